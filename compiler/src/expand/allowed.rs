//! `with-allowed-warnings`: warnings that are not reported in the place of a form.
//!
//! They are dropped at the end of the compilation, when those of undefined names are known too.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;

use super::expander::Expander;
use super::form::{Checked, Form, quoted};
use super::job::To;
use super::warning::{AND_HERE, AllowedWarnings};
use crate::diagnostic::code;

/// Uses of an undefined name that are shown besides the first.
const SHOWN: usize = 3;

/// `(%with-allowed-warnings (code*) . body)`: reports no warnings of these codes in the place of the form.
pub(super) fn with_allowed_warnings(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let body = expander.allow_warnings(&form)?;
    let jobs = expander.body(body, to);
    expander.schedule(jobs);
    Ok(())
}

impl Expander {
    /// Returns the warnings that forms allow.
    pub fn allowed(&self) -> &[AllowedWarnings] {
        &self.allowed
    }

    /// Drops the warnings that forms allow. Of one that is about several places, those are dropped at which
    /// it is allowed, and of the others the first ones are kept.
    pub fn drop_allowed(&self, findings: &mut Vec<Diagnostic>) {
        findings.retain_mut(|finding| {
            let code = finding.code;
            let is_allowed = |place: Span| self.allowed.iter().any(|allowed| allowed.include(code, place));
            let mut is_reported = true;
            if finding.severity == Severity::Warning {
                finding.secondary.retain(|label| label.text != AND_HERE || !is_allowed(label.span));
                if is_allowed(finding.primary.span) {
                    let next = finding.secondary.iter().position(|label| label.text == AND_HERE);
                    is_reported = next.is_some();
                    if let Some(next) = next {
                        finding.primary.span = finding.secondary.remove(next).span;
                    }
                }
            }
            let mut further = 0;
            finding.secondary.retain(|label| {
                further += usize::from(label.text == AND_HERE);
                label.text != AND_HERE || further <= SHOWN
            });
            is_reported
        });
    }

    /// Notes the warnings that a form of `%with-allowed-warnings` allows, and returns its body.
    pub(super) fn allow_warnings(&mut self, form: &Form) -> Checked<Vec<Datum>> {
        let Some((named, body)) = form.args.split_first() else {
            return Err(form.missing("takes a list of codes, and forms"));
        };
        let Some(named) = named.as_list() else {
            return Err(form.malformed("needs a list of codes before the forms"));
        };
        let mut codes = Vec::new();
        for datum in named {
            let span = datum.span();
            let Some(symbol) = datum.as_symbol() else {
                return Err(
                    form.malformed_at(span, &format!("needs codes of warnings, not {}", quoted(datum)))
                );
            };
            let name = symbol.name().to_ascii_lowercase();
            let of_analysis = code::OF_ANALYSES.into_iter().find(|code| *code == name);
            match code::find(&name) {
                None if of_analysis.is_some() => codes.extend(of_analysis),
                Some(code) if code.severity == Severity::Warning => codes.push(code.name),
                Some(_) => {
                    return Err(form.malformed_at(span, &format!("cannot allow `{name}`, which is an error")));
                }
                None => return Err(form.malformed_at(span, &format!("knows no warning `{name}`"))),
            }
        }
        self.allowed.push(AllowedWarnings::new(form.span, codes));
        Ok(body.to_vec())
    }
}
