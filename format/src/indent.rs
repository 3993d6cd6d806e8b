//! The column of a line's first token, by the list around it.

use std::sync::Arc;

use esl_compiler::reader::lexer::Token;
use esl_syntax::{NodeId, SyntaxKind, SyntaxTree, bare_name};

use super::style::{Indentation, Styles};

/// Stands for no node.
const NONE: NodeId = NodeId::MAX;

/// Words that begin a clause of a loop.
const LOOP_CLAUSES: &[&str] = &[
    "with",
    "for",
    "as",
    "named",
    "initially",
    "finally",
    "repeat",
    "while",
    "until",
    "always",
    "never",
    "thereis",
    "do",
    "doing",
    "return",
    "collect",
    "collecting",
    "append",
    "appending",
    "nconc",
    "nconcing",
    "sum",
    "summing",
    "count",
    "counting",
    "maximize",
    "maximizing",
    "minimize",
    "minimizing",
    "if",
    "when",
    "unless",
    "else",
    "end",
    "and",
];

/// The indentation of the elements of lists, by the style of each list.
pub(super) struct Shapes<'a> {
    pub(super) tree: &'a SyntaxTree,
    /// For each list its shape; for each mark that of what it applies to.
    of: Vec<Arc<Indentation>>,
    /// For each node the number of data before it in its parent.
    indexes: Vec<u32>,
    /// For each node the number of data in it.
    counts: Vec<u32>,
    /// For each node the datum before it and the one after it in its parent.
    before: Vec<NodeId>,
    after: Vec<NodeId>,
    /// For each element the last word before it that begins a part of its list: a clause of a loop, or `&key`
    /// of a lambda list.
    words: Vec<NodeId>,
    /// For each list its first keyword behind the operator.
    keywords: Vec<NodeId>,
}

impl<'a> Shapes<'a> {
    pub(super) fn new(tree: &'a SyntaxTree, styles: &Styles) -> Shapes<'a> {
        let count = tree.nodes().end as usize;
        let form = Arc::new(Indentation::Form);
        let none = vec![NONE; count];
        let mut shapes = Shapes {
            tree,
            of: vec![form.clone(); count],
            indexes: vec![0; count],
            counts: vec![0; count],
            before: none.clone(),
            after: none.clone(),
            words: none.clone(),
            keywords: none,
        };
        for node in std::iter::once(SyntaxTree::ROOT).chain(tree.nodes()) {
            if tree.kind(node) == SyntaxKind::List {
                shapes.find_shape(node, styles, &form);
            }
            shapes.find_children(node, &form);
        }
        shapes
    }

    fn find_shape(&mut self, list: NodeId, styles: &Styles, form: &Arc<Indentation>) {
        let tree = self.tree;
        let shape = &mut self.of[list as usize];
        if !tree.text(list).starts_with('(') {
            *shape = Arc::new(Indentation::Data);
        } else if **shape == Indentation::Form {
            *shape = Arc::new(form_shape(tree, styles, list));
        } else if matches!(**shape, Indentation::Column(..) | Indentation::Clause(..))
            && tree.operator(list).is_some_and(|word| word.starts_with(':'))
        {
            // An option such as `(:report …)`.
            *shape = Arc::new(Indentation::Call(form.clone()));
        }
    }

    fn find_children(&mut self, node: NodeId, form: &Arc<Indentation>) {
        let tree = self.tree;
        let kind = tree.kind(node);
        let shape = self.of[node as usize].clone();
        let (mut index, mut before, mut word) = (0, NONE, NONE);
        // Comments since the last datum.
        let mut comments: Vec<NodeId> = Vec::new();
        for child in tree.children(node) {
            let at = child as usize;
            (self.indexes[at], self.before[at], self.words[at]) = (index, before, word);
            self.of[at] = match kind {
                SyntaxKind::List => element(&shape, index as usize, form),
                SyntaxKind::Mark(Token::Quote | Token::Structure | Token::Array) => {
                    Arc::new(Indentation::Data)
                }
                SyntaxKind::Mark(Token::FeaturePresent | Token::FeatureAbsent) if index == 0 => {
                    Arc::new(Indentation::Data)
                }
                SyntaxKind::Mark(Token::FeaturePresent | Token::FeatureAbsent | Token::Label) => {
                    shape.clone()
                }
                _ => form.clone(),
            };
            if tree.is_comment(child) {
                comments.push(child);
                continue;
            }
            for earlier in comments.drain(..).chain(Some(before).filter(|&before| before != NONE)) {
                self.after[earlier as usize] = child;
            }
            let begins_part = match &*shape {
                Indentation::Loop => index > 0 && begins_clause(tree, child),
                Indentation::Parameters => tree.name(child).is_some_and(|name| name.starts_with('&')),
                _ => false,
            };
            if begins_part {
                word = child;
            }
            if index > 0 && self.keywords[node as usize] == NONE && self.is_keyword(child) {
                self.keywords[node as usize] = child;
            }
            before = child;
            index += 1;
        }
        self.counts[node as usize] = index;
    }

    pub(super) fn shape(&self, list: NodeId) -> &Indentation {
        &self.of[list as usize]
    }

    /// Returns the number of data before a node in its parent.
    pub(super) fn index(&self, node: NodeId) -> usize {
        self.indexes[node as usize] as usize
    }

    /// Returns the datum before a node in its parent.
    pub(super) fn before(&self, node: NodeId) -> Option<NodeId> {
        Some(self.before[node as usize]).filter(|&before| before != NONE)
    }

    /// Returns the datum after a node in its parent.
    pub(super) fn after(&self, node: NodeId) -> Option<NodeId> {
        Some(self.after[node as usize]).filter(|&after| after != NONE)
    }

    /// Whether an element is the value of the keyword before it.
    pub(super) fn is_value(&self, list: NodeId, node: NodeId) -> bool {
        let first = self.keywords[list as usize];
        if first == NONE || first >= node {
            return false;
        }
        let (index, start) = (self.index(node), self.index(first));
        match (self.counts[list as usize] as usize - start).is_multiple_of(2) {
            true => (index - start) % 2 == 1,
            false => {
                self.before(node).is_some_and(|before| self.is_keyword(before)) && !self.is_keyword(node)
            }
        }
    }

    pub(super) fn is_keyword(&self, node: NodeId) -> bool {
        self.tree.name(node).is_some_and(|name| name.starts_with(':'))
    }
}

/// Where nodes stand, as far as the text is laid out.
pub(super) struct NodePlaces {
    /// For each node the column in which it begins.
    columns: Vec<u32>,
    /// For each list and mark the column behind its first token.
    inner: Vec<u32>,
    /// For each node whether it is the first on its line.
    is_first: Vec<bool>,
}

impl NodePlaces {
    pub(super) fn new(tree: &SyntaxTree) -> NodePlaces {
        let count = tree.nodes().end as usize;
        NodePlaces { columns: vec![0; count], inner: vec![0; count], is_first: vec![false; count] }
    }

    /// Records that a node begins in one column, and its first token ends before another one.
    pub(super) fn put(&mut self, node: NodeId, column: usize, inner: usize, is_first: bool) {
        let at = node as usize;
        (self.columns[at], self.inner[at], self.is_first[at]) = (column as u32, inner as u32, is_first);
    }

    fn column(&self, node: NodeId) -> usize {
        self.columns[node as usize] as usize
    }

    fn inner(&self, node: NodeId) -> usize {
        self.inner[node as usize] as usize
    }

    fn is_first(&self, node: NodeId) -> bool {
        self.is_first[node as usize]
    }

    /// Returns the column of a node on a line of its own, all before which is laid out; `None` for a comment
    /// of one semicolon between forms, which stays where it is.
    pub(super) fn wanted(&self, shapes: &Shapes<'_>, node: NodeId) -> Option<usize> {
        let tree = shapes.tree;
        let parent = tree.parent(node).unwrap_or(SyntaxTree::ROOT);
        match tree.kind(parent) {
            SyntaxKind::List => Some(self.in_list(shapes, parent, shapes.index(node), Some(node))),
            // Behind a mark: under the mark, or what it takes.
            SyntaxKind::Mark(Token::FeaturePresent | Token::FeatureAbsent) => Some(self.column(parent)),
            SyntaxKind::Mark(_) => Some(self.inner(parent)),
            _ => {
                let is_moved = tree.kind(node) != SyntaxKind::Comment || tree.text(node).starts_with(";;");
                is_moved.then_some(0)
            }
        }
    }

    /// Returns the column of a list's `)` on a line of its own, where another element would stand.
    pub(super) fn wanted_end(&self, shapes: &Shapes<'_>, list: NodeId) -> usize {
        self.in_list(shapes, list, shapes.counts[list as usize] as usize, None)
    }

    /// Returns the column of an element of a list: the one before which there are `index` data.
    fn in_list(&self, shapes: &Shapes<'_>, list: NodeId, index: usize, node: Option<NodeId>) -> usize {
        let tree = shapes.tree;
        let (start, inner) = (self.column(list), self.inner(list));
        match shapes.shape(list) {
            _ if index == 0 => inner,
            Indentation::Form | Indentation::Data | Indentation::Column(..) => inner,
            Indentation::Clause(..) => self.beside_key(shapes, list, index).unwrap_or(inner),
            Indentation::Parameters => self.parameter(shapes, list, node).unwrap_or(inner),
            Indentation::Call(_) => self.argument(shapes, list, index, node).unwrap_or(inner),
            Indentation::Body(heads, columns, _) if index <= heads.len() => start + columns,
            Indentation::Tagbody(heads) if index <= *heads => start + 4,
            Indentation::Tagbody(_) if node.is_some_and(|node| is_tag(tree, node)) => start + 1,
            Indentation::Tagbody(_) => start + 3,
            Indentation::Sequence(_) => self.first_argument(tree, list, index).unwrap_or(start + 2),
            Indentation::Body(..) => start + 2,
            Indentation::Loop => self.in_loop(shapes, list, index, node),
        }
    }

    /// Returns the column of a clause's second datum if it is beside the first, which is an atom.
    fn beside_key(&self, shapes: &Shapes<'_>, list: NodeId, index: usize) -> Option<usize> {
        let key = shapes.tree.data(list).next()?;
        let is_atom = matches!(shapes.tree.kind(key), SyntaxKind::Leaf(_));
        is_atom.then(|| self.first_argument(shapes.tree, list, index)).flatten()
    }

    /// Returns the column of a list's first argument, if that is on the line of the operator, for an element
    /// behind it.
    fn first_argument(&self, tree: &SyntaxTree, list: NodeId, index: usize) -> Option<usize> {
        let argument = tree.data(list).nth(1).filter(|_| index > 1)?;
        (!self.is_first(argument)).then(|| self.column(argument))
    }

    /// Returns the column of an argument of a call: under the first keyword if it is one, or else under the
    /// first argument.
    fn argument(
        &self,
        shapes: &Shapes<'_>,
        list: NodeId,
        index: usize,
        node: Option<NodeId>,
    ) -> Option<usize> {
        let tree = shapes.tree;
        // A comment stands where that stands which it is about.
        let about = node.and_then(|node| if tree.is_comment(node) { shapes.after(node) } else { Some(node) });
        if about.is_some_and(|node| shapes.is_keyword(node)) {
            let mut data = tree.data(list);
            let is_keyword = |node: NodeId| shapes.is_keyword(node);
            let is_plist = data.next().is_some_and(is_keyword) && !data.next().is_some_and(is_keyword);
            if is_plist && index.is_multiple_of(2) {
                return None;
            }
            let first = shapes.keywords[list as usize];
            if first != NONE && shapes.index(first) < index {
                return Some(self.column(first));
            }
        }
        self.first_argument(tree, list, index)
    }

    /// Returns the column of a parameter: under the first one after the last word such as `&key`.
    fn parameter(&self, shapes: &Shapes<'_>, list: NodeId, node: Option<NodeId>) -> Option<usize> {
        let tree = shapes.tree;
        let is_word = |node: NodeId| tree.name(node).is_some_and(|name| name.starts_with('&'));
        let last = || tree.data(list).last();
        let about = match node {
            Some(node) if tree.is_comment(node) => shapes.after(node),
            node => node,
        };
        if about.is_some_and(is_word) {
            return None;
        }
        let word = match node {
            Some(node) => Some(shapes.words[node as usize]).filter(|&word| word != NONE)?,
            None => last()
                .and_then(|last| if is_word(last) { None } else { Some(shapes.words[last as usize]) })?,
        };
        if word == NONE {
            return None;
        }
        let first = shapes.after(word).filter(|&first| node.is_none_or(|node| first < node))?;
        (!self.is_first(first)).then(|| self.column(first))
    }

    fn in_loop(&self, shapes: &Shapes<'_>, list: NodeId, index: usize, node: Option<NodeId>) -> usize {
        let tree = shapes.tree;
        let start = self.column(list);
        if is_simple_loop(tree, list) {
            return start + 2;
        }
        let clauses = self.first_argument(tree, list, index).unwrap_or(start + 2);
        let word = |node: NodeId| tree.name(node).map(bare_name);
        let before = match node {
            Some(node) => Some(shapes.words[node as usize]),
            // The last word of all.
            None => tree
                .data(list)
                .last()
                .map(|last| if begins_clause(tree, last) { last } else { shapes.words[last as usize] }),
        };
        let before = before.filter(|&before| before != NONE);
        let about = node.and_then(|node| if tree.is_comment(node) { shapes.after(node) } else { Some(node) });
        let Some(before) = before else { return clauses };
        if about.is_none_or(|about| begins_clause(tree, about)) {
            let is_conditional = matches!(word(before).as_deref(), Some("when" | "if" | "unless"));
            let is_joined = node.and_then(word).as_deref() == Some("and");
            return match is_conditional {
                true => clauses + 2,
                false if is_joined && self.is_first(before) => self.column(before),
                false => clauses,
            };
        }
        // The forms of a clause stand under its first one.
        let first = shapes.after(before).filter(|&first| Some(first) != about && !self.is_first(first));
        match first {
            Some(first) => self.column(first),
            None if self.is_first(before) => self.column(before) + 2,
            None => clauses,
        }
    }
}

/// Whether a loop has no clauses.
pub(super) fn is_simple_loop(tree: &SyntaxTree, list: NodeId) -> bool {
    tree.data(list).nth(1).is_none_or(|item| tree.name(item).is_none())
}

/// Whether a node is a word that begins a clause of a loop.
pub(super) fn begins_clause(tree: &SyntaxTree, node: NodeId) -> bool {
    tree.name(node).map(bare_name).is_some_and(|word| LOOP_CLAUSES.contains(&&*word))
}

/// Returns the shape of a form, by its operator.
fn form_shape(tree: &SyntaxTree, styles: &Styles, list: NodeId) -> Indentation {
    if let Some(operator) = tree.operator(list) {
        return styles.of_operator(&operator);
    }
    match tree.data(list).next().and_then(|first| filled_in(tree, first)) {
        Some(operator) => styles.of_filled_in(&bare_name(operator)),
        None => Indentation::Column(Arc::new(Indentation::Form), Arc::new(Indentation::Form)),
    }
}

/// Returns the name whose value a template takes in at this node: `top` for `,top`.
fn filled_in(tree: &SyntaxTree, node: NodeId) -> Option<&str> {
    let is_filled_in = tree.kind(node) == SyntaxKind::Mark(Token::Comma);
    tree.data(node).next().filter(|_| is_filled_in).and_then(|inner| tree.name(inner))
}

/// Whether an element of a tagbody is a tag, also one that a template takes in.
fn is_tag(tree: &SyntaxTree, node: NodeId) -> bool {
    tree.name(node).is_some() || filled_in(tree, node).is_some()
}

/// Returns the shape of element `index` of a list.
fn element(list: &Arc<Indentation>, index: usize, form: &Arc<Indentation>) -> Arc<Indentation> {
    match &**list {
        Indentation::Data | Indentation::Parameters => list.clone(),
        Indentation::Column(first, rest) | Indentation::Clause(first, rest) => {
            if index == 0 {
                first.clone()
            } else {
                rest.clone()
            }
        }
        Indentation::Call(rest) | Indentation::Sequence(rest) if index > 0 => rest.clone(),
        Indentation::Body(..) | Indentation::Sequence(_) if index == 0 => Arc::new(Indentation::Data),
        Indentation::Body(heads, _, rest) => match heads.get(index - 1) {
            Some(head) => Arc::new(head.clone()),
            None => rest.clone(),
        },
        _ => form.clone(),
    }
}
