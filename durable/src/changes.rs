//! The changes from one program to another: by name, and as the forms that an upgrade makes.
//!
//! Two top-level forms are equal if their code is, wherever they are in their texts. So a form whose macro
//! has changed is another one, and so is one that has another number inlined.

use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};

use esl::program::Program;
use esl_bytecode::module::{Constant, FunctionNumber, Module, PoolIdx};
use esl_bytecode::span::SourceId;
use esl_compiler::diagnostic::Sources;
use esl_syntax::{NodeId, SyntaxTree};

/// Names of one kind that are listed.
const LISTED: usize = 8;

/// The kind of a definition, in the messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum ChangedKind {
    Function,
    Variable,
    Structure,
}

impl ChangedKind {
    /// Returns the kind that an operator defines, in lower case.
    fn of_operator(operator: &str) -> Option<ChangedKind> {
        Some(match operator {
            "defun"
            | "defmacro"
            | "defgeneric"
            | "defmethod"
            | "define-modify-macro"
            | "to-achieve"
            | "define-compiler-macro" => ChangedKind::Function,
            "defvar"
            | "defdurable"
            | "defparameter"
            | "defconstant"
            | "define-fluent"
            | "define-input"
            | "define-property"
            | "define-resource"
            | "define-symbol-macro" => ChangedKind::Variable,
            "defstruct" | "defclass" | "define-condition" | "deftype" => ChangedKind::Structure,
            _ => return None,
        })
    }

    /// Returns the plural.
    fn plural(self) -> &'static str {
        match self {
            ChangedKind::Function => "functions",
            ChangedKind::Variable => "variables",
            ChangedKind::Structure => "structures",
        }
    }
}

/// How a definition differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Difference {
    Changed,
    New,
    Gone,
}

/// Forms of one source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct UpgradeForms {
    /// The package in which it begins.
    pub(crate) package: &'static str,
    /// Texts of the forms whose code is new, and of those that change the package, in their order.
    pub(crate) forms: Vec<String>,
}

/// The changes from one program to another.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProgramChanges {
    names: BTreeMap<(ChangedKind, Difference), BTreeSet<String>>,
    /// Whether other top-level forms differ.
    has_other_forms: bool,
    pub(crate) sources: Vec<UpgradeForms>,
}

impl fmt::Display for ProgramChanges {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts: Vec<String> = self
            .names
            .iter()
            .map(|((kind, difference), names)| {
                let difference = match difference {
                    Difference::Changed => "changed",
                    Difference::New => "new",
                    Difference::Gone => "removed",
                };
                format!("{difference} {}: {}", kind.plural(), list(names))
            })
            .collect();
        if self.has_other_forms {
            parts.push("changed forms outside of definitions".into());
        }
        if parts.is_empty() {
            parts.push("only places in its text have changed".into());
        }
        f.write_str(&parts.join("; "))
    }
}

fn list(names: &BTreeSet<String>) -> String {
    let listed: Vec<&str> = names.iter().take(LISTED).map(String::as_str).collect();
    let more = match names.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{}{more}", listed.join(", "))
}

/// Returns how the second program differs from the first. `sources` are those that it was compiled from;
/// without them, the changes name functions only.
pub(crate) fn changes(before: &Program, after: &Program, sources: &Sources) -> ProgramChanges {
    let mut changes = ProgramChanges::default();
    let (old, new) = (before.module(), after.module());
    let mut note = |kind, difference, name: String| {
        changes.names.entry((kind, difference)).or_default().insert(name);
    };
    let (old_functions, new_functions) = (contents(old), contents(new));
    for (name, hash) in &new_functions {
        match old_functions.get(name) {
            Some(old) if old == hash => {}
            Some(_) => note(ChangedKind::Function, Difference::Changed, name.clone()),
            None => note(ChangedKind::Function, Difference::New, name.clone()),
        }
    }
    for name in old_functions.keys().filter(|&name| !new_functions.contains_key(name)) {
        note(ChangedKind::Function, Difference::Gone, name.clone());
    }
    let known = form_hashes(old);
    let fresh: Vec<FunctionNumber> =
        new.toplevel.iter().copied().filter(|&number| !known.contains(&form_hash(new, number))).collect();
    let symbols: HashSet<&str> = old
        .constants
        .iter()
        .filter_map(|constant| match constant {
            Constant::Symbol(symbol) | Constant::Class(symbol) => Some(symbol.name()),
            _ => None,
        })
        .collect();
    let mut placed = 0;
    for (number, name) in new.sources.iter().enumerate() {
        let Some(text) = text_of_source(sources, name) else { continue };
        let places = places_in(new, &fresh, number as u32);
        placed += places.len();
        let tree = SyntaxTree::new(&**text);
        let mut forms = Vec::new();
        for form in forms_at(&tree, &places) {
            let operator = tree.operator(form.node).unwrap_or_default();
            if form.is_fresh {
                match ChangedKind::of_operator(&operator) {
                    Some(kind) => {
                        let name = defined_name(&tree, form.node);
                        let is_known = symbols.contains(name.as_str());
                        let difference = if is_known { Difference::Changed } else { Difference::New };
                        // Other functions than macros and methods are compared by their names, above.
                        if kind != ChangedKind::Function || !new_functions.contains_key(&name) {
                            changes.names.entry((kind, difference)).or_default().insert(name);
                        }
                    }
                    None => changes.has_other_forms |= operator != "define-upgrade",
                }
            }
            if form.is_fresh || operator == "in-package" {
                forms.push(tree.text(form.node).to_owned());
            }
        }
        let is_lisp = name.ends_with(".lisp");
        let package = if is_lisp { "COMMON-LISP-USER" } else { "ESL-USER" };
        changes.sources.push(UpgradeForms { package, forms });
    }
    // Without a text, a form has no operator.
    changes.has_other_forms |= placed < fresh.len();
    // A form that is not there any more has left no definition of a function.
    let kept: HashSet<u64> = form_hashes(new);
    let is_removed = known.iter().any(|hash| !kept.contains(hash));
    changes.has_other_forms |= is_removed && changes.names.is_empty();
    changes
}

/// Returns the text of the source with this name.
fn text_of_source<'a>(sources: &'a Sources, name: &str) -> Option<&'a std::sync::Arc<str>> {
    let number = sources.names().position(|known| known == name)?;
    sources.text(SourceId(u32::try_from(number).ok()?))
}

/// A top-level form of a text.
struct TextForm {
    node: NodeId,
    /// Whether its code is new.
    is_fresh: bool,
}

/// Returns the top-level forms of a text. `places` are lines and columns of new code, from 1.
fn forms_at(tree: &SyntaxTree, places: &[(u32, u32)]) -> Vec<TextForm> {
    let mut forms: Vec<(TextForm, (u32, u32))> = Vec::new();
    let (mut line, mut column, mut at) = (1, 1, 0);
    for node in tree.data(SyntaxTree::ROOT) {
        let start = tree.range(node).start;
        for character in tree.source()[at..start].chars() {
            (line, column) = if character == '\n' { (line + 1, 1) } else { (line, column + 1) };
        }
        at = start;
        forms.push((TextForm { node, is_fresh: false }, (line, column)));
    }
    for place in places {
        let behind = forms.partition_point(|(_, start)| start <= place);
        if let Some((form, _)) = behind.checked_sub(1).and_then(|index| forms.get_mut(index)) {
            form.is_fresh = true;
        }
    }
    forms.into_iter().map(|(form, _)| form).collect()
}

/// Returns the places of those of `functions` that come from a source.
fn places_in(module: &Module, functions: &[FunctionNumber], source: u32) -> Vec<(u32, u32)> {
    let place = |&number: &FunctionNumber| {
        let mut seen = BTreeSet::new();
        first_place(module, number, &mut seen).filter(|&(of, _)| of == source).map(|(_, place)| place)
    };
    functions.iter().filter_map(place).collect()
}

/// Returns the source, and the line and column, of the first code of a function or of one that it makes.
fn first_place(
    module: &Module,
    number: FunctionNumber,
    seen: &mut BTreeSet<u32>,
) -> Option<(u32, (u32, u32))> {
    let function = module.functions.get(number.0 as usize).filter(|_| seen.insert(number.0))?;
    if let Some(entry) = function.lines.first() {
        return Some((entry.source, (entry.line, entry.column)));
    }
    function.constants.iter().find_map(|constant| match module.constants.get(constant.0 as usize) {
        Some(Constant::Function(inner)) => first_place(module, *inner, seen),
        _ => None,
    })
}

/// Returns the name that a definition defines, in upper case.
fn defined_name(tree: &SyntaxTree, form: NodeId) -> String {
    let Some(second) = tree.data(form).nth(1) else { return String::new() };
    // A list begins with the name, or is the name: `(setf x)`.
    let first = || tree.data(second).next().and_then(|first| tree.name(first));
    let name = tree.name(second).or_else(first).unwrap_or_else(|| tree.text(second));
    name.to_uppercase()
}

/// Returns the hashes of the code of the top-level forms.
fn form_hashes(module: &Module) -> HashSet<u64> {
    module.toplevel.iter().map(|&number| form_hash(module, number)).collect()
}

/// Returns the hash of the code of a top-level form, and of the functions that it makes.
fn form_hash(module: &Module, number: FunctionNumber) -> u64 {
    let mut hasher = DefaultHasher::new();
    hash_function(module, number, HashedParts::All, &mut hasher, &mut BTreeSet::new());
    hasher.finish()
}

/// The functions inside of a function that are hashed with it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum HashedParts {
    /// All.
    All,
    /// Those without a global name.
    Local,
}

/// Returns a hash for each name of a global function: of the functions with the name, and of the local
/// functions in them.
fn contents(module: &Module) -> BTreeMap<String, u64> {
    let toplevel: BTreeSet<u32> = module.toplevel.iter().map(|number| number.0).collect();
    let mut contents = BTreeMap::new();
    for (index, function) in module.functions.iter().enumerate() {
        let number = index as u32;
        let name = match function.name {
            _ if toplevel.contains(&number) => continue,
            Some(name) if is_global(module, name) => text_of(module, name, 0),
            _ => continue,
        };
        let mut hasher = DefaultHasher::new();
        hash_function(module, FunctionNumber(number), HashedParts::Local, &mut hasher, &mut BTreeSet::new());
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
    parts: HashedParts,
    hasher: &mut DefaultHasher,
    seen: &mut BTreeSet<u32>,
) {
    let Some(function) = module.functions.get(number.0 as usize) else { return };
    if !seen.insert(number.0) {
        return;
    }
    function.code.hash(hasher);
    function.registers.hash(hasher);
    for text in [function.name, function.lambda_list, function.documentation].into_iter().flatten() {
        text_of(module, text, 0).hash(hasher);
    }
    for &constant in &function.constants {
        match module.constants.get(constant.0 as usize) {
            Some(Constant::Function(inner)) => {
                let name = module.functions.get(inner.0 as usize).and_then(|inner| inner.name);
                match name {
                    Some(name) if parts == HashedParts::Local && is_global(module, name) => {
                        text_of(module, name, 0).hash(hasher);
                    }
                    _ => hash_function(module, *inner, parts, hasher, seen),
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

    /// Returns the changes from one text to another, in words and as forms.
    fn between(before: &str, after: &str) -> (String, Vec<String>) {
        let of = |text: &str| compile(&[Source::new("test.esl", text)]);
        let (before, after) = (of(before), of(after));
        let program = |compiled: &esl::program::Compiled| compiled.program.clone().expect("it compiles");
        let changes = changes(&program(&before), &program(&after), &after.sources);
        (changes.to_string(), changes.sources.into_iter().flat_map(|source| source.forms).collect())
    }

    const ONE: &str = "(defun a () 1) (defun b (x) (lambda () (+ x 1))) (defun c () 3)";

    #[test]
    fn functions_that_differ_are_named() {
        let (said, forms) = between(ONE, "(defun a () 1) (defun b (x) (lambda () (+ x 2))) (defun d () 3)");
        assert_eq!(said, "changed functions: B; new functions: D; removed functions: C");
        assert_eq!(forms, ["(defun b (x) (lambda () (+ x 2)))", "(defun d () 3)"]);
        let (said, forms) = between(ONE, &format!("; a comment\n{ONE}"));
        assert_eq!((&*said, forms.len()), ("only places in its text have changed", 0));
    }

    #[test]
    fn variables_structures_and_other_forms_are_told_apart() {
        let before =
            "(defvar *a* 1) (defstruct rover x) (defun f () (list *a* (make-rover :x 1))) (print (f))";
        let after = "(defvar *a* 2)\n(defvar *b* 2)\n(defstruct rover x y)\n(defstruct wheel)
            (defun f () (list *a* (make-rover :x 1))) (print (list (f)))";
        let (said, forms) = between(before, after);
        for part in [
            "changed variables: *A*",
            "new variables: *B*",
            "changed structures: ROVER",
            "new structures: WHEEL",
            "changed forms outside of definitions",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
        assert!(forms.contains(&"(print (list (f)))".to_owned()), "{forms:?}");
    }

    #[test]
    fn a_use_of_a_macro_that_has_changed_is_another_form() {
        let of = |number: u32| {
            format!("(defmacro m () {number})\n(defun f () (m)) (in-package :esl-user) (defun g () 1)")
        };
        let (said, forms) = between(&of(1), &of(2));
        assert_eq!(said, "changed functions: F, M");
        assert_eq!(forms, ["(defmacro m () 2)", "(defun f () (m))", "(in-package :esl-user)"]);
    }
}
