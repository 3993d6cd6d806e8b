//! The shapes of vector and array literals.

use std::sync::Arc;

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;

/// Dimensions of an array, at most.
pub const MAX_RANK: u32 = 8;

/// A part of an array's contents that does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ArrayError {
    /// Place of the part.
    pub(super) span: Span,
    /// Axis of the array, from 0.
    pub(super) axis: u32,
    /// Number of elements that the part must have; `None` if it is not a sequence.
    pub(super) expected: Option<usize>,
    /// Number of elements that it has.
    pub(super) found: Option<usize>,
}

/// Why the elements of `#n(…)` do not form a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VectorError {
    /// There are more elements than the length says.
    TooLong {
        /// Length as written.
        length: usize,
        /// Number of elements.
        count: usize,
    },
    /// There is no element to fill the vector with.
    NothingToFill {
        /// Length as written.
        length: usize,
    },
    /// Too many elements would have to be filled in.
    NoRoom,
}

/// Returns the array of `rank` dimensions with these contents: lists, vectors or strings, nested `rank` deep.
///
/// # Errors
/// [`ArrayError`], if the contents do not form a block.
pub(super) fn array(rank: u32, contents: Datum) -> Result<DatumKind, ArrayError> {
    let mut level = vec![contents];
    let mut dimensions = Vec::new();
    for axis in 0..rank {
        let mut next = Vec::new();
        let mut length = None;
        for part in &level {
            let before = next.len();
            if !extend(&mut next, part) {
                return Err(ArrayError { span: part.span(), axis, expected: None, found: None });
            }
            let found = next.len() - before;
            let expected = *length.get_or_insert(found);
            if found != expected {
                let (expected, found) = (Some(expected), Some(found));
                return Err(ArrayError { span: part.span(), axis, expected, found });
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

/// Adds the elements of a sequence. Returns whether it is one.
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

/// Returns the elements of `#n(…)`, in which the last one fills the rest of the length. `room` is the number
/// of elements that may be filled in, and is reduced.
///
/// # Errors
/// [`VectorError`].
pub(super) fn vector(
    length: Option<u32>,
    mut items: Vec<Datum>,
    room: &mut usize,
) -> Result<Arc<[Datum]>, VectorError> {
    if let Some(length) = length {
        let length = length as usize;
        if items.len() > length {
            return Err(VectorError::TooLong { length, count: items.len() });
        }
        let missing = length - items.len();
        if missing > *room {
            return Err(VectorError::NoRoom);
        }
        *room -= missing;
        match items.last().cloned() {
            Some(last) => items.resize(length, last),
            None if length > 0 => return Err(VectorError::NothingToFill { length }),
            None => {}
        }
    }
    Ok(items.into())
}
