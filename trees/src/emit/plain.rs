//! Nodes as forms of the language.

use crate::catalogue::BehaviourKind;
use crate::emit::Emitter;
use crate::emit::form::FormId;
use crate::emit::modes::{self, ParallelForm};
use crate::emit::names::kebab;
use crate::emit::scripts::quoted;
use crate::model::{Moment, PortValue, TreeNode};

impl Emitter<'_> {
    /// Returns the condition that a node is.
    pub(super) fn test(&mut self, index: usize) -> FormId {
        let node = &self.model.nodes[index];
        let children = || node.children.iter().map(|&child| self.tests[child - self.base]);
        match node.kind {
            BehaviourKind::ScriptCondition => self.script_test(&node.script),
            BehaviourKind::AlwaysSuccess => self.forms.atom("t"),
            BehaviourKind::AlwaysFailure => self.forms.atom("nil"),
            BehaviourKind::Inverter => {
                let child = self.tests[node.children[0] - self.base];
                self.not(child)
            }
            BehaviourKind::Sequence
            | BehaviourKind::ReactiveSequence
            | BehaviourKind::Fallback
            | BehaviourKind::ReactiveFallback => {
                let parts: Vec<FormId> = children().collect();
                let is_all = matches!(node.kind, BehaviourKind::Sequence | BehaviourKind::ReactiveSequence);
                match *parts {
                    [part] => part,
                    _ => self.forms.call(if is_all { "and" } else { "or" }, 2, parts),
                }
            }
            _ => self.leaf_call(index, &[]),
        }
    }

    pub(super) fn not(&mut self, form: FormId) -> FormId {
        match self.forms.argument_of("not", form) {
            Some(inner) => inner,
            None => self.forms.call("not", 2, [form]),
        }
    }

    /// Returns one form for several.
    pub(super) fn progn(&mut self, forms: Vec<FormId>) -> FormId {
        match *forms {
            [] => self.forms.atom("t"),
            [form] => form,
            _ => self.forms.call("progn", 1, forms),
        }
    }

    /// Returns the form that fails as a node does.
    pub(super) fn failure(&mut self, index: usize) -> FormId {
        let name = kebab(self.model.nodes[index].title());
        let is_known = ["timeout", "error", "skipped", "stack-exhausted", "tree-failed"].contains(&&*name);
        self.fail_with(&if is_known { format!(":{name}-node") } else { format!(":{name}") })
    }

    /// Returns the form that fails with a cause.
    pub(super) fn fail_with(&mut self, cause: &str) -> FormId {
        self.causes.insert(cause.to_owned());
        self.forms.atoms(&["fail", cause])
    }

    /// Returns the statements that fail unless a condition holds.
    pub(super) fn demand(&mut self, test: FormId, index: usize) -> Vec<FormId> {
        match self.forms.text_of(test) {
            Some("t") => return Vec::new(),
            Some("nil") => return vec![self.failure(index)],
            _ => {}
        }
        let failure = self.failure(index);
        vec![match self.forms.argument_of("not", test) {
            Some(inner) => self.forms.call("when", 2, [inner, failure]),
            None => {
                let ways = self.forms.arguments_of("or", test).map_or(vec![test], <[FormId]>::to_vec);
                self.forms.call("or", 2, ways.into_iter().chain([failure]))
            }
        }]
    }

    /// Returns the statements of a child.
    pub(super) fn statements(&self, child: usize) -> Vec<FormId> {
        self.bodies[child - self.base].clone()
    }

    pub(super) fn only_child(&self, node: &TreeNode) -> Vec<FormId> {
        node.children.first().map_or(Vec::new(), |&child| self.statements(child))
    }

    pub(super) fn all_children(&self, children: &[usize]) -> Vec<FormId> {
        children.iter().flat_map(|&child| self.statements(child)).collect()
    }

    /// Returns the statements of a node that is not ticked, its conditions included.
    pub(super) fn plain(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let mut body = self.without_conditions(index);
        body = self.with_outcome(node, body);
        if let Some(script) = node.condition(Moment::While) {
            body = self.whilst(index, &script.clone(), body);
        }
        if let Some(script) = node.condition(Moment::SkipIf) {
            let test = self.script_test(script);
            if self.modes.skip_fails[index] {
                let skip = self.fail_with(":skipped");
                body.insert(0, self.forms.call("when", 2, [test, skip]));
            } else {
                body = vec![self.forms.call("unless", 2, std::iter::once(test).chain(body))];
            }
        }
        if let Some(script) = node.condition(Moment::SuccessIf) {
            let test = self.script_test(script);
            body = vec![self.forms.call("unless", 2, std::iter::once(test).chain(body))];
        }
        if let Some(script) = node.condition(Moment::FailureIf) {
            let test = self.script_test(script);
            let failure = self.failure(index);
            body.insert(0, self.forms.call("when", 2, [test, failure]));
        }
        body
    }

    /// Runs statements only while a condition holds.
    fn whilst(&mut self, index: usize, script: &crate::script::Script, body: Vec<FormId>) -> Vec<FormId> {
        let test = self.script_test(script);
        let inverse = self.not(test);
        let mut watch = vec![self.forms.call("wait-until", 2, [inverse])];
        let skip = self.fail_with(":skipped");
        let skip_fails = self.modes.skip_fails[index];
        if skip_fails {
            watch.push(skip);
        }
        let race = self.race(("condition", watch), ("activity", body));
        vec![if skip_fails {
            self.forms.call("if", 2, [test, race, skip])
        } else {
            self.forms.call("when", 2, [test, race])
        }]
    }

    fn race(&mut self, watch: (&str, Vec<FormId>), work: (&str, Vec<FormId>)) -> FormId {
        let clauses = [watch, work].map(|(id, body)| self.forms.call(id, 1, body));
        self.forms.call("pursue", 1, clauses)
    }

    /// Runs the scripts that follow the end of a node.
    fn with_outcome(&mut self, node: &TreeNode, mut body: Vec<FormId>) -> Vec<FormId> {
        let mut scripts = |moments: &[Moment]| -> Vec<FormId> {
            let scripts = moments.iter().filter_map(|&moment| node.condition(moment));
            scripts.flat_map(|script| self.script_statements(script)).collect()
        };
        let on_success = scripts(&[Moment::OnSuccess, Moment::Post]);
        let on_failure = scripts(&[Moment::OnFailure, Moment::Post]);
        let on_halted = scripts(&[Moment::OnHalted]);
        if on_failure.is_empty() && on_halted.is_empty() {
            body.extend(on_success);
            return body;
        }
        self.needs_bt = true;
        let mut clauses = Vec::new();
        for (name, forms) in
            [(":on-success", on_success), (":on-failure", on_failure), (":on-halted", on_halted)]
        {
            if !forms.is_empty() {
                clauses.push(self.forms.call(name, 1, forms));
            }
        }
        let clauses = self.forms.list(1, clauses);
        vec![self.forms.call("bt:with-outcome", 2, std::iter::once(clauses).chain(body))]
    }

    fn without_conditions(&mut self, index: usize) -> Vec<FormId> {
        if self.modes.is_test[index] {
            let test = self.test(index);
            return self.demand(test, index);
        }
        let node = &self.model.nodes[index];
        match node.kind {
            BehaviourKind::SequenceWithMemory if modes::may_be_resumed(self.model, index) => {
                self.sequence_with_memory(index)
            }
            BehaviourKind::Sequence | BehaviourKind::SequenceWithMemory => self.all_children(&node.children),
            BehaviourKind::Fallback => self.fallback(index),
            BehaviourKind::Parallel => self.parallel(node),
            BehaviourKind::ReactiveSequence | BehaviourKind::WhileDoElse => self.reactive_sequence(index),
            BehaviourKind::ReactiveFallback => self.reactive_fallback(node),
            BehaviourKind::IfThenElse => self.if_then_else(index),
            BehaviourKind::Switch(cases) => self.switch(node, cases),
            BehaviourKind::Inverter => {
                let test = self.succeeds(self.only_child(node));
                let failure = self.failure(index);
                vec![self.forms.call("when", 2, [test, failure])]
            }
            BehaviourKind::ForceSuccess => vec![self.ignoring(self.only_child(node))],
            BehaviourKind::ForceFailure => vec![self.ignoring(self.only_child(node)), self.failure(index)],
            BehaviourKind::TryCatch => self.try_catch(index),
            BehaviourKind::Retry => self.retry(index),
            BehaviourKind::Repeat => self.repeat(node),
            BehaviourKind::KeepRunning => self.keep_running(node),
            BehaviourKind::Timeout => {
                let seconds = self.seconds(node, "msec");
                let body = self.only_child(node);
                vec![self.forms.call("with-timeout", 2, std::iter::once(seconds).chain(body))]
            }
            BehaviourKind::Delay => {
                let seconds = self.seconds(node, "delay_msec");
                let sleep = self.forms.call("sleep", 2, [seconds]);
                std::iter::once(sleep).chain(self.only_child(node)).collect()
            }
            BehaviourKind::Sleep => {
                let seconds = self.seconds(node, "msec");
                vec![self.forms.call("sleep", 2, [seconds])]
            }
            BehaviourKind::RunOnce => self.run_once(index),
            BehaviourKind::Precondition | BehaviourKind::BlackboardCheck => self.precondition(index),
            BehaviourKind::Loop => self.queue_loop(index),
            BehaviourKind::Script => self.script_statements(&node.script),
            BehaviourKind::SetBlackboard | BehaviourKind::UnsetBlackboard => self.set_blackboard(node),
            BehaviourKind::Recovery => self.recovery(node),
            BehaviourKind::RoundRobin => self.round_robin(index),
            BehaviourKind::SubTree => self.subtree(index),
            BehaviourKind::GoalUpdater => {
                let call = self.leaf_call(index, &[]);
                std::iter::once(call).chain(self.only_child(node)).collect()
            }
            BehaviourKind::PathLonger => {
                let test = self.leaf_call(index, &[]);
                let body = self.only_child(node);
                vec![self.forms.call("when", 2, std::iter::once(test).chain(body))]
            }
            BehaviourKind::RateController
            | BehaviourKind::DistanceController
            | BehaviourKind::SpeedController
            | BehaviourKind::GoalUpdatedController
            | BehaviourKind::SingleTrigger => self.only_child(node),
            BehaviourKind::CustomDecorator | BehaviourKind::CustomControl => self.custom(index),
            _ => vec![self.leaf_call(index, &[])],
        }
    }

    fn fallback(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let is_test = |child: &&usize| self.modes.is_test[**child];
        let leading = node.children.iter().take_while(is_test).count();
        let tests: Vec<FormId> =
            node.children[..leading].iter().map(|&child| self.tests[child - self.base]).collect();
        let rest = node.children[leading..].to_vec();
        let body = match *rest {
            [child] => self.statements(child),
            _ => {
                let clauses = self.clauses(&rest);
                vec![self.forms.call("try-in-order", 1, clauses)]
            }
        };
        let test = match *tests {
            [] => return body,
            [test] => test,
            _ => self.forms.call("or", 2, tests),
        };
        vec![match self.forms.argument_of("not", test) {
            Some(inner) => self.forms.call("when", 2, std::iter::once(inner).chain(body)),
            None => self.forms.call("unless", 2, std::iter::once(test).chain(body)),
        }]
    }

    /// Returns clauses with ids, one for each child.
    fn clauses(&mut self, children: &[usize]) -> Vec<FormId> {
        let mut ids: Vec<String> = Vec::new();
        let mut clauses = Vec::new();
        for &child in children {
            let title = kebab(self.model.nodes[child].title());
            let title = if self.entry_names.contains(&title) { format!("{title}-way") } else { title };
            let mut id = title.clone();
            let mut number = 2;
            while ids.contains(&id) {
                id = format!("{title}-{number}");
                number += 1;
            }
            let body = self.statements(child);
            let head = self.forms.atom(id.clone());
            clauses.push(self.forms.list(1, std::iter::once(head).chain(body)));
            ids.push(id);
        }
        clauses
    }

    fn parallel(&mut self, node: &TreeNode) -> Vec<FormId> {
        let operator = match modes::parallel(node) {
            Some(ParallelForm::First) => "or-parallel",
            Some(ParallelForm::Race) => "pursue",
            _ => "task-net",
        };
        let clauses = self.clauses(&node.children);
        vec![self.forms.call(operator, 1, clauses)]
    }

    fn reactive_sequence(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let Some((&last, guards)) = node.children.split_last() else { return Vec::new() };
        let mut body: Vec<FormId> = Vec::new();
        let mut tests: Vec<FormId> = Vec::new();
        for &guard in guards {
            body.extend(self.statements(guard));
            tests.push(self.tests[guard - self.base]);
        }
        let test = match *tests {
            [test] => test,
            _ => self.forms.call("and", 2, tests),
        };
        let inverse = self.not(test);
        let wait = self.forms.call("wait-until", 2, [inverse]);
        let failure = self.failure(guards[0]);
        let work = self.statements(last);
        // The failure of a guardian passes the recovery procedures of the activity, which must not see it.
        let is_simple =
            self.model.nodes[last].children.is_empty() && self.model.nodes[last].conditions.is_empty();
        body.push(if is_simple {
            self.forms.call("with-guardian", 3, [wait, failure].into_iter().chain(work))
        } else {
            self.race(("condition", vec![wait, failure]), ("activity", work))
        });
        body
    }

    fn reactive_fallback(&mut self, node: &TreeNode) -> Vec<FormId> {
        let Some((&last, guards)) = node.children.split_last() else { return Vec::new() };
        let tests: Vec<FormId> = guards.iter().map(|&guard| self.tests[guard - self.base]).collect();
        let test = match *tests {
            [test] => test,
            _ => self.forms.call("or", 2, tests),
        };
        let wait = self.forms.call("wait-until", 2, [test]);
        let work = self.statements(last);
        let race = self.race(("condition", vec![wait]), ("activity", work));
        vec![self.forms.call("unless", 2, [test, race])]
    }

    fn if_then_else(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let [condition, then, ref other @ ..] = *node.children else { return Vec::new() };
        let test = if self.modes.is_test[condition] {
            self.tests[condition - self.base]
        } else {
            self.succeeds(self.statements(condition))
        };
        let then = self.statements(then);
        match other.first() {
            Some(&other) => {
                let other = self.statements(other);
                let parts = [test, self.progn(then), self.progn(other)];
                vec![self.forms.call("if", 2, parts)]
            }
            None => {
                let mut body = self.demand(test, condition);
                body.extend(then);
                body
            }
        }
    }

    fn switch(&mut self, node: &TreeNode, cases: usize) -> Vec<FormId> {
        let variable = node.port("variable").unwrap_or(PortValue::Text(String::new()));
        let variable = self.value(&variable);
        let mut clauses = Vec::new();
        for (at, &child) in node.children.iter().enumerate() {
            let test = if at < cases {
                let case = node.port(&format!("case_{}", at + 1)).unwrap_or(PortValue::Text(String::new()));
                let case = self.value(&case);
                self.needs_bt = true;
                self.forms.call("bt:matches-p", 3, [variable, case])
            } else {
                self.forms.atom("t")
            };
            let body = self.statements(child);
            clauses.push(self.forms.list(1, std::iter::once(test).chain(body)));
        }
        vec![self.forms.call("cond", 1, clauses)]
    }

    /// Returns a form that is true if statements succeed.
    pub(super) fn succeeds(&mut self, body: Vec<FormId>) -> FormId {
        let truth = self.forms.atom("t");
        let abort = self.forms.atoms(&["abort"]);
        self.recovering(&[":general-failure"], vec![abort], body.into_iter().chain([truth]).collect())
    }

    /// Returns a form that succeeds in any case.
    pub(super) fn ignoring(&mut self, body: Vec<FormId>) -> FormId {
        let abort = self.forms.atoms(&["abort"]);
        self.recovering(&[":general-failure"], vec![abort], body)
    }

    pub(super) fn recovering(&mut self, head: &[&str], clause: Vec<FormId>, body: Vec<FormId>) -> FormId {
        let head: Vec<FormId> = head.iter().map(|&text| self.forms.atom(text)).collect();
        let clause = self.forms.list(head.len(), head.into_iter().chain(clause));
        let clauses = self.forms.list(1, [clause]);
        self.forms.call("with-recovery-procedures", 2, std::iter::once(clauses).chain(body))
    }

    fn recovery(&mut self, node: &TreeNode) -> Vec<FormId> {
        let [work, recovery] = *node.children else { return Vec::new() };
        let retries = node.port("number_of_retries").unwrap_or(PortValue::Text("1".into()));
        let retries = self.value(&retries);
        let head = self.statements(recovery);
        let head = self.forms.list(2, std::iter::once(retries).chain(head));
        let body = self.statements(work);
        self.needs_bt = true;
        vec![self.forms.call("bt:with-recovery", 2, std::iter::once(head).chain(body))]
    }

    fn round_robin(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let wanted = format!("next-of-{}", kebab(node.title()));
        let variable = self.state(&wanted, "0", "Number of the way that is tried next.");
        let mut head = vec![self.forms.atom(variable)];
        if let Some(wrap) = node.port("wrap_around").filter(|wrap| *wrap != PortValue::Text("false".into())) {
            head.push(self.forms.atom(":wrap"));
            head.push(self.value(&wrap));
        }
        let head = self.forms.list(usize::MAX, head);
        let children: Vec<Vec<FormId>> = node.children.iter().map(|&child| self.statements(child)).collect();
        let children: Vec<FormId> = children.into_iter().map(|body| self.progn(body)).collect();
        self.needs_bt = true;
        vec![self.forms.call("bt:round-robin", 2, std::iter::once(head).chain(children))]
    }

    fn sequence_with_memory(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let wanted = format!("next-of-{}", kebab(node.title()));
        let variable = self.state(&wanted, "0", "Number of the form that is evaluated next.");
        let head = self.forms.atoms(&[&variable]);
        let children: Vec<Vec<FormId>> = node.children.iter().map(|&child| self.statements(child)).collect();
        let children: Vec<FormId> = children.into_iter().map(|body| self.progn(body)).collect();
        self.needs_bt = true;
        vec![self.forms.call("bt:sequence-with-memory", 2, std::iter::once(head).chain(children))]
    }

    fn custom(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let mut functions = Vec::new();
        for child in node.children.clone() {
            let body = self.statements(child);
            let empty = self.forms.list(1, []);
            functions.push(self.forms.call("lambda", 2, std::iter::once(empty).chain(body)));
        }
        let rest = match (node.kind, &*functions) {
            (BehaviourKind::CustomDecorator, [function]) => *function,
            _ => self.forms.call("list", 1, functions),
        };
        vec![self.leaf_call(index, &[rest])]
    }

    /// Returns a comment about a node that a form replaces only in part.
    pub(super) fn remark(&self, index: usize) -> Option<String> {
        let node = &self.model.nodes[index];
        let way = match node.kind {
            BehaviourKind::RateController => "its rate matters only where something ticks it",
            BehaviourKind::DistanceController => "the distance matters only where something ticks it",
            BehaviourKind::SpeedController => "the speed matters only where something ticks it",
            BehaviourKind::GoalUpdatedController => "a new goal matters only where something ticks it",
            BehaviourKind::RunOnce => "it is done too when it was halted",
            _ => return None,
        };
        Some(format!("`{}`: {way}.", node.id))
    }

    /// Returns a text as a literal.
    pub(super) fn text_literal(&mut self, text: &str) -> FormId {
        self.forms.atom(quoted(text))
    }
}
