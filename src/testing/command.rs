//! `eslvm test`: the tests of several files, in several threads, and what is said of them.
#![allow(clippy::print_stdout, reason = "commands print")]

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use esl_compiler::diagnostic::{Format, Renderer};
use esl_vm::host::Rights;
use esl_vm::vm::Config;

use super::{Setup, Test, Verdict, junit, list, run_test};
use crate::command::{self, FAILED, NOT_COMPILED, ProgramFile, SUCCESS, StatusLine, USAGE, complain};
use crate::coverage::{Coverage, CoverageReport, refuse_compiled};
use crate::module_path::ModulePath;
use crate::program::{self, Modules, Program};

/// Which tests to run, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Only tests whose names contain this, in any case.
    pub filter: Option<String>,
    /// Number of tests that run at the same time.
    pub jobs: usize,
    /// The one seed to run tests with, in place of their own.
    pub seed: Option<u64>,
    /// File for a report in JUnit's form.
    pub junit: Option<PathBuf>,
    /// File for the coverage of the tests, in lcov's form.
    pub coverage: Option<PathBuf>,
    /// Limits of each test.
    pub config: Config,
    /// What of the outside a test may reach.
    pub rights: Rights,
    /// Whether a terminal is not to be told how far the tests are.
    pub is_quiet: bool,
}

/// A file with tests.
struct Suite<'a> {
    file: &'a Path,
    program: Program,
    setup: Setup,
}

/// A test of a file, and what became of it.
pub(super) struct Run<'a> {
    suite: &'a Suite<'a>,
    pub(super) test: Test,
    pub(super) result: Mutex<Option<FinishedTest>>,
}

impl Run<'_> {
    /// Returns the name of the file.
    pub(super) fn file(&self) -> String {
        self.suite.file.display().to_string()
    }
}

/// What became of a test.
pub(super) struct FinishedTest {
    pub(super) verdict: Verdict,
    /// Seed with which it has failed.
    seed: Option<u64>,
    pub(super) time: Duration,
}

/// Runs the tests of `files`, and prints what becomes of them. Returns the exit status.
pub fn run(files: &[PathBuf], library: &[PathBuf], options: &Options) -> u8 {
    for output in [&options.junit, &options.coverage].into_iter().flatten() {
        if let Err(status) = command::refuse_overwriting(output, files.iter().map(PathBuf::as_path)) {
            return status;
        }
    }
    let suites = match files
        .iter()
        .map(|file| suite(file, library, options))
        .collect::<Result<Vec<Suite<'_>>, u8>>()
    {
        Ok(suites) => suites,
        Err(status) => return status,
    };
    let mut runs = Vec::new();
    for suite in &suites {
        match list(&suite.program, &suite.setup) {
            Ok(tests) => {
                let wanted = tests.into_iter().filter(|test| is_wanted(test, options.filter.as_deref()));
                runs.extend(wanted.map(|test| Run { suite, test, result: Mutex::default() }));
            }
            Err(error) => {
                complain(format_args!("{} has no tests to run: {error}", suite.file.display()));
                return FAILED;
            }
        }
    }
    let next = AtomicUsize::new(0);
    // Number of the first test that was not told of.
    let told = Mutex::new(0);
    let status_line = StatusLine::new(options.is_quiet);
    let run_all = || {
        std::thread::scope(|scope| {
            for _ in 0..options.jobs.clamp(1, runs.len().max(1)) {
                scope.spawn(|| {
                    while let Some(run) = runs.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let finished = finish(run, options);
                        *run.result.lock().unwrap_or_else(PoisonError::into_inner) = Some(finished);
                        let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
                        status_line.beneath(|| tell(&runs, &mut told, options));
                    }
                });
            }
        });
    };
    status_line.during(|| progress(&runs), run_all);
    let failed = runs.iter().filter(|run| has_failed(run)).count();
    println!("{} passed, {failed} failed", runs.len() - failed);
    if let Some(path) = &options.junit
        && let Err(error) = std::fs::write(path, junit::report(&runs))
    {
        complain(format_args!("{} cannot be written: {error}", path.display()));
        return USAGE;
    }
    if let Some(path) = &options.coverage {
        let mut report = CoverageReport::default();
        for coverage in suites.iter().filter_map(|suite| suite.setup.coverage.as_ref()) {
            report.merge(coverage.lock().unwrap_or_else(PoisonError::into_inner).report());
        }
        print!("\n{}", report.table());
        if let Err(error) = std::fs::write(path, report.lcov()) {
            complain(format_args!("{} cannot be written: {error}", path.display()));
            return USAGE;
        }
    }
    if failed > 0 { FAILED } else { SUCCESS }
}

/// Says how many of the tests have ended, and which one goes on.
fn progress(runs: &[Run<'_>]) -> String {
    let has_ended = |run: &Run<'_>| run.result.lock().unwrap_or_else(PoisonError::into_inner).is_some();
    let ended = runs.iter().filter(|run| has_ended(run)).count();
    let first = runs.iter().find(|run| !has_ended(run)).map_or("", |run| &run.test.name);
    format!("{ended} of {} tests; {first}", runs.len())
}

/// Reads and compiles a file.
///
/// # Errors
/// The exit status, after a message.
fn suite<'a>(file: &'a Path, library: &[PathBuf], options: &Options) -> Result<Suite<'a>, u8> {
    let path = ModulePath::new([file], library);
    let mut coverage = None;
    let program = match command::read_program(file)? {
        ProgramFile::Compiled(_) if options.coverage.is_some() => return Err(refuse_compiled(file)),
        ProgramFile::Compiled(program) => program,
        ProgramFile::Source(source) => {
            let compile = || match &options.coverage {
                Some(_) => program::compile_covered(&[source], &path),
                None => program::compile_with(&[source], &path, Modules::Inside),
            };
            let line = || format!("compiling {}", file.display());
            let compiled = StatusLine::new(options.is_quiet).during(line, compile);
            let color = command::wants_color();
            command::print_diagnostics(&compiled, &Renderer { color, format: Format::Human });
            coverage = options.coverage.is_some().then(|| Arc::new(Mutex::new(Coverage::new(&compiled))));
            compiled.program.ok_or(NOT_COMPILED)?
        }
    };
    let (config, rights) = (options.config.clone(), options.rights.clone());
    let setup = Setup { config, path, rights, coverage };
    Ok(Suite { file, program, setup })
}

fn is_wanted(test: &Test, filter: Option<&str>) -> bool {
    filter.is_none_or(|filter| test.name.to_lowercase().contains(&filter.to_lowercase()))
}

fn has_failed(run: &Run<'_>) -> bool {
    let result = run.result.lock().unwrap_or_else(PoisonError::into_inner);
    result.as_ref().is_none_or(|finished| finished.verdict != Verdict::Passed)
}

/// Runs a test with each of its seeds, until it fails.
fn finish(run: &Run<'_>, options: &Options) -> FinishedTest {
    let start = Instant::now();
    let seeds = match options.seed {
        Some(seed) => seed..seed.saturating_add(1),
        None => 0..if run.test.explores { 1 } else { run.test.seeds },
    };
    let mut finished = FinishedTest { verdict: Verdict::Passed, seed: None, time: Duration::ZERO };
    for seed in seeds {
        let verdict = run_test(&run.suite.program, &run.test, seed, &run.suite.setup);
        let verdict = verdict.unwrap_or_else(|error| Verdict::Failed {
            why: "it cannot be begun".into(),
            output: error.to_string(),
        });
        if verdict != Verdict::Passed {
            finished = FinishedTest { verdict, seed: (!run.test.explores).then_some(seed), ..finished };
            break;
        }
    }
    FinishedTest { time: start.elapsed(), ..finished }
}

/// Prints what became of the tests from `told` on that have ended, in the order of the files.
fn tell(runs: &[Run<'_>], told: &mut usize, options: &Options) {
    while let Some(run) = runs.get(*told) {
        let result = run.result.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(finished) = result.as_ref() else { return };
        if *told == 0 || !std::ptr::eq(runs[*told - 1].suite, run.suite) {
            println!("{}", run.file());
        }
        print!("{}", text(run, finished, options));
        *told += 1;
    }
}

/// Returns the lines that say what became of a test.
fn text(run: &Run<'_>, finished: &FinishedTest, options: &Options) -> String {
    let Test { name, seeds, explores } = &run.test;
    let Verdict::Failed { why, output } = &finished.verdict else {
        let how = match options.seed {
            None if *explores => ", all schedules".into(),
            None if *seeds > 1 => format!(", {seeds} seeds"),
            _ => String::new(),
        };
        return format!("  passed  {name}{how}\n");
    };
    let seed = finished.seed.map_or(String::new(), |seed| format!(", seed {seed}"));
    let mut text = format!("  FAILED  {name}{seed}: {why}\n");
    // Writing to a string does not fail.
    output.lines().for_each(|line| _ = writeln!(text, "          {line}"));
    let again = finished.seed.map_or(String::new(), |seed| format!(" --seed {seed}"));
    _ = writeln!(text, "          again: eslvm test {} --filter {}{again}", run.file(), quoted(name));
    text
}

/// Returns a word as a shell reads it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_+.,/:@%".contains(c);
    if word.chars().all(is_plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}
