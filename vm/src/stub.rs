//! Instructions that only the virtual machine makes.
//!
//! Opcodes from `0xC0` on are refused in files, so whoever meets one of these knows that the machine has put it there.
//! Each is one word: the opcode in the low byte, the operand, if any, in the 24 bits above or, where the text says
//! *D16*, in the high half.

use esl_bytecode::builtin::Builtin;

/// Calls the builtin whose number is in D16 with the arguments in `R[0]…`, and returns what it returns.
pub(crate) const NATIVE: u8 = 0xC0;
/// Raises `undefined-function` of the symbol that is capture 0 of the running function.
pub(crate) const UNDEFINED: u8 = 0xC1;
/// First call of a function: has the loader put its real code in place of this stub, and calls again. The operand is
/// the function's number in its module.
pub(crate) const LAZY: u8 = 0xC2;
/// Where a recovery procedure returns to: its values take the place of the failed operation's.
pub(crate) const ERROR_RETURN: u8 = 0xC3;
/// Where the first function of a task returns to.
pub(crate) const TASK_EXIT: u8 = 0xC4;
/// Stops the interpreter.
pub(crate) const HALT: u8 = 0xC5;

/// The word of an instruction whose operand takes 24 bits.
pub(crate) const fn word(opcode: u8, operand: u32) -> u32 {
    debug_assert!(operand < 1 << 24);
    opcode as u32 | operand << 8
}

/// The word that calls `builtin`.
pub(crate) const fn native_word(builtin: Builtin) -> u32 {
    NATIVE as u32 | (builtin as u32) << 16
}

/// The largest operand of [`LAZY`].
pub(crate) const MAX_FUNCTION: usize = (1 << 24) - 1;
