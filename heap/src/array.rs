//! Elements of arrays, wherever they are kept.
//!
//! A simple vector, a string and a row of bytes are arrays of rank 1 by themselves; every other array is a
//! record over one of these, its *data*. The data decides what the elements may be: any value, characters, or
//! integers below 256.
//!
//! Guarantees: an array whose dimensions or fill pointer ask for more than its data holds has the elements
//! that are there.
//!
//! Not here: storing elements, and making and changing arrays.

use smallvec::{SmallVec, smallvec};

use crate::heap::{Heap, Kind};
use crate::value::Value;

/// The elements of an array.
#[derive(Clone, Copy, Debug)]
pub enum Elements<'a> {
    /// Any values.
    Values(&'a [Value]),
    /// Code points.
    Characters(&'a [u32]),
    /// Integers below 256.
    Bytes(&'a [u8]),
}

impl<'a> Elements<'a> {
    /// The elements in `data`, which an array may have or be.
    pub fn of_data(heap: &'a Heap, data: Value) -> Option<Elements<'a>> {
        Some(match heap.kind(data)? {
            Kind::SimpleVector => Elements::Values(heap.vector(data)?),
            Kind::String => Elements::Characters(heap.string(data)?),
            Kind::Bytes => Elements::Bytes(heap.bytes(data)?),
            _ => return None,
        })
    }

    /// Their number.
    pub fn len(self) -> usize {
        match self {
            Elements::Values(values) => values.len(),
            Elements::Characters(characters) => characters.len(),
            Elements::Bytes(bytes) => bytes.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// The element at `index`.
    pub fn get(self, index: usize) -> Option<Value> {
        match self {
            Elements::Values(values) => values.get(index).copied(),
            Elements::Characters(characters) => Value::character(*characters.get(index)?),
            Elements::Bytes(bytes) => bytes.get(index).map(|&byte| Value::small(i32::from(byte))),
        }
    }

    /// Those from `start` to before `end`.
    ///
    /// # Panics
    /// If `start` is above `end`, or `end` above the number of elements.
    pub fn part(self, start: usize, end: usize) -> Elements<'a> {
        match self {
            Elements::Values(values) => Elements::Values(&values[start..end]),
            Elements::Characters(characters) => Elements::Characters(&characters[start..end]),
            Elements::Bytes(bytes) => Elements::Bytes(&bytes[start..end]),
        }
    }
}

/// What keeps the elements of an array: the array itself if it is simple.
pub fn data_of(heap: &Heap, array: Value) -> Option<Value> {
    match heap.kind(array)? {
        Kind::SimpleVector | Kind::String | Kind::Bytes => Some(array),
        Kind::Array => heap.array(array).map(|array| array.data),
        _ => None,
    }
}

/// All elements of an array, those behind a fill pointer too.
pub fn all_elements(heap: &Heap, array: Value) -> Option<Elements<'_>> {
    let elements = Elements::of_data(heap, data_of(heap, array)?)?;
    let size = total_size(heap, array)?.min(elements.len());
    Some(elements.part(0, size))
}

/// The elements of a vector, up to its fill pointer.
pub fn vector_elements(heap: &Heap, vector: Value) -> Option<Elements<'_>> {
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

/// Number of elements of a vector, up to its fill pointer.
pub fn vector_length(heap: &Heap, vector: Value) -> Option<usize> {
    vector_elements(heap, vector).map(Elements::len)
}

/// Product of the dimensions.
pub fn total_size(heap: &Heap, array: Value) -> Option<usize> {
    match heap.array_dimensions(array) {
        Some(dimensions) => {
            dimensions.iter().try_fold(1usize, |size, v| size.checked_mul(v.as_index().unwrap_or(0)))
        }
        None => Elements::of_data(heap, array).map(Elements::len),
    }
}

/// The dimensions, as counts.
pub fn dimensions(heap: &Heap, array: Value) -> Option<SmallVec<[usize; 4]>> {
    match heap.array_dimensions(array) {
        Some(dimensions) => Some(dimensions.iter().map(|v| v.as_index().unwrap_or(0)).collect()),
        None => total_size(heap, array).map(|size| smallvec![size]),
    }
}
