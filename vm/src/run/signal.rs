//! Signals, and handing them to those who wait.
//!
//! A signal is one step for the program, but it may have a million waiters. Those beyond the first thousand are a
//! [`Delivery`], which the scheduler works off between turns, a thousand at a time. Until that is done the task that signals is
//! held back, and so is whoever would begin to wait, let a wait time out, or signal; the latter try again then
//! ([`Exit::Again`]). So nobody can tell the difference: who waits when the signal is given gets it and goes on before the
//! task that has given it, and who begins later does not.

use crate::heap::Kind;
use crate::raise::Exit;
use crate::task::AccountId;
use crate::task::TaskState;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{Delivery, event, link};

/// Waits that are seen to in one step.
const AT_ONCE: usize = 1000;

impl Vm {
    /// Signals an event: everybody who waits for it becomes runnable, in the order in which they began to wait. It is as
    /// if the running task had called `signal`.
    ///
    /// # Errors
    /// [`Exit::Collect`] without room; then nothing has happened.
    pub fn signal_event(&mut self, event: Value, arguments: &[Value]) -> Result<(), Exit> {
        let arguments = self.heap.list(arguments)?;
        self.signal(event, arguments)
    }

    /// Signals an event with a list of arguments.
    pub(crate) fn signal(&mut self, event: Value, arguments: Value) -> Result<(), Exit> {
        let any_event = self.scheduler.any_event;
        let is_awaited = self.slot(event, event::FIRST).is_true();
        let any_is_awaited = self.slot(any_event, event::FIRST).is_true();
        if self.watch.is_watched && (is_awaited || !self.heap.is(event, Kind::Task)) {
            self.tell_of_signal(event);
        }
        if !is_awaited && !any_is_awaited {
            self.count_signal(event);
            self.count_signal(any_event);
            return Ok(());
        }
        if self.scheduler.deliveries.is_empty()
            && let Some(keepers) = self.keepers_if_few(event)
            && let Some(others) = self.keepers_if_few(any_event)
        {
            // Everything is allocated before anything happens.
            let cells = self.cells(keepers, arguments)?;
            let other_cells = self.cells(others, Value::NIL)?;
            let mut woken = self.deliver(event, arguments, cells);
            if any_is_awaited {
                woken += self.deliver(any_event, Value::NIL, other_cells);
            } else {
                self.count_signal(any_event);
            }
            self.exchange.charge(64 * woken);
            return Ok(());
        }
        for (event, arguments) in [(event, arguments), (any_event, Value::NIL)] {
            self.count_signal(event);
            let task = self.scheduler.running.as_ref();
            let (account, by) = task.map_or((AccountId::NONE, 0), |task| (task.account, task.number));
            let next = self.slot(event, event::FIRST);
            if next.is_true() {
                self.scheduler.accounts.enter(account);
                self.scheduler.deliveries.push_back(Delivery { event, arguments, next, account, by });
            }
        }
        if self.scheduler.running.is_some() {
            self.scheduler.turn.holds_task = true;
            self.end_slice_here();
        }
        Ok(())
    }

    /// Has an operation on waits of the running task wait for the signals that are being delivered.
    ///
    /// # Errors
    /// [`Exit::Again`] if there are some.
    pub(crate) fn wait_for_deliveries(&mut self) -> Result<(), Exit> {
        if self.scheduler.deliveries.is_empty() || self.scheduler.running.is_none() {
            return Ok(());
        }
        self.scheduler.turn.holds_task = true;
        Err(Exit::Again)
    }

    /// How many of those who wait for `event` keep signals; `None` if there are too many to see to in one step.
    fn keepers_if_few(&self, event: Value) -> Option<usize> {
        let (mut keepers, mut count) = (0, 0);
        let mut link = self.slot(event, event::FIRST);
        while link.is_true() {
            count += 1;
            if count > AT_ONCE {
                return None;
            }
            keepers += usize::from(self.wait_flags(self.wait_of(link)) & link::KEEPS != 0);
            link = self.slot(link, link::NEXT);
        }
        Some(keepers)
    }

    /// A list of `count` conses that all hold `item`.
    fn cells(&mut self, count: usize, item: Value) -> Result<Value, Exit> {
        let mut cells = Value::NIL;
        for _ in 0..count {
            cells = self.heap.cons(item, cells)?;
        }
        Ok(cells)
    }

    fn count_signal(&mut self, event: Value) {
        let count = Value::fixnum(self.event_count(event) + 1).unwrap_or(Value::small(0));
        self.set_slot(event, event::COUNT, count);
    }

    /// Hands a signal to everybody who waits for `event`; gives how many. `cells` is a list of as many conses as there are
    /// waits that keep signals.
    fn deliver(&mut self, event: Value, arguments: Value, mut cells: Value) -> usize {
        self.count_signal(event);
        let mut link = self.slot(event, event::FIRST);
        let mut woken = 0;
        let by = self.scheduler.running.as_ref().map_or(0, |task| task.number);
        while link.is_true() {
            // A wait is in the list once, so ending it does not touch the next link.
            let next = self.slot(link, link::NEXT);
            self.hand_over(link, (event, by), arguments, &mut cells);
            woken += 1;
            link = next;
        }
        woken
    }

    /// Works off a part of the signals that are being delivered.
    pub(crate) fn deliver_some(&mut self) {
        let Some(&Delivery { event, arguments, next, account, by }) = self.scheduler.deliveries.front()
        else {
            return;
        };
        let mut links = Vec::with_capacity(AT_ONCE);
        let (mut link, mut keepers) = (next, 0);
        while link.is_true() && links.len() < AT_ONCE {
            keepers += usize::from(self.wait_flags(self.wait_of(link)) & link::KEEPS != 0);
            links.push(link);
            link = self.slot(link, link::NEXT);
        }
        let mut cells = self.make_for_end(|vm| vm.cells(keepers, arguments));
        for &link in &links {
            self.hand_over(link, (event, by), arguments, &mut cells);
        }
        self.scheduler.spent += links.len() as u64;
        self.charge_account(account, links.len() as u64);
        match self.scheduler.deliveries.front_mut() {
            Some(delivery) if link.is_true() => delivery.next = link,
            _ => {
                self.scheduler.deliveries.pop_front();
                self.scheduler.accounts.leave(account);
                if self.scheduler.deliveries.is_empty() {
                    self.release_held();
                }
            }
        }
    }

    /// Keeps a task that can run from running until the signals under way are delivered.
    pub(crate) fn hold(&mut self, index: u32) {
        let serial = self.scheduler.next_serial();
        if let Some(task) = self.scheduler.tasks.at_mut(index) {
            task.serial = serial;
            self.scheduler.held.push((index, serial));
        }
    }

    fn release_held(&mut self) {
        for (index, serial) in std::mem::take(&mut self.scheduler.held) {
            if self.scheduler.tasks.at(index).is_some_and(|task| task.serial == serial) {
                self.make_runnable(index, false);
            }
        }
    }

    /// Notes that a link leaves its list, in front of `next`, so that no delivery goes by it.
    pub(super) fn pass_over(&mut self, link: Value, next: Value) {
        for delivery in &mut self.scheduler.deliveries {
            if delivery.next == link {
                delivery.next = next;
            }
        }
    }

    /// Hands a signal, of an event by the task of a number, to the wait that `link` belongs to. If that keeps signals, it gets
    /// the first of `cells`.
    fn hand_over(&mut self, link: Value, signal: (Value, u64), arguments: Value, cells: &mut Value) {
        let wait = self.wait_of(link);
        let flags = self.wait_flags(wait);
        if flags & link::KEEPS == 0 {
            self.set_slot(wait, link::QUEUE, arguments);
            self.heap.set_flags(wait, Kind::Wait, flags | link::SIGNALLED);
            self.close_wait(wait);
        } else {
            let cell = *cells;
            *cells = self.heap.cdr(cell).unwrap_or(Value::NIL);
            self.heap.set_cdr(cell, Value::NIL);
            self.enqueue(wait, cell);
        }
        self.wake_waiter(wait, signal);
    }

    /// Adds `cell`, a cons or `NIL`, to the queue of a wait as of a signal of `event`, and has who waits go on.
    pub(crate) fn keep(&mut self, wait: Value, cell: Value, event: Value) {
        if cell.is_cons() {
            self.enqueue(wait, cell);
        }
        let by = self.scheduler.running.as_ref().map_or(0, |task| task.number);
        self.wake_waiter(wait, (event, by));
    }

    /// Adds a cons to the queue of a wait.
    fn enqueue(&mut self, wait: Value, cell: Value) {
        let queue = self.slot(wait, link::QUEUE);
        match self.heap.cdr(queue) {
            Some(last) if last.is_cons() => _ = self.heap.set_cdr(last, cell),
            _ => _ = self.heap.set_car(queue, cell),
        }
        self.heap.set_cdr(queue, cell);
    }

    /// Makes the task runnable that is parked at this wait, if one is.
    fn wake_waiter(&mut self, wait: Value, (event, by): (Value, u64)) {
        let task = self.slot(wait, link::OWNER);
        let Some(index) = self.slot(task, event::STATE).as_index() else { return };
        let urgent = self.wait_flags(wait) & link::URGENT != 0;
        if let Some(task) = self.scheduler.tasks.at(index as u32)
            && task.state == TaskState::Waiting
            && task.wait == wait
        {
            self.make_runnable(index as u32, urgent);
            if self.watch.is_watched {
                self.tell_of_waking(event, by, index as u32);
            }
        }
    }
}
