//! Operations that only the virtual machine makes, and the code that consists of them: where a task's first
//! function returns to, where the function returns to that took the place of a failed instruction, and the
//! one that ran where its task was interrupted.
//!
//! Opcode 0 and those from `0xC0` on are refused in files, so code with one of these was made by the machine.
//! (Because there is a 0, the loop's table of jumps begins there, and the opcode is its index as it is.)
//!
//! A return reads the call word two words before the return address, so each stub is a call word, its aux
//! word, and then the operation that goes on.

use std::ops::Range;
use std::sync::OnceLock;

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

/// Words of a stub.
const STUB: usize = 3;
/// Place of the stubs that return to a failed instruction, one for each window.
const ERROR_RETURNS: usize = STUB;
/// Place of the stubs that return to an instruction before which the task was interrupted.
const INTERRUPT_RETURNS: usize = ERROR_RETURNS + 256 * STUB;
/// Words of all stubs.
const WORDS: usize = INTERRUPT_RETURNS + 256 * STUB;

/// All stubs: the return to the end of the task, and the returns to the two operations.
static STUBS: [u32; WORDS] = {
    let mut words = [0; WORDS];
    words[0] = call_word(0);
    words[2] = TASK_EXIT as u32;
    let mut window = 0;
    while window < 256 {
        let (error, interrupt) = (ERROR_RETURNS + window * STUB, INTERRUPT_RETURNS + window * STUB);
        words[error] = call_word(window as u8);
        words[error + 2] = ERROR_RETURN as u32;
        words[interrupt] = call_word(window as u8);
        words[interrupt + 2] = INTERRUPT_RETURN as u32;
        window += 1;
    }
    words
};

/// Where the stubs are in each process, so that the state of a task means the same in all of them: below the
/// end of what ThreadSanitizer takes for addresses of a program, since it stops one that maps others.
const PLACE: u64 = 0x007e_0000_0000;

/// Returns the stubs at their place; `None` if the system does not give it.
fn placed() -> Option<&'static [u32]> {
    static PLACED: OnceLock<Option<&'static [u32]>> = OnceLock::new();
    *PLACED.get_or_init(|| esl_heap::heap::words_at(usize::try_from(PLACE).ok()?, &STUBS))
}

/// Returns all stubs.
fn stubs() -> &'static [u32] {
    placed().unwrap_or(&STUBS)
}

/// Returns whether the stubs are at the same addresses in each process.
pub(crate) fn are_placed() -> bool {
    placed().is_some()
}

/// Returns the address of the operation of the stub at this place, from which the words before it can be
/// read.
fn operation_of(stub: usize) -> *const u32 {
    stubs().as_ptr().wrapping_add(stub + 2)
}

/// Return address of a task's first function.
pub(crate) fn task_exit() -> *const u32 {
    operation_of(0)
}

/// Return address of a function whose window is register `window` of the frame with the failed instruction.
pub(crate) fn error_return(window: u8) -> *const u32 {
    operation_of(ERROR_RETURNS + STUB * usize::from(window))
}

/// Return address of a function that runs in an interrupted frame, whose window is this register of the
/// frame.
pub(crate) fn interrupt_return(window: u8) -> *const u32 {
    operation_of(INTERRUPT_RETURNS + STUB * usize::from(window))
}

/// Returns whether a return address is one of [`error_return`] or [`interrupt_return`]: the frame has its pc
/// behind its registers.
pub(crate) fn is_return_above(pc: *const u32) -> bool {
    is_in(ERROR_RETURNS..WORDS, pc)
}

/// Returns whether a return address is one of [`error_return`].
pub(crate) fn is_error_return(pc: *const u32) -> bool {
    is_in(ERROR_RETURNS..INTERRUPT_RETURNS, pc)
}

fn is_in(places: Range<usize>, pc: *const u32) -> bool {
    let stubs = &stubs()[places];
    let start = stubs.as_ptr().addr();
    pc.addr() >= start && pc.addr() < start + size_of_val(stubs)
}

/// Length in words of the instruction that begins with `word`.
pub(super) fn length(word: Word) -> usize {
    word.opcode().map_or(1, Opcode::words)
}
