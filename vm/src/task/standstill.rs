//! Standstills of suspended tasks: by whom, how often, and the time that their clocks have missed.
//!
//! A tree of a hundred thousand tasks may be suspended at once, so this is not behind a pointer of each task:
//! there is a row for each place of the table of tasks, from the first suspension on.

use esl_heap::list_state;

use crate::value::Value;

/// Standstill of the task at one place.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Standstill {
    /// Nanoseconds by which the task's clock is behind the machine's.
    pub(crate) behind: u64,
    /// Time of the machine at which the task's clock was stopped, if it is.
    pub(crate) stopped: Option<u64>,
    /// The task that has put it at rest first, while it is at rest.
    pub(crate) by: Option<Value>,
    /// How often it was suspended where it is at rest.
    pub(crate) times: u32,
}

list_state! { Standstill { behind: Run, stopped: Run, by: Run, times: Run } }

impl Standstill {
    /// Standstill of a task that was never suspended.
    pub(crate) const NONE: Standstill = Standstill { behind: 0, stopped: None, by: None, times: 0 };

    /// Returns the time of the task's clock, at the machine's time `now`.
    pub(crate) fn time_at(&self, now: u64) -> u64 {
        self.stopped.unwrap_or(now).saturating_sub(self.behind)
    }

    /// Returns when the task's clock will show `time`, unless it is stopped before.
    pub(crate) fn when(&self, time: u64) -> u64 {
        time.saturating_add(self.behind)
    }

    /// Has the task's clock go on, if it was stopped.
    pub(crate) fn start_clock(&mut self, now: u64) {
        let missed = self.stopped.take().map_or(0, |stopped| now.saturating_sub(stopped));
        self.behind = self.behind.saturating_add(missed);
    }
}
