//! Reasons why a durable run cannot begin, or cannot go on.

use std::fmt;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use esl_bytecode::file::WriteError;
use esl_replay::RecordedError;

use super::changes::ProgramChanges;

/// Reason why a durable run cannot begin, or cannot go on.
#[derive(Debug)]
#[non_exhaustive]
pub enum DurableError {
    /// The folder, or a file in it, cannot be made, read or locked.
    Folder(PathBuf, io::Error),
    /// Another process has the folder.
    InUse(PathBuf),
    /// A process that the last process of the run has started has the folder still.
    Inherited(PathBuf),
    /// The folder or a file in it belongs to another user, or other users may write or read it.
    NotPrivate(PathBuf),
    /// There is no durable run in the folder.
    NoRun(PathBuf),
    /// The folder has a durable run already.
    HasRun(PathBuf),
    /// The run cannot be copied as it was so long ago: its folder has only this much of its past.
    TooFarBack(Duration),
    /// The journal was changed, or another machine has written it.
    Journal(RecordedError),
    /// The run has not begun.
    NoBeginning,
    /// Its machine cannot be made, or its program not be begun.
    Machine(esl::Error),
    /// There are no facts from which the run of another version of the machine could begin anew.
    NoFacts,
    /// The facts from which the run is to begin anew cannot be read.
    Facts(Box<esl::Error>),
    /// The program contains an object that no file can hold.
    Program(WriteError),
    /// The folder has the run of another program: the changes.
    OtherProgram(Box<ProgramChanges>),
    /// The run cannot be upgraded to the program: the reason, in words.
    NotUpgraded(String),
    /// It was begun with other settings: their names.
    OtherSettings(&'static str),
    /// It was begun with other limits, another slice or another seed: their names and values, as options of
    /// the command.
    OtherLimits(String),
    /// The run does not take the course of its journal.
    Diverged(String),
    /// The journal cannot be written, so no effect may leave.
    NotWritten(io::Error),
    /// The snapshot of the run does not fit into this process: the reason, in words.
    Snapshot(&'static str),
    /// The addresses of the snapshot are taken in this process, which another time or another process may
    /// have free.
    AddressesTaken,
    /// The system has refused memory, which may have changed the course of the run.
    MemoryRefused,
}

impl fmt::Display for DurableError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DurableError::Folder(path, error) => write!(f, "{} cannot be used: {error}", path.display()),
            DurableError::InUse(path) => {
                write!(f, "{} is in use by another process: a run has one at a time", path.display())
            }
            DurableError::Inherited(path) => write!(
                f,
                "{} is in use by a process that the run's last process has started as a copy of itself, by a fork: \
                 it has to end first",
                path.display()
            ),
            DurableError::NotPrivate(path) => write!(
                f,
                "{} must belong to you, without access for others, since its contents are executed; type \
                 `chown -R $USER {}` and `chmod -R go= {}`",
                path.display(),
                path.display(),
                path.display()
            ),
            DurableError::NoRun(path) => {
                write!(f, "there is no durable run in {}; `eslvm run --state` begins one", path.display())
            }
            DurableError::HasRun(path) => {
                write!(f, "{} has a durable run already; name a folder without one", path.display())
            }
            DurableError::TooFarBack(kept) => write!(
                f,
                "the folder has only the last {:.1} s of the run, from its oldest snapshot on",
                kept.as_secs_f64()
            ),
            DurableError::Journal(RecordedError::OtherMachine) => f.write_str(
                "the run was begun by another version of the machine or its library; go on with that version, \
                 type `--from-facts` to begin anew with its facts, or begin a new run in another folder",
            ),
            DurableError::NoFacts => f.write_str(
                "the run was begun by another version of the machine, and its folder has no facts: it was neither \
                 paused nor stored by a snapshot before; go on with that version, or begin a new run in another folder",
            ),
            DurableError::Facts(error) => write!(f, "the facts of the earlier run cannot be made: {error}"),
            DurableError::Journal(RecordedError::Format(version)) => {
                write!(
                    f,
                    "the journal has version {version} of the format, which this machine cannot read; type \
                     `--from-facts` to begin anew with the facts of the run"
                )
            }
            DurableError::Journal(error) => write!(f, "the journal cannot be read: {error}"),
            DurableError::NoBeginning => f.write_str("the folder has no run that has begun"),
            DurableError::Machine(error) => write!(f, "the machine of the run cannot be made: {error}"),
            DurableError::Program(error) => write!(f, "the program cannot be durable: {error}"),
            DurableError::OtherProgram(changes) => write!(
                f,
                "the folder has the run of another program: {changes}; go on with the earlier program, type \
                 `--upgrade` to make these definitions in the run, or begin a new run in another folder"
            ),
            DurableError::NotUpgraded(reason) => {
                write!(f, "the run cannot be upgraded to this program: {reason}; nothing has changed")
            }
            DurableError::OtherSettings(which) => {
                write!(f, "the run was begun with {which}; repeat the command by which it was begun")
            }
            DurableError::OtherLimits(options) => {
                write!(f, "the run was begun with other limits, slice or seed: give it {options}")
            }
            DurableError::Diverged(text) => {
                write!(f, "the run does not take the course of its journal: {text}")
            }
            DurableError::NotWritten(error) => write!(
                f,
                "the journal cannot be written: {error}; the run stops before its next effect, and the same \
                 command goes on"
            ),
            DurableError::Snapshot(reason) => {
                write!(f, "the snapshot of the run cannot be loaded: {reason}; nothing has changed")
            }
            DurableError::AddressesTaken => f.write_str(
                "the snapshot of the run cannot be loaded: its addresses are taken in this process, which seldom \
                 happens; start it again; nothing has changed",
            ),
            DurableError::MemoryRefused => f.write_str(
                "the system has refused memory, which may change the course of the run; the run stops, and the \
                 same command goes on",
            ),
        }
    }
}

impl std::error::Error for DurableError {}
