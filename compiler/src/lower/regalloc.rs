//! Registers of a frame, handed out as a stack: variables and temporaries in the order in which they come to life.
//!
//! Invariant: at each point of the code, registers below `top` are in use and those from `top` on are free.

use esl_bytecode::module::MAX_REGISTERS;

/// The register stack of the function that is being lowered.
#[derive(Debug, Default)]
pub(crate) struct Registers {
    top: u8,
    used: u8,
    overflow: bool,
}

impl Registers {
    /// The first free register.
    pub(crate) fn top(&self) -> u8 {
        self.top
    }

    /// Takes the next `count` registers, and returns the first.
    pub(crate) fn take(&mut self, count: usize) -> u8 {
        let first = self.top;
        self.reserve(first, count);
        self.top = (usize::from(first) + count).min(usize::from(MAX_REGISTERS)) as u8;
        first
    }

    /// Frees the registers from `top` on.
    pub(crate) fn release(&mut self, top: u8) {
        debug_assert!(top <= self.top, "registers are freed in the reverse order of taking them");
        self.top = top;
    }

    /// Makes sure that the frame has the registers `first`, … `first + count - 1`.
    pub(crate) fn reserve(&mut self, first: u8, count: usize) {
        let end = usize::from(first) + count;
        if end > usize::from(MAX_REGISTERS) {
            self.overflow = true;
        }
        self.used = self.used.max(end.min(usize::from(MAX_REGISTERS)) as u8);
    }

    /// The size of the frame.
    pub(crate) fn used(&self) -> u8 {
        self.used
    }

    /// Whether more registers were taken than a frame can have. The numbers handed out since then are wrong.
    pub(crate) fn overflow(&self) -> bool {
        self.overflow
    }
}
