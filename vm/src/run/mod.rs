//! Running tasks: giving them their turns.
//!
//! A runnable task has a slice of ticks and goes to the end of its queue; `schedule` says whose turn it is. The machine's own
//! budget is counted to the tick: a run that is given the same budget ends at the same place. When no task is
//! runnable the machine sleeps in the host until the first timer, or until something comes from outside (`clock`).
//! Not here: making tasks (`spawn`), and their ends (`finish`).

mod finish;
mod limit;
mod signal;
mod spawn;
mod timers;
mod wait;

pub(crate) use spawn::SpawnOptions;
pub(crate) use timers::is_wanted;

use std::sync::atomic::Ordering::Relaxed;

use crate::interp::{self, Leave};
use crate::observe::Seen;
use crate::report::Happening;
use crate::schedule::{Due, Parking};
use crate::task::AccountId;
use crate::task::End;
use crate::task::{Task, TaskId, TaskResult, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// Why a run came back to the embedder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunOutcome {
    /// What was to be run has ended: every task, or the one that was named.
    Done,
    /// The tasks that are left all wait for what cannot come.
    Waiting,
    /// The budget of the run is spent.
    BudgetSpent,
    /// The ticks that this call was given are used up.
    TicksUsed,
    /// The embedder has set the flag of [`Vm::stop_flag`].
    Stopped,
}

impl Vm {
    /// Makes a task runnable that is parked, or moves one that is runnable to the urgent ones.
    pub(crate) fn make_runnable(&mut self, index: u32, urgent: bool) {
        let serial = self.scheduler.next_serial();
        let Some(task) = self.scheduler.tasks.at_mut(index) else { return };
        let was_parked = std::mem::replace(&mut task.state, TaskState::Runnable) != TaskState::Runnable;
        task.serial = serial;
        let (priority, urgent) = (task.priority, urgent || task.flags.urgent());
        self.scheduler.queues.push(index, serial, priority, urgent);
        if was_parked {
            self.note(index, Happening::GoesOn);
        }
    }

    /// Runs tasks in turn until all have ended or wait for what cannot come, the budget of the run is spent, or `ticks`
    /// are used up.
    pub fn run(&mut self, ticks: u64) -> RunOutcome {
        self.run_until(None, ticks)
    }

    /// Runs tasks in turn, as [`Vm::run`] does, but only until the named one has ended.
    pub fn run_until(&mut self, id: Option<TaskId>, ticks: u64) -> RunOutcome {
        self.run_tasks(id, ticks, true)
    }

    /// Runs tasks in turn, as [`Vm::run`] does, but comes back instead of waiting when all of them wait.
    pub fn run_ready(&mut self, ticks: u64) -> RunOutcome {
        self.run_tasks(None, ticks, false)
    }

    fn run_tasks(&mut self, id: Option<TaskId>, ticks: u64, may_wait: bool) -> RunOutcome {
        let end = self.scheduler.spent.saturating_add(ticks);
        loop {
            if let Some(id) = id
                && self.scheduler.tasks.get(id).is_none_or(|task| task.state == TaskState::Ended)
            {
                return RunOutcome::Done;
            }
            if self.is_budget_spent() {
                return RunOutcome::BudgetSpent;
            }
            if self.scheduler.spent >= end {
                return RunOutcome::TicksUsed;
            }
            if self.embedder.stop.load(Relaxed) && self.embedder.stop.swap(false, Relaxed) {
                return RunOutcome::Stopped;
            }
            if let Some(interrupted) = self.take_interrupt() {
                self.embedder.was_interrupted = true;
                self.abort(interrupted);
            }
            self.look_at_clock();
            if !self.scheduler.deliveries.is_empty() {
                self.deliver_some();
            }
            let next = match self.scheduler.end_of_all {
                None => self.scheduler.queues.next(&self.scheduler.tasks, &mut self.scheduler.choices),
                Some(_) => self.next_while_all_end(),
            };
            match next {
                Some(index) => self.give_turn(index, end),
                None => {
                    if !self.scheduler.deliveries.is_empty() || self.scheduler.end_of_all.is_some() {
                        continue;
                    }
                    if self.scheduler.counts.alive == 0 {
                        return RunOutcome::Done;
                    }
                    if !may_wait || !self.idle() {
                        return RunOutcome::Waiting;
                    }
                }
            }
        }
    }

    /// Asks more tasks to end; whose turn it is among those that do.
    #[cold]
    fn next_while_all_end(&mut self) -> Option<u32> {
        self.abort_more();
        self.scheduler.queues.next_urgent(&self.scheduler.tasks)
    }

    /// Gives a runnable task its turn: one slice, or as many as it takes to leave a critical section.
    pub(crate) fn give_turn(&mut self, index: u32, end: u64) {
        loop {
            let limit = end.saturating_sub(self.scheduler.spent);
            let leave = self.run_slice(index, limit);
            let Some(task) = self.scheduler.tasks.at_mut(index) else { return };
            match leave {
                Leave::Ended => return,
                Leave::Slice => {
                    let passes = std::mem::take(&mut self.scheduler.turn.passes_turn);
                    let holds = std::mem::take(&mut self.scheduler.turn.holds_task)
                        && !self.scheduler.deliveries.is_empty();
                    let goes_on = task.critical > 0 || self.scheduler.turn.slice_is_cut && !passes && !holds;
                    if goes_on && self.scheduler.spent < end && !self.is_budget_spent() {
                        continue;
                    }
                    return if holds { self.hold(index) } else { self.make_runnable(index, false) };
                }
                Leave::Parked => return self.park_task(index),
            }
        }
    }

    /// Gives a runnable task one slice.
    fn run_slice(&mut self, index: u32, limit: u64) -> Leave {
        if !self.scheduler.deliveries.is_empty() {
            self.deliver_some();
        }
        let Some(task) = self.scheduler.tasks.take(index) else { return Leave::Ended };
        let account = task.account;
        self.scheduler.running = Some(task);
        self.scheduler.counts.switches += u64::from(index != self.scheduler.turn.index);
        self.scheduler.turn.index = index;
        self.scheduler.counts.turns += 1;
        let task = self.scheduler.task_mut();
        task.turns = task.turns.wrapping_add(1);
        let number = task.number;
        if self.watch.is_watched {
            self.show(number, Seen::Runs);
        }
        self.scheduler.turn.slice_is_cut = false;
        self.scheduler.turn.holds_task = false;
        self.scheduler.turn.had_attention = self.scheduler.task().flags.attention();
        self.scan_before_running();
        let slice = self.slice_of_running_task(limit);
        interp::load(self, slice as i32);
        let mut left = Ok(());
        if self.scheduler.task().flags.attention() || account != AccountId::NONE {
            left = interp::see_to_attention(self);
        }
        let is_over = self.scheduler.task().critical > 0 && self.scheduler.turn.critical_left <= 0;
        if left.is_ok() && is_over && !self.scheduler.task().control.is_unwinding() {
            left = self.end_critical_by_failure();
        }
        let leave = match left {
            Ok(()) => interp::run(self),
            Err(leave) => leave,
        };
        let cpu = &self.cpu;
        let used = (i64::from(cpu.granted) - i64::from(cpu.reserve) - i64::from(cpu.ticks)).max(0) as u64;
        self.cpu.reserve = 0;
        let used = used + self.exchange.take_charged();
        self.scheduler.spent += used;
        if leave != Leave::Ended {
            self.save_cpu();
        }
        let task = self.scheduler.task_mut();
        task.ticks += used;
        if task.critical > 0 && !std::mem::take(&mut self.scheduler.turn.critical_is_new) {
            self.scheduler.turn.critical_left -= used as i64;
        }
        if account != AccountId::NONE {
            self.charge_account(account, used);
        }
        if self.watch.is_watched {
            self.tell_how_turn_ended(leave);
        }
        let Some(task) = self.scheduler.running.take() else { return Leave::Ended };
        if leave == Leave::Ended && !task.flags.kept() {
            self.scheduler.turn.index = u32::MAX;
            if let Some(id) = self.scheduler.tasks.id_at(index) {
                self.scheduler.tasks.retire(id, task);
            }
        } else {
            self.scheduler.tasks.put_back(index, task);
        }
        leave
    }

    /// Tells observers that the turn of the running task is over. Waits are told of when the task is parked.
    #[cold]
    fn tell_how_turn_ended(&mut self, leave: Leave) {
        let number = self.scheduler.task().number;
        match leave {
            Leave::Slice => self.tell_end_of_turn(number),
            Leave::Parked => {}
            Leave::Ended => {
                self.note_end_in_figures();
                let how = self.end_label(self.scheduler.task());
                self.show(number, Seen::Ends(how));
            }
        }
    }

    /// The length of the next slice of the running task.
    fn slice_of_running_task(&mut self, limit: u64) -> u64 {
        let mut slice = u64::from(self.scheduler.choices.slice(self.config.slice)).min(limit);
        if let Some(budget) = self.config.budget {
            slice = slice.min(budget.saturating_sub(self.scheduler.spent));
        }
        let account = self.scheduler.task().account;
        if account != AccountId::NONE {
            slice = slice.min(self.scheduler.accounts.left(account));
        }
        if self.scheduler.task().control.get().is_some_and(|control| !control.running.is_empty()) {
            let left = self.cleanup_ticks_left();
            slice = slice.min(left);
            if left == 0 {
                self.scheduler.task_mut().flags.set_attention(true);
            }
        }
        if self.scheduler.task().critical > 0 {
            slice = slice.min(self.scheduler.turn.critical_left.max(1) as u64);
        }
        slice.max(1)
    }

    /// Ends the critical section of the running task, which has used up its ticks, with a failure where the task stands.
    fn end_critical_by_failure(&mut self) -> Result<(), Leave> {
        self.scheduler.task_mut().critical = 0;
        let function = self.world.known.raise;
        let cause = self.world.known.budget_exhausted;
        interp::interrupt(self, function, &[cause])
    }

    /// Notes that the task at a place has come to wait.
    fn park_task(&mut self, index: u32) {
        let parking = std::mem::take(&mut self.scheduler.turn.parking);
        let serial = self.scheduler.next_serial();
        let Some(id) = self.scheduler.tasks.id_at(index) else { return };
        let Some(task) = self.scheduler.tasks.at_mut(index) else { return };
        task.serial = serial;
        trim(task);
        match parking {
            Parking::Input => {
                task.state = TaskState::Reading;
                self.scheduler.readers.push(id);
            }
            Parking::Wait(deadline) => {
                task.state = TaskState::Waiting;
                if let Some(deadline) = deadline {
                    self.scheduler.timers.push(deadline, index, Due::Wait(serial));
                }
            }
        }
        self.note(index, Happening::Waits);
        if !self.scheduler.turn.had_attention
            && self.scheduler.tasks.at(index).is_some_and(|task| task.flags.attention())
        {
            // Something was noted while it was about to wait.
            self.make_runnable(index, true);
        }
    }

    /// Whether the budget of the run is spent.
    pub(crate) fn is_budget_spent(&self) -> bool {
        self.config.budget.is_some_and(|budget| self.scheduler.spent >= budget)
    }

    /// Calls a function in a task of its own and runs tasks until it has ended, at most for `ticks`.
    ///
    /// # Errors
    /// The text of the failure that ended it, or that it took too long.
    pub fn call(&mut self, function: Value, arguments: &[Value], ticks: u64) -> Result<Vec<Value>, String> {
        let id = self.spawn(function, arguments).map_err(|_| "no room for a task".to_string())?;
        let outcome = self.run_until(Some(id), ticks);
        let result = self.result(id);
        self.forget(id);
        match (result, outcome) {
            (TaskResult::Succeeded(values), _) => Ok(values),
            (TaskResult::Failed(condition), _) => {
                Err(self.embedder.last_words.take().unwrap_or_else(|| self.describe(condition)))
            }
            (TaskResult::Aborted, _) => Err("it was aborted".into()),
            (_, RunOutcome::Waiting) => Err("it waits for what cannot come".into()),
            (_, RunOutcome::BudgetSpent) => Err("the budget of the run is spent".into()),
            _ => Err(format!("it did not end within {ticks} ticks")),
        }
    }

    /// Makes a program's main task the one with whose failure the run ends.
    pub fn set_main(&mut self, id: TaskId) {
        self.scheduler.main = Some(id);
        self.scheduler.main_number = self.scheduler.tasks.get(id).map(|task| task.number);
        if let Some(number) = self.scheduler.main_number {
            self.show(number, Seen::IsNamed("the main task"));
        }
    }

    /// What became of a task. One that was forgotten counts as running.
    pub fn result(&self, id: TaskId) -> TaskResult {
        self.scheduler.tasks.get(id).map_or(TaskResult::Running, Task::result)
    }

    /// What is to be said of the failure that ended a task.
    pub fn report(&self, id: TaskId) -> Option<String> {
        let extra = self.scheduler.tasks.get(id)?.extra.as_ref()?;
        match (&extra.report, extra.end) {
            (Some(report), _) => Some(report.text()),
            (None, Some(End::Failed(condition))) => Some(self.report_in_short(condition)),
            _ => None,
        }
    }

    /// Ticks that a task has used.
    pub fn ticks_of(&self, id: TaskId) -> u64 {
        self.scheduler.tasks.get(id).map_or(0, |task| task.ticks)
    }

    /// Ticks that all tasks together have used.
    pub fn ticks(&self) -> u64 {
        self.scheduler.spent
    }

    /// Tasks that were made, turns that they had, and how many of these came after one of another task, since the program
    /// began.
    pub fn tasks_turns_and_switches(&self) -> (u64, u64, u64) {
        (self.scheduler.counts.made, self.scheduler.counts.turns, self.scheduler.counts.switches)
    }
}

/// Gives back most of a stack that is much too large for what is on it, if it was the last time too.
fn trim(task: &mut Task) {
    let (top, capacity) = (interp::top_of_task(task), task.stack.capacity());
    let is_oversized = capacity > 64 && top < capacity / 4;
    if is_oversized && task.flags.oversized() {
        task.stack.shrink(top + 16);
    }
    task.flags.set_oversized(is_oversized && !task.flags.oversized());
}
