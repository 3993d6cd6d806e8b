//! Calling a function from outside, and what became of a task.

use std::fmt;

use esl_bytecode::datum::Datum;
use esl_host::{Answer, FailureFrame, Incoming, Pending};

use super::ending::end_task;
use super::question::begins_no_call;
use super::{RunOutcome, run_tasks};
use crate::observe::Seen;
use crate::report;
use crate::task::{Task, TaskEnd, TaskId, TaskResult, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// Arguments of a failure, compared by what they print as.
#[derive(Clone, Debug, Default)]
pub struct FailureArguments(pub Vec<Datum>);

impl PartialEq for FailureArguments {
    fn eq(&self, other: &FailureArguments) -> bool {
        self.0.iter().map(Datum::to_string).eq(other.0.iter().map(Datum::to_string))
    }
}

impl Eq for FailureArguments {}

/// Reason why a call from outside returned no values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CallError {
    /// A failure ended the task.
    Failed {
        /// Cause of the failure, or name of the condition's type, as the program prints it: `:TYPE-ERROR`.
        cause: String,
        /// Text of the condition.
        message: String,
        /// Message, frames of the failure and what they were recovering from.
        report: String,
        /// Arguments of the failure, if its cause is one of the program's.
        arguments: FailureArguments,
        /// The calls that the failure has left unfinished, innermost first.
        frames: Box<[FailureFrame]>,
    },
    /// The task was aborted.
    Aborted,
    /// The program has asked to end with this status, which has aborted the task.
    Exited(u8),
    /// Every task waits for what cannot come.
    Deadlocked,
    /// The budget of the run is spent.
    BudgetSpent,
    /// The call did not end within this number of ticks.
    TicksUsed(u64),
    /// The embedder has stopped the run.
    Stopped,
    /// Not enough memory for a task.
    NoMemory,
}

impl fmt::Display for CallError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CallError::Failed { message, .. } => f.write_str(message),
            CallError::Aborted => f.write_str("it was aborted"),
            CallError::Exited(status) => write!(f, "the program has ended with the status {status}"),
            CallError::Deadlocked => f.write_str("it waits for an event that cannot occur"),
            CallError::BudgetSpent => f.write_str("the budget of the run is spent"),
            CallError::TicksUsed(ticks) => write!(f, "it did not end within {ticks} ticks"),
            CallError::Stopped => f.write_str("the run was stopped"),
            CallError::NoMemory => f.write_str("not enough memory for a task"),
        }
    }
}

impl std::error::Error for CallError {}

impl Vm {
    /// Calls a function in a task of its own and runs tasks until it has ended, at most for `ticks`. If it
    /// has not ended then, or cannot, it is aborted, and its cleanups run.
    ///
    /// # Errors
    /// [`CallError`].
    pub fn call(
        &mut self,
        function: Value,
        arguments: &[Value],
        ticks: u64,
    ) -> Result<Vec<Value>, CallError> {
        self.call_or_condition(function, arguments, ticks).map_err(|(error, _)| error)
    }

    /// As [`Vm::call`]; returns the first value, or `NIL` if there is none.
    ///
    /// # Errors
    /// [`CallError`].
    pub fn call_for_value(
        &mut self,
        function: Value,
        arguments: &[Value],
        ticks: u64,
    ) -> Result<Value, CallError> {
        let id = self.spawn(function, arguments).map_err(|_| CallError::NoMemory)?;
        let first = |values: &[Value]| values.first().copied().unwrap_or(Value::NIL);
        self.run_call(id, ticks, first).map_err(|(error, _)| error)
    }

    /// As [`Vm::call`], whatever is left of the run's budget.
    ///
    /// # Errors
    /// [`CallError`].
    pub fn call_without_budget(
        &mut self,
        function: Value,
        arguments: &[Value],
        ticks: u64,
    ) -> Result<Vec<Value>, CallError> {
        let budget = self.config.budget.take();
        let result = self.call(function, arguments, ticks);
        self.config.budget = budget;
        result
    }

    /// As [`Vm::call`]; the error comes with the condition of the failure, or `NIL`.
    pub(crate) fn call_or_condition(
        &mut self,
        function: Value,
        arguments: &[Value],
        ticks: u64,
    ) -> Result<Vec<Value>, (CallError, Value)> {
        let id = self.spawn(function, arguments).map_err(|_| (CallError::NoMemory, Value::NIL))?;
        self.run_call(id, ticks, <[Value]>::to_vec)
    }

    /// Begins a call of a function in a task of its own, and runs tasks for a portion of ticks, until the
    /// task has ended or all of them wait. Returns the first value, or `NIL` if there is none; or the answer
    /// to come, if the task goes on in the runs to come.
    ///
    /// # Errors
    /// [`CallError`].
    pub fn begin_call_for_value(
        &mut self,
        function: Value,
        arguments: &[Value],
        ticks: u64,
    ) -> Result<Result<Value, Pending>, CallError> {
        if begins_no_call(self) {
            let pending = self.outside.inbox.expect_answer();
            self.outside.inbox.answer(pending.number(), Answer::Ended);
            return Ok(Err(pending));
        }
        let id = self.spawn(function, arguments).map_err(|_| CallError::NoMemory)?;
        let outcome = run_tasks(self, Some(id), ticks, false);
        let task = self.scheduler.tasks.get(id);
        if let Some(values) = task.and_then(Task::values) {
            let value = values.first().copied().unwrap_or(Value::NIL);
            self.forget(id);
            return Ok(Ok(value));
        }
        if task.is_none_or(|task| task.state == TaskState::Ended) {
            return Err(self.error_of_call(id, ticks, outcome).0);
        }
        if outcome == RunOutcome::Stopped {
            // It was for the run of which this is a portion.
            self.outside.inbox.put(Incoming::Stop);
        }
        let pending = self.outside.inbox.expect_answer();
        self.embedder.calls.insert(id.index, pending.number());
        Ok(Err(pending))
    }

    /// As [`Vm::call_or_condition`]; a signal of the process aborts the call.
    pub(crate) fn call_until_signal(
        &mut self,
        function: Value,
        arguments: &[Value],
        ticks: u64,
    ) -> Result<Vec<Value>, (CallError, Value)> {
        let id = self.spawn(function, arguments).map_err(|_| (CallError::NoMemory, Value::NIL))?;
        self.embedder.interruptible = Some(id);
        let result = self.run_call(id, ticks, <[Value]>::to_vec);
        self.embedder.interruptible = None;
        result
    }

    /// Runs tasks until the one of a call has ended, and returns its values as `read` reads them.
    fn run_call<T>(
        &mut self,
        id: TaskId,
        ticks: u64,
        read: impl FnOnce(&[Value]) -> T,
    ) -> Result<T, (CallError, Value)> {
        let outcome = self.run_until(Some(id), ticks);
        if let Some(values) = self.scheduler.tasks.get(id).and_then(Task::values) {
            let read = read(values);
            self.forget(id);
            return Ok(read);
        }
        Err(self.error_of_call(id, ticks, outcome))
    }

    /// Ends the task of a call that has not succeeded. Returns the reason, and the condition of a failure.
    #[cold]
    fn error_of_call(&mut self, id: TaskId, ticks: u64, outcome: RunOutcome) -> (CallError, Value) {
        let result = self.result(id);
        end_task(self, id);
        let report = self.report(id);
        let frames = self.failure_frames(id).into();
        self.forget(id);
        let error = match (result, outcome) {
            (TaskResult::Failed(condition), _) => {
                let cause = report::cause_label(&self.heap, condition);
                let message = self.embedder.last_words.take().unwrap_or_else(|| self.describe(condition));
                let arguments = FailureArguments(report::failure_arguments(self, condition));
                let report = report.unwrap_or_default();
                let failed = CallError::Failed { cause, message, report, arguments, frames };
                return (failed, condition);
            }
            (TaskResult::Aborted, _) => {
                self.outside.exit_status.map_or(CallError::Aborted, CallError::Exited)
            }
            (_, RunOutcome::Waiting) => CallError::Deadlocked,
            (_, RunOutcome::BudgetSpent) => CallError::BudgetSpent,
            (_, RunOutcome::Stopped) => CallError::Stopped,
            (_, RunOutcome::Done | RunOutcome::TicksUsed) => CallError::TicksUsed(ticks),
        };
        (error, Value::NIL)
    }

    /// Makes a program's main task the one with whose failure the run ends.
    pub fn set_main(&mut self, id: TaskId) {
        self.scheduler.main = Some(id);
        self.scheduler.main_number = self.scheduler.tasks.get(id).map(|task| task.number);
        if let Some(number) = self.scheduler.main_number {
            report::show(self, number, Seen::IsNamed("the main task"));
        }
    }

    /// Returns what became of a task. A task that was forgotten counts as running.
    pub fn result(&self, id: TaskId) -> TaskResult {
        self.scheduler.tasks.get(id).map_or(TaskResult::Running, Task::result)
    }

    /// Returns the report of the failure that ended a task.
    pub fn report(&self, id: TaskId) -> Option<String> {
        let extra = self.scheduler.tasks.get(id)?.extra.as_ref()?;
        match (&extra.report, extra.end) {
            (Some(report), _) => Some(report.text()),
            (None, Some(TaskEnd::Failed(condition))) => Some(report::report_in_short(&self.heap, condition)),
            _ => None,
        }
    }

    /// Returns the same with the variables of its frames, if [`Vm::tell_variables`] has asked for them.
    pub fn detailed_report(&self, id: TaskId) -> Option<String> {
        let extra = self.scheduler.tasks.get(id)?.extra.as_ref()?;
        extra.report.as_ref().map(|report| report.detailed_text()).or_else(|| self.report(id))
    }

    /// Returns the report of the failure that ended a task with all calls of the library, if it was kept.
    pub fn full_report(&self, id: TaskId) -> Option<String> {
        self.scheduler.tasks.get(id)?.extra.as_ref()?.report.as_ref()?.full_text()
    }

    /// Returns the calls that the failure has left unfinished that ended a task, innermost first.
    pub fn failure_frames(&self, id: TaskId) -> Vec<FailureFrame> {
        let extra = self.scheduler.tasks.get(id).and_then(|task| task.extra.as_ref());
        extra.and_then(|extra| extra.report.as_ref()).map_or(Vec::new(), |report| report.frames.to_vec())
    }

    /// Returns the ticks that a task has used.
    pub fn ticks_of(&self, id: TaskId) -> u64 {
        self.scheduler.tasks.get(id).map_or(0, |task| task.ticks)
    }

    /// Returns the ticks that all tasks together have used.
    pub fn ticks(&self) -> u64 {
        self.scheduler.spent
    }

    /// Returns the number of tasks made, of their turns, and of the turns that came after one of another
    /// task, since the program began.
    pub fn tasks_turns_and_switches(&self) -> (u64, u64, u64) {
        let counts = &self.scheduler.counts;
        (counts.made, counts.turns, counts.switches)
    }
}
