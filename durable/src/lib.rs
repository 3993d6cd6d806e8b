//! Runs of ESL programs that outlive their processes.
//!
//! A durable run has a folder with a journal: a recording (`esl_replay`) that is written before an effect
//! leaves that could depend on it. When the process is killed, the next one takes the same course by the
//! journal, without the outside, and goes on from its end. Programs need no change: tasks, timers, facts and
//! everything else are restored.
//!
//! ```
//! use esl::host::RealHost;
//! use esl::program::{self, Source, compile};
//! use esl_durable::{Durability, Downtime, DurableOptions, DurableRun};
//! use esl_replay::RunSetup;
//!
//! let text = "(define-input ready) (assert '(door open)) (princ 1) (wait-for-event ready) (princ 2)";
//! let program = compile(&[Source::new("wait.esl", text)]).program.expect("it compiles");
//! let folder = std::env::temp_dir().join(format!("esl-durable-{}", std::process::id()));
//! for _process in 0..2 {
//!     let run = DurableRun::open(&folder, DurableOptions::default())?;
//!     let host = RealHost::new(Vec::new()).with_elapsed(run.elapsed()).with_screen(Box::new(|_| Ok(())));
//!     let mut machine = program::machine(Default::default(), Box::new(run.host(host)))?;
//!     run.begin(&program, &RunSetup::default(), &machine)?;
//!     program::begin(&mut machine, &program)?;
//!     machine.run_ready(10_000);
//!     run.pause(&machine)?;
//! }
//! let state = esl_durable::look(&folder)?;
//! assert!(state.ended.is_none() && state.lives.last().is_some_and(|life| life.is_pause));
//! # std::fs::remove_dir_all(folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

/// The examples of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct ReadmeExamples;

mod agent;
mod changes;
mod control;
mod disk;
mod engine;
mod error;
mod facts;
mod figures;
mod file_effect;
mod folder;
mod fork;
mod generations;
mod host;
mod interruption;
mod kill_place;
mod lasting;
mod log;
mod look;
mod rehearsal;
mod rest;
mod resume;
mod settings;
mod snapshots;
mod standing;
mod upgrade;

use std::path::Path;

use esl::program::Program;
use esl_host::Host;
use esl_replay::{
    Beginning, JournalLife, JournalUpgrade, JournalWriter, OpenCall, RecordedError, RunJournal, RunSetup,
};
use esl_vm::heap::range_start;
use esl_vm::task::TaskId;
use esl_vm::vm::{Config, Vm};

pub use agent::DurableJournal;
pub use changes::ProgramChanges;
pub use control::{DurableControl, Resumed};
pub use disk::{Disk, RealDisk, SnapshotWriting};
pub use engine::{DurableEnding, DurableEngine, DurableSettings};
pub use error::DurableError;
pub use facts::KeptFacts;
pub use figures::LogFigures;
pub use folder::RunFolder;
pub use fork::{RunFork, fork};
pub use host::DurableHost;
pub use look::{DurableState, RunPatch, look};
pub use rehearsal::{Rehearsal, rehearse};
pub use rest::RunRest;
pub use snapshots::{SnapshotEvery, SnapshotFigures};
pub use upgrade::UpgradeReport;

use generations::FoundJournals;
use lasting::LastingCalls;
use log::JournalLog;
use resume::{Resumption, chance, wall_clock};
use settings::compare;
use snapshots::SnapshotTaker;
use standing::Standing;
use upgrade::Upgrade;

/// The events that a durable run survives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Durability {
    /// The end of its process: the journal is passed to the system before an effect leaves.
    #[default]
    Process,
    /// Loss of power too: the journal is synced before an effect leaves.
    Power,
}

/// How a gap between two processes counts for the program's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Downtime {
    /// As time that has passed, by the clock of the system.
    #[default]
    Counts,
    /// Not at all.
    Stops,
}

/// Settings of this process of a durable run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DurableOptions {
    /// The events that it survives.
    pub durability: Durability,
    /// How the gap before it counts.
    pub downtime: Downtime,
    /// When snapshots are taken.
    pub snapshots: SnapshotEvery,
    /// Time of day in nanoseconds since 1970 at which the host of the run has begun, if it has one: from then
    /// on the clock of a run that sleeps goes on, also where a downtime does not count.
    pub hosted: Option<i64>,
    /// Whether the run of another version of the machine begins anew, with its facts and the variables of
    /// `defdurable`.
    pub from_facts: bool,
}

/// A durable run in this process.
pub struct DurableRun {
    folder: Option<RunFolder>,
    log: JournalLog,
    control: DurableControl,
    taker: SnapshotTaker,
    lasting: LastingCalls,
    /// Start of the addresses of the machine's heap; `None` if it is never copied.
    range: Option<usize>,
    /// Warnings about the files.
    warnings: Vec<String>,
    found: Option<FoundRun>,
    /// The facts from which it begins anew.
    kept: Option<KeptFacts>,
}

/// A run that is to go on.
struct FoundRun {
    recorded: esl_replay::Recorded,
    upgrades: Vec<JournalUpgrade>,
    resumption: Resumption,
    /// Good bytes of the file, if a torn tail follows them.
    torn: Option<u64>,
    /// The upgrade that is to be made when it goes on.
    upgrade: Option<Upgrade>,
}

impl FoundRun {
    /// Returns the bytes of the program that the run has now.
    fn current(&self) -> &[u8] {
        self.upgrades.last().map_or(&self.recorded.beginning.program, |upgrade| &upgrade.program)
    }
}

impl DurableRun {
    /// Takes the folder of a run, which is made if there is none, and reads its journal.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn open(path: &Path, options: DurableOptions) -> Result<DurableRun, DurableError> {
        DurableRun::open_in(RunFolder::open(path)?, options)
    }

    /// Takes the folder of a run that is there.
    ///
    /// # Errors
    /// [`DurableError`]; [`DurableError::NoRun`] if there is no folder.
    pub fn open_found(path: &Path, options: DurableOptions) -> Result<DurableRun, DurableError> {
        DurableRun::open_in(RunFolder::take(path)?, options)
    }

    fn open_in(folder: RunFolder, options: DurableOptions) -> Result<DurableRun, DurableError> {
        let (found, kept) = facts::find(folder.path(), options.from_facts)?;
        let last = found.as_ref().map_or(0, |found| found.last);
        let disk = with_kill(RealDisk::new(generations::journal_file(folder.path(), last)));
        let mut run = DurableRun::with(disk, found, options)?;
        run.taker.keep_facts_in(folder.path());
        if run.found.is_some() || kept.is_some() {
            folder.keep();
        }
        (run.folder, run.kept) = (Some(folder), kept);
        Ok(run)
    }

    /// Takes the folder of a run that is there, to inspect it.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn open_to_look(path: &Path) -> Result<DurableRun, DurableError> {
        if !path.is_dir() {
            return Err(DurableError::NoRun(path.into()));
        }
        let run = DurableRun::open_found(path, DurableOptions::default())?;
        if run.found.is_some() { Ok(run) } else { Err(DurableError::NoRun(path.into())) }
    }

    /// Reads the journal on a disk.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn on(mut disk: Box<dyn Disk>, options: DurableOptions) -> Result<DurableRun, DurableError> {
        let bytes = disk.read().map_err(DurableError::NotWritten)?;
        let found = match bytes.as_deref().map(RunJournal::read) {
            None | Some(Err(RecordedError::NoBeginning)) => None,
            Some(Ok(journal)) => {
                let (warnings, snapshot_bytes) = (Vec::new(), 0);
                Some(FoundJournals { journal, base: 0, last: 0, oldest: 0, snapshot_bytes, warnings })
            }
            Some(Err(error)) => return Err(DurableError::Journal(error)),
        };
        DurableRun::with(disk, found, options)
    }

    /// Goes on with the journals that were found, or begins a run.
    fn with(
        disk: Box<dyn Disk>,
        found: Option<FoundJournals>,
        options: DurableOptions,
    ) -> Result<DurableRun, DurableError> {
        let (control, lasting) = (DurableControl::default(), LastingCalls::default());
        let fresh = (options.snapshots != SnapshotEvery::Never).then(|| range_start(chance())).flatten();
        let Some(FoundJournals { journal, base, last: number, oldest, snapshot_bytes: _, warnings }) = found
        else {
            let standing = Standing::default();
            let log = JournalLog::new(disk, JournalWriter::default(), 0, options.durability, standing);
            let taker = SnapshotTaker::new(options.snapshots, log.clone(), control.clone(), lasting.clone());
            let (folder, warnings) = (None, Vec::new());
            return Ok(DurableRun {
                folder,
                log,
                control,
                taker,
                lasting,
                range: fresh,
                warnings,
                found: None,
                kept: None,
            });
        };
        let RunJournal { recorded, lives, upgrades, saved, length, time, generation: _, writer } = journal;
        if !recorded.beginning.is_of_this_machine() {
            return Err(DurableError::Journal(RecordedError::OtherMachine));
        }
        let torn = (recorded.torn > 0).then_some(length as u64);
        let last = lives.last().copied().unwrap_or_default();
        let resumption = Resumption::new(&last, time, wall_clock(), options.downtime, options.hosted);
        let standing = Standing { number, base, oldest, ..Standing::after(&recorded, &upgrades, saved) };
        let log = JournalLog::new(disk, writer, length as u64, options.durability, standing);
        let taker = SnapshotTaker::new(options.snapshots, log.clone(), control.clone(), lasting.clone());
        let snapshot = recorded.start.as_ref().and_then(|start| start.snapshot.as_ref());
        let range = snapshot.map(|snapshot| snapshot.range).or(fresh);
        let found = FoundRun { recorded, upgrades, resumption, torn, upgrade: None };
        let (folder, kept) = (None, None);
        Ok(DurableRun { folder, log, control, taker, lasting, range, warnings, found: Some(found), kept })
    }

    /// Returns warnings about the files, such as that of a damaged snapshot.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Returns the settings that the machine of the run needs, in place of these.
    pub fn config(&self, config: Config) -> Config {
        Config { range: self.range, ..config }
    }

    /// Makes the state of a machine that is ready for the program that of the snapshot from which the run
    /// goes on. Returns the main task; `None` if there is no snapshot, so that the program begins in the
    /// machine.
    ///
    /// # Errors
    /// [`DurableError::Snapshot`].
    pub fn restore(&self, machine: &mut Vm) -> Result<Option<TaskId>, DurableError> {
        let Some(start) = self.found.as_ref().and_then(|found| found.recorded.start.as_deref()) else {
            return Ok(None);
        };
        let snapshot = start.snapshot.as_ref().ok_or(DurableError::Snapshot("it is missing"))?;
        if machine.heap_range() != Some(snapshot.range) {
            return Err(DurableError::AddressesTaken);
        }
        let main = if machine.load_state(&snapshot.state) { machine.main_task() } else { None };
        let main =
            main.ok_or(DurableError::Snapshot("it belongs to a machine that was made by other steps"))?;
        let generation = &start.generation;
        if let Some(found) = self.found.as_ref().filter(|_| !self.control.is_copy()) {
            let ended = interruption::ended_operations(&found.recorded.records);
            let open = generation.open.iter().filter(|call| !ended.contains(&call.number));
            let is_repeated =
                |call: &&OpenCall| interruption::is_repeated(call, self.log.has_saved(call.number));
            for call in open.filter(is_repeated) {
                machine.begin_again(call.number, &call.name, &call.arguments, call.action);
            }
        }
        self.lasting.restore(&generation.lasting, machine);
        self.control.start_past(generation.not_due, generation.time());
        Ok(Some(main))
    }

    /// Has the machine take the snapshots of the run. To be called before it runs.
    pub fn take_snapshots(&self, machine: &mut Vm) {
        self.taker.install(machine);
    }

    /// Returns figures of the snapshots that this process has taken.
    pub fn snapshot_figures(&self) -> SnapshotFigures {
        self.taker.figures()
    }

    /// Returns the status with which the run has ended, if it has.
    pub fn ended(&self) -> Option<u8> {
        self.found.as_ref().and_then(|found| found.recorded.end).map(|end| end.status)
    }

    /// Returns the program and the settings with which the run has begun, unless it begins now.
    pub fn found(&self) -> Option<&Beginning> {
        self.found.as_ref().map(|found| &found.recorded.beginning)
    }

    /// Returns the arguments that the program has asked for, if it has.
    pub fn arguments(&self) -> Option<&[String]> {
        let found = self.found.as_ref()?;
        let known = found.recorded.start.as_ref().and_then(|start| start.generation.arguments.as_deref());
        known.or_else(|| {
            found.recorded.records.iter().find_map(|noted| match &noted.record {
                esl_host::Record::Arguments(arguments) => Some(arguments.as_slice()),
                _ => None,
            })
        })
    }

    /// Returns where the program's clock stands, in nanoseconds.
    pub fn elapsed(&self) -> u64 {
        self.found.as_ref().map_or(0, |found| found.resumption.elapsed())
    }

    /// Returns the control of the run.
    pub fn control(&self) -> DurableControl {
        self.control.clone()
    }

    /// Returns the host of the run, whose outside is `host`.
    pub fn host<H: Host>(&self, host: H) -> DurableHost<H> {
        self.log.set_inbox(host.inbox());
        let start = self.found.as_ref().and_then(|found| found.recorded.start.as_deref());
        let start = start.map(|start| &start.generation);
        let (records, resumption, upgrade) = match &self.found {
            Some(found) => (found.recorded.records.clone(), Some(found.resumption), found.upgrade.clone()),
            None => (Vec::new().into(), None, None),
        };
        let (log, control, lasting) = (self.log.clone(), self.control.clone(), self.lasting.clone());
        DurableHost::new(host, log, (control, lasting), records, start, resumption, upgrade)
    }

    /// Writes the program and the settings of a new run, or compares them with those with which the run has
    /// begun that goes on; [`DurableRun::choose_program`] returns that program. The machine has to be ready
    /// for it.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn begin(&self, program: &Program, setup: &RunSetup, machine: &Vm) -> Result<(), DurableError> {
        let beginning = esl_replay::beginning(program, setup, machine);
        let mut beginning = beginning.map_err(DurableError::Program)?;
        match &self.found {
            Some(found) => {
                compare(&found.recorded.beginning, &beginning, program)?;
                self.take_up(found)
            }
            None => {
                let (wall, chance) = (wall_clock(), chance());
                let life = JournalLife { number: 1, wall, chance, ..JournalLife::default() };
                beginning.kept = self.kept.as_ref().map(KeptFacts::for_beginning);
                self.log.create(&beginning, life);
                self.check()?;
                if let Some(folder) = &self.folder {
                    folder.keep();
                }
                self.end_beginning()
            }
        }
    }

    /// Takes up the journal of a run that goes on.
    fn take_up(&self, found: &FoundRun) -> Result<(), DurableError> {
        match found.torn {
            Some(length) => self.log.truncate(length),
            None => self.log.sync_found(),
        }
        self.check()
    }

    /// Returns the reason for which the run has to stop, if there is one.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn check(&self) -> Result<(), DurableError> {
        if let Some(divergence) = self.control.divergence() {
            return Err(DurableError::Diverged(divergence));
        }
        self.log.take_error().map_or(Ok(()), Err)
    }

    /// Leaves the run as it is, to go on in another process.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn pause(&self, machine: &Vm) -> Result<(), DurableError> {
        if let Some(life) = self.log.life() {
            let time = self.control.paused_at().unwrap_or_else(|| machine.last_time());
            let wall = wall_clock();
            self.log.note_life(JournalLife { is_pause: true, wall, time, ..life });
            self.log.finish();
            self.taker.finish();
            self.keep_facts(machine);
        }
        self.check()
    }

    /// Notes the end of the run.
    ///
    /// # Errors
    /// [`DurableError`].
    pub fn end(&self, machine: &Vm, status: u8) -> Result<(), DurableError> {
        self.check()?;
        if !self.control.is_at_end_of_past() {
            return Err(DurableError::Diverged("the run has ended, and the journal has more of it".into()));
        }
        self.log.end(machine.check(), status);
        self.taker.finish();
        self.check()?;
        self.forget_facts();
        self.note_rest(RunRest::Ended(status));
        Ok(())
    }

    /// Returns figures of the journal.
    pub fn figures(&self) -> LogFigures {
        self.log.figures()
    }
}

/// Returns a disk; one on which the process is killed, if a test asks for that.
#[cfg(all(unix, debug_assertions))]
fn with_kill(disk: RealDisk) -> Box<dyn Disk> {
    if kill_place::begin() { Box::new(disk::DeadlyDisk(disk)) } else { Box::new(disk) }
}

/// Returns a disk.
#[cfg(not(all(unix, debug_assertions)))]
fn with_kill(disk: RealDisk) -> Box<dyn Disk> {
    Box::new(disk)
}
