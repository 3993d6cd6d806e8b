//! Events: objects of the heap with a count of their signals and a list of the waits for them.
//!
//! A task that looks at something and then waits for its changes has to know whether an event was signalled
//! meanwhile. The library does not compare counts for that, but takes a *mark* of the event, which the next
//! signal takes away: two states of a program that differ by how often something has happened, but not by
//! anything that a task can still see of it, are one state to an exploration.
//!
//! A task is an event too, which its checkpoints and its end signal; its slots are those of an event and a
//! few more.

use crate::heap::{AllocError, Heap, Kind};
use crate::task::TaskIndex;
use crate::value::Value;

/// Slot: name, any value or `NIL`.
pub(crate) const NAME: usize = 0;
/// Slot: number of signals so far; or a mark that carries it, if there is one of the time since the last one.
pub(crate) const COUNT: usize = 1;
/// Slot: link of the wait that began first, or `NIL`.
pub(crate) const FIRST: usize = 2;
/// Slot: link of the wait that began last, or `NIL`.
pub(crate) const LAST: usize = 3;
/// Slot of a task: its index in the table while it lives, then its status.
pub(crate) const STATE: usize = 4;
/// Slot of a task: its node in the tree, or that of its maker, while it lives: see [`super::lineage`]. Then
/// its value or values, or the condition, or a cons of that and the history of the failure.
pub(crate) const RESULT: usize = 5;
/// Slot of a task: list of the things that the library releases at its end; once it has passed a checkpoint,
/// a record of that list and of its checkpoints. Few tasks have either, and there may be millions of tasks.
const PARTS: usize = 6;
/// Number of slots of a task.
pub(crate) const TASK_LENGTH: usize = 7;

/// Slot of the record of parts: the list of things to release.
const HELD: usize = 0;
/// Slot of the record of parts: the checkpoints.
const CHECKPOINTS: usize = 1;
/// Tells the record of parts from others.
const PARTS_AUX: u16 = 3;

/// Number of slots that every event has.
const LENGTH: usize = 4;

/// Creates an event.
///
/// # Errors
/// As for every allocation.
pub(crate) fn make(heap: &mut Heap, name: Value) -> Result<Value, AllocError> {
    heap.alloc_record(Kind::Event, 0, 0, &[name, Value::small(0), Value::NIL, Value::NIL])
}

/// Returns whether `object` is an event; tasks are.
pub(crate) fn is_event(heap: &Heap, object: Value) -> bool {
    matches!(heap.kind(object), Some(Kind::Event | Kind::Task))
}

/// Returns how often an event was signalled.
#[inline]
pub(crate) fn count(heap: &Heap, event: Value) -> i64 {
    count_in(heap, heap.slot_or_nil(event, COUNT))
}

/// Returns the count that is in the slot of an event.
#[inline]
fn count_in(heap: &Heap, slot: Value) -> i64 {
    slot.as_fixnum().or_else(|| heap.slot_or_nil(slot, 0).as_fixnum()).unwrap_or(0)
}

/// The field `aux` of a [`Kind::Tag`] that is a mark.
pub(crate) const MARK: u16 = 1;

/// Returns the mark of an event: another object after its next signal.
///
/// # Errors
/// As for every allocation.
#[inline]
pub(crate) fn mark(heap: &mut Heap, event: Value) -> Result<Value, AllocError> {
    let slot = heap.slot_or_nil(event, COUNT);
    let (Some(kind), true) = (heap.kind(event), slot.is_fixnum()) else { return Ok(slot) };
    let mark = heap.alloc_record(Kind::Tag, 0, MARK, &[slot])?;
    heap.record_set(event, kind, COUNT, mark);
    Ok(mark)
}

/// Returns whether an event was signalled since its mark was taken.
#[inline]
pub(crate) fn is_over(heap: &Heap, event: Value, mark: Value) -> bool {
    heap.slot_or_nil(event, COUNT) != mark
}

/// Returns whether an object is a mark.
pub(crate) fn is_mark(heap: &Heap, object: Value) -> bool {
    heap.header(object).is_some_and(|header| header.kind == Kind::Tag && header.aux == MARK)
}

/// Counts a signal of an event.
#[inline]
pub(crate) fn count_signal(heap: &mut Heap, event: Value) {
    let Some(kind) = heap.kind(event) else { return };
    // One slot is set alone: while the collector marks, setting several costs more.
    let Some(&[_, count]) = heap.slots(event, kind) else { return };
    let count = count_in(heap, count) + 1;
    heap.record_set(event, kind, COUNT, Value::fixnum(count).unwrap_or(Value::small(0)));
}

/// Returns the slots that every event has, to be set.
#[inline]
pub(super) fn slots_mut(heap: &mut Heap, event: Value) -> Option<&mut [Value; LENGTH]> {
    let kind = heap.kind(event)?;
    heap.slots_mut(event, kind)
}

/// Returns whether a wait for an event is open.
#[inline]
pub(crate) fn is_awaited(heap: &Heap, event: Value) -> bool {
    heap.slot_or_nil(event, FIRST).is_true()
}

/// Returns the condition and the history of a failure, from the result of a task that has failed.
pub(crate) fn failure(heap: &Heap, result: Value) -> (Value, Value) {
    heap.as_cons(result).map_or((result, Value::NIL), |pair| (pair.car, pair.cdr))
}

/// Returns the record of a task's parts, if it has one.
fn parts(heap: &Heap, task: Value) -> Option<Value> {
    let parts = heap.slot_or_nil(task, PARTS);
    heap.is(parts, Kind::Record).then_some(parts)
}

/// Returns the list of the things that the library releases at the end of a task.
pub(crate) fn held(heap: &Heap, task: Value) -> Value {
    parts(heap, task).map_or_else(|| heap.slot_or_nil(task, PARTS), |parts| heap.slot_or_nil(parts, HELD))
}

/// Sets that list. Takes no memory.
pub(crate) fn set_held(heap: &mut Heap, task: Value, list: Value) {
    debug_assert!(list.is_list());
    match parts(heap, task) {
        Some(parts) => heap.slot_set(parts, HELD, list),
        None => heap.slot_set(task, PARTS, list),
    };
}

/// Returns the checkpoints that a task has passed, the last one first.
pub(crate) fn checkpoints(heap: &Heap, task: Value) -> Value {
    parts(heap, task).map_or(Value::NIL, |parts| heap.slot_or_nil(parts, CHECKPOINTS))
}

/// Makes room for the checkpoints of a task, so that [`set_checkpoints`] takes no memory.
///
/// # Errors
/// As for every allocation; then nothing has happened.
pub(crate) fn reserve_checkpoints(heap: &mut Heap, task: Value) -> Result<(), AllocError> {
    if parts(heap, task).is_none() {
        let held = heap.slot_or_nil(task, PARTS);
        let parts = heap.alloc_record(Kind::Record, 0, PARTS_AUX, &[held, Value::NIL])?;
        heap.slot_set(task, PARTS, parts);
    }
    Ok(())
}

/// Sets the checkpoints of a task that has room for them.
pub(crate) fn set_checkpoints(heap: &mut Heap, task: Value, list: Value) {
    if let Some(parts) = parts(heap, task) {
        heap.slot_set(parts, CHECKPOINTS, list);
    }
}

/// Returns the place of the task that `object` stands for, while it lives.
#[inline]
pub(crate) fn task_index(heap: &Heap, object: Value) -> Option<TaskIndex> {
    let slots = heap.slots::<TASK_LENGTH>(object, Kind::Task)?;
    slots[STATE].as_index().map(|index| TaskIndex(index as u32))
}
