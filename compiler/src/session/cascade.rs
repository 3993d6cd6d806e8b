//! Findings that follow from a foreign form: they are taken away, so that the form has one message.
//!
//! Besides the foreign forms that the expander reports, names that stand right before parentheses are found
//! here, since only the text shows that no blank is between them.

use esl_bytecode::diagnostic::{Diagnostic, Severity};
use esl_bytecode::span::Span;

use crate::diagnostic::{Sources, code};
use crate::habit::operator;
use crate::habit::statement::{COMMENT_HELP, comment_message};
use crate::reader::datum_end;

/// Takes away the findings inside of `foreign` forms, but for those about the forms themselves; `sources`
/// has the texts.
pub(super) fn without_consequences(
    diagnostics: Vec<Diagnostic>,
    mut foreign: Vec<Span>,
    sources: &Sources,
) -> Vec<Diagnostic> {
    let mut reports = Vec::new();
    for diagnostic in &diagnostics {
        if let Some((report, extent)) = from_text(diagnostic, sources) {
            foreign.push(extent);
            reports.push(report);
        }
    }
    if foreign.is_empty() {
        return diagnostics;
    }
    let is_report = |diagnostic: &Diagnostic, extent: Span| {
        let is_foreign = [code::FOREIGN_WORD.name, code::FOREIGN_FORM.name].contains(&diagnostic.code);
        // The report about a form is at its beginning.
        is_foreign && diagnostic.primary.span.start <= extent.start + 1
    };
    let outermost =
        |extent: &&Span| !foreign.iter().any(|other| other != *extent && other.contains(**extent));
    let outermost: Vec<Span> = foreign.iter().filter(outermost).copied().collect();
    // A variable that only a foreign form mentions counts as unused, since nothing reads it there.
    let is_mentioned = |diagnostic: &Diagnostic| {
        let used = diagnostic.primary.span;
        let (Some(name), Some(text)) = (diagnostic.message.split('`').nth(1), sources.text(used.source))
        else {
            return false;
        };
        diagnostic.code == code::UNUSED_VARIABLE.name
            && outermost.iter().any(|extent| {
                let part = |start: u32, end: u32| text.get(start as usize..end as usize).unwrap_or_default();
                extent.source == used.source
                    && used.start < extent.start
                    && !part(used.start, extent.start).contains("\n(")
                    && part(extent.start, extent.end).to_lowercase().contains(name)
            })
    };
    let mut lost_errors: Vec<Span> = Vec::new();
    let mut kept: Vec<Diagnostic> = Vec::new();
    for diagnostic in diagnostics {
        if is_mentioned(&diagnostic) {
            continue;
        }
        let span = diagnostic.primary.span;
        match outermost.iter().find(|extent| extent.contains(span) && !is_report(&diagnostic, **extent)) {
            Some(extent) if diagnostic.severity == Severity::Error => lost_errors.push(*extent),
            Some(_) => {}
            None => kept.push(diagnostic),
        }
    }
    kept.extend(reports.into_iter().filter(|report| {
        let span = report.primary.span;
        !outermost.iter().any(|extent| extent.contains(span) && extent.start < span.start)
    }));
    // Text that cannot be compiled must not become a program.
    for diagnostic in &mut kept {
        let is_lost = lost_errors.iter().any(|extent| is_report(diagnostic, *extent));
        if is_lost && diagnostic.severity == Severity::Warning {
            let error =
                code::FOREIGN_FORM.at(diagnostic.primary.span, std::mem::take(&mut diagnostic.message));
            (diagnostic.code, diagnostic.severity, diagnostic.message) =
                (error.code, error.severity, error.message);
        }
    }
    kept.dedup();
    kept
}

/// Returns the report about a name right before parentheses, or a comment, that a finding follows from; and
/// the part of the text that it is about.
fn from_text(diagnostic: &Diagnostic, sources: &Sources) -> Option<(Diagnostic, Span)> {
    let names =
        [code::UNDEFINED_VARIABLE, code::UNDEFINED_FUNCTION, code::NOT_AN_OPERATOR, code::FOREIGN_WORD];
    if !names.iter().any(|code| code.name == diagnostic.code) {
        return None;
    }
    let span = diagnostic.primary.span;
    let text = sources.text(span.source)?;
    let (start, end) = (span.start as usize, span.end as usize);
    let before = text.get(..start)?;
    let line = &before[before.rfind('\n').map_or(0, |at| at + 1)..];
    if let Some(at) = comment(line, text.get(start..end)?) {
        let start = start - line.len() + at;
        let end = text[start..].find('\n').map_or(text.len(), |length| start + length);
        let span = Span::new(span.source, start as u32, end as u32);
        return Some((code::FOREIGN_FORM.at(span, comment_message("//")).help(COMMENT_HELP), span));
    }
    let is_part = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '-' | '!' | '?' | '*');
    let is_value =
        [code::UNDEFINED_VARIABLE, code::FOREIGN_WORD].iter().any(|code| code.name == diagnostic.code);
    let (name_start, list_start) = if is_value {
        if !text.get(end..)?.starts_with('(') || !text[start..end].chars().all(is_part) {
            return None;
        }
        (start, end)
    } else if diagnostic.code != code::NOT_AN_OPERATOR.name {
        return None;
    } else {
        // The first part of a list whose `(` follows a name.
        let list = before.strip_suffix('(')?;
        let name =
            list.len() - list.chars().rev().take_while(|&c| is_part(c)).map(char::len_utf8).sum::<usize>();
        // `(if(test) …)` and `'a(b)` are as good as with a blank.
        if name == list.len() || list[..name].ends_with(['(', '\'', '`', ',', '@', '"', '#', ':']) {
            return None;
        }
        (name, list.len())
    };
    let list_end = datum_end(text, list_start)?;
    let name = &text[name_start..list_start];
    let inside = text.get(list_start + 1..list_end - 1)?;
    let span = Span::new(span.source, name_start as u32, list_end as u32);
    let message = format!("a call begins with its parenthesis, not with `{name}(`");
    let written = operator::call(name, inside);
    Some((code::FOREIGN_FORM.at(span, message).help(format!("write `{written}`")), span))
}

/// Returns where in a line that ends before the name `found` a comment begins, as in C: `// text`.
fn comment(line: &str, found: &str) -> Option<usize> {
    if found == "//" {
        return Some(line.len());
    }
    let at = line.find("// ")?;
    let is_apart = at == 0 || line[..at].ends_with([' ', '\t', '(', ')']);
    (is_apart && line[..at].matches('"').count().is_multiple_of(2)).then_some(at)
}
