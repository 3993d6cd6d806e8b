//! The end of a task: noting its outcome, waking the tasks that wait for it, and ending the run with the
//! last.

use super::abort::abort_others;
use super::pending::interrupt_by;
use super::question::answer_call;
use super::signal::{keep, wake_waiters};
use crate::heap::Kind;
use crate::interp;
use crate::raise::Exit;
use crate::report;
use crate::schedule::Measure;
use crate::task::{AccountId, TaskEnd, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{event, lineage};

/// Notes how the running task has ended, wakes the tasks that wait for it, and answers a call from outside.
pub(super) fn finish_task(vm: &mut Vm) {
    let end = match vm.scheduler.turn.ending.take().unwrap_or(TaskEnd::Succeeded) {
        TaskEnd::Spent => TaskEnd::Failed(vm.names.known.budget_exhausted),
        end => end,
    };
    let mut values = std::mem::take(&mut vm.exchange.values);
    let object = vm.scheduler.task().object;
    // These objects are made before others learn of the end: an allocation here cannot be retried.
    let result = match (end, &values[..]) {
        (TaskEnd::Succeeded, &[value]) => value,
        (TaskEnd::Succeeded, values) => allocate_without_retry(vm, |vm| Ok(vm.heap.list(values)?)),
        (TaskEnd::Failed(condition), _) => with_history(vm, condition),
        _ => Value::NIL,
    };
    let has_one_value = end == TaskEnd::Succeeded && values.len() == 1;
    vm.heap.set_aux(object, Kind::Task, u16::from(has_one_value));
    lineage::end(&mut vm.heap, object);
    let status = match end {
        TaskEnd::Succeeded => vm.names.known.succeeded,
        TaskEnd::Failed(_) | TaskEnd::Spent => vm.names.known.failed,
        TaskEnd::Aborted => vm.names.known.aborted,
    };
    if let Some(slots) = vm.heap.slots_mut::<{ event::TASK_LENGTH }>(object, Kind::Task) {
        slots[event::RESULT] = result;
        slots[event::STATE] = status;
    }
    let is_awaited = event::is_awaited(&vm.heap, object);
    let task = vm.scheduler.task_mut();
    let notify = std::mem::replace(&mut task.notify, Value::NIL);
    let account = std::mem::replace(&mut task.account, AccountId::NONE);
    let is_hidden = task.flags.hidden();
    interp::start::drop_frames(vm);
    if !is_hidden {
        vm.scheduler.accounts.give_back(account, Measure::Tasks);
    }
    vm.scheduler.accounts.leave(account);
    report::trace_end(vm, vm.heap.slot_or_nil(object, event::NAME), status);
    // See `with_history`.
    let history = vm.heap.as_cons(result).filter(|_| matches!(end, TaskEnd::Failed(_))).map(|pair| pair.cdr);
    report_end(vm, end, history, is_awaited || notify.is_true());
    let task = vm.scheduler.task_mut();
    task.state = TaskState::Ended;
    if task.flags.kept() {
        if task.extra.is_none() {
            let extra = vm.scheduler.tasks.make_extra();
            vm.scheduler.task_mut().extra = Some(extra);
        }
        let extra = vm.scheduler.task_mut().extra_mut();
        extra.end = Some(end);
        extra.values.clone_from(&values);
        if answer_call(vm, end, &values) {
            // The answer is given, so the record need not be kept.
            vm.scheduler.task_mut().flags.set_kept(false);
        }
    }
    values.clear();
    vm.exchange.values = values;
    // The list of arguments is made only if a task waits for it.
    allocate_without_retry(vm, |vm| {
        let end = vm.names.known.task_end;
        let arguments = if is_awaited { vm.heap.cons(end, Value::NIL)? } else { Value::NIL };
        wake_waiters(vm, object, arguments).map(|()| Value::NIL)
    });
    if let Some(cell) = vm.heap.as_cons(notify) {
        vm.heap.set_car(notify, object);
        keep(vm, cell.car, notify, object);
    } else if notify.is_true() {
        interrupt_by(vm, notify);
    }
    end_run_if_over(vm, end);
}

/// Returns what is kept of the failure of the running task: the condition; for a form that is told of it, a
/// cons of that and the history, which `%END-TASK` has left.
fn with_history(vm: &mut Vm, condition: Value) -> Value {
    let task = vm.scheduler.task_mut();
    let left = task.extra.as_mut().filter(|_| task.notify.is_true() && !task.flags.kept());
    let Some(history) = left.and_then(|extra| extra.values.pop()) else { return condition };
    // The condition alone if there is no room: the form fails with that.
    vm.heap.cons(condition, history).unwrap_or(condition)
}

/// Allocates where an instruction cannot be done again, at the end of a task or between turns: with the
/// reserve of the heap if need be, and with a collection.
pub(super) fn allocate_without_retry(
    vm: &mut Vm,
    mut allocate: impl FnMut(&mut Vm) -> Result<Value, Exit>,
) -> Value {
    if let Ok(value) = allocate(vm) {
        return value;
    }
    // Many tasks may end while there is no room: not each of them is worth a collection.
    let opens = vm.heap.open_reserve();
    let value = allocate(vm).or_else(|_| {
        vm.collect_fully();
        allocate(vm)
    });
    if opens {
        vm.heap.close_reserve();
    }
    value.unwrap_or(Value::NIL)
}

/// Reports the failure that has ended the running task, unless a task waits for it or the embedder wants to.
/// `history` is that of a failure that a form is told of.
fn report_end(vm: &mut Vm, end: TaskEnd, history: Option<Value>, is_awaited: bool) {
    if vm.watch.journal.is_kept
        && let TaskEnd::Failed(condition) = end
    {
        report::note_end_by_failure(vm, condition, history);
    }
    let task = vm.scheduler.task_mut();
    if task.flags.kept() || is_awaited {
        return;
    }
    let TaskEnd::Failed(condition) = end else { return };
    let report = task.extra.as_mut().and_then(|extra| extra.report.take());
    let (name, number) = (vm.heap.slot_or_nil(task.object, event::NAME), task.number);
    let label = report::label_of(vm, name, number);
    let began = vm.place_of_code(interp::start::first_code_of(vm.scheduler.task()));
    let began = began.map_or(String::new(), |place| {
        format!(", begun at {}:{}:{}", place.source, place.line, place.column)
    });
    let text = report.map_or_else(|| report::report_in_short(&vm.heap, condition), |report| report.text());
    vm.outside.complain(&format!("In {label}{began}:\n{text}"));
}

/// Ends the run with the running task, if it is the last that matters.
fn end_run_if_over(vm: &mut Vm, end: TaskEnd) {
    let scheduler = &mut vm.scheduler;
    scheduler.counts.alive -= 1;
    if !scheduler.task().flags.daemon() {
        scheduler.counts.foreground -= 1;
    }
    let Some(main) = scheduler.main else { return };
    let main_has_failed = main.index == scheduler.turn.index && end != TaskEnd::Succeeded;
    // All others may have been asked before; each of them comes by here.
    let has_newer = scheduler.counts.made > scheduler.counts.made_at_end;
    if has_newer && (main_has_failed || scheduler.counts.foreground == 0) {
        abort_others(vm);
    }
}
