//! The columns of comments behind code: what stood under each other stays so.

use super::layout::{Layout, Lead};
use super::pieces::PieceKind;

/// A comment behind code, or one that goes on with the comment on the line before.
struct SideComment {
    piece: usize,
    /// Line and column in the text.
    old: (usize, usize),
    /// Line of the layout.
    line: usize,
    /// Blanks before it in the text, and column of the end of the code in the layout; `None` if it has the
    /// line for itself.
    behind: Option<(usize, usize)>,
}

/// Moves comments that stood in one column of successive lines into one column again, as far from the code as
/// the closest of them was.
pub(super) fn align_comments(layout: &mut Layout<'_>) {
    let mut group: Vec<SideComment> = Vec::new();
    for at in 0..layout.pieces.len() {
        let piece = layout.pieces[at];
        if piece.kind != PieceKind::Comment {
            continue;
        }
        let placed = layout.placed[at];
        let behind = match (placed.lead, at.checked_sub(1)) {
            (Lead::Blanks(_), Some(before)) => {
                Some((layout.gap(at).chars().count().max(1), layout.placed[before].end.1))
            }
            (Lead::Lines(..), _) if layout.follows[at] => None,
            _ => continue,
        };
        let old = (layout.lines.line_of(piece.start), layout.old_column(piece.start));
        let next = SideComment { piece: at, old, line: placed.start.0, behind };
        let goes_on = group.last().is_some_and(|last| {
            last.old.0 + 1 == next.old.0 && last.old.1 == next.old.1 && last.line + 1 == next.line
        });
        if !goes_on {
            align(layout, &group);
            group.clear();
        }
        group.push(next);
    }
    align(layout, &group);
}

fn align(layout: &mut Layout<'_>, group: &[SideComment]) {
    let behind = || group.iter().filter_map(|comment| comment.behind);
    let (Some(blanks), Some(end)) =
        (behind().map(|(blanks, _)| blanks).min(), behind().map(|(_, end)| end).max())
    else {
        return;
    };
    let column = end + blanks;
    for comment in group {
        layout.placed[comment.piece].lead = match (comment.behind, layout.placed[comment.piece].lead) {
            (Some((_, end)), _) => Lead::Blanks(column - end),
            (None, Lead::Lines(newlines, _)) => Lead::Lines(newlines, column),
            (None, lead) => lead,
        };
    }
}
