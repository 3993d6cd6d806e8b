//! Handles of operations: events that tell what has become of something that the outside does.

use super::event;
use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;

/// Slot: a keyword, `:PENDING`, `:COMPLETED`, `:FAILED` or `:CANCELLED`.
pub(crate) const STATE: usize = 4;
/// Slot: the list of its values, or of the cause and the arguments of its failure.
pub(crate) const RESULT: usize = 5;
/// Slot: the list of the values of the latest report on its progress.
pub(crate) const PROGRESS: usize = 6;
/// Slot: its number.
pub(crate) const NUMBER: usize = 7;
/// Slot: the task that performs it in place of the outside, or `NIL`.
pub(crate) const PERFORMER: usize = 8;
/// `aux` of such an event.
const AUX: u16 = 1;

/// Creates the handle of an operation that is under way.
///
/// # Errors
/// As for every allocation.
pub(crate) fn make(heap: &mut Heap, name: Value, number: u64, pending: Value) -> Result<Value, AllocError> {
    let mut slots = [Value::NIL; PERFORMER + 1];
    slots[event::NAME] = name;
    slots[event::COUNT] = Value::small(0);
    slots[STATE] = pending;
    slots[NUMBER] = Value::index(number as usize);
    heap.alloc_record(Kind::Event, 0, AUX, &slots)
}

/// Returns whether `object` is the handle of an operation.
pub(crate) fn is_handle(heap: &Heap, object: Value) -> bool {
    heap.is(object, Kind::Event) && heap.header(object).is_some_and(|header| header.aux == AUX)
}

/// Returns the number of the operation that a handle stands for.
pub(crate) fn number(heap: &Heap, handle: Value) -> u64 {
    heap.slot_or_nil(handle, NUMBER).as_index().unwrap_or(0) as u64
}
