//! A file of MCAP: its index, and the messages of its sections.

use std::fmt;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;
use std::sync::Arc;

use esl_bytecode::Bytes;
use mcap::records::{MessageHeader, Record, op};

use super::damage::{Damage, DamageKind};
use super::index::{FileIndex, FileSection, MAGIC, McapChannel, of_summary};
use super::record::{self, InnerRecords, MAX_SIZE, MESSAGE_HEADER, PREFIX, RecordSource};
use super::scan::{chunk_at, scan};

/// Why a file is not read at all.
#[derive(Debug)]
pub enum McapFault {
    /// The system does not read it.
    System(std::io::Error),
    /// It is not a file of MCAP; the text says what it is.
    Other(String),
    /// Its messages are in such disorder that more than this many bytes would have to be kept.
    Disorder(u64),
}

impl fmt::Display for McapFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            McapFault::System(error) => error.fmt(f),
            McapFault::Other(text) => f.write_str(text),
            McapFault::Disorder(limit) => {
                write!(f, "chunks of more than {limit} bytes have messages of the same time: select topics")
            }
        }
    }
}

impl std::error::Error for McapFault {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            McapFault::System(error) => Some(error),
            McapFault::Other(_) | McapFault::Disorder(_) => None,
        }
    }
}

impl From<std::io::Error> for McapFault {
    fn from(error: std::io::Error) -> McapFault {
        McapFault::System(error)
    }
}

/// A message within the contents of a section.
#[derive(Clone, Copy, Debug)]
pub(super) struct MessagePlace {
    pub(super) header: MessageHeader,
    /// Its payload.
    pub(super) start: usize,
    pub(super) end: usize,
}

/// The contents of a section, and its messages in the order of writing.
pub(super) struct SectionContents {
    pub(super) bytes: Bytes,
    pub(super) messages: Vec<MessagePlace>,
}

/// A file of MCAP.
pub(super) struct McapFile<R> {
    source: RecordSource<R>,
    pub(super) index: FileIndex,
}

impl McapFile<BufReader<File>> {
    /// Opens the file at a path.
    pub(super) fn open(path: &Path) -> Result<Self, McapFault> {
        McapFile::of(BufReader::new(File::open(path)?))
    }
}

impl<R: Read + Seek> McapFile<R> {
    /// Returns the file that these bytes are.
    pub(super) fn of(bytes: R) -> Result<McapFile<R>, McapFault> {
        let mut source = RecordSource::new(bytes)?;
        let beginning = source.bytes_at(0, MAGIC.len() as u64)?;
        if beginning != MAGIC {
            return Err(McapFault::Other(what_it_is(&beginning)));
        }
        let index = match of_summary(&mut source)? {
            Some(index) => index,
            None => scan(&mut source)?,
        };
        Ok(McapFile { source, index })
    }

    /// Returns the contents of a section, and notes what is damaged. Channels that the summary left out are
    /// added to the index.
    pub(super) fn contents(&mut self, section: &FileSection) -> std::io::Result<SectionContents> {
        let bytes = match section.is_chunk {
            true => self.chunk(section)?,
            false => self.source.bytes_at(section.place, section.end - section.place)?,
        };
        let mut messages = Vec::new();
        for found in InnerRecords::new(&bytes) {
            let Ok(found) = found else {
                // A scan has noted this.
                if self.index.is_indexed {
                    self.index.damage.push(Damage::of_chunk(section.place, DamageKind::Malformed("chunk")));
                }
                break;
            };
            let body = &bytes[found.start..found.end];
            match found.opcode {
                op::SCHEMA => _ = record::schema(body).map(|schema| self.index.add_schema(schema)),
                op::CHANNEL => _ = record::channel(body).map(|channel| self.index.add_channel(channel)),
                op::MESSAGE => {
                    let Some(header) = record::message_header(body) else { continue };
                    let (start, end) = (found.start + MESSAGE_HEADER, found.end);
                    messages.push(MessagePlace { header, start, end });
                }
                _ => {}
            }
        }
        Ok(SectionContents { bytes: Bytes::from(bytes), messages })
    }

    /// Returns the contents of a chunk; none if it is damaged, which is noted.
    fn chunk(&mut self, section: &FileSection) -> std::io::Result<Vec<u8>> {
        let place = section.place;
        let head = self.source.head_at(place)?;
        let head = head.filter(|head| {
            head.opcode == op::CHUNK && head.length.checked_add(PREFIX) == Some(section.end - place)
        });
        let kind = match head {
            None => DamageKind::Index,
            Some(head) => match chunk_at(&mut self.source, place, head)? {
                Ok((_, contents)) => return Ok(contents),
                Err(kind) => kind,
            },
        };
        let lost = self.messages_of_indexes(section.end)?;
        self.index.damage.push(Damage { lost, ..Damage::of_chunk(place, kind) });
        Ok(Vec::new())
    }

    /// Returns how many messages the indexes behind a chunk list, if there are any.
    fn messages_of_indexes(&mut self, behind: u64) -> std::io::Result<Option<u64>> {
        let (mut place, mut count) = (behind, None);
        while let Some(head) = self.source.head_at(place)?.filter(|head| head.opcode == op::MESSAGE_INDEX) {
            count = Some(count.unwrap_or(0_u64).saturating_add(head.length.saturating_sub(6) / 16));
            let Some(next) = place.checked_add(PREFIX).and_then(|place| place.checked_add(head.length))
            else {
                break;
            };
            place = next;
        }
        Ok(count)
    }

    /// Returns the body of the record at a place, if it is of this kind.
    fn body_at(&mut self, place: u64, opcode: u8) -> Result<Vec<u8>, McapFault> {
        let head = self.source.head_at(place)?.filter(|head| head.opcode == opcode);
        let damaged = |what| McapFault::Other(format!("byte {place}: {what}"));
        let Some(head) = head else {
            return Err(damaged("the index names a record that is not there".into()));
        };
        if head.length > MAX_SIZE {
            return Err(damaged(format!("{} bytes are more than the {MAX_SIZE} that are read", head.length)));
        }
        Ok(self.source.bytes_at(place + PREFIX, head.length)?)
    }

    /// Returns the data of an attachment.
    pub(super) fn attachment(&mut self, place: u64) -> Result<Bytes, McapFault> {
        let body = self.body_at(place, op::ATTACHMENT)?;
        match record::parse(op::ATTACHMENT, &body) {
            Some(Record::Attachment { data, .. }) => Ok(Bytes::copy_from_slice(&data)),
            _ => Err(McapFault::Other(format!(
                "byte {place}: the attachment is malformed, or its CRC is wrong"
            ))),
        }
    }

    /// Returns the names and values of a record of metadata.
    pub(super) fn metadata(&mut self, place: u64) -> Result<Vec<(String, String)>, McapFault> {
        let body = self.body_at(place, op::METADATA)?;
        match record::parse(op::METADATA, &body) {
            Some(Record::Metadata(found)) => Ok(found.metadata.into_iter().collect()),
            _ => Err(McapFault::Other(format!("byte {place}: the metadata are malformed"))),
        }
    }

    /// Returns the channel of a number.
    pub(super) fn channel(&self, id: u16) -> Option<&Arc<McapChannel>> {
        self.index.channels.get(&id)
    }
}

/// Returns what a file is that does not begin as those of MCAP.
fn what_it_is(beginning: &[u8]) -> String {
    let is = match beginning {
        [] => "it is empty".to_owned(),
        _ if MAGIC.starts_with(beginning) => "it ends within its first bytes".to_owned(),
        _ if beginning.starts_with(b"SQLite f") => {
            "it is a bag of ROS 2 in SQLite: `ros2 bag convert` makes MCAP of it".to_owned()
        }
        _ if beginning.starts_with(b"#ROSBAG ") => {
            "it is a bag of ROS 1: `mcap convert` makes MCAP of it".to_owned()
        }
        _ if beginning.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) => {
            "it is compressed by zstd as a whole: `zstd -d` makes MCAP of it".to_owned()
        }
        _ => format!("it begins with \"{}\"", beginning.escape_ascii()),
    };
    format!("not an MCAP file: {is}")
}
