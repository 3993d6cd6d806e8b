//! `eslvm test`: the tests of several files, in several threads, and what is said of them.

mod findings;
pub mod inject;
mod junit;
mod watch;

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use esl::Error;
use esl::module_path::ModulePath;
use esl::program::{self, Modules, Program, Source};
use esl_command as command;
use esl_command::{
    FAILED, NO_TESTS, NOT_COMPILED, ProgramFile, SUCCESS, StatusLine, USAGE, complain, refuse_compiled, say,
    say_part,
};
use esl_compiler::diagnostic::{Format, Renderer};
use esl_host::Rights;
use esl_testing::coverage::{Coverage, CoverageReport};
use esl_testing::{Setup, Test, Verdict, list, run_and_explore, run_test};
use esl_vm::vm::Config;

use findings::ShownSchedule;

/// Which tests to run, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Only tests whose names contain this, in any case.
    pub filter: Option<String>,
    /// Whether to run them again whenever a source changes.
    pub is_watching: bool,
    /// Number of tests that run at the same time.
    pub jobs: usize,
    /// The one seed to run tests with, in place of their own.
    pub seed: Option<u64>,
    /// File for a report in JUnit's form.
    pub junit: Option<PathBuf>,
    /// File for the schedules under which tests fail, as JSON, which editors show.
    pub findings: Option<PathBuf>,
    /// File for the coverage of the tests, in lcov's form.
    pub coverage: Option<PathBuf>,
    /// Limits of each test.
    pub config: Config,
    /// The rights of a test.
    pub rights: Rights,
    /// Whether a terminal is not to be told how far the tests are.
    pub is_quiet: bool,
    /// Whether reports of failures show all calls of the library.
    pub is_full: bool,
    /// Whether tests of several tasks are explored unasked, if their schedules are few.
    pub explores: bool,
}

/// A file with tests.
struct Suite<'a> {
    file: &'a Path,
    program: Program,
    setup: Setup,
    /// The source, unless the file is compiled.
    source: Option<Source>,
    /// Whether tests are explored unasked.
    explores: bool,
    /// The program with points, once it was needed.
    marked: OnceLock<Option<Arc<Program>>>,
}

impl Suite<'_> {
    /// Returns the program with points, if its source is there.
    fn marked(&self) -> Option<&Arc<Program>> {
        let compile = || {
            let source = std::slice::from_ref(self.source.as_ref()?);
            program::compile_with_points(source, &self.setup.path).program.map(Arc::new)
        };
        self.marked.get_or_init(compile).as_ref()
    }

    /// Makes the program with points that of tests which are explored strictly.
    fn add_points(&mut self) {
        self.setup.with_points = self.marked().cloned();
    }
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

    /// Returns the command that repeats it.
    fn again(&self, finished: &FinishedTest) -> String {
        let seed = finished.seed.map_or(String::new(), |seed| format!(" --seed {seed}"));
        format!("eslvm test {} --filter {}{seed}", self.file(), quoted(&self.test.name))
    }
}

/// The outcome of a test.
pub(super) struct FinishedTest {
    pub(super) verdict: Verdict,
    /// Seed with which it has failed.
    seed: Option<u64>,
    pub(super) time: Duration,
    /// The schedule under which it has failed.
    shown: Option<ShownSchedule>,
}

impl FinishedTest {
    /// Returns why it has failed, and what is said of that, if it has.
    pub(super) fn failure(&self) -> Option<(&str, String)> {
        let Verdict::Failed { why, output, .. } = &self.verdict else { return None };
        let lines = self.shown.iter().flat_map(|shown| &shown.lines).map(String::as_str);
        let lines: String = output.lines().chain(lines).flat_map(|line| [line, "\n"]).collect();
        Some((why, lines))
    }
}

/// Runs the tests of `paths`, files and folders, and prints what becomes of them; again and again if that is
/// wanted. Returns the exit status.
pub fn run(paths: &[PathBuf], library: &[PathBuf], options: &Options) -> u8 {
    if !options.is_watching {
        return run_once(paths, library, options);
    }
    let folders = watch::folders(paths);
    loop {
        let before = watch::state(&folders);
        run_once(paths, library, options);
        say!("\nwaiting for a change of a source; Ctrl-C ends");
        watch::wait(&folders, &before);
        say!();
    }
}

/// The files in which tests are looked for.
struct TestFiles {
    files: Vec<PathBuf>,
    /// Those of them that were named.
    named: Vec<PathBuf>,
    /// Folders in which no file has the name of one with tests.
    without: Vec<PathBuf>,
}

impl TestFiles {
    /// Finds the files with tests in folders.
    ///
    /// # Errors
    /// The exit status, after a message.
    fn find(paths: &[PathBuf]) -> Result<TestFiles, u8> {
        let mut found = TestFiles { files: Vec::new(), named: Vec::new(), without: Vec::new() };
        let here = [PathBuf::from(".")];
        for path in if paths.is_empty() { &here[..] } else { paths } {
            if !path.is_dir() {
                found.named.push(path.clone());
                found.files.push(path.clone());
                continue;
            }
            let tests: Vec<PathBuf> = command::sources_in(path)?
                .into_iter()
                .filter(|file| command::is_test_file(path, file))
                .collect();
            if tests.is_empty() {
                found.without.push(path.clone());
            }
            found.files.extend(tests);
        }
        let mut seen = std::collections::HashSet::new();
        found.files.retain(|file| seen.insert(file.clone()));
        Ok(found)
    }

    /// Says where no test was found. `total` is the number of all tests, before they are selected.
    fn complain_of_none(&self, filter: Option<&str>, total: usize) {
        if let (Some(filter), true) = (filter, total > 0) {
            let tests = if total == 1 { "test" } else { "tests" };
            return complain(format_args!(
                "no name of a test contains `{filter}`; there are {total} {tests} in all"
            ));
        }
        for folder in &self.without {
            complain(format_args!(
                "no file with tests is in {}: their names are test.esl, *_test.esl or *-test.esl, or they are in a \
                 folder named tests; name any other file itself",
                folder.display()
            ));
        }
    }
}

/// Runs the tests of files and folders once. Returns the exit status.
fn run_once(paths: &[PathBuf], library: &[PathBuf], options: &Options) -> u8 {
    match TestFiles::find(paths).and_then(|files| run_files(&files, library, options)) {
        Ok(status) | Err(status) => status,
    }
}

/// Runs the tests of files. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
fn run_files(found: &TestFiles, library: &[PathBuf], options: &Options) -> Result<u8, u8> {
    let files = &found.files;
    for output in [&options.junit, &options.findings, &options.coverage].into_iter().flatten() {
        command::refuse_overwriting(output, files.iter().map(PathBuf::as_path))?;
    }
    let mut suites =
        files.iter().map(|file| suite(file, library, options)).collect::<Result<Vec<Suite<'_>>, u8>>()?;
    let mut lists = Vec::new();
    for suite in &mut suites {
        let tests = list(&suite.program, &suite.setup).map_err(|error| {
            let reason = match error {
                Error::BudgetSpent => {
                    "its top-level forms have spent the budget of ticks; raise it by --budget".into()
                }
                error => error.to_string(),
            };
            complain(format_args!("{} has no tests to run: {reason}", suite.file.display()));
            FAILED
        })?;
        refuse_two_of_one_name(suite.file, &tests)?;
        if tests.is_empty() && found.named.iter().any(|named| named == suite.file) {
            complain(format_args!("{} has no tests: `deftest` defines one", suite.file.display()));
        }
        if tests.iter().any(|test| test.explores.is_some_and(|explores| explores.strict)) {
            suite.add_points();
        }
        lists.push(tests);
    }
    let mut runs = Vec::new();
    let mut total = 0;
    for (suite, tests) in suites.iter().zip(lists) {
        total += tests.len();
        let wanted = tests.into_iter().filter(|test| is_wanted(test, options.filter.as_deref()));
        runs.extend(wanted.map(|test| Run { suite, test, result: Mutex::default() }));
    }
    run_all(&runs, options);
    let failed = runs.iter().filter(|run| has_failed(run)).count();
    say!("{} passed, {failed} failed", runs.len() - failed);
    if let Some(path) = &options.junit
        && let Err(error) = std::fs::write(path, junit::report(&runs))
    {
        complain(format_args!("{} cannot be written: {error}", path.display()));
        return Err(USAGE);
    }
    if let Some(path) = &options.findings
        && let Err(error) = findings::write(path, &runs)
    {
        complain(format_args!("{} cannot be written: {error}", path.display()));
        return Err(USAGE);
    }
    if let Some(path) = &options.coverage {
        let mut report = CoverageReport::default();
        for coverage in suites.iter().filter_map(|suite| suite.setup.coverage.as_ref()) {
            report.merge(coverage.lock().unwrap_or_else(PoisonError::into_inner).report());
        }
        say_part!("\n{}", report.table());
        if let Err(error) = std::fs::write(path, report.lcov()) {
            complain(format_args!("{} cannot be written: {error}", path.display()));
            return Err(USAGE);
        }
    }
    if runs.is_empty() {
        found.complain_of_none(options.filter.as_deref(), total);
        return Ok(NO_TESTS);
    }
    Ok(if failed > 0 { FAILED } else { SUCCESS })
}

/// Refuses a file with two tests of one name, of which only one would count.
///
/// # Errors
/// The exit status, after a message for each name.
fn refuse_two_of_one_name(file: &Path, tests: &[Test]) -> Result<(), u8> {
    let mut result = Ok(());
    for (number, test) in tests.iter().enumerate() {
        if let Some(first) = tests[..number].iter().find(|other| other.name == test.name) {
            let (name, file) = (&test.name, file.display());
            complain(format_args!(
                "{file} has two tests `{name}`, at {} and at {}: rename one",
                first.place, test.place
            ));
            result = Err(NOT_COMPILED);
        }
    }
    result
}

/// Runs tests, several at a time, and prints what becomes of them in their order.
fn run_all(runs: &[Run<'_>], options: &Options) {
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
                        status_line.beneath(|| tell(runs, &mut told, options));
                    }
                });
            }
        });
    };
    status_line.during(|| progress(runs), run_all);
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
    let (mut coverage, mut source) = (None, None);
    let program = match command::read_program(file)? {
        ProgramFile::Compiled(_) if options.coverage.is_some() => return Err(refuse_compiled(file)),
        ProgramFile::Compiled(program) => program,
        ProgramFile::Source(read) => {
            let sources = std::slice::from_ref(source.insert(read));
            let compile = || match &options.coverage {
                Some(_) => program::compile_covered(sources, &path),
                None => program::compile_with(sources, &path, Modules::Inside),
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
    let setup = Setup { config, path, rights, coverage, is_full: options.is_full, with_points: None };
    let explores = options.explores && options.seed.is_none() && options.coverage.is_none();
    Ok(Suite { file, program, setup, source, explores, marked: OnceLock::new() })
}

fn is_wanted(test: &Test, filter: Option<&str>) -> bool {
    filter.is_none_or(|filter| test.name.to_lowercase().contains(&filter.to_lowercase()))
}

fn has_failed(run: &Run<'_>) -> bool {
    let result = run.result.lock().unwrap_or_else(PoisonError::into_inner);
    result.as_ref().is_none_or(|finished| matches!(finished.verdict, Verdict::Failed { .. }))
}

/// Runs a test with each of its seeds, until it fails.
fn finish(run: &Run<'_>, options: &Options) -> FinishedTest {
    let start = Instant::now();
    let seeds = match options.seed {
        // An exploration tries everything that a seed can pick.
        _ if run.test.explores.is_some() => 0..1,
        Some(seed) => seed..seed.saturating_add(1),
        None => 0..run.test.seeds,
    };
    let mut finished =
        FinishedTest { verdict: Verdict::Passed, seed: None, time: Duration::ZERO, shown: None };
    for seed in seeds {
        let found = match run.test.may_explore && run.suite.explores {
            true => run_and_explore(&run.suite.program, &run.test, &run.suite.setup),
            false => run_test(&run.suite.program, &run.test, seed, &run.suite.setup)
                .map(|verdict| (verdict, run.test.explores.is_some())),
        };
        let (verdict, is_explored) = found.unwrap_or_else(|error| {
            let (why, output) = ("it cannot be begun".into(), error.to_string());
            (Verdict::Failed { why, output, schedule: None }, false)
        });
        let seed = (!is_explored).then_some(seed);
        match verdict {
            Verdict::Passed => {}
            Verdict::PassedAll(_) => finished = FinishedTest { verdict, ..finished },
            Verdict::Failed { .. } => {
                finished = FinishedTest { verdict, seed, ..finished };
                break;
            }
        }
    }
    let shown = shown(run, &finished.verdict);
    FinishedTest { time: start.elapsed(), shown, ..finished }
}

/// Returns the schedule under which a test has failed, if there is one. It is left out if it cannot be
/// followed for want of memory.
fn shown(run: &Run<'_>, verdict: &Verdict) -> Option<ShownSchedule> {
    let Verdict::Failed { schedule: Some(schedule), .. } = verdict else { return None };
    let suite = run.suite;
    let program = suite.marked().map_or(&suite.program, |marked| &**marked);
    ShownSchedule::of(schedule, program, &run.test, &suite.setup).ok()
}

/// Prints what became of the tests from `told` on that have ended, in the order of the files.
fn tell(runs: &[Run<'_>], told: &mut usize, options: &Options) {
    while let Some(run) = runs.get(*told) {
        let result = run.result.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(finished) = result.as_ref() else { return };
        if *told == 0 || !std::ptr::eq(runs[*told - 1].suite, run.suite) {
            say!("{}", run.file());
        }
        say_part!("{}", text(run, finished, options));
        *told += 1;
    }
}

/// Returns the lines that say what became of a test.
fn text(run: &Run<'_>, finished: &FinishedTest, options: &Options) -> String {
    let Test { name, seeds, .. } = &run.test;
    match &finished.verdict {
        Verdict::Passed if options.seed.is_none() && *seeds > 1 => {
            return format!("  passed  {name}, {seeds} seeds\n");
        }
        Verdict::Passed => return format!("  passed  {name}\n"),
        Verdict::PassedAll(how) => return format!("  passed  {name}, {how}\n"),
        Verdict::Failed { .. } => {}
    }
    let (why, output) = finished.failure().unwrap_or_default();
    let seed = finished.seed.map_or(String::new(), |seed| format!(", seed {seed}"));
    let mut text = format!("  FAILED  {name}{seed}: {why}\n");
    // Writing to a string does not fail.
    output.lines().for_each(|line| _ = writeln!(text, "          {line}"));
    _ = writeln!(text, "          again: {}", run.again(finished));
    text
}

/// Returns a word as a shell reads it.
fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_+.,/:@%".contains(c);
    if word.chars().all(is_plain) { word.into() } else { format!("'{}'", word.replace('\'', "'\\''")) }
}
