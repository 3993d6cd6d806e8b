//! The tokens and comments of a text in order, with the blanks between them.

use std::ops::Range;

use esl_syntax::{LineStarts, NodeId, SyntaxKind, SyntaxTree};

/// The kind of a piece.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PieceKind {
    /// The `(` of a list, with what belongs to it, as in `#(`.
    Open,
    /// The `)` of a list.
    Close,
    /// The token of a mark, such as `'`.
    Mark,
    /// A token that is a datum by itself, or one that the reader refuses.
    Leaf,
    /// A comment up to the end of its line.
    Comment,
    /// `#| … |#`
    BlockComment,
}

/// A token or comment.
#[derive(Clone, Copy, Debug)]
pub(super) struct TextPiece {
    /// The node that begins with the piece; for a `)` its list.
    pub(super) node: NodeId,
    pub(super) kind: PieceKind,
    pub(super) start: usize,
    pub(super) end: usize,
    /// Whether the piece and the blanks before it stay as they are.
    pub(super) is_kept: bool,
}

/// Returns the pieces of a text. Kept are those on lines that are not wanted, and those between the comments
/// `; format: off` and `; format: on`.
pub(super) fn pieces(
    tree: &SyntaxTree,
    lines: &LineStarts,
    is_wanted: impl Fn(usize) -> bool,
) -> Vec<TextPiece> {
    let mut found = Vec::with_capacity(tree.nodes().len() * 3 / 2);
    let mut open: Vec<NodeId> = Vec::new();
    for node in tree.nodes() {
        let place = tree.range(node);
        close_before(tree, &mut open, place.start, &mut found);
        let kind = match tree.kind(node) {
            SyntaxKind::List => {
                if tree.is_closed(node) {
                    open.push(node);
                }
                PieceKind::Open
            }
            SyntaxKind::Mark(_) => PieceKind::Mark,
            SyntaxKind::Comment => PieceKind::Comment,
            SyntaxKind::BlockComment => PieceKind::BlockComment,
            SyntaxKind::Root | SyntaxKind::Leaf(_) | SyntaxKind::Unexpected => PieceKind::Leaf,
        };
        let (start, end) = (place.start, tree.opening_end(node));
        found.push(TextPiece { node, kind, start, end, is_kept: false });
    }
    close_before(tree, &mut open, usize::MAX, &mut found);
    let mut is_off = false;
    for piece in &mut found {
        let line = lines.line_of(piece.start);
        let was_off = is_off;
        if piece.kind == PieceKind::Comment
            && let Some(switched_off) = switch(tree, lines.range(line), piece)
        {
            is_off = switched_off;
        }
        piece.is_kept = was_off && is_off || !is_wanted(line);
    }
    found
}

/// Adds the ends of the lists that end before byte `start`.
fn close_before(tree: &SyntaxTree, open: &mut Vec<NodeId>, start: usize, found: &mut Vec<TextPiece>) {
    while let Some(list) = open.pop_if(|list| tree.range(*list).end <= start) {
        let end = tree.range(list).end;
        found.push(TextPiece { node: list, kind: PieceKind::Close, start: end - 1, end, is_kept: false });
    }
}

/// Whether a comment that has its line for itself switches formatting off or on.
fn switch(tree: &SyntaxTree, line: Range<usize>, comment: &TextPiece) -> Option<bool> {
    let before = &tree.source()[line.start..comment.start];
    let text = tree.source()[comment.start..comment.end].trim_start_matches(';').trim();
    let word = text.strip_prefix("format:").filter(|_| before.trim().is_empty())?;
    match word.trim() {
        "off" => Some(true),
        "on" => Some(false),
        _ => None,
    }
}
