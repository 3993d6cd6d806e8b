//! Quotients, bits and shifts of fixnums.

use cranelift_codegen::ir::InstBuilder;
use cranelift_codegen::ir::condcodes::IntCC;
use esl_bytecode::opcode::Instr;

use crate::arithmetic::of_both;
use crate::translate::Translator;

impl Translator<'_, '_> {
    /// Quotients and remainders of fixnums by one above zero.
    pub(crate) fn divide(&mut self, instr: &Instr, dst: u8, left: u8, right: u8) {
        let (x, y, slow) = (self.operand(left), self.operand(right), self.cold_block());
        if let Some(test) = self.not_fixnums(x, y) {
            self.refuse(test, slow);
        }
        let known = of_both(x.1, y.1);
        let (x, y) = (x.0, y.0);
        let is_above = self.b.ins().icmp_imm_s(IntCC::SignedGreaterThan, y, 0);
        self.require(is_above, slow);
        // Both are shifted by two, and so is the remainder.
        let result = match instr {
            Instr::Rem { .. } => self.b.ins().srem(x, y),
            Instr::Mod { .. } => {
                let remainder = self.b.ins().srem(x, y);
                let other = self.b.ins().iadd(remainder, y);
                let is_negative = self.b.ins().icmp_imm_s(IntCC::SignedLessThan, remainder, 0);
                self.b.ins().select(is_negative, other, remainder)
            }
            Instr::Floor { .. } => {
                let quotient = self.b.ins().sdiv(x, y);
                let product = self.b.ins().imul(quotient, y);
                let remainder = self.b.ins().isub(x, product);
                let below = self.b.ins().iadd_imm_s(quotient, -1);
                let is_negative = self.b.ins().icmp_imm_s(IntCC::SignedLessThan, remainder, 0);
                let quotient = self.b.ins().select(is_negative, below, quotient);
                self.b.ins().ishl_imm_s(quotient, 2)
            }
            _ => {
                let quotient = self.b.ins().sdiv(x, y);
                self.b.ins().ishl_imm_s(quotient, 2)
            }
        };
        self.finish_as(slow, result, dst, known);
    }

    pub(crate) fn bitwise(&mut self, instr: &Instr, dst: u8, left: u8, right: u8) {
        let (x, y, slow) = (self.operand(left), self.operand(right), self.cold_block());
        let test = self.not_fixnums(x, y);
        if let Some(test) = test {
            self.refuse(test, slow);
        }
        let result = match instr {
            Instr::LogAnd { .. } => self.b.ins().band(x.0, y.0),
            Instr::LogIor { .. } => self.b.ins().bor(x.0, y.0),
            _ => self.b.ins().bxor(x.0, y.0),
        };
        self.finish_as(slow, result, dst, of_both(x.1, y.1));
    }

    pub(crate) fn shift(&mut self, dst: u8, left: u8, right: u8) {
        let (x, y, slow) = (self.operand(left), self.operand(right), self.cold_block());
        let done = self.block_with_value();
        if let Some(test) = self.not_fixnums(x, y) {
            self.refuse(test, slow);
        }
        let (n, by) = (x.0, self.b.ins().sshr_imm_s(y.0, 2));
        let (up, down) = (self.block(), self.block());
        let is_up = self.b.ins().icmp_imm_s(IntCC::SignedGreaterThan, by, 0);
        self.branch(is_up, up, down);
        self.go_to(down);
        let most = self.word(63);
        let distance = self.b.ins().ineg(by);
        let distance = self.b.ins().smin(distance, most);
        let shifted = self.b.ins().sshr(n, distance);
        let shifted = self.b.ins().band_imm_s(shifted, !3);
        self.jump_with(done.0, shifted);
        self.go_to(up);
        let is_small = self.b.ins().icmp_imm_s(IntCC::SignedLessThan, by, 62);
        self.require(is_small, slow);
        let shifted = self.b.ins().ishl(n, by);
        let back = self.b.ins().sshr(shifted, by);
        let is_whole = self.b.ins().icmp(IntCC::Equal, back, n);
        self.require(is_whole, slow);
        self.jump_with(done.0, shifted);
        self.finish_value(slow, done, dst, of_both(x.1, y.1));
    }
}
