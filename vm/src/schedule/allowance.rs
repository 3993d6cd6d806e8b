//! Allowances of the cleanups of the running task while an abort or an expired limit waits for their end.

use esl_host::Host;

use super::{Due, Scheduler};
use crate::config::Config;
use crate::task::{Allowance, Fund};

impl Scheduler {
    /// Returns the ticks and the time of the running task, which has used `used` ticks in this slice.
    fn reading(&mut self, used: u64, host: &mut dyn Host) -> Allowance {
        let ticks = self.task().ticks.saturating_add(used);
        Allowance { ticks, time: self.clock.read(host) }
    }

    /// Returns the allowance of a cleanup of the running task, at the control entry `index`, that an abort or
    /// an expired limit meets or finds running, and sets its timer. `None` if the cleanup is not to be run.
    ///
    /// `depth` is the number of control entries that are left when the abort or the limit has had its way;
    /// `None` if a cleanup is cut off for one that is under way. `used` counts the ticks of this slice.
    pub(crate) fn allow_cleanup(
        &mut self,
        depth: Option<usize>,
        index: usize,
        used: u64,
        host: &mut dyn Host,
        config: &Config,
    ) -> Option<Allowance> {
        let fund = self.task().extra.as_ref().and_then(|extra| extra.fund.as_ref());
        let is_new = fund.is_none_or(|fund| fund.is_inside(depth));
        if !is_new && fund.is_some_and(|fund| fund.refuses(index)) {
            // There may be very many of these, and to look at the clock takes longer than to leave one.
            return None;
        }
        let now = self.reading(used, host);
        let fund = &mut self.task_mut().extra_mut().fund;
        if is_new {
            *fund = Some(Fund::new(depth.unwrap_or(0), now, config.cleanup_ticks, config.cleanup_time));
        }
        let allowance = fund.as_mut().and_then(|fund| fund.allow(index, now))?;
        self.timers.push(allowance.time, self.turn.index, Due::Cleanup);
        Some(allowance)
    }

    /// Returns whether the cleanups of the running task have a fund that is spent.
    pub(crate) fn is_fund_spent(&mut self, used: u64, host: &mut dyn Host) -> bool {
        let Some(fund) = self.task().extra.as_ref().and_then(|extra| extra.fund) else { return false };
        fund.is_spent(self.reading(used, host))
    }
}
