//! Waits: objects of the heap, one *link* for each event that the wait is for.
//!
//! The first link stands for the wait. Links of the same event form a list, in the order in which the waits
//! began; links of the same wait form a chain through [`MORE`].

use super::{Deliveries, event};
use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;

/// Slot: the task; in the links after the first, the first link.
const OWNER: usize = 0;
/// Slot: the event whose list the link is in, or `NIL`.
const EVENT: usize = 1;
/// Slot: link before this one in that list, or `NIL`.
const PREVIOUS: usize = 2;
/// Slot: link after this one in that list, or `NIL`.
const NEXT: usize = 3;
/// Slot: next link of the same wait; in the last link, what is waited for, for reports.
const MORE: usize = 4;
/// Slot: arguments of the signal; in a wait that keeps signals, a pair of the first and the last cell of a
/// list of them.
const QUEUE: usize = 5;
/// Slot: time at which the wait ends by itself, in nanoseconds, or `NIL`.
pub(crate) const DEADLINE: usize = 6;
/// Number of slots.
const LENGTH: usize = 7;

/// Flag: signals are kept until the wait is closed.
const KEEPS: u8 = 1;
/// Flag: the signal has come.
const SIGNALLED: u8 = 2;
/// Flag: the waiting task goes on without delay.
const URGENT: u8 = 4;
/// Flag: the wait is for the end of a child, which is bounded.
const CHILD: u8 = 8;

/// Properties of a wait.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WaitOptions {
    /// Whether signals are kept.
    pub keeps: bool,
    /// Whether the waiting task goes on without delay.
    pub urgent: bool,
    /// Whether the wait is for the end of a child.
    pub child: bool,
    /// Time at which it ends by itself, in nanoseconds.
    pub deadline: Option<u64>,
    /// Description of the wait, for reports; `NIL` if the events say it.
    pub what: Value,
}

impl Default for WaitOptions {
    fn default() -> WaitOptions {
        WaitOptions { keeps: false, urgent: false, child: false, deadline: None, what: Value::NIL }
    }
}

#[inline]
fn flags(heap: &Heap, wait: Value) -> u8 {
    heap.header(wait).map_or(0, |header| header.flags)
}

/// Returns the slots of a link, to be set.
#[inline]
fn slots_mut(heap: &mut Heap, link: Value) -> Option<&mut [Value; LENGTH]> {
    heap.slots_mut(link, Kind::Wait)
}

/// Opens a wait of the task with this object for events, each given once.
///
/// # Errors
/// As for every allocation; then nothing has happened.
pub(crate) fn open(
    heap: &mut Heap,
    owner: Value,
    events: &[Value],
    options: WaitOptions,
) -> Result<Value, AllocError> {
    let (first, others) = match events {
        [] => (Value::NIL, events),
        [first, others @ ..] => (*first, others),
    };
    let wait = make(heap, owner, first, options)?;
    let mut more = options.what;
    for _ in others {
        let mut slots = [Value::NIL; LENGTH];
        slots[OWNER] = wait;
        slots[MORE] = more;
        more = heap.alloc_record(Kind::Wait, 0, 0, &slots)?;
    }
    enter(heap, wait, first);
    if others.is_empty() {
        return Ok(wait);
    }
    heap.slot_set(wait, MORE, more);
    let mut link = more;
    for &event in others.iter().rev() {
        append(heap, link, event);
        link = heap.slot_or_nil(link, MORE);
    }
    Ok(wait)
}

/// Creates the first link of a wait, which is to [`enter`] the list of `event`, if that is not `NIL`.
fn make(heap: &mut Heap, owner: Value, event: Value, options: WaitOptions) -> Result<Value, AllocError> {
    let deadline = options.deadline.and_then(|time| Value::fixnum(time as i64)).unwrap_or(Value::NIL);
    let queue = if options.keeps { heap.cons(Value::NIL, Value::NIL)? } else { Value::NIL };
    let mut flags = if options.keeps { KEEPS } else { 0 };
    flags |= if options.urgent { URGENT } else { 0 };
    flags |= if options.child { CHILD } else { 0 };
    let mut slots = [Value::NIL; LENGTH];
    slots[OWNER] = owner;
    slots[EVENT] = event;
    slots[PREVIOUS] = heap.slot_or_nil(event, event::LAST);
    slots[QUEUE] = queue;
    slots[DEADLINE] = deadline;
    slots[MORE] = options.what;
    heap.alloc_record(Kind::Wait, flags, 0, &slots)
}

/// Returns the wait that a link belongs to, and the link behind it in the list of its event, or `NIL`.
#[inline]
pub(crate) fn wait_and_next(heap: &Heap, link: Value) -> (Value, Value) {
    let Some(slots) = heap.slots::<LENGTH>(link, Kind::Wait) else { return (link, Value::NIL) };
    let wait = if heap.is(slots[OWNER], Kind::Wait) { slots[OWNER] } else { link };
    (wait, slots[NEXT])
}

/// Returns the object of the task that waits.
#[inline]
pub(crate) fn owner(heap: &Heap, wait: Value) -> Value {
    heap.slot_or_nil(wait, OWNER)
}

/// Returns the link of the wait for `event` that began first, or `NIL`.
#[inline]
pub(crate) fn first(heap: &Heap, event: Value) -> Value {
    heap.slot_or_nil(event, event::FIRST)
}

/// Returns the wait for `event`, if there is just one and it keeps no signals.
#[inline]
pub(crate) fn only_wait(heap: &Heap, event: Value) -> Option<Value> {
    let (wait, next) = wait_and_next(heap, first(heap, event));
    (next.is_nil() && !keeps(heap, wait)).then_some(wait)
}

/// Returns the time at which a wait ends by itself, in nanoseconds.
pub(crate) fn deadline(heap: &Heap, wait: Value) -> Option<u64> {
    heap.slot_or_nil(wait, DEADLINE).as_fixnum().map(|time| time as u64)
}

/// Returns whether a wait keeps signals.
#[inline]
pub(crate) fn keeps(heap: &Heap, wait: Value) -> bool {
    flags(heap, wait) & KEEPS != 0
}

/// Returns whether the waiting task goes on without delay.
#[inline]
pub(crate) fn is_urgent(heap: &Heap, wait: Value) -> bool {
    flags(heap, wait) & URGENT != 0
}

/// Returns whether a wait is for the end of a child.
#[inline]
pub(crate) fn is_for_child(heap: &Heap, wait: Value) -> bool {
    flags(heap, wait) & CHILD != 0
}

/// Returns the events that a wait is for, and what else is known of what is waited for.
pub(crate) fn waited_for(heap: &Heap, wait: Value) -> (Vec<Value>, Value) {
    let mut events = Vec::new();
    let mut link = wait;
    while heap.is(link, Kind::Wait) {
        events.push(heap.slot_or_nil(link, EVENT));
        link = heap.slot_or_nil(link, MORE);
    }
    events[1..].reverse();
    (events, link)
}

/// Returns whether a wait takes what an input has kept: whether it is for the signals themselves, and not to
/// look at something again.
pub(crate) fn takes(heap: &Heap, wait: Value) -> bool {
    let mut link = wait;
    while heap.is(link, Kind::Wait) {
        link = heap.slot_or_nil(link, MORE);
    }
    link.is_nil()
}

/// Returns the signal that a wait has got and not handed on: the only one, or the first that it has kept.
pub(crate) fn first_signal(heap: &Heap, wait: Value) -> Option<Value> {
    if keeps(heap, wait) { heap.car(heap.car(heap.slot_or_nil(wait, QUEUE))?) } else { signalled(heap, wait) }
}

/// Has a wait forget what it has got.
pub(crate) fn forget_signals(heap: &mut Heap, wait: Value) {
    let queue = heap.slot_or_nil(wait, QUEUE);
    if keeps(heap, wait) {
        heap.set_car(queue, Value::NIL);
        heap.set_cdr(queue, Value::NIL);
    } else {
        heap.slot_set(wait, QUEUE, Value::NIL);
    }
}

/// Puts a link at the end of the list of an event, and returns the one that was there.
fn enter(heap: &mut Heap, link: Value, event: Value) -> Value {
    let Some(ends) = event::slots_mut(heap, event) else { return Value::NIL };
    let last = std::mem::replace(&mut ends[event::LAST], link);
    if last.is_nil() {
        ends[event::FIRST] = link;
    } else {
        heap.slot_set(last, NEXT, link);
    }
    last
}

/// Appends a link to the list of an event.
fn append(heap: &mut Heap, link: Value, event: Value) {
    let last = enter(heap, link, event);
    if let Some(slots) = slots_mut(heap, link) {
        slots[EVENT] = event;
        slots[PREVIOUS] = last;
    }
}

/// Removes a link from its list, if it is in one, and returns the next link of its wait.
fn remove(heap: &mut Heap, deliveries: &mut Deliveries, link: Value) -> Value {
    let Some(slots) = slots_mut(heap, link) else { return Value::NIL };
    let take = |slot: &mut Value| std::mem::replace(slot, Value::NIL);
    let more = slots[MORE];
    let (event, previous, next) =
        (take(&mut slots[EVENT]), take(&mut slots[PREVIOUS]), take(&mut slots[NEXT]));
    if event.is_nil() {
        return more;
    }
    deliveries.pass_over(link, next);
    if previous.is_true() {
        heap.slot_set(previous, NEXT, next);
    }
    if next.is_true() {
        heap.slot_set(next, PREVIOUS, previous);
    }
    if (previous.is_nil() || next.is_nil())
        && let Some(ends) = event::slots_mut(heap, event)
    {
        if previous.is_nil() {
            ends[event::FIRST] = next;
        }
        if next.is_nil() {
            ends[event::LAST] = previous;
        }
    }
    more
}

/// Closes a wait: none of its links is in a list any more.
pub(crate) fn close(heap: &mut Heap, deliveries: &mut Deliveries, wait: Value) {
    let mut link = wait;
    while heap.is(link, Kind::Wait) {
        link = remove(heap, deliveries, link);
    }
}

/// Notes the one signal of a wait, which is over with it.
pub(crate) fn set_signalled(heap: &mut Heap, deliveries: &mut Deliveries, wait: Value, arguments: Value) {
    heap.slot_set(wait, QUEUE, arguments);
    heap.set_flags(wait, Kind::Wait, flags(heap, wait) | SIGNALLED);
    close(heap, deliveries, wait);
}

/// Returns the arguments of the signal that a wait was for, if it has come.
#[inline]
pub(crate) fn signalled(heap: &Heap, wait: Value) -> Option<Value> {
    (flags(heap, wait) & SIGNALLED != 0).then(|| heap.slot_or_nil(wait, QUEUE))
}

/// Appends a cons to the queue of a wait that keeps signals.
#[inline]
pub(crate) fn enqueue(heap: &mut Heap, wait: Value, cell: Value) {
    let queue = heap.slot_or_nil(wait, QUEUE);
    match heap.cdr(queue) {
        Some(last) if last.is_cons() => _ = heap.set_cdr(last, cell),
        _ => _ = heap.set_car(queue, cell),
    }
    heap.set_cdr(queue, cell);
}

/// Takes the arguments of the first signal that a wait has kept.
pub(crate) fn take_kept(heap: &mut Heap, wait: Value) -> Option<Value> {
    let queue = heap.slot_or_nil(wait, QUEUE);
    let first = heap.car(queue).filter(|first| first.is_cons())?;
    let rest = heap.cdr(first).unwrap_or(Value::NIL);
    heap.set_car(queue, rest);
    if rest.is_nil() {
        heap.set_cdr(queue, Value::NIL);
    }
    heap.car(first)
}
