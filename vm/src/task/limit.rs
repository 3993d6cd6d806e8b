//! The limits that are open in a task, and what its cleanups may still use.

use super::LimitNumber;
use crate::value::Value;
use esl_heap::list_state;
use esl_heap::stored;

/// Names an account of ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AccountId(pub(crate) u32);

list_state! { AccountId { 0: Run } }
list_state! { Limit { entry: Run, number: Run, account: Run, outer: Run, ends: Run, expired: Run } }
list_state! { Allowance { ticks: Run, time: Run } }
list_state! { Fund { depth: Run, ends: Run, floor: Run, is_reported: Run } }

impl AccountId {
    /// No account: ticks are not limited.
    pub(crate) const NONE: AccountId = AccountId(u32::MAX);
}

/// An open limit of a task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    /// Index of its entry in the control stack.
    pub(crate) entry: u32,
    /// Number that timers and accounts know it by.
    pub(crate) number: LimitNumber,
    /// Account, if it limits ticks.
    pub(crate) account: AccountId,
    /// Account that the task charges when it is closed.
    pub(crate) outer: AccountId,
    /// Time of the task's clock at which it expires, if it limits time.
    pub(crate) ends: Option<u64>,
    /// Cause of its expiry, a keyword.
    pub(crate) expired: Option<Value>,
}

/// Means left to a running cleanup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Allowance {
    /// Ticks of the task at which it ends.
    pub ticks: u64,
    /// Time at which it ends, in nanoseconds.
    pub time: u64,
}

impl Default for Allowance {
    fn default() -> Allowance {
        Allowance::OVER
    }
}

impl Allowance {
    /// The allowance of a cleanup that was cut off: it has none to outrun any more.
    pub(crate) const OVER: Allowance = Allowance { ticks: u64::MAX, time: u64::MAX };

    /// Returns the smaller number of ticks and the earlier time of two.
    fn least(self, other: Allowance) -> Allowance {
        Allowance { ticks: self.ticks.min(other.ticks), time: self.time.min(other.time) }
    }

    /// Returns what is left to a cleanup with the allowance `own`, inside of those that may use this.
    pub(crate) fn around(self, own: Option<Allowance>) -> Allowance {
        own.map_or(self, |own| self.least(own))
    }

    /// Returns the allowance of a cleanup that may use `ticks` and `nanoseconds` from `now` on.
    pub(crate) fn after(now: Allowance, ticks: u64, nanoseconds: u64) -> Allowance {
        Allowance { ticks: now.ticks.saturating_add(ticks), time: now.time.saturating_add(nanoseconds) }
    }
}

/// Ticks that a cleanup may use when the fund that it belongs to is spent.
const LAST_TICKS: u64 = 1000;
/// Ticks that many cleanups may use then together, about.
const LAST_TICKS_OF_ALL: u64 = 1_000_000;
/// Fewest ticks that one of many may use then.
const FEWEST_LAST_TICKS: u64 = 20;
/// Nanoseconds that go with a tick of a last allowance.
const LAST_TIME_PER_TICK: u64 = 1000;

/// The common allowance of all cleanups that run for one abort, or for one expired limit.
///
/// A fund is twice the allowance of a single cleanup, and each cleanup may use half of what is left. So the
/// first one that hangs leaves something for those further out, and cleanups that are begun in others that
/// are cut off use up one fund, however deep. When it is spent, each cleanup that was established before has
/// a last small allowance, since it may release what others need: the smaller, the more of them there are.
/// Those established later are not run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fund {
    /// Number of entries of the control stack that are left when the abort, or the limit, has had its way.
    pub(crate) depth: usize,
    /// Where it ends.
    pub(crate) ends: Allowance,
    /// Index of the control entry from which on cleanups are not run, once it is spent.
    pub(crate) floor: Option<usize>,
    /// Whether it was reported that it is spent.
    pub(crate) is_reported: bool,
}

impl Fund {
    /// Creates the fund for an abort or a limit that leaves `depth` entries, if a single cleanup may use
    /// `ticks` and `nanoseconds`.
    pub(crate) fn new(depth: usize, now: Allowance, ticks: u64, nanoseconds: u64) -> Fund {
        let ends = Allowance::after(now, ticks.saturating_mul(2), nanoseconds.saturating_mul(2));
        Fund { depth, ends, floor: None, is_reported: false }
    }

    /// Returns the fund of a new task that belongs to a form of this fund's task: the same time, and as many
    /// ticks.
    pub(crate) fn for_child(&self, ticks: u64) -> Fund {
        let ends = Allowance { ticks: self.ends.ticks.saturating_sub(ticks), time: self.ends.time };
        Fund { depth: 0, ends, floor: None, is_reported: false }
    }

    /// Gives half of the ticks that are left to a new task that is not waited for, and returns its fund. So
    /// tasks that are made by cleanups and make others in theirs use up one fund together.
    pub(crate) fn split(&mut self, ticks: u64) -> Fund {
        let half = self.ends.ticks.saturating_sub(ticks) / 2;
        self.ends.ticks -= half;
        let ends = Allowance { ticks: half, time: self.ends.time };
        Fund { depth: 0, ends, floor: None, is_reported: false }
    }

    /// Returns whether so little is left that cleanups have their last allowance.
    pub(crate) fn is_spent(&self, now: Allowance) -> bool {
        now.ticks.saturating_add(LAST_TICKS) > self.ends.ticks
            || now.time.saturating_add(LAST_TICKS * LAST_TIME_PER_TICK) > self.ends.time
    }

    /// Returns whether an abort or a limit that leaves so many entries ends outside of where this one does.
    /// Not inlined: the depth of a fund that does not exist would be compared, and valgrind reports that.
    #[inline(never)]
    pub(crate) fn is_inside(&self, depth: Option<usize>) -> bool {
        depth.is_some_and(|depth| depth < self.depth)
    }

    /// Returns whether the cleanup at the control entry `index` is not to be run, whatever the time.
    pub(crate) fn refuses(&self, index: usize) -> bool {
        self.floor.is_some_and(|floor| index >= floor)
    }

    /// Returns the allowance of the cleanup at the control entry `index`; `None` if it is not to be run.
    pub(crate) fn allow(&mut self, index: usize, now: Allowance) -> Option<Allowance> {
        if !self.is_spent(now) {
            let ticks = (self.ends.ticks - now.ticks) / 2;
            let nanoseconds = (self.ends.time - now.time) / 2;
            return Some(Allowance::after(now, ticks, nanoseconds));
        }
        if self.refuses(index) {
            return None;
        }
        self.floor = Some(index);
        // There are at most `index` cleanups further out.
        let ticks = (LAST_TICKS_OF_ALL / (index as u64 + 1)).clamp(FEWEST_LAST_TICKS, LAST_TICKS);
        Some(Allowance::after(now, ticks, ticks * LAST_TIME_PER_TICK))
    }
}

stored! { AccountId { 0 } }
stored! { Limit { entry, number, account, outer, ends, expired } }
stored! { Allowance { ticks, time } }
stored! { Fund { depth, ends, floor, is_reported } }

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Allowance = Allowance { ticks: 500, time: 7 };

    #[test]
    fn the_first_cleanup_has_a_whole_allowance_and_the_next_ones_half_of_the_rest() {
        let mut fund = Fund::new(0, NOW, 1_000_000, 60_000_000_000);
        let first = fund.allow(10, NOW);
        assert_eq!(first, Some(Allowance::after(NOW, 1_000_000, 60_000_000_000)));
        let next = fund.allow(11, first.unwrap());
        assert_eq!(next, Some(Allowance::after(first.unwrap(), 500_000, 30_000_000_000)));
    }

    #[test]
    fn a_spent_fund_lets_run_only_what_was_established_before() {
        let mut fund = Fund::new(0, NOW, 1_000_000, 60_000_000_000);
        let end = fund.ends;
        assert!(fund.is_spent(end));
        assert!(fund.allow(10, end).is_some());
        assert_eq!((fund.allow(10, end), fund.allow(11, end)), (None, None));
        assert!(fund.allow(9, end).is_some());
    }

    #[test]
    fn a_child_has_what_is_left() {
        let mut fund = Fund::new(3, NOW, 1000, 50);
        let child = fund.for_child(NOW.ticks);
        assert_eq!((child.depth, child.ends), (0, Allowance { ticks: 2000, time: 107 }));
        let other = fund.split(NOW.ticks);
        assert_eq!((other.depth, other.ends), (0, Allowance { ticks: 1000, time: 107 }));
        assert_eq!(fund.ends, Allowance { ticks: 1500, time: 107 });
    }
}
