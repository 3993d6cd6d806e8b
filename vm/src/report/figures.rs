//! Gathering figures of tasks.

use super::{end_label, label_of};
use crate::observe::{Figures, Pauses, TaskFigures};
use crate::task::{Task, TaskState};
use crate::vm::Vm;
use crate::wait::event;

impl Vm {
    /// Has the collector's turns timed from now on, and the figures of tasks gathered if they are wanted.
    pub fn gather_figures(&mut self, of_tasks: bool) {
        self.watch.figures.are_wanted = true;
        self.watch.figures.of_tasks = of_tasks;
        self.watch.update_is_watched();
    }

    /// Has the passages of places counted from now on, in programs that were compiled to be counted.
    pub fn count_passages(&mut self) {
        self.watch.passages.get_or_insert_default();
    }

    /// Returns how often control has passed each place since the last call. Missing places were not passed.
    pub fn take_passages(&mut self) -> Vec<u64> {
        self.watch.passages.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Returns how long the collector's turns took since they are timed.
    pub fn pauses(&self) -> Pauses {
        self.watch.figures.pauses
    }

    /// Returns the tasks that have used most, most first: of those that have ended and of those that have
    /// not, a hundred at most.
    pub fn task_figures(&self) -> Vec<TaskFigures> {
        let mut tasks = self.watch.figures.ended.clone();
        let living = self.scheduler.tasks.iter().filter(|task| task.state != TaskState::Ended);
        tasks.extend(living.map(|task| figures_of(self, task)));
        tasks.sort_by_key(|task| (std::cmp::Reverse(task.ticks), task.number));
        tasks.truncate(Figures::KEPT);
        tasks
    }
}

fn figures_of(vm: &Vm, task: &Task) -> TaskFigures {
    let status = match task.state {
        TaskState::Ended => end_label(vm, task),
        TaskState::Waiting | TaskState::Reading | TaskState::Writing => "waiting",
        TaskState::Runnable => "running",
    };
    TaskFigures {
        number: task.number,
        name: label_of(vm, vm.heap.slot_or_nil(task.object, event::NAME), task.number),
        status,
        ticks: task.ticks,
        turns: u64::from(task.turns),
        stack: task.stack.capacity() * 8,
    }
}

/// Notes what the running task, which has ended, has used.
pub(crate) fn note_end_in_figures(vm: &mut Vm) {
    if vm.watch.figures.of_tasks {
        let figures = figures_of(vm, vm.scheduler.task());
        vm.watch.figures.note_end(figures);
    }
}
