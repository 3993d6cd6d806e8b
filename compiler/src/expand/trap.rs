//! The trap of guardians: a recovery procedure runs above the call that a guardian has interrupted, so an
//! operation that both call is performed twice at once.
//!
//! It is seen where the procedure, the guardian and both calls stand in one form, and the unit says that
//! the name is one of an operation: by `define-mock` or `start`, or since the host has defined it.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::form::{Form, is_esl, operator};

/// An operation that a recovery procedure and the form that its guardian interrupts both call.
#[derive(Clone, Debug)]
pub(super) struct GuardianTrap {
    pub(super) operation: Symbol,
    /// The call in the procedure.
    pub(super) in_procedure: Span,
    /// The call in the body of the guardian.
    pub(super) in_body: Span,
}

/// Parts of a form that are looked at.
const MOST_PARTS: usize = 10_000;

/// Returns the forms inside `datum`, itself included, that begin with a symbol.
fn forms(datum: &Datum) -> Vec<&Datum> {
    let mut found = Vec::new();
    let mut pending = vec![datum];
    for _ in 0..MOST_PARTS {
        let Some(datum) = pending.pop() else { break };
        if operator(datum).is_some() {
            found.push(datum);
        }
        pending.extend(datum.elements());
    }
    found
}

/// Returns the traps of a `with-recovery-procedures`.
pub(super) fn traps(form: &Form) -> Vec<GuardianTrap> {
    let Some((clauses, body)) = form.args.split_first() else { return Vec::new() };
    let inside: Vec<&Datum> = body.iter().flat_map(forms).collect();
    let is_operator = |datum: &Datum, name| operator(datum).is_some_and(|symbol| is_esl(symbol, name));
    let mut found = Vec::new();
    for guardian in inside.into_iter().filter(|datum| is_operator(datum, "WITH-GUARDIAN")) {
        let parts: Vec<&Datum> = guardian.elements().skip(2).collect();
        let Some((failform, guarded)) = parts.split_first() else { continue };
        let causes: Vec<&Symbol> = forms(failform)
            .into_iter()
            .filter(|datum| is_operator(datum, "FAIL"))
            .filter_map(|datum| datum.elements().nth(1)?.as_symbol())
            .collect();
        for clause in clauses.elements() {
            let Some((head, rest)) = clause.as_cons() else { continue };
            let cause = head.as_symbol().or_else(|| operator(head));
            if !cause.is_some_and(|cause| cause.name() == "GENERAL-FAILURE" || causes.contains(&cause)) {
                continue;
            }
            for call in rest.elements().flat_map(forms) {
                let Some(called) = operator(call) else { continue };
                let mut same = guarded.iter().flat_map(|part| forms(part));
                if let Some(other) = same.find(|other| operator(other) == Some(called)) {
                    let (in_procedure, in_body) = (call.span(), other.span());
                    found.push(GuardianTrap { operation: called.clone(), in_procedure, in_body });
                }
            }
        }
    }
    found
}
