//! The embedding API: a machine that a program in Rust evaluates ESL in.

use std::fmt;

use esl_bytecode::symbol::USER_PACKAGE;
use esl_vm::host::{Host, RealHost};
use esl_vm::run::CallError;
use esl_vm::vm::{Config, Vm};

use crate::data::Data;
use crate::program;

/// What went wrong.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Error {
    /// The machine could not be made, or a name is none.
    Setup(String),
    /// The evaluation ended with a failure, or the text does not compile; the text says how.
    Failed(String),
    /// The evaluation took more ticks than it was given.
    OutOfTicks(u64),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Setup(text) | Error::Failed(text) => f.write_str(text),
            Error::OutOfTicks(ticks) => write!(f, "the evaluation did not end within {ticks} ticks"),
        }
    }
}

impl std::error::Error for Error {}

impl From<&str> for Error {
    fn from(text: &str) -> Error {
        Error::Failed(text.into())
    }
}

/// A machine with the library, in which definitions stay from one evaluation to the next.
///
/// An engine belongs to one thread at a time and can be sent to another; engines share nothing.
pub struct Engine {
    machine: Vm,
    ticks: u64,
}

impl Engine {
    /// An engine with the default limits, whose programs write to the standard streams.
    ///
    /// # Errors
    /// [`Error::Setup`].
    pub fn new() -> Result<Engine, Error> {
        Engine::with(Config::default(), Box::new(RealHost::new(Vec::new())))
    }

    /// An engine with limits and a host of the embedder's.
    ///
    /// # Errors
    /// [`Error::Setup`] if the limit of memory leaves no room for the library.
    pub fn with(config: Config, host: Box<dyn Host + Send>) -> Result<Engine, Error> {
        let machine = program::machine(config, host).map_err(Error::Setup)?;
        Ok(Engine { machine, ticks: u64::MAX })
    }

    /// Limits the ticks (calls and turns of loops) that each evaluation may take.
    #[must_use]
    pub fn with_ticks(mut self, ticks: u64) -> Engine {
        self.ticks = ticks;
        self
    }

    /// Gives programs a function of the embedder's. It gets as many arguments as there are parameters, gives a value or
    /// the text of an error, and cannot call back.
    ///
    /// # Errors
    /// [`Error::Setup`] if the name belongs to the language, or is no name.
    pub fn register<F>(
        &mut self,
        name: &str,
        parameters: &[&str],
        documentation: &str,
        mut function: F,
    ) -> Result<(), Error>
    where
        F: FnMut(&[Data]) -> Result<Data, Error> + Send + 'static,
    {
        for word in parameters.iter().chain([&name]) {
            let is_name = |c: char| c.is_alphanumeric() || "-+*/<>=!?%&$_~.".contains(c);
            if word.is_empty() || !word.chars().all(is_name) {
                return Err(Error::Setup(format!("`{word}` is not the name of a function or parameter")));
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
        self.eval(&definition).map(drop).map_err(|error| Error::Setup(error.to_string()))
    }

    /// Evaluates the forms of a text one after another; gives the first value of the last one.
    ///
    /// # Errors
    /// [`Error::Failed`] if the text does not compile or a failure ends the evaluation, [`Error::OutOfTicks`].
    pub fn eval(&mut self, text: &str) -> Result<Data, Error> {
        let datum = esl_bytecode::datum::Datum::string(text, Default::default());
        let text = self.machine.import(&datum).map_err(|_| Error::Setup("no room for the text".into()))?;
        let function =
            self.machine.library_function("%EVAL-TEXT").map_err(|error| Error::Setup(error.to_string()))?;
        match self.machine.call(function, &[text], self.ticks) {
            Ok(values) => {
                let value = values.first().copied().unwrap_or(esl_vm::value::Value::NIL);
                let datum = self.machine.export(value).map_err(|error| Error::Failed(error.to_string()))?;
                Ok(Data::from_datum(&datum))
            }
            Err(CallError::TicksUsed(ticks)) => Err(Error::OutOfTicks(ticks)),
            Err(error) => Err(Error::Failed(error.to_string())),
        }
    }

    /// The machine, for what this API does not offer.
    pub fn machine(&mut self) -> &mut Vm {
        &mut self.machine
    }
}
