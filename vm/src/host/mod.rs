//! The outside of the virtual machine, as a trait: clocks, standard streams, files, arguments, messages from
//! other threads.
//!
//! Guarantees: nothing else in this crate names clocks, files, threads, the environment or randomness (a test
//! checks this), so a run depends only on the program, the seed and the answers of its host. All functions
//! here return plain data, so a host can be recorded ([`RecordingHost`]) and replayed ([`ReplayHost`]).
//!
//! Not here: when the host is asked. The scheduler reads the clock once per round and drains the inbox
//! between slices.
//!
//! A host decides what it makes available. File access is a grant: [`VirtualHost`] has only the files that it
//! was given.

use std::fmt;

use esl_bytecode::datum::Datum;

mod console;
mod real;
mod record;
mod virtual_host;

pub(crate) use console::{Console, Taken, column_after, encode};
pub use real::{FileAccess, MessageSender, RealHost, Screen, Waker};
pub use record::{Record, Recording, RecordingHost, ReplayHost};
pub use virtual_host::{Captured, VirtualHost};

/// A stream that bytes are written to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// Standard output.
    Standard,
    /// Standard error.
    Error,
}

/// The outcome of an attempt to read standard input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    /// Bytes that were read, at least one.
    Data(Vec<u8>),
    /// Nothing has arrived yet; [`Host::wait`] wakes when something has.
    WouldBlock,
    /// The input has ended.
    End,
    /// Reading failed.
    Failed(HostError),
}

/// How a file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteMode {
    /// Replace the contents; create the file if there is none.
    Replace,
    /// Append to the file; create it if there is none.
    Append,
    /// Create the file; it is an error if it exists.
    Create,
}

/// Why the host did not carry out a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostError {
    /// The other end of a pipe has closed.
    BrokenPipe,
    /// There is no such file.
    NotFound,
    /// The host, or the system, does not grant access.
    Refused,
    /// The file exists already.
    Exists,
    /// Another error, described by the system.
    Other(String),
}

impl fmt::Display for HostError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            HostError::BrokenPipe => f.write_str("nobody reads the other end"),
            HostError::NotFound => f.write_str("there is no such file"),
            HostError::Refused => f.write_str("access is not granted"),
            HostError::Exists => f.write_str("the file exists already"),
            HostError::Other(text) => f.write_str(text),
        }
    }
}

impl std::error::Error for HostError {}

/// A message from another thread.
#[derive(Clone, Debug)]
pub struct Message {
    /// Purpose of the message, by which the program dispatches.
    pub channel: String,
    /// Contents. No datum in them may be an object.
    pub arguments: Vec<Datum>,
}

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    /// The deadline has passed.
    Time,
    /// A message or input has arrived.
    Arrival,
    /// Nothing can ever arrive: there is no deadline, no input, and no sender of messages.
    Never,
}

/// The source of everything that the virtual machine learns from outside.
pub trait Host {
    /// Returns the nanoseconds of a clock that never goes back, since some start.
    fn monotonic(&mut self) -> u64;

    /// Returns the nanoseconds since 1970-01-01 00:00 UTC.
    fn wall_clock(&mut self) -> i64;

    /// Waits until the monotonic clock shows `deadline` nanoseconds, a message arrives or, if `for_input`,
    /// standard input has data or ends. May wake too early.
    fn wait(&mut self, deadline: Option<u64>, for_input: bool) -> Wake;

    /// Returns nanoseconds of real time, for figures and timelines of a run, on which nothing in the run
    /// depends. 0 if there is no real time.
    fn stopwatch(&mut self) -> u64 {
        0
    }

    /// Returns whether time passes only when somebody waits, so that a long computation has to let some pass
    /// explicitly.
    fn is_virtual(&self) -> bool {
        false
    }

    /// Lets `nanoseconds` pass at once. Only for hosts with virtual time.
    fn advance(&mut self, nanoseconds: u64) {
        let _ = nanoseconds;
    }

    /// Returns a seed for the random choices of a run, if none was given.
    fn seed(&mut self) -> u64;

    /// Returns the arguments of the program.
    fn arguments(&mut self) -> Vec<String>;

    /// Writes all of the bytes to a standard stream.
    ///
    /// # Errors
    /// [`HostError::BrokenPipe`] if nobody reads them, another error if they could not be written.
    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError>;

    /// Reads the available part of standard input, without waiting.
    fn read_input(&mut self) -> Input;

    /// Returns whether standard output is a terminal, or something else that a person watches.
    fn is_interactive(&mut self) -> bool {
        false
    }

    /// Returns the whole contents of a file.
    ///
    /// # Errors
    /// [`HostError`], and [`HostError::Refused`] if the embedder does not grant it.
    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError>;

    /// Writes `bytes` to a file.
    ///
    /// # Errors
    /// [`HostError`], and [`HostError::Refused`] if the embedder does not grant it.
    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError>;

    /// Returns whether there is a file of this name that the program may know of.
    fn file_exists(&mut self, path: &str) -> bool;

    /// Removes a file.
    ///
    /// # Errors
    /// [`HostError`], and [`HostError::Refused`] if the embedder does not grant it.
    fn delete_file(&mut self, path: &str) -> Result<(), HostError>;

    /// Returns the messages that have arrived, in order.
    fn receive(&mut self) -> Vec<Message>;

    /// Returns the exit status of a program whose standard output nobody reads any more, which is not the
    /// program's fault.
    fn broken_output_status(&self) -> u8 {
        0
    }

    /// Returns whether more messages may be sent. While this holds, a run in which everything waits is not
    /// deadlocked if something waits for a message.
    fn has_senders(&self) -> bool;
}
