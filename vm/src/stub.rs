//! Instructions that only the virtual machine makes.
//!
//! Opcode 0 and those from `0xC0` on are refused in files, so whoever meets one of these knows that the machine has put it
//! there. (Because there is a 0, the loop's table of jumps begins there, and the opcode is its index as it is.)
//! Each is one word: the opcode in the low byte, the operand, if any, in the 24 bits above or, where the text says
//! *D16*, in the high half.

use esl_bytecode::builtin::Builtin;

/// The code of a builtin; its number is in D16. The interpreter goes by the shape and never comes here.
pub(crate) const NATIVE: u8 = 0xC0;
/// The code of a symbol without a function; the symbol is capture 0 of the function. As for builtins.
pub(crate) const UNDEFINED: u8 = 0xC1;
/// The code of a function that nobody has called yet: the loader puts its real code in place of this. As for builtins.
pub(crate) const LAZY: u8 = 0xC2;
/// Where a recovery procedure returns to: its values take the place of the failed operation's.
pub(crate) const ERROR_RETURN: u8 = 0xC3;
/// Where the first function of a task returns to.
pub(crate) const TASK_EXIT: u8 = 0;
/// Where a function returns to that ran where its task was interrupted: the task goes on as it was.
pub(crate) const INTERRUPT_RETURN: u8 = 0xC4;
/// The word of an instruction whose operand takes 24 bits.
pub(crate) const fn word(opcode: u8, operand: u32) -> u32 {
    debug_assert!(operand < 1 << 24);
    opcode as u32 | operand << 8
}

/// The word that calls `builtin`.
pub(crate) const fn native_word(builtin: Builtin) -> u32 {
    NATIVE as u32 | (builtin as u32) << 16
}
