//! From a module to bytes.

use std::collections::HashMap;
use std::sync::Arc;

use num_bigint::BigInt;

use super::cursor::ByteOutput;
use super::fingerprint::{BUILTIN_TABLE, OPCODE_TABLE};
use super::{FORMAT_VERSION, HEADER_LENGTH, MAGIC, NONE, Section, WriteError, function, tag};
use crate::module::{Constant, FunctionNumber, Module, PoolIdx};
use crate::symbol::{Home, Symbol};

/// Returns the file that holds `module`.
///
/// # Errors
/// [`WriteError::Object`] if a constant is an object of the running program, [`WriteError::TooLong`] for a
/// module beyond the limits of the format.
pub fn write(module: &Module) -> Result<Vec<u8>, WriteError> {
    let mut symbols = SymbolTable::default();
    // Constants number the symbols that they use, so they come before the table of symbols is written.
    let constants = write_constants(&module.constants, &mut symbols)?;
    let mut names = NameTable::default();
    let (functions, index) = write_functions(module, &mut names);
    let sections = [
        write_names(&[&module.sources, &module.requires]),
        symbols.finish(),
        constants,
        functions,
        index,
        write_toplevel(module),
        names.texts,
    ];
    let mut file =
        ByteOutput(Vec::with_capacity(HEADER_LENGTH + sections.iter().map(|s| s.0.len()).sum::<usize>()));
    file.0.extend(MAGIC);
    file.u32(FORMAT_VERSION);
    file.u32(Section::ALL.len() as u32);
    file.u64(OPCODE_TABLE);
    file.u64(BUILTIN_TABLE);
    let mut offset = HEADER_LENGTH as u32;
    for (section, ByteOutput(bytes)) in Section::ALL.into_iter().zip(&sections) {
        let length = u32::try_from(bytes.len()).map_err(|_| WriteError::TooLong(section))?;
        file.u32(section as u32);
        file.u32(offset);
        file.u32(length);
        file.u32(crc32fast::hash(bytes));
        offset = offset.checked_add(length).ok_or(WriteError::TooLong(section))?;
    }
    let checksum = crc32fast::hash(&file.0);
    file.u32(checksum);
    for ByteOutput(bytes) in sections {
        file.0.extend(bytes);
    }
    Ok(file.0)
}

fn write_names(lists: &[&[String]]) -> ByteOutput {
    let mut out = ByteOutput::default();
    for names in lists {
        out.u32(names.len() as u32);
        for name in *names {
            write_text(name, &mut out);
        }
    }
    out
}

fn write_text(text: &str, out: &mut ByteOutput) {
    out.u32(text.len() as u32);
    out.0.extend(text.as_bytes());
}

/// The names of variables met so far, in the order of their numbers.
#[derive(Default)]
pub(super) struct NameTable {
    numbers: HashMap<Arc<str>, u32>,
    texts: ByteOutput,
}

impl NameTable {
    /// Returns the number of `name`, a new one if it was not met before.
    pub(super) fn number(&mut self, name: &Arc<str>) -> u32 {
        if let Some(&number) = self.numbers.get(name) {
            return number;
        }
        let number = self.numbers.len() as u32;
        self.numbers.insert(name.clone(), number);
        self.texts.leb(name.len() as u32);
        self.texts.0.extend(name.as_bytes());
        number
    }
}

/// The symbols met so far, in the order of their numbers.
#[derive(Default)]
struct SymbolTable {
    numbers: HashMap<Symbol, u32>,
    package_numbers: HashMap<Arc<str>, u32>,
    packages: Vec<Arc<str>>,
    records: ByteOutput,
    names: ByteOutput,
}

impl SymbolTable {
    /// Returns the number of `symbol`, a new one if it was not met before.
    fn number(&mut self, symbol: &Symbol) -> u32 {
        if let Some(&number) = self.numbers.get(symbol) {
            return number;
        }
        let number = self.numbers.len() as u32;
        self.numbers.insert(symbol.clone(), number);
        let (package, id) = match symbol.home() {
            Home::Package(package) => (self.package_number(package), 0),
            Home::Uninterned(id) => (NONE, *id),
        };
        self.records.u32(package);
        self.records.u32(id);
        self.records.u32(self.names.0.len() as u32);
        self.records.u32(symbol.name().len() as u32);
        self.names.0.extend(symbol.name().as_bytes());
        number
    }

    fn package_number(&mut self, package: &Arc<str>) -> u32 {
        *self.package_numbers.entry(package.clone()).or_insert_with(|| {
            self.packages.push(package.clone());
            self.packages.len() as u32 - 1
        })
    }

    fn finish(self) -> ByteOutput {
        let mut out = ByteOutput::default();
        out.u32(self.packages.len() as u32);
        for package in &self.packages {
            write_text(package, &mut out);
        }
        out.u32(self.numbers.len() as u32);
        out.0.extend(self.records.0);
        out.0.extend(self.names.0);
        out
    }
}

fn write_constants(constants: &[Constant], symbols: &mut SymbolTable) -> Result<ByteOutput, WriteError> {
    let mut out = ByteOutput::default();
    let mut records = ByteOutput::default();
    out.u32(constants.len() as u32);
    for (index, constant) in constants.iter().enumerate() {
        out.u32(records.0.len() as u32);
        write_constant(constant, PoolIdx(index as u32), symbols, &mut records)?;
    }
    out.0.extend(records.0);
    Ok(out)
}

fn write_constant(
    constant: &Constant,
    index: PoolIdx,
    symbols: &mut SymbolTable,
    out: &mut ByteOutput,
) -> Result<(), WriteError> {
    match constant {
        Constant::Nil => out.u8(tag::NIL),
        Constant::True => out.u8(tag::TRUE),
        Constant::Symbol(symbol) => {
            out.u8(tag::SYMBOL);
            out.u32(symbols.number(symbol));
        }
        Constant::Integer(value) => match i64::try_from(value) {
            Ok(value) => {
                out.u8(tag::FIXNUM);
                out.u64(value as u64);
            }
            Err(_) => {
                out.u8(tag::INTEGER);
                write_integer(value, out);
            }
        },
        Constant::Ratio(numerator, denominator) => {
            out.u8(tag::RATIO);
            write_integer(numerator, out);
            write_integer(denominator, out);
        }
        Constant::Float(value) => {
            out.u8(tag::FLOAT);
            out.u64(value.to_bits());
        }
        Constant::Character(value) => {
            out.u8(tag::CHARACTER);
            out.u32(u32::from(*value));
        }
        Constant::String(text) => {
            out.u8(tag::STRING);
            write_text(text, out);
        }
        Constant::Cons(PoolIdx(car), PoolIdx(cdr)) => {
            out.u8(tag::CONS);
            out.u32(*car);
            out.u32(*cdr);
        }
        Constant::Vector(items) => {
            out.u8(tag::VECTOR);
            write_items(items, out);
        }
        Constant::Array(dimensions, items) => {
            out.u8(tag::ARRAY);
            out.u32(dimensions.len() as u32);
            for &dimension in dimensions {
                out.u32(dimension);
            }
            write_items(items, out);
        }
        Constant::Function(FunctionNumber(number)) => {
            out.u8(tag::FUNCTION);
            out.u32(*number);
        }
        Constant::Class(name) => {
            out.u8(tag::CLASS);
            out.u32(symbols.number(name));
        }
        Constant::Object(_) => return Err(WriteError::Object(index)),
    }
    Ok(())
}

fn write_integer(value: &BigInt, out: &mut ByteOutput) {
    let bytes = value.to_signed_bytes_le();
    out.u32(bytes.len() as u32);
    out.0.extend(bytes);
}

fn write_items(items: &[PoolIdx], out: &mut ByteOutput) {
    out.u32(items.len() as u32);
    for &PoolIdx(item) in items {
        out.u32(item);
    }
}

fn write_functions(module: &Module, names: &mut NameTable) -> (ByteOutput, ByteOutput) {
    let mut records = ByteOutput::default();
    let mut index = ByteOutput::default();
    index.u32(module.functions.len() as u32);
    for function in &module.functions {
        let start = records.0.len();
        function::write(function, names, &mut records);
        index.u32(start as u32);
        index.u32((records.0.len() - start) as u32);
    }
    (records, index)
}

fn write_toplevel(module: &Module) -> ByteOutput {
    let mut out = ByteOutput::default();
    out.u32(module.toplevel.len() as u32);
    for &FunctionNumber(number) in &module.toplevel {
        out.u32(number);
    }
    out
}
