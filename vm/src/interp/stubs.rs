//! Code that no module contains: where a task's first function returns to, where the function returns to that took
//! the place of a failed instruction, and the one that ran where its task was interrupted.
//!
//! A return reads the call word two words before the return address, so each stub is a call word, its aux word, and
//! then the operation that goes on.

use esl_bytecode::opcode::Opcode;
use esl_bytecode::operand::Want;

use crate::stub;

/// A call word whose window is register `window` and that wants all values.
const fn call_word(window: u8) -> u32 {
    Opcode::Call as u32 | (window as u32) << 8 | (Want::ALL.0 as u32) << 24
}

/// Return to the end of the task.
static TASK_EXIT: [u32; 3] = [call_word(0), 0, stub::word(stub::TASK_EXIT, 0)];

/// For each window, return to this operation.
const fn returns_to(operation: u8) -> [[u32; 3]; 256] {
    let mut table = [[0; 3]; 256];
    let mut window = 0;
    while window < 256 {
        table[window] = [call_word(window as u8), 0, stub::word(operation, 0)];
        window += 1;
    }
    table
}

/// For each window, return to a failed instruction.
static ERROR_RETURN: [[u32; 3]; 256] = returns_to(stub::ERROR_RETURN);

/// For each window, return to an instruction before which the task was interrupted.
static INTERRUPT_RETURN: [[u32; 3]; 256] = returns_to(stub::INTERRUPT_RETURN);

/// Return address of a task's first function.
pub(crate) fn task_exit() -> *const u32 {
    &raw const TASK_EXIT[2]
}

/// Return address of a function whose window is register `window` of the frame with the failed instruction.
pub(crate) fn error_return(window: u8) -> *const u32 {
    &raw const ERROR_RETURN[usize::from(window)][2]
}

/// Return address of a function that runs in an interrupted frame, whose window is this register of the frame.
pub(crate) fn interrupt_return(window: u8) -> *const u32 {
    &raw const INTERRUPT_RETURN[usize::from(window)][2]
}

/// Whether a return address is one of [`error_return`] or [`interrupt_return`]: the frame has its pc behind its registers.
pub(crate) fn is_return_above(pc: *const u32) -> bool {
    is_in(&ERROR_RETURN, pc) || is_in(&INTERRUPT_RETURN, pc)
}

/// Whether a return address is one of [`error_return`].
pub(crate) fn is_error_return(pc: *const u32) -> bool {
    is_in(&ERROR_RETURN, pc)
}

fn is_in(table: &'static [[u32; 3]; 256], pc: *const u32) -> bool {
    let start = table.as_ptr().addr();
    pc.addr() >= start && pc.addr() < start + size_of_val(table)
}

/// Length in words of the instruction that begins with `word`.
pub(crate) fn length(word: u32) -> usize {
    Opcode::from_number(word as u8).map_or(1, Opcode::words)
}
