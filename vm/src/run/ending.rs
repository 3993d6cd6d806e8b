//! The end of a run that the outside wants, or that comes because the run cannot go on: a signal of the
//! process, a deadlock, a budget that is spent, an engine that is dropped.
//!
//! Guarantees: every task is aborted, newest first, and its cleanups run within their allowance; operations
//! that are under way are cancelled, and have as much time to stop. An interrupt cuts that short.

use esl_host::{Awaited, Host};

use super::{RunOutcome, run_tasks, take_in};
use crate::report;
use crate::task::{TaskId, TaskState};
use crate::vm::Vm;

impl Vm {
    /// Ends the run: aborts every task, newest first, runs their cleanups, which the budget of the run does
    /// not limit, and cancels the operations under way. Returns what is left, as reports call it: tasks whose
    /// end an interrupt has cut short, and operations that have not stopped in time.
    pub fn end_run(&mut self) -> Vec<String> {
        self.embedder.is_ending = true;
        self.scheduler.is_paused = false;
        if !self.embedder.is_cut_short {
            self.abort_all();
            run_cleanups(self, None);
            stop_operations(self);
            self.embedder.is_ending = self.embedder.is_cut_short;
            self.scheduler.counts.made_at_end = 0;
        }
        let mut left = report::tasks_left(self);
        left.extend(report::operations_left(self));
        left
    }
}

/// Aborts a task of the embedder's, and runs its cleanups.
pub(super) fn end_task(vm: &mut Vm, id: TaskId) {
    if vm.scheduler.tasks.get(id).is_some_and(|task| task.state != TaskState::Ended) {
        vm.abort(id);
        run_cleanups(vm, Some(id));
    }
}

/// Runs tasks until all have ended, or the named one, without the budget of the run.
fn run_cleanups(vm: &mut Vm, id: Option<TaskId>) {
    let (budget, between_rounds) = (vm.config.budget.take(), vm.between_rounds.take());
    // A request to come back is for the run that is over.
    while run_tasks(vm, id, u64::MAX, true) == RunOutcome::Stopped && !vm.embedder.is_cut_short {}
    (vm.config.budget, vm.between_rounds) = (budget, between_rounds);
}

/// Cancels the operations under way, and waits until those have stopped that are waited for.
fn stop_operations(vm: &mut Vm) {
    vm.outside.operations.cancel_all();
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    let deadline = now.saturating_add(vm.config.cleanup_time);
    while vm.outside.operations.are_awaited() && !vm.embedder.is_cut_short {
        if vm.scheduler.clock.is_due(&mut vm.outside.host, deadline) {
            return;
        }
        vm.outside.host.wait(Some(deadline), Awaited { news: true, ..Awaited::default() });
        if vm.outside.inbox.is_rung() {
            vm.scheduler.rounds += 1;
            take_in(vm);
        }
    }
}
