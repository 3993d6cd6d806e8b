//! The texts of a compilation, for drawing diagnostics.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use esl_bytecode::compile::{LineIndex, Part, Place, SourcePlace};
use esl_bytecode::span::{SourceId, Span};

#[derive(Clone, Debug)]
struct KnownSource {
    name: String,
    text: Option<Arc<str>>,
    /// Part of the text that is compiled, and the line in which it begins.
    part: (Range<usize>, u32),
    /// Computed on demand, since most texts have no diagnostics.
    lines: OnceLock<LineIndex>,
}

/// The sources of a compilation, in the order of their numbers.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    sources: Vec<KnownSource>,
}

impl Sources {
    /// Creates an empty list.
    pub fn new() -> Sources {
        Sources::default()
    }

    /// Adds a source and returns its number, the next one. Diagnostics of a source without a text have no
    /// excerpts.
    pub fn add(&mut self, name: impl Into<String>, text: Option<Arc<str>>) -> SourceId {
        let length = text.as_ref().map_or(0, |text| text.len());
        self.add_source(name.into(), text, (0..length, 0))
    }

    /// Adds a source of which only a part is compiled.
    pub fn add_part(&mut self, part: &Part<'_>) -> SourceId {
        self.add_source(part.name.into(), Some(part.text.clone()), (part.range.clone(), part.line))
    }

    fn add_source(&mut self, name: String, text: Option<Arc<str>>, part: (Range<usize>, u32)) -> SourceId {
        let id = SourceId(u32::try_from(self.sources.len()).expect("fewer than 2^32 sources"));
        self.sources.push(KnownSource { name, text, part, lines: OnceLock::new() });
        id
    }

    /// Returns the name of a source.
    pub fn name(&self, id: SourceId) -> Option<&str> {
        self.get(id).map(|source| source.name.as_str())
    }

    /// Returns the names of all sources, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|source| source.name.as_str())
    }

    /// Returns the text of a source, if it is known.
    pub fn text(&self, id: SourceId) -> Option<&Arc<str>> {
        self.get(id)?.text.as_ref()
    }

    /// Returns the line and column at which `span` begins; `None` without a text, or outside of it.
    pub fn place(&self, span: Span) -> Option<Place> {
        let source = self.get(span.source)?;
        let text = source.text.as_ref()?;
        let (part, line) = &source.part;
        let start = span.start as usize;
        if start > text.len() || !text.is_char_boundary(start) {
            return None;
        }
        if !(part.start..=part.end).contains(&start) {
            return Some(LineIndex::new(text).place(text, span));
        }
        let lines = || LineIndex::of_part(text, part.clone(), *line);
        Some(source.lines.get_or_init(lines).place(text, span))
    }

    /// Returns the source that a place names, and the byte of the place in its text; `None` if the text is
    /// unknown or does not contain the place.
    pub fn offset_of(&self, place: &SourcePlace) -> Option<(SourceId, usize)> {
        let is_named = |source: &KnownSource| source.name == place.source && source.text.is_some();
        let index = self.sources.iter().rposition(is_named)?;
        let text = self.sources[index].text.as_ref()?;
        let (line, column) = (place.line.checked_sub(1)? as usize, place.column.checked_sub(1)? as usize);
        let line_start = match line {
            0 => 0,
            _ => text.match_indices('\n').nth(line - 1)?.0 + 1,
        };
        let (offset, _) = text[line_start..].char_indices().nth(column)?;
        Some((SourceId(index as u32), line_start + offset))
    }

    /// Returns the line and column of the position after `span`.
    pub(super) fn end_place(&self, span: Span) -> Option<Place> {
        self.place(Span::new(span.source, span.end, span.end))
    }

    fn get(&self, id: SourceId) -> Option<&KnownSource> {
        self.sources.get(id.0 as usize)
    }
}
