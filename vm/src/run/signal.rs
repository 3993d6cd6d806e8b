//! Signals, and handing them to waiters.
//!
//! A signal is one step for the program, but it may have a million waiters. Those beyond the first thousand
//! become a [`Delivery`], which is worked off between turns, a thousand waiters at a time. Until that is done
//! the task that signals is held back, and so is any task that would begin a wait, let one time out, or
//! signal; the latter try again then ([`Exit::Again`]). So no task can tell the difference: a task that waits
//! when the signal is given gets it, and goes on before the task that has given it; a task that begins to
//! wait later does not.

use super::finish::allocate_without_retry;
use super::limit::charge_account;
use super::wake::make_runnable;
use crate::heap::{Heap, Kind};
use crate::raise::Exit;
use crate::report;
use crate::schedule::{Measure, TurnEnd};
use crate::task::TaskNumber;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::input::{self, WhenFull};
use crate::wait::{Delivery, event, link};

/// Waits that get a signal in one step.
const AT_ONCE: usize = 1000;

impl Vm {
    /// Creates an event.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room.
    pub fn make_event(&mut self, name: Value) -> Result<Value, Exit> {
        Ok(event::make(&mut self.heap, name)?)
    }

    /// Signals an event, as if the running task had called `signal`: every task that waits for it becomes
    /// runnable, in the order in which they began to wait.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room; then nothing has happened.
    pub fn signal_event(&mut self, event: Value, arguments: &[Value]) -> Result<(), Exit> {
        let arguments = self.heap.list(arguments)?;
        signal(self, event, arguments)
    }
}

/// Signals an event with a list of arguments.
///
/// # Errors
/// [`Exit::Collect`] without room; then nothing has happened.
#[inline(always)]
pub(crate) fn signal(vm: &mut Vm, event: Value, arguments: Value) -> Result<(), Exit> {
    if input::is_input(&vm.heap, event) {
        return signal_input(vm, event, arguments);
    }
    wake_waiters(vm, event, arguments)
}

/// Signals an input: the tasks that wait for it get the signal, or the input keeps it.
fn signal_input(vm: &mut Vm, input: Value, arguments: Value) -> Result<(), Exit> {
    let takers = if input::is_empty(&vm.heap, input) { count_takers(vm, input) } else { 0 };
    match takers {
        0 => {
            let cell = vm.heap.cons(arguments, Value::NIL)?;
            wake_waiters(vm, input, Value::NIL)?;
            input::keep(&mut vm.heap, input, cell);
            show_kept(vm, input);
            Ok(())
        }
        1 => {
            let loan = input::loan(&mut vm.heap, input, arguments)?;
            wake_waiters(vm, input, loan)
        }
        _ => wake_waiters(vm, input, arguments),
    }
}

/// Says outside how many signals an input keeps, if senders wait for room in it.
pub(crate) fn show_kept(vm: &Vm, input: Value) {
    if input::when_full(&vm.heap, input) != WhenFull::Wait {
        return;
    }
    let name = vm.heap.slot_or_nil(input, event::NAME);
    let name = vm.heap.symbol(name).map_or(name, |symbol| symbol.name);
    if let Some(name) = vm.heap.string_text(name) {
        vm.outside.inbox.note_kept(&name, input::size(&vm.heap, input));
    }
}

/// Returns how many waits would get a signal of an input: none, one, or more than one.
fn count_takers(vm: &mut Vm, input: Value) -> usize {
    let (mut count, mut seen) = (0, 0);
    let mut link = link::first(&vm.heap, input);
    while link.is_true() && count < 2 {
        let (wait, next) = link::wait_and_next(&vm.heap, link);
        count += usize::from(is_ready(vm, wait));
        seen += 1;
        link = next;
    }
    vm.exchange.charge(seen);
    count
}

/// Returns whether a wait for an input gets the next signal: one that keeps signals gets it only if its task
/// is parked there, and otherwise takes it later.
fn is_ready(vm: &Vm, wait: Value) -> bool {
    let is_free = !link::keeps(&vm.heap, wait) || vm.scheduler.index_of_parked(&vm.heap, wait).is_some();
    is_free && link::takes(&vm.heap, wait)
}

/// Hands a signal to the waiters of an event, and counts it.
///
/// # Errors
/// [`Exit::Collect`] without room; then nothing has happened.
pub(super) fn wake_waiters(vm: &mut Vm, event: Value, arguments: Value) -> Result<(), Exit> {
    let any_event = vm.scheduler.any_event;
    let is_awaited = event::is_awaited(&vm.heap, event);
    let any_is_awaited = event::is_awaited(&vm.heap, any_event);
    if vm.watch.is_followed && (is_awaited || !vm.heap.is(event, Kind::Task)) {
        report::tell_of_signal(vm, event);
    }
    if !is_awaited && !any_is_awaited {
        event::count_signal(&mut vm.heap, event);
        event::count_signal(&mut vm.heap, any_event);
        return Ok(());
    }
    if !any_is_awaited
        && vm.scheduler.deliveries.is_empty()
        && let Some(wait) = link::only_wait(&vm.heap, event)
    {
        event::count_signal(&mut vm.heap, event);
        let (by, mut no_cells) = (vm.scheduler.running_number(), Value::NIL);
        hand_over(vm, wait, (event, by), arguments, &mut no_cells);
        event::count_signal(&mut vm.heap, any_event);
        vm.exchange.charge(64);
        return Ok(());
    }
    if vm.scheduler.deliveries.is_empty()
        && let Some(keepers) = keepers_if_few(&vm.heap, event)
        && let Some(others) = keepers_if_few(&vm.heap, any_event)
    {
        // Everything is allocated before anything happens.
        let cells = cells(&mut vm.heap, keepers, arguments)?;
        let other_cells = self::cells(&mut vm.heap, others, Value::NIL)?;
        let mut woken = deliver(vm, event, arguments, cells);
        if any_is_awaited {
            woken += deliver(vm, any_event, Value::NIL, other_cells);
        } else {
            event::count_signal(&mut vm.heap, any_event);
        }
        vm.exchange.charge(64 * woken);
        return Ok(());
    }
    for (event, arguments) in [(event, arguments), (any_event, Value::NIL)] {
        event::count_signal(&mut vm.heap, event);
        begin_delivery(vm, event, arguments);
    }
    if vm.scheduler.running.is_some() {
        vm.scheduler.turn.end_with(TurnEnd::Held);
        vm.exchange.charges.end_slice();
    }
    Ok(())
}

/// Returns how many of the waits for `event` keep signals; `None` if there are too many waits to see to in
/// one step.
#[inline]
fn keepers_if_few(heap: &Heap, event: Value) -> Option<usize> {
    let (mut keepers, mut count) = (0, 0);
    let mut link = link::first(heap, event);
    while link.is_true() {
        count += 1;
        if count > AT_ONCE {
            return None;
        }
        let (wait, next) = link::wait_and_next(heap, link);
        keepers += usize::from(link::keeps(heap, wait));
        link = next;
    }
    Some(keepers)
}

/// Creates a list of `count` conses that all hold `item`.
fn cells(heap: &mut Heap, count: usize, item: Value) -> Result<Value, Exit> {
    let mut cells = Value::NIL;
    for _ in 0..count {
        cells = heap.cons(item, cells)?;
    }
    Ok(cells)
}

/// Hands a signal to every wait for `event`, and returns how many there are. `cells` is a list of as many
/// conses as there are waits that keep signals.
fn deliver(vm: &mut Vm, event: Value, arguments: Value, mut cells: Value) -> usize {
    event::count_signal(&mut vm.heap, event);
    let mut link = link::first(&vm.heap, event);
    let mut woken = 0;
    let by = vm.scheduler.running_number();
    while link.is_true() {
        // A wait is in the list once, so closing it does not touch the next link.
        let (wait, next) = link::wait_and_next(&vm.heap, link);
        hand_over(vm, wait, (event, by), arguments, &mut cells);
        woken += 1;
        link = next;
    }
    woken
}

/// Puts a signal under delivery, if any task waits for it.
fn begin_delivery(vm: &mut Vm, event: Value, arguments: Value) {
    let next = link::first(&vm.heap, event);
    if next.is_true() {
        let scheduler = &mut vm.scheduler;
        let account = scheduler.running_account();
        let by = scheduler.running_number();
        scheduler.accounts.enter(account);
        scheduler.deliveries.signals.push_back(Delivery { event, arguments, next, account, by });
    }
}

/// Works off a part of the signals under delivery.
pub(crate) fn deliver_some(vm: &mut Vm) {
    let Some(&delivery) = vm.scheduler.deliveries.signals.front() else { return };
    let Delivery { event, arguments, next, account, by } = delivery;
    let mut waits = Vec::with_capacity(AT_ONCE);
    let (mut link, mut keepers) = (next, 0);
    while link.is_true() && waits.len() < AT_ONCE {
        let (wait, next) = link::wait_and_next(&vm.heap, link);
        keepers += usize::from(link::keeps(&vm.heap, wait));
        waits.push(wait);
        link = next;
    }
    let mut cells = allocate_without_retry(vm, |vm| cells(&mut vm.heap, keepers, arguments));
    // Nothing is allocated while it is out of the queue. The waits that are closed are in front of its next
    // link.
    vm.scheduler.deliveries.signals.pop_front();
    for &wait in &waits {
        hand_over(vm, wait, (event, by), arguments, &mut cells);
    }
    vm.scheduler.spent += waits.len() as u64;
    charge_account(vm, account, Measure::Ticks, waits.len() as u64);
    if link.is_true() {
        vm.scheduler.deliveries.signals.push_front(Delivery { next: link, ..delivery });
        return;
    }
    vm.scheduler.accounts.leave(account);
    if vm.scheduler.deliveries.is_empty() {
        release_held(vm);
    }
}

/// Lets the tasks go on that were held back.
fn release_held(vm: &mut Vm) {
    for (index, serial) in std::mem::take(&mut vm.scheduler.deliveries.held) {
        if vm.scheduler.tasks.at(index).is_some_and(|task| task.serial == serial) {
            make_runnable(vm, index, false);
        }
    }
}

/// Hands a signal, an event and the task that gave it, to a wait. A wait that keeps signals gets the first of
/// `cells`.
#[inline(always)]
fn hand_over(vm: &mut Vm, wait: Value, signal: (Value, TaskNumber), arguments: Value, cells: &mut Value) {
    if input::is_input(&vm.heap, signal.0) && link::takes(&vm.heap, wait) {
        // The wait itself takes a signal that an input keeps, when its task runs.
        if !input::is_empty(&vm.heap, signal.0) || !is_ready(vm, wait) {
            return;
        }
    }
    if link::keeps(&vm.heap, wait) {
        let cell = *cells;
        *cells = vm.heap.cdr(cell).unwrap_or(Value::NIL);
        vm.heap.set_cdr(cell, Value::NIL);
        link::enqueue(&mut vm.heap, wait, cell);
    } else {
        link::set_signalled(&mut vm.heap, &mut vm.scheduler.deliveries, wait, arguments);
    }
    wake_waiter(vm, wait, signal);
}

/// Adds `cell`, a cons or `NIL`, to the queue of a wait as a signal of `event`, and lets the waiting task go
/// on.
pub(super) fn keep(vm: &mut Vm, wait: Value, cell: Value, event: Value) {
    if cell.is_cons() {
        link::enqueue(&mut vm.heap, wait, cell);
    }
    let by = vm.scheduler.running_number();
    wake_waiter(vm, wait, (event, by));
}

/// Makes the task runnable that is parked at this wait, if one is.
#[inline(always)]
fn wake_waiter(vm: &mut Vm, wait: Value, (event, by): (Value, TaskNumber)) {
    let urgent = link::is_urgent(&vm.heap, wait);
    if let Some(index) = vm.scheduler.index_of_parked(&vm.heap, wait) {
        make_runnable(vm, index, urgent);
        if vm.watch.is_followed {
            report::tell_of_waking(vm, event, by, index);
        }
    }
}
