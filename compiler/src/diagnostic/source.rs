//! The texts of a compilation, for drawing diagnostics.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use esl_bytecode::compile::{LineIndex, Part, Place};
use esl_bytecode::span::{SourceId, Span};

#[derive(Clone, Debug)]
struct Source {
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
    sources: Vec<Source>,
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
        self.sources.push(Source { name, text, part, lines: OnceLock::new() });
        id
    }

    /// Returns the name of a source.
    pub fn name(&self, id: SourceId) -> Option<&str> {
        self.get(id).map(|source| source.name.as_str())
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
        let inside = (part.start..=part.end).contains(&start) && text.is_char_boundary(start);
        let lines = || LineIndex::of_part(text, part.clone(), *line);
        inside.then(|| source.lines.get_or_init(lines).place(text, span))
    }

    /// Returns the line and column of the position after `span`.
    pub(super) fn end_place(&self, span: Span) -> Option<Place> {
        self.place(Span::new(span.source, span.end, span.end))
    }

    fn get(&self, id: SourceId) -> Option<&Source> {
        self.sources.get(id.0 as usize)
    }
}
