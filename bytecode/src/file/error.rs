//! Why a file cannot be read or a module cannot be written.

use std::fmt;

use super::Section;
use crate::module::PoolIdx;

/// Why bytes are not read as a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReadError {
    /// The first bytes are not those of a compiled file.
    NotCompiled,
    /// The file was written in another version of the format.
    Version {
        /// The version that the file names.
        found: u32,
    },
    /// The file was compiled for another opcode or builtin table.
    Tables {
        /// Which table differs.
        table: &'static str,
    },
    /// The file is cut off or changed.
    Damaged {
        /// The section, or the header.
        section: Option<Section>,
        /// Offset in the file.
        offset: usize,
        /// Fault at that place.
        problem: Problem,
    },
}

/// Fault at some place of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Problem {
    /// There are fewer bytes than were announced.
    Short {
        /// How many bytes were expected.
        expected: u64,
        /// How many bytes are there.
        found: u64,
    },
    /// The checksum is another one.
    Checksum,
    /// The section table is not as it must be.
    SectionTable,
    /// A byte or number that has no meaning there.
    Unknown {
        /// Expected value.
        expected: &'static str,
        /// Value found.
        found: u32,
    },
    /// An index out of range.
    Index {
        /// The table that it should be an index of.
        of: &'static str,
        /// The index.
        found: u32,
        /// How many of them there are, up to this place.
        count: u32,
    },
    /// A packed number of more than 32 bits.
    Number,
    /// Text that is not UTF-8.
    Utf8,
    /// A record that does not begin where the one before it ends.
    Gap,
    /// Bytes after the last expected one.
    Trailing,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ReadError::NotCompiled => f.write_str("not a compiled ESL file: its first bytes are others"),
            ReadError::Version { found } => write!(
                f,
                "compiled in format version {found}, but this is a machine for version {}: compile it again",
                super::FORMAT_VERSION
            ),
            ReadError::Tables { table } => {
                write!(
                    f,
                    "compiled by another version of eslc, with another table of {table}: compile it again"
                )
            }
            ReadError::Damaged { section, offset, problem } => {
                let section = section.map_or("header", Section::name);
                write!(f, "damaged file: {problem} at byte {offset} ({section}): compile it again")
            }
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::Short { expected, found } => {
                write!(f, "expected {expected} more bytes, found {found}")
            }
            Problem::Checksum => f.write_str("wrong checksum"),
            Problem::SectionTable => f.write_str("sections are not in order, or not as long as the file"),
            Problem::Unknown { expected, found } => write!(f, "expected {expected}, found {found}"),
            Problem::Index { of, found, count } => {
                write!(f, "expected an index below {count} of {of}, found {found}")
            }
            Problem::Number => f.write_str("expected a number of at most 32 bits, found a longer one"),
            Problem::Gap => {
                f.write_str("expected the records one after the other, found a gap or an overlap")
            }
            Problem::Utf8 => f.write_str("expected text in UTF-8, found other bytes"),
            Problem::Trailing => f.write_str("expected the end, found more bytes"),
        }
    }
}

impl std::error::Error for ReadError {}

/// Why a module cannot be written to a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WriteError {
    /// The constant is an object of the running program, which means nothing to another one.
    Object(PoolIdx),
    /// A section would be longer than 4 GiB.
    TooLong(Section),
}

impl fmt::Display for WriteError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WriteError::Object(PoolIdx(index)) => write!(
                f,
                "constant {index} is an object of the running program, which no file can hold: make it at load time"
            ),
            WriteError::TooLong(section) => write!(f, "the section `{}` would be too long", section.name()),
        }
    }
}

impl std::error::Error for WriteError {}
