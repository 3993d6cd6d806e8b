//! Running along a list of choices that was found before.

use super::point::PointRun;
use super::step::{Runnable, ScheduleEvent, ScheduleStep, TellStep, switch, tell_step, tell_uses};
use super::tasks::watch_variables;
use super::{Settings, TimerGrain};
use crate::run::RunOutcome;
use crate::schedule::{Choices, Grain};
use crate::value::Value;
use crate::vm::Vm;

/// A run by a list of choices, which may be given its ticks in portions.
#[derive(Clone, Debug)]
pub struct FollowedRun {
    run: PointRun,
    choices: Vec<u32>,
    /// Number of choices made so far.
    made: usize,
}

impl Vm {
    /// Prepares to run the program as [`Vm::follow`] does, by [`Vm::go_on_following`].
    pub fn begin_to_follow(&mut self, settings: &Settings, choices: Vec<u32>) -> FollowedRun {
        explore_by(self, settings);
        FollowedRun { run: PointRun::begin(self, settings), choices, made: 0 }
    }

    /// Runs on along the list of choices, for at most so many ticks.
    pub fn go_on_following(&mut self, followed: &mut FollowedRun, ticks: u64) -> RunOutcome {
        let end = self.scheduler.spent.saturating_add(ticks);
        let FollowedRun { run, choices, made } = followed;
        let outcome = run.go_on(self, end, None, &mut |_, _, runnable| {
            if runnable.count() <= 1 {
                return Some(0);
            }
            let choice = choices.get(*made).copied().unwrap_or(0);
            *made += 1;
            Some(choice)
        });
        let outcome = outcome.unwrap_or(RunOutcome::Done);
        if outcome != RunOutcome::TicksUsed {
            self.end_following();
        }
        outcome
    }

    /// Makes tasks stop at points no longer.
    pub fn end_following(&mut self) {
        self.scheduler.points.grain = None;
        self.scheduler.points.is_strict = false;
    }

    /// Runs the program from point to point along a list of choices found by [`super::explore`] with the same
    /// settings; beyond the end of the list, the first choice is taken.
    pub fn follow(&mut self, settings: &Settings, choices: &[u32]) -> RunOutcome {
        follow(self, settings, choices, true, None).unwrap_or(RunOutcome::Done)
    }

    /// As [`Vm::follow`]; `told` is told of the choices other than the first, and of the uses of variables.
    pub fn follow_and_tell(
        &mut self,
        settings: &Settings,
        choices: &[u32],
        told: &mut TellStep<'_>,
    ) -> RunOutcome {
        follow(self, settings, choices, true, Some(told)).unwrap_or(RunOutcome::Done)
    }

    /// As [`Vm::follow_and_tell`], no further than the last of the choices: for a schedule that does not end.
    pub fn follow_to(&mut self, settings: &Settings, choices: &[u32], told: &mut TellStep<'_>) {
        follow(self, settings, choices, false, Some(told));
    }
}

/// Runs along choices, and further if `goes_beyond`; returns how the run has ended, if it has.
fn follow(
    vm: &mut Vm,
    settings: &Settings,
    choices: &[u32],
    goes_beyond: bool,
    mut told: Option<&mut TellStep<'_>>,
) -> Option<RunOutcome> {
    explore_by(vm, settings);
    vm.scheduler.points.uses = told.is_some().then(Vec::new);
    vm.scheduler.points.objects.clear();
    let mut choices = choices.iter().copied();
    let mut watched = 0;
    let mut next = |vm: &mut Vm, runnable: Runnable<'_>| {
        if let Some(told) = &mut told {
            tell_uses(vm, *told);
            // Uses of variables are told at each grain.
            if watched != vm.names.symbol_count() {
                watch_variables(vm);
                watched = vm.names.symbol_count();
            }
        }
        if !goes_beyond && choices.len() == 0 {
            return None;
        }
        let choice = if runnable.count() > 1 { choices.next().unwrap_or(0) } else { 0 };
        if choice > 0
            && let Some(told) = &mut told
        {
            let event = ScheduleEvent::Switch(switch(vm, runnable, choice));
            told(ScheduleStep { time: vm.scheduler.clock.now, event });
        }
        if let (None, Some(&index), Some(told)) =
            (runnable.ways, runnable.tasks.get(choice as usize), &mut told)
        {
            tell_step(vm, index, *told);
        }
        Some(choice)
    };
    let mut run = PointRun::begin(vm, settings);
    let outcome = run.go_on(vm, u64::MAX, None, &mut |vm, _, runnable| next(vm, runnable));
    if let Some(told) = told {
        tell_uses(vm, told);
    }
    vm.scheduler.points.uses = None;
    vm.end_following();
    outcome
}

/// Makes tasks stop at points from now on.
pub(super) fn explore_by(vm: &mut Vm, settings: &Settings) {
    vm.scheduler.points.grain = Some(settings.grain);
    vm.scheduler.points.is_strict = settings.strict;
    vm.scheduler.points.is_timed = settings.timers == TimerGrain::Any;
    // At a tick a task may hold a time that the library has read, such as the deadline of a sleep; relative
    // times do not tell whether that has passed.
    vm.scheduler.points.has_counts = settings.counts;
    (vm.scheduler.points.sees_numbers, vm.scheduler.points.sees_order) = (false, false);
    vm.scheduler.points.has_columns = settings.columns;
    vm.scheduler.points.has_numbers = settings.numbers;
    vm.scheduler.points.has_symmetry = settings.symmetry && !settings.numbers;
    vm.scheduler.points.has_clock = settings.clock || settings.grain == Grain::Ticks;
    vm.config.slice = match settings.grain {
        Grain::Changes | Grain::Reads => settings.turn,
        Grain::Variables | Grain::Ticks => 1,
    };
    vm.scheduler.choices = Choices::first();
    vm.outside.console.note_all(settings.output);
    if settings.crashes > 0 {
        let count = Value::index(settings.crashes as usize);
        // Without room for the name there is none for the program either.
        if let Ok(name) = vm.names.intern_esl(&mut vm.heap, "*%CRASHES*") {
            _ = vm.set_symbol_value(name, count);
        }
    }
}
