//! Variables: reading, setting and binding them.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Index, Int16, Reg};
use esl_bytecode::symbol::Symbol;

use super::builder::{Excess, Extent, FunctionBuilder};
use super::dest::Dest;
use super::scopes::VariableScope;
use crate::core::*;
use crate::resolve::Lexical;

/// Location of a variable, as seen from the running code.
#[derive(Clone, Copy, Debug)]
pub(super) enum VariableLocation {
    /// A register.
    Register(Reg),
    /// The box in a register.
    Box(Reg),
    /// A capture.
    Capture(Index),
    /// The box in a capture.
    CaptureBox(Index),
    /// A place in the vector of variables that find no room in the registers.
    Spilled(Int16),
}

/// The registers and spilled places in use outside a form that binds variables.
#[derive(Clone, Copy, Debug)]
pub(super) struct OuterScope {
    top: Reg,
    spilled: i16,
    variables: VariableScope,
}

impl<'a> FunctionBuilder<'_, 'a> {
    /// Returns the register of a variable that this frame owns.
    pub(super) fn register(&self, variable: VarId) -> Reg {
        self.module.variables[variable.index()]
    }

    /// Returns the index of a capture of this frame.
    pub(super) fn capture_index(&mut self, lexical: Lexical) -> Index {
        let index = self.module.resolution.capture_index(self.lambda, lexical);
        let Some(index) = index else { unreachable!("variables of other frames are captured") };
        if index > usize::from(u8::MAX) {
            self.excess = Some(Excess::Captures);
        }
        Index(index.min(255) as u8)
    }

    /// Returns the location of a variable, or of the closure of a local function.
    pub(super) fn location(&mut self, variable: VarId) -> VariableLocation {
        let resolution = &self.module.resolution;
        let is_boxed = resolution.is_boxed(variable);
        if resolution.frame(self.core.variables[variable.index()].owner) == self.lambda {
            if let Some(place) = self.spilled(variable) {
                return VariableLocation::Spilled(place);
            }
            let register = self.register(variable);
            return if is_boxed {
                VariableLocation::Box(register)
            } else {
                VariableLocation::Register(register)
            };
        }
        let index = self.capture_index(Lexical::Variable(variable));
        if is_boxed { VariableLocation::CaptureBox(index) } else { VariableLocation::Capture(index) }
    }

    /// Reads a local variable.
    pub(super) fn local(&mut self, variable: VarId, dest: Dest) {
        if let Some(lambda) = self.module.resolution.function(variable) {
            return self.function_value(variable, lambda, dest);
        }
        if let Some(value) = self.substitutes.get(&variable) {
            return self.single(*value, dest);
        }
        let location = self.location(variable);
        self.fetch(location, dest);
    }

    /// Delivers the value at a location.
    pub(super) fn fetch(&mut self, location: VariableLocation, dest: Dest) {
        if let Dest::Effect = dest {
            return;
        }
        match location {
            VariableLocation::Register(register) => self.deliver(register, dest),
            VariableLocation::Box(register) => {
                self.compute(dest, |dst| Instr::BoxRef { dst, cell: register })
            }
            VariableLocation::Capture(index) => self.compute(dest, |dst| Instr::CaptureRef { dst, index }),
            VariableLocation::CaptureBox(index) => {
                self.compute(dest, |dst| Instr::CaptureBoxRef { dst, index })
            }
            VariableLocation::Spilled(place) => {
                let target = self.target(dest);
                self.load_spilled(place, target);
                self.deliver(target, dest);
            }
        }
    }

    /// Sets a local variable.
    pub(super) fn set_local(&mut self, variable: VarId, value: NodeId, dest: Dest) {
        match self.location(variable) {
            VariableLocation::Register(register) => {
                self.form(value, Dest::Keep(register));
                self.deliver(register, dest);
            }
            location => {
                let top = self.registers.top();
                let src = self.operand(value, &[]);
                match location {
                    VariableLocation::Box(register) => self.emit(Instr::BoxSet { cell: register, src }),
                    VariableLocation::CaptureBox(index) => self.emit(Instr::CaptureBoxSet { src, index }),
                    VariableLocation::Spilled(place) => self.store_spilled(place, src),
                    _ => unreachable!("a variable that is captured and assigned lives in a box"),
                }
                self.deliver(src, dest);
                self.registers.release(top);
            }
        }
    }

    /// Returns a register that holds the value of `node` until the forms `later` have been evaluated. May
    /// take a register.
    pub(super) fn operand(&mut self, node: NodeId, later: &[NodeId]) -> Reg {
        if let Some(register) = self.plain_variable(node, later).or_else(|| self.loaded_literal(node)) {
            return register;
        }
        let register = self.registers.top();
        self.form(node, Dest::Fresh(register));
        self.registers.take(1)
    }

    /// Returns the register of the variable that `node` reads, if it keeps its value while the forms `later`
    /// are evaluated.
    fn plain_variable(&mut self, node: NodeId, later: &[NodeId]) -> Option<Reg> {
        let NodeKind::Local(variable) = self.core.nodes[node.index()].kind else { return None };
        if !self.keeps_its_value(variable, later) {
            return None;
        }
        match self.location(variable) {
            VariableLocation::Register(register) => Some(register),
            _ => None,
        }
    }

    /// Whether `variable` has a location, and keeps its value while the forms `later` are evaluated.
    pub(super) fn keeps_its_value(&self, variable: VarId, later: &[NodeId]) -> bool {
        let resolution = &self.module.resolution;
        resolution.function(variable).is_none()
            && !resolution.is_set_in(variable, later)
            && !self.substitutes.contains_key(&variable)
    }

    /// Reads a special variable.
    pub(super) fn special(&mut self, symbol: &Symbol, dest: Dest) {
        let symbol = self.symbol_index(symbol);
        self.compute(dest, |dst| Instr::SymbolValue { dst, symbol });
    }

    /// Sets a special variable.
    pub(super) fn set_special(&mut self, symbol: &Symbol, value: NodeId, dest: Dest) {
        let top = self.registers.top();
        let src = self.operand(value, &[]);
        let symbol = self.symbol_index(symbol);
        self.emit(Instr::SetSymbolValue { src, symbol });
        self.deliver(src, dest);
        self.registers.release(top);
    }

    /// Binds variables around a body.
    pub(super) fn let_form(
        &mut self,
        sequential: bool,
        bindings: &'a [(BoundVariable, NodeId)],
        body: NodeId,
        dest: Dest,
    ) {
        if self.parallel_assignment(bindings, body, dest) {
            return;
        }
        let scope = self.begin_scope();
        let depth = self.extents.len();
        // Special bindings of a parallel `let` are made once all values are computed.
        let mut waiting: Vec<(&Symbol, Reg)> = Vec::new();
        for (index, (target, value)) in bindings.iter().enumerate() {
            // The form that is evaluated right after this value.
            let next = match bindings.get(index + 1) {
                None if waiting.is_empty() => Some(body),
                Some((_, next)) if sequential => Some(*next),
                _ => None,
            };
            match target {
                BoundVariable::Lexical(variable)
                    if next.is_some_and(|next| self.is_used_at_once(*variable, next)) =>
                {
                    self.substitutes.insert(*variable, *value);
                }
                BoundVariable::Lexical(variable) => self.bind_lexical(*variable, *value),
                BoundVariable::Special(symbol) => {
                    let temporary = self.registers.top();
                    if sequential {
                        let src = self.operand(*value, &[]);
                        self.bind_special(symbol, src);
                        self.registers.release(temporary);
                    } else {
                        self.form(*value, Dest::Fresh(temporary));
                        waiting.push((symbol, self.registers.take(1)));
                    }
                }
            }
        }
        for (symbol, register) in waiting {
            self.bind_special(symbol, register);
        }
        self.form_inside(body, dest, depth);
        self.end_scope(scope);
    }

    /// Returns what is in use before variables are bound, for [`FunctionBuilder::end_scope`].
    pub(super) fn begin_scope(&self) -> OuterScope {
        let variables = self.graph.scopes.current;
        OuterScope { top: self.registers.top(), spilled: self.spill_height(), variables }
    }

    /// Gives back what was taken for variables since `scope` began.
    pub(super) fn end_scope(&mut self, scope: OuterScope) {
        self.registers.release(scope.top);
        self.release_spilled(scope.spilled);
        self.graph.scopes.current = scope.variables;
    }

    /// Binds a lexical variable to the value of a form.
    pub(super) fn bind_lexical(&mut self, variable: VarId, value: NodeId) {
        if !self.module.resolution.is_used(variable) {
            return self.form(value, Dest::Effect);
        }
        if let Some(register) = self.alias(variable, value) {
            self.module.variables[variable.index()] = register;
            self.graph.scopes.add(variable, register);
            return;
        }
        let register = self.registers.top();
        self.form(value, Dest::Fresh(register));
        if !self.spill_variable(variable) {
            self.module.variables[variable.index()] = self.registers.take(1);
            self.graph.scopes.add(variable, register);
            self.box_variable(variable);
        }
    }

    /// Whether `next` begins with reading `variable`, and nothing else refers to it. The value may then be
    /// computed there.
    fn is_used_at_once(&self, variable: VarId, next: NodeId) -> bool {
        let resolution = &self.module.resolution;
        if resolution.is_assigned(variable)
            || resolution.is_captured(variable)
            || resolution.reads_of(variable) != 1
        {
            return false;
        }
        let mut node = next;
        // Deeper first forms are too rare to matter.
        for _ in 0..8 {
            node = match &self.core.nodes[node.index()].kind {
                NodeKind::Local(read) => return *read == variable,
                NodeKind::SetLocal(_, value)
                | NodeKind::SetSpecial(_, value)
                | NodeKind::If(value, _, _)
                | NodeKind::ReturnFrom(_, value)
                | NodeKind::BindValues(_, value, _)
                | NodeKind::FirstValues(value, _)
                | NodeKind::Slot(_, _, value)
                | NodeKind::SetSlot(_, _, value, _)
                | NodeKind::IsInstance(_, value)
                | NodeKind::Catch(value, _)
                | NodeKind::Throw(value, _)
                | NodeKind::Call(Callee::Value(value), _) => *value,
                NodeKind::Progn(forms)
                | NodeKind::And(forms)
                | NodeKind::Or(forms)
                | NodeKind::Values(forms) => match forms.first() {
                    Some(first) => *first,
                    None => return false,
                },
                NodeKind::Call(Callee::Global(_) | Callee::Builtin(_), arguments) => {
                    match arguments.first() {
                        Some(first) => *first,
                        None => return false,
                    }
                }
                NodeKind::Let { bindings, body, .. } => bindings.first().map_or(*body, |(_, value)| *value),
                _ => return false,
            };
        }
        false
    }

    /// Returns the register of another variable that `variable` can share, since neither ever changes.
    fn alias(&mut self, variable: VarId, value: NodeId) -> Option<Reg> {
        let NodeKind::Local(other) = self.core.nodes[value.index()].kind else { return None };
        let resolution = &self.module.resolution;
        if resolution.is_assigned(variable) || resolution.is_assigned(other) {
            return None;
        }
        let register = self.plain_variable(value, &[])?;
        // Jumps for self calls assign parameters, and must know which variables read them.
        self.sharers.entry(register).or_default().push(variable);
        Some(register)
    }

    /// Moves a variable that has its value into a box, if it lives in one.
    pub(super) fn box_variable(&mut self, variable: VarId) {
        if self.module.resolution.is_boxed(variable) {
            let register = self.register(variable);
            self.emit(Instr::MakeBox { dst: register.into(), src: register });
        }
    }

    /// Binds a special variable to the value in a register.
    pub(super) fn bind_special(&mut self, symbol: &Symbol, register: Reg) {
        let symbol = self.symbol_index(symbol);
        self.emit(Instr::Bind { src: register, symbol });
        self.open(Extent::Binding);
    }
}
