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

mod convert;
mod opaque;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use esl_bytecode::BigInt;
use esl_bytecode::datum::{Datum, DatumKind, OpaqueDatum};
use esl_bytecode::span::{SourceId, Span};
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol, USER_PACKAGE};
use esl_compiler::diagnostic::code;
use esl_compiler::reader::{BareEnvironment, read_datum};
use esl_vm::embed::Atom;

use crate::error::Error;

#[cfg(feature = "serde")]
pub use structure::{Structure, StructureError};

pub use convert::FromData;
pub use esl_bytecode::Bytes;
pub use esl_bytecode::packed::PackedVector;
pub use opaque::{HostType, Opaque};

/// Most levels of lists and vectors within each other: data are walked by recursion.
pub const MAX_DEPTH: usize = 1000;

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
    /// Another symbol, by its name: `VALVE`. One that is at home in a package that programs do not use from
    /// the start has the package before it: `FLEET::VALVE`.
    Symbol(String),
    /// A proper list, not empty.
    List(Vec<Data>),
    /// A list whose last `cdr` is not `NIL`: its elements, and that last `cdr`.
    DottedList(Vec<Data>, Box<Data>),
    /// A vector.
    Vector(Vec<Data>),
    /// A hash table that compares its keys by `eq`, `eql` or `equal`: its keys and values, in the order in
    /// which they came. A table made of it compares them by `equal`, and of equal keys the last one counts.
    Table(Vec<(Data, Data)>),
    /// A vector of numbers: of bytes, if that is its element type, or of floats, if all elements are.
    /// `Vec<f64>`, `Vec<u8>`, [`Bytes`] and others are made of it.
    Packed(PackedVector),
    /// Something of the embedder's: an [`Opaque`] makes it, and is made of it. An object of the program that
    /// no data stands for, such as a task, is opaque as well ([`is_of_program`](OpaqueDatum::is_of_program));
    /// what the program gets back is the text that describes it.
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

    /// Returns the vector of these bytes.
    pub fn bytes(bytes: impl Into<Bytes>) -> Data {
        Data::Packed(PackedVector::Bytes(bytes.into()))
    }

    /// Returns the vector of these floats.
    pub fn floats(floats: impl Into<Arc<[f64]>>) -> Data {
        Data::Packed(PackedVector::Floats(floats.into()))
    }

    /// Returns the vector of these integers.
    pub fn integers(integers: impl Into<Arc<[i64]>>) -> Data {
        Data::Packed(PackedVector::Integers(integers.into()))
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

    /// Returns the bytes, if the value is a vector with that element type.
    pub fn as_bytes(&self) -> Option<&Bytes> {
        match self {
            Data::Packed(PackedVector::Bytes(bytes)) => Some(bytes),
            _ => None,
        }
    }

    /// Returns the floats, if the value is a vector of one or more floats and nothing else.
    pub fn as_floats(&self) -> Option<&[f64]> {
        match self {
            Data::Packed(PackedVector::Floats(floats)) => Some(floats),
            _ => None,
        }
    }

    /// Returns the keys and values, if the value is a hash table.
    ///
    /// ```
    /// use esl::{Data, Engine};
    ///
    /// let mut engine = Engine::new()?;
    /// let table = Data::Table(vec![("ridge".into(), 0.5.into())]);
    /// let speed: f64 = engine.call("gethash", ["ridge".into(), table])?;
    /// let made = engine.eval("(let ((table (make-hash-table))) (setf (gethash :on table) 3) table)")?;
    /// assert_eq!((speed, made.as_table()), (0.5, Some(&[(Data::Keyword("ON".into()), 3.into())][..])));
    /// # Ok::<(), esl::Error>(())
    /// ```
    pub fn as_table(&self) -> Option<&[(Data, Data)]> {
        match self {
            Data::Table(entries) => Some(entries),
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

    /// Returns the atom that the value is, if it is one.
    pub(crate) fn as_atom(&self) -> Option<Atom> {
        Some(match *self {
            Data::Nil => Atom::Nil,
            Data::True => Atom::True,
            Data::Integer(value) => Atom::Integer(value),
            Data::Float(value) => Atom::Float(value),
            Data::Character(value) => Atom::Character(value),
            _ => return None,
        })
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
            Data::BigInteger(value) => DatumKind::Integer(value.clone().into()),
            Data::Ratio(numerator, denominator) => DatumKind::Ratio(numerator.clone(), denominator.clone()),
            Data::Float(value) => DatumKind::Float(*value),
            Data::Character(value) => DatumKind::Character(*value),
            Data::String(value) => DatumKind::String(value.as_str().into()),
            Data::Keyword(name) => DatumKind::Symbol(Symbol::keyword(name)),
            Data::Symbol(name) => return Datum::symbol(symbol_of(name, package), span),
            Data::List(items) => return list(items, Datum::nil(span)),
            Data::DottedList(items, tail) => return list(items, tail.to_datum(package)),
            Data::Vector(items) => {
                DatumKind::Vector(items.iter().map(|item| item.to_datum(package)).collect())
            }
            Data::Table(entries) => {
                let items = entries.iter().flat_map(|(key, value)| [key, value]);
                DatumKind::Table(items.map(|item| item.to_datum(package)).collect())
            }
            Data::Packed(vector) => DatumKind::Packed(vector.clone()),
            Data::Opaque(object) if object.is_of_program() => DatumKind::String(object.text().into()),
            Data::Opaque(opaque) => DatumKind::Opaque(opaque.clone()),
        };
        Datum::new(kind, span)
    }

    /// As [`Data::to_datum`]; a number takes the place of the last one, if nobody has that any more.
    pub(crate) fn to_datum_again(&self, last: &mut Datum) -> Datum {
        last.put(match self {
            Data::Integer(value) => DatumKind::Integer((*value).into()),
            Data::Float(value) => DatumKind::Float(*value),
            _ => return self.to_datum(USER_PACKAGE),
        });
        last.clone()
    }

    /// Returns a datum of the machine as Rust sees it. A list or vector more than [`MAX_DEPTH`] levels deep
    /// is the string `#`, as the printer has it for levels that it leaves out.
    pub fn from_datum(datum: &Datum) -> Data {
        Data::within(datum, MAX_DEPTH, &mut false)
    }

    /// Returns a datum of the machine as Rust sees it.
    ///
    /// # Errors
    /// [`Error::NestedTooDeeply`].
    pub(crate) fn whole(datum: &Datum) -> Result<Data, Error> {
        // Most data are small integers.
        if let DatumKind::Integer(value) = datum.kind()
            && let Some(value) = value.as_small()
        {
            return Ok(Data::Integer(value));
        }
        let mut is_cut = false;
        let data = Data::within(datum, MAX_DEPTH, &mut is_cut);
        if is_cut { Err(Error::NestedTooDeeply) } else { Ok(data) }
    }

    /// Returns a datum with this number of levels, and sets `is_cut` if it has more.
    fn within(datum: &Datum, levels: usize, is_cut: &mut bool) -> Data {
        let is_compound = matches!(
            datum.kind(),
            DatumKind::Cons(..) | DatumKind::Vector(_) | DatumKind::Array(..) | DatumKind::Table(_)
        );
        let Some(levels) = levels.checked_sub(usize::from(is_compound)) else {
            *is_cut = true;
            return Data::String("#".into());
        };
        match datum.kind() {
            DatumKind::Nil => Data::Nil,
            DatumKind::Symbol(symbol) if symbol.is_cl("T") => Data::True,
            DatumKind::Symbol(symbol) if symbol.is_keyword() => Data::Keyword(symbol.name().into()),
            DatumKind::Symbol(symbol) => Data::Symbol(name_of(symbol)),
            DatumKind::Integer(value) => match value.as_small() {
                Some(value) => Data::Integer(value),
                None => Data::BigInteger(value.to_big()),
            },
            DatumKind::Ratio(numerator, denominator) => Data::Ratio(numerator.clone(), denominator.clone()),
            DatumKind::Float(value) => Data::Float(*value),
            DatumKind::Character(value) => Data::Character(*value),
            DatumKind::String(value) => Data::String(value.to_string()),
            DatumKind::Vector(items) | DatumKind::Array(_, items) => {
                Data::Vector(items.iter().map(|item| Data::within(item, levels, is_cut)).collect())
            }
            DatumKind::Table(items) => {
                let mut within = |item| Data::within(item, levels, is_cut);
                let entries = items.as_chunks().0.iter();
                Data::Table(entries.map(|[key, value]| (within(key), within(value))).collect())
            }
            DatumKind::Packed(vector) => Data::Packed(vector.clone()),
            DatumKind::Opaque(opaque) => Data::Opaque(opaque.clone()),
            DatumKind::Object(_) | DatumKind::Call(_) => Data::String(datum.to_string()),
            DatumKind::Cons(..) => {
                let mut elements = datum.elements();
                let items: Vec<Data> =
                    elements.by_ref().map(|item| Data::within(item, levels, is_cut)).collect();
                match elements.tail().kind() {
                    DatumKind::Nil => Data::List(items),
                    _ => Data::DottedList(items, Box::new(Data::within(elements.tail(), levels, is_cut))),
                }
            }
        }
    }
}

impl From<Atom> for Data {
    fn from(atom: Atom) -> Data {
        match atom {
            Atom::Nil => Data::Nil,
            Atom::True => Data::True,
            Atom::Integer(value) => Data::Integer(value),
            Atom::Float(value) => Data::Float(value),
            Atom::Character(value) => Data::Character(value),
        }
    }
}

/// Packages whose symbols need no package before them.
const OPEN_PACKAGES: [&str; 3] = [CL_PACKAGE, ESL_PACKAGE, USER_PACKAGE];

/// Returns the name of a symbol, with its package if it needs one.
fn name_of(symbol: &Symbol) -> String {
    match symbol.package() {
        Some(package) if !OPEN_PACKAGES.contains(&&**package) => format!("{package}::{}", symbol.name()),
        _ => symbol.name().to_owned(),
    }
}

/// Returns the symbol of a name, which has a package before it or is of this package.
fn symbol_of(name: &str, package: &str) -> Symbol {
    match name.split_once("::") {
        Some((package, name)) if !package.is_empty() && !name.is_empty() => {
            Symbol::new(&package.into(), name)
        }
        _ => Symbol::new(&package.into(), name),
    }
}

impl FromStr for Data {
    type Err = Error;

    /// Reads a value as programs write it.
    ///
    /// ```
    /// use esl::Data;
    ///
    /// let pattern: Data = "(at ?robot (3.5 :north))".parse()?;
    /// assert_eq!(pattern.to_string(), "(AT ?ROBOT (3.5 :NORTH))");
    /// for text in ["(at", "", "1 2"] {
    ///     assert!(text.parse::<Data>().is_err());
    /// }
    /// # Ok::<(), esl::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::DoesNotCompile`], also if the text has no value or several.
    fn from_str(text: &str) -> Result<Data, Error> {
        let mut environment = BareEnvironment::new();
        let mut next = |start| {
            read_datum(&mut environment, text, start).map_err(|fault| Error::DoesNotCompile(vec![*fault]))
        };
        let span = |start: usize| Span::new(SourceId::default(), start as u32, text.len() as u32);
        let (datum, end) = next(0)?;
        let fault = match datum {
            None => code::MISSING_DATUM.at(span(0), "expected a value"),
            Some(datum) if next(end)?.0.is_none() => return Data::whole(&datum),
            Some(_) => code::INVALID_TOKEN.at(span(end), "expected the end of the text after one value"),
        };
        Err(Error::DoesNotCompile(vec![fault]))
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
            Data::Packed(vector) => vector.fmt(f),
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
            Data::Table(entries) => {
                f.write_str("#<hash-table")?;
                entries.iter().try_for_each(|(key, value)| write!(f, " {key} {value}"))?;
                f.write_str(">")
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
            Data::bytes(vec![0, 255]),
            Data::floats([0.5]),
            Data::integers([-1]),
            Data::DottedList(vec![Data::Integer(1)], Box::new(Data::Integer(2))),
            Data::Table(vec![(Data::String("a".into()), Data::Integer(1)), (Data::Nil, Data::True)]),
        ]);
        assert_eq!(Data::from_datum(&data.to_datum("ESL-USER")), data);
        assert_eq!(
            data.to_string(),
            "(NIL T -5 1.5 #\\x \"a \\\"b\\\"\" :ON VALVE #(1) #(0 255) #(0.5) #(-1) (1 . 2) #<hash-table \"a\" 1 NIL T>)"
        );
    }
}
