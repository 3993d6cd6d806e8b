//! The column of a line's first token.

use std::collections::HashMap;
use std::sync::Arc;

use esl_compiler::reader::lexer::Token;

use super::style::{Indentation, Styles};
use crate::syntax::{LineStarts, NodeId, SyntaxKind, SyntaxTree, bare_name};

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

/// Finds the columns of lines, which have to be asked for from the first to the last.
pub(super) struct Indenter<'a> {
    tree: &'a SyntaxTree,
    starts: &'a LineStarts,
    /// For each list its shape; for each mark that of what it applies to.
    shapes: Vec<Arc<Indentation>>,
    /// For each node the number of data before it in its parent.
    indexes: Vec<u32>,
    /// Columns by which a line moves to the right, for lines that move.
    shifts: HashMap<usize, isize>,
    /// Columns of positions that were asked for, before lines move.
    columns: HashMap<usize, usize>,
}

impl<'a> Indenter<'a> {
    pub(super) fn new(tree: &'a SyntaxTree, styles: &Styles, starts: &'a LineStarts) -> Indenter<'a> {
        let count = tree.nodes().end as usize;
        let mut indexes = vec![0; count];
        let form = Arc::new(Indentation::Form);
        let data = Arc::new(Indentation::Data);
        let mut shapes = vec![form.clone(); count];
        for node in std::iter::once(SyntaxTree::ROOT).chain(tree.nodes()) {
            let kind = tree.kind(node);
            if kind == SyntaxKind::List {
                let is_vector = !tree.text(node).starts_with('(');
                if is_vector {
                    shapes[node as usize] = data.clone();
                } else if *shapes[node as usize] == Indentation::Form {
                    shapes[node as usize] = Arc::new(form_shape(tree, styles, node));
                } else if matches!(*shapes[node as usize], Indentation::Column(..) | Indentation::Clause(..))
                    && tree.operator(node).is_some_and(|word| word.starts_with(':'))
                {
                    // An option such as `(:report …)`.
                    shapes[node as usize] = Arc::new(Indentation::Call(form.clone()));
                }
            }
            let mut index = 0;
            for child in tree.children(node) {
                indexes[child as usize] = index;
                index += u32::from(!tree.is_comment(child));
                let inner = &shapes[node as usize];
                shapes[child as usize] = match kind {
                    SyntaxKind::List => element(inner, indexes[child as usize] as usize, &form),
                    SyntaxKind::Mark(Token::Quote | Token::Structure | Token::Array) => data.clone(),
                    SyntaxKind::Mark(Token::FeaturePresent | Token::FeatureAbsent) => {
                        if indexes[child as usize] == 0 { data.clone() } else { inner.clone() }
                    }
                    SyntaxKind::Mark(Token::Label) => inner.clone(),
                    _ => form.clone(),
                };
            }
        }
        Indenter { tree, starts, shapes, indexes, shifts: HashMap::new(), columns: HashMap::new() }
    }

    /// Returns the column for a line whose first token begins at byte `start` after so many blanks.
    pub(super) fn indent(&mut self, line: usize, start: usize, blanks: usize) -> usize {
        let column = self.aligned_comment(line, start).unwrap_or_else(|| self.wanted(start));
        if column != blanks {
            self.shifts.insert(line, column as isize - blanks as isize);
        }
        column
    }

    /// Returns the column of a comment that goes on with the one at the end of the line before.
    fn aligned_comment(&mut self, line: usize, start: usize) -> Option<usize> {
        let text = &self.tree.source()[start..];
        if !text.starts_with(';') || text.starts_with(";;") {
            return None;
        }
        let before = self.tree.first_at(start) - 1;
        let place = self.tree.range(before);
        let is_comment = before != SyntaxTree::ROOT && self.tree.kind(before) == SyntaxKind::Comment;
        if !is_comment || line == 0 || self.starts.line_of(place.start) != line - 1 {
            return None;
        }
        let first = self.starts.range(line - 1).start;
        let is_alone = self.tree.source()[first..place.start].trim().is_empty();
        // One that is alone on its line has been aligned itself, or is indented as code is.
        if is_alone && self.wanted(place.start) == self.column(place.start) {
            return None;
        }
        let was = self.old_column(place.start);
        (was == self.old_column(start)).then(|| self.column(place.start))
    }

    /// Returns the column by the list around a position.
    fn wanted(&mut self, start: usize) -> usize {
        let tree = self.tree;
        let next = tree.first_at(start);
        let begins = next < tree.nodes().end && tree.range(next).start == start;
        let (parent, index) = if begins {
            (tree.parent(next).unwrap_or(SyntaxTree::ROOT), self.indexes[next as usize] as usize)
        } else {
            // A `)`: it belongs to the list that ends with it, as another element would.
            let list = closing_list(tree, start);
            (list, tree.data(list).count())
        };
        match tree.kind(parent) {
            SyntaxKind::List => self.in_list(parent, index, begins.then_some(next)),
            // Behind a mark: under the mark, or what it takes.
            SyntaxKind::Mark(Token::FeaturePresent | Token::FeatureAbsent) => {
                self.column(tree.range(parent).start)
            }
            SyntaxKind::Mark(_) => self.column(tree.opening_end(parent)),
            // Between forms, a comment of one semicolon stays where it is.
            _ if tree.source()[start..].starts_with(';') && !tree.source()[start..].starts_with(";;") => {
                self.old_column(start)
            }
            _ => 0,
        }
    }

    /// Returns the column of an element of a list: the one before which there are `index` data.
    fn in_list(&mut self, list: NodeId, index: usize, node: Option<NodeId>) -> usize {
        let tree = self.tree;
        let start = self.column(tree.range(list).start);
        let inner = self.column(tree.opening_end(list));
        let shape = self.shapes[list as usize].clone();
        match &*shape {
            _ if index == 0 => inner,
            Indentation::Form | Indentation::Data | Indentation::Column(..) => inner,
            Indentation::Clause(..) => self.beside_key(list, index).unwrap_or(inner),
            Indentation::Parameters => self.parameter(list, index).unwrap_or(inner),
            Indentation::Call(_) => self.argument(list, index, node).unwrap_or(inner),
            Indentation::Body(heads, columns, _) if index <= heads.len() => start + columns,
            Indentation::Tagbody(heads) if index <= *heads => start + 4,
            Indentation::Tagbody(_) if node.is_some_and(|node| is_tag(tree, node)) => start + 1,
            Indentation::Tagbody(_) => start + 3,
            Indentation::Sequence(_) if index > 1 => self.first_argument(list).unwrap_or(start + 2),
            Indentation::Body(..) | Indentation::Sequence(_) => start + 2,
            Indentation::Loop => self.in_loop(list, index, node, start),
        }
    }

    /// Returns the column of a clause's second datum if it is beside the first, which is an atom.
    fn beside_key(&mut self, list: NodeId, index: usize) -> Option<usize> {
        let key = self.tree.data(list).next()?;
        let is_atom = matches!(self.tree.kind(key), SyntaxKind::Leaf(_));
        (is_atom && index > 1).then(|| self.first_argument(list)).flatten()
    }

    /// Returns the column of a list's first argument, if that is on the line of the operator.
    fn first_argument(&mut self, list: NodeId) -> Option<usize> {
        let mut data = self.tree.data(list);
        let operator = self.tree.range(data.next()?).end;
        let argument = self.tree.range(data.next()?).start;
        (self.starts.line_of(operator) == self.starts.line_of(argument)).then(|| self.column(argument))
    }

    /// Returns the column of an argument of a call: under the first keyword if it is one, or else under the
    /// first argument.
    fn argument(&mut self, list: NodeId, index: usize, node: Option<NodeId>) -> Option<usize> {
        let tree = self.tree;
        let is_keyword = |node: NodeId| tree.name(node).is_some_and(|name| name.starts_with(':'));
        // A comment stands where that stands which it is about.
        let is_comment = node.is_some_and(|node| tree.is_comment(node));
        let node = if is_comment { tree.data(list).nth(index) } else { node };
        if node.is_some_and(is_keyword) {
            let mut data = tree.data(list);
            let is_plist = data.next().is_some_and(is_keyword) && !data.next().is_some_and(is_keyword);
            if is_plist && index.is_multiple_of(2) {
                return None;
            }
            let first = tree.data(list).take(index).skip(1).find(|&before| is_keyword(before));
            if let Some(first) = first {
                return Some(self.column(tree.range(first).start));
            }
        }
        self.first_argument(list)
    }

    /// Returns the column of a parameter: under the first one after the last word such as `&key`.
    fn parameter(&mut self, list: NodeId, index: usize) -> Option<usize> {
        let tree = self.tree;
        let is_word = |node: NodeId| tree.name(node).is_some_and(|name| name.starts_with('&'));
        let items: Vec<NodeId> = tree.data(list).take(index + 1).collect();
        if items.get(index).copied().is_some_and(is_word) {
            return None;
        }
        let word = items[..index].iter().rposition(|&item| is_word(item))?;
        let first = *items.get(word + 1).filter(|_| word + 1 < index)?;
        let line = |offset| self.starts.line_of(offset);
        let is_beside = line(tree.range(items[word]).start) == line(tree.range(first).start);
        is_beside.then(|| self.column(tree.range(first).start))
    }

    fn in_loop(&mut self, list: NodeId, index: usize, node: Option<NodeId>, start: usize) -> usize {
        let tree = self.tree;
        let is_simple = tree.data(list).nth(1).is_none_or(|item| tree.name(item).is_none());
        if is_simple {
            return start + 2;
        }
        let items: Vec<NodeId> = tree.data(list).take(index + 1).collect();
        let clauses = self.first_argument(list).unwrap_or(start + 2);
        let word = |node: NodeId| tree.name(node).map(bare_name);
        let begins_clause = |node: NodeId| word(node).is_some_and(|word| LOOP_CLAUSES.contains(&&*word));
        let at = node.map(|node| if tree.is_comment(node) { items.get(index).copied() } else { Some(node) });
        if at.flatten().is_none_or(begins_clause) {
            let Some(before) = (1..index).rev().map(|at| items[at]).find(|&item| begins_clause(item)) else {
                return clauses;
            };
            let is_conditional = matches!(word(before).as_deref(), Some("when" | "if" | "unless"));
            let is_joined = node.and_then(word).as_deref() == Some("and");
            let place = tree.range(before).start;
            let blanks = &tree.source()[self.starts.range(self.starts.line_of(place)).start..place];
            return match is_conditional {
                true => clauses + 2,
                false if is_joined && blanks.trim().is_empty() => self.column(place),
                false => clauses,
            };
        }
        // The forms of a clause stand under its first one.
        let clause = (1..index).rev().find(|&at| begins_clause(items[at]));
        let Some(first) = clause.and_then(|at| items.get(at + 1)) else { return clauses };
        let place = tree.range(*first).start;
        let keyword = tree.range(items[clause.unwrap_or(1)]).start;
        let line = self.starts.line_of(keyword);
        if self.starts.line_of(place) == line {
            return self.column(place);
        }
        let before = &tree.source()[self.starts.range(line).start..keyword];
        if before.trim().is_empty() { self.column(keyword) + 2 } else { clauses }
    }

    /// Returns the column of a position on a line that was indented already.
    fn column(&mut self, offset: usize) -> usize {
        let line = self.starts.line_of(offset);
        let shift = self.shifts.get(&line).copied().unwrap_or(0);
        self.old_column(offset).saturating_add_signed(shift)
    }

    fn old_column(&mut self, offset: usize) -> usize {
        let start = self.starts.range(self.starts.line_of(offset)).start;
        let text = &self.tree.source()[start..offset];
        *self.columns.entry(offset).or_insert_with(|| text.trim_start_matches('\u{feff}').chars().count())
    }
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

/// Returns the list whose `)` is at byte `offset`; the root if it is none's.
fn closing_list(tree: &SyntaxTree, offset: usize) -> NodeId {
    let mut node = tree.first_at(offset) - 1;
    loop {
        if tree.kind(node) == SyntaxKind::List && tree.range(node).end == offset + 1 {
            return node;
        }
        match tree.parent(node) {
            Some(parent) => node = parent,
            None => return SyntaxTree::ROOT,
        }
    }
}
