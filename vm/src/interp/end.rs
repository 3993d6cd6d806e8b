//! The end of a task, before others are told of it: the task lets go of what it holds.
//!
//! A task that comes to its end while it holds something, noted by `%SET-HELD`, calls `%RELEASE-HELD` with
//! that. The call runs as a cleanup at the task's root: aborts wait for it, it has an allowance if the end is
//! forced, and the end that it puts off comes when it returns, fails or is cut off.

use super::{Leave, start};
use crate::saved_pc::SavedPc;
use crate::task::{Entry, EntryKind, RunningCleanup, TaskEnd, UnwindTarget, Unwinding};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

/// Works on the end of the running task, which has left all its frames: has it let go of what it holds.
///
/// # Errors
/// [`Leave::Ended`] when there is nothing left to do.
pub(super) fn end_task(vm: &mut Vm) -> Result<(), Leave> {
    resume_end(vm);
    let held = event::held(&vm.heap, vm.scheduler.task().object);
    if held.is_nil() {
        return Err(Leave::Ended);
    }
    put_off_end(vm);
    event::set_held(&mut vm.heap, vm.scheduler.task().object, Value::NIL);
    start::begin_again(vm, vm.names.known.release_held, held);
    Ok(())
}

/// Begins a cleanup at the root of the running task, after which the task ends as it would now.
fn put_off_end(vm: &mut Vm) {
    let target = UnwindTarget::Root(vm.scheduler.turn.ending.take().unwrap_or(TaskEnd::Succeeded));
    let Vm { scheduler, outside, config, cpu, .. } = vm;
    let allowance = if target.is_forced() {
        // Others wait for what is let go, so what the cleanups before have used up does not count.
        scheduler.task_mut().extra_mut().fund = None;
        scheduler.allow_cleanup(Some(0), 0, cpu.used(), &mut outside.host, config)
    } else {
        None
    };
    let values = std::mem::take(&mut vm.exchange.values);
    let pending = Some(Unwinding { target, values });
    let entry = Entry {
        data: Value::NIL,
        pc: SavedPc::NONE,
        base: start::FIRST_BASE,
        bindings: 0,
        window: 0,
        want: 0,
        kind: EntryKind::Running,
    };
    let running = RunningCleanup { pending, allowance, ..RunningCleanup::default() };
    vm.scheduler.task_mut().control.run_cleanup(entry, running);
}

/// Takes up the end that a cleanup at the root of the running task has put off, if that is what has returned.
fn resume_end(vm: &mut Vm) {
    let task = vm.scheduler.task_mut();
    if task.control.get().is_none_or(|control| control.running.is_empty()) {
        return;
    }
    task.control.entries.pop();
    let pending = task.control.running.pop().and_then(|running| running.pending);
    if let Some(Unwinding { target: UnwindTarget::Root(end), values }) = pending {
        vm.scheduler.turn.ending = Some(end);
        vm.exchange.values = values;
    }
}
