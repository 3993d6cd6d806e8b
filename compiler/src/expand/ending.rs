//! Whether control reaches the end of a form, as far as its text shows: for the warning about recovery
//! clauses that fall off their end, and for local functions that never return.
//!
//! Which forms are reached inside a tagbody follows from the `go`s in it. Conditions that are constants are
//! taken into account, as in `(loop while t do …)`. The answer may be wrong on the side of no warning only: a
//! form that is too large to be walked counts as one that needs none.

use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashSet;

use super::form::is_esl;
use crate::core::*;
use crate::resolve::{children, lambda_nodes};

/// Functions and operators that do not return.
const LEAVING: &[&str] = &["FAIL", "%FAIL-FOR", "%FAIL-AS", "%FAIL-ALL", "%NO-CASE", "NEXT-BINDINGS", "EXIT"];
const LEAVING_STANDARD: &[&str] = &["ERROR", "INVOKE-RESTART", "ABORT"];

/// Nodes that are visited for one question at most.
const MOST_NODES: usize = 10_000;
/// How deep the forms of a tagbody are looked into.
const MOST_LEVELS: usize = 64;

/// A question about the end of a form.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum EndQuestion {
    /// Whether control never reaches it, or the form says that its value is meant.
    LeavesOrResumes,
    /// Whether control never reaches it.
    Leaves,
}

/// Answers a question about the end of a form.
pub(super) fn ends(core: &Core, node: NodeId, question: EndQuestion) -> bool {
    let mut walk = EndWalk { core, inside: FxHashSet::default(), caught: Vec::new(), nodes: 0 };
    let answer = walk.ends(node, question);
    if walk.nodes > MOST_NODES { question == EndQuestion::LeavesOrResumes } else { answer }
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

/// Returns the symbol that a form is, if it is a quoted one.
fn written_symbol(core: &Core, node: NodeId) -> Option<&Symbol> {
    match &core.nodes[node.index()].kind {
        NodeKind::Constant(constant) => constant.as_symbol(),
        _ => None,
    }
}

/// A walk that answers one question.
struct EndWalk<'a> {
    core: &'a Core,
    /// Blocks around the form whose ends are those of the whole.
    inside: FxHashSet<BlockId>,
    /// Tags of the catches around the form, if they are written there.
    caught: Vec<Symbol>,
    /// Number of nodes visited.
    nodes: usize,
}

impl<'a> EndWalk<'a> {
    /// Counts a node. Returns whether it is to be visited.
    fn visit(&mut self) -> bool {
        self.nodes += 1;
        self.nodes <= MOST_NODES
    }

    /// Answers the question for a form. A `NIL` that a macro has put at the end of its expansion, as `dolist`
    /// does, does not say that it is meant.
    fn ends(&mut self, node: NodeId, question: EndQuestion) -> bool {
        let core = self.core;
        let leaves = question == EndQuestion::Leaves;
        let mut pending = vec![(node, None)];
        while let Some((node, around)) = pending.pop() {
            if !self.visit() {
                return false;
            }
            let span = core.nodes[node.index()].span;
            let inside_it = |node: NodeId| (node, Some(span));
            let kind = &core.nodes[node.index()].kind;
            if evaluated_first(kind).any(|part| exits(core, part, &self.inside)) {
                continue;
            }
            match kind {
                NodeKind::Constant(constant) if constant.is_nil() && around == Some(span) => return false,
                NodeKind::Constant(_) | NodeKind::Values(_) if leaves => return false,
                NodeKind::Constant(_) | NodeKind::Values(_) | NodeKind::Go(..) => {}
                NodeKind::Throw(tag, value) => {
                    if written_symbol(core, *tag).is_some_and(|tag| self.caught.contains(tag)) {
                        pending.push(inside_it(*value));
                    }
                }
                // Functions that are called in it may throw to it.
                NodeKind::Catch(..) if leaves => return false,
                NodeKind::Catch(tag, body) => {
                    self.caught.extend(written_symbol(core, *tag).cloned());
                    pending.push(inside_it(*body));
                }
                // Control may leave it from anywhere inside.
                NodeKind::Block(block, _) if leaves && core.blocks[block.index()].is_used => return false,
                NodeKind::ReturnFrom(block, value) => {
                    if self.inside.contains(block) {
                        pending.push(inside_it(*value));
                    }
                }
                NodeKind::Block(block, body) => {
                    self.inside.insert(*block);
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
                NodeKind::Tagbody(tagbody, items) => {
                    if self.reaches_end(*tagbody, items, 0) {
                        return false;
                    }
                }
                NodeKind::Call(Callee::Global(function), _) => {
                    if !is_leaving(function) {
                        return false;
                    }
                }
                NodeKind::Call(Callee::Local(function), _) | NodeKind::Apply(Callee::Local(function), _) => {
                    if !core.variables[function.index()].never_returns {
                        return false;
                    }
                }
                NodeKind::Call(Callee::Value(function), _) | NodeKind::Apply(Callee::Value(function), _) => {
                    match core.nodes[function.index()].kind {
                        NodeKind::Lambda(lambda) => {
                            pending.push(inside_it(core.lambdas[lambda.index()].body))
                        }
                        _ => return false,
                    }
                }
                _ => return false,
            }
        }
        true
    }

    /// Whether control reaches the end of a tagbody, `level` levels inside of another.
    fn reaches_end(&mut self, tagbody: TagbodyId, items: &[TagbodyItem], level: usize) -> bool {
        let is_tag = |&place: &usize| matches!(items[place], TagbodyItem::Tag);
        let tags: Vec<usize> = (0..items.len()).filter(is_tag).collect();
        let mut reached = vec![false; tags.len()];
        let mut starts = vec![0];
        while let Some(start) = starts.pop() {
            let mut has_left = false;
            for (place, item) in items.iter().enumerate().skip(start) {
                match item {
                    TagbodyItem::Tag => {
                        let tag = tags.partition_point(|&tag| tag < place);
                        // Control goes on in a part that has been walked or will be.
                        if std::mem::replace(&mut reached[tag], true) && place != start {
                            has_left = true;
                            break;
                        }
                    }
                    TagbodyItem::Form(form) => {
                        for tag in self.gos(tagbody, *form) {
                            if !std::mem::replace(&mut reached[tag], true) {
                                starts.push(tags[tag]);
                            }
                        }
                        if !self.completes(*form, level + 1) {
                            has_left = true;
                            break;
                        }
                    }
                }
            }
            if !has_left {
                return true;
            }
        }
        false
    }

    /// Returns the tags of a tagbody to which a form in it goes.
    fn gos(&mut self, tagbody: TagbodyId, form: NodeId) -> Vec<usize> {
        let core = self.core;
        let mut tags = Vec::new();
        let mut pending = vec![form];
        while let Some(node) = pending.pop() {
            if !self.visit() {
                break;
            }
            let kind = &core.nodes[node.index()].kind;
            match kind {
                NodeKind::Go(to, tag) if *to == tagbody => tags.push(*tag as usize),
                NodeKind::If(test, consequent, alternative) if truth(core, *test).is_some() => {
                    let holds = truth(core, *test) == Some(true);
                    pending.push(if holds { *consequent } else { *alternative });
                    continue;
                }
                NodeKind::Lambda(lambda) => {
                    lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push(node));
                }
                NodeKind::Functions { definitions, .. } => {
                    for (_, lambda) in definitions {
                        lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push(node));
                    }
                }
                _ => {}
            }
            children(kind, &mut |node| pending.push(node));
        }
        tags
    }

    /// Whether control may reach the end of a form of a tagbody.
    fn completes(&mut self, form: NodeId, level: usize) -> bool {
        if level > MOST_LEVELS || !self.visit() {
            return true;
        }
        let core = self.core;
        let kind = &core.nodes[form.index()].kind;
        if exits(core, form, &self.inside)
            || evaluated_first(kind).any(|part| !self.completes(part, level + 1))
        {
            return false;
        }
        match kind {
            NodeKind::If(test, consequent, alternative) => match truth(core, *test) {
                Some(true) => self.completes(*consequent, level + 1),
                Some(false) => self.completes(*alternative, level + 1),
                None => self.completes(*consequent, level + 1) || self.completes(*alternative, level + 1),
            },
            NodeKind::Block(block, body) => {
                core.blocks[block.index()].is_used || self.completes(*body, level + 1)
            }
            NodeKind::Tagbody(tagbody, items) => self.reaches_end(*tagbody, items, level),
            NodeKind::Let { body, .. }
            | NodeKind::Functions { body, .. }
            | NodeKind::BindValues(_, _, body) => self.completes(*body, level + 1),
            _ => true,
        }
    }
}
