//! Why something that an operator has asked for was not done.

use std::fmt;

use super::secrets::OperatorRole;

/// Reason why a request of an operator was not carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum OperatorRefusal {
    /// A session has no such request.
    UnknownRequest(String),
    /// The monitor has no such action.
    UnknownAction,
    /// The session may not do so much.
    Role {
        /// Name of the request.
        request: String,
        /// Role that it needs.
        needed: OperatorRole,
        /// Role of the session.
        held: OperatorRole,
    },
    /// The session may only survey the run.
    ObservesOnly,
    /// An argument of the request is missing, or is not what it has to be.
    Argument {
        /// Name of the request.
        request: String,
        /// The missing argument.
        needed: NeededArgument,
    },
    /// The action needs the number of a task.
    NoNumber,
    /// The request wraps only one other.
    Wraps {
        /// Name of the request.
        request: String,
        /// Name of the other.
        only: &'static str,
    },
    /// The text is not data.
    NotData {
        /// The text.
        text: String,
        /// The fault in it.
        reason: &'static str,
    },
    /// The table of tasks has no such row.
    NoRow(usize),
    /// No task has this number.
    NoTask(u64),
    /// There are as many sessions of this role as there may be.
    TooManySessions {
        /// The role.
        role: OperatorRole,
        /// Most sessions of one role.
        most: usize,
    },
    /// Too many requests of the session are under way.
    TooManyRequests,
    /// The machine does not answer.
    Silent,
    /// The run has not done it in time.
    Late,
    /// It was not done.
    NotDone,
    /// The call failed. Holds the text of the failure, as the program says it.
    Failed(String),
    /// The call was aborted.
    Aborted,
    /// The task that was asked has left the debugger.
    Left,
    /// No answer has room for the value.
    ValueTooLarge,
    /// No packet has room for the answer.
    AnswerTooLarge,
    /// The run has ended.
    Ended,
    /// The machine has answered something else.
    OtherAnswer,
}

/// An argument that a request needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NeededArgument {
    /// The number of a task.
    TaskNumber,
    /// A row of the table of tasks.
    TaskRow,
    /// A string at this index.
    Text(usize),
    /// Strings, in pairs.
    Pairs,
}

impl fmt::Display for OperatorRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OperatorRefusal::UnknownRequest(name) => write!(f, "`{name}` is not a request of a session"),
            OperatorRefusal::UnknownAction => f.write_str("unknown action"),
            OperatorRefusal::Role { request, needed, held } => {
                write!(f, "`{request}` needs the role {needed}, and this session has {held}")
            }
            OperatorRefusal::ObservesOnly => f.write_str("this session may only survey the run"),
            OperatorRefusal::Argument { request, needed } => write!(f, "`{request}` needs {needed}"),
            OperatorRefusal::NoNumber => f.write_str("it needs the number of a task"),
            OperatorRefusal::Wraps { request, only } => {
                write!(f, "`{request}` is a request only for `{only}`")
            }
            OperatorRefusal::NotData { text, reason } => write!(f, "`{text}` is not data: {reason}"),
            OperatorRefusal::NoRow(row) => write!(f, "row {row} of the table of tasks does not exist"),
            OperatorRefusal::NoTask(number) => write!(f, "task {number} does not exist"),
            OperatorRefusal::TooManySessions { role, most } => {
                write!(
                    f,
                    "{most} sessions of the role {role} are open, the most that may be: end one of them"
                )
            }
            OperatorRefusal::TooManyRequests => f.write_str("too many requests are under way"),
            OperatorRefusal::Silent => f.write_str("the machine does not answer"),
            OperatorRefusal::Late => f.write_str("the run has not completed the request yet"),
            OperatorRefusal::NotDone => f.write_str("the request was not completed"),
            OperatorRefusal::Failed(text) => f.write_str(text),
            OperatorRefusal::Aborted => f.write_str("aborted"),
            OperatorRefusal::Left => f.write_str("the task has left the debugger"),
            OperatorRefusal::ValueTooLarge => f.write_str("the value is too large"),
            OperatorRefusal::AnswerTooLarge => f.write_str("the answer is too large"),
            OperatorRefusal::Ended => f.write_str("the run has ended"),
            OperatorRefusal::OtherAnswer => f.write_str("the run has given an answer of another kind"),
        }
    }
}

impl fmt::Display for NeededArgument {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NeededArgument::TaskNumber => f.write_str("the number of a task"),
            NeededArgument::TaskRow => f.write_str("the row of a task"),
            NeededArgument::Text(index) => write!(f, "a string as argument {}", index + 1),
            NeededArgument::Pairs => f.write_str("pairs of strings"),
        }
    }
}

impl std::error::Error for OperatorRefusal {}
