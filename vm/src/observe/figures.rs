//! Figures of a run that cost something to gather, and are gathered on request: how long the collector's turns took, and what each
//! task has used.
//!
//! Of the tasks that have ended only those are kept that have used most, so a million of them take no room.

/// How long the collector's turns took, in nanoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pauses {
    /// How many there were.
    pub count: u64,
    /// All together.
    pub total: u64,
    /// The longest.
    pub longest: u64,
}

/// What a task has used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TaskFigures {
    /// The how manieth task of the machine it is.
    pub number: u64,
    /// How reports call it.
    pub name: String,
    /// How it has ended, `waiting` or `running`.
    pub status: &'static str,
    /// Ticks that it has used.
    pub ticks: u64,
    /// Turns that it has had.
    pub turns: u64,
    /// Bytes of its stack.
    pub stack: usize,
}

/// What is gathered.
#[derive(Default)]
pub(crate) struct Figures {
    pub(crate) pauses: Pauses,
    /// Whether any are wanted, and those of tasks.
    pub(crate) wanted: bool,
    pub(crate) of_tasks: bool,
    /// Tasks that have ended; no more than twice as many as are kept.
    pub(crate) ended: Vec<TaskFigures>,
}

impl Figures {
    /// Tasks that are kept, of those that have ended.
    pub(crate) const KEPT: usize = 100;

    /// Whether somebody has asked for figures.
    pub(crate) fn are_wanted(&self) -> bool {
        self.wanted
    }

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
