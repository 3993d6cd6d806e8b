//! The damage of a file: what cannot be read, where it is, and what is lost with it.

use std::fmt;

/// Why a part of a file cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DamageKind {
    /// The file ends within a record of this kind.
    CutOff {
        /// The kind of the record.
        record: &'static str,
        /// Bytes of the record that are there.
        left: u64,
        /// Bytes that it has.
        needed: u64,
    },
    /// The checksum of a chunk is not that of its contents.
    Checksum {
        /// The checksum that the file states.
        stated: u32,
        /// That of the contents.
        computed: u32,
    },
    /// A chunk is not decompressed, for this reason.
    Compression(String),
    /// A record of this kind has other contents than its kind has.
    Malformed(&'static str),
    /// A chunk or a record is larger than what is read.
    TooLarge {
        /// Its size.
        size: u64,
        /// The limit.
        limit: u64,
    },
    /// The bytes up to this place are not records.
    Garbage {
        /// The place behind them.
        end: u64,
    },
    /// The file ends without the end of its data: it was not closed.
    Unfinished,
    /// The index is not that of the file.
    Index,
}

/// A damaged part of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// Where it begins, in bytes from the beginning of the file.
    pub place: u64,
    /// Whether it is a chunk.
    pub is_chunk: bool,
    /// Its kind.
    pub kind: DamageKind,
    /// Messages that are lost, if the index of the chunk tells.
    pub lost: Option<u64>,
}

impl Damage {
    pub(super) fn new(place: u64, kind: DamageKind) -> Damage {
        Damage { place, is_chunk: false, kind, lost: None }
    }

    pub(super) fn of_chunk(place: u64, kind: DamageKind) -> Damage {
        Damage { place, is_chunk: true, kind, lost: None }
    }
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let thing = if self.is_chunk { "chunk at byte" } else { "byte" };
        write!(f, "{thing} {}: ", self.place)?;
        match &self.kind {
            DamageKind::CutOff { record, left, needed } => {
                write!(f, "the file ends within the {record}, of whose {needed} bytes it has {left}")?;
            }
            DamageKind::Checksum { stated, computed } => {
                write!(f, "CRC {computed:08x} of the contents is not the stated {stated:08x}, skipped")?;
            }
            DamageKind::Compression(reason) => write!(f, "it cannot be decompressed ({reason}), skipped")?,
            DamageKind::Malformed(record) => write!(f, "malformed {record}, skipped")?,
            DamageKind::TooLarge { size, limit } => {
                write!(f, "{size} bytes are more than the {limit} that are read, skipped")?;
            }
            DamageKind::Garbage { end } => write!(f, "no record up to byte {end}, skipped")?,
            DamageKind::Unfinished => {
                f.write_str("the file ends here, without a summary: its writer did not close it")?;
            }
            DamageKind::Index => f.write_str("the index names a chunk that is not there, skipped")?,
        }
        match self.lost {
            Some(1) => f.write_str(", 1 message lost"),
            Some(lost) => write!(f, ", {lost} messages lost"),
            None if self.is_chunk => f.write_str(", its messages are lost"),
            None => Ok(()),
        }
    }
}
