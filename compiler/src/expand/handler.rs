//! `%handler-case`, on which the library builds `handler-case`.

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;

use super::expander::Expander;
use super::form::{Checked, Form, Make, fresh, quoted};
use super::job::{Job, To};
use super::scope::{ScopeEntry, VariableMeaning};
use super::variable::VariableChange;
use crate::core::{HandlerClause, NodeKind};
use crate::diagnostic::code;

/// `(%handler-case form (type ([variable]) . body)*)`: runs `form`. A condition of a clause's type that is
/// signalled in it unwinds to here and runs the body.
pub(super) fn handler_case(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a form")?;
    let (protected, job) = expander.part(form.args[0].clone(), to);
    let mut jobs = vec![job];
    let mut clauses = Vec::new();
    for clause in &form.args[1..] {
        let shape = "needs clauses of a type, a list of at most one variable, and forms";
        let parts = clause.as_list().unwrap_or_default();
        let [condition_type, variables, body @ ..] = parts.as_slice() else {
            return Err(form.fault(code::MALFORMED_CLAUSE, clause.span(), shape));
        };
        if !matches!(condition_type.kind(), DatumKind::Symbol(_) | DatumKind::Cons(..) | DatumKind::Nil) {
            let what =
                format!("needs a type at the beginning of each clause, not {}", quoted(condition_type));
            return Err(form.fault(code::MALFORMED_CLAUSE, condition_type.span(), &what));
        }
        let variables = variables.as_list();
        let bound: Option<Datum> = match variables.as_deref() {
            Some([]) => None,
            Some([variable]) => Some((*variable).clone()),
            _ => return Err(form.fault(code::MALFORMED_CLAUSE, clause.span(), shape)),
        };
        let forms: Vec<Datum> = body.iter().map(|&form| form.clone()).collect();
        let mut body = expander.take_body(&forms, false, &form, to.origin)?;
        let name: Symbol = match &bound {
            Some(datum) => expander.variable_name(environment, datum, &form, VariableChange::Bind)?,
            None => fresh(environment, "CONDITION"),
        };
        let inside = expander.child(to);
        let variable = expander.variable(name.clone(), inside.span, to);
        let mut entries = Vec::new();
        if let Some(datum) = &bound {
            if expander.is_special(environment, &name, &body) {
                // The condition arrives in a lexical variable, to which the special one is bound.
                let make = Make(to.span);
                let condition = fresh(environment, "CONDITION");
                entries.push(ScopeEntry::Variable(
                    condition.clone(),
                    VariableMeaning::Lexical(variable),
                    None,
                ));
                let bindings = make.list([make.list([datum.clone(), make.symbol(&condition)])]);
                body.forms = vec![make.cl("LET", std::iter::once(bindings).chain(forms))];
                body.specials.clear();
            } else {
                let report = if body.ignored.contains(&name) {
                    None
                } else {
                    expander.report_unused(&name, datum, form.datum.span(), to.origin)
                };
                entries.push(ScopeEntry::Variable(name.clone(), VariableMeaning::Lexical(variable), report));
            }
        }
        entries.extend(body.free_declarations(&[name]));
        clauses.push(HandlerClause {
            condition_type: (*condition_type).clone(),
            variable,
            body: inside.node,
        });
        let count = entries.len();
        jobs.push(Job::Enter(entries));
        jobs.extend(expander.body(body.forms, inside));
        jobs.push(Job::Leave(count));
    }
    expander.fill(to, NodeKind::HandlerCase(protected, clauses));
    expander.schedule(jobs);
    Ok(())
}
