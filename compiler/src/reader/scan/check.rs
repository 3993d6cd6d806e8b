//! Checks that depend on more of a datum than the grammar sees: commas and labels.

use crate::diagnostic::code;
use crate::reader::lexer::Token;
use crate::reader::name;

use super::{LabelState, MAX_DEPTH, OpenKind, Scanner};

/// Tokens of the tree that a datum with labels stands for, at most.
const MAX_TREE: u64 = 1 << 24;

impl Scanner {
    pub(super) fn check_comma(&mut self, token: Token, start: u32, end: u32) {
        if self.excluded > 0 {
            return;
        }
        let span = self.span(start, end);
        if self.backquotes == 0 && self.is_between_parts(start) {
            if !std::mem::replace(&mut self.has_foreign_comma, true) {
                let message = "blanks separate the parts of a form in ESL, not commas";
                self.error(code::FOREIGN_NOTATION.at(span, message).help("leave out the commas"));
            }
            return;
        }
        if self.backquotes == 0 {
            let in_array = self.levels.iter().any(|level| level.open == OpenKind::Array);
            let place = if in_array { "in an array literal" } else { "outside of a backquote" };
            return self.error(
                code::COMMA_OUTSIDE_BACKQUOTE.at(span, format!("expected no comma {place}, found one")),
            );
        }
        if token == Token::CommaAt {
            let parent = self.levels.last().map(|level| level.open);
            let after_dot = self.lexemes.last().is_some_and(|last| last.token == Token::Dot);
            if parent == Some(OpenKind::Backquote) {
                self.error(
                    code::MISPLACED_SPLICE
                        .at(span, "expected `,@` within a list, found it right after the backquote")
                        .help("put it into a list, or take `,` to insert the value itself"),
                );
            } else if parent == Some(OpenKind::List) && after_dot {
                self.error(
                    code::MISPLACED_SPLICE
                        .at(span, "expected one datum after the dot, found `,@`")
                        .help("leave the dot out, or take `,` to make the value the rest of the list"),
                );
            }
        }
    }

    pub(super) fn open_label(&mut self, text: &str, start: u32, end: u32) -> OpenKind {
        if self.excluded > 0 {
            return OpenKind::Prefix;
        }
        let Some(number) = label_number(text, start, end) else {
            let span = self.span(start, end);
            self.error(
                code::INVALID_TOKEN.at(span, "expected the number of a label, found one that is too large"),
            );
            return OpenKind::Prefix;
        };
        if self.labels.insert(number, LabelState::Open).is_some() {
            let span = self.span(start, end);
            self.error(
                code::UNKNOWN_LABEL.at(span, format!("expected a new label, found another `#{number}=`")),
            );
        }
        let open = OpenKind::Label { number, deepest: self.deepest, tokens: self.tokens };
        self.deepest = self.levels.len();
        open
    }

    pub(super) fn check_reference(&mut self, text: &str, start: u32, end: u32) {
        if self.excluded > 0 {
            return;
        }
        let span = self.span(start, end);
        let state = label_number(text, start, end).and_then(|number| self.labels.get(&number).copied());
        match state {
            Some(LabelState::Done { height, tokens }) => {
                let depth = self.levels.len() + height;
                self.deepest = self.deepest.max(depth);
                self.tokens = self.tokens.saturating_add(tokens);
                if depth > MAX_DEPTH {
                    self.too_deep(start, end);
                } else if self.tokens > MAX_TREE {
                    self.error(
                        code::LITERAL_TOO_LARGE
                            .at(span, format!("labels stand for more than {MAX_TREE} tokens if written out")),
                    );
                }
            }
            // The builder closes the circle.
            Some(LabelState::Open) => {}
            None => {
                let label = &text[start as usize..end as usize];
                self.error(
                    code::UNKNOWN_LABEL
                        .at(span, format!("expected the number of a label before this, found `{label}`")),
                );
            }
        }
    }
}

/// Returns the number in `#n=` or `#n#`.
pub(in crate::reader) fn label_number(text: &str, start: u32, end: u32) -> Option<u32> {
    name::digits(&text[start as usize + 1..end as usize - 1])
}
