//! Which variables are in which registers, for debuggers.
//!
//! A scope is a list of variables with their registers, the innermost first, that shares its tail with the
//! scope around it. Each instruction and each exit of a segment knows the scope in which it was lowered;
//! [`ranges`] turns this into ranges of the finished code.
//!
//! A task stands only at instructions that can fail, call or loop, or to which a loop goes back. Only there
//! does the scope matter. In between, values are in transit: the window of a call may already overlap
//! variables that are not read any more.

use esl_bytecode::operand::Reg;

use crate::core::VarId;

/// A list of variables; 0 is the empty one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct VariableScope(u32);

#[derive(Clone, Copy, Debug)]
struct ScopeRow {
    outer: VariableScope,
    depth: u32,
    variable: VarId,
    register: Reg,
}

/// The scopes of a function.
#[derive(Debug, Default)]
pub(crate) struct VariableScopes {
    rows: Vec<ScopeRow>,
    /// The scope of the code that is being lowered.
    pub(crate) current: VariableScope,
}

impl VariableScopes {
    fn row(&self, VariableScope(number): VariableScope) -> Option<&ScopeRow> {
        self.rows.get((number as usize).checked_sub(1)?)
    }

    /// From now on `variable` has its value in `register`.
    pub(crate) fn add(&mut self, variable: VarId, register: Reg) {
        let outer = self.current;
        let depth = self.row(outer).map_or(0, |row| row.depth) + 1;
        self.rows.push(ScopeRow { outer, depth, variable, register });
        self.current = VariableScope(self.rows.len() as u32);
    }

    /// From now on `register` holds none of the variables.
    pub(crate) fn hide(&mut self, register: Reg) {
        let mut kept = Vec::new();
        let (mut scope, mut hidden) = (self.current, None);
        while let Some(&row) = self.row(scope) {
            if row.register == register {
                hidden = Some((row.outer, kept.len()));
            } else {
                kept.push(row);
            }
            scope = row.outer;
        }
        // Rows outside the outermost hidden one stay as they are.
        if let Some((outer, count)) = hidden {
            self.current = outer;
            for row in kept[..count].iter().rev() {
                self.add(row.variable, row.register);
            }
        }
    }
}

/// An instruction in its final place, as [`ranges`] needs it.
#[derive(Clone, Copy, Debug)]
pub(super) struct ScopedInstr {
    /// Its first word, and the one behind it.
    pub(super) words: (u32, u32),
    pub(super) scope: VariableScope,
    /// Whether a task can stand there.
    pub(super) is_stop: bool,
    /// First register of its window, over which a callee's frame lies, if it is a call.
    pub(super) window: Option<Reg>,
}

/// A variable, its register, and the words at which it is there.
pub(super) type RegisterRange = (VarId, Reg, u32, u32);

/// A variable of the current scope.
struct LiveVariable {
    row: ScopeRow,
    /// Since when a task can find it in its register, and up to where it has been so.
    seen: Option<(u32, u32)>,
    /// How many variables of inner scopes have its name.
    shadows: u32,
}

/// The walk over the code.
struct RangeWalk<'a, F> {
    scopes: &'a VariableScopes,
    have_one_name: F,
    /// Scope of the code that was walked over last.
    scope: VariableScope,
    /// Its variables, the innermost last.
    live: Vec<LiveVariable>,
    done: Vec<RegisterRange>,
}

/// Returns where variables are, by ascending first words. Where two are in scope that `have_one_name`, it is
/// the inner one.
pub(super) fn ranges(
    scopes: &VariableScopes,
    code: impl Iterator<Item = ScopedInstr>,
    have_one_name: impl Fn(VarId, VarId) -> bool,
) -> Vec<RegisterRange> {
    let (scope, live, done) = (VariableScope::default(), Vec::new(), Vec::new());
    let mut walk = RangeWalk { scopes, have_one_name, scope, live, done };
    for instr in code {
        walk.enter(instr.scope);
        if instr.is_stop {
            walk.stop(instr);
        }
    }
    walk.enter(VariableScope::default());
    let mut done = walk.done;
    done.sort_unstable_by_key(|&(variable, register, from, _)| (variable, register, from));
    done.dedup_by(|next, before| {
        let goes_on = (next.0, next.1, next.2) == (before.0, before.1, before.3);
        if goes_on {
            before.3 = next.3;
        }
        goes_on
    });
    done.sort_unstable_by_key(|&(_, register, from, _)| (from, register));
    done
}

impl<F: Fn(VarId, VarId) -> bool> RangeWalk<'_, F> {
    /// Goes to a scope.
    fn enter(&mut self, next: VariableScope) {
        let (mut from, mut to) = (self.scope, next);
        let mut entered: Vec<ScopeRow> = Vec::new();
        let depth = |scope| self.scopes.row(scope).map_or(0, |row| row.depth);
        while from != to {
            if depth(from) >= depth(to) {
                from = self.scopes.row(from).map_or_else(VariableScope::default, |row| row.outer);
                if let Some(mut left) = self.live.pop() {
                    left.end(&mut self.done);
                    for outer in &mut self.live {
                        outer.shadows -=
                            u32::from((self.have_one_name)(outer.row.variable, left.row.variable));
                    }
                }
            } else if let Some(&row) = self.scopes.row(to) {
                entered.push(row);
                to = row.outer;
            }
        }
        for row in entered.into_iter().rev() {
            for outer in &mut self.live {
                if (self.have_one_name)(outer.row.variable, row.variable) {
                    outer.end(&mut self.done);
                    outer.shadows += 1;
                }
            }
            self.live.push(LiveVariable { row, seen: None, shadows: 0 });
        }
        self.scope = next;
    }

    /// A task can stand at an instruction of the current scope.
    fn stop(&mut self, instr: ScopedInstr) {
        let (from, to) = instr.words;
        for variable in self.live.iter_mut().filter(|variable| variable.shadows == 0) {
            if instr.window.is_some_and(|window| variable.row.register >= window) {
                variable.end(&mut self.done);
            } else {
                variable.seen = Some((variable.seen.map_or(from, |(from, _)| from), to));
            }
        }
    }
}

impl LiveVariable {
    /// It is not found in its register any more.
    fn end(&mut self, done: &mut Vec<RegisterRange>) {
        if let Some((from, to)) = self.seen.take() {
            done.push((self.row.variable, self.row.register, from, to));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const X: VarId = VarId(0);
    const Y: VarId = VarId(1);

    fn instr(word: u32, scope: VariableScope, is_stop: bool, window: Option<u8>) -> ScopedInstr {
        ScopedInstr { words: (word, word + 1), scope, is_stop, window: window.map(Reg) }
    }

    /// Variables whose numbers have the same last digit have one name.
    fn found(scopes: &VariableScopes, code: &[ScopedInstr]) -> Vec<RegisterRange> {
        ranges(scopes, code.iter().copied(), |one, other| one.0 % 10 == other.0 % 10)
    }

    #[test]
    fn a_variable_is_there_from_stop_to_stop_of_its_scope() {
        let mut scopes = VariableScopes::default();
        let outside = scopes.current;
        scopes.add(X, Reg(3));
        let x = scopes.current;
        scopes.add(Y, Reg(4));
        let y = scopes.current;
        let code = [
            instr(0, outside, true, None),
            instr(1, x, false, None),
            instr(2, x, true, None),
            instr(3, y, false, None),
            instr(4, y, true, None),
            instr(5, x, true, None),
            instr(6, x, false, None),
            instr(7, outside, true, None),
        ];
        assert_eq!(found(&scopes, &code), [(X, Reg(3), 2, 6), (Y, Reg(4), 4, 5)]);
    }

    #[test]
    fn a_callee_lies_over_what_nobody_needs() {
        let mut scopes = VariableScopes::default();
        scopes.add(X, Reg(3));
        scopes.add(Y, Reg(4));
        let both = scopes.current;
        let code = [
            instr(0, both, true, None),
            instr(1, both, true, Some(4)),
            instr(2, both, false, None),
            instr(3, both, true, None),
        ];
        let expected = [(X, Reg(3), 0, 4), (Y, Reg(4), 0, 1), (Y, Reg(4), 3, 4)];
        assert_eq!(found(&scopes, &code), expected);
    }

    #[test]
    fn a_hidden_register_shows_none_of_its_variables() {
        let mut scopes = VariableScopes::default();
        scopes.add(X, Reg(0));
        scopes.add(Y, Reg(1));
        scopes.add(VarId(2), Reg(0));
        let before = scopes.current;
        scopes.hide(Reg(0));
        let code = [instr(0, before, true, None), instr(1, scopes.current, true, None)];
        let expected = [(X, Reg(0), 0, 1), (VarId(2), Reg(0), 0, 1), (Y, Reg(1), 0, 2)];
        assert_eq!(found(&scopes, &code), expected);
        let same = scopes.current;
        scopes.hide(Reg(9));
        assert_eq!(scopes.current, same);
    }

    #[test]
    fn an_inner_variable_hides_one_of_its_name() {
        let mut scopes = VariableScopes::default();
        scopes.add(X, Reg(0));
        let outer = scopes.current;
        scopes.add(VarId(10), Reg(1));
        let inner = scopes.current;
        let code = [
            instr(0, outer, true, None),
            instr(1, inner, true, None),
            instr(2, inner, true, Some(1)),
            instr(3, inner, true, None),
            instr(4, outer, true, None),
        ];
        let expected =
            [(X, Reg(0), 0, 1), (VarId(10), Reg(1), 1, 2), (VarId(10), Reg(1), 3, 4), (X, Reg(0), 4, 5)];
        assert_eq!(found(&scopes, &code), expected);
    }
}
