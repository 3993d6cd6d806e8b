//! The table as text for people, and as JSON, CSV, Markdown and HTML.

mod flat;
mod fmea;
mod graph;
mod injected;
mod json;
mod notes;
mod text;

use crate::row::FailureTable;

pub use flat::markdown_cell;
pub use injected::{InjectedError, InjectedOutcomes};
pub use notes::{EarlierNotes, NotesError};

/// Form of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Text for people.
    Text,
    /// One object.
    Json,
    /// A line for each failure of an item.
    Csv,
    /// Tables of Markdown.
    Markdown,
    /// A page.
    Html,
}

/// Returns the table in a form.
pub fn render(table: &FailureTable, format: TableFormat) -> String {
    match format {
        TableFormat::Text => text::render(table),
        TableFormat::Json => json::render(table),
        TableFormat::Csv => flat::csv(&flat::rows(table)),
        TableFormat::Markdown => flat::markdown(&flat::rows(table)),
        TableFormat::Html => flat::html("Possible failures", &flat::rows(table)),
    }
}

/// Returns the program as a picture in SVG: sources of failures, clauses that take them, and tasks.
pub fn render_graph(table: &FailureTable, title: &str) -> String {
    graph::render(table, title)
}

/// Returns the failure modes and effects of a program as a table; as text, that is Markdown. The severities
/// and notes of `earlier` are carried over; `seen` has the outcomes of runs with injected faults, which are
/// the end effects then.
pub fn render_fmea(
    table: &FailureTable,
    format: TableFormat,
    earlier: EarlierNotes,
    seen: InjectedOutcomes,
) -> String {
    let lines = fmea::lines(table, earlier, seen);
    match format {
        TableFormat::Csv => flat::csv(&lines),
        TableFormat::Html => flat::html("Failure modes and effects", &lines),
        TableFormat::Json => json::lines(&lines),
        TableFormat::Text | TableFormat::Markdown => flat::markdown(&lines),
    }
}
