//! Why a session with a run elsewhere could not be begun, and why a request of one came to nothing.

use std::path::PathBuf;
use std::{fmt, io};

use super::attached::SECRET;

/// Reason why a session could not be begun.
#[derive(Debug)]
pub(super) enum AttachError {
    /// No run can be reached at this address.
    Unreachable(String, io::Error),
    /// The secret is missing.
    NoSecret,
    /// The file with the secret cannot be read.
    SecretFile(PathBuf, io::Error),
    /// No thread can be made to read standard input.
    NoReader(io::Error),
    /// No thread can be made to hear the run.
    NoHearer(io::Error),
    /// The connection cannot be shared, or no thread can be made to interrupt the run.
    Connection(io::Error),
}

impl fmt::Display for AttachError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AttachError::Unreachable(address, error) => {
                write!(f, "cannot reach a run at {address}: {error}")
            }
            AttachError::NoSecret => {
                write!(f, "a port asks for a secret: use --secret-file, or the environment variable {SECRET}")
            }
            AttachError::SecretFile(file, error) => write!(f, "{}: {error}", file.display()),
            AttachError::NoReader(error) => {
                write!(f, "cannot start the thread that reads standard input: {error}")
            }
            AttachError::NoHearer(error) => {
                write!(f, "cannot start the thread that reads from the run: {error}")
            }
            AttachError::Connection(error) => error.fmt(f),
        }
    }
}

/// Reason why a request came to nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum RequestRefusal {
    /// The run says so, in these words.
    ByRun(String),
    /// The run has answered something that is not an answer.
    NotAnAnswer,
    /// The command needs something.
    Needs(String, &'static str),
    /// The line is not a command. Holds what is said about it.
    NoCommand(String),
    /// The file cannot be read, for the reason that the system gives.
    Unreadable(String, String),
    /// There is no patch to be undone.
    NoPatch,
}

impl fmt::Display for RequestRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestRefusal::ByRun(text) | RequestRefusal::NoCommand(text) => f.write_str(text),
            RequestRefusal::NotAnAnswer => f.write_str("it is not an answer"),
            RequestRefusal::Needs(command, needed) => write!(f, "`{command}` needs {needed}"),
            RequestRefusal::Unreadable(file, reason) => write!(f, "{file} cannot be read: {reason}"),
            RequestRefusal::NoPatch => f.write_str("no patch can be undone"),
        }
    }
}
