//! Running from point to point.

use super::Settings;
use crate::run::{self, RunOutcome};
use crate::schedule::Choices;
use crate::task::{TaskIndex, TaskNumber, TaskState};
use crate::vm::Vm;

/// The tasks to choose from, or the ways in which one of them may go on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Runnable {
    /// Number of runnable tasks, or of ways.
    pub(super) count: u32,
    /// Whether the first of them is the task that ran last.
    pub(super) has_last: bool,
}

impl Vm {
    /// Runs the program from point to point along a list of choices found by [`super::explore`] with the same
    /// settings; beyond the end of the list, the first choice is taken.
    pub fn follow(&mut self, settings: &Settings, choices: &[u32]) -> RunOutcome {
        explore_by(self, settings);
        let mut choices = choices.iter().copied();
        let mut next = |runnable: Runnable| if runnable.count > 1 { choices.next() } else { None };
        let outcome = run_by_points(self, &mut |_, runnable| Some(next(runnable).unwrap_or(0)));
        outcome.unwrap_or(RunOutcome::Done)
    }
}

/// Makes tasks stop at points from now on.
pub(super) fn explore_by(vm: &mut Vm, settings: &Settings) {
    vm.scheduler.points.grain = Some(settings.grain);
    vm.config.slice = settings.turn;
    vm.scheduler.choices = Choices::first();
    vm.outside.console.note_all(settings.output);
}

/// Runs from point to point; at each, `choose` says which task continues, or `None` to give up the run.
/// Returns how the run has ended, unless it was given up.
pub(super) fn run_by_points(
    vm: &mut Vm,
    choose: &mut dyn FnMut(&mut Vm, Runnable) -> Option<u32>,
) -> Option<RunOutcome> {
    let mut last = TaskNumber(u64::MAX);
    loop {
        vm.scheduler.rounds += 1;
        if vm.outside.inbox.is_rung() && run::take_in(vm) {
            return Some(RunOutcome::Stopped);
        }
        if vm.scheduler.is_budget_spent(&vm.config) {
            return Some(RunOutcome::BudgetSpent);
        }
        while !vm.scheduler.deliveries.is_empty() {
            run::deliver_some(vm);
        }
        let mut runnable: Vec<(bool, TaskNumber, TaskIndex)> = (vm.scheduler.tasks.ids().into_iter())
            .filter_map(|id| {
                let task = vm.scheduler.tasks.get(id).filter(|task| task.state == TaskState::Runnable)?;
                Some((task.number != last, task.number, id.index))
            })
            .collect();
        runnable.sort_unstable();
        let Some(&(is_other, ..)) = runnable.first() else {
            if vm.scheduler.counts.alive == 0 {
                return Some(RunOutcome::Done);
            }
            if !run::idle(vm) {
                return Some(RunOutcome::Waiting);
            }
            continue;
        };
        if let Some(ways) = vm.scheduler.points.asked.take() {
            let way = choose(vm, Runnable { count: ways as u32, has_last: false })?;
            vm.scheduler.points.chosen = Some(way as usize);
            if let Some(&(_, _, index)) = runnable.first().filter(|_| !is_other) {
                if let Some(task) = vm.scheduler.tasks.at_mut(index) {
                    task.flags.set_at_point(false);
                }
                run::give_turn(vm, index, u64::MAX);
            }
            continue;
        }
        let count = runnable.len() as u32;
        let choice = choose(vm, Runnable { count, has_last: !is_other })?;
        let (_, number, index) = runnable[(choice % count) as usize];
        last = number;
        if let Some(task) = vm.scheduler.tasks.at_mut(index) {
            vm.scheduler.points.is_open = task.flags.at_point();
            task.flags.set_at_point(false);
        }
        run::give_turn(vm, index, u64::MAX);
    }
}
