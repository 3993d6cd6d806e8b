//! Building the tree from the tokens of the reader's lexer, with the comments between them.

use esl_compiler::reader::lexer::{Token, tokens};

use super::{NONE, NodeId, SyntaxKind, SyntaxNode, SyntaxTree};

/// A list or mark whose end has not been seen.
struct OpenNode {
    node: NodeId,
    last_child: NodeId,
    /// Data that a mark still takes; 0 for lists, which end at their `)`.
    missing: u32,
}

struct TreeBuilder {
    nodes: Vec<SyntaxNode>,
    open: Vec<OpenNode>,
    /// From here on, a `(` in column 0 begins a new form whatever is open: the form that begins here has no
    /// end.
    broken_from: usize,
}

pub(super) fn build(mut text: String) -> SyntaxTree {
    if u32::try_from(text.len()).is_err() {
        let end = (0..=u32::MAX as usize).rev().find(|&at| text.is_char_boundary(at));
        text.truncate(end.unwrap_or(0));
    }
    let mut builder = TreeBuilder::new(&text, usize::MAX);
    // A list without an end, and where it begins.
    let unclosed = builder.open.get(1).map(|open| builder.nodes[open.node as usize].start as usize);
    if let Some(start) = unclosed {
        builder = TreeBuilder::new(&text, start);
    }
    builder.close_all(text.len());
    SyntaxTree { text, nodes: builder.nodes }
}

/// Returns the length of the token of a mark in the text of the mark.
pub(super) fn mark_length(token: Token, text: &str) -> usize {
    match token {
        Token::Quote | Token::Backquote | Token::Comma => 1,
        Token::CommaAt
        | Token::Function
        | Token::FeaturePresent
        | Token::FeatureAbsent
        | Token::ReadEval
        | Token::Structure
        | Token::Pathname
        | Token::Complex => 2,
        // `#nA`, `#n=`
        _ => text.find(['a', 'A', '=']).map_or(text.len(), |at| at + 1),
    }
}

impl TreeBuilder {
    /// Takes all of a text. Lists that are open at its end stay open.
    fn new(text: &str, broken_from: usize) -> TreeBuilder {
        let root = SyntaxNode {
            kind: SyntaxKind::Root,
            start: 0,
            end: text.len() as u32,
            parent: NONE,
            first_child: NONE,
            next: NONE,
            is_closed: true,
        };
        let outermost = OpenNode { node: SyntaxTree::ROOT, last_child: NONE, missing: 0 };
        let mut builder = TreeBuilder { nodes: vec![root], open: vec![outermost], broken_from };
        let mut position = builder.preamble(text);
        for (token, place) in tokens(text, position) {
            builder.comments(text, position, place.start);
            position = place.end;
            match token {
                Ok(token) => builder.token(token, text, place.start, place.end),
                // The rest of the text: a string, comment or name without an end.
                Err(_) if text[place.clone()].starts_with("#|") => {
                    builder.add(SyntaxKind::BlockComment, place.start, place.end);
                }
                Err(_) => {
                    builder.add(SyntaxKind::Leaf(Token::Unfinished), place.start, place.end);
                    builder.complete(place.end);
                }
            }
        }
        builder.comments(text, position, text.len());
        builder
    }

    /// Ends all open lists and marks before byte `end`.
    fn close_all(&mut self, end: usize) {
        for open in self.open.drain(1..) {
            self.nodes[open.node as usize].end = end as u32;
        }
    }

    /// Takes what the reader skips at the beginning: a byte order mark, and a line that begins with `#!`,
    /// which counts as a comment.
    fn preamble(&mut self, text: &str) -> usize {
        let start = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        if !text[start..].starts_with("#!") {
            return start;
        }
        let end = text[start..].find('\n').map_or(text.len(), |at| start + at);
        self.add(SyntaxKind::Comment, start, end);
        end
    }

    /// Adds the comments between two tokens.
    fn comments(&mut self, text: &str, start: usize, end: usize) {
        let mut at = start;
        while let Some(found) = text[at..end].find([';', '#']) {
            let start = at + found;
            let (kind, length) = if text[start..].starts_with(';') {
                (SyntaxKind::Comment, text[start..end].find('\n').unwrap_or(end - start))
            } else {
                (SyntaxKind::BlockComment, block_length(&text[start..end]))
            };
            at = start + length;
            let shown = text[start..at].trim_end_matches(['\r', ' ', '\t']).len();
            self.add(kind, start, if kind == SyntaxKind::Comment { start + shown } else { at });
        }
    }

    fn token(&mut self, token: Token, text: &str, start: usize, end: usize) {
        match token {
            Token::Open | Token::Vector => {
                let is_column_0 = start == 0 || text.as_bytes()[start - 1] == b'\n';
                if start > self.broken_from && is_column_0 {
                    self.close_all(text[..start].trim_end().len());
                }
                self.begin(SyntaxKind::List, 0, start, end);
            }
            Token::Close => self.close(start, end),
            Token::Quote
            | Token::Backquote
            | Token::Comma
            | Token::CommaAt
            | Token::Function
            | Token::Array
            | Token::Label
            | Token::ReadEval
            | Token::Structure
            | Token::Pathname
            | Token::Complex => self.begin(SyntaxKind::Mark(token), 1, start, end),
            Token::FeaturePresent | Token::FeatureAbsent => {
                self.begin(SyntaxKind::Mark(token), 2, start, end);
            }
            Token::Stray => _ = self.add(SyntaxKind::Unexpected, start, end),
            _ => {
                self.add(SyntaxKind::Leaf(token), start, end);
                self.complete(end);
            }
        }
    }

    /// Adds a node inside the innermost open one.
    fn add(&mut self, kind: SyntaxKind, start: usize, end: usize) -> NodeId {
        let id = self.nodes.len() as NodeId;
        // The root stays open until the end.
        let Some(open) = self.open.last_mut() else { return SyntaxTree::ROOT };
        let previous = std::mem::replace(&mut open.last_child, id);
        let parent = open.node;
        match previous {
            NONE => self.nodes[parent as usize].first_child = id,
            previous => self.nodes[previous as usize].next = id,
        }
        let (start, end) = (start as u32, end as u32);
        let (first_child, next) = (NONE, NONE);
        self.nodes.push(SyntaxNode { kind, start, end, parent, first_child, next, is_closed: false });
        id
    }

    fn begin(&mut self, kind: SyntaxKind, missing: u32, start: usize, end: usize) {
        let node = self.add(kind, start, end);
        self.open.push(OpenNode { node, last_child: NONE, missing });
    }

    /// Ends the marks to which a datum that ends here was missing.
    fn complete(&mut self, end: usize) {
        while let Some(open) = self.open.last_mut().filter(|open| open.missing > 0) {
            open.missing -= 1;
            if open.missing > 0 {
                return;
            }
            let node = open.node;
            self.nodes[node as usize].end = end as u32;
            self.open.pop();
        }
    }

    fn close(&mut self, start: usize, end: usize) {
        // Marks without a datum end before the `)`.
        while let Some(open) = self.open.last().filter(|open| open.missing > 0) {
            let last = open.last_child;
            let end = if last == NONE { None } else { Some(self.nodes[last as usize].end) };
            let node = &mut self.nodes[open.node as usize];
            node.end = end.unwrap_or(node.end);
            self.open.pop();
        }
        if self.open.len() == 1 {
            self.add(SyntaxKind::Unexpected, start, end);
            return;
        }
        if let Some(open) = self.open.pop() {
            let node = &mut self.nodes[open.node as usize];
            (node.end, node.is_closed) = (end as u32, true);
        }
        self.complete(end);
    }
}

/// Returns the length of the block comment with which a text begins. Block comments nest.
fn block_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let (mut depth, mut at) = (0, 0);
    while at < bytes.len() {
        match (bytes[at], bytes.get(at + 1)) {
            (b'|', Some(b'#')) => {
                depth -= 1;
                at += 2;
                if depth == 0 {
                    return at;
                }
            }
            (b'#', Some(b'|')) => {
                depth += 1;
                at += 2;
            }
            _ => at += 1,
        }
    }
    bytes.len()
}
