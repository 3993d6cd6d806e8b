//! Readings of the host's clock.

use crate::host::Host;

/// When the clock was read, and what it said.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Clock {
    /// Time of the last reading, in nanoseconds.
    pub(crate) now: u64,
    /// Ticks spent when timers were looked at last.
    pub(crate) looked_at: u64,
    /// Ticks spent when virtual time moved last.
    pub(crate) moved_at: u64,
    /// Whether timers are due that one step had no room for.
    pub(crate) more_is_due: bool,
}

impl Clock {
    /// Reads the host's clock, in nanoseconds.
    pub(crate) fn read(&mut self, host: &mut dyn Host) -> u64 {
        self.now = host.monotonic();
        self.now
    }
}
