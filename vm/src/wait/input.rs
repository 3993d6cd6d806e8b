//! Inputs: events that queue signals until a task takes them.
//!
//! A signal of an input goes to the tasks that wait for it, as that of every event; if there is none, or if
//! earlier signals are still kept, it is kept itself. A wait that begins takes the oldest. When a signal has
//! gone to one wait only, and that wait is left before its task went on (by an abort, a timeout, a throw), it
//! goes back to the input: nothing is lost but by the input's own rule.

use super::{event, link};
use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;

/// Slot: the first cell of a list of the signals that are kept, or `NIL`.
const FIRST_KEPT: usize = 4;
/// Slot: the last cell of that list, or `NIL`.
const LAST_KEPT: usize = 5;
/// Slot: number of signals that are kept.
const SIZE: usize = 6;
/// Slot: number of signals for which there is room.
const CAPACITY: usize = 7;
/// Slot: number of the rule for when it is full.
const RULE: usize = 8;
/// Slot: number of signals that were dropped.
const DROPPED: usize = 9;
/// Slot: the event that is signalled when there is room again, or `NIL`.
const ROOM: usize = 10;
/// Number of slots.
const LENGTH: usize = 11;
/// `aux` of such an event.
const AUX: u16 = 2;

/// Rule for a signal for which an input has no room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WhenFull {
    /// It takes the place of the oldest.
    DropOldest,
    /// It is dropped itself.
    DropNewest,
    /// It takes the place of all others.
    Latest,
    /// The sender waits until there is room.
    Wait,
}

impl WhenFull {
    const ALL: [WhenFull; 4] = [WhenFull::DropOldest, WhenFull::DropNewest, WhenFull::Latest, WhenFull::Wait];

    /// Returns the rule with this number.
    pub(crate) fn from_number(number: usize) -> Option<WhenFull> {
        WhenFull::ALL.get(number).copied()
    }
}

/// Creates an input.
///
/// # Errors
/// As for every allocation.
pub(crate) fn make(
    heap: &mut Heap,
    name: Value,
    capacity: usize,
    when_full: WhenFull,
) -> Result<Value, AllocError> {
    let room = event::make(heap, name)?;
    let mut slots = [Value::NIL; LENGTH];
    slots[event::NAME] = name;
    slots[event::COUNT] = Value::small(0);
    slots[SIZE] = Value::small(0);
    slots[CAPACITY] = Value::index(capacity);
    slots[RULE] = Value::index(when_full as usize);
    slots[DROPPED] = Value::small(0);
    slots[ROOM] = room;
    heap.alloc_record(Kind::Event, 0, AUX, &slots)
}

/// Sets capacity and rule of an input.
pub(crate) fn change(heap: &mut Heap, input: Value, capacity: usize, when_full: WhenFull) {
    heap.slot_set(input, CAPACITY, Value::index(capacity));
    heap.slot_set(input, RULE, Value::index(when_full as usize));
}

/// Returns whether `object` is an input.
#[inline]
pub(crate) fn is_input(heap: &Heap, object: Value) -> bool {
    heap.header(object).is_some_and(|header| header.aux == AUX && header.kind == Kind::Event)
}

fn number(heap: &Heap, input: Value, slot: usize) -> usize {
    heap.slot_or_nil(input, slot).as_index().unwrap_or(0)
}

/// Returns how many signals were dropped.
pub(crate) fn dropped(heap: &Heap, input: Value) -> usize {
    number(heap, input, DROPPED)
}

/// Returns the event that is signalled when there is room again.
pub(crate) fn room(heap: &Heap, input: Value) -> Value {
    heap.slot_or_nil(input, ROOM)
}

/// Returns how many signals are kept.
pub(crate) fn size(heap: &Heap, input: Value) -> usize {
    number(heap, input, SIZE)
}

/// Returns whether no signal is kept.
pub(crate) fn is_empty(heap: &Heap, input: Value) -> bool {
    size(heap, input) == 0
}

/// Returns how many signals there is room for.
pub(crate) fn capacity(heap: &Heap, input: Value) -> usize {
    number(heap, input, CAPACITY)
}

fn is_full(heap: &Heap, input: Value) -> bool {
    size(heap, input) >= number(heap, input, CAPACITY)
}

/// Returns the rule for when an input is full.
pub(crate) fn when_full(heap: &Heap, input: Value) -> WhenFull {
    WhenFull::from_number(number(heap, input, RULE)).unwrap_or(WhenFull::DropOldest)
}

/// Returns whether the signalling task has to wait until there is room.
pub(crate) fn has_senders_wait(heap: &Heap, input: Value) -> bool {
    is_full(heap, input) && when_full(heap, input) == WhenFull::Wait
}

/// Keeps a signal, the cons of the list of its arguments and `NIL`, as the newest. Without room a signal is
/// dropped by the input's rule; an input whose senders wait takes it nevertheless.
pub(crate) fn keep(heap: &mut Heap, input: Value, cell: Value) {
    if is_full(heap, input) {
        match when_full(heap, input) {
            WhenFull::DropOldest => {
                take(heap, input);
                count_dropped(heap, input, 1);
            }
            WhenFull::DropNewest => return count_dropped(heap, input, 1),
            WhenFull::Latest => {
                let size = size(heap, input);
                count_dropped(heap, input, size);
                heap.slot_set(input, FIRST_KEPT, Value::NIL);
                heap.slot_set(input, LAST_KEPT, Value::NIL);
                heap.slot_set(input, SIZE, Value::small(0));
            }
            WhenFull::Wait => {}
        }
    }
    let last = heap.slot_or_nil(input, LAST_KEPT);
    if last.is_cons() {
        heap.set_cdr(last, cell);
    } else {
        heap.slot_set(input, FIRST_KEPT, cell);
    }
    heap.slot_set(input, LAST_KEPT, cell);
    resize(heap, input, 1);
}

/// Takes the oldest signal that is kept: the list of its arguments.
pub(crate) fn take(heap: &mut Heap, input: Value) -> Option<Value> {
    let first = heap.slot_or_nil(input, FIRST_KEPT);
    let pair = heap.as_cons(first)?;
    heap.slot_set(input, FIRST_KEPT, pair.cdr);
    if pair.cdr.is_nil() {
        heap.slot_set(input, LAST_KEPT, Value::NIL);
    }
    resize(heap, input, -1);
    Some(pair.car)
}

fn resize(heap: &mut Heap, input: Value, by: isize) {
    let size = size(heap, input).saturating_add_signed(by);
    heap.slot_set(input, SIZE, Value::index(size));
}

/// Counts signals of `input` that were dropped.
pub(crate) fn count_dropped(heap: &mut Heap, input: Value, count: usize) {
    let dropped = dropped(heap, input).saturating_add(count);
    heap.slot_set(input, DROPPED, Value::index(dropped));
}

/// Creates what stands for a signal of `input` that goes to one wait only, so that it can be given back.
///
/// # Errors
/// As for every allocation.
pub(crate) fn loan(heap: &mut Heap, input: Value, arguments: Value) -> Result<Value, AllocError> {
    let cell = heap.cons(arguments, Value::NIL)?;
    heap.alloc_vector(&[cell, input])
}

/// Returns the arguments of a signal, which may be one that could be given back.
pub(crate) fn arguments(heap: &Heap, signal: Value) -> Value {
    match heap.vector(signal) {
        Some(&[cell, _]) => heap.car(cell).unwrap_or(Value::NIL),
        _ => signal,
    }
}

/// Gives the signal back that a wait has not taken, and returns the input that has it again.
pub(crate) fn give_back(heap: &mut Heap, wait: Value) -> Option<Value> {
    let signal = link::first_signal(heap, wait)?;
    let &[cell, input] = heap.vector(signal)? else { return None };
    link::forget_signals(heap, wait);
    let first = heap.slot_or_nil(input, FIRST_KEPT);
    heap.set_cdr(cell, first);
    heap.slot_set(input, FIRST_KEPT, cell);
    if first.is_nil() {
        heap.slot_set(input, LAST_KEPT, cell);
    }
    resize(heap, input, 1);
    Some(input)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heap::HeapConfig;

    fn input(capacity: usize, when_full: WhenFull) -> (Heap, Value) {
        let mut heap = crate::trust::new_heap(HeapConfig::default());
        let input = make(&mut heap, Value::NIL, capacity, when_full).expect("there is room");
        (heap, input)
    }

    /// Keeps the numbers from 1 to 5, and returns what is taken then, and how many were dropped.
    fn after_five(capacity: usize, when_full: WhenFull) -> (Vec<i64>, usize) {
        let (mut heap, input) = input(capacity, when_full);
        for n in 1..=5 {
            let cell = heap.cons(Value::small(n), Value::NIL).expect("there is room");
            keep(&mut heap, input, cell);
        }
        let taken = std::iter::from_fn(|| take(&mut heap, input)?.as_fixnum()).collect();
        assert!(is_empty(&heap, input));
        (taken, dropped(&heap, input))
    }

    #[test]
    fn rules_say_what_is_dropped() {
        assert_eq!(after_five(2, WhenFull::DropOldest), (vec![4, 5], 3));
        assert_eq!(after_five(2, WhenFull::DropNewest), (vec![1, 2], 3));
        assert_eq!(after_five(2, WhenFull::Latest), (vec![5], 4));
        assert_eq!(after_five(9, WhenFull::Latest), (vec![1, 2, 3, 4, 5], 0));
        assert_eq!(after_five(2, WhenFull::Wait), (vec![1, 2, 3, 4, 5], 0));
    }
}
