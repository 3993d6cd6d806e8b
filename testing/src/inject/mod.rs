//! Fault injection: a test or a program is run with each fault that the outside may show, and each run is
//! compared with the undisturbed one.
//!
//! An undisturbed run lists the calls of operations. For each operation, each way in which it can fail and a
//! number of its calls, the run is made again with that call disturbed: it fails, never answers, answers
//! late, or its task is aborted. Time is virtual, and a run with the same seed is the same up to its first
//! fault, so the name of a fault is enough to repeat a run.
//!
//! Operations are mocks (`define-mock`) and calls that the scripts of worlds answer: the outside of these
//! runs is simulated, as in an exploration. The library notes and disturbs calls (`stdlib/injection.esl`).
//!
//! Guarantees: rows come in one order, whatever the number of threads. Not here: finding the ways in which an
//! operation can fail without running it, which is up to the caller; printing.
//!
//! ```
//! use esl::program::{Source, compile};
//! use esl_testing::Setup;
//! use esl_testing::inject::{FaultOutcome, InjectSettings, InjectionSubject, inject};
//!
//! let text = "(define-mock measure () 7)
//!             (deftest measuring (is (eql (measure) 7)))";
//! let program = compile(&[Source::new("measure.esl", text)]).program.expect("it compiles");
//! let setup = Setup::default();
//! let subject = InjectionSubject { program: &program, test: Some("MEASURING"), seed: 0, setup: &setup };
//! let report = inject(&subject, &Default::default(), &InjectSettings::default(), &|_, _| ())?;
//! let never = report.rows.iter().find(|row| row.name == "measure#1:never").expect("it is tried");
//! assert_eq!(never.outcome, FaultOutcome::Deadlocks);
//! # Ok::<(), esl::Error>(())
//! ```

mod fault;
mod outcome;
mod properties;
mod run;
mod table;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use esl::Error;
use esl::program::Program;
use esl_bytecode::symbol::Symbol;

pub use fault::{FaultWay, InjectedFault};
pub use outcome::FaultOutcome;
pub use run::{InjectedRun, NotedCall};
pub use table::{InjectFormat, InjectionSummary, render, summary};

use crate::Setup;
use fault::{FailureWays, faults, pairs};
use outcome::{judge, problem};
use run::{Runs, counts};

/// Causes with which operations can fail, such as `:timeout`, by the names of these in lower case.
pub type KnownFailures = BTreeMap<String, Vec<Symbol>>;

/// A test, or a whole program, to be run with faults.
#[derive(Clone, Copy, Debug)]
pub struct InjectionSubject<'a> {
    /// Program.
    pub program: &'a Program,
    /// Name of the test; `None` for the program itself.
    pub test: Option<&'a str>,
    /// Seed of its runs.
    pub seed: u64,
    /// Limits, rights, and folders of modules.
    pub setup: &'a Setup,
}

/// Settings of an injection.
#[derive(Clone, Debug, PartialEq)]
pub struct InjectSettings {
    /// Most calls of an operation that are disturbed: the first, the last, and others evenly between.
    pub calls: usize,
    /// Factor by which a run may take longer than the undisturbed one; see [`RunBound`]. The undisturbed
    /// one may take a million ticks and a million virtual seconds for each unit.
    pub patience: f64,
    /// Most pairs of faults that are injected together; 0 for none.
    pub pairs: usize,
    /// Name of the only row that is tried.
    pub only: Option<String>,
    /// Runs with other seeds that show the arguments of failures.
    pub seeds: u64,
    /// Threads.
    pub jobs: usize,
}

impl Default for InjectSettings {
    fn default() -> InjectSettings {
        InjectSettings { calls: 5, patience: 10.0, pairs: 0, only: None, seeds: 4, jobs: 1 }
    }
}

/// Bound of a run: one that takes longer hangs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunBound {
    /// Virtual seconds: an hour, and the factor times those of the undisturbed run.
    pub seconds: f64,
    /// Ticks: two million, and the factor times those of the undisturbed run.
    pub ticks: u64,
}

impl RunBound {
    /// Bound of an undisturbed run, for each unit of patience: with ten, four months of virtual time.
    const UNDISTURBED: RunBound = RunBound { seconds: 1e6, ticks: 1_000_000 };

    fn of_undisturbed(factor: f64) -> RunBound {
        RunBound {
            seconds: RunBound::UNDISTURBED.seconds * factor,
            ticks: (RunBound::UNDISTURBED.ticks as f64 * factor) as u64,
        }
    }

    fn new(undisturbed: &InjectedRun, factor: f64) -> RunBound {
        RunBound {
            seconds: 3600.0 + undisturbed.seconds * factor,
            ticks: (undisturbed.ticks as f64 * factor) as u64 + 2_000_000,
        }
    }
}

/// A run with one fault or two.
#[derive(Clone, Debug)]
pub struct InjectedRow {
    /// Name by which it can be repeated, such as `slew#3:wheel-stuck`; two of them with a `/` between.
    pub name: String,
    /// The faults.
    pub faults: Vec<InjectedFault>,
    /// Time of the first disturbed call in the undisturbed run, in seconds.
    pub at: f64,
    /// The task that makes this call.
    pub task: String,
    /// Outcome.
    pub outcome: FaultOutcome,
    /// Details in a few words.
    pub detail: String,
    /// Output and reports of the run, if it was the only one.
    pub text: Option<String>,
}

/// The runs of a subject.
#[derive(Clone, Debug)]
pub struct InjectionReport {
    /// Name of the test; `None` for the program itself.
    pub test: Option<String>,
    /// Seed.
    pub seed: u64,
    /// Reason for which the undisturbed run cannot be compared with.
    pub problem: Option<String>,
    /// Virtual seconds of the undisturbed run.
    pub seconds: f64,
    /// Number of calls of each operation in it.
    pub calls: BTreeMap<String, usize>,
    /// Number of calls that were disturbed.
    pub tried: usize,
    /// Bound of the runs.
    pub bound: RunBound,
    /// The runs.
    pub rows: Vec<InjectedRow>,
    /// Number of pairs that were not tried.
    pub pairs_left: usize,
}

/// Runs a subject undisturbed, and then with each fault. `progress` is told of the runs made, and of all.
///
/// # Errors
/// [`Error::NoMemory`] or [`Error::Refused`], if a run cannot be begun.
pub fn inject(
    subject: &InjectionSubject<'_>,
    known: &KnownFailures,
    settings: &InjectSettings,
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<InjectionReport, Error> {
    let is_test = subject.test.is_some();
    let longest = RunBound::of_undisturbed(settings.patience);
    let undisturbed = Runs::new(subject, subject.seed).run(&[], longest, true)?;
    let bound = RunBound::new(&undisturbed, settings.patience);
    let mut report = InjectionReport {
        test: subject.test.map(String::from),
        seed: subject.seed,
        problem: problem(&undisturbed, is_test),
        seconds: undisturbed.seconds,
        calls: counts(&undisturbed.calls),
        tried: 0,
        bound,
        rows: Vec::new(),
        pairs_left: 0,
    };
    if report.problem.is_some() || undisturbed.calls.is_empty() {
        return Ok(report);
    }
    let mut ways = FailureWays::default();
    ways.add_run(&undisturbed);
    for seed in (0..=settings.seeds).filter(|seed| *seed != subject.seed).take(settings.seeds as usize) {
        ways.add_run(&Runs::new(subject, seed).run(&[], bound, false)?);
    }
    ways.add_known(known);
    let (single, tried) = faults(&undisturbed.calls, &ways, settings);
    report.tried = tried;
    let wanted = match &settings.only {
        Some(only) => {
            // The second of two faults may disturb an operation that only a run with the first one calls.
            if named(only, settings, &undisturbed, &ways).is_empty() {
                for (first, _) in halves(only) {
                    if let Some(fault) = named(first, settings, &undisturbed, &ways).first() {
                        ways.note_operations(&Runs::new(subject, subject.seed).run(fault, bound, false)?);
                    }
                }
            }
            named(only, settings, &undisturbed, &ways)
        }
        None => single.iter().map(|fault| vec![fault.clone()]).collect(),
    };
    let run =
        |wanted: &[Vec<InjectedFault>]| run_all(subject, settings, &undisturbed, bound, wanted, progress);
    let (rows, remedies) = run(&wanted)?;
    report.rows = rows;
    if settings.pairs > 0 {
        let (two, count) = pairs(&single, &remedies, &ways, settings.pairs);
        report.pairs_left = count - two.len();
        report.rows.extend(run(&two)?.0);
    }
    Ok(report)
}

/// The calls that a run with one fault makes beyond the undisturbed ones: the first of each operation.
type Remedies = Vec<(InjectedFault, NotedCall)>;

/// Returns the faults that a name says: one, or two with a `/` between. Any call may be named.
fn named(
    name: &str,
    settings: &InjectSettings,
    undisturbed: &InjectedRun,
    ways: &FailureWays,
) -> Vec<Vec<InjectedFault>> {
    let every = InjectSettings { calls: usize::MAX, ..settings.clone() };
    let (all, _) = faults(&undisturbed.calls, ways, &every);
    let one = |part: &str| InjectedFault::named(part.trim(), &all, ways);
    let two = || halves(name).find_map(|(first, second)| Some(vec![one(first)?, one(second)?]));
    one(name).map(|fault| vec![fault]).or_else(two).into_iter().collect()
}

/// Returns the halves of a text at each `/`: one may be in the name of an operation or a cause.
fn halves(text: &str) -> impl Iterator<Item = (&str, &str)> {
    text.match_indices('/').map(|(place, _)| (&text[..place], &text[place + 1..]))
}

/// Makes the runs, several at a time, and returns their rows in the order of `wanted`.
fn run_all(
    subject: &InjectionSubject<'_>,
    settings: &InjectSettings,
    undisturbed: &InjectedRun,
    bound: RunBound,
    wanted: &[Vec<InjectedFault>],
    progress: &(dyn Fn(usize, usize) + Sync),
) -> Result<(Vec<InjectedRow>, Remedies), Error> {
    let next = AtomicUsize::new(0);
    let done = AtomicUsize::new(0);
    let rows: Mutex<Vec<Option<(InjectedRow, Remedies)>>> = Mutex::new(vec![None; wanted.len()]);
    let error: Mutex<Option<Error>> = Mutex::new(None);
    let work = || {
        let mut runs = Runs::new(subject, subject.seed);
        while let Some(faults) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) {
            let place = wanted.iter().position(|other| std::ptr::eq(other, faults)).unwrap_or_default();
            match runs.run(faults, bound, false) {
                Ok(run) => {
                    let row = row(faults, &run, undisturbed, bound, subject, settings);
                    let row = (row, remedies(faults, &run, undisturbed));
                    rows.lock().unwrap_or_else(PoisonError::into_inner)[place] = Some(row);
                }
                Err(found) => {
                    *error.lock().unwrap_or_else(PoisonError::into_inner) = Some(found);
                    next.store(wanted.len(), Ordering::Relaxed);
                }
            }
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, wanted.len());
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..settings.jobs.clamp(1, wanted.len().max(1)) {
            scope.spawn(work);
        }
    });
    match error.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(error) => Err(error),
        None => {
            let rows = rows.into_inner().unwrap_or_else(PoisonError::into_inner);
            let (rows, remedies): (Vec<_>, Vec<_>) = rows.into_iter().flatten().unzip();
            Ok((rows, remedies.into_iter().flatten().collect()))
        }
    }
}

/// Returns the first call of each operation that a run with one fault makes beyond those of the undisturbed
/// run.
fn remedies(faults: &[InjectedFault], run: &InjectedRun, undisturbed: &InjectedRun) -> Remedies {
    let [fault] = faults else { return Vec::new() };
    if fault.lasts || !matches!(fault.way, FaultWay::Fails { .. } | FaultWay::Never) {
        return Vec::new();
    }
    let known = counts(&undisturbed.calls);
    let is_first_new = |call: &&NotedCall| {
        let before = known.get(&fault::shown_operation(&call.operation)).copied().unwrap_or(0);
        call.number == before as u64 + 1
    };
    run.calls.iter().filter(is_first_new).map(|call| (fault.clone(), call.clone())).collect()
}

fn row(
    faults: &[InjectedFault],
    run: &InjectedRun,
    undisturbed: &InjectedRun,
    bound: RunBound,
    subject: &InjectionSubject<'_>,
    settings: &InjectSettings,
) -> InjectedRow {
    let names: Vec<String> = faults.iter().map(InjectedFault::to_string).collect();
    let is_of = |call: &NotedCall, fault: &InjectedFault| {
        call.operation == fault.operation && call.number == fault.call
    };
    let first = faults.first().and_then(|fault| undisturbed.calls.iter().find(|call| is_of(call, fault)));
    // Without notes of the run, it has ended for want of memory.
    let is_reached =
        run.calls.is_empty() || faults.iter().all(|fault| run.calls.iter().any(|call| is_of(call, fault)));
    let (outcome, detail) = match is_reached {
        true => judge(run, undisturbed, bound, subject.test.is_some()),
        false => (FaultOutcome::NotReached, String::new()),
    };
    InjectedRow {
        name: names.join("/"),
        faults: faults.to_vec(),
        at: first.map_or(0.0, |call| call.begun),
        task: first.map_or(String::new(), |call| call.task.clone()),
        outcome,
        detail,
        text: settings.only.is_some().then(|| format!("{}{}", run.output, run.errors)),
    }
}
