//! Causes and condition types: which clause and which handler applies to which failure.

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::Symbol;

use crate::effect::{FailureKind, mistake};
use crate::forms::CoreForms;
use crate::value::{NameId, Numbering};

/// The standard condition types and their parents.
const STANDARD: &[(&str, &[&str])] = &[
    ("CONDITION", &[]),
    ("SERIOUS-CONDITION", &["CONDITION"]),
    ("ERROR", &["SERIOUS-CONDITION"]),
    ("WARNING", &["CONDITION"]),
    ("STYLE-WARNING", &["WARNING"]),
    ("STORAGE-CONDITION", &["SERIOUS-CONDITION"]),
    ("STACK-EXHAUSTED", &["STORAGE-CONDITION"]),
    ("HEAP-EXHAUSTED", &["STORAGE-CONDITION"]),
    ("SIMPLE-CONDITION", &["CONDITION"]),
    ("SIMPLE-ERROR", &["SIMPLE-CONDITION", "ERROR"]),
    ("SIMPLE-WARNING", &["SIMPLE-CONDITION", "WARNING"]),
    ("TYPE-ERROR", &["ERROR"]),
    ("SIMPLE-TYPE-ERROR", &["SIMPLE-CONDITION", "TYPE-ERROR"]),
    ("ARITHMETIC-ERROR", &["ERROR"]),
    ("DIVISION-BY-ZERO", &["ARITHMETIC-ERROR"]),
    ("FLOATING-POINT-OVERFLOW", &["ARITHMETIC-ERROR"]),
    ("FLOATING-POINT-UNDERFLOW", &["ARITHMETIC-ERROR"]),
    ("FLOATING-POINT-INEXACT", &["ARITHMETIC-ERROR"]),
    ("FLOATING-POINT-INVALID-OPERATION", &["ARITHMETIC-ERROR"]),
    ("CONTROL-ERROR", &["ERROR"]),
    ("PROGRAM-ERROR", &["ERROR"]),
    ("CELL-ERROR", &["ERROR"]),
    ("UNBOUND-VARIABLE", &["CELL-ERROR"]),
    ("UNDEFINED-FUNCTION", &["CELL-ERROR"]),
    ("UNBOUND-SLOT", &["CELL-ERROR"]),
    ("PARSE-ERROR", &["ERROR"]),
    ("STREAM-ERROR", &["ERROR"]),
    ("END-OF-FILE", &["STREAM-ERROR"]),
    ("READER-ERROR", &["PARSE-ERROR", "STREAM-ERROR"]),
    ("FILE-ERROR", &["ERROR"]),
    ("PACKAGE-ERROR", &["ERROR"]),
    ("PRINT-NOT-READABLE", &["ERROR"]),
    ("FAILURE", &["SERIOUS-CONDITION"]),
    ("SIMPLE-PROGRAM-ERROR", &["SIMPLE-CONDITION", "PROGRAM-ERROR"]),
    ("SIMPLE-CONTROL-ERROR", &["SIMPLE-CONDITION", "CONTROL-ERROR"]),
    ("SIMPLE-PARSE-ERROR", &["SIMPLE-CONDITION", "PARSE-ERROR"]),
    ("SIMPLE-STREAM-ERROR", &["SIMPLE-CONDITION", "STREAM-ERROR"]),
    ("DETAILED-TYPE-ERROR", &["SIMPLE-CONDITION", "TYPE-ERROR"]),
    ("CASE-FAILURE", &["TYPE-ERROR"]),
];

/// Whether something applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Applies {
    /// It does not.
    No,
    /// It may.
    Perhaps,
    /// It does.
    Yes,
}

impl From<bool> for Applies {
    fn from(applies: bool) -> Applies {
        if applies { Applies::Yes } else { Applies::No }
    }
}

fn parents_of_standard(name: &str) -> Option<&'static [&'static str]> {
    STANDARD.iter().find(|(known, _)| *known == name).map(|(_, parents)| *parents)
}

/// Whether a symbol names a condition type.
pub(crate) fn is_condition(forms: &CoreForms, symbol: &Symbol) -> bool {
    !symbol.is_keyword() && (forms.condition_types.contains(symbol) || is_standard(symbol))
}

pub(crate) fn is_standard(symbol: &Symbol) -> bool {
    (symbol.is_in("COMMON-LISP") || symbol.is_in("ESL")) && parents_of_standard(symbol.name()).is_some()
}

/// Whether a clause for a cause may take programming errors: a value of a wrong type, a division by zero.
pub(crate) fn may_be_mistake(forms: &CoreForms, cause: &Symbol) -> bool {
    !cause.is_keyword() || is_mistake(cause.name()) || forms.redefines_mistakes
}

/// Returns whether a cause is that of conditions of Lisp, such as `:type-error`.
pub(crate) fn is_of_mistake(cause: &Symbol) -> bool {
    cause.is_keyword() && is_mistake(cause.name())
}

/// Whether a cause or a type with this name is one of the standard.
pub(crate) fn is_mistake(name: &str) -> bool {
    name == "T" || parents_of_standard(name).is_some()
}

/// Returns the condition type whose failures have this cause.
pub(crate) fn condition_of(forms: &CoreForms, cause: &Symbol) -> Option<Symbol> {
    if forms.parents.contains_key(cause) {
        return None;
    }
    if let Some(own) = forms.condition_types.iter().find(|known| known.name() == cause.name()) {
        return Some(own.clone());
    }
    parents_of_standard(cause.name()).map(|_| Symbol::cl(cause.name()))
}

/// Returns a cause as a program has it: in lower case, or between bars if it could not be read otherwise.
pub fn shown_cause(cause: &Symbol) -> String {
    let name = cause.name();
    let is_plain =
        |c: char| !c.is_lowercase() && !c.is_whitespace() && !c.is_control() && !"\"#'(),;`:|\\".contains(c);
    if !name.is_empty() && name.chars().all(is_plain) {
        return cause.to_string().to_lowercase();
    }
    let escaped = name.replace('\\', "\\\\").replace('|', "\\|");
    format!("{}|{escaped}|", if cause.is_keyword() { ":" } else { "" })
}

/// Returns the cause of conditions of a type.
pub(crate) fn cause_of_condition(condition: &Symbol) -> Symbol {
    let name = condition.name();
    Symbol::keyword(match name {
        "SIMPLE-PROGRAM-ERROR" => "PROGRAM-ERROR",
        "SIMPLE-CONTROL-ERROR" => "CONTROL-ERROR",
        "SIMPLE-PARSE-ERROR" => "PARSE-ERROR",
        "SIMPLE-STREAM-ERROR" => "STREAM-ERROR",
        "DETAILED-TYPE-ERROR" | "CASE-FAILURE" => "TYPE-ERROR",
        other => other,
    })
}

/// Returns the names of a condition type and of all above it.
fn names_above_condition(forms: &CoreForms, condition: &Symbol) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    let mut pending = vec![condition.clone()];
    while let Some(symbol) = pending.pop() {
        if names.iter().any(|known| known == symbol.name()) {
            continue;
        }
        names.push(symbol.name().to_string());
        match (forms.parents.get(&symbol), parents_of_standard(symbol.name())) {
            (Some(parents), _) if parents.is_empty() => pending.push(Symbol::cl("CONDITION")),
            (Some(parents), _) => pending.extend(parents.iter().cloned()),
            (None, Some(parents)) => pending.extend(parents.iter().map(|name| Symbol::cl(name))),
            (None, None) => {}
        }
    }
    names
}

/// Whether `ancestor` is above a cause.
pub(crate) fn is_above_cause(forms: &CoreForms, cause: &Symbol, ancestor: &Symbol) -> bool {
    let mut seen: Vec<&Symbol> = Vec::new();
    let mut pending = vec![cause];
    while let Some(symbol) = pending.pop() {
        if symbol == ancestor {
            return true;
        }
        if !seen.contains(&symbol) {
            seen.push(symbol);
            pending.extend(forms.parents.get(symbol).into_iter().flatten());
        }
    }
    false
}

/// Whether a clause of a recovery form for `wanted` applies to a failure.
pub(crate) fn clause_applies(
    forms: &CoreForms,
    names: &Numbering<Symbol>,
    kind: FailureKind,
    wanted: &Symbol,
) -> Applies {
    if wanted.name() == "GENERAL-FAILURE" && wanted.is_keyword() {
        return Applies::Yes;
    }
    let symbol = |name: NameId| &names.keys[name.index()];
    match kind {
        FailureKind::Cause(name) => {
            let cause = symbol(name);
            if is_above_cause(forms, cause, wanted) {
                return Applies::Yes;
            }
            let condition = condition_of(forms, cause);
            condition.is_some_and(|one| condition_has_name(forms, &one, wanted)).into()
        }
        FailureKind::Below(name) if is_above_cause(forms, symbol(name), wanted) => Applies::Yes,
        FailureKind::Below(name) if is_above_cause(forms, wanted, symbol(name)) => Applies::Perhaps,
        FailureKind::Below(_) => Applies::No,
        FailureKind::Condition(name) | FailureKind::CauseOf(name) => {
            condition_has_name(forms, symbol(name), wanted).into()
        }
        FailureKind::Any(_) | FailureKind::Unknown(_) => Applies::Perhaps,
    }
}

/// Returns the causes of the clauses that may take failures of a kind, beside `:general-failure`; `None` if
/// any may.
pub(crate) fn clause_causes(
    forms: &CoreForms,
    names: &Numbering<Symbol>,
    kind: FailureKind,
) -> Option<Vec<Symbol>> {
    let of_condition = |condition: &Symbol| -> Vec<Symbol> {
        names_above_condition(forms, condition).iter().map(|name| Symbol::keyword(name)).collect()
    };
    match kind {
        FailureKind::Cause(name) => {
            let cause = &names.keys[name.index()];
            let mut found = vec![cause.clone()];
            let mut next = 0;
            while let Some(symbol) = found.get(next) {
                let parents = forms.parents.get(symbol).into_iter().flatten();
                let more: Vec<Symbol> = parents.filter(|parent| !found.contains(parent)).cloned().collect();
                found.extend(more);
                next += 1;
            }
            found.extend(condition_of(forms, cause).iter().flat_map(of_condition));
            Some(found)
        }
        FailureKind::Condition(name) | FailureKind::CauseOf(name) => {
            Some(of_condition(&names.keys[name.index()]))
        }
        FailureKind::Below(_) | FailureKind::Any(_) | FailureKind::Unknown(_) => None,
    }
}

fn condition_has_name(forms: &CoreForms, condition: &Symbol, wanted: &Symbol) -> bool {
    wanted.is_keyword() && names_above_condition(forms, condition).iter().any(|name| name == wanted.name())
}

/// Whether a failure is a condition of a type.
pub(crate) fn is_of_type(
    forms: &CoreForms,
    names: &Numbering<Symbol>,
    kind: FailureKind,
    wanted: &Datum,
) -> Applies {
    let Some(symbol) = wanted.as_symbol() else {
        let mut parts = wanted.elements();
        let operator = parts.next().and_then(Datum::as_symbol).map(|symbol| symbol.name().to_string());
        let parts = parts.map(|part| is_of_type(forms, names, kind, part));
        return match operator.as_deref() {
            Some("OR") => parts.max().unwrap_or(Applies::No),
            Some("AND") => parts.min().unwrap_or(Applies::Yes),
            _ => Applies::Perhaps,
        };
    };
    let name = symbol.name();
    let is_wide = matches!(name, "SERIOUS-CONDITION" | "CONDITION" | "T");
    match kind {
        FailureKind::Cause(_) | FailureKind::Below(_) | FailureKind::CauseOf(_) => {
            (is_wide || name == "FAILURE").into()
        }
        FailureKind::Condition(condition) => {
            let condition = &names.keys[condition.index()];
            if !is_condition(forms, condition) {
                return Applies::Perhaps;
            }
            let above = names_above_condition(forms, condition);
            (name == "T" || above.iter().any(|known| known == name)).into()
        }
        FailureKind::Any(_) | FailureKind::Unknown(_) if is_wide => Applies::Yes,
        FailureKind::Any(_) | FailureKind::Unknown(_) => Applies::Perhaps,
    }
}

/// Returns the kinds of programming errors that the type or cause of this name takes all of, and those that
/// it takes some of.
pub(crate) fn mistakes_named(name: &str) -> (u8, u8) {
    use mistake::*;
    match name {
        "TYPE-ERROR" => (TYPE, TYPE | CAUSE),
        "ARITHMETIC-ERROR" => (ARITHMETIC, ARITHMETIC | CAUSE),
        "CELL-ERROR" => (NAME, NAME | CAUSE),
        "ERROR" => (ALL & !CRITICAL & !CONSEQUENCE & !CAUSE, ALL & !CRITICAL & !CONSEQUENCE),
        "GENERAL-FAILURE" | "SERIOUS-CONDITION" | "CONDITION" | "T" => (ALL, ALL),
        "FAILURE" => (CRITICAL | CONSEQUENCE | CAUSE, CRITICAL | CONSEQUENCE | CAUSE),
        "DIVISION-BY-ZERO" | "FLOATING-POINT-OVERFLOW" | "FLOATING-POINT-UNDERFLOW" => {
            (0, ARITHMETIC | CAUSE)
        }
        "UNBOUND-VARIABLE" | "UNDEFINED-FUNCTION" | "UNBOUND-SLOT" => (0, NAME | CAUSE),
        "PROGRAM-ERROR" | "CONTROL-ERROR" => (0, PROGRAM | CAUSE),
        "BUDGET-EXHAUSTED" | "WOULD-BLOCK" => (0, CRITICAL),
        "ALL-FAILED" => (0, CONSEQUENCE),
        "FILE-ERROR" | "STREAM-ERROR" | "PARSE-ERROR" | "END-OF-FILE" | "READER-ERROR" | "SIMPLE-ERROR"
        | "PACKAGE-ERROR" | "PRINT-NOT-READABLE" => (0, OTHER | CAUSE),
        _ => (0, 0),
    }
}

/// The same for a type as it is written.
pub(crate) fn mistakes_of_type(wanted: &Datum) -> (u8, u8) {
    match wanted.as_symbol() {
        Some(symbol) => mistakes_named(symbol.name()),
        None => {
            let parts = wanted.elements().skip(1).map(mistakes_of_type);
            let all = parts.fold((0, 0), |(all, some), (more, perhaps)| (all | more, some | perhaps));
            let is_or = wanted
                .elements()
                .next()
                .and_then(Datum::as_symbol)
                .is_some_and(|symbol| symbol.name() == "OR");
            if is_or { all } else { (0, mistake::ALL) }
        }
    }
}

/// Kinds of programming errors, with their causes.
pub(crate) const MISTAKES: [(u8, &str); 8] = [
    (mistake::TYPE, "TYPE-ERROR"),
    (mistake::ARITHMETIC, "ARITHMETIC-ERROR"),
    (mistake::NAME, "CELL-ERROR"),
    (mistake::PROGRAM, "PROGRAM-ERROR"),
    (mistake::OTHER, "ERROR"),
    (mistake::CRITICAL, "WOULD-BLOCK"),
    (mistake::CONSEQUENCE, "ALL-FAILED"),
    (mistake::CAUSE, "ERROR"),
];
