//! Declarations `(declaim (ftype …))`, compared with inferred types.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::kind::ValueType;
use esl_bytecode::symbol::{CL_PACKAGE, Symbol};
use esl_compiler::core::NodeKind;
use esl_compiler::diagnostic::Sources;

use super::program::ProgramDefinitions;
use super::set::TypeSet;
use super::walk::TypeWalk;
use crate::forms::is_esl;

/// Most parts of a type specifier that are looked at.
const MOST_PARTS: usize = 100;

/// Returns the values of a type specifier, and perhaps more.
pub(super) fn type_of(specifier: &Datum, definitions: &ProgramDefinitions) -> TypeSet {
    let mut all = TypeSet::NONE;
    let mut pending = vec![specifier];
    let mut parts = 0;
    while let Some(part) = pending.pop() {
        parts += 1;
        if parts > MOST_PARTS {
            return TypeSet::ANY;
        }
        let items = part.as_list().unwrap_or_default();
        if let Some(name) = part.as_symbol() {
            all = all.or(type_named(name, definitions));
            continue;
        }
        if part.is_nil() {
            continue;
        }
        let head = items.first().and_then(|head| head.as_symbol());
        match head.map(|head| (head, head.name())) {
            Some((_, "OR")) => pending.extend(items[1..].iter().copied()),
            Some((_, "MEMBER" | "EQL")) => {
                items[1..]
                    .iter()
                    .for_each(|item| all = all.or(TypeSet::of(ValueType::of_datum(item.kind()))));
            }
            Some((_, "VALUES")) => pending.extend(items.get(1)),
            Some((_, "AND" | "NOT" | "SATISFIES")) | None => return TypeSet::ANY,
            Some((name, _)) => all = all.or(type_named(name, definitions)),
        }
    }
    all
}

fn type_named(name: &Symbol, definitions: &ProgramDefinitions) -> TypeSet {
    if !name.is_in(CL_PACKAGE) {
        return match definitions.is_structure(name) {
            true => TypeSet::instances(definitions.classes_below(name)),
            false => TypeSet::ANY,
        };
    }
    TypeSet::of(match name.name() {
        "NULL" => ValueType::NIL,
        "BOOLEAN" | "SYMBOL" => ValueType::SYMBOL,
        "KEYWORD" => ValueType::OTHER_SYMBOL,
        "INTEGER" | "FIXNUM" | "BIGNUM" | "BIT" | "UNSIGNED-BYTE" | "SIGNED-BYTE" | "MOD" => {
            ValueType::INTEGER
        }
        "RATIO" => ValueType::RATIO,
        "RATIONAL" => ValueType::RATIONAL,
        "FLOAT" | "DOUBLE-FLOAT" | "SINGLE-FLOAT" | "SHORT-FLOAT" | "LONG-FLOAT" => ValueType::FLOAT,
        "REAL" => ValueType::REAL,
        "COMPLEX" => ValueType::COMPLEX,
        "NUMBER" => ValueType::NUMBER,
        "CHARACTER" | "BASE-CHAR" | "STANDARD-CHAR" => ValueType::CHARACTER,
        "STRING" | "SIMPLE-STRING" | "BASE-STRING" | "SIMPLE-BASE-STRING" => ValueType::STRING,
        "CONS" => ValueType::PAIR,
        "LIST" => ValueType::LIST,
        "ARRAY" | "SIMPLE-ARRAY" | "VECTOR" => ValueType::ARRAY,
        "SIMPLE-VECTOR" | "BIT-VECTOR" | "SIMPLE-BIT-VECTOR" => ValueType::OTHER_ARRAY,
        "SEQUENCE" => ValueType::SEQUENCE,
        "HASH-TABLE" => ValueType::TABLE,
        _ => ValueType::ANY,
    })
}

/// Returns warnings about declared types that have no value in common with inferred ones.
pub(super) fn findings(walk: &TypeWalk<'_>, sources: &Sources) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for form in &walk.forms.forms {
        for node in &form.core.nodes {
            let NodeKind::Call(_, arguments) = &node.kind else { continue };
            let [name, key, declared] = arguments.as_slice() else { continue };
            let constants = [key, declared].map(|node| match form.kind(*node) {
                NodeKind::Constant(datum) => Some(datum),
                _ => None,
            });
            let (Some(name), [Some(key), Some(declared)]) = (form.symbol(*name), constants) else { continue };
            if !is_esl(key, "%FTYPE") || !crate::is_of_program(sources, node.span) {
                continue;
            }
            let Some(function) = walk.definitions.functions.get(name) else { continue };
            let summary = &walk.summaries[function];
            if !summary.returns {
                continue;
            }
            let text = &walk.forms.forms[function.0 as usize].core.lambdas[function.1.index()];
            let items = declared.as_list().unwrap_or_default();
            let [_, parameters, results @ ..] = items.as_slice() else { continue };
            let shown = name.to_string().to_lowercase();
            let mut warn = |message: String, place| {
                let diagnostic = Diagnostic::new("wrong-type", Severity::Warning, message, node.span);
                found.push(match place {
                    Some(place) => diagnostic.also(place, "as this needs it"),
                    None => diagnostic.also(text.span, "as it is defined here"),
                });
            };
            for (index, parameter) in parameters.elements().enumerate().take(text.required.len()) {
                if matches!(parameter.kind(), DatumKind::Symbol(symbol) if symbol.name().starts_with('&')) {
                    break;
                }
                let (types, fact) = (type_of(parameter, walk.definitions), summary.parameters[index]);
                if types.and(fact.types).is_empty() {
                    let (declared, needed) = (walk.noun(types), walk.noun(fact.types));
                    let message = format!(
                        "`{shown}` is declared to take {declared} as argument {}, and needs {needed}",
                        index + 1
                    );
                    warn(message, fact.needed_at);
                }
            }
            if let [result] = results {
                let types = type_of(result, walk.definitions);
                // Whether a function never returns, as `nil` says, is not known of each.
                if !types.is_empty() && types.and(summary.result).is_empty() {
                    let (declared, given) = (walk.noun(types), walk.noun(summary.result));
                    warn(format!("`{shown}` is declared to return {declared}, and returns {given}"), None);
                }
            }
        }
    }
    found
}
