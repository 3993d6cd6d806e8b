//! The primitive types of message definitions, and arrays of them as data.

use std::sync::Arc;

use esl_bytecode::Bytes;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use hiroz_schema::TypeId;

/// A primitive type with a fixed size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// `bool`: `T` or `NIL`.
    Bool,
    /// `byte`, an octet.
    Byte,
    /// `char`, which ROS 2 defines as `uint8`.
    Char,
    /// `int8`
    Int8,
    /// `uint8`
    Uint8,
    /// `int16`
    Int16,
    /// `uint16`
    Uint16,
    /// `int32`
    Int32,
    /// `uint32`
    Uint32,
    /// `int64`
    Int64,
    /// `uint64`
    Uint64,
    /// `float32`
    Float32,
    /// `float64`
    Float64,
}

/// Name, size in bytes and type id of every scalar.
const SCALARS: [(Scalar, &str, usize, u8); 13] = [
    (Scalar::Bool, "bool", 1, TypeId::BOOL),
    (Scalar::Byte, "byte", 1, TypeId::BYTE),
    (Scalar::Char, "char", 1, TypeId::UINT8),
    (Scalar::Int8, "int8", 1, TypeId::INT8),
    (Scalar::Uint8, "uint8", 1, TypeId::UINT8),
    (Scalar::Int16, "int16", 2, TypeId::INT16),
    (Scalar::Uint16, "uint16", 2, TypeId::UINT16),
    (Scalar::Int32, "int32", 4, TypeId::INT32),
    (Scalar::Uint32, "uint32", 4, TypeId::UINT32),
    (Scalar::Int64, "int64", 8, TypeId::INT64),
    (Scalar::Uint64, "uint64", 8, TypeId::UINT64),
    (Scalar::Float32, "float32", 4, TypeId::FLOAT32),
    (Scalar::Float64, "float64", 8, TypeId::FLOAT64),
];

impl Scalar {
    /// Returns the scalar of a name in a definition.
    pub fn of_name(name: &str) -> Option<Scalar> {
        SCALARS.iter().find(|row| row.1 == name).map(|row| row.0)
    }

    fn row(self) -> &'static (Scalar, &'static str, usize, u8) {
        &SCALARS[self as usize]
    }

    /// Returns the name in definitions.
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// Returns the number of bytes of a value, to whose multiple values are aligned.
    pub fn size(self) -> usize {
        self.row().2
    }

    /// Returns the number of the type in type descriptions.
    pub(super) fn type_id(self) -> u8 {
        self.row().3
    }

    /// Returns whether the values are floats.
    pub fn is_float(self) -> bool {
        matches!(self, Scalar::Float32 | Scalar::Float64)
    }

    /// Returns whether arrays are vectors of bytes.
    pub fn is_octet(self) -> bool {
        matches!(self, Scalar::Byte | Scalar::Char | Scalar::Uint8)
    }

    /// Returns least and greatest value of an integer type; `None` for floats and booleans.
    pub fn range(self) -> Option<(i128, i128)> {
        Some(match self {
            Scalar::Bool | Scalar::Float32 | Scalar::Float64 => return None,
            Scalar::Byte | Scalar::Char | Scalar::Uint8 => (0, u8::MAX.into()),
            Scalar::Int8 => (i8::MIN.into(), i8::MAX.into()),
            Scalar::Int16 => (i16::MIN.into(), i16::MAX.into()),
            Scalar::Uint16 => (0, u16::MAX.into()),
            Scalar::Int32 => (i32::MIN.into(), i32::MAX.into()),
            Scalar::Uint32 => (0, u32::MAX.into()),
            Scalar::Int64 => (i64::MIN.into(), i64::MAX.into()),
            Scalar::Uint64 => (0, u64::MAX.into()),
        })
    }

    /// Returns the value of a field without a default in the definition.
    pub fn zero(self) -> Datum {
        match self {
            Scalar::Bool => Datum::nil(Span::default()),
            _ if self.is_float() => float(0.0),
            _ => Datum::integer(0, Span::default()),
        }
    }

    /// Returns an array of values of this type, in the form that a program gets.
    pub(super) fn array_of(self, items: Vec<Datum>) -> Datum {
        let whole = |item: &Datum| match item.kind() {
            DatumKind::Integer(value) => i64::try_from(value).ok(),
            _ => None,
        };
        let packed = if self.is_octet() {
            let bytes = items.iter().map(|item| whole(item).and_then(|n| u8::try_from(n).ok()));
            bytes.collect::<Option<Vec<u8>>>().map(|bytes| PackedVector::Bytes(Bytes::from(bytes)))
        } else if self.is_float() {
            let float = |item: &Datum| match item.kind() {
                DatumKind::Float(value) => Some(*value),
                _ => None,
            };
            items.iter().map(float).collect::<Option<Arc<[f64]>>>().map(PackedVector::Floats)
        } else if self == Scalar::Bool {
            None
        } else {
            items.iter().map(whole).collect::<Option<Arc<[i64]>>>().map(PackedVector::Integers)
        };
        match packed {
            Some(packed) => Datum::new(DatumKind::Packed(packed), Span::default()),
            None => vector(items),
        }
    }
}

/// Returns a float as a datum.
pub(super) fn float(value: f64) -> Datum {
    Datum::new(DatumKind::Float(value), Span::default())
}

/// Returns a truth value as a datum.
pub(super) fn boolean(value: bool) -> Datum {
    if value { Datum::symbol(Symbol::cl("T"), Span::default()) } else { Datum::nil(Span::default()) }
}

/// Returns a simple vector as a datum.
pub(super) fn vector(items: Vec<Datum>) -> Datum {
    Datum::new(DatumKind::Vector(items.into()), Span::default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scalar_has_the_row_at_its_place() {
        for (place, row) in SCALARS.iter().enumerate() {
            assert_eq!(row.0 as usize, place, "{}", row.1);
            assert_eq!(Scalar::of_name(row.1), Some(row.0));
        }
        assert_eq!(Scalar::of_name("string"), None);
    }

    #[test]
    fn an_array_is_packed_if_a_kind_of_vector_holds_its_values() {
        let integers = |values: &[u64]| values.iter().map(|&n| Datum::integer(n, Span::default())).collect();
        let packed = |datum: &Datum| matches!(datum.kind(), DatumKind::Packed(_));
        let small = Scalar::Uint64.array_of(integers(&[1, 2]));
        assert!(packed(&small) && small.to_string() == "#(1 2)");
        let large = Scalar::Uint64.array_of(integers(&[1, u64::MAX]));
        assert!(!packed(&large) && large.to_string() == "#(1 18446744073709551615)");
        assert!(!packed(&Scalar::Bool.array_of(vec![boolean(true)])));
    }
}
