//! The host as a trait: clocks, standard streams, files, arguments, and the inbox for unrequested events.
//!
//! All functions here return plain data, so a host can be recorded ([`RecordingHost`](super::RecordingHost))
//! and replayed ([`ReplayHost`](super::ReplayHost)).
//!
//! Not here: when the host is asked. The machine asks whether timers are due, and looks into the inbox,
//! between two turns.

use std::any::Any;
use std::fmt;

use esl_bytecode::datum::Datum;

use super::{ActionId, HostCall, HostFailure, Inbox, Incoming, Permit, RepeatedCall, Right, Rights};

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

/// Something that is done with files beside reading and writing them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileRequest<'a> {
    /// The names of what is in a folder; those of folders end in `/`.
    List(&'a str),
    /// Gives a file another name, in place of what has it.
    Rename(&'a str, &'a str),
    /// The time at which a file was written last.
    Date(&'a str),
    /// Makes a folder, and those around it.
    MakeFolders(&'a str),
    /// The name of a file or folder after all links, from the root on; that of a folder ends in `/`.
    TrueName(&'a str),
}

/// The answer to a [`FileRequest`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileAnswer {
    /// Names, in order.
    Names(Vec<String>),
    /// Seconds since 1970.
    Date(i64),
    /// It is done; whether it changed anything.
    Done(bool),
}

/// Time of day at which virtual time begins: the beginning of the year 2000, in nanoseconds since 1970, UTC.
pub const VIRTUAL_BEGINNING: i64 = 946_684_800_000_000_000;

/// Why the host did not carry out a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HostError {
    /// The other end of a pipe has closed.
    BrokenPipe,
    /// There is no such file.
    NotFound,
    /// The system does not grant access.
    Refused,
    /// The file exists already.
    Exists,
    /// Another error, described by the system.
    Other(String),
}

impl fmt::Display for HostError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            HostError::BrokenPipe => f.write_str("the other end is closed"),
            HostError::NotFound => f.write_str("the file does not exist"),
            HostError::Refused => f.write_str("the system does not grant access"),
            HostError::Exists => f.write_str("the file exists already"),
            HostError::Other(text) => f.write_str(text),
        }
    }
}

impl std::error::Error for HostError {}

impl From<&std::io::Error> for HostError {
    fn from(error: &std::io::Error) -> HostError {
        use std::io::ErrorKind;
        match error.kind() {
            ErrorKind::BrokenPipe => HostError::BrokenPipe,
            ErrorKind::NotFound => HostError::NotFound,
            ErrorKind::PermissionDenied => HostError::Refused,
            ErrorKind::AlreadyExists => HostError::Exists,
            _ => HostError::Other(error.to_string()),
        }
    }
}

/// Whether a host replays a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplayState {
    /// The outside is there.
    Live,
    /// Recorded answers are left.
    Replays,
    /// The replay has diverged, or asked for more than was recorded: nothing comes any more.
    IsOver,
}

/// The events that a host waits for beside a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Awaited {
    /// Whether tasks wait for standard input.
    pub input: bool,
    /// Whether output waits until there is room for it.
    pub output: bool,
    /// Whether something is expected in the inbox, because an operation is under way, or because there is a
    /// sender.
    pub news: bool,
}

/// Why a wait ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wake {
    /// The deadline has passed.
    Time,
    /// Something has come into the inbox, or standard input has data.
    Arrival,
    /// A survey is requested, and nothing else has arrived: the machine answers, and waits on.
    Inspection,
    /// Nothing can ever arrive: there is no deadline, no input, and no sender.
    Never,
}

/// State of a host, as it sees fit.
pub struct HostState(pub Box<dyn Any + Send>);

/// How far a run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RunCheck {
    /// Round of the machine.
    pub round: u64,
    /// Ticks of all tasks.
    pub ticks: u64,
    /// Canary of the run.
    pub canary: u64,
}

/// The source of everything that the virtual machine learns from outside.
pub trait Host {
    /// Returns the nanoseconds of a clock that never goes back, since some start.
    fn monotonic(&mut self) -> u64;

    /// Returns the nanoseconds since 1970-01-01 00:00 UTC.
    fn wall_clock(&mut self) -> i64;

    /// Returns the nanoseconds for which processors have worked for this process: the monotonic clock's where
    /// the host cannot tell.
    fn processor_time(&mut self) -> u64 {
        self.monotonic()
    }

    /// Returns the time of the monotonic clock in nanoseconds, if it is `deadline` or later.
    fn due(&mut self, deadline: u64) -> Option<u64> {
        Some(self.monotonic()).filter(|&now| now >= deadline)
    }

    /// Waits until the monotonic clock shows `deadline` nanoseconds, something comes into the inbox or, if
    /// `awaited` says so, standard input has data or ends. May wake too early.
    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake;

    /// Returns the state of a host whose whole outside is in memory, for [`Host::restore`]. `None` for
    /// others: what has happened outside cannot be taken back.
    fn save(&self) -> Option<HostState> {
        None
    }

    /// Returns to a state of this host, the inbox excepted. Returns whether it did.
    fn restore(&mut self, state: &HostState) -> bool {
        _ = state;
        false
    }

    /// Returns nanoseconds of real time, for figures and timelines of a run, on which nothing in the run
    /// depends. 0 if there is no real time.
    fn stopwatch(&mut self) -> u64 {
        0
    }

    /// Returns whether time passes only during waits, so that a long computation has to let some pass
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
    /// [`HostError::BrokenPipe`] if the reader has closed the stream, another error if they could not be
    /// written.
    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError>;

    /// Writes as many of the bytes to a standard stream as there is room for, without waiting, and returns
    /// their number. If that is not all, [`Incoming::Output`] comes into the inbox when there is room.
    ///
    /// # Errors
    /// As [`Host::write`].
    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        self.write(output, bytes).map(|()| bytes.len())
    }

    /// Reads the available part of standard input, without waiting.
    fn read_input(&mut self) -> Input;

    /// Returns whether standard output is a terminal, or something else that a person watches.
    fn is_interactive(&mut self) -> bool {
        false
    }

    /// Returns whether the program has a right to an object, where `narrowed` are in force beside the rights
    /// of the run.
    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit;

    /// Returns the whole contents of a file.
    ///
    /// # Errors
    /// [`HostError`].
    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError>;

    /// Writes `bytes` to a file.
    ///
    /// # Errors
    /// [`HostError`].
    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError>;

    /// Returns whether there is a file of this name.
    fn file_exists(&mut self, path: &str) -> bool;

    /// Removes a file.
    ///
    /// # Errors
    /// [`HostError`].
    fn delete_file(&mut self, path: &str) -> Result<(), HostError>;

    /// Does something with files.
    ///
    /// # Errors
    /// [`HostError`].
    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError>;

    /// Has a function of the embedder's called, and returns its result.
    ///
    /// # Errors
    /// The failure of the function.
    fn call(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        function(call.arguments)
    }

    /// Has an operation begun by a function of the embedder's, which is given the identity of the call if the
    /// host keeps account of those. The inbox hears of the operation.
    fn begin(&mut self, call: HostCall<'_>, function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        function(call.arguments, None);
    }

    /// Returns the inbox of the machine that this is the host of.
    fn inbox(&self) -> Inbox;

    /// Takes everything out of the inbox, in the round of the machine with this number. Called while the
    /// inbox is rung.
    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        let _ = round;
        self.inbox().take()
    }

    /// Returns a call of an earlier process that is to be made again now, after each [`Host::poll`] until
    /// none is left. The answer goes to [`Host::answer_repeated`]; that of an operation comes by the inbox.
    fn next_repeated(&mut self) -> Option<RepeatedCall> {
        None
    }

    /// Returns whether this process has a right that a call which is made again needs.
    fn permits_repeated(&mut self, right: Right, object: &str) -> bool {
        let _ = (right, object);
        true
    }

    /// Takes the answer of the call that was made again last.
    fn answer_repeated(&mut self, answer: Result<Datum, HostFailure>) {
        let _ = answer;
    }

    /// Returns whether this is a replay, which waits for nothing: all that can come comes by itself, in one
    /// of the rounds to come.
    fn replay_state(&self) -> ReplayState {
        ReplayState::Live
    }

    /// Returns the exit status of a program whose standard output was closed by its reader: that of a program
    /// that SIGPIPE has ended.
    fn broken_output_status(&self) -> u8 {
        128 + 13
    }

    /// Is told that the system has refused memory, which may change the course of the run: when a task next
    /// lacks room, and each time again.
    fn hear_of_refusal(&mut self) {}

    /// Is told how far the run is, now and then: always in the same rounds.
    fn check(&mut self, check: RunCheck) {
        let _ = check;
    }
}

esl_heap::stored_enum! { HostError { BrokenPipe = 0, NotFound = 1, Refused = 2, Exists = 3, Other(text) = 4 } }
