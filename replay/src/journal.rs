//! The journal of a durable run: a recording that several processes write, one after the other.
//!
//! It is a file as `file` describes it, with frames of six further kinds:
//!
//! ```text
//! 5 life                 a process begins to write, or pauses the run: mark, and the fields of `JournalLife`
//! 6 marked records       mark, and the records
//! 7 the same, compressed by lz4: mark, length of the records, compressed records
//! 8 upgrade              mark, the program that the run has from here on, and records
//! 9 generation           mark, and where the journal begins, if not with its run (`generation`)
//! 10 saved               mark, the number of an operation, and the bytes that it has saved last
//! ```
//!
//! The records of an upgrade have the call that makes the definitions of its program. Both are in one frame,
//! so a kill leaves both or neither.
//!
//! The mark of a frame is the length of the part of the file that was safe when the frame was written:
//! passed to the kernel, for a run that survives its process, or synced, for one that survives loss of power.
//!
//! A process that is killed leaves a frame that is cut off. A loss of power leaves sectors without the data
//! written to them since the last sync, in any order. A bad frame is a torn tail if the file ends in it, or
//! if one of its sectors is zero, and no whole frame behind it has a mark beyond it; a torn tail is cut. Any
//! other bad frame means that the file was changed, and it is refused.

use std::collections::BTreeMap;
use std::sync::Arc;

use esl_host::NotedRecord;

use super::file::{
    Beginning, COMPRESSED_ABOVE, FORMAT, FRAME, MAGIC, Recorded, RecordedEnd, RecordedError, RunStart,
    beginning_bytes, decompress, end_bytes, frame, is_own, kind, read_beginning, read_end,
};
use super::generation::JournalGeneration;
use super::pack::{ByteReader, ByteWriter};
use super::records::{self, Before};

/// Bytes of a sector, which a disk writes as a whole.
const SECTOR: usize = 512;

/// A process begins to write the journal, or pauses the run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JournalLife {
    /// Number of the process, from 1 on.
    pub number: u64,
    /// Whether it has paused the run here.
    pub is_pause: bool,
    /// Whether the pause is a sleep, of which the program is not told: it had no ties to the process.
    pub is_asleep: bool,
    /// Time of day, in nanoseconds since 1970.
    pub wall: i64,
    /// Time of the program's clock.
    pub time: u64,
    /// A random number, by which the effects of this process are told from those of others.
    pub chance: u64,
}

/// Records on their way to a file.
#[derive(Debug, Default)]
pub struct JournalWriter {
    packed: ByteWriter,
    before: Before,
}

impl JournalWriter {
    /// Adds a record, and returns the number of bytes that wait.
    pub fn add(&mut self, noted: &NotedRecord) -> usize {
        records::write(&mut self.packed, noted, &mut self.before);
        self.packed.0.len()
    }

    /// Returns whether no record waits.
    pub fn is_empty(&self) -> bool {
        self.packed.0.is_empty()
    }

    /// Takes the records that wait as a frame with this mark; nothing if none waits.
    pub fn take(&mut self, mark: u64) -> Vec<u8> {
        self.take_as(Some(mark))
    }

    /// Takes the records that wait as the frame of an upgrade to a program, given as in an `.eslb` file.
    pub fn take_upgrade(&mut self, mark: u64, program: &[u8]) -> Vec<u8> {
        let mut out = ByteWriter::default();
        out.number(mark);
        out.bytes(program);
        out.0.append(&mut self.packed.0);
        let mut bytes = Vec::new();
        frame(&mut bytes, kind::UPGRADE, &out.0);
        bytes
    }

    /// Returns the first bytes of a journal that goes on here, with this beginning. No record waits. The
    /// generation gets the base of the differences that the next records state.
    pub fn begin_generation(&self, beginning: &Beginning, generation: JournalGeneration) -> Vec<u8> {
        debug_assert!(self.is_empty(), "the records before belong to the journal before");
        let mut bytes = beginning_bytes(beginning);
        let mark = bytes.len() as u64;
        bytes.extend(JournalGeneration { before: self.before, ..generation }.to_frame(mark));
        bytes
    }

    /// Takes the records that wait as a frame of a recording that one process writes.
    pub(super) fn take_unmarked(&mut self) -> Vec<u8> {
        self.take_as(None)
    }

    fn take_as(&mut self, mark: Option<u64>) -> Vec<u8> {
        let content = &mut self.packed.0;
        let mut bytes = Vec::new();
        if content.is_empty() {
            return bytes;
        }
        let mut out = ByteWriter::default();
        if let Some(mark) = mark {
            out.number(mark);
        }
        if content.len() > COMPRESSED_ABOVE {
            out.number(content.len() as u64);
            out.0.extend_from_slice(&lz4_flex::block::compress(content));
            let kind = if mark.is_some() { kind::MARKED_COMPRESSED } else { kind::COMPRESSED };
            frame(&mut bytes, kind, &out.0);
        } else {
            bytes.reserve(FRAME + out.0.len() + content.len());
            let kind = if mark.is_some() { kind::MARKED } else { kind::RECORDS };
            out.0.extend_from_slice(content);
            frame(&mut bytes, kind, &out.0);
        }
        // Its room stays, for the next.
        content.clear();
        bytes
    }
}

/// Returns the first bytes of a journal.
pub fn journal_beginning(beginning: &Beginning) -> Vec<u8> {
    beginning_bytes(beginning)
}

/// Returns the frame that says that a process begins, or pauses.
pub fn journal_life(life: &JournalLife, mark: u64) -> Vec<u8> {
    let mut out = ByteWriter::default();
    out.number(mark);
    write_life_fields(&mut out, life);
    let mut bytes = Vec::new();
    frame(&mut bytes, kind::LIFE, &out.0);
    bytes
}

/// Returns the last frame of a journal.
pub fn journal_end(end: &RecordedEnd) -> Vec<u8> {
    end_bytes(end)
}

/// Returns the frame that says that an operation has saved these bytes.
pub fn journal_saved(operation: u64, state: &[u8], mark: u64) -> Vec<u8> {
    let mut out = ByteWriter::default();
    out.number(mark);
    out.number(operation);
    out.bytes(state);
    let mut bytes = Vec::new();
    frame(&mut bytes, kind::SAVED, &out.0);
    bytes
}

pub(super) fn write_life_fields(out: &mut ByteWriter, life: &JournalLife) {
    out.number(life.number);
    out.byte(u8::from(life.is_pause) + u8::from(life.is_asleep));
    out.signed(life.wall);
    out.number(life.time);
    out.0.extend_from_slice(&life.chance.to_le_bytes());
}

pub(super) fn read_life_fields(from: &mut ByteReader<'_>) -> Option<JournalLife> {
    let number = from.number()?;
    let (is_pause, is_asleep) = match from.byte()? {
        0 => (false, false),
        1 => (true, false),
        2 => (true, true),
        _ => return None,
    };
    Some(JournalLife {
        number,
        is_pause,
        is_asleep,
        wall: from.signed()?,
        time: from.number()?,
        chance: u64::from_le_bytes(from.array()?),
    })
}

fn read_life(from: &mut ByteReader<'_>) -> Option<JournalLife> {
    read_life_fields(from).filter(|_| from.is_empty())
}

/// The contents at some place of a file.
enum FoundFrame<'a> {
    Frame(u8, &'a [u8]),
    /// A frame whose write was interrupted.
    Torn,
    Wrong(&'static str),
}

/// Returns the kind and the content of the frame at the beginning of `bytes`, if a whole one is there.
fn whole_frame(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let (head, rest) = bytes.split_first_chunk::<FRAME>()?;
    let content = rest.get(..content_length(head))?;
    (is_head(head) && crc32fast::hash(content) == word(head, 4)).then_some((head[8], content))
}

fn word(head: &[u8; FRAME], at: usize) -> u32 {
    u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]])
}

fn content_length(head: &[u8; FRAME]) -> usize {
    word(head, 0) as usize
}

fn is_head(head: &[u8; FRAME]) -> bool {
    crc32fast::hash(&head[..9]) as u16 == u16::from_le_bytes([head[9], head[10]])
}

/// Looks for a frame at `offset`.
fn find(bytes: &[u8], offset: usize) -> FoundFrame<'_> {
    // A system that crashes may leave zeros where nothing was written.
    let is_unwritten = |bytes: &[u8]| bytes.iter().all(|&byte| byte == 0);
    let bytes = &bytes[offset..];
    if let Some((kind, content)) = whole_frame(bytes) {
        return FoundFrame::Frame(kind, content);
    }
    let Some((head, rest)) = bytes.split_first_chunk::<FRAME>() else { return FoundFrame::Torn };
    if !is_head(head) {
        return if is_unwritten(bytes) {
            FoundFrame::Torn
        } else {
            FoundFrame::Wrong("no frame begins here")
        };
    }
    match rest.get(content_length(head)..) {
        None => FoundFrame::Torn,
        Some(rest) if is_unwritten(rest) => FoundFrame::Torn,
        Some(_) => FoundFrame::Wrong("the content has another checksum"),
    }
}

/// Returns whether a bad frame is a torn tail, so that no effect depended on it or on the frames behind it.
fn is_torn(bytes: &[u8], offset: usize) -> bool {
    let head = bytes[offset..].first_chunk::<FRAME>();
    let has_length = head.filter(|head| is_head(head)).map(content_length);
    let end = offset.saturating_add(has_length.map_or(FRAME, |length| FRAME.saturating_add(length)));
    let is_cut_off = end > bytes.len();
    let is_unwritten = || {
        let mut starts = (offset / SECTOR..=(end - 1) / SECTOR).map(|sector| sector * SECTOR);
        starts.any(|start| {
            let part = &bytes[start.max(offset)..(start + SECTOR).min(end)];
            part.iter().all(|&byte| byte == 0)
        })
    };
    (is_cut_off || is_unwritten()) && !has_frame_beyond(bytes, offset)
}

/// Returns whether a whole frame behind `offset` was written when everything there was safe.
fn has_frame_beyond(bytes: &[u8], offset: usize) -> bool {
    (offset + 1..bytes.len()).any(|at| {
        whole_frame(&bytes[at..]).is_some_and(|(kind, content)| {
            !has_mark(kind) || ByteReader(content).number().is_some_and(|mark| mark > offset as u64)
        })
    })
}

/// Returns whether frames of a kind begin with a mark.
fn has_mark(kind: u8) -> bool {
    use kind::{GENERATION, LIFE, MARKED, MARKED_COMPRESSED, SAVED, UPGRADE};
    matches!(kind, LIFE | MARKED | MARKED_COMPRESSED | UPGRADE | GENERATION | SAVED)
}

/// A program that a run was upgraded to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JournalUpgrade {
    /// Number of records before it.
    pub records: usize,
    /// Number of the process that has made it.
    pub life: u64,
    /// Bytes of the program, as in an `.eslb` file.
    pub program: Vec<u8>,
}

/// The journal of a durable run, as it was found.
#[derive(Debug)]
pub struct RunJournal {
    /// The run so far.
    pub recorded: Recorded,
    /// The processes that have written it, and their pauses.
    pub lives: Vec<JournalLife>,
    /// The programs that the run has been upgraded to.
    pub upgrades: Vec<JournalUpgrade>,
    /// The states that operations have saved last, by their numbers. Some of these may be over.
    pub saved: BTreeMap<u64, Vec<u8>>,
    /// Bytes of the file that are good: all but a torn tail.
    pub length: usize,
    /// Time of the program's clock at the last record that has one.
    pub time: u64,
    /// Number of the generation that ends it.
    pub generation: u64,
    /// Writes the records that follow.
    pub writer: JournalWriter,
}

impl RunJournal {
    /// Reads the bytes of a file.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn read(bytes: &[u8]) -> Result<RunJournal, RecordedError> {
        let (reading, length) = read_frames(bytes, u64::MAX)?;
        let JournalReading { beginning, records, lives, upgrades, saved, end, before, generation, .. } =
            reading;
        let number = generation.as_ref().map_or(0, |generation| generation.number);
        let start = generation.map(|generation| Arc::new(RunStart { generation, snapshot: None }));
        let beginning = beginning.ok_or(RecordedError::NoBeginning)?;
        let torn = bytes.len() - length;
        Ok(RunJournal {
            recorded: Recorded { beginning, records: records.into(), end, torn, start },
            lives,
            upgrades,
            saved,
            length,
            time: before.time(),
            generation: number,
            writer: JournalWriter { packed: ByteWriter::default(), before },
        })
    }

    /// Returns the length of the part of a file that was there when the program's clock showed `time`, as far
    /// as its frames tell.
    ///
    /// # Errors
    /// [`RecordedError`].
    pub fn length_until(bytes: &[u8], time: u64) -> Result<usize, RecordedError> {
        read_frames(bytes, time).map(|(_, length)| length)
    }
}

/// Reads the frames of a file up to the first one that goes beyond `time`. Returns their contents, with those
/// of that frame, and their length without it.
fn read_frames(bytes: &[u8], time: u64) -> Result<(JournalReading, usize), RecordedError> {
    let Some(rest) = bytes.strip_prefix(&MAGIC) else {
        let is_torn = MAGIC.starts_with(bytes) || bytes.iter().all(|&byte| byte == 0);
        return Err(if is_torn { RecordedError::NoBeginning } else { RecordedError::NotOne });
    };
    let (version, _) = rest.split_first_chunk::<4>().ok_or(RecordedError::NoBeginning)?;
    let version = u32::from_le_bytes(*version);
    if version != FORMAT {
        return Err(RecordedError::Format(version));
    }
    let mut reading = JournalReading::default();
    let mut offset = MAGIC.len() + 4;
    while offset < bytes.len() {
        match find(bytes, offset) {
            FoundFrame::Frame(kind, content) => {
                reading.take(offset, kind, content)?;
                if reading.time() > time {
                    break;
                }
                offset += FRAME + content.len();
            }
            FoundFrame::Torn if reading.lives.is_empty() => break,
            FoundFrame::Wrong(problem) if reading.lives.is_empty() => {
                return Err(RecordedError::Damaged { offset, problem });
            }
            _ if is_torn(bytes, offset) => break,
            FoundFrame::Torn => {
                let problem = "a part of it is missing, though later parts are there, as after a loss of power \
                                   without `--durability power`";
                return Err(RecordedError::Damaged { offset, problem });
            }
            FoundFrame::Wrong(problem) => return Err(RecordedError::Damaged { offset, problem }),
        }
    }
    Ok((reading, offset))
}

impl RunJournal {
    /// Goes on with the journal of the next generation, whose beginning is the end of this one. Returns
    /// whether it is; if not, nothing changes.
    #[must_use]
    pub fn append(&mut self, next: RunJournal) -> bool {
        let Some(start) = next.recorded.start.as_deref() else { return false };
        let is_next = start.generation.number == self.generation + 1
            && start.generation.before == self.writer.before
            && self.recorded.end.is_none()
            && self.recorded.torn == 0;
        if !is_next {
            return false;
        }
        let offset = self.recorded.records.len();
        let records = self.recorded.records.iter().chain(next.recorded.records.iter());
        self.recorded.records = records.cloned().collect();
        (self.recorded.end, self.recorded.torn) = (next.recorded.end, next.recorded.torn);
        // The first one repeats the last one of this journal.
        self.lives.extend(next.lives.into_iter().skip(1));
        let upgrades = next.upgrades.into_iter();
        self.upgrades
            .extend(upgrades.map(|upgrade| JournalUpgrade { records: upgrade.records + offset, ..upgrade }));
        // Its beginning repeats the states that were saved before.
        (self.saved, self.generation) = (next.saved, next.generation);
        (self.length, self.time, self.writer) = (next.length, next.time, next.writer);
        true
    }
}

/// The contents of the frames that were read.
struct JournalReading {
    beginning: Option<Beginning>,
    records: Vec<NotedRecord>,
    lives: Vec<JournalLife>,
    upgrades: Vec<JournalUpgrade>,
    saved: BTreeMap<u64, Vec<u8>>,
    end: Option<RecordedEnd>,
    before: Before,
    generation: Option<JournalGeneration>,
    /// Whether this version of the machine has written the file. Another version may write other frames.
    is_ours: bool,
}

impl Default for JournalReading {
    fn default() -> JournalReading {
        let (beginning, records, lives, upgrades) = (None, Vec::new(), Vec::new(), Vec::new());
        let (saved, before) = (BTreeMap::new(), Before::default());
        let (end, generation) = (None, None);
        JournalReading { beginning, records, lives, upgrades, saved, end, before, generation, is_ours: true }
    }
}

impl JournalReading {
    /// Returns the time of the program's clock at the last record or process.
    fn time(&self) -> u64 {
        self.before.time().max(self.lives.last().map_or(0, |life| life.time))
    }

    /// Takes the frame at `offset`.
    fn take(&mut self, offset: usize, kind: u8, content: &[u8]) -> Result<(), RecordedError> {
        let damaged = |problem| RecordedError::Damaged { offset, problem };
        if self.end.is_some() || self.beginning.is_some() == (kind == kind::HEADER) {
            return Err(damaged("this frame does not belong here"));
        }
        if kind == kind::HEADER {
            self.is_ours = ByteReader(content).text().is_none_or(is_own);
        }
        let is_ours = self.is_ours;
        let strange = |problem| if is_ours { damaged(problem) } else { RecordedError::OtherMachine };
        let malformed = || strange("the content is not of its kind");
        let mut from = ByteReader(content);
        if has_mark(kind) {
            from.number().filter(|&mark| mark <= offset as u64).ok_or_else(malformed)?;
        }
        match kind {
            kind::HEADER => self.beginning = Some(read_beginning(content).ok_or_else(malformed)?),
            kind::RECORDS | kind::MARKED => self.add(from).ok_or_else(malformed)?,
            kind::COMPRESSED | kind::MARKED_COMPRESSED => {
                let length = from.number().and_then(|length| usize::try_from(length).ok());
                let content = length.and_then(|length| decompress(from.0, length)).ok_or_else(malformed)?;
                self.add(ByteReader(&content)).ok_or_else(malformed)?;
            }
            kind::LIFE => self.lives.push(read_life(&mut from).ok_or_else(malformed)?),
            kind::UPGRADE => {
                let program = from.bytes().ok_or_else(malformed)?.to_vec();
                let (records, life) = (self.records.len(), self.lives.last().map_or(0, |life| life.number));
                self.upgrades.push(JournalUpgrade { records, life, program });
                self.add(from).ok_or_else(malformed)?;
            }
            kind::GENERATION => {
                let generation = JournalGeneration::read(&mut from).ok_or_else(malformed)?;
                if self.generation.is_some() || !self.records.is_empty() || !self.lives.is_empty() {
                    return Err(damaged("this frame does not belong here"));
                }
                self.before = generation.before;
                self.lives.push(generation.life);
                self.saved = generation.saved.iter().cloned().collect();
                self.generation = Some(generation);
            }
            kind::SAVED => {
                let operation = from.number().ok_or_else(malformed)?;
                let state = from.bytes().filter(|_| from.is_empty()).ok_or_else(malformed)?;
                self.saved.insert(operation, state.to_vec());
            }
            kind::END => self.end = Some(read_end(content).ok_or_else(malformed)?),
            _ => return Err(strange("a frame of an unknown kind")),
        }
        Ok(())
    }

    /// Adds records.
    fn add(&mut self, mut from: ByteReader<'_>) -> Option<()> {
        while !from.is_empty() {
            self.records.push(records::read(&mut from, &mut self.before)?);
        }
        Some(())
    }
}
