//! Inspecting a durable run without going on with it.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use esl::program;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::{Record, Survey, SurveyRequest};
use esl_replay::{JournalLife, Recorded, Replayed, Rerun, RunJournal};
use esl_vm::vm::Vm;

use super::control::DurableControl;
use super::folder::RunFolder;
use super::generations::{self, FoundJournals};
use super::resume::{Resumption, wall_clock};
use super::{Downtime, DurableError, DurableRun};

/// A durable run, at the end of its journal.
pub struct DurableState {
    /// The names of the file of the program.
    pub program_file: Vec<String>,
    /// Identity of the machine and its library.
    pub identity: String,
    /// The processes that it has had, and its pauses.
    pub lives: Vec<JournalLife>,
    /// Numbers of the processes that have upgraded it.
    pub upgrades: Vec<u64>,
    /// Records of the journal.
    pub records: usize,
    /// Effects of which the journal has the intents.
    pub effects: usize,
    /// Bytes of the journals by which it goes on.
    pub bytes: usize,
    /// Number of the generation of its journal.
    pub generation: u64,
    /// Number of the generation from which it goes on: that of the snapshot, or 0 for its beginning.
    pub base: u64,
    /// Number of the oldest generation that is kept.
    pub oldest: u64,
    /// Bytes of the snapshot; 0 without one.
    pub snapshot_bytes: u64,
    /// Why newer snapshots are left out.
    pub warnings: Vec<String>,
    /// Bytes of a torn tail.
    pub torn: usize,
    /// Exit status, if it has ended.
    pub ended: Option<u8>,
    /// Time of the last write to the journal.
    pub written: Option<SystemTime>,
    /// Ticks of all tasks.
    pub ticks: u64,
    machine: LookedMachine,
    /// The control of the copy that is inspected.
    control: DurableControl,
    /// The folder is locked while it is inspected.
    _folder: RunFolder,
}

impl DurableState {
    /// Returns tasks, relations and facts where the journal ends.
    pub fn survey(&mut self, request: &SurveyRequest) -> Survey {
        self.machine.get().survey(request)
    }
}

/// A patch that an operator has made in a run, and that is in force.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunPatch {
    /// Number of its definitions.
    pub definitions: usize,
    /// The kinds of what it has changed, in lower case, and the names.
    pub changes: Vec<(String, String)>,
}

impl RunPatch {
    /// Reads an element of the library's list of patches.
    fn of(datum: &Datum) -> Option<RunPatch> {
        let parts = datum.as_list()?;
        let (count, rows) = parts.split_first()?;
        let DatumKind::Integer(count) = count.kind() else { return None };
        let row = |row: &&Datum| {
            let row = row.as_list()?;
            let kind = row.first()?.to_string().trim_start_matches(':').to_lowercase();
            Some((kind, row.get(1)?.to_string()))
        };
        let changes = rows.iter().filter_map(row).collect();
        Some(RunPatch { definitions: usize::try_from(count).ok()?, changes })
    }
}

impl DurableState {
    /// Returns the patches of operators that are in force where the journal ends, newest first. A run that
    /// has ended has none.
    ///
    /// # Errors
    /// [`DurableError::Machine`].
    pub fn patches(&mut self) -> Result<Vec<RunPatch>, DurableError> {
        let LookedMachine::Open(machine) = &mut self.machine else { return Ok(Vec::new()) };
        if !program::has_operators(machine) {
            return Ok(Vec::new());
        }
        self.control.set_asked();
        let none = || DurableError::Machine(esl::Error::NoMemory("the patches"));
        let read = machine.callee_named("symbol-value").ok_or_else(none)?;
        let variable = Datum::symbol(Symbol::esl("*%PATCHES*"), Span::default());
        let variable = machine.import(&variable).map_err(|_| none())?;
        let values = machine.call_without_budget(read, &[variable], u64::MAX);
        let values = values.map_err(|error| DurableError::Machine(error.into()))?;
        let Some(&list) = values.first() else { return Ok(Vec::new()) };
        let list = machine.export(list).map_err(|_| none())?;
        Ok(list.as_list().unwrap_or_default().into_iter().filter_map(RunPatch::of).collect())
    }
}

/// The machine of a run at the end of its journal.
enum LookedMachine {
    /// The run has ended.
    Ended(Box<Rerun>),
    /// It may go on.
    Open(Box<Vm>),
}

impl LookedMachine {
    fn get(&mut self) -> &mut Vm {
        match self {
            LookedMachine::Ended(rerun) => rerun.machine_mut(),
            LookedMachine::Open(machine) => machine,
        }
    }
}

/// Runs a run again that has ended.
fn run_ended(recorded: &Recorded) -> Result<Rerun, DurableError> {
    let mut rerun = Rerun::begin(recorded, |_, _| ()).map_err(|error| match error {
        esl_replay::RerunError::Recording(error) => DurableError::Journal(error),
        other => DurableError::Diverged(other.to_string()),
    })?;
    match rerun.run_to_last_record() {
        Replayed::Diverged(text) => Err(DurableError::Diverged(text)),
        _ => Ok(rerun),
    }
}

/// Reads a run, and runs it again by its journal, without the outside.
///
/// # Errors
/// [`DurableError`], also if the run takes another course than its journal.
pub fn look(path: &Path) -> Result<DurableState, DurableError> {
    if !path.is_dir() {
        return Err(DurableError::NoRun(path.into()));
    }
    let folder = RunFolder::take(path)?;
    let found = generations::find(folder.path())?.ok_or_else(|| DurableError::NoRun(path.into()))?;
    let FoundJournals { journal, base, last, oldest, snapshot_bytes, warnings } = found;
    let file = generations::journal_file(folder.path(), last);
    let bytes = (base..=last)
        .map(|number| {
            fs::metadata(generations::journal_file(folder.path(), number)).map_or(0, |file| file.len())
        })
        .sum::<u64>();
    let RunJournal { recorded, lives, upgrades, time, .. } = journal;
    let mut control = DurableControl::default();
    let mut machine = match recorded.end {
        Some(_) => LookedMachine::Ended(Box::new(run_ended(&recorded)?)),
        None => {
            let last = lives.last().copied().unwrap_or_default();
            let resumption = Resumption::new(&last, time, wall_clock(), Downtime::Stops, None);
            let copy = DurableRun::copy_of(&recorded, resumption, None);
            control = copy.control();
            LookedMachine::Open(Box::new(copy.run_to_end_of_journal()?))
        }
    };
    let before = recorded
        .start
        .as_ref()
        .map_or((0, 0), |start| (start.generation.records as usize, start.generation.effects as usize));
    let is_intent = |record: &Record| matches!(record, Record::Intended(_));
    let written = fs::metadata(&file).and_then(|metadata| metadata.modified()).ok();
    Ok(DurableState {
        program_file: recorded.beginning.program_file.clone(),
        identity: recorded.beginning.identity().into(),
        records: before.0 + recorded.records.len(),
        effects: before.1 + recorded.records.iter().filter(|noted| is_intent(&noted.record)).count(),
        lives,
        upgrades: upgrades.iter().map(|upgrade| upgrade.life).collect(),
        bytes: bytes as usize - recorded.torn,
        generation: last,
        base,
        oldest,
        snapshot_bytes,
        warnings,
        torn: recorded.torn,
        ended: recorded.end.map(|end| end.status),
        written,
        ticks: machine.get().check().ticks,
        machine,
        control,
        _folder: folder,
    })
}
