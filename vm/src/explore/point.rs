//! Points, and running from one to the next.
//!
//! A builtin that is at a point gives up ([`Exit::Again`]) before it has had any effect, its task leaves the processor, and when the task
//! goes on the builtin is done again and let through. Unless schedules are explored that costs a test.

use super::{Grain, Settings};
use crate::raise::Exit;
use crate::run::RunOutcome;
use crate::schedule::Choices;
use crate::task::TaskState;
use crate::task::{End, Target, Unwinding};
use crate::vm::Vm;

/// What the machine knows of points.
#[derive(Default)]
pub(crate) struct Points {
    /// Where they are, while schedules are explored.
    grain: Option<Grain>,
    /// Whether the running task may pass the point at which it stands.
    is_open: bool,
}

/// What there is to choose from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Runnable {
    /// How many tasks.
    pub(super) count: u32,
    /// Whether the first of them is the task that ran last.
    pub(super) has_last: bool,
}

impl Vm {
    /// Said by a builtin that is about to do something that other tasks can see, once each time that it is done.
    ///
    /// # Errors
    /// [`Exit::Again`] if others are to be given the choice to go first; it will be done again.
    #[inline]
    pub(crate) fn point(&mut self) -> Result<(), Exit> {
        if self.points.grain.is_some() && self.stops_here() { Err(Exit::Again) } else { Ok(()) }
    }

    /// Said by a builtin that is about to look at what other tasks have done.
    ///
    /// # Errors
    /// As [`Vm::point`].
    #[inline]
    pub(crate) fn point_of_read(&mut self) -> Result<(), Exit> {
        if self.points.grain == Some(Grain::Reads) && self.stops_here() { Err(Exit::Again) } else { Ok(()) }
    }

    /// Whether the running task stops at the point that it has come to.
    #[cold]
    fn stops_here(&mut self) -> bool {
        if self.scheduler.task().critical > 0 || std::mem::take(&mut self.points.is_open) {
            return false;
        }
        self.scheduler.task_mut().flags.set_at_point(true);
        self.scheduler.turn.passes_turn = true;
        true
    }

    /// The running task will not do what it stands before: it was made to do something else first.
    pub(crate) fn close_point(&mut self) {
        self.points.is_open = false;
    }

    /// Whether the running task, which has come to its end, stops before it; then it stands before the last step of
    /// the unwinding that ends it.
    pub(crate) fn stops_before_end(&mut self) -> bool {
        if self.points.grain.is_none() || !self.stops_here() {
            return false;
        }
        let target = Target::Root(self.scheduler.turn.ending.take().unwrap_or(End::Succeeded));
        let values = std::mem::take(&mut self.exchange.values);
        self.scheduler.task_mut().control.unwinding = Some(Unwinding { target, values });
        true
    }

    /// From now on tasks stop at points.
    pub(super) fn explore_by(&mut self, settings: &Settings) {
        self.points.grain = Some(settings.grain);
        self.config.slice = settings.turn;
        self.scheduler.choices = Choices::first();
        self.outside.console.note_all(settings.output);
    }

    /// Runs the program from point to point along a list of choices that [`super::explore`] has found with the same settings; beyond its end
    /// the first choice is taken.
    pub fn follow(&mut self, settings: &Settings, choices: &[u32]) -> RunOutcome {
        self.explore_by(settings);
        let mut choices = choices.iter().copied();
        let mut next = |runnable: Runnable| if runnable.count > 1 { choices.next() } else { None };
        let outcome = self.run_by_points(&mut |_, runnable| Some(next(runnable).unwrap_or(0)));
        outcome.unwrap_or(RunOutcome::Done)
    }

    /// Runs from point to point; at each, `choose` says which task goes on, or that the run is given up. How the
    /// run has ended, unless it was given up.
    pub(super) fn run_by_points(
        &mut self,
        choose: &mut dyn FnMut(&mut Vm, Runnable) -> Option<u32>,
    ) -> Option<RunOutcome> {
        let mut last = u64::MAX;
        loop {
            if self.is_budget_spent() {
                return Some(RunOutcome::BudgetSpent);
            }
            while !self.scheduler.deliveries.is_empty() {
                self.deliver_some();
            }
            let mut runnable: Vec<(bool, u64, u32)> = (self.scheduler.tasks.ids().into_iter())
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
                if !self.idle() {
                    return Some(RunOutcome::Waiting);
                }
                continue;
            };
            let count = runnable.len() as u32;
            let choice = choose(self, Runnable { count, has_last: !is_other })?;
            let (_, number, index) = runnable[(choice % count) as usize];
            last = number;
            if let Some(task) = self.scheduler.tasks.at_mut(index) {
                self.points.is_open = task.flags.at_point();
                task.flags.set_at_point(false);
            }
            self.give_turn(index, u64::MAX);
        }
    }
}
