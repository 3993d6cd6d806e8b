//! The clauses of a recovery form, read from its table and from the lambda that runs them; and whether
//! control can reach the end of a form.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::symbol::Symbol;
use esl_compiler::children;
use esl_compiler::core::{BoundVariable, Callee, Core, LambdaId, NodeId, NodeKind, TagbodyItem, VarId};

/// How often a clause may run in one entry of its form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ClauseLimit {
    /// So often.
    Times(u32),
    /// As often as it applies.
    None,
    /// A number that is computed.
    Computed,
}

/// Ways in which control leaves a clause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Ways {
    /// It may run the body of the form again.
    pub(crate) retries: bool,
    /// It may leave the form with a result.
    pub(crate) aborts: bool,
    /// It waits before the body runs again.
    pub(crate) pauses: bool,
}

/// A clause of a recovery form.
#[derive(Clone, Debug)]
pub(crate) struct Clause {
    pub(crate) cause: Symbol,
    pub(crate) limit: ClauseLimit,
    pub(crate) ways: Ways,
    /// Body; `None` if it was not found, so that the lambda as a whole counts.
    pub(crate) body: NodeId,
}

/// Returns the clauses of a recovery form, and their bodies in the lambda that runs them.
pub(crate) fn clauses_of(core: &Core, table: NodeId, procedures: LambdaId) -> (Vec<Clause>, Vec<NodeId>) {
    let whole = core.lambdas[procedures.index()].body;
    let rows = rows_of(core, table);
    let bodies = bodies_of(core, procedures, rows.len());
    let clause = |(index, (cause, limit)): (usize, (Symbol, ClauseLimit))| {
        let body = bodies.get(index).copied().unwrap_or(whole);
        Clause { cause, limit, ways: ways_of(core, procedures, body), body }
    };
    let clauses: Vec<Clause> = rows.into_iter().enumerate().map(clause).collect();
    let bodies = clauses.iter().map(|clause| clause.body).collect();
    (clauses, bodies)
}

/// Returns causes and limits of a table.
fn rows_of(core: &Core, table: NodeId) -> Vec<(Symbol, ClauseLimit)> {
    let limit = |datum: &Datum| match datum.kind() {
        DatumKind::Integer(times) => u32::try_from(times).map_or(ClauseLimit::None, ClauseLimit::Times),
        DatumKind::Symbol(symbol) if symbol.name() == "INFINITE" => ClauseLimit::None,
        _ => ClauseLimit::Computed,
    };
    match &core.nodes[table.index()].kind {
        NodeKind::Constant(datum) => match datum.kind() {
            DatumKind::Vector(items) => {
                let pairs = items.get(1..).unwrap_or_default().chunks_exact(2);
                pairs.filter_map(|pair| Some((pair[0].as_symbol()?.clone(), limit(&pair[1])))).collect()
            }
            _ => Vec::new(),
        },
        NodeKind::Call(_, items) => {
            let pairs = items.get(1..).unwrap_or_default().chunks_exact(2);
            let row = |pair: &[NodeId]| {
                let NodeKind::Constant(cause) = &core.nodes[pair[0].index()].kind else { return None };
                let limit = match &core.nodes[pair[1].index()].kind {
                    NodeKind::Constant(datum) => limit(datum),
                    _ => ClauseLimit::Computed,
                };
                Some((cause.as_symbol()?.clone(), limit))
            };
            pairs.filter_map(row).collect()
        }
        _ => Vec::new(),
    }
}

/// Returns the bodies of `count` clauses in the order of the table.
fn bodies_of(core: &Core, procedures: LambdaId, count: usize) -> Vec<NodeId> {
    let lambda = &core.lambdas[procedures.index()];
    if count <= 1 {
        return vec![lambda.body];
    }
    let place = lambda.required.get(1).map(|parameter| parameter.variable);
    let mut keys: Vec<VarId> = place.into_iter().collect();
    let mut bodies = vec![lambda.body; count];
    let mut node = lambda.body;
    loop {
        match &core.nodes[node.index()].kind {
            NodeKind::Let { bindings, body, .. } => {
                for (variable, value) in bindings {
                    if let (BoundVariable::Lexical(bound), NodeKind::Local(read)) =
                        (variable, &core.nodes[value.index()].kind)
                        && keys.contains(read)
                    {
                        keys.push(*bound);
                    }
                }
                node = *body;
            }
            NodeKind::Progn(nodes) if nodes.len() == 1 => node = nodes[0],
            // Many clauses stand in a row, and leave a block.
            NodeKind::Block(_, inside) => node = *inside,
            NodeKind::Progn(nodes) => {
                for one in nodes {
                    if let NodeKind::If(test, then, _) = &core.nodes[one.index()].kind
                        && let Some(number) = tested_number(core, *test, &keys)
                        && let Some(body) = bodies.get_mut((number.saturating_sub(1) / 2) as usize)
                    {
                        *body = match &core.nodes[then.index()].kind {
                            NodeKind::ReturnFrom(_, value) => *value,
                            _ => *then,
                        };
                    }
                }
                break;
            }
            NodeKind::If(test, then, otherwise) => {
                let Some(number) = tested_number(core, *test, &keys) else { break };
                if let Some(body) = bodies.get_mut((number.saturating_sub(1) / 2) as usize) {
                    *body = *then;
                }
                node = *otherwise;
            }
            _ => break,
        }
    }
    bodies
}

/// Returns the number with which a test compares the place of the clause.
fn tested_number(core: &Core, test: NodeId, keys: &[VarId]) -> Option<u32> {
    let NodeKind::Call(Callee::Builtin(Builtin::Eql | Builtin::Eq), arguments) =
        &core.nodes[test.index()].kind
    else {
        return None;
    };
    let [left, right] = arguments.as_slice() else { return None };
    match (&core.nodes[left.index()].kind, &core.nodes[right.index()].kind) {
        (NodeKind::Local(variable), NodeKind::Constant(datum)) if keys.contains(variable) => {
            match datum.kind() {
                DatumKind::Integer(number) => u32::try_from(number).ok(),
                _ => None,
            }
        }
        _ => None,
    }
}

/// Returns the ways in which a clause leaves: its throws to the state of the form.
fn ways_of(core: &Core, procedures: LambdaId, body: NodeId) -> Ways {
    let lambda = &core.lambdas[procedures.index()];
    let state = lambda.required.first().map(|parameter| parameter.variable);
    let mut ways = Ways::default();
    let mut pending = vec![body];
    while let Some(node) = pending.pop() {
        let kind = &core.nodes[node.index()].kind;
        if let NodeKind::Throw(tag, values) = kind
            && let NodeKind::Local(variable) = core.nodes[tag.index()].kind
            && Some(variable) == state
        {
            match &core.nodes[values.index()].kind {
                NodeKind::Values(items) if items.len() == 2 => {
                    if matches!(core.nodes[items[0].index()].kind, NodeKind::Local(first) if Some(first) == state)
                    {
                        ways.retries = true;
                        let pause = &core.nodes[items[1].index()].kind;
                        ways.pauses |= matches!(pause, NodeKind::SetLocal(_, value)
                            if matches!(core.nodes[value.index()].kind, NodeKind::Call(..)));
                    } else {
                        ways.aborts = true;
                    }
                }
                _ => ways = Ways { retries: true, aborts: true, ..ways },
            }
        }
        children(kind, &mut |child| pending.push(child));
        match kind {
            NodeKind::Lambda(inner) => pending.push(core.lambdas[inner.index()].body),
            NodeKind::Functions { definitions, .. } => {
                pending.extend(definitions.iter().map(|(_, inner)| core.lambdas[inner.index()].body));
            }
            _ => {}
        }
    }
    ways
}

/// Returns whether control can reach the end of a node. `leaves` says whether a call, which is a node,
/// never comes back.
pub(crate) fn can_end(core: &Core, node: NodeId, leaves: &dyn Fn(NodeId) -> bool) -> bool {
    can_end_inside(core, node, leaves, MOST_NESTED)
}

/// Depth of lambdas that are called where they stand, up to which it matters how they end.
const MOST_NESTED: usize = 20;

fn can_end_inside(core: &Core, node: NodeId, leaves: &dyn Fn(NodeId) -> bool, depth: usize) -> bool {
    // Children have higher numbers than their parents.
    let mut ends: rustc_hash::FxHashMap<NodeId, bool> = rustc_hash::FxHashMap::default();
    let mut inside = Vec::new();
    let mut pending = vec![node];
    while let Some(node) = pending.pop() {
        inside.push(node);
        children(&core.nodes[node.index()].kind, &mut |child| pending.push(child));
    }
    inside.sort_unstable_by(|left, right| right.cmp(left));
    let mut returns_from = rustc_hash::FxHashSet::default();
    for node in &inside {
        if let NodeKind::ReturnFrom(block, _) = core.nodes[node.index()].kind {
            returns_from.insert(block);
        }
    }
    for node in inside {
        let end = |child: &NodeId| ends.get(child).copied().unwrap_or(true);
        let value = match &core.nodes[node.index()].kind {
            NodeKind::ReturnFrom(..) | NodeKind::Go(..) | NodeKind::Throw(..) => false,
            NodeKind::If(test, then, otherwise) => end(test) && (end(then) || end(otherwise)),
            NodeKind::And(nodes) | NodeKind::Or(nodes) => nodes.first().is_none_or(end),
            NodeKind::Let { bindings, body, .. } => bindings.iter().all(|(_, value)| end(value)) && end(body),
            NodeKind::Functions { body, .. } => end(body),
            NodeKind::Block(block, body) => end(body) || returns_from.contains(block),
            NodeKind::HandlerCase(body, clauses) => {
                end(body) || clauses.iter().any(|clause| end(&clause.body))
            }
            NodeKind::Recovery { .. } | NodeKind::Catch(..) => true,
            NodeKind::FailureCleanup(body, _) => end(body),
            NodeKind::Tagbody(_, items) => {
                let has_tag = items.iter().any(|item| matches!(item, TagbodyItem::Tag));
                has_tag || items.iter().all(|item| !matches!(item, TagbodyItem::Form(form) if !end(form)))
            }
            kind => {
                let mut all = true;
                children(kind, &mut |child| all &= end(&child));
                let (NodeKind::Call(callee, _) | NodeKind::Apply(callee, _)) = kind else {
                    ends.insert(node, all);
                    continue;
                };
                let comes_back = match callee {
                    Callee::Value(function) => match &core.nodes[function.index()].kind {
                        NodeKind::Lambda(lambda) if depth > 0 => {
                            can_end_inside(core, core.lambdas[lambda.index()].body, leaves, depth - 1)
                        }
                        _ => true,
                    },
                    _ => !leaves(node),
                };
                all && comes_back
            }
        };
        ends.insert(node, value);
    }
    ends.get(&node).copied().unwrap_or(true)
}
