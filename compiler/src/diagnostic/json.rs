//! Diagnostics as JSON: one object on one line, for editors and other tools.
//!
//! Lines count from 1, columns in characters from 1, offsets in bytes from 0. An end is the position after
//! the last character. Line and column are null if the text is unknown.

use std::fmt::Write;

use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;

use super::source::Sources;

/// Returns the object for `diagnostic`, without a newline at its end.
pub(super) fn object(diagnostic: &Diagnostic, sources: &Sources) -> String {
    let mut out = String::from("{\"code\":");
    string(&mut out, diagnostic.code);
    out.push_str(match diagnostic.severity {
        Severity::Error => ",\"severity\":\"error\"",
        Severity::Warning => ",\"severity\":\"warning\"",
    });
    out.push_str(",\"message\":");
    string(&mut out, &diagnostic.message);
    range(&mut out, diagnostic.primary.span, sources);
    out.push_str(",\"label\":");
    string(&mut out, &diagnostic.primary.text);
    out.push_str(",\"labels\":[");
    for (i, label) in diagnostic.secondary.iter().enumerate() {
        out.push_str(if i > 0 { ",{\"message\":" } else { "{\"message\":" });
        string(&mut out, &label.text);
        range(&mut out, label.span, sources);
        out.push('}');
    }
    out.push_str("],\"help\":");
    match &diagnostic.help {
        Some(help) => string(&mut out, help),
        None => out.push_str("null"),
    }
    out.push('}');
    out
}

fn range(out: &mut String, span: Span, sources: &Sources) {
    out.push_str(",\"file\":");
    match sources.name(span.source) {
        Some(name) => string(out, name),
        None => out.push_str("null"),
    }
    let (start, end) = (sources.place(span), sources.end_place(span));
    number(out, "line", start.as_ref().map(|place| place.line));
    number(out, "column", start.as_ref().map(|place| place.column));
    number(out, "end_line", end.as_ref().map(|place| place.line));
    number(out, "end_column", end.as_ref().map(|place| place.column));
    number(out, "offset", Some(span.start));
    number(out, "end_offset", Some(span.end));
}

fn number(out: &mut String, key: &str, value: Option<u32>) {
    // Writing to a string cannot fail.
    let _ = match value {
        Some(value) => write!(out, ",\"{key}\":{value}"),
        None => write!(out, ",\"{key}\":null"),
    };
}

fn string(out: &mut String, text: &str) {
    out.push('"');
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c < ' ' || c == '\u{7f}' => {
                let _ = write!(out, "\\u{:04x}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
}
