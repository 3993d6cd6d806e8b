//! Inspecting a durable run without going on with it.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use esl_host::{Record, Survey, SurveyRequest};
use esl_replay::{JournalLife, Replayed, Rerun, RunJournal};

use super::DurableError;
use super::disk::{Disk, RealDisk};
use super::folder::RunFolder;

/// A durable run, at the end of its journal.
pub struct DurableState {
    /// The names of the file of the program.
    pub program_file: Vec<String>,
    /// Identity of the machine and its library.
    pub identity: String,
    /// The processes that it has had, and its pauses.
    pub lives: Vec<JournalLife>,
    /// Records of the journal.
    pub records: usize,
    /// Effects of which the journal has the intents.
    pub effects: usize,
    /// Bytes of the journal.
    pub bytes: usize,
    /// Bytes of a torn tail.
    pub torn: usize,
    /// Exit status, if it has ended.
    pub ended: Option<u8>,
    /// Time of the last write to the journal.
    pub written: Option<SystemTime>,
    /// Ticks of all tasks.
    pub ticks: u64,
    rerun: Rerun,
    /// The folder is locked while it is inspected.
    _folder: RunFolder,
}

impl DurableState {
    /// Returns tasks, relations and facts where the journal ends.
    pub fn survey(&mut self, request: &SurveyRequest) -> Survey {
        self.rerun.machine_mut().survey(request)
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
    let file = folder.journal();
    let bytes = RealDisk::new(file.clone()).read();
    let bytes = bytes.map_err(|error| DurableError::Folder(file.clone(), error))?;
    let bytes = bytes.ok_or_else(|| DurableError::NoRun(path.into()))?;
    let RunJournal { recorded, lives, length, .. } =
        RunJournal::read(&bytes).map_err(DurableError::Journal)?;
    let mut rerun = Rerun::begin(&recorded, |_, _| ()).map_err(|error| match error {
        esl_replay::RerunError::Recording(error) => DurableError::Journal(error),
        other => DurableError::Diverged(other.to_string()),
    })?;
    if let Replayed::Diverged(text) = rerun.run_to_last_record() {
        return Err(DurableError::Diverged(text));
    }
    let is_intent = |record: &Record| matches!(record, Record::Intended(_));
    let written = fs::metadata(&file).and_then(|metadata| metadata.modified()).ok();
    Ok(DurableState {
        program_file: recorded.beginning.program_file.clone(),
        identity: recorded.beginning.identity().into(),
        records: recorded.records.len(),
        effects: recorded.records.iter().filter(|noted| is_intent(&noted.record)).count(),
        lives,
        bytes: length,
        torn: recorded.torn,
        ended: recorded.end.map(|end| end.status),
        written,
        ticks: rerun.check().ticks,
        rerun,
        _folder: folder,
    })
}
