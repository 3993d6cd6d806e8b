//! Entries of the blackboard: which tree mentions and sets them, and the directions of ports.

use std::collections::{HashMap, HashSet};

use crate::catalogue::{self, BehaviourKind, Direction};
use crate::model::{Model, PortValue, TreeNode};
use crate::ros;

/// Entries of one tree, those of its subtrees included.
#[derive(Clone, Debug, Default)]
pub(crate) struct TreeEntries {
    /// In the order of their first mention.
    pub(crate) mentioned: Vec<String>,
    pub(crate) set: HashSet<String>,
    known: HashSet<String>,
}

impl TreeEntries {
    fn mention(&mut self, entry: &str) {
        if self.known.insert(entry.to_owned()) {
            self.mentioned.push(entry.to_owned());
        }
    }
}

/// Entries of all trees.
#[derive(Debug, Default)]
pub(crate) struct EntryUses {
    pub(crate) trees: Vec<TreeEntries>,
    /// Ports of leaves that are taken for outputs, since nothing declares them: node and port.
    guessed: HashSet<(usize, String)>,
    /// Number of the nodes that stand for each tree.
    pub(crate) uses: Vec<usize>,
}

impl EntryUses {
    pub(crate) fn new(model: &Model) -> EntryUses {
        let count = model.trees.len();
        let mut entries = EntryUses {
            trees: vec![TreeEntries::default(); count],
            guessed: HashSet::new(),
            uses: vec![0; count],
        };
        let numbers: HashMap<&str, usize> =
            model.trees.iter().enumerate().map(|(n, tree)| (&*tree.id, n)).collect();
        for node in model.nodes.iter().filter(|node| node.kind == BehaviourKind::SubTree) {
            entries.uses[numbers[&*node.id]] += 1;
        }
        entries.guess(model);
        for tree in from_leaves(model, &numbers) {
            let end = model.trees.get(tree + 1).map_or(model.nodes.len(), |next| next.root);
            let mut own = TreeEntries::default();
            for index in model.trees[tree].root..end {
                let node = &model.nodes[index];
                for script in node.conditions.iter().map(|(_, script)| script).chain([&node.script]) {
                    script.names().for_each(|name| own.mention(name));
                    for name in script.assigned() {
                        own.mention(name);
                        own.set.insert(name.to_owned());
                    }
                }
                if node.kind == BehaviourKind::SubTree {
                    entries.add_subtree(node, numbers[&*node.id], &mut own);
                    continue;
                }
                for port in &node.ports {
                    let entry = match (&port.value, node.kind, &*port.name) {
                        (PortValue::Entry(entry), ..) => entry,
                        // The name of the entry itself.
                        (PortValue::Text(entry), BehaviourKind::SetBlackboard, "output_key")
                        | (PortValue::Text(entry), BehaviourKind::UnsetBlackboard, "key") => entry,
                        _ => continue,
                    };
                    own.mention(entry);
                    if entries.direction(model, index, &port.name) != Direction::In {
                        own.set.insert(entry.clone());
                    }
                }
            }
            entries.trees[tree] = own;
        }
        entries
    }

    fn add_subtree(&self, node: &TreeNode, tree: usize, own: &mut TreeEntries) {
        let inner = &self.trees[tree];
        for entry in &inner.mentioned {
            let outer = match node.ports.iter().find(|port| port.name == *entry) {
                Some(port) => match &port.value {
                    PortValue::Entry(outer) => outer,
                    PortValue::Text(_) => continue,
                },
                None if node.remaps_all => entry,
                None => continue,
            };
            own.mention(outer);
            if inner.set.contains(entry) {
                own.set.insert(outer.clone());
            }
        }
    }

    /// Returns the direction of a port.
    pub(crate) fn direction(&self, model: &Model, index: usize, port: &str) -> Direction {
        let node = &model.nodes[index];
        match declared_direction(model, node, port) {
            Some(direction) => direction,
            None if self.guessed.contains(&(index, port.to_owned())) => Direction::Out,
            None => Direction::In,
        }
    }

    /// Guesses which ports of undeclared leaves are outputs: those with such a name, and those that mention
    /// an entry first that nothing sets and that others mention later.
    fn guess(&mut self, model: &Model) {
        let mut set: Vec<HashSet<&str>> = vec![HashSet::new(); model.trees.len()];
        let mut mentions: HashMap<(usize, &str), usize> = HashMap::new();
        for node in &model.nodes {
            for script in node.conditions.iter().map(|(_, script)| script).chain([&node.script]) {
                set[node.tree].extend(script.assigned());
                script.names().for_each(|name| *mentions.entry((node.tree, name)).or_default() += 1);
            }
            for port in &node.ports {
                let PortValue::Entry(entry) = &port.value else {
                    if let (PortValue::Text(entry), BehaviourKind::SetBlackboard) = (&port.value, node.kind) {
                        set[node.tree].insert(entry);
                    }
                    continue;
                };
                *mentions.entry((node.tree, entry)).or_default() += 1;
                let direction = declared_direction(model, node, &port.name);
                if direction.is_some_and(|direction| direction != Direction::In)
                    || node.kind == BehaviourKind::SubTree
                {
                    set[node.tree].insert(entry);
                }
            }
        }
        // Ports of subtrees come from outside.
        for node in model.nodes.iter().filter(|node| node.kind == BehaviourKind::SubTree) {
            if let Some(tree) = model.tree(&node.id) {
                set[tree].extend(node.ports.iter().map(|port| &*port.name));
            }
        }
        for (index, node) in
            model.nodes.iter().enumerate().filter(|(_, node)| node.kind == BehaviourKind::Action)
        {
            for port in &node.ports {
                let PortValue::Entry(entry) = &port.value else { continue };
                if declared_direction(model, node, &port.name).is_some() {
                    continue;
                }
                let is_named_so = ["output", "out_", "result"].iter().any(|word| port.name.starts_with(word));
                let is_first = !set[node.tree].contains(&**entry)
                    && mentions.get(&(node.tree, entry)).is_some_and(|&n| n > 1);
                if is_named_so || is_first {
                    self.guessed.insert((index, port.name.clone()));
                }
                set[node.tree].insert(entry);
            }
        }
    }
}

/// Returns the direction of a port, as far as it is declared.
fn declared_direction(model: &Model, node: &TreeNode, port: &str) -> Option<Direction> {
    if let Some(row) = catalogue::row(&node.id) {
        return catalogue::ports(row.ports)
            .find(|row| row.name == port)
            .map(|row| row.direction)
            .or(Some(Direction::In));
    }
    if let Some(row) = ros::row(&node.id) {
        let is_output = ros::pairs(row.outputs).any(|(name, _)| name == port)
            || port.starts_with("error_")
            || port.contains("feedback")
            || port == "last_reached_index";
        return Some(if is_output { Direction::Out } else { Direction::In });
    }
    if matches!(node.kind, BehaviourKind::Switch(_)) {
        return Some(Direction::In);
    }
    let declared = model.declared.get(&node.id)?;
    declared.ports.iter().find(|row| row.name == port).map(|row| row.direction)
}

/// Returns the trees, subtrees before those that contain them.
fn from_leaves(model: &Model, numbers: &HashMap<&str, usize>) -> Vec<usize> {
    let mut uses: Vec<Vec<usize>> = vec![Vec::new(); model.trees.len()];
    for node in model.nodes.iter().filter(|node| node.kind == BehaviourKind::SubTree) {
        uses[node.tree].push(numbers[&*node.id]);
    }
    let mut order = Vec::new();
    let mut is_begun = vec![false; uses.len()];
    for start in 0..uses.len() {
        let mut path = if is_begun[start] { Vec::new() } else { vec![(start, 0)] };
        is_begun[start] = true;
        while let Some((tree, next)) = path.last_mut() {
            let Some(&used) = uses[*tree].get(*next) else {
                order.push(*tree);
                path.pop();
                continue;
            };
            *next += 1;
            if !is_begun[used] {
                is_begun[used] = true;
                path.push((used, 0));
            }
        }
    }
    order
}
