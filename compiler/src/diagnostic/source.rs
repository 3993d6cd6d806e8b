//! The texts of a compilation, for drawing diagnostics.

use std::sync::{Arc, OnceLock};

use esl_bytecode::compile::{LineIndex, Place};
use esl_bytecode::span::{SourceId, Span};

#[derive(Clone, Debug)]
struct Source {
    name: String,
    text: Option<Arc<str>>,
    /// Made when it is first asked for: most texts have no diagnostics.
    lines: OnceLock<LineIndex>,
}

/// The sources of a compilation, in the order of their numbers.
#[derive(Clone, Debug, Default)]
pub struct Sources {
    sources: Vec<Source>,
}

impl Sources {
    /// No sources.
    pub fn new() -> Sources {
        Sources::default()
    }

    /// Adds a source and gives its number, the next one. Without a text, its diagnostics are shown without excerpts.
    pub fn add(&mut self, name: impl Into<String>, text: Option<Arc<str>>) -> SourceId {
        let id = SourceId(u32::try_from(self.sources.len()).expect("fewer than 2^32 sources"));
        self.sources.push(Source { name: name.into(), text, lines: OnceLock::new() });
        id
    }

    /// The name that `id` was added with.
    pub fn name(&self, id: SourceId) -> Option<&str> {
        self.get(id).map(|source| source.name.as_str())
    }

    /// The text of `id`, if it is known.
    pub fn text(&self, id: SourceId) -> Option<&Arc<str>> {
        self.get(id)?.text.as_ref()
    }

    /// Line and column at which `span` begins; `None` without a text, or outside of it.
    pub fn place(&self, span: Span) -> Option<Place> {
        let source = self.get(span.source)?;
        let text = source.text.as_ref()?;
        let inside = text.is_char_boundary(span.start as usize);
        inside.then(|| source.lines.get_or_init(|| LineIndex::new(text)).place(text, span))
    }

    /// Line and column of the position after `span`.
    pub(super) fn end_place(&self, span: Span) -> Option<Place> {
        self.place(Span::new(span.source, span.end, span.end))
    }

    fn get(&self, id: SourceId) -> Option<&Source> {
        self.sources.get(id.0 as usize)
    }
}
