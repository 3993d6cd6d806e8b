//! `eslvm test --inject`: tests and programs with injected faults.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use esl::module_path::ModulePath;
use esl::program;
use esl_analysis::{AnalysisOptions, analyze};
use esl_command as command;
use esl_command::{FAILED, NOT_COMPILED, ProgramFile, SUCCESS, StatusLine, USAGE, complain, say_part};
use esl_compiler::diagnostic::{Format, Renderer};
use esl_testing::inject::{
    InjectFormat, InjectSettings, InjectionReport, InjectionSubject, KnownFailures, inject, render, summary,
};
use esl_testing::{Setup, list, may_define_tests};

use super::{Options, TestFiles, is_wanted};

/// Which faults are injected, and the form of the table.
#[derive(Clone, Debug)]
pub struct InjectOptions {
    /// Settings.
    pub settings: InjectSettings,
    /// Form of the table.
    pub format: InjectFormat,
}

/// Runs the tests of files, or the programs in them, with injected faults, and prints the table. Returns the
/// exit status.
pub fn run(paths: &[PathBuf], library: &[PathBuf], options: &Options, injecting: &InjectOptions) -> u8 {
    match run_files(paths, library, options, injecting) {
        Ok(status) | Err(status) => status,
    }
}

fn run_files(
    paths: &[PathBuf],
    library: &[PathBuf],
    options: &Options,
    injecting: &InjectOptions,
) -> Result<u8, u8> {
    let found = TestFiles::find(paths)?;
    let mut reports = Vec::new();
    for file in &found.files {
        let subject = LoadedFile::new(file, library, options)?;
        for report in subject.inject(options, injecting)? {
            reports.push((file.display().to_string(), report));
        }
    }
    if reports.is_empty() {
        found.complain_of_none(options.filter.as_deref(), 0);
        return Ok(command::NO_TESTS);
    }
    let is_unknown = reports.iter().all(|(_, report)| report.rows.is_empty() && report.problem.is_none());
    if let (Some(only), true) = (&injecting.settings.only, is_unknown) {
        complain(format_args!("no fault is called `{only}`; without --inject-only, the table has the names"));
        return Err(USAGE);
    }
    say_part!("{}", render(&reports, injecting.format));
    let all = summary(reports.iter().map(|(_, report)| report));
    Ok(if all.bad + all.problems > 0 { FAILED } else { SUCCESS })
}

/// A file whose program is run with faults.
struct LoadedFile {
    name: String,
    program: program::Program,
    known: KnownFailures,
    setup: Setup,
}

impl LoadedFile {
    /// Compiles a file, and looks for the causes of failures in it.
    ///
    /// # Errors
    /// The exit status, after a message.
    fn new(file: &Path, library: &[PathBuf], options: &Options) -> Result<LoadedFile, u8> {
        let path = ModulePath::new([file], library);
        let (program, known) = match command::read_program(file)? {
            ProgramFile::Compiled(program) => (program, KnownFailures::new()),
            ProgramFile::Source(source) => {
                let line = || format!("compiling {}", file.display());
                let compile = || program::compile_with_core(std::slice::from_ref(&source), &path);
                let mut compiled = StatusLine::new(options.is_quiet).during(line, compile);
                let color = command::wants_color();
                command::print_diagnostics(&compiled, &Renderer { color, format: Format::Human });
                let program = compiled.program.take().ok_or(NOT_COMPILED)?;
                let cores = std::mem::take(&mut compiled.core);
                let (table, _) = analyze(cores, &compiled.sources, &AnalysisOptions::default());
                if table.is_incomplete {
                    complain(format_args!(
                        "the failures of the mocks in {} are not found: too many functions flow through it as values",
                        file.display()
                    ));
                }
                (program, table.causes_by_name())
            }
        };
        let (config, rights) = (options.config.clone(), options.rights.clone());
        let setup = Setup { config, path, rights, ..Setup::default() };
        Ok(LoadedFile { name: file.display().to_string(), program, known, setup })
    }

    /// Runs the tests of the file that are wanted, or its program if it has none.
    ///
    /// # Errors
    /// The exit status, after a message.
    fn inject(&self, options: &Options, injecting: &InjectOptions) -> Result<Vec<InjectionReport>, u8> {
        let refuse = |error: esl::Error| {
            complain(format_args!("{} cannot be run: {error}", self.name));
            FAILED
        };
        // A program without tests need not come to its end.
        let tests = match may_define_tests(&self.program) {
            true => list(&self.program, &self.setup).unwrap_or_default(),
            false => Vec::new(),
        };
        let names: Vec<Option<&str>> = if tests.is_empty() {
            vec![None]
        } else {
            let wanted = tests.iter().filter(|test| is_wanted(test, options.filter.as_deref()));
            wanted.map(|test| Some(test.name.as_str())).collect()
        };
        let settings = InjectSettings { jobs: options.jobs, ..injecting.settings.clone() };
        let mut reports = Vec::new();
        for test in names {
            let seed = options.seed.unwrap_or(0);
            let subject = InjectionSubject { program: &self.program, test, seed, setup: &self.setup };
            let told = Mutex::new((0, 0));
            let note = |done: usize, all: usize| {
                if let Ok(mut told) = told.lock() {
                    *told = (done, all);
                }
            };
            let line = || {
                let (done, all) = told.lock().map_or((0, 0), |told| *told);
                format!("{done} of {all} runs; {}", test.unwrap_or(&self.name))
            };
            let work = || inject(&subject, &self.known, &settings, &note);
            reports.push(StatusLine::new(options.is_quiet).during(line, work).map_err(refuse)?);
        }
        Ok(reports)
    }
}
