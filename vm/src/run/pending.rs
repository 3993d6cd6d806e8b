//! Delivering what is pending for a task: aborts, expired limits, interrupts by guards.
//!
//! None of these acts at once. They are noted in the task, which gets the flag `attention`, and are delivered
//! just before it next runs, where [`deliver_pending`] turns them into an unwinding or a call. While a
//! cleanup runs they wait, and the cleanup has an allowance from then on; the unwinding of an abort or of an
//! expired limit gives one to each cleanup that it meets. A cleanup that outruns its allowance is left, and
//! the unwinding goes on outward. All allowances come out of one fund, so no task is unkillable.

use super::cleanup::{allow_cleanups, cut_off_cleanup};
use super::wake::call_attention;
use crate::interp::{self, Leave};
use crate::task::{AccountId, Control, TaskEnd, UnwindTarget, Unwinding, guard};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

/// Has `guard` interrupt the task that it guards, if it is open.
pub(crate) fn interrupt_by(vm: &mut Vm, guard: Value) {
    let task = vm.heap.slot_or_nil(guard, guard::TASK);
    let Some(index) = event::task_index(&vm.heap, task) else { return };
    if !guard::is_open(&vm.heap, guard) {
        return;
    }
    if let Some(task) = vm.scheduler.find_mut(index) {
        task.extra_mut().interrupts.push(guard);
        call_attention(vm, index);
    }
}

/// Delivers what is pending for the running task, which is loaded: it may begin to unwind, or find itself in
/// another function.
///
/// # Errors
/// The reason for which the task gives up the processor before it runs.
pub(super) fn deliver_pending(vm: &mut Vm) -> Result<(), Leave> {
    let was_unwinding = vm.scheduler.task().control.is_unwinding();
    let guard = take_pending(vm);
    if guard.is_some() || vm.scheduler.task().control.is_unwinding() != was_unwinding {
        // The task will not do what it stands before.
        vm.scheduler.points.is_open = false;
    }
    match guard {
        Some(guard) => {
            let function = vm.heap.slot_or_nil(guard, guard::FUNCTION);
            let rights = vm.heap.slot_or_nil(guard, guard::RIGHTS);
            interp::interrupt(vm, function, &[], (rights != Value::UNSUPPLIED).then_some(rights))
        }
        None => Ok(()),
    }
}

/// Turns what is pending for the running task into an unwinding, or returns a guard whose function is to be
/// called where the task stands. Requests that have to wait for the end of a cleanup, or of a critical
/// section, stay noted.
fn take_pending(vm: &mut Vm) -> Option<Value> {
    let scheduler = &mut vm.scheduler;
    if scheduler.task().account != AccountId::NONE && scheduler.is_task_spent() {
        scheduler.task_mut().flags.set_attention(true);
    }
    if !scheduler.task().flags.attention() || scheduler.task().critical > 0 {
        return None;
    }
    let cleanup = scheduler.task().control.get().and_then(Control::innermost_cleanup);
    if cleanup.is_some() && cut_off_cleanup(vm) {
        return None;
    }
    let scheduler = &mut vm.scheduler;
    let ends = scheduler.task().flags.abort_pending() || scheduler.is_task_spent();
    if ends && cleanup.is_none() {
        end_running_task(vm);
        return None;
    }
    if scheduler.task().flags.suspended() {
        // Other pending requests are delivered when it goes on.
        scheduler.task_mut().flags.set_attention(false);
        return None;
    }
    let mut waits = ends;
    // One that was opened in the cleanup ends its form there, whatever else is pending.
    if let Some((entry, cause)) = scheduler.task().expired_limit(cleanup) {
        unwind_to_limit(vm, entry, cause);
        // Other pending requests are examined again when the unwinding is over.
        return None;
    }
    let expired = scheduler.task().expired_limit(None);
    waits |= expired.is_some();
    if waits {
        let depth = if ends { 0 } else { expired.map_or(0, |(entry, _)| entry + 1) };
        allow_cleanups(vm, depth);
    }
    let interrupt = take_interrupt(vm, cleanup);
    let task = vm.scheduler.task_mut();
    let has_more = task.extra.as_ref().is_some_and(|extra| !extra.interrupts.is_empty());
    task.flags.set_attention(waits || has_more);
    interrupt
}

/// Begins to end the running task.
fn end_running_task(vm: &mut Vm) {
    vm.scheduler.cancel_wait(&mut vm.heap);
    let is_over_quota = vm.scheduler.is_task_over_quota();
    let task = vm.scheduler.task_mut();
    let end = if task.flags.abort_pending() || is_over_quota { TaskEnd::Aborted } else { TaskEnd::Spent };
    task.flags.set_abort_pending(false);
    task.flags.set_attention(false);
    task.flags.set_urgent(true);
    if let Some(extra) = &mut task.extra {
        extra.interrupts.clear();
    }
    let unwinding = task.control.get().and_then(|control| control.unwinding.as_ref());
    if !unwinding.is_some_and(|unwinding| matches!(unwinding.target, UnwindTarget::Root(_))) {
        task.begin_end(end);
    }
}

/// Begins to unwind the running task to the entry of a limit, unless it is on its way further out.
fn unwind_to_limit(vm: &mut Vm, entry: usize, cause: Value) {
    vm.scheduler.cancel_wait(&mut vm.heap);
    let control = &mut vm.scheduler.task_mut().control;
    let passes_by = control.unwinding.as_ref().is_some_and(|unwinding| match unwinding.target {
        UnwindTarget::Root(_) => true,
        UnwindTarget::Entry(index) | UnwindTarget::Limit(index) | UnwindTarget::Cleanup(index) => {
            index <= entry
        }
        UnwindTarget::Return { entries, .. } => entries <= entry,
    });
    if !passes_by {
        control.unwinding = Some(Unwinding { target: UnwindTarget::Limit(entry), values: vec![cause] });
    }
}

/// Takes the first guard whose interrupt may be delivered now.
fn take_interrupt(vm: &mut Vm, cleanup: Option<usize>) -> Option<Value> {
    let task = vm.scheduler.task();
    let interrupts = task.extra.as_ref().map_or(&[][..], |extra| &extra.interrupts[..]);
    if interrupts.is_empty() || task.control.is_unwinding() {
        return None;
    }
    let may_act = |&guard: &Value| {
        let height = vm.heap.slot_or_nil(guard, guard::HEIGHT).as_index().unwrap_or(0);
        cleanup.is_none_or(|cleanup| cleanup < height)
    };
    let position = interrupts.iter().position(may_act)?;
    let guard = vm.scheduler.task_mut().extra_mut().interrupts.remove(position);
    if !guard::is_open(&vm.heap, guard) {
        return None;
    }
    guard::set_open(&mut vm.heap, guard, false);
    Some(guard)
}
