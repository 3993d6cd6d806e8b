//! Errors of compiling, loading and running programs from Rust.

use std::fmt;

use esl_bytecode::diagnostic::Diagnostic;
use esl_compiler::diagnostic::{Renderer, Sources};
use esl_host::FailureFrame;
use esl_vm::embed::{ExportError, LibraryError};
use esl_vm::load::LoadError;
use esl_vm::run::CallError;

use crate::data::{Data, MAX_DEPTH};

/// Reason why an evaluation returned no value, or a program could not be begun.
///
/// ```
/// use esl::{Engine, Error};
///
/// let mut engine = Engine::new()?.with_ticks(100_000);
/// let outcome = |engine: &mut Engine, text| engine.eval(text).expect_err("it does not return");
///
/// let Error::DoesNotCompile(errors) = outcome(&mut engine, "(print 1)\n(let 5)") else { panic!() };
/// assert_eq!((errors[0].code, errors[0].primary.span.start), ("malformed-binding", 15));
///
/// let Error::Failed { cause, message, .. } = outcome(&mut engine, "(car 5)") else { panic!() };
/// assert_eq!((&*cause, &*message), (":TYPE-ERROR", "The value 5 is not of type LIST."));
///
/// assert_eq!(outcome(&mut engine, "(loop)"), Error::TicksUsed(100_000));
/// assert_eq!(outcome(&mut engine, "(wait-for-event (make-event))"), Error::Deadlocked);
/// assert_eq!(outcome(&mut engine, "(exit 3)"), Error::Exited(3));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// A form of the text cannot be read or compiled. The forms before it have been evaluated.
    ///
    /// Holds the errors found in that form; their spans are bytes of the text.
    DoesNotCompile(Vec<Diagnostic>),
    /// A failure that nothing in the program recovered from ended the evaluation.
    Failed {
        /// Cause of the failure, or name of the condition's type, as the program prints it: `:VALVE-STUCK`.
        cause: String,
        /// Text of the condition.
        message: String,
        /// Message, frames of the failure and what they were recovering from, as the commands print them.
        report: String,
        /// Arguments of the failure: of `(fail :valve-stuck 'left)` the symbol. None if the cause is an error
        /// of the language.
        arguments: Vec<Data>,
        /// The calls that the failure has left unfinished, innermost first. A form such as `task-net` fails
        /// as one of its tasks has: the calls of that task come before those of the task with the form.
        frames: Vec<FailureFrame>,
    },
    /// The evaluation was aborted: by the program, or by a [`ProcessSignal`](crate::host::ProcessSignal).
    Aborted,
    /// The program has asked to end with this status: `(exit 3)`, in the evaluation or beside it. All tasks
    /// are aborted, and run their cleanups; later evaluations begin another run.
    Exited(u8),
    /// The evaluation waits for an event that no task can signal.
    Deadlocked,
    /// The machine has spent [`Config::budget`](crate::Config::budget), in this evaluation or an earlier one.
    BudgetSpent,
    /// The evaluation did not end within this number of ticks, and was ended.
    TicksUsed(u64),
    /// The run was stopped by [`Incoming::Stop`](crate::host::Incoming).
    Stopped,
    /// [`Config::memory`](crate::Config::memory) leaves no room. Holds what it leaves no room for.
    NoMemory(&'static str),
    /// The bytecode is damaged, was made by another version, or breaks a rule of the verifier.
    Refused(LoadError),
    /// A file cannot be read.
    Unreadable {
        /// Name of the file.
        file: String,
        /// Reason of the operating system.
        reason: String,
    },
    /// The value is not of the type that was asked for.
    NotOfType {
        /// The value, as the program prints it.
        value: String,
        /// Name of the type in `COMMON-LISP`.
        expected: &'static str,
    },
    /// The engine that was asked is gone, or replays a run in which this was not asked.
    Ended,
    /// The value has lists or vectors more than [`MAX_DEPTH`] levels deep.
    NestedTooDeeply,
    /// The value cannot become [`Data`].
    NotData(ExportError),
    /// The name cannot be that of a function.
    InvalidName(String),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::DoesNotCompile(errors) => {
                let (renderer, sources) = (Renderer::default(), Sources::new());
                let texts: Vec<String> =
                    errors.iter().map(|error| renderer.render(error, &sources)).collect();
                f.write_str(texts.join("\n").trim_end())
            }
            Error::Failed { message, .. } => f.write_str(message),
            Error::Aborted => f.write_str("the evaluation was aborted"),
            Error::Exited(status) => write!(f, "the program has ended with the status {status}"),
            Error::Deadlocked => f.write_str("the evaluation waits for an event that no task can signal"),
            Error::BudgetSpent => f.write_str(
                "the machine has spent its budget of ticks: make a new one, or raise `Config::budget`",
            ),
            Error::TicksUsed(ticks) => write!(
                f,
                "the evaluation did not end within {ticks} ticks: raise the limit with `Engine::with_ticks`"
            ),
            Error::Stopped => f.write_str("the run was stopped from outside"),
            Error::NoMemory(what) => {
                write!(f, "the memory limit leaves no room for {what}: raise `Config::memory`")
            }
            Error::NotOfType { value, expected } => write!(f, "the value {value} is not of type {expected}"),
            Error::Unreadable { file, reason } => write!(f, "`{file}` cannot be read: {reason}"),
            Error::NestedTooDeeply => {
                write!(f, "the value has more than {MAX_DEPTH} levels of lists or vectors within each other")
            }
            Error::Ended => f.write_str("the engine is gone, or replays a run without this question"),
            Error::Refused(error) => error.fmt(f),
            Error::NotData(error) => error.fmt(f),
            Error::InvalidName(name) => {
                write!(f, "`{name}` is not the name of a function: use letters, digits and {NAME_MARKS}")
            }
        }
    }
}

/// Characters of a name beside letters and digits.
pub(crate) const NAME_MARKS: &str = "-+*/<>=!?%&$_~.";

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Error::Refused(error) => Some(error),
            Error::NotData(error) => Some(error),
            _ => None,
        }
    }
}

impl From<CallError> for Error {
    fn from(error: CallError) -> Error {
        match error {
            CallError::Failed { cause, message, report, arguments, frames } => {
                let arguments = arguments.0.iter().map(Data::from_datum).collect();
                Error::Failed { cause, message, report, arguments, frames: frames.into_vec() }
            }
            CallError::Aborted => Error::Aborted,
            CallError::Exited(status) => Error::Exited(status),
            CallError::Deadlocked => Error::Deadlocked,
            CallError::BudgetSpent => Error::BudgetSpent,
            CallError::TicksUsed(ticks) => Error::TicksUsed(ticks),
            CallError::Stopped => Error::Stopped,
            CallError::NoMemory => Error::NoMemory("a task"),
        }
    }
}

impl From<LibraryError> for Error {
    fn from(error: LibraryError) -> Error {
        match error {
            LibraryError::NoMemory => Error::NoMemory("a task"),
            LibraryError::Missing(name) => unreachable!("the library of this version has {name}"),
        }
    }
}

impl From<LoadError> for Error {
    fn from(error: LoadError) -> Error {
        match error {
            LoadError::Alloc(_) => Error::NoMemory("the program"),
            error => Error::Refused(error),
        }
    }
}

impl From<ExportError> for Error {
    fn from(error: ExportError) -> Error {
        Error::NotData(error)
    }
}
