//! Failures of programs as exceptions, and back.

use esl::engine::Failure;
use esl::host::{FailureFrame, SendError};
use esl::{Data, Error};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use pyo3::call::PyCallArgs;
use pyo3::exceptions::{PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::value::{held, hold, to_data, to_python};

/// Cause of a failure that an exception of Python is.
const PYTHON_ERROR: &str = "PYTHON-ERROR";

/// Returns an exception of `esl.errors`.
pub(crate) fn exception<'py>(py: Python<'py>, class: &str, arguments: impl PyCallArgs<'py>) -> PyErr {
    let made = py.import("esl.errors").and_then(|errors| errors.getattr(class)?.call1(arguments));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// Returns the exception of an error of an engine. An exception that a callback has raised, and nothing in
/// the program has handled, comes back as itself.
pub(crate) fn of_error(py: Python<'_>, error: Error) -> PyErr {
    let message = message_of(&error);
    match error {
        Error::Failed { cause, message, report, arguments, frames } => {
            if cause.trim_start_matches(':') == PYTHON_ERROR
                && let Some(raised) = arguments.get(2).and_then(|raised| held(py, raised))
            {
                return PyErr::from_value(raised.into_bound(py));
            }
            if cause == ":COMPILATION-FAILED" {
                return exception(py, "CompileError", (message,));
            }
            of_failure(py, &cause, &message, &report, &arguments, &frames).unwrap_or_else(|error| error)
        }
        Error::DoesNotCompile(_) => exception(py, "CompileError", (message,)),
        Error::Exited(status) => exception(py, "Exited", (status,)),
        Error::Aborted => exception(py, "Aborted", (message,)),
        Error::Deadlocked => exception(py, "Deadlocked", (message,)),
        Error::BudgetSpent | Error::TicksUsed(_) => exception(py, "BudgetSpent", (message,)),
        Error::Stopped => exception(py, "Stopped", (message,)),
        Error::Ended => exception(py, "Ended", (message,)),
        Error::NoMemory(_) => exception(py, "NoMemory", (message,)),
        Error::Unreadable { file, .. } => unreadable(py, &file, message),
        _ => exception(py, "Error", (message,)),
    }
}

/// Returns the text of an error, in which limits have the names that they have in Python.
fn message_of(error: &Error) -> String {
    match error {
        Error::NoMemory(thing) => {
            format!("the memory limit leaves no room for {thing}: raise it by `esl.Engine(memory=…)`")
        }
        Error::BudgetSpent => {
            "the engine has spent its budget of ticks: make a new one, or raise the limit by \
                               `esl.Engine(budget=…)`"
                .into()
        }
        error => error.to_string(),
    }
}

/// Returns the exception of a file that cannot be read: that of the system, or `esl.Error` if its contents
/// are the reason.
fn unreadable(py: Python<'_>, file: &str, message: String) -> PyErr {
    let Some(number) = std::fs::read(file).err().and_then(|error| error.raw_os_error()) else {
        return exception(py, "Error", (message,));
    };
    let text = py.import("os").and_then(|os| os.call_method1("strerror", (number,))?.extract::<String>());
    // Python makes a FileNotFoundError and the like of it, by the number.
    text.map_or_else(|error| error, |text| PyOSError::new_err((number, text, file.to_owned())))
}

/// Returns the exception of an error of an engine in the evaluation of a text, whose name is that of its file
/// if it is from one.
pub(crate) fn of_text(py: Python<'_>, error: Error, source: &str, text: &str) -> PyErr {
    let Error::DoesNotCompile(diagnostics) = &error else { return of_error(py, error) };
    let places = Places::new(source, text);
    match places.all(py, diagnostics) {
        Ok(list) => exception(py, "CompileError", (error.to_string(), list)),
        Err(error) => error,
    }
}

/// Places of one text, by line and column.
pub(crate) struct Places<'a> {
    source: &'a str,
    text: &'a str,
}

impl<'a> Places<'a> {
    pub(crate) fn new(source: &'a str, text: &'a str) -> Places<'a> {
        Places { source, text }
    }

    /// Returns the line and the column of a byte of the text; both count from 1.
    fn place(&self, byte: u32) -> (&'a str, usize, usize) {
        let before = self.text.get(..byte as usize).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = 1 + before.bytes().filter(|&byte| byte == b'\n').count();
        (self.source, line, 1 + before[line_start..].chars().count())
    }

    /// Returns diagnostics of the text as the arguments of `esl.Diagnostic`.
    pub(crate) fn all<'py>(
        &self,
        py: Python<'py>,
        diagnostics: &[Diagnostic],
    ) -> PyResult<Bound<'py, PyList>> {
        let row = |diagnostic: &Diagnostic| {
            let span = diagnostic.primary.span;
            let is_error = diagnostic.severity == Severity::Error;
            (
                if is_error { "error" } else { "warning" },
                diagnostic.code,
                diagnostic.message.clone(),
                self.place(span.start),
                self.place(span.end),
                diagnostic.primary.text.clone(),
                diagnostic.help.clone(),
            )
        };
        PyList::new(py, diagnostics.iter().map(row))
    }
}

fn of_failure(
    py: Python<'_>,
    cause: &str,
    message: &str,
    report: &str,
    arguments: &[Data],
    frames: &[FailureFrame],
) -> PyResult<PyErr> {
    let arguments = arguments.iter().map(|argument| to_python(py, argument)).collect::<PyResult<Vec<_>>>()?;
    let frame = |frame: &FailureFrame| {
        let place = frame.place.as_ref();
        let place = place.map(|place| (place.source.clone(), place.line, place.column));
        (frame.function.clone(), frame.task.clone(), place, frame.is_of_library)
    };
    let frames = PyList::new(py, frames.iter().map(frame))?;
    Ok(exception(py, "Failure", (cause, PyList::new(py, arguments)?, message, report, frames)))
}

/// Returns the exception of a signal that was not delivered.
pub(crate) fn of_send(py: Python<'_>, error: &SendError) -> PyErr {
    let class = match error {
        SendError::NoSuchInput(_) => "NoSuchInput",
        SendError::Full(_) => "Full",
        SendError::Ended => "Ended",
    };
    exception(py, class, (error.to_string(),))
}

/// Returns the failure that an exception of a callback is: an `esl.Failure` has its cause and arguments,
/// every other exception is `:PYTHON-ERROR` with its type, its text and itself.
pub(crate) fn of_exception(py: Python<'_>, error: PyErr) -> Failure {
    let value = error.value(py);
    let own = || {
        let class = py.import("esl.errors")?.getattr("Failure")?;
        if !value.is_instance(&class)? {
            return Ok(None);
        }
        let cause: String = value.getattr("cause")?.extract()?;
        let arguments = value.getattr("arguments")?.try_iter()?.map(|argument| to_data(&argument?));
        let arguments = arguments.collect::<PyResult<Vec<Data>>>()?;
        Ok::<_, PyErr>(Some(Failure::new(cause.trim_start_matches(':'), arguments)))
    };
    if let Ok(Some(failure)) = own() {
        return failure;
    }
    let name = value.get_type().name().map(|name| name.to_string()).unwrap_or_default();
    let text = value.str().map(|text| text.to_string()).unwrap_or_default();
    let raised = hold(error.into_value(py).into_any());
    Failure::new(PYTHON_ERROR, [Data::String(name), Data::String(text), raised])
}

/// Returns the exception of an engine that is in a call.
pub(crate) fn busy() -> PyErr {
    PyRuntimeError::new_err(
        "the engine is in a call: it serves one thread at a time, and the functions that it calls do not call \
         it; use a handle",
    )
}
