//! The oracle: programs are run, and each failure that is seen to end a task or to reach a recovery
//! procedure is in the table of the program.
#![allow(clippy::print_stderr, reason = "long runs show their findings at once")]

mod generated;
mod generator;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use esl::Config;
use esl::host::VirtualHost;
use esl::module_path::ModulePath;
use esl::program::{Program, Source, compile_with_core, finish, load, machine, run_in, set_module_path};
use esl_analysis::{AnalysisOptions, CauseRow, FailureTable, TaskKind, analyze};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;

/// The failures that a run has shown.
#[derive(Default)]
struct Log {
    names: BTreeMap<TaskNumber, (String, bool)>,
    /// The latest cause of each task.
    failing: BTreeMap<TaskNumber, String>,
    /// Name, whether it is hidden, and cause of tasks that a failure has ended.
    ended: Vec<(String, bool, String)>,
    recovered: Vec<String>,
    /// Whether a programming error has been seen.
    has_error: bool,
}

struct Onlooker(Arc<Mutex<Log>>);

impl Observer for Onlooker {
    fn see(&mut self, _: u64, task: TaskNumber, seen: Seen<'_>) {
        let Ok(mut log) = self.0.lock() else { return };
        match seen {
            Seen::Begins { name, is_hidden } => _ = log.names.insert(task, (name.into(), is_hidden)),
            Seen::Fails(cause) => {
                log.has_error |= STANDARD.contains(&cause.to_lowercase().as_str());
                log.failing.insert(task, cause.to_lowercase());
            }
            Seen::Recovers(cause) => log.recovered.push(cause.to_lowercase()),
            Seen::Ends("failed") => {
                let (name, is_hidden) = log.names.get(&task).cloned().unwrap_or_default();
                let cause = log.failing.get(&task).cloned().unwrap_or_default();
                log.ended.push((name, is_hidden, cause));
            }
            _ => {}
        }
    }
}

/// The failures that a table says clauses take, and those that it says end tasks, without programming errors
/// and causes that are not known.
fn inferred(table: &FailureTable) -> BTreeSet<(&'static str, String)> {
    let is_named = |row: &&CauseRow| !row.is_mistake && row.cause.starts_with(':');
    let taken = table.clauses.iter().flat_map(|clause| &clause.causes);
    let ending = table.tasks.iter().flat_map(|task| &task.causes);
    let taken = taken.filter(is_named).map(|row| ("a clause takes", row.cause.clone()));
    taken.chain(ending.filter(is_named).map(|row| ("a task ends by", row.cause.clone()))).collect()
}

/// The failures that a run has shown clauses take, and those that ended tasks.
fn shown(log: &Log) -> BTreeSet<(&'static str, String)> {
    let taken = log.recovered.iter().map(|cause| ("a clause takes", cause.clone()));
    taken.chain(log.ended.iter().map(|(_, _, cause)| ("a task ends by", cause.clone()))).collect()
}

/// How many inferred failures runs have shown.
#[derive(Default)]
struct Precision {
    inferred: usize,
    shown: usize,
    /// Those that no run has shown, with the number of programs.
    others: BTreeMap<(&'static str, String), usize>,
}

impl Precision {
    fn add(&mut self, inferred: BTreeSet<(&'static str, String)>, shown: &BTreeSet<(&'static str, String)>) {
        self.inferred += inferred.len();
        for pair in inferred {
            if shown.contains(&pair) {
                self.shown += 1;
            } else {
                *self.others.entry(pair).or_default() += 1;
            }
        }
    }

    fn tell(&self, runs: &str) {
        eprintln!("{runs} have shown {} of {} inferred failures; the others:", self.shown, self.inferred);
        let mut others: Vec<_> = self.others.iter().collect();
        others.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
        for ((what, cause), count) in others {
            eprintln!("{count:6} {what} {cause}");
        }
    }
}

/// Causes of limits and rights of the run, which are in no table. A task that a limit ends has no cause here.
const LIMITS: [&str; 5] =
    [":stack-exhausted", ":heap-exhausted", ":permission-denied", ":not-in-this-world", ""];

fn has(rows: &[CauseRow], cause: &str) -> bool {
    let is_error = |row: &CauseRow| row.is_mistake;
    let is_wide = |row: &CauseRow| row.cause.starts_with("any") || row.cause.starts_with("unknown");
    rows.iter().any(|row| row.cause == cause || is_wide(row))
        || (rows.iter().any(is_error) && STANDARD.contains(&cause))
}

/// Causes of errors of the standard.
const STANDARD: [&str; 30] = [
    ":detailed-type-error",
    ":case-failure",
    ":bounding-indices-error",
    ":simple-program-error",
    ":simple-stream-error",
    ":would-block",
    ":no-applicable-method-error",
    ":unstratified-rules",
    ":type-error",
    ":simple-error",
    ":division-by-zero",
    ":unbound-variable",
    ":undefined-function",
    ":program-error",
    ":control-error",
    ":parse-error",
    ":reader-error",
    ":stream-error",
    ":file-error",
    ":end-of-file",
    ":package-error",
    ":error",
    ":arithmetic-error",
    ":floating-point-overflow",
    ":floating-point-invalid-operation",
    ":unbound-slot",
    ":cell-error",
    ":print-not-readable",
    ":simple-type-error",
    ":floating-point-underflow",
];

/// Runs a program. Returns the failures that its table lacks, and the number of those that were seen. A
/// program that is warned of fails as the warning says.
fn misses(path: &Path, precision: &mut Precision) -> Option<(Vec<String>, usize)> {
    let text = std::fs::read_to_string(path).ok()?;
    let sources = [Source::new(path.to_string_lossy(), text)];
    let modules = ModulePath::new(std::iter::once(path), &[]);
    let mut compiled = compile_with_core(&sources, &modules);
    let program = compiled.program.take()?;
    let cores = std::mem::take(&mut compiled.core);
    let (table, _) = analyze(cores, &compiled.sources, &AnalysisOptions { all: true, explained: None });
    let config = Config { memory: 64 << 20, budget: Some(3_000_000), ..Config::DEFAULT };
    let mut machine = machine(config, Box::new(VirtualHost::new())).ok()?;
    set_module_path(&mut machine, &modules).ok()?;
    let log = Arc::new(Mutex::new(Log::default()));
    machine.coming_observers().add(Box::new(Onlooker(Arc::clone(&log))));
    machine.inbox().inspect(esl::host::Inspection::Watch);
    run_in(&mut machine, &program).ok()?;
    let log = log.lock().ok()?;
    let (mut missed, seen) = compare(&table, &log);
    precision.add(inferred(&table), &shown(&log));
    let is_of_types = |found: &&Diagnostic| found.code == "wrong-type" && !log.has_error;
    missed.extend(
        table.findings.iter().filter(is_of_types).map(|found| format!("warned of: {}", found.message)),
    );
    Some((missed, seen))
}

fn compare(table: &FailureTable, log: &Log) -> (Vec<String>, usize) {
    let mut missed = Vec::new();
    let mut seen = 0;
    for (name, is_hidden, cause) in &log.ended {
        if LIMITS.contains(&cause.as_str()) || (*is_hidden && !name.contains("MOCK")) {
            continue;
        }
        seen += 1;
        // The main task runs a test.
        let is_main = name == "the main task";
        let mut rows = table.tasks.iter().filter(|task| match task.kind {
            TaskKind::Main => is_main,
            TaskKind::Test => true,
            _ => !is_main,
        });
        if !rows.any(|task| has(&task.causes, cause)) {
            missed.push(format!("{name} ended by {cause}"));
        }
    }
    for cause in &log.recovered {
        seen += 1;
        if !LIMITS.contains(&cause.as_str()) && !table.clauses.iter().any(|clause| has(&clause.causes, cause))
        {
            missed.push(format!("a procedure took {cause}"));
        }
    }
    missed.sort();
    missed.dedup();
    (missed, seen)
}

/// One in so many programs is run, unless the variable `ESL_ORACLE` names another number.
const STRIDE: usize = 10;

#[test]
fn failures_that_are_seen_are_in_the_table() {
    let wanted = std::env::var("ESL_ORACLE").ok().and_then(|stride| stride.parse().ok());
    let stride = wanted.unwrap_or(STRIDE);
    let programs = esl_conformance::programs::paths("");
    let paths: Vec<PathBuf> = programs.into_iter().step_by(stride).collect();
    let (mut runs, mut seen, mut missed) = (0, 0, Vec::new());
    let mut precision = Precision::default();
    for path in paths {
        if let Some((misses, count)) = misses(&path, &mut precision) {
            runs += 1;
            seen += count;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            missed.extend(misses.iter().map(|miss| format!("{name}: {miss}")));
        }
    }
    precision.tell("programs");
    assert!(runs > 20 && seen > 10, "{runs} runs with {seen} failures are too few");
    assert!(missed.is_empty(), "{} of {seen} in {runs} runs:\n{}", missed.len(), missed.join("\n"));
}

/// Programs with operations, and the test that is run if the program alone calls none.
const INJECTED: [(&str, Option<&str>); 5] = [
    ("examples/spacecraft/scripted.esl", None),
    ("examples/missions/drive-to-target.esl", None),
    ("examples/missions/pick-and-place.esl", None),
    ("examples/missions/safe-drive.esl", None),
    ("examples/missions/cross-door.esl", Some("PASSES-EVERY-DOOR")),
];

/// Causes with which forms and operations fail because a task is aborted from outside, which are in no table.
const OF_ABORTS: [&str; 2] = [":aborted", ":cancelled"];

/// A program that is run with faults.
struct InjectedProgram {
    program: Program,
    modules: ModulePath,
    table: FailureTable,
    test: Option<&'static str>,
}

impl InjectedProgram {
    fn new(file: &str, test: Option<&'static str>) -> InjectedProgram {
        let path = esl_conformance::root().join(file);
        let text = std::fs::read_to_string(&path).expect("the program can be read");
        let modules = ModulePath::new(std::iter::once(path.as_path()), &[]);
        let mut compiled = compile_with_core(&[Source::new(file, text)], &modules);
        let program = compiled.program.take().expect("it compiles");
        let options = AnalysisOptions { all: true, explained: None };
        let (table, _) = analyze(std::mem::take(&mut compiled.core), &compiled.sources, &options);
        InjectedProgram { program, modules, table, test }
    }

    /// Runs the program with faults. Returns the failures that were seen, and the operations that it calls.
    fn run(&self, faults: &Datum) -> (Log, Vec<Symbol>) {
        let span = Span::default();
        let config = Config { memory: 64 << 20, budget: Some(2_000_000), ..Config::DEFAULT };
        let mut machine = machine(config.clone(), Box::new(VirtualHost::new())).expect("there is room");
        set_module_path(&mut machine, &self.modules).expect("there is room");
        let log = Arc::new(Mutex::new(Log::default()));
        machine.coming_observers().add(Box::new(Onlooker(Arc::clone(&log))));
        machine.inbox().inspect(esl::host::Inspection::Watch);
        let functions = load(&mut machine, &self.program).expect("it is loaded");
        let name = self.test.map_or_else(|| Datum::nil(span), |name| Datum::string(name, span));
        let given = [name, faults.clone()].map(|datum| machine.import(&datum).expect("there is room"));
        let main = machine.spawn_library("%RUN-INJECTED", &[functions, given[0], given[1]]);
        let main = main.expect("it begins");
        machine.set_main(main);
        let outcome = machine.run(u64::MAX);
        finish(&mut machine, main, outcome);
        machine.begin_program(Config { budget: None, ..config });
        let report = machine.library_function("%INJECTION-REPORT").expect("the library has it");
        let values = machine.call(report, &[], u64::MAX).expect("it returns");
        let report = machine.export(values[0]).expect("it is data");
        let calls = report.elements().next().expect("the calls come first").clone();
        let names = calls.elements().filter_map(|call| call.elements().next()?.as_symbol().cloned());
        let names: Vec<Symbol> = names.collect();
        (std::mem::take(&mut *log.lock().expect("nobody panics")), names)
    }
}

/// Each known failure of each operation, and calls that never answer or whose task is aborted: the failures
/// that leave tasks and reach procedures then are in the table, too.
#[test]
fn failures_after_injected_faults_are_in_the_table() {
    let span = Span::default();
    let (mut runs, mut seen, mut missed) = (0, 0, Vec::new());
    let mut precision = Precision::default();
    for (file, test) in INJECTED {
        let subject = InjectedProgram::new(file, test);
        let known = subject.table.causes_by_name();
        let mut all_shown = BTreeSet::new();
        let (_, mut operations) = subject.run(&Datum::nil(span));
        operations.sort_by_key(|operation| operation.name().to_string());
        operations.dedup();
        for operation in operations {
            let causes = known.get(&operation.name().to_lowercase()).cloned().unwrap_or_default();
            let failing = causes
                .iter()
                .map(|cause| ("FAILS", Datum::list(vec![Datum::symbol(cause.clone(), span)], span)));
            let others = ["NEVER", "ABORTED"].map(|way| (way, Datum::nil(span)));
            for (way, arguments) in failing.chain(others) {
                for lasts in [false, true] {
                    let lasts = if lasts { Datum::symbol(Symbol::cl("T"), span) } else { Datum::nil(span) };
                    let name = Datum::symbol(operation.clone(), span);
                    let way = Datum::symbol(Symbol::keyword(way), span);
                    let fault =
                        Datum::list(vec![name, Datum::integer(1, span), lasts, way, arguments.clone()], span);
                    let (log, _) = subject.run(&Datum::list(vec![fault], span));
                    let (misses, count) = compare(&subject.table, &log);
                    all_shown.extend(shown(&log));
                    runs += 1;
                    seen += count;
                    let misses =
                        misses.iter().filter(|miss| !OF_ABORTS.iter().any(|end| miss.ends_with(end)));
                    missed.extend(misses.map(|miss| format!("{file}, {operation}: {miss}")));
                }
            }
        }
        precision.add(inferred(&subject.table), &all_shown);
    }
    precision.tell("runs with faults");
    assert!(runs > 50 && seen > 100, "{runs} runs with {seen} failures are too few");
    assert!(missed.is_empty(), "{} of {seen} in {runs} runs:\n{}", missed.len(), missed.join("\n"));
}
