//! Durable runs that Python embeds.

use std::path::PathBuf;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use esl::Config;
use esl::engine::HostDefinition;
use esl::host::{HostRows, RealHost};
use esl::module_path::ModulePath;
use esl::program::Source;
use esl_durable::{
    Downtime, Durability, DurableControl, DurableEnding, DurableError, DurableOptions, DurableSettings,
};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::callback;
use crate::engine::rights;
use crate::failure::{exception, of_error};
use crate::handle::Handle;
use crate::output::{Output, screen};
use crate::process::{Process, detached};

/// Longest wait until signals of the process are looked for.
const PAUSE: Duration = Duration::from_millis(50);

/// A definition of a function of Python: name, lambda list, documentation, the function, whether its calls
/// are operations, whether a call may be made twice.
type Row = (String, String, String, Py<PyAny>, bool, bool);

/// A durable run, which is open.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct DurableEngine {
    engine: Mutex<Option<esl_durable::DurableEngine>>,
    control: DurableControl,
    process: Process,
}

impl DurableEngine {
    fn lock(&self) -> PyResult<MutexGuard<'_, Option<esl_durable::DurableEngine>>> {
        self.process.check()?;
        // It is there or not, so a panic elsewhere does not corrupt it.
        Ok(self.engine.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Drop for DurableEngine {
    fn drop(&mut self) {
        let engine = self.engine.lock().unwrap_or_else(PoisonError::into_inner).take();
        if !self.process.is_current() {
            // Its tasks belong to the process that has made it.
            std::mem::forget(engine);
        }
    }
}

/// Returns the exception of a durable run that does not go on.
fn of_durable(py: Python<'_>, error: DurableError) -> PyErr {
    match error {
        DurableError::Machine(error) => of_error(py, error),
        DurableError::Diverged(_) => exception(py, "Diverged", (error.to_string(),)),
        error => exception(py, "NotDurable", (error.to_string(),)),
    }
}

fn definition(row: Row) -> HostDefinition {
    let (name, lambda_list, documentation, function, is_operation, is_idempotent) = row;
    let function = Arc::new(function);
    let definition = if is_operation {
        let begin = move |operation| callback::begin(&function, operation);
        HostDefinition::operation(&name, &lambda_list, &documentation, begin)
    } else {
        let call = move |call: esl::engine::Call| callback::call(&function, &call);
        HostDefinition::at_once(&name, &lambda_list, &documentation, call)
    };
    if is_idempotent { definition.idempotent() } else { definition }
}

#[pymethods]
impl DurableEngine {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "they are keyword arguments in Python")]
    fn new(
        py: Python<'_>,
        folder: PathBuf,
        source: (String, String),
        path: Option<PathBuf>,
        functions: Vec<Row>,
        clock: &str,
        allow: Vec<String>,
        memory: Option<usize>,
        seed: u64,
        budget: Option<u64>,
        output: Option<Py<PyAny>>,
        survives: &str,
        downtime: &str,
        snapshots: Option<&str>,
        upgrades: bool,
        from_facts: bool,
    ) -> PyResult<DurableEngine> {
        let choice = |what: &str, given: &str, choices: [&str; 2]| match choices {
            [first, _] if given == first => Ok(false),
            [_, second] if given == second => Ok(true),
            [first, second] => Err(PyValueError::new_err(format!(
                "`{given}` is not a {what}: expected `{first}` or `{second}`"
            ))),
        };
        let mut host = RealHost::new(Vec::new()).with_rights(rights(&allow)?);
        let is_virtual = choice("clock", clock, ["real", "virtual"])?;
        if is_virtual {
            host = host.with_virtual_time();
        }
        if let Some(function) = output {
            host = host.with_screen(screen(Output::new(Arc::new(function))));
        }
        let mut durable = DurableOptions { from_facts, ..DurableOptions::default() };
        if choice("durability", survives, ["process", "power"])? {
            durable.durability = Durability::Power;
        }
        if choice("downtime", downtime, ["counts", "stops"])? || is_virtual {
            durable.downtime = Downtime::Stops;
        }
        if let Some(text) = snapshots {
            durable.snapshots = text.parse().map_err(PyValueError::new_err)?;
        }
        let config =
            Config { memory: memory.unwrap_or(Config::DEFAULT.memory), seed, budget, ..Config::default() };
        let path = path.map_or_else(ModulePath::none, |path| ModulePath::new([path.as_path()], &[]));
        let functions = functions.into_iter().map(definition).collect();
        let settings = DurableSettings { durable, config, host: Some(host), functions, path, upgrades };
        let (name, text) = source;
        let sources = [Source::new(name, text)];
        let opened =
            py.detach(|| esl_durable::DurableEngine::open(&folder, &sources, settings, HostRows::new));
        let engine = opened.map_err(|error| of_durable(py, error))?;
        let control = engine.control();
        Ok(DurableEngine { engine: Mutex::new(Some(engine)), control, process: Process::current() })
    }

    /// Returns a handle, through which other threads reach the run. It does not run yet.
    fn handle(&self) -> PyResult<Handle> {
        let engine = self.lock()?;
        let engine = engine.as_ref().ok_or_else(|| {
            PyRuntimeError::new_err("the run is under way or over: make its handles before `run`")
        })?;
        Ok(Handle::new(engine.handle()))
    }

    /// Runs the program until it ends or is paused. Returns its exit status; nothing if it is paused.
    fn run(&self, py: Python<'_>) -> PyResult<Option<u8>> {
        let engine = self.lock()?.take().ok_or_else(|| {
            PyRuntimeError::new_err(
                "the run is under way or over in this process: make another engine of its folder",
            )
        })?;
        let (done, ended) = channel();
        // Signals of the process are those of this thread, so the run has another one.
        let running = thread::Builder::new().name("esl-durable".into()).spawn(move || {
            _ = done.send(engine.run());
        });
        running.map_err(|error| PyRuntimeError::new_err(format!("the system gives no thread: {error}")))?;
        // Other threads do not wait for it, but the compiler cannot know.
        let (mut interrupt, ended) = (None, Mutex::new(ended));
        let wait = || ended.lock().unwrap_or_else(PoisonError::into_inner).recv_timeout(PAUSE);
        let ended = loop {
            match detached(py, wait) {
                Ok(ended) => break ended,
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(PyRuntimeError::new_err(
                        "a fault of ESL has ended the run: please report it",
                    ));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Err(signal) = py.check_signals() {
                self.control.pause();
                interrupt.get_or_insert(signal);
            }
        };
        let ended = ended.map_err(|error| of_durable(py, error))?;
        match (interrupt, ended) {
            (Some(signal), _) => Err(signal),
            (None, DurableEnding::Paused) => Ok(None),
            (None, DurableEnding::Ended(status)) => Ok(Some(status)),
        }
    }

    /// Has `run` leave the run, so that it goes on in the next process. From any thread.
    fn pause(&self) {
        self.control.pause();
    }

    /// The number of this process of the run, and the seconds since the last record of the one before;
    /// nothing while the run has not gone on.
    #[getter]
    fn resumed(&self) -> Option<(u64, f64)> {
        self.control.resumed().map(|resumed| (resumed.life.number, resumed.downtime))
    }
}
