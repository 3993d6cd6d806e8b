//! What is to happen at a time: waits that end, limits that expire, cleanups that have run for too long.
//!
//! Guarantees: what is due is given in the order of time, and of two things due at the same time the one that was asked for
//! first. What is no longer wanted is not taken out but recognised by its serial number when it is due; when more
//! than half is no longer wanted, all of that is dropped at once.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// What is to happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Due {
    /// The wait of the task with this serial number ends.
    Wait(u64),
    /// The limit with this number expires.
    Limit(u64),
    /// A cleanup is looked at.
    Cleanup,
}

/// A timer: time in nanoseconds, sequence, place of the task, what is to happen.
pub(crate) type Timer = (u64, u64, u32, Due);

/// The timers of a machine.
#[derive(Default)]
pub(crate) struct Timers {
    heap: BinaryHeap<Reverse<Timer>>,
    sequence: u64,
    /// Length at which those that are no longer wanted are dropped.
    sweep_at: usize,
}

impl Timers {
    /// Adds a timer.
    pub(crate) fn push(&mut self, time: u64, index: u32, due: Due) {
        self.sequence += 1;
        self.heap.push(Reverse((time, self.sequence, index, due)));
    }

    /// Whether it is time to drop what is no longer wanted.
    pub(crate) fn wants_sweep(&self) -> bool {
        self.heap.len() > self.sweep_at.max(64)
    }

    /// Drops the timers that are no longer wanted.
    pub(crate) fn sweep(&mut self, mut is_wanted: impl FnMut(u32, Due) -> bool) {
        let timers = std::mem::take(&mut self.heap).into_vec();
        self.heap = timers.into_iter().filter(|Reverse(timer)| is_wanted(timer.2, timer.3)).collect();
        self.sweep_at = self.heap.len() * 2;
    }

    /// The time of the first timer.
    pub(crate) fn first(&self) -> Option<u64> {
        self.heap.peek().map(|Reverse(timer)| timer.0)
    }

    /// All timers, in order.
    pub(crate) fn in_order(&self) -> Vec<Timer> {
        let mut timers: Vec<Timer> = self.heap.iter().map(|Reverse(timer)| *timer).collect();
        timers.sort_unstable();
        timers
    }

    /// The first timer itself.
    pub(crate) fn peek(&self) -> Option<(u32, Due)> {
        self.heap.peek().map(|Reverse(timer)| (timer.2, timer.3))
    }

    /// Takes the first timer that is due.
    pub(crate) fn take_due(&mut self, now: u64) -> Option<(u32, Due)> {
        if self.first()? > now { None } else { self.take_first() }
    }

    /// Takes the first timer.
    pub(crate) fn take_first(&mut self) -> Option<(u32, Due)> {
        self.heap.pop().map(|Reverse(timer)| (timer.2, timer.3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_due_comes_in_order() {
        let mut timers = Timers::default();
        for (time, index) in [(30, 0), (10, 1), (20, 2), (10, 3), (40, 4)] {
            timers.push(time, index, Due::Wait(0));
        }
        let mut due = Vec::new();
        while let Some((index, _)) = timers.take_due(30) {
            due.push(index);
        }
        assert_eq!(due, [1, 3, 2, 0]);
        assert_eq!(timers.first(), Some(40));
    }

    #[test]
    fn what_is_not_wanted_is_dropped() {
        let mut timers = Timers::default();
        for serial in 0..200 {
            timers.push(serial, 0, Due::Wait(serial));
        }
        assert!(timers.wants_sweep());
        timers.sweep(|_, due| due == Due::Wait(150));
        assert_eq!((timers.first(), timers.wants_sweep()), (Some(150), false));
    }
}
