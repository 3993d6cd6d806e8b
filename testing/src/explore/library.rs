//! Kinds of places that functions of the library change in their arguments, for those that are written in
//! ESL.
//!
//! `tests/library_changes.rs` derives candidates from the library's bytecode: each has to be in the list, or
//! among the functions that were found to change only objects of their own. So no new function is forgotten.

use std::collections::HashMap;
use std::sync::LazyLock;

use esl_bytecode::module::{Constant, Module, PoolIdx};
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol, setf_cell};

use super::unseen::UnseenKind;

/// A line is a name of `COMMON-LISP` or `ESL`, and kinds of places.
const LIST: &str = include_str!("library-changes.txt");

/// The words of the list.
const KINDS: [(UnseenKind, &str); 5] = [
    (UnseenKind::Slot, "slots"),
    (UnseenKind::Element, "elements"),
    (UnseenKind::Pair, "pairs"),
    (UnseenKind::Table, "tables"),
    (UnseenKind::Property, "properties"),
];

/// Returns the kinds of places that a function of the library changes in its arguments.
pub(super) fn changes(function: &Symbol) -> &'static [UnseenKind] {
    static CHANGES: LazyLock<HashMap<&str, Vec<UnseenKind>>> = LazyLock::new(|| {
        let line = |line: &'static str| {
            let (name, words) = line.rsplit_once(": ")?;
            let kind = |word| KINDS.iter().find(|(_, known)| *known == word).map(|(kind, _)| *kind);
            Some((name, words.split(' ').filter_map(kind).collect()))
        };
        LIST.lines().filter_map(line).collect()
    });
    let is_of_library = function.is_in(CL_PACKAGE) || function.is_in(ESL_PACKAGE);
    if is_of_library { CHANGES.get(function.name()).map_or(&[], Vec::as_slice) } else { &[] }
}

/// Returns the symbol that names a function: with `(SETF X)`, the one that keeps it.
pub fn function_symbol(module: &Module, name: PoolIdx) -> Option<Symbol> {
    let constant = |index: PoolIdx| module.constants.get(index.0 as usize);
    match constant(name)? {
        Constant::Symbol(symbol) => Some(symbol.clone()),
        Constant::Cons(first, rest) => match (constant(*first)?, constant(*rest)?) {
            (Constant::Symbol(setf), Constant::Cons(second, _)) if setf.name() == "SETF" => {
                let Constant::Symbol(symbol) = constant(*second)? else { return None };
                Some(setf_cell(symbol))
            }
            _ => None,
        },
        _ => None,
    }
}
