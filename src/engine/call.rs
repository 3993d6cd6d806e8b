//! Calls of the embedder's functions: their arguments by name and type, and their failures.

use std::any::Any;
use std::sync::Arc;

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::USER_PACKAGE;
use esl_host as host;
use smallvec::SmallVec;

use crate::data::{Data, FromData};
use crate::error::Error;

/// A failure of a function of the embedder's, which the program sees at the call.
///
/// Recovery procedures and handlers apply to it as to every other failure. A text becomes an error with that
/// message.
///
/// ```
/// use esl::engine::Failure;
/// use esl::{Data, Engine};
///
/// let mut engine = Engine::new()?;
/// engine.define("OPEN-VALVE", "(number)", "Opens a valve.", |call| {
///     let number: i64 = call.get("number")?;
///     if number > 3 { Err(Failure::new("VALVE-STUCK", [number.into()])) } else { Ok(number) }
/// })?;
/// let text = "(with-recovery-procedures (((:valve-stuck number) (values (list 'left number))))
///               (list (open-valve 1) (open-valve 5)))";
/// assert_eq!(engine.eval(text)?.to_string(), "(1 (LEFT 5))");
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Name of the cause, a keyword: `VALVE-STUCK`.
    pub cause: String,
    /// Arguments of the failure.
    pub arguments: Vec<Data>,
}

impl Failure {
    /// Creates a failure.
    pub fn new(cause: impl Into<String>, arguments: impl IntoIterator<Item = Data>) -> Failure {
        Failure { cause: cause.into(), arguments: arguments.into_iter().collect() }
    }

    /// Creates the failure of an argument that is not of the expected type, by its name in `COMMON-LISP`.
    fn of_type(datum: Data, expected: &str) -> Failure {
        Failure::new("TYPE-ERROR", [datum, Data::String(expected.into())])
    }

    /// Creates the failure of code of the embedder's that has panicked.
    pub(super) fn of_panic(panic: &(dyn Any + Send)) -> Failure {
        let failure = host::HostFailure::of_panic(panic);
        Failure::new(failure.cause, failure.arguments.iter().map(Data::from_datum))
    }

    /// Returns the arguments of a call, or its failure if they cannot be data.
    ///
    /// # Errors
    /// A failure `:NESTED-TOO-DEEPLY`.
    pub(super) fn of_arguments(arguments: &[Datum]) -> Result<GivenArguments, Failure> {
        let mut whole = GivenArguments::new();
        for argument in arguments {
            whole.push(Data::whole(argument).map_err(|error| Failure::too_deep(&error))?);
        }
        Ok(whole)
    }

    #[cold]
    fn too_deep(error: &Error) -> Failure {
        Failure::new("NESTED-TOO-DEEPLY", [Data::String(error.to_string())])
    }

    pub(super) fn to_host(&self) -> host::HostFailure {
        let arguments = self.arguments.iter().map(|argument| argument.to_datum(USER_PACKAGE)).collect();
        host::HostFailure { cause: self.cause.clone(), arguments }
    }
}

impl From<String> for Failure {
    fn from(text: String) -> Failure {
        Failure::new("SIMPLE-ERROR", [Data::String(text)])
    }
}

impl From<&str> for Failure {
    fn from(text: &str) -> Failure {
        Failure::from(text.to_owned())
    }
}

/// Arguments of a call, of which most have few.
pub(super) type GivenArguments = SmallVec<[Data; 2]>;

/// A call of a function of the embedder's, with its arguments.
///
/// ```
/// use esl::Engine;
///
/// let mut engine = Engine::new()?;
/// engine.define("DRIVE", "(goal &optional speed)", "Drives to a goal.", |call| {
///     let goal: String = call.get("goal")?;
///     let speed: Option<f64> = call.get("speed")?;
///     Ok(format!("{goal} at {}", speed.unwrap_or(0.5)))
/// })?;
/// assert_eq!(engine.eval("(drive \"ridge\")")?.as_str(), Some("ridge at 0.5"));
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Call {
    /// Variables of the lambda list, in order and in lower case.
    pub(super) names: Arc<[String]>,
    pub(super) arguments: GivenArguments,
}

impl Call {
    /// Returns the argument of the parameter with this name, in any case.
    ///
    /// # Errors
    /// A failure `:TYPE-ERROR` if the argument is not of the type; `:NO-SUCH-PARAMETER` if the lambda list
    /// does not have the parameter.
    pub fn get<T: FromData>(&self, parameter: &str) -> Result<T, Failure> {
        let name = parameter.to_lowercase();
        let place = self.names.iter().position(|known| *known == name);
        let Some(argument) = place.and_then(|place| self.arguments.get(place)) else {
            return Err(Failure::new("NO-SUCH-PARAMETER", [Data::String(name)]));
        };
        T::from_data(argument).ok_or_else(|| Failure::of_type(argument.clone(), T::TYPE))
    }

    /// Returns the arguments, in the order of the lambda list's variables.
    pub fn arguments(&self) -> &[Data] {
        &self.arguments
    }
}
