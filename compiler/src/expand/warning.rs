//! The warnings that a form allows, and the text by which further places of a warning are told.

use esl_bytecode::span::Span;

/// Text of the further places that a finding is about.
pub(super) const AND_HERE: &str = "and here";

/// Warnings that are not reported in the place of a form.
#[derive(Clone, Debug)]
pub struct AllowedWarnings {
    /// Place of the form.
    span: Span,
    /// Codes of the warnings.
    codes: Vec<&'static str>,
}

impl AllowedWarnings {
    /// Allows the warnings of these codes within the span.
    pub(super) fn new(span: Span, codes: Vec<&'static str>) -> Self {
        Self { span, codes }
    }

    /// Returns whether these include a warning of this code at this place.
    pub fn include(&self, code: &'static str, place: Span) -> bool {
        let here = self.span;
        let is_inside = place.source == here.source && here.start <= place.start && place.end <= here.end;
        is_inside && self.codes.contains(&code)
    }
}
