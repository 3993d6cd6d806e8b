//! The part of a source that a diagnostic shows.
//!
//! A text may have a million lines, and a line a million characters. So an excerpt holds the lines with
//! labels and those between them, unless they are far apart; and of a very long line, the neighbourhood of
//! its labels.

use std::ops::Range;

use esl_bytecode::diagnostic::Label;
use esl_bytecode::span::{SourceId, Span};

use super::source::Sources;

/// Lines between labels that share an excerpt, at most.
const MAX_GAP: u32 = 50;
/// Lines of a label that is shown in full. A longer one is shown at its first line only.
const MAX_LABEL_LINES: usize = 8;
/// Bytes of a line that is shown in full.
const MAX_LINE: usize = 1000;
/// Bytes of a cut line that are kept on either side of the label.
const CUT_CONTEXT: usize = 60;
/// Bytes of a label that are kept in a cut line.
const CUT_LABEL: usize = 120;

/// A label within an excerpt.
#[derive(Debug)]
pub(super) struct Mark<'a> {
    /// Range in the text of the excerpt.
    pub(super) range: Range<usize>,
    pub(super) text: &'a str,
    pub(super) is_primary: bool,
}

/// Consecutive lines of a source.
#[derive(Debug)]
pub(super) struct Excerpt<'a> {
    pub(super) source: SourceId,
    pub(super) text: String,
    /// Number of the first line, from 1.
    pub(super) line: u32,
    pub(super) marks: Vec<Mark<'a>>,
    /// Column of the first mark, if its line is cut: `(line, column in the excerpt, column in the source)`.
    pub(super) cut: Option<(u32, u32, u32)>,
}

/// A label with its place in the text.
struct PlacedMark<'a> {
    start: usize,
    end: usize,
    first_line: u32,
    last_line: u32,
    label: &'a Label,
    is_primary: bool,
}

/// Returns excerpts for the labels whose source has a text. The one with the primary label comes first.
pub(super) fn excerpts<'a>(
    primary: &'a Label,
    secondary: &'a [Label],
    sources: &Sources,
) -> Vec<Excerpt<'a>> {
    let labels = std::iter::once((primary, true)).chain(secondary.iter().map(|label| (label, false)));
    let mut placed: Vec<PlacedMark<'_>> =
        labels.filter_map(|(label, is_primary)| place(label, is_primary, sources)).collect();
    placed.sort_by_key(|placed| (placed.label.span.source, placed.start));
    let mut excerpts: Vec<Excerpt<'a>> = placed
        .chunk_by(|a, b| {
            a.label.span.source == b.label.span.source && b.first_line <= a.last_line.saturating_add(MAX_GAP)
        })
        .map(|group| excerpt(group, sources))
        .collect();
    excerpts.sort_by_key(|excerpt| !excerpt.marks.iter().any(|mark| mark.is_primary));
    excerpts
}

/// Fits a label into its text: moves its ends to character boundaries, and reduces many lines to the first.
fn place<'a>(label: &'a Label, is_primary: bool, sources: &Sources) -> Option<PlacedMark<'a>> {
    let text = sources.text(label.span.source)?;
    let start = text.floor_char_boundary(label.span.start as usize);
    let mut end = text.ceil_char_boundary(label.span.end as usize).max(start);
    let mut lines = text[start..end].match_indices('\n');
    if let (Some((line_end, _)), Some(_)) = (lines.next(), lines.nth(MAX_LABEL_LINES)) {
        end = start + line_end;
    }
    let line =
        |at: usize| sources.place(Span::new(label.span.source, at as u32, at as u32)).map(|place| place.line);
    Some(PlacedMark { start, end, first_line: line(start)?, last_line: line(end)?, label, is_primary })
}

fn excerpt<'a>(group: &[PlacedMark<'a>], sources: &Sources) -> Excerpt<'a> {
    let source = group[0].label.span.source;
    let text = sources.text(source).expect("labels have a text");
    let end = group.iter().map(|placed| placed.end).max().unwrap_or(0);
    let lines_start = text[..group[0].start].rfind('\n').map_or(0, |at| at + 1);
    let lines_end = text[end..].find('\n').map_or(text.len(), |at| end + at);
    let mut shown = String::new();
    // For each piece of the source that is shown: its range in the source, and its start in `shown`.
    let mut pieces: Vec<(Range<usize>, usize)> = Vec::new();
    let mut line_start = lines_start;
    for line in text[lines_start..lines_end].split_inclusive('\n') {
        let range = line_start..line_start + line.len();
        let kept = if line.len() > MAX_LINE { cut(text, &range, group) } else { range.clone() };
        if kept.start > range.start {
            shown.push('…');
        }
        pieces.push((kept.clone(), shown.len()));
        shown.push_str(&text[kept.clone()]);
        if kept.end < range.end {
            shown.push_str(if line.ends_with('\n') { "…\n" } else { "…" });
        }
        line_start = range.end;
    }
    let position = |at: usize| {
        let piece = pieces.partition_point(|(range, _)| range.start <= at).saturating_sub(1);
        pieces.get(piece).map_or(0, |(range, start)| start + at.clamp(range.start, range.end) - range.start)
    };
    let marks: Vec<Mark<'a>> = group
        .iter()
        .map(|placed| Mark {
            range: position(placed.start)..position(placed.end),
            text: &placed.label.text,
            is_primary: placed.is_primary,
        })
        .collect();
    let first = group.iter().position(|placed| placed.is_primary).unwrap_or(0);
    let column = |text: &str, at: usize| {
        let line = text[..at].rfind('\n').map_or(0, |at| at + 1);
        text[line..at].chars().count() as u32 + 1
    };
    let shown_column = column(&shown, marks[first].range.start);
    let true_column = column(text, group[first].start);
    Excerpt {
        source,
        line: group[0].first_line,
        marks,
        cut: (shown_column != true_column).then_some((group[first].first_line, shown_column, true_column)),
        text: shown,
    }
}

/// Returns the part of a long line to keep: the neighbourhood of its first label, or its beginning.
fn cut(text: &str, line: &Range<usize>, group: &[PlacedMark<'_>]) -> Range<usize> {
    let label = group.iter().find(|placed| placed.start < line.end && placed.end >= line.start);
    let (start, end) = label.map_or((line.start, line.start), |placed| {
        let start = placed.start.max(line.start);
        (start, placed.end.clamp(start, start + CUT_LABEL))
    });
    let keep_start = text.floor_char_boundary(start.saturating_sub(CUT_CONTEXT).max(line.start));
    let keep_end = text.ceil_char_boundary((end + CUT_CONTEXT).min(line.end));
    keep_start..keep_end.min(line.end)
}
