//! The tree of tasks: which task belongs to which.
//!
//! A task belongs to the one that has made it; when that one ends, to the one that that one belonged to, and
//! so on. So those that an ended task has made are still of the tree of its maker.
//!
//! A task that has made others has a *node*: a cons of its index and the node of its maker. When it ends, the
//! index gives way to `NIL`, and the node, which the tasks that it has made know it by, is all that is kept
//! of it. Nodes of ended tasks are skipped for good when they are met, so endless chains of tasks each of
//! which makes the next one take no room: what is left of the ended ones is no more than there were alive at
//! a time.

use super::event;
use crate::heap::{AllocError, Heap, Kind};
use crate::task::TaskIndex;
use crate::value::Value;

/// Most nodes of ended tasks that are skipped in one step.
const AT_ONCE: usize = 1000;

/// Returns the index of a living task, as a value, and its node or that of its maker.
#[inline]
fn place_of(heap: &Heap, task: Value) -> (Value, Value) {
    match heap.slots::<{ event::TASK_LENGTH }>(task, Kind::Task) {
        Some(slots) => (slots[event::STATE], slots[event::RESULT]),
        None => (Value::NIL, Value::NIL),
    }
}

/// Returns the node of a task that is about to make another, a new one if it has none.
///
/// # Errors
/// As for every allocation; then nothing has happened.
#[inline]
pub(crate) fn node_of(heap: &mut Heap, task: Value) -> Result<Value, AllocError> {
    let (own, node) = place_of(heap, task);
    if heap.as_cons(node).is_some_and(|pair| pair.car == own) {
        return Ok(node);
    }
    let new = heap.cons(own, node)?;
    heap.slot_set(task, event::RESULT, new);
    Ok(new)
}

/// Notes in the tree that a task ends. Its index and its node have to be in their places still.
#[inline]
pub(crate) fn end(heap: &mut Heap, task: Value) {
    let (own, node) = place_of(heap, task);
    let Some(pair) = heap.as_cons(node) else { return };
    if pair.car == own {
        heap.set_car(node, Value::NIL);
        skip_ended(heap, node);
    }
}

/// Has nodes of ended tasks, from `node` on, lead to that of a task that lives, or as far towards it as one
/// step goes.
fn skip_ended(heap: &mut Heap, node: Value) {
    let mut end = node;
    for _ in 0..AT_ONCE {
        match heap.as_cons(end) {
            Some(pair) if pair.car.is_nil() => end = pair.cdr,
            _ => break,
        }
    }
    let mut rest = node;
    while rest != end
        && let Some(pair) = heap.as_cons(rest)
    {
        heap.set_cdr(rest, end);
        rest = pair.cdr;
    }
}

/// Returns the place of the task that a living task belongs to, if it belongs to one.
#[inline]
pub(crate) fn owner_of(heap: &Heap, task: Value) -> Option<TaskIndex> {
    let (own, mut node) = place_of(heap, task);
    while let Some(pair) = heap.as_cons(node) {
        if pair.car != own
            && let Some(index) = pair.car.as_index()
        {
            return Some(TaskIndex(index as u32));
        }
        node = pair.cdr;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trust::heap_for_tests;

    fn task(heap: &mut Heap, index: usize, node: Value) -> Value {
        let mut slots = [Value::NIL; event::TASK_LENGTH];
        slots[event::STATE] = Value::index(index);
        slots[event::RESULT] = node;
        heap.alloc_record(Kind::Task, 0, 0, &slots).unwrap()
    }

    fn length(heap: &Heap, mut node: Value) -> usize {
        let mut length = 0;
        while let Some(pair) = heap.as_cons(node) {
            length += 1;
            node = pair.cdr;
        }
        length
    }

    #[test]
    fn a_task_whose_maker_has_ended_belongs_to_the_maker_of_that() {
        let mut heap = heap_for_tests();
        let first = task(&mut heap, 1, Value::NIL);
        let node = node_of(&mut heap, first).unwrap();
        assert_eq!(node_of(&mut heap, first).unwrap(), node);
        let second = task(&mut heap, 2, node);
        let node = node_of(&mut heap, second).unwrap();
        let third = task(&mut heap, 3, node);
        assert_eq!(owner_of(&heap, third), Some(TaskIndex(2)));
        end(&mut heap, second);
        assert_eq!(owner_of(&heap, third), Some(TaskIndex(1)));
        end(&mut heap, first);
        assert_eq!(owner_of(&heap, third), None);
    }

    #[test]
    fn a_chain_of_tasks_keeps_no_more_nodes_than_are_alive_at_a_time() {
        let mut heap = heap_for_tests();
        let mut alive = std::collections::VecDeque::new();
        alive.push_back(task(&mut heap, 1, Value::NIL));
        for index in 2..1000 {
            let &last = alive.back().unwrap();
            let node = node_of(&mut heap, last).unwrap();
            alive.push_back(task(&mut heap, index, node));
            if alive.len() > 10 {
                let first = alive.pop_front().unwrap();
                end(&mut heap, first);
            }
            assert!(length(&heap, node) < 30);
        }
    }
}
