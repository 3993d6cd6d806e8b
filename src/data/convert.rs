//! Conversion between data and types of Rust.

use std::collections::{BTreeMap, HashMap};
use std::hash::Hash;
use std::sync::Arc;

use esl_bytecode::Bytes;
use esl_bytecode::packed::PackedVector;

use super::Data;

/// A type of Rust that arguments of functions of the embedder's can have.
///
/// ```
/// use esl::data::FromData;
/// use esl::{Data, Engine};
///
/// /// A length of the program's, which counts in metres.
/// struct Centimetres(f64);
///
/// impl FromData for Centimetres {
///     const TYPE: &'static str = "REAL";
///
///     fn from_data(data: &Data) -> Option<Centimetres> {
///         f64::from_data(data).map(|metres| Centimetres(100.0 * metres))
///     }
/// }
///
/// let mut engine = Engine::new()?;
/// engine.define("STEPS", "(length)", "The steps that a length takes.", |call| {
///     let Centimetres(length) = call.get("length")?;
///     Ok((length / 5.0) as i64)
/// })?;
/// assert_eq!(engine.eval("(steps 2.5)")?.as_integer(), Some(50));
/// # Ok::<(), esl::Error>(())
/// ```
pub trait FromData: Sized {
    /// Name of the type in `COMMON-LISP`, for failures.
    const TYPE: &'static str;

    /// Returns the value that data stand for; `None` if they are of another type.
    fn from_data(data: &Data) -> Option<Self>;

    /// Returns the value that data stand for, made of them; the data if they are of another type.
    ///
    /// # Errors
    /// The data.
    fn from_own_data(data: Data) -> Result<Self, Data> {
        Self::from_data(&data).ok_or(data)
    }

    /// Returns the values that the elements of a vector of numbers stand for; `None` if one of them is of
    /// another type. Types whose elements can be copied at once do so.
    fn from_packed(vector: &PackedVector) -> Option<Vec<Self>> {
        match vector {
            PackedVector::Bytes(bytes) => {
                bytes.iter().map(|&byte| Self::from_data(&Data::Integer(byte.into()))).collect()
            }
            PackedVector::Integers(integers) => {
                integers.iter().map(|&n| Self::from_data(&Data::Integer(n))).collect()
            }
            PackedVector::Floats(floats) => {
                floats.iter().map(|&x| Self::from_data(&Data::Float(x))).collect()
            }
        }
    }
}

/// Defines conversions for a type: its name in ESL, from data, and to data.
macro_rules! convert {
    ($( $ty:ty, $name:literal, |$data:ident| $from:expr, |$value:ident| $to:expr ; )*) => {
        $(
            impl FromData for $ty {
                const TYPE: &'static str = $name;

                fn from_data($data: &Data) -> Option<$ty> {
                    $from
                }
            }

            impl From<$ty> for Data {
                fn from($value: $ty) -> Data {
                    $to
                }
            }
        )*
    };
}

convert! {
    i64, "INTEGER", |data| data.as_integer(), |value| Data::Integer(value);
    i32, "INTEGER", |data| data.as_integer()?.try_into().ok(), |value| Data::Integer(value.into());
    u32, "UNSIGNED-BYTE", |data| data.as_integer()?.try_into().ok(), |value| Data::Integer(value.into());
    f32, "REAL", |data| data.as_float().map(|value| value as f32), |value| Data::Float(value.into());
    bool, "T", |data| Some(data.is_true()), |value| Data::boolean(value);
    String, "STRING", |data| data.as_str().map(str::to_owned), |value| Data::String(value);
    (), "NULL", |data| (!data.is_true()).then_some(()), |_value| Data::Nil;
}

impl FromData for f64 {
    const TYPE: &'static str = "REAL";

    fn from_data(data: &Data) -> Option<f64> {
        data.as_float()
    }

    fn from_packed(vector: &PackedVector) -> Option<Vec<f64>> {
        Some(match vector {
            PackedVector::Bytes(bytes) => bytes.iter().map(|&byte| byte.into()).collect(),
            PackedVector::Integers(integers) => integers.iter().map(|&n| n as f64).collect(),
            PackedVector::Floats(floats) => floats.to_vec(),
        })
    }
}

impl From<f64> for Data {
    fn from(value: f64) -> Data {
        Data::Float(value)
    }
}

/// An element of bytes. There is no way back, so that a `Vec<u8>` becomes a vector of bytes.
impl FromData for u8 {
    const TYPE: &'static str = "UNSIGNED-BYTE";

    fn from_data(data: &Data) -> Option<u8> {
        data.as_integer()?.try_into().ok()
    }

    fn from_packed(vector: &PackedVector) -> Option<Vec<u8>> {
        match vector {
            PackedVector::Bytes(bytes) => Some(bytes.to_vec()),
            PackedVector::Integers(integers) => integers.iter().map(|&n| n.try_into().ok()).collect(),
            PackedVector::Floats(_) => None,
        }
    }
}

/// Those of a vector of bytes are shared, not copied.
impl FromData for Bytes {
    const TYPE: &'static str = "SEQUENCE";

    fn from_data(data: &Data) -> Option<Bytes> {
        match data {
            Data::Packed(PackedVector::Bytes(bytes)) => Some(bytes.clone()),
            _ => Vec::<u8>::from_data(data).map(Bytes::from),
        }
    }
}

/// Defines the conversion of a type to a vector of numbers.
macro_rules! pack {
    ($( $ty:ty, |$value:ident| $to:expr ; )*) => {
        $(
            impl From<$ty> for Data {
                /// Returns a vector.
                fn from($value: $ty) -> Data {
                    $to
                }
            }
        )*
    };
}

pack! {
    Bytes, |bytes| Data::bytes(bytes);
    Vec<u8>, |bytes| Data::bytes(bytes);
    &[u8], |bytes| Data::bytes(Bytes::copy_from_slice(bytes));
    &[f64], |floats| Data::floats(floats);
    Arc<[f64]>, |floats| Data::floats(floats);
    &[f32], |floats| Data::floats(floats.iter().map(|&x| x.into()).collect::<Arc<[f64]>>());
    &[i64], |integers| Data::integers(integers);
    &[i32], |integers| Data::integers(integers.iter().map(|&n| n.into()).collect::<Arc<[i64]>>());
}

impl FromData for Data {
    const TYPE: &'static str = "T";

    fn from_data(data: &Data) -> Option<Data> {
        Some(data.clone())
    }

    fn from_own_data(data: Data) -> Result<Data, Data> {
        Ok(data)
    }
}

/// `NIL` is `None`, so an optional argument needs no value to stand for its absence.
impl<T: FromData> FromData for Option<T> {
    const TYPE: &'static str = T::TYPE;

    fn from_data(data: &Data) -> Option<Option<T>> {
        if data.is_true() { T::from_data(data).map(Some) } else { Some(None) }
    }
}

/// A list or a vector.
impl<T: FromData> FromData for Vec<T> {
    const TYPE: &'static str = "SEQUENCE";

    fn from_data(data: &Data) -> Option<Vec<T>> {
        let items = match data {
            Data::Packed(vector) => return T::from_packed(vector),
            Data::Vector(items) => items,
            list => list.as_list()?,
        };
        items.iter().map(T::from_data).collect()
    }
}

/// A hash table; of equal keys, the last one counts.
macro_rules! convert_maps {
    ($( $map:ident<$key:ident: $($bound:path),+> )*) => {
        $(
            impl<$key: FromData $(+ $bound)+, V: FromData> FromData for $map<$key, V> {
                const TYPE: &'static str = "HASH-TABLE";

                fn from_data(data: &Data) -> Option<Self> {
                    let entries = data.as_table()?.iter();
                    entries.map(|(key, value)| Some((K::from_data(key)?, V::from_data(value)?))).collect()
                }
            }

            impl<$key: Into<Data>, V: Into<Data>> From<$map<$key, V>> for Data {
                /// Returns a hash table.
                fn from(map: $map<$key, V>) -> Data {
                    Data::Table(map.into_iter().map(|(key, value)| (key.into(), value.into())).collect())
                }
            }
        )*
    };
}

convert_maps! {
    HashMap<K: Eq, Hash>
    BTreeMap<K: Ord>
}

impl From<&str> for Data {
    fn from(value: &str) -> Data {
        Data::String(value.to_owned())
    }
}

impl<T: Into<Data>> From<Vec<T>> for Data {
    /// Returns a list. Slices of numbers become vectors.
    fn from(items: Vec<T>) -> Data {
        Data::list(items.into_iter().map(Into::into))
    }
}

impl<T: Into<Data>> From<Option<T>> for Data {
    fn from(value: Option<T>) -> Data {
        value.map_or(Data::Nil, Into::into)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vectors_of_numbers_are_what_rust_asks_for() {
        let bytes = Data::from(vec![1_u8, 255]);
        assert_eq!(bytes, Data::from(&[1_u8, 255][..]));
        assert_eq!(Vec::<u8>::from_data(&bytes), Some(vec![1, 255]));
        assert_eq!(Vec::<i64>::from_data(&bytes), Some(vec![1, 255]));
        assert_eq!(Vec::<f32>::from_data(&bytes), Some(vec![1.0, 255.0]));
        let shared = Bytes::from_data(&bytes).expect("they are bytes");
        assert_eq!(Some(shared.as_ptr()), bytes.as_bytes().map(|bytes| bytes.as_ptr()), "it is no copy");
        let floats = Data::from(&[0.5_f32, -1.0][..]);
        assert_eq!(floats.as_floats(), Some(&[0.5, -1.0][..]));
        assert_eq!(Vec::<f64>::from_data(&floats), Some(vec![0.5, -1.0]));
        assert_eq!(Vec::<u8>::from_data(&floats), None);
        let integers = Data::from(&[-1_i32, 1][..]);
        assert_eq!(Vec::<i32>::from_data(&integers), Some(vec![-1, 1]));
        assert_eq!(Vec::<u8>::from_data(&integers), None);
        let list = Data::list([Data::Integer(7), Data::Integer(256)]);
        assert_eq!((Bytes::from_data(&list), Vec::<f64>::from_data(&list)), (None, Some(vec![7.0, 256.0])));
        assert_eq!(Data::from(vec![0.5, 1.5]), Data::list([Data::Float(0.5), Data::Float(1.5)]));
    }

    #[test]
    fn maps_are_hash_tables() {
        let map = BTreeMap::from([("a".to_owned(), 1_i64), ("b".to_owned(), 2)]);
        let table = Data::from(map.clone());
        assert_eq!(table.to_string(), "#<hash-table \"a\" 1 \"b\" 2>");
        assert_eq!(BTreeMap::<String, i64>::from_data(&table), Some(map));
        assert_eq!(HashMap::<String, i64>::from_data(&table).map(|map| map["b"]), Some(2));
        assert_eq!(HashMap::<i64, i64>::from_data(&table), None);
        assert_eq!(HashMap::<i64, i64>::from_data(&Data::Nil), None, "an empty list is not a table");
    }
}
