//! A file that is read from one end to the other.

use std::sync::Arc;

use super::image::ModuleImage;
use super::record::{ConstantRecord, SymbolHome, SymbolRecord};
use super::{Problem, ReadError, Section};
use crate::module::{Constant, FunctionNumber, Module, PoolIdx};
use crate::symbol::Symbol;

impl ModuleImage {
    /// Returns the whole module. Records must lie one after the other: so one byte of the file ends up in one
    /// place only, and a small file cannot become a large module.
    ///
    /// # Errors
    /// [`ReadError::Damaged`].
    pub fn to_module(&self) -> Result<Module, ReadError> {
        let symbols = self.all_symbols()?;
        let names = self.names()?;
        let mut functions = Vec::with_capacity(self.function_count);
        let mut end = 0;
        for number in 0..self.function_count as u32 {
            let (offset, length) = self.function_place(FunctionNumber(number))?;
            if offset != end {
                return Err(self.section(Section::Index).damaged(Problem::Gap));
            }
            end = offset.saturating_add(length);
            functions.push(self.function_with(FunctionNumber(number), Some(&names))?);
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
            requires: self.requires()?,
            constants: self.all_constants(&symbols)?,
            functions,
            toplevel: self.toplevel()?,
        })
    }

    fn all_symbols(&self) -> Result<Vec<Symbol>, ReadError> {
        let packages: Vec<Arc<str>> = self.packages()?.into_iter().map(Arc::from).collect();
        let mut symbols = Vec::with_capacity(self.symbol_count);
        let section = self.section(Section::Symbols);
        let mut left = section.rest().len() - (self.symbol_records + self.symbol_count * 16);
        for record in self.symbols() {
            let SymbolRecord { home, name } = record?;
            // The writer gives each symbol its own piece of the names.
            left = left.checked_sub(name.len()).ok_or_else(|| section.damaged(Problem::Gap))?;
            symbols.push(match home {
                SymbolHome::Package(number) => Symbol::new(&packages[number as usize], name),
                SymbolHome::Uninterned(id) => Symbol::uninterned(id, name),
            });
        }
        if left != 0 {
            return Err(section.damaged(Problem::Trailing));
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
