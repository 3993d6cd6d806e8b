//! Recording a run in a file, and running it again from there.
//!
//! A recording holds the program, and everything that has reached its run from outside: the answers of the
//! host, and what came into the inbox, each at its place. So a replay needs neither sources nor a world,
//! waits for nothing, and takes the same course to the tick; where it does not, it says so.
//!
//! ```
//! use esl::host::{RealHost, VirtualHost};
//! use esl::program::{Ended, Source, compile};
//! use esl_replay::{Replayed, RunSetup, record, replay};
//!
//! let text = "(dotimes (i 3) (sleep 0.01) (format t \"~a \" (random 1000)))";
//! let program = compile(&[Source::new("dice.esl", text)]).program.expect("it compiles");
//! let file = std::env::temp_dir().join(format!("esl-replay-{}.eslj", std::process::id()));
//!
//! let host = RealHost::new(Vec::new()).with_screen(Box::new(|_| Ok(())));
//! let summary = record(&program, &RunSetup::default(), host, &file, |_machine| ())?;
//! assert_eq!(summary.ended, Ended::Normally(0));
//!
//! let again = replay(&file)?;
//! assert_eq!(again.replayed, Replayed::Equal(0));
//! assert_eq!(again.output.split(' ').count(), 4);
//! # std::fs::remove_file(file)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod breakpoint;
mod debugger;
mod file;
mod generation;
mod journal;
mod kept;
mod pack;
mod pattern;
mod recorder;
mod records;
mod rerun;
mod snapshot;
#[cfg(test)]
mod tests;

use std::fmt;
use std::io;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use esl_bytecode::file::WriteError;
use esl_host::{Host, Output, RecordingHost};
use esl_vm::vm::{Config, Vm};

use esl::Error;
use esl::program::Schedule;
use esl::program::{self, ExecutionIdentity, Program, Summary};

pub use breakpoint::{Breakpoint, StopError, Target};
pub use debugger::Debugger;
pub use file::{Beginning, FORMAT, GivenFunction, MAGIC, Recorded, RecordedEnd, RecordedError, RunStart};
pub use generation::{JournalGeneration, OpenCall, StoredArgument, StoredCall};
pub use journal::{
    JournalLife, JournalUpgrade, JournalWriter, RunJournal, journal_beginning, journal_end, journal_life,
    journal_saved,
};
pub use kept::set_kept;
pub use pattern::{FactPattern, NotAPattern};
pub use recorder::FileRecorder;
pub use rerun::{Replayed, Rerun, RerunError, begin_recorded, prepare_recorded};
pub use snapshot::{RunSnapshot, add_to_sum, seal_snapshot, snapshot_file, snapshot_head};

/// The setup of a run, beside its program and its host.
#[derive(Clone, Debug, Default)]
pub struct RunSetup {
    /// Limits and settings.
    pub config: Config,
    /// The traces, as [`program::set_traces`] takes them.
    pub traces: Vec<String>,
    /// The folders in which `require` looks for modules.
    pub folders: Vec<String>,
    /// The names of the file of the program, as [`ModulePath::program_file`] returns them.
    ///
    /// [`ModulePath::program_file`]: esl::module_path::ModulePath::program_file
    pub program_file: Vec<String>,
    /// The schedule by which the tasks of the program take turns, if it has one. It is for the caller to run
    /// the program by it.
    pub schedule: Option<Schedule>,
}

/// Why a run could not be recorded, or not be replayed.
#[derive(Debug)]
#[non_exhaustive]
pub enum ReplayError {
    /// The file cannot be written or read.
    File(io::Error),
    /// The program contains an object that no file can hold.
    Program(WriteError),
    /// The machine cannot be made, or the program not begun.
    Machine(Error),
    /// The bytes of the file are not a recorded run.
    Recording(RecordedError),
    /// It cannot be run again.
    Rerun(RerunError),
}

impl fmt::Display for ReplayError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReplayError::File(error) => error.fmt(f),
            ReplayError::Program(error) => error.fmt(f),
            ReplayError::Machine(error) => error.fmt(f),
            ReplayError::Recording(error) => error.fmt(f),
            ReplayError::Rerun(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for ReplayError {}

/// Runs a program under `host`, and writes a recording of the run to `file`. `prepare` gives the machine the
/// embedder's functions.
///
/// # Errors
/// [`ReplayError`]; a program that fails is recorded.
pub fn record(
    program: &Program,
    setup: &RunSetup,
    host: impl Host + Send + 'static,
    file: &Path,
    prepare: impl FnOnce(&mut Vm),
) -> Result<Summary, ReplayError> {
    let recorder = FileRecorder::create(file).map_err(ReplayError::File)?;
    let host = RecordingHost::with_recorder(host, recorder.clone());
    let mut machine = program::machine(setup.config.clone(), Box::new(host)).map_err(ReplayError::Machine)?;
    prepare(&mut machine);
    recorder.begin(&beginning(program, setup, &machine).map_err(ReplayError::Program)?);
    program::set_module_folders(&mut machine, &setup.folders).map_err(ReplayError::Machine)?;
    program::set_program_file(&mut machine, &setup.program_file).map_err(ReplayError::Machine)?;
    program::set_traces(&mut machine, &setup.traces).map_err(ReplayError::Machine)?;
    let summary = program::run_in(&mut machine, program).map_err(ReplayError::Machine)?;
    recorder.end(&machine, summary.ended.exit_status()).map_err(ReplayError::File)?;
    Ok(summary)
}

/// Returns what the run of a program begins with, in a machine that has the embedder's functions already, and
/// the part of the library for operators if its run is served to them.
///
/// # Errors
/// [`WriteError`], if the program contains an object that no file can hold.
pub fn beginning(program: &Program, setup: &RunSetup, machine: &Vm) -> Result<Beginning, WriteError> {
    Ok(Beginning {
        program: program.to_bytes()?,
        config: setup.config.clone(),
        traces: setup.traces.clone(),
        folders: setup.folders.clone(),
        program_file: setup.program_file.clone(),
        schedule: setup.schedule.as_ref().map(Schedule::to_string),
        functions: functions_of(machine),
        has_operators: program::has_operators(machine),
        kept: None,
        identity: ExecutionIdentity::current().to_string(),
    })
}

/// Returns what a run begins with that has the program and the settings of another one, in this machine.
pub fn beginning_of(run: &Beginning, machine: &Vm) -> Beginning {
    Beginning {
        functions: functions_of(machine),
        has_operators: program::has_operators(machine),
        identity: ExecutionIdentity::current().to_string(),
        ..run.clone()
    }
}

/// Returns the functions of the embedder's in a machine.
fn functions_of(machine: &Vm) -> Vec<GivenFunction> {
    let functions = machine.host_functions().map(|(name, is_operation, needs)| GivenFunction {
        name: name.into(),
        is_operation,
        needs: needs.to_vec(),
    });
    functions.collect()
}

/// Reads a recorded run, or a journal of a durable run with the snapshot at which it begins.
///
/// # Errors
/// [`ReplayError::File`] or [`ReplayError::Recording`].
pub fn read_recorded(file: &Path) -> Result<Recorded, ReplayError> {
    let bytes = std::fs::read(file).map_err(ReplayError::File)?;
    let mut recorded = Recorded::read(&bytes).map_err(ReplayError::Recording)?;
    if let Some(start) = &recorded.start {
        let snapshot = snapshot_file(file).ok_or(RecordedError::NoSnapshot);
        let snapshot = snapshot.and_then(|file| std::fs::read(file).map_err(|_| RecordedError::NoSnapshot));
        let snapshot = snapshot.and_then(RunSnapshot::read).map_err(ReplayError::Recording)?;
        let generation = start.generation.clone();
        recorded.start = Some(Arc::new(RunStart { generation, snapshot: Some(snapshot) }));
    }
    Ok(recorded)
}

/// A replay that is over, and what the program has written in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Replay {
    /// How it has ended.
    pub replayed: Replayed,
    /// The text on standard output.
    pub output: String,
    /// The text on standard error.
    pub errors: String,
    /// Ticks of all tasks.
    pub ticks: u64,
}

/// Runs the recorded run in `file` again, to its end.
///
/// # Errors
/// [`ReplayError`]; a replay that diverges returns [`Replayed::Diverged`].
pub fn replay(file: &Path) -> Result<Replay, ReplayError> {
    let recorded = read_recorded(file)?;
    let written = Arc::new(Mutex::new((Vec::new(), Vec::new())));
    let kept = written.clone();
    let screen = move |output, bytes: &[u8]| {
        let mut written = kept.lock().unwrap_or_else(PoisonError::into_inner);
        match output {
            Output::Standard => written.0.extend_from_slice(bytes),
            Output::Error => written.1.extend_from_slice(bytes),
        }
    };
    let mut rerun = Rerun::begin(&recorded, screen).map_err(ReplayError::Rerun)?;
    let replayed = rerun.run(u64::MAX).cloned().unwrap_or(Replayed::Cut);
    let written = written.lock().unwrap_or_else(PoisonError::into_inner);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (output, errors) = (text(&written.0), text(&written.1));
    Ok(Replay { replayed, output, errors, ticks: rerun.check().ticks })
}
