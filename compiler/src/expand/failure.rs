//! Failures at compile time: of macros, and of forms that run while a file is compiled.

use esl_bytecode::compile::{CompileTimeFailure, SourcePlace};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::Span;

use super::form::is_known;

/// Innermost place in the program at which something failed at compile time.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum FailurePlace {
    /// There is none, or it is unknown.
    #[default]
    Unknown,
    /// A place in the texts of the compilation.
    Here(Span),
    /// A place in another source.
    Elsewhere(SourcePlace),
}

/// A failure at compile time.
#[derive(Clone, Debug, Default)]
pub struct MacroFailure {
    /// Report of the failure.
    pub report: String,
    /// Place at which it occurred.
    pub place: FailurePlace,
    /// Objects that the failure is about, the likeliest culprit last.
    pub culprits: Vec<Datum>,
    /// How a call of the macro that failed is written, if that is known.
    pub usage: Option<String>,
}

impl From<CompileTimeFailure> for MacroFailure {
    fn from(failure: CompileTimeFailure) -> MacroFailure {
        let place = failure.place.map_or(FailurePlace::Unknown, FailurePlace::Elsewhere);
        MacroFailure { report: failure.report, place, culprits: failure.culprits, usage: failure.usage }
    }
}

impl MacroFailure {
    /// Returns the place of the part of `form` that the failure is about, if it is about one.
    pub(super) fn faulty_part(&self, form: &Datum) -> Option<Span> {
        self.culprits.iter().rev().find_map(|culprit| match culprit.kind() {
            DatumKind::Nil => None,
            DatumKind::Cons(..) | DatumKind::Vector(_) | DatumKind::Array(..) => {
                find(form, |part| part.is_same(culprit))
            }
            kind => find(form, |part| is_same_atom(part.kind(), kind)),
        })
    }

    /// Adds the place at which the failure occurred to the diagnostic about it.
    pub(super) fn located(&self, diagnostic: Diagnostic) -> Diagnostic {
        match &self.place {
            FailurePlace::Unknown => diagnostic,
            FailurePlace::Here(span) => diagnostic.also(*span, "it failed here"),
            FailurePlace::Elsewhere(place) => {
                diagnostic.help(format!("it failed at {}:{}:{}", place.source, place.line, place.column))
            }
        }
    }
}

/// Whether two data are the same symbol, or equal numbers, characters or strings.
fn is_same_atom(left: &DatumKind, right: &DatumKind) -> bool {
    match (left, right) {
        (DatumKind::Symbol(left), DatumKind::Symbol(right)) => left == right,
        (DatumKind::Integer(left), DatumKind::Integer(right)) => left == right,
        (DatumKind::Float(left), DatumKind::Float(right)) => left.to_bits() == right.to_bits(),
        (DatumKind::Character(left), DatumKind::Character(right)) => left == right,
        (DatumKind::String(left), DatumKind::String(right)) => left == right,
        _ => false,
    }
}

/// Returns the place of the first part inside `form` that `is_wanted`.
fn find(form: &Datum, is_wanted: impl Fn(&Datum) -> bool) -> Option<Span> {
    let mut pending = vec![form];
    while let Some(datum) = pending.pop() {
        if !std::ptr::eq(datum, form) && is_known(datum.span()) && is_wanted(datum) {
            return Some(datum.span());
        }
        if let Some((car, cdr)) = datum.as_cons() {
            pending.extend([cdr, car]);
        }
    }
    None
}
