//! Decides for each node whether a program states it directly, or keeps it as a node that is ticked.

use crate::catalogue::{BehaviourKind, Direction};
use crate::emit::entries::EntryUses;
use crate::model::{Model, Moment, PortValue, TreeNode};

/// Decisions for the nodes of a model, by their indices.
#[derive(Debug, Default)]
pub(crate) struct Modes {
    /// It is a condition, which ends at once and sets nothing.
    pub(crate) is_test: Vec<bool>,
    /// It ends within its tick.
    pub(crate) is_instant: Vec<bool>,
    /// It may be skipped.
    pub(crate) can_skip: Vec<bool>,
    /// It is ticked.
    pub(crate) is_ticked: Vec<bool>,
    /// To skip it is to fail: its parent goes on with the next way.
    pub(crate) skip_fails: Vec<bool>,
}

impl Modes {
    pub(crate) fn new(model: &Model, entries: &EntryUses) -> Modes {
        let count = model.nodes.len();
        let mut modes = Modes {
            is_test: vec![false; count],
            is_instant: vec![false; count],
            can_skip: vec![false; count],
            is_ticked: vec![false; count],
            skip_fails: vec![false; count],
        };
        let mut has_counterpart = vec![true; count];
        // Whether the node and all below it have counterparts.
        let mut is_whole = vec![true; count];
        for index in (0..count).rev() {
            let node = &model.nodes[index];
            modes.is_test[index] = modes.is_test(model, entries, index);
            modes.is_instant[index] = modes.is_test[index] || modes.is_instant(node);
            modes.can_skip[index] = modes.can_skip(model, node);
            has_counterpart[index] = modes.has_counterpart(model, index);
            is_whole[index] = has_counterpart[index] && node.children.iter().all(|&child| is_whole[child]);
        }
        for index in 0..count {
            let node = &model.nodes[index];
            let parent = node.parent;
            modes.skip_fails[index] = parent.is_some_and(|parent| {
                let kind = model.nodes[parent].kind;
                matches!(kind, BehaviourKind::Fallback)
                    || kind != BehaviourKind::Sequence && modes.skip_fails[parent]
            });
            modes.is_ticked[index] = match parent.filter(|&parent| modes.is_ticked[parent]) {
                None => !has_counterpart[index],
                // Below a node that is ticked, whole activities are leaves.
                Some(_) => {
                    !modes.is_test[index]
                        && !node.children.is_empty()
                        && !is_custom(node.kind)
                        && (!is_whole[index] || modes.is_instant[index] || is_paced(node.kind))
                }
            };
        }
        modes
    }

    fn all_children(&self, node: &TreeNode, list: fn(&Modes) -> &Vec<bool>) -> bool {
        !node.children.is_empty() && node.children.iter().all(|&child| list(self)[child])
    }

    fn is_test(&self, model: &Model, entries: &EntryUses, index: usize) -> bool {
        let node = &model.nodes[index];
        if !node.conditions.is_empty() {
            return false;
        }
        match node.kind {
            BehaviourKind::Condition => {
                let is_output = |name: &str| entries.direction(model, index, name) != Direction::In;
                !node
                    .ports
                    .iter()
                    .any(|port| matches!(port.value, PortValue::Entry(_)) && is_output(&port.name))
            }
            BehaviourKind::ScriptCondition => node.script.assigned().next().is_none(),
            BehaviourKind::AlwaysSuccess | BehaviourKind::AlwaysFailure => true,
            BehaviourKind::Inverter
            | BehaviourKind::Sequence
            | BehaviourKind::Fallback
            | BehaviourKind::ReactiveSequence
            | BehaviourKind::ReactiveFallback => self.all_children(node, |modes| &modes.is_test),
            _ => false,
        }
    }

    fn is_instant(&self, node: &TreeNode) -> bool {
        match node.kind {
            BehaviourKind::Condition
            | BehaviourKind::ScriptCondition
            | BehaviourKind::SyncAction
            | BehaviourKind::Script
            | BehaviourKind::SetBlackboard
            | BehaviourKind::UnsetBlackboard => true,
            BehaviourKind::Inverter
            | BehaviourKind::Sequence
            | BehaviourKind::Fallback
            | BehaviourKind::ReactiveSequence
            | BehaviourKind::ReactiveFallback
            | BehaviourKind::IfThenElse
            | BehaviourKind::ForceSuccess
            | BehaviourKind::ForceFailure
            | BehaviourKind::BlackboardCheck
            | BehaviourKind::Switch(_) => self.all_children(node, |modes| &modes.is_instant),
            _ => false,
        }
    }

    fn can_skip(&self, model: &Model, node: &TreeNode) -> bool {
        if node.condition(Moment::SkipIf).is_some() || node.condition(Moment::While).is_some() {
            return true;
        }
        match node.kind {
            BehaviourKind::SubTree => model.tree(&node.id).is_some_and(|tree| {
                let root = &model.nodes[model.trees[tree].root];
                root.condition(Moment::SkipIf).is_some() || root.condition(Moment::While).is_some()
            }),
            BehaviourKind::Precondition => node.text("else").as_deref() == Some("SKIPPED"),
            BehaviourKind::BlackboardCheck => node.text("return_on_mismatch").as_deref() == Some("SKIPPED"),
            BehaviourKind::RunOnce | BehaviourKind::SkipUnlessUpdated => true,
            BehaviourKind::Loop => node.text("if_empty").as_deref() == Some("SKIPPED"),
            BehaviourKind::Switch(_) | BehaviourKind::IfThenElse => {
                node.children.iter().any(|&child| self.can_skip[child])
            }
            _ => self.all_children(node, |modes| &modes.can_skip),
        }
    }

    /// Returns whether a form of the language means the same as a node.
    fn has_counterpart(&self, model: &Model, index: usize) -> bool {
        let node = &model.nodes[index];
        let skips = node.children.iter().any(|&child| self.can_skip[child]);
        let may_skip = matches!(
            node.kind,
            BehaviourKind::Sequence | BehaviourKind::Fallback | BehaviourKind::Timeout | BehaviourKind::Delay
        );
        if skips && (!may_skip || self.all_children(node, |modes| &modes.can_skip) && node.children.len() > 1)
        {
            return false;
        }
        let moments = |wanted: &[Moment]| node.conditions.iter().any(|(moment, _)| wanted.contains(moment));
        if moments(&[Moment::SkipIf, Moment::While])
            && moments(&[Moment::OnHalted, Moment::OnFailure, Moment::OnSuccess, Moment::Post])
        {
            return false;
        }
        let last = node.children.len().saturating_sub(1);
        let guards_are_tests = node.children.iter().take(last).all(|&child| self.is_test[child]);
        match node.kind {
            BehaviourKind::Pipeline
            | BehaviourKind::Nonblocking
            | BehaviourKind::Persistent
            | BehaviourKind::ParallelAll
            | BehaviourKind::SkipUnlessUpdated
            | BehaviourKind::WaitValueUpdated => false,
            // Conditions after an activity, or two activities, are ticked in turn.
            BehaviourKind::ReactiveSequence | BehaviourKind::ReactiveFallback => guards_are_tests && last > 0,
            BehaviourKind::WhileDoElse => node.children.len() == 2 && self.is_test[node.children[0]],
            BehaviourKind::Parallel => parallel(node).is_some(),
            BehaviourKind::Switch(_) => !is_concurrent(model, index),
            BehaviourKind::RunOnce => node.text("then_skip").as_deref() == Some("true"),
            _ => true,
        }
    }
}

/// Form of a `Parallel`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ParallelForm {
    /// All must succeed; the first failure ends it.
    Net,
    /// The first success ends it; all must fail.
    First,
    /// The first end ends it.
    Race,
}

/// Returns the form that means the same as a `Parallel`, if there is one.
pub(crate) fn parallel(node: &TreeNode) -> Option<ParallelForm> {
    let count = i64::try_from(node.children.len()).ok()?;
    let number = |names: &[&str], default: i64| match names
        .iter()
        .find_map(|name| node.ports.iter().any(|port| port.name == *name).then(|| node.whole(name)))
    {
        Some(number) => number,
        None => Some(default),
    };
    let absolute = |number: i64| if number < 0 { count + number + 1 } else { number };
    let success = absolute(number(&["success_count", "success_threshold", "threshold"], -1)?);
    let failure = absolute(number(&["failure_count", "failure_threshold"], 1)?);
    match (success, failure) {
        (success, 1) if success == count => Some(ParallelForm::Net),
        (1, failure) if failure == count => Some(ParallelForm::First),
        (1, 1) => Some(ParallelForm::Race),
        _ => None,
    }
}

fn is_custom(kind: BehaviourKind) -> bool {
    matches!(kind, BehaviourKind::CustomControl | BehaviourKind::CustomDecorator)
}

/// Returns whether a node passes on only some of its ticks.
pub(crate) fn is_paced(kind: BehaviourKind) -> bool {
    matches!(
        kind,
        BehaviourKind::RateController
            | BehaviourKind::DistanceController
            | BehaviourKind::SpeedController
            | BehaviourKind::GoalUpdatedController
            | BehaviourKind::GoalUpdater
            | BehaviourKind::SingleTrigger
            | BehaviourKind::PathLonger
    )
}

/// Returns whether a node may be left before its end, and ticked again later, when it goes on in the middle.
pub(crate) fn may_be_resumed(model: &Model, index: usize) -> bool {
    let mut parent = model.nodes[index].parent;
    while let Some(ancestor) = parent {
        let node = &model.nodes[ancestor];
        if !matches!(node.kind, BehaviourKind::Sequence | BehaviourKind::Timeout | BehaviourKind::Delay) {
            return true;
        }
        parent = node.parent;
    }
    model.nodes[index].tree != model.main
}

/// Returns whether other nodes run beside this one, or change its variable below it.
fn is_concurrent(model: &Model, index: usize) -> bool {
    let mut parent = model.nodes[index].parent;
    while let Some(ancestor) = parent {
        let node = &model.nodes[ancestor];
        if matches!(
            node.kind,
            BehaviourKind::Parallel
                | BehaviourKind::ParallelAll
                | BehaviourKind::ReactiveSequence
                | BehaviourKind::ReactiveFallback
                | BehaviourKind::WhileDoElse
                | BehaviourKind::Pipeline
                | BehaviourKind::Nonblocking
        ) {
            return true;
        }
        parent = node.parent;
    }
    false
}
