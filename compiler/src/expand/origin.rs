//! Macro calls: stopping for them, remembering which call made a form, and blaming the right one.
//!
//! What a macro makes has the place of its call. So a form was written by the program's author if its place is known
//! and is not that of the call that made it ([`Machine::written`]).

use esl_bytecode::compile::{MacroCall, MacroRef};
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::form::{Checked, Form, is_known, name};
use super::machine::{Event, Machine, To, Waiting};
use super::toplevel::Top;
use crate::diagnostic::code;

/// How many macro calls one top-level form may take.
pub(super) const MAX_EXPANSIONS: u32 = 1_000_000;
/// How many macros may expand into one another in one place.
pub(super) const MAX_CHAIN: u32 = 10_000;

/// A macro call that made a form. The outermost one that is written in the source is the one to be shown.
#[derive(Clone, Debug)]
pub(super) struct Origin {
    /// Name of the macro.
    name: Symbol,
    /// Where the call was written.
    span: Span,
    /// Whether the macro belongs to the language: it is not to blame then.
    is_standard: bool,
    /// How many macro calls are around it.
    chain: u32,
}

impl Machine {
    /// Stops for the expansion of a macro call in a form.
    pub(super) fn stop_for_form(
        &mut self,
        function: MacroRef,
        form: &Form,
        is_standard: bool,
        to: To,
    ) -> Checked {
        let origin = self.origin(&form.operator, form.span, is_standard, to.origin)?;
        self.waiting = Waiting::Form(To { origin, ..to });
        self.stop_for_macro(function, form.datum.clone());
        Ok(())
    }

    /// Stops for what a compiler macro makes of a call.
    pub(super) fn stop_for_call(&mut self, compiler_macro: Symbol, form: Form, to: To) -> Checked {
        let origin = self.origin(&form.operator, form.span, true, to.origin)?;
        let datum = form.datum.clone();
        self.waiting = Waiting::Call(form, To { origin, ..to });
        self.stop_for_macro(MacroRef::Global(compiler_macro), datum);
        Ok(())
    }

    /// Stops for the expansion of a macro call that stands for a place.
    pub(super) fn stop_for_place(
        &mut self,
        function: MacroRef,
        form: &Form,
        is_standard: bool,
        to: To,
    ) -> Checked {
        let origin = self.origin(&form.operator, form.span, is_standard, to.origin)?;
        self.waiting = Waiting::Place(To { origin, ..to });
        self.stop_for_macro(function, form.datum.clone());
        Ok(())
    }

    /// Stops for the five values that the macro `expander` gives for a place.
    pub(super) fn stop_for_five(&mut self, expander: Symbol, form: &Form, to: To) -> Checked {
        let origin = self.origin(&form.operator, form.span, true, to.origin)?;
        self.waiting = Waiting::Five(form.datum.clone(), To { origin, ..to });
        self.stop_for_macro(MacroRef::Global(expander), form.datum.clone());
        Ok(())
    }

    /// Stops for the expansion of a top-level macro call.
    pub(super) fn stop_for_top(
        &mut self,
        function: MacroRef,
        form: &Form,
        is_standard: bool,
        top: Top,
    ) -> Checked {
        let origin = self.origin(&form.operator, form.span, is_standard, top.origin)?;
        self.waiting = Waiting::TopLevel(Top { origin, ..top });
        self.stop_for_macro(function, form.datum.clone());
        Ok(())
    }

    fn stop_for_macro(&mut self, function: MacroRef, form: Datum) {
        let locals = self.scope.locals();
        self.stopped = Some(Event::Macro(MacroCall { function, form, locals }));
    }

    /// Notes a macro call, unless there have been too many.
    pub(super) fn origin(
        &mut self,
        operator: &Symbol,
        span: Span,
        is_standard: bool,
        around: Option<u32>,
    ) -> Checked<Option<u32>> {
        let parent = around.map(|index| &self.origins[index as usize]);
        let chain = parent.map_or(0, |parent| parent.chain + 1);
        self.expansions += 1;
        if self.expansions > MAX_EXPANSIONS || chain > MAX_CHAIN {
            let outermost =
                parent.filter(|parent| parent.span == span).map_or(operator, |parent| &parent.name);
            let message = format!("the expansion of {} does not end", name(outermost));
            return Err(Box::new(code::MACRO_FAILED.at(span, message)));
        }
        let origin = match parent {
            // A call that a macro has made is shown as what made it.
            Some(parent) if parent.span == span => Origin { chain, ..parent.clone() },
            _ => Origin { name: operator.clone(), span, is_standard, chain },
        };
        self.origins.push(origin);
        Ok(Some(self.origins.len() as u32 - 1))
    }

    pub(super) fn macro_failed(&mut self, failure: &str, origin: Option<u32>, span: Span) {
        let origin = origin.map(|index| &self.origins[index as usize]);
        let failed = origin.map_or_else(|| "a macro".to_string(), |origin| name(&origin.name));
        let is_standard = origin.is_some_and(|origin| origin.is_standard);
        // The checks of arguments begin with the name of the macro, which is said already.
        let shown = origin.map(|origin| origin.name.to_string() + " ").unwrap_or_default();
        let failure = failure.strip_prefix(&shown).unwrap_or(failure);
        // What fails in a macro of the language is a form that it cannot take.
        let diagnostic = if is_standard {
            code::MALFORMED_FORM.at(span, format!("{failed} {failure}"))
        } else {
            code::MACRO_FAILED.at(span, format!("{failed} failed while it was expanded: {failure}"))
        };
        self.report(diagnostic, None);
    }

    /// Reports a finding about a form that the macro call `origin`, if any, has made.
    pub(super) fn report(&mut self, mut diagnostic: Diagnostic, origin: Option<u32>) {
        if diagnostic.severity == Severity::Error {
            self.errors += 1;
            if let Some(origin) = origin.map(|index| &self.origins[index as usize]) {
                let text = format!("in the expansion of {}", name(&origin.name));
                if diagnostic.primary.span == origin.span && diagnostic.primary.text.is_empty() {
                    diagnostic.primary.text = text;
                } else if !origin.is_standard && is_known(origin.span) {
                    diagnostic = diagnostic.also(origin.span, text);
                }
            }
        }
        // A macro may have used the same part twice.
        let place = (diagnostic.code, diagnostic.primary.span, diagnostic.message.clone());
        if self.reported.insert(place) {
            self.diagnostics.push(diagnostic);
        }
    }

    /// `span`, if a form of that place was written there; an empty one, if the macro call `origin` has made it: what a
    /// macro makes has the place of its call.
    pub(super) fn written(&self, span: Span, origin: Option<u32>) -> Span {
        let is_made = origin.is_some_and(|index| self.origins[index as usize].span == span);
        if is_made { Span::default() } else { span }
    }

    /// Whether a form at `span` was made by a macro that belongs to the language.
    pub(super) fn is_of_library(&self, span: Span, origin: Option<u32>) -> bool {
        let is_made = !is_known(self.written(span, origin));
        is_made && origin.is_some_and(|index| self.origins[index as usize].is_standard)
    }

    /// The findings so far.
    pub(super) fn take_diagnostics(&mut self) -> Vec<Diagnostic> {
        std::mem::take(&mut self.diagnostics)
    }

    /// How many errors have been reported.
    pub(super) fn errors(&self) -> usize {
        self.errors
    }
}
