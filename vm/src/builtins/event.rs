//! Events, waits and time: the primitives from which the library makes the forms that wait.
//!
//! A builtin that waits parks its task and is done again, from the start, when the task goes on: then the
//! task's `wait` is what it was parked at.

use esl_host::ProcessSignal;

use crate::builtins::list::list_items;
use crate::heap::{Heap, Kind};
use crate::number;
use crate::raise::{Exit, Outcome};
use crate::run;
use crate::schedule::{AskedFor, TurnEnd};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{WaitOptions, event, input, link};

use super::expect::{exactly, optional};

/// The latest time, in nanoseconds: far beyond the life of a machine, and a fixnum.
const LATEST: u64 = 1 << 60;

/// Seconds as nanoseconds; what is negative counts as zero.
///
/// # Errors
/// A failure if `seconds` is not a real number.
pub(crate) fn nanoseconds(vm: &mut Vm, seconds: Value) -> Result<u64, Exit> {
    if let Some(n) = seconds.as_fixnum() {
        return Ok((n.max(0) as u64).saturating_mul(1_000_000_000).min(LATEST));
    }
    // A number too large for a double becomes infinite; a conversion of floats saturates.
    let seconds = match seconds.as_double() {
        Some(seconds) => seconds,
        None => vm.nearest_double(seconds, "REAL")?,
    };
    Ok(((seconds * 1e9).round() as u64).min(LATEST))
}

/// Returns whether `seconds` is a number below zero.
#[inline]
fn is_negative(heap: &Heap, seconds: Value) -> bool {
    match seconds.as_double() {
        Some(seconds) => seconds < 0.0,
        None => number::sign_of(heap, seconds) == Some(-1),
    }
}

/// Returns the time of the running task's clock.
fn time_of_task(vm: &mut Vm) -> u64 {
    vm.scheduler.points.note_clock_read();
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    vm.scheduler.standstill().time_at(now)
}

/// Returns the sum of the counts of an event or of a list of events.
fn count_of_events(vm: &mut Vm, events: Value) -> Result<i64, Exit> {
    if !events.is_list() {
        return if event::is_event(&vm.heap, events) {
            Ok(event::count(&vm.heap, events))
        } else {
            vm.exchange.not_a(events, vm.names.known.event)
        };
    }
    let mut sum = 0_i64;
    for event in listed_events(vm, events)? {
        if !event::is_event(&vm.heap, event) {
            return vm.exchange.not_a(event, vm.names.known.event);
        }
        sum = sum.wrapping_add(event::count(&vm.heap, event));
    }
    Ok(sum)
}

/// Returns the mark of an event, or the list of those of a list of events.
fn marks_of_events(vm: &mut Vm, events: Value) -> Outcome {
    if !events.is_list() {
        return if event::is_event(&vm.heap, events) {
            Ok(event::mark(&mut vm.heap, events)?)
        } else {
            vm.exchange.not_a(events, vm.names.known.event)
        };
    }
    let mut marks = listed_events(vm, events)?;
    for mark in &mut marks {
        if !event::is_event(&vm.heap, *mark) {
            return vm.exchange.not_a(*mark, vm.names.known.event);
        }
        *mark = event::mark(&mut vm.heap, *mark)?;
    }
    vm.exchange.charge_elements(marks.len());
    Ok(vm.heap.list(&marks)?)
}

/// Returns the items of a list of events to wait for.
///
/// # Errors
/// A failure if it is not a list, or has more items than one wait may be for.
fn listed_events(vm: &mut Vm, events: Value) -> Result<Vec<Value>, Exit> {
    match list_items(vm, events, MAX_EVENTS) {
        Err(Exit::Slowly) => {
            vm.exchange.program_error(format!("a wait is for at most {MAX_EVENTS} events, found more"))
        }
        items => items,
    }
}

/// Returns whether a wait need not begin because the events were signalled since: since they were counted, or
/// since their marks were taken.
fn was_signalled_since(vm: &mut Vm, events: Value, since: Value) -> Result<bool, Exit> {
    if let Some(count) = since.as_fixnum() {
        return Ok(count_of_events(vm, events)? != count);
    }
    if since.is_nil() {
        return Ok(false);
    }
    if event::is_mark(&vm.heap, since) {
        return Ok(event::is_over(&vm.heap, events, since));
    }
    let (mut events, mut marks) = (events, since);
    while let (Some(event), Some(mark)) = (vm.heap.as_cons(events), vm.heap.as_cons(marks)) {
        if !event::is_mark(&vm.heap, mark.car) {
            break;
        }
        if event::is_over(&vm.heap, event.car, mark.car) {
            return Ok(true);
        }
        (events, marks) = (event.cdr, mark.cdr);
        if events.is_nil() && marks.is_nil() {
            return Ok(false);
        }
    }
    vm.exchange.type_error(since, "INTEGER")
}

/// Takes the oldest signal that one of `events` keeps, an event or a list of events: the list of its
/// arguments.
///
/// # Errors
/// As [`take_kept_by`].
fn take_kept_by_one_of(vm: &mut Vm, events: Value) -> Result<Option<Value>, Exit> {
    let mut rest = events;
    while let Some(pair) = vm.heap.as_cons(rest) {
        if let Some(arguments) = take_kept_by(vm, pair.car)? {
            return Ok(Some(arguments));
        }
        rest = pair.cdr;
    }
    take_kept_by(vm, events)
}

/// Takes the oldest signal that `event` keeps, if it is an input, and wakes the tasks that wait for room in
/// it.
///
/// # Errors
/// [`Exit::Collect`]; [`Exit::Again`] while signals are under delivery. Then nothing has happened.
#[inline(always)]
fn take_kept_by(vm: &mut Vm, event: Value) -> Result<Option<Value>, Exit> {
    if input::is_input(&vm.heap, event) && !input::is_empty(&vm.heap, event) {
        take_oldest(vm, event)
    } else {
        Ok(None)
    }
}

/// Takes the oldest signal that an input keeps, which keeps one.
///
/// # Errors
/// As [`take_kept_by`].
fn take_oldest(vm: &mut Vm, event: Value) -> Result<Option<Value>, Exit> {
    let room = input::room(&vm.heap, event);
    if event::is_awaited(&vm.heap, room) {
        vm.scheduler.wait_for_deliveries()?;
        vm.signal_event(room, &[])?;
    }
    let arguments = input::take(&mut vm.heap, event);
    run::show_kept(vm, event);
    Ok(arguments)
}

/// Returns whether one of `events`, an event or a list of events, keeps a signal.
fn is_one_kept(vm: &Vm, events: Value) -> bool {
    let keeps = |event: Value| input::is_input(&vm.heap, event) && !input::is_empty(&vm.heap, event);
    let mut rest = events;
    while let Some(pair) = vm.heap.as_cons(rest) {
        if keeps(pair.car) {
            return true;
        }
        rest = pair.cdr;
    }
    keeps(rest)
}

/// Takes the oldest signal that an input keeps for which a wait is.
fn take_for(vm: &mut Vm, wait: Value) -> Result<Option<Value>, Exit> {
    if !link::takes(&vm.heap, wait) {
        return Ok(None);
    }
    for event in link::waited_for(&vm.heap, wait).0 {
        if let Some(arguments) = take_kept_by(vm, event)? {
            return Ok(Some(arguments));
        }
    }
    Ok(None)
}

/// Parks the running task until an input has room for a signal.
///
/// # Errors
/// Always, if it has none.
fn wait_for_room(vm: &mut Vm, event: Value) -> Result<(), Exit> {
    let wait = vm.scheduler.task().wait;
    if wait.is_true() {
        if link::signalled(&vm.heap, wait).is_none() {
            return vm.scheduler.park_at(wait, None).map(drop);
        }
        vm.scheduler.leave_signalled(&mut vm.heap);
    }
    if !input::has_senders_wait(&vm.heap, event) {
        return Ok(());
    }
    let what = vm.names.known.room;
    let room = input::room(&vm.heap, event);
    let wait = begin_wait(vm, room, WaitOptions { what, ..WaitOptions::default() })?;
    vm.scheduler.park_at(wait, None).map(drop)
}

fn give_list(vm: &mut Vm, list: Value) -> Outcome {
    let mut rest = list;
    if let Some(pair) = vm.heap.as_cons(list)
        && (pair.cdr.is_nil() || vm.cpu.wants_one)
    {
        return Ok(pair.car);
    }
    vm.exchange.values.clear();
    while let Some(pair) = vm.heap.as_cons(rest) {
        vm.exchange.values.push(pair.car);
        rest = pair.cdr;
    }
    Err(Exit::Values)
}

pub(super) fn make_event(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.make_event(arguments.first().copied().unwrap_or(Value::NIL))
}

pub(super) fn signal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    if !event::is_event(&vm.heap, arguments[0]) {
        return vm.exchange.not_a(arguments[0], vm.names.known.event);
    }
    vm.scheduler.wait_for_deliveries()?;
    if input::is_input(&vm.heap, arguments[0]) {
        wait_for_room(vm, arguments[0])?;
    }
    vm.signal_event(arguments[0], &arguments[1..])?;
    Ok(Value::NIL)
}

pub(super) fn event_count(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    if !event::is_event(&vm.heap, arguments[0]) {
        return vm.exchange.not_a(arguments[0], vm.names.known.event);
    }
    let count = event::count(&vm.heap, arguments[0]);
    Ok(Value::fixnum(count).unwrap_or(Value::small(0)))
}

pub(super) fn mark_events(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    marks_of_events(vm, arguments[0])
}

pub(super) fn event_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if !event::is_event(&vm.heap, arguments[0]) {
        return vm.exchange.not_a(arguments[0], vm.names.known.event);
    }
    Ok(vm.heap.slot_or_nil(arguments[0], event::NAME))
}

pub(super) fn eventp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(event::is_event(&vm.heap, arguments[0])))
}

pub(super) fn any_event(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    Ok(vm.scheduler.any_event)
}

/// The most events that one wait is for.
const MAX_EVENTS: usize = 4096;

/// Begins a wait of the running task for `events`, an event or a list of them.
///
/// # Errors
/// A failure if something else is among them; [`Exit::Collect`]; [`Exit::Again`] while signals are under
/// delivery.
pub(super) fn begin_wait(vm: &mut Vm, events: Value, options: WaitOptions) -> Outcome {
    vm.scheduler.wait_for_deliveries()?;
    let owner = vm.scheduler.task().object;
    if event::is_event(&vm.heap, events) {
        return Ok(link::open(&mut vm.heap, owner, &[events], options)?);
    }
    if !events.is_list() {
        return vm.exchange.not_a(events, vm.names.known.event);
    }
    let mut list = Vec::new();
    for event in listed_events(vm, events)? {
        if !event::is_event(&vm.heap, event) {
            return vm.exchange.not_a(event, vm.names.known.event);
        }
        if !list.contains(&event) {
            list.push(event);
        }
    }
    vm.exchange.charge(64 * list.len());
    Ok(link::open(&mut vm.heap, owner, &list, options)?)
}

/// Parks the running task until `events` are signalled: at the wait where it was parked, or at a new one.
pub(super) fn take_or_park(vm: &mut Vm, events: Value, options: WaitOptions) -> Outcome {
    let wait = vm.scheduler.task().wait;
    if wait.is_true() && link::signalled(&vm.heap, wait).is_none() {
        return vm.scheduler.park_at(wait, None);
    }
    let wait = begin_wait(vm, events, options)?;
    vm.scheduler.park_at(wait, None)
}

/// Waits for a signal of `events`, and returns its arguments. If `count` is not `NIL`, any signal after they
/// were counted will do.
#[inline]
fn wait_for_signal(vm: &mut Vm, events: Value, count: Value, what: Value) -> Outcome {
    match link::signalled(&vm.heap, vm.scheduler.task().wait) {
        Some(signal) => {
            vm.scheduler.leave_signalled(&mut vm.heap);
            let arguments = input::arguments(&vm.heap, signal);
            give_list(vm, arguments)
        }
        None => wait_on(vm, events, count, what),
    }
}

/// As [`wait_for_signal`], where the signal has not come to the wait of the task, if there is one.
#[inline(never)]
fn wait_on(vm: &mut Vm, events: Value, count: Value, what: Value) -> Outcome {
    let wait = vm.scheduler.task().wait;
    if wait.is_true() {
        return match take_for(vm, wait)? {
            Some(arguments) => {
                vm.scheduler.cancel_wait(&mut vm.heap);
                give_list(vm, arguments)
            }
            None => vm.scheduler.park_at(wait, None),
        };
    }
    vm.scheduler.point()?;
    if what.is_nil()
        && let Some(arguments) = take_kept_by_one_of(vm, events)?
    {
        return give_list(vm, arguments);
    }
    if was_signalled_since(vm, events, count)? {
        return Ok(Value::NIL);
    }
    let wait = begin_wait(vm, events, WaitOptions { what, ..WaitOptions::default() })?;
    vm.scheduler.park_at(wait, None)
}

pub(super) fn wait_for_events(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match arguments {
        &[events] => wait_for_signal(vm, events, Value::NIL, Value::NIL),
        _ => Err(Exit::Slowly),
    }
}

pub(super) fn wait(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [events, count, what] = exactly(arguments);
    wait_for_signal(vm, events, count, what)
}

pub(super) fn signal_and_wait(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [event, count, what] = exactly(arguments);
    if vm.scheduler.task().wait.is_true() {
        return wait_for_signal(vm, event, count, what);
    }
    vm.scheduler.point()?;
    if was_signalled_since(vm, event, count)? {
        return Ok(Value::NIL);
    }
    vm.scheduler.wait_for_deliveries()?;
    vm.signal_event(event, &[])?;
    // If there is no room for the wait now, all is done again, and the count tells.
    let wait = begin_wait(vm, event, WaitOptions { what, ..WaitOptions::default() })?;
    vm.scheduler.park_at(wait, None)
}

pub(super) fn open_wait(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [events, seconds, count, what] = exactly(arguments);
    let deadline = if seconds.is_nil() {
        None
    } else {
        let nanoseconds = nanoseconds(vm, seconds)?;
        Some(time_of_task(vm).saturating_add(nanoseconds).min(LATEST))
    };
    let is_kept = what.is_nil() && is_one_kept(vm, events);
    if !is_kept && was_signalled_since(vm, events, count)? {
        return Ok(Value::NIL);
    }
    begin_wait(vm, events, WaitOptions { keeps: true, deadline, what, ..WaitOptions::default() })
}

pub(super) fn take_signal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let wait = arguments[0];
    if !vm.heap.is(wait, Kind::Wait) {
        let text = format!("{} is not a wait that has been opened", vm.describe(wait));
        return vm.exchange.program_error(text);
    }
    vm.scheduler.task_mut().wait = Value::NIL;
    if let Some(signal) = link::take_kept(&mut vm.heap, wait) {
        return Ok(input::arguments(&vm.heap, signal));
    }
    if let Some(arguments) = take_for(vm, wait)? {
        return Ok(arguments);
    }
    // A signal that is on its way comes before a timeout.
    vm.scheduler.wait_for_deliveries()?;
    let latest = optional(arguments, 1).as_fixnum().map(|time| time.max(0) as u64);
    match latest.or_else(|| link::deadline(&vm.heap, wait)) {
        Some(deadline) if time_of_task(vm) >= deadline => Ok(vm.names.known.timeout),
        deadline => {
            let deadline = deadline.map(|time| vm.scheduler.standstill().when(time));
            let parks = vm.scheduler.park_at(wait, deadline);
            if latest.is_some() {
                // It ends this call, not the wait.
                vm.scheduler.task_mut().has_deadline = link::deadline(&vm.heap, wait).is_some();
            }
            parks
        }
    }
}

pub(super) fn close_wait(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.close_wait(&mut vm.heap, arguments[0]);
    Ok(Value::NIL)
}

pub(super) fn deadline(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if optional(arguments, 1).is_true() && is_negative(&vm.heap, arguments[0]) {
        return vm.exchange.not_written(arguments[0], "(REAL 0)");
    }
    let nanoseconds = nanoseconds(vm, arguments[0])?;
    let time = time_of_task(vm).saturating_add(nanoseconds).min(LATEST);
    Ok(Value::fixnum(time as i64).unwrap_or(Value::NIL))
}

pub(super) fn sleep_until(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(deadline) = arguments[0].as_fixnum().and_then(|time| u64::try_from(time).ok()) else {
        return vm.exchange.type_error(arguments[0], "UNSIGNED-BYTE");
    };
    // The clock was read to make the deadline, and again to fire the timer that ends the wait.
    let standstill = vm.scheduler.standstill();
    if standstill.time_at(vm.scheduler.clock.now) >= deadline {
        Ok(Value::NIL)
    } else {
        let time = standstill.when(deadline);
        vm.scheduler.park_at(Value::NIL, Some(time))
    }
}

pub(super) fn on_signal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [number, function] = exactly(arguments);
    let signal = number.as_index().and_then(ProcessSignal::from_number);
    let Some(signal) = signal.filter(|signal| signal.can_be_handled()) else {
        return vm.exchange.not_written(number, "(MEMBER 1 2 10 12 15 28)");
    };
    let function = vm.callable(function)?;
    vm.embedder.pin(&mut vm.heap, function);
    match vm.embedder.handlers.insert(signal.number(), function) {
        Some(before) => vm.embedder.unpin(before),
        // The process may still receive the signal, which counts as a sender.
        None => vm.outside.senders += 1,
    }
    vm.outside.inbox.note_handled(signal);
    Ok(Value::NIL)
}

pub(super) fn choose(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(count) = arguments[0].as_index().filter(|&count| count > 0) else {
        return vm.exchange.not_written(arguments[0], "(INTEGER 1)");
    };
    let asked_for = AskedFor::of_way(optional(arguments, 1).as_index());
    Ok(Value::index(vm.scheduler.choose(count, asked_for)?))
}

/// Done again when the others have had their turns.
pub(super) fn pass_turn(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    vm.scheduler.turn.end_with(TurnEnd::Passed);
    vm.exchange.charges.end_slice();
    Ok(Value::NIL)
}
