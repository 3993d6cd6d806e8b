//! The constant pool of the module that is being made.
//!
//! Guarantees: the same datum node becomes one entry, so that sharing in a literal is kept; equal symbols,
//! numbers and characters become one entry; entries refer to earlier entries only. Data of any depth are
//! converted without native recursion.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::module::{Constant, FunctionNumber, PoolIdx};
use esl_bytecode::symbol::Symbol;
use esl_bytecode::{BigInt, Integer};
use rustc_hash::FxHashMap;

/// Identity of a constant: for literals with an identity their node, otherwise their value.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum LiteralKey {
    Nil,
    True,
    Symbol(Symbol),
    Integer(Integer),
    Ratio(BigInt, BigInt),
    /// The bits of the float, so that the zeros differ.
    Float(u64),
    Character(char),
    Function(FunctionNumber),
    Class(Symbol),
    Object(u32),
    Node(usize),
}

/// A constant pool. The data given to it must live until it is finished, since nodes are distinguished by
/// address.
#[derive(Debug, Default)]
pub(crate) struct Pool {
    constants: Vec<Constant>,
    known: FxHashMap<LiteralKey, PoolIdx>,
}

impl Pool {
    /// Returns the constants.
    pub(crate) fn finish(self) -> Vec<Constant> {
        self.constants
    }

    /// Returns the entry for `symbol`, which may be `NIL` or `T`.
    pub(crate) fn symbol(&mut self, symbol: &Symbol) -> PoolIdx {
        if symbol.is_cl("NIL") {
            self.enter(LiteralKey::Nil, Constant::Nil)
        } else if symbol.is_cl("T") {
            self.enter(LiteralKey::True, Constant::True)
        } else {
            self.enter(LiteralKey::Symbol(symbol.clone()), Constant::Symbol(symbol.clone()))
        }
    }

    /// Returns the entry for an integer.
    pub(crate) fn integer(&mut self, value: &Integer) -> PoolIdx {
        self.enter(LiteralKey::Integer(value.clone()), Constant::Integer(value.to_big()))
    }

    /// Returns the entry for a function of the module.
    pub(crate) fn function(&mut self, function: FunctionNumber) -> PoolIdx {
        self.enter(LiteralKey::Function(function), Constant::Function(function))
    }

    /// Returns the entry for the structure class named `name`.
    pub(crate) fn class(&mut self, name: &Symbol) -> PoolIdx {
        self.enter(LiteralKey::Class(name.clone()), Constant::Class(name.clone()))
    }

    /// Adds an entry for a vector of entries, which is not shared.
    pub(crate) fn vector(&mut self, items: Vec<PoolIdx>) -> PoolIdx {
        self.push(Constant::Vector(items))
    }

    /// Returns the entry for a datum.
    pub(crate) fn datum(&mut self, datum: &Datum) -> PoolIdx {
        // A datum stays on the stack until its parts have entries.
        let mut pending = vec![datum];
        while let Some(&top) = pending.last() {
            if self.lookup(top).is_some() {
                pending.pop();
                continue;
            }
            let before = pending.len();
            let mut part = |part| {
                let found = self.lookup(part);
                if found.is_none() {
                    pending.push(part);
                }
                found.unwrap_or(PoolIdx(0))
            };
            let constant = match top.kind() {
                DatumKind::Cons(car, cdr) => Constant::Cons(part(car), part(cdr)),
                DatumKind::Vector(items) => Constant::Vector(items.iter().map(part).collect()),
                DatumKind::Array(dimensions, items) => {
                    Constant::Array(dimensions.to_vec(), items.iter().map(part).collect())
                }
                _ => self.leaf(top),
            };
            if pending.len() == before {
                self.enter(key(top), constant);
                pending.pop();
            }
        }
        self.lookup(datum).unwrap_or(PoolIdx(0))
    }

    fn lookup(&self, datum: &Datum) -> Option<PoolIdx> {
        self.known.get(&key(datum)).copied()
    }

    fn leaf(&self, datum: &Datum) -> Constant {
        match datum.kind() {
            DatumKind::Nil => Constant::Nil,
            DatumKind::Symbol(symbol) if symbol.is_cl("NIL") => Constant::Nil,
            DatumKind::Symbol(symbol) if symbol.is_cl("T") => Constant::True,
            DatumKind::Symbol(symbol) => Constant::Symbol(symbol.clone()),
            DatumKind::Integer(value) => Constant::Integer(value.to_big()),
            DatumKind::Ratio(numerator, denominator) => {
                Constant::Ratio(numerator.clone(), denominator.clone())
            }
            DatumKind::Float(value) => Constant::Float(*value),
            DatumKind::Character(c) => Constant::Character(*c),
            DatumKind::String(text) => Constant::String(text.clone()),
            DatumKind::Object(id) => Constant::Object(*id),
            // Calls have been made before a form is compiled; what is the embedder's is in no form.
            DatumKind::Call(_) | DatumKind::Opaque(_) | DatumKind::Packed(_) | DatumKind::Table(_) => {
                Constant::Nil
            }
            DatumKind::Cons(..) | DatumKind::Vector(_) | DatumKind::Array(..) => {
                unreachable!("compound data are handled by the caller")
            }
        }
    }

    fn enter(&mut self, key: LiteralKey, constant: Constant) -> PoolIdx {
        if let Some(&index) = self.known.get(&key) {
            return index;
        }
        let index = self.push(constant);
        self.known.insert(key, index);
        index
    }

    fn push(&mut self, constant: Constant) -> PoolIdx {
        self.constants.push(constant);
        PoolIdx(self.constants.len() as u32 - 1)
    }
}

fn key(datum: &Datum) -> LiteralKey {
    match datum.kind() {
        DatumKind::Nil => LiteralKey::Nil,
        DatumKind::Symbol(symbol) if symbol.is_cl("NIL") => LiteralKey::Nil,
        DatumKind::Symbol(symbol) if symbol.is_cl("T") => LiteralKey::True,
        DatumKind::Symbol(symbol) => LiteralKey::Symbol(symbol.clone()),
        DatumKind::Integer(value) => LiteralKey::Integer(value.clone()),
        DatumKind::Ratio(numerator, denominator) => LiteralKey::Ratio(numerator.clone(), denominator.clone()),
        DatumKind::Float(value) => LiteralKey::Float(value.to_bits()),
        DatumKind::Character(c) => LiteralKey::Character(*c),
        DatumKind::Object(id) => LiteralKey::Object(id.0),
        DatumKind::String(_)
        | DatumKind::Cons(..)
        | DatumKind::Vector(_)
        | DatumKind::Array(..)
        | DatumKind::Opaque(_)
        | DatumKind::Packed(_)
        | DatumKind::Table(_)
        | DatumKind::Call(_) => LiteralKey::Node(datum.identity()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_bytecode::span::Span;

    #[test]
    fn sharing_is_kept_and_equal_atoms_are_merged() {
        let span = Span::default();
        let shared = Datum::list([Datum::integer(1, span)], span);
        let copy = Datum::list([Datum::integer(1, span)], span);
        let whole = Datum::list([shared.clone(), shared.clone(), copy], span);
        let mut pool = Pool::default();
        let index = pool.datum(&whole);
        assert_eq!(pool.datum(&whole), index);
        let part = pool.datum(&shared);
        let constants = pool.finish();
        // NIL, 1, the shared list, its copy, and the three pairs of the whole.
        assert_eq!(constants.len(), 7);
        assert!(matches!(constants[index.0 as usize], Constant::Cons(car, _) if car == part));
    }

    #[test]
    fn a_deep_datum_needs_no_native_stack() {
        let span = Span::default();
        let mut deep = Datum::nil(span);
        for _ in 0..300_000 {
            deep = Datum::list([deep], span);
        }
        let mut pool = Pool::default();
        let top = pool.datum(&deep);
        assert_eq!(top.0 as usize + 1, pool.finish().len());
    }
}
