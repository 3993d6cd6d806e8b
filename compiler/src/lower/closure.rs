//! Functions as values, and local functions.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Capture, CaptureSource};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::*;
use esl_bytecode::symbol::Symbol;

use super::builder::{Excess, FunctionBuilder};
use super::dest::Dest;
use crate::core::*;
use crate::resolve::{FunctionKind, Lexical};

impl<'a> FunctionBuilder<'_, 'a> {
    /// Reads the global function kept in a symbol.
    pub(super) fn function_ref(&mut self, symbol: &Symbol, dest: Dest) {
        let symbol = self.symbol_index(symbol);
        self.compute(dest, |dst| Instr::FunctionRef { dst, symbol });
    }

    /// Reads a builtin as a function.
    pub(super) fn builtin_ref(&mut self, builtin: Builtin, dest: Dest) {
        self.function_ref(&builtin.symbol(), dest);
    }

    /// Makes the closure of a lambda that is written here.
    pub(super) fn lambda(&mut self, lambda: LambdaId, dest: Dest) {
        if let Dest::Effect = dest {
            return;
        }
        if self.module.resolution.captures(lambda).is_empty() {
            return self.constant_function(lambda, dest);
        }
        let top = self.registers.top();
        self.set_captures(lambda, &[]);
        self.registers.release(top);
        let function = self.function_index(lambda);
        self.compute(dest, |dst| Instr::MakeClosure { dst, function });
    }

    /// Reads a function that captures nothing.
    pub(super) fn constant_function(&mut self, lambda: LambdaId, dest: Dest) {
        let constant = ConstIdx(self.function_index(lambda).0);
        self.compute(dest, |dst| Instr::LoadConst { dst, constant });
    }

    fn function_index(&mut self, lambda: LambdaId) -> FunctionIdx {
        let number = self.module.number(lambda);
        let entry = self.module.pool.function(number);
        FunctionIdx(self.constant_index(entry))
    }

    /// Reads a local function as a value.
    pub(super) fn function_value(&mut self, variable: VarId, lambda: LambdaId, dest: Dest) {
        if let Dest::Effect = dest {
            return;
        }
        match self.module.resolution.function_kind(lambda) {
            FunctionKind::Closure => {
                let location = self.location(variable);
                self.fetch(location, dest);
            }
            _ => self.constant_function(lambda, dest),
        }
    }

    /// Notes the sources of the captures of a lambda whose closure is made here. Returns the captures that
    /// are among `unmade`, local functions whose closures do not exist yet. Takes registers for variables
    /// without one.
    fn set_captures(&mut self, lambda: LambdaId, unmade: &[VarId]) -> Vec<(Index, VarId)> {
        let core = self.core;
        let mut late = Vec::new();
        let mut captures = Vec::new();
        for index in 0..self.module.resolution.captures(lambda).len() {
            let resolution = &self.module.resolution;
            let lexical = resolution.captures(lambda)[index];
            let is_own = resolution.frame(lexical.owner(core)) == self.lambda;
            let boxed = matches!(lexical, Lexical::Variable(variable) if resolution.is_boxed(variable));
            let source = match lexical {
                Lexical::Variable(variable) if unmade.contains(&variable) => {
                    late.push((Index(index.min(255) as u8), variable));
                    CaptureSource::Later
                }
                _ if !is_own => CaptureSource::Capture(self.capture_index(lexical).0),
                Lexical::Variable(variable) => CaptureSource::Register(match self.spilled(variable) {
                    Some(place) => {
                        let register = self.registers.take(1);
                        self.load_spilled(place, register);
                        register.0
                    }
                    None => self.register(variable).0,
                }),
                Lexical::Block(block) => CaptureSource::Register(self.module.blocks[block.index()].0),
                Lexical::Tagbody(tagbody) => {
                    CaptureSource::Register(self.module.tagbodies[tagbody.index()].0)
                }
            };
            captures.push(Capture { source, boxed });
        }
        if captures.len() > usize::from(u8::MAX) {
            self.excess = Some(Excess::Captures);
        }
        self.module.captures[lambda.index()] = captures;
        late
    }

    /// Binds local functions around a body. Constants and inlined functions need no code here.
    pub(super) fn functions(&mut self, definitions: &[(VarId, LambdaId)], body: NodeId, dest: Dest) {
        let top = self.registers.top();
        let resolution = &self.module.resolution;
        let closures = definitions
            .iter()
            .filter(|(_, lambda)| resolution.function_kind(*lambda) == FunctionKind::Closure);
        let closures: Vec<(VarId, LambdaId)> = closures.copied().collect();
        let mut unmade: Vec<VarId> = closures.iter().map(|&(variable, _)| variable).collect();
        unmade.reverse();
        let mut patches: Vec<(Reg, Index, VarId)> = Vec::new();
        for &(variable, lambda) in &closures {
            let late = self.set_captures(lambda, &unmade);
            let function = self.function_index(lambda);
            let register = self.registers.take(1);
            self.module.variables[variable.index()] = register;
            self.emit(Instr::MakeClosure { dst: register.into(), function });
            patches.extend(late.into_iter().map(|(index, captured)| (register, index, captured)));
            unmade.pop();
        }
        for (closure, index, captured) in patches {
            let src = self.register(captured);
            self.emit(Instr::PatchCapture { closure, index, src });
        }
        self.form(body, dest);
        self.registers.release(top);
    }
}
