//! Edits by which formatting changes a text: blanks between tokens and comments.

use std::ops::Range;

use esl_compiler::reader::lexer::Token;
use esl_syntax::SyntaxKind;

use super::layout::{Layout, LayoutExtent, Lead};
use super::pieces::{PieceKind, TextPiece};

/// A part of a text, and what stands there instead.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edit {
    /// Place of the part, in bytes.
    pub place: Range<usize>,
    /// The replacement.
    pub new: String,
}

impl Edit {
    /// Returns a text with edits made that are in the order of their places and do not overlap.
    pub fn apply(text: &str, edits: &[Edit]) -> String {
        let mut out = String::with_capacity(text.len() + text.len() / 16);
        let mut at = 0;
        for edit in edits {
            out.push_str(&text[at..edit.place.start]);
            out.push_str(&edit.new);
            at = edit.place.end;
        }
        out.push_str(&text[at..]);
        out
    }
}

impl Layout<'_> {
    /// Returns what changes: blanks between pieces.
    pub(super) fn edits(&self, is_last_line_wanted: bool) -> Vec<Edit> {
        let source = self.tree.source();
        // Lines end as they did, and new ones as the first one.
        let is_crlf = source.find('\n').is_some_and(|at| source[..at].ends_with('\r'));
        let newline = |gap: &str| {
            let is_crlf = if gap.contains('\n') { gap.contains("\r\n") } else { is_crlf };
            if is_crlf { "\r\n" } else { "\n" }
        };
        let mut edits = Vec::new();
        let mut replace = |gap: &str, end: usize, new: String| {
            if gap != new {
                edits.push(Edit { place: end - gap.len()..end, new });
            }
        };
        for (at, piece) in self.pieces.iter().enumerate() {
            let gap = self.gap(at);
            match self.placed[at].lead {
                Lead::AsIs => {}
                Lead::Blanks(count) => replace(gap, piece.start, " ".repeat(count)),
                Lead::Lines(count, column) => {
                    replace(gap, piece.start, newline(gap).repeat(count) + &" ".repeat(column));
                }
            }
        }
        let gap = self.gap(self.pieces.len());
        let is_kept = !is_last_line_wanted
            || gap.contains('\u{c}')
            || self.pieces.last().is_some_and(|last| last.is_kept || self.is_open_end(last));
        if !is_kept {
            let count = match (self.extent, self.pieces.is_empty()) {
                (LayoutExtent::All, is_empty) => usize::from(!is_empty),
                (LayoutExtent::Indentation, true) => gap.matches('\n').count(),
                (LayoutExtent::Indentation, false) => gap.matches('\n').count().max(1),
            };
            replace(gap, source.len(), newline(gap).repeat(count));
        }
        edits
    }

    /// Whether a newline behind the last piece would become a part of it: it has no end.
    fn is_open_end(&self, last: &TextPiece) -> bool {
        match last.kind {
            PieceKind::Leaf => self.tree.kind(last.node) == SyntaxKind::Leaf(Token::Unfinished),
            PieceKind::BlockComment => !self.tree.text(last.node).ends_with("|#"),
            _ => false,
        }
    }
}
