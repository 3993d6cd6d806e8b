//! Gathering figures of tasks.

use crate::observe::{Figures, Pauses, TaskFigures};
use crate::task::{Task, TaskState};
use crate::vm::Vm;
use crate::wait::event;

impl Vm {
    /// Has the collector's turns timed from now on, and the figures of tasks gathered if they are wanted.
    pub fn gather_figures(&mut self, of_tasks: bool) {
        self.watch.figures.wanted = true;
        self.watch.figures.of_tasks = of_tasks;
        self.note_who_watches();
    }

    /// How long the collector's turns took since they are timed.
    pub fn pauses(&self) -> Pauses {
        self.watch.figures.pauses
    }

    /// The tasks that have used most, most first: of those that have ended and of those that have not, a hundred at most.
    pub fn task_figures(&self) -> Vec<TaskFigures> {
        let mut tasks = self.watch.figures.ended.clone();
        let living = self.scheduler.tasks.iter().filter(|task| task.state != TaskState::Ended);
        tasks.extend(living.map(|task| self.figures_of(task)));
        tasks.sort_by_key(|task| (std::cmp::Reverse(task.ticks), task.number));
        tasks.truncate(Figures::KEPT);
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
        if self.watch.figures.of_tasks {
            let figures = self.figures_of(self.scheduler.task());
            self.watch.figures.note_end(figures);
        }
    }
}
