//! The embedding API: a machine in which a program in Rust evaluates ESL.
//!
//! ```
//! use std::time::Duration;
//!
//! use esl::host::VirtualHost;
//! use esl::{Config, Data, Engine};
//!
//! // A machine with little memory whose time is virtual and whose output is kept.
//! let host = VirtualHost::new();
//! let captured = host.captured();
//! let mut engine = Engine::with(Config { memory: 32 << 20, ..Config::default() }, Box::new(host))?;
//! let value = engine.eval("(progn (sleep 3600) (format t \"an hour later~%\") (now))")?;
//! assert_eq!(value, Data::Float(Duration::from_secs(3600).as_secs_f64()));
//! assert_eq!(captured.output(), "an hour later\n");
//! # Ok::<(), esl::Error>(())
//! ```

mod call;
mod definition;
mod executor;
mod function;
mod handle;
mod loading;
mod looping;
mod operation;
mod patch;
mod query;
mod watch;

use std::future::Future;
use std::sync::Arc;

use esl_host::{Host, HostRows, Inbox, RealHost};
use esl_vm::run::CallError;
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use crate::data::Data;
use crate::error::{Error, NAME_MARKS};
use crate::program;

pub use call::{Call, Failure};
pub use definition::HostDefinition;
pub use esl_vm::observe::{Observer, Seen};
pub use esl_vm::task::TaskNumber;
pub use executor::{Executor, HostFuture};
pub use function::{BegunCall, Callable, Function};
pub use handle::{Handle, InputHandle, Reply, TaskHandle};
pub use looping::{Ending, Poll, Running};
pub use operation::Operation;
pub use patch::{ProgramDefinition, ProgramDefinitionKind};
pub use query::QueryAnswer;
use watch::LeftWatches;
pub use watch::{FactWatch, WatchedFact};

/// A machine with the library. Definitions last from one evaluation to the next.
///
/// An engine belongs to one thread at a time and can be sent to another; engines share nothing.
///
/// ```
/// use esl::Engine;
///
/// let mut engine = Engine::new()?;
/// engine.eval("(defun twice (n) (* 2 n))")?;
/// assert_eq!(engine.eval("(twice 21)")?.as_integer(), Some(42));
/// # Ok::<(), esl::Error>(())
/// ```
pub struct Engine {
    machine: Vm,
    ticks: u64,
    /// Room for the arguments of a call; empty between two calls.
    arguments: Vec<Value>,
    /// Runs the futures of operations.
    executor: Executor,
    /// Number of names of watches over facts.
    watches: u64,
    left_watches: LeftWatches,
}

impl Engine {
    /// Creates an engine with the default limits, whose programs write to the standard streams.
    ///
    /// # Errors
    /// [`Error::NoMemory`], if the system has none.
    pub fn new() -> Result<Engine, Error> {
        Engine::with(Config::default(), Box::new(RealHost::new(Vec::new())))
    }

    /// Creates an engine with limits and a host of the embedder's.
    ///
    /// # Errors
    /// [`Error::NoMemory`], if the limit of memory leaves no room for the library.
    pub fn with(config: Config, host: Box<dyn Host + Send>) -> Result<Engine, Error> {
        let machine = program::machine(config, host)?;
        Ok(Engine {
            machine,
            ticks: u64::MAX,
            arguments: Vec::new(),
            executor: executor::thread(),
            watches: 0,
            left_watches: LeftWatches::default(),
        })
    }

    /// Limits the ticks (calls and turns of loops) of each evaluation.
    #[must_use]
    pub fn with_ticks(mut self, ticks: u64) -> Engine {
        self.ticks = ticks;
        self
    }

    /// Has the futures of operations run by an executor of the embedder's, such as a tokio runtime. Without
    /// this, one thread of the engine's runs them all.
    #[must_use]
    pub fn with_executor(mut self, executor: impl Fn(HostFuture) + Send + Sync + 'static) -> Engine {
        self.executor = Arc::new(executor);
        self
    }

    /// Defines a function that programs call and Rust implements. It returns at once, and cannot call back; a
    /// panic in it is a failure `:HOST-PANIC` of the call.
    ///
    /// `lambda_list` is that of the function, in ESL: `(metres &key (speed 0.1))`.
    ///
    /// # Errors
    /// [`Error::InvalidName`]; [`Error::DoesNotCompile`] if the name belongs to the language, or the lambda
    /// list is none.
    pub fn define<F, V>(
        &mut self,
        name: &str,
        lambda_list: &str,
        documentation: &str,
        function: F,
    ) -> Result<(), Error>
    where
        F: FnMut(Call) -> Result<V, Failure> + Send + 'static,
        V: Into<Data>,
    {
        self.add_definition(HostDefinition::at_once(name, lambda_list, documentation, function))
    }

    /// Defines a function whose calls are operations, performed by futures. The calling task waits until the
    /// future is ready; when the call is left before, the future is dropped.
    ///
    /// ```
    /// use esl::Engine;
    ///
    /// let mut engine = Engine::new()?;
    /// engine.define_async("DRIVE", "(metres &key (speed 1))", "Drives that far.", |call| async move {
    ///     let (metres, speed): (f64, f64) = (call.get("metres")?, call.get("speed")?);
    ///     Ok(metres / speed)
    /// })?;
    /// assert_eq!(engine.eval("(drive 3 :speed 2)")?.as_float(), Some(1.5));
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Engine::define`].
    pub fn define_async<F, R, V>(
        &mut self,
        name: &str,
        lambda_list: &str,
        documentation: &str,
        mut function: F,
    ) -> Result<(), Error>
    where
        F: FnMut(Call) -> R + Send + 'static,
        R: Future<Output = Result<V, Failure>> + Send + 'static,
        V: Into<Data> + 'static,
    {
        let executor = self.executor.clone();
        self.define_operation(name, lambda_list, documentation, move |operation| {
            let future = function(operation.call().clone());
            executor(executor::job(operation, future));
        })
    }

    /// Defines a function whose calls are operations. `begin` begins one, and sees to it that it is completed
    /// or fails, on any thread; the calling task waits until then.
    ///
    /// # Errors
    /// As [`Engine::define`].
    pub fn define_operation<F>(
        &mut self,
        name: &str,
        lambda_list: &str,
        documentation: &str,
        begin: F,
    ) -> Result<(), Error>
    where
        F: FnMut(Operation) + Send + 'static,
    {
        self.add_definition(HostDefinition::operation(name, lambda_list, documentation, begin))
    }

    /// Has calls of an operation that are left not wait until it has stopped.
    ///
    /// # Errors
    /// [`Error::InvalidName`].
    pub fn detach(&mut self, name: &str) -> Result<(), Error> {
        check_name(name)?;
        self.eval(&format!("(esl::%detach '{name})")).map(drop)
    }

    /// Defines the functions that rows declare: `make` makes these for the inbox of this engine. Their code
    /// takes arguments by types, and may take inputs of the program, which it signals from other threads.
    ///
    /// ```
    /// use esl::Engine;
    /// use esl::host::{HostFailure, HostRows};
    ///
    /// let mut engine = Engine::new()?;
    /// engine.define_rows(|inbox| {
    ///     let mut rows = HostRows::new(inbox);
    ///     rows.at_once("OPEN-VALVE", ["number"], "Opens a valve.", |number: u16| {
    ///         if number > 3 { Err(HostFailure::new("VALVE-STUCK", number)) } else { Ok(number) }
    ///     });
    ///     rows
    /// })?;
    /// assert_eq!(engine.eval("(open-valve 2)")?.as_integer(), Some(2));
    /// let stuck = "(handler-case (open-valve 7) (failure (f) (failure-cause f)))";
    /// assert_eq!(engine.eval(stuck)?.to_string(), ":VALVE-STUCK");
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`Engine::define`].
    pub fn define_rows(&mut self, make: impl FnOnce(&Inbox) -> HostRows) -> Result<(), Error> {
        for row in make(&self.machine.inbox()) {
            let lambda_list = format!("({})", row.parameters.join(" "));
            self.define_name(row.name, &lambda_list, row.documentation, row.waits())?;
            self.machine.add_host_row(row);
        }
        Ok(())
    }

    /// Has one call at most of an operation be under way, or one for each value of a parameter, as by
    /// `define-exclusive`.
    ///
    /// # Errors
    /// [`Error::InvalidName`]; [`Error::Failed`] if the name is not that of an operation, or the parameter is
    /// unknown.
    pub fn make_exclusive(&mut self, name: &str, parameter: Option<&str>) -> Result<(), Error> {
        check_name(name)?;
        parameter.map_or(Ok(()), check_name)?;
        self.eval(&format!("(esl:define-exclusive {name} {})", parameter.unwrap_or_default())).map(drop)
    }

    /// Defines a function of the embedder's.
    ///
    /// # Errors
    /// As [`Engine::define`].
    pub fn add_definition(&mut self, definition: HostDefinition) -> Result<(), Error> {
        let names = self.define_form(definition.name(), &definition.form())?;
        definition.give_to(&mut self.machine, names);
        Ok(())
    }

    /// Defines a function of the host for programs. Returns the variables of its lambda list, in lower case.
    fn define_name(
        &mut self,
        name: &str,
        lambda_list: &str,
        documentation: &str,
        waits: bool,
    ) -> Result<Arc<[String]>, Error> {
        self.define_form(name, &definition::form(name, lambda_list, documentation, waits))
    }

    /// Makes the definition of this name. Returns the variables of its lambda list, in lower case.
    fn define_form(&mut self, name: &str, form: &str) -> Result<Arc<[String]>, Error> {
        check_name(name)?;
        let names = self.eval(form)?;
        let names = names.as_list().unwrap_or_default().iter();
        Ok(names.map(|name| name.as_str().unwrap_or_default().to_lowercase()).collect())
    }

    /// Evaluates the forms of a text one after another, and returns the first value of the last form.
    ///
    /// Tasks that the text has spawned go on in later evaluations.
    ///
    /// # Errors
    /// All of [`Error`] but [`Error::Refused`] and [`Error::InvalidName`].
    pub fn eval(&mut self, text: &str) -> Result<Data, Error> {
        self.eval_as(text, None)
    }

    /// Returns the first of the values of a call.
    fn first_value(&mut self, result: Result<Vec<Value>, CallError>) -> Result<Value, Error> {
        self.machine.flush();
        match result {
            Ok(values) => Ok(values.first().copied().unwrap_or(Value::NIL)),
            Err(error) => Err(self.error(error)),
        }
    }

    /// Returns the reason why an evaluation did not return.
    fn error(&mut self, error: CallError) -> Error {
        if matches!(error, CallError::Exited(_)) {
            self.machine.take_exit_status();
        }
        self.diagnose(error.into())
    }

    /// Returns an error of a text that was given to [`Engine::begin`] with its diagnostics, as
    /// [`Engine::eval`] does: [`Error::DoesNotCompile`] in place of a failure `:COMPILATION-FAILED`. Other
    /// errors stay.
    #[must_use]
    pub fn diagnose(&mut self, error: Error) -> Error {
        if let Error::Failed { message, .. } = &error
            && let Some(diagnostics) = self.machine.take_refused(message)
        {
            return Error::DoesNotCompile(diagnostics);
        }
        error
    }

    /// Writes what the program has printed and is still in a buffer. All calls that run the program do so at
    /// their end, except [`Engine::begin_call`].
    pub fn flush(&mut self) {
        self.machine.flush();
    }

    /// Returns a handle, through which other threads reach the run.
    pub fn handle(&self) -> Handle {
        Handle::new(&self.machine)
    }

    /// Ends what still runs: aborts all tasks, newest first, and runs their cleanups; cancels operations
    /// under way, and waits until they have stopped. Returns what has not ended in time. An engine that is
    /// dropped does the same.
    pub fn end(&mut self) -> Vec<String> {
        let left = self.machine.end_run();
        self.machine.flush();
        left
    }

    /// Returns the strict fingerprint of the state between two turns: of everything that decides how the run
    /// goes on. Takes a time in proportion to the state, and changes nothing.
    pub fn fingerprint(&self) -> u128 {
        self.machine.fingerprint()
    }

    /// Returns the canary of the run so far: a hash of the turns of its tasks and of the questions to its
    /// host. Runs are compared by it: a recorded one and its replay have the same.
    pub fn canary(&self) -> u64 {
        self.machine.canary()
    }

    /// Returns the ticks that all tasks have used.
    pub fn ticks(&self) -> u64 {
        self.machine.ticks()
    }

    /// Returns a text that shows the tasks of the program: each below its maker, with what it does and where,
    /// and the ticks that it has used.
    pub fn task_report(&self) -> String {
        self.machine.task_report()
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.end();
    }
}

/// Checks that a text is the name of a function.
///
/// # Errors
/// [`Error::InvalidName`].
fn check_name(name: &str) -> Result<(), Error> {
    let is_name = |c: char| c.is_alphanumeric() || NAME_MARKS.contains(c);
    if name.is_empty() || !name.chars().all(is_name) { Err(Error::InvalidName(name.into())) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use esl_host::VirtualHost;
    use esl_vm::embed::ExportError;

    use super::*;

    fn engine(config: Config) -> Engine {
        Engine::with(config, Box::new(VirtualHost::new())).expect("there is room for the library")
    }

    /// Returns the codes of the errors for which a text is refused, and the starts of their spans.
    fn refused(text: &str) -> Vec<(&'static str, u32)> {
        match engine(Config::default()).eval(text) {
            Err(Error::DoesNotCompile(errors)) => {
                errors.iter().map(|error| (error.code, error.primary.span.start)).collect()
            }
            other => panic!("`{text}` gives {other:?}"),
        }
    }

    #[test]
    fn a_text_is_refused_with_its_errors_and_their_places() {
        assert_eq!(refused("(list 1)\n(list 2"), [("unclosed-list", 9)]);
        assert_eq!(refused("(list (if) (let 5))"), [("missing-part", 7), ("malformed-binding", 16)]);
        assert_eq!(refused("(defun car (x) x)"), [("locked-name", 7)]);
    }

    #[test]
    fn a_form_that_the_program_evaluates_fails() {
        let mut engine = engine(Config::default());
        for (text, expected) in [
            ("(eval '(let 5))", ":COMPILATION-FAILED"),
            ("(read-from-string \")\")", ":READER-ERROR"),
            ("(progn (ignore-errors (eval '(let 5))) (fail :lost 'in 'space))", ":LOST"),
        ] {
            let Err(Error::Failed { cause, report, .. }) = engine.eval(text) else { panic!("{text}") };
            assert_eq!(cause, expected);
            assert!(report.contains("no recovery available"), "{report}");
        }
    }

    #[test]
    fn an_evaluation_that_does_not_return_and_an_engine_that_is_dropped_run_cleanups() {
        let host = VirtualHost::new();
        let captured = host.captured();
        let engine = Engine::with(Config::default(), Box::new(host)).expect("there is room for the library");
        let mut engine = engine.with_ticks(10_000);
        let taken = |captured: &esl_host::Captured, before: &mut usize| {
            let output = captured.output();
            let new = output[*before..].to_owned();
            *before = output.len();
            new
        };
        let mut before = 0;
        assert_eq!(engine.eval("(unwind-protect (loop) (princ 'off))"), Err(Error::TicksUsed(10_000)));
        assert_eq!(taken(&captured, &mut before), "OFF");
        let waiting = "(unwind-protect (wait-for-event (make-event)) (princ 'left))";
        assert_eq!(engine.eval(waiting), Err(Error::Deadlocked));
        assert_eq!(taken(&captured, &mut before), "LEFT");
        let background = "(progn (spawn (unwind-protect (loop) (princ 'old)))
                                 (spawn (unwind-protect (loop) (sleep 5) (princ 'new)))
                                 (sleep 0))";
        assert_eq!(engine.eval(background), Ok(Data::Nil));
        drop(engine);
        assert_eq!(taken(&captured, &mut before), "OLDNEW");
    }

    #[test]
    fn limits_are_told_apart() {
        let mut small = engine(Config { budget: Some(10_000), ..Config::default() }).with_ticks(6_000);
        assert_eq!(small.eval("(loop)"), Err(Error::TicksUsed(6_000)));
        assert_eq!(small.eval("(loop)"), Err(Error::BudgetSpent));
        let mut engine = engine(Config::default());
        assert_eq!(engine.eval("(abort-task (current-task))"), Err(Error::Aborted));
        assert_eq!(engine.eval("(let ((a (list 1))) (rplacd a a))"), Err(ExportError::Circular.into()));
        let error = engine.define("READ SENSOR", "()", "", |_| Ok(Data::Nil));
        assert_eq!(error, Err(Error::InvalidName("READ SENSOR".into())));
    }
}
