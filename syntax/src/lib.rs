//! The lossless syntax tree: every list, mark, token and comment of a text, with its place.
//!
//! Guarantees: any text has a tree, also one that cannot be read: a list without an end reaches to the end of
//! the text, and a `)` too many is a node of its own. The text between nodes is blank. Building takes time in
//! proportion to the text, without native recursion. Not here: what names mean (the compiler), the data of
//! the text (its reader, whose lexer finds the tokens here too).
//!
//! ```
//! use esl_syntax::{SyntaxKind, SyntaxTree};
//!
//! let tree = SyntaxTree::new("(go 'home) ; at once");
//! let kinds: Vec<SyntaxKind> = tree.children(SyntaxTree::ROOT).map(|node| tree.kind(node)).collect();
//! assert_eq!(kinds, [SyntaxKind::List, SyntaxKind::Comment]);
//! ```
#![forbid(unsafe_code)]

mod build;
mod lines;

use std::ops::Range;

use esl_compiler::reader::lexer::Token;

pub use lines::LineStarts;

/// The number of a node of a tree. Nodes are numbered in the order in which they begin in the text, each
/// before what it contains.
pub type NodeId = u32;

/// Stands for no node.
const NONE: NodeId = NodeId::MAX;

/// The kind of a node of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyntaxKind {
    /// The whole text.
    Root,
    /// `( … )`, or `#( … )` for vectors.
    List,
    /// A mark such as `'` or `#.` and what it applies to. `#+` and `#-` apply to two data.
    Mark(Token),
    /// A name, number, string or another token that is a datum by itself; also a dot.
    Leaf(Token),
    /// `; …`, up to the end of the line.
    Comment,
    /// `#| … |#`.
    BlockComment,
    /// Text that the reader refuses: a `)` without a list, or an invisible character.
    Unexpected,
}

#[derive(Clone, Debug)]
struct SyntaxNode {
    kind: SyntaxKind,
    start: u32,
    end: u32,
    parent: NodeId,
    first_child: NodeId,
    next: NodeId,
    is_closed: bool,
}

/// The tree of a text.
#[derive(Clone, Debug)]
pub struct SyntaxTree {
    text: String,
    nodes: Vec<SyntaxNode>,
}

impl SyntaxTree {
    /// The node of the whole text.
    pub const ROOT: NodeId = 0;

    /// Builds the tree of a text of less than 4 GiB; of one that is longer, the tree of its beginning.
    pub fn new(text: impl Into<String>) -> SyntaxTree {
        build::build(text.into())
    }

    /// Returns the whole text.
    pub fn source(&self) -> &str {
        &self.text
    }

    /// Returns the text of a node.
    pub fn text(&self, node: NodeId) -> &str {
        &self.text[self.range(node)]
    }

    /// Returns the place of a node, in bytes.
    pub fn range(&self, node: NodeId) -> Range<usize> {
        let node = &self.nodes[node as usize];
        node.start as usize..node.end as usize
    }

    /// Returns what a node is.
    pub fn kind(&self, node: NodeId) -> SyntaxKind {
        self.nodes[node as usize].kind
    }

    /// Returns whether a list has its `)`.
    pub fn is_closed(&self, node: NodeId) -> bool {
        self.nodes[node as usize].is_closed
    }

    /// Returns the node that contains a node; `None` for the root.
    pub fn parent(&self, node: NodeId) -> Option<NodeId> {
        Some(self.nodes[node as usize].parent).filter(|&parent| parent != NONE)
    }

    /// Returns the nodes directly inside a node, comments included, in order.
    pub fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        let first = self.nodes[node as usize].first_child;
        std::iter::successors(Some(first).filter(|&child| child != NONE), |&child| {
            Some(self.nodes[child as usize].next).filter(|&next| next != NONE)
        })
    }

    /// Returns the data directly inside a node: its children without comments.
    pub fn data(&self, node: NodeId) -> impl Iterator<Item = NodeId> + '_ {
        self.children(node).filter(|&child| !self.is_comment(child))
    }

    /// Returns all nodes but the root, each before those that it contains.
    pub fn nodes(&self) -> Range<NodeId> {
        1..self.nodes.len() as NodeId
    }

    /// Returns all nodes inside a node, each before those that it contains.
    pub fn nodes_in(&self, node: NodeId) -> Range<NodeId> {
        let end = self.range(node).end;
        let first = self.first_at(self.range(node).start + 1).max(node + 1);
        first..self.first_at(end).max(first)
    }

    /// Returns whether a node is a comment.
    pub fn is_comment(&self, node: NodeId) -> bool {
        matches!(self.kind(node), SyntaxKind::Comment | SyntaxKind::BlockComment)
    }

    /// Returns the first node that begins at byte `offset` or after it; the number of all nodes if there is
    /// none.
    pub fn first_at(&self, offset: usize) -> NodeId {
        1 + self.nodes[1..].partition_point(|node| (node.start as usize) < offset) as NodeId
    }

    /// Returns the innermost node around byte `offset`. A name counts up to the position after it, unless
    /// another token begins there.
    pub fn node_at(&self, offset: usize) -> NodeId {
        let last = self.first_at(offset + 1) - 1;
        let is_leaf = |node| matches!(self.kind(node), SyntaxKind::Leaf(_));
        if !(is_leaf(last) && self.range(last).contains(&offset)) {
            let before = self.first_at(offset) - 1;
            if is_leaf(before) && self.range(before).end == offset {
                return before;
            }
        }
        let mut node = last;
        while node != SyntaxTree::ROOT {
            let place = self.range(node);
            let is_open = self.kind(node) == SyntaxKind::List && !self.is_closed(node) && offset == place.end;
            if offset < place.end || is_open {
                return node;
            }
            node = self.nodes[node as usize].parent;
        }
        node
    }

    /// Returns the list directly around a node, marks left aside.
    pub fn list_around(&self, node: NodeId) -> Option<NodeId> {
        let mut at = self.parent(node)?;
        while matches!(self.kind(at), SyntaxKind::Mark(_)) {
            at = self.parent(at)?;
        }
        (self.kind(at) == SyntaxKind::List).then_some(at)
    }

    /// Returns the position after the `(` of a list or after the token of a mark; else the end of the node.
    pub fn opening_end(&self, node: NodeId) -> usize {
        let place = self.range(node);
        let length = match self.kind(node) {
            SyntaxKind::List => self.text[place.clone()].find('(').map_or(1, |at| at + 1),
            SyntaxKind::Mark(token) => build::mark_length(token, &self.text[place.clone()]),
            _ => return place.end,
        };
        place.start + length
    }

    /// Returns the name that a node is, as it is written; `None` if it is not a name.
    pub fn name(&self, node: NodeId) -> Option<&str> {
        match self.kind(node) {
            SyntaxKind::Leaf(Token::Atom | Token::Escaped) => Some(self.text(node)),
            _ => None,
        }
    }

    /// Returns the name of the operator of a list, without its package, in lower case.
    pub fn operator(&self, list: NodeId) -> Option<String> {
        let first = self.data(list).next().filter(|_| self.kind(list) == SyntaxKind::List)?;
        self.name(first).map(bare_name)
    }
}

/// Returns a name without its package, in lower case. A keyword keeps its colon.
pub fn bare_name(name: &str) -> String {
    let at = name.rfind(':').filter(|&at| at > 0).map_or(0, |at| at + 1);
    name[at..].to_lowercase()
}
