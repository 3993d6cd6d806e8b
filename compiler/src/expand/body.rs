//! Bodies: documentation strings, declarations, and forms in a row.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::form::{Checked, Form, is_cl_form, is_known, name, operator};
use super::machine::{Job, Machine, To};
use super::scope::{Entry, Gone, Variable};
use crate::core::NodeKind;
use crate::diagnostic::code;

/// A body taken apart.
#[derive(Debug, Default)]
pub(super) struct Body {
    /// The names declared special.
    pub(super) specials: Vec<Symbol>,
    /// The names declared `ignore` or `ignorable`.
    pub(super) ignored: Vec<Symbol>,
    /// The documentation string.
    pub(super) documentation: Option<Datum>,
    /// The declarations as written.
    pub(super) declarations: Vec<Datum>,
    /// The forms.
    pub(super) forms: Vec<Datum>,
}

impl Body {
    /// Entries for the names that are declared special but not bound by the form itself.
    pub(super) fn free_specials(&self, bound: &[Symbol]) -> Vec<Entry> {
        let free = self.specials.iter().filter(|symbol| !bound.contains(symbol));
        free.map(|symbol| Entry::Variable(symbol.clone(), Variable::Special, None)).collect()
    }
}

/// Declarations that are accepted without effect.
const WITHOUT_EFFECT: &[&str] = &[
    "TYPE",
    "FTYPE",
    "FUNCTION",
    "INLINE",
    "NOTINLINE",
    "OPTIMIZE",
    "DYNAMIC-EXTENT",
    "VALUES",
    "DECLARATION",
];

impl Machine {
    /// Takes a body apart. With `documentation`, a string before the first form is the documentation if a form follows.
    pub(super) fn take_body(
        &mut self,
        forms: &[Datum],
        documentation: bool,
        form: &Form,
        origin: Option<u32>,
    ) -> Checked<Body> {
        let mut body = Body::default();
        let mut rest = forms;
        while let Some((first, others)) = rest.split_first() {
            if is_cl_form(first, "DECLARE") {
                let Some(specifiers) = super::form::arguments(first) else {
                    return Err(form.malformed_at(first.span(), "has a declaration that is no list"));
                };
                for specifier in &specifiers {
                    self.declaration(specifier, &mut body, form, origin)?;
                }
                body.declarations.push(first.clone());
            } else if documentation
                && body.documentation.is_none()
                && !others.is_empty()
                && matches!(first.kind(), DatumKind::String(_))
            {
                body.documentation = Some(first.clone());
            } else {
                break;
            }
            rest = others;
        }
        body.forms = rest.to_vec();
        Ok(body)
    }

    /// Takes one declaration specifier to heart.
    pub(super) fn declaration(
        &mut self,
        specifier: &Datum,
        body: &mut Body,
        form: &Form,
        origin: Option<u32>,
    ) -> Checked {
        let items = specifier.as_list();
        let Some((head, names)) = items.as_deref().and_then(<[&Datum]>::split_first) else {
            return Err(form.malformed_at(specifier.span(), "has a declaration that is no list"));
        };
        let Some(symbol) = head.as_symbol() else {
            // A type specifier such as `(integer 0 9)` stands for itself.
            return Ok(());
        };
        if symbol.is_cl("SPECIAL") {
            for name in names {
                match name.as_symbol().filter(|symbol| !symbol.is_keyword() && !symbol.is_cl("T")) {
                    Some(symbol) => body.specials.push(symbol.clone()),
                    None => {
                        return Err(
                            form.malformed_at(name.span(), "declares something special that is no variable")
                        );
                    }
                }
            }
        } else if symbol.is_cl("IGNORE") || symbol.is_cl("IGNORABLE") {
            // `(function f)` is about a function; those are not reported when unused.
            body.ignored.extend(names.iter().filter_map(|name| name.as_symbol().cloned()));
        } else if !(symbol.is_in(esl_bytecode::symbol::CL_PACKAGE) || WITHOUT_EFFECT.contains(&symbol.name()))
        {
            let message = format!("{} is no declaration", name(symbol));
            let help = format!("a type is declared with `(type {} …)`", super::form::plain(symbol));
            self.report(code::UNKNOWN_DECLARATION.at(form.at(specifier.span()), message).help(help), origin);
        }
        Ok(())
    }

    /// Makes `to` the forms in a row, and gives the jobs that expand them.
    pub(super) fn body(&mut self, forms: Vec<Datum>, to: To) -> Vec<Job> {
        self.check_reachable(&forms, to);
        match forms.len() {
            0 => {
                self.fill(to, NodeKind::Constant(Datum::nil(to.span)));
                Vec::new()
            }
            1 => forms.into_iter().map(|form| Job::Expand(form, to)).collect(),
            count => {
                let mut nodes = Vec::with_capacity(count);
                let mut jobs = Vec::with_capacity(count);
                for (index, form) in forms.into_iter().enumerate() {
                    let (node, job) = if index + 1 < count {
                        self.statement(form, to)
                    } else {
                        let last = self.result(to);
                        (last.node, Job::Expand(form, last))
                    };
                    nodes.push(node);
                    jobs.push(job);
                }
                self.fill(to, NodeKind::Progn(nodes));
                jobs
            }
        }
    }

    /// Reports a form that comes after one that always leaves.
    pub(super) fn check_reachable(&mut self, forms: &[Datum], to: To) {
        for pair in forms.windows(2) {
            let [first, next] = pair else { continue };
            let is_written = |form: &Datum| is_known(self.written(form.span(), to.origin));
            if !(is_written(first) && is_written(next)) || next.as_cons().is_none() {
                continue;
            }
            if let Some(leaver) = operator(first)
                && ["RETURN-FROM", "RETURN", "GO", "THROW"].iter().any(|name| leaver.is_cl(name))
            {
                let message =
                    format!("this code is never reached: the {} before it always leaves", name(leaver));
                self.report(
                    code::UNREACHABLE_CODE.at(next.span(), message).also(first.span(), "it leaves here"),
                    to.origin,
                );
            }
        }
    }

    /// Reports a variable that nobody has read, as it goes out of scope.
    pub(super) fn check_use(&mut self, gone: &Gone) {
        // Where something was wrong, the variable may have been used in what was given up.
        if self.is_failing() {
            return;
        }
        let variable = &self.core().variables[gone.variable.index()];
        if variable.is_read {
            return;
        }
        let what = if variable.is_assigned { "is set but never read" } else { "is never used" };
        let message = format!("the variable {} {what}", name(&gone.name));
        let help = format!("if that is meant, write `(declare (ignore {}))`", super::form::plain(&gone.name));
        self.report(code::UNUSED_VARIABLE.at(gone.span, message).help(help), None);
    }
}

/// The place of a part of a form, for a label.
pub(super) fn span_of(datum: &Datum, otherwise: Span) -> Span {
    if is_known(datum.span()) { datum.span() } else { otherwise }
}
