//! Finding the extent of the next datum in the token stream.
//!
//! The meaning of a name depends on the current package, which the previous form may have changed. So the
//! reader works through a text one top-level datum at a time. The scanner collects the tokens of one, which
//! the grammar then parses. On the way it does the work that depends on more than the grammar sees: it leaves
//! out data that `#+` and `#-` exclude, keeps nesting within bounds, and checks commas and labels.
//!
//! Guarantees: nesting is on a stack of its own; after an error the scanner continues at an offset from which
//! the following forms can be read; all calls together look at each byte of the text a bounded number of
//! times. Not here: dots, marks without a datum (the grammar), the meaning of tokens (`builder`).

mod check;
mod habits;
mod recover;

use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::{SourceId, Span};
use logos::Logos;
use rustc_hash::FxHashMap;

use crate::diagnostic::code;

use super::MAX_ERRORS;
use super::feature::{self, HasFeature};
use super::lexer::{Lexeme, Token};

pub(super) use check::label_number;

/// Nesting of lists, vectors and marks, at most.
pub const MAX_DEPTH: usize = 2000;

/// Stands for no offset, since texts are shorter.
const NONE: u32 = u32::MAX;

/// A list or mark that is open around the current token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OpenKind {
    /// A list or vector, until its `)`.
    List,
    /// A mark that takes one datum.
    Prefix,
    Backquote,
    Comma,
    Array,
    /// `#n=`: the number, and the values of [`Scanner::deepest`] and [`Scanner::tokens`] outside.
    Label {
        number: u32,
        deepest: usize,
        tokens: u64,
    },
    /// `#+` or `#-` before its feature expression.
    Feature {
        wanted: bool,
    },
    /// `#+` or `#-` after its feature expression, before its datum.
    Conditional {
        kept: bool,
    },
}

#[derive(Clone, Copy, Debug)]
struct Level {
    open: OpenKind,
    /// Start of its token.
    start: u32,
    end: u32,
    /// Index of its token in [`Scanner::lexemes`].
    lexeme: usize,
    /// Number of backquotes around it, minus that of commas.
    backquotes: u32,
    /// The first `(` within it that is in column 0.
    column_0: u32,
}

/// A list without an end, and the offset at which the next form probably begins.
#[derive(Clone, Copy, Debug)]
struct Unclosed {
    start: u32,
    column_0: u32,
}

#[derive(Clone, Copy, Debug)]
enum LabelState {
    Open,
    Done { height: usize, tokens: u64 },
}

/// Outcome of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scan {
    /// A datum, whose tokens are in [`Scanner::lexemes`]. It ends before this offset.
    Datum(usize),
    /// No datum, but [`Scanner::errors`]. Scanning continues at this offset.
    Errors(usize),
    /// The end of the text.
    End,
}

/// The scanner. It is kept from one datum to the next, for its buffers and for facts about the text.
#[derive(Debug, Default)]
pub(super) struct Scanner {
    source: SourceId,
    /// Tokens of the datum.
    pub(super) lexemes: Vec<Lexeme>,
    /// Faults of the datum so far.
    pub(super) errors: Vec<Diagnostic>,
    levels: Vec<Level>,
    /// Number of levels that are lists.
    lists: usize,
    /// Number of lists open beyond [`MAX_DEPTH`], which have no levels.
    excess: u64,
    /// Whether excessive nesting has been reported.
    is_too_deep: bool,
    /// Number of levels that a feature excludes.
    excluded: u32,
    backquotes: u32,
    labels: FxHashMap<u32, LabelState>,
    /// Deepest nesting since the innermost label.
    deepest: usize,
    /// Number of tokens that the datum would have if all labels were written out.
    tokens: u64,
    /// Lists that are known to be unclosed at the end of the text, in order.
    unclosed: Vec<Unclosed>,
    runaways: u32,
    /// Whether the text is a program, in which habits from other languages are faults.
    is_program: bool,
    /// Whether a comment that begins with `#` or the like has been reported.
    pub(super) has_foreign_comment: bool,
    /// Whether a comma between the parts of a form of this datum has been reported.
    has_foreign_comma: bool,
}

impl Scanner {
    pub(super) fn source(&self) -> SourceId {
        self.source
    }

    pub(super) fn new(source: SourceId) -> Scanner {
        Scanner { source, ..Scanner::default() }
    }

    /// Creates a scanner for the text of a program.
    pub(super) fn of_program(source: SourceId) -> Scanner {
        Scanner { is_program: true, ..Scanner::new(source) }
    }

    /// Collects the tokens of the next datum of `text` from byte `from` on.
    /// `has_feature` says what holds for `#+`.
    pub(super) fn scan(&mut self, text: &str, from: usize, has_feature: HasFeature<'_>) -> Scan {
        self.reset();
        let mut lexer = Token::lexer(&text[from..]);
        while let Some(token) = lexer.next() {
            let (start, end) = ((from + lexer.span().start) as u32, (from + lexer.span().end) as u32);
            let token = match token {
                Ok(token) => token,
                Err(error) => return Scan::Errors(self.runaway(error, text, start, end)),
            };
            let is_done = match token {
                Token::Open | Token::Vector => {
                    if self.lists == 0 {
                        // The list was scanned before, up to the end of the text.
                        if let Ok(known) = self.unclosed.binary_search_by_key(&start, |list| list.start) {
                            let list = self.unclosed[known];
                            return Scan::Errors(self.unclosed_list(list.start, end, list.column_0, text));
                        }
                    }
                    if token == Token::Open && is_column_0(text, start) {
                        self.note_column_0(start);
                    }
                    self.push(OpenKind::List, token, start, end);
                    false
                }
                Token::Close => {
                    if self.levels.is_empty() && self.excess == 0 {
                        return Scan::Errors(self.unexpected_close(text, start));
                    }
                    self.close(text, start, end, has_feature)
                }
                Token::Stray => {
                    self.stray(text, start, end);
                    false
                }
                Token::UnknownDispatch if self.is_foreign_comment(text, start, end) => {
                    let line = text[end as usize..].find('\n').unwrap_or(text.len() - end as usize);
                    self.foreign_comment(start, end + line as u32);
                    lexer.bump(line);
                    false
                }
                Token::Quote if self.is_end_of_text(text, start, end) => {
                    self.foreign_text(text, end);
                    false
                }
                token => self.token(token, text, start, end, has_feature),
            };
            if is_done {
                return if self.errors.is_empty() {
                    Scan::Datum(end as usize)
                } else {
                    Scan::Errors(end as usize)
                };
            }
        }
        self.end(text)
    }

    fn reset(&mut self) {
        self.lexemes.clear();
        self.errors.clear();
        self.levels.clear();
        self.lists = 0;
        self.excess = 0;
        self.is_too_deep = false;
        self.excluded = 0;
        self.backquotes = 0;
        self.labels.clear();
        self.deepest = 0;
        self.tokens = 0;
        self.has_foreign_comma = false;
    }

    /// Takes a token other than a parenthesis. Returns whether it completes the top-level datum.
    fn token(&mut self, token: Token, text: &str, start: u32, end: u32, has_feature: HasFeature<'_>) -> bool {
        match token {
            Token::Quote | Token::Function => self.push(OpenKind::Prefix, token, start, end),
            Token::Backquote => {
                self.push(OpenKind::Backquote, token, start, end);
                self.backquotes += 1;
            }
            Token::Comma | Token::CommaAt => {
                self.check_comma(token, start, end);
                self.push(OpenKind::Comma, token, start, end);
                self.backquotes = self.backquotes.saturating_sub(1);
            }
            Token::Array => {
                self.push(OpenKind::Array, token, start, end);
                self.backquotes = 0;
            }
            Token::Label => {
                let open = self.open_label(text, start, end);
                self.push(open, token, start, end);
            }
            Token::FeaturePresent | Token::FeatureAbsent => {
                self.push(OpenKind::Feature { wanted: token == Token::FeaturePresent }, token, start, end);
                self.excluded += 1;
            }
            Token::ReadEval | Token::Structure | Token::Pathname | Token::Complex => {
                self.push(OpenKind::Prefix, token, start, end);
            }
            Token::Dot => {
                self.add(token, start, end);
                return self.lists == 0 && self.excess == 0;
            }
            _ => {
                if token == Token::Reference {
                    self.check_reference(text, start, end);
                }
                self.add(token, start, end);
                return self.complete(text, has_feature);
            }
        }
        false
    }

    fn add(&mut self, token: Token, start: u32, end: u32) {
        self.lexemes.push(Lexeme { token, start, end });
        self.tokens = self.tokens.saturating_add(1);
    }

    fn push(&mut self, open: OpenKind, token: Token, start: u32, end: u32) {
        if self.levels.len() == MAX_DEPTH {
            self.too_deep(start, end);
            // Marks beyond the limit are dropped; lists are counted, so that the end of the datum is found.
            self.excess += u64::from(open == OpenKind::List);
            return;
        }
        let (lexeme, backquotes) = (self.lexemes.len(), self.backquotes);
        self.levels.push(Level { open, start, end, lexeme, backquotes, column_0: NONE });
        self.lists += usize::from(open == OpenKind::List);
        self.deepest = self.deepest.max(self.levels.len());
        self.add(token, start, end);
    }

    fn pop(&mut self) -> Option<Level> {
        let level = self.levels.pop()?;
        self.lists -= usize::from(level.open == OpenKind::List);
        self.backquotes = level.backquotes;
        if matches!(level.open, OpenKind::Feature { .. } | OpenKind::Conditional { kept: false }) {
            self.excluded -= 1;
        }
        Some(level)
    }

    /// Takes a `)`. Returns whether it completes the top-level datum.
    fn close(&mut self, text: &str, start: u32, end: u32, has_feature: HasFeature<'_>) -> bool {
        if self.excess > 0 {
            self.excess -= 1;
            return self.complete(text, has_feature);
        }
        self.add(Token::Close, start, end);
        while let Some(level) = self.pop() {
            match level.open {
                OpenKind::List => return self.complete(text, has_feature),
                // Excluded data never reach the grammar, so their marks are checked here.
                OpenKind::Feature { .. } | OpenKind::Conditional { .. } => {
                    let mark = &text[level.start as usize..level.end as usize];
                    let span = self.span(start, end);
                    self.error(
                        code::MISSING_DATUM
                            .at(span, format!("expected a datum for `{mark}`, found `)`"))
                            .also(self.span(level.start, level.end), "this needs a feature and a datum"),
                    );
                }
                _ => {}
            }
        }
        // Only marks were open, a fault that the grammar reports.
        true
    }

    /// Completes a datum and the marks before it. Returns whether nothing is left open.
    fn complete(&mut self, text: &str, has_feature: HasFeature<'_>) -> bool {
        if self.excess > 0 {
            return false;
        }
        while let Some(&level) = self.levels.last() {
            match level.open {
                OpenKind::List => return false,
                OpenKind::Feature { wanted } => {
                    self.pop();
                    let test = &self.lexemes[level.lexeme + 1..];
                    let kept = match feature::holds(text, test, has_feature) {
                        Ok(holds) => holds == wanted,
                        Err(fault) => {
                            let span = self.span(fault.start, fault.end);
                            self.error(code::INVALID_TOKEN.at(span, fault.message));
                            true
                        }
                    };
                    self.lexemes.truncate(level.lexeme);
                    self.levels.push(Level { open: OpenKind::Conditional { kept }, ..level });
                    self.excluded += u32::from(!kept);
                    return false;
                }
                OpenKind::Conditional { kept: false } => {
                    self.pop();
                    self.lexemes.truncate(level.lexeme);
                    return false;
                }
                OpenKind::Label { number, deepest, tokens } => {
                    self.pop();
                    let height = self.deepest.saturating_sub(self.levels.len() + 1);
                    self.labels.insert(number, LabelState::Done { height, tokens: self.tokens - tokens });
                    self.deepest = self.deepest.max(deepest);
                }
                _ => {
                    self.pop();
                }
            }
        }
        true
    }

    /// Notes for all open levels without one that a `(` at the beginning of a line lies within them.
    fn note_column_0(&mut self, start: u32) {
        // Frames that have one are below those that have none.
        for level in self.levels.iter_mut().rev().take_while(|level| level.column_0 == NONE) {
            level.column_0 = start;
        }
    }

    fn error(&mut self, diagnostic: Diagnostic) {
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(diagnostic);
        }
    }

    fn span(&self, start: u32, end: u32) -> Span {
        Span::new(self.source, start, end)
    }
}

fn is_column_0(text: &str, start: u32) -> bool {
    start == 0 || text.as_bytes()[start as usize - 1] == b'\n'
}
