//! Building the nodes of a model from elements, with all checks of single nodes.

use std::sync::Arc;

use crate::catalogue::{self, BehaviourKind, Direction, PortRow, switch_cases};
use crate::fault::{FilePlace, TreeFault};
use crate::model::declared::kind_of_tag;
use crate::model::{Model, Moment, Port, PortValue, Tree, TreeNode};
use crate::script::{self, Script};
use crate::xml::{Attribute, XmlElement};
use crate::{number, ros};

/// Most faults that are kept.
const MAX_FAULTS: usize = 100;

/// Ports that hold whole numbers, and those that hold numbers.
const WHOLE: [&str; 12] = [
    "num_attempts",
    "num_cycles",
    "msec",
    "delay_msec",
    "success_count",
    "failure_count",
    "max_failures",
    "number_of_retries",
    "success_threshold",
    "failure_threshold",
    "threshold",
    "current_child_idx",
];
const NUMBERS: [&str; 6] = ["hz", "min_rate", "max_rate", "min_speed", "max_speed", "filter_duration"];

/// A model under construction.
pub(crate) struct Builder {
    pub(crate) model: Model,
    faults: Vec<TreeFault>,
}

/// An element that becomes a node.
struct NodeSite<'a> {
    file: usize,
    tree: usize,
    parent: Option<usize>,
    is_format_3: bool,
    element: &'a XmlElement,
}

impl Builder {
    pub(crate) fn new(files: Vec<Arc<str>>) -> Builder {
        Builder { model: Model { files, ..Model::default() }, faults: Vec::new() }
    }

    pub(crate) fn fault(&mut self, file: usize, place: FilePlace, message: String) {
        if self.faults.len() < MAX_FAULTS {
            self.faults.push(TreeFault { file: self.model.files[file].clone(), place, message });
        }
    }

    /// Adds the trees of a file.
    pub(crate) fn add_trees(&mut self, file: usize, elements: &[XmlElement]) {
        let Some(root) = elements.first() else { return };
        if root.name != "root" {
            let text = format!("`<{}>` is not a tree: expected `<root BTCPP_format=\"4\">`", root.name);
            return self.fault(file, root.place, text);
        }
        let format = root.attribute("BTCPP_format");
        if let Some(format) = format.filter(|format| !["3", "4"].contains(&&*format.value)) {
            let text = format!("the format `{}` is not known: expected 3 or 4", format.value);
            self.fault(file, format.place, text);
        }
        let is_format_3 = format.is_none_or(|format| format.value == "3");
        for &child in &root.children {
            let element = &elements[child];
            match &*element.name {
                "BehaviorTree" => self.add_tree(file, elements, element, is_format_3),
                "include" | "TreeNodesModel" => {}
                name => {
                    let text = format!(
                        "`<{name}>` is not part of `<root>`: expected `<BehaviorTree>`, `<include>` or \
                         `<TreeNodesModel>`"
                    );
                    self.fault(file, element.place, text);
                }
            }
        }
    }

    fn add_tree(&mut self, file: usize, elements: &[XmlElement], tree: &XmlElement, is_format_3: bool) {
        let number = self.model.trees.len();
        let id = tree.value("ID").map_or_else(|| format!("BehaviorTree_{number}"), str::to_owned);
        if let Some(other) = self.model.tree(&id) {
            let Tree { file: first, place, .. } = self.model.trees[other];
            let text = format!(
                "a second tree has the ID `{id}`: the first one is at {}:{}; rename one of both",
                self.model.files[first], place.line
            );
            return self.fault(file, tree.place, text);
        }
        let [root] = *tree.children else {
            let count = tree.children.len();
            let text =
                format!("the tree `{id}` has {count} roots: expected one node; put them into a `<Sequence>`");
            return self.fault(file, tree.place, text);
        };
        self.model.numbers.insert(id.clone(), number);
        self.model.trees.push(Tree { id, root: self.model.nodes.len(), file, place: tree.place });
        // Elements that wait for their nodes, with the nodes of their parents.
        let mut waiting = vec![(root, None)];
        while let Some((index, parent)) = waiting.pop() {
            let element = &elements[index];
            let at = NodeSite { file, tree: number, parent, is_format_3, element };
            let Some(node) = self.node(&at) else { continue };
            let id = self.model.nodes.len();
            self.model.nodes.push(node);
            if let Some(parent) = parent {
                self.model.nodes[parent].children.push(id);
            }
            waiting.extend(element.children.iter().rev().map(|&child| (child, Some(id))));
        }
    }

    /// Returns the kind of a node, and the name of its type.
    fn kind(&mut self, at: &NodeSite) -> Option<(BehaviourKind, String)> {
        let NodeSite { file, element, .. } = *at;
        let tag = kind_of_tag(&element.name);
        let id = match tag {
            None => element.name.clone(),
            Some(_) => match element.value("ID").filter(|id| !id.is_empty()) {
                Some(id) => id.to_owned(),
                None => {
                    let text = format!(
                        "`<{0}>` has no type: expected the attribute `ID`, as `<{0} ID=\"…\">`",
                        element.name
                    );
                    self.fault(file, element.place, text);
                    return None;
                }
            },
        };
        if tag == Some(BehaviourKind::SubTree) {
            return Some((BehaviourKind::SubTree, id));
        }
        let known =
            catalogue::row(&id).map(|row| row.kind).or_else(|| switch_cases(&id).map(BehaviourKind::Switch));
        let known = known.or_else(|| ros::row(&id).map(|_| BehaviourKind::Action));
        let declared = || self.model.declared.get(&id).map(|declared| declared.kind);
        if let Some(kind) = known.or_else(declared).or(tag) {
            return Some((kind, id));
        }
        if element.children.is_empty() {
            let is_condition = catalogue::is_condition_name(&id);
            return Some((if is_condition { BehaviourKind::Condition } else { BehaviourKind::Action }, id));
        }
        let alike = catalogue::ROWS.iter().find(|row| row.name.eq_ignore_ascii_case(&id));
        if let Some(row) = alike {
            let text =
                format!("`<{id}>` is not a known node: expected `<{}>`; names are case-sensitive", row.name);
            self.fault(file, element.place, text);
            return None;
        }
        let text = format!(
            "`<{id}>` is not a known node: expected a control node or decorator of BehaviorTree.CPP or Nav2, or one that \
             `<TreeNodesModel>` declares by `<Control ID=\"{id}\"/>` or `<Decorator ID=\"{id}\"/>`"
        );
        self.fault(file, element.place, text);
        None
    }

    fn node(&mut self, at: &NodeSite) -> Option<TreeNode> {
        let (kind, id) = self.kind(at)?;
        self.check_children(at, kind, &id);
        let mut node = TreeNode {
            kind,
            id,
            name: at.element.value("name").filter(|name| !name.is_empty()).map(str::to_owned),
            ports: Vec::new(),
            conditions: Vec::new(),
            script: Script::default(),
            remaps_all: false,
            children: Vec::new(),
            parent: at.parent,
            tree: at.tree,
            place: at.element.place,
        };
        for attribute in &at.element.attributes {
            self.take_attribute(at, &mut node, attribute);
        }
        node.conditions.sort_by_key(|(moment, _)| *moment);
        self.check_ports(at, &node);
        Some(node)
    }

    fn check_children(&mut self, at: &NodeSite, kind: BehaviourKind, id: &str) {
        let (least, most) = match kind {
            BehaviourKind::Switch(cases) => (cases + 1, cases + 1),
            BehaviourKind::CustomDecorator => (1, 1),
            BehaviourKind::CustomControl => (1, usize::MAX),
            _ => catalogue::row(id).map_or((0, 0), |row| row.children),
        };
        let count = at.element.children.len();
        if (least..=most).contains(&count) {
            return;
        }
        let expected = match (least, most) {
            (0, 0) => "none".into(),
            (1, 1) => "exactly one".into(),
            (least, usize::MAX) => format!("{least} or more"),
            (least, most) if least == most => format!("exactly {least}"),
            (least, most) => format!("{least} to {most}"),
        };
        let has = if count == 1 { "1 child".into() } else { format!("{count} children") };
        let advice = match (least, most) {
            (1, 1) if count > 1 => "; put them into a `<Sequence>`",
            _ => "",
        };
        self.fault(at.file, at.element.place, format!("`{id}` has {has}: expected {expected}{advice}"));
    }

    fn take_attribute(&mut self, at: &NodeSite, node: &mut TreeNode, attribute: &Attribute) {
        let Attribute { name, value, place } = attribute;
        if let Some(&(_, moment)) = Moment::ALL.iter().find(|(known, _)| known == name) {
            let script = self.script(at.file, *place, value);
            return node.conditions.push((moment, script));
        }
        match &**name {
            "name" | "ID" => return,
            "_autoremap" | "__autoremap" | "__shared_blackboard" => {
                node.remaps_all = ["1", "true"].contains(&&*value.to_lowercase());
                return;
            }
            _ => {}
        }
        if name.starts_with('_') {
            if name != "_description" && name != "_uid" && name != "_fullpath" {
                let known: Vec<&str> = Moment::ALL.iter().map(|(name, _)| *name).collect();
                let text =
                    format!("the attribute `{name}` is not known: expected one of `{}`", known.join("`, `"));
                self.fault(at.file, *place, text);
            }
            return;
        }
        let is_script = matches!(
            (node.kind, &**name),
            (BehaviourKind::Script | BehaviourKind::ScriptCondition, "code")
                | (BehaviourKind::Precondition, "if")
        );
        if is_script {
            node.script = self.script(at.file, *place, value);
        }
        let is_entry_name =
            node.kind == BehaviourKind::SubTree && at.is_format_3 && at.element.name == "SubTree";
        let value = match entry_of(name, value) {
            Some(entry) if !is_script => PortValue::Entry(entry),
            None if is_entry_name => PortValue::Entry(value.clone()),
            _ => PortValue::Text(value.clone()),
        };
        node.ports.push(Port { name: name.clone(), value, place: *place });
    }

    fn script(&mut self, file: usize, place: FilePlace, text: &str) -> Script {
        script::parse(text).unwrap_or_else(|fault| {
            self.fault(file, place, format!("the script `{text}` cannot be read: {fault}"));
            Script::default()
        })
    }

    /// Checks names of ports, ports that are missing, and numbers.
    fn check_ports(&mut self, at: &NodeSite, node: &TreeNode) {
        let Some(known) = self.known_ports(node) else { return };
        for port in &node.ports {
            let Some(row) = known.iter().find(|row| row.name == port.name) else {
                let names: Vec<&str> = known.iter().map(|row| &*row.name).collect();
                let expected =
                    if names.is_empty() { "none".into() } else { format!("one of `{}`", names.join("`, `")) };
                let text = format!("`{}` does not have a port `{}`: expected {expected}", node.id, port.name);
                self.fault(at.file, port.place, text);
                continue;
            };
            if let PortValue::Text(text) = &port.value {
                self.check_value(at.file, &node.id, row, port, text);
            }
        }
        for row in known.iter().filter(|row| row.is_needed) {
            if !node.ports.iter().any(|port| port.name == row.name) {
                let text = format!("`{0}` needs the port `{1}`: write `<{0} {1}=\"…\">`", node.id, row.name);
                self.fault(at.file, node.place, text);
            }
        }
    }

    fn check_value(&mut self, file: usize, id: &str, row: &PortRow, port: &Port, text: &str) {
        let name = &*port.name;
        let expected = if WHOLE.contains(&name) && text.trim().parse::<i64>().is_err() {
            "a whole number, or an entry of the blackboard such as `{count}`"
        } else if NUMBERS.contains(&name) && number::any(text.trim()).is_none() {
            "a number, or an entry of the blackboard such as `{rate}`"
        } else if ["else", "if_empty", "return_on_mismatch"].contains(&name)
            && !["SUCCESS", "FAILURE", "SKIPPED", "RUNNING"].contains(&text)
        {
            "`SUCCESS`, `FAILURE`, `SKIPPED` or `RUNNING`"
        } else if row.direction == Direction::Out {
            "an entry of the blackboard, such as `{result}`"
        } else {
            return;
        };
        self.fault(file, port.place, format!("the port `{name}` of `{id}` is `{text}`: expected {expected}"));
    }

    /// Returns the ports of a node that has no others.
    fn known_ports(&self, node: &TreeNode) -> Option<Vec<PortRow>> {
        if node.kind == BehaviourKind::SubTree {
            return None;
        }
        if let BehaviourKind::Switch(cases) = node.kind {
            let port =
                |name: String| PortRow { name, direction: Direction::In, is_needed: true, default: None };
            let cases = (1..=cases).map(|case| format!("case_{case}"));
            return Some(std::iter::once("variable".to_owned()).chain(cases).map(port).collect());
        }
        // Leaves may have more ports in other releases.
        let row = catalogue::row(&node.id).filter(|row| !row.kind.is_leaf())?;
        Some(catalogue::ports(row.ports).collect())
    }

    /// Checks what needs all trees, and returns the model.
    pub(crate) fn finish(
        mut self,
        main: Option<&str>,
        first: &[XmlElement],
    ) -> Result<Model, Vec<TreeFault>> {
        self.choose_main(main, first);
        self.check_subtrees();
        if self.faults.is_empty() { Ok(self.model) } else { Err(self.faults) }
    }

    fn choose_main(&mut self, main: Option<&str>, first: &[XmlElement]) {
        let Some(root) = first.first() else { return };
        let named = root.attribute("main_tree_to_execute");
        let place = named.filter(|_| main.is_none()).map_or(root.place, |attribute| attribute.place);
        let ids: Vec<&str> = self.model.trees.iter().map(|tree| &*tree.id).collect();
        let expected = format!("expected one of `{}`", ids.join("`, `"));
        let text = match main.or(named.map(|attribute| &*attribute.value)) {
            Some(id) => match self.model.tree(id) {
                Some(tree) => {
                    self.model.main = tree;
                    return;
                }
                None if ids.is_empty() => {
                    format!("no tree is called `{id}`: expected a `<BehaviorTree ID=\"{id}\">`")
                }
                None => format!("no tree is called `{id}`: {expected}"),
            },
            None if ids.len() == 1 => return,
            None if ids.is_empty() => "the file has no trees: expected a `<BehaviorTree>`".into(),
            None => format!("the main tree is not named: {expected} in `<root main_tree_to_execute=\"…\">`"),
        };
        // A tree that was refused is reported already.
        if self.faults.is_empty() {
            self.fault(0, place, text);
        }
    }
}

/// Returns the entry of the blackboard that a value of a port names.
fn entry_of(port: &str, value: &str) -> Option<String> {
    let entry = value.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
    match entry {
        "" => None,
        "=" => Some(port.to_owned()),
        entry => Some(entry.to_owned()),
    }
}
