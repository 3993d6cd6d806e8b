//! Checks of the forms that define operations or need the name of one.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Form, operator};
use super::operation::OperationUse;
use super::origin::OriginId;

/// `(%define-starter name …)`: the expansions of `define-mock` and of the functions of modules contain one
/// for each operation.
pub(super) fn starter(expander: &mut Expander, _: &dyn Environment, form: &Form, _: Option<OriginId>) {
    if let Some(symbol) = form.args.first().and_then(Datum::as_symbol) {
        expander.globals.operations.defined.insert(symbol.clone());
    }
}

/// `(with-world (clause*) . body)`
pub(super) fn world(expander: &mut Expander, _: &dyn Environment, form: &Form, _: Option<OriginId>) {
    for clause in form.args.first().into_iter().flat_map(Datum::elements) {
        let mut parts = clause.elements();
        let is_answer = parts
            .next()
            .and_then(Datum::as_symbol)
            .is_some_and(|key| key.is_keyword() && matches!(key.name(), "ANSWER" | "NEVER"));
        if let Some(call) = parts.next().filter(|_| is_answer)
            && let Some(symbol) = operator(call)
        {
            expander.globals.operations.defined.insert(symbol.clone());
        }
    }
}

/// `(start (name …))`
pub(super) fn start(expander: &mut Expander, _: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    if let Some((named, _)) = form.args.first().and_then(Datum::as_cons)
        && let Some(symbol) = named.as_symbol()
    {
        expander.note_operation(symbol, form.at(named.span()), None, origin);
    }
}

/// `(define-exclusive name [parameter])`
pub(super) fn exclusive(expander: &mut Expander, _: &dyn Environment, form: &Form, origin: Option<OriginId>) {
    let Some((named, rest)) = form.args.split_first() else { return };
    let Some(symbol) = named.as_symbol() else { return };
    expander.globals.operations.exclusive.insert(symbol.clone());
    let parameter = rest.first().filter(|parameter| !parameter.is_nil());
    let parameter =
        parameter.and_then(|parameter| Some((parameter.as_symbol()?.clone(), form.at(parameter.span()))));
    expander.note_operation(symbol, form.at(named.span()), parameter, origin);
}

impl Expander {
    fn note_operation(
        &mut self,
        symbol: &Symbol,
        span: Span,
        parameter: Option<(Symbol, Span)>,
        origin: Option<OriginId>,
    ) {
        let place = self.place_of_use(span, origin);
        let (operation, is_guarded) = (symbol.clone(), self.is_guarded(span));
        self.globals.operations.uses.push(OperationUse { operation, place, parameter, is_guarded });
    }
}
