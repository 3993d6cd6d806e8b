//! Operations that only the virtual machine makes, and the code that consists of them: where a task's first
//! function returns to, where the function returns to that took the place of a failed instruction, and the
//! one that ran where its task was interrupted.
//!
//! Opcode 0 and those from `0xC0` on are refused in files, so code with one of these was made by the machine.
//! (Because there is a 0, the loop's table of jumps begins there, and the opcode is its index as it is.)
//!
//! A return reads the call word two words before the return address, so each stub is a call word, its aux
//! word, and then the operation that goes on.

use esl_bytecode::opcode::Opcode;
use esl_bytecode::operand::Want;
use esl_bytecode::word::Word;

/// Number of the operation at the end of a task.
pub(super) const TASK_EXIT: u8 = 0;
/// Number of the operation after a function that took the place of an instruction.
pub(super) const ERROR_RETURN: u8 = 0xC3;
/// Number of the operation after a function that ran where its task was interrupted.
pub(super) const INTERRUPT_RETURN: u8 = 0xC4;

/// Number of the operation at the entry of code that has machine code.
#[cfg(feature = "native")]
pub(super) const NATIVE_ENTRY: u8 = 0xC5;
/// Number of the operation at the entry of code of which machine code is to be made.
#[cfg(feature = "native")]
pub(super) const MAKE_AT_ENTRY: u8 = 0xC6;

/// Returns a call word whose window is register `window` and that wants all values.
const fn call_word(window: u8) -> u32 {
    Opcode::Call as u32 | (window as u32) << 8 | (Want::ALL.0 as u32) << 24
}

/// Return to the end of the task.
static TASK_EXIT_CODE: [u32; 3] = [call_word(0), 0, TASK_EXIT as u32];

/// For each window, return to this operation.
const fn returns_to(operation: u8) -> [[u32; 3]; 256] {
    let mut table = [[0; 3]; 256];
    let mut window = 0;
    while window < 256 {
        table[window] = [call_word(window as u8), 0, operation as u32];
        window += 1;
    }
    table
}

/// For each window, return to a failed instruction.
static ERROR_RETURN_CODE: [[u32; 3]; 256] = returns_to(ERROR_RETURN);

/// For each window, return to an instruction before which the task was interrupted.
static INTERRUPT_RETURN_CODE: [[u32; 3]; 256] = returns_to(INTERRUPT_RETURN);

/// Returns the address of the operation of a stub, from which the words before it can be read.
fn operation_of(stub: &'static [u32; 3]) -> *const u32 {
    stub.as_ptr().wrapping_add(2)
}

/// Return address of a task's first function.
pub(crate) fn task_exit() -> *const u32 {
    operation_of(&TASK_EXIT_CODE)
}

/// Return address of a function whose window is register `window` of the frame with the failed instruction.
pub(crate) fn error_return(window: u8) -> *const u32 {
    operation_of(&ERROR_RETURN_CODE[usize::from(window)])
}

/// Return address of a function that runs in an interrupted frame, whose window is this register of the
/// frame.
pub(crate) fn interrupt_return(window: u8) -> *const u32 {
    operation_of(&INTERRUPT_RETURN_CODE[usize::from(window)])
}

/// Returns whether a return address is one of [`error_return`] or [`interrupt_return`]: the frame has its pc
/// behind its registers.
pub(crate) fn is_return_above(pc: *const u32) -> bool {
    is_in(&ERROR_RETURN_CODE, pc) || is_in(&INTERRUPT_RETURN_CODE, pc)
}

/// Returns whether a return address is one of [`error_return`].
pub(crate) fn is_error_return(pc: *const u32) -> bool {
    is_in(&ERROR_RETURN_CODE, pc)
}

fn is_in(table: &'static [[u32; 3]; 256], pc: *const u32) -> bool {
    let start = table.as_ptr().addr();
    pc.addr() >= start && pc.addr() < start + size_of_val(table)
}

/// Length in words of the instruction that begins with `word`.
pub(super) fn length(word: Word) -> usize {
    word.opcode().map_or(1, Opcode::words)
}
