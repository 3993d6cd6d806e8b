//! The extension module of the Python package `esl-lang`: engines, their handles, operations and values.
//!
//! | module | content |
//! | --- | --- |
//! | `value` | values of programs as values of Python, and back |
//! | `failure` | exceptions |
//! | `engine` | engines, and driving them until an answer has come |
//! | `durable` | runs that go on after the end of their process |
//! | `callback` | functions and operations that Python implements |
//! | `handle` | other threads, and answers to come |
//! | `watching` | events of tasks, changes of facts, drawings |
//! | `program` | whole programs: diagnostics, tests, recordings |
//! | `recording` | recordings of engines |
//! | `output` | the output of programs |
//! | `wakeup` | waking the thread or the event loop that drives an engine |
//! | `process` | copies of the process |
//! | `command` | the commands `eslvm` and `eslc`, for the wheel |
//!
//! Guarantees: the interpreter's lock is released while a machine runs. Exceptions of a callback are failures
//! of the call.
//!
//! Not here: the classes that programs in Python use, which are in `esl/` and written in Python.
#![deny(unsafe_code)]

mod callback;
#[cfg(feature = "commands")]
pub mod command;
mod durable;
mod engine;
mod failure;
mod handle;
mod output;
mod process;
mod program;
mod recording;
mod value;
mod wakeup;
mod watching;

use pyo3::prelude::*;

/// The classes below those of `esl/`.
#[pymodule(gil_used = false)]
mod _esl {
    #[pymodule_export]
    use super::callback::Operation;
    #[pymodule_export]
    use super::durable::DurableEngine;
    #[pymodule_export]
    use super::engine::Engine;
    #[pymodule_export]
    use super::handle::{Handle, Input, Mailbox, Reply, Task};
    #[pymodule_export]
    use super::process::{note_exit, note_fork};
    #[pymodule_export]
    use super::program::{Tests, check, replay, run};
    #[pymodule_export]
    use super::recording::Recording;
    #[pymodule_export]
    use super::value::ProgramObject;
    #[pymodule_export]
    use super::watching::{Observation, Timeline, Watch};
}
