//! Data and the parts of objects: making one of them, and comparing.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;

use super::walk::{ObjectParts, parts_of};
use crate::heap::Heap;
use crate::table::Table;
use crate::value::Value;

/// Returns a new datum for an object with these parts.
pub(super) fn datum_with(heap: &Heap, object: Value, parts: Vec<Datum>, span: Span) -> Datum {
    match parts_of(heap, object) {
        Some(ObjectParts::Items(Some(dimensions), _)) => {
            let dimensions = dimensions.iter().map(|size| size.as_index().unwrap_or(0) as u32).collect();
            Datum::new(DatumKind::Array(dimensions, parts.into()), span)
        }
        Some(ObjectParts::Pair(..)) => {
            let mut parts = parts.into_iter();
            match (parts.next(), parts.next()) {
                (Some(car), Some(cdr)) => Datum::cons(car, cdr, span),
                _ => Datum::nil(span),
            }
        }
        // Tables, and vectors of all kinds, have parts for the embedder only.
        None if Table::of(heap, object).is_some() => Datum::new(DatumKind::Table(parts.into()), span),
        Some(ObjectParts::Items(None, _) | ObjectParts::Entries(_)) | None => {
            Datum::new(DatumKind::Vector(parts.into()), span)
        }
    }
}

/// Returns whether `datum` has exactly these parts.
pub(super) fn are_parts(datum: &Datum, parts: &[Datum]) -> bool {
    match datum.kind() {
        DatumKind::Cons(car, cdr) => {
            parts.len() == 2 && is_equivalent(car, &parts[0]) && is_equivalent(cdr, &parts[1])
        }
        DatumKind::Vector(items) | DatumKind::Array(_, items) => {
            items.len() == parts.len() && items.iter().zip(parts).all(|(a, b)| is_equivalent(a, b))
        }
        _ => false,
    }
}

/// Returns whether both are the same node, or atoms that a program cannot distinguish.
fn is_equivalent(a: &Datum, b: &Datum) -> bool {
    a.is_same(b)
        || match (a.kind(), b.kind()) {
            (DatumKind::Nil, DatumKind::Nil) => true,
            (DatumKind::Symbol(a), DatumKind::Symbol(b)) => a == b,
            (DatumKind::Integer(a), DatumKind::Integer(b)) => a == b,
            (DatumKind::Ratio(a, b), DatumKind::Ratio(c, d)) => (a, b) == (c, d),
            (DatumKind::Float(a), DatumKind::Float(b)) => a.to_bits() == b.to_bits(),
            (DatumKind::Character(a), DatumKind::Character(b)) => a == b,
            (DatumKind::Object(a), DatumKind::Object(b)) => a == b,
            (DatumKind::Opaque(a), DatumKind::Opaque(b)) => a == b,
            _ => false,
        }
}
