//! The reader: source text to data.
//!
//! Reading has four steps. The [`lexer`] finds tokens; `scan` collects the tokens of the next top-level
//! datum; the grammar (`grammar.lalrpop`) parses them; `builder` makes the datum. One datum is read at a
//! time, since the previous form may have changed the package in which its names are looked up.
//!
//! Guarantees: reading any text ends, in time in proportion to its length, without native recursion, and with
//! a datum or a diagnostic for every part of it. After an error, reading continues behind the faulty datum
//! or, if that has no end, at the next form that begins in column 0. Not here: reader macros and `read` on
//! streams (the library, over [`read_datum`]); the calls that stand for data such as `#.form`, which are made
//! before the datum is compiled ([`DatumKind::Call`](esl_bytecode::datum::DatumKind::Call)).

mod bare;
mod builder;
mod character;
mod feature;
mod grammar;
pub mod lexer;
mod literal;
mod name;
mod number;
mod print;
mod scan;

use std::sync::Arc;

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::Datum;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::{SourceId, Span};
use lalrpop_util::ParseError;

use crate::diagnostic::code;
use crate::habit::statement::{Statement, StatementKind, statement};

pub use bare::{BareEnvironment, read_anything};
pub use character::CHARACTER_NAMES;
pub use feature::FEATURES;
pub use literal::MAX_RANK;
pub use name::{MAX_NAME, fold};
pub use number::{MAX_DIGITS, MAX_RATIO_DIGITS};
pub use print::print;
pub use scan::MAX_DEPTH;

use builder::DatumBuilder;
use lexer::{Lexeme, Token};
use scan::{Scan, Scanner};

/// Errors in one text after which the rest is not read.
const MAX_ERRORS: usize = 100;

/// Elements that may be filled into the vectors `#n(…)` of one text.
const MAX_FILL: usize = 1 << 20;

/// Reads a text, one top-level datum at a time.
#[derive(Debug)]
pub struct Reader {
    text: Arc<str>,
    position: usize,
    scanner: Scanner,
    room: usize,
    /// Diagnostics to be returned before reading continues, the first one last.
    waiting: Vec<Diagnostic>,
    errors: usize,
    /// Kinds of foreign statements that have been reported.
    foreign: Vec<StatementKind>,
}

impl Reader {
    /// Creates a reader at the beginning of `text`, behind a byte order mark and a first line that begins
    /// with `#!`.
    pub fn new(source: SourceId, text: impl Into<Arc<str>>) -> Reader {
        let text = text.into();
        let position = preamble(&text);
        let mut waiting = Vec::new();
        if !is_readable(&text) {
            waiting.push(too_large(source));
        }
        let scanner = Scanner::of_program(source);
        Reader { text, position, scanner, room: MAX_FILL, waiting, errors: 0, foreign: Vec::new() }
    }

    /// Returns whether no diagnostics about what was read are left.
    pub(crate) fn is_sound(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Returns whether all of the text has been read.
    pub(crate) fn is_at_end(&self) -> bool {
        self.position >= self.text.len()
    }

    /// Returns up to `size` bytes of the text that has not been read yet, and whether these are all.
    pub(crate) fn part(&self, size: usize) -> (&str, bool) {
        let rest = &self.text[self.position..];
        let end = rest.floor_char_boundary(size);
        (&rest[..end], end == rest.len())
    }

    /// Returns the place of the first character of the text that has not been read yet and is not blank.
    pub(crate) fn next_span(&self) -> Span {
        let rest = &self.text[self.position..];
        let start = self.position + rest.find(|c: char| !c.is_whitespace()).unwrap_or(0);
        let end = self.text.ceil_char_boundary(start + 1);
        Span::new(self.scanner.source(), start as u32, end as u32)
    }

    /// Leaves out `count` characters of the text, which something else has read.
    pub(crate) fn skip(&mut self, count: usize) {
        let rest = &self.text[self.position..];
        self.position += rest.char_indices().nth(count).map_or(rest.len(), |(at, _)| at);
    }

    /// Returns the byte from which the next datum is read.
    pub fn position(&self) -> usize {
        self.position
    }

    /// Returns the next datum, or a diagnostic about it; `None` at the end of the text. One faulty datum may
    /// have several diagnostics in a row.
    pub fn next(&mut self, environment: &mut dyn Environment) -> Option<Result<Datum, Box<Diagnostic>>> {
        if self.waiting.is_empty() {
            if !is_readable(&self.text) {
                return None;
            }
            self.pass_statements();
        }
        if self.waiting.is_empty() {
            match read(&mut self.scanner, environment, &self.text, self.position, &mut self.room) {
                ReadStep::Datum(datum, end) => {
                    self.position = end;
                    return Some(Ok(datum));
                }
                ReadStep::Errors(mut errors, resume) => {
                    self.position = resume;
                    errors.reverse();
                    self.waiting = errors;
                }
                ReadStep::End => self.position = self.text.len(),
            }
        }
        let error = self.waiting.pop()?;
        self.errors += 1;
        let is_over = self.waiting.is_empty() && self.position == self.text.len();
        if self.errors == MAX_ERRORS && !is_over {
            let message = format!("expected fewer than {MAX_ERRORS} errors, found so many");
            let last = code::TOO_MANY_ERRORS.at(error.primary.span, message);
            self.waiting = vec![last.label("the rest of the text is not read")];
            self.position = self.text.len();
        }
        Some(Err(Box::new(error)))
    }
}

impl Reader {
    /// Leaves out statements of other languages before the next datum. The first of each kind is reported.
    fn pass_statements(&mut self) {
        while self.waiting.is_empty()
            && let Some(found) = self.statement()
        {
            self.position = found.end;
            let is_known = match found.kind {
                StatementKind::Comment => std::mem::replace(&mut self.scanner.has_foreign_comment, true),
                kind => self.foreign.contains(&kind),
            };
            if !is_known {
                self.foreign.push(found.kind);
                let end = u32::try_from(found.line_end).unwrap_or(u32::MAX);
                let span = Span::new(self.scanner.source(), found.start as u32, end);
                self.waiting.push(code::FOREIGN_NOTATION.at(span, found.message).help(found.help));
            }
        }
    }

    /// Returns the statement of another language that comes next, if one does.
    fn statement(&self) -> Option<Statement> {
        let mut at = self.position;
        loop {
            let rest = &self.text[at..];
            at += rest.len() - rest.trim_start().len();
            if !self.text[at..].starts_with(';') {
                break;
            }
            at += self.text[at..].find('\n').unwrap_or(self.text.len() - at);
        }
        if self.text[at..].starts_with('(') { None } else { statement(&self.text, at) }
    }
}

/// Reads one datum of `text` from byte `start` on. Returns the datum, or `None` at the end of the text, and
/// the offset after it. A blank after the datum is not part of it.
///
/// # Errors
/// The first fault of the datum. A fault that more text could mend ([`is_unfinished`]) is reported only if
/// there is no other.
pub fn read_datum(
    environment: &mut dyn Environment,
    text: &str,
    start: usize,
) -> Result<(Option<Datum>, usize), Box<Diagnostic>> {
    let source = SourceId::default();
    if !is_readable(text) {
        return Err(Box::new(too_large(source)));
    }
    let start = text.ceil_char_boundary(start);
    match read(&mut Scanner::new(source), environment, text, start, &mut { MAX_FILL }) {
        ReadStep::Datum(datum, end) => Ok((Some(datum), end)),
        ReadStep::End => Ok((None, text.len())),
        ReadStep::Errors(mut errors, _) => {
            let wrong = errors.iter().position(|error| !is_unfinished(error.code));
            Err(Box::new(errors.swap_remove(wrong.unwrap_or(0))))
        }
    }
}

/// Returns the faults of a text that keep its forms from being told apart: lists, strings and comments
/// without an end, marks out of place. Other faults, such as those of names, are not looked for.
pub fn structure_faults(source: SourceId, text: &str) -> Vec<Diagnostic> {
    if !is_readable(text) {
        return vec![too_large(source)];
    }
    let mut scanner = Scanner::new(source);
    let mut faults = Vec::new();
    let mut position = preamble(text);
    while faults.len() < MAX_ERRORS {
        match scanner.scan(text, position, &|name| FEATURES.contains(&name)) {
            Scan::Datum(end) => position = end,
            Scan::Errors(resume) => {
                faults.append(&mut scanner.errors);
                position = resume;
            }
            Scan::End => break,
        }
    }
    faults
}

/// Returns the end of the datum of `text` that begins at byte `start`; `None` if it is faulty.
pub(crate) fn datum_end(text: &str, start: usize) -> Option<usize> {
    match Scanner::new(SourceId::default()).scan(text, start, &|name| FEATURES.contains(&name)) {
        Scan::Datum(end) => Some(end),
        Scan::Errors(_) | Scan::End => None,
    }
}

/// Whether a diagnostic of this code says only that the text ends too early. A REPL then waits for another
/// line.
pub fn is_unfinished(code: &str) -> bool {
    let codes = [
        code::UNCLOSED_LIST,
        code::UNCLOSED_STRING,
        code::UNCLOSED_COMMENT,
        code::UNCLOSED_BAR,
        code::UNFINISHED_DATUM,
        code::UNFINISHED_ESCAPE,
    ];
    codes.iter().any(|unfinished| unfinished.name == code)
}

/// Returns the text of a file.
///
/// # Errors
/// `invalid-utf-8`, with the offset of the first byte that is not UTF-8; `source-too-large`.
pub fn decode(source: SourceId, bytes: Vec<u8>) -> Result<String, Box<Diagnostic>> {
    let text = String::from_utf8(bytes).map_err(|error| {
        let (at, bytes) = (error.utf8_error().valid_up_to(), error.as_bytes());
        let line = bytes[..at].iter().filter(|&&byte| byte == b'\n').count() + 1;
        let message =
            format!("expected text in UTF-8, found byte 0x{:02X} at offset {at}, line {line}", bytes[at]);
        let at = u32::try_from(at).unwrap_or(u32::MAX - 1);
        let diagnostic = code::INVALID_UTF_8.at(Span::new(source, at, at + 1), message);
        Box::new(diagnostic.help("save the file as UTF-8, or convert it, for instance with `iconv`"))
    })?;
    if is_readable(&text) { Ok(text) } else { Err(Box::new(too_large(source))) }
}

/// Outcome of reading one datum.
enum ReadStep {
    Datum(Datum, usize),
    /// Faults in order, at least one, and the offset at which to continue.
    Errors(Vec<Diagnostic>, usize),
    End,
}

fn read(
    scanner: &mut Scanner,
    environment: &mut dyn Environment,
    text: &str,
    from: usize,
    room: &mut usize,
) -> ReadStep {
    let has_feature = |name: &str| environment.has_feature(name).unwrap_or(FEATURES.contains(&name));
    let end = match scanner.scan(text, from, &has_feature) {
        Scan::Datum(end) => end,
        Scan::Errors(resume) => return ReadStep::Errors(std::mem::take(&mut scanner.errors), resume),
        Scan::End => return ReadStep::End,
    };
    let source = scanner.source();
    let mut builder = DatumBuilder::new(environment, text, source, room);
    let tokens = scanner.lexemes.iter().map(|lexeme| (lexeme.start, lexeme.token, lexeme.end));
    let parsed = grammar::DatumParser::new().parse(&mut builder, tokens);
    let mut errors = builder.errors;
    match parsed {
        Ok(datum) if errors.is_empty() => return ReadStep::Datum(datum, end),
        Ok(_) => {}
        Err(error) => errors.push(explain(&error, &scanner.lexemes, text, source)),
    }
    ReadStep::Errors(errors, end)
}

/// Returns the diagnostic for a fault that the grammar found. The tokens are balanced, so the fault concerns
/// a dot, or a mark before a `)`.
fn explain<E>(
    error: &ParseError<u32, Token, E>,
    lexemes: &[Lexeme],
    text: &str,
    source: SourceId,
) -> Diagnostic {
    let place = match error {
        ParseError::UnrecognizedToken { token, .. } | ParseError::ExtraToken { token } => token.0,
        _ => u32::MAX,
    };
    let at = lexemes.partition_point(|lexeme| lexeme.start < place).min(lexemes.len() - 1);
    let span = |lexeme: &Lexeme| Span::new(source, lexeme.start, lexeme.end);
    let found = &lexemes[at];
    let previous = at.checked_sub(1).map(|at| &lexemes[at]);
    let mark = previous.filter(|previous| is_mark(previous.token));
    match (found.token, previous.map(|previous| previous.token)) {
        (Token::Close, Some(Token::Dot)) => code::DOTTED_LIST
            .at(span(found), "expected the last element of the list after the dot, found `)`"),
        (Token::Dot, None) => {
            code::DOTTED_LIST.at(span(found), "expected a form, found a dot outside of a list")
        }
        (Token::Dot, Some(Token::Open | Token::Vector)) => {
            code::DOTTED_LIST.at(span(found), "expected an element before the dot, found none")
        }
        (found_token @ (Token::Dot | Token::Close), Some(_)) if mark.is_some() => {
            let mark = mark.expect("just tested");
            let shown = &text[mark.start as usize..mark.end as usize];
            let found_shown = if found_token == Token::Dot { "a dot" } else { "`)`" };
            code::MISSING_DATUM
                .at(span(found), format!("expected a datum after `{shown}`, found {found_shown}"))
                .also(span(mark), "this mark needs a datum after it")
        }
        (Token::Dot, _) => code::DOTTED_LIST
            .at(span(found), "expected a dot only before the last element of a list, found one elsewhere"),
        _ => code::DOTTED_LIST
            .at(span(found), "expected `)` after the element that follows the dot, found more"),
    }
}

fn is_mark(token: Token) -> bool {
    use Token::*;
    let is_call = matches!(token, ReadEval | Structure | Pathname | Complex);
    is_call || matches!(token, Quote | Backquote | Comma | CommaAt | Function | Array | Label)
}

/// Returns the number of bytes to be skipped at the beginning of a text.
fn preamble(text: &str) -> usize {
    let mark = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    let rest = &text[mark..];
    if rest.starts_with("#!") { mark + rest.find('\n').unwrap_or(rest.len()) } else { mark }
}

/// Whether spans, whose offsets have 32 bits, can refer to all of a text. The last offset is kept free.
fn is_readable(text: &str) -> bool {
    text.len() < u32::MAX as usize
}

fn too_large(source: SourceId) -> Diagnostic {
    code::SOURCE_TOO_LARGE.at(Span::new(source, 0, 0), "expected a text of less than 4 GiB, found more")
}
