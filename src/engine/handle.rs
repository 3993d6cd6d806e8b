//! Handles: what other threads say to a run and ask of it.

use std::fmt;
use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll};

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::USER_PACKAGE;
use esl_host::{
    Answer, FunctionRef, Incoming, Inspection, Pending, ProcessSignal, Question, SendError, Sender,
    SenderInput, TaskInfo,
};
use esl_vm::embed::ExportError;
use esl_vm::observe::{Coming, Observer};
use esl_vm::vm::Vm;

use super::function::Callable;
use crate::data::{Data, FromData};
use crate::error::Error;

/// A way into a run for other threads, and for other parts of the program that owns the engine.
///
/// It may be cloned and sent, and holds no lock of the engine's. Its signals and questions come into the
/// inbox of the machine in order, and are taken in between two turns while the engine runs. While there is a
/// handle, something may come: a program that waits is not deadlocked. Signals after the end of the engine
/// have no effect, and questions then end with [`Error::Ended`].
///
/// ```
/// use esl::Engine;
///
/// let mut engine = Engine::new()?;
/// engine.eval("(progn (define-input commands :capacity 9) (defun double (n) (* 2 n)))")?;
/// let handle = engine.handle();
/// let operator = std::thread::spawn(move || {
///     let four: i64 = handle.call("double", [2.into()]).wait()?;
///     assert_eq!(four, 4);
///     handle.signal("commands", ["drive".into(), four.into()]).expect("the program has the input");
///     Ok::<(), esl::Error>(())
/// });
/// let command = engine.eval("(multiple-value-list (wait-for-event commands))")?;
/// assert_eq!(command.to_string(), "(\"drive\" 4)");
/// operator.join().expect("it does not panic")?;
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Handle {
    sender: Sender,
    coming: Coming,
}

impl Handle {
    /// Returns a handle to a machine that an embedder has without an engine.
    pub fn to(machine: &Vm) -> Handle {
        Handle::new(machine)
    }

    pub(super) fn new(machine: &Vm) -> Handle {
        Handle { sender: Sender::new(&machine.inbox()), coming: machine.coming_observers() }
    }

    /// Signals an input of the program, by its name in any case. Waits while the input is full, if that is
    /// its rule: so not on the thread that runs the engine.
    ///
    /// # Errors
    /// [`SendError::NoSuchInput`], also before the program has defined the input; [`SendError::Ended`].
    pub fn signal(&self, input: &str, arguments: impl IntoIterator<Item = Data>) -> Result<(), SendError> {
        self.sender.signal(input, data(arguments))
    }

    /// Signals an input, as [`Handle::signal`], but does not wait.
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal(
        &self,
        input: &str,
        arguments: impl IntoIterator<Item = Data>,
    ) -> Result<(), SendError> {
        self.sender.try_signal(input, data(arguments))
    }

    /// Returns an input of the program, by its name in any case, for many signals. The program may define it
    /// later.
    pub fn input(&self, name: &str) -> InputHandle {
        InputHandle(self.sender.input(name))
    }

    /// Adds a fact to the program's database. The answer is whether it is new.
    pub fn assert(&self, fact: impl Into<Data>) -> Reply<bool> {
        self.ask(FunctionRef::Named("ESL:ASSERT".into()), [fact.into()], true)
    }

    /// Removes the facts that match a pattern. The answer is how many there were.
    pub fn retract(&self, pattern: impl Into<Data>) -> Reply<i64> {
        self.ask(FunctionRef::Named("ESL:RETRACT".into()), [pattern.into()], true)
    }

    /// Sets a property of the program, in place of the value that it has for these arguments. The answer is
    /// whether that has changed it.
    pub fn set(
        &self,
        property: &str,
        arguments: impl IntoIterator<Item = Data>,
        value: impl Into<Data>,
    ) -> Reply<bool> {
        let name = Data::Symbol(property.to_uppercase());
        self.ask(
            FunctionRef::Named("ESL::%SET-PROPERTY".into()),
            [name, Data::list(arguments), value.into()],
            true,
        )
    }

    /// Calls a function of the program, by its name or as a [`Function`](super::Function), in a task of its
    /// own. The answer is its first value, converted.
    pub fn call<T: FromData>(
        &self,
        function: impl Callable,
        arguments: impl IntoIterator<Item = Data>,
    ) -> Reply<T> {
        self.ask(function.callee(self.sender.inbox()), arguments, false)
    }

    /// Starts a task that calls a function of the program.
    pub fn spawn(&self, function: impl Callable, arguments: impl IntoIterator<Item = Data>) -> TaskHandle {
        TaskHandle { sender: self.sender.clone(), result: self.call(function, arguments) }
    }

    /// Aborts the task with this number, which [`Handle::tasks`] tells. Nothing happens if it has ended.
    pub fn abort(&self, task: u64) {
        self.sender.inbox().put(Incoming::Abort(task));
    }

    /// Has no task run, until [`Handle::resume`] or the end of the last handle. The clock goes on, if it is
    /// not virtual.
    pub fn pause(&self) {
        self.sender.inbox().put(Incoming::Pause(true));
    }

    /// Has tasks run again.
    pub fn resume(&self) {
        self.sender.inbox().put(Incoming::Pause(false));
    }

    /// Has [`Engine::eval`](super::Engine::eval) return with [`Error::Stopped`], and
    /// [`Engine::run`](super::Engine::run) with [`Ending::Stopped`](super::Ending::Stopped). Tasks stay as
    /// they are, and go on in the next run.
    pub fn stop(&self) {
        self.sender.inbox().put(Incoming::Stop);
    }

    /// Has the program deal with a signal as if the process had got it: it calls the function of `on-signal`,
    /// or ends.
    pub fn send_signal(&self, signal: ProcessSignal) {
        self.sender.inbox().put(Incoming::Signal(signal));
    }

    /// Returns the tasks of the program that have not ended, in the order in which they were made.
    pub fn tasks(&self) -> Reply<Vec<TaskInfo>> {
        Reply { pending: self.sender.ask(Question::Tasks), read: read_tasks }
    }

    /// Has an observer watch the run from the next turn on.
    pub fn subscribe(&self, observer: impl Observer + 'static) {
        self.coming.add(Box::new(observer));
        self.sender.inbox().inspect(Inspection::Watch);
    }

    fn ask<T: FromData>(
        &self,
        function: FunctionRef,
        arguments: impl IntoIterator<Item = Data>,
        goes_first: bool,
    ) -> Reply<T> {
        Reply::of_value(self.ask_pending(function, arguments, goes_first))
    }

    /// Asks for a call, and returns its answer to come.
    pub(super) fn ask_pending(
        &self,
        function: FunctionRef,
        arguments: impl IntoIterator<Item = Data>,
        goes_first: bool,
    ) -> Pending {
        self.sender.ask(Question::Call { function, arguments: data(arguments), goes_first })
    }
}

/// An input of a program, as other threads signal it many times: [`Handle::signal`] looks for the name each
/// time.
///
/// ```
/// use esl::Engine;
///
/// let mut engine = Engine::new()?;
/// engine.eval("(define-input scan :capacity 100 :when-full :wait)")?;
/// let scan = engine.handle().input("scan");
/// let sensor = std::thread::spawn(move || (1..=3).try_for_each(|n| scan.signal([n.into()])));
/// let sum = engine.eval("(loop repeat 3 sum (wait-for-event scan))")?;
/// assert_eq!(sum.as_integer(), Some(6));
/// sensor.join().expect("it does not panic").expect("there is the input");
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct InputHandle(SenderInput);

impl InputHandle {
    /// Returns the name, in upper case.
    pub fn name(&self) -> &str {
        self.0.name()
    }

    /// Signals the input, as [`Handle::signal`].
    ///
    /// # Errors
    /// As that.
    pub fn signal(&self, arguments: impl IntoIterator<Item = Data>) -> Result<(), SendError> {
        self.0.signal(data(arguments))
    }

    /// Signals the input, as [`Handle::try_signal`].
    ///
    /// # Errors
    /// [`SendError`].
    pub fn try_signal(&self, arguments: impl IntoIterator<Item = Data>) -> Result<(), SendError> {
        self.0.try_signal(data(arguments))
    }

    /// Signals the input if it has room, and never waits.
    ///
    /// # Errors
    /// The arguments, if it has none or is not there: [`InputHandle::signal`] waits, or says why.
    pub fn offer<A: IntoIterator<Item = Data>>(&self, arguments: A) -> Result<(), A> {
        if !self.0.admit() {
            return Err(arguments);
        }
        self.0.signal_admitted(data(arguments));
        Ok(())
    }
}

pub(super) fn data(arguments: impl IntoIterator<Item = Data>) -> Vec<Datum> {
    arguments.into_iter().map(|argument| argument.to_datum(USER_PACKAGE)).collect()
}

/// An answer to come from a run: a future, which can also be waited for. Dropping it changes nothing in the
/// run.
///
/// ```
/// use esl::Engine;
///
/// let mut engine = Engine::new()?;
/// let sum = engine.begin("(+ 1 2)");
/// assert!(sum.take().is_none(), "nothing has run");
/// engine.run();
/// assert_eq!(sum.wait()?.as_integer(), Some(3));
/// # Ok::<(), esl::Error>(())
/// ```
pub struct Reply<T> {
    pending: Pending,
    read: fn(Answer) -> Result<T, Error>,
}

impl<T> fmt::Debug for Reply<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.pending.fmt(f)
    }
}

impl<T: FromData> Reply<T> {
    /// Returns the reply that a pending answer will be, by its first value.
    pub(super) fn of_value(pending: Pending) -> Reply<T> {
        Reply { pending, read: read_value }
    }
}

impl<T> Reply<T> {
    /// Returns the reply that a pending answer will be, as `read` reads it.
    pub(super) fn new(pending: Pending, read: fn(Answer) -> Result<T, Error>) -> Reply<T> {
        Reply { pending, read }
    }

    /// Waits for the answer: on another thread than the one that runs the engine.
    ///
    /// # Errors
    /// [`Error::Failed`], [`Error::Aborted`], [`Error::Exited`], [`Error::NotData`], [`Error::NotOfType`] if
    /// the value is of another type, and [`Error::Ended`] if the engine is gone.
    pub fn wait(self) -> Result<T, Error> {
        (self.read)(self.pending.wait())
    }

    /// Returns the answer, if it has come and was not taken before.
    pub fn take(&self) -> Option<Result<T, Error>> {
        self.pending.take().map(self.read)
    }
}

impl<T> Future for Reply<T> {
    type Output = Result<T, Error>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<T, Error>> {
        let read = self.read;
        Pin::new(&mut self.pending).poll(context).map(read)
    }
}

/// Returns the error that an answer without a value stands for.
fn error_of(answer: Answer) -> Error {
    match answer {
        Answer::Failed { cause, message, report, arguments, frames, .. } => Error::Failed {
            cause,
            message,
            report,
            frames,
            arguments: arguments.iter().map(Data::from_datum).collect(),
        },
        Answer::Circular => Error::NotData(ExportError::Circular),
        Answer::TooLarge => Error::NotData(ExportError::TooLarge),
        Answer::Aborted => Error::Aborted,
        Answer::Exited(status) => Error::Exited(status),
        Answer::Values(_) | Answer::Tasks(_) | Answer::Ended => Error::Ended,
    }
}

pub(super) fn read_value<T: FromData>(answer: Answer) -> Result<T, Error> {
    match answer {
        Answer::Values(values) => {
            let value = values.first().map_or(Ok(Data::Nil), Data::whole)?;
            T::from_data(&value).ok_or(Error::NotOfType { value: value.to_string(), expected: T::TYPE })
        }
        answer => Err(error_of(answer)),
    }
}

fn read_tasks(answer: Answer) -> Result<Vec<TaskInfo>, Error> {
    match answer {
        Answer::Tasks(tasks) => Ok(tasks),
        answer => Err(error_of(answer)),
    }
}

/// A task that was started from outside.
///
/// ```
/// use esl::{Engine, Error};
///
/// let mut engine = Engine::new()?;
/// engine.eval("(defun patrol () (loop (sleep 0.01)))")?;
/// let patrol = engine.handle().spawn("patrol", []);
/// patrol.abort();
/// engine.run();
/// assert_eq!(patrol.wait(), Err(Error::Aborted));
/// # Ok::<(), Error>(())
/// ```
#[derive(Debug)]
pub struct TaskHandle {
    sender: Sender,
    result: Reply<Data>,
}

impl TaskHandle {
    /// Asks for a call in a task of its own.
    pub(super) fn begin(sender: Sender, question: Question) -> TaskHandle {
        let result = Reply::of_value(sender.ask(question));
        TaskHandle { sender, result }
    }

    /// Aborts the task: it unwinds and runs its cleanups. Nothing happens if it has ended.
    pub fn abort(&self) {
        self.sender.inbox().put(Incoming::AbortCall(self.result.pending.number()));
    }

    /// Waits until the task has ended, and returns the first value of its function.
    ///
    /// # Errors
    /// As [`Reply::wait`].
    pub fn wait(self) -> Result<Data, Error> {
        self.result.wait()
    }

    /// Returns the first value of its function, if the task has ended and it was not taken before.
    pub fn take(&self) -> Option<Result<Data, Error>> {
        self.result.take()
    }

    /// Returns the result as a future.
    pub fn into_reply(self) -> Reply<Data> {
        self.result
    }
}

/// Ready when the task has ended, with the first value of its function.
impl Future for TaskHandle {
    type Output = Result<Data, Error>;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Result<Data, Error>> {
        Pin::new(&mut self.result).poll(context)
    }
}
