//! A journal of a run, for surveys: its failures, and the delays of timers.
//!
//! It is kept from the beginning of a run on request. Only the latest failures are kept whole, and only the
//! first causes are counted apart, so a run of any length takes no more room.

use std::collections::{BTreeMap, VecDeque};

use esl_host::{FailureFrame, FailureRow, Lateness};

/// Failures that are kept whole.
const RECENT: usize = 200;
/// Causes that are counted apart; further ones are counted together.
const CAUSES: usize = 200;
/// Cause under which the others are counted.
const OTHERS: &str = "others";

/// The journal.
#[derive(Default)]
pub(crate) struct Journal {
    /// Whether it is kept.
    pub(crate) is_kept: bool,
    /// Number of failures by cause.
    pub(crate) causes: BTreeMap<String, u64>,
    /// Number of failures.
    pub(crate) failed: u64,
    /// Number of those that have ended a task.
    pub(crate) ended: u64,
    /// Number of the latest note.
    pub(crate) noted: u64,
    /// The latest failures, oldest first.
    pub(crate) recent: VecDeque<FailureRow>,
    /// Recovery procedures that have begun.
    pub(crate) recoveries: u64,
    /// How late timers were.
    pub(crate) lateness: Lateness,
}

impl Journal {
    /// Notes a failure, and numbers it.
    pub(crate) fn note_failure(&mut self, row: FailureRow) {
        self.failed += 1;
        let is_counted_apart = self.causes.contains_key(&row.cause) || self.causes.len() < CAUSES;
        let cause = if is_counted_apart { &row.cause } else { OTHERS };
        *self.causes.entry(cause.into()).or_default() += 1;
        if self.recent.len() == RECENT {
            self.recent.pop_front();
        }
        self.noted += 1;
        self.recent.push_back(FailureRow { number: self.noted, ..row });
    }

    /// Notes the report of the failure that has ended a task: the last one of that task.
    pub(crate) fn note_end(
        &mut self,
        task: u64,
        report: String,
        full_report: Option<String>,
        frames: Vec<FailureFrame>,
    ) {
        self.ended += 1;
        let last = self.recent.iter().rposition(|row| row.task == task);
        let Some(mut row) = last.and_then(|index| self.recent.remove(index)) else { return };
        row.report = Some(report);
        row.full_report = full_report;
        row.frames = frames;
        // Viewers that have seen the failure without its report get it again, under a new number.
        self.noted += 1;
        self.recent.push_back(FailureRow { number: self.noted, ..row });
    }

    /// Notes that a timer was so many nanoseconds late.
    pub(crate) fn note_timer(&mut self, late: u64) {
        if self.is_kept {
            self.lateness.count += 1;
            self.lateness.total += late;
            self.lateness.longest = self.lateness.longest.max(late);
        }
    }
}
