//! The most frequent operations of the library's fluents and resources: noting the sources that a form has
//! read, setting a fluent, granting a request at once.
//!
//! Each could be written in ESL, and is here because it is the whole cost of a wake-up, or of an uncontended
//! resource. The records are those of `sources.esl` and `resources.esl`. A builtin that is given something
//! else does nothing, or gives up.

use smallvec::SmallVec;

use crate::builtins::LIMIT;
use crate::equality::{self, KeyTest};
use crate::heap::{Heap, Kind};
use crate::names::records::{claim, reads, request, resource, source};
use crate::raise::{Exit, Outcome};
use crate::run;
use crate::task::PRIORITIES;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{WaitOptions, event, link};

use super::event::begin_wait;
use super::expect::{exactly, optional};
use super::lookup;

/// Element of a shelf: the bits of the priorities at which claims are. The claims of each priority come
/// before it.
const SHELF_BITS: usize = PRIORITIES;

/// The most sources that one wait is for; with more, any signal wakes.
const MOST_SOURCES: usize = 4000;

// ---- fluents

/// Returns whether a form is looked at as it was after each change, so that changes are logged.
fn are_changes_logged(vm: &Vm) -> bool {
    vm.heap.symbol(vm.names.known.watches).is_none_or(|symbol| symbol.value != Value::small(0))
}

pub(super) fn set_fluent(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [fluent, value] = exactly(arguments);
    if are_changes_logged(vm) {
        return Err(Exit::Slowly);
    }
    vm.scheduler.point()?;
    let Some(slots) = vm.heap.slots::<{ source::VALUE + 1 }>(fluent, Kind::SimpleVector) else {
        return Ok(value);
    };
    let (event, before) = (slots[source::EVENT], slots[source::VALUE]);
    let mut work = LIMIT;
    match equality::same(&vm.heap, KeyTest::Equal, before, value, &mut work) {
        Some(true) => {}
        Some(false) => {
            if !event::is_event(&vm.heap, event) {
                return vm.exchange.not_a(event, vm.names.known.event);
            }
            vm.scheduler.wait_for_deliveries()?;
            run::signal(vm, event, Value::NIL)?;
            vm.heap.slot_set(fluent, source::VALUE, value);
        }
        None => return Err(Exit::Slowly),
    }
    vm.exchange.charge_elements(LIMIT - work);
    Ok(value)
}

pub(super) fn new_reads(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    make_reads(vm, optional(arguments, 0))
}

/// Creates a record of what this task reads, for a watch or `NIL`.
fn make_reads(vm: &mut Vm, watch: Value) -> Outcome {
    let any = event::count(&vm.heap, vm.scheduler.any_event);
    let mut fields = [Value::NIL; reads::LENGTH];
    fields[reads::TASK] = vm.scheduler.task().object;
    fields[reads::COUNT] = Value::small(0);
    fields[reads::WATCH] = watch;
    fields[reads::ANY] = Value::fixnum(any).unwrap_or(Value::NIL);
    Ok(vm.heap.alloc_vector(&fields)?)
}

pub(super) fn noted_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [fluent, reads] = exactly(arguments);
    // Tasks made by the form have copies of its binding.
    let Some(slots) = vm.heap.slots::<{ source::SEEN + 1 }>(fluent, Kind::SimpleVector) else {
        return Ok(Value::NIL);
    };
    let (value, seen) = (slots[source::VALUE], slots[source::SEEN]);
    if let Some(slots) = vm.heap.slots::<{ reads::WATCH + 1 }>(reads, Kind::SimpleVector)
        && slots[reads::TASK] == vm.scheduler.task().object
    {
        if slots[reads::WATCH].is_true() {
            return Err(Exit::Slowly);
        }
        if seen != reads {
            note_source(vm, fluent, reads)?;
        }
    }
    Ok(value)
}

pub(super) fn note_read(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [source, reads] = exactly(arguments);
    let is_new = vm.heap.slot_or_nil(source, source::SEEN) != reads;
    if is_new {
        note_source(vm, source, reads)?;
    }
    Ok(Value::boolean(is_new))
}

/// Notes that a form has read a source, which was not noted yet, with the count of its event.
#[inline]
fn note_source(vm: &mut Vm, source: Value, reads: Value) -> Result<(), Exit> {
    vm.scheduler.point_of_read()?;
    let heap = &mut vm.heap;
    let Some(slots) = heap.slots::<{ reads::COUNT + 1 }>(reads, Kind::SimpleVector) else { return Ok(()) };
    let sources = slots[reads::SOURCES];
    let sum = slots[reads::COUNT]
        .as_fixnum()
        .unwrap_or(0)
        .wrapping_add(event::count(heap, heap.slot_or_nil(source, source::EVENT)));
    let all = heap.cons(source, sources)?;
    heap.record_set(reads, Kind::SimpleVector, reads::SOURCES, all);
    heap.record_set(reads, Kind::SimpleVector, reads::COUNT, Value::fixnum(sum).unwrap_or(Value::small(0)));
    heap.record_set(source, Kind::SimpleVector, source::SEEN, reads);
    Ok(())
}

/// Returns the events whose signals a form is to be evaluated after, with the sum of their counts from before
/// it was: those of what it has read; of all, if it has read nothing or too much.
fn events_of_reads(vm: &Vm, reads: Value) -> (SmallVec<[Value; 4]>, i64) {
    let number = |field| vm.heap.slot_or_nil(reads, field).as_fixnum().unwrap_or(0);
    let mut events = SmallVec::new();
    let mut rest = vm.heap.slot_or_nil(reads, reads::SOURCES);
    while let Some(pair) = vm.heap.as_cons(rest)
        && events.len() <= MOST_SOURCES
    {
        events.push(vm.heap.slot_or_nil(pair.car, source::EVENT));
        rest = pair.cdr;
    }
    if events.is_empty() || events.len() > MOST_SOURCES {
        return (SmallVec::from_elem(vm.scheduler.any_event, 1), number(reads::ANY));
    }
    (events, number(reads::COUNT))
}

pub(super) fn wait_for_reads(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [reads, what] = exactly(arguments);
    let wait = vm.scheduler.task().wait;
    if wait.is_true() {
        if link::signalled(&vm.heap, wait).is_none() {
            return vm.scheduler.park_at(wait, None);
        }
        let next = make_reads(vm, Value::NIL)?;
        vm.scheduler.leave_signalled(&mut vm.heap);
        return Ok(next);
    }
    vm.scheduler.point()?;
    let options = WaitOptions { what, ..WaitOptions::default() };
    if let Some((event, count)) = only_event(&vm.heap, reads) {
        if event::count(&vm.heap, event) != count {
            return make_reads(vm, Value::NIL);
        }
        let wait = begin_wait(vm, event, options)?;
        return vm.scheduler.park_at(wait, None);
    }
    let (events, count) = events_of_reads(vm, reads);
    vm.exchange.charge_elements(events.len());
    let now = events.iter().fold(0_i64, |sum, &event| sum.wrapping_add(event::count(&vm.heap, event)));
    if now != count {
        return make_reads(vm, Value::NIL);
    }
    let events = vm.heap.list(&events)?;
    let wait = begin_wait(vm, events, options)?;
    vm.scheduler.park_at(wait, None)
}

/// Returns the event of what a form has read, with its count from before, if that is one source.
fn only_event(heap: &Heap, reads: Value) -> Option<(Value, i64)> {
    let slots = heap.slots::<{ reads::COUNT + 1 }>(reads, Kind::SimpleVector)?;
    let sources = heap.as_cons(slots[reads::SOURCES]).filter(|sources| sources.cdr.is_nil())?;
    Some((heap.slot_or_nil(sources.car, source::EVENT), slots[reads::COUNT].as_fixnum()?))
}

// ---- resources

/// Returns whether no claim is on a shelf.
fn is_empty_shelf(heap: &Heap, shelf: Value) -> bool {
    heap.slot_or_nil(shelf, SHELF_BITS) == Value::small(0)
}

/// Returns the resource with this name, and how much of it would be used if a request got so much
/// of it; `None` if there is no such resource, if others wait for it, or if the request has to be looked at.
fn free_resource(vm: &mut Vm, name: Value, amount: Value, priority: Value) -> Option<(Value, Value)> {
    let plist = vm.heap.symbol(name)?.plist;
    let resource = lookup::getf(vm, &[plist, vm.names.known.resource]).ok()?;
    let slots = vm.heap.slots::<{ resource::USED + 1 }>(resource, Kind::SimpleVector)?;
    let (capacity, used) = (slots[resource::CAPACITY].as_fixnum()?, slots[resource::USED].as_fixnum()?);
    let sum = amount.as_fixnum().filter(|&amount| amount >= 1)?.checked_add(used)?;
    let is_free = sum <= capacity
        && matches!(priority.as_fixnum(), Some(0..=7))
        && is_empty_shelf(&vm.heap, slots[resource::WAITERS]);
    Some((resource, Value::fixnum(sum).filter(|_| is_free)?))
}

pub(super) fn request_at_once(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, amount, priority, outer] = exactly(arguments);
    vm.scheduler.point()?;
    let Some((resource, used)) = free_resource(vm, name, amount, priority) else { return Ok(Value::NIL) };
    let heap = &mut vm.heap;
    let mut request = [Value::NIL; request::LENGTH];
    request[request::TASK] = vm.scheduler.task().object;
    request[request::SIZE] = Value::small(1);
    request[request::PRIORITY] = priority;
    request[request::STATE] = vm.names.known.granted;
    request[request::OUTER] = outer;
    let request = heap.alloc_vector(&request)?;
    let first = heap.slot_or_nil(resource, resource::HOLDERS);
    let mut claim = [Value::NIL; claim::LENGTH];
    claim[claim::REQUEST] = request;
    claim[claim::RESOURCE] = resource;
    claim[claim::AMOUNT] = amount;
    claim[claim::NEXT] = first;
    claim[claim::PREVIOUS] = heap.slot_or_nil(first, claim::PREVIOUS);
    let claim = heap.alloc_vector(&claim)?;
    let claims = heap.cons(claim, Value::NIL)?;
    heap.slot_set(request, request::CLAIMS, claims);
    if first.is_nil() {
        heap.slot_set(claim, claim::NEXT, claim);
        heap.slot_set(claim, claim::PREVIOUS, claim);
        heap.slot_set(resource, resource::HOLDERS, claim);
    } else {
        let last = heap.slot_or_nil(first, claim::PREVIOUS);
        heap.slot_set(last, claim::NEXT, claim);
        heap.slot_set(first, claim::PREVIOUS, claim);
    }
    heap.slot_set(resource, resource::USED, used);
    Ok(request)
}

/// Takes from a request what it holds, if that is an amount of one resource that no request waits for; `None`
/// if it is not.
fn give_back(heap: &mut Heap, request: Value, granted: Value) -> Option<()> {
    let slots = heap.slots::<{ request::STATE + 1 }>(request, Kind::SimpleVector)?;
    let (claims, state) = (slots[request::CLAIMS], slots[request::STATE]);
    if state.is_nil() {
        return Some(());
    }
    let claim = heap.as_cons(claims).filter(|claims| state == granted && claims.cdr.is_nil())?.car;
    let slots = heap.slots::<{ claim::LENGTH }>(claim, Kind::SimpleVector)?;
    let (next, previous, resource) = (slots[claim::NEXT], slots[claim::PREVIOUS], slots[claim::RESOURCE]);
    let (amount, preemptible) = (slots[claim::AMOUNT], slots[claim::PREEMPTIBLE]);
    let slots = heap.slots::<{ resource::USED + 1 }>(resource, Kind::SimpleVector)?;
    let left = Value::fixnum(slots[resource::USED].as_fixnum()?.checked_sub(amount.as_fixnum()?)?)?;
    if preemptible.is_true() || !is_empty_shelf(heap, slots[resource::WAITERS]) {
        return None;
    }
    if next == claim {
        heap.slot_set(resource, resource::HOLDERS, Value::NIL);
    } else {
        heap.slot_set(previous, claim::NEXT, next);
        heap.slot_set(next, claim::PREVIOUS, previous);
        if heap.slot_or_nil(resource, resource::HOLDERS) == claim {
            heap.slot_set(resource, resource::HOLDERS, next);
        }
    }
    heap.slot_set(claim, claim::NEXT, Value::NIL);
    heap.slot_set(claim, claim::PREVIOUS, Value::NIL);
    heap.slot_set(resource, resource::USED, left);
    heap.slot_set(request, request::STATE, Value::NIL);
    Some(())
}

pub(super) fn give_back_at_once(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [request] = exactly(arguments);
    if request.is_nil() {
        return Ok(Value::T);
    }
    vm.scheduler.point()?;
    Ok(Value::boolean(give_back(&mut vm.heap, request, vm.names.known.granted).is_some()))
}
