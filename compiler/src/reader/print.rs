//! Data as text that reads back.
//!
//! For readers of expansions, and for tests; running programs print by the library. The text is one line,
//! which shows neither sharing nor the identity of symbols without a package. No native recursion.

use std::fmt::Write;

use esl_bytecode::datum::{Datum, DatumKind, ObjectId};
use esl_bytecode::package::Qualifier;
use esl_bytecode::symbol::{ESL_PACKAGE, Symbol};
use logos::Logos;

use super::character::CHARACTER_NAMES;
use super::lexer::Token;
use super::name::fold;
use super::number;

/// A part that is still to be printed.
enum PrintStep<'a> {
    /// A datum, the number of backquotes around it, and whether `,@` can stand in its place.
    Datum(&'a Datum, u32, bool),
    /// The elements of a list from this pair or tail on, then `)`.
    Rest(&'a Datum, u32),
    /// The items of one part of an array, along the first of these axes, from this offset on.
    Axis(&'a [u32], &'a [Datum], usize),
    Text(&'static str),
}

/// Returns the text of `datum`. `qualifier` chooses the prefix of a symbol; it is usually
/// [`Packages::qualifier`](esl_bytecode::package::Packages::qualifier).
pub fn print(datum: &Datum, qualifier: &dyn Fn(&Symbol) -> Qualifier) -> String {
    let mut out = String::new();
    let mut work = vec![PrintStep::Datum(datum, 0, false)];
    while let Some(item) = work.pop() {
        match item {
            PrintStep::Text(text) => out.push_str(text),
            PrintStep::Datum(datum, level, can_splice) => {
                print_one(datum, level, can_splice, qualifier, &mut out, &mut work)
            }
            PrintStep::Rest(rest, level) => match rest.kind() {
                DatumKind::Nil => out.push(')'),
                // `(a . ,b)` is `(a %unquote b)`.
                DatumKind::Cons(car, cdr)
                    if mark(car, cdr, level, false).is_some_and(|mark| mark.0 == ",") =>
                {
                    out.push_str(" . ");
                    work.push(PrintStep::Text(")"));
                    work.push(PrintStep::Datum(rest, level, false));
                }
                DatumKind::Cons(car, cdr) => {
                    out.push(' ');
                    work.push(PrintStep::Rest(cdr, level));
                    work.push(PrintStep::Datum(car, level, true));
                }
                _ => {
                    out.push_str(" . ");
                    work.push(PrintStep::Text(")"));
                    work.push(PrintStep::Datum(rest, level, false));
                }
            },
            PrintStep::Axis(dimensions, items, offset) => {
                print_axis(dimensions, items, offset, &mut out, &mut work)
            }
        }
    }
    out
}

fn print_one<'a>(
    datum: &'a Datum,
    level: u32,
    can_splice: bool,
    qualifier: &dyn Fn(&Symbol) -> Qualifier,
    out: &mut String,
    work: &mut Vec<PrintStep<'a>>,
) {
    // Writing to a string cannot fail.
    let _ = match datum.kind() {
        DatumKind::Nil => write!(out, "NIL"),
        DatumKind::Symbol(symbol) => {
            print_symbol(symbol, qualifier, out);
            Ok(())
        }
        DatumKind::Integer(value) => write!(out, "{value}"),
        DatumKind::Ratio(numerator, denominator) => write!(out, "{numerator}/{denominator}"),
        DatumKind::Float(value) if value.is_finite() => write!(out, "{value:?}"),
        DatumKind::Float(value) => write!(out, "#<float {value}>"),
        DatumKind::Object(ObjectId(id)) => write!(out, "#<object {id}>"),
        DatumKind::Opaque(opaque) => write!(out, "{opaque}"),
        DatumKind::Packed(vector) => write!(out, "{vector}"),
        DatumKind::Table(_) => write!(out, "{datum}"),
        DatumKind::Call(call) => {
            out.push_str("#.");
            work.push(PrintStep::Datum(call, level, true));
            Ok(())
        }
        DatumKind::Character(c) => print_character(*c, out),
        DatumKind::String(value) => write!(out, "\"{}\"", value.replace('\\', "\\\\").replace('"', "\\\"")),
        DatumKind::Cons(car, cdr) => {
            match mark(car, cdr, level, can_splice) {
                Some((mark, inner, level)) => {
                    out.push_str(mark);
                    // `,` before a name that begins with `@` or `.` would be another mark.
                    let is_glued =
                        mark == "," && inner.as_symbol().is_some_and(|s| s.name().starts_with(['@', '.']));
                    out.push_str(if is_glued { " " } else { "" });
                    work.push(PrintStep::Datum(inner, level, !mark.starts_with('`')));
                }
                None => {
                    out.push('(');
                    work.push(PrintStep::Rest(cdr, level));
                    work.push(PrintStep::Datum(car, level, true));
                }
            }
            Ok(())
        }
        DatumKind::Vector(items) => {
            print_items(items.iter().map(|item| PrintStep::Datum(item, level, true)), "#(", out, work);
            Ok(())
        }
        DatumKind::Array(dimensions, items) => {
            work.push(PrintStep::Axis(dimensions, items, 0));
            write!(out, "#{}A", dimensions.len())
        }
    };
}

fn print_items<'a>(
    items: impl DoubleEndedIterator<Item = PrintStep<'a>>,
    open: &str,
    out: &mut String,
    work: &mut Vec<PrintStep<'a>>,
) {
    out.push_str(open);
    work.push(PrintStep::Text(")"));
    let bottom = work.len();
    for item in items.rev() {
        work.push(item);
        work.push(PrintStep::Text(" "));
    }
    // No blank before the first.
    if work.len() > bottom {
        work.pop();
    }
}

fn print_axis<'a>(
    dimensions: &'a [u32],
    items: &'a [Datum],
    offset: usize,
    out: &mut String,
    work: &mut Vec<PrintStep<'a>>,
) {
    let Some((&length, inner)) = dimensions.split_first() else {
        return work.push(PrintStep::Datum(&items[offset], 0, false));
    };
    let step: usize = inner.iter().map(|&dimension| dimension as usize).product();
    let parts = (0..length as usize).map(|i| PrintStep::Axis(inner, items, offset + i * step));
    print_items(parts, "(", out, work);
}

/// Returns the mark that abbreviates the list of `car` and one more element, that element, and the number of
/// backquotes around it.
fn mark<'a>(
    car: &Datum,
    cdr: &'a Datum,
    level: u32,
    can_splice: bool,
) -> Option<(&'static str, &'a Datum, u32)> {
    let symbol = car.as_symbol()?;
    let (inner, tail) = cdr.as_cons()?;
    if !tail.is_nil() {
        return None;
    }
    let is_esl = symbol.is_in(ESL_PACKAGE);
    match symbol.name() {
        "QUOTE" if symbol.is_cl("QUOTE") => Some(("'", inner, level)),
        "FUNCTION" if symbol.is_cl("FUNCTION") => Some(("#'", inner, level)),
        "%BACKQUOTE" if is_esl => Some(("`", inner, level + 1)),
        "%UNQUOTE" if is_esl && level > 0 => Some((",", inner, level - 1)),
        "%UNQUOTE-SPLICING" if is_esl && level > 0 && can_splice => Some((",@", inner, level - 1)),
        _ => None,
    }
}

fn print_symbol(symbol: &Symbol, qualifier: &dyn Fn(&Symbol) -> Qualifier, out: &mut String) {
    match qualifier(symbol) {
        Qualifier::None => {}
        Qualifier::Keyword => out.push(':'),
        Qualifier::Uninterned => out.push_str("#:"),
        Qualifier::External(package) => {
            print_name(&package, out);
            out.push(':');
        }
        Qualifier::Internal(package) => {
            print_name(&package, out);
            out.push_str("::");
        }
    }
    print_name(symbol.name(), out);
}

fn print_name(name: &str, out: &mut String) {
    let mut lexer = Token::lexer(name);
    let is_plain = lexer.next() == Some(Ok(Token::Atom))
        && lexer.span() == (0..name.len())
        && number::parse(name, 10).is_none()
        && !name.contains(':')
        && !name.bytes().all(|byte| byte == b'.')
        && name.chars().all(|c| fold(c) == c);
    if is_plain {
        out.push_str(name);
    } else {
        out.push('|');
        out.push_str(&name.replace('\\', "\\\\").replace('|', "\\|"));
        out.push('|');
    }
}

fn print_character(c: char, out: &mut String) -> std::fmt::Result {
    let name = CHARACTER_NAMES.iter().find(|&&(_, named)| named == c);
    let is_stray = || Token::lexer(c.encode_utf8(&mut [0; 4])).next() == Some(Ok(Token::Stray));
    match name {
        Some((name, _)) => write!(out, "#\\{name}"),
        None if is_stray() => write!(out, "#\\U+{:04X}", u32::from(c)),
        None => write!(out, "#\\{c}"),
    }
}
