//! Faults of definitions, of messages that a program gives, and of payloads that others send.

use std::error::Error;
use std::fmt;

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::HostFailure;

/// A type that cannot be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TypeFault {
    /// A name that is not of the form `package/msg/Name`.
    Name {
        /// The name.
        name: String,
        /// The kind of definition that was asked for.
        kind: &'static str,
    },
    /// No definition has this name.
    Unknown {
        /// The name.
        name: String,
        /// A known name that is similar.
        nearest: Option<String>,
        /// The type and the line whose field has this type.
        used_by: Option<(String, usize)>,
    },
    /// A definition whose text is wrong.
    Definition {
        /// Name of the type.
        name: String,
        /// Line in its text, from 1.
        line: usize,
        /// The fault.
        problem: DefinitionProblem,
    },
    /// A file of a definition that cannot be read.
    File {
        /// Path of the file.
        path: String,
        /// Reason of the operating system.
        reason: String,
    },
}

/// A fault in the text of a definition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DefinitionProblem {
    /// A line that is neither a field nor a constant.
    Line(String),
    /// A type that is malformed.
    Type(String),
    /// A name of a field or a constant that is malformed.
    FieldName(String),
    /// Two fields, or two constants, whose names are equal to a program.
    Twice(String),
    /// A value that the type does not have.
    Value {
        /// The text of the value.
        text: String,
        /// The type.
        expected: String,
    },
    /// A value of a type that cannot have one.
    NoValue(String),
    /// A type that contains itself.
    Circular(String),
    /// Types that are nested too deeply.
    Deep(usize),
    /// Fixed arrays that have too many elements.
    Large(usize),
    /// A number of separators `---` that the kind does not have.
    Parts {
        /// Number of parts of the kind.
        expected: usize,
        /// Number of parts of the text.
        given: usize,
    },
}

impl fmt::Display for TypeFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TypeFault::Name { name, kind } => {
                write!(f, "`{name}` is not the name of a type; expected the form `package/{kind}/Name`")
            }
            TypeFault::Unknown { name, nearest, used_by } => {
                write!(f, "unknown type `{name}`")?;
                if let Some((user, line)) = used_by {
                    write!(f, " in line {line} of `{user}`")?;
                }
                match nearest {
                    Some(nearest) => write!(f, "; did you mean `{nearest}`?"),
                    None => f.write_str(
                        "; definitions are searched in the texts and the folders that are given, and among those \
                         that ESL has",
                    ),
                }
            }
            TypeFault::Definition { name, line, problem } => {
                write!(f, "definition of `{name}`, line {line}: {problem}")
            }
            TypeFault::File { path, reason } => write!(f, "cannot read the definition `{path}`: {reason}"),
        }
    }
}

impl fmt::Display for DefinitionProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DefinitionProblem::Line(line) => {
                write!(f, "expected `type name`, `type name default` or `type NAME=value`, got `{line}`")
            }
            DefinitionProblem::Type(text) => write!(f, "`{text}` is not a type"),
            DefinitionProblem::FieldName(name) => {
                write!(f, "`{name}` is not a name; expected a letter, then letters, digits and `_`")
            }
            DefinitionProblem::Twice(name) => write!(f, "`{name}` is defined twice"),
            DefinitionProblem::Value { text, expected } => write!(f, "`{text}` is not a value of {expected}"),
            DefinitionProblem::NoValue(kind) => write!(f, "{kind} cannot have a value here"),
            DefinitionProblem::Circular(name) => write!(f, "`{name}` contains itself"),
            DefinitionProblem::Deep(most) => write!(f, "types are nested in more than {most} levels"),
            DefinitionProblem::Large(most) => write!(f, "fixed arrays have more than {most} elements"),
            DefinitionProblem::Parts { expected, given } => {
                write!(f, "expected {expected} parts, separated by lines `---`, got {given}")
            }
        }
    }
}

impl Error for TypeFault {}

impl From<TypeFault> for HostFailure {
    fn from(fault: TypeFault) -> HostFailure {
        let cause = match fault {
            TypeFault::Name { .. } | TypeFault::Unknown { .. } => "UNKNOWN-TYPE",
            TypeFault::Definition { .. } | TypeFault::File { .. } => "INVALID-DEFINITION",
        };
        HostFailure::new(cause, fault)
    }
}

/// A message that does not match its type, or a payload that is not one of its type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MessageFault(Box<FaultAt>);

#[derive(Clone, Debug, PartialEq, Eq)]
struct FaultAt {
    type_name: String,
    /// The steps to the value, the innermost first.
    path: Vec<FieldStep>,
    problem: MessageProblem,
}

/// A step from a value to a part of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum FieldStep {
    /// The field of this keyword, in upper case.
    Field(String),
    /// The element of this index.
    Index(usize),
}

/// A fault of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MessageProblem {
    /// The value is of another type.
    WrongType {
        /// The expected type, in words.
        expected: String,
        /// The value as text.
        given: String,
    },
    /// A message without a field of this name.
    UnknownField {
        /// The keyword.
        given: String,
        /// The type of the message.
        of: String,
        /// Name of the field that is most similar.
        nearest: Option<String>,
    },
    /// A field that is given twice.
    Twice(String),
    /// The type does not define this constant.
    UnknownConstant {
        /// The keyword.
        given: String,
        /// The type of the message.
        of: String,
        /// Name of the constant that is most similar.
        nearest: Option<String>,
    },
    /// An array or a text of a wrong length.
    Length {
        /// The permitted length, in words.
        expected: String,
        /// The length.
        given: usize,
    },
    /// The payload ends within a value.
    Truncated {
        /// Bytes that the value needs.
        needed: u64,
        /// Bytes that are left.
        left: usize,
    },
    /// Bytes follow the message.
    Trailing(usize),
    /// The first four bytes do not announce plain CDR.
    Encoding(u16),
    /// A byte that is neither 0 nor 1.
    Boolean(u8),
    /// A text that does not end in a zero byte.
    Unterminated,
    /// A text that is not in UTF-8, or in UTF-16.
    NotUnicode,
    /// A message of too many values.
    Parts(usize),
}

/// A value, or the fault of a message.
pub(super) type MessageResult<T> = Result<T, MessageFault>;

/// A value, or the fault of a type.
pub(super) type TypeResult<T> = Result<T, TypeFault>;

impl MessageFault {
    pub(super) fn new(problem: MessageProblem) -> MessageFault {
        MessageFault(Box::new(FaultAt { type_name: String::new(), path: Vec::new(), problem }))
    }

    /// Returns the fault as one of the value that this step leads from.
    pub(super) fn inside(mut self, step: FieldStep) -> MessageFault {
        self.0.path.push(step);
        self
    }

    /// Returns the fault as one of a message of this type.
    pub(super) fn of(mut self, type_name: &str) -> MessageFault {
        self.0.type_name = type_name.to_owned();
        self
    }

    /// Returns the fault itself.
    pub fn problem(&self) -> &MessageProblem {
        &self.0.problem
    }

    /// Returns the place of the value in the message, as `:poses 3 :position`; empty for the message itself.
    pub fn path(&self) -> String {
        let step = |step: &FieldStep| match step {
            FieldStep::Field(name) => format!(":{}", name.to_ascii_lowercase()),
            FieldStep::Index(index) => index.to_string(),
        };
        self.0.path.iter().rev().map(step).collect::<Vec<_>>().join(" ")
    }
}

impl fmt::Display for MessageFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = self.path();
        if !path.is_empty() {
            write!(f, "`{path}` of ")?;
        }
        write!(f, "{}: {}", self.0.type_name, self.0.problem)
    }
}

/// Writes a guess of what was meant.
fn guess(f: &mut fmt::Formatter<'_>, nearest: Option<&String>) -> fmt::Result {
    nearest.map_or(Ok(()), |nearest| write!(f, "; did you mean `{nearest}`?"))
}

impl fmt::Display for MessageProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            MessageProblem::WrongType { expected, given } => write!(f, "expected {expected}, got {given}"),
            MessageProblem::UnknownField { given, of, nearest } => {
                write!(f, "`{of}` does not have a field `{given}`")?;
                guess(f, nearest.as_ref())
            }
            MessageProblem::Twice(field) => write!(f, "the field `{field}` is given twice"),
            MessageProblem::UnknownConstant { given, of, nearest } => {
                write!(f, "`{of}` does not define a constant `{given}` for this field")?;
                guess(f, nearest.as_ref())
            }
            MessageProblem::Length { expected, given } => write!(f, "expected {expected}, got {given}"),
            MessageProblem::Truncated { needed, left } => {
                write!(f, "the payload is too short: needs {needed} more bytes, has {left}")
            }
            MessageProblem::Trailing(count) => write!(f, "{count} bytes follow the message"),
            MessageProblem::Encoding(id) => write!(f, "expected the encoding CDR (0 or 1), got {id:#06x}"),
            MessageProblem::Boolean(byte) => write!(f, "expected a boolean, 0 or 1, got {byte}"),
            MessageProblem::Unterminated => f.write_str("the text does not end in a zero byte"),
            MessageProblem::NotUnicode => f.write_str("the text is not valid Unicode"),
            MessageProblem::Parts(most) => write!(f, "the message has more than {most} values"),
        }
    }
}

impl Error for MessageFault {}

impl From<MessageFault> for HostFailure {
    /// The arguments are the text and the path.
    fn from(fault: MessageFault) -> HostFailure {
        let cause = match fault.0.problem {
            MessageProblem::WrongType { .. }
            | MessageProblem::UnknownField { .. }
            | MessageProblem::Twice(_)
            | MessageProblem::UnknownConstant { .. }
            | MessageProblem::Length { .. } => "INVALID-MESSAGE",
            _ => "MALFORMED-PAYLOAD",
        };
        let mut failure = HostFailure::new(cause, &fault);
        failure.arguments.push(Datum::string(&fault.path(), Span::default()));
        failure
    }
}
