//! Functions that call their arguments: each is looked at anew for each place that calls it.

use esl_bytecode::symbol::Symbol;
use esl_compiler::core::{Callee, LambdaId, NodeId, NodeKind, VarId};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::forms::{CoreForm, CoreForms};
use crate::library::function_positions;

/// Parameters that are called, by the form and the lambda whose they are.
type CalledParameters = FxHashMap<(u32, u32), FxHashSet<VarId>>;

/// Returns the lambdas, each with its form, of global functions that call an argument, by themselves or by
/// another function that does.
pub(crate) fn calling_their_arguments(forms: &CoreForms) -> FxHashSet<(u32, u32)> {
    let mut by_name: FxHashMap<&Symbol, (u32, LambdaId)> = FxHashMap::default();
    for (name, (form, node)) in &forms.defined {
        if let NodeKind::Call(_, arguments) = forms.forms[*form].kind(*node)
            && let Some(NodeKind::Lambda(lambda)) =
                arguments.get(1).map(|node| forms.forms[*form].kind(*node))
        {
            by_name.insert(name, (*form as u32, *lambda));
        }
    }
    let mut found = CalledParameters::default();
    loop {
        let before: usize = found.values().map(FxHashSet::len).sum();
        for (number, form) in forms.forms.iter().enumerate() {
            for index in 0..form.core.nodes.len() {
                for node in called_nodes(forms, &by_name, &found, form, NodeId(index as u32)) {
                    if let NodeKind::Local(variable) = form.kind(node)
                        && let Some(owner) = parameter_of_global(form, *variable)
                    {
                        found.entry((number as u32, owner.0)).or_default().insert(*variable);
                    }
                }
            }
        }
        if found.values().map(FxHashSet::len).sum::<usize>() == before {
            return found.into_keys().collect();
        }
    }
}

/// Returns the nodes whose values a node calls.
fn called_nodes(
    forms: &CoreForms,
    by_name: &FxHashMap<&Symbol, (u32, LambdaId)>,
    found: &CalledParameters,
    form: &CoreForm,
    node: NodeId,
) -> Vec<NodeId> {
    let (callee, arguments) = match form.kind(node) {
        NodeKind::Apply(callee, arguments) | NodeKind::Call(callee, arguments) => (callee, arguments),
        NodeKind::CallValues(function, _) => return vec![*function],
        _ => return Vec::new(),
    };
    match callee {
        Callee::Value(function) => vec![*function],
        Callee::Local(_) => Vec::new(),
        Callee::Builtin(builtin) => positions(form, builtin.info().name, arguments),
        Callee::Global(name) => {
            let Some((number, lambda)) = by_name.get(name) else {
                return positions(form, name.name(), arguments);
            };
            let Some(called) = found.get(&(*number, lambda.0)) else { return Vec::new() };
            let text = &forms.forms[*number as usize].core.lambdas[lambda.index()];
            let optional = text.optional.iter().map(|optional| optional.parameter);
            let positional: Vec<VarId> =
                text.required.iter().copied().chain(optional).map(|parameter| parameter.variable).collect();
            let is_called = |(index, _): &(usize, &NodeId)| match positional.get(*index) {
                Some(variable) => called.contains(variable),
                None => called.iter().any(|variable| !positional.contains(variable)),
            };
            arguments.iter().enumerate().filter(is_called).map(|(_, node)| *node).collect()
        }
    }
}

/// Returns the arguments of a call of the library that are functions.
fn positions(form: &CoreForm, name: &str, arguments: &[NodeId]) -> Vec<NodeId> {
    let mut nodes: Vec<NodeId> =
        function_positions(name).iter().filter_map(|index| arguments.get(*index)).copied().collect();
    for pair in arguments.windows(2) {
        let keyword = form.symbol(pair[0]).filter(|symbol| symbol.is_keyword());
        if keyword.is_some_and(|keyword| matches!(keyword.name(), "KEY" | "TEST" | "TEST-NOT")) {
            nodes.push(pair[1]);
        }
    }
    nodes
}

/// Returns the outermost lambda, other than the form itself, that has this variable as a parameter.
fn parameter_of_global(form: &CoreForm, variable: VarId) -> Option<LambdaId> {
    let owner = form.core.variables[variable.index()].owner;
    let parent = form.core.lambdas[owner.index()].parent;
    (parent == Some(LambdaId(0)) && form.is_parameter(owner, variable)).then_some(owner)
}
