//! Tasks: making them, what is known of them, ending them, limits, guards and critical sections.

use crate::builtins::LIMIT;
use crate::builtins::event::{nanoseconds, take_or_park};
use crate::builtins::rights::in_force as rights_in_force;
use crate::heap::{Heap, Kind};
use crate::raise::{Exit, Outcome, Raised};
use crate::report;
use crate::run::{self, SpawnOptions};
use crate::schedule::{Amount, Measure, Scheduler};
use crate::task::{DEFAULT_PRIORITY, PRIORITIES, TaskEnd, TaskIndex, TaskNumber, TaskState, guard};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{WaitOptions, event};

use super::expect::exactly;

/// Most limits that may be open in a task at once: each turn, and each timer, goes over them.
const MAX_LIMITS: usize = 10_000;

/// Returns the task that `v` is.
///
/// # Errors
/// A failure if it is none.
pub(super) fn expect_task(vm: &mut Vm, v: Value) -> Result<Value, Exit> {
    if vm.heap.is(v, Kind::Task) { Ok(v) } else { vm.exchange.not_a(v, vm.names.known.task) }
}

/// Returns whether a task has ended.
#[inline]
pub(super) fn has_ended(heap: &Heap, task: Value) -> bool {
    !heap.slot_or_nil(task, event::STATE).is_fixnum()
}

/// Returns a number of ticks.
fn ticks_argument(vm: &mut Vm, v: Value) -> Result<u64, Exit> {
    match v.as_index() {
        Some(ticks) => Ok(ticks as u64),
        None if vm.heap.is(v, Kind::Bignum) => Ok(i64::MAX as u64),
        None => vm.exchange.type_error(v, "UNSIGNED-BYTE"),
    }
}

/// Waits for the end of a task. `None` once it has ended.
fn wait_for_end(vm: &mut Vm, task: Value, urgent: bool, child: bool) -> Option<Outcome> {
    if has_ended(&vm.heap, task) {
        vm.scheduler.cancel_wait(&mut vm.heap);
        return None;
    }
    let what = vm.names.known.task_end;
    let options = WaitOptions { urgent, child, what, ..WaitOptions::default() };
    Some(take_or_park(vm, task, options))
}

/// Number and object of the task with this index, if it is one that is listed.
fn listed_task(scheduler: &Scheduler, index: usize, shows_hidden: bool) -> Option<(TaskNumber, Value)> {
    let task = scheduler.find(TaskIndex(index as u32))?;
    let is_listed = task.state != TaskState::Ended && (shows_hidden || !task.flags.hidden());
    is_listed.then_some((task.number, task.object))
}

pub(super) fn spawn(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let argument = |index: usize| arguments.get(index).copied().unwrap_or(Value::NIL);
    let function = vm.callable(arguments[0])?;
    let priority = match argument(2) {
        v if v.is_nil() => DEFAULT_PRIORITY,
        v => match v.as_index().filter(|&priority| priority < PRIORITIES) {
            Some(priority) => priority as u8,
            None => return vm.exchange.not_written(v, "(INTEGER 0 7)"),
        },
    };
    let budget = match argument(3) {
        v if v.is_nil() => None,
        v => Some(ticks_argument(vm, v)?),
    };
    let daemon = argument(4);
    let is_service = daemon == vm.names.known.service;
    let options = SpawnOptions {
        name: argument(1),
        priority,
        budget,
        daemon: daemon.is_true(),
        hidden: daemon == vm.names.known.internal || is_service,
        is_service,
        notify: argument(5),
    };
    let id = run::make_task(vm, function, Value::NIL, options)?;
    Ok(vm.scheduler.tasks.get(id).map_or(Value::NIL, |task| task.object))
}

pub(super) fn current_task(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    Ok(vm.scheduler.task().object)
}

pub(super) fn taskp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(vm.heap.is(arguments[0], Kind::Task)))
}

pub(super) fn task_status(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    let task = expect_task(vm, arguments[0])?;
    let state = vm.heap.slot_or_nil(task, event::STATE);
    let Some(index) = event::task_index(&vm.heap, task) else { return Ok(state) };
    let known = &vm.names.known;
    let task = vm.scheduler.tasks.at(index);
    Ok(match task.map(|task| task.state) {
        Some(TaskState::Waiting) if task.is_some_and(|task| vm.scheduler.is_suspended(&vm.heap, task)) => {
            known.suspended
        }
        Some(TaskState::Waiting | TaskState::Reading | TaskState::Writing) => known.waiting,
        _ => known.running,
    })
}

pub(super) fn task_number(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let task = expect_task(vm, arguments[0])?;
    let Some(index) = event::task_index(&vm.heap, task) else { return Ok(Value::NIL) };
    vm.scheduler.points.sees_numbers = true;
    let number = vm.scheduler.find(index).map_or(TaskNumber::NONE, |task| task.number);
    let owner = match report::number_of_owner(vm, task) {
        0 => Value::NIL,
        owner => Value::index(owner as usize),
    };
    vm.give_values(&[Value::index(number.0 as usize), owner])
}

pub(super) fn task_ticks(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let task = expect_task(vm, arguments[0])?;
    let Some(index) = event::task_index(&vm.heap, task) else { return Ok(Value::NIL) };
    let ticks = vm.scheduler.find(index).map_or(0, |task| task.ticks);
    Ok(Value::fixnum(ticks as i64).unwrap_or(Value::NIL))
}

pub(super) fn task_end(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    let task = expect_task(vm, arguments[0])?;
    if has_ended(&vm.heap, task) { give_end(vm, task) } else { Ok(Value::NIL) }
}

/// Returns the status of a task that has ended, then its values, or the condition.
fn give_end(vm: &mut Vm, task: Value) -> Outcome {
    let (status, result) =
        (vm.heap.slot_or_nil(task, event::STATE), vm.heap.slot_or_nil(task, event::RESULT));
    let has_one_value = vm.heap.header(task).is_some_and(|header| header.aux == 1);
    vm.exchange.values.clear();
    vm.exchange.values.push(status);
    if status == vm.names.known.failed {
        vm.exchange.values.push(event::failure(&vm.heap, result).0);
    } else if has_one_value {
        vm.exchange.values.push(result);
    } else {
        let mut rest = result;
        while let Some(pair) = vm.heap.as_cons(rest) {
            vm.exchange.values.push(pair.car);
            rest = pair.cdr;
        }
    }
    Err(Exit::Values)
}

pub(super) fn task_failure(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let task = expect_task(vm, arguments[0])?;
    if vm.heap.slot_or_nil(task, event::STATE) != vm.names.known.failed {
        return Ok(Value::NIL);
    }
    let (condition, history) = event::failure(&vm.heap, vm.heap.slot_or_nil(task, event::RESULT));
    vm.give_values(&[condition, history])
}

pub(super) fn task_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let task = expect_task(vm, arguments[0])?;
    if vm.heap.slot_or_nil(task, event::STATE) != vm.names.known.succeeded {
        return Ok(Value::NIL);
    }
    let result = vm.heap.slot_or_nil(task, event::RESULT);
    let has_one_value = vm.heap.header(task).is_some_and(|header| header.aux == 1);
    Ok(if has_one_value { result } else { vm.heap.car(result).unwrap_or(Value::NIL) })
}

pub(super) fn all_tasks(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if vm.scheduler.tasks.places() > LIMIT {
        return Err(Exit::Slowly);
    }
    vm.scheduler.points.sees_order = true;
    let mut tasks: Vec<(TaskNumber, Value)> = Vec::new();
    for index in 0..vm.scheduler.tasks.places() {
        tasks.extend(listed_task(&vm.scheduler, index, arguments[0].is_true()));
    }
    tasks.sort_unstable_by_key(|&(number, _)| number);
    vm.exchange.charge(64 * tasks.len());
    let objects: Vec<Value> = tasks.into_iter().map(|(_, object)| object).collect();
    Ok(vm.heap.list(&objects)?)
}

pub(super) fn tasks_from(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [place, hidden] = exactly(arguments);
    let Some(place) = place.as_index() else { return vm.exchange.type_error(place, "UNSIGNED-BYTE") };
    let end = vm.scheduler.tasks.places().min(place.saturating_add(LIMIT));
    vm.scheduler.points.sees_order = true;
    let mut objects = Vec::new();
    for index in place..end {
        objects.extend(listed_task(&vm.scheduler, index, hidden.is_true()).map(|(_, object)| object));
    }
    let list = vm.heap.list(&objects)?;
    vm.exchange.charge(LIMIT + 8 * objects.len());
    let next = if end < vm.scheduler.tasks.places() { Value::index(end) } else { Value::NIL };
    vm.give_values(&[list, next])
}

pub(super) fn join(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [task, child] = exactly(arguments);
    if vm.scheduler.task().wait.is_nil() {
        vm.scheduler.point()?;
    }
    let task = expect_task(vm, task)?;
    match wait_for_end(vm, task, false, child.is_true()) {
        Some(outcome) => outcome,
        None => give_end(vm, task),
    }
}

pub(super) fn request_abort(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let task = expect_task(vm, arguments[0])?;
    if let Some(index) = event::task_index(&vm.heap, task)
        && let Some(id) = vm.scheduler.tasks.id_at(index)
    {
        vm.abort(id);
    }
    Ok(Value::NIL)
}

pub(super) fn abort_task(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let task = expect_task(vm, arguments[0])?;
    if vm.scheduler.task().wait.is_nil() {
        if task == vm.scheduler.task().object {
            if vm.scheduler.task().runs_cleanup() || vm.scheduler.task().critical > 0 {
                return request_abort(vm, arguments);
            }
            vm.scheduler.task_mut().flags.set_urgent(true);
            vm.scheduler.task_mut().begin_end(TaskEnd::Aborted);
            return Err(Exit::Unwind);
        }
        request_abort(vm, arguments)?;
        if vm.scheduler.task().critical > 0 {
            return Ok(Value::NIL);
        }
    }
    wait_for_end(vm, task, true, false).unwrap_or(Ok(Value::NIL))
}

pub(super) fn add_checkpoint(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    vm.scheduler.wait_for_deliveries()?;
    let task = vm.scheduler.task().object;
    event::reserve_checkpoints(&mut vm.heap, task)?;
    let list = vm.heap.cons(arguments[0], event::checkpoints(&vm.heap, task))?;
    vm.signal_event(task, arguments)?;
    event::set_checkpoints(&mut vm.heap, task, list);
    Ok(Value::NIL)
}

pub(super) fn checkpoints(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    let task = expect_task(vm, arguments[0])?;
    Ok(event::checkpoints(&vm.heap, task))
}

pub(super) fn held(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    Ok(event::held(&vm.heap, vm.scheduler.task().object))
}

pub(super) fn set_held(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if !arguments[0].is_list() {
        return vm.exchange.type_error(arguments[0], "LIST");
    }
    event::set_held(&mut vm.heap, vm.scheduler.task().object, arguments[0]);
    Ok(arguments[0])
}

pub(super) fn make_guard(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let function = vm.callable(arguments[0])?;
    vm.scheduler.points.has_guards = true;
    let height = vm.scheduler.task().control.get().map_or(0, |control| control.entries.len());
    let mut slots = [Value::NIL; guard::LENGTH];
    slots[guard::RIGHTS] = rights_in_force(vm);
    slots[guard::TASK] = vm.scheduler.task().object;
    slots[guard::FUNCTION] = function;
    slots[guard::IS_OPEN] = Value::T;
    slots[guard::HEIGHT] = Value::index(height);
    Ok(vm.heap.alloc_record(Kind::Record, 0, guard::AUX, &slots)?)
}

pub(super) fn interrupt_task(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [task, function] = exactly(arguments);
    let task = expect_task(vm, task)?;
    let mut slots = [Value::NIL; guard::LENGTH];
    slots[guard::RIGHTS] = Value::UNSUPPLIED;
    slots[guard::TASK] = task;
    slots[guard::FUNCTION] = vm.callable(function)?;
    slots[guard::IS_OPEN] = Value::T;
    // It does not act within a cleanup.
    slots[guard::HEIGHT] = Value::small(0);
    let guard = vm.heap.alloc_record(Kind::Record, 0, guard::AUX, &slots)?;
    run::interrupt_by(vm, guard);
    Ok(Value::NIL)
}

pub(super) fn stand_still(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [stands, stops_clock] = exactly(arguments);
    if stands.is_true() {
        run::stand_still(vm, stops_clock.is_true());
    } else {
        run::go_on(vm);
    }
    Ok(Value::NIL)
}

pub(super) fn interrupt_by(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    if guard::is_guard(&vm.heap, arguments[0]) {
        guard::set_open(&mut vm.heap, arguments[0], true);
        run::interrupt_by(vm, arguments[0]);
    }
    Ok(Value::NIL)
}

pub(super) fn close_guard(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    if guard::is_guard(&vm.heap, arguments[0]) {
        guard::set_open(&mut vm.heap, arguments[0], false);
    }
    Ok(Value::NIL)
}

/// Returns what quotas count under this number, which the library knows.
fn measure_argument(vm: &mut Vm, v: Value) -> Result<Measure, Exit> {
    match v.as_index() {
        Some(0) => Ok(Measure::Ticks),
        Some(1) => Ok(Measure::Bytes),
        Some(2) => Ok(Measure::Tasks),
        Some(3) => Ok(Measure::Operations),
        _ => vm.exchange.not_written(v, "(INTEGER 0 3)"),
    }
}

pub(super) fn open_limit(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let argument = |index: usize| arguments.get(index).copied().unwrap_or(Value::NIL);
    let (tag, seconds, units, measure) = (argument(0), argument(1), argument(2), argument(3));
    let time = if seconds.is_nil() { None } else { Some(nanoseconds(vm, seconds)?) };
    let amount = if units.is_nil() {
        None
    } else {
        let units = ticks_argument(vm, units)?;
        let is_quota = measure.is_true();
        let measure = if is_quota { measure_argument(vm, measure)? } else { Measure::Ticks };
        Some(Amount { measure, units, is_quota })
    };
    let open = vm.scheduler.task().extra.as_ref().map_or(0, |extra| extra.limits.len());
    if open >= MAX_LIMITS {
        return vm.exchange.raise(Raised::StackExhausted);
    }
    Ok(Value::boolean(run::open_limit(vm, tag, time, amount)))
}

pub(super) fn is_over_quota(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let task = expect_task(vm, arguments[0])?;
    let Some(index) = event::task_index(&vm.heap, task) else { return Ok(Value::NIL) };
    let Some(account) = vm.scheduler.find(index).map(|task| task.account) else { return Ok(Value::NIL) };
    Ok(Value::boolean(vm.scheduler.accounts.is_quota_spent_for(account, index)))
}

pub(super) fn expire_limit(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [task, tag, cause] = exactly(arguments);
    vm.scheduler.point()?;
    if let Some(index) = event::task_index(&vm.heap, task) {
        run::expire_limit(vm, index, tag, cause);
    }
    Ok(Value::NIL)
}

pub(super) fn in_critical_section(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(vm.scheduler.task().critical > 0))
}

pub(super) fn begin_critical(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let ticks = i64::from(vm.config.critical_ticks);
    let task = vm.scheduler.task_mut();
    if task.critical == 0 {
        // The ticks of the slice so far are taken off at its end.
        task.critical = 1;
        vm.scheduler.turn.critical_left = ticks;
        vm.scheduler.turn.critical_is_new = true;
        vm.exchange.charges.end_slice();
    } else {
        task.critical = task.critical.saturating_add(1);
    }
    Ok(Value::NIL)
}

pub(super) fn end_critical(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let is_turn_spent = vm.scheduler.turn.is_spent();
    let task = vm.scheduler.task_mut();
    task.critical = task.critical.saturating_sub(1);
    // Others wait for the end of a section that goes beyond its turn.
    if task.critical == 0 && (task.flags.attention() || is_turn_spent) {
        vm.exchange.charges.end_slice();
    }
    Ok(Value::NIL)
}
