//! `%with-recovery` and its relatives, on which the library builds `with-recovery-procedures` and
//! `with-cleanup-procedure`; and the checks of recovery clauses.

use esl_bytecode::compile::Environment;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashSet;

use super::expander::Expander;
use super::form::{Checked, Form, Make, is_esl, name, operator, with_namesake};
use super::job::{Job, To};
use super::scope::Visible;
use crate::core::*;
use crate::diagnostic::code;

/// Functions and operators that do not return.
const LEAVING: &[&str] = &["FAIL", "%FAIL-FOR", "%NO-CASE", "NEXT-BINDINGS", "EXIT"];
const LEAVING_STANDARD: &[&str] = &["ERROR", "INVOKE-RESTART", "ABORT"];

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
        expander.globals.note_cause(cause, form.at(form.args[1].span()));
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
            let message = "this clause can end without saying how to go on, and its value then stands for \
                           that of the operation that failed";
            let help = "end it with `(retry)`, `(abort …)` or `(fail …)`, or with `(values …)` to go on \
                        behind the failure";
            self.report(code::CLAUSE_FALLS_OFF.at(to.span, message.to_string()).help(help), to.origin);
        }
    }

    /// Notes whether a local function, whose text is expanded, never returns.
    pub(super) fn check_return(&mut self, function: VarId, lambda: LambdaId) {
        let core = self.core();
        let body = core.lambdas[lambda.index()].body;
        core.variables[function.index()].never_returns = ends(core, body, EndQuestion::Leaves(function));
    }
}

/// A question about the end of a form.
#[derive(Clone, Copy)]
enum EndQuestion {
    /// Whether control never reaches it, or the form says that its value is meant.
    LeavesOrResumes,
    /// Whether control never reaches it; the form is the body of this function.
    Leaves(VarId),
}

/// Returns whether the global function of this name never returns.
fn is_leaving(function: &Symbol) -> bool {
    LEAVING.iter().any(|name| is_esl(function, name))
        || LEAVING_STANDARD.iter().any(|name| function.is_cl(name))
}

/// Returns whether a form itself leaves, and what is around it too. `inside` are blocks around it that would
/// not be left.
fn exits(core: &Core, node: NodeId, inside: &FxHashSet<BlockId>) -> bool {
    match &core.nodes[node.index()].kind {
        NodeKind::Throw(..) | NodeKind::Go(..) => true,
        NodeKind::ReturnFrom(block, _) => !inside.contains(block),
        NodeKind::Call(Callee::Global(function), _) => is_leaving(function),
        NodeKind::Call(Callee::Local(function), _) => core.variables[function.index()].never_returns,
        _ => false,
    }
}

/// Returns whether the value of a form is true, if that is written there.
fn truth(core: &Core, node: NodeId) -> Option<bool> {
    match &core.nodes[node.index()].kind {
        NodeKind::Constant(constant) => Some(!constant.is_nil()),
        _ => None,
    }
}

/// Returns parts of a form that are evaluated whenever the form is, before it ends.
fn evaluated_first(kind: &NodeKind) -> impl Iterator<Item = NodeId> {
    let bindings = match kind {
        NodeKind::Let { bindings, .. } => &bindings[..],
        _ => &[],
    };
    let (one, list): (Option<NodeId>, &[NodeId]) = match kind {
        NodeKind::SetLocal(_, value) | NodeKind::SetSpecial(_, value) => (Some(*value), &[]),
        NodeKind::If(test, ..) => (Some(*test), &[]),
        NodeKind::And(forms) | NodeKind::Or(forms) => (forms.first().copied(), &[]),
        NodeKind::Progn(forms) | NodeKind::Values(forms) => (None, forms),
        NodeKind::UnwindProtect(_, cleanup) => (Some(*cleanup), &[]),
        NodeKind::BindValues(_, form, _) | NodeKind::FirstValues(form, _) => (Some(*form), &[]),
        NodeKind::Call(_, arguments) | NodeKind::Apply(_, arguments) => (None, arguments),
        NodeKind::CallValues(_, forms) => (None, forms),
        _ => (None, &[]),
    };
    one.into_iter().chain(list.iter().copied()).chain(bindings.iter().map(|(_, value)| *value))
}

/// Answers a question about the end of a form. A `NIL` that a macro has put at the end of its expansion, as
/// `dolist` does, does not say that it is meant. A function that calls itself at its end does not return
/// there.
fn ends(core: &Core, node: NodeId, end: EndQuestion) -> bool {
    let leaves = matches!(end, EndQuestion::Leaves(_));
    let mut inside: FxHashSet<BlockId> = FxHashSet::default();
    let mut pending = vec![(node, None)];
    while let Some((node, around)) = pending.pop() {
        let span = core.nodes[node.index()].span;
        let inside_it = |node: NodeId| (node, Some(span));
        let kind = &core.nodes[node.index()].kind;
        if evaluated_first(kind).any(|part| exits(core, part, &inside)) {
            continue;
        }
        match kind {
            NodeKind::Constant(constant) if constant.is_nil() && around == Some(span) => return false,
            NodeKind::Constant(_) | NodeKind::Values(_) if leaves => return false,
            NodeKind::Constant(_) | NodeKind::Values(_) | NodeKind::Throw(..) | NodeKind::Go(..) => {}
            // Control may leave it from anywhere inside.
            NodeKind::Block(block, _) if leaves && core.blocks[block.index()].is_used => return false,
            NodeKind::ReturnFrom(block, value) => {
                if inside.contains(block) {
                    pending.push(inside_it(*value));
                }
            }
            NodeKind::Block(block, body) => {
                inside.insert(*block);
                pending.push(inside_it(*body));
            }
            NodeKind::If(test, consequent, alternative) if truth(core, *test).is_some() => {
                let holds = truth(core, *test) == Some(true);
                pending.push(inside_it(if holds { *consequent } else { *alternative }));
            }
            NodeKind::And(forms) | NodeKind::Or(forms) => {
                let goes_on = matches!(kind, NodeKind::And(_));
                let Some((last, before)) = forms.split_last() else { return false };
                if !before.iter().all(|&form| truth(core, form) == Some(goes_on)) {
                    return false;
                }
                pending.push(inside_it(*last));
            }
            NodeKind::If(_, consequent, alternative) => {
                // A branch that `when` or `cond` leaves out does not say that its value is meant.
                let is_left_out = |node: &NodeId| match &core.nodes[node.index()].kind {
                    NodeKind::Constant(constant) => constant.is_nil(),
                    _ => false,
                };
                if is_left_out(consequent) || is_left_out(alternative) {
                    return false;
                }
                pending.extend([*consequent, *alternative].map(inside_it));
            }
            NodeKind::Progn(forms) => match forms.last() {
                Some(last) => pending.push(inside_it(*last)),
                None => return false,
            },
            NodeKind::Let { body, .. }
            | NodeKind::Functions { body, .. }
            | NodeKind::BindValues(_, _, body)
            | NodeKind::Progv(_, _, body)
            | NodeKind::Handlers(_, body)
            | NodeKind::Mask(_, body)
            | NodeKind::FirstValues(body, _)
            | NodeKind::UnwindProtect(body, _)
            | NodeKind::FailureCleanup(body, _)
            | NodeKind::Recovery { body, .. } => pending.push(inside_it(*body)),
            NodeKind::HandlerCase(body, clauses) => {
                pending.push(inside_it(*body));
                pending.extend(clauses.iter().map(|clause| inside_it(clause.body)));
            }
            NodeKind::Tagbody(_, items) => match items.last() {
                Some(TagbodyItem::Form(last)) => {
                    if !exits(core, *last, &inside) {
                        return false;
                    }
                }
                _ => return false,
            },
            NodeKind::Call(Callee::Global(function), _) => {
                if !is_leaving(function) {
                    return false;
                }
            }
            NodeKind::Call(Callee::Local(function), _) | NodeKind::Apply(Callee::Local(function), _) => {
                let is_itself = matches!(end, EndQuestion::Leaves(own) if own == *function);
                if !is_itself && !core.variables[function.index()].never_returns {
                    return false;
                }
            }
            NodeKind::Call(Callee::Value(function), _) | NodeKind::Apply(Callee::Value(function), _) => {
                match core.nodes[function.index()].kind {
                    NodeKind::Lambda(lambda) => pending.push(inside_it(core.lambdas[lambda.index()].body)),
                    _ => return false,
                }
            }
            _ => return false,
        }
    }
    true
}
