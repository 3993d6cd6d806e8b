//! Compiled modules as bytes: the `.eslb` file, and the image of the library.
//!
//! ```text
//! magic           8 bytes   b"ESLB\r\n\x1a\n"
//! format version  u32       FORMAT_VERSION
//! section count   u32       7
//! opcode table    u64       fingerprint of the table that the code was compiled for
//! builtin table   u64       the same of the builtin table
//! section table   7 × 16    kind u32, offset u32, length u32, CRC-32 u32
//! header CRC      u32       of all of the above
//! sections, one after the other, without gaps, in the order of `Section`
//! ```
//!
//! Numbers are little-endian. Inside the sections:
//!
//! ```text
//! sources     count, then for each: length, UTF-8; then likewise the modules that it requires
//! symbols     count of packages, for each: length, UTF-8
//!             count of symbols, for each 16 bytes: package (or NONE), number of an uninterned symbol (else 0),
//!             offset and length of the name in the names; then the names, to the end of the section
//! constants   count, for each: offset of its record in what follows; then the records: a tag byte and its
//!             fields. A record refers to earlier constants by index
//! functions   the records, back to back
//! index       count, for each function: offset and length of its record in `functions`
//! top level   count, then function numbers
//! names       the names of variables: for each its length in LEB128, UTF-8
//! ```
//!
//! So each symbol, constant and function can be read on its own: [`ModuleImage`] opens a file without looking
//! at any of them. [`read`] decodes all of it.
//!
//! Guarantees: [`read`] of what [`write()`] gave is the same module; no bytes make a reader panic, or
//! allocate more than a small multiple of their number. Not here: whether a module makes sense to run
//! (`verify`).

mod cursor;
mod error;
mod fingerprint;
mod function;
mod image;
mod record;
mod whole;
mod write;

pub use error::{Problem, ReadError, WriteError};
pub use fingerprint::{BUILTIN_TABLE, OPCODE_TABLE};
pub use image::{ImageBytes, ModuleImage};
pub use record::{ConstantRecord, PoolIndexes, SymbolHome, SymbolRecord};
pub use write::write;

use crate::module::Module;

/// The first bytes of a file. They betray transfers that change line ends.
pub const MAGIC: [u8; 8] = *b"ESLB\r\n\x1a\n";
/// The version of the format that this crate reads and writes.
///
/// 3: the names of variables, and where their values are.
pub const FORMAT_VERSION: u32 = 3;

/// In place of an index: there is none.
const NONE: u32 = u32::MAX;
/// Length of the header with the section table and its CRC.
const HEADER_LENGTH: usize = SECTION_TABLE + Section::ALL.len() * SECTION_ENTRY + 4;
const SECTION_TABLE: usize = 32;
const SECTION_ENTRY: usize = 16;

/// A part of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Section {
    /// Names of the sources.
    Sources = 1,
    /// The symbols.
    Symbols = 2,
    /// The constant pool.
    Constants = 3,
    /// The functions.
    Functions = 4,
    /// Where each function's record is.
    Index = 5,
    /// The functions that run the top-level forms.
    Toplevel = 6,
    /// The names of variables.
    Names = 7,
}

impl Section {
    /// All of them, in the order of the file.
    pub const ALL: [Section; 7] = [
        Section::Sources,
        Section::Symbols,
        Section::Constants,
        Section::Functions,
        Section::Index,
        Section::Toplevel,
        Section::Names,
    ];

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Section::Sources => "sources",
            Section::Symbols => "symbols",
            Section::Constants => "constants",
            Section::Functions => "functions",
            Section::Index => "index",
            Section::Toplevel => "top level",
            Section::Names => "names",
        }
    }

    /// Its position in [`Section::ALL`].
    fn position(self) -> usize {
        self as usize - 1
    }
}

/// Tags of constants.
mod tag {
    pub(super) const NIL: u8 = 0;
    pub(super) const TRUE: u8 = 1;
    pub(super) const SYMBOL: u8 = 2;
    pub(super) const FIXNUM: u8 = 3;
    pub(super) const INTEGER: u8 = 4;
    pub(super) const RATIO: u8 = 5;
    pub(super) const FLOAT: u8 = 6;
    pub(super) const CHARACTER: u8 = 7;
    pub(super) const STRING: u8 = 8;
    pub(super) const CONS: u8 = 9;
    pub(super) const VECTOR: u8 = 10;
    pub(super) const ARRAY: u8 = 11;
    pub(super) const FUNCTION: u8 = 12;
    pub(super) const CLASS: u8 = 13;
}

/// Returns the checksum of a file's header, which has the checksums of all sections in it: so it tells files
/// apart without looking at all of them. The file is taken to be intact.
pub fn checksum(file: &[u8]) -> Option<u32> {
    file.get(..HEADER_LENGTH)?.last_chunk().map(|checksum| u32::from_le_bytes(*checksum))
}

/// Decodes a whole file. The module is well-formed as a file; call [`crate::verify::verify`] before it is
/// run.
///
/// # Errors
/// [`ReadError`] for bytes that are not an intact file of this version.
pub fn read(bytes: &[u8]) -> Result<Module, ReadError> {
    ModuleImage::open(ImageBytes::Shared(bytes.into()))?.to_module()
}

#[cfg(test)]
mod tests;
