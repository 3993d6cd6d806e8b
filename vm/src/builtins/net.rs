//! Nets: tasks that belong to a form, from which the library makes `task-net` and `or-parallel`.
//!
//! A net is a list of a wait and the tasks. The wait is for no event; each of the tasks is put into its queue
//! at its end.

use smallvec::{SmallVec, smallvec};

use crate::builtins::LIMIT;
use crate::builtins::event::begin_wait;
use crate::builtins::task::has_ended;
use crate::heap::{Heap, Kind};
use crate::raise::{Exit, Outcome};
use crate::run::{self, SpawnOptions};
use crate::task::TaskId;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{WaitOptions, event, link};

use super::expect::exactly;

/// Returns the wait of a net.
///
/// # Errors
/// A failure if it is none.
fn wait_of_net(vm: &mut Vm, net: Value) -> Result<Value, Exit> {
    match vm.heap.as_cons(net) {
        Some(pair) if vm.heap.is(pair.car, Kind::Wait) => Ok(pair.car),
        _ => vm.exchange.type_error(net, "LIST"),
    }
}

/// Returns the first task of a net of which something is true.
fn find_in_net(heap: &Heap, net: Value, test: impl Fn(Value) -> bool) -> Option<Value> {
    let mut rest = heap.cdr(net)?;
    for _ in 0..LIMIT {
        let pair = heap.as_cons(rest)?;
        if test(pair.car) {
            return Some(pair.car);
        }
        rest = pair.cdr;
    }
    None
}

fn has_net_ended(heap: &Heap, net: Value) -> bool {
    find_in_net(heap, net, |task| !has_ended(heap, task)).is_none()
}

/// Returns whether a task has ended with one of `statuses`, a list of at most three.
fn has_status(heap: &Heap, task: Value, statuses: Value) -> bool {
    let status = heap.slot_or_nil(task, event::STATE);
    let mut rest = statuses;
    for _ in 0..3 {
        let Some(pair) = heap.as_cons(rest) else { return false };
        if pair.car == status {
            return true;
        }
        rest = pair.cdr;
    }
    false
}

pub(super) fn spawn_net(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (what, mut names, functions) = (arguments[0], arguments[1], &arguments[2..]);
    let priority = vm.scheduler.task().priority;
    let wait = begin_wait(vm, Value::NIL, WaitOptions { keeps: true, what, ..WaitOptions::default() })?;
    let mut made: SmallVec<[TaskId; 8]> = SmallVec::new();
    // The first value is the net.
    let mut values: SmallVec<[Value; 8]> = smallvec![Value::NIL];
    let mut make = || {
        for &function in functions {
            let name = vm.heap.car(names).unwrap_or(Value::NIL);
            names = vm.heap.cdr(names).unwrap_or(Value::NIL);
            let options = SpawnOptions { name, priority, notify: wait, ..SpawnOptions::default() };
            let function = vm.callable(function)?;
            let id = run::make_task(vm, function, Value::NIL, options)?;
            made.push(id);
            values.push(vm.scheduler.tasks.get(id).map_or(Value::NIL, |task| task.object));
        }
        let tasks = vm.heap.list(&values[1..])?;
        Ok(vm.heap.cons(wait, tasks)?)
    };
    match make() {
        Ok(net) => values[0] = net,
        Err(exit) => {
            // None of them has run yet, so nothing has happened.
            made.into_iter().for_each(|id| vm.forget(id));
            return Err(exit);
        }
    }
    vm.exchange.charge(64 * functions.len());
    vm.give_values(&values)
}

pub(super) fn await_net(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [net, statuses] = exactly(arguments);
    let wait = wait_of_net(vm, net)?;
    vm.scheduler.task_mut().wait = Value::NIL;
    while let Some(task) = link::take_kept(&mut vm.heap, wait) {
        vm.exchange.charge(1);
        if has_status(&vm.heap, task, statuses) {
            return Ok(task);
        }
    }
    if has_net_ended(&vm.heap, net) {
        // One that has ended when there was no room to say so has not been in the queue.
        let ended = find_in_net(&vm.heap, net, |task| has_status(&vm.heap, task, statuses));
        return Ok(ended.unwrap_or(Value::NIL));
    }
    vm.scheduler.park_at(wait, None)
}

pub(super) fn end_net(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    if arguments[0].is_nil() || has_net_ended(&vm.heap, arguments[0]) {
        Ok(Value::NIL)
    } else {
        Err(Exit::Slowly)
    }
}
