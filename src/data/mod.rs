//! Values of programs, as data of Rust.
//!
//! ```
//! use esl::Data;
//!
//! let reading = Data::list([Data::Keyword("TEMPERATURE".into()), Data::Float(21.5)]);
//! assert_eq!(reading.to_string(), "(:TEMPERATURE 21.5)");
//! let items = reading.as_list().expect("it is a list");
//! assert_eq!(items[1].as_float(), Some(21.5));
//! ```

#[cfg(feature = "serde")]
mod structure;

mod opaque;

use std::fmt;

use esl_bytecode::BigInt;
use esl_bytecode::datum::{Datum, DatumKind, OpaqueDatum};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

#[cfg(feature = "serde")]
pub use structure::{Structure, StructureError};

pub use opaque::{HostType, Opaque};

/// A value from a program, or for one.
///
/// ```
/// use esl::Data;
///
/// let order = Data::list([Data::Symbol("GO".into()), 7.into(), "home".into()]);
/// assert_eq!(order.to_string(), "(GO 7 \"home\")");
/// assert_eq!(order.as_list().and_then(|items| items[1].as_integer()), Some(7));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// `NIL`: false, and the empty list.
    Nil,
    /// `T`: true.
    True,
    /// An integer of 64 bits.
    Integer(i64),
    /// A larger integer.
    BigInteger(BigInt),
    /// A ratio: numerator and denominator.
    Ratio(BigInt, BigInt),
    /// A double float.
    Float(f64),
    /// A character.
    Character(char),
    /// A string.
    String(String),
    /// A keyword, by its name: `:ON` is `Keyword("ON")`.
    Keyword(String),
    /// Another symbol, by its name.
    Symbol(String),
    /// A proper list, not empty.
    List(Vec<Data>),
    /// A list whose last `cdr` is not `NIL`: its elements, and that last `cdr`.
    DottedList(Vec<Data>, Box<Data>),
    /// A vector.
    Vector(Vec<Data>),
    /// Something of the embedder's: an [`Opaque`] makes it, and is made of it.
    Opaque(OpaqueDatum),
}

impl Data {
    /// Returns `T` or `NIL`.
    pub fn boolean(value: bool) -> Data {
        if value { Data::True } else { Data::Nil }
    }

    /// Returns the list of these items: `NIL` if there are none.
    pub fn list(items: impl IntoIterator<Item = Data>) -> Data {
        let items: Vec<Data> = items.into_iter().collect();
        if items.is_empty() { Data::Nil } else { Data::List(items) }
    }

    /// Returns whether the value counts as true: whether it is anything but `NIL`.
    pub fn is_true(&self) -> bool {
        !matches!(self, Data::Nil)
    }

    /// Returns the integer, if the value is an integer of 64 bits.
    pub fn as_integer(&self) -> Option<i64> {
        match self {
            Data::Integer(value) => Some(*value),
            _ => None,
        }
    }

    /// Returns the number as a float, if the value is a float or an integer of 64 bits.
    pub fn as_float(&self) -> Option<f64> {
        match self {
            Data::Float(value) => Some(*value),
            Data::Integer(value) => Some(*value as f64),
            _ => None,
        }
    }

    /// Returns the string, if the value is a string.
    pub fn as_str(&self) -> Option<&str> {
        match self {
            Data::String(value) => Some(value),
            _ => None,
        }
    }

    /// Returns the elements, if the value is a proper list; no elements for `NIL`.
    pub fn as_list(&self) -> Option<&[Data]> {
        match self {
            Data::Nil => Some(&[]),
            Data::List(items) => Some(items),
            _ => None,
        }
    }

    pub(crate) fn to_datum(&self, package: &str) -> Datum {
        let span = Span::default();
        let list = |items: &[Data], tail: Datum| {
            Datum::list_with_tail(items.iter().map(|item| item.to_datum(package)), tail, span)
        };
        let kind = match self {
            Data::Nil => return Datum::nil(span),
            Data::True => return Datum::symbol(Symbol::cl("T"), span),
            Data::Integer(value) => DatumKind::Integer((*value).into()),
            Data::BigInteger(value) => DatumKind::Integer(value.clone()),
            Data::Ratio(numerator, denominator) => DatumKind::Ratio(numerator.clone(), denominator.clone()),
            Data::Float(value) => DatumKind::Float(*value),
            Data::Character(value) => DatumKind::Character(*value),
            Data::String(value) => DatumKind::String(value.as_str().into()),
            Data::Keyword(name) => DatumKind::Symbol(Symbol::keyword(name)),
            Data::Symbol(name) => return Datum::symbol(Symbol::new(&package.into(), name), span),
            Data::List(items) => return list(items, Datum::nil(span)),
            Data::DottedList(items, tail) => return list(items, tail.to_datum(package)),
            Data::Vector(items) => {
                DatumKind::Vector(items.iter().map(|item| item.to_datum(package)).collect())
            }
            Data::Opaque(opaque) => DatumKind::Opaque(opaque.clone()),
        };
        Datum::new(kind, span)
    }

    /// Returns a datum of the machine as Rust sees it.
    pub fn from_datum(datum: &Datum) -> Data {
        match datum.kind() {
            DatumKind::Nil => Data::Nil,
            DatumKind::Symbol(symbol) if symbol.is_cl("T") => Data::True,
            DatumKind::Symbol(symbol) if symbol.is_keyword() => Data::Keyword(symbol.name().into()),
            DatumKind::Symbol(symbol) => Data::Symbol(symbol.name().into()),
            DatumKind::Integer(value) => match i64::try_from(value) {
                Ok(value) => Data::Integer(value),
                Err(_) => Data::BigInteger(value.clone()),
            },
            DatumKind::Ratio(numerator, denominator) => Data::Ratio(numerator.clone(), denominator.clone()),
            DatumKind::Float(value) => Data::Float(*value),
            DatumKind::Character(value) => Data::Character(*value),
            DatumKind::String(value) => Data::String(value.to_string()),
            DatumKind::Vector(items) | DatumKind::Array(_, items) => {
                Data::Vector(items.iter().map(Data::from_datum).collect())
            }
            DatumKind::Opaque(opaque) => Data::Opaque(opaque.clone()),
            DatumKind::Object(_) | DatumKind::Call(_) => Data::String(datum.to_string()),
            DatumKind::Cons(..) => {
                let mut elements = datum.elements();
                let items: Vec<Data> = elements.by_ref().map(Data::from_datum).collect();
                match elements.tail().kind() {
                    DatumKind::Nil => Data::List(items),
                    _ => Data::DottedList(items, Box::new(Data::from_datum(elements.tail()))),
                }
            }
        }
    }
}

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
    f64, "REAL", |data| data.as_float(), |value| Data::Float(value);
    bool, "T", |data| Some(data.is_true()), |value| Data::boolean(value);
    String, "STRING", |data| data.as_str().map(str::to_owned), |value| Data::String(value);
    (), "NULL", |data| (!data.is_true()).then_some(()), |_value| Data::Nil;
}

impl FromData for Data {
    const TYPE: &'static str = "T";

    fn from_data(data: &Data) -> Option<Data> {
        Some(data.clone())
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
            Data::Vector(items) => items,
            list => list.as_list()?,
        };
        items.iter().map(T::from_data).collect()
    }
}

impl From<&str> for Data {
    fn from(value: &str) -> Data {
        Data::String(value.to_owned())
    }
}

impl<T: Into<Data>> From<Vec<T>> for Data {
    /// Returns a list.
    fn from(items: Vec<T>) -> Data {
        Data::list(items.into_iter().map(Into::into))
    }
}

impl<T: Into<Data>> From<Option<T>> for Data {
    fn from(value: Option<T>) -> Data {
        value.map_or(Data::Nil, Into::into)
    }
}

impl fmt::Display for Data {
    /// Writes the value as the program would print it with `prin1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sequence = |f: &mut fmt::Formatter<'_>, items: &[Data]| {
            for (i, item) in items.iter().enumerate() {
                if i > 0 {
                    f.write_str(" ")?;
                }
                item.fmt(f)?;
            }
            Ok(())
        };
        match self {
            Data::Nil => f.write_str("NIL"),
            Data::True => f.write_str("T"),
            Data::Integer(value) => value.fmt(f),
            Data::BigInteger(value) => value.fmt(f),
            Data::Ratio(numerator, denominator) => write!(f, "{numerator}/{denominator}"),
            Data::Float(value) => write!(f, "{value:?}"),
            Data::Character(value) => write!(f, "#\\{value}"),
            Data::String(value) => write!(f, "\"{}\"", value.replace('\\', "\\\\").replace('"', "\\\"")),
            Data::Keyword(name) => write!(f, ":{name}"),
            Data::Symbol(name) => f.write_str(name),
            Data::Opaque(opaque) => opaque.fmt(f),
            Data::List(items) => {
                f.write_str("(")?;
                sequence(f, items)?;
                f.write_str(")")
            }
            Data::DottedList(items, tail) => {
                f.write_str("(")?;
                sequence(f, items)?;
                write!(f, " . {tail})")
            }
            Data::Vector(items) => {
                f.write_str("#(")?;
                sequence(f, items)?;
                f.write_str(")")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_survive_the_way_to_a_program_and_back() {
        let data = Data::list([
            Data::Nil,
            Data::True,
            Data::Integer(-5),
            Data::Float(1.5),
            Data::Character('x'),
            Data::String("a \"b\"".into()),
            Data::Keyword("ON".into()),
            Data::Symbol("VALVE".into()),
            Data::Vector(vec![Data::Integer(1)]),
            Data::DottedList(vec![Data::Integer(1)], Box::new(Data::Integer(2))),
        ]);
        assert_eq!(Data::from_datum(&data.to_datum("ESL-USER")), data);
        assert_eq!(data.to_string(), "(NIL T -5 1.5 #\\x \"a \\\"b\\\"\" :ON VALVE #(1) (1 . 2))");
    }
}
