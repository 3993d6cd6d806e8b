//! Instructions and builtins that gave no value: each [`Exit`] dealt with.
//!
//! A failure becomes a call of the library's `%raise` above the failed instruction; nothing has been unwound.

use esl_bytecode::builtin::BUILTINS;
use esl_bytecode::opcode::{CallTarget, Instr, Opcode};
use esl_bytecode::operand::Role;
use esl_bytecode::symbol::Symbol;
use esl_host::Host;

use super::call::{FramePlace, call, call_requested};
use super::{Signal, aux_at, failure, word_at};
use crate::describe::describe;
use crate::overhead::CollectionPoint;
use crate::raise::{Arguments, Exit, Raised};
use crate::saved_pc::SavedPc;
use crate::schedule::TurnEnd;
use crate::task::{Shortage, TaskEnd};
use crate::value::Value;
use crate::vm::Vm;

/// Live bytes over which a collection goes in the time of a tick, about.
const BYTES_PER_TICK: u64 = 256;

/// Deals with a builtin or an instruction that gave no value.
///
/// # Safety
/// The contract of [`super::settle`].
pub(super) unsafe fn exit(vm: &mut Vm, exit: Exit) -> Signal {
    // SAFETY: F1 holds by the contract, and each of these functions needs just that; V1: `pc` is at an
    // instruction. Only the instructions that call a builtin give `Exit::Slowly`.
    unsafe {
        match exit {
            Exit::Values => Signal::ReturnAll,
            Exit::Raise => {
                note_call(vm);
                raise(vm)
            }
            Exit::Collect => collect(vm),
            Exit::Unwind => Signal::Unwind,
            Exit::Slowly => take_over(vm),
            Exit::Call => {
                let place = FramePlace::for_instruction(word_at(vm.cpu.pc()));
                call_requested(vm, place)
            }
            Exit::Park => Signal::Park,
            Exit::Again => Signal::Again,
        }
    }
}

/// Calls the library function that the builtin's row names in place of the builtin.
///
/// # Safety
/// The contract of [`super::settle`], at `call-builtin` or `tail-call-builtin`. No other instruction gives
/// [`Exit::Slowly`]: as a function a builtin is called in `call`, which deals with it.
unsafe fn take_over(vm: &mut Vm) -> Signal {
    // SAFETY: V1, V5: the aux word is the number of the builtin; V3: the arguments are registers of the
    // frame.
    unsafe {
        let word = word_at(vm.cpu.pc());
        let function = match vm.twin_of(&BUILTINS[aux_at(vm.cpu.pc()) as usize]) {
            Ok(function) => function,
            Err(exit) => return Signal::Exit(exit),
        };
        let given = std::ptr::slice_from_raw_parts(vm.cpu.base().add(word.a() + 2), word.b());
        call(vm, function, given, FramePlace::for_instruction(word))
    }
}

/// Notes in the failure which builtin the instruction at `vm.cpu.pc()` called, or did the work of, and with
/// which arguments.
///
/// # Safety
/// The contract of [`super::settle`].
unsafe fn note_call(vm: &mut Vm) {
    let Some(raised) = &mut vm.exchange.raised else { return };
    // SAFETY: V1: `pc` is at an instruction, with an aux word if its row says so; V3: operands and arguments
    // are registers of the frame; V5: the aux word is the number of the builtin.
    unsafe {
        let (pc, base) = (vm.cpu.pc(), vm.cpu.base());
        let word = word_at(pc);
        let Some(opcode) = word.opcode() else { return };
        if opcode.callee() == Some(CallTarget::Builtin) {
            let given = std::slice::from_raw_parts(base.add(word.a() + 2), word.b());
            raised.note_call(&BUILTINS[aux_at(pc) as usize], given);
        } else if let Some(builtin) = opcode.builtin() {
            raised.note_call(builtin.info(), &operands(opcode, pc, base));
        }
    }
}

/// Returns the arguments that the instruction at `pc` gives the builtin in its row.
///
/// # Safety
/// V1, V3: at `pc` is an instruction with this opcode, and the registers that it names are in the frame at
/// `base`.
unsafe fn operands(opcode: Opcode, pc: *const u32, base: *mut Value) -> Arguments {
    let mut operands = Arguments::new();
    // SAFETY: the contract is the same.
    unsafe {
        let aux = if opcode.words() == 2 { aux_at(pc) } else { 0 };
        Instr::from_words(opcode, *pc, aux).visit_operands(|role| match role {
            Role::Read(register) => operands.push(*base.add(usize::from(register))),
            Role::Number(number) => operands.push(Value::small(number)),
            _ => {}
        });
    }
    operands
}

/// Calls `%raise` with the failure that is noted.
///
/// # Safety
/// The contract of [`super::settle`].
unsafe fn raise(vm: &mut Vm) -> Signal {
    // It stays noted until it has been put into words, since that may have to be done again.
    let raised = vm.exchange.raised.clone().unwrap_or(Raised::Simple("an operation failed".into()));
    let arguments = match raised.arguments(&mut vm.heap, &mut vm.names) {
        Ok(arguments) => arguments,
        Err(error) => return Signal::Exit(error.into()),
    };
    let function = vm.names.known.raise;
    if !vm.names.is_defined(&vm.heap, function) {
        // Without a library there are no conditions, and nothing handles a failure: its cause ends the task.
        let name = vm.names.name_of(&vm.heap, arguments[0]);
        let (cause, details) = match name.as_ref().map_or("", Symbol::name) {
            "FAILURE" => (arguments[1], &arguments[2..]),
            name => match vm.names.keyword(&mut vm.heap, name) {
                Ok(cause) => (cause, &arguments[1..]),
                Err(error) => return Signal::Exit(error.into()),
            },
        };
        let words = std::iter::once(&cause).chain(details).map(|&v| describe(&vm.heap, v));
        vm.embedder.last_words = Some(words.collect::<Vec<_>>().join(" "));
        vm.exchange.raised = None;
        vm.scheduler.task_mut().begin_end(TaskEnd::Failed(cause));
        return Signal::Unwind;
    }
    vm.exchange.raised = None;
    // SAFETY: F1 holds by the contract, and a frame above the running one needs no window.
    unsafe { call(vm, function, &*arguments, FramePlace::Above) }
}

/// Has the instruction at `vm.cpu.pc()` done again: in the task's next turn, where there is room for it or
/// not yet, and then after a collection. If that did not help, or collections have lately taken more time
/// than they were worth, the heap is exhausted.
///
/// # Safety
/// The contract of [`super::settle`].
unsafe fn collect(vm: &mut Vm) -> Signal {
    if vm.heap.is_refused() {
        vm.outside.host.hear_of_refusal();
    }
    // SAFETY: V1: `pc` is at an instruction.
    let word = unsafe { word_at(vm.cpu.pc()) };
    let is_call = FramePlace::for_instruction(word) != FramePlace::Above;
    if is_call {
        // Its tick will be taken again.
        vm.cpu.ticks += 1;
    }
    let used = vm.scheduler.turn.used_before + vm.cpu.used();
    let place = (SavedPc::new(vm.cpu.pc()), vm.scheduler.task().ticks + used);
    let turn = &mut vm.scheduler.turn;
    // The turn begins with what there was no room for in the last one.
    let is_retry = used <= 1;
    let shortage = std::mem::take(&mut turn.shortage);
    let has_collected = vm.exchange.collected_at.take() == Some(place);
    if has_collected || is_retry && shortage == Shortage::Collected {
        return run_out(vm, is_call, has_collected);
    }
    let task = vm.scheduler.task_mut();
    if task.critical == 0 && !(is_retry && shortage == Shortage::Noted) {
        // One collection does for all tasks that lack room in this round: that of the first to come here
        // again.
        task.flags.set_lacks_room(true);
        vm.scheduler.turn.end_with(TurnEnd::Passed);
        return Signal::Again;
    }
    let now = CollectionPoint {
        ticks: vm.scheduler.spent + vm.cpu.used(),
        allocated: vm.heap.stats().allocated,
        limit: vm.config.memory as u64,
    };
    if vm.exchange.overhead.is_too_much(now) {
        return run_out(vm, is_call, false);
    }
    vm.exchange.collected_at = Some(place);
    vm.collect_fully();
    // SAFETY: F1 holds by the contract.
    unsafe { vm.trim_running_stack() };
    let seen = vm.heap.stats().live + vm.heap.external() as u64;
    vm.exchange.overhead.note(now, seen / BYTES_PER_TICK);
    Signal::Reload
}

/// Deals with an instruction for which there is no room although everything has been collected, in this turn
/// or since the last one, or so often that no more time is to go into that.
fn run_out(vm: &mut Vm, is_call: bool, has_collected: bool) -> Signal {
    if vm.open_cleanup_memory() {
        return Signal::Reload;
    }
    if is_call {
        vm.cpu.ticks -= 1;
    }
    // The instruction fails instead of being executed again.
    vm.drop_answers(vm.offset_of(vm.cpu.base()) as u32);
    if !vm.heap.open_reserve() && !vm.open_report_memory() {
        vm.leave_reserve(vm.names.known.heap_exhausted);
        return Signal::Unwind;
    }
    if has_collected {
        // A task that goes on failing for want of memory does not get its collections for nothing. But its
        // critical section is not to be over because of them: the failure has yet to be handled there.
        let ticks = vm.heap.stats().live / BYTES_PER_TICK;
        vm.exchange.charges.add(ticks);
        if vm.scheduler.task().critical > 0 {
            vm.scheduler.turn.extend_critical(ticks);
        }
    }
    failure(vm, Raised::HeapExhausted)
}
