//! Forms: taking them apart, making them, and quoting them in messages.

use std::ops::RangeInclusive;

use esl_bytecode::compile::Environment;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::package::TAKEN_OVER;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::{ESL_PACKAGE, Symbol};
use rustc_hash::FxHashMap;

use crate::diagnostic::{DiagnosticCode, code};
use crate::habit::operator::between;

/// Outcome of a check of a form.
pub(super) type Checked<T = ()> = Result<T, Box<Diagnostic>>;

/// A compound form.
#[derive(Clone, Debug)]
pub(super) struct Form {
    /// The whole form.
    pub(super) datum: Datum,
    pub(super) operator: Symbol,
    pub(super) args: Vec<Datum>,
    /// Place of the form, of the form around it, or of the macro call that made it.
    pub(super) span: Span,
}

impl Form {
    /// Takes a compound form apart. `span` is its place, or that of the form around it.
    ///
    /// # Errors
    /// `not-an-operator`, `dotted-form`.
    pub(super) fn of(datum: &Datum, span: Span) -> Checked<Form> {
        let Some((head, rest)) = datum.as_cons() else {
            let message = format!("expected a compound form, found {}", quoted(datum));
            return Err(Box::new(code::MALFORMED_FORM.at(span, message)));
        };
        // Messages call a call of a `lambda` expression by the name `lambda`.
        let operator = match head.as_symbol() {
            Some(symbol) => symbol.clone(),
            None if is_cl_form(head, "LAMBDA") => Symbol::cl("LAMBDA"),
            None => return Err(not_an_operator(datum, head, span)),
        };
        let mut elements = rest.elements();
        let args = elements.by_ref().cloned().collect();
        let tail = elements.tail();
        if !tail.is_nil() {
            let message = format!("expected `)` at the end of a form, found a dot and {}", quoted(tail));
            return Err(Box::new(code::DOTTED_FORM.at(span_of(tail, span), message)));
        }
        Ok(Form { datum: datum.clone(), operator, args, span })
    }

    /// Returns the form as a call of the global function, whatever else the operator means.
    pub(super) fn globally(&self) -> Datum {
        Make(self.datum.span()).call(&self.operator, self.args.iter().cloned())
    }

    /// Returns the error that `what` follows the name of the operator, at the operator.
    pub(super) fn malformed(&self, what: &str) -> Box<Diagnostic> {
        self.fault(code::MALFORMED_FORM, self.head(), what)
    }

    /// Returns the error that `what` follows the name of the operator, at `span`.
    pub(super) fn malformed_at(&self, span: Span, what: &str) -> Box<Diagnostic> {
        self.fault(code::MALFORMED_FORM, span, what)
    }

    /// Returns an error of this code at `span`. The message is the name of the operator, followed by `what`.
    pub(super) fn fault(&self, code: &DiagnosticCode, span: Span, what: &str) -> Box<Diagnostic> {
        Box::new(code.at(self.at(span), format!("{} {what}", name(&self.operator))))
    }

    /// Returns the error for a form that ends before a part that it needs. `what` says what the form takes.
    pub(super) fn missing(&self, what: &str) -> Box<Diagnostic> {
        let count = match self.args.len() {
            0 => "no parts".to_string(),
            1 => "1 part only".to_string(),
            count => format!("{count} parts only"),
        };
        self.fault(code::MISSING_PART, self.head(), &format!("{what}, but has {count}"))
    }

    /// Returns the error for something other than a name as a part of this form.
    pub(super) fn not_a_name(&self, found: &Datum, what: &str) -> Box<Diagnostic> {
        self.fault(code::NOT_A_NAME, found.span(), &format!("{what}, not {}", quoted(found)))
    }

    /// Checks the number of arguments. `what` says what the form takes.
    ///
    /// # Errors
    /// `missing-part`, at the operator; `extra-part`, at the arguments beyond the last one that the form
    /// takes.
    pub(super) fn takes(&self, count: RangeInclusive<usize>, what: &str) -> Checked {
        if self.args.len() < *count.start() {
            return Err(self.missing(what));
        }
        let Some([first, others @ ..]) = self.args.get(*count.end()..) else { return Ok(()) };
        let last = others.last().unwrap_or(first);
        let is_known = is_known(first.span()) && is_known(last.span());
        let span = if is_known { first.span().to(last.span()) } else { self.span };
        let found = quoted(first);
        let found = if others.is_empty() { found } else { format!("{found} and more") };
        Err(self.fault(code::EXTRA_PART, span, &format!("{what}; {found} is too much")))
    }

    /// Returns the place of the operator.
    pub(super) fn head(&self) -> Span {
        self.datum.as_cons().map_or(self.span, |(head, _)| self.at(head.span()))
    }

    /// Returns `span` if it is known, and the place of the form otherwise.
    pub(super) fn at(&self, span: Span) -> Span {
        if is_known(span) { span } else { self.span }
    }

    /// Returns argument `index` as a name. `NIL` does not count as one.
    ///
    /// # Errors
    /// `missing-part`, `not-a-name`.
    pub(super) fn symbol(&self, index: usize, what: &str) -> Checked<Symbol> {
        let Some(arg) = self.args.get(index) else { return Err(self.missing(what)) };
        arg.as_symbol().cloned().ok_or_else(|| self.not_a_name(arg, what))
    }
}

/// The error for a form that begins with something other than the name of an operator.
fn not_an_operator(form: &Datum, head: &Datum, span: Span) -> Box<Diagnostic> {
    let args: Vec<Datum> =
        form.as_cons().map(|(_, rest)| rest.elements().take(3).cloned().collect()).unwrap_or_default();
    if let Some(foreign) = infix(Some(head), &args, span_of(form, span)) {
        return Box::new(foreign);
    }
    let message =
        format!("expected the name of an operator at the beginning of a form, found {}", quoted(head));
    let diagnostic = code::NOT_AN_OPERATOR.at(span_of(head, span), message);
    Box::new(match head.kind() {
        DatumKind::Cons(..) => {
            let call = on_one_line(head, QUOTED);
            diagnostic.help(format!("to call its value, write `(funcall {call} …)`"))
        }
        _ if form.as_list().is_some() => diagnostic.help("to make a list, write `(list …)` or quote it"),
        _ => diagnostic,
    })
}

/// Returns the error about a form at `span` whose first two parts are `left` and an operator that stands
/// between its operands; `None` for other forms.
pub(super) fn infix(left: Option<&Datum>, args: &[Datum], span: Span) -> Option<Diagnostic> {
    let (Some(left), [operator, right, rest @ ..]) = (left, args) else { return None };
    let symbol = operator.as_symbol().filter(|symbol| symbol.name().len() <= 3 && !symbol.is_keyword())?;
    let own = between(symbol.name())?;
    let shown = |part: &Datum| on_one_line(part, 20);
    let written = match (own, rest) {
        (_, []) => format!("({own} {} {})", shown(left), shown(right)),
        _ => format!("({own} {} …)", shown(left)),
    };
    let message =
        format!("the operator {} stands first in its form, not between its operands", quoted(operator));
    Some(code::FOREIGN_FORM.at(span, message).help(format!("write `{written}`")))
}

/// Whether a span is a place in a source. Data made by a program have an empty span.
pub(super) fn is_known(span: Span) -> bool {
    span.end > span.start
}

/// Returns a name as messages show it: in backticks, and in lower case unless it has lower case of its own.
pub(super) fn name(symbol: &Symbol) -> String {
    format!("`{}`", plain(symbol))
}

/// Returns a name between backticks, after its package.
pub(super) fn name_with_package(symbol: &Symbol) -> String {
    let package = symbol.package().map(|package| package.to_string().to_lowercase() + ":");
    format!("`{}{}`", package.unwrap_or_default(), plain(symbol))
}

/// Adds to a finding about a use of `symbol`, if ESL has taken over that name of Common Lisp, how to refer to
/// what it means there.
pub(super) fn with_namesake(diagnostic: Diagnostic, symbol: &Symbol) -> Diagnostic {
    if !symbol.is_in(ESL_PACKAGE) || !TAKEN_OVER.contains(&symbol.name()) {
        return diagnostic;
    }
    let standard = name_with_package(&Symbol::cl(symbol.name()));
    let help = format!("this is ESL's own {}; Common Lisp's is {standard}", name(symbol));
    let help = diagnostic.help.as_ref().map_or(help.clone(), |first| format!("{first}; {help}"));
    diagnostic.help(help)
}

/// Returns a name as [`name`], without the backticks.
pub(super) fn plain(symbol: &Symbol) -> String {
    let text = symbol.to_string();
    if text.chars().any(char::is_lowercase) { text } else { text.to_lowercase() }
}

/// Characters of a form that a message quotes.
const QUOTED: usize = 40;

/// Returns the beginning of a datum as messages show it.
pub(super) fn quoted(datum: &Datum) -> String {
    let text = on_one_line(datum, QUOTED);
    let short: String = text.chars().take(QUOTED).collect();
    if short.len() < text.len() { format!("`{short}…`") } else { format!("`{short}`") }
}

/// Returns a datum on one line, in lower case. A form may be as long as a file, so the text is cut soon after
/// `limit` characters.
pub(super) fn on_one_line(datum: &Datum, limit: usize) -> String {
    enum PrintPart<'a> {
        Datum(&'a Datum),
        Tail(&'a Datum),
        Text(&'static str),
    }
    let mut text = String::new();
    let mut parts = vec![PrintPart::Datum(datum)];
    while let Some(part) = parts.pop() {
        // The count of bytes decides only whether to count characters.
        if text.len() > 4 * limit || text.len() > limit && text.chars().count() > limit {
            break;
        }
        match part {
            PrintPart::Text(piece) => text.push_str(piece),
            PrintPart::Tail(tail) => match tail.kind() {
                DatumKind::Nil => text.push(')'),
                DatumKind::Cons(car, cdr) => {
                    text.push(' ');
                    parts.extend([PrintPart::Tail(cdr), PrintPart::Datum(car)]);
                }
                _ => {
                    text.push_str(" . ");
                    parts.extend([PrintPart::Text(")"), PrintPart::Datum(tail)]);
                }
            },
            PrintPart::Datum(datum) => match datum.kind() {
                DatumKind::Nil => text.push_str("()"),
                DatumKind::Symbol(symbol) => text.push_str(&plain(symbol)),
                DatumKind::Cons(car, cdr) => match abbreviation(car, cdr) {
                    Some((mark, quoted)) => {
                        text.push_str(mark);
                        parts.push(PrintPart::Datum(quoted));
                    }
                    None => {
                        text.push('(');
                        parts.extend([PrintPart::Tail(cdr), PrintPart::Datum(car)]);
                    }
                },
                DatumKind::Vector(items) => {
                    text.push_str("#(");
                    parts.push(PrintPart::Text(")"));
                    for (index, item) in items.iter().take(limit).enumerate().rev() {
                        parts.push(PrintPart::Datum(item));
                        if index > 0 {
                            parts.push(PrintPart::Text(" "));
                        }
                    }
                }
                DatumKind::Array(..) => text.push_str("#A(…)"),
                DatumKind::String(value) => {
                    let shown: String = value.chars().take(limit).collect();
                    text.push_str(&format!("\"{}\"", shown.replace('\\', "\\\\").replace('"', "\\\"")));
                }
                _ => text.push_str(&datum.to_string()),
            },
        }
    }
    text
}

/// Returns the mark that abbreviates a form such as `(quote x)`, and its argument.
pub(super) fn abbreviation<'a>(car: &'a Datum, cdr: &'a Datum) -> Option<(&'static str, &'a Datum)> {
    let operator = car.as_symbol()?;
    let (argument, rest) = cdr.as_cons()?;
    let mark = match operator.name() {
        "QUOTE" if operator.is_cl("QUOTE") => "'",
        "FUNCTION" if operator.is_cl("FUNCTION") => "#'",
        "%BACKQUOTE" if is_esl(operator, "%BACKQUOTE") => "`",
        "%UNQUOTE" if is_esl(operator, "%UNQUOTE") => ",",
        "%UNQUOTE-SPLICING" if is_esl(operator, "%UNQUOTE-SPLICING") => ",@",
        _ => return None,
    };
    rest.is_nil().then_some((mark, argument))
}

/// Whether `symbol` is the symbol `name` of the package `ESL`.
pub(super) fn is_esl(symbol: &Symbol, name: &str) -> bool {
    symbol.name() == name && symbol.is_in(ESL_PACKAGE)
}

/// Returns the operator of a compound form that begins with a symbol.
pub(super) fn operator(datum: &Datum) -> Option<&Symbol> {
    datum.as_cons()?.0.as_symbol()
}

/// Whether `datum` is a list that begins with the symbol `name` of the package `COMMON-LISP`.
pub(super) fn is_cl_form(datum: &Datum, name: &str) -> bool {
    operator(datum).is_some_and(|symbol| symbol.is_cl(name))
}

/// Returns the arguments of a compound form, if it is a proper list.
pub(super) fn arguments(datum: &Datum) -> Option<Vec<Datum>> {
    let (_, rest) = datum.as_cons()?;
    Some(rest.as_list()?.into_iter().cloned().collect())
}

/// Whether `datum` always has the same value and no effect: a literal or a quoted datum.
pub(super) fn is_constant(datum: &Datum) -> bool {
    match datum.kind() {
        DatumKind::Symbol(symbol) => symbol.is_keyword() || symbol.is_cl("T"),
        DatumKind::Cons(..) => is_cl_form(datum, "QUOTE"),
        _ => true,
    }
}

/// Returns the value of a constant form (see [`is_constant`]).
pub(super) fn constant_value(datum: &Datum) -> Option<Datum> {
    match datum.kind() {
        DatumKind::Cons(car, cdr) if car.as_symbol().is_some_and(|symbol| symbol.is_cl("QUOTE")) => {
            let (value, rest) = cdr.as_cons()?;
            rest.is_nil().then(|| value.clone())
        }
        _ => is_constant(datum).then(|| datum.clone()),
    }
}

/// Refuses two equal names.
///
/// # Errors
/// `duplicate-parameter`.
pub(super) fn check_distinct<'a>(
    names: impl IntoIterator<Item = (&'a Symbol, Span)>,
    form: &Form,
) -> Checked {
    let mut seen = FxHashMap::default();
    for (symbol, span) in names {
        if let Some(first) = seen.insert(symbol, span) {
            return Err(bound_twice(symbol, (first, span), form));
        }
    }
    Ok(())
}

/// The error for a name that a form binds at two places.
pub(super) fn bound_twice(symbol: &Symbol, (first, second): (Span, Span), form: &Form) -> Box<Diagnostic> {
    let message = format!("{} is bound twice", name(symbol));
    let diagnostic = code::DUPLICATE_PARAMETER.at(form.at(second), message);
    Box::new(diagnostic.also(form.at(first), "it is bound here already"))
}

/// Returns the place of `datum` if that is known, and `otherwise` if not.
pub(super) fn span_of(datum: &Datum, otherwise: Span) -> Span {
    if is_known(datum.span()) { datum.span() } else { otherwise }
}

/// Creates an uninterned symbol.
pub(super) fn fresh(environment: &mut dyn Environment, name: &str) -> Symbol {
    Symbol::uninterned(environment.fresh(), name)
}

/// Makes forms that all have one place in the source.
#[derive(Clone, Copy, Debug)]
pub(super) struct Make(pub(super) Span);

impl Make {
    /// Returns a symbol.
    pub(super) fn symbol(self, symbol: &Symbol) -> Datum {
        Datum::symbol(symbol.clone(), self.0)
    }

    /// Creates an uninterned symbol.
    pub(super) fn fresh(self, environment: &mut dyn Environment, name: &str) -> Datum {
        Datum::symbol(fresh(environment, name), self.0)
    }

    /// Returns the empty list.
    pub(super) fn nil(self) -> Datum {
        Datum::nil(self.0)
    }

    /// Returns a list.
    pub(super) fn list<const N: usize>(self, items: [Datum; N]) -> Datum {
        Datum::list(items, self.0)
    }

    /// Returns a list of any number of items.
    pub(super) fn items(self, items: impl IntoIterator<Item = Datum>) -> Datum {
        Datum::list(items.into_iter().collect::<Vec<_>>(), self.0)
    }

    /// Returns `(operator . args)`; the operator is a symbol of the package `COMMON-LISP`.
    pub(super) fn cl(self, operator: &str, args: impl IntoIterator<Item = Datum>) -> Datum {
        let operator = self.symbol(&Symbol::cl(operator));
        self.items(std::iter::once(operator).chain(args))
    }

    /// Returns `(operator . args)`; the operator is a symbol of the package `ESL`.
    pub(super) fn esl(self, operator: &str, args: impl IntoIterator<Item = Datum>) -> Datum {
        let operator = self.symbol(&Symbol::esl(operator));
        self.items(std::iter::once(operator).chain(args))
    }

    /// Returns a call of the global function `function`, even where a local function has its name.
    pub(super) fn call(self, function: &Symbol, args: impl IntoIterator<Item = Datum>) -> Datum {
        self.esl("%CALL-GLOBAL", std::iter::once(self.symbol(function)).chain(args))
    }

    /// Returns a call of the standard function `function`.
    pub(super) fn call_cl(self, function: &str, args: impl IntoIterator<Item = Datum>) -> Datum {
        self.call(&Symbol::cl(function), args)
    }

    /// Returns a call of the function `function` of the package `ESL`.
    pub(super) fn call_esl(self, function: &str, args: impl IntoIterator<Item = Datum>) -> Datum {
        self.call(&Symbol::esl(function), args)
    }

    /// Returns a quoted datum.
    pub(super) fn quote(self, datum: Datum) -> Datum {
        self.cl("QUOTE", [datum])
    }

    /// Returns `(let* bindings . body)`, or the body alone if there are no bindings.
    pub(super) fn let_in_order(self, bindings: Vec<(Datum, Datum)>, body: Vec<Datum>) -> Datum {
        if bindings.is_empty() {
            return self.progn(body);
        }
        let bindings = self.items(bindings.into_iter().map(|(name, value)| self.list([name, value])));
        self.cl("LET*", std::iter::once(bindings).chain(body))
    }

    /// Returns `(progn . body)`, or the only form of the body.
    pub(super) fn progn(self, mut body: Vec<Datum>) -> Datum {
        match body.len() {
            1 => body.swap_remove(0),
            _ => self.cl("PROGN", body),
        }
    }
}
