//! Figures of a run that cost something to gather, and are gathered on request: how long the collector's
//! turns took, and what each task has used.
//!
//! Of the tasks that have ended only those that used most are kept, so a million of them take no room.

use crate::task::TaskNumber;

/// Lengths of the collector's turns, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pauses {
    /// Number of turns.
    pub count: u64,
    /// Sum of their lengths.
    pub total: u64,
    /// Length of the longest.
    pub longest: u64,
}

/// Resources that a task has used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TaskFigures {
    /// Ordinal of the task, counted from the machine's first.
    pub number: TaskNumber,
    /// Name by which reports call it.
    pub name: String,
    /// How it has ended, `waiting` or `running`.
    pub status: &'static str,
    /// Ticks used.
    pub ticks: u64,
    /// Number of its turns.
    pub turns: u64,
    /// Size of its stack in bytes.
    pub stack: usize,
}

/// Figures gathered so far.
#[derive(Default)]
pub(crate) struct Figures {
    /// The collector's turns.
    pub(crate) pauses: Pauses,
    /// Whether any figures are wanted.
    pub(crate) are_wanted: bool,
    /// Whether figures of tasks are wanted.
    pub(crate) of_tasks: bool,
    /// Tasks that have ended; at most twice as many as are kept.
    pub(crate) ended: Vec<TaskFigures>,
}

impl Figures {
    /// Tasks that are kept, of those that have ended.
    pub(crate) const KEPT: usize = 100;

    /// Notes a turn of the collector.
    pub(crate) fn note_pause(&mut self, length: u64) {
        self.pauses.count += 1;
        self.pauses.total += length;
        self.pauses.longest = self.pauses.longest.max(length);
    }

    pub(crate) fn note_end(&mut self, task: TaskFigures) {
        self.ended.push(task);
        if self.ended.len() > 2 * Figures::KEPT {
            self.ended.sort_by_key(|task| (std::cmp::Reverse(task.ticks), task.number));
            self.ended.truncate(Figures::KEPT);
        }
    }
}
