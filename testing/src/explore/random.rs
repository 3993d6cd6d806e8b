//! Random schedules of a program, when there are too many to try all.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use esl::Error;
use esl::program::{self, Program};
use esl_vm::explore::{ExploredEnding, RandomSchedule, Settings};

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
}

/// The result of random schedules.
#[derive(Clone, Debug)]
pub struct RandomFound {
    /// The ways of ending, that of the lowest seed first. `choices` are those of that seed.
    pub endings: Vec<ExploredEnding<Behaviour>>,
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
}

impl RandomFound {
    /// Returns the least probability with which one schedule shows a fault of this depth: 1/(n·k^(depth-1)),
    /// with `n` tasks and `k` steps.
    pub fn least_probability(&self, depth: u32) -> f64 {
        let (tasks, steps) = (self.tasks.max(1) as f64, self.steps.max(self.assumed_steps).max(1) as f64);
        1.0 / (tasks * steps.powi(depth.saturating_sub(1) as i32))
    }
}

/// A run of one seed.
struct SeededRun {
    seed: u64,
    behaviour: Option<Behaviour>,
    choices: Vec<u32>,
    steps: u64,
    tasks: usize,
}

/// Runs a program by random schedules, on machines that `prepare` has changed, for as long as `goes_on`,
/// which is asked before each run. Schedules are tried in the order of their seeds.
///
/// # Errors
/// As [`program::run`], and the errors of `prepare`.
pub fn explore_randomly(
    program: &Program,
    settings: &Settings,
    random: RandomSettings,
    prepare: Prepare<'_>,
    goes_on: &(dyn Fn(u64) -> bool + Sync),
) -> Result<RandomFound, Error> {
    let settings = &states_of(program, settings);
    let run = |seed: u64, steps: u64| -> Result<SeededRun, Error> {
        let (mut machine, main, captured) = begin(program, prepare, false)?;
        let schedule = RandomSchedule { seed, depth: random.depth.max(1), steps };
        let found = machine.run_randomly(settings, schedule);
        let behaviour = found.outcome.map(|outcome| {
            let ended = program::end(&mut machine, main, outcome);
            Behaviour { ended, output: captured.output(), errors: captured.error() }
        });
        Ok(SeededRun { seed, behaviour, choices: found.choices, steps: found.steps, tasks: found.tasks })
    };
    // The length of a run is that of one without changes of priorities, so that a seed means the same
    // schedule in whatever series it is.
    let assumed_steps = run(0, 1)?.steps.max(1);
    let end = random.seed.saturating_add(random.count);
    let next = AtomicU64::new(random.seed);
    let runs: Mutex<Vec<SeededRun>> = Mutex::default();
    let failed: Mutex<Option<Error>> = Mutex::default();
    std::thread::scope(|scope| {
        for _ in 0..random.jobs.max(1) {
            scope.spawn(|| {
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    let is_stopped = failed.lock().unwrap_or_else(PoisonError::into_inner).is_some();
                    if seed >= end || is_stopped || !goes_on(seed - random.seed) {
                        return;
                    }
                    match run(seed, assumed_steps) {
                        Ok(run) => runs.lock().unwrap_or_else(PoisonError::into_inner).push(run),
                        Err(error) => *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error),
                    }
                }
            });
        }
    });
    if let Some(error) = failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    let mut runs = runs.into_inner().unwrap_or_else(PoisonError::into_inner);
    runs.sort_by_key(|run| run.seed);
    // When time is over, a thread may have left out a seed that another one is past.
    let whole = runs.iter().zip(random.seed..).take_while(|(run, seed)| run.seed == *seed).count();
    runs.truncate(whole);
    let mut found = RandomFound {
        endings: Vec::new(),
        runs: whole as u64,
        endless: 0,
        tasks: 0,
        steps: 0,
        assumed_steps,
    };
    for run in runs {
        found.tasks = found.tasks.max(run.tasks);
        found.steps = found.steps.max(run.steps);
        let Some(behaviour) = run.behaviour else {
            found.endless += 1;
            continue;
        };
        match found.endings.iter_mut().find(|ending| ending.what == behaviour) {
            Some(ending) => ending.runs += 1,
            None => found.endings.push(ExploredEnding { what: behaviour, choices: run.choices, runs: 1 }),
        }
    }
    Ok(found)
}
