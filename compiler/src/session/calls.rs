//! The calls in a datum that was read: `#.form`, `#S(…)`, circular literals and the like.
//!
//! A form is compiled when all its calls have been made, the inner ones before those around them. Each is the
//! call of a macro of the library that returns `(quote datum)`; the datum takes the place of the call. A call
//! that the form reaches twice is made once, so that labels keep their meaning.

use esl_bytecode::compile::{MacroCall, MacroRef};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::locals::Locals;
use esl_bytecode::span::Span;
use rustc_hash::{FxHashMap, FxHashSet};

/// A form whose calls are being made.
#[derive(Debug)]
pub(super) struct FormCalls {
    form: Datum,
    /// Calls to be made, the next one last.
    calls: Vec<Datum>,
    /// Results that replace calls, by the addresses of the calls' nodes.
    made: FxHashMap<usize, Datum>,
}

impl FormCalls {
    /// Finds the calls in `form`.
    pub(super) fn new(form: Datum) -> FormCalls {
        let mut calls = Vec::new();
        let mut seen: FxHashSet<usize> = FxHashSet::default();
        // The parts of a node are met after it, the last one first; so the calls are in the wanted order.
        let mut pending = vec![&form];
        while let Some(datum) = pending.pop() {
            if !datum.has_calls() || !seen.insert(datum.identity()) {
                continue;
            }
            match datum.kind() {
                DatumKind::Call(call) => {
                    calls.push(datum.clone());
                    pending.push(call);
                }
                DatumKind::Cons(car, cdr) => pending.extend([car, cdr]),
                DatumKind::Vector(items) | DatumKind::Array(_, items) => pending.extend(items.iter()),
                _ => {}
            }
        }
        FormCalls { form, calls, made: FxHashMap::default() }
    }

    /// Returns the next call to be made; `None` if all have been made.
    pub(super) fn next(&self) -> Option<MacroCall> {
        let DatumKind::Call(call) = self.calls.last()?.kind() else { return None };
        let form = self.replace(call);
        let operator = form.as_cons()?.0.as_symbol()?.clone();
        Some(MacroCall { function: MacroRef::Global(operator), form, locals: Locals::default() })
    }

    /// Returns the place of the call that is being made.
    pub(super) fn span(&self) -> Span {
        self.calls.last().unwrap_or(&self.form).span()
    }

    /// Takes the expansion of the call that is being made.
    pub(super) fn take(&mut self, expansion: &Datum) {
        let Some(call) = self.calls.pop() else { return };
        let items = expansion.as_list().unwrap_or_default();
        let datum = items.get(1).map_or(expansion, |datum| *datum);
        self.made.insert(call.identity(), datum.clone());
    }

    /// Returns the form without calls.
    pub(super) fn finish(self) -> Datum {
        self.replace(&self.form)
    }

    /// Returns `datum` with data in the places of the calls that have been made.
    fn replace(&self, datum: &Datum) -> Datum {
        enum Walk<'a> {
            Visit(&'a Datum),
            Build(&'a Datum),
        }
        let mut built: FxHashMap<usize, Datum> = FxHashMap::default();
        let mut done: Vec<Datum> = Vec::new();
        let mut steps = vec![Walk::Visit(datum)];
        while let Some(step) = steps.pop() {
            match step {
                Walk::Visit(datum) => {
                    let known = built.get(&datum.identity()).or_else(|| self.made.get(&datum.identity()));
                    if let Some(known) = known {
                        done.push(known.clone());
                        continue;
                    }
                    match datum.kind() {
                        DatumKind::Cons(car, cdr) if datum.has_calls() => {
                            steps.extend([Walk::Build(datum), Walk::Visit(cdr), Walk::Visit(car)]);
                        }
                        DatumKind::Vector(items) | DatumKind::Array(_, items) if datum.has_calls() => {
                            steps.push(Walk::Build(datum));
                            steps.extend(items.iter().rev().map(Walk::Visit));
                        }
                        _ => done.push(datum.clone()),
                    }
                }
                Walk::Build(datum) => {
                    let count = match datum.kind() {
                        DatumKind::Vector(items) | DatumKind::Array(_, items) => items.len(),
                        _ => 2,
                    };
                    let parts = done.split_off(done.len() - count);
                    let kind = match datum.kind() {
                        DatumKind::Array(dimensions, _) => DatumKind::Array(dimensions.clone(), parts.into()),
                        DatumKind::Cons(..) => DatumKind::Cons(parts[0].clone(), parts[1].clone()),
                        _ => DatumKind::Vector(parts.into()),
                    };
                    let new = Datum::new(kind, datum.span());
                    built.insert(datum.identity(), new.clone());
                    done.push(new);
                }
            }
        }
        done.pop().unwrap_or_else(|| datum.clone())
    }
}
