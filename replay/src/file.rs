//! The file of a recorded run, `.eslj`.
//!
//! ```text
//! magic           8 bytes   b"ESLJ\r\n\x1a\n"
//! format version  u32       FORMAT
//! frames, one after the other:
//!   length        u32       of the content
//!   CRC-32        u32       of the content
//!   kind          u8        1 header, 2 records, 3 records compressed by lz4, 4 end
//!   check         u16       low half of the CRC-32 of the nine bytes before
//!   content
//! ```
//!
//! Numbers are little-endian. The first frame is the header: what the run began with, the program included,
//! as it is: to compress it takes longer than the beginning of a small program does.
//! Each frame of records holds those that were made between two writes to the file. The last one is the end:
//! how the run has ended.
//!
//! The journal of a durable run is such a file that several processes have written, one after the other; it
//! has frames of further kinds (`journal`).
//!
//! A run may be killed, so the last frame may be torn: then it is as if it had not been written. Anything
//! else that is wrong means that the file was changed, and it is refused.
//!
//! Guarantees: no bytes make [`Recorded::read`] panic, or allocate more than a small multiple of their
//! number; lz4 gives at most 255 bytes for one.

use std::fmt;
use std::sync::Arc;

use esl::program::ExecutionIdentity;
use esl_host::{NotedRecord, Right, RunCheck};
use esl_vm::embed::Need;
use esl_vm::vm::Config;

use super::generation::JournalGeneration;
use super::journal::RunJournal;
use super::pack::{ByteReader, ByteWriter};
use super::snapshot::RunSnapshot;

/// The first bytes of a file. They betray transfers that change line ends.
pub const MAGIC: [u8; 8] = *b"ESLJ\r\n\x1a\n";
/// The version of the format that this library reads and writes.
pub const FORMAT: u32 = 9;

/// Length of what is before the content of a frame.
pub(super) const FRAME: usize = 11;
/// Content above this size is compressed.
pub(super) const COMPRESSED_ABOVE: usize = 4096;
/// Most bytes that lz4 makes of one.
const EXPANSION: usize = 255;

/// Kinds of frames.
pub(super) mod kind {
    pub(crate) const HEADER: u8 = 1;
    pub(crate) const RECORDS: u8 = 2;
    pub(crate) const COMPRESSED: u8 = 3;
    pub(crate) const END: u8 = 4;
    pub(crate) const LIFE: u8 = 5;
    pub(crate) const MARKED: u8 = 6;
    pub(crate) const MARKED_COMPRESSED: u8 = 7;
    pub(crate) const UPGRADE: u8 = 8;
    pub(crate) const GENERATION: u8 = 9;
    pub(crate) const SAVED: u8 = 10;
}

/// A function of the embedder's, as a replay has to know it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GivenFunction {
    /// Its name.
    pub name: String,
    /// Whether it begins operations.
    pub is_operation: bool,
    /// The rights that it needs.
    pub needs: Vec<Need>,
}

/// The beginning of a run.
#[derive(Clone, Debug)]
pub struct Beginning {
    /// Bytes of the program, as in an `.eslb` file.
    pub program: Vec<u8>,
    /// Limits and settings.
    pub config: Config,
    /// The enabled traces.
    pub traces: Vec<String>,
    /// The folders in which modules are looked for.
    pub folders: Vec<String>,
    /// The names of the file of the program, if it was one.
    pub program_file: Vec<String>,
    /// The schedule by which tasks take turns, as a text, if there is one.
    pub schedule: Option<String>,
    /// The functions of the embedder's.
    pub functions: Vec<GivenFunction>,
    /// Whether the machine has the functions of the library that serve operators.
    pub has_operators: bool,
    /// The facts and variables with which it begins, as [`set_kept`](super::set_kept) takes them.
    pub kept: Option<String>,
    /// Identity of the machine and its library.
    pub(super) identity: String,
}

impl Beginning {
    /// Returns the identity of the machine and its library that the run has begun on.
    pub fn identity(&self) -> &str {
        &self.identity
    }

    /// Returns whether that is the identity of this machine.
    pub fn is_of_this_machine(&self) -> bool {
        is_own(&self.identity)
    }
}

/// How a run has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedEnd {
    /// Exit status.
    pub status: u8,
    /// Ticks and canary at the end.
    pub check: RunCheck,
}

/// A recorded run.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// The beginning of the run.
    pub beginning: Beginning,
    /// The records.
    pub records: Arc<[NotedRecord]>,
    /// How it has ended; `None` if the file ends before.
    pub end: Option<RecordedEnd>,
    /// Bytes of a torn frame that were left out.
    pub torn: usize,
    /// Where the records begin; `None` for the beginning of the run.
    pub start: Option<Arc<RunStart>>,
}

/// A place in the course of a run at which its records begin.
#[derive(Clone, Debug)]
pub struct RunStart {
    /// The frame in the journal.
    pub generation: JournalGeneration,
    /// The state of the machine, once it was read from its file.
    pub snapshot: Option<RunSnapshot>,
}

/// Why bytes are not a recorded run.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RecordedError {
    /// The first bytes are not those of a recording.
    NotOne,
    /// It was written by another version of the format.
    Format(u32),
    /// It ends before the program has begun.
    NoBeginning,
    /// A part of it was changed, or is of an unknown kind.
    Damaged {
        /// Offset of the frame.
        offset: usize,
        /// The fault.
        problem: &'static str,
    },
    /// It was made by another build of the machine or its library.
    OtherMachine,
    /// It begins at a snapshot, which is not beside it.
    NoSnapshot,
}

impl fmt::Display for RecordedError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RecordedError::NotOne => f.write_str("it is not a recording of a run"),
            RecordedError::Format(version) => {
                write!(f, "it has version {version} of the format; this machine reads version {FORMAT}")
            }
            RecordedError::NoBeginning => {
                f.write_str("it ends before the program; the run was killed while it began")
            }
            RecordedError::Damaged { offset, problem } => {
                write!(f, "it is damaged at byte {offset}: {problem}")
            }
            RecordedError::NoSnapshot => f.write_str(
                "it begins in the middle of its run, at a snapshot that is not beside it or cannot be read",
            ),
            RecordedError::OtherMachine => f.write_str(
                "it was made by another version of the machine or its library, in which the same run takes \
                 another course; replay it with that version",
            ),
        }
    }
}

impl std::error::Error for RecordedError {}

/// Adds a frame to the bytes of a file.
pub(super) fn frame(out: &mut Vec<u8>, kind: u8, content: &[u8]) {
    let start = out.len();
    // A piece of 4 GiB cannot be held by the machine either.
    out.extend_from_slice(&u32::try_from(content.len()).unwrap_or(u32::MAX).to_le_bytes());
    out.extend_from_slice(&crc32fast::hash(content).to_le_bytes());
    out.push(kind);
    let check = crc32fast::hash(&out[start..]) as u16;
    out.extend_from_slice(&check.to_le_bytes());
    out.extend_from_slice(content);
}

/// Returns the bytes with which a file begins.
pub(super) fn beginning_bytes(beginning: &Beginning) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend_from_slice(&FORMAT.to_le_bytes());
    let mut out = ByteWriter::default();
    out.text(&beginning.identity);
    write_config(&mut out, &beginning.config);
    out.list(&beginning.traces, |out, text| out.text(text));
    out.list(&beginning.folders, |out, text| out.text(text));
    out.list(&beginning.program_file, |out, text| out.text(text));
    out.list(beginning.schedule.as_slice(), |out, text| out.text(text));
    out.list(&beginning.functions, |out, function| {
        out.text(&function.name);
        out.byte(function.is_operation.into());
        out.list(&function.needs, |out, need| {
            out.byte(need.right as u8);
            out.number(need.argument as u64);
        });
    });
    out.byte(beginning.has_operators.into());
    out.list(beginning.kept.as_slice(), |out, text| out.text(text));
    out.bytes(&beginning.program);
    frame(&mut bytes, kind::HEADER, &out.0);
    bytes
}

pub(super) fn read_beginning(content: &[u8]) -> Option<Beginning> {
    let mut from = ByteReader(content);
    let identity = from.text()?.into();
    let config = read_config(&mut from)?;
    let traces = from.list(|from| Some(from.text()?.into()))?;
    let folders = from.list(|from| Some(from.text()?.into()))?;
    let program_file = from.list(|from| Some(from.text()?.into()))?;
    let mut schedules: Vec<String> = from.list(|from| Some(from.text()?.into()))?;
    let schedule = schedules.pop();
    let functions = from.list(|from| {
        let (name, is_operation) = (from.text()?.into(), from.flag()?);
        let needs = from.list(|from| {
            let right = usize::from(from.byte()?);
            let right = Right::ALL.into_iter().chain([Right::Module]).find(|&one| one as usize == right)?;
            Some(Need { right, argument: usize::try_from(from.number()?).ok()? })
        })?;
        Some(GivenFunction { name, is_operation, needs })
    })?;
    let has_operators = from.flag()?;
    let mut kept: Vec<String> = from.list(|from| Some(from.text()?.into()))?;
    let kept = kept.pop();
    let program = from.bytes()?.to_vec();
    from.is_empty().then_some(Beginning {
        program,
        config,
        traces,
        folders,
        program_file,
        schedule,
        functions,
        has_operators,
        kept,
        identity,
    })
}

pub(super) fn decompress(bytes: &[u8], length: usize) -> Option<Vec<u8>> {
    if length > bytes.len().saturating_mul(EXPANSION) {
        return None;
    }
    lz4_flex::block::decompress(bytes, length).ok().filter(|content| content.len() == length)
}

fn write_config(out: &mut ByteWriter, config: &Config) {
    let Config {
        memory,
        stack,
        slice,
        budget,
        seed,
        collect_always,
        critical_ticks,
        cleanup_ticks,
        cleanup_time,
        snapshots: _,
        range: _,
    } = config;
    let optional = |out: &mut ByteWriter, number: Option<u64>| {
        out.byte(number.is_some().into());
        out.number(number.unwrap_or(0));
    };
    out.number(*memory as u64);
    optional(out, stack.map(|words| words as u64));
    out.number(u64::from(*slice));
    optional(out, *budget);
    out.number(*seed);
    out.byte((*collect_always).into());
    out.number(u64::from(*critical_ticks));
    out.number(*cleanup_ticks);
    out.number(*cleanup_time);
}

fn read_config(from: &mut ByteReader<'_>) -> Option<Config> {
    let optional = |from: &mut ByteReader<'_>| {
        let (is_there, number) = (from.flag()?, from.number()?);
        Some(is_there.then_some(number))
    };
    Some(Config {
        memory: usize::try_from(from.number()?).ok()?,
        stack: match optional(from)? {
            Some(words) => Some(usize::try_from(words).ok()?),
            None => None,
        },
        slice: from.small().filter(|&slice| (1..=1_000_000_000).contains(&slice))?,
        budget: optional(from)?,
        seed: from.number()?,
        collect_always: from.flag()?,
        critical_ticks: from.small()?,
        cleanup_ticks: from.number()?,
        cleanup_time: from.number()?,
        snapshots: false,
        range: None,
    })
}

/// Returns the last frame.
pub(super) fn end_bytes(end: &RecordedEnd) -> Vec<u8> {
    let mut out = ByteWriter::default();
    out.byte(end.status);
    out.number(end.check.round);
    out.number(end.check.ticks);
    out.0.extend_from_slice(&end.check.canary.to_le_bytes());
    let mut bytes = Vec::new();
    frame(&mut bytes, kind::END, &out.0);
    bytes
}

pub(super) fn read_end(content: &[u8]) -> Option<RecordedEnd> {
    let mut from = ByteReader(content);
    let status = from.byte()?;
    let (round, ticks) = (from.number()?, from.number()?);
    let check = RunCheck { round, ticks, canary: u64::from_le_bytes(from.array()?) };
    from.is_empty().then_some(RecordedEnd { status, check })
}

impl Recorded {
    /// Reads the bytes of a file, which may be the journal of a durable run.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn read(bytes: &[u8]) -> Result<Recorded, RecordedError> {
        Ok(RunJournal::read(bytes)?.recorded)
    }

    /// Returns the last check of the records.
    pub fn last_check(&self) -> Option<RunCheck> {
        self.records.iter().rev().find_map(|noted| match noted.record {
            esl_host::Record::Checked(check) => Some(check),
            _ => None,
        })
    }
}

/// Returns whether an identity is that of this machine and its library.
pub(super) fn is_own(identity: &str) -> bool {
    identity == ExecutionIdentity::current().to_string()
}
