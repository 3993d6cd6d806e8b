//! Payloads to messages: plain CDR, in either byte order.
//!
//! Guarantees: no payload makes the reader panic, nor take more memory than a multiple of its length: the
//! length of a sequence is compared with the bytes that are left before anything is made of it.

use std::sync::Arc;

use esl_bytecode::Bytes;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::properties::PropertyValue;
use esl_bytecode::span::Span;

use super::complete::{check_length, step};
use super::definition::FieldExtent;
use super::fault::{FieldStep, MessageFault, MessageProblem, MessageResult};
use super::message_type::{Element, MessageField, MessageType};
use super::scalar::{Scalar, boolean, vector};

/// Greatest number of values of a message, elements of packed arrays apart. A program cannot take in more.
const MAX_PARTS: usize = 1_000_000;

/// Bytes that may follow a message: some senders fill up the payload.
const MAX_TRAILING: usize = 3;

/// Returns the message in a payload.
///
/// # Errors
/// The payload is not one of this type, with the path of the field at which that shows.
pub fn decode(message_type: &MessageType, payload: &[u8]) -> MessageResult<Datum> {
    let decode = || {
        let (header, bytes) = payload
            .split_first_chunk::<4>()
            .ok_or_else(|| MessageFault::new(MessageProblem::Truncated { needed: 4, left: payload.len() }))?;
        let is_little = match u16::from_be_bytes([header[0], header[1]]) {
            0 => false,
            1 => true,
            id => return Err(MessageFault::new(MessageProblem::Encoding(id))),
        };
        let mut reader = PayloadReader { bytes, place: 0, is_little, parts: MAX_PARTS };
        let message = reader.message(message_type)?;
        match reader.left() {
            0..=MAX_TRAILING => Ok(message),
            trailing => Err(MessageFault::new(MessageProblem::Trailing(trailing))),
        }
    };
    decode().map_err(|fault: MessageFault| fault.of(message_type.name()))
}

struct PayloadReader<'a> {
    bytes: &'a [u8],
    place: usize,
    is_little: bool,
    /// Number of values that may still be made.
    parts: usize,
}

/// Defines a function that returns the numbers of a slice.
macro_rules! numbers {
    ($name:ident, $ty:ty, $into:ty) => {
        fn $name(bytes: &[u8], is_little: bool) -> Arc<[$into]> {
            let chunks = bytes.as_chunks::<{ size_of::<$ty>() }>().0.iter();
            match is_little {
                true => chunks.map(|chunk| <$ty>::from_le_bytes(*chunk) as $into).collect(),
                false => chunks.map(|chunk| <$ty>::from_be_bytes(*chunk) as $into).collect(),
            }
        }
    };
}

numbers!(floats_of_f32, f32, f64);
numbers!(floats_of_f64, f64, f64);
numbers!(integers_of_i8, i8, i64);
numbers!(integers_of_i16, i16, i64);
numbers!(integers_of_u16, u16, i64);
numbers!(integers_of_i32, i32, i64);
numbers!(integers_of_u32, u32, i64);
numbers!(integers_of_i64, i64, i64);

impl<'a> PayloadReader<'a> {
    fn left(&self) -> usize {
        self.bytes.len() - self.place
    }

    /// Returns the next bytes, behind the padding before a value of this alignment.
    fn take(&mut self, count: usize, alignment: usize) -> MessageResult<&'a [u8]> {
        let start = self.place.next_multiple_of(alignment);
        let taken = start.checked_add(count).and_then(|end| self.bytes.get(start..end));
        let Some(taken) = taken else {
            let needed = (start - self.place) as u64 + count as u64;
            return Err(MessageFault::new(MessageProblem::Truncated { needed, left: self.left() }));
        };
        self.place = start + count;
        Ok(taken)
    }

    fn count_part(&mut self) -> MessageResult<()> {
        self.parts =
            self.parts.checked_sub(1).ok_or_else(|| MessageFault::new(MessageProblem::Parts(MAX_PARTS)))?;
        Ok(())
    }

    /// Returns the number of elements of a sequence, each of which takes at least so many bytes.
    fn length(&mut self, least_size: usize) -> MessageResult<usize> {
        let bytes = self.take(4, 4)?;
        let bytes = bytes.try_into().unwrap_or_default();
        let length = if self.is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) };
        let needed = u64::from(length) * least_size as u64;
        if needed > self.left() as u64 {
            return Err(MessageFault::new(MessageProblem::Truncated { needed, left: self.left() }));
        }
        Ok(length as usize)
    }

    fn message(&mut self, message_type: &MessageType) -> MessageResult<Datum> {
        if message_type.fields.is_empty() {
            self.take(1, 1)?;
        }
        let mut values = Vec::with_capacity(message_type.fields.len());
        for field in &message_type.fields {
            values.push(self.field(field).map_err(|fault| fault.inside(step(field)))?);
        }
        Ok(Datum::properties(message_type.keywords.clone(), values))
    }

    fn field(&mut self, field: &MessageField) -> MessageResult<PropertyValue> {
        let least_size = match &field.element {
            Element::Scalar(scalar) => scalar.size(),
            Element::Text { .. } => 4,
            Element::Message(message) => message.least_size,
        };
        let count = match field.extent {
            FieldExtent::One => return self.element(&field.element),
            FieldExtent::Fixed(count) => count,
            FieldExtent::Sequence(_) => {
                let count = self.length(least_size)?;
                check_length(field.extent, count)?;
                count
            }
        };
        match field.element {
            Element::Scalar(scalar) if scalar != Scalar::Bool => {
                self.packed(scalar, count).map(PropertyValue::from)
            }
            _ => {
                let mut items = Vec::with_capacity(count.min(self.left()));
                for index in 0..count {
                    let item = self.element(&field.element);
                    items.push(item.map_err(|fault| fault.inside(FieldStep::Index(index)))?.to_datum());
                }
                Ok(vector(items).into())
            }
        }
    }

    fn packed(&mut self, scalar: Scalar, count: usize) -> MessageResult<Datum> {
        self.count_part()?;
        // An empty sequence is not followed by the padding before its elements.
        let alignment = if count == 0 { 1 } else { scalar.size() };
        let bytes = self.take(count.saturating_mul(scalar.size()), alignment)?;
        let is_little = self.is_little;
        let packed = match scalar {
            Scalar::Bool | Scalar::Byte | Scalar::Char | Scalar::Uint8 => {
                PackedVector::Bytes(Bytes::copy_from_slice(bytes))
            }
            Scalar::Float32 => PackedVector::Floats(floats_of_f32(bytes, is_little)),
            Scalar::Float64 => PackedVector::Floats(floats_of_f64(bytes, is_little)),
            Scalar::Int8 => PackedVector::Integers(integers_of_i8(bytes, is_little)),
            Scalar::Int16 => PackedVector::Integers(integers_of_i16(bytes, is_little)),
            Scalar::Uint16 => PackedVector::Integers(integers_of_u16(bytes, is_little)),
            Scalar::Int32 => PackedVector::Integers(integers_of_i32(bytes, is_little)),
            Scalar::Uint32 => PackedVector::Integers(integers_of_u32(bytes, is_little)),
            Scalar::Int64 => PackedVector::Integers(integers_of_i64(bytes, is_little)),
            Scalar::Uint64 => {
                let integers = integers_of_i64(bytes, is_little);
                if integers.iter().any(|&n| n < 0) {
                    let whole = |&n: &i64| Datum::integer(n.cast_unsigned(), Span::default());
                    return Ok(vector(integers.iter().map(whole).collect()));
                }
                PackedVector::Integers(integers)
            }
        };
        Ok(Datum::new(DatumKind::Packed(packed), Span::default()))
    }

    fn element(&mut self, element: &Element) -> MessageResult<PropertyValue> {
        self.count_part()?;
        match element {
            Element::Message(message) => self.message(message).map(PropertyValue::from),
            Element::Scalar(scalar) => self.scalar(*scalar),
            Element::Text { is_wide, most } => {
                let text = if *is_wide { self.wide_text()? } else { self.text()? };
                let length = if *is_wide { text.encode_utf16().count() } else { text.len() };
                match most {
                    Some(most) if length > *most => {
                        let expected = format!("at most {most}");
                        Err(MessageFault::new(MessageProblem::Length { expected, given: length }))
                    }
                    _ => Ok(Datum::string(&text, Span::default()).into()),
                }
            }
        }
    }

    fn scalar(&mut self, scalar: Scalar) -> MessageResult<PropertyValue> {
        let size = scalar.size();
        let bytes = self.take(size, size)?;
        if scalar == Scalar::Bool {
            return match bytes[0] {
                byte @ 0..=1 => Ok(boolean(byte == 1).into()),
                byte => Err(MessageFault::new(MessageProblem::Boolean(byte))),
            };
        }
        let mut low = [0; 8];
        low[..size].copy_from_slice(bytes);
        if !self.is_little {
            low[..size].reverse();
        }
        let bits = u64::from_le_bytes(low);
        Ok(match scalar {
            Scalar::Float32 => PropertyValue::Float(f32::from_bits(bits as u32).into()),
            Scalar::Float64 => PropertyValue::Float(f64::from_bits(bits)),
            Scalar::Int8 => PropertyValue::Integer((bits as i8).into()),
            Scalar::Int16 => PropertyValue::Integer((bits as i16).into()),
            Scalar::Int32 => PropertyValue::Integer((bits as i32).into()),
            Scalar::Int64 => PropertyValue::Integer(bits.cast_signed()),
            _ => match i64::try_from(bits) {
                Ok(integer) => PropertyValue::Integer(integer),
                Err(_) => Datum::integer(bits, Span::default()).into(),
            },
        })
    }

    fn text(&mut self) -> MessageResult<String> {
        let length = self.length(1)?;
        // Some senders write an empty text without its zero byte.
        if length == 0 {
            return Ok(String::new());
        }
        let bytes = self.take(length, 1)?;
        let Some((0, text)) = bytes.split_last() else {
            return Err(MessageFault::new(MessageProblem::Unterminated));
        };
        String::from_utf8(text.to_vec()).map_err(|_| MessageFault::new(MessageProblem::NotUnicode))
    }

    fn wide_text(&mut self) -> MessageResult<String> {
        let length = self.length(4)?;
        let bytes = self.take(length * 4, 1)?;
        let units = integers_of_u32(bytes, self.is_little);
        let units: Option<Vec<u16>> = units.iter().map(|&unit| u16::try_from(unit).ok()).collect();
        let text = units.and_then(|units| String::from_utf16(&units).ok());
        text.ok_or_else(|| MessageFault::new(MessageProblem::NotUnicode))
    }
}
