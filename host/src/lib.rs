//! The outside of the ESL virtual machine: the host as a trait, with a real, a virtual and a recorded host.
//!
//! | module | content |
//! | --- | --- |
//! | `host` | [`Host`]: clocks, streams, files and arguments as a trait |
//! | `real`, `real_files`, `real_output` | [`RealHost`]: the operating system |
//! | `virtual_host` | [`VirtualHost`]: an outside in memory, whose time passes only in waits |
//! | `external_clock` | the time of a simulator, which the outside tells a host |
//! | `record`, `replay` | [`RecordingHost`] and [`ReplayHost`]: the answers of a host, kept and given again |
//! | `inbox`, `signal` | [`Inbox`]: unrequested events, from any thread; the signals of the process |
//! | `function`, `argument`, `value` | [`HostRows`]: functions of the host, each declared once, with typed arguments and values |
//! | `input` | [`HostInput`]: an input that a driver signals, which waits for room |
//! | `sender` | [`Sender`]: signals of inputs, with a limit on the unread ones |
//! | `operation` | [`HostOperation`]: work of the outside for a task, and its end |
//! | `saved` | [`OperationState`]: bytes of an operation that outlive the process of a durable run |
//! | `question` | [`Question`]: calls, evaluations and commands for a run, and their answers |
//! | `survey` | [`Inspection`]: reading the state of a run between two turns, without an effect on it |
//! | `task_tree` | the tree of the tasks in what was seen |
//! | `rights` | [`Rights`]: access that is granted to a program |
//! | `console` | the standard streams, buffered between a program and its host |
//! | `asked` | a host that counts its questions into a canary |
//! | `canary` | hashes of the course of a run |
//! | `shared` | values that a machine shares with copies of its state until they change |
//!
//! Guarantees: a run depends only on its program, its seed and the answers of its host. The crates of the
//! machine name no clocks, files, threads or environment, and no randomness (`vm/tests/host_boundary.rs`).
//!
//! A host decides which files and streams exist. The program's access to them is granted by [`Rights`]: the
//! machine asks for a permit before each request that needs a right, and the host carries out the permitted
//! request. [`VirtualHost`] has only the files that it was given.
//!
//! Not here: the machine, and the functions themselves.

#![forbid(unsafe_code)]

mod argument;
mod asked;
mod canary;
mod console;
mod effect;
mod external_clock;
mod function;
mod host;
mod inbox;
mod input;
mod operation;
mod question;
mod real;
mod real_files;
#[cfg(unix)]
mod real_output;
mod record;
mod replay;
mod rights;
mod saved;
mod sender;
mod shared;
mod signal;
mod survey;
mod task_tree;
mod value;
mod virtual_host;

pub use argument::{ArgumentList, ArgumentReader, CallAction, FromArgument, FromCall, Payload};
pub use effect::{ActionId, CallEffect, GoneObject, HostCall, RepeatedCall, has_gone_object};
pub use external_clock::ClockStep;
pub use function::{
    BeginFuture, Completion, DataFunction, Handler, HostFunction, HostModule, HostRow, HostRows, Need,
    OperationFuture, definitions, unused_functions,
};
pub use host::{
    Awaited, FileAnswer, FileRequest, Host, HostError, HostState, Input, Output, ReplayState, RunCheck,
    VIRTUAL_BEGINNING, Wake, WriteMode,
};
pub use inbox::{Inbox, Incoming};
pub use input::HostInput;
pub use operation::{HostFailure, HostOperation, News};
pub use question::{Answer, FunctionRef, Kept, Pending, Question, TaskInfo};
pub use real::{RealHost, Screen};
pub use real_files::request_of_files;
pub use record::{Intent, NotedRecord, QuestionHash, Record, Recorder, Recording, RecordingHost};
pub use replay::{Divergence, ReplayHost};
pub use rights::{Permit, Right, Rights};
pub use saved::{OperationState, StateKeeper};
pub use sender::{SendError, Sender, SenderInput};
pub use signal::ProcessSignal;
pub use survey::{
    FailureFrame, FailureRow, FrameRow, FrameVariable, InputRow, Inspection, Lateness, LockRow, RelationRow,
    RunFigures, Survey, SurveyRequest, SurveyedTask, TaskStanding,
};
pub use value::{HostHandle, HostObject, IntoDatum, IntoValues, Keyword, Values};
pub use virtual_host::{Captured, VirtualHost};

/// The names that only a machine needs.
pub mod machine {
    pub use crate::asked::Asked;
    pub use crate::canary::Canary;
    pub use crate::console::{Console, Taken, column_after, encode};
    pub use crate::operation::Canceller;
    pub use crate::shared::CopyOnWrite;
    pub use crate::task_tree::task_order;
}

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
