//! Payloads of messages as property lists, and back.
//!
//! Guarantees: every payload of a known message is read, and every fault of a property list is named with its
//! path. A value outside of its enumeration is a number.

use std::sync::Arc;

use esl_bytecode::Bytes;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::properties::PropertyValue;
use esl_bytecode::span::Span;
use esl_host::{HostFailure, IntoDatum};
use num_traits::ToPrimitive;

use super::definitions::{Dialect, Enumeration, FieldType, MavlinkMessage, PayloadField, keyword};
use super::fault::{ValueFault, shown, suggestion};
use crate::message::nearest;

/// Most bytes of a payload.
pub(super) const MOST_BYTES: usize = 255;

/// Version of the protocol in heartbeats.
const PROTOCOL: u64 = 3;

/// A payload, filled with zeros behind its end, so that every field can be read.
pub(super) type PayloadBytes = [u8; MOST_BYTES + 8];

/// Returns a payload that ends early as one with all its bytes.
pub(super) fn padded(payload: &[u8]) -> PayloadBytes {
    let mut bytes = [0; MOST_BYTES + 8];
    let length = payload.len().min(MOST_BYTES);
    bytes[..length].copy_from_slice(&payload[..length]);
    bytes
}

/// Returns the message that a keyword names.
pub(super) fn message_of(name: &Datum) -> Result<&'static MavlinkMessage, HostFailure> {
    let dialect = Dialect::get();
    let symbol = name.as_symbol().filter(|symbol| symbol.is_keyword());
    symbol.and_then(|symbol| dialect.message_named(symbol.name())).ok_or_else(|| {
        let given = shown(name).to_ascii_lowercase();
        let suggestion = suggestion(nearest(&given, dialect.message_names()).as_deref());
        HostFailure::new("UNKNOWN-MESSAGE", format!("`{given}` is not the name of a message{suggestion}"))
    })
}

// ---- reading

/// Returns the unsigned number of an element.
fn unsigned(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, &byte| number << 8 | u64::from(byte))
}

/// Returns the number of an element of an integer type, as bits.
fn bits(element: FieldType, bytes: &[u8]) -> u64 {
    let number = unsigned(&bytes[..element.size()]);
    let unused = 64 - 8 * element.size();
    match element {
        // The sign is extended.
        FieldType::Int8 | FieldType::Int16 | FieldType::Int32 => ((number << unused) as i64 >> unused) as u64,
        _ => number,
    }
}

fn integer(element: FieldType, bytes: &[u8]) -> PropertyValue {
    let bits = bits(element, bytes);
    match i64::try_from(bits) {
        Err(_) if element == FieldType::Uint64 => Datum::integer(bits, Span::default()).into(),
        _ => PropertyValue::Integer(bits.cast_signed()),
    }
}

fn real(element: FieldType, bytes: &[u8]) -> f64 {
    let number = unsigned(&bytes[..element.size()]);
    if element == FieldType::Float {
        f64::from(f32::from_bits(number as u32))
    } else {
        f64::from_bits(number)
    }
}

/// Returns the keyword, or the list of keywords, of a value.
pub(super) fn datum_of_value(enumeration: &Enumeration, value: u64) -> Datum {
    let number = |value: u64| Datum::integer(value, Span::default());
    if !enumeration.is_bits {
        return enumeration.keyword(value).cloned().unwrap_or_else(|| number(value));
    }
    let mut rest = value;
    let mut found = Vec::new();
    for (bits, keyword) in &enumeration.entries {
        if *bits != 0 && value & bits == *bits && rest & bits != 0 {
            rest &= !bits;
            found.push(keyword.clone());
        }
    }
    if rest != 0 {
        found.push(number(rest));
    }
    Datum::list(found, Span::default())
}

fn read_field(field: &PayloadField, bytes: &[u8]) -> PropertyValue {
    let element = field.element;
    let Some(count) = field.count else {
        return match &field.enumeration {
            Some(enumeration) => {
                let width = 8 * element.size();
                datum_of_value(enumeration, bits(element, bytes) & (u64::MAX >> (64 - width))).into()
            }
            // Some vehicles send the bytes of an integer here, which a float that is not a number does not
            // keep.
            None if field.name == "param_value" && real(element, bytes).is_nan() => {
                vec![keyword("BITS"), integer(FieldType::Uint32, bytes).to_datum()].into_datum().into()
            }
            None if element.is_float() => PropertyValue::Float(real(element, bytes)),
            None => integer(element, bytes),
        };
    };
    read_array(element, count, bytes).into()
}

fn read_array(element: FieldType, count: usize, bytes: &[u8]) -> Datum {
    let elements = bytes.chunks(element.size()).take(count);
    let packed = match element {
        FieldType::Char => {
            let text = &bytes[..count];
            let end = text.iter().position(|&byte| byte == 0).unwrap_or(count);
            return String::from_utf8_lossy(&text[..end]).into_datum_text();
        }
        FieldType::Uint8 => PackedVector::Bytes(Bytes::copy_from_slice(&bytes[..count])),
        FieldType::Float | FieldType::Double => {
            PackedVector::Floats(elements.map(|bytes| real(element, bytes)).collect())
        }
        FieldType::Uint64 => {
            let numbers: Vec<Datum> = elements.map(|bytes| integer(element, bytes).to_datum()).collect();
            let small = elements_of_i64(&numbers);
            match small {
                Some(small) => PackedVector::Integers(small),
                None => return Datum::new(DatumKind::Vector(numbers.into()), Span::default()),
            }
        }
        _ => PackedVector::Integers(elements.map(|bytes| bits(element, bytes) as i64).collect()),
    };
    Datum::new(DatumKind::Packed(packed), Span::default())
}

fn elements_of_i64(numbers: &[Datum]) -> Option<Arc<[i64]>> {
    let small = |datum: &Datum| match datum.kind() {
        DatumKind::Integer(number) => number.to_i64(),
        _ => None,
    };
    numbers.iter().map(small).collect()
}

/// Makes a string of a text.
trait IntoText {
    fn into_datum_text(self) -> Datum;
}

impl IntoText for std::borrow::Cow<'_, str> {
    fn into_datum_text(self) -> Datum {
        Datum::string(&self, Span::default())
    }
}

/// Returns the property list of a payload.
pub(super) fn decode(message: &MavlinkMessage, payload: &PayloadBytes) -> Datum {
    let values = message.fields.iter().map(|field| read_field(field, &payload[field.offset..]));
    Datum::properties(message.keywords.clone(), values.collect())
}

// ---- writing

/// Returns the number that a datum is, as a float.
pub(super) fn number_of(datum: &Datum) -> Option<f64> {
    match datum.kind() {
        DatumKind::Float(number) => Some(*number),
        DatumKind::Integer(number) => number.to_f64(),
        DatumKind::Ratio(numerator, denominator) => Some(numerator.to_f64()? / denominator.to_f64()?),
        _ => None,
    }
}

/// Returns the value that a keyword, or a list of keywords and numbers, stands for.
pub(super) fn value_of_datum(enumeration: &Enumeration, datum: &Datum) -> Result<u64, ValueFault> {
    let unexpected = |expected: &str, given: &Datum| {
        ValueFault::unexpected(format!("{expected} of {}", enumeration.name), given)
    };
    match datum.kind() {
        DatumKind::Integer(number) => number.to_u64().ok_or_else(|| unexpected("a value", datum)),
        DatumKind::Symbol(symbol) if symbol.is_keyword() => {
            enumeration.value(symbol.name()).ok_or_else(|| {
                let given = format!(":{}", symbol.name().to_ascii_lowercase());
                let nearest = nearest(&given, enumeration.names());
                ValueFault::Unknown { given, of: enumeration.name.clone(), nearest }
            })
        }
        DatumKind::Symbol(symbol) if symbol.is_cl("T") && enumeration.value("TRUE").is_some() => Ok(1),
        DatumKind::Nil | DatumKind::Cons(..) if enumeration.is_bits => {
            let mut value = 0;
            let mut elements = datum.elements();
            for element in elements.by_ref() {
                if element.as_cons().is_some() {
                    return Err(unexpected("a keyword", element));
                }
                value |= value_of_datum(enumeration, element)?;
            }
            match elements.tail().is_nil() {
                true => Ok(value),
                false => Err(unexpected("a list of keywords", datum)),
            }
        }
        DatumKind::Nil if enumeration.value("FALSE").is_some() => Ok(0),
        _ if enumeration.is_bits => Err(unexpected("an integer, or a list of keywords", datum)),
        _ => Err(unexpected("an integer, or a keyword", datum)),
    }
}

/// Returns the bits that a list `(:BITS n)` gives a float.
fn bits_of(datum: &Datum) -> Option<u32> {
    let (head, rest) = datum.as_cons()?;
    let (bits, end) = rest.as_cons()?;
    let is_bits = head.as_symbol().is_some_and(|head| head.is_keyword() && head.name() == "BITS");
    match bits.kind() {
        DatumKind::Integer(bits) if is_bits && end.is_nil() => bits.to_u32(),
        _ => None,
    }
}

/// Writes an element.
fn write_element(element: FieldType, datum: &Datum, bytes: &mut [u8]) -> Result<(), ValueFault> {
    if element == FieldType::Float
        && let Some(bits) = bits_of(datum)
    {
        write_bits(element, u64::from(bits), bytes);
        return Ok(());
    }
    if element.is_float() {
        // NIL is not a value.
        let number = if datum.is_nil() { Some(f64::NAN) } else { number_of(datum) };
        let fits = |number: &f64| {
            element == FieldType::Double || !number.is_finite() || (*number as f32).is_finite()
        };
        let number = number.filter(fits).ok_or_else(|| {
            let expected = format!("{}, a real number in its range, or nil", element.name());
            ValueFault::unexpected(expected, datum)
        })?;
        let number = match element {
            FieldType::Float => u64::from((number as f32).to_bits()),
            _ => number.to_bits(),
        };
        write_bits(element, number, bytes);
        return Ok(());
    }
    let (least, greatest) = element.range();
    let number = match datum.kind() {
        DatumKind::Integer(number) => number.to_i128().filter(|number| (least..=greatest).contains(number)),
        _ => None,
    };
    let number = number.ok_or_else(|| {
        let expected = format!("{}, an integer from {least} to {greatest}", element.name());
        ValueFault::unexpected(expected, datum)
    })?;
    write_bits(element, number as u64, bytes);
    Ok(())
}

fn write_bits(element: FieldType, number: u64, bytes: &mut [u8]) {
    bytes[..element.size()].copy_from_slice(&number.to_le_bytes()[..element.size()]);
}

/// Writes a field; a fault may be that of an element.
fn write_field(
    field: &PayloadField,
    datum: &Datum,
    bytes: &mut [u8],
) -> Result<(), (Option<usize>, ValueFault)> {
    let here = |fault: ValueFault| (None, fault);
    let element = field.element;
    let Some(count) = field.count else {
        return match &field.enumeration {
            Some(enumeration) => {
                let value = value_of_datum(enumeration, datum).map_err(here)?;
                let most = u64::MAX >> (64 - 8 * element.size());
                if value > most {
                    return Err(here(ValueFault::unexpected(format!("at most {most}"), datum)));
                }
                write_bits(element, value, bytes);
                Ok(())
            }
            None => write_element(element, datum, bytes).map_err(here),
        };
    };
    if element == FieldType::Char {
        let DatumKind::String(text) = datum.kind() else {
            return Err(here(ValueFault::unexpected("a string", datum)));
        };
        if text.len() > count {
            return Err(here(ValueFault::Length { most: count, unit: "bytes", given: text.len() }));
        }
        bytes[..text.len()].copy_from_slice(text.as_bytes());
        return Ok(());
    }
    let items: Vec<Datum> = match datum.kind() {
        DatumKind::Packed(PackedVector::Bytes(bytes)) => {
            bytes.iter().map(|&byte| i64::from(byte).into_datum()).collect()
        }
        DatumKind::Packed(PackedVector::Integers(numbers)) => {
            numbers.iter().map(|&n| n.into_datum()).collect()
        }
        DatumKind::Packed(PackedVector::Floats(numbers)) => numbers.iter().map(|&n| n.into_datum()).collect(),
        DatumKind::Vector(items) => items.to_vec(),
        DatumKind::Nil | DatumKind::Cons(..) => datum.elements().cloned().collect(),
        _ => {
            let expected = format!("an array of {count} {}", element.name());
            return Err(here(ValueFault::unexpected(expected, datum)));
        }
    };
    // A shorter one is filled with zeros.
    if items.len() > count {
        return Err(here(ValueFault::Length { most: count, unit: "elements", given: items.len() }));
    }
    for (place, (item, bytes)) in items.iter().zip(bytes.chunks_mut(element.size())).enumerate() {
        write_element(element, item, bytes).map_err(|fault| (Some(place), fault))?;
    }
    Ok(())
}

/// Returns the next key of a property list, its value, and the rest; `None` at its end.
fn next_pair<'a>(list: &mut &'a Datum) -> Result<Option<(&'a str, &'a Datum)>, ValueFault> {
    if list.is_nil() {
        return Ok(None);
    }
    let unexpected = || ValueFault::unexpected("keywords and values", list);
    let (key, rest) = list.as_cons().ok_or_else(unexpected)?;
    let (value, rest) = rest.as_cons().ok_or_else(unexpected)?;
    let symbol = key.as_symbol().filter(|symbol| symbol.is_keyword()).ok_or_else(unexpected)?;
    *list = rest;
    Ok(Some((symbol.name(), value)))
}

/// Returns the name of a keyword as it is written.
fn written(name: &str) -> String {
    format!(":{}", name.to_ascii_lowercase())
}

/// Returns the payload of a property list. Fields that are left out are zero; those of the system and the
/// component that the message is for are the `target`.
pub(super) fn encode(
    message: &MavlinkMessage,
    fields: &Datum,
    target: (u8, u8),
) -> Result<PayloadBytes, HostFailure> {
    let of = message.keyword.to_string().to_ascii_lowercase();
    let mut bytes = [0; MOST_BYTES + 8];
    let mut given = vec![false; message.fields.len()];
    for field in message.fields.iter().filter(|field| field.is_version) {
        write_bits(field.element, PROTOCOL, &mut bytes[field.offset..]);
    }
    for (place, value) in [(message.target.0, target.0), (message.target.1, target.1)] {
        if let Some(place) = place {
            bytes[place] = value;
        }
    }
    let mut rest = fields;
    while let Some((name, value)) = next_pair(&mut rest).map_err(|fault| fault.at("", &of))? {
        let path = written(name);
        let is_it = |field: &PayloadField| field.keyword.as_symbol().is_some_and(|key| key.name() == name);
        let place = message.fields.iter().position(is_it).ok_or_else(|| {
            let names = message.fields.iter().map(|field| field.keyword.to_string().to_ascii_lowercase());
            ValueFault::NoSuchPart { kind: "field", nearest: nearest(&path, names) }.at(&path, &of)
        })?;
        if std::mem::replace(&mut given[place], true) {
            return Err(ValueFault::Twice.at(&path, &of));
        }
        let field = &message.fields[place];
        write_field(field, value, &mut bytes[field.offset..]).map_err(|(index, fault)| match index {
            None => fault.at(&path, &of),
            Some(index) => fault.at(&format!("{path} {index}"), &of),
        })?;
    }
    Ok(bytes)
}

// ---- commands

/// Returns the number of a command and its seven parameters, of a property list by their names.
pub(super) fn command_of(name: &Datum, parameters: &Datum) -> Result<(u64, [f64; 7]), HostFailure> {
    let dialect = Dialect::get();
    let commands = dialect.enumeration("MAV_CMD");
    let of = shown(name).to_ascii_lowercase();
    let number = match (name.kind(), commands) {
        (DatumKind::Integer(number), _) => number.to_u16().map(u64::from),
        (DatumKind::Symbol(symbol), Some(commands)) if symbol.is_keyword() => commands.value(symbol.name()),
        _ => None,
    };
    let number = number.ok_or_else(|| {
        let names = commands.into_iter().flat_map(|commands| commands.names());
        let suggestion = suggestion(nearest(&of, names).as_deref());
        HostFailure::new("UNKNOWN-COMMAND", format!("`{of}` is not the name of a command{suggestion}"))
    })?;
    let command = dialect.command(number);
    let known = command.map_or(&[][..], |command| &command.parameters);
    let mut values = [0.0; 7];
    for (value, parameter) in values.iter_mut().zip(known) {
        *value = parameter.default;
    }
    let mut rest = parameters;
    while let Some((name, value)) = next_pair(&mut rest).map_err(|fault| fault.at("", &of))? {
        let path = written(name);
        let by_number = name.strip_prefix("PARAM").and_then(|number| number.parse::<usize>().ok());
        let place = known
            .iter()
            .position(|parameter| parameter.name == name)
            .or(by_number.filter(|number| (1..=7).contains(number)).map(|number| number - 1));
        let place = place.ok_or_else(|| {
            let names = known.iter().map(|parameter| written(&parameter.name));
            ValueFault::NoSuchPart { kind: "parameter", nearest: nearest(&path, names) }.at(&path, &of)
        })?;
        let enumeration = known.get(place).and_then(|parameter| parameter.enumeration.as_ref());
        values[place] = match (value.kind(), enumeration) {
            (DatumKind::Symbol(symbol), _) if symbol.is_cl("T") => 1.0,
            (DatumKind::Symbol(_) | DatumKind::Cons(..), Some(enumeration)) => {
                value_of_datum(enumeration, value).map_err(|fault| fault.at(&path, &of))? as f64
            }
            (DatumKind::Nil, _) => f64::NAN,
            _ => number_of(value)
                .ok_or_else(|| ValueFault::unexpected("a real number or nil", value).at(&path, &of))?,
        };
    }
    Ok((number, values))
}
