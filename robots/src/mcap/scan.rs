//! The index of a file without a summary, or with a broken one: it is read from its beginning to its end.
//!
//! Guarantees: a chunk or a record that cannot be read ends nothing but itself. Behind bytes that are not a
//! record, the scan goes on with the next chunk or message. Each part that is passed over is noted as damage.

use std::io::{Read, Seek};

use mcap::records::{Record, op};

use super::damage::{Damage, DamageKind};
use super::index::{FileIndex, FileSection, MAGIC, NamedRecord, add_header, widened};
use super::record::{
    self, CHUNK_BEGINNING, InnerRecords, MAX_SIZE, MESSAGE_HEADER, PREFIX, RecordHead, RecordSource,
};

/// Bytes of messages outside of chunks that are one section.
const SECTION: u64 = 1 << 20;

/// Bytes of one step of a search for the next record.
const STEP: u64 = 1 << 20;

/// Damage that is noted one by one.
const MOST_DAMAGE: usize = 1000;

/// Returns whether records of this kind may be in a file: those of the specification, and private ones.
fn is_kind(opcode: u8) -> bool {
    matches!(opcode, 1..=op::DATA_END | 0x80..)
}

/// A scan in progress.
struct FileScan<'a, R> {
    source: &'a mut RecordSource<R>,
    index: FileIndex,
    /// Place of the next record.
    place: u64,
    /// The section of messages outside of chunks that is growing.
    loose: Option<FileSection>,
    /// The damage of the last chunk, whose indexes tell what is lost.
    broken: Option<usize>,
    is_over: bool,
}

/// Returns the index of a file that begins with its magic bytes.
pub(super) fn scan<R: Read + Seek>(source: &mut RecordSource<R>) -> std::io::Result<FileIndex> {
    let mut index = FileIndex::default();
    let place = MAGIC.len() as u64;
    _ = add_header(&mut index, source)?;
    let mut scan = FileScan { source, index, place, loose: None, broken: None, is_over: false };
    while !scan.is_over {
        scan.step()?;
    }
    scan.end_section();
    Ok(scan.index)
}

impl<R: Read + Seek> FileScan<'_, R> {
    fn note(&mut self, damage: Damage) {
        if self.index.damage.len() < MOST_DAMAGE {
            self.index.damage.push(damage);
        }
    }

    fn end_section(&mut self) {
        self.index.sections.extend(self.loose.take());
    }

    /// Takes in the record at the place.
    fn step(&mut self) -> std::io::Result<()> {
        let left = self.source.length() - self.place;
        let Some(head) = self.source.head_at(self.place)? else {
            self.note(Damage::new(self.place, DamageKind::Unfinished));
            self.is_over = true;
            return Ok(());
        };
        if head.opcode == op::DATA_END && head.length == 4 {
            self.is_over = true;
            return Ok(());
        }
        let is_plausible = is_kind(head.opcode) && head.length <= left - PREFIX;
        if !is_plausible {
            return self.resume(head, left);
        }
        self.take(head)?;
        self.place += PREFIX + head.length;
        Ok(())
    }

    /// Goes on behind bytes that are not a whole record.
    fn resume(&mut self, head: RecordHead, left: u64) -> std::io::Result<()> {
        self.end_section();
        self.broken = None;
        let begun = self.place;
        let is_chunk = head.opcode == op::CHUNK;
        let beginning = self.source.bytes_at(begun + PREFIX, CHUNK_BEGINNING)?;
        let is_cut = is_chunk && record::chunk_header(&beginning, head.length).is_some();
        let next = if is_cut { None } else { self.next_record(begun + 1)? };
        if let Some(next) = next {
            self.note(Damage::new(begun, DamageKind::Garbage { end: next }));
            self.place = next;
            return Ok(());
        }
        let kind = if is_kind(head.opcode) {
            let needed = head.length.saturating_add(PREFIX);
            DamageKind::CutOff { record: head.name(), left, needed }
        } else {
            DamageKind::Garbage { end: self.source.length() }
        };
        self.note(Damage { place: begun, is_chunk, kind, lost: None });
        self.is_over = true;
        Ok(())
    }

    /// Returns the place of the next chunk, or message, from a place on.
    fn next_record(&mut self, from: u64) -> std::io::Result<Option<u64>> {
        let mut place = from;
        while place < self.source.length() {
            let bytes = self.source.bytes_at(place, STEP + PREFIX + CHUNK_BEGINNING)?;
            let end = bytes.len().min(STEP as usize);
            for at in 0..end {
                let is_candidate = matches!(bytes[at], op::CHUNK | op::MESSAGE);
                if is_candidate && self.begins_at(place + at as u64, &bytes[at..])? {
                    return Ok(Some(place + at as u64));
                }
            }
            place += end as u64;
        }
        Ok(None)
    }

    /// Returns whether a chunk or a message begins with these bytes, at this place.
    fn begins_at(&mut self, place: u64, bytes: &[u8]) -> std::io::Result<bool> {
        let Some(head) = bytes.first_chunk().copied().map(RecordHead::of) else { return Ok(false) };
        let behind = place.checked_add(PREFIX).and_then(|start| start.checked_add(head.length));
        let Some(behind) = behind.filter(|&behind| behind <= self.source.length()) else { return Ok(false) };
        let body = &bytes[PREFIX as usize..];
        if head.opcode == op::CHUNK {
            let header = record::chunk_header(body, head.length);
            return Ok(header.is_some_and(|(header, _)| {
                matches!(header.compression.as_str(), "" | "lz4" | "zstd")
                    && header.message_start_time <= header.message_end_time
            }));
        }
        // Messages have no mark: one is believed if its channel is known, and a record follows.
        let Some(header) = record::message_header(body) else { return Ok(false) };
        if !self.index.channels.contains_key(&header.channel_id) || head.length > MAX_SIZE {
            return Ok(false);
        }
        let next = self.source.head_at(behind)?;
        let left = self.source.length() - behind;
        Ok(next.is_some_and(|next| (1..=op::DATA_END).contains(&next.opcode) && next.length <= left - PREFIX))
    }

    /// Takes in a record, which is whole.
    fn take(&mut self, head: RecordHead) -> std::io::Result<()> {
        match head.opcode {
            op::MESSAGE => return self.take_message(head),
            op::CHUNK => {
                self.end_section();
                return self.take_chunk(head);
            }
            op::MESSAGE_INDEX => {
                // Each entry has 16 bytes, behind the number of the channel and the size of all.
                let count = head.length.saturating_sub(6) / 16;
                if let Some(damage) = self.broken.and_then(|at| self.index.damage.get_mut(at)) {
                    damage.lost = Some(damage.lost.unwrap_or(0).saturating_add(count));
                }
                return Ok(());
            }
            op::ATTACHMENT | op::METADATA => self.take_named(head)?,
            op::SCHEMA | op::CHANNEL => {
                let is_taken = match head.length <= MAX_SIZE {
                    true => {
                        let body = self.source.bytes_at(self.place + PREFIX, head.length)?;
                        self.take_definition(head.opcode, &body)
                    }
                    false => false,
                };
                if !is_taken {
                    self.note(Damage::new(self.place, DamageKind::Malformed(head.name())));
                }
            }
            _ => {}
        }
        self.broken = None;
        Ok(())
    }

    /// Takes in a schema or a channel. Returns whether it is well-formed.
    fn take_definition(&mut self, opcode: u8, body: &[u8]) -> bool {
        if opcode == op::SCHEMA {
            return record::schema(body).map(|schema| self.index.add_schema(schema)).is_some();
        }
        record::channel(body).map(|channel| self.index.add_channel(channel)).is_some()
    }

    fn take_message(&mut self, head: RecordHead) -> std::io::Result<()> {
        let body = self.source.bytes_at(self.place + PREFIX, MESSAGE_HEADER as u64)?;
        let header = record::message_header(&body).filter(|_| head.length >= MESSAGE_HEADER as u64);
        let known = header.filter(|header| self.index.channels.contains_key(&header.channel_id));
        let Some(header) = known.filter(|_| head.length <= MAX_SIZE) else {
            self.end_section();
            let kind = match header {
                Some(_) if head.length > MAX_SIZE => {
                    DamageKind::TooLarge { size: head.length, limit: MAX_SIZE }
                }
                _ => DamageKind::Malformed("message"),
            };
            self.note(Damage { lost: Some(1), ..Damage::new(self.place, kind) });
            return Ok(());
        };
        let end = self.place + PREFIX + head.length;
        let time = header.log_time;
        match &mut self.loose {
            Some(section) if section.end == self.place && end - section.place <= SECTION => {
                section.end = end;
                section.times = widened(Some(section.times), time);
            }
            _ => {
                self.end_section();
                let (place, times, channels) = (self.place, (time, time), Vec::new());
                self.loose = Some(FileSection { is_chunk: false, place, end, times, channels });
            }
        }
        *self.index.counts.entry(header.channel_id).or_default() += 1;
        self.index.note_time(time);
        Ok(())
    }

    fn take_chunk(&mut self, head: RecordHead) -> std::io::Result<()> {
        self.broken = None;
        let place = self.place;
        let contents = match chunk_at(self.source, place, head)? {
            Ok((header, contents)) => {
                let (compressed, uncompressed) = (header.compressed_size, header.uncompressed_size);
                self.index.note_chunk(&header.compression, compressed, uncompressed);
                contents
            }
            Err(kind) => {
                self.broken = Some(self.index.damage.len());
                self.note(Damage::of_chunk(place, kind));
                return Ok(());
            }
        };
        let mut times = None;
        let mut channels = Vec::new();
        for record in InnerRecords::new(&contents) {
            let record = match record {
                Ok(record) => record,
                Err(kind) => {
                    self.note(Damage::of_chunk(place, kind));
                    break;
                }
            };
            let body = &contents[record.start..record.end];
            match record.opcode {
                op::SCHEMA | op::CHANNEL => _ = self.take_definition(record.opcode, body),
                op::MESSAGE => {
                    let Some(header) = record::message_header(body) else { continue };
                    if !self.index.channels.contains_key(&header.channel_id) {
                        continue;
                    }
                    times = Some(widened(times, header.log_time));
                    if channels.last() != Some(&header.channel_id) && !channels.contains(&header.channel_id) {
                        channels.push(header.channel_id);
                    }
                    *self.index.counts.entry(header.channel_id).or_default() += 1;
                    self.index.note_time(header.log_time);
                }
                _ => {}
            }
        }
        let end = place + PREFIX + head.length;
        let section = times.map(|times| FileSection { is_chunk: true, place, end, times, channels });
        self.index.sections.extend(section);
        Ok(())
    }

    /// Notes an attachment or a record of metadata.
    fn take_named(&mut self, head: RecordHead) -> std::io::Result<()> {
        // The data of an attachment stay where they are.
        let length =
            if head.opcode == op::METADATA { head.length.min(MAX_SIZE) } else { head.length.min(STEP) };
        let body = self.source.bytes_at(self.place + PREFIX, length)?;
        let named = match head.opcode {
            op::METADATA => match record::parse(op::METADATA, &body) {
                Some(Record::Metadata(found)) => {
                    self.index.metadata.push(NamedRecord {
                        name: found.name,
                        media_type: String::new(),
                        time: 0,
                        size: 0,
                        place: self.place,
                    });
                    Some(())
                }
                _ => None,
            },
            _ => attachment_head(&body, self.place).map(|found| self.index.attachments.push(found)),
        };
        if named.is_none() {
            self.note(Damage::new(self.place, DamageKind::Malformed(head.name())));
        }
        Ok(())
    }
}

/// Returns an attachment by the beginning of its record.
fn attachment_head(body: &[u8], place: u64) -> Option<NamedRecord> {
    fn number(rest: &mut &[u8]) -> Option<u64> {
        let (bytes, after) = rest.split_first_chunk::<8>()?;
        *rest = after;
        Some(u64::from_le_bytes(*bytes))
    }
    fn text(rest: &mut &[u8]) -> Option<String> {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let (bytes, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        *rest = after;
        String::from_utf8(bytes.to_vec()).ok()
    }
    let mut rest = body;
    let time = number(&mut rest)?;
    number(&mut rest)?;
    let (name, media_type) = (text(&mut rest)?, text(&mut rest)?);
    Some(NamedRecord { name, media_type, time, size: number(&mut rest)?, place })
}

/// Returns the header and the contents of the chunk at a place, or why it cannot be read.
pub(super) fn chunk_at<R: Read + Seek>(
    source: &mut RecordSource<R>,
    place: u64,
    head: RecordHead,
) -> std::io::Result<Result<(mcap::records::ChunkHeader, Vec<u8>), DamageKind>> {
    if head.length > MAX_SIZE {
        return Ok(Err(DamageKind::TooLarge { size: head.length, limit: MAX_SIZE }));
    }
    let record = source.bytes_at(place + PREFIX, head.length)?;
    let Some((header, data)) = record::chunk_header(&record, head.length) else {
        return Ok(Err(DamageKind::Malformed("header")));
    };
    let contents = record::decompress(&header, &record[data as usize..]);
    Ok(contents.map(|contents| (header, contents)))
}
