//! Data of the program as forms of the protocol, and forms as data.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::form::WireForm;
use crate::refusal::OperatorRefusal;

/// Most lists within each other of an answer; deeper ones are left out.
const DEPTH: usize = 50;

/// Returns what stands for the data of a text: as `sessions.esl` says, so that their symbols are not made.
///
/// # Errors
/// Why it is not data.
pub(crate) fn codes_of(text: &str) -> Result<Datum, OperatorRefusal> {
    let form = WireForm::parse(&format!("({text})"))
        .map_err(|reason| OperatorRefusal::NotData { text: text.into(), reason })?;
    Ok(list(form.items().unwrap_or_default().iter().map(code_of)))
}

// The depth of a form is bounded.
fn code_of(form: &WireForm) -> Datum {
    match form {
        WireForm::Integer(n) => integer(*n),
        WireForm::Text(text) => list([integer(0), string(text)]),
        WireForm::List(items) => list([integer(1)].into_iter().chain(items.iter().map(code_of))),
        WireForm::Symbol(name) => match name.parse::<f64>() {
            Ok(number) if number.is_finite() && name.contains(|c: char| c.is_ascii_digit()) => {
                Datum::new(DatumKind::Float(number), Span::default())
            }
            _ => string(&name.to_uppercase()),
        },
    }
}

/// Returns a list.
pub(crate) fn list(items: impl IntoIterator<Item = Datum>) -> Datum {
    Datum::list(items.into_iter().collect::<Vec<_>>(), Span::default())
}

/// Returns an integer.
pub(crate) fn integer(n: i64) -> Datum {
    Datum::integer(n, Span::default())
}

/// Returns a string.
pub(crate) fn string(text: &str) -> Datum {
    Datum::string(text, Span::default())
}

/// Returns `T` or `NIL`.
pub(crate) fn boolean(is_true: bool) -> Datum {
    if is_true { Datum::symbol(Symbol::cl("T"), Span::default()) } else { Datum::nil(Span::default()) }
}

/// Returns a value of the library's as a form: strings, integers and symbols, and lists of them.
pub(super) fn form_of(datum: &Datum) -> WireForm {
    form_within(datum, DEPTH)
}

fn form_within(datum: &Datum, depth: usize) -> WireForm {
    match datum.as_list() {
        Some(items) if depth > 0 => {
            WireForm::List(items.iter().map(|item| form_within(item, depth - 1)).collect())
        }
        Some(_) => WireForm::nil(),
        None => atom_of(datum),
    }
}

fn atom_of(datum: &Datum) -> WireForm {
    match datum.kind() {
        DatumKind::String(text) => WireForm::text(&**text),
        DatumKind::Float(number) => WireForm::Symbol(format!("{number:.6}")),
        DatumKind::Symbol(symbol) if symbol.is_keyword() => {
            WireForm::Symbol(format!(":{}", symbol.name().to_lowercase()))
        }
        DatumKind::Symbol(symbol) if symbol.is_cl("NIL") => WireForm::nil(),
        DatumKind::Symbol(symbol) => WireForm::Symbol(symbol.name().to_lowercase()),
        _ => datum.to_string().parse().map_or_else(|_| WireForm::text(datum.to_string()), WireForm::Integer),
    }
}
