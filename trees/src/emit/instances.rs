//! Trees as functions: the meanings of their entries, and their uses as subtrees.

use std::collections::HashMap;

use crate::emit::Emitter;
use crate::emit::form::FormId;
use crate::emit::names::kebab;
use crate::emit::{MAX_DEPTH, NAMED_SIZE, leaves};
use crate::fault::TreeFault;
use crate::model::{PortValue, TreeNode};

/// Most functions that trees become.
const MAX_INSTANCES: usize = 20_000;

/// A tree, and the variables that its outputs are: other uses with the same share a function.
pub(super) type Key = (usize, Vec<(String, String)>);

/// Meaning of an entry in a function.
#[derive(Clone, Debug)]
enum EntryMeaning {
    FluentRow(String),
    Parameter(String),
    Constant(String),
}

/// A tree with meanings of its entries.
pub(super) struct Instance {
    tree: usize,
    pub(super) function: String,
    bindings: HashMap<String, EntryMeaning>,
    parameters: Vec<String>,
}

impl Emitter<'_> {
    /// Writes the functions of the main tree and of all subtrees that it uses.
    pub(super) fn write_instances(&mut self) -> Result<(), TreeFault> {
        let main = &self.model.trees[self.model.main];
        let function = self.names.function(&kebab(&main.id), "run");
        self.instances.push(Instance {
            tree: self.model.main,
            function,
            bindings: HashMap::new(),
            parameters: Vec::new(),
        });
        let mut next = 0;
        while next < self.instances.len() {
            if next > MAX_INSTANCES {
                return Err(TreeFault {
                    file: self.model.files[main.file].clone(),
                    place: main.place,
                    message: format!(
                        "the subtrees are used in more than {MAX_INSTANCES} ways: expected fewer remappings of outputs; \
                         run the tree as it is by `bt:run`"
                    ),
                });
            }
            self.write_instance(next);
            next += 1;
        }
        Ok(())
    }

    fn write_instance(&mut self, number: usize) {
        let tree = self.instances[number].tree;
        let root = self.model.trees[tree].root;
        let end = self.model.trees.get(tree + 1).map_or(self.model.nodes.len(), |next| next.root);
        self.current = number;
        self.base = root;
        let nothing = self.forms.atom("nil");
        self.tests = vec![nothing; end - root];
        self.bodies = vec![Vec::new(); end - root];
        self.ticks = vec![None; end - root];
        self.functions.push(Vec::new());
        for index in (root..end).rev() {
            self.write_node(index, index == root);
        }
        let body = std::mem::take(&mut self.bodies[0]);
        let function = self.instances[number].function.clone();
        let text = format!("Tree `{}`.", self.model.trees[tree].id);
        let definition = self.definition(&function, &text, body, true);
        self.functions[number].push(definition);
    }

    fn write_node(&mut self, index: usize, is_root: bool) {
        let at = index - self.base;
        let node = &self.model.nodes[index];
        if self.modes.is_test[index] {
            self.tests[at] = self.test(index);
        }
        if self.modes.is_ticked[index] {
            let mut part = self.ticked(index);
            let parent_ticks = node.parent.is_some_and(|parent| self.modes.is_ticked[parent]);
            if !parent_ticks {
                self.needs_bt = true;
                let options = self.forms.list(1, []);
                let form = self.forms.call("bt:ticking", 2, [options, part]);
                let remark =
                    format!("Ticked: a form of the language would not mean the same as `{}`.", node.id);
                let form = self.forms.commented(vec![remark], form);
                self.bodies[at] = vec![form];
            } else if self.forms.depth(part) > MAX_DEPTH {
                part = self.outline(index, part);
            }
            self.ticks[at] = Some(part);
        } else {
            let mut body = self.plain(index);
            if let (Some(remark), Some(&first)) = (self.remark(index), body.first()) {
                body[0] = self.forms.commented(vec![remark], first);
            }
            self.bodies[at] = body;
        }
        let parent_ticks = node.parent.is_some_and(|parent| self.modes.is_ticked[parent]);
        if is_root || node.children.is_empty() || self.modes.is_ticked[index] && parent_ticks {
            return;
        }
        let body = &self.bodies[at];
        let size: usize = body.iter().map(|&form| self.forms.size(form)).sum();
        let depth = body.iter().map(|&form| self.forms.depth(form)).max().unwrap_or(0);
        if node.name.is_some() && size >= NAMED_SIZE && depth > 2 || depth > MAX_DEPTH {
            self.hoist(index);
        }
    }

    /// Makes a node that is ticked a function, which returns it.
    fn outline(&mut self, index: usize, part: FormId) -> FormId {
        let function = self.names.function(&kebab(self.model.nodes[index].title()), "part");
        let form = self.forms.call("bt:node", 2, [part]);
        let definition = self.definition(&function, "Part of a tree that is ticked.", vec![form], false);
        self.functions[self.current].push(definition);
        let call = self.call_with_parameters(&function, &[form]);
        self.forms.call(":part", 2, [call])
    }

    /// Makes a node a function of its own.
    fn hoist(&mut self, index: usize) {
        let at = index - self.base;
        let node = &self.model.nodes[index];
        let function = self.names.function(&kebab(node.title()), "perform");
        let body = std::mem::take(&mut self.bodies[at]);
        let text = match &node.name {
            Some(name) => format!("Node `{name}`."),
            None => format!("A `{}` of the tree `{}`.", node.id, self.model.trees[node.tree].id),
        };
        let call = self.call_with_parameters(&function, &body);
        let definition = self.definition(&function, &text, body, false);
        self.functions[self.current].push(definition);
        self.bodies[at] = vec![call];
    }

    /// Returns the parameters of the instance that forms use.
    fn parameters_in(&self, forms: &[FormId]) -> Vec<String> {
        let parameters = &self.instances[self.current].parameters;
        if parameters.is_empty() {
            return Vec::new();
        }
        let atoms: Vec<&str> = forms.iter().flat_map(|&form| self.forms.all_atoms(form)).collect();
        parameters.iter().filter(|name| atoms.contains(&&***name)).cloned().collect()
    }

    fn call_with_parameters(&mut self, function: &str, body: &[FormId]) -> FormId {
        let arguments: Vec<FormId> =
            self.parameters_in(body).into_iter().map(|name| self.forms.atom(name)).collect();
        self.forms.call(function, usize::MAX, arguments)
    }

    fn definition(&mut self, function: &str, text: &str, body: Vec<FormId>, is_tree: bool) -> FormId {
        let parameters = if is_tree {
            let all = &self.instances[self.current].parameters;
            if all.is_empty() {
                Vec::new()
            } else {
                std::iter::once("&key".to_owned()).chain(all.clone()).collect()
            }
        } else {
            self.parameters_in(&body)
        };
        let parameters: Vec<&str> = parameters.iter().map(|name| &**name).collect();
        let lambda_list = self.forms.atoms(&parameters);
        let name = self.forms.atom(function);
        let text = self.text_literal(text);
        // A body of a constant alone would be taken for nothing else.
        self.forms.call("defun", 3, [name, lambda_list, text].into_iter().chain(body))
    }

    /// Returns the variable or the literal that an entry is.
    pub(super) fn variable(&mut self, entry: &str) -> String {
        let (instance, entry) = match entry.strip_prefix('@') {
            Some(entry) => (0, entry),
            None => (self.current, entry),
        };
        if let Some(binding) = self.instances[instance].bindings.get(entry) {
            let (EntryMeaning::FluentRow(text)
            | EntryMeaning::Parameter(text)
            | EntryMeaning::Constant(text)) = binding;
            return text.clone();
        }
        let tree = &self.model.trees[self.instances[instance].tree].id;
        let wanted = [kebab(entry), format!("{}-{}", kebab(tree), kebab(entry))];
        let text = if instance == 0 {
            format!("Entry `{entry}` of the blackboard.")
        } else {
            format!("Entry `{entry}` of the blackboard of `{tree}`.")
        };
        let name = self.state_of(&wanted, "nil", &text);
        self.instances[instance].bindings.insert(entry.to_owned(), EntryMeaning::FluentRow(name.clone()));
        name
    }

    /// Returns a new variable that holds the state of a node.
    pub(super) fn state(&mut self, wanted: &str, initial: &str, text: &str) -> String {
        self.state_of(&[wanted.to_owned()], initial, text)
    }

    fn state_of(&mut self, wanted: &[String], initial: &str, text: &str) -> String {
        let name = self.names.variable(wanted);
        self.entry_names.insert(name.clone());
        self.globals.push(super::FluentRow {
            name: name.clone(),
            documentation: text.to_owned(),
            initial: initial.to_owned(),
        });
        name
    }

    /// Returns the call of the function of a subtree.
    pub(super) fn subtree(&mut self, index: usize) -> Vec<FormId> {
        let node = &self.model.nodes[index];
        let Some(tree) = self.model.tree(&node.id) else { return Vec::new() };
        let mut bindings: Vec<(String, EntryMeaning)> = Vec::new();
        let mut arguments = Vec::new();
        let mut settings = Vec::new();
        let entries = &self.entries.trees[tree];
        for entry in entries.mentioned.iter().filter(|entry| !entry.starts_with('@')) {
            let Some(value) = self.remapped(node, entry) else { continue };
            let is_set = entries.set.contains(entry);
            let outer = match value {
                PortValue::Entry(outer) => {
                    let name = self.variable(&outer);
                    let owner = if outer.starts_with('@') { 0 } else { self.current };
                    let known = self.instances[owner].bindings.get(outer.trim_start_matches('@'));
                    known.cloned().unwrap_or(EntryMeaning::FluentRow(name))
                }
                PortValue::Text(text) => EntryMeaning::Constant(leaves::literal(&text)),
            };
            let is_alone = self.entries.uses[tree] == 1;
            let binding = match outer {
                EntryMeaning::FluentRow(name) if is_set || is_alone => EntryMeaning::FluentRow(name),
                EntryMeaning::Constant(text) if is_set => {
                    settings.push((entry.clone(), text));
                    continue;
                }
                EntryMeaning::Constant(text) if is_alone => EntryMeaning::Constant(text),
                EntryMeaning::FluentRow(text)
                | EntryMeaning::Parameter(text)
                | EntryMeaning::Constant(text) => {
                    let name = kebab(entry);
                    arguments.push(self.forms.atom(format!(":{name}")));
                    arguments.push(self.forms.atom(text));
                    EntryMeaning::Parameter(name)
                }
            };
            bindings.push((entry.clone(), binding));
        }
        let instance = self.instance(tree, bindings);
        let mut forms = Vec::new();
        // Constants of entries that the subtree sets.
        let caller = std::mem::replace(&mut self.current, instance);
        for (entry, text) in settings {
            let variable = self.variable(&entry);
            forms.push(self.forms.atoms(&["setf", &variable, &text]));
        }
        self.current = caller;
        let function = self.instances[instance].function.clone();
        forms.push(self.forms.call(&function, 1, arguments));
        forms
    }

    /// Returns what an entry of a subtree is outside.
    fn remapped(&self, node: &TreeNode, entry: &str) -> Option<PortValue> {
        let port = node.ports.iter().find(|port| port.name == entry);
        port.map(|port| port.value.clone())
            .or_else(|| node.remaps_all.then(|| PortValue::Entry(entry.to_owned())))
    }

    fn instance(&mut self, tree: usize, bindings: Vec<(String, EntryMeaning)>) -> usize {
        let mut outputs: Vec<(String, String)> = Vec::new();
        let mut parameters = Vec::new();
        for (entry, binding) in &bindings {
            match binding {
                EntryMeaning::FluentRow(name) | EntryMeaning::Constant(name) => {
                    outputs.push((entry.clone(), name.clone()))
                }
                EntryMeaning::Parameter(name) => parameters.push(name.clone()),
            }
        }
        outputs.sort();
        let key = (tree, outputs);
        if let Some(&known) = self.by_key.get(&key) {
            return known;
        }
        let function = self.names.function(&kebab(&self.model.trees[tree].id), "run");
        self.instances.push(Instance {
            tree,
            function,
            bindings: bindings.into_iter().collect(),
            parameters,
        });
        self.by_key.insert(key, self.instances.len() - 1);
        self.instances.len() - 1
    }

    /// Returns the function that measures the robot.
    pub(super) fn measure(&mut self, wanted: &str) -> String {
        if let Some((_, function)) = self.measures.iter().find(|(known, _)| known == wanted) {
            return function.clone();
        }
        let function = self.names.function(wanted, "robot");
        self.measures.push((wanted.to_owned(), function.clone()));
        function
    }
}
