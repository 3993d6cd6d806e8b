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

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::USER_PACKAGE;
use esl_vm::host::{Host, RealHost};
use esl_vm::run::CallError;
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use crate::data::Data;
use crate::error::{Error, NAME_MARKS};
use crate::program;

/// Error of a function of the embedder's: its text becomes the message of a failure in the program.
pub type FunctionError = Box<dyn std::error::Error + Send + Sync>;

/// A machine with the library. Definitions last from one evaluation to the next.
///
/// An engine belongs to one thread at a time and can be sent to another; engines share nothing.
pub struct Engine {
    machine: Vm,
    ticks: u64,
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
        Ok(Engine { machine: program::machine(config, host)?, ticks: u64::MAX })
    }

    /// Limits the ticks (calls and turns of loops) of each evaluation.
    #[must_use]
    pub fn with_ticks(mut self, ticks: u64) -> Engine {
        self.ticks = ticks;
        self
    }

    /// Defines a function that programs call and Rust implements. `function` gets as many arguments as there
    /// are parameters, returns a value or an error, and cannot call back.
    ///
    /// # Errors
    /// [`Error::InvalidName`]; [`Error::DoesNotCompile`] if the name belongs to the language.
    pub fn register<F>(
        &mut self,
        name: &str,
        parameters: &[&str],
        documentation: &str,
        mut function: F,
    ) -> Result<(), Error>
    where
        F: FnMut(&[Data]) -> Result<Data, FunctionError> + Send + 'static,
    {
        for word in parameters.iter().chain([&name]) {
            let is_name = |c: char| c.is_alphanumeric() || NAME_MARKS.contains(c);
            if word.is_empty() || !word.chars().all(is_name) {
                return Err(Error::InvalidName((*word).into()));
            }
        }
        let number = self.machine.add_host_function(Box::new(move |arguments| {
            let arguments: Vec<Data> = arguments.iter().map(Data::from_datum).collect();
            let value = function(&arguments).map_err(|error| error.to_string())?;
            Ok(value.to_datum(USER_PACKAGE))
        }));
        let parameters = parameters.join(" ");
        let documentation = documentation.replace('\\', "\\\\").replace('"', "\\\"");
        let definition = format!(
            "(defun {name} ({parameters}) \"{documentation}\" (esl::%call-host {number} {parameters}))"
        );
        self.eval(&definition).map(drop)
    }

    /// Evaluates the forms of a text one after another, and returns the first value of the last form.
    ///
    /// Tasks that the text has spawned go on in later evaluations.
    ///
    /// # Errors
    /// All of [`Error`] but [`Error::Refused`] and [`Error::InvalidName`].
    pub fn eval(&mut self, text: &str) -> Result<Data, Error> {
        let datum = Datum::string(text, Default::default());
        let text = self.machine.import(&datum).map_err(|_| Error::NoMemory("the text"))?;
        let function = self.machine.library_function("%EVAL-TEXT")?;
        let result = self.machine.call(function, &[text], self.ticks);
        self.machine.flush();
        match result {
            Ok(values) => {
                let datum = self.machine.export(values.first().copied().unwrap_or(Value::NIL))?;
                Ok(Data::from_datum(&datum))
            }
            Err(error) => Err(self.error(error)),
        }
    }

    /// Returns the reason why an evaluation did not return.
    fn error(&mut self, error: CallError) -> Error {
        if let CallError::Failed { message, .. } = &error
            && let Some(diagnostics) = self.machine.take_refused(message)
        {
            return Error::DoesNotCompile(diagnostics);
        }
        error.into()
    }

    /// Returns the machine, for what this API does not offer.
    pub fn machine(&mut self) -> &mut Vm {
        &mut self.machine
    }
}

#[cfg(test)]
mod tests {
    use esl_vm::embed::ExportError;
    use esl_vm::host::VirtualHost;

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
    fn limits_are_told_apart() {
        let mut small = engine(Config { budget: Some(10_000), ..Config::default() }).with_ticks(6_000);
        assert_eq!(small.eval("(loop)"), Err(Error::TicksUsed(6_000)));
        assert_eq!(small.eval("(loop)"), Err(Error::BudgetSpent));
        let mut engine = engine(Config::default());
        assert_eq!(engine.eval("(abort-task (current-task))"), Err(Error::Aborted));
        assert_eq!(engine.eval("(let ((a (list 1))) (rplacd a a))"), Err(ExportError::Circular.into()));
        let error = engine.register("READ SENSOR", &[], "", |_| Ok(Data::Nil));
        assert_eq!(error, Err(Error::InvalidName("READ SENSOR".into())));
    }
}
