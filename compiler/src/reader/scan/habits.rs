//! Habits from other languages within a datum: comments that begin with `#`, texts between `'`, commas
//! between the parts of a form.
//!
//! `'a' b` and `(f a, b)` are data for `read`, or faults that `read` reports; in a program they are mistakes.

use crate::diagnostic::code;
use crate::habit::statement::{COMMENT_HELP, TEXT_MESSAGE, comment_message};
use crate::reader::lexer::Token;

use super::Scanner;

impl Scanner {
    /// Whether a `#` begins a comment, as in Python.
    pub(super) fn is_foreign_comment(&self, text: &str, start: u32, end: u32) -> bool {
        self.is_program && end - start == 1 && text[end as usize..].starts_with([' ', '\t', '\n', '\r'])
    }

    /// Reports the first comment that begins with `#`.
    pub(super) fn foreign_comment(&mut self, start: u32, end: u32) {
        if !std::mem::replace(&mut self.has_foreign_comment, true) {
            let span = self.span(start, end);
            self.error(code::FOREIGN_NOTATION.at(span, comment_message("#")).help(COMMENT_HELP));
        }
    }

    /// Whether a `'` ends a text, as in `'hello'`: it follows a name without a blank, and a blank or `)`
    /// follows.
    pub(super) fn is_end_of_text(&self, text: &str, start: u32, end: u32) -> bool {
        self.is_program
            && self.lexemes.last().is_some_and(|last| last.end == start && last.token == Token::Atom)
            && text[end as usize..].chars().next().is_none_or(|next| next.is_whitespace() || next == ')')
    }

    /// Reports a text between `'`, the last of which ends before `end`.
    pub(super) fn foreign_text(&mut self, text: &str, end: u32) {
        let is_opening = |start: u32| {
            let between = &text[start as usize..end as usize];
            text[start as usize..].starts_with('\'') && !between.contains(['\n', '"', '\\'])
        };
        let marks = self.lexemes.iter().rev().filter(|lexeme| lexeme.token == Token::Quote);
        let start = marks.map(|mark| mark.start).find(|&start| is_opening(start));
        let span = self.span(start.unwrap_or(end - 1), end);
        let shown = start.map_or("text", |start| &text[start as usize + 1..end as usize - 1]);
        let shown: String = shown.chars().take(40).collect();
        self.error(code::FOREIGN_NOTATION.at(span, TEXT_MESSAGE).help(format!("write `\"{shown}\"`")));
    }

    /// Whether a comma outside of a backquote stands between the parts of a form: it follows one without a
    /// blank.
    pub(super) fn is_between_parts(&self, start: u32) -> bool {
        self.is_program
            && self.lexemes.last().is_some_and(|last| {
                last.end == start && matches!(last.token, Token::Atom | Token::String | Token::Close)
            })
    }
}
