//! Handles: how other threads reach a run; answers to come.

use std::sync::{Mutex, PoisonError};

use esl::engine::{QueryAnswer, TaskHandle};
use esl::{Data, Error};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::failure::{of_error, of_send};
use crate::value::{to_data, to_python};

/// Returns the values of a program that arguments of Python become.
pub(crate) fn all_data(arguments: &Bound<'_, PyTuple>) -> PyResult<Vec<Data>> {
    arguments.iter().map(|argument| to_data(&argument)).collect()
}

/// A way into a run, from all threads. While a program has a handle, it waits for what may come by it.
#[pyclass(frozen)]
pub(crate) struct Handle(pub(crate) esl::engine::Handle);

#[pymethods]
impl Handle {
    /// Signals an input, by its name in any case. Waits while it is full, if that is its rule.
    #[pyo3(signature = (name, *arguments))]
    fn signal(&self, py: Python<'_>, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<()> {
        let data = all_data(arguments)?;
        py.detach(|| self.0.signal(name, data)).map_err(|error| of_send(py, &error))
    }

    /// Signals an input, and raises `esl.Full` instead of waiting.
    #[pyo3(signature = (name, *arguments))]
    fn try_signal(&self, py: Python<'_>, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<()> {
        let data = all_data(arguments)?;
        self.0.try_signal(name, data).map_err(|error| of_send(py, &error))
    }

    /// Adds a fact. The answer is whether it is new.
    fn assert_fact(&self, fact: &Bound<'_, PyAny>) -> PyResult<Reply> {
        Ok(Reply::new(AwaitedReply::Truth(self.0.assert(pattern(fact)?))))
    }

    /// Removes the facts that match a pattern. The answer is how many there were.
    fn retract(&self, facts: &Bound<'_, PyAny>) -> PyResult<Reply> {
        Ok(Reply::new(AwaitedReply::Count(self.0.retract(pattern(facts)?))))
    }

    /// Asks the database. The answer is a list of dictionaries of the variables.
    fn query(&self, query: &Bound<'_, PyAny>) -> PyResult<Reply> {
        Ok(Reply::new(AwaitedReply::Facts(self.0.query(pattern(query)?))))
    }

    /// Sets a property for these arguments. The answer is whether that has changed its value.
    #[pyo3(signature = (name, value, *arguments))]
    fn set(&self, name: &str, value: &Bound<'_, PyAny>, arguments: &Bound<'_, PyTuple>) -> PyResult<Reply> {
        let reply = self.0.set(name, all_data(arguments)?, to_data(value)?);
        Ok(Reply::new(AwaitedReply::Truth(reply)))
    }

    /// Calls a function of the program in a task of its own. The answer is its first value.
    #[pyo3(signature = (name, *arguments))]
    fn call(&self, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<Reply> {
        Ok(Reply::new(AwaitedReply::Value(self.0.call(name, all_data(arguments)?))))
    }

    /// Starts a task that calls a function of the program.
    #[pyo3(signature = (name, *arguments))]
    fn spawn(&self, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<Task> {
        Ok(Task { task: self.0.spawn(name, all_data(arguments)?) })
    }

    /// Has no task run, until `resume` or the end of the last handle.
    fn pause(&self) {
        self.0.pause();
    }

    /// Has tasks run again.
    fn resume(&self) {
        self.0.resume();
    }

    /// Has an evaluation of the engine end with `esl.Stopped`. Tasks go on in the next run.
    fn stop(&self) {
        self.0.stop();
    }
}

/// Returns a pattern or a fact: a text is read as programs write it.
fn pattern(object: &Bound<'_, PyAny>) -> PyResult<Data> {
    match object.extract::<String>() {
        Ok(text) => text.parse().map_err(|error| of_error(object.py(), error)),
        Err(_) => to_data(object),
    }
}

/// The reply of an engine, by the type that it has there.
pub(crate) enum AwaitedReply {
    Value(esl::engine::Reply<Data>),
    Truth(esl::engine::Reply<bool>),
    Count(esl::engine::Reply<i64>),
    Facts(esl::engine::Reply<Vec<QueryAnswer>>),
}

/// An answer that has come.
enum Arrived {
    Value(Data),
    Facts(Vec<QueryAnswer>),
}

impl AwaitedReply {
    fn take(&self) -> Option<Result<Arrived, Error>> {
        match self {
            AwaitedReply::Value(reply) => reply.take().map(|result| result.map(Arrived::Value)),
            AwaitedReply::Truth(reply) => {
                reply.take().map(|result| result.map(|truth| Arrived::Value(Data::boolean(truth))))
            }
            AwaitedReply::Count(reply) => {
                reply.take().map(|result| result.map(|count| Arrived::Value(Data::Integer(count))))
            }
            AwaitedReply::Facts(reply) => reply.take().map(|result| result.map(Arrived::Facts)),
        }
    }

    fn wait(self) -> Result<Arrived, Error> {
        match self {
            AwaitedReply::Value(reply) => reply.wait().map(Arrived::Value),
            AwaitedReply::Truth(reply) => reply.wait().map(|truth| Arrived::Value(Data::boolean(truth))),
            AwaitedReply::Count(reply) => reply.wait().map(|count| Arrived::Value(Data::Integer(count))),
            AwaitedReply::Facts(reply) => reply.wait().map(Arrived::Facts),
        }
    }
}

impl Arrived {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let answers = match self {
            Arrived::Value(data) => return to_python(py, &data),
            Arrived::Facts(answers) => answers,
        };
        let list = PyList::empty(py);
        for answer in answers {
            let dictionary = PyDict::new(py);
            for (name, value) in answer.iter() {
                dictionary.set_item(name.to_lowercase(), to_python(py, value)?)?;
            }
            list.append(dictionary)?;
        }
        Ok(list.into_any())
    }
}

/// An answer to come from a run. Dropping it changes nothing in the run.
#[pyclass(frozen)]
pub(crate) struct Reply(Mutex<Option<AwaitedReply>>);

impl Reply {
    pub(crate) fn new(awaited: AwaitedReply) -> Reply {
        Reply(Mutex::new(Some(awaited)))
    }
}

#[pymethods]
impl Reply {
    /// Takes the answer if it has come: returns whether it has, and the answer, which can be taken once.
    fn take<'py>(&self, py: Python<'py>) -> PyResult<(bool, Option<Bound<'py, PyAny>>)> {
        let mut reply = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let arrived = match &*reply {
            None => return Err(of_error(py, Error::Ended)),
            Some(awaited) => awaited.take(),
        };
        let Some(arrived) = arrived else { return Ok((false, None)) };
        *reply = None;
        let value = arrived.map_err(|error| of_error(py, error))?.into_python(py)?;
        Ok((true, Some(value)))
    }

    /// Waits for the answer, on a thread other than the engine's.
    fn wait<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let awaited = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        let awaited = awaited.ok_or_else(|| of_error(py, Error::Ended))?;
        let arrived = py.detach(|| awaited.wait());
        arrived.map_err(|error| of_error(py, error))?.into_python(py)
    }
}

/// A task that was started from outside.
#[pyclass(frozen)]
pub(crate) struct Task {
    task: TaskHandle,
}

#[pymethods]
impl Task {
    /// Aborts the task: it unwinds and runs its cleanups. Nothing happens if it has ended.
    fn abort(&self) {
        self.task.abort();
    }

    /// Takes the value of its function if it has ended, as `Reply.take` does.
    fn take<'py>(&self, py: Python<'py>) -> PyResult<(bool, Option<Bound<'py, PyAny>>)> {
        match self.task.take() {
            None => Ok((false, None)),
            Some(result) => Ok((true, Some(to_python(py, &result.map_err(|error| of_error(py, error))?)?))),
        }
    }
}
