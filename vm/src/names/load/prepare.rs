//! Preparation of an image: top-level forms that only define are turned into rows of the table of
//! definitions.
//!
//! Each form is executed here on constants alone. It is a short piece of code of a few kinds of instructions
//! and builtins. With anything else, or with a value that is not a constant, the form stays a form. The
//! remaining forms run after all definitions in the table; a library must not depend on the order between the
//! two.

use std::collections::BTreeMap;
use std::sync::Arc;

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Constant, FunctionNumber, Module, PoolIdx};
use esl_bytecode::opcode::Instr;
use esl_bytecode::symbol::{ESL_PACKAGE, Symbol};

use super::definitions::{CLASS, CONSTANT, HEAD, MARKER, ROW, SPECIAL, STREAM, VALUE, hash};

/// Library function that tells whether a symbol already is a constant with a value.
const IS_CONSTANT: &str = "%IS-CONSTANT-WITH";

/// The contents of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum KnownValue {
    Nil,
    True,
    Integer(i32),
    Constant(PoolIdx),
    /// The standard stream of this number.
    Stream(i32),
    /// A class that the form has defined.
    Class,
}

/// A class: the names of its superclasses, the names of its slots, and the library's data about it.
#[derive(Clone, Copy, Debug)]
struct ClassRow {
    supers: KnownValue,
    slots: KnownValue,
    data: KnownValue,
}

/// The definition of a symbol.
#[derive(Clone, Debug, Default)]
struct DefinitionRow {
    symbol: Option<PoolIdx>,
    function: Option<PoolIdx>,
    macro_function: Option<PoolIdx>,
    flags: i64,
    value: Option<KnownValue>,
    class: Option<ClassRow>,
    /// Indicators and values, the newest last.
    properties: Vec<(PoolIdx, KnownValue)>,
}

type SymbolName = (Arc<str>, String);

/// The definitions so far.
#[derive(Clone, Debug, Default)]
struct Noted {
    rows: BTreeMap<SymbolName, DefinitionRow>,
    /// Symbols that `ESL` exports.
    exports: Vec<PoolIdx>,
}

/// Turns the top-level forms of `module` that only define into a table, for an image: functions, macros,
/// special variables, constants, properties and exports. Forms without effect are dropped.
///
/// The module must stay the only one in its file: its last constant becomes the table.
#[must_use]
pub fn prepare(mut module: Module) -> Module {
    let mut noted = Noted::default();
    let mut toplevel = Vec::new();
    for number in std::mem::take(&mut module.toplevel) {
        let mut form =
            FormRun { module: &module, registers: [None; 256], changes: Vec::new(), noted: &noted };
        match form.run(number) {
            Some(()) => {
                let changes = form.changes;
                changes.into_iter().for_each(|change| noted.change(&module, change));
            }
            None => toplevel.push(number),
        }
    }
    module.toplevel = toplevel;
    noted.write(&mut module);
    module
}

/// An effect of a form, on a symbol with a package.
#[derive(Clone, Copy, Debug)]
enum Effect {
    Function(PoolIdx, PoolIdx),
    Macro(PoolIdx, PoolIdx),
    Special(PoolIdx),
    Constant(PoolIdx, KnownValue),
    Value(PoolIdx, KnownValue),
    Property(PoolIdx, PoolIdx, KnownValue),
    Class(PoolIdx, ClassRow),
    Export(PoolIdx),
}

/// A form being executed.
struct FormRun<'a> {
    module: &'a Module,
    registers: [Option<KnownValue>; 256],
    changes: Vec<Effect>,
    noted: &'a Noted,
}

impl FormRun<'_> {
    /// Executes a top-level function to its end. `None` if that takes more than constants.
    fn run(&mut self, FunctionNumber(number): FunctionNumber) -> Option<()> {
        let function = &self.module.functions[number as usize];
        let wide = |index: u32| KnownValue::Constant(function.constants[index as usize]);
        let constant = |index: u16| wide(index.into());
        let mut pc = 0;
        loop {
            // Jumps go forward, so the loop ends.
            let instruction = Instr::decode(&function.code, pc)?;
            pc += instruction.opcode().words();
            let mut jump = |distance: i64| pc = (pc as i64 + distance) as usize;
            match instruction {
                Instr::LoadConst { dst, constant: index } => self.set(dst.0, constant(index.0)),
                Instr::MakeClosure { dst, function: index } => self.set(dst.0, constant(index.0)),
                Instr::LoadInt { dst, value } => self.set(dst.0, KnownValue::Integer(i32::from(value.0))),
                Instr::LoadTrue { dst } => self.set(dst.0, KnownValue::True),
                Instr::LoadNil { first, count } => {
                    (0..count.0).for_each(|offset| self.set(first.0 + offset, KnownValue::Nil));
                }
                Instr::Move { dst, src } => {
                    self.registers[usize::from(dst.0)] = self.registers[usize::from(src.0)]
                }
                Instr::JumpAlways { to } => jump(i64::from(to.0)),
                Instr::JumpIfNil { test, to } => {
                    if self.get(test.0)? == KnownValue::Nil {
                        jump(i64::from(to.0));
                    }
                }
                Instr::JumpIfNotNil { test, to } => {
                    if self.get(test.0)? != KnownValue::Nil {
                        jump(i64::from(to.0));
                    }
                }
                Instr::CallBuiltin { window, count, builtin, .. } => {
                    let value = self.call(builtin.0, window.0, count.0)?;
                    self.set(window.0, value);
                }
                Instr::TailCallBuiltin { window, count, builtin } => {
                    return self.call(builtin.0, window.0, count.0).map(|_| ());
                }
                Instr::CallGlobal { window, count, symbol, .. } => {
                    let value = self.call_library(wide(symbol.0), window.0, count.0)?;
                    self.set(window.0, value);
                }
                Instr::TailCallGlobal { window, count, symbol } => {
                    return self.call_library(wide(symbol.0), window.0, count.0).map(|_| ());
                }
                Instr::Return { .. } | Instr::ReturnAll {} => return Some(()),
                _ => return None,
            }
        }
    }

    fn get(&self, register: u8) -> Option<KnownValue> {
        self.registers[usize::from(register)]
    }

    fn set(&mut self, register: u8, value: KnownValue) {
        self.registers[usize::from(register)] = Some(value);
    }

    /// Returns the result of the only library function that may be called here.
    fn call_library(&mut self, function: KnownValue, window: u8, count: u8) -> Option<KnownValue> {
        let Constant::Symbol(function) = self.constant(self.symbol(function)?) else { return None };
        let argument = |position: usize| self.registers[usize::from(window) + 2 + position];
        if *function != Symbol::esl(IS_CONSTANT) || count != 2 {
            return None;
        }
        let is_new = !self.noted.has_value(self.module, self.symbol(argument(0)?)?);
        is_new.then_some(KnownValue::Nil)
    }

    /// Records the effect of a builtin, and returns its value.
    fn call(&mut self, builtin: u32, window: u8, count: u8) -> Option<KnownValue> {
        let argument = |position: u8| {
            if position < count {
                self.registers[usize::from(window) + 2 + usize::from(position)]
            } else {
                None
            }
        };
        let name = self.symbol(argument(0)?);
        let value = argument(1);
        let (change, result) = match Builtin::from_number(builtin)? {
            Builtin::SetFunction => (Effect::Function(name?, self.function(value?)?), name),
            Builtin::SetMacro => (Effect::Macro(name?, self.function(value?)?), name),
            Builtin::ProclaimSpecial => (Effect::Special(name?), name),
            Builtin::DefineConstant => (Effect::Constant(name?, self.data(value?)?), name),
            Builtin::StandardStream => {
                let KnownValue::Integer(number) = argument(0)? else { return None };
                return Some(KnownValue::Stream(number));
            }
            Builtin::Set => {
                let known = match value? {
                    KnownValue::Stream(number) => KnownValue::Stream(number),
                    known => self.data(known)?,
                };
                self.changes.push(Effect::Value(name?, known));
                return value;
            }
            Builtin::Put => {
                self.changes.push(Effect::Property(name?, self.symbol(value?)?, self.data(argument(2)?)?));
                return argument(2);
            }
            Builtin::MakeClass => {
                let (supers, slots) = (value?, self.data(argument(2)?)?);
                let supers_known = self.list(supers)?.into_iter().all(|class| self.has_class(class));
                let class = ClassRow { supers, slots, data: self.data(argument(3)?)? };
                self.changes.push(supers_known.then_some(Effect::Class(name?, class))?);
                return Some(KnownValue::Class);
            }
            Builtin::Boundp => {
                let has_value = self.noted.has_value(self.module, name?);
                let gets_value = self
                    .changes
                    .iter()
                    .any(|change| matches!(change, Effect::Value(symbol, _) if Some(*symbol) == name));
                return Some(if has_value || gets_value { KnownValue::True } else { KnownValue::Nil });
            }
            Builtin::Export if count == 1 || self.is_esl(value?) => {
                self.export(argument(0)?)?;
                return Some(KnownValue::True);
            }
            _ => return None,
        };
        self.changes.push(change);
        result.map(KnownValue::Constant)
    }

    fn constant(&self, PoolIdx(index): PoolIdx) -> &Constant {
        &self.module.constants[index as usize]
    }

    /// Returns the constant, if it is a symbol with a package.
    fn symbol(&self, known: KnownValue) -> Option<PoolIdx> {
        let KnownValue::Constant(index) = known else { return None };
        match self.constant(index) {
            Constant::Symbol(symbol) if symbol.package().is_some() => Some(index),
            _ => None,
        }
    }

    /// Returns the constant, if it is a function without captures.
    fn function(&self, known: KnownValue) -> Option<PoolIdx> {
        let KnownValue::Constant(index) = known else { return None };
        match self.constant(index) {
            Constant::Function(number) if self.module.functions[number.0 as usize].captures.is_empty() => {
                Some(index)
            }
            _ => None,
        }
    }

    /// Returns the value, unless it is a function with captures or an object of the program.
    fn data(&self, known: KnownValue) -> Option<KnownValue> {
        match known {
            KnownValue::Constant(index) => match self.constant(index) {
                Constant::Function(_) => self.function(known).map(KnownValue::Constant),
                Constant::Object(_) | Constant::Class(_) => None,
                _ => Some(known),
            },
            KnownValue::Stream(_) | KnownValue::Class => None,
            _ => Some(known),
        }
    }

    /// Returns the items of a literal proper list.
    fn list(&self, known: KnownValue) -> Option<Vec<PoolIdx>> {
        let mut list = match known {
            KnownValue::Nil => return Some(Vec::new()),
            KnownValue::Constant(list) => list,
            _ => return None,
        };
        let mut items = Vec::new();
        while let &Constant::Cons(car, cdr) = self.constant(list) {
            items.push(car);
            list = cdr;
        }
        (*self.constant(list) == Constant::Nil).then_some(items)
    }

    /// Returns whether the symbol names a class whose definition is recorded.
    fn has_class(&self, symbol: PoolIdx) -> bool {
        let Some(name) = Noted::name(self.module, symbol) else { return false };
        let now = self.changes.iter().any(|change| match change {
            &Effect::Class(class, _) => Noted::name(self.module, class).as_ref() == Some(&name),
            _ => false,
        });
        now || self.noted.rows.get(&name).is_some_and(|row| row.class.is_some())
    }

    /// Returns whether the value designates the package `ESL`.
    fn is_esl(&self, known: KnownValue) -> bool {
        let KnownValue::Constant(index) = known else { return false };
        match self.constant(index) {
            Constant::String(text) => **text == *ESL_PACKAGE,
            Constant::Symbol(symbol) => symbol.name() == ESL_PACKAGE,
            _ => false,
        }
    }

    /// Records the export of a symbol, or of a list of symbols, of `ESL`.
    fn export(&mut self, known: KnownValue) -> Option<()> {
        let symbols = match self.symbol(known) {
            Some(symbol) => vec![symbol],
            None => self.list(known)?,
        };
        for symbol in symbols {
            match self.constant(symbol) {
                Constant::Symbol(name) if name.is_in(ESL_PACKAGE) => {
                    self.changes.push(Effect::Export(symbol))
                }
                _ => return None,
            }
        }
        Some(())
    }
}

impl Noted {
    fn name(module: &Module, PoolIdx(index): PoolIdx) -> Option<SymbolName> {
        match &module.constants[index as usize] {
            Constant::Symbol(symbol) => Some((symbol.package()?.clone(), symbol.name().to_owned())),
            _ => None,
        }
    }

    fn has_value(&self, module: &Module, symbol: PoolIdx) -> bool {
        let row = Noted::name(module, symbol).and_then(|name| self.rows.get(&name));
        row.is_some_and(|row| row.value.is_some())
    }

    fn change(&mut self, module: &Module, change: Effect) {
        let (Effect::Function(symbol, _)
        | Effect::Macro(symbol, _)
        | Effect::Special(symbol)
        | Effect::Constant(symbol, _)
        | Effect::Value(symbol, _)
        | Effect::Property(symbol, ..)
        | Effect::Class(symbol, _)
        | Effect::Export(symbol)) = change;
        if let Effect::Export(symbol) = change {
            self.exports.push(symbol);
            return;
        }
        let Some(name) = Noted::name(module, symbol) else { return };
        let row = self.rows.entry(name).or_default();
        row.symbol = Some(symbol);
        match change {
            Effect::Function(_, function) => (row.function, row.macro_function) = (Some(function), None),
            Effect::Macro(_, function) => (row.function, row.macro_function) = (None, Some(function)),
            Effect::Special(_) => row.flags |= SPECIAL,
            Effect::Constant(_, value) => {
                row.flags |= CONSTANT;
                row.value = Some(value);
            }
            Effect::Value(_, value) => row.value = Some(value),
            Effect::Class(_, class) => row.class = Some(class),
            Effect::Property(_, indicator, value) => {
                let found = row.properties.iter_mut().find(|(other, _)| {
                    module.constants[other.0 as usize] == module.constants[indicator.0 as usize]
                });
                match found {
                    Some((_, old)) => *old = value,
                    None => row.properties.push((indicator, value)),
                }
            }
            Effect::Export(_) => {}
        }
    }

    /// Appends the table as the last constant.
    fn write(self, module: &mut Module) {
        let mut pool = PoolAdditions { constants: &mut module.constants };
        let none = pool.add(Constant::Nil);
        // At most two thirds full.
        let count = (self.rows.len() + self.rows.len() / 2 + 1).next_power_of_two();
        let mut table = vec![[none; ROW]; count];
        for ((package, name), row) in self.rows {
            let mut at = hash(&package, &name) as usize & (count - 1);
            while table[at][0] != none {
                at = (at + 1) & (count - 1);
            }
            let symbol = row.symbol.unwrap_or(none);
            let functions = [row.function.unwrap_or(none), row.macro_function.unwrap_or(none)];
            let data = pool.data(&row).unwrap_or(none);
            table[at] = [symbol, functions[0], functions[1], data];
        }
        let marker = pool.add(Constant::Symbol(Symbol::esl(MARKER)));
        let exports = pool.add(Constant::Vector(self.exports));
        let head: [PoolIdx; HEAD] = [marker, exports];
        pool.add(Constant::Vector(head.into_iter().chain(table.into_iter().flatten()).collect()));
    }
}

/// The pool of the module, for additions.
struct PoolAdditions<'a> {
    constants: &'a mut Vec<Constant>,
}

impl PoolAdditions<'_> {
    fn add(&mut self, constant: Constant) -> PoolIdx {
        self.constants.push(constant);
        PoolIdx(self.constants.len() as u32 - 1)
    }

    fn known(&mut self, known: KnownValue) -> PoolIdx {
        match known {
            KnownValue::Constant(index) => index,
            KnownValue::Nil | KnownValue::Class => self.add(Constant::Nil),
            KnownValue::True => self.add(Constant::True),
            KnownValue::Integer(value) | KnownValue::Stream(value) => {
                self.add(Constant::Integer(value.into()))
            }
        }
    }

    /// Returns the data of a row, if it has any.
    fn data(&mut self, row: &DefinitionRow) -> Option<PoolIdx> {
        let value = match row.value {
            None => 0,
            Some(KnownValue::Stream(_)) => VALUE | STREAM,
            Some(_) => VALUE,
        };
        let flags = row.flags | value | if row.class.is_some() { CLASS } else { 0 };
        if flags == 0 && row.properties.is_empty() {
            return None;
        }
        let mut items = vec![self.add(Constant::Integer(flags.into()))];
        items.extend(row.value.map(|value| self.known(value)));
        if let Some(ClassRow { supers, slots, data }) = row.class {
            items.extend([supers, slots, data].map(|part| self.known(part)));
        }
        // The newest property comes first.
        for &(indicator, value) in row.properties.iter().rev() {
            items.push(indicator);
            items.push(self.known(value));
        }
        Some(self.add(Constant::Vector(items)))
    }
}
