//! The interpreter's registers, while its loop is left.
//!
//! Invariant: `pc` is the address of an instruction of the function of the frame at `base`, or of a stub;
//! `base` lies in the running task's stack, which may be used up to `stack_end`. So to set one of them is
//! unsafe.

#![allow(unsafe_code)]

use crate::value::Value;

/// The registers of the interpreter.
pub(crate) struct Cpu {
    /// The next instruction, or the one that was given up.
    pc: *const u32,
    /// First register of the running frame.
    base: *mut Value,
    /// End of the running task's stack.
    stack_end: *mut Value,
    /// Whether the call of the builtin that runs wants its first value only.
    pub(crate) wants_one: bool,
    /// Ticks left until the next safepoint.
    pub(crate) ticks: i32,
    /// Ticks withheld so that the collector has its turn at the next tick.
    pub(crate) reserve: i32,
    /// Ticks of this slice that were given out at its beginning.
    pub(crate) granted: i32,
    /// Number of turns of the collector in this slice.
    pub(crate) collections: u32,
}

impl Cpu {
    /// Creates the registers of no task.
    pub(crate) const fn new() -> Cpu {
        Cpu {
            pc: std::ptr::null(),
            base: std::ptr::null_mut(),
            stack_end: std::ptr::null_mut(),
            wants_one: false,
            ticks: 0,
            reserve: 0,
            granted: 0,
            collections: 0,
        }
    }

    /// Creates the registers of a task at the beginning of a slice of so many ticks.
    ///
    /// # Safety
    /// The invariant of the module.
    #[inline(always)]
    pub(crate) const unsafe fn at(
        pc: *const u32,
        base: *mut Value,
        stack_end: *mut Value,
        ticks: i32,
    ) -> Cpu {
        Cpu { pc, base, stack_end, wants_one: false, ticks, reserve: 0, granted: ticks, collections: 0 }
    }

    /// Returns the address of the next instruction, or of the one that was given up.
    #[inline(always)]
    pub(crate) const fn pc(&self) -> *const u32 {
        self.pc
    }

    /// Returns the address of the first register of the running frame.
    #[inline(always)]
    pub(crate) const fn base(&self) -> *mut Value {
        self.base
    }

    /// Returns the end of the running task's stack.
    #[inline(always)]
    pub(crate) const fn stack_end(&self) -> *mut Value {
        self.stack_end
    }

    /// Sets the address of the next instruction.
    ///
    /// # Safety
    /// The invariant of the module holds when the interpreter goes on.
    #[inline(always)]
    pub(crate) const unsafe fn set_pc(&mut self, pc: *const u32) {
        self.pc = pc;
    }

    /// Sets the running frame.
    ///
    /// # Safety
    /// As [`Cpu::set_pc`].
    #[inline(always)]
    pub(crate) const unsafe fn set_base(&mut self, base: *mut Value) {
        self.base = base;
    }

    /// Sets the end of the running task's stack.
    ///
    /// # Safety
    /// As [`Cpu::set_pc`].
    #[inline(always)]
    pub(crate) const unsafe fn set_stack_end(&mut self, stack_end: *mut Value) {
        self.stack_end = stack_end;
    }

    /// Returns the ticks that are left in the slice; negative if it is overdrawn.
    pub(crate) fn left(&self) -> i64 {
        i64::from(self.reserve) + i64::from(self.ticks)
    }

    /// Returns the ticks of the slice that were used.
    pub(crate) fn used(&self) -> u64 {
        (i64::from(self.granted) - self.left()).max(0) as u64
    }

    /// Takes the ticks of the slice that were used.
    #[inline]
    pub(crate) fn take_used(&mut self) -> u64 {
        let used = self.used();
        self.reserve = 0;
        used
    }
}

// SAFETY: the pointers lead into the running task's stack and into code; the machine owns both and moves with
// them.
unsafe impl Send for Cpu {}
