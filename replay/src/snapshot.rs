//! The file of a snapshot, `.esls`: the state of a machine at the beginning of a journal.
//!
//! ```text
//! magic           8 bytes   b"ESLS\r\n\x1a\n"
//! format version  u32       FORMAT
//! number          u64       of the journal that begins there
//! range           u64       start of the addresses of the machine's heap
//! identity        u32 and text: of the machine and its library
//! state
//! CRC-32          u32       of all that comes before
//! ```
//!
//! Guarantees: no bytes make [`RunSnapshot::read`] panic. A file with a flipped bit is refused.
//!
//! Not here: trust. The state contains code that no verifier sees, so the file is as trusted as the program.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use esl::program::ExecutionIdentity;
use esl_vm::stored::{MachineState, StateParts};

use super::file::{RecordedError, is_own};

const MAGIC: [u8; 8] = *b"ESLS\r\n\x1a\n";
const FORMAT: u32 = 1;
/// Bytes of the checksum.
const SUM: usize = 4;

/// The state of a machine at the beginning of a journal.
#[derive(Clone, Debug)]
pub struct RunSnapshot {
    /// Number of the journal.
    pub number: u64,
    /// Start of the addresses of the machine's heap.
    pub range: usize,
    /// The state.
    pub state: Arc<MachineState>,
}

/// Returns the first bytes of a snapshot, which end with the head of the state. The memory follows, and then
/// the checksum of both ([`add_to_sum`]).
pub fn snapshot_head(number: u64, range: usize, state: &StateParts<'_>) -> Vec<u8> {
    let mut bytes = bytes_before_state(number, range);
    bytes.extend_from_slice(state.head());
    bytes
}

fn bytes_before_state(number: u64, range: usize) -> Vec<u8> {
    let identity = ExecutionIdentity::current().to_string();
    let mut bytes = Vec::new();
    bytes.extend_from_slice(&MAGIC);
    bytes.extend_from_slice(&FORMAT.to_le_bytes());
    bytes.extend_from_slice(&number.to_le_bytes());
    bytes.extend_from_slice(&(range as u64).to_le_bytes());
    bytes.extend_from_slice(&(identity.len() as u32).to_le_bytes());
    bytes.extend_from_slice(identity.as_bytes());
    bytes
}

/// Adds bytes to the checksum of a snapshot, which begins with 0. Allocates nothing, and takes no lock.
pub fn add_to_sum(sum: u32, bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new_with_initial(sum);
    hasher.update(bytes);
    hasher.finalize()
}

/// Puts the checksum behind the bytes of a snapshot.
pub fn seal_snapshot(bytes: &mut Vec<u8>) {
    let sum = add_to_sum(0, bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
}

/// Returns the name of the file of the snapshot at the beginning of a journal, given the name of the journal.
pub fn snapshot_file(journal: &Path) -> Option<PathBuf> {
    let number = journal.file_stem()?.to_str()?.strip_prefix("journal-")?;
    Some(journal.with_file_name(format!("snapshot-{number}.esls")))
}

impl RunSnapshot {
    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn read(mut bytes: Vec<u8>) -> Result<RunSnapshot, RecordedError> {
        let damaged = |problem| RecordedError::Damaged { offset: 0, problem };
        let rest = bytes.strip_prefix(&MAGIC).ok_or_else(|| damaged("it is not a snapshot"))?;
        let &version = rest.first_chunk().ok_or_else(|| damaged("it is cut off"))?;
        let version = u32::from_le_bytes(version);
        if version != FORMAT {
            return Err(RecordedError::Format(version));
        }
        let (content, &sum) = bytes.split_last_chunk::<SUM>().ok_or_else(|| damaged("it is cut off"))?;
        if add_to_sum(0, content) != u32::from_le_bytes(sum) {
            return Err(damaged("the snapshot has another checksum"));
        }
        let content = content.get(MAGIC.len() + size_of::<u32>()..).unwrap_or_default();
        let (identity, number, range, length) =
            read_content(content).ok_or_else(|| damaged("the content is not of its kind"))?;
        if !is_own(identity) {
            return Err(RecordedError::OtherMachine);
        }
        bytes.truncate(bytes.len() - SUM);
        let start = bytes.len() - length;
        Ok(RunSnapshot { number, range, state: Arc::new(MachineState::from_trusted_end(bytes, start)) })
    }
}

/// Reads the identity, the number and the range, and returns them with the length of the state behind.
fn read_content(content: &[u8]) -> Option<(&str, u64, usize, usize)> {
    let (&number, rest) = content.split_first_chunk()?;
    let (&range, rest) = rest.split_first_chunk()?;
    let (&length, rest) = rest.split_first_chunk()?;
    let (identity, state) = rest.split_at_checked(u32::from_le_bytes(length) as usize)?;
    let range = usize::try_from(u64::from_le_bytes(range)).ok()?;
    Some((std::str::from_utf8(identity).ok()?, u64::from_le_bytes(number), range, state.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_snapshot_with_a_flipped_bit_or_cut_off_is_refused() {
        let state = MachineState::from_trusted_bytes(vec![1, 2, 3]);
        let mut bytes = bytes_before_state(7, 0x1000);
        bytes.extend_from_slice(state.bytes());
        seal_snapshot(&mut bytes);
        let read = RunSnapshot::read(bytes.clone()).expect("it is whole");
        assert_eq!((read.number, read.range, &*read.state), (7, 0x1000, &state));
        for bit in 0..8 * bytes.len() {
            let mut flipped = bytes.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert!(RunSnapshot::read(flipped).is_err(), "bit {bit}");
        }
        assert!((0..bytes.len()).all(|length| RunSnapshot::read(bytes[..length].to_vec()).is_err()));
    }

    #[test]
    fn the_snapshot_of_a_journal_is_beside_it() {
        let file = |journal: &str| snapshot_file(Path::new(journal));
        assert_eq!(file("d/journal-12.eslj"), Some("d/snapshot-12.esls".into()));
        assert_eq!(file("d/journal.eslj"), None);
    }
}
