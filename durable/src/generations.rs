//! The generations of a run: the files in its folder, and those of them by which it goes on.
//!
//! ```text
//! journal.eslj                        from the beginning of the run
//! journal-1.eslj   snapshot-1.esls    from the first snapshot on
//! journal-2.eslj   snapshot-2.esls    and so on; the last two generations are kept
//! ```
//!
//! A journal begins when the machine is copied, so its snapshot may be missing: the process was killed before
//! it was on the disk. Then the run goes on from the generation before, by both journals. So it does if a
//! snapshot is damaged.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use esl_replay::{RecordedError, RunJournal, RunSnapshot, RunStart};

use super::DurableError;
use super::disk::{Disk, RealDisk};

/// Returns the name of the journal of a generation.
pub(crate) fn journal_file(folder: &Path, number: u64) -> PathBuf {
    match number {
        0 => folder.join("journal.eslj"),
        number => folder.join(format!("journal-{number}.eslj")),
    }
}

/// Returns the name of the snapshot at the beginning of a generation.
pub(crate) fn snapshot_file(folder: &Path, number: u64) -> PathBuf {
    folder.join(format!("snapshot-{number}.esls"))
}

/// Returns the numbers of the generations of which there are journals, in their order.
pub(crate) fn numbers(folder: &Path) -> std::io::Result<Vec<u64>> {
    let mut numbers = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let name = entry?.file_name();
        let name = name.to_str().unwrap_or_default();
        match name.strip_prefix("journal-").and_then(|rest| rest.strip_suffix(".eslj")) {
            Some(number) => numbers.extend(number.parse::<u64>().ok().filter(|&number| number > 0)),
            None if name == "journal.eslj" => numbers.push(0),
            None => {}
        }
    }
    numbers.sort_unstable();
    Ok(numbers)
}

/// The journals by which a run goes on.
pub(crate) struct FoundJournals {
    /// All of them as one. Its start has the snapshot, if it does not begin with the run.
    pub(crate) journal: RunJournal,
    /// Number of the first one.
    pub(crate) base: u64,
    /// Number of the last one, which is written on.
    pub(crate) last: u64,
    /// Number of the oldest generation in the folder.
    pub(crate) oldest: u64,
    /// Bytes of the snapshot.
    pub(crate) snapshot_bytes: u64,
    /// Why newer snapshots are left out.
    pub(crate) warnings: Vec<String>,
}

/// Reads the journals in a folder; `None` if there is no run.
///
/// # Errors
/// [`DurableError`].
pub(crate) fn find(folder: &Path) -> Result<Option<FoundJournals>, DurableError> {
    let in_folder = |error| DurableError::Folder(folder.into(), error);
    let numbers = numbers(folder).map_err(in_folder)?;
    let (Some(&oldest), Some(&last)) = (numbers.first(), numbers.last()) else { return Ok(None) };
    let mut warnings = Vec::new();
    let mut refused = None;
    for &base in numbers.iter().rev() {
        // A gap is the end of the generations that were removed.
        if !(base..=last).all(|number| numbers.binary_search(&number).is_ok()) {
            break;
        }
        let snapshot = match base {
            0 => None,
            number => match read_snapshot(&snapshot_file(folder, number), number) {
                Ok(snapshot) => Some(snapshot),
                Err(None) => continue,
                Err(Some(RecordedError::OtherMachine)) => {
                    return Err(DurableError::Journal(RecordedError::OtherMachine));
                }
                Err(Some(error)) => {
                    warnings.push(format!("snapshot {number} is left out: {error}"));
                    refused = Some(error);
                    continue;
                }
            },
        };
        let mut journal = match joined(folder, base, last) {
            // The first process was killed before it had begun the run.
            Err(DurableError::Journal(RecordedError::NoBeginning)) if last == 0 => return Ok(None),
            journal => journal?,
        };
        let mut snapshot_bytes = 0;
        if let (Some(start), Some((snapshot, bytes))) = (&journal.recorded.start, snapshot) {
            let generation = start.generation.clone();
            journal.recorded.start = Some(Arc::new(RunStart { generation, snapshot: Some(snapshot) }));
            snapshot_bytes = bytes;
        }
        return Ok(Some(FoundJournals { journal, base, last, oldest, snapshot_bytes, warnings }));
    }
    Err(DurableError::Journal(refused.unwrap_or(RecordedError::NoSnapshot)))
}

/// Returns the number of the last generation in a folder.
///
/// # Errors
/// [`DurableError`].
pub(crate) fn last(folder: &Path) -> Result<u64, DurableError> {
    let numbers = numbers(folder).map_err(|error| DurableError::Folder(folder.into(), error))?;
    numbers.last().copied().ok_or_else(|| DurableError::NoRun(folder.into()))
}

/// Reads the journals of these generations as one.
///
/// # Errors
/// [`DurableError`].
pub(crate) fn joined(folder: &Path, first: u64, last: u64) -> Result<RunJournal, DurableError> {
    let mut journal = read_journal(folder, first)?;
    for number in first + 1..=last {
        let next = read_journal(folder, number)?;
        if !journal.append(next) {
            let problem = if journal.recorded.torn > 0 {
                "its end is missing, and the next journal is there, as after a loss of power without \
                 `--durability power`"
            } else {
                "the next journal does not begin at its end"
            };
            let offset = journal.length;
            return Err(DurableError::Journal(RecordedError::Damaged { offset, problem }));
        }
    }
    Ok(journal)
}

fn read_journal(folder: &Path, number: u64) -> Result<RunJournal, DurableError> {
    let file = journal_file(folder, number);
    super::folder::check_private(&file)?;
    let bytes = RealDisk::new(file.clone()).read();
    let bytes = bytes.map_err(|error| DurableError::Folder(file, error))?.unwrap_or_default();
    let journal = RunJournal::read(&bytes).map_err(DurableError::Journal)?;
    if journal.generation != number {
        let problem = "it is the journal of another generation";
        return Err(DurableError::Journal(RecordedError::Damaged { offset: 0, problem }));
    }
    Ok(journal)
}

/// Reads a snapshot. The error is `None` if there is no file.
fn read_snapshot(file: &Path, number: u64) -> Result<(RunSnapshot, u64), Option<RecordedError>> {
    let unreadable = |problem| Some(RecordedError::Damaged { offset: 0, problem });
    if !file.exists() {
        return Err(None);
    }
    super::folder::check_private(file)
        .map_err(|_| unreadable("other users may write or read it, or it is theirs"))?;
    let bytes = std::fs::read(file).map_err(|_| unreadable("it cannot be read"))?;
    let length = bytes.len() as u64;
    let snapshot = RunSnapshot::read(bytes).map_err(Some)?;
    if snapshot.number != number {
        return Err(unreadable("it is the snapshot of another generation"));
    }
    Ok((snapshot, length))
}
