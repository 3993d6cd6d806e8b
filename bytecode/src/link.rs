//! Makes one module of several, such as the files of the library.
//!
//! Pools, functions and sources are put one after the other; numbers in them move, code stays as it is.
//! Constants of which a program cannot tell two apart (symbols, numbers, characters, classes) are kept once.
//! Strings, pairs, vectors and arrays have an identity, and those of different modules stay different.
//!
//! Uninterned symbols of different modules are different: they get new numbers.

use std::collections::HashMap;

use num_bigint::BigInt;

use crate::module::{Constant, FunctionNumber, LineEntry, Module, ModuleFunction, PoolIdx};
use crate::symbol::{Home, Symbol, setf_cell, symbol_of_setf_cell};

/// Returns the module that does what `modules` do one after the other.
///
/// Verified modules give a verified module.
pub fn link(modules: impl IntoIterator<Item = Module>) -> Module {
    let mut linker = Linker::default();
    for module in modules {
        linker.add(module);
    }
    linker.linked
}

/// As [`link`], for modules of one compilation unit: an uninterned symbol of one is that of the same number
/// in another, and keeps its number. Each has the sources of the one before it, and maybe more.
pub fn join(modules: impl IntoIterator<Item = Module>) -> Module {
    let mut linker = Linker { is_one_unit: true, ..Linker::default() };
    for module in modules {
        linker.add(module);
    }
    linker.linked
}

#[derive(Default)]
struct Linker {
    linked: Module,
    /// Where constants without identity are in the linked pool.
    known: HashMap<ConstantKey, PoolIdx>,
    /// New numbers of the uninterned symbols of the module that is being added.
    uninterned: HashMap<Symbol, Symbol>,
    /// How many uninterned symbols there are.
    fresh: u32,
    /// Whether uninterned symbols keep their identity from one module to the next.
    is_one_unit: bool,
}

/// A constant without identity.
#[derive(PartialEq, Eq, Hash)]
enum ConstantKey {
    Nil,
    True,
    Symbol(Symbol),
    Integer(BigInt),
    Ratio(BigInt, BigInt),
    /// The bits: `0.0` and `-0.0` differ, and a number that is none equals itself.
    Float(u64),
    Character(char),
    Class(Symbol),
    Function(FunctionNumber),
}

impl ConstantKey {
    fn of(constant: &Constant) -> Option<ConstantKey> {
        Some(match constant {
            Constant::Nil => ConstantKey::Nil,
            Constant::True => ConstantKey::True,
            Constant::Symbol(symbol) => ConstantKey::Symbol(symbol.clone()),
            Constant::Integer(value) => ConstantKey::Integer(value.clone()),
            Constant::Ratio(numerator, denominator) => {
                ConstantKey::Ratio(numerator.clone(), denominator.clone())
            }
            Constant::Float(value) => ConstantKey::Float(value.to_bits()),
            Constant::Character(value) => ConstantKey::Character(*value),
            Constant::Class(name) => ConstantKey::Class(name.clone()),
            Constant::Function(number) => ConstantKey::Function(*number),
            Constant::String(_)
            | Constant::Cons(..)
            | Constant::Vector(_)
            | Constant::Array(..)
            | Constant::Object(_) => return None,
        })
    }
}

/// Where the parts of one module go.
struct Places {
    constants: Vec<PoolIdx>,
    first_function: u32,
    first_source: u32,
}

impl Places {
    /// Returns the new index of a constant. An index that the module does not have stays one that no module
    /// has.
    fn constant(&self, PoolIdx(index): PoolIdx) -> PoolIdx {
        self.constants.get(index as usize).copied().unwrap_or(PoolIdx(u32::MAX))
    }

    fn function(&self, FunctionNumber(number): FunctionNumber) -> FunctionNumber {
        FunctionNumber(number.saturating_add(self.first_function))
    }
}

impl Linker {
    fn add(&mut self, module: Module) {
        self.uninterned.clear();
        let is_same_text = self.is_one_unit && module.sources.starts_with(&self.linked.sources);
        let mut places = Places {
            constants: Vec::with_capacity(module.constants.len()),
            first_function: self.linked.functions.len() as u32,
            first_source: if is_same_text { 0 } else { self.linked.sources.len() as u32 },
        };
        for mut constant in module.constants {
            self.renumber(&mut constant, &places);
            let index = self.place(constant);
            places.constants.push(index);
        }
        if is_same_text {
            self.linked.sources = module.sources;
        } else {
            self.linked.sources.extend(module.sources);
        }
        self.linked.requires.extend(module.requires);
        self.linked.functions.extend(module.functions.into_iter().map(|mut function| {
            relocate(&mut function, &places);
            function
        }));
        self.linked.toplevel.extend(module.toplevel.into_iter().map(|number| places.function(number)));
    }

    /// Renumbers the references of `constant`, whose targets have their places already.
    fn renumber(&mut self, constant: &mut Constant, places: &Places) {
        match constant {
            Constant::Symbol(symbol) | Constant::Class(symbol) => self.renumber_symbol(symbol),
            Constant::Cons(car, cdr) => {
                *car = places.constant(*car);
                *cdr = places.constant(*cdr);
            }
            Constant::Vector(items) | Constant::Array(_, items) => move_all(items, places),
            Constant::Function(number) => *number = places.function(*number),
            Constant::Nil
            | Constant::True
            | Constant::Integer(_)
            | Constant::Ratio(..)
            | Constant::Float(_)
            | Constant::Character(_)
            | Constant::String(_)
            | Constant::Object(_) => {}
        }
    }

    fn renumber_symbol(&mut self, symbol: &mut Symbol) {
        if let (Home::Uninterned(_), false) = (symbol.home(), self.is_one_unit) {
            if let Some(mut named) = symbol_of_setf_cell(symbol) {
                self.renumber_symbol(&mut named);
                *symbol = setf_cell(&named);
                return;
            }
            let fresh = &mut self.fresh;
            let renumbered = self.uninterned.entry(symbol.clone()).or_insert_with_key(|symbol| {
                *fresh += 1;
                Symbol::uninterned(*fresh - 1, symbol.name())
            });
            *symbol = renumbered.clone();
        }
    }

    fn place(&mut self, constant: Constant) -> PoolIdx {
        let next = PoolIdx(self.linked.constants.len() as u32);
        if let Some(key) = ConstantKey::of(&constant) {
            let index = *self.known.entry(key).or_insert(next);
            if index != next {
                return index;
            }
        }
        self.linked.constants.push(constant);
        next
    }
}

fn move_all(indexes: &mut [PoolIdx], places: &Places) {
    for index in indexes {
        *index = places.constant(*index);
    }
}

fn relocate(function: &mut ModuleFunction, places: &Places) {
    for place in [&mut function.name, &mut function.lambda_list, &mut function.documentation] {
        *place = place.map(|index| places.constant(index));
    }
    if let Some(keys) = &mut function.parameters.keys {
        move_all(keys, places);
    }
    move_all(&mut function.constants, places);
    for LineEntry { source, .. } in &mut function.lines {
        *source = source.saturating_add(places.first_source);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn module(constants: Vec<Constant>) -> Module {
        let function = ModuleFunction {
            constants: (0..constants.len() as u32).map(PoolIdx).collect(),
            lines: vec![LineEntry { pc: 0, source: 0, line: 1, column: 1 }],
            ..ModuleFunction::default()
        };
        Module {
            sources: vec!["a.esl".to_owned()],
            requires: Vec::new(),
            constants,
            functions: vec![function],
            toplevel: vec![FunctionNumber(0)],
        }
    }

    #[test]
    fn constants_without_identity_are_kept_once() {
        let symbol = || Constant::Symbol(Symbol::cl("CAR"));
        let text = || Constant::String("text".into());
        let linked = link([
            module(vec![symbol(), text(), Constant::Float(0.0)]),
            module(vec![text(), symbol(), Constant::Float(-0.0), Constant::Cons(PoolIdx(0), PoolIdx(1))]),
        ]);
        let expected = [
            symbol(),
            text(),
            Constant::Float(0.0),
            text(),
            Constant::Float(-0.0),
            Constant::Cons(PoolIdx(3), PoolIdx(0)),
        ];
        assert_eq!(linked.constants, expected);
        assert_eq!(linked.functions[1].constants, [3, 0, 4, 5].map(PoolIdx));
        assert_eq!(linked.functions[1].lines[0].source, 1);
        assert_eq!(linked.toplevel, [0, 1].map(FunctionNumber));
    }

    #[test]
    fn uninterned_symbols_of_two_modules_stay_different() {
        let g = |id| Constant::Symbol(Symbol::uninterned(id, "G"));
        let linked = link([module(vec![g(7), g(9), g(7)]), module(vec![g(7)])]);
        assert_eq!(linked.constants, [g(0), g(1), g(2)]);
        assert_eq!(linked.functions[0].constants, [0, 1, 0].map(PoolIdx));
    }

    #[test]
    fn modules_of_one_unit_share_symbols_and_sources() {
        let g = |id| Constant::Symbol(Symbol::uninterned(id, "G"));
        let part = |id| Module { sources: vec!["a.esl".into()], ..module(vec![g(id)]) };
        let joined = join([part(7), part(9), part(7)]);
        assert_eq!(joined.constants, [g(7), g(9)]);
        assert_eq!(joined.sources, ["a.esl"]);
    }

    #[test]
    fn functions_are_renumbered() {
        let linked = link([
            module(vec![Constant::Function(FunctionNumber(0))]),
            module(vec![Constant::Function(FunctionNumber(0))]),
        ]);
        let expected = [0, 1].map(|number| Constant::Function(FunctionNumber(number)));
        assert_eq!(linked.constants, expected);
    }
}
