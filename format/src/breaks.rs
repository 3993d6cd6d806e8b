//! Where a line that is too long may be broken, and what of its list breaks with it.

use esl_syntax::{NodeId, SyntaxKind, SyntaxTree};

use super::indent::{Shapes, begins_clause, is_simple_loop};
use super::style::Indentation;

/// Columns of a line.
pub(super) const WIDTH: usize = 100;

/// Whether a line may begin with an element of a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BreakLevel {
    /// It stays beside the element before it: a value after its keyword, say.
    Never,
    /// Only where nothing else can be broken: it belongs beside the operator.
    Reluctant,
    /// Before what is inside it, if the line gains much: a value behind the place that it is given to.
    Willing,
    /// It does, when the list is broken.
    Ready,
}

/// How a list is broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BreakMode {
    /// Each element begins a line: bodies, clauses.
    Each,
    /// A line holds as many elements as it can.
    Fill,
    /// As [`BreakMode::Fill`], but each keyword begins a line.
    Keywords,
}

impl Shapes<'_> {
    /// Returns whether a line may begin with a node.
    pub(super) fn break_level(&self, node: NodeId) -> BreakLevel {
        let tree = self.tree;
        let list = tree.parent(node).unwrap_or(SyntaxTree::ROOT);
        let Some(before) = self.before(node).filter(|_| !tree.is_comment(node)) else {
            return BreakLevel::Never;
        };
        match tree.kind(list) {
            SyntaxKind::Root => return BreakLevel::Ready,
            SyntaxKind::List => {}
            _ => return BreakLevel::Never,
        }
        let index = self.index(node);
        let follows_keyword = self.is_keyword(before) && !self.is_keyword(node);
        // A dot stands between what it divides.
        if tree.text(node) == "." || tree.text(before) == "." {
            return BreakLevel::Never;
        }
        match self.shape(list) {
            Indentation::Data | Indentation::Form if follows_keyword => BreakLevel::Never,
            Indentation::Data | Indentation::Form | Indentation::Column(..) => BreakLevel::Ready,
            Indentation::Parameters => {
                let is_word = tree.name(before).is_some_and(|name| name.starts_with('&'));
                if is_word { BreakLevel::Never } else { BreakLevel::Ready }
            }
            Indentation::Clause(..) => {
                let is_beside = index == 1 && matches!(tree.kind(before), SyntaxKind::Leaf(_));
                if is_beside { BreakLevel::Reluctant } else { BreakLevel::Ready }
            }
            Indentation::Call(_) => self.of_argument(list, node, index),
            Indentation::Body(heads, ..) => self.of_body(list, node, heads.len()),
            Indentation::Tagbody(heads) if index <= *heads => BreakLevel::Reluctant,
            // The value of a variable stands beside its name.
            Indentation::Sequence(_) if index == 1 && self.is_binding(list) => BreakLevel::Reluctant,
            Indentation::Tagbody(_) | Indentation::Sequence(_) => BreakLevel::Ready,
            Indentation::Loop if is_simple_loop(tree, list) => BreakLevel::Ready,
            Indentation::Loop => {
                let is_clause = index > 1 && begins_clause(tree, node) && !begins_clause(tree, before);
                if is_clause { BreakLevel::Ready } else { BreakLevel::Never }
            }
        }
    }

    fn is_binding(&self, list: NodeId) -> bool {
        let parent = self.tree.parent(list).unwrap_or(SyntaxTree::ROOT);
        matches!(self.shape(parent), Indentation::Column(..))
    }

    fn of_argument(&self, list: NodeId, node: NodeId, index: usize) -> BreakLevel {
        let is_pairs =
            || matches!(self.tree.operator(list).as_deref(), Some("setf" | "setq" | "psetf" | "psetq"));
        match index {
            _ if self.is_value(list, node) => BreakLevel::Never,
            1 => BreakLevel::Reluctant,
            _ if index.is_multiple_of(2) && is_pairs() => BreakLevel::Willing,
            _ => BreakLevel::Ready,
        }
    }

    fn of_body(&self, list: NodeId, node: NodeId, heads: usize) -> BreakLevel {
        let tree = self.tree;
        let index = self.index(node);
        let begins_with_keyword = || tree.operator(node).is_some_and(|word| word.starts_with(':'));
        let operator = tree.operator(list).unwrap_or_default();
        let is_definition = operator.trim_start_matches('%').starts_with("def");
        let is_table = matches!(self.shape(list), Indentation::Body(.., rest) if **rest != Indentation::Form);
        if index <= heads {
            return match (is_definition, index) {
                (true, 1) => BreakLevel::Never,
                (false, 2..) => BreakLevel::Willing,
                _ => BreakLevel::Reluctant,
            };
        }
        // Nothing is known of the operator but that it defines something, or has a body.
        let is_head = match &*operator {
            "defmethod" | "defgeneric" => self.is_up_to_first_list(list, node),
            _ if is_definition && !is_table => {
                let is_option = self.is_keyword(node) || self.is_value(list, node);
                index == 1 || is_option || index == 2 && begins_with_keyword()
            }
            _ => heads == 0 && index == 1 && begins_with_keyword(),
        };
        match is_head {
            true if index == 1 => BreakLevel::Never,
            true => BreakLevel::Reluctant,
            false => BreakLevel::Ready,
        }
    }

    /// Whether a node is the lambda list of a method, or stands before it.
    fn is_up_to_first_list(&self, list: NodeId, node: NodeId) -> bool {
        let is_list = |&part: &NodeId| self.tree.kind(part) == SyntaxKind::List;
        self.tree.data(list).skip(2).take(8).find(is_list).is_none_or(|parameters| node <= parameters)
    }

    /// Returns how a list is broken.
    pub(super) fn break_mode(&self, list: NodeId) -> BreakMode {
        let tree = self.tree;
        if tree.kind(list) != SyntaxKind::List {
            return BreakMode::Each;
        }
        // Of marks that apply to an atom no line is made either.
        let is_atom = |node: NodeId| {
            let mut at = node;
            while let (SyntaxKind::Mark(_), Some(inner)) = (tree.kind(at), tree.data(at).last()) {
                at = inner;
            }
            !matches!(tree.kind(at), SyntaxKind::List)
        };
        // Where the author has broken it, lines are as long as there.
        let is_broken = || tree.data(list).skip(1).any(|node| self.begins_line(node));
        match self.shape(list) {
            Indentation::Parameters => BreakMode::Fill,
            Indentation::Form | Indentation::Data | Indentation::Column(..) => {
                if tree.data(list).any(is_atom) || is_broken() { BreakMode::Fill } else { BreakMode::Each }
            }
            Indentation::Call(rest) => {
                let is_ready = |&node: &NodeId| self.break_level(node) == BreakLevel::Ready;
                let mut ready = tree.data(list).skip(2).filter(is_ready);
                if **rest != Indentation::Form || tree.operator(list).as_deref() == Some("if") {
                    BreakMode::Each
                } else if is_broken() || tree.data(list).next().is_some_and(|first| self.is_keyword(first)) {
                    BreakMode::Fill
                } else if tree.data(list).skip(2).any(|node| self.is_keyword(node)) {
                    BreakMode::Keywords
                } else if ready.any(is_atom) {
                    BreakMode::Fill
                } else {
                    BreakMode::Each
                }
            }
            // A row of a table, or slots.
            Indentation::Body(heads, ..) if heads.is_empty() && tree.data(list).skip(1).any(is_atom) => {
                let has_body =
                    matches!(tree.operator(list).as_deref(), Some("defmethod" | "defgeneric" | "deftest"));
                if has_body { BreakMode::Each } else { BreakMode::Fill }
            }
            Indentation::Body(.., rest) if **rest != Indentation::Form && is_broken() => BreakMode::Fill,
            _ => BreakMode::Each,
        }
    }

    /// Whether a list is filled anew where it is broken: names, numbers and short lists, without comments. A
    /// list of lists only has the lines that its author gave it, and so have keywords and their values.
    pub(super) fn is_plain(&self, list: NodeId) -> bool {
        let tree = self.tree;
        let is_leaf = |node: NodeId| matches!(tree.kind(node), SyntaxKind::Leaf(_));
        let is_call = matches!(self.shape(list), Indentation::Call(_));
        let is_short = |node: NodeId| {
            let is_option = is_call && self.is_keyword(node);
            !tree.is_comment(node) && !tree.text(node).contains('\n') && !is_option
        };
        let has_leaves = || tree.data(list).skip(1 + usize::from(is_call)).any(is_leaf);
        tree.children(list).all(is_short) && has_leaves()
    }

    /// Whether a node is the first on its line in the text.
    fn begins_line(&self, node: NodeId) -> bool {
        let before = &self.tree.source()[..self.tree.range(node).start];
        before.trim_end_matches([' ', '\t']).ends_with('\n')
    }
}
