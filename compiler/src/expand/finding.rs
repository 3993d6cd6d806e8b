//! Findings: what is reported of a form, and of the macro that made it.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;

use super::expander::Expander;
use super::failure::MacroFailure;
use super::form::{is_known, name, span_of};
use super::origin::OriginId;
use super::unit::UnitFindings;
use crate::diagnostic::code;

/// Findings beyond which further warnings are dropped: they would take memory and help no reader.
const MAX_FINDINGS: usize = 10_000;

impl Expander {
    /// Takes the findings so far.
    pub fn take_diagnostics(&mut self) -> Vec<Diagnostic> {
        std::mem::take(&mut self.diagnostics)
    }

    /// Finishes the unit: returns the findings so far, undefined names, and calls with unsuitable arguments.
    /// Undefined names are left out unless the unit `is_whole`.
    pub fn finish(&mut self, environment: &dyn Environment, is_whole: bool) -> UnitFindings {
        let mut findings = self.globals.finish(environment, is_whole);
        findings.diagnostics.splice(..0, self.take_diagnostics());
        findings
    }

    /// Returns the number of errors found so far.
    pub fn errors(&self) -> usize {
        self.errors
    }

    /// Reports the failure of the macro whose call at `span` the expander stopped for.
    pub(super) fn macro_failed(&mut self, failure: &MacroFailure, origin: Option<OriginId>, span: Span) {
        let origin = origin.map(|origin| self.origins.get(origin));
        let failed = origin.map_or_else(|| "a macro".to_string(), |origin| name(&origin.name));
        let is_standard = origin.is_some_and(|origin| origin.is_standard);
        // Checks of arguments begin with the name of the macro, which the message contains already.
        let shown = origin.map(|origin| origin.name.to_string() + " ").unwrap_or_default();
        let report = failure.report.strip_prefix(&shown).unwrap_or(&failure.report);
        let call = self.call.take();
        let head = call.as_ref().and_then(Datum::as_cons).map_or(span, |(head, _)| span_of(head, span));
        // A macro of the language fails only on a form that it cannot take.
        let diagnostic = if is_standard {
            let part = call.and_then(|call| failure.faulty_part(&call));
            let diagnostic = code::MALFORMED_FORM.at(part.unwrap_or(head), format!("{failed} {report}"));
            match &failure.usage {
                Some(usage) => diagnostic.help(format!("it is written `{usage}`")),
                None => diagnostic,
            }
        } else {
            let message = format!("{failed} failed while it was expanded: {report}");
            failure.located(code::MACRO_FAILED.at(head, message))
        };
        self.report(diagnostic, None);
    }

    /// Reports a finding about a form that the macro call `origin`, if any, has made.
    pub(super) fn report(&mut self, mut diagnostic: Diagnostic, origin: Option<OriginId>) {
        if diagnostic.severity == Severity::Error {
            self.errors += 1;
            if let Some(origin) = origin.map(|origin| self.origins.get(origin)) {
                let text = format!("in the expansion of {}", name(&origin.name));
                if diagnostic.primary.span == origin.span && diagnostic.primary.text.is_empty() {
                    diagnostic.primary.text = text;
                } else if !origin.is_standard && is_known(origin.span) {
                    diagnostic = diagnostic.also(origin.span, text);
                }
            }
        }
        if diagnostic.severity == Severity::Warning && self.reported.len() >= MAX_FINDINGS {
            return;
        }
        // A macro may have used the same part twice.
        let place = (diagnostic.code, diagnostic.primary.span, diagnostic.message.clone());
        if self.reported.insert(place) {
            self.diagnostics.push(diagnostic);
        }
    }
}
