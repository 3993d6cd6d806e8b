//! The immediate children of a node, and the nodes of a lambda, in the order of evaluation.

use crate::core::*;

/// Calls `visit` with the immediate children of a node. The nodes of a lambda are not children.
pub(crate) fn children(kind: &NodeKind, visit: &mut dyn FnMut(NodeId)) {
    let mut all = |nodes: &[NodeId]| nodes.iter().for_each(|&node| visit(node));
    match kind {
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
        | NodeKind::Functions { body: node, .. } => all(&[*node]),
        NodeKind::If(a, b, c)
        | NodeKind::Progv(a, b, c)
        | NodeKind::Recovery { table: a, procedures: b, body: c } => all(&[*a, *b, *c]),
        NodeKind::Catch(a, b)
        | NodeKind::Throw(a, b)
        | NodeKind::UnwindProtect(a, b)
        | NodeKind::FailureCleanup(a, b)
        | NodeKind::BindValues(_, a, b)
        | NodeKind::FirstValues(a, b)
        | NodeKind::Handlers(a, b)
        | NodeKind::Mask(a, b)
        | NodeKind::SetSlot(_, _, a, b) => all(&[*a, *b]),
        NodeKind::Progn(nodes) | NodeKind::And(nodes) | NodeKind::Or(nodes) | NodeKind::Values(nodes) => {
            all(nodes)
        }
        NodeKind::Let { bindings, body, .. } => {
            bindings.iter().for_each(|(_, value)| visit(*value));
            visit(*body);
        }
        NodeKind::Tagbody(_, items) => {
            for item in items {
                if let TagbodyItem::Form(form) = item {
                    visit(*form);
                }
            }
        }
        NodeKind::Call(callee, arguments) | NodeKind::Apply(callee, arguments) => {
            if let Callee::Value(function) = callee {
                visit(*function);
            }
            arguments.iter().for_each(|&argument| visit(argument));
        }
        NodeKind::CallValues(function, forms) => {
            visit(*function);
            forms.iter().for_each(|&form| visit(form));
        }
        NodeKind::HandlerCase(body, clauses) => {
            visit(*body);
            clauses.iter().for_each(|clause| visit(clause.body));
        }
    }
}

/// Calls `visit` with the nodes of a lambda: the defaults of its parameters, then its body.
pub(crate) fn lambda_nodes(lambda: &Lambda, visit: &mut dyn FnMut(NodeId)) {
    lambda.optional.iter().for_each(|optional| visit(optional.default));
    lambda.keys.iter().flatten().for_each(|key| visit(key.optional.default));
    visit(lambda.body);
}
