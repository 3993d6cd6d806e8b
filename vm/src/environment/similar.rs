//! Suggestions for misspelt names.

use esl_bytecode::builtin::BUILTINS;
use esl_bytecode::compile::{Environment, GlobalVariable, NameUse};
use esl_bytecode::package::{PackageId, Qualifier};
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, Symbol};

use crate::heap::layout::SymbolObject;
use crate::value::Value;
use crate::vm::Vm;

/// Greatest number of suggestions.
const MOST: usize = 3;

/// Returns defined names similar to `symbol`, the likeliest first.
pub(super) fn similar(vm: &Vm, symbol: &Symbol, wanted: NameUse) -> Vec<Symbol> {
    let limit = match symbol.name().chars().count() {
        0..=2 => 0,
        3..=5 => 1,
        6..=9 => 2,
        _ => 3,
    };
    let home = symbol.package().and_then(|name| vm.names.packages.named(name)).unwrap_or(PackageId::USER);
    let is_accessible = |candidate: &Symbol| {
        candidate.package() == symbol.package()
            || !matches!(vm.names.packages.qualifier(candidate, home), Qualifier::Internal(_))
    };
    let mut found: Vec<(usize, Symbol)> = Vec::new();
    let mut consider = |candidate: &Symbol| {
        if candidate == symbol || candidate.name().starts_with('%') || candidate.name().starts_with('(') {
            return;
        }
        if is_accessible(candidate)
            && let Some(distance) = distance(symbol.name(), candidate.name(), limit)
        {
            let entry = (distance, candidate.clone());
            if !found.iter().any(|(_, other)| other == candidate) {
                found.push(entry);
            }
        }
    };
    vm.names.each_symbol(&mut |candidate, value| {
        let is_likely = wanted == NameUse::Cause || is_visible(candidate, symbol);
        if is_likely && is_defined(vm, value, wanted) {
            consider(candidate);
        }
    });
    if wanted == NameUse::Function {
        for info in BUILTINS {
            consider(&Symbol::new(&info.package().into(), info.name));
        }
        vm.names.images.each_definition(&mut consider);
    }
    if wanted == NameUse::Type {
        standard_types(vm).iter().for_each(&mut consider);
        vm.names.images.each_definition(&mut |symbol: &Symbol| {
            if is_class_of_image(vm, symbol) || is_defined_type(vm, symbol) {
                consider(symbol);
            }
        });
    }
    // At equal distance, the program's own names come first, then in alphabetical order.
    found.sort_by_key(|(distance, candidate)| {
        let is_foreign = candidate.package() != symbol.package();
        (*distance, is_foreign, candidate.name().to_owned())
    });
    found.into_iter().take(MOST).map(|(_, candidate)| candidate).collect()
}

/// Returns whether `candidate` is a likely meaning of a program that writes `symbol`.
fn is_visible(candidate: &Symbol, symbol: &Symbol) -> bool {
    match candidate.package() {
        None => false,
        Some(home) if &**home == KEYWORD_PACKAGE => false,
        Some(home) => matches!(&**home, CL_PACKAGE | ESL_PACKAGE) || Some(home) == symbol.package(),
    }
}

/// Returns whether a symbol names a type: a class, a type of `deftype`, or a standard type.
pub(super) fn is_type(vm: &Vm, symbol: &Symbol) -> bool {
    let class = super::value_for(vm, symbol).and_then(|value| vm.names.find_class(value));
    class.is_some()
        || is_class_of_image(vm, symbol)
        || is_defined_type(vm, symbol)
        || standard_types(vm).contains(symbol)
}

/// Returns whether a symbol names a type of `deftype`.
fn is_defined_type(vm: &Vm, symbol: &Symbol) -> bool {
    let indicator = Symbol::esl("%TYPE");
    match super::object_for(vm, symbol) {
        Some(object) => super::value_for(vm, &indicator)
            .and_then(|indicator| super::property(&vm.heap, object, indicator))
            .is_some_and(Value::is_true),
        None => vm.names.images.definition(symbol).is_some_and(|(image, definition)| {
            let wanted = Some((ESL_PACKAGE, indicator.name()));
            definition.properties.iter().any(|&(name, _)| vm.names.images.symbol(image, name) == wanted)
        }),
    }
}

/// Returns whether a symbol names a class of the library that has not been made yet.
fn is_class_of_image(vm: &Vm, symbol: &Symbol) -> bool {
    vm.names.images.definition(symbol).is_some_and(|(_, definition)| definition.class.is_some())
}

/// Returns the names in the library's table of types.
fn standard_types(vm: &Vm) -> Vec<Symbol> {
    match vm.global(&Symbol::esl("%STANDARD-TYPES")).variable {
        GlobalVariable::Constant(names) => {
            names.elements().filter_map(|name| name.as_symbol().cloned()).collect()
        }
        _ => Vec::new(),
    }
}

fn is_defined(vm: &Vm, value: Value, wanted: NameUse) -> bool {
    let Some(object) = vm.names.object_of(&vm.heap, value) else { return false };
    match wanted {
        NameUse::Function => {
            vm.names.function_of(&vm.heap, object).is_some()
                || vm.names.macro_function_of(&vm.heap, object).is_some()
        }
        NameUse::Variable => {
            let flags = vm.heap.symbol(object).map_or(0, |cell| cell.header.flags);
            flags & (SymbolObject::SPECIAL | SymbolObject::CONSTANT) != 0
        }
        // The library notes parents, or the condition type, of a cause.
        NameUse::Cause => super::value_for(vm, &Symbol::esl("%CAUSE"))
            .and_then(|indicator| super::property(&vm.heap, object, indicator))
            .is_some_and(Value::is_true),
        NameUse::Type => {
            vm.names.find_class(value).is_some()
                || super::value_for(vm, &Symbol::esl("%TYPE"))
                    .and_then(|indicator| super::property(&vm.heap, object, indicator))
                    .is_some_and(Value::is_true)
        }
    }
}

/// Returns the number of characters to insert, delete, replace or swap with their neighbour to turn `a` into
/// `b`, if it is at most `limit`.
fn distance(a: &str, b: &str, limit: usize) -> Option<usize> {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    if a.len().abs_diff(b.len()) > limit {
        return None;
    }
    // Rows of the table of distances between prefixes: the one before the last, the last, and the next.
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut next = vec![i];
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut best = replaced.min(last[j] + 1).min(next[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                best = best.min(before[j - 2] + 1);
            }
            next.push(best);
        }
        if next.iter().all(|&n| n > limit) {
            return None;
        }
        before = std::mem::replace(&mut last, next);
    }
    last.last().copied().filter(|&n| n <= limit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_count_edits_up_to_a_limit() {
        let table = [
            ("PRINT", "PRINT", Some(0)),
            ("PRNIT", "PRINT", Some(1)),
            ("PRIN", "PRINT", Some(1)),
            ("PLINTS", "PRINT", Some(2)),
            ("COND", "PRINT", None),
            ("", "AB", Some(2)),
        ];
        for (a, b, expected) in table {
            assert_eq!(distance(a, b, 2), expected, "{a} {b}");
        }
    }
}
