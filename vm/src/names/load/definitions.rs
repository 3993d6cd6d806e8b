//! The definitions of an image: a table of its symbols, instead of code that defines them.
//!
//! The table is the last constant of the image, a vector: the symbol `ESL::%DEFINITIONS`; a vector of the
//! symbols that the package `ESL` exports; then rows of four: a symbol, its function, its macro function, and
//! its *data* (`NIL` where there is none). Data are a vector: flags, the value, the class that the symbol
//! names (a list of the names of its superclasses, a list of its slots, and the library's data about it),
//! then indicators and values of properties, in the order of the property list. Flags say which of them there
//! are.
//!
//! The number of rows is a power of two. A symbol is in the row of its hash, or in the next free one; empty
//! rows begin with `NIL`. So finding a symbol takes about one look, and loading the table takes none.
//!
//! [`super::prepare()`] makes the table when the library is built.

use std::sync::Arc;

use esl_bytecode::file::{ConstantRecord, ModuleImage, PoolIndexes, ReadError, SymbolHome};
use esl_bytecode::module::PoolIdx;
use esl_bytecode::symbol::Symbol;

/// Name of the symbol at the beginning of the table.
pub(super) const MARKER: &str = "%DEFINITIONS";
/// Number of items before the rows.
pub(super) const HEAD: usize = 2;
/// Number of items in a row.
pub(super) const ROW: usize = 4;
/// Flag of data: the symbol is a special variable.
pub(super) const SPECIAL: i64 = 1;
/// Flag of data: the symbol is a constant.
pub(super) const CONSTANT: i64 = 2;
/// Flag of data: the symbol has a value.
pub(super) const VALUE: i64 = 4;
/// Flag of data: the value is the standard stream of this number.
pub(super) const STREAM: i64 = 8;
/// Flag of data: the symbol names a class.
pub(super) const CLASS: i64 = 16;

/// An image's definition of a symbol: functions by number, data by index of the constant.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ImageDefinition {
    /// Number of the function.
    pub function: Option<u32>,
    /// Number of the macro function.
    pub macro_function: Option<u32>,
    /// Whether the symbol is a special variable.
    pub is_special: bool,
    /// Whether the symbol is a constant.
    pub is_constant: bool,
    /// The value.
    pub value: Option<PoolIdx>,
    /// Number of the standard stream that is the value.
    pub stream: Option<usize>,
    /// The class that the symbol names.
    pub class: Option<ImageClass>,
    /// Indicators and values of the properties.
    pub properties: Vec<(PoolIdx, PoolIdx)>,
}

/// An image's definition of a class. All superclasses are classes of the image, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ImageClass {
    /// List of the names of the superclasses.
    pub supers: PoolIdx,
    /// List of the names of the slots.
    pub slots: PoolIdx,
    /// Data of the library.
    pub data: PoolIdx,
}

/// The table of an image. Decoding a vector visits each of its items, so the result is kept.
#[derive(Clone)]
pub(super) struct Definitions {
    exports: Option<PoolIdx>,
    /// The rows in sequence: none, or a power of two of them.
    rows: Vec<PoolIdx>,
}

impl Definitions {
    /// Returns the table of an image; an empty one if there is none.
    pub(super) fn of(image: &ModuleImage) -> Result<Definitions, ReadError> {
        let mut definitions = Definitions { exports: None, rows: Vec::new() };
        let table = PoolIdx((image.constant_count() as u32).saturating_sub(1));
        if image.constant_count() > 0
            && let ConstantRecord::Vector(items) = image.constant(table)?
            && let Some(first) = items.get(0)
            && let ConstantRecord::Symbol(number) = image.constant(first)?
            && image.symbol(number)?.name == MARKER
            && (items.len().saturating_sub(HEAD) / ROW).is_power_of_two()
        {
            definitions.exports = items.get(1);
            definitions.rows = items.iter().skip(HEAD).collect();
        }
        Ok(definitions)
    }

    /// Returns the definition of `symbol`.
    pub(super) fn find(
        &self,
        image: &ModuleImage,
        packages: &[Arc<str>],
        symbol: &Symbol,
    ) -> Option<ImageDefinition> {
        let wanted = (&**symbol.package()?, symbol.name());
        let last = (self.rows.len() / ROW).checked_sub(1)?;
        let mut at = hash(wanted.0, wanted.1) as usize & last;
        loop {
            let row = &self.rows[at * ROW..][..ROW];
            if name_of(image, packages, row[0])? == wanted {
                return Some(read_row(image, row));
            }
            // There are empty rows, so the search ends.
            at = (at + 1) & last;
        }
    }

    /// Calls `visit` with each symbol that has a row.
    pub(super) fn each(&self, image: &ModuleImage, packages: &[Arc<str>], visit: &mut dyn FnMut(&Symbol)) {
        for row in self.rows.chunks_exact(ROW) {
            if let Some((package, name)) = name_of(image, packages, row[0]) {
                visit(&Symbol::new(&package.into(), name));
            }
        }
    }

    /// Returns the names that the package `ESL` exports.
    pub(super) fn exports<'a>(&self, image: &'a ModuleImage, packages: &'a [Arc<str>]) -> Vec<&'a str> {
        let exports = self.exports.and_then(|exports| vector(image, exports));
        let names = exports.iter().flat_map(|exports| exports.iter());
        names.filter_map(|symbol| name_of(image, packages, symbol)).map(|(_, name)| name).collect()
    }
}

fn vector(image: &ModuleImage, index: PoolIdx) -> Option<PoolIndexes<'_>> {
    match image.constant(index) {
        Ok(ConstantRecord::Vector(items)) => Some(items),
        _ => None,
    }
}

fn read_row(image: &ModuleImage, row: &[PoolIdx]) -> ImageDefinition {
    let number = |index| match image.constant(index) {
        Ok(ConstantRecord::Function(number)) => Some(number.0),
        _ => None,
    };
    let functions = ImageDefinition {
        function: number(row[1]),
        macro_function: number(row[2]),
        ..ImageDefinition::default()
    };
    let Some(data) = vector(image, row[3]) else { return functions };
    let flags = match data.get(0).map(|flags| image.constant(flags)) {
        Some(Ok(ConstantRecord::Fixnum(flags))) => flags,
        _ => 0,
    };
    let mut items = data.iter().skip(1);
    let value = if flags & VALUE != 0 { items.next() } else { None };
    let class = if flags & CLASS != 0 { image_class(&mut items) } else { None };
    let properties: Vec<PoolIdx> = items.collect();
    ImageDefinition {
        is_special: flags & SPECIAL != 0,
        is_constant: flags & CONSTANT != 0,
        value: value.filter(|_| flags & STREAM == 0),
        stream: value.filter(|_| flags & STREAM != 0).and_then(|number| match image.constant(number) {
            Ok(ConstantRecord::Fixnum(number)) => usize::try_from(number).ok(),
            _ => None,
        }),
        class,
        properties: properties.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect(),
        ..functions
    }
}

fn image_class(items: &mut impl Iterator<Item = PoolIdx>) -> Option<ImageClass> {
    Some(ImageClass { supers: items.next()?, slots: items.next()?, data: items.next()? })
}

/// FNV-1a of a symbol's package and name. Tables in images depend on it.
pub(super) fn hash(package: &str, name: &str) -> u64 {
    let bytes = package.bytes().chain([0xFF]).chain(name.bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    // The low bits of a product hardly depend on the high ones of its factors.
    hash ^ hash >> 32
}

/// Returns package and name of a constant that is a symbol with a package.
pub(super) fn name_of<'a>(
    image: &'a ModuleImage,
    packages: &'a [Arc<str>],
    index: PoolIdx,
) -> Option<(&'a str, &'a str)> {
    let ConstantRecord::Symbol(number) = image.constant(index).ok()? else { return None };
    let record = image.symbol(number).ok()?;
    let SymbolHome::Package(package) = record.home else { return None };
    Some((packages.get(package as usize)?, record.name))
}
