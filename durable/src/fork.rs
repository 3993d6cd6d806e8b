//! Forks: copies of a durable run as it was.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::time::Duration;

use esl_replay::{RecordedError, RunJournal};

use super::DurableError;
use super::folder::{RunFolder, check_private};
use super::generations::{self, journal_file, snapshot_file};

/// A copy of a durable run that was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunFork {
    /// Time between its last record and that of the run.
    pub back: Duration,
    /// Number of processes that the copy has had.
    pub processes: u64,
}

/// Copies a run into a folder without one, as the run was so long before its last record, by its own clock.
/// The copy ends with the last part of the journal that was written by then. It is a run of its own.
///
/// # Errors
/// [`DurableError`]; [`DurableError::HasRun`] if the other folder has a run; [`DurableError::TooFarBack`] if
/// the generations that are kept begin later.
pub fn fork(path: &Path, copy: &Path, back: Duration) -> Result<RunFork, DurableError> {
    if !path.is_dir() {
        return Err(DurableError::NoRun(path.into()));
    }
    let folder = RunFolder::take(path)?;
    let found = generations::find(folder.path())?.ok_or_else(|| DurableError::NoRun(path.into()))?;
    let end = found.journal.time;
    let until = end.saturating_sub(u64::try_from(back.as_nanos()).unwrap_or(u64::MAX));
    let read = |number| {
        let file = journal_file(folder.path(), number);
        check_private(&file)?;
        fs::read(&file).map_err(|error| DurableError::Folder(file, error))
    };
    let mut bytes = Vec::new();
    let mut last = None;
    let mut oldest = 0;
    for number in (found.oldest..=found.last).rev() {
        bytes = read(number)?;
        let journal = RunJournal::read(&bytes).map_err(DurableError::Journal)?;
        oldest = journal.recorded.start.map_or(0, |start| start.generation.time());
        if oldest <= until {
            last = Some(number);
            break;
        }
    }
    let last = last.ok_or(DurableError::TooFarBack(Duration::from_nanos(end - oldest)))?;
    let until = if back.is_zero() { u64::MAX } else { until };
    bytes.truncate(RunJournal::length_until(&bytes, until).map_err(DurableError::Journal)?);
    let journal = RunJournal::read(&bytes).map_err(DurableError::Journal)?;
    let target = RunFolder::open(copy)?;
    let in_copy = |error| DurableError::Folder(copy.into(), error);
    if !generations::numbers(target.path()).map_err(in_copy)?.is_empty() {
        return Err(DurableError::HasRun(copy.into()));
    }
    target.keep();
    for number in found.oldest..=last {
        let snapshot = snapshot_file(folder.path(), number);
        if number > 0 && snapshot.exists() {
            check_private(&snapshot)?;
            let contents = fs::read(&snapshot).map_err(|error| DurableError::Folder(snapshot, error))?;
            write(&snapshot_file(target.path(), number), &contents).map_err(in_copy)?;
        }
        let earlier = if number < last { Some(read(number)?) } else { None };
        // The last journal makes a run of the folder, so it comes last.
        write(&journal_file(target.path(), number), earlier.as_ref().unwrap_or(&bytes)).map_err(in_copy)?;
    }
    File::open(target.path()).and_then(|folder| folder.sync_all()).map_err(in_copy)?;
    let processes = journal.lives.last().ok_or(DurableError::Journal(RecordedError::NoBeginning))?.number;
    Ok(RunFork { back: Duration::from_nanos(end.saturating_sub(journal.time)), processes })
}

/// Writes a file that only its owner can read.
fn write(path: &Path, contents: &[u8]) -> std::io::Result<()> {
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let mut file = options.open(path)?;
    file.write_all(contents)?;
    file.sync_all()
}
