//! The oracle: programs are run, and each failure that is seen to end a task or to reach a recovery
//! procedure is in the table of the program.
#![allow(clippy::print_stderr, reason = "long runs show their findings at once")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use esl::Config;
use esl::host::VirtualHost;
use esl::module_path::ModulePath;
use esl::program::{Source, compile_with_core, machine, run_in, set_module_path};
use esl_analysis::{AnalysisOptions, CauseRow, FailureTable, TaskKind, analyze};
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
}

struct Onlooker(Arc<Mutex<Log>>);

impl Observer for Onlooker {
    fn see(&mut self, _: u64, task: TaskNumber, seen: Seen<'_>) {
        let Ok(mut log) = self.0.lock() else { return };
        match seen {
            Seen::Begins { name, is_hidden } => _ = log.names.insert(task, (name.into(), is_hidden)),
            Seen::Fails(cause) => _ = log.failing.insert(task, cause.to_lowercase()),
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

/// Runs a program. Returns the failures that its table lacks, and the number of those that were seen.
fn misses(path: &Path) -> Option<(Vec<String>, usize)> {
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
    Some(compare(&table, &log))
}

fn compare(table: &FailureTable, log: &Log) -> (Vec<String>, usize) {
    let mut missed = Vec::new();
    let mut seen = 0;
    for (name, is_hidden, cause) in &log.ended {
        if LIMITS.contains(&cause.as_str()) || (*is_hidden && !name.contains("MOCK")) {
            continue;
        }
        seen += 1;
        let is_main = name == "the main task";
        let mut rows = table.tasks.iter().filter(|task| (task.kind == TaskKind::Main) == is_main);
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
    for path in paths {
        if let Some((misses, count)) = misses(&path) {
            runs += 1;
            seen += count;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            missed.extend(misses.iter().map(|miss| format!("{name}: {miss}")));
        }
    }
    assert!(runs > 20 && seen > 10, "{runs} runs with {seen} failures are too few");
    assert!(missed.is_empty(), "{} of {seen} in {runs} runs:\n{}", missed.len(), missed.join("\n"));
}
