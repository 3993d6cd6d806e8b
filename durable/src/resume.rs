//! The restart of a run: its downtime, and the time of its clock.

use std::time::{SystemTime, UNIX_EPOCH};

use esl_replay::JournalLife;

use super::Downtime;

/// Returns the time of day in nanoseconds since 1970.
pub(crate) fn wall_clock() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |time| i64::try_from(time.as_nanos()).unwrap_or(i64::MAX))
}

/// Returns a random number.
pub(crate) fn chance() -> u64 {
    getrandom::u64().unwrap_or_else(|_| wall_clock() as u64 ^ u64::from(std::process::id()) << 40)
}

/// A run that is about to go on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Resumption {
    number: u64,
    wall: i64,
    /// Nanoseconds since the last record.
    downtime: u64,
    /// The program's clock when it was read.
    elapsed: u64,
    chance: u64,
}

impl Resumption {
    /// Creates the restart of a run after the last process or pause, when its clock stood at `time`.
    pub(crate) fn new(last: &JournalLife, time: u64, wall: i64, downtime: Downtime) -> Resumption {
        let stood = time.max(last.time);
        let ended = last.wall.saturating_add_unsigned(stood - last.time);
        let gap = wall.checked_sub(ended).and_then(|gap| u64::try_from(gap).ok()).unwrap_or(0);
        let elapsed = match downtime {
            Downtime::Counts => stood.saturating_add(gap),
            Downtime::Stops => stood,
        };
        Resumption { number: last.number + 1, wall, downtime: gap, elapsed, chance: chance() }
    }

    /// Returns where the program's clock stands.
    pub(crate) fn elapsed(&self) -> u64 {
        self.elapsed
    }

    /// Begins the life of this process, when its clock shows `time`. Returns the seconds of the gap too.
    pub(crate) fn begin(self, time: u64) -> (JournalLife, f64) {
        let since = i64::try_from(time.saturating_sub(self.elapsed)).unwrap_or(i64::MAX);
        let life = JournalLife {
            number: self.number,
            is_pause: false,
            wall: self.wall.saturating_add(since),
            time,
            chance: self.chance,
        };
        (life, self.downtime as f64 / 1e9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_goes_on_with_or_without_the_gap() {
        let last = JournalLife { number: 3, wall: 1000, time: 50, ..JournalLife::default() };
        let resumed = |wall, downtime| {
            let resumption = Resumption::new(&last, 80, wall, downtime);
            (resumption.elapsed(), resumption.downtime)
        };
        assert_eq!(resumed(1100, Downtime::Counts), (150, 70));
        assert_eq!(resumed(1100, Downtime::Stops), (80, 70));
        // The clock of the system was set back.
        assert_eq!(resumed(900, Downtime::Counts), (80, 0));
        let (life, _) = Resumption::new(&last, 80, 1100, Downtime::Counts).begin(155);
        assert_eq!((life.number, life.wall, life.time), (4, 1105, 155));
    }
}
