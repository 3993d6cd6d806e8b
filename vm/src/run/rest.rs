//! Tasks at rest: suspended ones that stand still just where they wait.
//!
//! A task that is suspended is interrupted, and a function of the library in it does what there is to do
//! around a suspension, and waits for the end of it. Most tasks of a large tree only wait, and have nothing
//! to do: for these it is enough that no wake-up reaches them. Wake-ups are noted meanwhile, and delivered
//! later.

use super::wake::make_runnable;
use crate::report::{self, Happening};
use crate::task::{Rest, Task, TaskIndex, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::link;

/// Most procedures for suspension that are looked through for one of a task.
const PROCEDURES: usize = 100;

/// Returns whether a task can stand still where it is, with nothing to do for it: it waits without an end, in
/// no cleanup, no form has a limit, and neither procedures nor operations are to be told. One at rest can.
#[inline]
pub(crate) fn can_rest(vm: &Vm, index: TaskIndex) -> bool {
    vm.scheduler.tasks.rest(index) != Rest::None
        || vm.scheduler.tasks.at(index).is_some_and(|task| has_nothing_to_do(vm, task))
}

#[inline]
fn has_nothing_to_do(vm: &Vm, task: &Task) -> bool {
    let flags = task.flags;
    let waits = task.state == TaskState::Waiting && task.wait.is_true() && task.critical == 0;
    waits
        && !(flags.attention() || flags.abort_pending() || flags.suspended())
        && !has_deadline(vm, task)
        && task.extra.as_ref().is_none_or(|extra| {
            extra.limits.is_empty() && extra.interrupts.is_empty() && extra.fund.is_none()
        })
        && task.control.get().is_none_or(|control| {
            control.running.is_empty() && control.unwinding.is_none() && !has_procedures(vm, task)
        })
        && !vm.outside.operations.has_begun_one(task.number)
}

/// Returns whether the wait at which a task is parked ends by itself.
#[inline]
fn has_deadline(vm: &Vm, task: &Task) -> bool {
    debug_assert_eq!(task.has_deadline, link::deadline(&vm.heap, task.wait).is_some());
    task.has_deadline
}

/// Returns whether a task is in a form with procedures for its suspension, as far as it takes to know.
fn has_procedures(vm: &Vm, task: &Task) -> bool {
    let bindings = task.control.get().map(|control| &control.bindings);
    let symbol = vm.names.known.suspension_procedures;
    let Some(mut rest) = bindings.and_then(|bindings| bindings.get(symbol)) else { return false };
    for _ in 0..PROCEDURES {
        // Each is a list that begins with its task; those of makers are not its own.
        let Some(pair) = vm.heap.as_cons(rest) else { return false };
        if vm.heap.car(pair.car) == Some(task.object) {
            return true;
        }
        rest = pair.cdr;
    }
    true
}

/// Has tasks that [`can_rest`] stand still once more, by the running task, at the time `now`.
pub(crate) fn begin_rest(vm: &mut Vm, tasks: &[TaskIndex], stops_clock: bool, now: u64) {
    let by = vm.scheduler.task().object;
    vm.scheduler.tasks.make_standstills(&mut vm.heap);
    for &index in tasks {
        // It could have come before the task waits.
        vm.scheduler.points.note_request(index, false);
        let Some((rest, standstill)) = vm.scheduler.tasks.rest_mut(index) else { continue };
        standstill.times = standstill.times.saturating_add(1);
        if *rest != Rest::None {
            continue;
        }
        *rest = Rest::Rests;
        standstill.by = by;
        if stops_clock {
            standstill.stop_clock(now);
        }
        report::note(vm, index, Happening::Waits);
    }
}

/// Resumes tasks at rest once. Those go on that were suspended no more often.
pub(crate) fn resume_from_rest(vm: &mut Vm, tasks: &[TaskIndex], now: u64) {
    for &index in tasks {
        let Some((rest, standstill)) = vm.scheduler.tasks.rest_mut(index) else { continue };
        if *rest == Rest::None {
            continue;
        }
        standstill.times = standstill.times.saturating_sub(1);
        if standstill.times == 0 {
            let was_woken = std::mem::take(rest) == Rest::Woken;
            let by = standstill.end_rest(now);
            go_on_from_rest(vm, index, was_woken, by);
        }
    }
}

/// Has a task at rest stand still no more. Returns how often it was to be resumed; 0 if it was not at rest.
pub(crate) fn end_rest(vm: &mut Vm, index: TaskIndex, now: u64) -> u32 {
    let Some((rest, standstill)) = vm.scheduler.tasks.rest_mut(index) else { return 0 };
    if *rest == Rest::None {
        return 0;
    }
    let times = std::mem::take(&mut standstill.times);
    let was_woken = std::mem::take(rest) == Rest::Woken;
    let by = standstill.end_rest(now);
    go_on_from_rest(vm, index, was_woken, by);
    times
}

/// Has a task go on whose rest, which `by` has begun, is over: what has come meanwhile reaches it.
#[inline(always)]
fn go_on_from_rest(vm: &mut Vm, index: TaskIndex, was_woken: bool, by: Value) {
    vm.heap.log_if_marking(by);
    if was_woken {
        let is_urgent = vm.scheduler.tasks.at(index).is_some_and(|task| task.flags.attention());
        make_runnable(vm, index, is_urgent);
    } else {
        report::note(vm, index, Happening::Waits);
    }
}
