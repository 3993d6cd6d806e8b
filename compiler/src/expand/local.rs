//! Local functions and macros: `flet`, `labels`, `macrolet`.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Checked, Form, Make, check_distinct, quoted, span_of};
use super::function::{Body, FunctionParts, FunctionText, WrittenName};
use super::job::{Job, To};
use super::origin::OriginId;
use super::scope::{FunctionMeaning, ScopeEntry};
use crate::core::NodeKind;
use crate::diagnostic::code;

/// A local definition taken apart.
struct Definition {
    name: WrittenName,
    lambda_list: Datum,
    body: Vec<Datum>,
}

fn definitions(
    expander: &Expander,
    environment: &dyn Environment,
    form: &Form,
    origin: Option<OriginId>,
) -> Checked<Vec<Definition>> {
    let shape = "needs a list of definitions, such as `((f (x) (* x x)))`";
    let Some(list) = form.args.first() else { return Err(form.missing(shape)) };
    let malformed = |span, what: &str| form.fault(code::MALFORMED_DEFINITION, span, what);
    let Some(items) = list.as_list() else {
        return Err(malformed(list.span(), &format!("{shape}, not {}", quoted(list))));
    };
    let mut definitions = Vec::new();
    for item in items {
        let Some((head, rest)) = item.as_cons() else {
            let fault = malformed(item.span(), &format!("{shape}, not {}", quoted(item)));
            // `(flet (f (x) …) …)` lacks the parentheses around its only definition.
            let is_bare = list.as_list().is_some_and(|parts| parts.len() > 1 && item.is_same(parts[0]));
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
        definitions.push(Definition { name, lambda_list: parts[0].clone(), body });
    }
    let names: Vec<(&Symbol, Span)> =
        definitions.iter().map(|definition| (&definition.name.cell, definition.name.datum.span())).collect();
    check_distinct(names, form)?;
    Ok(definitions)
}

/// `(flet ((name lambda-list . body)*) . body)`
pub(super) fn flet(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    local_functions(expander, environment, &form, to, false)
}

/// `(labels ((name lambda-list . body)*) . body)`
pub(super) fn labels(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    local_functions(expander, environment, &form, to, true)
}

fn local_functions(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: &Form,
    to: To,
    recursive: bool,
) -> Checked {
    let make = Make(to.span);
    let mut texts: Vec<(WrittenName, FunctionText)> = Vec::new();
    for Definition { name, lambda_list, body } in definitions(expander, environment, form, to.origin)? {
        let shown = make.items([make.symbol(&form.operator), name.datum.clone()]);
        let parts =
            FunctionParts { name: Some(&shown), block: Some(&name.block()), list: &lambda_list, body: &body };
        let text = expander.lambda_text(environment, parts, form, to.origin)?;
        texts.push((name, text));
    }
    let body = expander.take_body(&form.args[1..], false, form, to.origin)?;

    let mut functions = Vec::new();
    let mut entries = Vec::new();
    let mut lambdas = Vec::new();
    for (name, text) in texts {
        let span = span_of(&name.datum, to.span);
        let variable = expander.variable(name.name.symbol.clone(), span, to);
        entries.push(ScopeEntry::Function(name.cell, FunctionMeaning::Local(variable, text.arity())));
        let lambda = expander.lambda(to);
        functions.push((variable, lambda));
        lambdas
            .extend([Job::Lambda(Box::new(text), lambda, to), Job::CheckReturns(vec![(variable, lambda)])]);
    }
    if recursive && functions.len() > 1 {
        lambdas.push(Job::CheckReturns(functions.clone()));
    }
    let inside = expander.child(to);
    expander.fill(to, NodeKind::Functions { definitions: functions, body: inside.node });

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
    jobs.extend(expander.body(body.forms, inside));
    jobs.push(Job::Leave(count));
    expander.schedule(jobs);
    Ok(())
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
    for Definition { name, lambda_list, body } in definitions(expander, environment, form, to.origin)? {
        if name.name.is_setf {
            return Err(form.not_a_name(&name.datum, "needs a symbol as the name of a macro"));
        }
        // The definition keeps its place in the source, so that its unused variables are reported.
        let definition = Make(form.datum.span());
        let shown = make.items([make.symbol(&form.operator), name.datum.clone()]);
        let parts = [shown, name.datum.clone(), lambda_list].into_iter().chain(body);
        jobs.push(Job::Macro(definition.esl("%MACRO-LAMBDA", parts), to));
        names.push(name.cell);
    }
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
