//! From structures to data.

use esl_bytecode::BigInt;
use serde::{Serialize, ser};

use super::{StructureError, keyword};
use crate::data::Data;

/// Makes data.
pub(super) struct ToData;

/// The items of a list that is being made; behind a keyword, if there is one.
pub(super) struct Items(Vec<Data>);

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
pub(super) struct Pairs(Vec<Data>, Option<Data>);

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
        serialize_bytes &[u8] => |value| Data::from(value);
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
