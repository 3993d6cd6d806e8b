//! Vectors of numbers, which cross the border to the host as wholes.

use esl_bytecode::Bytes;
use esl_bytecode::packed::PackedVector;
use esl_heap::array::{ArrayElements, vector_elements};

use super::DatumError;
use crate::heap::{AllocError, Heap};
use crate::names::load::integer;
use crate::value::Value;

/// Returns the object of a vector.
///
/// # Errors
/// As for every allocation.
pub(super) fn value_of(heap: &mut Heap, vector: &PackedVector) -> Result<Value, AllocError> {
    let elements: Vec<Value> = match vector {
        PackedVector::Bytes(bytes) => return heap.alloc_bytes(bytes),
        PackedVector::Floats(floats) => floats.iter().map(|&x| heap.float(x)).collect::<Result<_, _>>()?,
        PackedVector::Integers(integers) => {
            let mut value = |&n: &i64| Value::fixnum(n).map_or_else(|| integer(heap, &n.into()), Ok);
            integers.iter().map(&mut value).collect::<Result<_, _>>()?
        }
    };
    heap.alloc_vector(&elements)
}

/// Returns the vector that an object is, if its elements are bytes by their type, or floats, of which there
/// is at least one.
///
/// # Errors
/// [`DatumError::NoRoom`], if there is no room for a copy.
pub(super) fn vector_of(heap: &Heap, object: Value) -> Result<Option<PackedVector>, DatumError> {
    let check_room = |bytes: usize| if bytes > heap.room() { Err(DatumError::NoRoom(bytes)) } else { Ok(()) };
    match vector_elements(heap, object) {
        Some(ArrayElements::Bytes(bytes)) => {
            check_room(bytes.len())?;
            Ok(Some(PackedVector::Bytes(Bytes::copy_from_slice(bytes))))
        }
        Some(ArrayElements::Values(values))
            if !values.is_empty() && values.iter().all(|&value| heap.as_double(value).is_some()) =>
        {
            check_room(size_of_val(values))?;
            let floats = values.iter().map(|&value| heap.as_double(value).unwrap_or(f64::NAN));
            Ok(Some(PackedVector::Floats(floats.collect())))
        }
        _ => Ok(None),
    }
}
