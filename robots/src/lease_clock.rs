//! The clock by which the leases of a fleet end.
//!
//! Guarantees: it goes as fast as that of the store of leases, also while the machine sleeps. The clock of
//! the program may differ: it may be fast, slow, told by a simulator, or stand still while a durable run has
//! no process. Setting the system's clock does not move it within a process; in the next process of a
//! durable run it has gone on by the system's clock.

use std::sync::LazyLock;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use esl_host::{HostFailure, HostRows, Inbox};
use esl_world::spawned;

/// The longest pause, after which the clock is read again: a timer stands still while the machine sleeps.
const LONGEST_PAUSE: f64 = 1.0;

/// Returns the functions of `:fleet-etcd`.
pub(crate) fn rows(inbox: &Inbox) -> HostRows {
    let mut rows = HostRows::new(inbox);
    rows.at_once("%LEASE-CLOCK", [], "Returns the seconds of the clock by which leases end.", || {
        Ok::<_, HostFailure>(seconds())
    })
    .idempotent();
    rows.operation(
        spawned,
        "%LEASE-PAUSE",
        ["seconds"],
        "Waits SECONDS of that clock, at most one.",
        |seconds: f64| async move {
            tokio::time::sleep(Duration::from_secs_f64(seconds.clamp(0.0, LONGEST_PAUSE))).await;
            Ok::<_, HostFailure>(())
        },
    )
    .idempotent();
    rows
}

/// Returns the time of the clock, in seconds.
fn seconds() -> f64 {
    /// The time of the system at the first call, less that since the start of the machine.
    static OFFSET: LazyLock<f64> = LazyLock::new(|| {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        now.as_secs_f64() - since_start().as_secs_f64()
    });
    *OFFSET + since_start().as_secs_f64()
}

/// Returns the time since the start of the machine, with the time in which it has slept.
#[cfg(any(target_os = "linux", target_os = "android"))]
fn since_start() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    Duration::new(u64::try_from(time.tv_sec).unwrap_or(0), u32::try_from(time.tv_nsec).unwrap_or(0))
}

/// Returns the time since the first call.
#[cfg(not(any(target_os = "linux", target_os = "android")))]
fn since_start() -> Duration {
    static START: LazyLock<std::time::Instant> = LazyLock::new(std::time::Instant::now);
    START.elapsed()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_on_from_the_time_of_the_system() {
        let (before, first) = (SystemTime::now(), seconds());
        let system = before.duration_since(UNIX_EPOCH).expect("it is past 1970").as_secs_f64();
        assert!((first - system).abs() < 60.0, "{first} {system}");
        std::thread::sleep(Duration::from_millis(5));
        assert!((0.005..60.0).contains(&(seconds() - first)));
    }
}
