//! Exploring the schedules of a program: in which ways it can end, and which choices lead to each.
//!
//! [`esl_vm::explore`] says what is explored.
//!
//! ```
//! use esl_testing::explore::{Settings, explore};
//! use esl::program::{Source, compile};
//!
//! // Both look for the fact before either asserts it.
//! let text = "(dotimes (i 2)
//!               (spawn (unless (db-query '(door open))
//!                        (assert '(door open))
//!                        (princ \"creak \"))))";
//! let program = compile(&[Source::new("door.esl", text)]).program.expect("it compiles");
//! let found = explore(&program, &Settings::default())?;
//! let mut outputs: Vec<&str> = found.endings.iter().map(|ending| &*ending.what.output).collect();
//! outputs.sort();
//! assert_eq!(outputs, ["creak ", "creak creak "]);
//! # Ok::<(), esl::Error>(())
//! ```

mod forms;
mod late;
mod library;
mod named;
mod orders;
mod random;
mod unseen;
mod verdict;

use esl::Error;
use esl::program::{self, Ended, Program};
use esl_host::{Captured, VirtualHost};
pub use esl_vm::explore::{
    Exploration, ExploredEnding, Fairness, Grain, Livelock, ScheduleEvent, ScheduleStep, SearchLimit,
    SearchProgress, Settings, StandingTask, Switch, TellStep, TimerGrain, UnmetCondition,
};
use esl_vm::task::TaskId;
use esl_vm::vm::{Config, Vm};
pub use forms::SourceForms;
pub use library::function_symbol;
pub use orders::SeenOrders;
pub use random::{RandomFound, RandomSettings, explore_randomly};
pub use unseen::{UnseenChange, UnseenKind, counts_signals, reads_clock, reads_column, unseen_changes};
pub use verdict::{ExplorationScope, grains};

/// A run as it is seen from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Behaviour {
    /// Way in which the run ended.
    pub ended: Ended,
    /// Text written to standard output.
    pub output: String,
    /// Text written to standard error.
    pub errors: String,
}

/// Prepares each machine before the program is loaded.
pub type Prepare<'a> = &'a (dyn Fn(&mut Vm) -> Result<(), Error> + Sync);

/// Returns a machine that is about to run a program, its main task, and its outputs.
fn begin(program: &Program, prepare: Prepare<'_>, snapshots: bool) -> Result<(Vm, TaskId, Captured), Error> {
    let host = VirtualHost::new();
    let captured = host.captured();
    let mut machine = program::machine(Config { snapshots, ..Config::default() }, Box::new(host))?;
    prepare(&mut machine)?;
    let main = program::begin(&mut machine, program)?;
    Ok((machine, main, captured))
}

/// Runs a program under all schedules.
///
/// # Errors
/// As [`program::run`].
pub fn explore(program: &Program, settings: &Settings) -> Result<Exploration<Behaviour>, Error> {
    explore_with(program, settings, &|_| Ok(()))
}

/// Runs a program under all schedules, on machines that `prepare` has changed before they load the program.
///
/// # Errors
/// As [`program::run`], and the errors of `prepare`.
pub fn explore_with(
    program: &Program,
    settings: &Settings,
    prepare: Prepare<'_>,
) -> Result<Exploration<Behaviour>, Error> {
    explore_together(program, settings, 1, prepare, |_| true)
}

/// Returns the settings with which the states of a program differ by all that it may know.
pub(crate) fn states_of(program: &Program, settings: &Settings) -> Settings {
    Settings {
        clock: settings.clock || reads_clock(program),
        counts: settings.counts || counts_signals(program),
        columns: settings.columns || reads_column(program),
        ..*settings
    }
}

/// As [`explore_with`], in so many threads, which find the same as one, and for as long as `goes_on`, which
/// is asked now and then.
///
/// # Errors
/// As [`explore_with`].
pub fn explore_together(
    program: &Program,
    settings: &Settings,
    jobs: usize,
    prepare: Prepare<'_>,
    goes_on: impl FnMut(&SearchProgress) -> bool,
) -> Result<Exploration<Behaviour>, Error> {
    let settings = &states_of(program, settings);
    let begin = || {
        let (machine, main, captured) = begin(program, prepare, settings.snapshots)?;
        Ok((machine, (main, captured)))
    };
    let judge = |machine: &mut Vm, (main, captured): &(TaskId, Captured), outcome| {
        let ended = program::end(machine, *main, outcome);
        Behaviour { ended, output: captured.output(), errors: captured.error() }
    };
    esl_vm::explore::explore_together(settings, (jobs, &side_by_side), begin, judge, goes_on)
}

/// Calls functions in threads of their own and the last one in this thread, and waits for all of them.
fn side_by_side(others: Vec<Box<dyn FnOnce() + Send + '_>>, own: &mut dyn FnMut()) {
    std::thread::scope(|scope| {
        for other in others {
            scope.spawn(other);
        }
        own();
    });
}

/// Runs a program by a list of choices that [`explore`] has found with the same settings.
///
/// # Errors
/// As [`program::run`].
pub fn follow(program: &Program, settings: &Settings, choices: &[u32]) -> Result<Behaviour, Error> {
    follow_with(program, settings, choices, &|_| Ok(()))
}

/// Returns the name of a condition of `eventually` or `leads-to` that a schedule never meets.
///
/// # Errors
/// As [`program::run`], and the errors of `prepare`.
pub fn name_of_condition(
    program: &Program,
    settings: &Settings,
    unmet: &UnmetCondition,
    prepare: Prepare<'_>,
) -> Result<String, Error> {
    let (mut machine, ..) = begin(program, prepare, false)?;
    machine.follow_to(settings, &unmet.schedule.choices, &mut |_| {});
    Ok(machine.name_of_condition(unmet.condition).unwrap_or_else(|| "a condition".into()))
}

/// Returns the choices of an ending with as few as possible of those taken away that are not the first one:
/// an order of tasks that does not matter is left as it is without them.
///
/// # Errors
/// As [`program::run`], and the errors of `prepare`.
pub fn shortest(
    program: &Program,
    settings: &Settings,
    choices: &[u32],
    prepare: Prepare<'_>,
) -> Result<Vec<u32>, Error> {
    shortest_by(choices, &mut |choices| {
        let Behaviour { ended, errors, .. } = follow_with(program, settings, choices, prepare)?;
        Ok((ended, errors))
    })
}

/// Returns choices with as few as possible of those that are not the first one, without which a run along
/// them ends as before, as `end` describes it.
///
/// # Errors
/// Those of `end`.
pub(crate) fn shortest_by<T: PartialEq, E>(
    choices: &[u32],
    end: &mut dyn FnMut(&[u32]) -> Result<T, E>,
) -> Result<Vec<u32>, E> {
    let wanted = end(choices)?;
    let mut best = choices.to_vec();
    let mut runs = 0;
    let mut at = best.len();
    while at > 0 && runs < MOST_TRIALS {
        at -= 1;
        if best[at] == 0 {
            continue;
        }
        let without = |rest: &[u32]| [&best[..at], &[0], rest].concat();
        let shorter = [without(&[]), without(&best[at + 1..])];
        for candidate in shorter {
            runs += 1;
            if end(&candidate)? == wanted {
                best = candidate;
                break;
            }
        }
    }
    while best.last() == Some(&0) {
        best.pop();
    }
    Ok(best)
}

/// Runs that are made to shorten a schedule, at most.
const MOST_TRIALS: usize = 200;

/// As [`follow`], on a machine that `prepare` has changed.
///
/// # Errors
/// As [`program::run`], and the errors of `prepare`.
pub fn follow_with(
    program: &Program,
    settings: &Settings,
    choices: &[u32],
    prepare: Prepare<'_>,
) -> Result<Behaviour, Error> {
    let (mut machine, main, captured) = begin(program, prepare, false)?;
    let outcome = machine.follow(settings, choices);
    let ended = program::end(&mut machine, main, outcome);
    Ok(Behaviour { ended, output: captured.output(), errors: captured.error() })
}

/// Follows a list of choices, on a machine that `prepare` has changed, to the end of the run if `ends`, else
/// to the last of them. `told` is told of each choice that is not the first one, just before it is made, and
/// of each use of a place that tasks may share, after it.
///
/// # Errors
/// As [`program::run`], and the errors of `prepare`.
pub fn tell_steps(
    program: &Program,
    settings: &Settings,
    choices: &[u32],
    ends: bool,
    prepare: Prepare<'_>,
    told: &mut TellStep<'_>,
) -> Result<(), Error> {
    let (mut machine, ..) = begin(program, prepare, false)?;
    if ends {
        machine.follow_and_tell(settings, choices, told);
    } else {
        machine.follow_to(settings, choices, told);
    }
    Ok(())
}
