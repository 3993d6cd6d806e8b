//! Tests and jumps that depend on them, other than by the order of numbers; loop instructions.

use cranelift_codegen::ir::condcodes::IntCC;
use cranelift_codegen::ir::{InstBuilder, Value as Ssa};
use esl_bytecode::opcode::TypeCode;
use esl_heap::Value;

use crate::emit::WORD;
use crate::flow::FlowStep;
use crate::kinds::Known;
use crate::translate::Translator;

impl Translator<'_, '_> {
    pub(crate) fn jump_if(&mut self, test: Ssa, step: &FlowStep) {
        let (target, next) = (self.target(step), self.block());
        self.branch(test, target, next);
        self.go_to(next);
    }

    pub(crate) fn jump_unless(&mut self, test: Ssa, step: &FlowStep) {
        let (target, next) = (self.target(step), self.block());
        self.branch(test, next, target);
        self.go_to(next);
    }

    pub(crate) fn jump_if_is(&mut self, register: u8, value: Value, step: &FlowStep) {
        let found = self.get(register);
        let test = self.equals(found, value.bits());
        self.jump_if(test, step);
    }

    pub(crate) fn jump_if_is_not(&mut self, register: u8, value: Value, step: &FlowStep) {
        let found = self.get(register);
        let test = self.equals(found, value.bits());
        self.jump_unless(test, step);
    }

    pub(crate) fn jump_eql(&mut self, x: Ssa, y: Ssa, jumps_when: bool, step: &FlowStep) {
        let (target, next, slow) = (self.target(step), self.block(), self.cold_block());
        let (equal, unequal) = if jumps_when { (target, next) } else { (next, target) };
        let is_eq = self.b.ins().icmp(IntCC::Equal, x, y);
        self.refuse(is_eq, equal);
        let (x, y) = (self.is_object(x), self.is_object(y));
        let both = self.b.ins().band(x, y);
        self.branch(both, slow, unequal);
        self.go_to(slow);
        self.step_test(target, next);
        self.go_to(next);
    }

    /// Returns whether a register is of a type, if that is told by the word alone.
    pub(crate) fn type_test(&mut self, register: u8, code: u8) -> Option<Ssa> {
        let code = TypeCode::from_number(code)?;
        if !matches!(
            code,
            TypeCode::Cons
                | TypeCode::Atom
                | TypeCode::List
                | TypeCode::Null
                | TypeCode::Fixnum
                | TypeCode::Character
        ) {
            return None;
        }
        let value = self.get(register);
        Some(match code {
            TypeCode::Null => self.equals(value, Value::NIL.bits()),
            TypeCode::Fixnum => {
                let tag = self.b.ins().band_imm_s(value, 3);
                self.equals(tag, 0)
            }
            TypeCode::Character => self.is_character(value),
            code => {
                let is_cons = self.is_cons(value);
                let is_nil = self.equals(value, Value::NIL.bits());
                match code {
                    TypeCode::Cons => is_cons,
                    TypeCode::Atom => self.b.ins().icmp_imm_s(IntCC::Equal, is_cons, 0),
                    _ => self.b.ins().bor(is_cons, is_nil),
                }
            }
        })
    }

    pub(crate) fn loop_if(&mut self, test: Ssa, step: &FlowStep) {
        let (jumps, next) = (self.block(), self.block());
        self.branch(test, jumps, next);
        self.go_to(jumps);
        self.tick();
        let target = self.target(step);
        self.jump(target);
        self.go_to(next);
    }

    pub(crate) fn loop_count(&mut self, counter: u8, limit: u8, by: i32, step: &FlowStep) {
        if self.known[usize::from(counter)] == Known::Double {
            self.spill();
        }
        let (x, y) = (self.operand(counter), self.operand(limit));
        if x.1 == Known::Fixnum {
            // The counter stays a fixnum: what would make it something else leaves the machine code.
            let exit = self.exit();
            if let Some(test) = self.not_fixnums(x, y) {
                self.refuse(test, exit);
            }
            let (sum, overflow) = self.add_constant(x.0, by);
            self.refuse(overflow, exit);
            self.tick();
            self.set(counter, sum, Known::Fixnum);
            let is_less = self.b.ins().icmp(IntCC::SignedLessThan, sum, y.0);
            return self.jump_if(is_less, step);
        }
        self.tick();
        self.known[usize::from(counter)] = Known::Nothing;
        let (target, next, slow) = (self.target(step), self.block(), self.cold_block());
        if let Some(test) = self.not_fixnums(x, y) {
            self.refuse(test, slow);
        }
        let (sum, overflow) = self.add_constant(x.0, by);
        self.refuse(overflow, slow);
        let (jump, fall) = (self.block_with_value(), self.block_with_value());
        let is_less = self.b.ins().icmp(IntCC::SignedLessThan, sum, y.0);
        self.b.ins().brif(is_less, jump.0, &[sum.into()], fall.0, &[sum.into()]);
        self.go_to(slow);
        let (again, last) = (self.cold_block(), self.cold_block());
        self.step_test(again, last);
        for (from, to) in [(again, jump.0), (last, fall.0)] {
            self.go_to(from);
            let base = self.base;
            let value = self.load(base, i32::from(counter) * WORD);
            self.jump_with(to, value);
        }
        self.go_to(jump.0);
        self.set(counter, jump.1, Known::Nothing);
        self.jump(target);
        self.go_to(fall.0);
        self.set(counter, fall.1, Known::Nothing);
        self.jump(next);
        self.go_to(next);
    }
}
