//! Faults of the values that a program gives for fields and parameters.

use std::error::Error;
use std::fmt;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::HostFailure;

/// A fault of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum ValueFault {
    /// It is of another type, or out of range.
    Unexpected { expected: String, given: String },
    /// It is a keyword that the enumeration lacks.
    Unknown { given: String, of: String, nearest: Option<String> },
    /// There are too many of them.
    Length { most: usize, unit: &'static str, given: usize },
    /// The message, or the command, has no such field or parameter.
    NoSuchPart { kind: &'static str, nearest: Option<String> },
    /// The field is given twice.
    Twice,
}

impl fmt::Display for ValueFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ValueFault::Unexpected { expected, given } => write!(f, "expected {expected}, got {given}"),
            ValueFault::Unknown { given, of, nearest } => {
                write!(f, "`{given}` is not a value of {of}{}", suggestion(nearest.as_deref()))
            }
            ValueFault::Length { most, unit, given } => {
                write!(f, "expected at most {most} {unit}, got {given}")
            }
            ValueFault::NoSuchPart { kind, nearest } => {
                write!(f, "there is no such {kind}{}", suggestion(nearest.as_deref()))
            }
            ValueFault::Twice => f.write_str("the field is given twice"),
        }
    }
}

impl Error for ValueFault {}

impl ValueFault {
    /// Returns the fault of a value of another type.
    pub(super) fn unexpected(expected: impl Into<String>, given: &Datum) -> ValueFault {
        ValueFault::Unexpected { expected: expected.into(), given: shown(given) }
    }

    /// Returns the failure about the part at a path of a message or a command.
    pub(super) fn at(&self, path: &str, of: &str) -> HostFailure {
        let place = if path.is_empty() { String::new() } else { format!("`{path}` of ") };
        let mut failure = HostFailure::new("INVALID-FIELD", format!("{place}{of}: {self}"));
        failure.arguments.push(Datum::string(path, Span::default()));
        failure
    }
}

/// Returns a datum as a text for messages.
pub(super) fn shown(datum: &Datum) -> String {
    const SHOWN: usize = 80;
    let text = datum.to_string();
    if text.chars().count() > SHOWN { text.chars().take(SHOWN).collect::<String>() + "…" } else { text }
}

/// Returns the end of a text about a name that is not known.
pub(super) fn suggestion(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |nearest| format!("; did you mean `{nearest}`?"))
}
