//! Readings of the host's clock.

/// When the clock was read, and what it said.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Clock {
    /// Time of the last reading, in nanoseconds.
    pub(crate) now: u64,
    /// Ticks spent when the scheduler looked at the clock last.
    pub(crate) looked_at: u64,
    /// Ticks spent when virtual time moved last.
    pub(crate) moved_at: u64,
    /// Whether more timers are due than were seen to.
    pub(crate) more_is_due: bool,
}
