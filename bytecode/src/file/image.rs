//! A file that is read in parts, when they are needed.

use std::ops::{Deref, Range};
use std::sync::Arc;

use num_bigint::BigInt;

use super::cursor::Cursor;
use super::fingerprint::{BUILTIN_TABLE, OPCODE_TABLE};
use super::record::{ConstantRecord, PoolIndexes, SymbolHome, SymbolRecord};
use super::{
    FORMAT_VERSION, HEADER_LENGTH, MAGIC, NONE, Problem, ReadError, SECTION_ENTRY, SECTION_TABLE, Section,
    function, tag,
};
use crate::module::{FunctionNumber, ModuleFunction, PoolIdx, VariableRange};

/// The bytes of a file, embedded in the program or shared.
#[derive(Clone, Debug)]
pub enum ImageBytes {
    /// Part of the program.
    Static(&'static [u8]),
    /// Read from somewhere.
    Shared(Arc<[u8]>),
}

impl Deref for ImageBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            ImageBytes::Static(bytes) => bytes,
            ImageBytes::Shared(bytes) => bytes,
        }
    }
}

/// An opened file. Each symbol, constant and function is decoded when it is asked for.
///
/// For files that this process trusts, such as the image of the library: what is decoded in parts is not seen
/// by the verifier. A file from elsewhere goes through [`super::read`] and [`crate::verify::verify`].
#[derive(Clone, Debug)]
pub struct ModuleImage {
    bytes: ImageBytes,
    /// Where the sections are, in the order of [`Section::ALL`].
    sections: [Range<usize>; Section::ALL.len()],
    /// Offset in the section of the first symbol's record, and how many there are. The names follow.
    pub(super) symbol_records: usize,
    pub(super) symbol_count: usize,
    package_count: usize,
    pub(super) constant_count: usize,
    pub(super) function_count: usize,
}

impl ModuleImage {
    /// Opens a file and compares all checksums.
    ///
    /// # Errors
    /// [`ReadError`] for bytes that are not a file of this version and these tables, or are damaged.
    pub fn open(bytes: ImageBytes) -> Result<ModuleImage, ReadError> {
        let image = ModuleImage::open_trusted(bytes)?;
        let mut header = Cursor::new(&image.bytes, 0, None);
        let covered = header.bytes(HEADER_LENGTH - 4)?;
        let here = header.clone();
        if header.u32()? != crc32fast::hash(covered) {
            return Err(here.damaged(Problem::Checksum));
        }
        for section in Section::ALL {
            // The checksum is the last field of the section's entry.
            let mut checksum = Cursor::new(covered, 0, None);
            checksum.bytes(SECTION_TABLE + SECTION_ENTRY * section.position() + SECTION_ENTRY - 4)?;
            let content = image.section(section);
            if checksum.u32()? != crc32fast::hash(content.rest()) {
                return Err(content.damaged(Problem::Checksum));
            }
        }
        Ok(image)
    }

    /// Opens a file that is known to be intact, such as one that is part of the program: only its header is
    /// looked at.
    ///
    /// # Errors
    /// [`ReadError`] for bytes that are not a file of this version and these tables.
    pub fn open_trusted(bytes: ImageBytes) -> Result<ModuleImage, ReadError> {
        let sections = read_header(&bytes)?;
        let mut image = ModuleImage {
            bytes,
            sections,
            symbol_records: 0,
            symbol_count: 0,
            package_count: 0,
            constant_count: 0,
            function_count: 0,
        };
        image.constant_count = image.section(Section::Constants).count(4)?;
        image.function_count = image.section(Section::Index).count(8)?;
        let mut symbols = image.section(Section::Symbols);
        let length = symbols.rest().len();
        let package_count = symbols.count(4)?;
        for _ in 0..package_count {
            symbols.text()?;
        }
        let symbol_count = symbols.count(16)?;
        let symbol_records = length - symbols.rest().len();
        image = ModuleImage { symbol_records, symbol_count, package_count, ..image };
        Ok(image)
    }

    pub(super) fn section(&self, section: Section) -> Cursor<'_> {
        let range = self.sections[section.position()].clone();
        let start = range.start;
        // The header's check has seen that the sections lie within the file.
        Cursor::new(&self.bytes[range], start, Some(section))
    }

    /// Returns a part of `section`, for reading: `length` bytes from `offset` of the section on.
    fn part(&self, section: Section, offset: usize, length: usize) -> Result<Cursor<'_>, ReadError> {
        let mut all = self.section(section);
        all.bytes(offset)?;
        let here = all.clone();
        let bytes = all.bytes(length)?;
        Ok(here.narrowed(bytes))
    }

    /// Names of the sources.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn sources(&self) -> Result<Vec<String>, ReadError> {
        Ok(self.sources_and_required()?.0)
    }

    /// Name of the source with this number; `None` if there is no such source.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn source(&self, number: u32) -> Result<Option<&str>, ReadError> {
        let mut from = self.section(Section::Sources);
        let count = from.count(4)?;
        if number as usize >= count {
            return Ok(None);
        }
        for _ in 0..number {
            from.text()?;
        }
        from.text().map(Some)
    }

    /// Names of the modules that it requires.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn requires(&self) -> Result<Vec<String>, ReadError> {
        Ok(self.sources_and_required()?.1)
    }

    fn sources_and_required(&self) -> Result<(Vec<String>, Vec<String>), ReadError> {
        let mut from = self.section(Section::Sources);
        let mut names = || {
            let count = from.count(4)?;
            let mut names = Vec::with_capacity(count);
            for _ in 0..count {
                names.push(from.text()?.to_owned());
            }
            Ok(names)
        };
        let lists = (names()?, names()?);
        from.end()?;
        Ok(lists)
    }

    /// Names of the packages at which the symbols are at home, by number.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn packages(&self) -> Result<Vec<&str>, ReadError> {
        let mut from = self.section(Section::Symbols);
        let count = from.count(4)?;
        let mut packages = Vec::with_capacity(count);
        for _ in 0..count {
            packages.push(from.text()?);
        }
        Ok(packages)
    }

    /// Returns how many symbols there are.
    pub fn symbol_count(&self) -> usize {
        self.symbol_count
    }

    /// Returns all symbols, by number.
    pub fn symbols(&self) -> impl ExactSizeIterator<Item = Result<SymbolRecord<'_>, ReadError>> {
        (0..self.symbol_count as u32).map(|number| self.symbol(number))
    }

    /// One symbol.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such symbol.
    pub fn symbol(&self, number: u32) -> Result<SymbolRecord<'_>, ReadError> {
        if number as usize >= self.symbol_count {
            let problem = Problem::Index { of: "symbols", found: number, count: self.symbol_count as u32 };
            return Err(self.section(Section::Symbols).damaged(problem));
        }
        let mut record = self.part(Section::Symbols, self.symbol_records + number as usize * 16, 16)?;
        let here = record.clone();
        let home = match (record.u32()?, record.u32()?) {
            (NONE, id) => SymbolHome::Uninterned(id),
            (found, _) if found as usize >= self.package_count => {
                let count = self.package_count as u32;
                return Err(here.damaged(Problem::Index { of: "packages", found, count }));
            }
            (package, _) => SymbolHome::Package(package),
        };
        let names = self.symbol_records + self.symbol_count * 16;
        let start = names.saturating_add(record.u32()? as usize);
        let name = self.part(Section::Symbols, start, record.u32()? as usize)?;
        let text = std::str::from_utf8(name.rest()).map_err(|_| name.damaged(Problem::Utf8))?;
        Ok(SymbolRecord { home, name: text })
    }

    /// Returns how many constants there are.
    pub fn constant_count(&self) -> usize {
        self.constant_count
    }

    /// One constant.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such constant.
    pub fn constant(&self, index: PoolIdx) -> Result<ConstantRecord<'_>, ReadError> {
        let offset = self.constant_offset(index)?;
        let records = 4 + self.constant_count * 4;
        let mut from = self.section(Section::Constants);
        from.bytes(records)?;
        from.bytes(offset as usize)?;
        self.read_constant(&mut from, index)
    }

    /// Where the record of a constant begins, after the offsets.
    pub(super) fn constant_offset(&self, PoolIdx(index): PoolIdx) -> Result<u32, ReadError> {
        let here = self.section(Section::Constants);
        if index as usize >= self.constant_count {
            let count = self.constant_count as u32;
            return Err(here.damaged(Problem::Index { of: "constants", found: index, count }));
        }
        self.part(Section::Constants, 4 + index as usize * 4, 4)?.u32()
    }

    pub(super) fn read_constant<'a>(
        &'a self,
        from: &mut Cursor<'a>,
        PoolIdx(own): PoolIdx,
    ) -> Result<ConstantRecord<'a>, ReadError> {
        let earlier = own as usize;
        let here = from.clone();
        Ok(match from.u8()? {
            tag::NIL => ConstantRecord::Nil,
            tag::TRUE => ConstantRecord::True,
            tag::SYMBOL => ConstantRecord::Symbol(from.index("symbols", self.symbol_count)?),
            tag::FIXNUM => ConstantRecord::Fixnum(from.u64()? as i64),
            tag::INTEGER => ConstantRecord::Integer(read_integer(from)?),
            tag::RATIO => ConstantRecord::Ratio(read_integer(from)?, read_integer(from)?),
            tag::FLOAT => ConstantRecord::Float(f64::from_bits(from.u64()?)),
            tag::CHARACTER => {
                let found = from.u32()?;
                let problem = Problem::Unknown { expected: "the code of a character", found };
                ConstantRecord::Character(char::from_u32(found).ok_or_else(|| here.damaged(problem))?)
            }
            tag::STRING => ConstantRecord::String(from.text()?),
            tag::CONS => {
                let car = from.index("earlier constants", earlier)?;
                ConstantRecord::Cons(PoolIdx(car), PoolIdx(from.index("earlier constants", earlier)?))
            }
            tag::VECTOR => ConstantRecord::Vector(read_items(from, earlier)?),
            tag::ARRAY => {
                let rank = from.count(4)?;
                let dimensions = from.words(rank)?.collect();
                ConstantRecord::Array(dimensions, read_items(from, earlier)?)
            }
            tag::FUNCTION => {
                ConstantRecord::Function(FunctionNumber(from.index("functions", self.function_count)?))
            }
            tag::CLASS => ConstantRecord::Class(from.index("symbols", self.symbol_count)?),
            found => {
                let problem = Problem::Unknown { expected: "the tag of a constant", found: u32::from(found) };
                return Err(here.damaged(problem));
            }
        })
    }

    /// Returns how many functions there are.
    pub fn function_count(&self) -> usize {
        self.function_count
    }

    /// Returns one function, without its variables, which only debuggers need.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such function.
    pub fn function(&self, number: FunctionNumber) -> Result<ModuleFunction, ReadError> {
        self.function_with(number, None)
    }

    /// The variables of one function.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such function.
    pub fn variables(&self, number: FunctionNumber) -> Result<Vec<VariableRange>, ReadError> {
        Ok(self.function_with(number, Some(&self.names()?))?.variables)
    }

    /// One function, with its variables if there are names.
    pub(super) fn function_with(
        &self,
        number: FunctionNumber,
        names: Option<&[Arc<str>]>,
    ) -> Result<ModuleFunction, ReadError> {
        let (offset, length) = self.function_place(number)?;
        let record = self.part(Section::Functions, offset as usize, length as usize)?;
        function::read(record, self.constant_count, names)
    }

    /// Returns the names of variables, by number.
    pub(super) fn names(&self) -> Result<Vec<Arc<str>>, ReadError> {
        let mut from = self.section(Section::Names);
        let mut names = Vec::new();
        while !from.rest().is_empty() {
            let length = from.leb()? as usize;
            let here = from.clone();
            let name = std::str::from_utf8(from.bytes(length)?).map_err(|_| here.damaged(Problem::Utf8))?;
            names.push(name.into());
        }
        Ok(names)
    }

    /// Returns how many captures a function has, without decoding all of it.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such function.
    pub fn capture_count(&self, number: FunctionNumber) -> Result<usize, ReadError> {
        let (offset, length) = self.function_place(number)?;
        function::capture_count(self.part(Section::Functions, offset as usize, length as usize)?)
    }

    /// Offset and length of a function's record.
    pub(super) fn function_place(
        &self,
        FunctionNumber(number): FunctionNumber,
    ) -> Result<(u32, u32), ReadError> {
        let here = self.section(Section::Index);
        if number as usize >= self.function_count {
            let count = self.function_count as u32;
            return Err(here.damaged(Problem::Index { of: "functions", found: number, count }));
        }
        let mut entry = self.part(Section::Index, 4 + number as usize * 8, 8)?;
        Ok((entry.u32()?, entry.u32()?))
    }

    /// Returns the functions that run the top-level forms.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn toplevel(&self) -> Result<Vec<FunctionNumber>, ReadError> {
        let mut from = self.section(Section::Toplevel);
        let count = from.count(4)?;
        let mut toplevel = Vec::with_capacity(count);
        for _ in 0..count {
            toplevel.push(FunctionNumber(from.index("functions", self.function_count)?));
        }
        from.end()?;
        Ok(toplevel)
    }
}

/// Checks magic, version and tables. Returns the places of the sections.
fn read_header(bytes: &[u8]) -> Result<[Range<usize>; Section::ALL.len()], ReadError> {
    let mut header = Cursor::new(bytes, 0, None);
    if !bytes.starts_with(&MAGIC) {
        return Err(ReadError::NotCompiled);
    }
    header.bytes(MAGIC.len())?;
    let found = header.u32()?;
    if found != FORMAT_VERSION {
        return Err(ReadError::Version { found });
    }
    let sections = header.clone();
    if header.u32()? as usize != Section::ALL.len() {
        return Err(sections.damaged(Problem::SectionTable));
    }
    if header.u64()? != OPCODE_TABLE {
        return Err(ReadError::Tables { table: "opcodes" });
    }
    if header.u64()? != BUILTIN_TABLE {
        return Err(ReadError::Tables { table: "builtins" });
    }
    let mut places = Section::ALL.map(|_| 0..0);
    let mut end = HEADER_LENGTH;
    for (section, place) in Section::ALL.into_iter().zip(&mut places) {
        let here = header.clone();
        let kind = header.u32()?;
        let offset = header.u32()? as usize;
        let length = header.u32()? as usize;
        header.u32()?;
        let next = offset.checked_add(length).filter(|&next| next <= bytes.len());
        let (true, Some(next)) = (kind == section as u32 && offset == end, next) else {
            return Err(here.damaged(Problem::SectionTable));
        };
        *place = offset..next;
        end = next;
    }
    if end != bytes.len() {
        return Err(header.damaged(Problem::SectionTable));
    }
    Ok(places)
}

fn read_integer(from: &mut Cursor<'_>) -> Result<BigInt, ReadError> {
    let length = from.count(1)?;
    Ok(BigInt::from_signed_bytes_le(from.bytes(length)?))
}

fn read_items<'a>(from: &mut Cursor<'a>, earlier: usize) -> Result<PoolIndexes<'a>, ReadError> {
    let count = from.count(4)?;
    let here = from.clone();
    let indexes = PoolIndexes(from.bytes(count * 4)?.as_chunks().0);
    match indexes.iter().find(|&PoolIdx(index)| index as usize >= earlier) {
        None => Ok(indexes),
        Some(PoolIdx(found)) => {
            Err(here.damaged(Problem::Index { of: "earlier constants", found, count: earlier as u32 }))
        }
    }
}
