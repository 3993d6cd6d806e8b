//! Copies of the process: an engine stays in the process that has made it. The end of the process: a thread
//! that is in an engine then does not return to Python, which ends threads in a way that Rust does not
//! permit.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::{self, ThreadId};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Number of copies between the first process and this one.
static COPIES: AtomicU32 = AtomicU32::new(0);

/// Notes that this process is a copy of the one before. Python calls it after a fork.
#[pyfunction]
pub(crate) fn note_fork() {
    COPIES.fetch_add(1, Ordering::Relaxed);
}

/// The process in which something was made.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Process(u32);

impl Process {
    pub(crate) fn current() -> Process {
        Process(COPIES.load(Ordering::Relaxed))
    }

    /// Returns whether this is the process.
    pub(crate) fn is_current(self) -> bool {
        self == Process::current()
    }

    /// # Errors
    /// `RuntimeError` in a copy of the process: its threads are not there.
    pub(crate) fn check(self) -> PyResult<()> {
        if self.is_current() {
            return Ok(());
        }
        Err(PyRuntimeError::new_err(
            "the engine was made before the process was forked: make one in the new process, or have \
             `multiprocessing` use the method `spawn`",
        ))
    }
}

/// The thread that ends the process, once it does.
static ENDS_PROCESS: OnceLock<ThreadId> = OnceLock::new();

/// Notes that this thread is about to end the process.
#[pyfunction]
pub(crate) fn note_exit() {
    _ = ENDS_PROCESS.set(thread::current().id());
}

/// Waits for ever if another thread ends the process.
pub(crate) fn stay_at_exit() {
    while ENDS_PROCESS.get().is_some_and(|ending| *ending != thread::current().id()) {
        thread::park();
    }
}

/// Does something without the lock of the interpreter.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> T {
    py.detach(|| {
        let done = work();
        stay_at_exit();
        done
    })
}
