//! Engines, and driving them until an answer has come.

use std::io::{self, Read, Write};
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::task::{Wake, Waker};
use std::time::{Duration, Instant};

use esl::engine::{Ending, Poll};
use esl::host::{RealHost, Right, Rights};
use esl::{Config, Data, Error};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::callback;
use crate::failure::{busy, of_error};
use crate::handle::{AwaitedReply, Handle, Reply, all_data};
use crate::value::to_python;

/// Ticks after which signals of the process are looked for.
const PORTION: u64 = 1_000_000;

/// Longest wait until signals of the process are looked for.
const PAUSE: Duration = Duration::from_millis(50);

/// A bell that wakes the thread that drives an engine.
#[derive(Default)]
struct Bell {
    is_rung: Mutex<bool>,
    rung: Condvar,
}

impl Wake for Bell {
    fn wake(self: Arc<Bell>) {
        *self.is_rung.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.rung.notify_all();
    }
}

/// A pair of sockets of which one becomes readable when the engine has something to do, so that an event loop
/// of Python waits for it. A function of Python would have to wait for the interpreter, under a lock of the
/// machine.
struct Wakeup {
    reader: UnixStream,
    waker: Waker,
}

struct WakeupWriter(UnixStream);

impl Wake for WakeupWriter {
    fn wake(self: Arc<WakeupWriter>) {
        // A socket that is full is readable already.
        _ = (&self.0).write(&[1]);
    }
}

impl Wakeup {
    fn new() -> io::Result<Wakeup> {
        let (reader, writer) = UnixStream::pair()?;
        reader.set_nonblocking(true)?;
        writer.set_nonblocking(true)?;
        Ok(Wakeup { reader, waker: Waker::from(Arc::new(WakeupWriter(writer))) })
    }
}

/// A machine in which programs run. It serves one thread at a time.
#[pyclass(frozen)]
pub(crate) struct Engine {
    engine: Mutex<esl::Engine>,
    bell: Arc<Bell>,
    wakeup: Mutex<Option<Wakeup>>,
}

impl Engine {
    fn lock(&self) -> PyResult<MutexGuard<'_, esl::Engine>> {
        match self.engine.try_lock() {
            Ok(engine) => Ok(engine),
            Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => Err(busy()),
        }
    }

    /// Runs the engine until the reply has come.
    fn drive<'py>(
        &self,
        py: Python<'py>,
        engine: &mut esl::Engine,
        reply: &esl::engine::Reply<Data>,
    ) -> PyResult<Bound<'py, PyAny>> {
        loop {
            let ending = py.detach(|| self.portion(engine));
            if let Some(result) = reply.take() {
                return to_python(py, &result.map_err(|error| of_error(py, engine.diagnose(error)))?);
            }
            if let Some(ending) = ending {
                return Err(of_ending(py, ending));
            }
            if let Err(interrupt) = py.check_signals() {
                py.detach(|| engine.end());
                return Err(interrupt);
            }
        }
    }

    /// Runs a portion, and waits for a while if all tasks do. Returns the end of the run if it has ended.
    fn portion(&self, engine: &mut esl::Engine) -> Option<Ending> {
        match engine.poll(Instant::now(), PORTION) {
            Poll::Busy => None,
            Poll::Ended(ending) => Some(ending),
            Poll::Idle { until } => {
                let left = until.map(|until| until.saturating_duration_since(Instant::now()));
                engine.wake_when_ready(&Waker::from(self.bell.clone()));
                let is_rung = self.bell.is_rung.lock().unwrap_or_else(PoisonError::into_inner);
                let wait = left.unwrap_or(PAUSE).min(PAUSE);
                let waited = self.bell.rung.wait_timeout_while(is_rung, wait, |is_rung| !*is_rung);
                *waited.unwrap_or_else(PoisonError::into_inner).0 = false;
                None
            }
        }
    }
}

fn of_ending(py: Python<'_>, ending: Ending) -> PyErr {
    match ending {
        Ending::Exited(status) => pyo3::exceptions::PySystemExit::new_err(status),
        Ending::BudgetSpent => of_error(py, Error::BudgetSpent),
        Ending::Stopped => of_error(py, Error::Stopped),
        _ => of_error(py, Error::Deadlocked),
    }
}

/// Reads rights as `--allow-…` has them.
fn rights(allow: &[String]) -> PyResult<Rights> {
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
    #[pyo3(signature = (*, clock = "real", allow = Vec::new(), memory = None, seed = 0, budget = None))]
    fn new(
        py: Python<'_>,
        clock: &str,
        allow: Vec<String>,
        memory: Option<usize>,
        seed: u64,
        budget: Option<u64>,
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
        let memory = memory.unwrap_or(Config::DEFAULT.memory);
        let config = Config { memory, seed, budget, ..Config::default() };
        let engine = py.detach(|| esl::Engine::with(config, Box::new(host)));
        let engine = engine.map_err(|error| of_error(py, error))?;
        Ok(Engine { engine: Mutex::new(engine), bell: Arc::default(), wakeup: Mutex::default() })
    }

    /// Evaluates the forms of a text, and returns the first value of the last.
    fn eval<'py>(&self, py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
        let mut engine = self.lock()?;
        let reply = engine.begin(text);
        self.drive(py, &mut engine, &reply)
    }

    /// Evaluates the forms of a source file, and returns the first value of the last; runs a compiled file.
    fn load<'py>(&self, py: Python<'py>, path: std::path::PathBuf) -> PyResult<Bound<'py, PyAny>> {
        let engine = &mut *self.lock()?;
        if path.extension().is_some_and(|extension| extension == "eslb") {
            let data = py.detach(|| engine.load(&path)).map_err(|error| of_error(py, error))?;
            return to_python(py, &data);
        }
        let reply = engine.begin_load(&path).map_err(|error| of_error(py, error))?;
        self.drive(py, engine, &reply)
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
        let mut engine = self.lock()?;
        let reply = engine.handle().call(name, data);
        self.drive(py, &mut engine, &reply)
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
        let begin = move |operation| callback::begin(&begin, operation);
        engine.define_operation(name, lambda_list, documentation, begin).map_err(|error| of_error(py, error))
    }

    /// Returns a handle, through which other threads reach the run.
    fn handle(&self) -> PyResult<Handle> {
        Ok(Handle(self.lock()?.handle()))
    }

    /// Has a text evaluated as a task of the runs to come.
    fn begin(&self, text: &str) -> PyResult<Reply> {
        Ok(Reply::new(AwaitedReply::Value(self.lock()?.begin(text))))
    }

    /// Runs tasks for a number of ticks, and never waits. Returns whether some task can go on at once, the
    /// seconds until the first goes on if it waits for a time, and whether the run has ended.
    fn poll(&self, py: Python<'_>, ticks: u64) -> PyResult<(bool, Option<f64>, bool)> {
        let engine = &mut *self.lock()?;
        Ok(match py.detach(|| engine.poll(Instant::now(), ticks)) {
            Poll::Busy => (true, None, false),
            Poll::Idle { until } => {
                let wait = until.map(|until| until.saturating_duration_since(Instant::now()).as_secs_f64());
                (false, wait, false)
            }
            Poll::Ended(_) => (false, None, true),
        })
    }

    /// Returns a file descriptor that becomes readable when something has come for the engine.
    fn wakeup_fd(&self) -> PyResult<i32> {
        let mut wakeup = self.wakeup.lock().unwrap_or_else(PoisonError::into_inner);
        if wakeup.is_none() {
            *wakeup = Some(Wakeup::new()?);
        }
        Ok(wakeup.as_ref().map_or(-1, |wakeup| wakeup.reader.as_raw_fd()))
    }

    /// Makes the descriptor unreadable, and readable again when something comes.
    fn watch_wakeup(&self) -> PyResult<()> {
        let engine = self.lock()?;
        let wakeup = self.wakeup.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(Wakeup { reader, waker }) = &*wakeup {
            let mut bytes = [0; 64];
            while matches!((&*reader).read(&mut bytes), Ok(count) if count == bytes.len()) {}
            engine.wake_when_ready(waker);
        }
        Ok(())
    }

    /// Ends what still runs: aborts all tasks, runs their cleanups, cancels operations.
    fn end(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let engine = &mut *self.lock()?;
        Ok(py.detach(|| engine.end()))
    }

    /// The tasks of the program, as a text.
    fn task_report(&self) -> PyResult<String> {
        Ok(self.lock()?.task_report())
    }
}
