//! The text of a datum, for messages and snapshots.

use std::fmt;

use super::{Datum, DatumKind, ObjectId};

impl fmt::Display for Datum {
    /// Returns the datum as it could be read again, as far as that goes; deep and long parts are cut off with
    /// `#` and `...`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        display(self, f, 0)
    }
}

/// How deep and how long [`Datum`]'s display goes: it is meant for messages and snapshots.
const DISPLAY_DEPTH: u32 = 40;
const DISPLAY_LENGTH: usize = 1000;

fn display(datum: &Datum, f: &mut fmt::Formatter<'_>, depth: u32) -> fmt::Result {
    if depth > DISPLAY_DEPTH {
        return f.write_str("#");
    }
    match datum.kind() {
        DatumKind::Nil => f.write_str("NIL"),
        DatumKind::Symbol(symbol) => write!(f, "{symbol}"),
        DatumKind::Integer(value) => write!(f, "{value}"),
        DatumKind::Ratio(numerator, denominator) => write!(f, "{numerator}/{denominator}"),
        DatumKind::Float(value) => write!(f, "{value:?}"),
        DatumKind::Character(c) => write!(f, "#\\{c}"),
        DatumKind::String(value) => write!(f, "{value:?}"),
        DatumKind::Object(ObjectId(id)) => write!(f, "#<object {id}>"),
        DatumKind::Packed(vector) => write!(f, "{vector}"),
        DatumKind::Opaque(opaque) => write!(f, "{opaque}"),
        DatumKind::Call(call) => {
            f.write_str("#.")?;
            display(call, f, depth + 1)
        }
        DatumKind::Cons(..) => {
            f.write_str("(")?;
            let mut elements = datum.elements();
            for (i, item) in elements.by_ref().enumerate() {
                if i > 0 {
                    f.write_str(" ")?;
                }
                if i == DISPLAY_LENGTH {
                    return f.write_str("...)");
                }
                display(item, f, depth + 1)?;
            }
            if !elements.tail().is_nil() {
                f.write_str(" . ")?;
                display(elements.tail(), f, depth + 1)?;
            }
            f.write_str(")")
        }
        DatumKind::Vector(items) => display_items(items, ["#(", ")"], f, depth),
        DatumKind::Array(dimensions, items) => {
            display_items(items, [&format!("#{}A(", dimensions.len()), ")"], f, depth)
        }
        DatumKind::Table(items) => display_items(items, ["#<hash-table ", ">"], f, depth),
    }
}

fn display_items(
    items: &[Datum],
    [open, close]: [&str; 2],
    f: &mut fmt::Formatter<'_>,
    depth: u32,
) -> fmt::Result {
    f.write_str(open)?;
    for (i, item) in items.iter().enumerate() {
        if i > 0 {
            f.write_str(" ")?;
        }
        if i == DISPLAY_LENGTH {
            return write!(f, "...{close}");
        }
        display(item, f, depth + 1)?;
    }
    f.write_str(close)
}
