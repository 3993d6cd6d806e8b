//! Signals under delivery.
//!
//! A signal that more tasks wait for than are seen to in one step is delivered between turns, a part at a
//! time. Until then no task may notice that others have not got it yet: the task that signals is held back,
//! and operations on waits try again.

use esl_heap::list_state;
use esl_heap::stored;
use std::collections::VecDeque;

use crate::task::{AccountId, Serial, TaskIndex, TaskNumber};
use crate::value::Value;

/// A signal under delivery.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Delivery {
    /// Signalled event.
    pub(crate) event: Value,
    /// List of the signal's arguments.
    pub(crate) arguments: Value,
    /// Next link in the list of the event that gets the signal, or `NIL`.
    pub(crate) next: Value,
    /// Account that the work is charged to.
    pub(crate) account: AccountId,
    /// Task that signals, or [`TaskNumber::NONE`].
    pub(crate) by: TaskNumber,
}

/// Signals under delivery, and the tasks that are held back until all of them are delivered.
#[derive(Clone, Default)]
pub(crate) struct Deliveries {
    /// Signals, in the order in which they were given.
    pub(crate) signals: VecDeque<Delivery>,
    /// Tasks held back, each with its serial number then.
    pub(crate) held: Vec<(TaskIndex, Serial)>,
}

list_state! { Delivery { event: Run, arguments: Run, next: Run, account: Run, by: Run } }

impl Deliveries {
    /// Returns whether no signal is under delivery.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.signals.is_empty()
    }

    /// Notes that a link leaves its list, in front of `next`, so that no delivery goes by it.
    #[inline]
    pub(crate) fn pass_over(&mut self, link: Value, next: Value) {
        if !self.is_empty() {
            self.pass_over_now(link, next);
        }
    }

    #[cold]
    fn pass_over_now(&mut self, link: Value, next: Value) {
        for delivery in &mut self.signals {
            if delivery.next == link {
                delivery.next = next;
            }
        }
    }

    /// Calls `visit` with every value of the signals.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
        for delivery in &self.signals {
            [delivery.event, delivery.arguments, delivery.next].into_iter().for_each(&mut *visit);
        }
    }
}

stored! { Delivery { event, arguments, next, account, by } }
stored! { Deliveries { signals, held } }
