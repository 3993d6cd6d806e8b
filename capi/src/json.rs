//! Values as texts in JSON, and back.
//!
//! The same as `json:stringify` and `json:parse` of the module `json` with `:objects :alist`, where `NIL` is
//! false, an object is an association list, an array is a vector, and null is `:NULL`.

use std::ffi::c_char;
use std::fmt::{self, Write};

use esl::Data;
use esl::data::PackedVector;
use esl_bytecode::BigInt;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use crate::border::{give_text, guarded, hand, look_within, store, text};
use crate::failure::{Fault, c_text, esl_failure};
use crate::status::esl_status::{self, ESL_NOT_OF_TYPE};
use crate::value::esl_value;

/// Reads a value from a text in JSON: objects are association lists whose keys are strings, arrays vectors,
/// true and false `T` and `NIL`, null `:NULL`, integers of up to 64 bits integers, other numbers floats. An
/// empty object is `NIL`. From any thread.
///
/// # Safety
/// `json` is a text with a null character at its end; `value` and `failure` are places that can be written,
/// or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_of_json(
    json: *const c_char,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let read: JsonData = serde_json::from_str(text(json, "text in JSON")?)
                .map_err(|error| Fault::new(ESL_NOT_OF_TYPE, format!("the text is not JSON: {error}")))?;
            hand(value, esl_value(read.0));
            Ok(())
        })
    }
}

/// Writes a value as a text in JSON, for `esl_text_free`. A list is an object if all its items are pairs
/// whose keys are strings, symbols or integers, otherwise an array. `NIL` is false, `:NULL` null; other
/// symbols are strings in lower case. A value without a form in JSON, such as an infinite float or an object
/// of the embedder's, is refused with `ESL_NOT_OF_TYPE`.
///
/// # Safety
/// `value` is a value; `json` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_json(
    value: *const esl_value,
    json: *mut *mut c_char,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let mut written = String::new();
            write(&look_within(value)?.0, &mut written)?;
            if json.is_null() {
                return Ok(());
            }
            store(json, give_text(c_text(written)));
            Ok(())
        })
    }
}

/// A value as it is read from JSON.
struct JsonData(Data);

impl<'de> Deserialize<'de> for JsonData {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<JsonData, D::Error> {
        deserializer.deserialize_any(JsonVisitor).map(JsonData)
    }
}

struct JsonVisitor;

impl<'de> Visitor<'de> for JsonVisitor {
    type Value = Data;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Data, E> {
        Ok(Data::boolean(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Data, E> {
        Ok(Data::Integer(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Data, E> {
        Ok(i64::try_from(value).map_or_else(|_| Data::BigInteger(BigInt::from(value)), Data::Integer))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Data, E> {
        Ok(Data::Float(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Data, E> {
        Ok(Data::String(value.into()))
    }

    fn visit_unit<E>(self) -> Result<Data, E> {
        Ok(Data::Keyword("NULL".into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Data, A::Error> {
        let mut read = Vec::new();
        while let Some(JsonData(item)) = items.next_element()? {
            read.push(item);
        }
        Ok(Data::Vector(read))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut members: A) -> Result<Data, A::Error> {
        let mut read = Vec::new();
        while let Some((key, JsonData(value))) = members.next_entry::<String, JsonData>()? {
            read.push(pair(Data::String(key), value));
        }
        Ok(Data::list(read))
    }
}

/// Returns the pair `(key . value)`.
fn pair(key: Data, value: Data) -> Data {
    match value {
        Data::Nil => Data::List(vec![key]),
        Data::List(mut items) => {
            items.insert(0, key);
            Data::List(items)
        }
        Data::DottedList(mut items, tail) => {
            items.insert(0, key);
            Data::DottedList(items, tail)
        }
        value => Data::DottedList(vec![key], Box::new(value)),
    }
}

/// Returns the key of an object that a key of a pair or table becomes.
fn object_key(key: &Data) -> Option<String> {
    Some(match key {
        Data::String(key) => key.clone(),
        Data::Symbol(key) | Data::Keyword(key) => key.to_lowercase(),
        Data::True => "t".into(),
        Data::Integer(_) | Data::BigInteger(_) => key.to_string(),
        _ => return None,
    })
}

/// Returns the key and the value of a pair, if its key is one of an object.
fn member(item: &Data) -> Option<(String, Data)> {
    let (key, value) = match item {
        Data::List(items) => (&items[0], Data::list(items[1..].iter().cloned())),
        Data::DottedList(items, tail) if items.len() == 1 => (&items[0], (**tail).clone()),
        Data::DottedList(items, tail) => (&items[0], Data::DottedList(items[1..].into(), tail.clone())),
        _ => return None,
    };
    Some((object_key(key)?, value))
}

fn write_text(text: &str, out: &mut String) -> Result<(), Fault> {
    let quoted =
        serde_json::to_string(text).map_err(|error| Fault::new(ESL_NOT_OF_TYPE, error.to_string()))?;
    out.push_str(&quoted);
    Ok(())
}

fn write_number(number: impl fmt::Display, out: &mut String) -> Result<(), Fault> {
    // Writing to a string does not fail.
    _ = write!(out, "{number}");
    Ok(())
}

fn write_float(number: f64, out: &mut String) -> Result<(), Fault> {
    if !number.is_finite() {
        return Err(Fault::new(ESL_NOT_OF_TYPE, format!("JSON has no form for the float {number}")));
    }
    write_number(format_args!("{number:?}"), out)
}

/// Writes items between brackets, with commas between them.
fn write_items<T>(
    items: impl IntoIterator<Item = T>,
    out: &mut String,
    mut write: impl FnMut(T, &mut String) -> Result<(), Fault>,
) -> Result<(), Fault> {
    for (number, item) in items.into_iter().enumerate() {
        if number > 0 {
            out.push(',');
        }
        write(item, out)?;
    }
    Ok(())
}

fn write_array<T>(
    items: impl IntoIterator<Item = T>,
    out: &mut String,
    write: impl FnMut(T, &mut String) -> Result<(), Fault>,
) -> Result<(), Fault> {
    out.push('[');
    write_items(items, out, write)?;
    out.push(']');
    Ok(())
}

fn write_object<'a>(
    members: impl IntoIterator<Item = (&'a String, &'a Data)>,
    out: &mut String,
) -> Result<(), Fault> {
    out.push('{');
    write_items(members, out, |(key, value), out| {
        write_text(key, out)?;
        out.push(':');
        write(value, out)
    })?;
    out.push('}');
    Ok(())
}

/// Writes a value. Its depth is limited where it has become data.
fn write(data: &Data, out: &mut String) -> Result<(), Fault> {
    match data {
        Data::Nil => out.push_str("false"),
        Data::True => out.push_str("true"),
        Data::Integer(value) => write_number(value, out)?,
        Data::BigInteger(value) => write_number(value, out)?,
        Data::Ratio(numerator, denominator) => {
            let float = |value: &BigInt| value.to_string().parse::<f64>().unwrap_or(f64::NAN);
            write_float(float(numerator) / float(denominator), out)?;
        }
        Data::Float(value) => write_float(*value, out)?,
        Data::Character(value) => write_text(value.encode_utf8(&mut [0; 4]), out)?,
        Data::String(value) => write_text(value, out)?,
        Data::Keyword(name) if name == "NULL" => out.push_str("null"),
        Data::Keyword(name) if name == "FALSE" => out.push_str("false"),
        Data::Keyword(name) | Data::Symbol(name) => write_text(&name.to_lowercase(), out)?,
        Data::List(items) => match items.iter().map(member).collect::<Option<Vec<_>>>() {
            Some(members) => write_object(members.iter().map(|(key, value)| (key, value)), out)?,
            None => write_array(items, out, write)?,
        },
        Data::Vector(items) => write_array(items, out, write)?,
        Data::Packed(PackedVector::Bytes(bytes)) => write_array(bytes.iter(), out, write_number)?,
        Data::Packed(PackedVector::Integers(integers)) => write_array(integers.iter(), out, write_number)?,
        Data::Packed(PackedVector::Floats(floats)) => {
            write_array(floats.iter().copied(), out, write_float)?;
        }
        Data::Table(entries) => {
            let member = |(key, value)| {
                let no_key = || Fault::new(ESL_NOT_OF_TYPE, format!("JSON has no form for the key {key}"));
                Ok((object_key(key).ok_or_else(no_key)?, value))
            };
            let members: Vec<(String, &Data)> =
                entries.iter().map(|(key, value)| member((key, value))).collect::<Result<_, Fault>>()?;
            write_object(members.iter().map(|(key, value)| (key, *value)), out)?;
        }
        Data::DottedList(..) | Data::Opaque(_) => {
            return Err(Fault::new(ESL_NOT_OF_TYPE, format!("JSON has no form for {data}")));
        }
    }
    Ok(())
}
