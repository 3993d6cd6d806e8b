//! Elements of arrays, wherever they are kept.
//!
//! A simple vector, a string and a row of bytes or bits are arrays of rank 1 by themselves; every other array
//! is a record over one of these, its *data*, or over a part of another array, to which it is *displaced*.
//! The data decides what the elements may be: any value, characters, integers below 256, or bits.
//!
//! Guarantees: if the dimensions or the fill pointer of an array ask for more elements than its data holds,
//! the array has those that are there. An array that is displaced to itself, by way of others, or by way of
//! too many others, has no elements.
//!
//! Not here: storing elements; creating and changing arrays.

use smallvec::{SmallVec, smallvec};

use crate::heap::{Heap, Kind};
use crate::value::Value;

/// Elements of an array.
#[derive(Clone, Copy, Debug)]
pub enum ArrayElements<'a> {
    /// Any values.
    Values(&'a [Value]),
    /// Code points.
    Characters(&'a [u32]),
    /// Integers below 256.
    Bytes(&'a [u8]),
    /// 0 and 1.
    Bits(&'a [u8]),
}

/// Arrays that stand between a displaced array and its data, at most.
pub const MAX_DISPLACEMENTS: usize = 64;

impl<'a> ArrayElements<'a> {
    /// Returns the elements in `data`, an array's data or a simple array itself.
    pub fn of_data(heap: &'a Heap, data: Value) -> Option<ArrayElements<'a>> {
        Some(match heap.kind(data)? {
            Kind::SimpleVector => ArrayElements::Values(heap.vector(data)?),
            Kind::String => ArrayElements::Characters(heap.string(data)?),
            Kind::Bytes if heap.is_bits(data) => ArrayElements::Bits(heap.bytes(data)?),
            Kind::Bytes => ArrayElements::Bytes(heap.bytes(data)?),
            _ => return None,
        })
    }

    /// Returns the number of elements.
    pub fn len(self) -> usize {
        match self {
            ArrayElements::Values(values) => values.len(),
            ArrayElements::Characters(characters) => characters.len(),
            ArrayElements::Bytes(bytes) | ArrayElements::Bits(bytes) => bytes.len(),
        }
    }

    /// Returns whether there are no elements.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Returns the element at `index`.
    pub fn get(self, index: usize) -> Option<Value> {
        match self {
            ArrayElements::Values(values) => values.get(index).copied(),
            ArrayElements::Characters(characters) => Value::character(*characters.get(index)?),
            ArrayElements::Bytes(bytes) | ArrayElements::Bits(bytes) => {
                bytes.get(index).map(|&byte| Value::small(i32::from(byte)))
            }
        }
    }

    /// Returns the elements from `start` to before `end`.
    ///
    /// # Panics
    /// If `start` is above `end`, or `end` above the number of elements.
    pub fn part(self, start: usize, end: usize) -> ArrayElements<'a> {
        match self {
            ArrayElements::Values(values) => ArrayElements::Values(&values[start..end]),
            ArrayElements::Characters(characters) => ArrayElements::Characters(&characters[start..end]),
            ArrayElements::Bytes(bytes) => ArrayElements::Bytes(&bytes[start..end]),
            ArrayElements::Bits(bits) => ArrayElements::Bits(&bits[start..end]),
        }
    }
}

/// Returns the data of an array, and the index of the array's first element in it. The data of a simple array
/// is the array itself.
pub fn storage(heap: &Heap, array: Value) -> Option<(Value, usize)> {
    let (mut at, mut offset) = (array, 0usize);
    for _ in 0..=MAX_DISPLACEMENTS {
        match heap.kind(at)? {
            Kind::SimpleVector | Kind::String | Kind::Bytes => return Some((at, offset)),
            Kind::Array => {
                let array = heap.array(at)?;
                offset = offset.checked_add(array.offset.as_index().unwrap_or(0))?;
                at = array.data;
            }
            _ => return None,
        }
    }
    None
}

/// Returns all elements of an array, even those behind a fill pointer.
pub fn all_elements(heap: &Heap, array: Value) -> Option<ArrayElements<'_>> {
    let size = total_size(heap, array)?;
    let Some((data, offset)) = storage(heap, array) else { return Some(ArrayElements::Values(&[])) };
    let elements = ArrayElements::of_data(heap, data)?;
    let start = offset.min(elements.len());
    Some(elements.part(start, start + size.min(elements.len() - start)))
}

/// Returns the elements of a vector, up to its fill pointer.
pub fn vector_elements(heap: &Heap, vector: Value) -> Option<ArrayElements<'_>> {
    let elements = all_elements(heap, vector)?;
    match heap.array(vector) {
        None => Some(elements),
        Some(array) if array.header.aux == 1 => {
            let length = array.fill.as_index().unwrap_or(usize::MAX).min(elements.len());
            Some(elements.part(0, length))
        }
        Some(_) => None,
    }
}

/// Returns the number of elements of a vector, up to its fill pointer.
pub fn vector_length(heap: &Heap, vector: Value) -> Option<usize> {
    vector_elements(heap, vector).map(ArrayElements::len)
}

/// Returns the product of the dimensions.
pub fn total_size(heap: &Heap, array: Value) -> Option<usize> {
    match heap.array_dimensions(array) {
        Some(dimensions) => {
            dimensions.iter().try_fold(1usize, |size, v| size.checked_mul(v.as_index().unwrap_or(0)))
        }
        None => ArrayElements::of_data(heap, array).map(ArrayElements::len),
    }
}

/// Returns the dimensions.
pub fn dimensions(heap: &Heap, array: Value) -> Option<SmallVec<[usize; 4]>> {
    match heap.array_dimensions(array) {
        Some(dimensions) => Some(dimensions.iter().map(|v| v.as_index().unwrap_or(0)).collect()),
        None => total_size(heap, array).map(|size| smallvec![size]),
    }
}

/// Returns an element of an array of two dimensions that keeps any values and is not displaced, if both
/// subscripts are below their dimensions.
pub fn matrix_element(heap: &Heap, array: Value, row: Value, column: Value) -> Option<Value> {
    let &[rows, columns] = heap.array_dimensions(array)? else { return None };
    let array = heap.array(array)?;
    let (row, column, columns) = (row.as_index()?, column.as_index()?, columns.as_index()?);
    if array.offset.is_true() || row >= rows.as_index()? || column >= columns {
        return None;
    }
    heap.vector(array.data)?.get(row * columns + column).copied()
}
