//! Running the tests of a program, each in a machine of its own: what `eslvm test` does.
//!
//! The clock of a test is virtual, and what it prints is kept, and shown if it fails.
//!
//! ```
//! use esl::program::{Source, compile};
//! use esl_testing::{Setup, Verdict, list, run_test};
//!
//! let text = "(deftest adding (is (= (+ 1 1) 2)))
//!             (deftest waiting :seeds 3 (sleep 100) (is (> (now) 200)))";
//! let program = compile(&[Source::new("sums.esl", text)]).program.expect("it compiles");
//! let setup = Setup::default();
//! let tests = list(&program, &setup)?;
//! let run = |at: usize| run_test(&program, &tests[at], 0, &setup);
//! assert_eq!(run(0)?, Verdict::Passed);
//! let Verdict::Failed { why, output } = run(1)? else { panic!() };
//! assert_eq!(why, "a check did not hold");
//! assert_eq!(output, "(> (NOW) 200) is false.\n  (NOW) is 100.0\n");
//! # Ok::<(), esl::Error>(())
//! ```
#![forbid(unsafe_code)]

pub mod coverage;
pub mod explore;

use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

use esl::Data;
use esl::Error;
use esl::module_path::ModulePath;
use esl::program::{self, Ended, Program};
use esl_bytecode::datum::Datum;
use esl_host::{Host, RealHost, Rights, VirtualHost};
use esl_vm::explore::{Exploration, Grain, Settings, TimerGrain};
use esl_vm::task::TaskId;
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use crate::coverage::Coverage;
use crate::explore::{ExplorationScope, grains};

/// Statuses with which the library's `%run-test` ends a run.
const ALL_HELD: u8 = 100;
const ONE_DID_NOT_HOLD: u8 = 101;
const NO_CHECK: u8 = 102;

/// The setup of tests.
#[derive(Clone, Debug, Default)]
pub struct Setup {
    /// Limits of each run.
    pub config: Config,
    /// Folders in which modules are found.
    pub path: ModulePath,
    /// The rights of a test.
    pub rights: Rights,
    /// Coverage of the program, which was compiled for it, if tests are to add to it.
    pub coverage: Option<Arc<Mutex<Coverage>>>,
    /// Whether reports of failures show all calls of the library.
    pub is_full: bool,
}

impl Setup {
    /// Adds what a machine has run to the coverage, if that is wanted.
    fn note_passages(&self, machine: &mut Vm) {
        if let Some(coverage) = &self.coverage {
            let passages = machine.take_passages();
            coverage.lock().unwrap_or_else(PoisonError::into_inner).add(&passages);
        }
    }
}

/// A test of a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Test {
    /// Name, as the program prints it.
    pub name: String,
    /// Number of seeds to run it with.
    pub seeds: u64,
    /// How to run it under all schedules, if that is what it is for.
    pub explores: Option<ExploreOptions>,
    /// Where its body begins, as `file:line:column`; empty if that is not known.
    pub place: String,
}

/// How to run a test under all schedules; by default as `eslvm explore` does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExploreOptions {
    /// Where points are.
    pub grain: Option<Grain>,
    /// When timers fire.
    pub timers: Option<TimerGrain>,
    /// Most states.
    pub states: Option<usize>,
}

/// The outcome of a test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// All its checks held.
    Passed,
    /// All its checks held under all schedules, as far as these words say.
    PassedAll(String),
    /// It failed.
    Failed {
        /// Why, in a few words.
        why: String,
        /// Its output, reports of failures and checks included.
        output: String,
    },
}

/// The output of a machine.
#[derive(Clone, Default)]
struct Written(Arc<Mutex<Vec<u8>>>);

impl Written {
    fn text(&self) -> String {
        String::from_utf8_lossy(&self.0.lock().unwrap_or_else(PoisonError::into_inner)).into_owned()
    }

    /// Returns a host with virtual time whose programs write here.
    fn host(&self, setup: &Setup) -> RealHost {
        let written = self.clone();
        let screen = move |bytes: &[u8]| {
            written.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
            Ok(())
        };
        let rights = setup.path.with_rights(setup.rights.clone());
        RealHost::new(Vec::new()).with_rights(rights).with_virtual_time().with_screen(Box::new(screen))
    }
}

/// Returns the tests of a program, in the order of their definitions.
///
/// # Errors
/// Those of an evaluation, if the program does not come to its end.
pub fn list(program: &Program, setup: &Setup) -> Result<Vec<Test>, Error> {
    let host = Box::new(Written::default().host(setup));
    let mut machine = program::machine(setup.config.clone(), host)?;
    program::set_module_path(&mut machine, &setup.path)?;
    let functions = program::load(&mut machine, program)?;
    let function = machine.library_function("%LIST-TESTS")?;
    let values = machine.call(function, &[functions], u64::MAX)?;
    let tests = machine.export(values.first().copied().unwrap_or(Value::NIL))?;
    let tests = Data::from_datum(&tests);
    let read = |test: &Data| match test.as_list() {
        Some([Data::String(name), Data::Integer(seeds), explores, Data::String(place)]) => Some(Test {
            name: name.clone(),
            seeds: u64::try_from(*seeds).ok()?,
            explores: explore_options(explores),
            place: place.clone(),
        }),
        _ => None,
    };
    Ok(tests.as_list().unwrap_or_default().iter().filter_map(read).collect())
}

/// Returns how a test is explored, as the library has noted it.
fn explore_options(noted: &Data) -> Option<ExploreOptions> {
    let Some([grain, timers, states]) = noted.as_list() else { return None };
    let name = |data: &Data| match data {
        Data::String(name) => Some(name.clone()),
        _ => None,
    };
    let states = match states {
        Data::Integer(states) => Some(usize::try_from(*states).unwrap_or(usize::MAX)),
        _ => None,
    };
    Some(ExploreOptions {
        grain: name(grain).and_then(|name| Grain::from_name(&name)),
        timers: name(timers).and_then(|name| TimerGrain::from_name(&name)),
        states,
    })
}

/// Returns a machine that is about to run a test, and its main task.
fn begin(
    program: &Program,
    test: &Test,
    seed: u64,
    setup: &Setup,
    host: Box<dyn Host + Send>,
) -> Result<(Vm, TaskId), Error> {
    let mut machine = program::machine(Config { seed, ..setup.config.clone() }, host)?;
    program::set_module_path(&mut machine, &setup.path)?;
    if setup.is_full {
        program::set_traces(&mut machine, &["full".into()])?;
    }
    let name = Datum::string(&test.name, Default::default());
    let main = program::begin_with(&mut machine, program, "%RUN-TEST", &[name])?;
    if setup.coverage.is_some() {
        machine.count_passages();
    }
    Ok((machine, main))
}

/// Runs a test with a seed, or under all schedules if that is what it is for.
///
/// # Errors
/// [`Error::NoMemory`] or [`Error::Refused`], if it cannot be begun.
pub fn run_test(program: &Program, test: &Test, seed: u64, setup: &Setup) -> Result<Verdict, Error> {
    if let Some(options) = test.explores {
        return explore(program, test, options, setup);
    }
    let written = Written::default();
    let (mut machine, main) = begin(program, test, seed, setup, Box::new(written.host(setup)))?;
    let outcome = machine.run(u64::MAX);
    let ended = program::end(&mut machine, main, outcome);
    program::end_rest(&mut machine);
    setup.note_passages(&mut machine);
    Ok(verdict(ended, || written.text()))
}

/// Runs a test under all schedules: at the grain that is asked for, or at those that show most.
fn explore(program: &Program, test: &Test, options: ExploreOptions, setup: &Setup) -> Result<Verdict, Error> {
    let states = options.states.unwrap_or(Settings::default().states);
    let timers = options.timers.unwrap_or_default();
    let mut verdict = Verdict::Passed;
    for grain in grains(program, options.grain) {
        let settings = Settings { grain, timers, states, output: false, ..Settings::default() };
        let found = explore_at(program, test, &settings, setup)?;
        let scope = ExplorationScope::new(program, &settings, &found);
        let failed = |why: &str, output| Verdict::Failed { why: format!("{why} ({scope})"), output };
        let badly = found.endings.into_iter().find(|ending| ending.what != Verdict::Passed);
        verdict = match badly.map(|ending| ending.what) {
            Some(Verdict::Failed { why, output }) => failed(&format!("under a schedule, {why}"), output),
            _ if found.endless.is_some() => failed("a schedule leads to where it never ends", String::new()),
            _ if found.livelock.is_some() => {
                failed("tasks can go on for ever, though each has its turns", String::new())
            }
            _ if found.limit.is_some() => {
                failed("not proved: schedules are left that were not tried", unproved(&verdict))
            }
            _ => Verdict::PassedAll(match scope.why_not_complete() {
                None => format!("all schedules, {scope}"),
                Some(why) => format!("all schedules, {scope}; not proved: {why}"),
            }),
        };
        if matches!(verdict, Verdict::Failed { .. }) {
            break;
        }
    }
    Ok(verdict)
}

/// Says of a test that is not proved at one grain what is known of it at the one before.
fn unproved(before: &Verdict) -> String {
    match before {
        Verdict::PassedAll(how) => format!(
            "before: passed, {how}\nto be content with that, say :explore (:grain variables); to try more, :states\n"
        ),
        _ => String::new(),
    }
}

/// Runs a test under all schedules, with these settings.
fn explore_at(
    program: &Program,
    test: &Test,
    settings: &Settings,
    setup: &Setup,
) -> Result<Exploration<Verdict>, Error> {
    let present = RefCell::new(None);
    let begin = || {
        let host = VirtualHost::new();
        let captured = host.captured();
        let config = Config { snapshots: true, ..setup.config.clone() };
        let setup = Setup { config, ..setup.clone() };
        let (machine, main) = begin(program, test, 0, &setup, Box::new(host))?;
        present.replace(Some((main, captured)));
        Ok::<Vm, Error>(machine)
    };
    esl_vm::explore::explore(settings, begin, |machine, outcome| {
        let present = present.borrow();
        let (main, captured) = present.as_ref().expect("a machine that has run was begun");
        let ended = program::end(machine, *main, outcome);
        setup.note_passages(machine);
        verdict(ended, || captured.output() + &captured.error())
    })
}

/// Returns what became of a test whose run has ended so.
fn verdict(ended: Ended, output: impl FnOnce() -> String) -> Verdict {
    let why = match ended {
        Ended::Normally(ALL_HELD) => return Verdict::Passed,
        Ended::Normally(ONE_DID_NOT_HOLD) => "a check did not hold".into(),
        Ended::Normally(NO_CHECK) => "it has no check: use IS, SIGNALS or FAILS".into(),
        Ended::Normally(status) => format!("it has ended the run with the status {status}"),
        Ended::Failed => "a failure has left it".into(),
        Ended::HeapExhausted => "its memory is exhausted".into(),
        Ended::BudgetSpent => "its budget of ticks is spent; `--budget` raises it".into(),
        Ended::Deadlocked => "it waits for an event that cannot occur".into(),
        Ended::Signalled(signal) => format!("it was ended by the signal {}", signal.number()),
    };
    Verdict::Failed { why, output: output() }
}
