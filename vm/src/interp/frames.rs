//! Walks over the frames of a task's stack, for backtraces, reports, recoveries from failures, and
//! fingerprints of the task's state.

use std::marker::PhantomData;

use super::{code_of, pc_from_value, stubs, word_at};
use crate::heap::Heap;
use crate::heap::layout::CodeObject;
use crate::names::load::is_of_library;
use crate::task::Entry;
use crate::task::Task;
use crate::value::Value;
use crate::vm::Vm;
use esl_bytecode::module::VariablePlace;
use esl_bytecode::opcode::{CallTarget, Opcode};

/// Words below the first register of a task's outermost frame: the frame of the stub at the task's end has
/// nothing but its link, and no code of a program stands there.
const BELOW_FRAMES: usize = 4;

/// One frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame<'a> {
    /// The function.
    pub function: Value,
    /// Word of its code at which it stands: at the instruction, or for a caller behind the call.
    pub word: usize,
    /// Whether `word` is that of the instruction itself, because it is the one that runs, or one that failed.
    pub is_exact: bool,
    /// First register.
    base: *mut Value,
    /// Number of registers, up to the frame above it.
    registers: usize,
    stack: PhantomData<&'a [Value]>,
}

impl<'a> Frame<'a> {
    /// Returns its registers, up to the frame above it.
    pub(crate) fn registers(&self) -> &'a [Value] {
        // SAFETY: F2, F4: so many registers of the frame lie in the stack, and all its words are values;
        // `Frames` borrows it.
        unsafe { std::slice::from_raw_parts(self.base, self.registers) }
    }

    /// Returns the word of the code that tells where it stands: a caller stands behind its call.
    pub(crate) fn place(&self) -> u32 {
        (if self.is_exact { self.word } else { self.word.saturating_sub(1) }) as u32
    }

    /// Returns the value at the place of a variable; `None` if the frame does not have it.
    pub(crate) fn value_at(&self, heap: &Heap, place: VariablePlace) -> Option<Value> {
        let value = match place {
            VariablePlace::Register(register) => self.registers().get(usize::from(register)),
            VariablePlace::Capture(capture) => {
                heap.function_captures(self.function)?.get(usize::from(capture))
            }
        };
        value.copied().filter(|&value| value != Value::UNSUPPLIED)
    }

    /// Returns the address at which its function returns, that of a stub for the outermost frame.
    fn return_address(&self) -> *const u32 {
        // SAFETY: F2: below the registers of a frame is its link.
        unsafe { pc_from_value(*self.base.sub(1)) }
    }

    /// Returns whether its function was called by name, or by the machine in the place of an instruction, and
    /// not as a value that the caller was given.
    fn is_called_by_name(&self) -> bool {
        let return_to = self.return_address();
        // SAFETY: F2: two words before a return address is the word of the call.
        let call = unsafe { word_at(return_to.sub(2)) };
        stubs::is_error_return(return_to)
            || matches!(
                call.opcode().and_then(Opcode::callee),
                Some(CallTarget::Global | CallTarget::Running)
            )
    }

    /// Returns whether its function, one of the library, is a step of the function of the library below it:
    /// that has called it by name, or it is a closure, which only the library can have called. A function
    /// that the caller was given as a value may have taken the place of one of the program, by a tail call;
    /// in modules, which hardly do so with each other's functions, it counts as a step.
    fn is_step_of(&self, caller: &Frame<'_>, heap: &Heap) -> bool {
        // SAFETY: F2: the function of a frame is a Function.
        let name = unsafe { (*code_of(self.function)).name };
        let is_global = heap.symbol(name).is_some_and(|symbol| symbol.function == self.function);
        let is_step = !is_global || self.is_of_module() && caller.is_of_module();
        self.is_called_by_name() || is_step && !stubs::is_return_above(self.return_address())
    }

    /// Returns whether its function is one of a module that comes with the machine.
    fn is_of_module(&self) -> bool {
        // SAFETY: F2: the function of a frame is a Function.
        unsafe { (*code_of(self.function)).owner == Value::T }
    }

    /// Returns whether its function is one of the library.
    pub(crate) fn is_of_library(&self) -> bool {
        // SAFETY: F2: the function of a frame is a Function.
        unsafe { is_of_library(&*code_of(self.function)) }
    }
}

/// The frames of a stack, innermost first.
pub(crate) struct Frames<'a> {
    /// First word of the stack.
    bottom: *mut Value,
    /// Place of the next frame; `None` behind the outermost.
    next: Option<(*const u32, *mut Value)>,
    is_exact: bool,
    /// Registers of the next frame that no frame covers.
    uncovered: usize,
    stack: PhantomData<&'a [Value]>,
}

impl<'a> Frames<'a> {
    /// Walks from a frame outward.
    ///
    /// # Safety
    /// The task whose stack begins at `bottom` stands at `pc` in the frame with the registers at `base`, for
    /// `'a`.
    unsafe fn new(bottom: *mut Value, pc: *const u32, base: *mut Value) -> Frames<'a> {
        let next = Some((pc, base));
        Frames { bottom, next, is_exact: true, uncovered: usize::MAX, stack: PhantomData }
    }

    /// Returns the frames of a task that does not run.
    pub(crate) fn of_task(task: &'a Task) -> Frames<'a> {
        let bottom = task.stack.start();
        // SAFETY: F3: the task stands where it was noted at the switch, and is borrowed for as long.
        unsafe { Frames::new(bottom, task.pc.get(), bottom.add(task.base as usize)) }
    }
}

impl<'a> Iterator for Frames<'a> {
    type Item = Frame<'a>;

    fn next(&mut self) -> Option<Frame<'a>> {
        let (pc, base) = self.next.take()?;
        if base.addr() < self.bottom.addr() + BELOW_FRAMES * size_of::<Value>() {
            return None;
        }
        // SAFETY: F2: each link leads to the frame below, down to the outermost, whose link is a stub's; F3:
        // where a stub of another sort is linked, the pc of the frame below is behind its registers.
        unsafe {
            let function = *base.sub(2);
            let code = code_of(function);
            let registers = ((*code).nregs as usize).min(self.uncovered);
            let word = word_in(code, pc);
            let frame =
                Frame { function, word, is_exact: self.is_exact, base, registers, stack: PhantomData };
            let return_to = frame.return_address();
            if return_to != stubs::task_exit() {
                self.uncovered = word_at(return_to.sub(2)).a();
                let caller = base.sub(2 + self.uncovered);
                self.is_exact = stubs::is_return_above(return_to);
                let nregs = (*code_of(*caller.sub(2))).nregs as usize;
                let pc = if self.is_exact { pc_from_value(*caller.add(nregs)) } else { return_to };
                self.next = Some((pc, caller));
            }
            Some(frame)
        }
    }
}

/// Position of `pc` in the words of `code`.
///
/// # Safety
/// `code` points to a Code.
unsafe fn word_in(code: *mut CodeObject, pc: *const u32) -> usize {
    // SAFETY: by the contract this is a live Code, and its words are at this offset.
    let start = unsafe { code.byte_add((*code).words_offset()) };
    pc.addr().wrapping_sub(start.addr()) / size_of::<u32>()
}

/// Returns the word of the code of its frame at which an entry of a task that does not run lands, if it has
/// one.
pub(crate) fn entry_word(task: &Task, entry: &Entry) -> Option<usize> {
    if entry.pc.is_none() {
        return None;
    }
    // SAFETY: F5: the frame of an entry is live.
    unsafe {
        let code = code_of(*task.stack.start().add(entry.base as usize).sub(2));
        Some(word_in(code, entry.pc.get()))
    }
}

impl Vm {
    /// Returns the word of the code of its frame at which the running task stands, 0 if that is in a stub.
    pub(crate) fn word_of_pc(&self) -> usize {
        // SAFETY: F1, F2: below the base is the function of the running frame.
        let (word, words) = unsafe {
            let code = code_of(*self.cpu.base().sub(2));
            (word_in(code, self.cpu.pc()), (*code).nwords as usize)
        };
        if word < words { word } else { 0 }
    }

    /// Returns the frames of the running task. `vm.cpu` is in order when a builtin that the interpreter
    /// called asks for them only up to its innermost frame's pc, so that one is given as it was saved.
    pub(crate) fn frames(&self) -> impl Iterator<Item = Frame<'_>> {
        let task = self.scheduler.running.as_ref();
        // SAFETY: F1: `vm.cpu` describes the running task, which is borrowed for as long.
        task.map(|task| unsafe { Frames::new(task.stack.start(), self.cpu.pc(), self.cpu.base()) })
            .into_iter()
            .flatten()
    }

    /// Returns the base of the outermost frame of the library around a failure, inside the frame whose base
    /// is `around`: the recovery's values become what that frame returns. `None` if the program itself has
    /// failed. To be asked by a builtin that was called by the function that deals with the failure.
    pub(crate) fn frame_of_operation(&mut self, around: u32) -> Option<u32> {
        let (mut found, mut looked_at) = (None, 0);
        let mut frames = self.frames();
        let mut callee = frames.next()?;
        for caller in frames {
            if found.is_some() && !callee.is_step_of(&caller, &self.heap) {
                break;
            }
            let offset = self.offset_of(caller.base) as u32;
            if offset <= around || !caller.is_of_library() {
                break;
            }
            found = Some(offset);
            looked_at += 1;
            callee = caller;
        }
        self.exchange.charge(looked_at);
        found
    }
}
