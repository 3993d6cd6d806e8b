//! Local functions and macros: `flet`, `labels`, `macrolet`.

use std::sync::Arc;

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;

use super::expander::Expander;
use super::form::{Checked, Form, Make, bound_twice, check_distinct, quoted, span_of};
use super::function::{Body, FunctionParts, WrittenName};
use super::job::{Job, LocalFunctions, PARTS_AT_ONCE, To};
use super::origin::OriginId;
use super::scope::{FunctionMeaning, LocalSignature, ScopeEntry};
use crate::core::NodeKind;
use crate::diagnostic::code;

/// A local definition taken apart.
struct Definition {
    name: WrittenName,
    lambda_list: Datum,
    body: Vec<Datum>,
}

/// The expected first argument of a form with local definitions.
const SHAPE: &str = "needs a list of definitions, such as `((f (x) (* x x)))`";

/// Returns the definitions of a form, as written.
fn written_definitions(form: &Form) -> Checked<Vec<Datum>> {
    let Some(list) = form.args.first() else { return Err(form.missing(SHAPE)) };
    let Some(items) = list.as_list() else {
        let what = format!("{SHAPE}, not {}", quoted(list));
        return Err(form.fault(code::MALFORMED_DEFINITION, list.span(), &what));
    };
    Ok(items.into_iter().cloned().collect())
}

/// Takes a definition of a form apart.
fn definition(
    expander: &Expander,
    environment: &dyn Environment,
    form: &Form,
    item: &Datum,
    origin: Option<OriginId>,
) -> Checked<Definition> {
    let malformed = |span, what: &str| form.fault(code::MALFORMED_DEFINITION, span, what);
    let Some((head, rest)) = item.as_cons() else {
        let fault = malformed(item.span(), &format!("{SHAPE}, not {}", quoted(item)));
        // `(flet (f (x) …) …)` lacks the parentheses around its only definition.
        let list = form.args[0].as_list();
        let is_bare = list.is_some_and(|parts| parts.len() > 1 && item.is_same(parts[0]));
        let help = "put the definition into a list of definitions";
        return Err(if is_bare { Box::new(fault.help(help)) } else { fault });
    };
    let Some(name) = WrittenName::of(head) else {
        return Err(form.not_a_name(head, "needs a name at the beginning of each definition"));
    };
    let Some(parts) = rest.as_list().filter(|parts| !parts.is_empty()) else {
        let what = format!("needs a lambda list after the name {}", name.name.shown());
        return Err(malformed(item.span(), &what));
    };
    if !name.name.is_setf {
        let span = form.at(head.span());
        expander.check_locally_definable(environment, &name.cell, span, origin)?;
    }
    let body = parts[1..].iter().map(|&part| part.clone()).collect();
    Ok(Definition { name, lambda_list: parts[0].clone(), body })
}

/// `(flet ((name lambda-list . body)*) . body)`
pub(super) fn flet(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    local_functions(expander, environment, form, to, false)
}

/// `(labels ((name lambda-list . body)*) . body)`
pub(super) fn labels(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    local_functions(expander, environment, form, to, true)
}

fn local_functions(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
    recursive: bool,
) -> Checked {
    let items = written_definitions(&form)?.into_iter();
    let (seen, functions, entries, lambdas) = Default::default();
    let state = LocalFunctions { form, to, recursive, items, seen, functions, entries, lambdas };
    expander.go_on_with_functions(environment, Box::new(state))
}

impl Expander {
    /// Goes on with the definitions of local functions; after the last, schedules what is inside.
    pub(super) fn go_on_with_functions(
        &mut self,
        environment: &mut dyn Environment,
        mut state: Box<LocalFunctions>,
    ) -> Checked {
        let LocalFunctions { form, to, items, seen, functions, entries, lambdas, .. } = &mut *state;
        let to = *to;
        let make = Make(to.span);
        for item in items.by_ref().take(PARTS_AT_ONCE) {
            self.checked_parts += 1;
            let Definition { name, lambda_list, body } =
                definition(self, environment, form, &item, to.origin)?;
            let place = name.datum.span();
            if let Some(first) = seen.insert(name.cell.clone(), place) {
                return Err(bound_twice(&name.cell, (first, place), form));
            }
            let shown = make.items([make.symbol(&form.operator), name.datum.clone()]);
            let parts = FunctionParts {
                name: Some(&shown),
                block: Some(&name.block()),
                list: &lambda_list,
                body: &body,
            };
            let text = self.lambda_text(environment, parts, form, to.origin)?;
            let variable = self.variable(name.name.symbol.clone(), span_of(&name.datum, to.span), to);
            let list = &text.list;
            let keys = list.keys.as_ref().filter(|_| !list.allow_other_keys);
            let keys = keys.map(|keys| {
                let positional = list.required.len() + list.optional.len();
                Arc::new((positional, keys.iter().map(|key| key.key.clone()).collect()))
            });
            let signature = LocalSignature { arity: text.arity(), keys };
            entries.push(ScopeEntry::Function(name.cell, FunctionMeaning::Local(variable, signature)));
            let lambda = self.lambda(to);
            functions.push((variable, lambda));
            lambdas.extend([
                Job::Lambda(Box::new(text), lambda, to),
                Job::CheckReturns(vec![(variable, lambda)]),
            ]);
        }
        if items.len() > 0 {
            self.schedule([Job::LocalFunctions(state)]);
            return Ok(());
        }
        let LocalFunctions { form, recursive, functions, entries, mut lambdas, .. } = *state;
        let body = self.take_body(&form.args[1..], false, &form, to.origin)?;
        if recursive && functions.len() > 1 {
            lambdas.push(Job::CheckReturns(functions.clone()));
        }
        let inside = self.child(to);
        self.fill(to, NodeKind::Functions { definitions: functions, body: inside.node });

        let free = body.free_declarations(&[]);
        let count = entries.len() + free.len();
        let mut jobs = Vec::new();
        if recursive {
            jobs.push(Job::Enter(entries));
            jobs.extend(lambdas);
        } else {
            jobs.extend(lambdas);
            jobs.push(Job::Enter(entries));
        }
        jobs.push(Job::Enter(free));
        jobs.extend(self.body(body.forms, inside));
        jobs.push(Job::Leave(count));
        self.schedule(jobs);
        Ok(())
    }
}

/// Returns the jobs that define the macros of a `macrolet`, the number of names that they bring into scope,
/// and the body.
pub(super) fn local_macros(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: &Form,
    to: To,
) -> Checked<(Vec<Job>, usize, Body)> {
    let make = Make(to.span);
    let mut jobs = Vec::new();
    let mut names = Vec::new();
    let mut seen = Vec::new();
    for item in written_definitions(form)? {
        let Definition { name, lambda_list, body } =
            definition(expander, environment, form, &item, to.origin)?;
        if name.name.is_setf {
            return Err(form.not_a_name(&name.datum, "needs a symbol as the name of a macro"));
        }
        // The definition keeps its place in the source, so that its unused variables are reported.
        let definition = Make(form.datum.span());
        let shown = make.items([make.symbol(&form.operator), name.datum.clone()]);
        let parts = [shown, name.datum.clone(), lambda_list].into_iter().chain(body);
        jobs.push(Job::Macro(definition.esl("%MACRO-LAMBDA", parts), to));
        seen.push((name.cell.clone(), name.datum.span()));
        names.push(name.cell);
    }
    check_distinct(seen.iter().map(|(name, span)| (name, *span)), form)?;
    let body = expander.take_body(&form.args[1..], false, form, to.origin)?;
    let free = body.free_declarations(&[]);
    let count = names.len() + free.len();
    jobs.push(Job::EnterMacros(names));
    jobs.push(Job::Enter(free));
    Ok((jobs, count, body))
}

/// `(macrolet ((name lambda-list . body)*) . body)`
pub(super) fn macrolet(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    let (mut jobs, count, mut body) = local_macros(expander, environment, &form, to)?;
    jobs.extend(expander.body(std::mem::take(&mut body.forms), to));
    jobs.push(Job::Leave(count));
    expander.schedule(jobs);
    Ok(())
}
