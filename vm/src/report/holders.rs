//! Which other tasks a waiting task depends on.

use std::collections::BTreeMap;

use super::label::{field_of, items, ring};
use crate::heap::Kind;
use crate::names::records::{child, claim, request, resource};
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{event, link};

/// Most tasks that are named.
const SHOWN: usize = 16;

/// Returns the numbers of the tasks on which a waiting task depends: those whose end it waits for, or that
/// hold what it wants. `owners` are the owners of locks of properties by the events of these.
pub(super) fn holders_of(vm: &Vm, task: &Task, owners: &BTreeMap<u64, u64>) -> Vec<u64> {
    if task.state != TaskState::Waiting || task.wait.is_nil() {
        return Vec::new();
    }
    let (events, what) = link::waited_for(&vm.heap, task.wait);
    let mut holders: Vec<u64> = Vec::new();
    for &event in events.iter().take(SHOWN) {
        if vm.heap.is(event, Kind::Task) {
            holders.extend(number_of(vm, event));
        } else {
            holders.extend(owners.get(&event.bits()));
        }
    }
    if let Some(pair) = vm.heap.as_cons(what) {
        match vm.heap.symbol(pair.car).and_then(|symbol| vm.heap.string_text(symbol.name)).as_deref() {
            Some("RESOURCE") => {
                for resource in items(vm, pair.cdr) {
                    let claims = ring(vm, field_of(vm, resource, resource::HOLDERS));
                    let tasks =
                        claims.map(|claim| field_of(vm, field_of(vm, claim, claim::REQUEST), request::TASK));
                    holders.extend(tasks.filter_map(|task| number_of(vm, task)));
                }
            }
            Some("CHILDREN") => {
                let tasks = items(vm, pair.cdr).map(|child| field_of(vm, child, child::TASK));
                holders.extend(tasks.filter_map(|task| number_of(vm, task)));
            }
            Some("SUSPENDED") => holders.extend(number_of(vm, pair.cdr)),
            _ => {}
        }
    }
    holders.retain(|&number| number != task.number.0);
    holders.sort_unstable();
    holders.dedup();
    holders.truncate(SHOWN);
    holders
}

/// Returns the number of the task that `object` stands for, unless it has ended.
pub(super) fn number_of(vm: &Vm, object: Value) -> Option<u64> {
    if !vm.heap.is(object, Kind::Task) {
        return None;
    }
    let task = vm.scheduler.find(event::task_index(&vm.heap, object)?)?;
    Some(task.number.0)
}
