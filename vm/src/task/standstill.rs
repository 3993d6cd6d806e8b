//! Standstills of suspended tasks: by whom, how often, and the time that their clocks have missed; and tasks
//! at rest, which stand still where they wait.
//!
//! A tree of a hundred thousand tasks may be suspended at once, so this is not behind a pointer of each task:
//! there is a row for each place of the table of tasks, from the first suspension on. Nor is it in the record
//! of a task whether it is at rest, but at its place: the records of a large tree are far apart, the places
//! are not.

use esl_heap::list_state;
use esl_heap::state::{StateSink, Stated};
use esl_heap::{stored, stored_enum};

use crate::value::Value;

/// Whether a task is at rest: it is suspended, and stands still where it waits; no wake-up reaches it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Rest {
    /// It is not.
    #[default]
    None,
    /// It is.
    Rests,
    /// It is, and was to go on since then.
    Woken,
}

impl Stated for Rest {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(*self as u64);
    }
}

/// Says that a clock was not stopped.
const GOES: u64 = u64::MAX;

/// Standstill of the task at one place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Standstill {
    /// Nanoseconds by which the task's clock is behind the machine's.
    behind: u64,
    /// Time of the machine at which the task's clock was stopped, or [`GOES`].
    stopped: u64,
    /// The task that has put it at rest first, while it is at rest; otherwise `NIL`.
    pub(crate) by: Value,
    /// How often it was suspended where it is at rest.
    pub(crate) times: u32,
}

list_state! { Standstill { behind: Run, stopped: Run, by: Run, times: Run } }

const _: () = assert!(size_of::<Standstill>() == 32, "there may be a million of them");

impl Standstill {
    /// Standstill of a task that was never suspended.
    pub(crate) const NONE: Standstill = Standstill { behind: 0, stopped: GOES, by: Value::NIL, times: 0 };

    /// Returns the time of the task's clock, at the machine's time `now`.
    pub(crate) fn time_at(&self, now: u64) -> u64 {
        let time = if self.is_stopped() { self.stopped } else { now };
        time.saturating_sub(self.behind)
    }

    /// Returns whether the task's clock was stopped.
    pub(crate) fn is_stopped(&self) -> bool {
        self.stopped != GOES
    }

    /// Stops the task's clock, if it goes.
    pub(crate) fn stop_clock(&mut self, now: u64) {
        self.stopped = self.stopped.min(now);
    }

    /// Returns when the task's clock will show `time`, unless it is stopped before.
    pub(crate) fn when(&self, time: u64) -> u64 {
        time.saturating_add(self.behind)
    }

    /// Has the task's clock go on, if it was stopped.
    pub(crate) fn start_clock(&mut self, now: u64) {
        let stopped = std::mem::replace(&mut self.stopped, GOES);
        self.behind = self.behind.saturating_add(now.saturating_sub(stopped));
    }

    /// Ends the rest of the task, and returns the task that has put it at rest.
    #[inline(always)]
    pub(crate) fn end_rest(&mut self, now: u64) -> Value {
        self.start_clock(now);
        std::mem::replace(&mut self.by, Value::NIL)
    }
}

stored_enum! { Rest { None = 0, Rests = 1, Woken = 2 } }
stored! { Standstill { behind, stopped, by, times } }
