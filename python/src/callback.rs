//! Functions and operations that Python implements.

use std::sync::{Mutex, MutexGuard, PoisonError};

use esl::Data;
use esl::engine::{Call, Failure};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList, PyTuple};

use crate::failure::of_exception;
use crate::process::stay_at_exit;
use crate::value::{to_data, to_python};

/// Returns the arguments of a call.
fn arguments<'py>(py: Python<'py>, call: &Call) -> PyResult<Vec<Bound<'py, PyAny>>> {
    call.arguments().iter().map(|argument| to_python(py, argument)).collect()
}

/// Calls a function of Python for a call of the program.
pub(crate) fn call(function: &Py<PyAny>, call: &Call) -> Result<Data, Failure> {
    stay_at_exit();
    Python::attach(|py| {
        let value = arguments(py, call)
            .and_then(|arguments| function.bind(py).call1(PyTuple::new(py, arguments)?))
            .and_then(|value| to_data(&value));
        value.map_err(|error| of_exception(py, error))
    })
}

/// Begins an operation by a function of Python.
pub(crate) fn begin(function: &Py<PyAny>, operation: esl::engine::Operation) {
    stay_at_exit();
    Python::attach(|py| {
        let operation = Py::new(py, Operation(Mutex::new(Some(operation))));
        let begun = operation.and_then(|operation| {
            let begun = function.bind(py).call1((operation.clone_ref(py),));
            begun.map(drop).map_err(|error| (operation, error)).or_else(|(operation, error)| {
                operation.get().fail_by(py, error);
                Ok(())
            })
        });
        if let Err(error) = begun {
            error.write_unraisable(py, Some(function.bind(py)));
        }
    });
}

/// Work for a task of the program, which waits for its end. It ends once, on any thread.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Operation(Mutex<Option<esl::engine::Operation>>);

impl Operation {
    fn lock(&self) -> MutexGuard<'_, Option<esl::engine::Operation>> {
        // The operation is there or not, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self) -> PyResult<esl::engine::Operation> {
        self.lock().take().ok_or_else(|| PyRuntimeError::new_err("the operation has ended"))
    }

    fn fail_by(&self, py: Python<'_>, error: PyErr) {
        if let Ok(operation) = self.take() {
            operation.fail(of_exception(py, error));
        }
    }
}

#[pymethods]
impl Operation {
    /// The arguments of the call, in the order of the lambda list's variables.
    #[getter]
    fn arguments<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let call = self.lock().as_ref().map(|operation| operation.call().clone());
        let call = call.ok_or_else(|| PyRuntimeError::new_err("the operation has ended"))?;
        PyList::new(py, arguments(py, &call)?)
    }

    /// Whether the program has left the call, or cancelled the operation.
    #[getter]
    fn is_cancelled(&self) -> bool {
        self.lock().as_ref().is_some_and(esl::engine::Operation::is_cancelled)
    }

    /// The identity of the call in a durable run, the same in each process that performs it.
    #[getter]
    fn action(&self) -> Option<String> {
        let action = self.lock().as_ref().and_then(esl::engine::Operation::action);
        action.map(|action| action.to_string())
    }

    /// Keeps bytes with the state of a durable run, in place of those before. Returns whether they are safe.
    fn save(&self, py: Python<'_>, state: &[u8]) -> PyResult<bool> {
        // Without the lock: another thread may wait for it with the interpreter's.
        let saved = self.lock().as_ref().map(esl::engine::Operation::state);
        let saved = saved.ok_or_else(|| PyRuntimeError::new_err("the operation has ended"))?;
        Ok(py.detach(|| saved.save(state)))
    }

    /// The bytes that the operation has saved last, in this process or an earlier one.
    fn restore<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        let state = self.lock().as_ref().and_then(esl::engine::Operation::restore);
        state.map(|state| PyBytes::new(py, &state))
    }

    /// Ends the operation: the call returns the value.
    #[pyo3(signature = (value = None))]
    fn complete(&self, value: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let data = value.map_or(Ok(Data::Nil), to_data)?;
        self.take()?.complete(data);
        Ok(())
    }

    /// Ends the operation: the call fails with the exception.
    fn fail(&self, py: Python<'_>, error: &Bound<'_, PyAny>) -> PyResult<()> {
        self.take()?.fail(of_exception(py, PyErr::from_value(error.clone())));
        Ok(())
    }

    /// Gives the operation up: the call fails with `:OPERATION-DROPPED`, and one that was cancelled has
    /// stopped.
    fn drop(&self) {
        drop(self.lock().take());
    }

    /// Reports how far the operation is.
    fn report_progress(&self, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let data = to_data(value)?;
        if let Some(operation) = &*self.lock() {
            operation.report_progress(data);
        }
        Ok(())
    }

    /// Has a function called, without arguments, when the program leaves the call; at once if it has done so.
    fn on_cancel(&self, function: Py<PyAny>) {
        let notice = move || {
            Python::attach(|py| {
                if let Err(error) = function.call0(py) {
                    error.write_unraisable(py, Some(function.bind(py)));
                }
            });
        };
        if let Some(operation) = &*self.lock() {
            operation.on_cancel(notice);
        }
    }
}
