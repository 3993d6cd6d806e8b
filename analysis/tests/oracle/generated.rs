//! Generated programs: each failure that is seen to leave a function, the body of a handling form or a task,
//! and each that a clause takes, is in its row of the table.
//!
//! `ESL_ORACLE_PROGRAMS=10000` tries so many programs, from the number `ESL_ORACLE_FROM` on, in
//! `ESL_ORACLE_JOBS` threads, each in `ESL_ORACLE_SEEDS` runs; by default there are few.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use esl::Config;
use esl::host::VirtualHost;
use esl::module_path::ModulePath;
use esl::program::{Source, compile_with_core, machine, run_in};
use esl_analysis::{AnalysisOptions, CauseRow, FailureTable, TaskKind, analyze};
use esl_bytecode::diagnostic::Severity;

use super::LIMITS;
use super::generator;

/// Programs that are tried unless the variable says how many.
const PROGRAMS: u64 = 30;

/// The macros of a program that is analysed, and those of one that tells which failures come by.
const SILENT: &str = "(defmacro seen (id form) id form) (defmacro took (id &body forms) id `(progn ,@forms)) \
    (defmacro caught (id &body forms) id `(progn ,@forms))\n";
const TELLING: &str = "(defun tell (what id c) (write-string (format nil \"~a ~a ~a ~s~%\" what id (current-task) c))) \
    (defmacro seen (id form) `(progn (tell 'in ',id nil) \
    (handler-bind ((serious-condition (lambda (c) (tell 'by ',id (failure-cause c))))) ,form))) \
    (defmacro took (id &body forms) `(progn (tell 'took ',id nil) \
    (handler-bind ((serious-condition (lambda (c) (tell 'out ',id (failure-cause c))))) ,@forms))) \
    (defmacro caught (id &body forms) `(progn (tell 'caught ',id (failure-cause c)) ,@forms))\n";

/// Kinds of rows whose inferred failures are counted.
#[derive(Debug, Default, Clone, Copy)]
struct Shown {
    inferred: usize,
    shown: usize,
    /// Not shown, as the code was never entered.
    not_entered: usize,
}

#[derive(Default)]
struct Figures {
    programs: u64,
    runs: u64,
    /// Failures that were seen and compared.
    seen: usize,
    by_kind: BTreeMap<String, Shown>,
    /// Causes of inferred failures that no run has shown although the code was entered.
    others: BTreeMap<String, usize>,
    missed: Vec<String>,
}

/// A row of a table, by the kind of its form and its mark or name.
type RowKey = (String, String);

/// The failures of a run, by the rows that they have to be in.
#[derive(Default)]
struct SeenFailures {
    causes: BTreeMap<RowKey, BTreeSet<String>>,
    entered: BTreeSet<String>,
}

/// Returns the class of programming errors that the table shows for a cause of the standard.
fn class_of(cause: &str) -> &str {
    match cause {
        ":division-by-zero" | ":floating-point-overflow" | ":arithmetic-error" => ":arithmetic-error",
        ":unbound-variable" | ":undefined-function" | ":unbound-slot" | ":cell-error" => ":cell-error",
        ":type-error" | ":detailed-type-error" | ":case-failure" | ":bounding-indices-error" => ":type-error",
        ":program-error" | ":simple-program-error" | ":control-error" => ":program-error",
        other => other,
    }
}

/// Causes of errors that are of the class `:error`.
const OF_OTHERS: [&str; 8] = [
    ":parse-error",
    ":simple-error",
    ":reader-error",
    ":end-of-file",
    ":stream-error",
    ":simple-type-error",
    ":no-applicable-method-error",
    ":package-error",
];

fn has(rows: &[&CauseRow], cause: &str) -> bool {
    let class = class_of(cause);
    rows.iter().any(|row| {
        row.cause == cause
            || row.cause.starts_with("any")
            || row.cause.starts_with("unknown")
            || row.is_mistake
                && (row.cause == class
                    || row.cause == ":error (as a cause)" && super::STANDARD.contains(&cause)
                    || row.cause == ":would-block" && cause == ":budget-exhausted"
                    || row.cause == ":error" && OF_OTHERS.contains(&cause))
    })
}

/// The marks of a program: their offsets, and whether they are those of clauses.
struct Marks(Vec<(usize, String, bool)>);

impl Marks {
    fn new(text: &str) -> Marks {
        let mut marks = Vec::new();
        for (at, _) in text.match_indices("\n#|") {
            let Some((mark, rest)) = text[at + 3..].split_once("|#(") else { continue };
            let forms = ["with-recovery-procedures ", "handler-case ", "handler-bind ", "ignore-errors "];
            marks.push((at, mark.to_string(), !forms.iter().any(|form| rest.starts_with(form))));
        }
        Marks(marks)
    }

    /// Returns the last mark before an offset, of a clause or of a form.
    fn before(&self, offset: u32, is_clause: bool) -> Option<String> {
        let mut all = self.0.iter().rev();
        all.find(|(at, _, of_clause)| *at < offset as usize && *of_clause == is_clause)
            .map(|(_, mark, _)| mark.clone())
    }
}

/// The rows of a table, by the kinds of their forms and their marks or names.
fn rows_of<'t>(table: &'t FailureTable, text: &str) -> BTreeMap<RowKey, Vec<&'t CauseRow>> {
    let marks = Marks::new(text);
    let mut rows: BTreeMap<RowKey, Vec<&CauseRow>> = BTreeMap::new();
    let mut add = |kind: &str, name: String, causes: &'t [CauseRow]| {
        rows.entry((kind.to_string(), name)).or_default().extend(causes);
    };
    for function in &table.functions {
        add("function", function.name.clone(), &function.causes);
    }
    for form in &table.forms {
        if let Some(mark) = marks.before(form.span.start, false) {
            add("form", mark.clone(), &form.taken);
            add("form", mark.clone(), &form.passing);
        }
    }
    for clause in &table.clauses {
        if let Some(mark) = marks.before(clause.span.start, true) {
            add("clause", mark.clone(), &clause.causes);
            add("leaves clause", mark.clone(), &clause.fails);
        }
    }
    for task in &table.tasks {
        let name = if task.kind == TaskKind::Main { "main" } else { &task.name };
        add("task", name.to_string(), &task.causes);
    }
    rows
}

/// Runs a program, and adds the failures that were seen.
fn run(text: &str, seed: u64, seen: &mut SeenFailures) -> Option<()> {
    let source = [Source::new("generated.esl", format!("{TELLING}{text}"))];
    let mut compiled = compile_with_core(&source, &ModulePath::none());
    let program = compiled.program.take()?;
    let config = Config { memory: 64 << 20, budget: Some(300_000), seed, ..Config::DEFAULT };
    let host = VirtualHost::new();
    let captured = host.captured();
    let mut machine = machine(config, Box::new(host)).ok()?;
    run_in(&mut machine, &program).ok()?;
    // The failure that was seen last in each task is the one that a clause of recovery takes. Before one of
    // `handler-case` runs, cleanups can fail.
    let mut last: BTreeMap<String, String> = BTreeMap::new();
    for line in captured.output().lines() {
        let Some((what, rest)) = line.split_once(' ') else { continue };
        let Some((id, rest)) = rest.split_once(' ') else { continue };
        let Some((task, cause)) = rest.rsplit_once(' ') else { continue };
        let (id, cause) = (id.to_lowercase(), cause.to_lowercase());
        let kind = match what {
            "IN" => {
                seen.entered.insert(id);
                continue;
            }
            "TOOK" => {
                seen.entered.insert(id.clone());
                if let Some(cause) = last.get(task) {
                    seen.causes.entry(("clause".into(), id)).or_default().insert(cause.clone());
                }
                continue;
            }
            "CAUGHT" => {
                seen.entered.insert(id.clone());
                seen.causes.entry(("clause".into(), id)).or_default().insert(cause);
                continue;
            }
            "BY" if id.starts_with('f') => "function",
            "BY" if id.contains('-') || id == "main" => "task",
            "BY" => "form",
            "OUT" => "leaves clause",
            _ => continue,
        };
        last.insert(task.to_string(), cause.clone());
        seen.causes.entry((kind.into(), id)).or_default().insert(cause);
    }
    Some(())
}

/// Compares a program's table with its runs.
fn compare(number: u64, seeds: u64, figures: &Mutex<Figures>) {
    let text = generator::program(number);
    let source = [Source::new("generated.esl", format!("{SILENT}{text}"))];
    let mut compiled = compile_with_core(&source, &ModulePath::none());
    let errors: Vec<_> = compiled.diagnostics.iter().filter(|one| one.severity == Severity::Error).collect();
    if !errors.is_empty() {
        let lost = format!("program {number} does not compile: {errors:?}\n{text}");
        figures.lock().expect("no thread panics").missed.push(lost);
        return;
    }
    let cores = std::mem::take(&mut compiled.core);
    let (table, _) = analyze(cores, &compiled.sources, &AnalysisOptions { all: true, explained: None });
    let rows = rows_of(&table, &format!("{SILENT}{text}"));
    let mut seen = SeenFailures::default();
    let runs = (0..seeds).filter(|seed| run(&text, *seed, &mut seen).is_some()).count() as u64;
    let mut missed = String::new();
    let mut count = 0;
    for (key, causes) in &seen.causes {
        let (kind, name) = key;
        for cause in causes {
            let is_error = super::STANDARD.contains(&cause.as_str()) || OF_MISTAKES.contains(&cause.as_str());
            let is_outside = OF_OUTSIDE.contains(&cause.as_str()) && kind != "task";
            if LIMITS.contains(&cause.as_str()) || is_outside {
                continue;
            }
            if is_error && kind != "function" && kind != "task" {
                continue;
            }
            let known = rows.get(key).map(Vec::as_slice).unwrap_or_default();
            count += 1;
            if !has(known, cause) {
                _ = write!(missed, "{kind} {name} has no {cause}; ");
            }
        }
    }
    let figures = &mut *figures.lock().expect("no thread panics");
    figures.programs += 1;
    figures.runs += runs;
    figures.seen += count;
    for (key, causes) in &rows {
        let (kind, name) = key;
        let known = seen.causes.get(key);
        let all: BTreeSet<&str> =
            causes.iter().filter(|row| !row.is_mistake).map(|row| row.cause.as_str()).collect();
        for cause in all {
            let kind = figures.by_kind.entry(kind.clone()).or_default();
            kind.inferred += 1;
            if known.is_some_and(|known| known.contains(cause)) {
                kind.shown += 1;
            } else if !seen.entered.contains(name) {
                kind.not_entered += 1;
            } else {
                *figures.others.entry(cause.to_string()).or_default() += 1;
            }
        }
    }
    if !missed.is_empty() {
        figures.missed.push(format!("program {number}: {missed}"));
    }
}

/// Causes of failures that arrive from outside of a body: they are in the rows of the forms that let them in,
/// and those around these, not of all functions that the body calls.
const OF_OUTSIDE: [&str; 4] =
    [":alarm", ":would-block", ":maintained-property-violation", ":unrecoverable-property-violation"];

/// Causes that come from programming errors, too.
const OF_MISTAKES: [&str; 3] = [":all-failed", ":would-block", ":budget-exhausted"];

fn variable(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |count| count.parse().expect("a number"))
}

#[test]
fn failures_of_generated_programs_are_in_their_rows() {
    let (from, count) = (variable("ESL_ORACLE_FROM", 0), variable("ESL_ORACLE_PROGRAMS", PROGRAMS));
    let seeds = variable("ESL_ORACLE_SEEDS", 1);
    let (next, figures) = (AtomicU64::new(from), Mutex::new(Figures::default()));
    std::thread::scope(|scope| {
        for _ in 0..variable("ESL_ORACLE_JOBS", 1) {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= from + count {
                        break;
                    }
                    compare(number, seeds, &figures);
                }
            });
        }
    });
    let figures = figures.into_inner().expect("no thread panics");
    eprintln!("{} programs, {} runs, {} failures compared", figures.programs, figures.runs, figures.seen);
    for (kind, shown) in &figures.by_kind {
        eprintln!("{kind}: {shown:?}");
    }
    let mut others: Vec<_> = figures.others.iter().collect();
    others.sort_by_key(|(_, count)| std::cmp::Reverse(**count));
    eprintln!("not shown: {others:?}");
    let first: Vec<&str> = figures.missed.iter().take(40).map(String::as_str).collect();
    assert!(first.is_empty(), "{} of {}:\n{}", figures.missed.len(), figures.programs, first.join("\n"));
}

/// Writes the program with the number in the variable `ESL_ORACLE_SHOWN`.
#[test]
fn a_program_is_shown_on_request() {
    if let Ok(number) = std::env::var("ESL_ORACLE_SHOWN") {
        let number = number.parse().expect("a number");
        eprintln!("{TELLING}{0}\n---\n{SILENT}{0}", generator::program(number));
    }
}
