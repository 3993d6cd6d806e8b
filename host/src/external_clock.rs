//! A clock that the outside drives: the time of a simulator, or of a recording that is played.
//!
//! Any thread tells the time by [`Inbox::set_time`](super::Inbox::set_time). The host's monotonic clock adds
//! up the steps forward: a step back moves the time of day alone, so that a wait keeps the rest of its time.
//! Both stand still until the first time is told, and whenever no time is told.
//!
//! Guarantees: a wait ends when a time is told that reaches its deadline; a time that is told at any other
//! moment leaves the machine alone. So a recorded run is replayed although the clock ran in other threads.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// The effect of telling the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockStep {
    /// It is the first time.
    Begun,
    /// Nanoseconds that have passed.
    Forward(u64),
    /// Nanoseconds by which time has gone back.
    Back(u64),
}

/// State of the clock.
#[derive(Default)]
struct ExternalTime {
    /// Whether the host goes by this clock.
    is_used: bool,
    /// Nanoseconds that have passed.
    elapsed: u64,
    /// The time of day that was told last, in nanoseconds since 1970.
    time: Option<i64>,
    /// The time that the host waits for.
    deadline: Option<u64>,
    /// When the clock has become one of real time.
    released: Option<Instant>,
}

impl ExternalTime {
    /// Adds the real time since the release.
    fn catch_up(&mut self) {
        if let Some(since) = &mut self.released {
            let passed = u64::try_from(since.elapsed().as_nanos()).unwrap_or(u64::MAX);
            *since = Instant::now();
            self.elapsed = self.elapsed.saturating_add(passed);
            self.time = self.time.map(|time| time.saturating_add_unsigned(passed));
        }
    }

    fn is_due(&self) -> bool {
        self.deadline.is_some_and(|deadline| deadline <= self.elapsed)
    }
}

/// The clock of an inbox.
#[derive(Default)]
pub(super) struct ExternalClock(Mutex<ExternalTime>);

impl ExternalClock {
    fn lock(&self) -> MutexGuard<'_, ExternalTime> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn begin(&self) {
        self.lock().is_used = true;
    }

    pub(super) fn is_used(&self) -> bool {
        self.lock().is_used
    }

    /// Tells the time. Calls `ring` if the host waits for it.
    pub(super) fn set(&self, time: i64, ring: impl FnOnce()) -> ClockStep {
        let mut state = self.lock();
        let before = state.time.replace(time);
        let Some(before) = before else { return ClockStep::Begun };
        if state.released.is_some() {
            return ClockStep::Forward(0);
        }
        let passed = time.saturating_sub(before);
        if passed < 0 {
            return ClockStep::Back(passed.unsigned_abs());
        }
        state.elapsed = state.elapsed.saturating_add(passed.unsigned_abs());
        // Under the lock: the host does not end its wait in between.
        if state.is_due() {
            ring();
        }
        ClockStep::Forward(passed.unsigned_abs())
    }

    /// Makes the clock one of real time from now on, if the host goes by it.
    pub(super) fn release(&self) {
        let mut state = self.lock();
        if state.is_used && state.released.is_none() {
            state.released = Some(Instant::now());
        }
    }

    pub(super) fn elapsed(&self) -> u64 {
        let mut state = self.lock();
        state.catch_up();
        state.elapsed
    }

    pub(super) fn time(&self) -> i64 {
        let mut state = self.lock();
        state.catch_up();
        state.time.unwrap_or(0)
    }

    /// Notes the deadline of a wait. Returns the nanoseconds of real time until then, if the clock is one of
    /// real time, and whether the deadline has passed.
    pub(super) fn begin_wait(&self, deadline: Option<u64>) -> (Option<u64>, bool) {
        let mut state = self.lock();
        state.catch_up();
        state.deadline = deadline;
        let left = deadline.map(|deadline| deadline.saturating_sub(state.elapsed));
        (left.filter(|_| state.released.is_some()), state.is_due())
    }

    /// Ends a wait.
    pub(super) fn end_wait(&self) {
        self.lock().deadline = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_stands_still_and_goes_back_only_as_the_time_of_day() {
        let clock = ExternalClock::default();
        assert_eq!((clock.elapsed(), clock.time()), (0, 0));
        let set = |time| clock.set(time, || ());
        assert_eq!(set(1_000), ClockStep::Begun);
        assert_eq!((clock.elapsed(), clock.time()), (0, 1_000));
        assert_eq!(set(1_500), ClockStep::Forward(500));
        assert_eq!(set(1_500), ClockStep::Forward(0));
        assert_eq!(set(200), ClockStep::Back(1_300));
        assert_eq!((clock.elapsed(), clock.time()), (500, 200));
        assert_eq!(set(300), ClockStep::Forward(100));
        assert_eq!((clock.elapsed(), clock.time()), (600, 300));
        assert_eq!(set(i64::MAX), ClockStep::Forward(i64::MAX as u64 - 300));
        assert_eq!(set(i64::MIN), ClockStep::Back(1 << 63));
        assert_eq!(set(i64::MAX), ClockStep::Forward(i64::MAX as u64));
    }

    #[test]
    fn only_a_wait_whose_deadline_has_come_is_ended() {
        let clock = ExternalClock::default();
        let rings = |time| {
            let mut rung = false;
            clock.set(time, || rung = true);
            rung
        };
        assert!(!rings(10));
        assert_eq!(clock.begin_wait(Some(5)), (None, false));
        assert!(!rings(14) && rings(15));
        clock.end_wait();
        assert!(!rings(100), "nobody waits");
        assert_eq!(clock.begin_wait(Some(5)), (None, true));
        clock.end_wait();
        assert_eq!(clock.begin_wait(None), (None, false));
        assert!(!rings(1_000));
    }

    #[test]
    fn a_released_clock_is_one_of_real_time() {
        let clock = ExternalClock::default();
        clock.release();
        assert_eq!(clock.begin_wait(Some(5)), (None, false), "it is not used");
        clock.begin();
        clock.release();
        let (left, _) = clock.begin_wait(Some(u64::MAX));
        assert!(left.is_some_and(|left| left > 1 << 60));
        std::thread::sleep(std::time::Duration::from_millis(2));
        assert!(clock.elapsed() >= 2_000_000);
        let before = clock.elapsed();
        clock.set(7, || ());
        assert!(clock.elapsed() >= before && clock.time() >= 7);
    }
}
