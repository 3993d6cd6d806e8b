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
//! let Verdict::Failed { why, output, .. } = run(1)? else { panic!() };
//! assert_eq!(why, "a check did not hold");
//! assert_eq!(output, "(> (NOW) 200) is false.\n  (NOW) is 100.0\n");
//! # Ok::<(), esl::Error>(())
//! ```
#![forbid(unsafe_code)]

pub mod coverage;
pub mod explore;
mod failing;
pub mod inject;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use esl::Data;
use esl::Error;
use esl::module_path::ModulePath;
use esl::program::{self, Ended, Program};
use esl_bytecode::datum::Datum;
use esl_bytecode::module::Constant;
use esl_host::{Captured, Host, RealHost, Rights, VirtualHost};
use esl_vm::explore::{Exploration, Grain, Settings, TimerGrain, UnmetCondition};
use esl_vm::task::TaskId;
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use crate::coverage::Coverage;
use crate::explore::{ExplorationScope, grains, states_of};
pub use crate::failing::FailingSchedule;

/// Statuses with which the library's `%run-test` ends a run.
const ALL_HELD: u8 = 100;
const ONE_DID_NOT_HOLD: u8 = 101;
const NO_CHECK: u8 = 102;
/// The report of a test without one.
const WITHOUT_CHECK: &str = "it has no check: use IS, SIGNALS or FAILS";

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
    /// The program as [`program::compile_with_points`] compiles it, for tests that are explored strictly.
    pub with_points: Option<Arc<Program>>,
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
    /// Whether it is run under all schedules unasked, if these are few.
    pub may_explore: bool,
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
    /// Most aborts of a schedule by an operator.
    pub aborts: u32,
    /// Most restarts of a schedule, which interrupt calls.
    pub crashes: u32,
    /// Whether tasks also stop before each use of a place that others may reach.
    pub strict: bool,
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
        /// The schedule under which it does, if an exploration has found one.
        schedule: Option<Box<FailingSchedule>>,
    },
}

impl Verdict {
    /// Returns the verdict on a test that fails, under this schedule if there is one.
    fn failed(why: impl Into<String>, output: String, schedule: Option<Box<FailingSchedule>>) -> Verdict {
        Verdict::Failed { why: why.into(), output, schedule }
    }
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
            may_explore: explores.as_list().is_some_and(<[Data]>::is_empty),
            place: place.clone(),
        }),
        _ => None,
    };
    Ok(tests.as_list().unwrap_or_default().iter().filter_map(read).collect())
}

/// Whether a program may define tests: without, there is no need to run it for their list.
pub fn may_define_tests(program: &Program) -> bool {
    let module = program.module();
    let defines = |constant: &Constant| matches!(constant, Constant::Symbol(symbol) if ["%DEFINE-TEST", "LOAD", "EVAL"].contains(&symbol.name()));
    !module.requires.is_empty() || module.constants.iter().any(defines)
}

/// Returns how a test is explored, as the library has noted it.
fn explore_options(noted: &Data) -> Option<ExploreOptions> {
    let Some([grain, timers, states, strict, aborts, crashes]) = noted.as_list() else { return None };
    let name = |data: &Data| match data {
        Data::String(name) => Some(name.clone()),
        _ => None,
    };
    let number = |data: &Data| match data {
        Data::Integer(number) => Some(usize::try_from(*number).unwrap_or(usize::MAX)),
        _ => None,
    };
    let count = |data: &Data| number(data).map_or(0, |count| u32::try_from(count).unwrap_or(u32::MAX));
    Some(ExploreOptions {
        grain: name(grain).and_then(|name| Grain::from_name(&name)),
        timers: name(timers).and_then(|name| TimerGrain::from_name(&name)),
        states: number(states),
        aborts: count(aborts),
        crashes: count(crashes),
        strict: !strict.as_list().is_some_and(<[Data]>::is_empty),
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
    run_once(program, test, seed, setup).map(|(verdict, _)| verdict)
}

/// The size of a run of a test.
struct RunSize {
    ticks: u64,
    makes_tasks: bool,
}

/// Runs a test once. Returns what became of it, and the size of the run.
fn run_once(program: &Program, test: &Test, seed: u64, setup: &Setup) -> Result<(Verdict, RunSize), Error> {
    let written = Written::default();
    let (mut machine, main) = begin(program, test, seed, setup, Box::new(written.host(setup)))?;
    let (made_before, ..) = machine.tasks_turns_and_switches();
    let ticks_before = machine.ticks();
    let outcome = machine.run(u64::MAX);
    let ended = program::end(&mut machine, main, outcome);
    let (made, ..) = machine.tasks_turns_and_switches();
    let size = RunSize { ticks: machine.ticks() - ticks_before, makes_tasks: made > made_before };
    program::end_rest(&mut machine);
    setup.note_passages(&mut machine);
    Ok((verdict(ended, || written.text()), size))
}

/// Most states of a test that is explored unasked.
const FEW_STATES: usize = 2_000;

/// Most ticks of its runs, if each state costs as many as a run has.
const FEW_TICKS: u64 = 5_000_000;

/// Time after which such an exploration is given up: more than the two numbers above let any usual test take,
/// so that the line of a test does not depend on what else its machine does.
const LONG: Duration = Duration::from_secs(20);

/// Bytes that such an exploration may take.
const LITTLE_MEMORY: usize = 1 << 27;

/// Runs a test once, and then under all schedules, if it has made tasks and its schedules are few. Returns
/// also whether the verdict is that of the exploration.
///
/// # Errors
/// As [`run_test`].
pub fn run_and_explore(program: &Program, test: &Test, setup: &Setup) -> Result<(Verdict, bool), Error> {
    let (verdict, RunSize { ticks, makes_tasks }) = run_once(program, test, 0, setup)?;
    if verdict != Verdict::Passed || !test.may_explore || !makes_tasks {
        return Ok((verdict, false));
    }
    let states = usize::try_from(FEW_TICKS / ticks.max(1)).unwrap_or(FEW_STATES).min(FEW_STATES);
    let found = explore_if_small(program, test, setup, states)?;
    Ok(found.map_or((verdict, false), |found| (found, true)))
}

/// Explores a test. Returns `None` if it has more than so many states, or needs an outside that explorations
/// do not have.
fn explore_if_small(
    program: &Program,
    test: &Test,
    setup: &Setup,
    states: usize,
) -> Result<Option<Verdict>, Error> {
    let started = Instant::now();
    let mut complete = None;
    for grain in grains(program, None) {
        let few = Settings { states, memory: LITTLE_MEMORY, output: false, ..Settings::default() };
        let settings = Settings { grain, ..few };
        let found = explore_at(program, test, &settings, setup, &mut || started.elapsed() < LONG)?;
        // The first schedule is about the one that has passed with the outside of the test.
        let first = found.endings.first().map(|ending| &ending.what);
        if first.is_some_and(|verdict| *verdict != Verdict::Passed) {
            return Ok(None);
        }
        let scope = ExplorationScope::new(program, &settings, &found);
        if let Some(ending) = found.endings.iter().find(|ending| ending.what != Verdict::Passed) {
            let written = Written::default();
            let (mut machine, main) = begin(program, test, 0, setup, Box::new(written.host(setup)))?;
            let outcome = machine.follow(&settings, &ending.choices);
            let ended = program::end(&mut machine, main, outcome);
            let again = verdict(ended, || written.text());
            return Ok(match again {
                Verdict::Failed { why, output, .. } => {
                    let schedule = FailingSchedule::of_ending(&settings, &ending.choices);
                    let why = format!("under a schedule, {why} ({scope})");
                    Some(Verdict::failed(why, output, Some(schedule)))
                }
                _ => None,
            });
        }
        if let Some(choices) = &found.endless {
            let why = format!("a schedule leads to where it never ends ({scope})");
            let schedule = FailingSchedule::of_endless(&settings, choices);
            return Ok(Some(Verdict::failed(why, String::new(), Some(schedule))));
        }
        if let Some(unmet) = found.unmet.first() {
            let name = name_of_unmet(program, test, &settings, unmet, setup)?;
            let why = format!("{name} {NEVER_COMES_TRUE} ({scope})");
            let schedule = FailingSchedule::of_livelock(&settings, &unmet.schedule);
            return Ok(Some(Verdict::failed(why, String::new(), Some(schedule))));
        }
        if found.limit.is_some() || found.livelock.is_some() {
            return Ok(None);
        }
        complete = scope.is_complete().then_some(found.states);
    }
    Ok(complete.map(|states| Verdict::PassedAll(format!("explored: complete, {states} states"))))
}

/// Text about a condition of `eventually` or `leads-to` that a fair schedule never meets.
const NEVER_COMES_TRUE: &str =
    "never comes true on a schedule that goes on for ever, though each task has its turns";

/// Returns the name of a condition that a schedule of a test never meets.
fn name_of_unmet(
    program: &Program,
    test: &Test,
    settings: &Settings,
    unmet: &UnmetCondition,
    setup: &Setup,
) -> Result<String, Error> {
    let (mut machine, _) = begin(program, test, 0, setup, Box::new(Written::default().host(setup)))?;
    machine.follow_to(settings, &unmet.schedule.choices, &mut |_| {});
    Ok(machine.name_of_condition(unmet.condition).unwrap_or_else(|| "a condition".into()))
}

/// Runs a test under all schedules: at the grain that is asked for, or at those that show most; and strictly,
/// if that is asked for.
fn explore(program: &Program, test: &Test, options: ExploreOptions, setup: &Setup) -> Result<Verdict, Error> {
    let verdict = explore_grains(program, test, options, setup)?;
    if !options.strict || matches!(verdict, Verdict::Failed { .. }) {
        return Ok(verdict);
    }
    let Some(marked) = &setup.with_points else {
        return Ok(Verdict::failed("`:strict` needs the source of the program", String::new(), None));
    };
    Ok(match (explore_grains(marked, test, options, setup)?, verdict) {
        (Verdict::Failed { why, output, schedule }, _) => {
            let why = format!("with switches before each use of a shared place, {why}");
            Verdict::failed(why, output, schedule)
        }
        (Verdict::PassedAll(strictly), Verdict::PassedAll(how)) => {
            Verdict::PassedAll(format!("{how}; not fragile: {strictly}"))
        }
        (_, verdict) => verdict,
    })
}

/// Runs a test under all schedules at one grain after the other; strictly, if the program has points.
fn explore_grains(
    program: &Program,
    test: &Test,
    options: ExploreOptions,
    setup: &Setup,
) -> Result<Verdict, Error> {
    let strict = setup.with_points.as_ref().is_some_and(|marked| std::ptr::eq(&**marked, program));
    let states = options.states.unwrap_or(Settings::default().states);
    let ExploreOptions { aborts, crashes, .. } = options;
    let timers = options.timers.unwrap_or_default();
    let mut verdict = Verdict::Passed;
    for grain in grains(program, options.grain) {
        let settings =
            Settings { grain, timers, aborts, crashes, states, strict, output: false, ..Settings::default() };
        let found = explore_at(program, test, &settings, setup, &mut || true)?;
        let scope = ExplorationScope::new(program, &settings, &found);
        let failed =
            |why: &str, output, schedule| Verdict::failed(format!("{why} ({scope})"), output, schedule);
        let badly = found.endings.into_iter().find(|ending| ending.what != Verdict::Passed);
        verdict = match badly.map(|ending| (ending.what, ending.choices)) {
            Some((Verdict::Failed { why, output, .. }, choices)) => {
                let schedule = FailingSchedule::of_ending(&settings, &choices);
                failed(&format!("under a schedule, {why}"), output, Some(schedule))
            }
            _ if let Some(unmet) = found.unmet.first() => {
                let name = name_of_unmet(program, test, &settings, unmet, setup)?;
                let schedule = FailingSchedule::of_livelock(&settings, &unmet.schedule);
                failed(&format!("{name} {NEVER_COMES_TRUE}"), String::new(), Some(schedule))
            }
            _ if let Some(choices) = &found.endless => {
                let schedule = FailingSchedule::of_endless(&settings, choices);
                failed("a schedule leads to where it never ends", String::new(), Some(schedule))
            }
            _ if let Some(livelock) = &found.livelock => {
                let schedule = FailingSchedule::of_livelock(&settings, livelock);
                let why = "tasks can go on for ever, though each has its turns";
                failed(why, String::new(), Some(schedule))
            }
            _ if found.limit.is_some() => {
                failed("not proved: schedules are left that were not tried", unproved(&verdict), None)
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

/// Runs a test under all schedules, with these settings, for as long as `goes_on`.
fn explore_at(
    program: &Program,
    test: &Test,
    settings: &Settings,
    setup: &Setup,
    goes_on: &mut dyn FnMut() -> bool,
) -> Result<Exploration<Verdict>, Error> {
    let begin = || {
        let host = VirtualHost::new();
        let captured = host.captured();
        let config = Config { snapshots: true, ..setup.config.clone() };
        let setup = Setup { config, ..setup.clone() };
        let (machine, main) = begin(program, test, 0, &setup, Box::new(host))?;
        Ok::<_, Error>((machine, (main, captured)))
    };
    let judge = |machine: &mut Vm, (main, captured): &(TaskId, Captured), outcome| {
        let ended = program::end(machine, *main, outcome);
        setup.note_passages(machine);
        verdict(ended, || captured.output() + &captured.error())
    };
    let settings = &states_of(program, settings);
    esl_vm::explore::explore_while(settings, begin, judge, |_| goes_on())
}

/// Returns what became of a test whose run has ended so.
fn verdict(ended: Ended, output: impl FnOnce() -> String) -> Verdict {
    let why = match ended {
        Ended::Normally(ALL_HELD) => return Verdict::Passed,
        Ended::Normally(ONE_DID_NOT_HOLD) => "a check did not hold".into(),
        Ended::Normally(NO_CHECK) => WITHOUT_CHECK.into(),
        Ended::Normally(status) => format!("it has ended the run with the status {status}"),
        Ended::Failed => "a failure has left it".into(),
        Ended::HeapExhausted => "its memory is exhausted".into(),
        Ended::BudgetSpent => "its budget of ticks is spent; `--budget` raises it".into(),
        Ended::Deadlocked => "it waits for an event that cannot occur".into(),
        Ended::Signalled(signal) => format!("it was ended by the signal {}", signal.number()),
    };
    Verdict::Failed { why, output: output(), schedule: None }
}
