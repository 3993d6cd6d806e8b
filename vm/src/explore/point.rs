//! Running from point to point.

use super::Settings;
use crate::run::{self, RunOutcome};
use crate::schedule::Choices;
use crate::task::{TaskIndex, TaskNumber, TaskState};
use crate::vm::Vm;

/// What there is to choose from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Runnable {
    /// How many tasks.
    pub(super) count: u32,
    /// Whether the first of them is the task that ran last.
    pub(super) has_last: bool,
}

impl Vm {
    /// From now on tasks stop at points.
    pub(super) fn explore_by(&mut self, settings: &Settings) {
        self.scheduler.points.grain = Some(settings.grain);
        self.config.slice = settings.turn;
        self.scheduler.choices = Choices::first();
        self.outside.console.note_all(settings.output);
    }

    /// Runs the program from point to point along a list of choices that [`super::explore`] has found with
    /// the same settings; beyond its end the first choice is taken.
    pub fn follow(&mut self, settings: &Settings, choices: &[u32]) -> RunOutcome {
        self.explore_by(settings);
        let mut choices = choices.iter().copied();
        let mut next = |runnable: Runnable| if runnable.count > 1 { choices.next() } else { None };
        let outcome = self.run_by_points(&mut |_, runnable| Some(next(runnable).unwrap_or(0)));
        outcome.unwrap_or(RunOutcome::Done)
    }

    /// Runs from point to point; at each, `choose` says which task goes on, or that the run is given up. How
    /// the run has ended, unless it was given up.
    pub(super) fn run_by_points(
        &mut self,
        choose: &mut dyn FnMut(&mut Vm, Runnable) -> Option<u32>,
    ) -> Option<RunOutcome> {
        let mut last = TaskNumber(u64::MAX);
        loop {
            if self.scheduler.is_budget_spent(&self.config) {
                return Some(RunOutcome::BudgetSpent);
            }
            while !self.scheduler.deliveries.is_empty() {
                run::deliver_some(self);
            }
            let mut runnable: Vec<(bool, TaskNumber, TaskIndex)> = (self.scheduler.tasks.ids().into_iter())
                .filter_map(|id| {
                    let task =
                        self.scheduler.tasks.get(id).filter(|task| task.state == TaskState::Runnable)?;
                    Some((task.number != last, task.number, id.index))
                })
                .collect();
            runnable.sort_unstable();
            let Some(&(is_other, ..)) = runnable.first() else {
                if self.scheduler.counts.alive == 0 {
                    return Some(RunOutcome::Done);
                }
                if !run::idle(self) {
                    return Some(RunOutcome::Waiting);
                }
                continue;
            };
            let count = runnable.len() as u32;
            let choice = choose(self, Runnable { count, has_last: !is_other })?;
            let (_, number, index) = runnable[(choice % count) as usize];
            last = number;
            if let Some(task) = self.scheduler.tasks.at_mut(index) {
                self.scheduler.points.is_open = task.flags.at_point();
                task.flags.set_at_point(false);
            }
            run::give_turn(self, index, u64::MAX);
        }
    }
}
