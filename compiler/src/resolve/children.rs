//! The immediate children of a node, and the nodes of a lambda, in the order of evaluation.

use crate::core::*;

/// Calls `$visit` with each immediate child of a node: the one list of what the children of each kind are.
macro_rules! visit_children {
    ($kind:expr, $iter:ident, $visit:expr) => {{
        let mut visit = $visit;
        match $kind {
            NodeKind::Hole
            | NodeKind::Constant(_)
            | NodeKind::Local(_)
            | NodeKind::Special(_)
            | NodeKind::FunctionRef(_)
            | NodeKind::BuiltinRef(_)
            | NodeKind::Lambda(_)
            | NodeKind::Go(..)
            | NodeKind::Pass(_) => {}
            NodeKind::SetLocal(_, node)
            | NodeKind::SetSpecial(_, node)
            | NodeKind::Block(_, node)
            | NodeKind::ReturnFrom(_, node)
            | NodeKind::Slot(_, _, node)
            | NodeKind::IsInstance(_, node)
            | NodeKind::Functions { body: node, .. } => visit(node),
            NodeKind::If(a, b, c)
            | NodeKind::Progv(a, b, c)
            | NodeKind::Recovery { table: a, procedures: b, body: c } => {
                [a, b, c].into_iter().for_each(&mut visit)
            }
            NodeKind::Catch(a, b)
            | NodeKind::Throw(a, b)
            | NodeKind::UnwindProtect(a, b)
            | NodeKind::FailureCleanup(a, b)
            | NodeKind::BindValues(_, a, b)
            | NodeKind::FirstValues(a, b)
            | NodeKind::Handlers(a, b)
            | NodeKind::Mask(a, b)
            | NodeKind::SetSlot(_, _, a, b) => [a, b].into_iter().for_each(&mut visit),
            NodeKind::Progn(nodes) | NodeKind::And(nodes) | NodeKind::Or(nodes) | NodeKind::Values(nodes) => {
                nodes.$iter().for_each(&mut visit)
            }
            NodeKind::Let { bindings, body, .. } => {
                bindings.$iter().for_each(|(_, value)| visit(value));
                visit(body);
            }
            NodeKind::Tagbody(_, items) => {
                for item in items {
                    if let TagbodyItem::Form(form) = item {
                        visit(form);
                    }
                }
            }
            NodeKind::Call(callee, arguments) | NodeKind::Apply(callee, arguments) => {
                if let Callee::Value(function) = callee {
                    visit(function);
                }
                arguments.$iter().for_each(&mut visit);
            }
            NodeKind::CallValues(function, forms) => {
                visit(function);
                forms.$iter().for_each(&mut visit);
            }
            NodeKind::HandlerCase(body, clauses) => {
                visit(body);
                clauses.$iter().for_each(|HandlerClause { body, .. }| visit(body));
            }
        }
    }};
}

/// Calls `visit` with the immediate children of a node. The nodes of a lambda are not children.
pub fn children(kind: &NodeKind, visit: &mut dyn FnMut(NodeId)) {
    visit_children!(kind, iter, |node: &NodeId| visit(*node));
}

/// As [`children`], to change them.
pub(crate) fn children_mut(kind: &mut NodeKind, visit: &mut dyn FnMut(&mut NodeId)) {
    visit_children!(kind, iter_mut, |node: &mut NodeId| visit(node));
}

/// Calls `visit` with the nodes of a lambda: the defaults of its parameters, then its body.
pub fn lambda_nodes(lambda: &Lambda, visit: &mut dyn FnMut(NodeId)) {
    lambda.optional.iter().for_each(|optional| visit(optional.default));
    lambda.keys.iter().flatten().for_each(|key| visit(key.optional.default));
    visit(lambda.body);
}
