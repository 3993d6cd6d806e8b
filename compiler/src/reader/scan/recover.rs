//! Texts that end too early, close too much or nest too deeply: the diagnostics, and the offset at which
//! reading continues.

use crate::diagnostic::{DiagnosticCode, code};
use crate::reader::lexer::{LexError, Lexeme, Token};

use super::{Level, MAX_DEPTH, NONE, OpenKind, Scan, Scanner, Unclosed};

/// Strings and names without an end after which reading stops: each makes the rest of the text less certain.
const MAX_RUNAWAYS: u32 = 8;

impl Scanner {
    /// Takes the end of the text.
    pub(super) fn end(&mut self, text: &str) -> Scan {
        if self.levels.is_empty() {
            return if self.errors.is_empty() { Scan::End } else { Scan::Errors(text.len()) };
        }
        if self.excess > 0 {
            return Scan::Errors(text.len());
        }
        let lists: Vec<Level> =
            self.levels.iter().filter(|level| level.open == OpenKind::List).copied().collect();
        let Some(&outer) = lists.first() else {
            let mark = self.levels[self.levels.len() - 1];
            let span = self.span(mark.start, mark.end);
            let shown = &text[mark.start as usize..mark.end as usize];
            self.error(
                code::UNFINISHED_DATUM
                    .at(span, format!("expected a datum after `{shown}`, found the end of the text")),
            );
            return Scan::Errors(text.len());
        };
        self.unclosed = lists.iter().map(|f| Unclosed { start: f.start, column_0: f.column_0 }).collect();
        Scan::Errors(self.unclosed_list(outer.start, outer.end, outer.column_0, text))
    }

    /// Reports the unclosed list at `start`; returns the offset at which to continue.
    pub(super) fn unclosed_list(&mut self, start: u32, end: u32, column_0: u32, text: &str) -> usize {
        let mut diagnostic = code::UNCLOSED_LIST
            .at(self.span(start, end), "expected `)`, found the end of the text")
            .label("this list is not closed");
        // Lists behind the first form in column 0 are open only because this one is.
        let inner = self.unclosed.iter().rfind(|list| list.start > start && list.start < column_0);
        if let Some(inner) = inner {
            diagnostic = diagnostic
                .also(self.span(inner.start, inner.start + 1), "this list within it is not closed either");
        }
        if column_0 == NONE {
            self.error(diagnostic);
            return text.len();
        }
        let span = self.span(column_0, column_0 + 1);
        self.error(diagnostic.also(span, "the missing `)` probably belongs before this form"));
        column_0 as usize
    }

    pub(super) fn unexpected_close(&mut self, text: &str, start: u32) -> usize {
        let run = text.as_bytes()[start as usize..].iter().take_while(|&&byte| byte == b')').count();
        let end = start as usize + run;
        let span = self.span(start, end as u32);
        let found = if run == 1 { "`)`".to_owned() } else { format!("{run} `)`") };
        self.error(
            code::UNEXPECTED_CLOSE
                .at(span, format!("expected a form, found {found} with no list open"))
                .help("remove it, or look for a list before it that is closed too early"),
        );
        end
    }

    pub(super) fn stray(&mut self, text: &str, start: u32, end: u32) {
        let found = text[start as usize..].chars().next().unwrap_or_default();
        let what = if found.is_control() {
            "a control character"
        } else if found.is_whitespace() {
            "an unusual blank"
        } else {
            "an invisible character"
        };
        let span = self.span(start, end);
        self.error(
            code::INVALID_CHARACTER
                .at(span, format!("expected visible characters, found U+{:04X}, {what}", u32::from(found)))
                .help("remove it; it is allowed in strings, in comments and between bars"),
        );
    }

    /// Reports a token without an end; returns the offset at which to continue.
    pub(super) fn runaway(&mut self, error: LexError, text: &str, start: u32, end: u32) -> usize {
        let (code, width, what): (&DiagnosticCode, u32, _) = match error {
            LexError::UnclosedString => (code::UNCLOSED_STRING, 1, "the `\"` that ends this string"),
            LexError::UnclosedComment => (code::UNCLOSED_COMMENT, 2, "the `|#` that ends this comment"),
            LexError::UnclosedBar => {
                let name = text[start as usize..].find('|').unwrap_or(0) as u32;
                (code::UNCLOSED_BAR, name + 1, "the `|` that ends this name")
            }
            LexError::UnfinishedEscape => {
                (code::UNFINISHED_ESCAPE, end - start, "a character after the backslash")
            }
            LexError::Unknown => {
                let span = self.span(start, end);
                self.error(code::INVALID_TOKEN.at(span, "expected a token, found other characters"));
                return end as usize;
            }
        };
        let span = self.span(start, start + width);
        let mut diagnostic = code.at(span, format!("expected {what}, found the end of the text"));
        // A quote that was missed long before turns code into strings and strings into code. The first string
        // of this form that runs over the beginning of another form is the likely place.
        let is_suspect = |lexeme: &&Lexeme| {
            lexeme.token == Token::String && text[lexeme.start as usize..lexeme.end as usize].contains("\n(")
        };
        let suspect = self.lexemes.iter().find(is_suspect).copied();
        if let Some(suspect) = suspect {
            let span = self.span(suspect.start, suspect.start + 1);
            diagnostic =
                diagnostic.also(span, "this string runs on into the next form: is its `\"` missing?");
        }
        self.error(diagnostic);
        self.runaways += 1;
        // The intended end of the comment is unknown, and its text would be taken for code.
        if error == LexError::UnclosedComment || self.runaways > MAX_RUNAWAYS {
            return text.len();
        }
        let resume = suspect.map_or(start, |suspect| suspect.start) as usize;
        text[resume..].find("\n(").map_or(text.len(), |at| resume + at + 1)
    }

    pub(super) fn too_deep(&mut self, start: u32, end: u32) {
        if std::mem::replace(&mut self.is_too_deep, true) {
            return;
        }
        let span = self.span(start, end);
        self.error(
            code::NESTED_TOO_DEEPLY
                .at(span, format!("expected at most {MAX_DEPTH} levels of nesting, found more"))
                .help("build structure that deep at run time"),
        );
    }
}
