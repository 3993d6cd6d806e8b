//! The difference between two programs, by the names of their functions.

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash, Hasher};

use esl::program::Program;
use esl_bytecode::module::{Constant, FunctionNumber, Module, PoolIdx};

/// Names of one kind that are listed.
const LISTED: usize = 8;

/// Returns how the second program differs from the first, in words.
pub(crate) fn difference(before: &Program, after: &Program) -> String {
    let (before, after) = (contents(before.module()), contents(after.module()));
    let names = |pick: &dyn Fn(&str) -> bool| {
        let all: BTreeSet<&str> = before.keys().chain(after.keys()).map(String::as_str).collect();
        all.into_iter().filter(|name| pick(name)).map(str::to_owned).collect::<Vec<String>>()
    };
    let changed =
        names(&|name| before.get(name).is_some_and(|old| after.get(name).is_some_and(|new| old != new)));
    let added = names(&|name| !before.contains_key(name));
    let gone = names(&|name| !after.contains_key(name));
    let parts = [("changed", changed), ("new", added), ("gone", gone)];
    let said: Vec<String> = parts
        .iter()
        .filter(|(_, names)| !names.is_empty())
        .map(|(kind, names)| format!("{kind}: {}", list(names)))
        .collect();
    if said.is_empty() { "only places in its text have changed".into() } else { said.join("; ") }
}

fn list(names: &[String]) -> String {
    let listed: Vec<&str> = names.iter().take(LISTED).map(String::as_str).collect();
    let more = match names.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{}{more}", listed.join(", "))
}

/// Returns a hash for each name of a global function: of the functions with the name, and of the local
/// functions in them.
fn contents(module: &Module) -> BTreeMap<String, u64> {
    let toplevel: BTreeSet<u32> = module.toplevel.iter().map(|number| number.0).collect();
    let mut contents = BTreeMap::new();
    for (index, function) in module.functions.iter().enumerate() {
        let number = index as u32;
        let name = match function.name {
            _ if toplevel.contains(&number) => "the top-level forms".into(),
            Some(name) if is_global(module, name) => text_of(module, name, 0),
            _ => continue,
        };
        let mut hasher = DefaultHasher::new();
        hash_function(module, FunctionNumber(number), &mut hasher, &mut BTreeSet::new());
        let hash: &mut u64 = contents.entry(name).or_insert(0);
        *hash = hash.rotate_left(7) ^ hasher.finish();
    }
    contents
}

/// Returns whether a name is that of a global function: a symbol, or a list such as `(SETF X)`. Names of
/// local functions are other lists.
fn is_global(module: &Module, name: PoolIdx) -> bool {
    let constant = |index: PoolIdx| module.constants.get(index.0 as usize);
    match constant(name) {
        Some(Constant::Cons(head, _)) => {
            matches!(constant(*head), Some(Constant::Symbol(symbol)) if symbol.name() == "SETF")
        }
        Some(Constant::Symbol(_)) => true,
        _ => false,
    }
}

/// Hashes a function, and the local functions that it makes.
fn hash_function(
    module: &Module,
    number: FunctionNumber,
    hasher: &mut DefaultHasher,
    seen: &mut BTreeSet<u32>,
) {
    let Some(function) = module.functions.get(number.0 as usize) else { return };
    if !seen.insert(number.0) {
        return;
    }
    function.code.hash(hasher);
    function.registers.hash(hasher);
    for &constant in &function.constants {
        match module.constants.get(constant.0 as usize) {
            Some(Constant::Function(inner)) => {
                let name = module.functions.get(inner.0 as usize).and_then(|inner| inner.name);
                match name {
                    Some(name) if is_global(module, name) => text_of(module, name, 0).hash(hasher),
                    _ => hash_function(module, *inner, hasher, seen),
                }
            }
            _ => text_of(module, constant, 0).hash(hasher),
        }
    }
}

/// Lists in lists that are looked into.
const DEPTH: usize = 100;

/// Returns a constant as a text.
fn text_of(module: &Module, constant: PoolIdx, depth: usize) -> String {
    let part = |part: &PoolIdx| text_of(module, *part, depth + 1);
    match module.constants.get(constant.0 as usize) {
        _ if depth > DEPTH => "…".into(),
        Some(Constant::Symbol(symbol)) => symbol.name().to_string(),
        Some(Constant::Nil) => "NIL".into(),
        Some(Constant::Cons(car, cdr)) => {
            let mut items = vec![part(car)];
            let mut rest = *cdr;
            while let Some(Constant::Cons(car, cdr)) = module.constants.get(rest.0 as usize) {
                items.push(part(car));
                rest = *cdr;
            }
            match module.constants.get(rest.0 as usize) {
                Some(Constant::Nil) => format!("({})", items.join(" ")),
                _ => format!("({} . {})", items.join(" "), part(&rest)),
            }
        }
        Some(Constant::Vector(items)) => {
            format!("#({})", items.iter().map(part).collect::<Vec<_>>().join(" "))
        }
        Some(Constant::Function(_)) => "#<function>".into(),
        Some(other) => format!("{other:?}"),
        None => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl::program::{Source, compile};

    fn program(text: &str) -> Program {
        compile(&[Source::new("test.esl", text)]).program.expect("it compiles")
    }

    #[test]
    fn what_differs_is_named() {
        let one = program("(defun a () 1) (defun b (x) (lambda () (+ x 1))) (defun c () 3)");
        let of = |text: &str| difference(&one, &program(text));
        assert_eq!(
            of("(defun a () 1) (defun b (x) (lambda () (+ x 2))) (defun d () 3)"),
            "changed: B, the top-level forms; new: D; gone: C"
        );
        assert_eq!(
            of("\n(defun a () 1) (defun b (x) (lambda () (+ x 1))) (defun c () 3)"),
            "only places in its text have changed"
        );
    }
}
