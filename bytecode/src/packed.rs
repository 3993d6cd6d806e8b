//! Vectors of numbers that cross the border between a program and its host without a datum for each element:
//! the payload of a message, an image, a scan of a laser.
//!
//! Guarantees: cloning is cheap and shares the elements.

use std::borrow::Cow;
use std::fmt;
use std::sync::Arc;

use bytes::Bytes;

/// A vector of numbers of one kind.
///
/// To a program, bytes are a vector with the element type `(unsigned-byte 8)`; the others are simple vectors.
/// From a program come as [`PackedVector::Bytes`] all vectors with that element type and those of bits, and
/// as [`PackedVector::Floats`] all vectors whose elements are floats, of which there is at least one.
#[derive(Clone, Debug, PartialEq)]
pub enum PackedVector {
    /// Integers below 256.
    Bytes(Bytes),
    /// Integers of 64 bits. Only the host makes these.
    Integers(Arc<[i64]>),
    /// Double floats.
    Floats(Arc<[f64]>),
}

/// Units of work, of which the machine counts 64 as a tick, for an element that becomes a value or is made of
/// one. Two bytes are moved in the time of one unit.
const ELEMENT_WORK: usize = 4;

/// Elements that are displayed at most.
const DISPLAY_LENGTH: usize = 1000;

impl PackedVector {
    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        match self {
            PackedVector::Bytes(bytes) => bytes.len(),
            PackedVector::Integers(integers) => integers.len(),
            PackedVector::Floats(floats) => floats.len(),
        }
    }

    /// Returns whether there are no elements.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the units of work of moving the elements into a program or out of it.
    pub fn work(&self) -> usize {
        match self {
            PackedVector::Bytes(bytes) => 1 + bytes.len() / 2,
            _ => 1 + ELEMENT_WORK * self.len(),
        }
    }

    /// Returns the elements as bytes, the lowest first.
    pub fn to_le_bytes(&self) -> Cow<'_, [u8]> {
        match self {
            PackedVector::Bytes(bytes) => Cow::Borrowed(bytes),
            PackedVector::Integers(integers) => integers.iter().flat_map(|n| n.to_le_bytes()).collect(),
            PackedVector::Floats(floats) => floats.iter().flat_map(|x| x.to_le_bytes()).collect(),
        }
    }
}

impl fmt::Display for PackedVector {
    /// Writes the vector as a program would print it; a long one is cut off.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fn elements<T: fmt::Debug>(f: &mut fmt::Formatter<'_>, elements: &[T]) -> fmt::Result {
            f.write_str("#(")?;
            for (i, element) in elements.iter().take(DISPLAY_LENGTH).enumerate() {
                f.write_str(if i > 0 { " " } else { "" })?;
                fmt::Debug::fmt(element, f)?;
            }
            f.write_str(if elements.len() > DISPLAY_LENGTH { " ...)" } else { ")" })
        }
        match self {
            PackedVector::Bytes(bytes) => elements(f, bytes),
            PackedVector::Integers(integers) => elements(f, integers),
            PackedVector::Floats(floats) => elements(f, floats),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_vector_is_displayed_as_a_vector_and_cut_off() {
        assert_eq!(PackedVector::Bytes(vec![0, 255].into()).to_string(), "#(0 255)");
        assert_eq!(PackedVector::Integers([-5].into()).to_string(), "#(-5)");
        assert_eq!(PackedVector::Floats([1.0, -0.5].into()).to_string(), "#(1.0 -0.5)");
        assert_eq!(PackedVector::Bytes(Bytes::new()).to_string(), "#()");
        let long = PackedVector::Bytes(vec![7; DISPLAY_LENGTH + 1].into()).to_string();
        assert_eq!(long, format!("#(7{} ...)", " 7".repeat(DISPLAY_LENGTH - 1)));
    }

    #[test]
    fn elements_are_bytes_with_the_lowest_first() {
        assert_eq!(*PackedVector::Integers([258].into()).to_le_bytes(), [2, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(*PackedVector::Floats([1.0].into()).to_le_bytes(), 1.0_f64.to_le_bytes());
    }
}
