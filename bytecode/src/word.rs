//! The instruction word and its operands by position, for code that reads an instruction without decoding it.

use crate::opcode::Opcode;

/// An instruction word: the opcode, and operands by the bits that they occupy.
///
/// ```text
/// bits   0–7      8–15   16–23   24–31
///        opcode   a      b       c
///        opcode   a      d
///        opcode   e
/// ```
///
/// The signed readings are for operands such as [`Int8`](crate::operand::Int8) and
/// [`Jump16`](crate::operand::Jump16).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct Word(pub u32);

impl Word {
    /// Returns the opcode's number, which may be one of the virtual machine's own.
    #[inline(always)]
    pub const fn number(self) -> u8 {
        self.0 as u8
    }

    /// Returns the opcode, or `None` if the table has none with this number.
    #[inline(always)]
    pub fn opcode(self) -> Option<Opcode> {
        Opcode::from_number(self.number())
    }

    /// Returns the operand in bits 8 to 15.
    #[inline(always)]
    pub const fn a(self) -> usize {
        (self.0 >> 8 & 0xff) as usize
    }

    /// Returns the operand in bits 16 to 23.
    #[inline(always)]
    pub const fn b(self) -> usize {
        (self.0 >> 16 & 0xff) as usize
    }

    /// Returns the operand in bits 24 to 31.
    #[inline(always)]
    pub const fn c(self) -> usize {
        (self.0 >> 24) as usize
    }

    /// Returns the operand in bits 16 to 31.
    #[inline(always)]
    pub const fn d(self) -> usize {
        (self.0 >> 16) as usize
    }

    /// Returns the operand in bits 24 to 31, with its sign.
    #[inline(always)]
    pub const fn signed_c(self) -> i32 {
        self.0 as i32 >> 24
    }

    /// Returns the operand in bits 16 to 31, with its sign.
    #[inline(always)]
    pub const fn signed_d(self) -> i32 {
        self.0 as i32 >> 16
    }

    /// Returns the operand in bits 8 to 31, with its sign.
    #[inline(always)]
    pub const fn signed_e(self) -> i32 {
        self.0 as i32 >> 8
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::opcode::Instr;
    use crate::operand::*;

    fn word(instr: Instr) -> Word {
        Word(instr.encode().0)
    }

    #[test]
    fn positions_are_those_of_the_encoder() {
        let add = word(Instr::Add { dst: Dst(1), left: Reg(2), right: Reg(250) });
        assert_eq!((add.opcode(), add.a(), add.b(), add.c()), (Some(Opcode::Add), 1, 2, 250));
        let constant = word(Instr::LoadConst { dst: Dst(7), constant: ConstIdx(0xfedc) });
        assert_eq!((constant.a(), constant.d()), (7, 0xfedc));
        let step = word(Instr::AddInt { dst: Dst(0), left: Reg(0), value: Int8(-3) });
        assert_eq!(step.signed_c(), -3);
        let jump = word(Instr::LoopIfNil { test: Reg(0), to: Back16(-300) });
        assert_eq!(jump.signed_d(), -300);
        assert_eq!(word(Instr::Loop { to: Back24(-70_000) }).signed_e(), -70_000);
    }
}
