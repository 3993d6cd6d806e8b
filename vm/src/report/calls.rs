//! The calls in which a task stands, and what tasks have used, for profiles.

use esl_host::Host;

use super::tasks::place_of;
use super::{label_of, task_label};
use crate::describe::function_name;
use crate::interp::frames::Frames;
use crate::observe::{OpenCalls, UsedResources};
use crate::task::TaskState;
use crate::vm::Vm;
use crate::wait::event;

impl Vm {
    /// Returns the innermost `limit` calls in which the task stands whose turn it is, or was last. `None` if
    /// it has ended.
    pub fn open_calls(&self, limit: usize) -> Option<OpenCalls> {
        let task = self.scheduler.tasks.at(self.scheduler.turn.index)?;
        if task.state == TaskState::Ended {
            return None;
        }
        let place = Frames::of_task(task).next().and_then(|frame| place_of(self, &frame));
        let frames = Frames::of_task(task).take(limit);
        let functions = frames.map(|frame| function_name(&self.heap, frame.function)).collect();
        Some(OpenCalls { task: task_label(self, task.object), functions, place })
    }

    /// Has what tasks use in their turns measured from now on.
    pub fn measure_turns(&mut self) {
        self.watch.meter.is_on = true;
        self.watch.update_is_watched();
    }

    /// Returns the ticks of the run so far, and the time by the host's stopwatch.
    pub(crate) fn used_so_far(&mut self) -> UsedResources {
        UsedResources { ticks: self.scheduler.spent, nanoseconds: self.outside.host.stopwatch() }
    }

    /// Takes what the task has used whose turn it is, or was last, since this was last taken.
    pub fn take_used(&mut self) -> UsedResources {
        let index = self.scheduler.turn.index;
        let number = self.scheduler.tasks.at(index).map(|task| task.number);
        number.map_or(UsedResources::default(), |number| self.watch.meter.take(index, number))
    }

    /// Takes what tasks that have ended had used and was not taken, with what reports called them.
    pub fn take_used_by_ended(&mut self) -> Vec<(String, UsedResources)> {
        self.watch.meter.take_ended()
    }

    /// Takes what all tasks have used and was not taken, with what reports call them.
    pub fn take_all_used(&mut self) -> Vec<(String, UsedResources)> {
        let mut all = self.watch.meter.take_ended();
        for id in self.scheduler.tasks.ids() {
            let Some(task) = self.scheduler.tasks.get(id) else { continue };
            let used = self.watch.meter.take(id.index, task.number);
            if used != UsedResources::default() {
                all.push((task_label(self, task.object), used));
            }
        }
        all
    }
}

/// Notes that the running task, which has ended, uses nothing more.
pub(crate) fn note_end_in_meter(vm: &mut Vm) {
    let (index, task) = (vm.scheduler.turn.index, vm.scheduler.task());
    let label = label_of(vm, vm.heap.slot_or_nil(task.object, event::NAME), task.number);
    let used = vm.watch.meter.take(index, task.number);
    vm.watch.meter.note_end(label, used);
}
