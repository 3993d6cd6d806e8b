//! Running tasks: which one has the processor, for how long, and what becomes of it.
//!
//! Round-robin: a runnable task has a slice of ticks and goes to the end of the queue. The machine's own budget is
//! counted to the tick: a run that is given the same budget ends at the same place.

use std::collections::VecDeque;

use slotmap::SlotMap;

use crate::control::End;
use crate::interp::{self, Leave};
use crate::task::{Task, TaskId, TaskResult, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// The tasks of a machine. The running one's place is empty while it runs.
pub(crate) type Tasks = SlotMap<TaskId, Option<Box<Task>>>;

/// The runnable tasks, in the order in which they have their turn.
pub(crate) type RunQueue = VecDeque<TaskId>;

/// Why a run came back to the embedder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunOutcome {
    /// Every task has ended.
    Done,
    /// The tasks that are left all wait for something from outside.
    Waiting,
    /// The budget of the run is spent.
    BudgetSpent,
    /// The ticks that this call was given are used up.
    TicksUsed,
}

impl Vm {
    /// The running task.
    ///
    /// # Panics
    /// If none runs: builtins and instructions are only reached from a task.
    #[inline(always)]
    pub(crate) fn task(&self) -> &Task {
        self.running.as_ref().expect("a builtin is called by a task")
    }

    /// The running task.
    ///
    /// # Panics
    /// If none runs: builtins and instructions are only reached from a task.
    #[inline(always)]
    pub(crate) fn task_mut(&mut self) -> &mut Task {
        self.running.as_mut().expect("a builtin is called by a task")
    }

    /// Makes a task that will call `function`, a function or a symbol that names one, and puts it at the end of the
    /// queue.
    ///
    /// # Errors
    /// [`crate::raise::Exit::Collect`] if there is no room for its argument list.
    pub fn spawn(&mut self, function: Value, arguments: &[Value]) -> Result<TaskId, crate::raise::Exit> {
        let list = match self.heap.list(arguments) {
            Ok(list) => list,
            Err(_) => {
                self.pinned.extend_from_slice(arguments);
                self.pinned.push(function);
                self.collect_fully();
                self.pinned.truncate(self.pinned.len() - arguments.len() - 1);
                self.heap.list(arguments)?
            }
        };
        let mut task = Box::new(Task::new());
        interp::call::first_frame(&mut task, self.starter, function, list);
        // A new task holds nothing that was not found in a cycle under way: what it is made of is in hands of a task
        // that has been scanned, or of the host.
        self.heap.log_if_marking(function);
        self.heap.log_if_marking(list);
        task.scanned = self.heap.cycle_id();
        let id = self.tasks.insert(Some(task));
        self.roster.add(id, &self.tasks);
        self.queue.push_back(id);
        Ok(id)
    }

    /// What became of a task. One that was forgotten counts as running.
    pub fn result(&self, id: TaskId) -> TaskResult {
        match self.tasks.get(id) {
            Some(Some(task)) => task.result(),
            _ => TaskResult::Running,
        }
    }

    /// What is to be said of the failure that ended a task.
    pub fn report(&self, id: TaskId) -> Option<&str> {
        self.tasks.get(id)?.as_ref()?.report.as_deref()
    }

    /// Ticks that a task has used.
    pub fn ticks_of(&self, id: TaskId) -> u64 {
        self.tasks.get(id).and_then(|task| task.as_ref()).map_or(0, |task| task.ticks)
    }

    /// Ticks that all tasks together have used.
    pub fn ticks(&self) -> u64 {
        self.spent
    }

    /// Forgets a task that has ended; one that has not is dropped as it stands, without its cleanups.
    pub fn forget(&mut self, id: TaskId) {
        self.tasks.remove(id);
        self.queue.retain(|&queued| queued != id);
    }

    /// Asks for the end of a task. It unwinds, and runs its cleanups, when it next has its turn; inside a cleanup the
    /// request waits for its end.
    pub fn abort(&mut self, id: TaskId) {
        let Some(Some(task)) = self.tasks.get_mut(id) else { return };
        match task.state {
            TaskState::Ended(_) => {}
            TaskState::Runnable => task.pending_abort = true,
            TaskState::Parked => {
                task.pending_abort = true;
                task.state = TaskState::Runnable;
                self.queue.push_back(id);
            }
        }
    }

    /// Asks for the end of every task but the running one.
    pub(crate) fn abort_others(&mut self) {
        let others: Vec<TaskId> = self.tasks.keys().collect();
        others.into_iter().for_each(|id| self.abort(id));
    }

    /// Makes a task runnable that waits for something from outside: the instruction at which it waits is done again.
    pub(crate) fn wake(&mut self, id: TaskId) {
        if let Some(Some(task)) = self.tasks.get_mut(id)
            && task.state == TaskState::Parked
        {
            task.state = TaskState::Runnable;
            self.queue.push_back(id);
        }
    }

    /// Runs tasks in turn until all have ended or wait, the budget of the run is spent, or `ticks` are used up.
    pub fn run(&mut self, ticks: u64) -> RunOutcome {
        let end = self.spent.saturating_add(ticks);
        loop {
            if self.is_budget_spent() {
                return RunOutcome::BudgetSpent;
            }
            if self.spent >= end {
                return RunOutcome::TicksUsed;
            }
            let Some(id) = self.queue.pop_front() else {
                if !self.tasks.values().flatten().any(|task| task.state == TaskState::Parked) {
                    return RunOutcome::Done;
                }
                if !self.wait_for_input() {
                    return RunOutcome::Waiting;
                }
                continue;
            };
            if self.interrupt.load(std::sync::atomic::Ordering::Relaxed) && self.take_interrupt(id) {
                self.abort(id);
            }
            if self.run_slice(id, end - self.spent) == Leave::Slice {
                self.queue.push_back(id);
            }
        }
    }

    /// Runs one task alone until it ends, or has used `ticks` more. Gives whether it has ended.
    pub fn run_alone(&mut self, id: TaskId, ticks: u64) -> bool {
        let end = self.spent.saturating_add(ticks);
        self.queue.retain(|&queued| queued != id);
        while !self.is_budget_spent() && self.spent < end {
            match self.run_slice(id, end - self.spent) {
                Leave::Slice => {}
                Leave::Ended => return true,
                Leave::Parked => return false,
            }
        }
        false
    }

    /// Waits until the outside has something to say, and wakes those who wait for it. False if nobody does.
    fn wait_for_input(&mut self) -> bool {
        self.flush_output();
        self.host.wait(None, true);
        let parked: Vec<TaskId> = self.tasks.keys().collect();
        parked.into_iter().for_each(|id| self.wake(id));
        !self.queue.is_empty()
    }

    /// Whether the budget of the run is spent.
    fn is_budget_spent(&self) -> bool {
        self.config.budget.is_some_and(|budget| self.spent >= budget)
    }

    /// Gives a runnable task its slice.
    fn run_slice(&mut self, id: TaskId, limit: u64) -> Leave {
        let Some(Some(task)) = self.tasks.get_mut(id).map(Option::take) else { return Leave::Ended };
        let mut slice = u64::from(self.config.slice).min(limit);
        if let Some(budget) = self.config.budget {
            slice = slice.min(budget.saturating_sub(self.spent));
        }
        if let TaskState::Ended(_) = task.state {
            self.tasks[id] = Some(task);
            return Leave::Ended;
        }
        self.running = Some(task);
        self.scan_before_running();
        interp::load(self, slice.max(1) as i32);
        let task = self.task_mut();
        if task.pending_abort && task.control.running.is_empty() {
            task.pending_abort = false;
            self.begin_end(End::Aborted);
        }
        let leave = interp::run(self);
        let used =
            (i64::from(self.cpu.granted) - i64::from(self.cpu.reserve) - i64::from(self.cpu.ticks)).max(0);
        self.cpu.reserve = 0;
        self.spent += used as u64;
        if leave != Leave::Ended {
            self.save_cpu();
        }
        let mut task = self.running.take().expect("the loop leaves the running task in place");
        task.ticks += used as u64;
        if leave == Leave::Parked {
            task.state = TaskState::Parked;
        }
        self.tasks[id] = Some(task);
        leave
    }

    /// Notes how the running task has ended.
    pub(crate) fn finish_task(&mut self) {
        let end = self.ending.take().unwrap_or(End::Succeeded);
        let values = std::mem::take(&mut self.values);
        let task = self.task_mut();
        task.state = TaskState::Ended(end);
        task.values = values;
        interp::call::drop_frames(task);
    }

    /// Calls a function in a task of its own and runs it alone, at most for `ticks`.
    ///
    /// # Errors
    /// The text of the failure that ended it, or that it took too long.
    pub fn call(&mut self, function: Value, arguments: &[Value], ticks: u64) -> Result<Vec<Value>, String> {
        let id = self.spawn(function, arguments).map_err(|_| "no room for a task".to_string())?;
        let ended = self.run_alone(id, ticks);
        let result = self.result(id);
        self.forget(id);
        match result {
            TaskResult::Succeeded(values) => Ok(values),
            TaskResult::Failed(condition) => {
                Err(self.last_words.take().unwrap_or_else(|| self.describe(condition)))
            }
            TaskResult::Aborted => Err("it was aborted".into()),
            TaskResult::Running if ended => Err("it was aborted".into()),
            TaskResult::Running if self.is_budget_spent() => Err("the budget of the run is spent".into()),
            TaskResult::Running => Err(format!("it did not end within {ticks} ticks")),
        }
    }
}
