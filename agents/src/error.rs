//! Reasons why a host cannot begin, or does not do what it was asked for.

use std::fmt;
use std::io;
use std::path::PathBuf;

use esl_durable::DurableError;
use esl_host::SendError;

/// Reason why a host cannot begin, or does not do what it was asked for.
#[derive(Debug)]
#[non_exhaustive]
pub enum AgentError {
    /// The folder of the agents, or a file in it, cannot be used.
    Folder(PathBuf, io::Error),
    /// No host serves the folder.
    NoHost(PathBuf, io::Error),
    /// The text is not the name of an agent.
    Name(String),
    /// There is no agent of this name.
    NoAgent(String),
    /// There is one already.
    Exists(String),
    /// The run of an agent cannot begin or go on.
    Run(DurableError),
    /// The text is not data: the reason, in words.
    NotData(String),
    /// The message was not taken by the program.
    NotTaken(SendError),
    /// The agent has ended with this status.
    Ended(u8),
    /// The agent was stopped.
    Stopped,
    /// The agent has failed: the reason, in words.
    Failed(String),
    /// The program of the agent cannot be read again: the file, and the reason, in words.
    Program(PathBuf, String),
    /// Nothing says where the program of the agent comes from, which has to begin anew.
    NoOrigin,
    /// Too many messages wait for the agent.
    Full,
    /// The host is about to end, or the agent has ended before it took the message.
    Leaving,
    /// The request is not one: the reason, in words.
    Request(String),
    /// The answer of the host that refuses a request.
    Refused(String),
}

impl fmt::Display for AgentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AgentError::Folder(path, error) => write!(f, "{} cannot be used: {error}", path.display()),
            AgentError::NoHost(path, error) => {
                write!(f, "no host serves {}: {error}; type `eslvm host {}`", path.display(), path.display())
            }
            AgentError::Name(name) => write!(
                f,
                "`{name}` is not the name of an agent: expected at most 200 letters, digits, `-`, `_` and `.`, and \
                 no `.` in front"
            ),
            AgentError::NoAgent(name) => write!(f, "there is no agent `{name}`"),
            AgentError::Exists(name) => write!(f, "there is an agent `{name}` already"),
            AgentError::Run(error) => error.fmt(f),
            AgentError::NotData(reason) => write!(f, "the arguments are not data: {reason}"),
            AgentError::NotTaken(error) => error.fmt(f),
            AgentError::Ended(status) => write!(f, "the agent has ended with status {status}"),
            AgentError::Stopped => f.write_str("the agent was stopped: start it first"),
            AgentError::Failed(reason) => write!(f, "the agent cannot go on: {reason}"),
            AgentError::Program(file, reason) => {
                write!(f, "its program {} cannot be begun anew: {reason}", file.display())
            }
            AgentError::NoOrigin => f.write_str(
                "nothing says where its program comes from, so it cannot begin anew with its facts: go on with the \
                 version that has begun it",
            ),
            AgentError::Full => f.write_str("too many messages wait for the agent: send again later"),
            AgentError::Leaving => {
                f.write_str("the agent has left its process before it took the message: send again")
            }
            AgentError::Request(reason) => write!(f, "invalid request: {reason}"),
            AgentError::Refused(reason) => f.write_str(reason),
        }
    }
}

impl std::error::Error for AgentError {}

impl From<DurableError> for AgentError {
    fn from(error: DurableError) -> AgentError {
        AgentError::Run(error)
    }
}

impl AgentError {
    /// Returns whether a later try may succeed without a change by people.
    pub(crate) fn may_pass(&self) -> bool {
        let AgentError::Run(error) = self else { return false };
        matches!(
            error,
            DurableError::InUse(_)
                | DurableError::Inherited(_)
                | DurableError::NotWritten(_)
                | DurableError::AddressesTaken
                | DurableError::MemoryRefused
                | DurableError::Machine(_)
        )
    }
}
