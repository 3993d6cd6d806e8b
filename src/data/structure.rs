//! Structures of Rust as data, and back, by serde.
//!
//! A struct is a property list, whose keys are the names of the fields as keywords, with `-` for `_`; a map is an
//! association list. A variant of an enum is its keyword, or a list that begins with it. `None` and `()` are
//! `NIL`. From data a struct is read from a property list or an association list, with keys that are symbols,
//! keywords or strings.

use std::fmt;

use esl_bytecode::BigInt;
use serde::de::{
    self, DeserializeOwned, DeserializeSeed, EnumAccess, IntoDeserializer, MapAccess, SeqAccess,
    VariantAccess, Visitor,
};
use serde::{Serialize, ser};

use super::{Data, FromData};

/// A structure of Rust, as an argument or a value of functions of the embedder's.
///
/// ```
/// use esl::Engine;
/// use esl::data::Structure;
/// use serde::{Deserialize, Serialize};
///
/// #[derive(Deserialize, Serialize)]
/// struct Pose {
///     x: f64,
///     frame_name: String,
///     covariance: Option<Vec<f64>>,
/// }
///
/// let mut engine = Engine::new()?;
/// engine.define("MIRROR", "(pose)", "The pose on the other side.", |call| {
///     let Structure(pose): Structure<Pose> = call.get("pose")?;
///     Ok(Structure(Pose { x: -pose.x, ..pose }))
/// })?;
/// let mirrored = engine.eval("(mirror '(:frame-name \"map\" :x 2.5))")?;
/// assert_eq!(mirrored.to_string(), "(:X -2.5 :FRAME-NAME \"map\" :COVARIANCE NIL)");
/// assert_eq!(mirrored.to_structure::<Pose>().expect("it is a pose").x, -2.5);
/// # Ok::<(), esl::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Structure<T>(pub T);

impl<T: Serialize> From<Structure<T>> for Data {
    /// Returns the structure as data; `NIL` for one that says itself that it cannot be serialized.
    fn from(structure: Structure<T>) -> Data {
        Data::from_structure(&structure.0).unwrap_or(Data::Nil)
    }
}

impl<T: DeserializeOwned> FromData for Structure<T> {
    const TYPE: &'static str = "LIST";

    fn from_data(data: &Data) -> Option<Structure<T>> {
        data.to_structure().ok().map(Structure)
    }
}

/// Reason why data are not of a structure, or a structure has no data.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructureError(String);

impl fmt::Display for StructureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for StructureError {}

impl ser::Error for StructureError {
    fn custom<T: fmt::Display>(message: T) -> StructureError {
        StructureError(message.to_string())
    }
}

impl de::Error for StructureError {
    fn custom<T: fmt::Display>(message: T) -> StructureError {
        StructureError(message.to_string())
    }
}

impl Data {
    /// Returns the data that a structure of Rust is.
    ///
    /// # Errors
    /// [`StructureError`], if the structure says that it cannot be serialized.
    pub fn from_structure<T: Serialize + ?Sized>(structure: &T) -> Result<Data, StructureError> {
        structure.serialize(ToData)
    }

    /// Returns the structure of Rust that the data are.
    ///
    /// # Errors
    /// [`StructureError`], which says what was expected and what was found.
    pub fn to_structure<T: DeserializeOwned>(&self) -> Result<T, StructureError> {
        T::deserialize(Reading(self))
    }
}

/// Returns the keyword for a name of Rust: `heading_deg` is `:HEADING-DEG`, `TurnTo` is `:TURN-TO`.
fn keyword(name: &str) -> Data {
    let mut words = String::new();
    let mut was_lower = false;
    for c in name.chars() {
        if c.is_uppercase() && was_lower {
            words.push('-');
        }
        was_lower = c.is_lowercase() || c.is_ascii_digit();
        words.extend(if c == '_' { '-' } else { c }.to_uppercase());
    }
    Data::Keyword(words)
}

/// Returns whether data name a field or a variant: a keyword, another symbol, or the very string.
fn is_named(key: &Data, name: &str) -> bool {
    match key {
        Data::Keyword(key) | Data::Symbol(key) => keyword(name) == Data::Keyword(key.clone()),
        Data::String(key) => key == name,
        _ => false,
    }
}

/// Returns the name of Rust for a key.
fn field_name(key: &Data) -> Option<String> {
    match key {
        Data::Keyword(name) | Data::Symbol(name) => Some(name.to_lowercase().replace('-', "_")),
        Data::String(name) => Some(name.clone()),
        _ => None,
    }
}

/// Makes data.
struct ToData;

/// The items of a list that is being made; behind a keyword, if there is one.
struct Items(Vec<Data>);

impl Items {
    fn push<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), StructureError> {
        self.0.push(value.serialize(ToData)?);
        Ok(())
    }

    fn push_field<T: Serialize + ?Sized>(&mut self, name: &str, value: &T) -> Result<(), StructureError> {
        self.0.push(keyword(name));
        self.push(value)
    }

    fn end(self) -> Data {
        Data::list(self.0)
    }
}

/// The pairs of a map, while it is being made, and the key of the next one.
#[derive(Default)]
struct Pairs(Vec<Data>, Option<Data>);

/// Returns the pair of a key and a value: a list is its `cdr` as it is.
fn pair(key: Data, value: Data) -> Data {
    match value {
        Data::Nil => Data::List(vec![key]),
        Data::List(items) => Data::List(std::iter::once(key).chain(items).collect()),
        Data::DottedList(items, end) => Data::DottedList(std::iter::once(key).chain(items).collect(), end),
        value => Data::DottedList(vec![key], Box::new(value)),
    }
}

/// Defines methods that take a number.
macro_rules! serialize_numbers {
    ($($name:ident $ty:ty => |$value:ident| $data:expr;)*) => {
        $(fn $name(self, $value: $ty) -> Result<Data, StructureError> {
            Ok($data)
        })*
    };
}

impl ser::Serializer for ToData {
    type Ok = Data;
    type Error = StructureError;
    type SerializeSeq = Items;
    type SerializeTuple = Items;
    type SerializeTupleStruct = Items;
    type SerializeTupleVariant = Items;
    type SerializeMap = Pairs;
    type SerializeStruct = Items;
    type SerializeStructVariant = Items;

    serialize_numbers! {
        serialize_bool bool => |value| Data::boolean(value);
        serialize_i8 i8 => |value| Data::Integer(value.into());
        serialize_i16 i16 => |value| Data::Integer(value.into());
        serialize_i32 i32 => |value| Data::Integer(value.into());
        serialize_i64 i64 => |value| Data::Integer(value);
        serialize_u8 u8 => |value| Data::Integer(value.into());
        serialize_u16 u16 => |value| Data::Integer(value.into());
        serialize_u32 u32 => |value| Data::Integer(value.into());
        serialize_u64 u64 => |value| integer(BigInt::from(value));
        serialize_i128 i128 => |value| integer(BigInt::from(value));
        serialize_u128 u128 => |value| integer(BigInt::from(value));
        serialize_f32 f32 => |value| Data::Float(value.into());
        serialize_f64 f64 => |value| Data::Float(value);
        serialize_char char => |value| Data::Character(value);
        serialize_str &str => |value| Data::String(value.into());
        serialize_bytes &[u8] => |value| Data::Vector(value.iter().map(|&byte| Data::Integer(byte.into())).collect());
    }

    fn serialize_none(self) -> Result<Data, StructureError> {
        Ok(Data::Nil)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<Data, StructureError> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<Data, StructureError> {
        Ok(Data::Nil)
    }

    fn serialize_unit_struct(self, _name: &'static str) -> Result<Data, StructureError> {
        Ok(Data::Nil)
    }

    fn serialize_unit_variant(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
    ) -> Result<Data, StructureError> {
        Ok(keyword(variant))
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _name: &'static str,
        value: &T,
    ) -> Result<Data, StructureError> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<Data, StructureError> {
        Ok(Data::List(vec![keyword(variant), value.serialize(ToData)?]))
    }

    fn serialize_seq(self, _length: Option<usize>) -> Result<Items, StructureError> {
        Ok(Items(Vec::new()))
    }

    fn serialize_tuple(self, _length: usize) -> Result<Items, StructureError> {
        Ok(Items(Vec::new()))
    }

    fn serialize_tuple_struct(self, _name: &'static str, _length: usize) -> Result<Items, StructureError> {
        Ok(Items(Vec::new()))
    }

    fn serialize_tuple_variant(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
        _length: usize,
    ) -> Result<Items, StructureError> {
        Ok(Items(vec![keyword(variant)]))
    }

    fn serialize_map(self, _length: Option<usize>) -> Result<Pairs, StructureError> {
        Ok(Pairs::default())
    }

    fn serialize_struct(self, _name: &'static str, _length: usize) -> Result<Items, StructureError> {
        Ok(Items(Vec::new()))
    }

    fn serialize_struct_variant(
        self,
        _name: &'static str,
        _index: u32,
        variant: &'static str,
        _length: usize,
    ) -> Result<Items, StructureError> {
        Ok(Items(vec![keyword(variant)]))
    }
}

/// Returns an integer as data.
fn integer(value: BigInt) -> Data {
    i64::try_from(&value).map_or(Data::BigInteger(value), Data::Integer)
}

/// Implements the traits of sequences, whose methods differ in their names only.
macro_rules! serialize_items {
    ($($owner:ident :: $method:ident;)*) => {
        $(impl ser::$owner for Items {
            type Ok = Data;
            type Error = StructureError;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), StructureError> {
                self.push(value)
            }

            fn end(self) -> Result<Data, StructureError> {
                Ok(Items::end(self))
            }
        })*
    };
}

serialize_items! {
    SerializeSeq::serialize_element;
    SerializeTuple::serialize_element;
    SerializeTupleStruct::serialize_field;
    SerializeTupleVariant::serialize_field;
}

/// Implements the traits of structs.
macro_rules! serialize_fields {
    ($($owner:ident)*) => {
        $(impl ser::$owner for Items {
            type Ok = Data;
            type Error = StructureError;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                name: &'static str,
                value: &T,
            ) -> Result<(), StructureError> {
                self.push_field(name, value)
            }

            fn end(self) -> Result<Data, StructureError> {
                Ok(Items::end(self))
            }
        })*
    };
}

serialize_fields! { SerializeStruct SerializeStructVariant }

impl ser::SerializeMap for Pairs {
    type Ok = Data;
    type Error = StructureError;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), StructureError> {
        self.1 = Some(key.serialize(ToData)?);
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), StructureError> {
        let key = self.1.take().unwrap_or(Data::Nil);
        self.0.push(pair(key, value.serialize(ToData)?));
        Ok(())
    }

    fn end(self) -> Result<Data, StructureError> {
        Ok(Data::list(self.0))
    }
}

/// Data that are read.
#[derive(Clone, Copy)]
struct Reading<'a>(&'a Data);

impl Reading<'_> {
    fn is_not<T>(&self, expected: &str) -> Result<T, StructureError> {
        Err(StructureError(format!("expected {expected}, found {}", self.0)))
    }

    /// Returns the elements of a list or vector.
    fn elements(&self) -> Option<&[Data]> {
        match self.0 {
            Data::Vector(items) => Some(items),
            list => list.as_list(),
        }
    }
}

/// Returns the keys and values of a property list or an association list.
fn entries(items: &[Data]) -> Option<Vec<(Data, Data)>> {
    let is_pair = |item: &Data| matches!(item, Data::List(_) | Data::DottedList(..));
    if items.iter().all(is_pair) {
        return items.iter().map(entry).collect();
    }
    if !items.len().is_multiple_of(2) {
        return None;
    }
    Some(items.chunks(2).map(|two| (two[0].clone(), two[1].clone())).collect())
}

/// Returns the key and the value of a pair.
fn entry(pair: &Data) -> Option<(Data, Data)> {
    match pair {
        Data::List(items) => {
            let (key, rest) = items.split_first()?;
            Some((key.clone(), Data::list(rest.to_vec())))
        }
        Data::DottedList(items, end) => {
            let (key, rest) = items.split_first()?;
            let value =
                if rest.is_empty() { (**end).clone() } else { Data::DottedList(rest.to_vec(), end.clone()) };
            Some((key.clone(), value))
        }
        _ => None,
    }
}

impl<'de> de::Deserializer<'de> for Reading<'_> {
    type Error = StructureError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        match self.0 {
            Data::Nil => visitor.visit_unit(),
            Data::True => visitor.visit_bool(true),
            Data::Integer(value) => visitor.visit_i64(*value),
            Data::BigInteger(value) => {
                match (u64::try_from(value), i128::try_from(value), u128::try_from(value)) {
                    (Ok(value), ..) => visitor.visit_u64(value),
                    (_, Ok(value), _) => visitor.visit_i128(value),
                    (_, _, Ok(value)) => visitor.visit_u128(value),
                    _ => self.is_not("an integer of at most 128 bits"),
                }
            }
            Data::Float(value) => visitor.visit_f64(*value),
            Data::Character(value) => visitor.visit_char(*value),
            Data::String(value) => visitor.visit_str(value),
            Data::Keyword(_) | Data::Symbol(_) => {
                visitor.visit_string(field_name(self.0).unwrap_or_default())
            }
            Data::List(items) | Data::Vector(items) => visitor.visit_seq(Sequence(items.iter())),
            Data::Ratio(..) | Data::DottedList(..) => self.is_not("a number or a list"),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        visitor.visit_bool(self.0.is_true())
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        match self.0.as_float() {
            Some(value) => visitor.visit_f64(value),
            None => self.is_not("a number"),
        }
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        self.deserialize_f64(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        if self.0.is_true() { visitor.visit_some(self) } else { visitor.visit_none() }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, StructureError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        match self.elements() {
            Some(items) => visitor.visit_seq(Sequence(items.iter())),
            None => self.is_not("a list or a vector"),
        }
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        _length: usize,
        visitor: V,
    ) -> Result<V::Value, StructureError> {
        self.deserialize_seq(visitor)
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _length: usize,
        visitor: V,
    ) -> Result<V::Value, StructureError> {
        self.deserialize_seq(visitor)
    }

    fn deserialize_bytes<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        self.deserialize_seq(visitor)
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        self.deserialize_seq(visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        match self.0.as_list().and_then(entries) {
            Some(entries) => visitor.visit_map(Entries::new(entries, None)),
            None => self.is_not("a property list or an association list"),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, StructureError> {
        match self.0.as_list().and_then(entries) {
            Some(entries) => visitor.visit_map(Entries::new(entries, Some(fields))),
            None => self.is_not("a property list or an association list"),
        }
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, StructureError> {
        let (key, rest) = match self.0 {
            Data::List(items) => (&items[0], &items[1..]),
            key => (key, &[][..]),
        };
        match variants.iter().find(|variant| is_named(key, variant)) {
            Some(variant) => visitor.visit_enum(Variant { variant, rest }),
            None => self.is_not(&format!("one of {}", variants.join(", "))),
        }
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        visitor.visit_unit()
    }

    fn deserialize_identifier<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        match field_name(self.0) {
            Some(name) => visitor.visit_string(name),
            None => self.is_not("a name"),
        }
    }

    serde::forward_to_deserialize_any! {
        i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 char str string unit unit_struct
    }
}

/// Items that are read in order.
struct Sequence<'a>(std::slice::Iter<'a, Data>);

impl<'de> SeqAccess<'de> for Sequence<'_> {
    type Error = StructureError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, StructureError> {
        self.0.next().map(|item| seed.deserialize(Reading(item))).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

/// Keys and values that are read in order.
struct Entries {
    left: std::vec::IntoIter<(Data, Data)>,
    value: Option<Data>,
    /// Names of the fields of a struct; keys are any data without them.
    fields: Option<&'static [&'static str]>,
}

impl Entries {
    fn new(entries: Vec<(Data, Data)>, fields: Option<&'static [&'static str]>) -> Entries {
        Entries { left: entries.into_iter(), value: None, fields }
    }
}

impl<'de> MapAccess<'de> for Entries {
    type Error = StructureError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, StructureError> {
        let Some((key, value)) = self.left.next() else { return Ok(None) };
        self.value = Some(value);
        let Some(fields) = self.fields else { return seed.deserialize(Reading(&key)).map(Some) };
        let field = fields.iter().find(|field| is_named(&key, field));
        match field.map(ToString::to_string).or_else(|| field_name(&key)) {
            Some(name) => seed.deserialize(name.into_deserializer()).map(Some),
            None => seed.deserialize(Reading(&key)).map(Some),
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, StructureError> {
        seed.deserialize(Reading(&self.value.take().unwrap_or(Data::Nil)))
    }
}

/// A variant of an enum, and what comes behind its keyword.
struct Variant<'a> {
    variant: &'static str,
    rest: &'a [Data],
}

impl<'de> EnumAccess<'de> for Variant<'_> {
    type Error = StructureError;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), StructureError> {
        let name: de::value::StrDeserializer<'_, StructureError> = self.variant.into_deserializer();
        Ok((seed.deserialize(name)?, self))
    }
}

impl<'de> VariantAccess<'de> for Variant<'_> {
    type Error = StructureError;

    fn unit_variant(self) -> Result<(), StructureError> {
        if self.rest.is_empty() {
            Ok(())
        } else {
            Err(StructureError(format!("expected nothing behind {}", keyword(self.variant))))
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, StructureError> {
        match self.rest {
            [value] => seed.deserialize(Reading(value)),
            _ => Err(StructureError(format!("expected one value behind {}", keyword(self.variant)))),
        }
    }

    fn tuple_variant<V: Visitor<'de>>(self, _length: usize, visitor: V) -> Result<V::Value, StructureError> {
        visitor.visit_seq(Sequence(self.rest.iter()))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, StructureError> {
        match entries(self.rest) {
            Some(entries) => visitor.visit_map(Entries::new(entries, Some(fields))),
            None => Err(StructureError(format!("expected fields behind {}", keyword(self.variant)))),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use serde::Deserialize;

    use super::*;

    #[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
    enum Mode {
        Idle,
        Drive(f64),
        Between(u8, u8),
        TurnTo { heading_deg: i32, fast: bool },
    }

    #[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
    struct Report {
        name: String,
        initial: char,
        modes: Vec<Mode>,
        parent: Option<Box<Report>>,
        counts: BTreeMap<String, Vec<u64>>,
        pair: (i8, bool),
        unit: (),
    }

    fn report() -> Report {
        Report {
            name: "left".into(),
            initial: 'l',
            modes: vec![
                Mode::Idle,
                Mode::Drive(1.5),
                Mode::Between(1, 2),
                Mode::TurnTo { heading_deg: -90, fast: true },
            ],
            parent: None,
            counts: [("a".to_owned(), vec![1, u64::MAX]), ("b".to_owned(), vec![])].into(),
            pair: (-1, false),
            unit: (),
        }
    }

    #[test]
    fn structures_survive_the_way_to_data_and_back() {
        let report = Report { parent: Some(Box::new(report())), ..report() };
        let data = Data::from_structure(&report).expect("it is plain");
        assert_eq!(data.to_structure::<Report>(), Ok(report));
    }

    #[test]
    fn structures_are_lists_that_programs_read() {
        let data = Data::from_structure(&report()).expect("it is plain").to_string();
        assert_eq!(
            data,
            "(:NAME \"left\" :INITIAL #\\l :MODES (:IDLE (:DRIVE 1.5) (:BETWEEN 1 2) (:TURN-TO :HEADING-DEG -90 :FAST \
             T)) :PARENT NIL :COUNTS ((\"a\" 1 18446744073709551615) (\"b\")) :PAIR (-1 NIL) :UNIT NIL)"
        );
    }

    #[test]
    fn association_lists_and_what_is_wrong() {
        #[derive(Debug, Deserialize, PartialEq)]
        struct Point {
            x_m: f64,
            y_m: Option<f64>,
        }
        let key = |name: &str| Data::Keyword(name.into());
        let one =
            Data::list([Data::DottedList(vec![Data::Symbol("X-M".into())], Box::new(Data::Integer(3)))]);
        assert_eq!(one.to_structure(), Ok(Point { x_m: 3.0, y_m: None }));
        let wrong = |data: &Data| data.to_structure::<Point>().expect_err("it is wrong").to_string();
        assert_eq!(wrong(&Data::list([key("X-M"), "far".into()])), "expected a number, found \"far\"");
        assert_eq!(wrong(&Data::list([key("Y-M"), 1_i64.into()])), "missing field `x_m`");
        assert_eq!(
            wrong(&Data::list([key("X-M")])),
            "expected a property list or an association list, found (:X-M)"
        );
        let mode = |data: Data| data.to_structure::<Mode>();
        assert_eq!(mode(Data::Symbol("IDLE".into())), Ok(Mode::Idle));
        assert!(mode(Data::list([key("DRIVE")])).is_err() && mode(key("FLY")).is_err());
        assert!(mode(Data::list([key("IDLE"), 1_i64.into()])).is_err());
    }
}
