//! Bodies: documentation strings, declarations, and forms in a row.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::CL_PACKAGE;

use super::expander::Expander;
use super::form::{Checked, Form, arguments, is_cl_form, is_known, name, operator, plain, quoted};
use super::function::Body;
use super::job::{Job, To};
use super::origin::OriginId;
use super::scope::Gone;
use crate::core::NodeKind;
use crate::diagnostic::code;

/// Declarations that are accepted without effect.
const WITHOUT_EFFECT: &[&str] =
    &["INDENT", "TYPE", "FTYPE", "FUNCTION", "OPTIMIZE", "DYNAMIC-EXTENT", "VALUES", "DECLARATION"];

impl Expander {
    /// Takes a body apart. With `documentation`, a string that a form follows is the documentation.
    pub(super) fn take_body(
        &mut self,
        forms: &[Datum],
        documentation: bool,
        form: &Form,
        origin: Option<OriginId>,
    ) -> Checked<Body> {
        let mut body = Body::default();
        let mut rest = forms;
        while let Some((first, others)) = rest.split_first() {
            if is_cl_form(first, "DECLARE") {
                let Some(specifiers) = arguments(first) else {
                    let what = "needs a proper list of specifiers in a declaration";
                    return Err(form.fault(code::MALFORMED_DECLARATION, first.span(), what));
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

    /// Takes one declaration specifier into account.
    pub(super) fn declaration(
        &mut self,
        specifier: &Datum,
        body: &mut Body,
        form: &Form,
        origin: Option<OriginId>,
    ) -> Checked {
        let items = specifier.as_list();
        let Some((head, names)) = items.as_deref().and_then(<[&Datum]>::split_first) else {
            let what = format!("needs lists as specifiers of a declaration, not {}", quoted(specifier));
            return Err(form.fault(code::MALFORMED_DECLARATION, specifier.span(), &what));
        };
        let Some(symbol) = head.as_symbol() else {
            // A type specifier such as `(integer 0 9)` declares a type.
            return Ok(());
        };
        if symbol.is_cl("SPECIAL") {
            for name in names {
                match name.as_symbol().filter(|symbol| !symbol.is_keyword() && !symbol.is_cl("T")) {
                    Some(symbol) => body.specials.push(symbol.clone()),
                    None => {
                        let what = format!("needs names of variables after `special`, not {}", quoted(name));
                        return Err(form.fault(code::MALFORMED_DECLARATION, name.span(), &what));
                    }
                }
            }
        } else if symbol.is_cl("TYPE") {
            if let Some(specifier) = names.first() {
                self.note_declared(specifier, form, origin);
            }
        } else if symbol.is_cl("INLINE") || symbol.is_cl("NOTINLINE") {
            let is_written = symbol.is_cl("NOTINLINE");
            let functions = names.iter().filter_map(|name| name.as_symbol());
            body.written.extend(functions.map(|name| (name.clone(), is_written)));
        } else if symbol.is_cl("IGNORE") || symbol.is_cl("IGNORABLE") {
            // `(function f)` declares a function, and unused functions are not reported.
            body.ignored.extend(names.iter().filter_map(|name| name.as_symbol().cloned()));
        } else if !(symbol.is_in(CL_PACKAGE) || WITHOUT_EFFECT.contains(&symbol.name())) {
            let message = format!("unknown declaration {}", name(symbol));
            let help = format!("a type is declared with `(type {} …)`", plain(symbol));
            self.report(code::UNKNOWN_DECLARATION.at(form.at(head.span()), message).help(help), origin);
        }
        Ok(())
    }

    /// Makes `to` a row of forms; returns the jobs that expand them.
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

    /// Reports a form behind one that always leaves.
    pub(super) fn check_reachable(&mut self, forms: &[Datum], to: To) {
        for pair in forms.windows(2) {
            let [first, next] = pair else { continue };
            let is_written = |form: &Datum| is_known(self.origins.written(form.span(), to.origin));
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

    /// Reports a variable that goes out of scope without having been read.
    pub(super) fn check_use(&mut self, gone: &Gone) {
        // The faulty part of a chunk with errors may have used the variable.
        if self.is_failing() {
            return;
        }
        let variable = &self.core().variables[gone.variable.index()];
        if variable.is_read {
            return;
        }
        let what = if variable.is_assigned { "is set but never read" } else { "is never used" };
        let message = format!("the variable {} {what}", name(&gone.name));
        let help = format!("if that is meant, write `(declare (ignore {}))`", plain(&gone.name));
        self.report(code::UNUSED_VARIABLE.at(gone.span, message).help(help), None);
    }
}
