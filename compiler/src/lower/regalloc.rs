//! Registers of a function, handed out as a stack: variables and temporaries in the order in which they come
//! to life.
//!
//! Invariant: at each point of the code, the registers below `top` are in use and those from `top` on are
//! free.

use esl_bytecode::module::MAX_REGISTERS;
use esl_bytecode::operand::Reg;

/// The register stack of the function that is being lowered.
#[derive(Debug)]
pub(super) struct RegisterStack {
    top: Reg,
    used: u8,
    has_overflowed: bool,
}

impl RegisterStack {
    /// Creates a stack without any register in use.
    pub(super) fn new() -> RegisterStack {
        RegisterStack { top: Reg(0), used: 0, has_overflowed: false }
    }

    /// Returns the first free register.
    pub(super) fn top(&self) -> Reg {
        self.top
    }

    /// Takes the next `count` registers and returns the first.
    pub(super) fn take(&mut self, count: usize) -> Reg {
        let first = self.top;
        self.reserve(first, count);
        self.top = Reg((usize::from(first.0) + count).min(usize::from(MAX_REGISTERS)) as u8);
        first
    }

    /// Frees the registers from `top` on.
    pub(super) fn release(&mut self, top: Reg) {
        debug_assert!(top <= self.top, "registers are freed in the reverse order of taking them");
        self.top = top;
    }

    /// Makes sure that the frame has the `count` registers from `first` on.
    pub(super) fn reserve(&mut self, first: Reg, count: usize) {
        let end = usize::from(first.0) + count;
        self.has_overflowed |= end > usize::from(MAX_REGISTERS);
        self.used = self.used.max(end.min(usize::from(MAX_REGISTERS)) as u8);
    }

    /// Returns how many registers have been taken since `first` was the first free one.
    pub(super) fn taken_since(&self, first: Reg) -> u8 {
        self.top.0.saturating_sub(first.0)
    }

    /// Returns the number of registers of the frame.
    pub(super) fn used(&self) -> u8 {
        self.used
    }

    /// Whether more registers were taken than a frame can have. Registers handed out since then are wrong.
    pub(super) fn has_overflowed(&self) -> bool {
        self.has_overflowed
    }
}
