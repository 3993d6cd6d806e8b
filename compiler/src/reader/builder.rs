//! Data from tokens: the actions of the grammar.
//!
//! Guarantees: every datum has the span of its text. A faulty token is reported, and the empty list stands in
//! for it, so that one faulty name does not hide the next. Not here: the kinds of tokens (`lexer`), the end
//! of a datum (`scan`), the meaning of backquote (the expander, which gets `(esl::%backquote …)`,
//! `(esl::%unquote …)` and `(esl::%unquote-splicing …)`).

use std::sync::{Arc, LazyLock};

use esl_bytecode::compile::{Environment, InternError, NameUse};
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::{KEYWORD_PACKAGE, Symbol};
use rustc_hash::FxHashMap;

use crate::diagnostic::code;
use crate::habit::word;

use super::MAX_ERRORS;
use super::character;
use super::literal::{self, ArrayError, VectorError};
use super::name::{self, MAX_NAME, NameParts, Prefix, shorten};
use super::number::{self, NumberError, NumberToken};
use super::scan::label_number;

/// A mark that abbreviates a list of two elements.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Abbreviation {
    Quote,
    Backquote,
    Comma,
    CommaAt,
    Function,
}

/// Syntax that stands for what a macro of the library gives for the datum after it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ReadCall {
    Eval,
    Structure,
    Pathname,
    Complex,
}

/// Symbols that the reader itself puts into data.
struct KnownNames {
    quote: Symbol,
    function: Symbol,
    backquote: Symbol,
    unquote: Symbol,
    splice: Symbol,
    logical_value: Symbol,
    read_eval: Symbol,
    read_structure: Symbol,
    read_pathname: Symbol,
    read_complex: Symbol,
    read_bits: Symbol,
    read_circular: Symbol,
    keyword: Arc<str>,
}

static NAMES: LazyLock<KnownNames> = LazyLock::new(|| KnownNames {
    quote: Symbol::cl("QUOTE"),
    function: Symbol::cl("FUNCTION"),
    backquote: Symbol::esl("%BACKQUOTE"),
    unquote: Symbol::esl("%UNQUOTE"),
    splice: Symbol::esl("%UNQUOTE-SPLICING"),
    logical_value: Symbol::esl("LOGICAL-VALUE"),
    read_eval: Symbol::esl("%READ-EVAL"),
    read_structure: Symbol::esl("%READ-STRUCTURE"),
    read_pathname: Symbol::esl("%READ-PATHNAME"),
    read_complex: Symbol::esl("%READ-COMPLEX"),
    read_bits: Symbol::esl("%READ-BITS"),
    read_circular: Symbol::esl("%READ-CIRCULAR"),
    keyword: KEYWORD_PACKAGE.into(),
});

/// Builds the data of one text.
pub(crate) struct DatumBuilder<'a> {
    environment: &'a mut dyn Environment,
    text: &'a str,
    source: SourceId,
    labels: FxHashMap<u32, Datum>,
    /// Symbols that stand for data within themselves, by the number of the label.
    inside: FxHashMap<u32, Datum>,
    /// Radix of integers and ratios without a prefix.
    base: u32,
    /// Elements that `#n(…)` may still fill in.
    room: &'a mut usize,
    buffer: String,
    /// Faults found so far.
    pub(super) errors: Vec<Diagnostic>,
}

impl<'a> DatumBuilder<'a> {
    pub(super) fn new(
        environment: &'a mut dyn Environment,
        text: &'a str,
        source: SourceId,
        room: &'a mut usize,
    ) -> DatumBuilder<'a> {
        let (labels, inside, errors) = (FxHashMap::default(), FxHashMap::default(), Vec::new());
        let base = environment.read_base();
        DatumBuilder { environment, text, source, labels, inside, base, room, buffer: String::new(), errors }
    }

    fn span(&self, start: u32, end: u32) -> Span {
        Span::new(self.source, start, end)
    }

    fn slice(&self, start: u32, end: u32) -> &'a str {
        &self.text[start as usize..end as usize]
    }

    /// Reports a fault; returns the empty list, which stands in for the datum.
    fn fail(&mut self, diagnostic: Diagnostic) -> Datum {
        let span = diagnostic.primary.span;
        if self.errors.len() < MAX_ERRORS {
            self.errors.push(diagnostic);
        }
        Datum::nil(span)
    }

    /// A number or a name without escapes.
    pub(super) fn atom(&mut self, start: u32, end: u32) -> Datum {
        let token = self.slice(start, end);
        if let Some(number) = number::parse(token, self.base) {
            return self.number(number, start, end);
        }
        if token.len() > MAX_NAME {
            return self.too_long(start, end);
        }
        if token.contains(':') {
            return self.name(start, end);
        }
        if token.starts_with('.') && token.bytes().all(|byte| byte == b'.') {
            let span = self.span(start, end);
            return self
                .fail(code::INVALID_TOKEN.at(span, format!("expected a name, found only dots, `{token}`")));
        }
        let mut folded = std::mem::take(&mut self.buffer);
        folded.clear();
        folded.extend(token.chars().map(name::fold));
        let datum = self.intern(None, &folded, false, start, end);
        self.buffer = folded;
        datum
    }

    /// A name with escapes.
    pub(super) fn escaped(&mut self, start: u32, end: u32) -> Datum {
        if (end - start) as usize > MAX_NAME {
            return self.too_long(start, end);
        }
        self.name(start, end)
    }

    fn name(&mut self, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        match name::parse(self.slice(start, end)) {
            Ok(NameParts { prefix: Prefix::None, name }) => self.intern(None, &name, false, start, end),
            Ok(NameParts { prefix: Prefix::Keyword, name }) => {
                Datum::symbol(Symbol::new(&NAMES.keyword, &name), span)
            }
            Ok(NameParts { prefix: Prefix::Package { package, internal }, name }) => {
                self.intern(Some(&package), &name, internal, start, end)
            }
            Err(error) => {
                let message = error.message(self.slice(start, end));
                self.fail(code::INVALID_TOKEN.at(span, message))
            }
        }
    }

    fn intern(&mut self, package: Option<&str>, name: &str, internal: bool, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        let found = self.environment.intern(package, name, internal);
        let prefix = package.unwrap_or_default();
        match found {
            Ok(symbol) => Datum::symbol(symbol, span),
            Err(InternError::NoPackage(package)) => {
                let message = format!("expected the name of a package, found `{}`", shorten(&package));
                let fault = code::UNKNOWN_PACKAGE.at(span, message);
                self.fail(match &*package {
                    "QL" | "QUICKLISP" | "ASDF" | "UIOP" => fault.help(
                        "ESL has neither Quicklisp nor ASDF: copy the library's files beside the program, and write \
                         `(require \"NAME\")` for `NAME.esl`",
                    ),
                    _ => fault,
                })
            }
            Err(InternError::NotExternal { exists: true }) => {
                let message = format!("`{}` is internal to the package `{prefix}`", shorten(name));
                let help = format!(
                    "write `{}::{}` to use it all the same",
                    prefix.to_lowercase(),
                    name.to_lowercase()
                );
                self.fail(code::NOT_EXTERNAL.at(span, message).help(help))
            }
            Err(InternError::NotExternal { exists: false }) => {
                let message = format!("the package `{prefix}` has no symbol `{}`", shorten(name));
                let mut diagnostic = code::NOT_EXTERNAL.at(span, message);
                let wanted = Symbol::new(&prefix.into(), name);
                if let Some(similar) = self.environment.similar(&wanted, NameUse::Function).first() {
                    diagnostic = diagnostic.help(format!("did you mean `{}`?", similar.name()));
                }
                self.fail(diagnostic)
            }
        }
    }

    fn number(&mut self, number: Result<NumberToken, NumberError>, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        match number {
            Ok(NumberToken::Integer(value)) => Datum::integer(value, span),
            Ok(NumberToken::Ratio(numerator, denominator)) => {
                Datum::new(DatumKind::Ratio(numerator, denominator), span)
            }
            Ok(NumberToken::Float(value)) => Datum::new(DatumKind::Float(value), span),
            Err(NumberError::ZeroDenominator) => {
                self.fail(code::INVALID_TOKEN.at(span, "expected a denominator other than zero, found zero"))
            }
            Err(NumberError::OutOfRange) => {
                let message = format!("expected a float of at most {:e}, found a larger one", f64::MAX);
                self.fail(code::FLOAT_OUT_OF_RANGE.at(span, message))
            }
            Err(NumberError::TooLong(limit)) => {
                let message = format!("expected a number of at most {limit} digits, found more");
                self.fail(code::TOKEN_TOO_LONG.at(span, message))
            }
        }
    }

    fn too_long(&mut self, start: u32, end: u32) -> Datum {
        let message = format!("expected a name of at most {MAX_NAME} bytes, found {}", end - start);
        self.fail(code::TOKEN_TOO_LONG.at(self.span(start, end), message))
    }

    /// `#x`, `#b`, `#o`, `#nr`
    pub(super) fn radix(&mut self, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        let token = &self.slice(start, end)[1..];
        let letter = token.find(|c: char| !c.is_ascii_digit()).unwrap_or(0);
        let radix = match token.as_bytes()[letter].to_ascii_lowercase() {
            b'x' => Some(16),
            b'o' => Some(8),
            b'b' => Some(2),
            _ => name::digits(&token[..letter]).filter(|radix| (2..=36).contains(radix)),
        };
        let Some(radix) = radix else {
            let message = format!("expected a radix from 2 to 36, found `#{}`", shorten(&token[..=letter]));
            return self.fail(code::INVALID_TOKEN.at(span, message).help("write it as in `#36rZZ`"));
        };
        let digits = &token[letter + 1..];
        match number::parse_radix(digits, radix) {
            Some(number) => self.number(number, start, end),
            None => {
                let found = if digits.is_empty() { "none".into() } else { format!("`{}`", shorten(digits)) };
                let message = format!("expected an integer or ratio in base {radix}, found {found}");
                self.fail(code::INVALID_TOKEN.at(span, message))
            }
        }
    }

    /// `"…"`
    pub(super) fn string(&mut self, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        let written = self.slice(start + 1, end - 1);
        if !written.contains('\\') {
            return Datum::string(written, span);
        }
        let mut value = String::with_capacity(written.len());
        let mut rest = written.chars();
        while let Some(c) = rest.next() {
            if c == '\\' {
                value.extend(rest.next());
            } else {
                value.push(c);
            }
        }
        Datum::string(&value, span)
    }

    /// `#\x`
    pub(super) fn character(&mut self, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        let name = self.slice(start + 2, end);
        if let Some(c) = character::parse(name) {
            return Datum::new(DatumKind::Character(c), span);
        }
        let message =
            format!("expected a character or the name of one after `#\\`, found `{}`", shorten(name));
        let help = match character::similar(name) {
            Some(meant) => format!("did you mean `#\\{meant}`?"),
            None => "names are `Space`, `Newline`, `Tab`, … and numbers such as `U+00E9`".into(),
        };
        self.fail(code::INVALID_CHARACTER_NAME.at(span, message).help(help))
    }

    /// `#:name`
    pub(super) fn uninterned(&mut self, start: u32, end: u32) -> Datum {
        match self.plain_name(start, end) {
            Ok(name) => {
                let symbol = Symbol::uninterned(self.environment.fresh(), &name);
                Datum::symbol(symbol, self.span(start, end))
            }
            Err(fault) => fault,
        }
    }

    /// `#?variable`: `(esl:logical-value ?variable)`
    pub(super) fn logical_variable(&mut self, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        match self.plain_name(start, end) {
            Ok(name) => {
                let variable = self.intern(None, &format!("?{name}"), false, start, end);
                Datum::list([Datum::symbol(NAMES.logical_value.clone(), span), variable], span)
            }
            Err(fault) => fault,
        }
    }

    /// The name after `#:` or `#?`, which has no package.
    fn plain_name(&mut self, start: u32, end: u32) -> Result<String, Datum> {
        if (end - start) as usize > MAX_NAME {
            return Err(self.too_long(start, end));
        }
        let (mark, text) = (self.slice(start, start + 2), self.slice(start + 2, end));
        let found = match name::parse(text) {
            Ok(NameParts { prefix: Prefix::None, name }) => return Ok(name),
            _ if text.is_empty() => "none".to_owned(),
            _ => format!("`{}`", shorten(text)),
        };
        let message = format!("expected a name without a package after `{mark}`, found {found}");
        Err(self.fail(code::INVALID_TOKEN.at(self.span(start, end), message)))
    }

    /// `#<…>`
    pub(super) fn unreadable(&mut self, start: u32, end: u32) -> Datum {
        let message = format!("expected a datum, found `{}`", shorten(self.slice(start, end)));
        let help = "objects that print like this cannot be read; refer to them by a variable";
        self.fail(code::INVALID_TOKEN.at(self.span(start, end), message).help(help))
    }

    /// `#` with nothing known after it.
    pub(super) fn unknown(&mut self, start: u32, end: u32) -> Datum {
        let message =
            format!("expected a character that has a meaning after `#`, found `{}`", self.slice(start, end));
        let fault = code::INVALID_TOKEN.at(self.span(start, end), message);
        let value = word::value(&self.slice(start, end).to_uppercase());
        self.fail(value.into_iter().fold(fault, |fault, word| fault.help(word.help())))
    }

    /// Returns the list of a mark's symbol and `datum`. The mark ends before `middle`.
    pub(super) fn marked(&mut self, mark: Abbreviation, start: u32, middle: u32, datum: Datum) -> Datum {
        let symbol = match mark {
            Abbreviation::Quote => &NAMES.quote,
            Abbreviation::Function => &NAMES.function,
            Abbreviation::Backquote => &NAMES.backquote,
            Abbreviation::Comma => &NAMES.unquote,
            Abbreviation::CommaAt => &NAMES.splice,
        };
        let span = self.span(start, middle).to(datum.span());
        Datum::list([Datum::symbol(symbol.clone(), self.span(start, middle)), datum], span)
    }

    /// `(…)`, or with a tail, `(… . tail)`
    pub(super) fn list(&mut self, start: u32, items: Vec<Datum>, tail: Option<Datum>, end: u32) -> Datum {
        let span = self.span(start, end);
        let tail = tail.unwrap_or_else(|| Datum::nil(span));
        Datum::list_with_tail(items, tail, span)
    }

    /// `#(…)` or `#n(…)`; the elements begin after `middle`.
    pub(super) fn vector(&mut self, start: u32, middle: u32, items: Vec<Datum>, end: u32) -> Datum {
        let span = self.span(start, end);
        let length = self.slice(start + 1, middle - 1);
        let vector = match (length, name::digits(length)) {
            ("", _) => literal::vector(None, items, self.room),
            (_, Some(length)) => literal::vector(Some(length), items, self.room),
            _ => Err(VectorError::NoRoom),
        };
        match vector {
            Ok(items) => Datum::new(DatumKind::Vector(items), span),
            Err(error) => self.vector_fault(error, span),
        }
    }

    /// `#nA` before its contents; it ends before `middle`.
    pub(super) fn array(&mut self, start: u32, middle: u32, contents: Datum) -> Datum {
        let span = self.span(start, middle).to(contents.span());
        let rank = name::digits(self.slice(start + 1, middle - 1));
        let Some(rank) = rank.filter(|&rank| rank <= literal::MAX_RANK) else {
            let max = literal::MAX_RANK;
            let message = format!("expected a rank of at most {max}, found `{}`", self.slice(start, middle));
            return self.fail(code::INVALID_TOKEN.at(self.span(start, middle), message));
        };
        match literal::array(rank, contents) {
            Ok(kind) => Datum::new(kind, span),
            Err(ArrayError { span, axis, found, expected }) => {
                let message = match (expected, found) {
                    (Some(expected), Some(found)) => {
                        format!("expected {expected} elements in axis {axis}, found {found}")
                    }
                    _ => format!("expected a list or vector in axis {axis}, found something else"),
                };
                self.fail(code::MALFORMED_LITERAL.at(span, message))
            }
        }
    }

    /// `#n=` before its datum; it ends before `middle`.
    pub(super) fn label(&mut self, start: u32, middle: u32, datum: Datum) -> Datum {
        // The scanner has checked the number.
        let Some(number) = label_number(self.text, start, middle) else { return datum };
        let span = self.span(start, middle).to(datum.span());
        let datum = match self.inside.remove(&number) {
            None => datum,
            Some(placeholder) if placeholder.is_same(&datum) => {
                let message = "expected a datum after the label, found only a reference to it";
                return self.fail(code::CIRCULAR_LITERAL.at(span, message));
            }
            Some(placeholder) => self.made_by(&NAMES.read_circular, [placeholder, datum], span),
        };
        self.labels.insert(number, datum.clone());
        datum
    }

    /// `#n#`
    pub(super) fn reference(&mut self, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        let Some(number) = label_number(self.text, start, end) else { return Datum::nil(span) };
        if let Some(found) = self.labels.get(&number) {
            return found.clone();
        }
        // The scanner has checked that the label exists, so this is within its datum.
        let environment = &mut *self.environment;
        let placeholder = self.inside.entry(number).or_insert_with(|| {
            Datum::symbol(Symbol::uninterned(environment.fresh(), &format!("#{number}#")), span)
        });
        placeholder.clone()
    }

    /// Returns what the call of a macro of the library gives.
    fn made_by(&self, operator: &Symbol, arguments: impl IntoIterator<Item = Datum>, span: Span) -> Datum {
        let operator = Datum::symbol(operator.clone(), span);
        let call: Vec<Datum> = std::iter::once(operator).chain(arguments).collect();
        Datum::new(DatumKind::Call(Datum::list(call, span)), span)
    }

    /// `#.form`, `#S(…)`, `#P"…"`, `#C(…)`
    pub(super) fn call(&mut self, call: ReadCall, start: u32, datum: Datum) -> Datum {
        let operator = match call {
            ReadCall::Eval => &NAMES.read_eval,
            ReadCall::Structure => &NAMES.read_structure,
            ReadCall::Pathname => &NAMES.read_pathname,
            ReadCall::Complex => &NAMES.read_complex,
        };
        let span = self.span(start, start).to(datum.span());
        self.made_by(operator, [datum], span)
    }

    /// `#*0101`, `#n*0101`
    pub(super) fn bits(&mut self, start: u32, end: u32) -> Datum {
        let span = self.span(start, end);
        let (length, bits) = self.slice(start + 1, end).split_once('*').unwrap_or_default();
        if let Some(wrong) = bits.chars().find(|c| !matches!(c, '0' | '1')) {
            let message = format!("expected only 0 and 1 after `*`, found `{wrong}`");
            return self.fail(code::INVALID_TOKEN.at(span, message));
        }
        let items: Vec<Datum> = bits.bytes().map(|bit| Datum::integer(bit - b'0', span)).collect();
        let wanted = if length.is_empty() { Some(items.len() as u32) } else { name::digits(length) };
        match wanted.ok_or(VectorError::NoRoom).and_then(|n| literal::vector(Some(n), items, self.room)) {
            Ok(items) => {
                let text: String = items.iter().map(Datum::to_string).collect();
                self.made_by(&NAMES.read_bits, [Datum::string(&text, span)], span)
            }
            Err(error) => self.vector_fault(error, span),
        }
    }

    /// Reports why the elements of a vector do not suit its length.
    fn vector_fault(&mut self, error: VectorError, span: Span) -> Datum {
        self.fail(match error {
            VectorError::TooLong { length, count } => {
                let message = format!("expected a length of at least {count}, found {length}");
                code::MALFORMED_LITERAL.at(span, message)
            }
            VectorError::NothingToFill { length } => {
                let message = format!("expected an element to fill {length} places, found none");
                code::MALFORMED_LITERAL.at(span, message)
            }
            VectorError::NoRoom => {
                let message = "expected a vector of moderate length, found too many elements to fill in";
                code::LITERAL_TOO_LARGE.at(span, message).help("use `make-array` with `:initial-element`")
            }
        })
    }
}
