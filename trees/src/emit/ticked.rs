//! Nodes that are ticked, as parts of `bt:ticking`.

use crate::catalogue::BehaviourKind;
use crate::emit::Emitter;
use crate::emit::form::FormId;
use crate::model::{Moment, PortValue, TreeNode};
use crate::ros;

/// Names of the options of nodes, and the ports that they come from.
const OPTIONS: [(BehaviourKind, &[(&str, &str)]); 16] = [
    (BehaviourKind::Parallel, &[(":success-count", "success_count"), (":failure-count", "failure_count")]),
    (BehaviourKind::ParallelAll, &[(":max-failures", "max_failures")]),
    (BehaviourKind::TryCatch, &[(":catch-on-halt", "catch_on_halt")]),
    (BehaviourKind::Retry, &[(":attempts", "num_attempts")]),
    (BehaviourKind::Repeat, &[(":cycles", "num_cycles")]),
    (BehaviourKind::RunOnce, &[(":then-skip", "then_skip")]),
    (BehaviourKind::BlackboardCheck, &[(":value-a", "value_A"), (":value-b", "value_B")]),
    (BehaviourKind::SkipUnlessUpdated, &[(":entry", "entry")]),
    (BehaviourKind::WaitValueUpdated, &[(":entry", "entry")]),
    (BehaviourKind::Recovery, &[(":retries", "number_of_retries")]),
    (BehaviourKind::RoundRobin, &[(":wrap", "wrap_around")]),
    (BehaviourKind::Persistent, &[(":place", "current_child_idx")]),
    (BehaviourKind::RateController, &[(":hz", "hz")]),
    (BehaviourKind::DistanceController, &[(":distance", "distance")]),
    (
        BehaviourKind::SpeedController,
        &[
            (":min-rate", "min_rate"),
            (":max-rate", "max_rate"),
            (":min-speed", "min_speed"),
            (":max-speed", "max_speed"),
        ],
    ),
    (BehaviourKind::Loop, &[(":queue", "queue"), (":value", "value")]),
];

/// Returns the name of a node of a kind in `bt:ticking`.
pub(crate) fn operator(kind: BehaviourKind) -> &'static str {
    match kind {
        BehaviourKind::Sequence => ":sequence",
        BehaviourKind::SequenceWithMemory => ":sequence-with-memory",
        BehaviourKind::Fallback => ":fallback",
        BehaviourKind::Parallel => ":parallel",
        BehaviourKind::ParallelAll => ":parallel-all",
        BehaviourKind::ReactiveSequence => ":reactive-sequence",
        BehaviourKind::ReactiveFallback => ":reactive-fallback",
        BehaviourKind::IfThenElse => ":if-then-else",
        BehaviourKind::WhileDoElse => ":while-do-else",
        BehaviourKind::Switch(_) => ":switch",
        BehaviourKind::TryCatch => ":try-catch",
        BehaviourKind::Inverter => ":inverter",
        BehaviourKind::Retry => ":retry",
        BehaviourKind::Repeat => ":repeat",
        BehaviourKind::Timeout => ":timeout",
        BehaviourKind::Delay => ":delay",
        BehaviourKind::ForceSuccess => ":force-success",
        BehaviourKind::ForceFailure => ":force-failure",
        BehaviourKind::KeepRunning => ":keep-running-until-failure",
        BehaviourKind::RunOnce => ":run-once",
        BehaviourKind::Precondition => ":precondition",
        BehaviourKind::Loop => ":loop",
        BehaviourKind::BlackboardCheck => ":blackboard-check",
        BehaviourKind::SkipUnlessUpdated => ":skip-unless-updated",
        BehaviourKind::WaitValueUpdated => ":wait-value-update",
        BehaviourKind::SubTree => ":subtree",
        BehaviourKind::AlwaysSuccess => ":always-success",
        BehaviourKind::AlwaysFailure => ":always-failure",
        BehaviourKind::Script => ":script",
        BehaviourKind::ScriptCondition => ":script-condition",
        BehaviourKind::SetBlackboard => ":set-blackboard",
        BehaviourKind::UnsetBlackboard => ":unset-blackboard",
        BehaviourKind::Sleep => ":sleep",
        BehaviourKind::Pipeline => ":pipeline-sequence",
        BehaviourKind::Recovery => ":recovery",
        BehaviourKind::RoundRobin => ":round-robin",
        BehaviourKind::Nonblocking => ":nonblocking-sequence",
        BehaviourKind::Persistent => ":persistent-sequence",
        BehaviourKind::RateController => ":rate-controller",
        BehaviourKind::DistanceController => ":distance-controller",
        BehaviourKind::SpeedController => ":speed-controller",
        BehaviourKind::GoalUpdatedController => ":goal-updated-controller",
        BehaviourKind::GoalUpdater => ":goal-updater",
        BehaviourKind::SingleTrigger => ":single-trigger",
        BehaviourKind::PathLonger => ":path-longer-on-approach",
        BehaviourKind::CustomDecorator => ":decorator",
        BehaviourKind::CustomControl => ":control",
        BehaviourKind::Action => ":action",
        BehaviourKind::SyncAction => ":sync-action",
        BehaviourKind::Condition => ":condition",
    }
}

/// Returns the name of a moment in `bt:ticking`.
pub(crate) fn moment_name(moment: Moment) -> &'static str {
    match moment {
        Moment::FailureIf => ":failure-if",
        Moment::SuccessIf => ":success-if",
        Moment::SkipIf => ":skip-if",
        Moment::While => ":while",
        Moment::OnHalted => ":on-halted",
        Moment::OnFailure => ":on-failure",
        Moment::OnSuccess => ":on-success",
        Moment::Post => ":post",
    }
}

impl Emitter<'_> {
    /// Returns a child of a node that is ticked.
    fn part(&mut self, child: usize) -> FormId {
        let node = &self.model.nodes[child];
        if let Some(form) = self.ticks[child - self.base] {
            return form;
        }
        if self.modes.is_test[child] {
            let test = self.tests[child - self.base];
            return self.forms.call(":test", 2, [test]);
        }
        let body = self.statements(child);
        if self.modes.is_instant[child] && node.children.is_empty() && node.conditions.is_empty() {
            return self.forms.call(":call", 1, body);
        }
        let keeps = node.kind == BehaviourKind::Action
            && node.conditions.is_empty()
            && ros::row(&node.id).is_none()
            && node.parent.is_some_and(|parent| {
                matches!(
                    self.model.nodes[parent].kind,
                    BehaviourKind::Pipeline | BehaviourKind::Nonblocking | BehaviourKind::WhileDoElse
                )
            });
        if keeps {
            return self.forms.call(":action", 1, body);
        }
        self.progn(body)
    }

    /// Returns the part that a node is.
    pub(super) fn ticked(&mut self, index: usize) -> FormId {
        let node = &self.model.nodes[index];
        let mut items = Vec::new();
        for (moment, script) in &node.conditions {
            items.push(self.forms.atom(moment_name(*moment)));
            let is_test = *moment <= Moment::While;
            let form = if is_test {
                self.script_test(script)
            } else {
                let statements = self.script_statements(script);
                self.progn(statements)
            };
            items.push(form);
        }
        items.extend(self.options(index));
        for child in node.children.clone() {
            let part = self.part(child);
            items.push(part);
        }
        self.forms.call(operator(node.kind), 1, items)
    }

    fn options(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let mut items = Vec::new();
        for (_, options) in OPTIONS.iter().filter(|(kind, _)| *kind == node.kind) {
            for (name, port) in *options {
                let old = match *port {
                    "success_count" => node.port("success_threshold").or_else(|| node.port("threshold")),
                    "failure_count" => node.port("failure_threshold"),
                    _ => None,
                };
                if let Some(value) = old.or_else(|| node.port(port)) {
                    items.push(self.forms.atom(*name));
                    items.push(self.value(&value));
                }
            }
        }
        match node.kind {
            BehaviourKind::Timeout | BehaviourKind::Delay => {
                let port = if node.kind == BehaviourKind::Timeout { "msec" } else { "delay_msec" };
                items.push(self.forms.atom(":seconds"));
                items.push(self.seconds(node, port));
            }
            BehaviourKind::Precondition => {
                items.push(self.forms.atom(":if"));
                items.push(self.script_test(&node.script));
                self.add_status(node, "else", ":else", &mut items);
            }
            BehaviourKind::BlackboardCheck => {
                self.add_status(node, "return_on_mismatch", ":else", &mut items)
            }
            BehaviourKind::Loop => self.add_status(node, "if_empty", ":if-empty", &mut items),
            BehaviourKind::Switch(cases) => {
                let variable = node.port("variable").unwrap_or(PortValue::Text(String::new()));
                items.push(self.forms.atom(":variable"));
                items.push(self.value(&variable));
                let values: Vec<PortValue> =
                    (1..=cases).filter_map(|case| node.port(&format!("case_{case}"))).collect();
                let values: Vec<FormId> = values.iter().map(|value| self.value(value)).collect();
                items.push(self.forms.atom(":cases"));
                items.push(self.forms.call("list", 1, values));
            }
            BehaviourKind::GoalUpdatedController => {
                let goals: Vec<PortValue> = ["goal", "goals"]
                    .iter()
                    .map(|name| node.port(name).unwrap_or_else(|| PortValue::Entry((*name).into())))
                    .collect();
                let goals: Vec<FormId> = goals.iter().map(|value| self.value(value)).collect();
                items.push(self.forms.atom(":goal"));
                items.push(self.forms.call("list", 1, goals));
            }
            BehaviourKind::GoalUpdater => {
                items.push(self.forms.atom(":call"));
                items.push(self.leaf_call(index, &[]));
            }
            BehaviourKind::PathLonger => {
                items.push(self.forms.atom(":if"));
                items.push(self.leaf_call(index, &[]));
            }
            BehaviourKind::DistanceController => self.add_measure("odometer", ":odometer", &mut items),
            BehaviourKind::SpeedController => self.add_measure("robot-speed", ":speed", &mut items),
            _ => {}
        }
        items
    }

    fn add_status(&mut self, node: &TreeNode, port: &str, name: &str, items: &mut Vec<FormId>) {
        if let Some(status) = node.text(port) {
            items.push(self.forms.atom(name));
            items.push(self.forms.atom(format!(":{}", status.to_lowercase())));
        }
    }

    /// Adds the call of a function that measures the robot.
    fn add_measure(&mut self, wanted: &str, name: &str, items: &mut Vec<FormId>) {
        let function = self.measure(wanted);
        items.push(self.forms.atom(name));
        items.push(self.forms.atoms(&[&function]));
    }
}
