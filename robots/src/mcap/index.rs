//! The index of a file: its channels, the sections that hold its messages, and the records beside them.
//!
//! The index is that of the file's summary if that is whole, and otherwise one that `scan` makes.

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::sync::Arc;

use esl_bytecode::Bytes;
use mcap::records::{ChunkIndex, Record, Statistics, op};

use super::damage::Damage;
use super::record::{self, InnerRecords, MAX_SIZE, PREFIX, RecordSource};

/// First and last bytes of a file.
pub(super) const MAGIC: &[u8] = mcap::MAGIC;

/// Bytes of a footer's contents.
const FOOTER: u64 = 20;

/// The description of messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct McapSchema {
    /// Its number in the file.
    pub id: u16,
    /// Its name, such as `sensor_msgs/msg/LaserScan`.
    pub name: String,
    /// Its form: `ros2msg`, `jsonschema` and others.
    pub encoding: String,
    /// Its text.
    pub data: Bytes,
}

/// A channel: messages of one kind under one topic.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct McapChannel {
    /// Its number in the file.
    pub id: u16,
    /// Its topic.
    pub topic: String,
    /// The form of its messages: `cdr`, `json` and others.
    pub encoding: String,
    /// Further names and values.
    pub metadata: BTreeMap<String, String>,
    /// Number of its schema; 0 for none.
    pub schema_id: u16,
    /// Its schema.
    pub schema: Option<Arc<McapSchema>>,
}

/// Bytes of a file that hold messages: a chunk, or records outside of chunks.
#[derive(Clone, Debug)]
pub(super) struct FileSection {
    pub(super) is_chunk: bool,
    /// Place of the first record.
    pub(super) place: u64,
    /// Place behind the last one.
    pub(super) end: u64,
    /// Earliest and latest time of its messages.
    pub(super) times: (u64, u64),
    /// Numbers of its channels; empty if they are not known.
    pub(super) channels: Vec<u16>,
}

/// Sizes of the chunks of one compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ChunkSizes {
    /// Number of chunks.
    pub chunks: u64,
    /// Bytes in the file.
    pub compressed: u64,
    /// Bytes of the contents.
    pub uncompressed: u64,
}

/// A record beside the messages.
#[derive(Clone, Debug)]
pub struct NamedRecord {
    /// Its name.
    pub name: String,
    /// Media type of an attachment.
    pub media_type: String,
    /// Time of an attachment, in nanoseconds since 1970.
    pub time: u64,
    /// Bytes of an attachment.
    pub size: u64,
    pub(super) place: u64,
}

/// The index of a file.
#[derive(Clone, Debug, Default)]
pub(super) struct FileIndex {
    pub(super) profile: String,
    pub(super) library: String,
    pub(super) schemas: BTreeMap<u16, Arc<McapSchema>>,
    pub(super) channels: BTreeMap<u16, Arc<McapChannel>>,
    pub(super) sections: Vec<FileSection>,
    /// Messages of each channel.
    pub(super) counts: BTreeMap<u16, u64>,
    /// Earliest and latest time of a message.
    pub(super) times: Option<(u64, u64)>,
    pub(super) chunks: BTreeMap<String, ChunkSizes>,
    pub(super) attachments: Vec<NamedRecord>,
    pub(super) metadata: Vec<NamedRecord>,
    /// Whether the file has a summary.
    pub(super) is_indexed: bool,
    pub(super) damage: Vec<Damage>,
}

impl FileIndex {
    /// Adds a schema, unless there is one of its number.
    pub(super) fn add_schema(&mut self, schema: McapSchema) {
        self.schemas.entry(schema.id).or_insert_with(|| Arc::new(schema));
    }

    /// Adds a channel, unless there is one of its number. Its schema comes before it.
    pub(super) fn add_channel(&mut self, mut channel: McapChannel) {
        channel.schema = self.schemas.get(&channel.schema_id).cloned();
        self.channels.entry(channel.id).or_insert_with(|| Arc::new(channel));
    }

    /// Notes the time of a message.
    pub(super) fn note_time(&mut self, time: u64) {
        self.times = Some(widened(self.times, time));
    }

    pub(super) fn note_chunk(&mut self, compression: &str, compressed: u64, uncompressed: u64) {
        let sizes = self.chunks.entry(compression.to_owned()).or_default();
        sizes.chunks += 1;
        sizes.compressed = sizes.compressed.saturating_add(compressed);
        sizes.uncompressed = sizes.uncompressed.saturating_add(uncompressed);
    }
}

/// Returns times that contain another one.
pub(super) fn widened(times: Option<(u64, u64)>, time: u64) -> (u64, u64) {
    times.map_or((time, time), |(first, last)| (first.min(time), last.max(time)))
}

/// Returns the index that the summary of a file is; `None` if it has none, or it does not hold the places of
/// all messages.
pub(super) fn of_summary<R: Read + Seek>(source: &mut RecordSource<R>) -> std::io::Result<Option<FileIndex>> {
    let magic = MAGIC.len() as u64;
    let Some(footer) = source.length().checked_sub(magic + PREFIX + FOOTER).filter(|&place| place >= magic)
    else {
        return Ok(None);
    };
    let tail = source.bytes_at(footer, PREFIX + FOOTER + magic)?;
    let (record, end) = tail.split_at((PREFIX + FOOTER) as usize);
    let head = record.first_chunk().copied().map(record::RecordHead::of);
    if end != MAGIC || !head.is_some_and(|head| head.opcode == op::FOOTER && head.length == FOOTER) {
        return Ok(None);
    }
    let Some(Record::Footer(parsed)) = record::parse(op::FOOTER, &record[PREFIX as usize..]) else {
        return Ok(None);
    };
    let start = parsed.summary_start;
    let size = footer.checked_sub(start).filter(|size| start >= magic && (1..=MAX_SIZE).contains(size));
    let Some(size) = size else { return Ok(None) };
    let summary = source.bytes_at(start, size)?;
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&summary);
    // The checksum covers the footer up to itself.
    hasher.update(&record[..record.len() - 4]);
    if parsed.summary_crc != 0 && hasher.finalize() != parsed.summary_crc {
        return Ok(None);
    }
    let mut index = FileIndex { is_indexed: true, ..FileIndex::default() };
    if !add_header(&mut index, source)? {
        return Ok(None);
    }
    let (mut statistics, mut chunks) = (None, Vec::new());
    for record in InnerRecords::new(&summary) {
        let Ok(record) = record else { return Ok(None) };
        let body = &summary[record.start..record.end];
        let is_known = match record.opcode {
            op::SCHEMA => record::schema(body).map(|schema| index.add_schema(schema)).is_some(),
            op::CHANNEL => record::channel(body).map(|channel| index.add_channel(channel)).is_some(),
            _ => {
                let parsed = record::parse(record.opcode, body);
                let is_known = parsed.is_some();
                match parsed {
                    Some(Record::Statistics(found)) => statistics = Some(found),
                    Some(Record::ChunkIndex(chunk)) => chunks.push(chunk),
                    Some(Record::AttachmentIndex(found)) => index.attachments.push(NamedRecord {
                        name: found.name,
                        media_type: found.media_type,
                        time: found.log_time,
                        size: found.data_size,
                        place: found.offset,
                    }),
                    Some(Record::MetadataIndex(found)) => index.metadata.push(NamedRecord {
                        name: found.name,
                        media_type: String::new(),
                        time: 0,
                        size: 0,
                        place: found.offset,
                    }),
                    _ => {}
                }
                is_known
            }
        };
        if !is_known {
            return Ok(None);
        }
    }
    let is_whole = statistics.is_some_and(|statistics| add_sections(&mut index, statistics, &chunks, start));
    Ok(is_whole.then_some(index))
}

/// Adds the header of a file to its index. Returns whether there is one.
pub(super) fn add_header<R: Read + Seek>(
    index: &mut FileIndex,
    source: &mut RecordSource<R>,
) -> std::io::Result<bool> {
    let place = MAGIC.len() as u64;
    let Some(head) = source.head_at(place)? else { return Ok(false) };
    if head.opcode != op::HEADER || head.length > MAX_SIZE {
        return Ok(false);
    }
    let body = source.bytes_at(place + PREFIX, head.length)?;
    let Some(Record::Header(header)) = record::parse(op::HEADER, &body) else { return Ok(false) };
    (index.profile, index.library) = (header.profile, header.library);
    Ok(true)
}

/// Adds the sections that a summary names. Returns whether they are all that the file has.
fn add_sections(index: &mut FileIndex, statistics: Statistics, chunks: &[ChunkIndex], end: u64) -> bool {
    let is_inside = |chunk: &ChunkIndex| {
        chunk.chunk_start_offset.checked_add(chunk.chunk_length).is_some_and(|behind| behind <= end)
            && chunk.chunk_length > PREFIX
    };
    let counted: u64 = statistics.channel_message_counts.values().fold(0, |sum, n| sum.saturating_add(*n));
    let are_known = statistics.channel_message_counts.keys().all(|id| index.channels.contains_key(id));
    if chunks.len() != statistics.chunk_count as usize
        || chunks.is_empty() && statistics.message_count > 0
        || counted != statistics.message_count
        || index.channels.len() != statistics.channel_count as usize
        || !are_known
        || !chunks.iter().all(is_inside)
        || index.attachments.len() != statistics.attachment_count as usize
        || index.metadata.len() != statistics.metadata_count as usize
    {
        return false;
    }
    for chunk in chunks {
        index.note_chunk(&chunk.compression, chunk.compressed_size, chunk.uncompressed_size);
        index.sections.push(FileSection {
            is_chunk: true,
            place: chunk.chunk_start_offset,
            end: chunk.chunk_start_offset + chunk.chunk_length,
            times: (chunk.message_start_time, chunk.message_end_time),
            channels: chunk.message_index_offsets.keys().copied().collect(),
        });
    }
    if statistics.message_count > 0 {
        index.times = Some((statistics.message_start_time, statistics.message_end_time));
    }
    index.counts = statistics.channel_message_counts;
    true
}
