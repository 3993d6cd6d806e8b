//! Figures of a run that cost something to gather, and are gathered on request: how long the collector's turns took, and what each
//! task has used.
//!
//! Of the tasks that have ended only those are kept that have used most, so a million of them take no room.

use crate::task::{Task, TaskState};
use crate::vm::Vm;
use crate::wait::event;

/// Tasks that are kept, of those that have ended.
const KEPT: usize = 100;

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
    pauses: Pauses,
    /// Whether any are wanted, and those of tasks.
    wanted: bool,
    of_tasks: bool,
    /// Tasks that have ended; no more than twice as many as are kept.
    ended: Vec<TaskFigures>,
}

impl Figures {
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

    fn note_end(&mut self, task: TaskFigures) {
        self.ended.push(task);
        if self.ended.len() > 2 * KEPT {
            self.ended.sort_by_key(|task| (std::cmp::Reverse(task.ticks), task.number));
            self.ended.truncate(KEPT);
        }
    }
}

impl Vm {
    /// Has the collector's turns timed from now on, and the figures of tasks gathered if they are wanted.
    pub fn gather_figures(&mut self, of_tasks: bool) {
        self.figures.wanted = true;
        self.figures.of_tasks = of_tasks;
        self.note_who_watches();
    }

    /// How long the collector's turns took since they are timed.
    pub fn pauses(&self) -> Pauses {
        self.figures.pauses
    }

    /// The tasks that have used most, most first: of those that have ended and of those that have not, a hundred at most.
    pub fn task_figures(&self) -> Vec<TaskFigures> {
        let mut tasks = self.figures.ended.clone();
        let living = self.tasks.iter().filter(|task| task.state != TaskState::Ended);
        tasks.extend(living.map(|task| self.figures_of(task)));
        tasks.sort_by_key(|task| (std::cmp::Reverse(task.ticks), task.number));
        tasks.truncate(KEPT);
        tasks
    }

    fn figures_of(&self, task: &Task) -> TaskFigures {
        let status = match task.state {
            TaskState::Ended => self.end_label(task),
            TaskState::Waiting | TaskState::Reading => "waiting",
            TaskState::Runnable => "running",
        };
        TaskFigures {
            number: task.number,
            name: self.label_of(self.slot(task.object, event::NAME), task.number),
            status,
            ticks: task.ticks,
            turns: u64::from(task.turns),
            stack: task.stack.capacity() * 8,
        }
    }

    /// Notes what the running task, which has ended, has used.
    pub(crate) fn note_end_in_figures(&mut self) {
        if self.figures.of_tasks {
            let figures = self.figures_of(self.task());
            self.figures.note_end(figures);
        }
    }
}
