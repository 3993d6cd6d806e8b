//! Events, waits and time: the primitives from which the library makes the forms that wait.
//!
//! A builtin that waits parks its task and is done again, from the start, when the task goes on: then the
//! task's `wait` is what it was parked at.

use crate::builtins::LIMIT;
use crate::heap::Kind;
use crate::raise::{Exit, Outcome};
use crate::schedule::TurnEnd;
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;
use crate::wait::{WaitOptions, event, link};

/// The latest time, in nanoseconds: far beyond the life of a machine, and a fixnum.
const LATEST: u64 = 1 << 60;

impl Vm {
    /// Seconds as nanoseconds; what is negative counts as zero.
    ///
    /// # Errors
    /// A failure if `seconds` is no real number.
    pub(crate) fn nanoseconds(&mut self, seconds: Value) -> Result<u64, Exit> {
        if let Some(n) = seconds.as_fixnum() {
            return Ok((n.max(0) as u64).saturating_mul(1_000_000_000).min(LATEST));
        }
        let seconds = self.double_of("SLEEP", seconds, "REAL")?;
        // A conversion of floats saturates, and makes 0 of what is not a number.
        Ok(((seconds * 1e9).round() as u64).min(LATEST))
    }

    /// The sum of the counts of an event or of a list of events.
    fn count_of_events(&mut self, events: Value) -> Result<i64, Exit> {
        if !events.is_list() {
            return if event::is_event(&self.heap, events) {
                Ok(event::count(&self.heap, events))
            } else {
                self.exchange.not_a(events, self.world.known.event)
            };
        }
        let mut sum = 0_i64;
        for event in self.list_items(events, LIMIT)? {
            if !event::is_event(&self.heap, event) {
                return self.exchange.not_a(event, self.world.known.event);
            }
            sum = sum.wrapping_add(event::count(&self.heap, event));
        }
        Ok(sum)
    }

    /// Whether a wait need not begin because the events were signalled since they were counted.
    fn was_signalled_since(&mut self, events: Value, count: Value) -> Result<bool, Exit> {
        match count.as_fixnum() {
            Some(count) => Ok(self.count_of_events(events)? != count),
            None if count.is_nil() => Ok(false),
            None => self.exchange.type_error(count, "INTEGER"),
        }
    }

    fn give_list(&mut self, list: Value) -> Outcome {
        let mut rest = list;
        if let Some(pair) = self.heap.as_cons(list)
            && (pair.cdr.is_nil() || self.cpu.wants_one)
        {
            return Ok(pair.car);
        }
        self.exchange.values.clear();
        while let Some(pair) = self.heap.as_cons(rest) {
            self.exchange.values.push(pair.car);
            rest = pair.cdr;
        }
        Err(Exit::Values)
    }
}

pub(super) fn make_event(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.make_event(arguments.first().copied().unwrap_or(Value::NIL))
}

pub(super) fn signal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    if !event::is_event(&vm.heap, arguments[0]) {
        return vm.exchange.not_a(arguments[0], vm.world.known.event);
    }
    vm.scheduler.wait_for_deliveries()?;
    vm.signal_event(arguments[0], &arguments[1..])?;
    Ok(Value::NIL)
}

pub(super) fn event_count(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    if !event::is_event(&vm.heap, arguments[0]) {
        return vm.exchange.not_a(arguments[0], vm.world.known.event);
    }
    Ok(vm.heap.slot_or_nil(arguments[0], event::COUNT))
}

pub(super) fn count_events(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    let sum = vm.count_of_events(arguments[0])?;
    Ok(Value::fixnum(sum).unwrap_or(Value::small(0)))
}

pub(super) fn event_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if !event::is_event(&vm.heap, arguments[0]) {
        return vm.exchange.not_a(arguments[0], vm.world.known.event);
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
        return vm.exchange.not_a(events, vm.world.known.event);
    }
    let mut list = Vec::new();
    for event in vm.list_items(events, MAX_EVENTS)? {
        if !event::is_event(&vm.heap, event) {
            return vm.exchange.not_a(event, vm.world.known.event);
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

/// Waits for a signal of `events` that comes after they were counted, if `count` is not `NIL`, and gives its
/// arguments.
fn wait_for_signal(vm: &mut Vm, events: Value, count: Value, what: Value) -> Outcome {
    let wait = vm.scheduler.task().wait;
    if wait.is_true() {
        return match link::signalled(&vm.heap, wait) {
            Some(arguments) => {
                vm.scheduler.leave_signalled(&mut vm.heap);
                vm.give_list(arguments)
            }
            None => vm.scheduler.park_at(wait, None),
        };
    }
    vm.scheduler.point()?;
    if vm.was_signalled_since(events, count)? {
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

pub(super) fn open_wait(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [events, seconds, count, what] = exactly(arguments);
    let deadline = if seconds.is_nil() {
        None
    } else {
        let nanoseconds = vm.nanoseconds(seconds)?;
        Some(vm.scheduler.clock.read(&mut *vm.outside.host).saturating_add(nanoseconds).min(LATEST))
    };
    if vm.was_signalled_since(events, count)? {
        return Ok(Value::NIL);
    }
    begin_wait(vm, events, WaitOptions { keeps: true, deadline, what, ..WaitOptions::default() })
}

pub(super) fn take_signal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let wait = arguments[0];
    if !vm.heap.is(wait, Kind::Wait) {
        return vm.exchange.type_error(wait, "ATOM");
    }
    vm.scheduler.task_mut().wait = Value::NIL;
    if let Some(arguments) = link::take_kept(&mut vm.heap, wait) {
        return Ok(arguments);
    }
    // A signal that is on its way comes before a timeout.
    vm.scheduler.wait_for_deliveries()?;
    match link::deadline(&vm.heap, wait) {
        Some(deadline) if vm.scheduler.clock.read(&mut *vm.outside.host) >= deadline => {
            Ok(vm.world.known.timeout)
        }
        deadline => vm.scheduler.park_at(wait, deadline),
    }
}

pub(super) fn close_wait(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.close_wait(&mut vm.heap, arguments[0]);
    Ok(Value::NIL)
}

pub(super) fn deadline(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let nanoseconds = vm.nanoseconds(arguments[0])?;
    let time = vm.scheduler.clock.read(&mut *vm.outside.host).saturating_add(nanoseconds).min(LATEST);
    Ok(Value::fixnum(time as i64).unwrap_or(Value::NIL))
}

pub(super) fn sleep_until(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(deadline) = arguments[0].as_index() else {
        return vm.exchange.type_error(arguments[0], "UNSIGNED-BYTE");
    };
    let now = vm.scheduler.clock.read(&mut *vm.outside.host);
    if now >= deadline as u64 {
        Ok(Value::NIL)
    } else {
        vm.scheduler.park_at(Value::NIL, Some(deadline as u64))
    }
}

/// Done again when the others have had their turns.
pub(super) fn pass_turn(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    vm.scheduler.turn.end_with(TurnEnd::Passed);
    vm.exchange.charges.end_slice();
    Ok(Value::NIL)
}
