//! The definitions of an image: which symbols have which of its functions, as a table instead of code that runs.
//!
//! The table is the last constant of the image, a vector: the symbol `ESL::%DEFINITIONS`, then rows of three: a symbol,
//! its function and its macro function (`NIL` for none). The number of rows is a power of two. A symbol is in the row
//! that its hash says, or in the next free one; rows without a symbol begin with `NIL`. So finding a symbol takes about
//! one look, and taking the table in takes none.

use std::collections::BTreeMap;
use std::sync::Arc;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::file::{ConstantRecord, ModuleImage, ReadError, SymbolHome};
use esl_bytecode::module::{Constant, FunctionNumber, Module, PoolIdx};
use esl_bytecode::opcode::Instr;
use esl_bytecode::symbol::Symbol;

const MARKER: &str = "%DEFINITIONS";
/// Items of a row.
const ROW: usize = 3;

/// What an image defines a symbol as: numbers of functions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Definition {
    /// Its function.
    pub function: Option<u32>,
    /// Its macro function.
    pub macro_function: Option<u32>,
}

/// Where the table of an image is.
pub(super) struct Definitions {
    /// The constants that make up the rows.
    items: Vec<PoolIdx>,
}

impl Definitions {
    /// The table of an image; an empty one if it has none.
    pub(super) fn of(image: &ModuleImage) -> Result<Definitions, ReadError> {
        let mut items = Vec::new();
        if let Some(last) = (image.constant_count() as u32).checked_sub(1)
            && let ConstantRecord::Vector(indexes) = image.constant(PoolIdx(last))?
            && let Some(first) = indexes.iter().next()
            && let ConstantRecord::Symbol(number) = image.constant(first)?
            && image.symbol(number)?.name == MARKER
        {
            items = indexes.iter().skip(1).collect();
            if !(items.len() / ROW).is_power_of_two() {
                items.clear();
            }
        }
        Ok(Definitions { items })
    }

    /// The row of `symbol`.
    pub(super) fn find(
        &self,
        image: &ModuleImage,
        packages: &[Arc<str>],
        symbol: &Symbol,
    ) -> Option<Definition> {
        let wanted = (&**symbol.package()?, symbol.name());
        let rows = self.items.len() / ROW;
        let mut at = hash(wanted.0, wanted.1) as usize & rows.checked_sub(1)?;
        loop {
            let row = &self.items[at * ROW..][..ROW];
            if name_of(image, packages, row[0])? == wanted {
                let number = |index| match image.constant(index) {
                    Ok(ConstantRecord::Function(number)) => Some(number.0),
                    _ => None,
                };
                return Some(Definition { function: number(row[1]), macro_function: number(row[2]) });
            }
            // There are free rows, so this ends.
            at = (at + 1) & (rows - 1);
        }
    }

    /// Calls `visit` with each symbol that has a row.
    pub(super) fn each(&self, image: &ModuleImage, packages: &[Arc<str>], visit: &mut dyn FnMut(&Symbol)) {
        for row in self.items.chunks_exact(ROW) {
            if let Some((package, name)) = name_of(image, packages, row[0]) {
                visit(&Symbol::new(&package.into(), name));
            }
        }
    }
}

/// FNV-1a of a symbol's package and name. Images hold tables made with it.
fn hash(package: &str, name: &str) -> u64 {
    let bytes = package.bytes().chain([0xFF]).chain(name.bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325, |hash: u64, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    // The low bits of a product know little of the high ones.
    hash ^ hash >> 32
}

/// Package and name of a constant that is a symbol.
fn name_of<'a>(
    image: &'a ModuleImage,
    packages: &'a [Arc<str>],
    index: PoolIdx,
) -> Option<(&'a str, &'a str)> {
    let ConstantRecord::Symbol(number) = image.constant(index).ok()? else { return None };
    let record = image.symbol(number).ok()?;
    let SymbolHome::Package(package) = record.home else { return None };
    Some((packages.get(package as usize)?, record.name))
}

/// Turns the top-level forms of `module` that do nothing but define functions and macros into a table, for an image.
///
/// The module must stay the only one in its file: its last constant becomes the table.
#[must_use]
pub fn prepare(mut module: Module) -> Module {
    let mut rows: BTreeMap<(Arc<str>, String), Row> = BTreeMap::new();
    let mut toplevel = Vec::new();
    for number in std::mem::take(&mut module.toplevel) {
        let Some(defined) = definitions_of(&module, number) else {
            toplevel.push(number);
            continue;
        };
        for Defined { symbol, function, is_macro } in defined {
            let Constant::Symbol(name) = &module.constants[symbol.0 as usize] else { continue };
            let Some(package) = name.package() else { continue };
            let row = rows.entry((package.clone(), name.name().to_owned()));
            row.or_insert(Row { symbol, functions: [None; 2] }).functions[usize::from(is_macro)] =
                Some(function);
        }
    }
    module.toplevel = toplevel;
    let mut add = |constant| {
        module.constants.push(constant);
        PoolIdx(module.constants.len() as u32 - 1)
    };
    let none = add(Constant::Nil);
    // At most two thirds full.
    let count = (rows.len() + rows.len() / 2 + 1).next_power_of_two();
    let mut table = vec![[none; ROW]; count];
    for ((package, name), Row { symbol, functions }) in rows {
        let mut at = hash(&package, &name) as usize & (count - 1);
        while table[at][0] != none {
            at = (at + 1) & (count - 1);
        }
        table[at] = [symbol, functions[0].unwrap_or(none), functions[1].unwrap_or(none)];
    }
    let marker = add(Constant::Symbol(Symbol::esl(MARKER)));
    add(Constant::Vector([marker].into_iter().chain(table.into_iter().flatten()).collect()));
    module
}

/// A row under construction: the function, then the macro function.
struct Row {
    symbol: PoolIdx,
    functions: [Option<PoolIdx>; 2],
}

struct Defined {
    symbol: PoolIdx,
    function: PoolIdx,
    is_macro: bool,
}

/// What a top-level function defines, if its code does nothing else: it is run as far as constants go.
fn definitions_of(module: &Module, FunctionNumber(number): FunctionNumber) -> Option<Vec<Defined>> {
    let function = &module.functions[number as usize];
    let mut registers: [Option<PoolIdx>; 256] = [None; 256];
    let mut defined = Vec::new();
    let mut pc = 0;
    loop {
        let instruction = Instr::decode(&function.code, pc)?;
        pc += instruction.opcode().words();
        let mut call = |builtin: u32, window: u8, count: u8| {
            let is_macro = match Builtin::from_number(builtin)? {
                Builtin::SetFunction => false,
                Builtin::SetMacro => true,
                _ => return None,
            };
            let first = usize::from(window) + 2;
            if count != 2 {
                return None;
            }
            let (symbol, function) = (registers[first]?, registers[first + 1]?);
            let of = |index: PoolIdx| &module.constants[index.0 as usize];
            let is_interned = matches!(of(symbol), Constant::Symbol(name) if name.package().is_some());
            let Constant::Function(number) = of(function) else { return None };
            let is_closed = module.functions[number.0 as usize].captures.is_empty();
            if !is_interned || !is_closed {
                return None;
            }
            defined.push(Defined { symbol, function, is_macro });
            registers[usize::from(window)] = Some(symbol);
            Some(())
        };
        match instruction {
            Instr::LoadConst { dst, constant } => {
                registers[usize::from(dst.0)] = Some(function.constants[usize::from(constant.0)]);
            }
            Instr::MakeClosure { dst, function: constant } => {
                registers[usize::from(dst.0)] = Some(function.constants[usize::from(constant.0)]);
            }
            Instr::Move { dst, src } => registers[usize::from(dst.0)] = registers[usize::from(src.0)],
            // What they put there is no definition's business.
            Instr::LoadNil { first, count } => {
                registers[usize::from(first.0)..][..usize::from(count.0)].fill(None);
            }
            Instr::LoadTrue { dst } => registers[usize::from(dst.0)] = None,
            Instr::CallBuiltin { window, count, builtin, .. } => call(builtin.0, window.0, count.0)?,
            Instr::TailCallBuiltin { window, count, builtin } => {
                call(builtin.0, window.0, count.0)?;
                return Some(defined);
            }
            Instr::Return { .. } => return if defined.is_empty() { None } else { Some(defined) },
            _ => return None,
        }
    }
}
