//! Multiple values: what gives them and what takes them.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::Environment;

use super::call::DIRECT_ARGUMENTS;
use super::expander::Expander;
use super::form::{Checked, Form, Make};
use super::job::{Job, To};
use crate::core::{Callee, NodeKind};

/// `(multiple-value-call function form*)`
pub(super) fn multiple_value_call(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=usize::MAX, "needs a function")?;
    let (mut nodes, jobs) = expander.children(form.args, to);
    let function = nodes.remove(0);
    expander.fill(to, NodeKind::CallValues(function, nodes));
    expander.schedule(jobs);
    Ok(())
}

/// `(multiple-value-list form)`
pub(super) fn multiple_value_list(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(1..=1, "takes one form")?;
    let function = expander.child(to);
    expander.fill(function, NodeKind::BuiltinRef(Builtin::List));
    let (values, job) = expander.part(form.args[0].clone(), to);
    expander.fill(to, NodeKind::CallValues(function.node, vec![values]));
    expander.schedule([job]);
    Ok(())
}

/// `(multiple-value-setq (name*) form)`
pub(super) fn multiple_value_setq(
    expander: &mut Expander,
    _: &mut dyn Environment,
    form: Form,
    to: To,
) -> Checked {
    form.takes(2..=2, "takes a list of names and a form")?;
    let Some(names) = form.args[0].as_list() else {
        return Err(form.not_a_name(&form.args[0], "needs a list of names"));
    };
    let make = Make(to.span);
    let places = make.cl("VALUES", names.into_iter().cloned());
    let setf = make.cl("SETF", [places, form.args[1].clone()]);
    // The value of the form is the first value, even if there is no name to receive it.
    let values = make.cl("VALUES", [if form.args[0].is_nil() { form.args[1].clone() } else { setf }]);
    expander.schedule([Job::Expand(values, to)]);
    Ok(())
}

/// `(values form*)`
pub(super) fn values(expander: &mut Expander, _: &mut dyn Environment, form: Form, to: To) -> Checked {
    if form.args.len() > DIRECT_ARGUMENTS {
        let list = Make(to.span).call_cl("LIST", form.args);
        let (node, job) = expander.part(list, to);
        let callee = Callee::Builtin(Builtin::ValuesList);
        expander.fill(to, NodeKind::Call(callee, vec![node]));
        expander.schedule([job]);
        return Ok(());
    }
    let mut nodes = Vec::with_capacity(form.args.len());
    let mut jobs = Vec::with_capacity(form.args.len());
    for arg in form.args {
        let value = expander.result(to);
        nodes.push(value.node);
        jobs.push(Job::Expand(arg, value));
    }
    expander.fill(to, NodeKind::Values(nodes));
    expander.schedule(jobs);
    Ok(())
}
