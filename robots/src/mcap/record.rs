//! Records of a file: their places and sizes, and the contents of chunks.
//!
//! Guarantees: no bytes make a function here panic, nor take more memory than [`MAX_SIZE`] and a multiple of
//! what is in the file. Source: the specification of MCAP, version 0.

use std::io::{Read, Seek, SeekFrom};

use esl_bytecode::Bytes;
use mcap::records::{ChunkHeader, MessageHeader, Record, op};

use super::damage::DamageKind;
use super::index::{McapChannel, McapSchema};

/// Greatest number of bytes of a chunk's contents, of a message, and of every other record that is read as a
/// whole.
pub(super) const MAX_SIZE: u64 = 1 << 28;

/// Bytes before the contents of a record: its kind and its length.
pub(super) const PREFIX: u64 = 9;

/// Bytes of a message's record before its payload.
pub(super) const MESSAGE_HEADER: usize = 22;

/// Bytes of a chunk's record without its contents and the name of the compression.
const CHUNK_HEADER: u64 = 40;

/// Kind and length of a record.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordHead {
    pub(super) opcode: u8,
    pub(super) length: u64,
}

impl RecordHead {
    pub(super) fn of(bytes: [u8; PREFIX as usize]) -> RecordHead {
        let [opcode, length @ ..] = bytes;
        RecordHead { opcode, length: u64::from_le_bytes(length) }
    }

    /// Returns the name of the kind.
    pub(super) fn name(self) -> &'static str {
        match self.opcode {
            op::HEADER => "header",
            op::FOOTER => "footer",
            op::SCHEMA => "schema",
            op::CHANNEL => "channel",
            op::MESSAGE => "message",
            op::CHUNK => "chunk",
            op::MESSAGE_INDEX => "index of a chunk",
            op::ATTACHMENT => "attachment",
            op::METADATA => "metadata",
            op::DATA_END => "end of the data",
            _ => "record",
        }
    }
}

/// A place to read from, with its length.
pub(super) struct RecordSource<R> {
    inner: R,
    length: u64,
}

impl<R: Read + Seek> RecordSource<R> {
    pub(super) fn new(mut inner: R) -> std::io::Result<RecordSource<R>> {
        let length = inner.seek(SeekFrom::End(0))?;
        Ok(RecordSource { inner, length })
    }

    pub(super) fn length(&self) -> u64 {
        self.length
    }

    /// Fills a buffer with the bytes from a place on.
    pub(super) fn read_at(&mut self, place: u64, buffer: &mut [u8]) -> std::io::Result<()> {
        self.inner.seek(SeekFrom::Start(place))?;
        self.inner.read_exact(buffer)
    }

    /// Returns so many bytes from a place on, fewer at the end of the file.
    pub(super) fn bytes_at(&mut self, place: u64, length: u64) -> std::io::Result<Vec<u8>> {
        let length = length.min(self.length.saturating_sub(place));
        let mut bytes = vec![0; usize::try_from(length).unwrap_or(0)];
        self.read_at(place, &mut bytes)?;
        Ok(bytes)
    }

    /// Returns kind and length of the record at a place, unless the file ends before.
    pub(super) fn head_at(&mut self, place: u64) -> std::io::Result<Option<RecordHead>> {
        if self.length.saturating_sub(place) < PREFIX {
            return Ok(None);
        }
        let mut bytes = [0; PREFIX as usize];
        self.read_at(place, &mut bytes)?;
        Ok(Some(RecordHead::of(bytes)))
    }
}

/// Returns the record with these contents. A message, and the data of attachments, are not parsed here.
pub(super) fn parse(opcode: u8, body: &[u8]) -> Option<Record<'_>> {
    match opcode {
        // The parser takes the checksum behind an attachment for granted.
        op::ATTACHMENT if body.len() < 40 => None,
        _ => mcap::parse_record(opcode, body).ok(),
    }
}

/// Returns the schema with these contents; `None` if they are malformed. A schema has a number above 0.
pub(super) fn schema(body: &[u8]) -> Option<McapSchema> {
    match parse(op::SCHEMA, body)? {
        Record::Schema { header, data } if header.id != 0 => Some(McapSchema {
            id: header.id,
            name: header.name,
            encoding: header.encoding,
            data: Bytes::copy_from_slice(&data),
        }),
        _ => None,
    }
}

/// Returns the channel with these contents, without its schema.
pub(super) fn channel(body: &[u8]) -> Option<McapChannel> {
    match parse(op::CHANNEL, body)? {
        Record::Channel(channel) => Some(McapChannel {
            id: channel.id,
            topic: channel.topic,
            encoding: channel.message_encoding,
            metadata: channel.metadata,
            schema_id: channel.schema_id,
            schema: None,
        }),
        _ => None,
    }
}

/// Returns the numbers before the payload of a message; `None` if its record is too short.
pub(super) fn message_header(body: &[u8]) -> Option<MessageHeader> {
    let body = body.first_chunk::<MESSAGE_HEADER>()?;
    let (channel, rest) = body.split_first_chunk::<2>()?;
    let (sequence, rest) = rest.split_first_chunk::<4>()?;
    let (log_time, publish_time) = rest.split_first_chunk::<8>()?;
    Some(MessageHeader {
        channel_id: u16::from_le_bytes(*channel),
        sequence: u32::from_le_bytes(*sequence),
        log_time: u64::from_le_bytes(*log_time),
        publish_time: u64::from_le_bytes(*publish_time.first_chunk()?),
    })
}

/// Returns the header of a chunk, and the place of its data within the record; `None` if it is malformed, or
/// its data are not `length` bytes with it. `beginning` are at least the first bytes of the record.
pub(super) fn chunk_header(beginning: &[u8], length: u64) -> Option<(ChunkHeader, u64)> {
    let number = |place: usize| -> Option<u64> {
        beginning.get(place..)?.first_chunk().copied().map(u64::from_le_bytes)
    };
    let short = |place: usize| -> Option<u32> {
        beginning.get(place..)?.first_chunk().copied().map(u32::from_le_bytes)
    };
    let name_length = short(28)? as usize;
    // No compression has a longer name.
    let name = beginning.get(32..32 + name_length.min(64)).filter(|name| name.len() == name_length)?;
    let header = ChunkHeader {
        message_start_time: number(0)?,
        message_end_time: number(8)?,
        uncompressed_size: number(16)?,
        uncompressed_crc: short(24)?,
        compression: std::str::from_utf8(name).ok()?.to_owned(),
        compressed_size: number(32 + name_length)?,
    };
    let data = CHUNK_HEADER + name_length as u64;
    (data.checked_add(header.compressed_size)? == length).then_some((header, data))
}

/// Bytes of a record that contain the header of a chunk for certain.
pub(super) const CHUNK_BEGINNING: u64 = CHUNK_HEADER + 64;

/// Returns the contents of a chunk.
pub(super) fn decompress(header: &ChunkHeader, data: &[u8]) -> Result<Vec<u8>, DamageKind> {
    let size = header.uncompressed_size;
    if size > MAX_SIZE {
        return Err(DamageKind::TooLarge { size, limit: MAX_SIZE });
    }
    let failed = |error: std::io::Error| DamageKind::Compression(error.to_string());
    // A liar's chunk takes no memory before its data do.
    let mut contents = Vec::with_capacity(usize::try_from(size.min(64 * data.len() as u64)).unwrap_or(0));
    match header.compression.as_str() {
        "" => contents.extend_from_slice(data),
        "zstd" => {
            let decoder = zstd::stream::read::Decoder::new(data).map_err(failed)?;
            decoder.take(size + 1).read_to_end(&mut contents).map_err(failed)?;
        }
        "lz4" => {
            let decoder = lz4::Decoder::new(data).map_err(failed)?;
            decoder.take(size + 1).read_to_end(&mut contents).map_err(failed)?;
        }
        other => {
            return Err(DamageKind::Compression(format!("unknown compression `{}`", other.escape_debug())));
        }
    }
    let computed = crc32fast::hash(&contents);
    if header.uncompressed_crc != 0 && computed != header.uncompressed_crc {
        return Err(DamageKind::Checksum { stated: header.uncompressed_crc, computed });
    }
    if contents.len() as u64 != size {
        return Err(DamageKind::Compression(format!("not the stated {size} bytes")));
    }
    Ok(contents)
}

/// A record within the contents of a chunk.
#[derive(Clone, Copy, Debug)]
pub(super) struct InnerRecord {
    pub(super) opcode: u8,
    /// Place of its body.
    pub(super) start: usize,
    pub(super) end: usize,
}

/// The records within the contents of a chunk. The last item is `Err` if they end within a record.
pub(super) struct InnerRecords<'a> {
    bytes: &'a [u8],
    place: usize,
}

impl<'a> InnerRecords<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> InnerRecords<'a> {
        InnerRecords { bytes, place: 0 }
    }
}

impl Iterator for InnerRecords<'_> {
    type Item = Result<InnerRecord, DamageKind>;

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.bytes.get(self.place..).filter(|rest| !rest.is_empty())?;
        let cut = |record, needed| {
            let left = rest.len() as u64;
            Some(Err(DamageKind::CutOff { record, left, needed }))
        };
        let Some(head) = rest.first_chunk().copied().map(RecordHead::of) else {
            self.place = self.bytes.len();
            return cut("record", PREFIX);
        };
        let start = self.place + PREFIX as usize;
        let end = usize::try_from(head.length).ok().and_then(|length| start.checked_add(length));
        let Some(end) = end.filter(|&end| end <= self.bytes.len()) else {
            self.place = self.bytes.len();
            return cut(head.name(), head.length.saturating_add(PREFIX));
        };
        self.place = end;
        Some(Ok(InnerRecord { opcode: head.opcode, start, end }))
    }
}
