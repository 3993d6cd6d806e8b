//! Events, and the waits of tasks for them.
//!
//! An event is an object of the heap with a count of its signals and a list of those who wait. A task is an event too: its
//! checkpoints and its end signal it. A wait is an object as well, one link for each event that it is for:
//!
//! ```text
//! event | name | count | first | last |          task | as an event | state | result | checkpoints |
//!                          |       +-----------------------------+
//! wait  | owner | event | previous | next | more | queue | deadline |
//! ```
//!
//! Guarantees (signals are in `wait/signal.rs`): a signal reaches everybody who waits when it is given, in the order in which they began; to look at a count and
//! to begin to wait is one step; a wait that has ended is in no list. A wait is either for one signal, and is over with it,
//! or keeps them: then signals are queued until it is closed, and none is lost.
//! Not here: whose turn it is (`schedule`), and what ends a wait from outside (`limit`).

use crate::heap::Kind;
use crate::heap::layout::Header;
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

mod signal;

pub(crate) use signal::Delivery;

/// Slots of an event.
pub(crate) mod event {
    /// What it is called: anything, or `NIL`.
    pub(crate) const NAME: usize = 0;
    /// How often it was signalled.
    pub(crate) const COUNT: usize = 1;
    /// The wait that began first, or `NIL`.
    pub(crate) const FIRST: usize = 2;
    /// The wait that began last, or `NIL`.
    pub(crate) const LAST: usize = 3;
    /// Of a task: its place while it lives, then its status.
    pub(crate) const STATE: usize = 4;
    /// Of a task: the number of the task that made it; when it has ended, its value or values, or the condition.
    pub(crate) const RESULT: usize = 5;
    /// Of a task: the checkpoints that it has passed.
    pub(crate) const CHECKPOINTS: usize = 6;
    /// Number of slots of a task.
    pub(crate) const TASK_LENGTH: usize = 7;
}

/// Slots and flags of a wait.
pub(crate) mod link {
    /// The task; in the links after the first, the first.
    pub(super) const OWNER: usize = 0;
    /// The event whose list it is in, or `NIL`.
    pub(super) const EVENT: usize = 1;
    /// The links before and after it in that list.
    pub(super) const PREVIOUS: usize = 2;
    pub(super) const NEXT: usize = 3;
    /// The next link of the same wait; in the last, what is waited for, for reports.
    pub(super) const MORE: usize = 4;
    /// The arguments of the signal; of a wait that keeps signals, a pair of the first and the last of a list of them.
    pub(super) const QUEUE: usize = 5;
    /// When it ends by itself, in nanoseconds, or `NIL`.
    pub(crate) const DEADLINE: usize = 6;
    pub(super) const LENGTH: usize = 7;

    /// Flag: signals are kept until the wait is closed.
    pub(super) const KEEPS: u8 = 1;
    /// Flag: its signal has come.
    pub(super) const SIGNALLED: u8 = 2;
    /// Flag: who waits goes on without delay.
    pub(super) const URGENT: u8 = 4;
    /// Flag: it is for the end of a child, which is bounded.
    pub(super) const CHILD: u8 = 8;
}

/// The most events that one wait is for.
const MAX_EVENTS: usize = 4096;

/// How a task comes to be parked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Parking {
    /// For input from outside.
    #[default]
    Input,
    /// For a signal, or until a time in nanoseconds.
    Wait(Option<u64>),
}

/// What a wait is like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WaitOptions {
    /// Whether signals are kept.
    pub keeps: bool,
    /// Whether who waits goes on without delay.
    pub urgent: bool,
    /// Whether it is for the end of a child.
    pub child: bool,
    /// When it ends by itself.
    pub deadline: Option<u64>,
    /// What is waited for, for reports; `NIL` if the events say it.
    pub what: Value,
}

impl Default for WaitOptions {
    fn default() -> WaitOptions {
        WaitOptions { keeps: false, urgent: false, child: false, deadline: None, what: Value::NIL }
    }
}

impl Vm {
    /// Slot `index` of an object of the machine; `NIL` if it has none.
    #[inline]
    pub(crate) fn slot(&self, object: Value, index: usize) -> Value {
        self.heap.slot(object, index).unwrap_or(Value::NIL)
    }

    #[inline]
    pub(crate) fn set_slot(&mut self, object: Value, index: usize, value: Value) {
        if let Some(kind) = self.heap.kind(object) {
            self.heap.record_set(object, kind, index, value);
        }
    }

    #[inline]
    fn wait_flags(&self, wait: Value) -> u8 {
        self.heap.header(wait).map_or(0, |header: Header| header.flags)
    }

    /// Whether `object` is an event; tasks are.
    pub(crate) fn is_event(&self, object: Value) -> bool {
        matches!(self.heap.kind(object), Some(Kind::Event | Kind::Task))
    }

    /// Notes that `datum` is no event.
    pub(crate) fn event_error<T>(&mut self, datum: Value) -> Result<T, Exit> {
        self.raise(Raised::Type(datum, Expected::Specifier(self.world.known.event)))
    }

    /// Notes that `datum` is no task.
    pub(crate) fn task_error<T>(&mut self, datum: Value) -> Result<T, Exit> {
        self.raise(Raised::Type(datum, Expected::Specifier(self.world.known.task)))
    }

    /// A new event.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room.
    pub fn make_event(&mut self, name: Value) -> Outcome {
        Ok(self.heap.alloc_record(Kind::Event, 0, 0, &[name, Value::small(0), Value::NIL, Value::NIL])?)
    }

    /// How often an event was signalled.
    pub(crate) fn event_count(&self, event: Value) -> i64 {
        self.slot(event, event::COUNT).as_fixnum().unwrap_or(0)
    }

    /// The wait that a link belongs to.
    #[inline]
    fn wait_of(&self, link: Value) -> Value {
        let owner = self.slot(link, link::OWNER);
        if self.heap.is(owner, Kind::Wait) { owner } else { link }
    }

    /// Begins a wait of the running task for `events`, an event or a list of them.
    ///
    /// # Errors
    /// A failure if something else is among them; [`Exit::Collect`]; [`Exit::Again`] while a signal is being delivered.
    pub(crate) fn open_wait(&mut self, events: Value, options: WaitOptions) -> Outcome {
        self.wait_for_deliveries()?;
        if self.is_event(events) {
            let wait = self.make_wait(options)?;
            self.link(wait, events);
            return Ok(wait);
        }
        if !events.is_list() {
            return self.event_error(events);
        }
        let mut list = Vec::new();
        for event in self.list_items(events, MAX_EVENTS)? {
            if !self.is_event(event) {
                return self.event_error(event);
            }
            if !list.contains(&event) {
                list.push(event);
            }
        }
        self.charge(64 * list.len());
        let first = self.make_wait(options)?;
        let mut links = Vec::with_capacity(list.len());
        links.push(first);
        let mut more = options.what;
        for _ in 1..list.len() {
            let mut slots = [Value::NIL; link::LENGTH];
            slots[link::OWNER] = first;
            slots[link::MORE] = more;
            more = self.heap.alloc_record(Kind::Wait, 0, 0, &slots)?;
            links.push(more);
        }
        if list.len() > 1 {
            self.set_slot(first, link::MORE, more);
        }
        for (link, event) in links.into_iter().zip(list) {
            self.link(link, event);
        }
        Ok(first)
    }

    /// A wait of the running task that is in no list yet.
    fn make_wait(&mut self, options: WaitOptions) -> Outcome {
        let deadline = options.deadline.and_then(|time| Value::fixnum(time as i64)).unwrap_or(Value::NIL);
        let queue = if options.keeps { self.heap.cons(Value::NIL, Value::NIL)? } else { Value::NIL };
        let mut flags = if options.keeps { link::KEEPS } else { 0 };
        flags |= if options.urgent { link::URGENT } else { 0 };
        flags |= if options.child { link::CHILD } else { 0 };
        let mut slots = [Value::NIL; link::LENGTH];
        slots[link::OWNER] = self.task().object;
        slots[link::QUEUE] = queue;
        slots[link::DEADLINE] = deadline;
        slots[link::MORE] = options.what;
        Ok(self.heap.alloc_record(Kind::Wait, flags, 0, &slots)?)
    }

    /// Puts a link at the end of the list of an event.
    fn link(&mut self, link: Value, event: Value) {
        let last = self.slot(event, event::LAST);
        self.set_slot(link, link::EVENT, event);
        if last.is_true() {
            self.set_slot(link, link::PREVIOUS, last);
            self.set_slot(last, link::NEXT, link);
        } else {
            self.set_slot(event, event::FIRST, link);
        }
        self.set_slot(event, event::LAST, link);
    }

    /// Takes a link out of its list, if it is in one.
    fn unlink(&mut self, link: Value) {
        let event = self.slot(link, link::EVENT);
        if event.is_nil() {
            return;
        }
        let (previous, next) = (self.slot(link, link::PREVIOUS), self.slot(link, link::NEXT));
        self.pass_over(link, next);
        if previous.is_true() {
            self.set_slot(previous, link::NEXT, next);
        } else {
            self.set_slot(event, event::FIRST, next);
        }
        if next.is_true() {
            self.set_slot(next, link::PREVIOUS, previous);
        } else {
            self.set_slot(event, event::LAST, previous);
        }
        self.set_slot(link, link::EVENT, Value::NIL);
        if previous.is_true() {
            self.set_slot(link, link::PREVIOUS, Value::NIL);
        }
        if next.is_true() {
            self.set_slot(link, link::NEXT, Value::NIL);
        }
    }

    /// Ends a wait: it is in no list any more.
    pub(crate) fn close_wait(&mut self, wait: Value) {
        let mut link = wait;
        while self.heap.is(link, Kind::Wait) {
            self.unlink(link);
            link = self.slot(link, link::MORE);
        }
    }

    /// Ends the wait at which the running task was parked, because it will not go on there.
    pub(crate) fn cancel_wait(&mut self) {
        let wait = std::mem::replace(&mut self.task_mut().wait, Value::NIL);
        if wait.is_true() {
            self.heap.log_if_marking(wait);
            self.close_wait(wait);
        }
    }

    /// Parks the running task at `wait`; the instruction is done again when it goes on.
    ///
    /// # Errors
    /// Always: [`Exit::Park`], or the failure that a critical section cannot wait.
    pub(crate) fn park(&mut self, wait: Value, deadline: Option<u64>) -> Outcome {
        self.task_mut().wait = wait;
        self.parking = Parking::Wait(deadline);
        Err(Exit::Park)
    }

    /// The arguments of the signal for which a wait of the running task was, if it has come.
    pub(crate) fn take_signalled(&mut self, wait: Value) -> Option<Value> {
        (self.wait_flags(wait) & link::SIGNALLED != 0).then(|| self.slot(wait, link::QUEUE))
    }

    /// Leaves the wait at which the running task was parked. Its signal has come, so it is in no list any more.
    pub(crate) fn leave_signalled(&mut self) {
        let wait = std::mem::replace(&mut self.task_mut().wait, Value::NIL);
        self.heap.log_if_marking(wait);
    }

    /// The arguments of the first signal that a wait has kept.
    pub(crate) fn take_kept(&mut self, wait: Value) -> Option<Value> {
        let queue = self.slot(wait, link::QUEUE);
        let first = self.heap.car(queue).filter(|first| first.is_cons())?;
        let rest = self.heap.cdr(first).unwrap_or(Value::NIL);
        self.heap.set_car(queue, rest);
        if rest.is_nil() {
            self.heap.set_cdr(queue, Value::NIL);
        }
        self.heap.car(first)
    }

    /// When a wait ends by itself.
    pub(crate) fn wait_deadline(&self, wait: Value) -> Option<u64> {
        self.slot(wait, link::DEADLINE).as_fixnum().map(|time| time as u64)
    }

    /// Whether a wait is for the end of a child.
    pub(crate) fn is_for_child(&self, wait: Value) -> bool {
        self.wait_flags(wait) & link::CHILD != 0
    }

    /// The events that a wait is for, and what else is known of what is waited for.
    pub(crate) fn waited_for(&self, wait: Value) -> (Vec<Value>, Value) {
        let mut events = Vec::new();
        let mut link = wait;
        while self.heap.is(link, Kind::Wait) {
            events.push(self.slot(link, link::EVENT));
            link = self.slot(link, link::MORE);
        }
        events[1..].reverse();
        (events, link)
    }
}
