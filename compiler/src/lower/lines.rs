//! Lines and columns of the sources that a module is compiled from.

use std::cell::Cell;
use std::sync::Arc;

use esl_bytecode::compile::Part;
use esl_bytecode::span::{SourceId, Span};

/// The texts of a compilation, to turn spans into lines. A span that lies in none of them has no line.
#[derive(Clone, Debug, Default)]
pub struct SourceLines {
    sources: Vec<SourceText>,
}

#[derive(Clone, Debug)]
struct SourceText {
    name: String,
    text: Arc<str>,
    /// Where the text begins in the source: its byte, its line from 0, and the characters before it there.
    first: (u32, u32, u32),
    /// Offsets at which lines begin.
    starts: Vec<u32>,
    /// The place that was asked for last, since questions come nearly in order and lines may be very long.
    last: Cell<LastPlace>,
}

#[derive(Clone, Copy, Debug, Default)]
struct LastPlace {
    line: usize,
    offset: usize,
    column: u32,
}

impl SourceLines {
    /// No sources.
    pub fn new() -> SourceLines {
        SourceLines::default()
    }

    /// Adds a source, which gets the next number.
    pub fn add(&mut self, name: &str, text: Arc<str>) -> SourceId {
        self.add_text(name, text, (0, 0, 0))
    }

    /// Adds a source of which there is only a part.
    pub fn add_part(&mut self, part: &Part<'_>) -> SourceId {
        let text = part.text[part.range.clone()].into();
        self.add_text(part.name, text, (part.range.start as u32, part.line, part.column))
    }

    fn add_text(&mut self, name: &str, text: Arc<str>, first: (u32, u32, u32)) -> SourceId {
        let breaks = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n');
        let starts = std::iter::once(0).chain(breaks.map(|(at, _)| at as u32 + 1)).collect();
        let id = SourceId(self.sources.len() as u32);
        self.sources.push(SourceText { name: name.to_string(), text, first, starts, last: Cell::default() });
        id
    }

    /// The names of the sources, in the order of their numbers.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|source| source.name.as_str())
    }

    /// Line and column, from 1, of the start of `span`; columns count characters.
    pub fn line_and_column(&self, span: Span) -> Option<(u32, u32)> {
        let source = self.sources.get(span.source.0 as usize)?;
        let (first_byte, first_line, first_column) = source.first;
        let offset = span.start.checked_sub(first_byte)? as usize;
        if offset > source.text.len() {
            return None;
        }
        let line = source.starts.partition_point(|&start| start as usize <= offset) - 1;
        let start = source.starts[line] as usize;
        let last = source.last.get();
        let (from, before) = if last.line == line && last.offset <= offset {
            (last.offset.max(start), last.column)
        } else {
            (start, 0)
        };
        let column = before + source.text.get(from..offset)?.chars().count() as u32;
        source.last.set(LastPlace { line, offset, column });
        Some((first_line + line as u32 + 1, if line == 0 { first_column } else { 0 } + column + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_counted_in_characters_and_in_any_order() {
        let mut lines = SourceLines::new();
        let id = lines.add("a.esl", "(é x)\n  (y)\n".into());
        let place = |at| lines.line_and_column(Span::new(id, at, at));
        assert_eq!(place(4), Some((1, 4)));
        assert_eq!(place(9), Some((2, 3)));
        assert_eq!(place(10), Some((2, 4)));
        assert_eq!(place(7), Some((2, 1)));
        assert_eq!(place(0), Some((1, 1)));
        assert_eq!(place(100), None);
        assert_eq!(lines.line_and_column(Span::new(SourceId(1), 0, 0)), None);
    }

    #[test]
    fn a_part_knows_where_it_begins() {
        let mut lines = SourceLines::new();
        let text: Arc<str> = "(a)\n\n(b)\n(c)\n1234567 (x\n y) (z)".into();
        let part = Part { name: "a.esl", text: &text, range: 20..27, line: 4, column: 7 };
        assert_eq!(&text[part.range.clone()], " (x\n y)");
        let id = lines.add_part(&part);
        let place = |at| lines.line_and_column(Span::new(id, at, at));
        assert_eq!(place(21), Some((5, 9)));
        assert_eq!(place(25), Some((6, 2)));
        assert_eq!(place(19), None);
    }
}
