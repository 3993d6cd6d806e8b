//! Statuses that functions return.

use std::ffi::{CStr, c_char};

use esl::Error;
use esl::host::SendError;

/// The outcome of a call. All but `ESL_OK` and `ESL_PENDING` come with a failure, if the caller asks for one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum esl_status {
    /// The call has done what it says.
    ESL_OK = 0,
    /// The answer has not come yet.
    ESL_PENDING = 1,
    /// A failure of the program has left the evaluation; it has a cause, arguments and frames.
    ESL_FAILED = 2,
    /// A text cannot be read or compiled. The message has its errors.
    ESL_DOES_NOT_COMPILE = 3,
    /// The evaluation was aborted.
    ESL_ABORTED = 4,
    /// The evaluation waits for an event that no task can signal.
    ESL_DEADLOCKED = 5,
    /// The budget or the ticks of an evaluation are spent.
    ESL_BUDGET_SPENT = 6,
    /// The run was stopped by `esl_handle_stop`.
    ESL_STOPPED = 7,
    /// The limit of memory leaves no room.
    ESL_NO_MEMORY = 8,
    /// A value is not of the type that was asked for, or cannot leave the program.
    ESL_NOT_OF_TYPE = 9,
    /// A file cannot be read, or a compiled one is damaged.
    ESL_UNREADABLE = 10,
    /// An argument is null, is not UTF-8, was freed before, or names nothing.
    ESL_INVALID_ARGUMENT = 11,
    /// The engine is in a call, of another thread or of the caller's own.
    ESL_BUSY = 12,
    /// An input is full, and its rule is that senders wait.
    ESL_FULL = 13,
    /// The engine is gone, or replays a run without this question.
    ESL_ENDED = 14,
    /// The program has asked to end; the argument of the failure is the status.
    ESL_PROGRAM_EXITED = 16,
    /// The engine replays a recording, and does something else than the recorded engine did. The message says
    /// what.
    ESL_DIVERGED = 17,
    /// The folder of a durable run is in use, damaged, cannot be written, or has the run of another program.
    /// The message says what to do.
    ESL_NOT_DURABLE = 18,
    /// A fault of ESL itself. The message has what to report.
    ESL_PANIC = 15,
}

use esl_status::*;

impl esl_status {
    /// Returns the status of an error of an engine.
    pub(crate) fn of_error(error: &Error) -> esl_status {
        match error {
            Error::DoesNotCompile(_) => ESL_DOES_NOT_COMPILE,
            Error::Failed { .. } => ESL_FAILED,
            Error::Aborted => ESL_ABORTED,
            Error::Deadlocked => ESL_DEADLOCKED,
            Error::BudgetSpent | Error::TicksUsed(_) => ESL_BUDGET_SPENT,
            Error::Stopped => ESL_STOPPED,
            Error::NoMemory(_) => ESL_NO_MEMORY,
            Error::NotOfType { .. } | Error::NotData(_) | Error::NestedTooDeeply => ESL_NOT_OF_TYPE,
            Error::Refused(_) | Error::Unreadable { .. } => ESL_UNREADABLE,
            Error::Ended => ESL_ENDED,
            Error::Exited(_) => ESL_PROGRAM_EXITED,
            _ => ESL_INVALID_ARGUMENT,
        }
    }

    /// Returns the status of a signal that was not delivered.
    pub(crate) fn of_send(error: &SendError) -> esl_status {
        match error {
            SendError::NoSuchInput(_) => ESL_INVALID_ARGUMENT,
            SendError::Full(_) => ESL_FULL,
            SendError::Ended => ESL_ENDED,
        }
    }

    /// Returns the cause of a failure that does not come from a program.
    pub(crate) fn cause(self) -> &'static CStr {
        match self {
            ESL_OK => c":OK",
            ESL_PENDING => c":PENDING",
            ESL_FAILED => c":FAILED",
            ESL_DOES_NOT_COMPILE => c":COMPILATION-FAILED",
            ESL_ABORTED => c":ABORTED",
            ESL_DEADLOCKED => c":DEADLOCKED",
            ESL_BUDGET_SPENT => c":BUDGET-SPENT",
            ESL_STOPPED => c":STOPPED",
            ESL_NO_MEMORY => c":NO-MEMORY",
            ESL_NOT_OF_TYPE => c":NOT-OF-TYPE",
            ESL_UNREADABLE => c":UNREADABLE",
            ESL_INVALID_ARGUMENT => c":INVALID-ARGUMENT",
            ESL_BUSY => c":BUSY",
            ESL_FULL => c":FULL",
            ESL_ENDED => c":ENDED",
            ESL_PROGRAM_EXITED => c":EXITED",
            ESL_DIVERGED => c":DIVERGED",
            ESL_NOT_DURABLE => c":NOT-DURABLE",
            ESL_PANIC => c":PANIC",
        }
    }
}

/// Returns the version of ESL, such as "0.1.0": a text that is never freed. From any thread.
#[unsafe(no_mangle)]
pub extern "C" fn esl_version() -> *const c_char {
    const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    VERSION.as_ptr().cast()
}
