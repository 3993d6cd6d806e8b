//! Handles: how other threads reach a run; answers to come.

use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

use esl::engine::{InputHandle, QueryAnswer, TaskHandle};
use esl::host::TaskInfo;
use esl::{Data, Error};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use smallvec::SmallVec;

use crate::failure::{of_error, of_send};
use crate::process::{Process, detached};
use crate::value::{to_data, to_python};

/// Arguments of a call or a signal, of which most have few.
pub(crate) type CallData = SmallVec<[Data; 2]>;

/// Returns the values of a program that arguments of Python become.
pub(crate) fn all_data(arguments: &Bound<'_, PyTuple>) -> PyResult<CallData> {
    arguments.iter_borrowed().map(|argument| to_data(&argument)).collect()
}

/// A way into a run, from all threads. While a program has a handle, it waits for what may come by it.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Handle {
    inner: esl::engine::Handle,
    process: Process,
}

impl Handle {
    pub(crate) fn new(inner: esl::engine::Handle) -> Handle {
        Handle { inner, process: Process::current() }
    }

    fn check_process(&self) -> PyResult<()> {
        self.process.check()
    }
}

#[pymethods]
impl Handle {
    /// Signals an input, by its name in any case. Waits while it is full, if that is its rule.
    #[pyo3(signature = (name, *arguments))]
    fn signal(&self, py: Python<'_>, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.check_process()?;
        let data = all_data(arguments)?;
        detached(py, || self.inner.signal(name, data)).map_err(|error| of_send(py, &error))
    }

    /// Signals an input, and raises `esl.Full` instead of waiting.
    #[pyo3(signature = (name, *arguments))]
    fn try_signal(&self, py: Python<'_>, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.check_process()?;
        let data = all_data(arguments)?;
        self.inner.try_signal(name, data).map_err(|error| of_send(py, &error))
    }

    /// Returns an input, by its name in any case, for many signals.
    fn input(&self, name: &str) -> PyResult<Input> {
        self.check_process()?;
        Ok(Input { inner: self.inner.input(name), name: name.to_owned(), process: self.process })
    }

    /// Adds a fact. The answer is whether it is new.
    fn assert_fact(&self, fact: &Bound<'_, PyAny>) -> PyResult<Reply> {
        self.check_process()?;
        Ok(Reply::new(AwaitedReply::Truth(self.inner.assert(pattern(fact)?))))
    }

    /// Removes the facts that match a pattern. The answer is how many there were.
    fn retract(&self, facts: &Bound<'_, PyAny>) -> PyResult<Reply> {
        self.check_process()?;
        Ok(Reply::new(AwaitedReply::Count(self.inner.retract(pattern(facts)?))))
    }

    /// Asks the database. The answer is a list of dictionaries of the variables.
    fn query(&self, query: &Bound<'_, PyAny>) -> PyResult<Reply> {
        self.check_process()?;
        Ok(Reply::new(AwaitedReply::Facts(self.inner.query(pattern(query)?))))
    }

    /// Sets a property for these arguments. The answer is whether that has changed its value.
    #[pyo3(signature = (name, value, *arguments))]
    fn set(&self, name: &str, value: &Bound<'_, PyAny>, arguments: &Bound<'_, PyTuple>) -> PyResult<Reply> {
        self.check_process()?;
        let reply = self.inner.set(name, all_data(arguments)?, to_data(value)?);
        Ok(Reply::new(AwaitedReply::Truth(reply)))
    }

    /// Calls a function of the program in a task of its own. The answer is its first value.
    #[pyo3(signature = (name, *arguments))]
    fn call(&self, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<Reply> {
        self.check_process()?;
        Ok(Reply::new(AwaitedReply::Value(self.inner.call(name, all_data(arguments)?))))
    }

    /// Starts a task that calls a function of the program.
    #[pyo3(signature = (name, *arguments))]
    fn spawn(&self, name: &str, arguments: &Bound<'_, PyTuple>) -> PyResult<Task> {
        self.check_process()?;
        Ok(Task::new(self.inner.spawn(name, all_data(arguments)?)))
    }

    /// Asks for the tasks that have not ended. The answer is a list of number, number of the maker (0 for
    /// none), name, what the task waits for or nothing, and ticks.
    fn tasks(&self) -> PyResult<Reply> {
        self.check_process()?;
        Ok(Reply::new(AwaitedReply::Tasks(self.inner.tasks())))
    }

    /// Aborts the task with a number.
    fn abort(&self, task: u64) -> PyResult<()> {
        self.check_process()?;
        self.inner.abort(task);
        Ok(())
    }

    /// Has no task run, until `resume` or the end of the last handle.
    fn pause(&self) {
        self.inner.pause();
    }

    /// Has tasks run again.
    fn resume(&self) {
        self.inner.resume();
    }

    /// Has an evaluation of the engine end with `esl.Stopped`. Tasks go on in the next run.
    fn stop(&self) {
        self.inner.stop();
    }
}

/// An input of a program. Its signals come from any thread.
#[pyclass(frozen, module = "esl")]
pub(crate) struct Input {
    inner: InputHandle,
    /// The name as it was given.
    #[pyo3(get)]
    name: String,
    process: Process,
}

#[pymethods]
impl Input {
    /// Signals the input. Waits while it is full, if that is its rule: so not on the thread of the engine.
    #[pyo3(signature = (*arguments))]
    fn signal(&self, py: Python<'_>, arguments: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.process.check()?;
        // To let go of the interpreter takes longer than the signal, which mostly need not wait.
        match self.inner.offer(all_data(arguments)?) {
            Ok(()) => Ok(()),
            Err(data) => detached(py, || self.inner.signal(data)).map_err(|error| of_send(py, &error)),
        }
    }

    /// Signals the input, and raises `esl.Full` instead of waiting.
    #[pyo3(signature = (*arguments))]
    fn try_signal(&self, py: Python<'_>, arguments: &Bound<'_, PyTuple>) -> PyResult<()> {
        self.process.check()?;
        self.inner.try_signal(all_data(arguments)?).map_err(|error| of_send(py, &error))
    }

    fn __repr__(&self) -> String {
        format!("Input('{}')", self.name)
    }
}

/// Returns a pattern or a fact: a text is read as programs write it.
pub(crate) fn pattern(object: &Bound<'_, PyAny>) -> PyResult<Data> {
    match object.extract::<String>() {
        Ok(text) => text.parse().map_err(|error| of_error(object.py(), error)),
        Err(_) => to_data(object),
    }
}

/// Returns a dictionary of the variables of an answer.
pub(crate) fn bindings<'py>(py: Python<'py>, answer: &QueryAnswer) -> PyResult<Bound<'py, PyDict>> {
    let dictionary = PyDict::new(py);
    for (name, value) in answer.iter() {
        dictionary.set_item(name.to_lowercase(), to_python(py, value)?)?;
    }
    Ok(dictionary)
}

/// The reply of an engine, by the type that it has there.
pub(crate) enum AwaitedReply {
    Value(esl::engine::Reply<Data>),
    Truth(esl::engine::Reply<bool>),
    Count(esl::engine::Reply<i64>),
    Facts(esl::engine::Reply<Vec<QueryAnswer>>),
    Tasks(esl::engine::Reply<Vec<TaskInfo>>),
}

/// An answer, or the reason why there is none.
type Outcome = Result<Arrived, Error>;

/// An answer that has come.
enum Arrived {
    Value(Data),
    Facts(Vec<QueryAnswer>),
    Tasks(Vec<TaskInfo>),
}

/// Returns the outcome of a future, read.
fn read<T, F>(future: &mut F, context: &mut Context<'_>, read: fn(T) -> Arrived) -> Option<Outcome>
where
    F: Future<Output = Result<T, Error>> + Unpin,
{
    match Pin::new(future).poll(context) {
        Poll::Ready(result) => Some(result.map(read)),
        Poll::Pending => None,
    }
}

fn truth(is_true: bool) -> Arrived {
    Arrived::Value(Data::boolean(is_true))
}

fn count(count: i64) -> Arrived {
    Arrived::Value(Data::Integer(count))
}

impl AwaitedReply {
    /// Takes the answer if it has come; otherwise has the waker woken when it does.
    fn poll(&mut self, waker: &Waker) -> Option<Outcome> {
        let context = &mut Context::from_waker(waker);
        match self {
            AwaitedReply::Value(reply) => read(reply, context, Arrived::Value),
            AwaitedReply::Truth(reply) => read(reply, context, truth),
            AwaitedReply::Count(reply) => read(reply, context, count),
            AwaitedReply::Facts(reply) => read(reply, context, Arrived::Facts),
            AwaitedReply::Tasks(reply) => read(reply, context, Arrived::Tasks),
        }
    }

    fn wait(self) -> Outcome {
        match self {
            AwaitedReply::Value(reply) => reply.wait().map(Arrived::Value),
            AwaitedReply::Truth(reply) => reply.wait().map(truth),
            AwaitedReply::Count(reply) => reply.wait().map(count),
            AwaitedReply::Facts(reply) => reply.wait().map(Arrived::Facts),
            AwaitedReply::Tasks(reply) => reply.wait().map(Arrived::Tasks),
        }
    }
}

/// A mailbox that notes which of several answers have come, by numbers. Answers come while the engine runs,
/// on whatever thread that is.
#[pyclass(frozen, module = "esl._esl")]
#[derive(Default)]
pub(crate) struct Mailbox(Arc<Mutex<Vec<u64>>>);

#[pymethods]
impl Mailbox {
    #[new]
    fn new() -> Mailbox {
        Mailbox::default()
    }

    /// Takes the numbers of the answers that have come since the last call.
    fn take(&self) -> Vec<u64> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A waker that puts a number into a mailbox.
struct Notice {
    mailbox: Arc<Mutex<Vec<u64>>>,
    number: u64,
}

impl Wake for Notice {
    fn wake(self: Arc<Notice>) {
        self.mailbox.lock().unwrap_or_else(PoisonError::into_inner).push(self.number);
    }
}

fn notice(mailbox: &Mailbox, number: u64) -> Waker {
    Waker::from(Arc::new(Notice { mailbox: mailbox.0.clone(), number }))
}

impl Arrived {
    fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let answers = match self {
            Arrived::Value(data) => return to_python(py, &data),
            Arrived::Facts(answers) => answers,
            Arrived::Tasks(tasks) => {
                let row = |task: TaskInfo| (task.number, task.maker, task.name, task.waits_for, task.ticks);
                return Ok(PyList::new(py, tasks.into_iter().map(row))?.into_any());
            }
        };
        let list = PyList::empty(py);
        for answer in answers {
            list.append(bindings(py, &answer)?)?;
        }
        Ok(list.into_any())
    }
}

/// State of an answer to come.
enum ReplyState {
    Awaited(AwaitedReply),
    Come(Outcome),
    Taken,
}

/// An answer to come from a run. Dropping it changes nothing in the run.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Reply(Mutex<ReplyState>);

impl Reply {
    pub(crate) fn new(awaited: AwaitedReply) -> Reply {
        Reply(Mutex::new(ReplyState::Awaited(awaited)))
    }

    fn lock(&self) -> MutexGuard<'_, ReplyState> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Reply {
    /// Takes the answer if it has come: returns whether it has, and the answer, which can be taken once.
    fn take<'py>(&self, py: Python<'py>) -> PyResult<(bool, Option<Bound<'py, PyAny>>)> {
        let outcome = {
            let mut state = self.lock();
            match std::mem::replace(&mut *state, ReplyState::Taken) {
                ReplyState::Taken => return Err(of_error(py, Error::Ended)),
                ReplyState::Come(outcome) => outcome,
                ReplyState::Awaited(mut awaited) => match awaited.poll(Waker::noop()) {
                    Some(outcome) => outcome,
                    None => {
                        *state = ReplyState::Awaited(awaited);
                        return Ok((false, None));
                    }
                },
            }
        };
        Ok((true, Some(outcome.map_err(|error| of_error(py, error))?.into_python(py)?)))
    }

    /// Has a mailbox note a number when the answer comes; at once if it has come.
    fn notify(&self, mailbox: &Mailbox, number: u64) {
        let waker = notice(mailbox, number);
        let mut state = self.lock();
        if let ReplyState::Awaited(awaited) = &mut *state {
            match awaited.poll(&waker) {
                Some(outcome) => *state = ReplyState::Come(outcome),
                None => return,
            }
        }
        waker.wake();
    }

    /// Waits for the answer, on a thread other than the engine's.
    fn wait<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let state = std::mem::replace(&mut *self.lock(), ReplyState::Taken);
        let outcome = match state {
            ReplyState::Taken => Err(Error::Ended),
            ReplyState::Come(outcome) => outcome,
            ReplyState::Awaited(awaited) => detached(py, || awaited.wait()),
        };
        outcome.map_err(|error| of_error(py, error))?.into_python(py)
    }
}

/// State of the value of a task.
enum TaskState {
    Awaited(TaskHandle),
    Come(Result<Data, Error>),
    Taken,
}

/// A task that was started from outside.
#[pyclass(frozen, module = "esl._esl")]
pub(crate) struct Task(Mutex<TaskState>);

impl Task {
    pub(crate) fn new(task: TaskHandle) -> Task {
        Task(Mutex::new(TaskState::Awaited(task)))
    }

    fn lock(&self) -> MutexGuard<'_, TaskState> {
        // The state is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Looks whether the task has ended; otherwise has the waker woken when it does.
    fn poll(&self, waker: &Waker) -> MutexGuard<'_, TaskState> {
        let mut state = self.lock();
        if let TaskState::Awaited(task) = &mut *state
            && let Poll::Ready(result) = Pin::new(task).poll(&mut Context::from_waker(waker))
        {
            *state = TaskState::Come(result);
        }
        state
    }
}

#[pymethods]
impl Task {
    /// Aborts the task: it unwinds and runs its cleanups. Nothing happens if it has ended.
    fn abort(&self) {
        if let TaskState::Awaited(task) = &*self.lock() {
            task.abort();
        }
    }

    /// Takes the value of its function if it has ended, as `Reply.take` does.
    fn take<'py>(&self, py: Python<'py>) -> PyResult<(bool, Option<Bound<'py, PyAny>>)> {
        let result = {
            let mut state = self.poll(Waker::noop());
            match std::mem::replace(&mut *state, TaskState::Taken) {
                TaskState::Come(result) => result,
                TaskState::Taken => Err(Error::Ended),
                awaited @ TaskState::Awaited(_) => {
                    *state = awaited;
                    return Ok((false, None));
                }
            }
        };
        Ok((true, Some(to_python(py, &result.map_err(|error| of_error(py, error))?)?)))
    }

    /// Has a mailbox note a number when the task ends, as `Reply.notify` does.
    fn notify(&self, mailbox: &Mailbox, number: u64) {
        let waker = notice(mailbox, number);
        let state = self.poll(&waker);
        if !matches!(*state, TaskState::Awaited(_)) {
            waker.wake();
        }
    }
}
