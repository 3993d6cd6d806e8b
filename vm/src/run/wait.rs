//! Beginning waits, and ending them.

use crate::heap::Kind;
use crate::heap::layout::Header;
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::schedule::Parking;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{WaitOptions, event, link};

/// The most events that one wait is for.
const MAX_EVENTS: usize = 4096;

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
    pub(super) fn wait_flags(&self, wait: Value) -> u8 {
        self.heap.header(wait).map_or(0, |header: Header| header.flags)
    }

    /// Whether `object` is an event; tasks are.
    pub(crate) fn is_event(&self, object: Value) -> bool {
        matches!(self.heap.kind(object), Some(Kind::Event | Kind::Task))
    }

    /// Notes that `datum` is no event.
    pub(crate) fn event_error<T>(&mut self, datum: Value) -> Result<T, Exit> {
        self.exchange.raise(Raised::Type(datum, Expected::Specifier(self.world.known.event)))
    }

    /// Notes that `datum` is no task.
    pub(crate) fn task_error<T>(&mut self, datum: Value) -> Result<T, Exit> {
        self.exchange.raise(Raised::Type(datum, Expected::Specifier(self.world.known.task)))
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
    pub(super) fn wait_of(&self, link: Value) -> Value {
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
        self.exchange.charge(64 * list.len());
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
    pub(super) fn make_wait(&mut self, options: WaitOptions) -> Outcome {
        let deadline = options.deadline.and_then(|time| Value::fixnum(time as i64)).unwrap_or(Value::NIL);
        let queue = if options.keeps { self.heap.cons(Value::NIL, Value::NIL)? } else { Value::NIL };
        let mut flags = if options.keeps { link::KEEPS } else { 0 };
        flags |= if options.urgent { link::URGENT } else { 0 };
        flags |= if options.child { link::CHILD } else { 0 };
        let mut slots = [Value::NIL; link::LENGTH];
        slots[link::OWNER] = self.scheduler.task().object;
        slots[link::QUEUE] = queue;
        slots[link::DEADLINE] = deadline;
        slots[link::MORE] = options.what;
        Ok(self.heap.alloc_record(Kind::Wait, flags, 0, &slots)?)
    }

    /// Puts a link at the end of the list of an event.
    pub(super) fn link(&mut self, link: Value, event: Value) {
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
    pub(super) fn unlink(&mut self, link: Value) {
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
        let wait = std::mem::replace(&mut self.scheduler.task_mut().wait, Value::NIL);
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
        self.scheduler.task_mut().wait = wait;
        self.scheduler.turn.parking = Parking::Wait(deadline);
        Err(Exit::Park)
    }

    /// The arguments of the signal for which a wait of the running task was, if it has come.
    pub(crate) fn take_signalled(&mut self, wait: Value) -> Option<Value> {
        (self.wait_flags(wait) & link::SIGNALLED != 0).then(|| self.slot(wait, link::QUEUE))
    }

    /// Leaves the wait at which the running task was parked. Its signal has come, so it is in no list any more.
    pub(crate) fn leave_signalled(&mut self) {
        let wait = std::mem::replace(&mut self.scheduler.task_mut().wait, Value::NIL);
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
