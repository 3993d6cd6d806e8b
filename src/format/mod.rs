//! Formatting: the indentation that Lisp programmers expect.
//!
//! Lines keep their breaks. Each line that does not begin inside a string or a block comment is indented by
//! the list around its first token: arguments under the first one, bodies two columns in, distinguished
//! arguments four. Blanks at the ends of lines go. What the reader reads stays the same, as do all comments,
//! and formatting again changes nothing. What stands between the comments `; format: off` and `; format: on`
//! stays as it was laid out by hand. The rules are those of Emacs (`lisp-indent-function`,
//! `common-lisp-indent-function`), with the lambda lists of macros in place of most of its table.
//!
//! ```
//! use esl::format::{Styles, format};
//! use esl::syntax::SyntaxTree;
//!
//! let tree = SyntaxTree::new("(when ready\n(go-on\n 'home))");
//! assert_eq!(format(&tree, &Styles::standard(), None), "(when ready\n  (go-on\n   'home))\n");
//! ```

#[cfg(feature = "cli")]
mod command;
mod indent;
mod style;

use std::ops::RangeInclusive;

use crate::syntax::{LineStarts, SyntaxKind, SyntaxTree};

#[cfg(feature = "cli")]
pub use command::{FormatOptions, format_files};
#[cfg(feature = "cli")]
pub(crate) use command::{required, styles_of};
pub use style::Styles;

use indent::Indenter;

/// Returns the text of a tree with its lines indented: all of them, or those with these numbers, counted
/// from 0. All but these stay as they are.
pub fn format(tree: &SyntaxTree, styles: &Styles, lines: Option<RangeInclusive<usize>>) -> String {
    let text = tree.source();
    let starts = LineStarts::new(text);
    let fixed = FixedLines::new(tree, &starts);
    let mut indenter = Indenter::new(tree, styles, &starts);
    let mut out = String::with_capacity(text.len());
    let is_wanted = |line: usize| lines.as_ref().is_none_or(|lines| lines.contains(&line));
    let mut is_off = false;
    for line in 0..starts.count() {
        let place = starts.range(line);
        let is_inside = fixed.begins_inside[line];
        let was_off = is_off;
        if !is_inside && let Some(switched_off) = switch(&text[place.clone()]) {
            is_off = switched_off;
        }
        if !is_wanted(line) || (was_off && is_off) || (is_inside && fixed.kept_up_to[line] >= place.end) {
            out.push_str(&text[place]);
            continue;
        }
        let mark = if line == 0 && text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
        out.push_str(&text[place.start..place.start + mark]);
        let content = place.start + mark;
        let all = text[content..place.end].trim_end_matches('\n');
        let newline = &text[content + all.len()..place.end];
        let bare = all.trim_end_matches('\r');
        let newline = if newline.is_empty() { String::new() } else { all[bare.len()..].to_owned() + newline };
        let end = (content + bare.trim_end_matches([' ', '\t']).len()).max(fixed.kept_up_to[line]);
        let end = end.min(place.end);
        // The token that ends the line may reach over the newline.
        let newline = if end > content + bare.len() { String::new() } else { newline };
        if is_inside {
            out.push_str(&text[content..end]);
        } else {
            let blanks = all.len() - all.trim_start_matches([' ', '\t']).len();
            let start = (content + blanks).min(end.max(content));
            if start < end {
                let columns = indenter.indent(line, start, blanks);
                out.extend(std::iter::repeat_n(' ', columns));
                out.push_str(&text[start..end]);
            }
        }
        out.push_str(&newline);
    }
    let is_last_wanted = is_wanted(starts.count() - 1);
    if is_last_wanted && !out.is_empty() && !out.ends_with('\n') && tree_ends(tree) {
        out.push('\n');
    }
    out
}

/// Whether a line switches formatting off or on: `; format: off`, `; format: on`.
fn switch(line: &str) -> Option<bool> {
    let comment = line.trim().strip_prefix(';')?.trim_start_matches(';').trim();
    match comment.strip_prefix("format:")?.trim() {
        "off" => Some(true),
        "on" => Some(false),
        _ => None,
    }
}

/// Whether text can be added at the end without becoming part of a token.
fn tree_ends(tree: &SyntaxTree) -> bool {
    use esl_compiler::reader::lexer::Token;
    let last = tree.nodes().last();
    last.is_none_or(|last| !matches!(tree.kind(last), SyntaxKind::Leaf(Token::Unfinished)))
}

/// What must not be touched, line by line.
struct FixedLines {
    /// Whether the line begins inside a string, a block comment or a name.
    begins_inside: Vec<bool>,
    /// The end of the last token of the line, whose blanks belong to it.
    kept_up_to: Vec<usize>,
}

impl FixedLines {
    fn new(tree: &SyntaxTree, starts: &LineStarts) -> FixedLines {
        let mut fixed =
            FixedLines { begins_inside: vec![false; starts.count()], kept_up_to: vec![0; starts.count()] };
        for node in tree.nodes() {
            if !matches!(tree.kind(node), SyntaxKind::Leaf(_) | SyntaxKind::BlockComment) {
                continue;
            }
            let place = tree.range(node);
            let (first, last) = (starts.line_of(place.start), starts.line_of(place.end.max(1) - 1));
            for line in first..=last {
                fixed.begins_inside[line] |= line > first;
                let end = starts.range(line).end.min(place.end);
                fixed.kept_up_to[line] = fixed.kept_up_to[line].max(end);
            }
            // A token whose last character is a newline.
            if starts.range(last).end == place.end && last + 1 < starts.count() {
                fixed.kept_up_to[last] = place.end;
            }
        }
        fixed
    }
}

#[cfg(test)]
mod tests;
