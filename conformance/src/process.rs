//! A command run as a process, with a text at its standard input, for tests of `eslc` and `eslvm`.
//!
//! Guarantees: a command that does not end is killed, and the test panics. Both outputs are read while the
//! command runs, so that it never waits for a full pipe.

use std::fmt;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Longest time that a command may take: far more than any test needs, on a machine that is busy with others.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A command that has ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finished {
    /// Exit status; `None` if a signal ended the command.
    pub status: Option<i32>,
    /// Text written to standard output.
    pub output: String,
    /// Text written to standard error.
    pub errors: String,
}

/// Text that a command wrote to standard error although it ought to be quiet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotQuiet(pub String);

impl fmt::Display for NotQuiet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "expected nothing on standard error, found:\n{}", self.0)
    }
}

impl std::error::Error for NotQuiet {}

impl Finished {
    /// Returns the standard output.
    ///
    /// # Errors
    /// The standard error, if anything was written to it.
    pub fn quiet_output(self) -> Result<String, NotQuiet> {
        if self.errors.is_empty() { Ok(self.output) } else { Err(NotQuiet(self.errors)) }
    }
}

/// Returns the path of another command that is built beside the one at `path`. Tests of a package know the
/// path of its own commands only.
///
/// # Panics
/// If the command is not there: tests of one package do not build those of another.
pub fn beside(path: &str, name: &str) -> String {
    let beside = Path::new(path).with_file_name(name).with_extension(std::env::consts::EXE_EXTENSION);
    let beside = beside.display().to_string();
    assert!(Path::new(&beside).exists(), "{beside} is not there: type `cargo build --bin {name}` first");
    beside
}

/// Returns the command at a path with these arguments, without the folders of modules that the environment
/// names.
pub fn command(path: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(path);
    command.args(arguments).env_remove("ESL_LIBRARY");
    command
}

/// Starts a command whose three standard streams are pipes.
///
/// # Panics
/// If the command cannot be started.
pub fn start(command: &mut Command) -> Child {
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap_or_else(|error| panic!("{command:?} cannot be started: {error}"))
}

/// Waits until a command has ended, and reads its outputs as far as they are pipes.
///
/// # Panics
/// If the command takes longer than [`PATIENCE`], or writes something other than UTF-8.
pub fn finish(child: Child) -> Finished {
    finish_within(child, PATIENCE)
}

/// Waits until a command has ended, which takes some time by itself, and reads its outputs as far as they are
/// pipes.
///
/// # Panics
/// If the command takes longer than `patience`, or writes something other than UTF-8.
pub fn finish_within(mut child: Child, patience: Duration) -> Finished {
    let output = read_to_end(child.stdout.take());
    let errors = read_to_end(child.stderr.take());
    let deadline = Instant::now() + patience;
    let status = loop {
        if let Some(status) = child.try_wait().expect("a child can be waited for") {
            break status.code();
        }
        if Instant::now() > deadline {
            child.kill().expect("a child can be killed");
            panic!("the command does not end");
        }
        thread::sleep(Duration::from_millis(2));
    };
    let text = |reader: JoinHandle<Vec<u8>>| {
        let bytes = reader.join().expect("reading does not fail");
        String::from_utf8(bytes).expect("the commands write UTF-8")
    };
    Finished { status, output: text(output), errors: text(errors) }
}

fn read_to_end(pipe: Option<impl Read + Send + 'static>) -> JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            pipe.read_to_end(&mut bytes).expect("a pipe can be read");
        }
        bytes
    })
}

/// Runs a command to its end with `input` at its standard input.
///
/// # Panics
/// As [`start`] and [`finish`].
pub fn run(command: &mut Command, input: impl AsRef<[u8]>) -> Finished {
    let mut child = start(command);
    let mut pipe = child.stdin.take().expect("standard input is a pipe");
    let input = input.as_ref().to_vec();
    // A command may end without reading all of its input.
    let writer = thread::spawn(move || drop(pipe.write_all(&input)));
    let finished = finish(child);
    writer.join().expect("writing does not fail");
    finished
}
