//! Readings of the host's clock.

use esl_heap::stored;
use esl_host::Host;

/// When the clock was read, and what it said.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Clock {
    /// Whether time passes only when all tasks wait.
    pub(crate) is_virtual: bool,
    /// Time of the last reading, in nanoseconds.
    pub(crate) now: u64,
    /// Ticks spent when timers were looked at last.
    pub(crate) looked_at: u64,
    /// Ticks spent when virtual time moved last.
    pub(crate) moved_at: u64,
    /// Whether timers are due: one step had no room for them, or their time had come when they were set.
    pub(crate) more_is_due: bool,
    /// Nanoseconds in which all tasks waited.
    pub(crate) idled: u64,
}

impl Clock {
    /// Creates the readings of a clock that was not read yet.
    pub(crate) fn of(host: &dyn Host) -> Clock {
        Clock { is_virtual: host.is_virtual(), ..Clock::default() }
    }

    /// Returns whether the host's clock shows `deadline`, in nanoseconds, or later.
    pub(crate) fn is_due(&mut self, host: &mut dyn Host, deadline: u64) -> bool {
        let due = host.due(deadline);
        self.now = due.unwrap_or(self.now);
        due.is_some()
    }

    /// Reads the host's clock, in nanoseconds.
    pub(crate) fn read(&mut self, host: &mut dyn Host) -> u64 {
        self.now = host.monotonic();
        self.now
    }
}

stored! { Clock { is_virtual, now, looked_at, moved_at, more_is_due, idled } }
