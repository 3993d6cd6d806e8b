//! The calls in which a task stands, for profiles.

use esl_bytecode::compile::SourcePlace;

use super::task_label;
use super::tasks::place_of;
use crate::describe::function_name;
use crate::interp::frames::Frames;
use crate::task::TaskState;
use crate::vm::Vm;

impl Vm {
    /// Returns the calls in which the task stands whose turn it is, or was last: the innermost `limit` of
    /// them, innermost first, with the names of the functions and where they stand, as far as that is known.
    /// Last comes the task itself, as reports call it. `None` if it has ended.
    pub fn open_calls(&self, limit: usize) -> Option<Vec<(String, Option<SourcePlace>)>> {
        let task = self.scheduler.tasks.at(self.scheduler.turn.index)?;
        if task.state == TaskState::Ended {
            return None;
        }
        let calls = Frames::of_task(task)
            .take(limit)
            .map(|frame| (function_name(&self.heap, frame.function), place_of(self, &frame)));
        Some(calls.chain([(task_label(self, task.object), None)]).collect())
    }
}
