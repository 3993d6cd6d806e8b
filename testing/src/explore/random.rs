//! Random schedules of a program, when there are too many to try all.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use esl::Error;
use esl::program::{self, Program};
use esl_vm::explore::{ExploredEnding, RandomSchedule, ScheduleStep, Settings};

use super::orders::{RunOrders, SeenOrders};
use super::{Behaviour, Prepare, begin, states_of};

/// The random schedules to try.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RandomSettings {
    /// Number of schedules.
    pub count: u64,
    /// Seed of the first one; the next ones have the next seeds.
    pub seed: u64,
    /// Number of steps whose order matters in the faults that are looked for, at least 1.
    pub depth: u32,
    /// Number of threads. The findings do not depend on it.
    pub jobs: usize,
    /// Whether the orders of places are noted; the program was compiled with points then.
    pub covers: bool,
}

/// The result of random schedules.
#[derive(Clone, Debug, Default)]
pub struct RandomFound {
    /// The ways of ending, that of the lowest seed first. `choices` and output are those of that seed.
    pub endings: Vec<ExploredEnding<Behaviour>>,
    /// The lowest seed of each way of ending.
    pub seeds: Vec<u64>,
    /// Number of schedules that were tried.
    pub runs: u64,
    /// Number of those that did not end within very many steps.
    pub endless: u64,
    /// Number of tasks, and of steps, of the longest run.
    pub tasks: usize,
    /// See [`RandomFound::tasks`].
    pub steps: u64,
    /// The number of steps among which priorities changed.
    pub assumed_steps: u64,
    /// The orders of places, if they were noted.
    pub orders: SeenOrders,
}

impl RandomFound {
    /// Returns the least probability with which one schedule shows a fault of this depth: 1/(n·k^(depth-1)),
    /// with `n` tasks and `k` steps.
    pub fn least_probability(&self, depth: u32) -> f64 {
        let (tasks, steps) = (self.tasks.max(1) as f64, self.steps.max(self.assumed_steps).max(1) as f64);
        1.0 / (tasks * steps.powi(depth.saturating_sub(1) as i32))
    }

    /// Adds a way of ending. Runs that differ only in what they had printed before end in the same way.
    fn end(&mut self, seed: u64, behaviour: Behaviour, choices: Vec<u32>, runs: usize) {
        let is_same = |what: &Behaviour| (&what.ended, &what.errors) == (&behaviour.ended, &behaviour.errors);
        match self.endings.iter_mut().find(|ending| is_same(&ending.what)) {
            Some(ending) => ending.runs += runs,
            None => {
                self.endings.push(ExploredEnding { what: behaviour, choices, runs });
                self.seeds.push(seed);
            }
        }
    }

    /// Adds the run of the next seed.
    fn add(&mut self, seed: u64, run: SeededRun) {
        self.runs += 1;
        self.tasks = self.tasks.max(run.tasks);
        self.steps = self.steps.max(run.steps);
        self.orders.add_run(&run.orders);
        match run.behaviour {
            Some(behaviour) => self.end(seed, behaviour, run.choices, 1),
            None => self.endless += 1,
        }
    }
}

/// A run of one seed.
struct SeededRun {
    behaviour: Option<Behaviour>,
    choices: Vec<u32>,
    steps: u64,
    tasks: usize,
    orders: RunOrders,
}

/// Runs that have ended, in the order of their seeds as far as these are without gaps.
struct InOrder {
    found: RandomFound,
    /// Runs of later seeds than the next one.
    later: BTreeMap<u64, SeededRun>,
}

/// Runs a program by random schedules, on machines that `prepare` has changed, for as long as `goes_on`,
/// which is asked before each run and gets what was found so far. Schedules are tried in the order of their
/// seeds; after those of `begun`, which an earlier series with the same settings has found: of its endings,
/// `choices` and behaviour may be empty.
///
/// # Errors
/// As [`program::run`], and the errors of `prepare`.
pub fn explore_randomly(
    program: &Program,
    settings: &Settings,
    random: RandomSettings,
    begun: RandomFound,
    prepare: Prepare<'_>,
    goes_on: &(dyn Fn(&RandomFound) -> bool + Sync),
) -> Result<RandomFound, Error> {
    let settings = &states_of(program, settings);
    let run = |seed: u64, steps: u64| -> Result<SeededRun, Error> {
        let (mut machine, main, captured) = begin(program, prepare, false)?;
        let schedule = RandomSchedule { seed, depth: random.depth.max(1), steps };
        let mut orders = RunOrders::default();
        let mut see = |step: ScheduleStep| orders.see(step);
        let found = machine.run_randomly(settings, schedule, random.covers.then_some(&mut see));
        let behaviour = found.outcome.map(|outcome| {
            let ended = program::end(&mut machine, main, outcome);
            Behaviour { ended, output: captured.output(), errors: captured.error() }
        });
        Ok(SeededRun { behaviour, choices: found.choices, steps: found.steps, tasks: found.tasks, orders })
    };
    // The length of a run is that of one without changes of priorities, so that a seed means the same
    // schedule in whatever series it is.
    let assumed_steps = run(0, 1)?.steps.max(1);
    let mut found = RandomFound { assumed_steps, endings: Vec::new(), seeds: Vec::new(), ..begun };
    for (ending, seed) in begun.endings.into_iter().zip(begun.seeds) {
        let again = run(seed, assumed_steps)?;
        if let Some(behaviour) = again.behaviour {
            found.end(seed, behaviour, again.choices, ending.runs);
        }
    }
    let first = random.seed.saturating_add(found.runs);
    let end = random.seed.saturating_add(random.count);
    let next = AtomicU64::new(first);
    let in_order = Mutex::new(InOrder { found, later: BTreeMap::new() });
    let failed: Mutex<Option<Error>> = Mutex::default();
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..random.jobs.max(1) {
            scope.spawn(|| {
                loop {
                    {
                        let in_order = in_order.lock().unwrap_or_else(PoisonError::into_inner);
                        if is_over.load(Ordering::Relaxed) || !goes_on(&in_order.found) {
                            is_over.store(true, Ordering::Relaxed);
                            return;
                        }
                    }
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= end {
                        return;
                    }
                    match run(seed, assumed_steps) {
                        Ok(run) => {
                            let InOrder { found, later } =
                                &mut *in_order.lock().unwrap_or_else(PoisonError::into_inner);
                            later.insert(seed, run);
                            while let Some(run) = later.remove(&random.seed.saturating_add(found.runs)) {
                                found.add(random.seed.saturating_add(found.runs), run);
                            }
                        }
                        Err(error) => {
                            *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                            is_over.store(true, Ordering::Relaxed);
                            return;
                        }
                    }
                }
            });
        }
    });
    match failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(error) => Err(error),
        None => Ok(in_order.into_inner().unwrap_or_else(PoisonError::into_inner).found),
    }
}
