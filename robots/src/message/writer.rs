//! Messages to payloads: CDR as ROS 2 has it, little-endian, with its header of four bytes.

use esl_bytecode::Bytes;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::properties::PropertyValue;

use super::complete::complete;
use super::definition::FieldExtent;
use super::fault::MessageFault;
use super::message_type::{Element, MessageField, MessageType};
use super::scalar::Scalar;

/// Header of a payload: plain CDR, little-endian, no options.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// Returns the payload of a message, which is checked and completed as by [`complete`].
///
/// # Errors
/// As [`complete`].
pub fn encode(message_type: &MessageType, message: &Datum) -> Result<Bytes, MessageFault> {
    let message = complete(message_type, message)?;
    let mut writer = PayloadWriter { bytes: HEADER.to_vec() };
    writer.message(message_type, &message);
    Ok(writer.bytes.into())
}

struct PayloadWriter {
    bytes: Vec<u8>,
}

impl PayloadWriter {
    /// Fills up to the next multiple of `size`, counted from the end of the header.
    fn align(&mut self, size: usize) {
        let length = (self.bytes.len() - HEADER.len()).next_multiple_of(size);
        self.bytes.resize(HEADER.len() + length, 0);
    }

    fn length(&mut self, length: usize) {
        self.align(4);
        // A message of a program has fewer elements than memory has bytes.
        self.bytes.extend(u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
    }

    /// Writes a complete message.
    fn message(&mut self, message_type: &MessageType, message: &Datum) {
        if message_type.fields.is_empty() {
            self.bytes.push(0);
        }
        // As [`complete`] has made it, unless somebody has looked into it as a list.
        if let Some(properties) = message.as_properties() {
            for (field, value) in message_type.fields.iter().zip(properties.values()) {
                match value {
                    PropertyValue::Datum(datum) => self.field(field, datum),
                    scalar => self.field(field, &scalar.to_datum()),
                }
            }
            return;
        }
        let mut rest = message;
        for field in &message_type.fields {
            let Some((value, after)) = rest.as_cons().and_then(|(_, rest)| rest.as_cons()) else { return };
            self.field(field, value);
            rest = after;
        }
    }

    fn field(&mut self, field: &MessageField, value: &Datum) {
        let count = match value.kind() {
            DatumKind::Packed(packed) => packed.len(),
            DatumKind::Vector(items) => items.len(),
            _ => 0,
        };
        match field.extent {
            FieldExtent::One => return self.element(&field.element, value),
            FieldExtent::Sequence(_) => self.length(count),
            FieldExtent::Fixed(_) => {}
        }
        match (value.kind(), &field.element) {
            (DatumKind::Packed(packed), Element::Scalar(scalar)) => self.packed(*scalar, packed),
            (DatumKind::Vector(items), element) => items.iter().for_each(|item| self.element(element, item)),
            _ => {}
        }
    }

    fn packed(&mut self, scalar: Scalar, packed: &PackedVector) {
        if packed.is_empty() {
            return;
        }
        self.align(scalar.size());
        match packed {
            PackedVector::Bytes(bytes) => self.bytes.extend_from_slice(bytes),
            PackedVector::Floats(floats) if scalar == Scalar::Float32 => {
                self.numbers(floats, |value| (value as f32).to_le_bytes());
            }
            PackedVector::Floats(floats) => self.numbers(floats, f64::to_le_bytes),
            // The lowest bytes of a number in range are the number in its own size.
            PackedVector::Integers(integers) => match scalar.size() {
                1 => self.numbers(integers, |n| [n as u8]),
                2 => self.numbers(integers, |n| (n as u16).to_le_bytes()),
                4 => self.numbers(integers, |n| (n as u32).to_le_bytes()),
                _ => self.numbers(integers, i64::to_le_bytes),
            },
        }
    }

    /// Writes numbers, each as `N` bytes: into memory that is made at once, which is five times as fast as
    /// extending byte by byte.
    fn numbers<T: Copy, const N: usize>(&mut self, numbers: &[T], bytes_of: impl Fn(T) -> [u8; N]) {
        let start = self.bytes.len();
        self.bytes.resize(start + numbers.len() * N, 0);
        let places = self.bytes[start..].as_chunks_mut::<N>().0;
        for (place, &number) in places.iter_mut().zip(numbers) {
            *place = bytes_of(number);
        }
    }

    fn element(&mut self, element: &Element, value: &Datum) {
        match (element, value.kind()) {
            (Element::Message(message), _) => self.message(message, value),
            (Element::Text { is_wide: false, .. }, DatumKind::String(text)) => {
                self.length(text.len() + 1);
                self.bytes.extend_from_slice(text.as_bytes());
                self.bytes.push(0);
            }
            // ROS 2 writes each unit of UTF-16 as a number of four bytes, without an end mark.
            (Element::Text { is_wide: true, .. }, DatumKind::String(text)) => {
                self.length(text.encode_utf16().count());
                self.bytes.extend(text.encode_utf16().flat_map(|unit| u32::from(unit).to_le_bytes()));
            }
            (Element::Scalar(Scalar::Bool), _) => self.bytes.push((!value.is_nil()).into()),
            (Element::Scalar(scalar), DatumKind::Integer(number)) => {
                let low = i128::try_from(number).unwrap_or(0).to_le_bytes();
                self.align(scalar.size());
                self.bytes.extend_from_slice(&low[..scalar.size()]);
            }
            (Element::Scalar(scalar), DatumKind::Float(number)) => {
                self.align(scalar.size());
                match scalar {
                    Scalar::Float32 => self.bytes.extend((*number as f32).to_le_bytes()),
                    _ => self.bytes.extend(number.to_le_bytes()),
                }
            }
            _ => {}
        }
    }
}
