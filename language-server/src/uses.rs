//! The bindings of one name in a whole text, found in one pass over it: for all its uses at once.

use std::collections::HashMap;

use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

use super::scope::{LocalBinding, bound_by, is_seen, kind_at, template_level};

/// Stands for no list.
const NONE: NodeId = NodeId::MAX;

/// Where a text binds a name.
pub(super) struct NameBindings<'a> {
    tree: &'a SyntaxTree,
    /// For each node the innermost list, itself included, that binds the name.
    binder: Vec<NodeId>,
    /// For each such list its bindings of the name, each with the level of templates in which it stands.
    bindings: HashMap<NodeId, Vec<(LocalBinding, Option<i32>)>>,
    /// The bindings that names are themselves.
    own: HashMap<NodeId, LocalBinding>,
}

impl<'a> NameBindings<'a> {
    /// Finds the bindings of a name without its package, in lower case.
    pub(super) fn new(tree: &'a SyntaxTree, name: &str) -> NameBindings<'a> {
        let count = tree.nodes().end as usize;
        let (bindings, own) = (HashMap::new(), HashMap::new());
        let mut found = NameBindings { tree, binder: vec![NONE; count], bindings, own };
        let mut bound = Vec::new();
        for node in tree.nodes() {
            let parent = tree.parent(node).unwrap_or(SyntaxTree::ROOT);
            found.binder[node as usize] = found.binder[parent as usize];
            if tree.kind(node) != SyntaxKind::List {
                continue;
            }
            bound.clear();
            bound_by(tree, node, &mut bound);
            bound.retain(|binding| tree.name(binding.name).map(bare_name).as_deref() == Some(name));
            if bound.is_empty() {
                continue;
            }
            found.binder[node as usize] = node;
            found.own.extend(bound.iter().map(|binding| (binding.name, *binding)));
            let levels = bound.iter().map(|binding| (*binding, template_level(tree, binding.name)));
            found.bindings.insert(node, levels.collect());
        }
        found
    }

    /// Returns the binding to which a use of the name refers; `None` if it is global.
    pub(super) fn binding_of(&self, node: NodeId) -> Option<LocalBinding> {
        let mut list = self.binder[node as usize];
        if list == NONE {
            return None;
        }
        let level = template_level(self.tree, node)?;
        if let Some(own) = self.own.get(&node) {
            return Some(*own);
        }
        let kind = kind_at(self.tree, node);
        while list != NONE {
            let fits = |(binding, at): &&(LocalBinding, Option<i32>)| {
                *at == Some(level) && is_seen(self.tree, binding, kind, node)
            };
            if let Some((binding, _)) =
                self.bindings.get(&list).and_then(|bindings| bindings.iter().find(fits))
            {
                return Some(*binding);
            }
            let parent = self.tree.parent(list).unwrap_or(SyntaxTree::ROOT);
            list = self.binder[parent as usize];
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::super::scope::binding_of;
    use super::*;

    #[test]
    fn the_bindings_found_at_once_are_those_found_one_by_one() {
        let text = "(defun x (x &key (y x)) `(let ((x ,x)) x) (flet ((x (y) (x y))) (x x) (return-from x 1)))
            (let ((x 1) (y x)) 'x (dolist (x x) (block x (tagbody x (go x) (return-from x (x x))))))
            (defmacro with-x (x) (x x)) (loop for x in x collect x) (handler-case x (error (x) x)) x";
        let tree = SyntaxTree::new(text);
        for name in ["x", "y"] {
            let bindings = NameBindings::new(&tree, name);
            let uses = tree.nodes().filter(|&node| tree.name(node).map(bare_name).as_deref() == Some(name));
            let uses: Vec<NodeId> = uses.collect();
            assert!(uses.len() >= 4);
            for node in uses {
                assert_eq!(bindings.binding_of(node), binding_of(&tree, node), "{:?}", tree.range(node));
            }
        }
    }
}
