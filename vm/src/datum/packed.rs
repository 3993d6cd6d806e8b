//! Vectors of numbers, and strings of all kinds, which cross the border to the host as wholes.

use esl_bytecode::Bytes;
use esl_bytecode::datum::DatumKind;
use esl_bytecode::packed::PackedVector;
use esl_heap::array::{ArrayElements, vector_elements};

use super::DatumError;
use crate::heap::{AllocError, Heap, Kind};
use crate::names::load::integer;
use crate::value::Value;

/// Returns the object of a vector.
///
/// # Errors
/// As for every allocation.
pub(super) fn value_of(heap: &mut Heap, vector: &PackedVector) -> Result<Value, AllocError> {
    let mut elements = Vec::with_capacity(vector.len());
    match vector {
        PackedVector::Bytes(bytes) => return heap.alloc_bytes(bytes),
        PackedVector::Floats(floats) => {
            for &x in floats.iter() {
                elements.push(heap.float(x)?);
            }
        }
        PackedVector::Integers(integers) => {
            for &n in integers.iter() {
                elements.push(integer_of(heap, n)?);
            }
        }
    }
    heap.alloc_vector(&elements)
}

/// Returns an integer.
///
/// # Errors
/// As for every allocation.
pub(super) fn integer_of(heap: &mut Heap, n: i64) -> Result<Value, AllocError> {
    match Value::fixnum(n) {
        Some(value) => Ok(value),
        None => integer(heap, &n.into()),
    }
}

/// Returns the datum that a vector is as a whole: bytes, if its elements are bytes or bits by their type;
/// floats, if all elements are, of which there is at least one; a string, if it is one with a fill pointer
/// or the like.
///
/// # Errors
/// [`DatumError::NoRoom`], if there is no room for a copy.
pub(super) fn whole_of(heap: &Heap, object: Value) -> Result<Option<DatumKind>, DatumError> {
    let check_room = |bytes: usize| if bytes > heap.room() { Err(DatumError::NoRoom(bytes)) } else { Ok(()) };
    match vector_elements(heap, object) {
        Some(ArrayElements::Bytes(bytes) | ArrayElements::Bits(bytes)) => {
            check_room(bytes.len())?;
            Ok(Some(DatumKind::Packed(PackedVector::Bytes(Bytes::copy_from_slice(bytes)))))
        }
        Some(ArrayElements::Values(values))
            if !values.is_empty() && values.iter().all(|&value| heap.as_double(value).is_some()) =>
        {
            check_room(size_of_val(values))?;
            let floats = values.iter().map(|&value| heap.as_double(value).unwrap_or(f64::NAN));
            Ok(Some(DatumKind::Packed(PackedVector::Floats(floats.collect()))))
        }
        Some(ArrayElements::Characters(codes)) if heap.is(object, Kind::Array) => {
            check_room(size_of_val(codes))?;
            let character = |&code: &u32| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
            Ok(Some(DatumKind::String(codes.iter().map(character).collect::<String>().into())))
        }
        _ => Ok(None),
    }
}
