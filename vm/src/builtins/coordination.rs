//! What the library's fluents and resources do most often: notes of what a form has read, the setting of a
//! fluent, a request that is granted at once.
//!
//! Each could be written in ESL, and is here because it is the whole cost of a wake-up, or of a resource that
//! nobody else wants. The records are those of `sources.esl` and `resources.esl`, whose fields come in the
//! order of the constants. A builtin that is given something else does nothing, or gives up.

use smallvec::SmallVec;

use crate::builtins::LIMIT;
use crate::equality::{self, KeyTest};
use crate::heap::Heap;
use crate::raise::{Exit, Outcome};
use crate::run;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{WaitOptions, event, link};

use super::event::begin_wait;
use super::expect::exactly;

/// The fields of a source.
mod source {
    pub(super) const EVENT: usize = 0;
    pub(super) const VALUE: usize = 1;
    pub(super) const SEEN: usize = 2;
}

/// The fields of what a form has read.
mod reads {
    pub(super) const TASK: usize = 0;
    pub(super) const SOURCES: usize = 1;
    pub(super) const COUNT: usize = 2;
    pub(super) const WATCH: usize = 3;
    pub(super) const ANY: usize = 4;
}

/// The fields of a resource, a claim and a request.
mod resource {
    pub(super) const HOLDERS: usize = 1;
    pub(super) const WAITERS: usize = 2;
    pub(super) const CAPACITY: usize = 6;
    pub(super) const USED: usize = 7;
    /// Element of a shelf: the bits of the priorities at which claims are.
    pub(super) const BITS: usize = 8;
    /// Fields of a claim.
    pub(super) const NEXT: usize = 0;
    pub(super) const PREVIOUS: usize = 1;
    pub(super) const AMOUNT: usize = 6;
    /// Field of a request.
    pub(super) const STATE: usize = 5;
}

/// The most sources that one wait is for; with more, any signal wakes.
const MOST_SOURCES: usize = 4000;

// ---- fluents

/// Returns whether a form is looked at as it was after each change, so that changes are logged.
fn are_changes_logged(vm: &Vm) -> bool {
    vm.heap.symbol(vm.world.known.watches).is_none_or(|symbol| symbol.value != Value::small(0))
}

pub(super) fn set_fluent(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [fluent, value] = exactly(arguments);
    if are_changes_logged(vm) {
        return Err(Exit::Slowly);
    }
    vm.scheduler.point()?;
    let mut work = LIMIT;
    let before = vm.heap.slot_or_nil(fluent, source::VALUE);
    match equality::same(&vm.heap, KeyTest::Equal, before, value, &mut work) {
        Some(true) => {}
        Some(false) => {
            let event = vm.heap.slot_or_nil(fluent, source::EVENT);
            if !event::is_event(&vm.heap, event) {
                return vm.exchange.not_a(event, vm.world.known.event);
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
    let any = event::count(&vm.heap, vm.scheduler.any_event);
    let mut fields = [Value::NIL; 6];
    fields[reads::TASK] = vm.scheduler.task().object;
    fields[reads::COUNT] = Value::small(0);
    fields[reads::WATCH] = arguments[0];
    fields[reads::ANY] = Value::fixnum(any).unwrap_or(Value::NIL);
    Ok(vm.heap.alloc_vector(&fields)?)
}

pub(super) fn noted_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [fluent, reads] = exactly(arguments);
    // Tasks made by the form have copies of its binding.
    if vm.heap.slot_or_nil(reads, reads::TASK) == vm.scheduler.task().object {
        if vm.heap.slot_or_nil(reads, reads::WATCH).is_true() {
            return Err(Exit::Slowly);
        }
        note_source(vm, fluent, reads)?;
    }
    Ok(vm.heap.slot_or_nil(fluent, source::VALUE))
}

pub(super) fn note_read(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [source, reads] = exactly(arguments);
    Ok(Value::boolean(note_source(vm, source, reads)?))
}

/// Notes that a form has read a source, with the count of its event. Returns whether it was not noted yet.
fn note_source(vm: &mut Vm, source: Value, reads: Value) -> Result<bool, Exit> {
    if vm.heap.slot_or_nil(source, source::SEEN) == reads {
        return Ok(false);
    }
    vm.scheduler.point_of_read()?;
    let sources = vm.heap.cons(source, vm.heap.slot_or_nil(reads, reads::SOURCES))?;
    let count = event::count(&vm.heap, vm.heap.slot_or_nil(source, source::EVENT));
    let sum = vm.heap.slot_or_nil(reads, reads::COUNT).as_fixnum().unwrap_or(0).wrapping_add(count);
    vm.heap.slot_set(reads, reads::COUNT, Value::fixnum(sum).unwrap_or(Value::small(0)));
    vm.heap.slot_set(reads, reads::SOURCES, sources);
    vm.heap.slot_set(source, source::SEEN, reads);
    Ok(true)
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
        vm.scheduler.leave_signalled(&mut vm.heap);
        return Ok(Value::NIL);
    }
    vm.scheduler.point()?;
    let (events, count) = events_of_reads(vm, reads);
    vm.exchange.charge_elements(events.len());
    let now = events.iter().fold(0_i64, |sum, &event| sum.wrapping_add(event::count(&vm.heap, event)));
    if now != count {
        return Ok(Value::NIL);
    }
    let options = WaitOptions { what, ..WaitOptions::default() };
    let wait = match events[..] {
        [event] => begin_wait(vm, event, options)?,
        _ => {
            let events = vm.heap.list(&events)?;
            begin_wait(vm, events, options)?
        }
    };
    vm.scheduler.park_at(wait, None)
}

// ---- resources

/// Returns a field that is a number.
fn number(heap: &Heap, record: Value, field: usize) -> Option<i64> {
    heap.slot_or_nil(record, field).as_fixnum()
}

/// Returns whether no claim is on a shelf.
fn is_empty_shelf(heap: &Heap, shelf: Value) -> bool {
    heap.slot_or_nil(shelf, resource::BITS) == Value::small(0)
}

pub(super) fn grant_at_once(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [request, claim, resource] = exactly(arguments);
    vm.scheduler.point()?;
    let heap = &mut vm.heap;
    let numbers = (
        number(heap, resource, resource::CAPACITY),
        number(heap, resource, resource::USED),
        number(heap, claim, resource::AMOUNT),
    );
    let (Some(capacity), Some(used), Some(amount)) = numbers else { return Ok(Value::NIL) };
    let used = used.saturating_add(amount);
    let waiters = heap.slot_or_nil(resource, resource::WAITERS);
    let Some(sum) = Value::fixnum(used).filter(|_| used <= capacity && is_empty_shelf(heap, waiters)) else {
        return Ok(Value::NIL);
    };
    let first = heap.slot_or_nil(resource, resource::HOLDERS);
    if first.is_nil() {
        heap.slot_set(claim, resource::NEXT, claim);
        heap.slot_set(claim, resource::PREVIOUS, claim);
        heap.slot_set(resource, resource::HOLDERS, claim);
    } else {
        let last = heap.slot_or_nil(first, resource::PREVIOUS);
        heap.slot_set(last, resource::NEXT, claim);
        heap.slot_set(claim, resource::PREVIOUS, last);
        heap.slot_set(claim, resource::NEXT, first);
        heap.slot_set(first, resource::PREVIOUS, claim);
    }
    heap.slot_set(resource, resource::USED, sum);
    heap.slot_set(request, resource::STATE, vm.world.known.granted);
    Ok(Value::T)
}

pub(super) fn give_back_at_once(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [request, claim, resource] = exactly(arguments);
    vm.scheduler.point()?;
    let heap = &mut vm.heap;
    let state = heap.slot_or_nil(request, resource::STATE);
    if state.is_nil() {
        return Ok(Value::T);
    }
    let waiters = heap.slot_or_nil(resource, resource::WAITERS);
    let numbers = (number(heap, resource, resource::USED), number(heap, claim, resource::AMOUNT));
    let (Some(used), Some(amount)) = numbers else { return Ok(Value::NIL) };
    let left = Value::fixnum(used.saturating_sub(amount));
    let Some(left) = left.filter(|_| state == vm.world.known.granted && is_empty_shelf(heap, waiters)) else {
        return Ok(Value::NIL);
    };
    let (next, previous) =
        (heap.slot_or_nil(claim, resource::NEXT), heap.slot_or_nil(claim, resource::PREVIOUS));
    if next == claim {
        heap.slot_set(resource, resource::HOLDERS, Value::NIL);
    } else {
        heap.slot_set(previous, resource::NEXT, next);
        heap.slot_set(next, resource::PREVIOUS, previous);
        if heap.slot_or_nil(resource, resource::HOLDERS) == claim {
            heap.slot_set(resource, resource::HOLDERS, next);
        }
    }
    heap.slot_set(claim, resource::NEXT, Value::NIL);
    heap.slot_set(claim, resource::PREVIOUS, Value::NIL);
    heap.slot_set(resource, resource::USED, left);
    heap.slot_set(request, resource::STATE, Value::NIL);
    Ok(Value::T)
}
