//! Messages that programs give, checked against their type and completed.
//!
//! Guarantees: the result has all fields in their order, each with a value of its type, arrays packed where a
//! packed vector holds them. So writing it cannot fail.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_bytecode::span::Span;
use num_bigint::BigInt;
use num_traits::ToPrimitive;

use super::definition::FieldExtent;
use super::fault::{FieldStep, MessageFault, MessageProblem, MessageResult};
use super::message_type::{Element, MessageField, MessageType};
use super::scalar::{Scalar, boolean, float, vector};

/// Returns a message with all its fields: those that are not given have their defaults.
///
/// A message is a property list. A keyword in place of a number or a text is the constant of that name, an
/// array may be a list or any vector, and a number of seconds stands for a time or a duration.
///
/// # Errors
/// The first field that is unknown, given twice, or of a wrong type, with its path.
pub fn complete(message_type: &MessageType, message: &Datum) -> MessageResult<Datum> {
    complete_message(message_type, message).map_err(|fault| fault.of(message_type.name()))
}

/// Returns the default of a field without one in its definition.
pub(super) fn default_of(element: &Element, extent: FieldExtent) -> Datum {
    let single = match element {
        Element::Scalar(scalar) => scalar.zero(),
        Element::Text { .. } => Datum::string("", Span::default()),
        Element::Message(message) => message.defaults(),
    };
    match extent {
        FieldExtent::One => single,
        FieldExtent::Fixed(count) => array_of(element, vec![single; count]),
        FieldExtent::Sequence(_) => array_of(element, Vec::new()),
    }
}

/// Returns an array of values of the type, in the form that a program gets.
pub(super) fn array_of(element: &Element, items: Vec<Datum>) -> Datum {
    match element {
        Element::Scalar(scalar) => scalar.array_of(items),
        _ => vector(items),
    }
}

/// Returns a property list.
pub(super) fn plist<'a, I>(pairs: I) -> Datum
where
    I: IntoIterator<Item = (&'a Datum, Datum)>,
    I::IntoIter: DoubleEndedIterator,
{
    pairs.into_iter().rev().fold(Datum::nil(Span::default()), |rest, (keyword, value)| {
        Datum::cons(keyword.clone(), Datum::cons(value, rest, Span::default()), Span::default())
    })
}

fn complete_message(message_type: &MessageType, message: &Datum) -> MessageResult<Datum> {
    if message.is_nil() {
        return Ok(message_type.defaults());
    }
    if message_type.is_time
        && let Some(time) = time_of(message)
    {
        return time
            .map(|time| complete_message(message_type, &time))
            .unwrap_or_else(|| Err(wrong_type("a number of seconds that fits into int32", message)));
    }
    let fields = &message_type.fields;
    let mut given: Vec<Option<Datum>> = vec![None; fields.len()];
    let mut rest = message;
    let mut expected = 0;
    while let Some((key, after)) = rest.as_cons() {
        let Some((value, after)) = after.as_cons() else { return Err(not_a_message(message_type, message)) };
        let index = place_of(fields, key, expected);
        let Some(index) = index else { return Err(unknown_field(message_type, message, key)) };
        let field = &fields[index];
        if given[index].is_some() {
            return Err(MessageFault::new(MessageProblem::Twice(lower(key))));
        }
        let value = complete_field(message_type, field, value).map_err(|fault| fault.inside(step(field)))?;
        given[index] = Some(value);
        expected = index + 1;
        rest = after;
    }
    if !rest.is_nil() {
        return Err(not_a_message(message_type, message));
    }
    let values = fields.iter().zip(given);
    let values = values.map(|(field, value)| value.unwrap_or_else(|| field.default.clone()).into());
    Ok(Datum::properties(message_type.keywords.clone(), values.collect()))
}

/// Returns the place of the field that a keyword names. Fields are mostly given in their order.
fn place_of(fields: &[MessageField], key: &Datum, expected: usize) -> Option<usize> {
    let key = key.as_symbol().filter(|key| key.is_keyword())?;
    let is_it = |field: &MessageField| field.keyword.as_symbol() == Some(key);
    match fields.get(expected) {
        Some(field) if is_it(field) => Some(expected),
        _ => fields.iter().position(is_it),
    }
}

/// Returns the step into a field.
pub(super) fn step(field: &MessageField) -> FieldStep {
    FieldStep::Field(field.keyword.as_symbol().map_or_else(String::new, |symbol| symbol.name().to_owned()))
}

fn lower(datum: &Datum) -> String {
    datum.to_string().to_ascii_lowercase()
}

fn not_a_message(message_type: &MessageType, message: &Datum) -> MessageFault {
    let expected = format!("a property list of the fields of {}", message_type.name());
    wrong_type(&expected, message)
}

fn unknown_field(message_type: &MessageType, message: &Datum, key: &Datum) -> MessageFault {
    if !key.as_symbol().is_some_and(|key| key.is_keyword()) {
        return not_a_message(message_type, message);
    }
    let given = lower(key);
    let names = message_type.fields.iter().map(|field| lower(&field.keyword));
    let nearest = nearest(&given, names);
    MessageFault::new(MessageProblem::UnknownField { given, of: message_type.name().to_owned(), nearest })
}

/// Returns the name that is most similar to a given one, if any is similar.
pub(crate) fn nearest(given: &str, names: impl Iterator<Item = String>) -> Option<String> {
    const SIMILAR: f64 = 0.75;
    let rated = names.map(|name| (strsim::jaro_winkler(given, &name), name));
    let best = rated.filter(|(similarity, _)| *similarity >= SIMILAR).max_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, name)| name)
}

fn wrong_type(expected: &str, given: &Datum) -> MessageFault {
    const SHOWN: usize = 80;
    let mut text = given.to_string();
    if text.chars().count() > SHOWN {
        text = text.chars().take(SHOWN).collect::<String>() + "…";
    }
    MessageFault::new(MessageProblem::WrongType { expected: expected.to_owned(), given: text })
}

fn complete_field(of: &MessageType, field: &MessageField, value: &Datum) -> MessageResult<Datum> {
    if field.extent == FieldExtent::One {
        return complete_element(of, &field.element, value);
    }
    let count = match value.kind() {
        DatumKind::Nil => 0,
        DatumKind::Packed(packed) => packed.len(),
        DatumKind::Vector(items) => items.len(),
        DatumKind::Cons(..) => value.elements().count(),
        _ => return Err(wrong_type(&format!("an array, {}", field.type_text()), value)),
    };
    check_length(field.extent, count)?;
    if let (Element::Scalar(scalar), DatumKind::Packed(packed)) = (&field.element, value.kind())
        && let Some(same) = repacked(*scalar, packed)
    {
        return Ok(same);
    }
    let complete = |(index, item): (usize, &Datum)| {
        complete_element(of, &field.element, item).map_err(|fault| fault.inside(FieldStep::Index(index)))
    };
    let items: MessageResult<Vec<Datum>> = match value.kind() {
        DatumKind::Vector(items) => items.iter().enumerate().map(complete).collect(),
        DatumKind::Packed(packed) => unpacked(packed).iter().enumerate().map(complete).collect(),
        _ => {
            let mut elements = value.elements();
            let items = elements.by_ref().enumerate().map(complete).collect();
            if !elements.tail().is_nil() {
                return Err(wrong_type(&format!("an array, {}", field.type_text()), value));
            }
            items
        }
    };
    Ok(array_of(&field.element, items?))
}

/// Checks the number of elements of an array.
pub(super) fn check_length(extent: FieldExtent, given: usize) -> MessageResult<()> {
    let expected = match extent {
        FieldExtent::Fixed(count) if given != count => format!("{count} elements"),
        FieldExtent::Sequence(Some(most)) if given > most => format!("at most {most} elements"),
        _ => return Ok(()),
    };
    Err(MessageFault::new(MessageProblem::Length { expected, given }))
}

/// Returns a packed vector as an array of the type, if it is one without a look at each element as a datum.
fn repacked(scalar: Scalar, packed: &PackedVector) -> Option<Datum> {
    let packed = match packed {
        PackedVector::Bytes(_) if scalar.is_octet() => packed.clone(),
        PackedVector::Floats(_) if scalar == Scalar::Float64 => packed.clone(),
        PackedVector::Floats(floats) if scalar == Scalar::Float32 => {
            let is_inside = |&value: &f64| single(value).is_some();
            let is_rounded = |&value: &f64| f64::from(value as f32).to_bits() == value.to_bits();
            match floats.iter().all(is_rounded) {
                true => packed.clone(),
                false if floats.iter().all(is_inside) => {
                    PackedVector::Floats(floats.iter().map(|&value| f64::from(value as f32)).collect())
                }
                false => return None,
            }
        }
        PackedVector::Integers(integers) => {
            let (least, greatest) = scalar.range().filter(|_| !scalar.is_octet())?;
            let fits = |&n: &i64| (least..=greatest).contains(&n.into());
            integers.iter().all(fits).then(|| packed.clone())?
        }
        _ => return None,
    };
    Some(Datum::new(DatumKind::Packed(packed), Span::default()))
}

/// Returns a float rounded to single precision; `None` if it is outside of that range.
fn single(value: f64) -> Option<f64> {
    let rounded = value as f32;
    (rounded.is_finite() || !value.is_finite()).then_some(rounded.into())
}

fn unpacked(packed: &PackedVector) -> Vec<Datum> {
    let integer = |n: i64| Datum::integer(n, Span::default());
    match packed {
        PackedVector::Bytes(bytes) => bytes.iter().map(|&byte| integer(byte.into())).collect(),
        PackedVector::Integers(integers) => integers.iter().map(|&n| integer(n)).collect(),
        PackedVector::Floats(floats) => floats.iter().map(|&value| float(value)).collect(),
    }
}

fn complete_element(of: &MessageType, element: &Element, value: &Datum) -> MessageResult<Datum> {
    match element {
        Element::Message(message) => complete_message(message, value),
        Element::Scalar(Scalar::Bool) => match value.kind() {
            DatumKind::Nil => Ok(boolean(false)),
            DatumKind::Symbol(symbol) if symbol.is_cl("T") => Ok(boolean(true)),
            _ => constant_or(of, element, value, "a boolean, T or NIL"),
        },
        Element::Scalar(scalar) => complete_number(*scalar, value).unwrap_or_else(|| {
            let expected = match scalar.range() {
                Some((least, greatest)) => {
                    format!("{}, an integer from {least} to {greatest}", scalar.name())
                }
                None => format!("{}, a real number in its range", scalar.name()),
            };
            constant_or(of, element, value, &expected)
        }),
        Element::Text { is_wide, most } => match value.kind() {
            DatumKind::String(text) => {
                let length = if *is_wide { text.encode_utf16().count() } else { text.len() };
                match most {
                    Some(most) if length > *most => {
                        let unit = if *is_wide { "code units" } else { "bytes" };
                        let expected = format!("at most {most} {unit}");
                        Err(MessageFault::new(MessageProblem::Length { expected, given: length }))
                    }
                    _ => Ok(value.clone()),
                }
            }
            _ => constant_or(of, element, value, "a string"),
        },
    }
}

/// Returns a number of the type; `None` if the value is not one.
fn complete_number(scalar: Scalar, value: &Datum) -> Option<MessageResult<Datum>> {
    if scalar.is_float() {
        let number = match value.kind() {
            DatumKind::Float(number) => *number,
            DatumKind::Integer(number) => number.to_f64().filter(|number| number.is_finite())?,
            DatumKind::Ratio(numerator, denominator) => quotient(numerator, denominator)?,
            _ => return None,
        };
        let number = if scalar == Scalar::Float32 { single(number)? } else { number };
        return Some(Ok(float(number)));
    }
    let DatumKind::Integer(number) = value.kind() else { return None };
    let (least, greatest) = scalar.range()?;
    let fits = i128::try_from(number).is_ok_and(|number| (least..=greatest).contains(&number));
    fits.then(|| Ok(value.clone()))
}

fn quotient(numerator: &BigInt, denominator: &BigInt) -> Option<f64> {
    // Both are halved until they are floats: a ratio of long integers may be a small number.
    let shift = numerator.bits().max(denominator.bits()).saturating_sub(1000);
    let quotient = (numerator >> shift).to_f64()? / (denominator >> shift).to_f64()?;
    quotient.is_finite().then_some(quotient)
}

/// Returns the constant that a keyword names.
fn constant_or(of: &MessageType, element: &Element, value: &Datum, expected: &str) -> MessageResult<Datum> {
    let Some(key) = value.as_symbol().filter(|key| key.is_keyword()) else {
        return Err(wrong_type(expected, value));
    };
    let is_named = |name: &str| name.replace('_', "-").eq_ignore_ascii_case(key.name());
    let fits = |value: &Datum| match element {
        Element::Text { .. } => matches!(value.kind(), DatumKind::String(_)),
        Element::Scalar(Scalar::Bool) => value.is_nil() || value.as_symbol().is_some(),
        Element::Scalar(scalar) => complete_number(*scalar, value).is_some(),
        Element::Message(_) => false,
    };
    let mut fitting = of.constants.iter().filter(|constant| fits(&constant.value));
    if let Some(constant) = fitting.clone().find(|constant| is_named(&constant.name)) {
        return Ok(constant.value.clone());
    }
    if fitting.next().is_none() {
        return Err(wrong_type(expected, value));
    }
    let given = lower(value);
    let names = of.constants.iter().filter(|constant| fits(&constant.value));
    let nearest =
        nearest(&given, names.map(|c| format!(":{}", c.name.replace('_', "-").to_ascii_lowercase())));
    Err(MessageFault::new(MessageProblem::UnknownConstant { given, of: of.name().to_owned(), nearest }))
}

/// Returns a number of seconds as a time, if it is a number; the inner `None` if it is out of range.
fn time_of(seconds: &Datum) -> Option<Option<Datum>> {
    const BILLION: i64 = 1_000_000_000;
    let nanoseconds = match seconds.kind() {
        DatumKind::Float(value) => {
            let whole = value.floor();
            let rest = ((value - whole) * BILLION as f64).round();
            BigInt::from(whole.to_i64().unwrap_or(i64::MAX)) * BILLION
                + BigInt::from(rest.to_i64().unwrap_or(0))
        }
        DatumKind::Integer(value) => value.to_big() * BILLION,
        DatumKind::Ratio(numerator, denominator) => {
            num_integer::Integer::div_floor(&(numerator * BILLION), denominator)
        }
        _ => return None,
    };
    let parts = num_integer::Integer::div_mod_floor(&nanoseconds, &BigInt::from(BILLION));
    let fits = i32::try_from(&parts.0).is_ok();
    let integer = |value: BigInt| Datum::integer(value, Span::default());
    Some(fits.then(|| {
        let (sec, nanosec) = (super::keyword("sec"), super::keyword("nanosec"));
        plist([(&sec, integer(parts.0)), (&nanosec, integer(parts.1))])
    }))
}
