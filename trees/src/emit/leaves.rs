//! Leaves: their calls, and the functions that stand for them.

use std::collections::HashMap;

use crate::catalogue::{BehaviourKind, Direction};
use crate::emit::form::FormId;
use crate::emit::names::kebab;
use crate::emit::scripts::quoted;
use crate::emit::{Emitter, names::ProgramNames};
use crate::model::{Model, PortValue, TreeNode};
use crate::number;
use crate::ros::{self, RosRow};

/// Ports of leaves of ROS that name the server.
const SERVERS: [&str; 2] = ["server_name", "service_name"];

/// A leaf that a program defines once.
pub(super) struct Leaf {
    id: String,
    kind: BehaviourKind,
    function: String,
    ros: Option<&'static RosRow>,
    /// Ports that are passed, and how many nodes pass them.
    inputs: Vec<(String, usize)>,
    outputs: Vec<String>,
    /// Ports that nothing stands for.
    ignored: Vec<String>,
    uses: usize,
}

/// The leaves of a model, in the order of their first use.
#[derive(Default)]
pub(super) struct Leaves {
    leaves: Vec<Leaf>,
    numbers: HashMap<String, usize>,
}

impl Leaves {
    pub(super) fn new(
        model: &Model,
        entries: &super::entries::EntryUses,
        names: &mut ProgramNames,
    ) -> Leaves {
        let mut leaves = Leaves::default();
        for (index, node) in model.nodes.iter().enumerate() {
            let is_asked = matches!(
                node.kind,
                BehaviourKind::CustomControl
                    | BehaviourKind::CustomDecorator
                    | BehaviourKind::GoalUpdater
                    | BehaviourKind::PathLonger
            );
            if node.kind.is_leaf() || is_asked {
                leaves.add(model, entries, names, index);
            }
        }
        leaves
    }

    fn add(
        &mut self,
        model: &Model,
        entries: &super::entries::EntryUses,
        names: &mut ProgramNames,
        index: usize,
    ) {
        let node = &model.nodes[index];
        let number = *self.numbers.entry(node.id.clone()).or_insert_with(|| {
            self.leaves.push(Leaf {
                id: node.id.clone(),
                kind: node.kind,
                function: names.function(&kebab(&node.id), "perform"),
                ros: ros::row(&node.id),
                inputs: Vec::new(),
                outputs: Vec::new(),
                ignored: Vec::new(),
                uses: 0,
            });
            self.leaves.len() - 1
        });
        let leaf = &mut self.leaves[number];
        leaf.uses += 1;
        for port in &node.ports {
            let direction = entries.direction(model, index, &port.name);
            if let Some(row) = leaf.ros {
                let is_passed = ros::pairs(row.inputs).any(|(_, name)| name == port.name)
                    || SERVERS.contains(&&*port.name)
                    || ros::pairs(row.outputs).any(|(name, _)| name == port.name)
                    || ["error_code_id", "error_msg"].contains(&&*port.name);
                if !is_passed {
                    if !leaf.ignored.contains(&port.name) {
                        leaf.ignored.push(port.name.clone());
                    }
                    continue;
                }
                if port.name.starts_with("error_") {
                    continue;
                }
            }
            if direction != Direction::Out {
                match leaf.inputs.iter_mut().find(|(name, _)| *name == port.name) {
                    Some((_, uses)) => *uses += 1,
                    None => leaf.inputs.push((port.name.clone(), 1)),
                }
            }
            if direction != Direction::In && !leaf.outputs.contains(&port.name) {
                leaf.outputs.push(port.name.clone());
            }
        }
    }

    fn of(&self, node: &TreeNode) -> &Leaf {
        &self.leaves[self.numbers[&node.id]]
    }

    /// Returns whether any leaf is an action or a service of ROS.
    pub(super) fn use_ros(&self) -> bool {
        self.leaves.iter().any(|leaf| leaf.ros.is_some())
    }
}

/// Returns the keyword of a port.
pub(super) fn keyword(port: &str) -> String {
    if SERVERS.contains(&port) { ":server".into() } else { format!(":{}", kebab(port)) }
}

/// Returns the literal of a text.
pub(crate) fn literal(text: &str) -> String {
    match text.trim() {
        "true" | "True" | "TRUE" => "t".into(),
        "false" | "False" | "FALSE" => "nil".into(),
        trimmed => number::any(trimmed).unwrap_or_else(|| quoted(text)),
    }
}

impl Emitter<'_> {
    /// Returns the form of the value of a port.
    pub(super) fn value(&mut self, value: &PortValue) -> FormId {
        let text = match value {
            PortValue::Entry(entry) => self.variable(entry),
            PortValue::Text(text) => literal(text),
        };
        self.forms.atom(text)
    }

    /// Returns the call of the function of a leaf, with `rest` behind its ports; sets its outputs.
    pub(super) fn leaf_call(&mut self, index: usize, rest: &[FormId]) -> FormId {
        let node = &self.model.nodes[index];
        let leaf = self.leaves.of(node);
        let (function, outputs) = (leaf.function.clone(), leaf.outputs.clone());
        let passed: Vec<String> = leaf.inputs.iter().map(|(name, _)| name.clone()).collect();
        let mut arguments = rest.to_vec();
        for port in node.ports.iter().filter(|port| passed.contains(&port.name)) {
            if self.entries.direction(self.model, index, &port.name) != Direction::Out {
                arguments.push(self.forms.atom(keyword(&port.name)));
                arguments.push(self.value(&port.value));
            }
        }
        let head = if rest.is_empty() { 1 } else { 1 + rest.len() };
        let call = self.forms.call(&function, head, arguments);
        let call = self.set_outputs(index, &outputs, call);
        self.note_error(node, call)
    }

    /// Sets the entries of output ports to the values of a call.
    fn set_outputs(&mut self, index: usize, outputs: &[String], call: FormId) -> FormId {
        let node = &self.model.nodes[index];
        let entry_of = |name: &String| {
            let port = node.ports.iter().find(|port| port.name == *name)?;
            match &port.value {
                PortValue::Entry(entry)
                    if self.entries.direction(self.model, index, name) != Direction::In =>
                {
                    Some(entry.clone())
                }
                _ => None,
            }
        };
        let places: Vec<Option<String>> = outputs.iter().map(entry_of).collect();
        let count = places.iter().rposition(Option::is_some).map_or(0, |last| last + 1);
        let places = &places[..count];
        let first = match places {
            [] => return call,
            [Some(entry)] => {
                let variable = self.variable(entry);
                let place = self.forms.atom(variable);
                return self.forms.call("setf", 3, [place, call]);
            }
            _ if places.iter().all(Option::is_some) => {
                let variables: Vec<String> =
                    places.iter().flatten().map(|entry| self.variable(entry)).collect();
                let variables: Vec<FormId> =
                    variables.into_iter().map(|name| self.forms.atom(name)).collect();
                self.forms.call("values", usize::MAX, variables)
            }
            _ => {
                // Some values are of outputs that this node does not use.
                let names: Vec<String> = (1..=count).map(|n| format!("value-{n}")).collect();
                let mut pairs = Vec::new();
                let mut unused = vec![self.forms.atom("ignore")];
                for (name, place) in names.iter().zip(places) {
                    let name = self.forms.atom(name.clone());
                    match place {
                        Some(entry) => {
                            let variable = self.variable(entry);
                            pairs.push(self.forms.atom(variable));
                            pairs.push(name);
                        }
                        None => unused.push(name),
                    }
                }
                let unused = self.forms.list(usize::MAX, unused);
                let declaration = self.forms.call("declare", 2, [unused]);
                let names: Vec<&str> = names.iter().map(|name| &**name).collect();
                let names = self.forms.atoms(&names);
                let setting = self.forms.call("setf", 3, pairs);
                return self.forms.call("multiple-value-bind", 3, [names, call, declaration, setting]);
            }
        };
        self.forms.call("setf", 2, [first, call])
    }

    /// Has a call set the entries of the ports `error_code_id` and `error_msg`.
    fn note_error(&mut self, node: &TreeNode, call: FormId) -> FormId {
        if ros::row(&node.id).is_none() {
            return call;
        }
        let entry =
            |name: &str| match node.ports.iter().find(|port| port.name == name).map(|port| &port.value) {
                Some(PortValue::Entry(entry)) => Some(entry.clone()),
                _ => None,
            };
        let Some(code) = entry("error_code_id") else { return call };
        let entries = [Some(code), entry("error_msg")];
        let variables: Vec<String> = entries.iter().flatten().map(|entry| self.variable(entry)).collect();
        let places: Vec<&str> = variables.iter().map(|name| &**name).collect();
        let places = self.forms.atoms(&places);
        self.notes_errors = true;
        self.forms.call("noting-error", 2, [places, call])
    }

    /// Returns the definitions of the functions of all leaves.
    pub(super) fn leaf_definitions(&mut self) -> Vec<FormId> {
        let leaves = std::mem::take(&mut self.leaves);
        let mut definitions = Vec::new();
        for leaf in &leaves.leaves {
            let definition = match leaf.ros {
                Some(row) => self.ros_function(leaf, row),
                None => self.stub(leaf),
            };
            definitions.push(definition);
        }
        definitions
    }

    fn lambda_list(&mut self, leaf: &Leaf, first: &[&str]) -> FormId {
        let mut parameters: Vec<String> = first.iter().map(ToString::to_string).collect();
        if !leaf.inputs.is_empty() {
            parameters.push("&key".into());
        }
        parameters
            .extend(leaf.inputs.iter().map(|(name, _)| keyword(name).trim_start_matches(':').to_owned()));
        let parameters: Vec<&str> = parameters.iter().map(|name| &**name).collect();
        self.forms.atoms(&parameters)
    }

    /// Returns the definition of a leaf that the person who imports the tree fills in.
    fn stub(&mut self, leaf: &Leaf) -> FormId {
        let (operator, kind, rest): (_, _, &[&str]) = match leaf.kind {
            BehaviourKind::Condition | BehaviourKind::PathLonger => ("defun", "Condition", &[]),
            BehaviourKind::SyncAction => ("defun", "Action without waiting", &[]),
            BehaviourKind::CustomDecorator => ("defun", "Decorator, which calls CHILD", &["child"]),
            BehaviourKind::CustomControl => ("defun", "Control node, which calls CHILDREN", &["children"]),
            BehaviourKind::GoalUpdater => ("defun", "Decorator of Nav2", &[]),
            _ => ("define-mock", "Action", &[]),
        };
        let mut text = format!("{kind} `{}`.", leaf.id);
        if matches!(leaf.kind, BehaviourKind::Condition | BehaviourKind::PathLonger) {
            text.push_str(" True or false, by fluents, properties or facts, whose changes wake guards.");
        }
        match &*leaf.outputs {
            [] => {}
            [port] => text.push_str(&format!(" Returns the value of the port `{port}`.")),
            ports => text.push_str(&format!(" Returns the values of the ports `{}`.", ports.join("`, `"))),
        }
        let lambda_list = self.lambda_list(leaf, rest);
        let mut parts =
            vec![self.forms.atom(leaf.function.clone()), lambda_list, self.forms.atom(quoted(&text))];
        self.causes.insert(":not-implemented".into());
        let mut failure =
            vec![self.forms.atom(":not-implemented"), self.forms.atom(format!("'{}", leaf.function))];
        failure.extend(rest.iter().map(|name| self.forms.atom(*name)));
        for (name, _) in &leaf.inputs {
            failure.push(self.forms.atom(keyword(name).trim_start_matches(':')));
        }
        parts.push(self.forms.call("fail", usize::MAX, failure));
        self.forms.call(operator, 3, parts)
    }

    /// Returns the definition of a leaf that calls an action or a service.
    fn ros_function(&mut self, leaf: &Leaf, row: &'static RosRow) -> FormId {
        let way = if row.is_action { "action" } else { "service" };
        let mut text = format!("Calls the {way} of Nav2 for `{}`.", leaf.id);
        if !leaf.ignored.is_empty() {
            text.push_str(&format!(" Leaves the ports `{}` aside.", leaf.ignored.join("`, `")));
        }
        let is_named = leaf.inputs.iter().find(|(name, _)| SERVERS.contains(&&**name)).map(|(_, uses)| *uses);
        let server = match is_named {
            Some(uses) if uses == leaf.uses => self.forms.atom("server"),
            Some(_) => {
                let default = quoted(row.server);
                self.forms.atoms(&["or", "server", &default])
            }
            None => self.forms.atom(quoted(row.server)),
        };
        let interface =
            quoted(&format!("nav2_msgs/{}/{}", if row.is_action { "action" } else { "srv" }, row.interface));
        let mut call = vec![self.forms.atom("*node*"), server, self.forms.atom(interface)];
        let fields = self.fields(leaf, row);
        if row.is_action {
            if let Some(fields) = fields {
                call.push(self.forms.atom(":goal"));
                call.push(fields);
            }
        } else if let Some(fields) = fields {
            // A service takes its fields as arguments or as one list.
            call.push(fields);
        }
        let operator = if row.is_action { "ros:do-action" } else { "ros:call-service" };
        let call = self.forms.call(operator, 4, call);
        let results: Vec<(&str, &str)> = leaf
            .outputs
            .iter()
            .filter_map(|port| ros::pairs(row.outputs).find(|(name, _)| name == port))
            .collect();
        let body = match *results {
            [] => call,
            [(_, field)] => {
                let field = self.forms.atom(keyword(field));
                self.forms.call("getf", 3, [call, field])
            }
            _ => {
                let fields: Vec<String> = results.iter().map(|(_, field)| keyword(field)).collect();
                let values: Vec<FormId> =
                    fields.iter().map(|field| self.forms.atoms(&["getf", "result", field])).collect();
                let values = self.forms.call("values", 1, values);
                let result = self.forms.atom("result");
                let binding = self.forms.list(2, [result, call]);
                let bindings = self.forms.list(1, [binding]);
                self.forms.call("let", 2, [bindings, values])
            }
        };
        let lambda_list = self.lambda_list(leaf, &[]);
        let parts =
            [self.forms.atom(leaf.function.clone()), lambda_list, self.forms.atom(quoted(&text)), body];
        self.forms.call("defun", 3, parts)
    }

    /// Returns the form of the fields of a goal or a request.
    fn fields(&mut self, leaf: &Leaf, row: &'static RosRow) -> Option<FormId> {
        let mut always = Vec::new();
        let mut sometimes = Vec::new();
        for (field, port) in ros::pairs(row.inputs) {
            let Some((name, uses)) = leaf.inputs.iter().find(|(name, _)| name == port) else { continue };
            let variable = kebab(name);
            let (axis, field) =
                field.split_once(':').map_or((None, field), |(axis, field)| (Some(axis), field));
            let value = match axis {
                None => self.forms.atom(variable.clone()),
                Some(axis) => {
                    let number = if axis.starts_with('-') {
                        self.forms.atoms(&["-", &variable])
                    } else {
                        self.forms.atom(variable.clone())
                    };
                    let axis = self.forms.atom(format!(":{}", axis.trim_start_matches('-')));
                    self.forms.call("list", 1, [axis, number])
                }
            };
            let mut pair = vec![self.forms.atom(keyword(field)), value];
            if field == "start" && row.interface.starts_with("ComputePath") {
                pair.push(self.forms.atom(":use-start"));
                pair.push(self.forms.atom("t"));
            }
            if *uses == leaf.uses {
                always.extend(pair);
            } else {
                let pair = self.forms.call("list", 1, pair);
                let variable = self.forms.atom(variable);
                sometimes.push(self.forms.call("and", 3, [variable, pair]));
            }
        }
        let always = (!always.is_empty()).then(|| self.forms.call("list", 1, always));
        match (always, sometimes.is_empty()) {
            (always, true) => always,
            (always, false) => Some(self.forms.call("append", 2, always.into_iter().chain(sometimes))),
        }
    }
}
