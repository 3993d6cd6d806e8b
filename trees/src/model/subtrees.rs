//! Checks of subtrees: they exist, have their ports, and do not contain themselves.

use crate::catalogue::BehaviourKind;
use crate::model::build::Builder;
use crate::model::{Port, PortValue};

impl Builder {
    /// Checks all subtrees, and gives them the defaults of their models.
    pub(super) fn check_subtrees(&mut self) {
        for index in 0..self.model.nodes.len() {
            if self.model.nodes[index].kind != BehaviourKind::SubTree {
                continue;
            }
            let node = &self.model.nodes[index];
            let (id, place, file) = (node.id.clone(), node.place, self.model.trees[node.tree].file);
            if self.model.tree(&id).is_none() {
                let ids: Vec<&str> = self.model.trees.iter().map(|tree| &*tree.id).collect();
                let text = format!("no tree is called `{id}`: expected one of `{}`", ids.join("`, `"));
                self.fault(file, place, text);
                continue;
            }
            if node.remaps_all {
                continue;
            }
            let ports = self.model.subtrees.get(&id).cloned().unwrap_or_default();
            for row in ports {
                if self.model.nodes[index].ports.iter().any(|port| port.name == row.name) {
                    continue;
                }
                match row.default {
                    Some(default) => {
                        let entry = default.strip_prefix('{').and_then(|rest| rest.strip_suffix('}'));
                        let value = entry.map_or(PortValue::Text(default.clone()), |entry| {
                            PortValue::Entry(entry.to_owned())
                        });
                        self.model.nodes[index].ports.push(Port { name: row.name, value, place });
                    }
                    None => {
                        let text = format!(
                            "the subtree `{id}` needs the port `{0}`: write `<SubTree ID=\"{id}\" {0}=\"{{…}}\">`",
                            row.name
                        );
                        self.fault(file, place, text);
                    }
                }
            }
        }
        self.check_cycles();
    }

    /// Checks that no tree contains itself.
    fn check_cycles(&mut self) {
        // The subtrees of each tree: a node and the tree that it stands for.
        let mut uses: Vec<Vec<(usize, usize)>> = vec![Vec::new(); self.model.trees.len()];
        for (index, node) in self.model.nodes.iter().enumerate() {
            if let Some(tree) =
                (node.kind == BehaviourKind::SubTree).then(|| self.model.tree(&node.id)).flatten()
            {
                uses[node.tree].push((index, tree));
            }
        }
        #[derive(Clone, Copy, PartialEq)]
        enum Visit {
            Not,
            UnderWay,
            Over,
        }
        let mut visits = vec![Visit::Not; uses.len()];
        for start in 0..uses.len() {
            let mut path = vec![(start, 0)];
            while let Some(&(tree, next)) = path.last() {
                visits[tree] = Visit::UnderWay;
                let Some(&(node, used)) = uses[tree].get(next) else {
                    visits[tree] = Visit::Over;
                    path.pop();
                    continue;
                };
                if let Some(last) = path.last_mut() {
                    last.1 += 1;
                }
                match visits[used] {
                    Visit::Not => path.push((used, 0)),
                    Visit::UnderWay => {
                        let node = &self.model.nodes[node];
                        let (file, place) = (self.model.trees[node.tree].file, node.place);
                        let id = node.id.clone();
                        let text = format!(
                            "the tree `{id}` contains itself here: repeat it by `<Repeat>` or \
                             `<RetryUntilSuccessful>` instead"
                        );
                        self.fault(file, place, text);
                    }
                    Visit::Over => {}
                }
            }
        }
    }
}
