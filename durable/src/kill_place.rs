//! Places at which a test has the process killed: before and behind each call of the disk, before each piece
//! that the fork of a snapshot writes, and between the steps of the thread that waits for it. The number of
//! the place is in the environment. Only in builds for debugging.

#[cfg(all(unix, debug_assertions))]
mod counted {
    use std::sync::atomic::{AtomicI32, AtomicU64, Ordering};

    /// Places that are left; 0 if no kill is wanted.
    static LEFT: AtomicU64 = AtomicU64::new(0);
    /// The process that is killed, also by its fork, which counts on from the place of its beginning.
    static PROCESS: AtomicI32 = AtomicI32::new(0);

    /// Begins to count, if a test wants that. Returns whether it does.
    pub(crate) fn begin() -> bool {
        let place = std::env::var("ESL_DURABLE_KILL_AT").ok().and_then(|place| place.parse().ok());
        if let Some(place) = place {
            PROCESS.store(rustix::process::getpid().as_raw_nonzero().get(), Ordering::Relaxed);
            LEFT.store(place, Ordering::Relaxed);
        }
        place.is_some()
    }

    /// Notes that a place is passed. In a fork it makes system calls only.
    pub(crate) fn pass() {
        let less = |left: u64| left.checked_sub(1);
        if LEFT.fetch_update(Ordering::Relaxed, Ordering::Relaxed, less) == Ok(1)
            && let Some(process) = rustix::process::Pid::from_raw(PROCESS.load(Ordering::Relaxed))
        {
            // A process that cannot be killed goes on.
            _ = rustix::process::kill_process(process, rustix::process::Signal::KILL);
        }
    }
}

#[cfg(all(unix, debug_assertions))]
pub(crate) use counted::{begin, pass};

/// Does nothing.
#[cfg(not(all(unix, debug_assertions)))]
pub(crate) fn pass() {}
