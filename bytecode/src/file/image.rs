//! A file that is read in parts, when they are needed.

use std::ops::{Deref, Range};
use std::sync::Arc;

use num_bigint::BigInt;

use super::cursor::Cursor;
use super::fingerprint::{BUILTIN_TABLE, OPCODE_TABLE};
use super::{
    FORMAT_VERSION, HEADER_LENGTH, MAGIC, NONE, Problem, ReadError, SECTION_ENTRY, SECTION_TABLE, Section,
    function, tag,
};
use crate::module::{Constant, Function, FunctionNumber, Module, PoolIdx};
use crate::symbol::Symbol;

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
/// For files that this process trusts, such as the image of the library: what is decoded in parts is not seen by the
/// verifier. A file from elsewhere goes through [`super::read`] and [`crate::verify::verify`].
#[derive(Clone, Debug)]
pub struct ModuleImage {
    bytes: ImageBytes,
    /// Where the sections are, in the order of [`Section::ALL`].
    sections: [Range<usize>; Section::ALL.len()],
    /// Offset in the file of the first symbol's record, and how many there are. The names follow.
    symbol_records: usize,
    symbol_count: usize,
    constant_count: usize,
    function_count: usize,
}

/// Where a symbol of a file is at home.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SymbolHome {
    /// In the package of this number; [`ModuleImage::packages`] has the names.
    Package(u32),
    /// Nowhere; the number tells apart the uninterned symbols of the file.
    Uninterned(u32),
}

/// A symbol of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SymbolRecord<'a> {
    /// Where it is at home.
    pub home: SymbolHome,
    /// Its name.
    pub name: &'a str,
}

/// A constant of a file. Symbols are given by their number in the file.
#[derive(Clone, Debug, PartialEq)]
pub enum ConstantRecord<'a> {
    /// `NIL`.
    Nil,
    /// `T`.
    True,
    /// A symbol other than these.
    Symbol(u32),
    /// An integer of 64 bits.
    Fixnum(i64),
    /// A larger integer.
    Integer(BigInt),
    /// Numerator and denominator.
    Ratio(BigInt, BigInt),
    /// A double float.
    Float(f64),
    /// A character.
    Character(char),
    /// A string.
    String(&'a str),
    /// A pair of earlier constants.
    Cons(PoolIdx, PoolIdx),
    /// A simple vector of earlier constants.
    Vector(PoolIndexes<'a>),
    /// Dimensions and elements of an array.
    Array(Vec<u32>, PoolIndexes<'a>),
    /// A function.
    Function(FunctionNumber),
    /// The structure class that this symbol names.
    Class(u32),
}

/// Constants as they are listed in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoolIndexes<'a>(&'a [[u8; 4]]);

impl<'a> PoolIndexes<'a> {
    /// How many there are.
    pub fn len(self) -> usize {
        self.0.len()
    }

    /// Whether there are none.
    pub fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    /// One after the other.
    pub fn iter(self) -> impl ExactSizeIterator<Item = PoolIdx> + 'a {
        self.0.iter().map(|word| PoolIdx(u32::from_le_bytes(*word)))
    }
}

impl ModuleImage {
    /// Opens a file and compares all checksums.
    ///
    /// # Errors
    /// [`ReadError`] for bytes that are no file of this version and these tables, or are damaged.
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

    /// Opens a file that is known to be intact, such as one that is part of the program: only its header is looked at.
    ///
    /// # Errors
    /// [`ReadError`] for bytes that are no file of this version and these tables.
    pub fn open_trusted(bytes: ImageBytes) -> Result<ModuleImage, ReadError> {
        let sections = read_header(&bytes)?;
        let mut image = ModuleImage {
            bytes,
            sections,
            symbol_records: 0,
            symbol_count: 0,
            constant_count: 0,
            function_count: 0,
        };
        image.constant_count = image.section(Section::Constants).count(4)?;
        image.function_count = image.section(Section::Index).count(8)?;
        let mut symbols = image.section(Section::Symbols);
        for _ in 0..symbols.count(4)? {
            symbols.text()?;
        }
        let symbol_count = symbols.count(16)?;
        image.symbol_records = image.sections[Section::Symbols.position()].end - symbols.rest().len();
        image.symbol_count = symbol_count;
        Ok(image)
    }

    fn section(&self, section: Section) -> Cursor<'_> {
        let range = self.sections[section.position()].clone();
        let start = range.start;
        // The header's check has seen that the sections lie within the file.
        Cursor::new(&self.bytes[range], start, Some(section))
    }

    /// A part of `section`, for reading: `length` bytes from `offset` of the section on.
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
        let mut from = self.section(Section::Sources);
        let count = from.count(4)?;
        let mut sources = Vec::with_capacity(count);
        for _ in 0..count {
            sources.push(from.text()?.to_owned());
        }
        from.end()?;
        Ok(sources)
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

    /// How many symbols there are.
    pub fn symbol_count(&self) -> usize {
        self.symbol_count
    }

    /// All symbols, by number.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn symbols(&self) -> Result<Symbols<'_>, ReadError> {
        let packages = self.section(Section::Symbols).u32()?;
        let section = &self.sections[Section::Symbols.position()];
        let mut from = Cursor::new(
            &self.bytes[self.symbol_records..section.end],
            self.symbol_records,
            Some(Section::Symbols),
        );
        let records = from.clone().narrowed(from.bytes(self.symbol_count * 16)?);
        let names = std::str::from_utf8(from.rest()).map_err(|_| from.damaged(Problem::Utf8))?;
        Ok(Symbols { records, names, packages: packages as usize, left: self.symbol_count })
    }

    /// One symbol.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such symbol.
    pub fn symbol(&self, number: u32) -> Result<SymbolRecord<'_>, ReadError> {
        let section = &self.sections[Section::Symbols.position()];
        if number as usize >= self.symbol_count {
            let problem = Problem::Index { of: "symbols", found: number, count: self.symbol_count as u32 };
            return Err(self.section(Section::Symbols).damaged(problem));
        }
        let at = self.symbol_records + number as usize * 16;
        let mut record = Cursor::new(&self.bytes[at..section.end], at, Some(Section::Symbols));
        let (package, id, start, length) = (record.u32()?, record.u32()?, record.u32()?, record.u32()?);
        let home = match package {
            NONE => SymbolHome::Uninterned(id),
            package => SymbolHome::Package(package),
        };
        let names = self.symbol_records + self.symbol_count * 16 - section.start;
        let name = self.part(Section::Symbols, names.saturating_add(start as usize), length as usize)?;
        let name = std::str::from_utf8(name.rest()).map_err(|_| name.damaged(Problem::Utf8))?;
        Ok(SymbolRecord { home, name })
    }

    /// How many constants there are.
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
    fn constant_offset(&self, PoolIdx(index): PoolIdx) -> Result<u32, ReadError> {
        let here = self.section(Section::Constants);
        if index as usize >= self.constant_count {
            let count = self.constant_count as u32;
            return Err(here.damaged(Problem::Index { of: "constants", found: index, count }));
        }
        self.part(Section::Constants, 4 + index as usize * 4, 4)?.u32()
    }

    fn read_constant<'a>(
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

    /// How many functions there are.
    pub fn function_count(&self) -> usize {
        self.function_count
    }

    /// One function.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such function.
    pub fn function(&self, number: FunctionNumber) -> Result<Function, ReadError> {
        let (offset, length) = self.function_place(number)?;
        function::read(self.part(Section::Functions, offset as usize, length as usize)?, self.constant_count)
    }

    /// How many captures a function has, without decoding all of it.
    ///
    /// # Errors
    /// [`ReadError::Damaged`], also if there is no such function.
    pub fn capture_count(&self, number: FunctionNumber) -> Result<usize, ReadError> {
        let (offset, length) = self.function_place(number)?;
        function::capture_count(self.part(Section::Functions, offset as usize, length as usize)?)
    }

    /// Offset and length of a function's record.
    fn function_place(&self, FunctionNumber(number): FunctionNumber) -> Result<(u32, u32), ReadError> {
        let here = self.section(Section::Index);
        if number as usize >= self.function_count {
            let count = self.function_count as u32;
            return Err(here.damaged(Problem::Index { of: "functions", found: number, count }));
        }
        let mut entry = self.part(Section::Index, 4 + number as usize * 8, 8)?;
        Ok((entry.u32()?, entry.u32()?))
    }

    /// The functions that run the top-level forms.
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

    /// The whole module. Records must lie one after the other: so one byte of the file ends up in one place only, and
    /// a small file cannot become a large module.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn to_module(&self) -> Result<Module, ReadError> {
        let symbols = self.all_symbols()?;
        let mut functions = Vec::with_capacity(self.function_count);
        let mut end = 0;
        for number in 0..self.function_count as u32 {
            let (offset, length) = self.function_place(FunctionNumber(number))?;
            if offset != end {
                return Err(self.section(Section::Index).damaged(Problem::Gap));
            }
            end = offset.saturating_add(length);
            functions.push(self.function(FunctionNumber(number))?);
        }
        if end as usize != self.section(Section::Functions).rest().len() {
            return Err(self.section(Section::Functions).damaged(Problem::Trailing));
        }
        let index_length = 4 + self.function_count * 8;
        if self.section(Section::Index).rest().len() != index_length {
            return Err(self.section(Section::Index).damaged(Problem::Trailing));
        }
        Ok(Module {
            sources: self.sources()?,
            constants: self.all_constants(&symbols)?,
            functions,
            toplevel: self.toplevel()?,
        })
    }

    fn all_symbols(&self) -> Result<Vec<Symbol>, ReadError> {
        let packages: Vec<Arc<str>> = self.packages()?.into_iter().map(Arc::from).collect();
        let mut symbols = Vec::with_capacity(self.symbol_count);
        let records = self.symbols()?;
        let mut left = records.names.len();
        for record in records {
            let SymbolRecord { home, name } = record?;
            // The writer gives each symbol its own piece of the names.
            left = left
                .checked_sub(name.len())
                .ok_or_else(|| self.section(Section::Symbols).damaged(Problem::Gap))?;
            symbols.push(match home {
                SymbolHome::Package(number) => Symbol::new(&packages[number as usize], name),
                SymbolHome::Uninterned(id) => Symbol::uninterned(id, name),
            });
        }
        if left != 0 {
            return Err(self.section(Section::Symbols).damaged(Problem::Trailing));
        }
        Ok(symbols)
    }

    fn all_constants(&self, symbols: &[Symbol]) -> Result<Vec<Constant>, ReadError> {
        let mut constants = Vec::with_capacity(self.constant_count);
        let mut from = self.section(Section::Constants);
        from.bytes(4 + self.constant_count * 4)?;
        let length = from.rest().len();
        for index in (0..self.constant_count as u32).map(PoolIdx) {
            if self.constant_offset(index)? as usize != length - from.rest().len() {
                return Err(from.damaged(Problem::Gap));
            }
            let symbol = |number: u32| symbols[number as usize].clone();
            constants.push(match self.read_constant(&mut from, index)? {
                ConstantRecord::Nil => Constant::Nil,
                ConstantRecord::True => Constant::True,
                ConstantRecord::Symbol(number) => Constant::Symbol(symbol(number)),
                ConstantRecord::Fixnum(value) => Constant::Integer(value.into()),
                ConstantRecord::Integer(value) => Constant::Integer(value),
                ConstantRecord::Ratio(numerator, denominator) => Constant::Ratio(numerator, denominator),
                ConstantRecord::Float(value) => Constant::Float(value),
                ConstantRecord::Character(value) => Constant::Character(value),
                ConstantRecord::String(value) => Constant::String(value.into()),
                ConstantRecord::Cons(car, cdr) => Constant::Cons(car, cdr),
                ConstantRecord::Vector(items) => Constant::Vector(items.iter().collect()),
                ConstantRecord::Array(dimensions, items) => {
                    Constant::Array(dimensions, items.iter().collect())
                }
                ConstantRecord::Function(number) => Constant::Function(number),
                ConstantRecord::Class(number) => Constant::Class(symbol(number)),
            });
        }
        from.end()?;
        Ok(constants)
    }
}

/// Iterator over the symbols of a file.
#[derive(Clone, Debug)]
pub struct Symbols<'a> {
    records: Cursor<'a>,
    names: &'a str,
    packages: usize,
    left: usize,
}

impl<'a> Symbols<'a> {
    fn read(&mut self) -> Result<SymbolRecord<'a>, ReadError> {
        let here = self.records.clone();
        let package = self.records.u32()?;
        let id = self.records.u32()?;
        let home = if package == NONE {
            SymbolHome::Uninterned(id)
        } else {
            let count = self.packages;
            if package as usize >= count {
                let problem = Problem::Index { of: "packages", found: package, count: count as u32 };
                return Err(here.damaged(problem));
            }
            SymbolHome::Package(package)
        };
        let start = self.records.u32()?;
        let end = u64::from(start) + u64::from(self.records.u32()?);
        let name = usize::try_from(end).ok().and_then(|end| self.names.get(start as usize..end));
        let Some(name) = name else {
            let problem = Problem::Index { of: "the names", found: start, count: self.names.len() as u32 };
            return Err(here.damaged(problem));
        };
        Ok(SymbolRecord { home, name })
    }
}

impl<'a> Iterator for Symbols<'a> {
    type Item = Result<SymbolRecord<'a>, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.left = self.left.checked_sub(1)?;
        Some(self.read())
    }
}

/// Checks magic, version and tables, and gives the places of the sections.
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
