//! Timers: waits that end at a time, limits that expire, cleanups that have run for too long.
//!
//! Guarantees: timers fire in the order of time, and of two with the same time the one that was set first. A
//! timer that is no longer wanted is not searched for but recognised by its serial number when it fires; when
//! more than half are no longer wanted, all of these are dropped at once.

use esl_heap::list_state;
use esl_heap::state::{StateSink, Stated};
use esl_heap::{stored, stored_enum};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use crate::task::{LimitNumber, Serial, TaskIndex};

/// Action of a timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Due {
    /// The wait of the task ends, if the task still has this serial number.
    Wait(Serial),
    /// The limit with this number expires.
    Limit(LimitNumber),
    /// A cleanup of the task is looked at.
    Cleanup,
}

/// A timer. The order of the fields is that in which timers fire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Timer {
    /// Time in nanoseconds.
    pub(crate) time: u64,
    /// Ordinal among all timers that were set.
    pub(crate) sequence: u64,
    /// Index of the task.
    pub(crate) index: TaskIndex,
    /// Action.
    pub(crate) due: Due,
}

/// The timers of a machine.
#[derive(Clone, Default)]
pub(crate) struct Timers {
    pub(crate) heap: BinaryHeap<Reverse<Timer>>,
    /// Number of timers set so far.
    pub(crate) sequence: u64,
    /// Length at which timers that are no longer wanted are dropped.
    pub(crate) sweep_at: usize,
}

list_state! { Timer { time: Run, sequence: Run, index: Run, due: Run } }

impl Stated for Due {
    fn tell(&self, sink: &mut dyn StateSink) {
        match self {
            Due::Wait(serial) => (1_u8, *serial).tell(sink),
            Due::Limit(number) => (2_u8, *number).tell(sink),
            Due::Cleanup => sink.word(3),
        }
    }
}

impl Timers {
    /// Sets a timer.
    pub(crate) fn push(&mut self, time: u64, index: TaskIndex, due: Due) {
        self.sequence += 1;
        self.heap.push(Reverse(Timer { time, sequence: self.sequence, index, due }));
    }

    /// Returns whether it is time to drop the timers that are no longer wanted.
    pub(crate) fn wants_sweep(&self) -> bool {
        self.heap.len() > self.sweep_at.max(64)
    }

    /// Drops the timers that are no longer wanted.
    pub(crate) fn sweep(&mut self, mut is_wanted: impl FnMut(Timer) -> bool) {
        let timers = std::mem::take(&mut self.heap).into_vec();
        self.heap = timers.into_iter().filter(|&Reverse(timer)| is_wanted(timer)).collect();
        self.sweep_at = self.heap.len() * 2;
        self.heap.shrink_to(self.sweep_at);
    }

    /// Returns all timers, in the order in which they fire.
    pub(crate) fn in_order(&self) -> Vec<Timer> {
        let mut timers: Vec<Timer> = self.heap.iter().map(|&Reverse(timer)| timer).collect();
        timers.sort_unstable();
        timers
    }

    /// Returns whether there are none.
    #[inline]
    pub(crate) fn is_empty(&self) -> bool {
        self.heap.is_empty()
    }

    /// Returns the first timer.
    pub(crate) fn first(&self) -> Option<Timer> {
        self.heap.peek().map(|&Reverse(timer)| timer)
    }

    /// Takes the first timer, if its time has come.
    pub(crate) fn take_due(&mut self, now: u64) -> Option<Timer> {
        if self.first()?.time > now { None } else { self.take_first() }
    }

    /// Takes the first timer.
    pub(crate) fn take_first(&mut self) -> Option<Timer> {
        self.heap.pop().map(|Reverse(timer)| timer)
    }
}

stored_enum! { Due { Wait(serial) = 0, Limit(number) = 1, Cleanup = 2 } }
stored! { Timer { time, sequence, index, due } }
stored! { Timers { heap, sequence, sweep_at } }

#[cfg(test)]
mod tests {
    use super::*;

    fn wait(serial: u64) -> Due {
        Due::Wait(Serial(serial))
    }

    #[test]
    fn timers_fire_in_order() {
        let mut timers = Timers::default();
        for (time, index) in [(30, 0), (10, 1), (20, 2), (10, 3), (40, 4)] {
            timers.push(time, TaskIndex(index), wait(0));
        }
        let mut fired = Vec::new();
        while let Some(timer) = timers.take_due(30) {
            fired.push(timer.index.0);
        }
        assert_eq!(fired, [1, 3, 2, 0]);
        assert_eq!(timers.first().map(|timer| timer.time), Some(40));
    }

    #[test]
    fn unwanted_timers_are_dropped() {
        let mut timers = Timers::default();
        for serial in 0..200 {
            timers.push(serial, TaskIndex(0), wait(serial));
        }
        assert!(timers.wants_sweep());
        timers.sweep(|timer| timer.due == wait(150));
        assert_eq!((timers.first().map(|timer| timer.time), timers.wants_sweep()), (Some(150), false));
    }
}
