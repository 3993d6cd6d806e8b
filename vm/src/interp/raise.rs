//! Failures of instructions: calling the library at the point of failure, and putting a value in its place.
//!
//! ```text
//! registers of the frame with the failed instruction | its pc | %raise | return pc, a stub | arguments ...
//! ```
//!
//! The stub's `error-return` finds the failed instruction by the saved pc, puts the value where its row in the opcode
//! table says, and goes on behind it. The same way serves an instruction whose work a function of the library takes
//! over, and one that asks for a call.

use esl_bytecode::opcode::{Opcode, Substitute};

use super::call::Place;
use super::{Operation, Signal, call, code_of, stubs};
use crate::control::{Entry, EntryKind};
use crate::raise::Exit;
use crate::task::Task;
use crate::value::Value;
use crate::vm::Vm;

/// Deals with a builtin or an instruction that gave no value.
///
/// # Safety
/// As [`super::settle`].
pub(super) unsafe fn exit(vm: &mut Vm, exit: Exit) -> Signal {
    // SAFETY: as this function.
    unsafe {
        match exit {
            Exit::Values => Signal::ReturnAll,
            Exit::Raise => raise(vm),
            Exit::Collect => collect(vm),
            Exit::Unwind => Signal::Unwind,
            Exit::Slowly => take_over(vm),
            Exit::Call => {
                let (function, arguments) = vm.take_requested_call();
                let place = place_of(vm);
                call::call(vm, function, &arguments, place)
            }
            Exit::Park => Signal::Park,
            Exit::Again => Signal::Again,
        }
    }
}

/// Where a call that takes the place of the builtin at `vm.cpu.pc` has its frame.
unsafe fn place_of(vm: &Vm) -> Place {
    // SAFETY: V1.
    match unsafe { Opcode::from_number(*vm.cpu.pc as u8) } {
        Some(Opcode::TailCallBuiltin | Opcode::TailCall | Opcode::TailCallGlobal | Opcode::TailApply) => {
            Place::Tail
        }
        Some(opcode) if opcode.substitute() == Substitute::Call => Place::Window,
        _ => Place::Above,
    }
}

/// Has the library function that is named in the builtin's row do the work.
unsafe fn take_over(vm: &mut Vm) -> Signal {
    // SAFETY: V1, V3 and V5: at `call-builtin` or `tail-call-builtin`. No other instruction gives `Exit::Slowly`: as a
    // function a builtin is called in `call`, which deals with it.
    unsafe {
        let pc = vm.cpu.pc;
        let word = *pc;
        let number = *pc.add(1) as u16;
        let Some(function) = vm.slow_twin(number) else {
            let name = esl_bytecode::builtin::BUILTINS[usize::from(number)].name;
            let text = format!("{name} has too much to do at once");
            return Signal::Exit(vm.program_error::<()>(text).unwrap_err());
        };
        let first = vm.cpu.base.add((word >> 8 & 0xff) as usize + 2);
        let given = std::slice::from_raw_parts(first, (word >> 16 & 0xff) as usize);
        let place = place_of(vm);
        call::call(vm, function, given, place)
    }
}

/// Calls `%raise` with the failure that is noted.
unsafe fn raise(vm: &mut Vm) -> Signal {
    let arguments = match vm.raised_arguments() {
        Ok(arguments) => arguments,
        Err(exit) => return Signal::Exit(exit),
    };
    let function = vm.world.known.raise;
    if !vm.is_defined(function) {
        // Without a library nobody can handle it.
        let text = vm.describe_failure(&arguments);
        vm.last_words = Some(text);
        vm.begin_end(crate::control::End::Failed(arguments[0]));
        return Signal::Unwind;
    }
    // SAFETY: as `settle`.
    unsafe { call::call(vm, function, &arguments, Place::Above) }
}

/// Collects, so that the instruction at `vm.cpu.pc` is done again with more room; if that did not help the last time, the
/// heap is exhausted.
unsafe fn collect(vm: &mut Vm) -> Signal {
    // SAFETY: V1.
    let word = unsafe { *vm.cpu.pc };
    let is_call =
        Opcode::from_number(word as u8).is_some_and(|opcode| opcode.substitute() == Substitute::Call);
    if is_call {
        // Its tick will be taken again.
        vm.cpu.ticks += 1;
    }
    let place = (vm.cpu.pc, vm.task().ticks, vm.cpu.ticks);
    if vm.collected_at == Some(place) {
        vm.collected_at = None;
        if is_call {
            vm.cpu.ticks -= 1;
        }
        if !vm.heap.open_reserve() {
            vm.leave_reserve(vm.world.known.heap_exhausted);
            return Signal::Unwind;
        }
        return Signal::Exit(vm.raise::<()>(crate::raise::Raised::HeapExhausted).unwrap_err());
    }
    vm.collected_at = Some(place);
    vm.collect_fully();
    Signal::Reload
}

/// `error-return`: the value list holds what the function above the frame has returned.
///
/// # Safety
/// As [`super::settle`], at the stub.
pub(super) unsafe fn error_return(vm: &mut Vm, _pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: the frame is one above which `call` has put a function: its pc is saved behind its registers.
    unsafe {
        let nregs = (*code_of(*base.sub(2))).nregs as usize;
        vm.cpu.base = base;
        vm.cpu.pc = std::ptr::with_exposed_provenance((*base.add(nregs)).bits() as usize);
        substitute(vm)
    }
}

/// `interrupt-return`: the function that ran where the task was interrupted has returned. The instruction there, which has
/// had no effect yet, comes next, and a wait at which the task was parked goes on.
///
/// # Safety
/// As [`super::settle`], at the stub.
pub(super) unsafe fn interrupt_return(vm: &mut Vm, _pc: *const u32, base: *mut Value) -> Signal {
    // SAFETY: as for `error_return`.
    unsafe {
        let nregs = (*code_of(*base.sub(2))).nregs as usize;
        vm.cpu.base = base;
        vm.cpu.pc = std::ptr::with_exposed_provenance((*base.add(nregs)).bits() as usize);
    }
    let task = vm.task_mut();
    if let Some(entry) = task.control.entries.pop() {
        debug_assert_eq!(entry.kind, crate::control::EntryKind::Interrupt);
        task.wait = entry.data;
    }
    Signal::Reload
}

/// Calls a function where the running task stands, before the instruction there.
///
/// # Safety
/// As [`super::settle`], at an instruction that has had no effect yet.
pub(super) unsafe fn interrupt(vm: &mut Vm, function: Value, arguments: &[Value]) -> Signal {
    let base = vm.offset_of(vm.cpu.base) as u32;
    let task = vm.task_mut();
    let wait = std::mem::replace(&mut task.wait, Value::NIL);
    let bindings = task.control.bindings.len() as u32;
    let kind = EntryKind::Interrupt;
    let entry = Entry { data: wait, pc: std::ptr::null(), base, bindings, window: 0, want: 0, kind };
    task.control.entries.push(entry);
    // SAFETY: as this function.
    unsafe { call::call(vm, function, arguments, Place::Interrupt) }
}

/// Puts the value list in the place of the result of the instruction at `vm.cpu.pc`, and goes on behind it.
///
/// # Safety
/// As [`super::settle`], at an instruction.
pub(super) unsafe fn substitute(vm: &mut Vm) -> Signal {
    // SAFETY: V1 to V3: what the row of the opcode says is there.
    unsafe {
        let (pc, base) = (vm.cpu.pc, vm.cpu.base);
        let word = *pc;
        let value = vm.values.first().copied().unwrap_or(Value::NIL);
        let Some(opcode) = Opcode::from_number(word as u8) else { return Signal::Next };
        let operand = (word >> 8 & 0xff) as usize;
        match opcode.substitute() {
            Substitute::Value => *base.add(operand) = value,
            Substitute::Effect | Substitute::Silent => {}
            // Nothing can stand for what the instruction was to do: it is tried again.
            Substitute::Never => return Signal::Reload,
            Substitute::Test => {
                if vm.values.first().is_some_and(|v| v.is_true())
                    == jumps_when(std::mem::transmute::<u8, Operation>(word as u8))
                {
                    vm.cpu.pc = pc.add(2).offset(*pc.add(1) as i32 as isize);
                    return Signal::Reload;
                }
            }
            Substitute::Call => match opcode {
                Opcode::TailCall | Opcode::TailCallGlobal | Opcode::TailCallBuiltin | Opcode::TailApply => {
                    return Signal::ReturnAll;
                }
                _ => call::deliver(vm, base.add(operand), (word >> 24) as usize),
            },
        }
        vm.cpu.pc = pc.add(stubs::length(word));
        Signal::Reload
    }
}

/// Whether a comparison that holds makes the instruction jump.
fn jumps_when(operation: Operation) -> bool {
    !matches!(
        operation,
        Operation::JumpNotNumEq
            | Operation::JumpNotLess
            | Operation::JumpNotLessEq
            | Operation::JumpNotNumEqInt
            | Operation::JumpNotLessInt
            | Operation::JumpNotGreaterInt
            | Operation::LoopNotLess
    )
}

/// One frame of a backtrace.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameAt {
    /// The function.
    pub function: Value,
    /// Word of its code at which it stands: at the instruction, or for a caller behind the call.
    pub word: usize,
    /// Whether `word` is that of the instruction itself, because it is the one that runs, or one that failed.
    pub is_exact: bool,
}

impl Vm {
    /// The frames of the running task, innermost first, at most `limit` of them. `vm.cpu` is in order when a builtin that
    /// the interpreter called asks for it only up to its innermost frame's pc, so that one is given as it was saved.
    pub(crate) fn frames(&self, limit: usize) -> Vec<FrameAt> {
        let Some(task) = self.running.as_ref() else { return Vec::new() };
        // SAFETY: `vm.cpu` describes the running task.
        unsafe { frames_of(task.stack.start(), self.cpu.pc, self.cpu.base, limit) }
    }
}

impl Vm {
    /// The base of the frame that is to return what stands for the values of an operation that has failed: of the outermost
    /// function of the library around the failure, inside the frame whose base is `around`. `None` if the program itself has
    /// failed. To be asked by a builtin that was called by the function that deals with the failure.
    pub(crate) fn frame_of_operation(&mut self, around: u32) -> Option<u32> {
        let (mut found, mut looked_at) = (None, 0);
        let mut base = self.cpu.base;
        // SAFETY: `vm.cpu.base` is that of the innermost frame; frames are linked as in `frames_of`, down to the root,
        // whose link is a stub's.
        unsafe {
            loop {
                let return_to: *const u32 = std::ptr::with_exposed_provenance((*base.sub(1)).bits() as usize);
                if return_to == stubs::task_exit() {
                    break;
                }
                let call = *return_to.sub(2);
                let is_named = stubs::is_error_return(return_to)
                    || matches!(Opcode::from_number(call as u8), Some(Opcode::CallGlobal | Opcode::CallSelf));
                if found.is_some() && !is_named {
                    // Its caller was given it as a value: it may be the program's, which has called on by a tail call.
                    break;
                }
                base = base.sub(2 + (call >> 8 & 0xff) as usize);
                let offset = self.offset_of(base) as u32;
                if offset <= around || !(*code_of(*base.sub(2))).owner.is_fixnum() {
                    break;
                }
                found = Some(offset);
                looked_at += 1;
            }
        }
        self.charge(looked_at);
        found
    }
}

/// A frame with what it holds.
pub(crate) struct FrameView<'a> {
    /// The function.
    pub function: Value,
    /// As in [`FrameAt`].
    pub word: usize,
    /// As in [`FrameAt`].
    pub is_exact: bool,
    /// Its registers, up to the frame above it.
    pub registers: &'a [Value],
}

/// Calls `visit` with the frames of a task that does not run, innermost first.
pub(crate) fn visit_frames(task: &Task, visit: &mut dyn FnMut(FrameView<'_>)) {
    let bottom = task.stack.start();
    // SAFETY: the task stands where it was noted at the switch; frames are linked as in `frames_of`, and the frame at the
    // root, which the stub at the end of the task runs in, has nothing but its function.
    unsafe {
        let mut pc = task.pc;
        let mut base = bottom.add(task.base as usize);
        let mut is_exact = true;
        let mut end = usize::MAX;
        while base.addr() >= bottom.addr() + 4 * size_of::<Value>() {
            let function = *base.sub(2);
            let code = code_of(function);
            let start = code.byte_add((*code).words_offset()).cast::<u32>().cast_const();
            let word = pc.addr().wrapping_sub(start.addr()) / size_of::<u32>();
            let nregs = (*code).nregs as usize;
            let registers = std::slice::from_raw_parts(base, nregs.min(end));
            visit(FrameView { function, word, is_exact, registers });
            let return_to: *const u32 = std::ptr::with_exposed_provenance((*base.sub(1)).bits() as usize);
            if return_to == stubs::task_exit() {
                break;
            }
            end = (*return_to.sub(2) >> 8 & 0xff) as usize;
            base = base.sub(2 + end);
            is_exact = stubs::is_return_above(return_to);
            pc = return_to;
            if is_exact {
                let nregs = (*code_of(*base.sub(2))).nregs as usize;
                pc = std::ptr::with_exposed_provenance((*base.add(nregs)).bits() as usize);
            }
        }
    }
}

/// The word of the code of its frame at which an entry of a task that does not run lands, if it has one.
pub(crate) fn entry_word(task: &Task, entry: &Entry) -> Option<usize> {
    if entry.pc.is_null() {
        return None;
    }
    // SAFETY: the frame of an entry is live.
    unsafe {
        let code = code_of(*task.stack.start().add(entry.base as usize).sub(2));
        let start = code.byte_add((*code).words_offset()).cast::<u32>().cast_const();
        Some(entry.pc.addr().wrapping_sub(start.addr()) / size_of::<u32>())
    }
}

/// The frames of a task that does not run, innermost first, at most `limit` of them.
pub(crate) fn frames_of_task(task: &Task, limit: usize) -> Vec<FrameAt> {
    let start = task.stack.start();
    // SAFETY: the task stands where it was noted at the switch.
    unsafe { frames_of(start, task.pc, start.add(task.base as usize), limit) }
}

/// The frames of the stack that begins at `bottom`, from that with the registers at `base` on.
///
/// # Safety
/// The task to which the stack belongs stands at `pc` in that frame.
unsafe fn frames_of(
    bottom: *mut Value,
    mut pc: *const u32,
    mut base: *mut Value,
    limit: usize,
) -> Vec<FrameAt> {
    let mut frames = Vec::new();
    let mut is_exact = true;
    // SAFETY: frames are linked as `call` and the loop link them, down to the root, whose link is a stub's.
    unsafe {
        while frames.len() < limit && base.addr() >= bottom.addr() + 2 * size_of::<Value>() {
            let function = *base.sub(2);
            let code = code_of(function);
            let start = code.byte_add((*code).words_offset()).cast::<u32>().cast_const();
            let word = pc.addr().wrapping_sub(start.addr()) / size_of::<u32>();
            frames.push(FrameAt { function, word, is_exact });
            let return_to: *const u32 = std::ptr::with_exposed_provenance((*base.sub(1)).bits() as usize);
            if return_to == stubs::task_exit() {
                break;
            }
            let window = (*return_to.sub(2) >> 8 & 0xff) as usize;
            base = base.sub(2 + window);
            is_exact = stubs::is_return_above(return_to);
            pc = return_to;
            if is_exact {
                let nregs = (*code_of(*base.sub(2))).nregs as usize;
                pc = std::ptr::with_exposed_provenance((*base.add(nregs)).bits() as usize);
            }
        }
    }
    frames
}
