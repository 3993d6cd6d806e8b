//! The success types of the functions of the library that are written in ESL: a table that is made from its
//! sources, since a program is checked without them.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use esl_bytecode::kind::ValueType;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol};
use esl_compiler::core::Core;
use rustc_hash::FxHashMap;

use super::program::{DefinedBy, ProgramDefinitions};
use super::set::TypeSet;
use super::walk::{FunctionSummary, TypeWalk};
use crate::forms::CoreForms;

/// The table: a line for each function of which something is known, `name parameter… -> value`, with the word
/// of a key before its parameter.
const TABLE: &str = include_str!("library.txt");

/// The words of the table. Of a set, the first that fit are taken.
const WORDS: [(&str, ValueType); 22] = [
    ("any", ValueType::ANY),
    ("sequence", ValueType::SEQUENCE),
    ("number", ValueType::NUMBER),
    ("real", ValueType::REAL),
    ("array", ValueType::ARRAY),
    ("list", ValueType::LIST),
    ("symbol", ValueType::SYMBOL),
    ("nil", ValueType::NIL),
    ("other-symbol", ValueType::OTHER_SYMBOL),
    ("integer", ValueType::INTEGER),
    ("ratio", ValueType::RATIO),
    ("float", ValueType::FLOAT),
    ("complex", ValueType::COMPLEX),
    ("character", ValueType::CHARACTER),
    ("string", ValueType::STRING),
    ("pair", ValueType::PAIR),
    ("other-array", ValueType::OTHER_ARRAY),
    ("table", ValueType::TABLE),
    ("function", ValueType::FUNCTION),
    ("instance", ValueType::INSTANCE),
    ("stream", ValueType::STREAM),
    ("other", ValueType::OTHER),
];

/// Types of a function of the library.
#[derive(Clone, Debug)]
pub struct LibraryTypes {
    /// Those of required and optional parameters.
    pub positional: Vec<ValueType>,
    /// The names of keys, in upper case, with the types of their parameters.
    pub keys: Vec<(String, ValueType)>,
    /// That of the first value.
    pub result: ValueType,
}

/// Returns the types of the functions of the library, by their names in upper case.
#[doc(hidden)]
pub fn library_types() -> &'static FxHashMap<String, LibraryTypes> {
    static TYPES: LazyLock<FxHashMap<String, LibraryTypes>> =
        LazyLock::new(|| TABLE.lines().filter_map(parsed).collect());
    &TYPES
}

/// Returns the types of the function that a symbol names in each program.
pub(super) fn types_of(symbol: &Symbol) -> Option<&'static LibraryTypes> {
    let is_of_library = symbol.package().is_some_and(|home| matches!(&**home, CL_PACKAGE | ESL_PACKAGE));
    if is_of_library { library_types().get(symbol.name()) } else { None }
}

fn parsed(line: &str) -> Option<(String, LibraryTypes)> {
    let (name, rest) = line.split_once(' ')?;
    let (parameters, result) = rest.split_once("-> ")?;
    let mut types = LibraryTypes { positional: Vec::new(), keys: Vec::new(), result: union(result) };
    let mut words = parameters.split(' ').filter(|word| !word.is_empty());
    while let Some(word) = words.next() {
        match word.strip_prefix(':') {
            Some(key) => types.keys.push((key.to_uppercase(), union(words.next()?))),
            None => types.positional.push(union(word)),
        }
    }
    Some((name.to_uppercase(), types))
}

/// Returns the set that words name; one that has an unknown word has all values.
fn union(words: &str) -> ValueType {
    let of =
        |word: &str| WORDS.iter().find(|(known, _)| *known == word).map_or(ValueType::ANY, |found| found.1);
    words.split('|').map(of).fold(ValueType::NONE, ValueType::or)
}

/// Returns the table for the sources of the library.
#[doc(hidden)]
pub fn table_of_library(cores: Vec<Core>) -> String {
    let forms = CoreForms::new(cores);
    let definitions = ProgramDefinitions::new(&forms, DefinedBy::Library);
    let mut walk = TypeWalk::new(&forms, &definitions);
    super::infer(&mut walk);
    let mut rows = BTreeMap::new();
    for (name, key) in &definitions.functions {
        let summary = &walk.summaries[key];
        let tells = summary.result.values != ValueType::ANY
            || summary.parameters.iter().any(|fact| fact.types.values != ValueType::ANY);
        if !name.name().contains('%') && summary.returns && tells {
            let text = &forms.forms[key.0 as usize].core.lambdas[key.1.index()];
            let positional = text.required.len() + text.optional.len();
            let keys: Vec<&Symbol> = text.keys.iter().flatten().map(|key| &key.key).collect();
            rows.insert(name.to_string().to_lowercase(), row(summary, positional, &keys));
        }
    }
    rows.into_iter().map(|(name, row)| format!("{name}{row}\n")).collect()
}

fn row(summary: &FunctionSummary, positional: usize, keys: &[&Symbol]) -> String {
    let mut row = String::new();
    for (index, fact) in summary.parameters.iter().enumerate() {
        if let Some(key) = index.checked_sub(positional).and_then(|index| keys.get(index)) {
            row += &format!(" :{}", key.name().to_lowercase());
        }
        row += &format!(" {}", words(fact.types));
    }
    row + &format!(" -> {}", words(summary.result))
}

fn words(types: TypeSet) -> String {
    let mut left = types.values;
    let mut words = Vec::new();
    for (word, values) in WORDS {
        if !left.is_empty() && left.contains(values) {
            words.push(word);
            left = left.without(values);
        }
    }
    words.join("|")
}
