//! `%with-recovery` and its relatives, on which the library builds `with-recovery-procedures` and
//! `with-cleanup-procedure`; and the checks of recovery clauses.

use super::ending::{EndQuestion, ends};
use super::expander::Expander;
use super::form::{Checked, Form, Make, is_esl, name, operator, with_namesake};
use super::job::{Job, To};
use super::scope::Visible;
use crate::core::*;
use crate::diagnostic::code;
use esl_bytecode::compile::Environment;
use esl_bytecode::symbol::Symbol;

/// How often functions that call each other are looked at to find out which of them return.
const MOST_ROUNDS: usize = 10;

/// `(%with-recovery table (%named-lambda …) . body)`: see [`NodeKind::Recovery`].
pub(super) fn with_recovery(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=usize::MAX, "needs a table and a function")?;
    let is_function = operator(&form.args[1]).is_some_and(|operator| is_esl(operator, "%NAMED-LAMBDA"));
    if !is_function {
        return Err(form.malformed("needs a table and a function's text"));
    }
    let (table, table_job) = expander.part(form.args[0].clone(), to);
    let (procedures, job) = expander.part(form.args[1].clone(), to);
    let body = expander.child(to);
    expander.fill(to, NodeKind::Recovery { table, procedures, body: body.node });
    let mut jobs = vec![table_job, job];
    jobs.extend(expander.body(form.args[2..].to_vec(), body));
    expander.schedule(jobs);
    Ok(())
}

/// `(%with-failure-cleanup form . body)`: see [`NodeKind::FailureCleanup`].
pub(super) fn with_failure_cleanup(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a form for the cleanup")?;
    let body = expander.child(to);
    let mut jobs = expander.body(form.args[1..].to_vec(), body);
    let (cleanup, job) = expander.part(form.args[0].clone(), to);
    expander.fill(to, NodeKind::FailureCleanup(body.node, cleanup));
    // The cleanup is expanded first, as it is written first.
    jobs.insert(0, job);
    expander.schedule(jobs);
    Ok(())
}

/// `(%clause where . body)`: the body of a recovery clause.
pub(super) fn clause(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(1..=usize::MAX, "needs a datum that says where the clause is")?;
    let span = form.at(form.args[0].span());
    let body = expander.child(to);
    expander.fill(to, NodeKind::Progn(vec![body.node]));
    let mut jobs = expander.body(form.args[1..].to_vec(), body);
    jobs.push(Job::CheckClause(To { span, ..body }, form.args.len() == 1));
    expander.schedule(jobs);
    Ok(())
}

/// `(%cause cause where . body)`: expands to the body; notes that the datum `where` names the cause.
pub(super) fn cause(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    form.takes(2..=usize::MAX, "needs a cause and a datum that says where it is")?;
    if let Some(cause) = form.args[0].as_symbol() {
        let around = form.at(form.args[1].span());
        let written = to.origin.and_then(|origin| expander.origins.place_of(cause, around, origin));
        expander.globals.note_cause(cause, written.unwrap_or(around));
    }
    let jobs = expander.body(form.args[2..].to_vec(), to);
    expander.schedule(jobs);
    Ok(())
}

/// `(retry)`: runs the body of the recovery form around the clause again. `%on-retry`, a symbol macro of the
/// clause, is evaluated before.
pub(super) fn retry(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(0..=0, "takes no arguments")?;
    leave(expander, environment, form, to)
}

/// `(abort [result])`: leaves the recovery form around the clause.
pub(super) fn abort(
    expander: &mut Expander,
    environment: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(0..=1, "takes at most a result")
        .map_err(|diagnostic| Box::new(with_namesake(*diagnostic, &form.operator)))?;
    leave(expander, environment, form, to)
}

/// Throws to the state of the recovery form, which is a parameter of the function around the clause.
fn leave(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    let state = Symbol::esl("%RECOVERY");
    if !matches!(expander.scope.variable(&state, expander.level()), Visible::Is(_)) {
        let message = format!("{} stands outside of a recovery clause", name(&form.operator));
        let help = "only clauses of `with-recovery-procedures` can contain it";
        let diagnostic = code::OUTSIDE_CLAUSE.at(form.head(), message).help(help);
        return Err(Box::new(with_namesake(diagnostic, &form.operator)));
    }
    let make = Make(to.span);
    let is_retry = form.operator.name() == "RETRY";
    let result = form.args.into_iter().next();
    let (first, result) = if is_retry {
        (make.symbol(&state), make.symbol(&Symbol::esl("%ON-RETRY")))
    } else {
        (make.nil(), result.unwrap_or(make.nil()))
    };
    let throw = make.cl("THROW", [make.symbol(&state), make.cl("VALUES", [first, result])]);
    expander.schedule([Job::Expand(throw, to)]);
    Ok(())
}

impl Expander {
    /// Warns if control can reach the end of a recovery clause that does not say that its value is meant.
    pub(super) fn check_clause(&mut self, to: To, is_empty: bool) {
        if is_empty || !ends(self.core(), to.node, EndQuestion::LeavesOrResumes) {
            let message = "this clause can end without a retry, an abort or a failure: its value then replaces \
                           that of the failed operation";
            let help = "end it with `(retry)`, `(abort …)` or `(fail …)`, or with `(values …)` to go on \
                        behind the failure";
            self.report(code::CLAUSE_FALLS_OFF.at(to.span, message.to_string()).help(help), to.origin);
        }
    }

    /// Notes which local functions, whose texts are expanded, never return. They may call each other.
    pub(super) fn check_returns(&mut self, functions: &[(VarId, LambdaId)]) {
        let core = self.core();
        for (function, _) in functions {
            core.variables[function.index()].never_returns = true;
        }
        for _ in 0..MOST_ROUNDS {
            let mut has_changed = false;
            for (function, lambda) in functions {
                let body = core.lambdas[lambda.index()].body;
                if core.variables[function.index()].never_returns && !ends(core, body, EndQuestion::Leaves) {
                    core.variables[function.index()].never_returns = false;
                    has_changed = true;
                }
            }
            if !has_changed {
                return;
            }
        }
        for (function, _) in functions {
            core.variables[function.index()].never_returns = false;
        }
    }
}
