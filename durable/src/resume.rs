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
    /// Whether the program is told of it.
    is_told: bool,
}

impl Resumption {
    /// Creates the restart of a run after the last process or pause, when its clock stood at `time`. While it
    /// was asleep, its clock has gone on from the time of day `hosted` on.
    pub(crate) fn new(
        last: &JournalLife,
        time: u64,
        wall: i64,
        downtime: Downtime,
        hosted: Option<i64>,
    ) -> Resumption {
        let stood = time.max(last.time);
        let ended = last.wall.saturating_add_unsigned(stood - last.time);
        let since = |begin: i64| wall.checked_sub(begin).and_then(|gap| u64::try_from(gap).ok()).unwrap_or(0);
        let gap = since(ended);
        let hosted = hosted.filter(|_| last.is_asleep).map_or(0, |hosted| since(hosted.max(ended)));
        let elapsed = match downtime {
            Downtime::Counts => stood.saturating_add(gap),
            Downtime::Stops => stood.saturating_add(hosted),
        };
        let is_told = !last.is_asleep;
        Resumption { number: last.number + 1, wall, downtime: gap, elapsed, chance: chance(), is_told }
    }

    /// Has the program not be told of it.
    pub(crate) fn untold(self) -> Resumption {
        Resumption { is_told: false, ..self }
    }

    /// Returns whether the program is told of it: not where it was only asleep.
    pub(crate) fn is_told(&self) -> bool {
        self.is_told
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
            is_asleep: false,
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
            let resumption = Resumption::new(&last, 80, wall, downtime, Some(1050));
            (resumption.elapsed(), resumption.downtime)
        };
        assert_eq!(resumed(1100, Downtime::Counts), (150, 70));
        assert_eq!(resumed(1100, Downtime::Stops), (80, 70));
        // The clock of the system was set back.
        assert_eq!(resumed(900, Downtime::Counts), (80, 0));
        let (life, _) = Resumption::new(&last, 80, 1100, Downtime::Counts, None).begin(155);
        assert_eq!((life.number, life.wall, life.time), (4, 1105, 155));
        // It was asleep from 1030 on.
        let asleep = JournalLife { is_pause: true, is_asleep: true, ..last };
        for (hosted, elapsed) in [(None, 80), (Some(1000), 150), (Some(1060), 120), (Some(1200), 80)] {
            let resumption = Resumption::new(&asleep, 80, 1100, Downtime::Stops, hosted);
            assert_eq!((resumption.elapsed(), resumption.is_told()), (elapsed, false));
        }
    }
}
