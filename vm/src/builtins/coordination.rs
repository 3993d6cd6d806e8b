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
    let any = event::mark(&mut vm.heap, vm.scheduler.any_event)?;
    let mut fields = [Value::NIL; reads::LENGTH];
    fields[reads::TASK] = vm.scheduler.task().object;
    fields[reads::WATCH] = watch;
    fields[reads::ANY] = any;
    Ok(vm.heap.alloc_vector(&fields)?)
}

pub(super) fn noted_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [fluent, reads] = exactly(arguments);
    // Tasks made by the form have copies of its binding.
    let Some(slots) = vm.heap.slots::<{ source::SEEN + 1 }>(fluent, Kind::SimpleVector) else {
        return Ok(Value::NIL);
    };
    let value = slots[source::VALUE];
    if let Some(slots) = vm.heap.slots::<{ reads::WATCH + 1 }>(reads, Kind::SimpleVector)
        && slots[reads::TASK] == vm.scheduler.task().object
    {
        if slots[reads::WATCH].is_true() {
            return Err(Exit::Slowly);
        }
        if !is_noted(&vm.heap, fluent, reads) {
            note_source(vm, fluent, reads)?;
        }
    }
    Ok(value)
}

pub(super) fn note_read(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [source, reads] = exactly(arguments);
    let is_new = !is_noted(&vm.heap, source, reads);
    if is_new {
        note_source(vm, source, reads)?;
    }
    Ok(Value::boolean(is_new))
}

pub(super) fn noted_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [source, reads] = exactly(arguments);
    Ok(Value::boolean(is_noted(&vm.heap, source, reads)))
}

/// Number of noted sources up to which the list of them is searched. Of more, each knows the reads in which
/// it was noted last.
const FEW: usize = 8;

/// Returns up to [`FEW`] of the sources noted in `reads`, the latest first.
#[inline]
fn latest_sources(heap: &Heap, reads: Value) -> SmallVec<[Value; FEW]> {
    let mut latest = SmallVec::new();
    let mut rest = heap.slot_or_nil(reads, reads::SOURCES);
    while let Some(pair) = heap.as_cons(rest)
        && latest.len() < FEW
    {
        latest.push(pair.car);
        rest = pair.cdr;
    }
    latest
}

/// Returns whether a source is noted as read.
#[inline]
fn is_noted(heap: &Heap, source: Value, reads: Value) -> bool {
    let latest = latest_sources(heap, reads);
    latest.contains(&source) || latest.len() == FEW && heap.slot_or_nil(source, source::SEEN) == reads
}

/// Notes that a form has read a source, which was not noted yet, with the mark of its event.
#[inline]
fn note_source(vm: &mut Vm, source: Value, reads: Value) -> Result<(), Exit> {
    vm.scheduler.point_of_read()?;
    let heap = &mut vm.heap;
    let Some(slots) = heap.slots::<{ reads::ANY + 1 }>(reads, Kind::SimpleVector) else { return Ok(()) };
    let (sources, marks) = (slots[reads::SOURCES], slots[reads::MARKS]);
    let mark = event::mark(heap, heap.slot_or_nil(source, source::EVENT))?;
    let sources = heap.cons(source, sources)?;
    let marks = heap.cons(mark, marks)?;
    let before = latest_sources(heap, reads);
    heap.record_set(reads, Kind::SimpleVector, reads::SOURCES, sources);
    heap.record_set(reads, Kind::SimpleVector, reads::MARKS, marks);
    heap.record_set(reads, Kind::SimpleVector, reads::ANY, Value::NIL);
    if before.len() + 1 >= FEW {
        heap.record_set(source, Kind::SimpleVector, source::SEEN, reads);
    }
    if before.len() + 1 == FEW {
        for other in before {
            heap.record_set(other, Kind::SimpleVector, source::SEEN, reads);
        }
    }
    Ok(())
}

/// Returns the events whose signals a form is to be evaluated after: those of what it has read; any, if it
/// has read nothing or too much. `None` if there was one since it has read them.
fn events_of_reads(vm: &mut Vm, reads: Value) -> Option<SmallVec<[Value; 4]>> {
    let mut events = SmallVec::new();
    let mut rest = vm.heap.slot_or_nil(reads, reads::SOURCES);
    let mut marks = vm.heap.slot_or_nil(reads, reads::MARKS);
    let mut count = 0;
    while let (Some(source), Some(mark)) = (vm.heap.as_cons(rest), vm.heap.as_cons(marks)) {
        let event = vm.heap.slot_or_nil(source.car, source::EVENT);
        count += 1;
        if event::is_over(&vm.heap, event, mark.car) {
            return None;
        }
        if count <= MOST_SOURCES {
            events.push(event);
        }
        (rest, marks) = (source.cdr, mark.cdr);
    }
    vm.exchange.charge_elements(count);
    if (1..=MOST_SOURCES).contains(&count) {
        return Some(events);
    }
    let any = vm.scheduler.any_event;
    let is_over = count == 0 && event::is_over(&vm.heap, any, vm.heap.slot_or_nil(reads, reads::ANY));
    (!is_over).then(|| SmallVec::from_elem(any, 1))
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
    let Some(events) = events_of_reads(vm, reads) else { return make_reads(vm, Value::NIL) };
    let events = match events[..] {
        [event] => event,
        _ => vm.heap.list(&events)?,
    };
    let wait = begin_wait(vm, events, options)?;
    vm.scheduler.park_at(wait, None)
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
