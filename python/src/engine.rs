//! Engines, and driving them until an answer has come.

use std::collections::HashSet;
use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError, Weak};
use std::task::Waker;
use std::time::{Duration, Instant};

use esl::engine::{BegunCall, Ending, Poll, ProgramDefinition};
use esl::host::{RealHost, Right, Rights};
use esl::{Config, Data, Error};
use pyo3::exceptions::PyValueError;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::callback;
use crate::failure::{busy, exception, of_error, of_text};
use crate::handle::{Handle, Task, all_data};
use crate::output::{Output, screen};
use crate::process::{Process, detached};
use crate::recording::{Memory, Recording};
use crate::value::to_python;
use crate::wakeup::{Bell, Wakeup};
use crate::watching::{Caller, Observation, Timeline, Watch};

/// Ticks after which signals of the process are looked for.
const PORTION: u64 = 1_000_000;

/// Name of a text that is not from a file.
const EVALUATED: &str = "<text>";

/// Longest wait until signals of the process are looked for.
const PAUSE: Duration = Duration::from_millis(50);

/// A machine in which programs run. It serves one thread at a time.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Engine {
    engine: Mutex<Owned>,
    bell: Arc<Bell>,
    wakeup: Mutex<Option<Wakeup>>,
    memory: Memory,
    process: Process,
    /// Functions of Python that the machine holds, for the collector of Python.
    functions: Mutex<Vec<Weak<Py<PyAny>>>>,
}

/// The engine of an `Engine`, which is taken away when that is dropped.
struct Owned(Option<esl::Engine>);

const IS_THERE: &str = "it is there until it is dropped";

impl Deref for Owned {
    type Target = esl::Engine;

    fn deref(&self) -> &esl::Engine {
        self.0.as_ref().expect(IS_THERE)
    }
}

impl DerefMut for Owned {
    fn deref_mut(&mut self) -> &mut esl::Engine {
        self.0.as_mut().expect(IS_THERE)
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.give_up();
    }
}

impl Engine {
    fn lock(&self) -> PyResult<MutexGuard<'_, Owned>> {
        self.process.check()?;
        let engine = match self.engine.try_lock() {
            Ok(engine) => engine,
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => return Err(busy()),
        };
        if engine.0.is_some() { Ok(engine) } else { Err(Python::attach(|py| of_error(py, Error::Ended))) }
    }

    /// Returns a function for the machine to hold.
    fn hold(&self, function: Py<PyAny>) -> Arc<Py<PyAny>> {
        let function = Arc::new(function);
        let mut functions = self.functions.lock().unwrap_or_else(PoisonError::into_inner);
        if functions.len() == functions.capacity() {
            functions.retain(|function| function.strong_count() > 0);
        }
        functions.push(Arc::downgrade(&function));
        function
    }

    /// Drops the engine: what still runs ends.
    fn give_up(&self) {
        let engine = match self.engine.try_lock() {
            Ok(mut engine) => engine.0.take(),
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner().0.take(),
            // A call holds it, and the object of the call holds this one.
            Err(TryLockError::WouldBlock) => return,
        };
        if self.process.is_current() {
            // Cleanups may wait for functions of Python on other threads.
            Python::attach(|py| py.detach(|| drop(engine)));
        } else {
            // Its tasks and their cleanups belong to the process that has made it.
            std::mem::forget(engine);
        }
    }

    /// Runs the engine until the reply has come.
    fn drive<'py>(
        &self,
        py: Python<'py>,
        engine: &mut esl::Engine,
        reply: &esl::engine::Reply<Data>,
        text: (&str, &str),
    ) -> PyResult<Bound<'py, PyAny>> {
        loop {
            let polled = detached(py, || engine.poll(Instant::now(), PORTION));
            if let Some(result) = reply.take() {
                let (source, text) = text;
                return match result {
                    Ok(data) => to_python(py, &data),
                    Err(error) => {
                        let of_text = |error| of_text(py, engine.diagnose(error), source, text);
                        Err(self.memory.exception(py, error, of_text))
                    }
                };
            }
            match polled {
                Poll::Busy => {}
                Poll::Idle { until } => detached(py, || self.wait(engine, until)),
                Poll::Ended(ending) => {
                    self.memory.check_replay(py)?;
                    return Err(of_ending(py, ending));
                }
            }
            if let Err(interrupt) = py.check_signals() {
                detached(py, || engine.end());
                return Err(interrupt);
            }
        }
    }

    /// Waits until a time, or until something comes for the engine, but not longer than signals of the
    /// process may wait.
    fn wait(&self, engine: &mut esl::Engine, until: Option<Instant>) {
        let left = until.map(|until| until.saturating_duration_since(Instant::now()));
        engine.wake_when_ready(&Waker::from(self.bell.clone()));
        self.bell.wait(left.unwrap_or(PAUSE).min(PAUSE));
    }
}

fn of_ending(py: Python<'_>, ending: Ending) -> PyErr {
    match ending {
        Ending::Exited(status) => exception(py, "Exited", (status,)),
        Ending::BudgetSpent => of_error(py, Error::BudgetSpent),
        Ending::Stopped => of_error(py, Error::Stopped),
        _ => of_error(py, Error::Deadlocked),
    }
}

/// Reads rights as `--allow-…` has them.
pub(crate) fn rights(allow: &[String]) -> PyResult<Rights> {
    let mut rights = Rights::none();
    for text in allow {
        let (name, object) =
            text.split_once('=').map_or((text.as_str(), None), |(name, object)| (name, Some(object)));
        let Some(right) = Right::of_name(name) else {
            let names = Right::ALL.map(Right::name).join(", ");
            return Err(PyValueError::new_err(format!("`{name}` is not a right: expected one of {names}")));
        };
        rights = match object {
            Some(object) => rights.with(right, object),
            None => rights.with_all(right),
        };
    }
    Ok(rights)
}

#[pymethods]
impl Engine {
    #[new]
    #[pyo3(signature = (
        *, clock = "real", allow = Vec::new(), memory = None, seed = 0, budget = None, output = None, record = false,
        replay = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "they are keyword arguments in Python")]
    fn new(
        py: Python<'_>,
        clock: &str,
        allow: Vec<String>,
        memory: Option<usize>,
        seed: u64,
        budget: Option<u64>,
        output: Option<Py<PyAny>>,
        record: bool,
        replay: Option<Py<Recording>>,
    ) -> PyResult<Engine> {
        let host = RealHost::new(Vec::new()).with_rights(rights(&allow)?);
        let host = match clock {
            "real" => host,
            "virtual" => host.with_virtual_time(),
            _ => {
                let text = format!("`{clock}` is not a clock: expected `real` or `virtual`");
                return Err(PyValueError::new_err(text));
            }
        };
        let output = output.map(Arc::new);
        let functions = output.iter().map(Arc::downgrade).collect();
        let screen = output.map(|function| screen(Output::new(function)));
        let (host, remembers) = Memory::host(host, screen, record, replay.as_ref().map(Py::get))?;
        let memory = memory.unwrap_or(Config::DEFAULT.memory);
        let config = Config { memory, seed, budget, ..Config::default() };
        let engine = py.detach(|| esl::Engine::with(config, host));
        let engine = Mutex::new(Owned(Some(engine.map_err(|error| of_error(py, error))?)));
        Ok(Engine {
            engine,
            bell: Arc::default(),
            wakeup: Mutex::default(),
            memory: remembers,
            process: Process::current(),
            functions: Mutex::new(functions),
        })
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        // While another thread adds a function, the engine is in use.
        let Ok(functions) = self.functions.try_lock() else { return Ok(()) };
        functions.iter().filter_map(Weak::upgrade).try_for_each(|function| visit.call(&*function))
    }

    fn __clear__(&self) {
        self.give_up();
    }

    /// Evaluates the forms of a text, and returns the first value of the last.
    fn eval<'py>(&self, py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
        let mut engine = self.lock()?;
        let reply = engine.begin(text);
        self.drive(py, &mut engine, &reply, (EVALUATED, text))
    }

    /// Evaluates the forms of a source file, and returns the first value of the last; runs a compiled file.
    fn load<'py>(&self, py: Python<'py>, path: std::path::PathBuf) -> PyResult<Bound<'py, PyAny>> {
        let engine = &mut **self.lock()?;
        if path.extension().is_some_and(|extension| extension == "eslb") {
            let data = detached(py, || engine.load(&path)).map_err(|error| of_error(py, error))?;
            return to_python(py, &data);
        }
        let reply = engine.begin_load(&path).map_err(|error| of_error(py, error))?;
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        self.drive(py, engine, &reply, (&path.display().to_string(), &text))
    }

    /// Has a source file evaluated as a task of the runs to come.
    fn begin_load(&self, py: Python<'_>, path: std::path::PathBuf) -> PyResult<Task> {
        Ok(Task::new(self.lock()?.spawn_load(&path).map_err(|error| of_error(py, error))?))
    }

    /// Calls a function of the program, by its name in any case, and returns its first value.
    #[pyo3(signature = (name, *arguments))]
    fn call<'py>(
        &self,
        py: Python<'py>,
        name: &str,
        arguments: &Bound<'py, PyTuple>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let data = all_data(arguments)?;
        let engine = &mut **self.lock()?;
        if !matches!(self.memory, Memory::None) {
            // The call belongs to the recording.
            let reply = engine.handle().call(name, data);
            return self.drive(py, engine, &reply, (EVALUATED, ""));
        }
        let begun = detached(py, || {
            let begun = engine.begin_call(name, data, PORTION);
            engine.flush();
            begun
        });
        match begun {
            Ok(BegunCall::Ended(data)) => to_python(py, &data),
            Ok(BegunCall::UnderWay(reply)) => self.drive(py, engine, &reply, (EVALUATED, "")),
            Err(error) => Err(of_text(py, error, EVALUATED, "")),
        }
    }

    /// Defines a function that programs call and Python implements.
    fn define(
        &self,
        py: Python<'_>,
        name: &str,
        lambda_list: &str,
        documentation: &str,
        function: Py<PyAny>,
    ) -> PyResult<()> {
        let mut engine = self.lock()?;
        let function = self.hold(function);
        let defined =
            engine.define(name, lambda_list, documentation, move |call| callback::call(&function, &call));
        defined.map_err(|error| of_error(py, error))
    }

    /// Defines a function whose calls are operations: `begin` gets an `Operation`.
    fn define_operation(
        &self,
        py: Python<'_>,
        name: &str,
        lambda_list: &str,
        documentation: &str,
        begin: Py<PyAny>,
    ) -> PyResult<()> {
        let mut engine = self.lock()?;
        let begin = self.hold(begin);
        let begin = move |operation| callback::begin(&begin, operation);
        engine.define_operation(name, lambda_list, documentation, begin).map_err(|error| of_error(py, error))
    }

    /// Returns a handle, through which other threads reach the run.
    fn handle(&self) -> PyResult<Handle> {
        Ok(Handle::new(self.lock()?.handle()))
    }

    /// Has a text evaluated as a task of the runs to come.
    fn begin(&self, text: &str) -> PyResult<Task> {
        Ok(Task::new(self.lock()?.spawn_text(text)))
    }

    /// Runs tasks for a number of ticks, and never waits. Returns whether some task can go on at once, the
    /// seconds until the first goes on if it waits for a time, and the exception of a run that has ended
    /// before its tasks have.
    fn poll(&self, py: Python<'_>, ticks: u64) -> PyResult<(bool, Option<f64>, Option<PyErr>)> {
        let engine = &mut **self.lock()?;
        Ok(match detached(py, || engine.poll(Instant::now(), ticks)) {
            Poll::Busy => (true, None, None),
            Poll::Idle { until } => {
                let wait = until.map(|until| until.saturating_duration_since(Instant::now()).as_secs_f64());
                (false, wait, None)
            }
            Poll::Ended(ending) => {
                let failed = !matches!(ending, Ending::Done | Ending::Exited(_));
                let diverged = self.memory.check_replay(py).err();
                (false, None, diverged.or_else(|| failed.then(|| of_ending(py, ending))))
            }
        })
    }

    /// The recording so far.
    fn recording(&self) -> PyResult<Recording> {
        let _guard = self.lock()?;
        self.memory.recording()
    }

    /// A hash of the course of the run so far.
    #[getter]
    fn canary(&self) -> PyResult<u64> {
        Ok(self.lock()?.canary())
    }

    /// Returns a file descriptor that becomes readable when something has come for the engine.
    fn wakeup_fd(&self) -> PyResult<i32> {
        let mut wakeup = self.wakeup.lock().unwrap_or_else(PoisonError::into_inner);
        if wakeup.is_none() {
            *wakeup = Some(Wakeup::new()?);
        }
        Ok(wakeup.as_ref().map_or(-1, Wakeup::descriptor))
    }

    /// Makes the descriptor unreadable, and readable again when something comes.
    fn watch_wakeup(&self) -> PyResult<()> {
        let engine = self.lock()?;
        let wakeup = self.wakeup.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(wakeup) = &*wakeup {
            wakeup.empty();
            engine.wake_when_ready(&wakeup.waker());
        }
        Ok(())
    }

    /// Has the descriptor stay as it is, whatever comes, until `watch_wakeup`: the caller is about to poll.
    fn unwatch_wakeup(&self) {
        if let Ok(engine) = self.lock() {
            engine.wake_when_ready(Waker::noop());
        }
    }

    /// Ends what still runs: aborts all tasks, runs their cleanups, cancels operations.
    fn end(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let engine = &mut **self.lock()?;
        Ok(detached(py, || engine.end()))
    }

    /// Makes the definitions of a text in the running program. Returns their number.
    fn patch(&self, py: Python<'_>, name: &str, text: &str) -> PyResult<usize> {
        let engine = &mut **self.lock()?;
        detached(py, || engine.patch(name, text)).map_err(|error| of_text(py, error, name, text))
    }

    /// Takes the newest patch back. Returns the number of its definitions, or nothing without one.
    fn undo_patch(&self, py: Python<'_>) -> PyResult<Option<usize>> {
        let engine = &mut **self.lock()?;
        detached(py, || engine.undo_patch()).map_err(|error| of_error(py, error))
    }

    /// The definitions of a package: kind, name, parameters and documentation.
    fn definitions(
        &self,
        py: Python<'_>,
        package: &str,
    ) -> PyResult<Vec<(&'static str, String, String, String)>> {
        let engine = &mut **self.lock()?;
        let definitions =
            detached(py, || engine.definitions(package)).map_err(|error| of_error(py, error))?;
        let row = |row: ProgramDefinition| (row.kind.name(), row.name, row.parameters, row.documentation);
        Ok(definitions.into_iter().map(row).collect())
    }

    /// Has a function called with the seconds since the first observer came, the number of a task, a kind and
    /// a detail, for each event of one of these kinds, or of all if there are none.
    fn observe(&self, function: Py<PyAny>, kinds: HashSet<String>) -> PyResult<Observation> {
        let (caller, observation) = Caller::new(self.hold(function), kinds);
        self.lock()?.handle().subscribe(caller);
        Ok(observation)
    }

    /// Has the run drawn from now on.
    fn timeline(&self) -> PyResult<Timeline> {
        let (drawer, timeline) = Timeline::begin();
        self.lock()?.handle().subscribe(drawer);
        Ok(timeline)
    }

    /// Has a function called with whether a fact is there now, the fact, and a dictionary of the variables of
    /// the pattern, for each change of a fact that matches it.
    fn watch_facts(
        &self,
        py: Python<'_>,
        pattern: &Bound<'_, PyAny>,
        function: Py<PyAny>,
    ) -> PyResult<Watch> {
        let pattern = crate::handle::pattern(pattern)?;
        Watch::begin(&mut *self.lock()?, pattern, self.hold(function)).map_err(|error| of_error(py, error))
    }

    /// The tasks of the program, as a text.
    fn task_report(&self) -> PyResult<String> {
        Ok(self.lock()?.task_report())
    }
}
