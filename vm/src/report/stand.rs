//! Where tasks stand between two portions of a run: their frames, and what they are about to call.
//!
//! For debuggers: nothing here changes the run, save [`Vm::stop_all_tasks`], after which it is over.

use esl_bytecode::builtin::BUILTINS;
use esl_bytecode::opcode::{CallTarget, Instr};

use super::tasks::place_of;
use super::{task_label, variable_rows, with_variables};
use crate::describe::{describe, function_name};
use crate::heap::Kind;
use crate::interp::frames::{Frame, Frames};
use crate::observe::StandingFrame;
use crate::schedule::{RunQueues, Timers};
use crate::task::{Task, TaskId, TaskNumber, TaskState};
use crate::vm::Vm;

impl Vm {
    /// Returns the task into whose turn the end of the last portion has fallen.
    pub fn open_task(&self) -> Option<TaskNumber> {
        let open = self.scheduler.open_turn.as_ref()?;
        self.scheduler.tasks.get(open.task).map(|task| task.number)
    }

    /// Returns the task that has this number, or that reports call so, in any case and without the word
    /// `task`.
    pub fn find_task(&self, name: &str) -> Option<TaskNumber> {
        let tasks = self.scheduler.tasks.iter().filter(|task| task.state != TaskState::Ended);
        let is_it = |task: &&Task| {
            let label = task_label(self, task.object);
            let bare = label.strip_prefix("task ").unwrap_or(&label);
            let bare = bare.trim_matches('"');
            task.number.to_string() == name
                || label.eq_ignore_ascii_case(name)
                || bare.eq_ignore_ascii_case(name)
        };
        tasks.filter(is_it).map(|task| task.number).min()
    }

    fn standing(&self, number: TaskNumber) -> Option<&Task> {
        self.scheduler.tasks.iter().find(|task| task.number == number && task.state != TaskState::Ended)
    }

    /// Returns what reports call a task that has not ended.
    pub fn task_name(&self, number: TaskNumber) -> Option<String> {
        self.standing(number).map(|task| task_label(self, task.object))
    }

    /// Returns the first `limit` frames of a task that has not ended, the innermost first.
    pub fn frames_of(&self, number: TaskNumber, limit: usize) -> Vec<StandingFrame> {
        let Some(task) = self.standing(number) else { return Vec::new() };
        let row = |frame: Frame<'_>| StandingFrame {
            function: function_name(&self.heap, frame.function),
            place: place_of(self, &frame),
            variables: variable_rows(self, &frame),
        };
        Frames::of_task(task).take(limit).map(row).collect()
    }

    /// Returns the report of a failure at which a task stands, with the variables of its frames.
    pub fn report_with_variables(&self, number: TaskNumber, report: &str) -> String {
        let frames = self.standing(number).map(Frames::of_task).into_iter().flatten();
        with_variables(self, report, frames)
    }

    /// Returns the number of a task; `None` if it was forgotten.
    pub fn number_of(&self, id: TaskId) -> Option<TaskNumber> {
        self.scheduler.tasks.get(id).map(|task| task.number)
    }

    /// Returns the name of the function that a task is about to call, if it stands before a call.
    pub fn next_call(&self, number: TaskNumber) -> Option<String> {
        let frame = Frames::of_task(self.standing(number)?).next()?;
        let code = self.heap.function_code(frame.function)?;
        let instruction = Instr::decode(self.heap.code_words(code)?, frame.word)?;
        let call = instruction.call()?;
        match (call.callee, instruction) {
            (CallTarget::Running, _) => Some(function_name(&self.heap, frame.function)),
            (CallTarget::Global, Instr::CallGlobal { symbol, .. } | Instr::TailCallGlobal { symbol, .. }) => {
                let symbol = self.heap.code_constants(code)?.get(symbol.0 as usize)?;
                Some(describe(&self.heap, *symbol))
            }
            (
                CallTarget::Builtin,
                Instr::CallBuiltin { builtin, .. } | Instr::TailCallBuiltin { builtin, .. },
            ) => BUILTINS.get(builtin.0 as usize).map(|builtin| builtin.name.to_string()),
            (CallTarget::Given | CallTarget::Applied, _) => {
                let callee = *frame.registers().get(usize::from(call.window.0))?;
                let is_function = self.heap.is(callee, Kind::Function);
                Some(if is_function {
                    function_name(&self.heap, callee)
                } else {
                    describe(&self.heap, callee)
                })
            }
            _ => None,
        }
    }

    /// Ends the turns of all tasks, so that a call from now on runs alone. The run itself is over.
    pub fn stop_all_tasks(&mut self) {
        let scheduler = &mut self.scheduler;
        if let Some(slice) = scheduler.open_turn.take().and_then(|turn| turn.slice) {
            scheduler.accounts.leave(slice.account);
        }
        scheduler.queues = RunQueues::default();
        scheduler.timers = Timers::default();
        scheduler.readers.clear();
        scheduler.writers.clear();
        scheduler.end_of_all = None;
        scheduler.main = None;
        scheduler.is_paused = false;
        scheduler.clock.more_is_due = false;
        self.config.budget = None;
    }
}
