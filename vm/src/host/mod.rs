//! The outside of the virtual machine, as a trait: clocks, standard streams, files, arguments, messages from other
//! threads.
//!
//! Guarantees: nothing else in this crate names clocks, files, threads, the environment or randomness (a test says so),
//! so a run depends on the program, the seed and the answers of its host, and on nothing else. Every function here
//! answers with plain data, so a host can be recorded ([`RecordingHost`]) and replayed ([`ReplayHost`]).
//! Not here: who asks when. The scheduler reads the clock once per round and drains the inbox between slices.
//!
//! A host gives what it wants to give. File access is a grant: [`VirtualHost`] has only the files that it was given.

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

/// What became of an attempt to read standard input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Input {
    /// So many bytes came in, at least one.
    Data(Vec<u8>),
    /// Nothing is there yet; [`Host::wait`] wakes when something is.
    WouldBlock,
    /// There is no more.
    End,
    /// Reading failed.
    Failed(HostError),
}

/// How a file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteMode {
    /// What the file held is replaced; it is made if there is none.
    Replace,
    /// The bytes go to its end; it is made if there is none.
    Append,
    /// The file is made; it is an error if there is one.
    Create,
}

/// Why the host did not do what it was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostError {
    /// Nobody reads what is written: the other end of a pipe is gone.
    BrokenPipe,
    /// There is no such file.
    NotFound,
    /// The host, or the system, does not allow it.
    Refused,
    /// There is such a file already.
    Exists,
    /// Something else, in words.
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

/// A message from another thread: the name of what it is for, and what it says.
#[derive(Clone, Debug)]
pub struct Message {
    /// What it is for; the program chooses by this.
    pub channel: String,
    /// What it says. No datum in it may be an object.
    pub arguments: Vec<Datum>,
}

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    /// The time has come.
    Time,
    /// A message or input has come.
    Arrival,
    /// Nothing can ever come: no deadline, no input, and no sender of messages is left.
    Never,
}

/// Everything that the virtual machine learns from outside.
pub trait Host {
    /// Nanoseconds of a clock that never goes back, from some start.
    fn monotonic(&mut self) -> u64;

    /// Nanoseconds since 1970-01-01 00:00 UTC.
    fn wall_clock(&mut self) -> i64;

    /// Does nothing until the monotonic clock shows `deadline` nanoseconds, a message arrives or, if `for_input`,
    /// standard input has something to say. May wake too early.
    fn wait(&mut self, deadline: Option<u64>, for_input: bool) -> Wake;

    /// Nanoseconds of real time, for figures and pictures of a run: nothing that the run does depends on it. 0 where there is no
    /// real time.
    fn stopwatch(&mut self) -> u64 {
        0
    }

    /// Whether time stands still unless somebody waits, so that a long computation must be told to pass some.
    fn is_virtual(&self) -> bool {
        false
    }

    /// Lets `nanoseconds` pass at once. Only for hosts whose time is virtual.
    fn advance(&mut self, nanoseconds: u64) {
        let _ = nanoseconds;
    }

    /// A seed for the choices of a run, for when none was given.
    fn seed(&mut self) -> u64;

    /// The arguments of the program.
    fn arguments(&mut self) -> Vec<String>;

    /// Writes bytes to a standard stream, all of them.
    ///
    /// # Errors
    /// [`HostError::BrokenPipe`] if nobody reads them, another if they could not be written.
    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError>;

    /// Reads what standard input has, without waiting.
    fn read_input(&mut self) -> Input;

    /// Whether standard output is a terminal, or something else that a person watches.
    fn is_interactive(&mut self) -> bool {
        false
    }

    /// The whole contents of a file.
    ///
    /// # Errors
    /// [`HostError`], and [`HostError::Refused`] if the embedder does not grant it.
    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError>;

    /// Writes `bytes` to a file.
    ///
    /// # Errors
    /// [`HostError`], and [`HostError::Refused`] if the embedder does not grant it.
    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError>;

    /// Whether there is a file of this name that the program may know of.
    fn file_exists(&mut self, path: &str) -> bool;

    /// Removes a file.
    ///
    /// # Errors
    /// [`HostError`], and [`HostError::Refused`] if the embedder does not grant it.
    fn delete_file(&mut self, path: &str) -> Result<(), HostError>;

    /// The messages that have arrived, in order.
    fn receive(&mut self) -> Vec<Message>;

    /// The status with which a program ends whose standard output nobody reads any more. It did nothing wrong.
    fn broken_output_status(&self) -> u8 {
        0
    }

    /// Whether somebody may still send messages. While this is so, a run in which everything waits is not deadlocked
    /// if something waits for a message.
    fn has_senders(&self) -> bool;
}
