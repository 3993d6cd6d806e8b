//! Replays that begin in the middle of a run.

use std::sync::Arc;

use super::{AnswerSource, NotedRecord, ReplayHost};

impl ReplayHost {
    /// Creates a host that replays these records from [`ReplayHost::start`] on. Until then it is an empty
    /// world.
    pub fn preparing(records: impl Into<Arc<[NotedRecord]>>) -> ReplayHost {
        let replay = ReplayHost::new(records);
        replay.progress().source = AnswerSource::Preparing;
        replay
    }

    /// Begins to replay records that begin in the middle of a run, where so many questions whether a timer is
    /// due were answered no, and the latest time was this.
    pub fn start(&self, not_due: u64, time: u64) {
        let mut progress = self.progress();
        progress.source = AnswerSource::Records;
        (progress.not_due, progress.time) = (not_due, time);
        self.ring_if_needed(&progress);
    }

    /// Returns whether the records have not begun.
    pub fn is_preparing(&self) -> bool {
        self.progress().source == AnswerSource::Preparing
    }
}
