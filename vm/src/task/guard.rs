//! Slots of a guard: what a child interrupts its parent with.

use crate::heap::{Heap, Kind};
use crate::value::Value;

/// Slot: the task that it guards.
pub(crate) const TASK: usize = 0;
/// Slot: the function that is to run there.
pub(crate) const FUNCTION: usize = 1;
/// Slot: whether it still may.
pub(crate) const IS_OPEN: usize = 2;
/// Slot: the height of the control stack where it was made; it acts inside a cleanup only if it was made
/// there.
pub(crate) const HEIGHT: usize = 3;
/// Slot: the rights with which the function runs, as they are bound; unsupplied for those of the place.
pub(crate) const RIGHTS: usize = 4;
/// Number of slots.
pub(crate) const LENGTH: usize = 5;
/// `aux` of such a record.
pub(crate) const AUX: u16 = 1;

/// Returns whether a guard may still act.
pub(crate) fn is_open(heap: &Heap, guard: Value) -> bool {
    heap.slot_or_nil(guard, IS_OPEN).is_true()
}

/// Says whether a guard may act from now on.
pub(crate) fn set_open(heap: &mut Heap, guard: Value, on: bool) {
    heap.slot_set(guard, IS_OPEN, Value::boolean(on));
}

/// Returns whether `object` is a guard.
pub(crate) fn is_guard(heap: &Heap, object: Value) -> bool {
    heap.is(object, Kind::Record) && heap.header(object).is_some_and(|header| header.aux == AUX)
}
