//! One run of a program with faults, in a machine that returns to its beginning for the next one.

use std::collections::{BTreeMap, BTreeSet};

use esl::program::{self, Ended};
use esl::{Data, Error};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::{Captured, SurveyRequest, VirtualHost};
use esl_vm::Snapshot;
use esl_vm::run::RunOutcome;
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use super::fault::InjectedFault;
use super::properties::{PropertyValues, properties};
use super::{InjectionSubject, RunBound};

/// A call of an operation in a run.
#[derive(Clone, Debug)]
pub struct NotedCall {
    /// Name of the operation.
    pub operation: Symbol,
    /// Number among the calls of this operation, from 1.
    pub number: u64,
    /// Time of its beginning, in seconds.
    pub begun: f64,
    /// Time of its end, if it has ended.
    pub ended: Option<f64>,
    /// Name of the calling task.
    pub task: String,
    /// Cause and arguments of its failure.
    pub failure: Option<Vec<Datum>>,
}

/// A run as it is seen from outside.
#[derive(Clone, Debug)]
pub struct InjectedRun {
    /// Way in which it ended.
    pub ended: Ended,
    /// Text on standard output.
    pub output: String,
    /// Text on standard error.
    pub errors: String,
    /// Facts at its end, without properties that are measurements.
    pub facts: BTreeSet<String>,
    /// Properties at its end.
    pub(super) properties: PropertyValues,
    /// The first value of each property, if it was asked for.
    pub(super) first: PropertyValues,
    /// Calls of operations, in order.
    pub calls: Vec<NotedCall>,
    /// Failures of the scripts of its worlds: the operation, and the cause with its arguments.
    pub scripted: Vec<(Symbol, Vec<Datum>)>,
    /// Texts about conditions of `always` that were false.
    pub violated: Vec<String>,
    /// Virtual time at its end, in seconds.
    pub seconds: f64,
    /// Ticks.
    pub ticks: u64,
    /// Whether it was ended because its bound was reached.
    pub is_endless: bool,
    /// Report of the machine about a cleanup that was cut off.
    pub cut_off: Option<String>,
}

/// The machine's reports about cleanups that did not come to their end.
const CUT_OFF: [&str; 2] = ["is cut off", "The end of the run was cut short."];

/// Ticks between two looks at the time of a run.
const PORTION: u64 = 20_000;
/// The same in a run whose first properties are noted.
const SMALL_PORTION: u64 = 500;

/// A machine that has loaded a program.
pub(super) struct LoadedMachine {
    machine: Vm,
    captured: Captured,
    functions: Value,
    snapshot: Option<Snapshot>,
    is_used: bool,
}

impl LoadedMachine {
    /// Loads a program into a machine.
    ///
    /// # Errors
    /// [`Error::NoMemory`] or [`Error::Refused`].
    pub(super) fn new(subject: &InjectionSubject<'_>, seed: u64) -> Result<LoadedMachine, Error> {
        let setup = subject.setup;
        let host = VirtualHost::new().with_rights(setup.path.with_rights(setup.rights.clone()));
        let captured = host.captured();
        let config = Config { snapshots: true, seed, ..setup.config.clone() };
        let mut machine = program::machine(config, Box::new(host))?;
        program::set_module_path(&mut machine, &setup.path)?;
        let functions = program::load(&mut machine, subject.program)?;
        machine.pin(functions);
        let snapshot = machine.save(None);
        Ok(LoadedMachine { machine, captured, functions, snapshot, is_used: false })
    }

    /// Returns the machine to its beginning. False if that is not possible.
    fn begin_again(&mut self) -> bool {
        !self.is_used || self.snapshot.as_ref().is_some_and(|snapshot| self.machine.restore(snapshot))
    }
}

/// Machines for the runs of one subject with one seed, one after the other.
pub(super) struct Runs<'a> {
    subject: &'a InjectionSubject<'a>,
    seed: u64,
    loaded: Option<LoadedMachine>,
}

impl<'a> Runs<'a> {
    pub(super) fn new(subject: &'a InjectionSubject<'a>, seed: u64) -> Runs<'a> {
        Runs { subject, seed, loaded: None }
    }

    /// Runs the program with these faults.
    ///
    /// # Errors
    /// [`Error::NoMemory`] or [`Error::Refused`], if the run cannot be begun.
    pub(super) fn run(
        &mut self,
        faults: &[InjectedFault],
        bound: RunBound,
        is_first: bool,
    ) -> Result<InjectedRun, Error> {
        let is_ready = self.loaded.as_mut().is_some_and(LoadedMachine::begin_again);
        let mut loaded = match self.loaded.take() {
            Some(loaded) if is_ready => loaded,
            _ => LoadedMachine::new(self.subject, self.seed)?,
        };
        loaded.is_used = true;
        let run = run_in(&mut loaded, self.subject, faults, bound, is_first);
        self.loaded = Some(loaded);
        run
    }
}

fn run_in(
    loaded: &mut LoadedMachine,
    subject: &InjectionSubject<'_>,
    faults: &[InjectedFault],
    bound: RunBound,
    is_first: bool,
) -> Result<InjectedRun, Error> {
    let LoadedMachine { machine, captured, functions, .. } = loaded;
    let span = Span::default();
    let before = (captured.output().len(), captured.error().len());
    let no_room = |_| Error::NoMemory("an argument");
    let name = subject.test.map_or_else(|| Datum::nil(span), |name| Datum::string(name, span));
    let name = machine.import(&name).map_err(no_room)?;
    let list = Datum::list(faults.iter().map(InjectedFault::datum).collect::<Vec<_>>(), span);
    let list = machine.import(&list).map_err(no_room)?;
    let main = machine.spawn_library("%RUN-INJECTED", &[*functions, name, list])?;
    machine.set_interruptible(Some(main));
    machine.set_main(main);
    let ticks_before = machine.ticks();
    let mut first = PropertyValues::new();
    let mut is_endless = false;
    let outcome = loop {
        let outcome = machine.run(if is_first { SMALL_PORTION } else { PORTION });
        if is_first {
            for (key, value) in properties(machine).0 {
                first.entry(key).or_insert(value);
            }
        }
        let ticks = machine.ticks() - ticks_before;
        if seconds_of(machine) > bound.seconds || ticks > bound.ticks {
            is_endless = true;
            break outcome;
        }
        if outcome != RunOutcome::TicksUsed {
            break outcome;
        }
    };
    let seconds = seconds_of(machine);
    let ticks = machine.ticks() - ticks_before;
    let ended = program::end(machine, main, outcome);
    program::end_rest(machine);
    let (properties, measured) = properties(machine);
    let facts = facts(machine).into_iter().filter(|fact| !measured.contains(fact)).collect();
    // Nothing that has ended the run is in force any more.
    machine.begin_program(Config { snapshots: true, budget: None, ..subject.setup.config.clone() });
    let report = report(machine).unwrap_or_default();
    let (output, errors) = (captured.output(), captured.error());
    let (output, errors) = (rest(&output, before.0), rest(&errors, before.1));
    let cut_off = errors.lines().find(|line| CUT_OFF.iter().any(|text| line.contains(text)));
    Ok(InjectedRun {
        ended,
        cut_off: cut_off.map(String::from),
        output,
        errors,
        facts,
        properties,
        first,
        calls: report.calls,
        scripted: report.scripted,
        violated: report.violated,
        seconds,
        ticks,
        is_endless,
    })
}

/// Returns a text behind its first bytes.
fn rest(text: &str, bytes: usize) -> String {
    text.get(bytes..).unwrap_or(text).to_string()
}

fn seconds_of(machine: &Vm) -> f64 {
    machine.last_time() as f64 / 1e9
}

/// Most pages of facts that are compared.
const PAGES: usize = 20;

/// Returns the facts of a machine, as texts, except those that the library keeps.
fn facts(machine: &Vm) -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    let mut passed = 0;
    for _ in 0..PAGES {
        let request = SurveyRequest { facts: Some((String::new(), passed)), ..SurveyRequest::default() };
        let page = machine.survey(&request).facts;
        if page.is_empty() {
            break;
        }
        passed += page.len();
        all.extend(page.into_iter().filter(|fact| !fact.starts_with("(%")));
    }
    all
}

/// Notes of the library about a run.
#[derive(Default)]
struct LibraryReport {
    calls: Vec<NotedCall>,
    scripted: Vec<(Symbol, Vec<Datum>)>,
    violated: Vec<String>,
}

/// Asks the library for its notes. `None` if there is no memory for them.
fn report(machine: &mut Vm) -> Option<LibraryReport> {
    let function = machine.library_function("%INJECTION-REPORT").ok()?;
    let values = machine.call_without_budget(function, &[], u64::MAX).ok()?;
    let report = machine.export(*values.first()?).ok()?;
    let [calls, scripted, violated] = report.as_list()?[..] else { return None };
    let calls = calls.elements().filter_map(call).collect();
    let scripted = scripted.elements().filter_map(|row| {
        let items = row.as_list()?;
        let (operation, failure) = items.split_first()?;
        Some((operation.as_symbol()?.clone(), failure.iter().map(|item| (*item).clone()).collect()))
    });
    Some(LibraryReport {
        calls,
        scripted: scripted.collect(),
        violated: violated.elements().map(text).collect(),
    })
}

fn call(row: &Datum) -> Option<NotedCall> {
    let [operation, number, begun, ended, task, failure] = row.as_list()?[..] else { return None };
    let failure = failure.as_list().unwrap_or_default();
    Some(NotedCall {
        operation: operation.as_symbol()?.clone(),
        number: seconds(number)? as u64,
        begun: seconds(begun)?,
        ended: seconds(ended),
        task: text(task).to_lowercase(),
        failure: (!failure.is_empty()).then(|| failure.into_iter().cloned().collect()),
    })
}

fn seconds(datum: &Datum) -> Option<f64> {
    match Data::from_datum(datum) {
        Data::Integer(number) => Some(number as f64),
        Data::Float(number) => Some(number),
        _ => None,
    }
}

fn text(datum: &Datum) -> String {
    match Data::from_datum(datum) {
        Data::String(text) => text,
        _ => datum.to_string(),
    }
}

/// The number of calls of each operation, by its name.
pub(super) fn counts(calls: &[NotedCall]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for call in calls {
        *counts.entry(super::fault::shown_operation(&call.operation)).or_insert(0) += 1;
    }
    counts
}
