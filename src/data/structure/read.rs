//! From data to structures.

use esl_bytecode::packed::PackedVector;
use serde::de::value::SeqDeserializer;
use serde::de::{
    self, DeserializeSeed, EnumAccess, IntoDeserializer, MapAccess, SeqAccess, VariantAccess, Visitor,
};

use super::{StructureError, field_name, is_named, keyword};
use crate::data::Data;

/// Data that are read.
#[derive(Clone, Copy)]
pub(super) struct Reading<'a>(pub(super) &'a Data);

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

/// Returns the keys and values of a hash table, a property list or an association list.
fn entries(data: &Data) -> Option<Vec<(Data, Data)>> {
    match data {
        Data::Table(entries) => Some(entries.clone()),
        list => pairs(list.as_list()?),
    }
}

/// Returns the keys and values of a property list or an association list.
fn pairs(items: &[Data]) -> Option<Vec<(Data, Data)>> {
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

/// Has the elements of a vector of numbers visited.
fn visit_packed<'de, V: Visitor<'de>>(vector: &PackedVector, visitor: V) -> Result<V::Value, StructureError> {
    match vector {
        PackedVector::Bytes(bytes) => visitor.visit_seq(SeqDeserializer::new(bytes.iter().copied())),
        PackedVector::Integers(integers) => visitor.visit_seq(SeqDeserializer::new(integers.iter().copied())),
        PackedVector::Floats(floats) => visitor.visit_seq(SeqDeserializer::new(floats.iter().copied())),
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
            Data::Table(entries) => visitor.visit_map(Entries::new(entries.clone(), None)),
            Data::Packed(vector) => visit_packed(vector, visitor),
            Data::Ratio(..) | Data::DottedList(..) => self.is_not("a number or a list"),
            Data::Opaque(_) => self.is_not("data"),
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
        match (self.0, self.elements()) {
            (Data::Packed(vector), _) => visit_packed(vector, visitor),
            (_, Some(items)) => visitor.visit_seq(Sequence(items.iter())),
            (_, None) => self.is_not("a list or a vector"),
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
        match self.0 {
            Data::Packed(PackedVector::Bytes(bytes)) => visitor.visit_bytes(bytes),
            _ => self.deserialize_seq(visitor),
        }
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        self.deserialize_bytes(visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, StructureError> {
        match entries(self.0) {
            Some(entries) => visitor.visit_map(Entries::new(entries, None)),
            None => self.is_not("a property list, an association list or a hash table"),
        }
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, StructureError> {
        match entries(self.0) {
            Some(entries) => visitor.visit_map(Entries::new(entries, Some(fields))),
            None => self.is_not("a property list, an association list or a hash table"),
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
pub(super) struct Sequence<'a>(std::slice::Iter<'a, Data>);

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
pub(super) struct Entries {
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
pub(super) struct Variant<'a> {
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
        match pairs(self.rest) {
            Some(entries) => visitor.visit_map(Entries::new(entries, Some(fields))),
            None => Err(StructureError(format!("expected fields behind {}", keyword(self.variant)))),
        }
    }
}
