//! The shapes of vector and array literals.

use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;

/// Arrays have at most so many dimensions.
pub const MAX_RANK: u32 = 8;

/// An array of `rank` dimensions with these contents: lists, vectors or strings, nested `rank` deep.
///
/// # Errors
/// The place and the fault, if the contents do not form a block.
pub(super) fn array(rank: u32, contents: Datum) -> Result<DatumKind, (Span, String)> {
    let mut level = vec![contents];
    let mut dimensions = Vec::new();
    for axis in 0..rank {
        let mut next = Vec::new();
        let mut length = None;
        for part in &level {
            let before = next.len();
            if !extend(&mut next, part) {
                return Err((
                    part.span(),
                    format!("expected a list or vector in axis {axis}, found something else"),
                ));
            }
            let found = next.len() - before;
            let expected = *length.get_or_insert(found);
            if found != expected {
                return Err((
                    part.span(),
                    format!("expected {expected} elements in axis {axis}, found {found}"),
                ));
            }
        }
        dimensions.push(u32::try_from(length.unwrap_or(0)).expect("texts are shorter than 4 GiB"));
        level = next;
    }
    Ok(if rank == 1 {
        DatumKind::Vector(level.into())
    } else {
        DatumKind::Array(dimensions.into(), level.into())
    })
}

/// Adds the elements of a sequence. False if it is none.
fn extend(items: &mut Vec<Datum>, sequence: &Datum) -> bool {
    match sequence.kind() {
        DatumKind::Vector(elements) => items.extend(elements.iter().cloned()),
        DatumKind::String(text) => {
            items.extend(text.chars().map(|c| Datum::new(DatumKind::Character(c), sequence.span())));
        }
        _ => {
            let mut elements = sequence.elements();
            items.extend(elements.by_ref().cloned());
            return elements.tail().is_nil();
        }
    }
    true
}

/// The elements of `#n(…)`: the last one fills what is left of the length. `room` is how many elements may be filled
/// in, and is reduced.
///
/// # Errors
/// The fault, or `None` if there is no room.
pub(super) fn vector(
    length: Option<u32>,
    mut items: Vec<Datum>,
    room: &mut usize,
) -> Result<Arc<[Datum]>, Option<String>> {
    if let Some(length) = length {
        let length = length as usize;
        if items.len() > length {
            return Err(Some(format!("expected a length of at least {}, found {length}", items.len())));
        }
        let missing = length - items.len();
        if missing > *room {
            return Err(None);
        }
        *room -= missing;
        match items.last().cloned() {
            Some(last) => items.resize(length, last),
            None if length > 0 => {
                return Err(Some(format!("expected an element to fill {length} places, found none")));
            }
            None => {}
        }
    }
    Ok(items.into())
}
