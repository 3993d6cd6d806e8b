//! Runs by random priorities: probabilistic concurrency testing.
//!
//! Each task has a random priority, and at each point the runnable task with the highest one continues. At
//! `depth` - 1 random steps, the task that would continue gets a priority below all others. A run of `n`
//! tasks and `k` steps so finds a fault that needs `d` steps in a certain order with a probability of at
//! least 1/(n·k^(d-1)), with the depth `d`.
//!
//! A run is determined by its seed, and returns the choices by which [`Vm::follow`] repeats it.
//!
//! Source: Burckhardt, Kothari, Musuvathi and Nagarakatte 2010, "A randomized scheduler with probabilistic
//! guarantees of finding bugs". We differ in that a run that has taken many more steps than were expected
//! goes on fairly, so that loops which wait for other tasks end.

use std::collections::HashMap;

use super::Settings;
use super::follow::explore_by;
use super::point::PointRun;
use super::step::{Runnable, TellStep, tell_step, tell_uses};
use super::tasks::watch_variables;
use crate::run::RunOutcome;
use crate::task::TaskNumber;
use crate::vm::Vm;

/// A random schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RandomSchedule {
    /// The seed.
    pub seed: u64,
    /// Number of steps whose order matters, at least 1.
    pub depth: u32,
    /// Number of steps among which priorities change: those of a run.
    pub steps: u64,
}

/// A run by a random schedule.
#[derive(Clone, Debug)]
pub struct RandomRun {
    /// Way in which the run ended; `None` if it was given up after very many steps.
    pub outcome: Option<RunOutcome>,
    /// The choices, as for [`Vm::follow`].
    pub choices: Vec<u32>,
    /// Number of steps, from point to point.
    pub steps: u64,
    /// Number of tasks.
    pub tasks: usize,
}

/// Steps after which a run goes on fairly, as a multiple of those expected, and at least.
const FAIR_AFTER: (u64, u64) = (4, 10_000);

/// Steps after which a run is given up.
const MOST_STEPS: u64 = 2_000_000;

/// Key of the passing of time, beside those of tasks.
const TIMER: TaskNumber = TaskNumber(u64::MAX - 1);

/// A source of numbers that are spread evenly (Steele, Lea and Flood 2014, `splitmix64`).
struct EvenNumbers(u64);

impl EvenNumbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end.max(1)
    }
}

/// The priorities of the tasks of a run.
struct Priorities {
    numbers: EvenNumbers,
    /// Priorities by task. Those below [`Priorities::LOWERED`] were given at a change, the earliest change
    /// the highest.
    of: HashMap<TaskNumber, u64>,
    /// Steps at which priorities change.
    changes: Vec<u64>,
    /// Number of changes so far.
    changed: u64,
    fair_after: u64,
}

impl Priorities {
    /// A bound above the priorities given at changes.
    const LOWERED: u64 = 1 << 32;

    fn new(schedule: RandomSchedule) -> Priorities {
        let mut numbers = EvenNumbers(schedule.seed);
        let changes = (1..schedule.depth).map(|_| 1 + numbers.below(schedule.steps)).collect();
        let fair_after = schedule.steps.saturating_mul(FAIR_AFTER.0).max(FAIR_AFTER.1);
        Priorities { numbers, of: HashMap::new(), changes, changed: 0, fair_after }
    }

    /// Returns the choice at a step: the one with the highest priority.
    fn choose(&mut self, step: u64, alternatives: &[TaskNumber]) -> u32 {
        if step > self.fair_after {
            return self.numbers.below(alternatives.len() as u64) as u32;
        }
        for &task in alternatives {
            let numbers = &mut self.numbers;
            self.of.entry(task).or_insert_with(|| numbers.next() | Priorities::LOWERED);
        }
        for _ in 0..self.changes.iter().filter(|&&change| change == step).count() {
            let highest = alternatives[self.highest(alternatives)];
            self.changed += 1;
            self.of.insert(highest, Priorities::LOWERED - 1 - self.changed);
        }
        self.highest(alternatives) as u32
    }

    fn highest(&self, alternatives: &[TaskNumber]) -> usize {
        let priority = |at: &usize| self.of.get(&alternatives[*at]);
        (0..alternatives.len()).max_by_key(priority).unwrap_or(0)
    }
}

impl Vm {
    /// Runs the program by a random schedule. `told`, if there is one, is told of the steps of tasks, and of
    /// their uses of places that others may reach.
    pub fn run_randomly(
        &mut self,
        settings: &Settings,
        schedule: RandomSchedule,
        mut told: Option<&mut TellStep<'_>>,
    ) -> RandomRun {
        explore_by(self, settings);
        self.scheduler.points.uses = told.is_some().then(Vec::new);
        self.scheduler.points.objects.clear();
        let mut watched = 0;
        let mut priorities = Priorities::new(schedule);
        let mut found = RandomRun { outcome: None, choices: Vec::new(), steps: 0, tasks: 0 };
        let mut seen = std::collections::HashSet::new();
        let numbers = &mut priorities.numbers;
        let aborts: Vec<u64> = (0..settings.aborts).map(|_| 1 + numbers.below(schedule.steps)).collect();
        let mut run = PointRun::begin(self, settings);
        found.outcome = run.go_on(self, u64::MAX, None, &mut |vm: &mut Vm, _, runnable: Runnable<'_>| {
            found.steps += 1;
            if found.steps > MOST_STEPS {
                return None;
            }
            if let Some(told) = &mut told {
                tell_uses(vm, *told);
                if watched != vm.names.symbol_count() {
                    watch_variables(vm);
                    watched = vm.names.symbol_count();
                }
            }
            let number = |index| vm.scheduler.tasks.at(index).map_or(TaskNumber::NONE, |task| task.number);
            let mut alternatives: Vec<TaskNumber> =
                runnable.tasks.iter().map(|&index| number(index)).collect();
            seen.extend(alternatives.iter().copied());
            if runnable.has_timer {
                alternatives.push(TIMER);
            }
            let choice = match runnable.ways {
                Some(ways) => priorities.numbers.below(u64::from(ways)) as u32,
                None if !runnable.aborts.is_empty() && aborts.contains(&found.steps) => {
                    alternatives.len() as u32 + priorities.numbers.below(runnable.aborts.len() as u64) as u32
                }
                None => priorities.choose(found.steps, &alternatives),
            };
            if runnable.count() > 1 {
                found.choices.push(choice);
            }
            if let (None, Some(&index), Some(told)) =
                (runnable.ways, runnable.tasks.get(choice as usize), &mut told)
            {
                tell_step(vm, index, *told);
            }
            Some(choice)
        });
        if let Some(told) = told {
            tell_uses(self, told);
        }
        self.scheduler.points.uses = None;
        found.tasks = seen.len();
        self.end_following();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(schedule: RandomSchedule, tasks: &[TaskNumber], steps: u64) -> Vec<u32> {
        let mut priorities = Priorities::new(schedule);
        (1..=steps).map(|step| priorities.choose(step, tasks)).collect()
    }

    #[test]
    fn a_task_keeps_its_turn_up_to_a_change() {
        let tasks = [TaskNumber(1), TaskNumber(2), TaskNumber(3)];
        let mut first = [0; 3];
        for seed in 0..300 {
            let alone = order(RandomSchedule { seed, depth: 1, steps: 10 }, &tasks, 10);
            assert!(alone.iter().all(|choice| *choice == alone[0]), "{alone:?}");
            first[alone[0] as usize] += 1;
            let changed = order(RandomSchedule { seed, depth: 3, steps: 10 }, &tasks, 10);
            let switches = changed.windows(2).filter(|pair| pair[0] != pair[1]).count();
            assert!(switches <= 2, "{changed:?}");
        }
        assert!(first.iter().all(|count| *count > 60), "{first:?}");
    }

    #[test]
    fn a_long_run_is_fair() {
        let tasks = [TaskNumber(1), TaskNumber(2)];
        let choices = order(RandomSchedule { seed: 1, depth: 1, steps: 5 }, &tasks, 12_000);
        assert!(choices[10_500..].contains(&0) && choices[10_500..].contains(&1));
    }
}
