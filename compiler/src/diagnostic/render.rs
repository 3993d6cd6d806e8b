//! Diagnostics as text: the only place that draws carets.
//!
//! The look is that of rustc, drawn by `annotate-snippets`, which no other file uses.

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer as Carets, Snippet};

use esl_bytecode::diagnostic::{Diagnostic, Label, Severity};

use super::excerpt::{Excerpt, excerpts};
use super::json;
use super::source::Sources;

/// Format of drawn diagnostics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// For people: message, excerpt, carets, help.
    #[default]
    Human,
    /// For tools: one JSON object on one line.
    Json,
}

/// Draws diagnostics.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Renderer {
    /// Whether to use the colours of a terminal, in the format for people.
    pub color: bool,
    /// Format.
    pub format: Format,
}

impl Renderer {
    /// Returns the text for `diagnostic`, without a newline at its end.
    ///
    /// ```
    /// use esl_compiler::diagnostic::{Renderer, Sources, code};
    /// use esl_bytecode::span::Span;
    ///
    /// let mut sources = Sources::new();
    /// let source = sources.add("sum.esl", Some("(+ 1 2))".into()));
    /// let span = Span::new(source, 7, 8);
    /// let diagnostic = code::UNEXPECTED_CLOSE.at(span, "unexpected `)`: no list is open");
    /// let text = Renderer::default().render(&diagnostic, &sources);
    /// assert_eq!(text.lines().next(), Some("error[unexpected-close]: unexpected `)`: no list is open"));
    /// assert_eq!(text.lines().nth(1), Some(" --> sum.esl:1:8"));
    /// ```
    pub fn render(&self, diagnostic: &Diagnostic, sources: &Sources) -> String {
        match self.format {
            Format::Human => self.human(diagnostic, sources),
            Format::Json => json::object(diagnostic, sources),
        }
    }

    fn human(&self, diagnostic: &Diagnostic, sources: &Sources) -> String {
        let level = match diagnostic.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let excerpts = excerpts(&diagnostic.primary, &diagnostic.secondary, sources);
        let mut group =
            Group::with_title(level.primary_title(visible(&diagnostic.message)).id(diagnostic.code));
        let source = diagnostic.primary.span.source;
        if let (Some(name), None) = (sources.name(source), sources.text(source)) {
            group = group.element(Origin::path(position(&diagnostic.primary, name)));
        }
        for excerpt in &excerpts {
            group = group.element(snippet(excerpt, sources));
        }
        if let Some(help) = &diagnostic.help {
            group = group.element(Level::HELP.message(visible(help)));
        }
        let renderer = if self.color { Carets::styled() } else { Carets::plain() };
        let mut text = renderer.render(&[group]);
        for excerpt in &excerpts {
            // The library counts columns in the excerpt. If a long line was cut, replace that by the column
            // in the source.
            if let Some((line, shown, column)) = excerpt.cut {
                let name = sources.name(excerpt.source).unwrap_or_default();
                text =
                    text.replacen(&format!("{name}:{line}:{shown}"), &format!("{name}:{line}:{column}"), 1);
            }
        }
        text
    }
}

fn snippet<'a>(
    excerpt: &'a Excerpt<'_>,
    sources: &'a Sources,
) -> Snippet<'a, annotate_snippets::Annotation<'a>> {
    let annotations = excerpt.marks.iter().map(|mark| {
        let kind = if mark.is_primary { AnnotationKind::Primary } else { AnnotationKind::Context };
        let annotation = kind.span(mark.range.clone());
        if mark.text.is_empty() { annotation } else { annotation.label(visible(mark.text)) }
    });
    Snippet::source(excerpt.text.as_str())
        .line_start(excerpt.line as usize)
        .path(sources.name(excerpt.source))
        .annotations(annotations)
}

/// Returns the position of a label whose text is unknown.
fn position(label: &Label, name: &str) -> String {
    format!("{name}, byte {}", label.span.start)
}

/// Returns a message without characters that break the line or steer the terminal: it may quote the source.
fn visible(text: &str) -> String {
    let hidden = |c: char| {
        c.is_control()
            || matches!(c, '\u{200b}'..='\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}')
    };
    text.chars().map(|c| if hidden(c) { '\u{fffd}' } else { c }).collect()
}
