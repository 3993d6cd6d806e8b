//! Whole programs: their diagnostics, their tests, runs with recordings and replays.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use esl::host::{RealHost, Rights};
use esl::module_path::ModulePath;
use esl::program::{self, Compiled, Modules, Program, Source};
use esl::{Config, Error};
use esl_replay::{Replayed, RunSetup};
use esl_testing::{Setup, Verdict, list, run_test};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::engine::rights;
use crate::failure::{Places, exception, of_error};
use crate::output::{Output, screen};

fn read(py: Python<'_>, file: &Path) -> PyResult<String> {
    let unreadable =
        |reason: String| of_error(py, Error::Unreadable { file: file.display().to_string(), reason });
    let bytes = std::fs::read(file).map_err(|error| unreadable(error.to_string()))?;
    String::from_utf8(bytes).map_err(|error| unreadable(error.to_string()))
}

/// Returns the diagnostics of a compilation as arguments of `esl.Diagnostic`. Those of modules have no text
/// here, so their places are those of the module's file.
fn diagnostics<'py>(
    py: Python<'py>,
    compiled: &Compiled,
    name: &str,
    text: &str,
) -> PyResult<Bound<'py, PyList>> {
    Places::new(name, text).all(py, &compiled.diagnostics)
}

fn compile_text(name: &str, text: &str, path: &ModulePath) -> Compiled {
    program::compile_with(&[Source::new(name, text)], path, Modules::Inside)
}

/// Returns the program of a source or compiled file.
///
/// # Errors
/// `CompileError`, or that of the file.
fn program_of(py: Python<'_>, file: &Path, path: &ModulePath) -> PyResult<Program> {
    if file.extension().is_some_and(|extension| extension == "eslb") {
        let unreadable =
            |reason: String| of_error(py, Error::Unreadable { file: file.display().to_string(), reason });
        let bytes = std::fs::read(file).map_err(|error| unreadable(error.to_string()))?;
        return Program::from_bytes(&bytes).map_err(|error| of_error(py, Error::Refused(error)));
    }
    let (name, text) = (file.display().to_string(), read(py, file)?);
    let compiled = py.detach(|| compile_text(&name, &text, path));
    if compiled.has_errors() {
        let rows = diagnostics(py, &compiled, &name, &text)?;
        let message = Error::DoesNotCompile(compiled.diagnostics).to_string();
        return Err(exception(py, "CompileError", (message, rows)));
    }
    compiled.program.ok_or_else(|| PyRuntimeError::new_err("the compilation was stopped by a limit"))
}

/// Compiles a text without running it. Returns the rows of its diagnostics.
#[pyfunction]
pub(crate) fn check<'py>(
    py: Python<'py>,
    name: &str,
    text: &str,
    file: Option<PathBuf>,
) -> PyResult<Bound<'py, PyList>> {
    let path = file.map_or_else(ModulePath::none, |file| ModulePath::new([file.as_path()], &[]));
    let compiled = py.detach(|| compile_text(name, text, &path));
    diagnostics(py, &compiled, name, text)
}

/// The tests of a file, compiled.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Tests {
    program: Arc<Program>,
    setup: Setup,
    tests: Vec<esl_testing::Test>,
}

#[pymethods]
impl Tests {
    #[new]
    #[pyo3(signature = (file, folders = Vec::new(), allow = Vec::new(), budget = None))]
    fn new(
        py: Python<'_>,
        file: PathBuf,
        folders: Vec<PathBuf>,
        allow: Vec<String>,
        budget: Option<u64>,
    ) -> PyResult<Tests> {
        let path = ModulePath::new([file.as_path()], &folders);
        let program = program_of(py, &file, &path)?;
        let config = Config { budget, ..Config::default() };
        let setup = Setup { config, path, rights: rights(&allow)?, ..Setup::default() };
        let tests = py.detach(|| list(&program, &setup)).map_err(|error| of_error(py, error))?;
        Ok(Tests { program: Arc::new(program), setup, tests })
    }

    /// The tests: name, number of seeds, whether it is explored, and place.
    #[getter]
    fn tests(&self) -> Vec<(String, u64, bool, String)> {
        let row = |test: &esl_testing::Test| {
            (test.name.clone(), test.seeds, test.explores.is_some(), test.place.clone())
        };
        self.tests.iter().map(row).collect()
    }

    /// Runs a test with a seed; under all schedules if `explores`, or if that is what it is for. Returns why
    /// it has failed, or nothing, and its output, or what the exploration says.
    fn run(
        &self,
        py: Python<'_>,
        number: usize,
        seed: u64,
        explores: bool,
    ) -> PyResult<(Option<String>, String)> {
        let mut test = self.tests.get(number).ok_or_else(|| PyValueError::new_err("no such test"))?.clone();
        if explores {
            test.explores.get_or_insert_default();
        }
        let verdict = py.detach(|| run_test(&self.program, &test, seed, &self.setup));
        Ok(match verdict.map_err(|error| of_error(py, error))? {
            Verdict::Passed => (None, String::new()),
            Verdict::PassedAll(how) => (None, how),
            Verdict::Failed { why, output, .. } => (Some(why), output),
        })
    }
}

fn of_replay(error: esl_replay::ReplayError) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}

/// Runs a program to its end, and writes a recording of the run to a file if there is one. Returns its exit
/// status and the report of the failure or the deadlock that has ended it.
#[pyfunction]
#[pyo3(signature = (file, recording, virtual_clock, allow, memory, seed, budget, arguments, output))]
#[expect(clippy::too_many_arguments, reason = "they are keyword arguments in Python")]
pub(crate) fn run(
    py: Python<'_>,
    file: PathBuf,
    recording: Option<PathBuf>,
    virtual_clock: bool,
    allow: Vec<String>,
    memory: Option<usize>,
    seed: u64,
    budget: Option<u64>,
    arguments: Vec<String>,
    output: Option<Py<PyAny>>,
) -> PyResult<(u8, Option<String>)> {
    let path = ModulePath::new([file.as_path()], &[]);
    let program = program_of(py, &file, &path)?;
    let memory = memory.unwrap_or(Config::DEFAULT.memory);
    let config = Config { memory, seed, budget, ..Config::default() };
    let host = host(arguments, path.with_rights(rights(&allow)?), virtual_clock, output);
    let summary = py.detach(|| -> PyResult<_> {
        let Some(recording) = recording else {
            let run = || {
                let mut machine = program::machine(config, Box::new(host))?;
                program::set_module_path(&mut machine, &path)?;
                program::run_in(&mut machine, &program)
            };
            return run().map_err(|error| Python::attach(|py| of_error(py, error)));
        };
        let folders = path.folders().iter().map(|folder| folder.to_string_lossy().into_owned()).collect();
        let setup = RunSetup { config, folders, program_file: path.program_file(), ..RunSetup::default() };
        esl_replay::record(&program, &setup, host, &recording, |_| ()).map_err(of_replay)
    })?;
    Ok((summary.ended.exit_status(), summary.report))
}

fn host(arguments: Vec<String>, rights: Rights, is_virtual: bool, output: Option<Py<PyAny>>) -> RealHost {
    let host = RealHost::new(arguments).with_rights(rights);
    let host = if is_virtual { host.with_virtual_time() } else { host };
    match output {
        Some(function) => host.with_screen(screen(Output::new(Arc::new(function)))),
        None => host,
    }
}

/// End of a replay: its exit status, if it was the same run; the difference, if it was another one; its
/// output on both streams, and its ticks.
type ReplayRow = (Option<u8>, Option<String>, String, String, u64);

/// Runs a recorded run again, to its end. Returns its exit status, if it was the same run; what differs, if
/// it was another one; its output on both streams, and its ticks.
#[pyfunction]
pub(crate) fn replay(py: Python<'_>, file: PathBuf) -> PyResult<ReplayRow> {
    let replay =
        py.detach(|| esl_replay::replay(&file).map_err(Box::new)).map_err(|error| of_replay(*error))?;
    let (status, difference) = match replay.replayed {
        Replayed::Equal(status) => (Some(status), None),
        Replayed::Cut => (None, None),
        Replayed::Diverged(difference) => (None, Some(difference)),
    };
    Ok((status, difference, replay.output, replay.errors, replay.ticks))
}
