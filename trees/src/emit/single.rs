//! Decorators and nodes of the blackboard as forms of the language.

use crate::catalogue::BehaviourKind;
use crate::emit::Emitter;
use crate::emit::form::FormId;
use crate::emit::leaves;
use crate::emit::names::kebab;
use crate::model::{PortValue, TreeNode};
use crate::number;

impl Emitter<'_> {
    pub(super) fn try_catch(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let Some((&last, tried)) = node.children.split_last() else { return Vec::new() };
        let body = self.all_children(tried);
        let cleanup = self.statements(last);
        if node.text("catch_on_halt").as_deref() == Some("true") {
            let cleanup = self.progn(cleanup);
            return vec![self.forms.call("with-cleanup-procedure", 2, std::iter::once(cleanup).chain(body))];
        }
        let test = self.succeeds(body);
        let parts = [test, self.ignoring(cleanup), self.failure(index)];
        vec![self.forms.call("unless", 2, parts)]
    }

    pub(super) fn retry(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let body = self.only_child(node);
        let retry = self.forms.atoms(&["retry"]);
        let retries = match (node.whole("num_attempts"), node.port("num_attempts")) {
            (Some(-1), _) => ":infinite".to_owned(),
            (Some(1), _) => return body,
            (Some(attempts), _) if attempts > 1 => (attempts - 1).to_string(),
            (None, Some(PortValue::Entry(entry))) => format!("(- {} 1)", self.variable(&entry)),
            _ => return vec![self.failure(index)],
        };
        vec![self.recovering(&[":general-failure", ":retries", &retries], vec![retry], body)]
    }

    pub(super) fn repeat(&mut self, node: &TreeNode) -> Vec<FormId> {
        let body = self.only_child(node);
        match (node.whole("num_cycles"), node.port("num_cycles")) {
            (Some(-1), _) => vec![self.forms.call("loop", 1, body)],
            (Some(1), _) => body,
            (_, Some(cycles)) => {
                let parts = [self.forms.atom("repeat"), self.value(&cycles), self.forms.atom("do")];
                let body = self.progn(body);
                vec![self.forms.call("loop", 3, parts.into_iter().chain([body]))]
            }
            _ => body,
        }
    }

    pub(super) fn keep_running(&mut self, node: &TreeNode) -> Vec<FormId> {
        let Some(&child) = node.children.first() else { return Vec::new() };
        let body = self.statements(child);
        if self.modes.is_test[child] {
            let test = self.tests[child - self.base];
            let inverse = self.not(test);
            return vec![self.forms.call("wait-until", 2, [inverse]), self.failure(child)];
        }
        vec![self.forms.call("loop", 1, body)]
    }

    /// Returns the form of the seconds in a port that has milliseconds.
    pub(super) fn seconds(&mut self, node: &TreeNode, port: &str) -> FormId {
        match node.port(port) {
            Some(PortValue::Entry(entry)) => {
                let variable = self.variable(&entry);
                self.forms.atoms(&["/", &variable, "1000"])
            }
            Some(PortValue::Text(text)) => {
                let seconds = number::seconds(text.trim()).unwrap_or_else(|| "0".into());
                self.forms.atom(seconds)
            }
            None => self.forms.atom("0"),
        }
    }

    pub(super) fn run_once(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let wanted = node
            .children
            .first()
            .map_or("done".into(), |&child| format!("{}-done", kebab(self.model.nodes[child].title())));
        let variable = self.state(&wanted, "nil", "Whether this was done, which is done once.");
        let set = self.forms.atoms(&["setf", &variable, "t"]);
        let test = self.forms.atom(variable);
        let mut body = self.only_child(node);
        body.push(set);
        let tried = self.forms.call("with-cleanup-procedure", 2, std::iter::once(set).chain(body));
        if self.modes.skip_fails[index] {
            let skip = self.fail_with(":skipped");
            return vec![self.forms.call("when", 2, [test, skip]), tried];
        }
        vec![self.forms.call("unless", 2, [test, tried])]
    }

    pub(super) fn precondition(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let (test, otherwise) = if node.kind == BehaviourKind::Precondition {
            (self.script_test(&node.script), node.text("else"))
        } else {
            let values =
                ["value_A", "value_B"].map(|name| node.port(name).unwrap_or(PortValue::Text(String::new())));
            let values = values.map(|value| self.value(&value));
            self.needs_bt = true;
            (self.forms.call("bt:matches-p", 3, values), node.text("return_on_mismatch"))
        };
        let body = self.only_child(node);
        match otherwise.as_deref() {
            Some("SUCCESS") => vec![self.forms.call("when", 2, std::iter::once(test).chain(body))],
            Some("SKIPPED") if !self.modes.skip_fails[index] => {
                vec![self.forms.call("when", 2, std::iter::once(test).chain(body))]
            }
            Some("RUNNING") => {
                let wait = self.forms.call("wait-until", 2, [test]);
                std::iter::once(wait).chain(body).collect()
            }
            _ => {
                let demand = self.demand(test, index);
                demand.into_iter().chain(body).collect()
            }
        }
    }

    pub(super) fn queue_loop(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let value = match node.port("value") {
            Some(PortValue::Entry(entry)) => Some(self.variable(&entry)),
            _ => None,
        };
        let mut body = Vec::new();
        let form = match node.port("queue") {
            Some(PortValue::Entry(entry)) => {
                let queue = self.variable(&entry);
                let next = self.forms.atoms(&["pop", &queue]);
                body.push(match value {
                    Some(value) => {
                        let value = self.forms.atom(value);
                        self.forms.call("setf", 3, [value, next])
                    }
                    None => next,
                });
                body.extend(self.only_child(node));
                let parts = [self.forms.atom("while"), self.forms.atom(queue), self.forms.atom("do")];
                let body = self.progn(body);
                self.forms.call("loop", 3, parts.into_iter().chain([body]))
            }
            queue => {
                let text = if let Some(PortValue::Text(text)) = queue { text } else { String::new() };
                let items: Vec<String> =
                    text.split(';').filter(|item| !item.is_empty()).map(leaves::literal).collect();
                let list = self.forms.atom(format!("'({})", items.join(" ")));
                let item = self.forms.atom("item");
                let head = self.forms.list(2, [item, list]);
                if let Some(value) = value {
                    body.push(self.forms.atoms(&["setf", &value, "item"]));
                }
                body.extend(self.only_child(node));
                self.forms.call("dolist", 2, std::iter::once(head).chain(body))
            }
        };
        let mut forms = vec![form];
        if node.text("if_empty").as_deref() == Some("FAILURE") {
            forms.push(self.failure(index));
        }
        forms
    }

    pub(super) fn set_blackboard(&mut self, node: &TreeNode) -> Vec<FormId> {
        let port = if node.kind == BehaviourKind::SetBlackboard { "output_key" } else { "key" };
        let (Some(PortValue::Text(entry)) | Some(PortValue::Entry(entry))) = node.port(port) else {
            return Vec::new();
        };
        let variable = self.variable(&entry);
        let place = self.forms.atom(variable);
        let value = match node.port("value") {
            Some(value) => self.value(&value),
            None => self.forms.atom("nil"),
        };
        vec![self.forms.call("setf", 3, [place, value])]
    }
}
