//! Variables: reading, setting and binding them.

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Dst, Index, Int16, Reg};
use esl_bytecode::symbol::Symbol;

use super::dest::Dest;
use super::frame::{Extent, Frame};
use crate::core::*;
use crate::resolve::Lexical;

/// Where a variable is found from the running code.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    /// In a register.
    Register(u8),
    /// In the box in a register.
    Box(u8),
    /// Among the captures.
    Capture(Index),
    /// In a box among the captures.
    CaptureBox(Index),
    /// In the vector of variables that find no room in registers.
    Spilled(Int16),
}

impl<'a> Frame<'_, 'a> {
    /// The register of a variable that this frame owns.
    pub(super) fn register(&self, variable: VarId) -> u8 {
        self.builder.variables[variable.index()]
    }

    /// The number of a capture of this frame.
    pub(super) fn capture_index(&mut self, lexical: Lexical) -> Index {
        let index = self.builder.resolution.capture_index(self.lambda, lexical);
        let Some(index) = index else { unreachable!("what is owned by another frame is captured") };
        if index > usize::from(u8::MAX) {
            self.excess = Some("captured variables");
        }
        Index(index.min(255) as u8)
    }

    /// Where to find a variable, or the closure of a local function.
    pub(super) fn place(&mut self, variable: VarId) -> Place {
        let resolution = &self.builder.resolution;
        let is_boxed = resolution.is_boxed(variable);
        if resolution.frame(self.core.variables[variable.index()].owner) == self.lambda {
            if let Some(place) = self.spilled(variable) {
                return Place::Spilled(place);
            }
            let register = self.register(variable);
            return if is_boxed { Place::Box(register) } else { Place::Register(register) };
        }
        let index = self.capture_index(Lexical::Variable(variable));
        if is_boxed { Place::CaptureBox(index) } else { Place::Capture(index) }
    }

    pub(super) fn local(&mut self, variable: VarId, dest: Dest) {
        if let Some(lambda) = self.builder.resolution.function(variable) {
            return self.function_value(variable, lambda, dest);
        }
        if let Some(value) = self.substitutes.get(&variable) {
            return self.single(*value, dest);
        }
        let place = self.place(variable);
        self.fetch(place, dest);
    }

    /// Passes on what is in a place.
    pub(super) fn fetch(&mut self, place: Place, dest: Dest) {
        if let Dest::Effect = dest {
            return;
        }
        match place {
            Place::Register(register) => self.deliver(register, dest),
            Place::Box(register) => self.compute(dest, |dst| Instr::BoxRef { dst, cell: Reg(register) }),
            Place::Capture(index) => self.compute(dest, |dst| Instr::CaptureRef { dst, index }),
            Place::CaptureBox(index) => self.compute(dest, |dst| Instr::CaptureBoxRef { dst, index }),
            Place::Spilled(place) => {
                let target = self.target(dest);
                self.load_spilled(place, target);
                self.deliver(target, dest);
            }
        }
    }

    pub(super) fn set_local(&mut self, variable: VarId, value: NodeId, dest: Dest) {
        match self.place(variable) {
            Place::Register(register) => {
                self.form(value, Dest::Keep(register));
                self.deliver(register, dest);
            }
            place => {
                let top = self.registers.top();
                let src = self.operand(value, &[]);
                match place {
                    Place::Box(register) => self.emit(Instr::BoxSet { cell: Reg(register), src }),
                    Place::CaptureBox(index) => self.emit(Instr::CaptureBoxSet { src, index }),
                    Place::Spilled(place) => self.store_spilled(place, src),
                    _ => unreachable!("a variable that is captured and assigned lives in a box"),
                }
                self.deliver(src.0, dest);
                self.registers.release(top);
            }
        }
    }

    /// A register that holds the value of `node` until the forms `later` have been evaluated. May take a register.
    pub(super) fn operand(&mut self, node: NodeId, later: &[NodeId]) -> Reg {
        if let Some(register) = self.plain_variable(node, later).or_else(|| self.loaded_literal(node)) {
            return Reg(register);
        }
        let register = self.registers.top();
        self.form(node, Dest::Fresh(register));
        Reg(self.registers.take(1))
    }

    /// The register of the variable that `node` reads, if it keeps its value while the forms `later` are evaluated.
    pub(super) fn plain_variable(&mut self, node: NodeId, later: &[NodeId]) -> Option<u8> {
        let NodeKind::Local(variable) = self.core.nodes[node.index()].kind else { return None };
        if !self.keeps_its_value(variable, later) {
            return None;
        }
        match self.place(variable) {
            Place::Register(register) => Some(register),
            _ => None,
        }
    }

    /// Whether `variable` has a place, and holds the same while the forms `later` are evaluated.
    pub(super) fn keeps_its_value(&self, variable: VarId, later: &[NodeId]) -> bool {
        let resolution = &self.builder.resolution;
        resolution.function(variable).is_none()
            && !resolution.is_set_in(variable, later)
            && !self.substitutes.contains_key(&variable)
    }

    pub(super) fn special(&mut self, symbol: &Symbol, dest: Dest) {
        let symbol = self.symbol_index(symbol);
        self.compute(dest, |dst| Instr::SymbolValue { dst, symbol });
    }

    pub(super) fn set_special(&mut self, symbol: &Symbol, value: NodeId, dest: Dest) {
        let top = self.registers.top();
        let src = self.operand(value, &[]);
        let symbol = self.symbol_index(symbol);
        self.emit(Instr::SetSymbolValue { src, symbol });
        self.deliver(src.0, dest);
        self.registers.release(top);
    }

    pub(super) fn let_form(
        &mut self,
        sequential: bool,
        bindings: &'a [(Target, NodeId)],
        body: NodeId,
        dest: Dest,
    ) {
        if self.parallel_assignment(bindings, body, dest) {
            return;
        }
        let (top, spilled) = (self.registers.top(), self.spill_height());
        let depth = self.extents.len();
        // Special bindings of a parallel `let` are made when all values are there.
        let mut waiting: Vec<(&Symbol, u8)> = Vec::new();
        for (index, (target, value)) in bindings.iter().enumerate() {
            // What is evaluated right after this value.
            let next = match bindings.get(index + 1) {
                None if waiting.is_empty() => Some(body),
                Some((_, next)) if sequential => Some(*next),
                _ => None,
            };
            match target {
                Target::Lexical(variable)
                    if next.is_some_and(|next| self.is_used_at_once(*variable, next)) =>
                {
                    self.substitutes.insert(*variable, *value);
                }
                Target::Lexical(variable) => self.bind_lexical(*variable, *value),
                Target::Special(symbol) => {
                    let temporary = self.registers.top();
                    if sequential {
                        let src = self.operand(*value, &[]);
                        self.bind_special(symbol, src.0);
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
        self.registers.release(top);
        self.release_spilled(spilled);
    }

    /// Binds a lexical variable to the value of a form.
    pub(super) fn bind_lexical(&mut self, variable: VarId, value: NodeId) {
        if !self.builder.resolution.is_used(variable) {
            return self.form(value, Dest::Effect);
        }
        if let Some(register) = self.alias(variable, value) {
            self.builder.variables[variable.index()] = register;
            return;
        }
        let register = self.registers.top();
        self.form(value, Dest::Fresh(register));
        if !self.spill_variable(variable) {
            self.builder.variables[variable.index()] = self.registers.take(1);
            self.box_variable(variable);
        }
    }

    /// Whether the first thing that `next` does is to read `variable`, which nothing else refers to: then the value
    /// may as well be computed there.
    fn is_used_at_once(&self, variable: VarId, next: NodeId) -> bool {
        let resolution = &self.builder.resolution;
        if resolution.is_assigned(variable)
            || resolution.is_captured(variable)
            || resolution.reads_of(variable) != 1
        {
            return false;
        }
        let mut node = next;
        // So far down is far enough.
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

    /// The register of another variable that `variable` can share, since neither ever changes.
    fn alias(&mut self, variable: VarId, value: NodeId) -> Option<u8> {
        let NodeKind::Local(other) = self.core.nodes[value.index()].kind else { return None };
        let resolution = &self.builder.resolution;
        if resolution.is_assigned(variable) || resolution.is_assigned(other) {
            return None;
        }
        let register = self.plain_variable(value, &[])?;
        // Parameters are assigned by jumps for self calls, which must know who reads them.
        self.sharers.entry(register).or_default().push(variable);
        Some(register)
    }

    /// Moves a variable that has just got its value into a box, if it lives in one.
    pub(super) fn box_variable(&mut self, variable: VarId) {
        if self.builder.resolution.is_boxed(variable) {
            let register = self.register(variable);
            self.emit(Instr::MakeBox { dst: Dst(register), src: Reg(register) });
        }
    }

    pub(super) fn bind_special(&mut self, symbol: &Symbol, register: u8) {
        let symbol = self.symbol_index(symbol);
        self.emit(Instr::Bind { src: Reg(register), symbol });
        self.open(Extent::Binding);
    }
}
