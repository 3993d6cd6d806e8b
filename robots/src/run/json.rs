//! Data of a program as JSON, for people and panels.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use num_traits::ToPrimitive;
use serde_json::{Map, Value, json};

/// Most elements of a list or a vector that are shown.
const ELEMENTS: usize = 1000;

/// Levels of data within data that are shown as such.
const DEPTH: usize = 8;

/// Returns a datum as JSON: a property list as an object, symbols as their names in lower case.
pub(super) fn value_of(datum: &Datum) -> Value {
    nested(datum, DEPTH)
}

/// Returns data as an array of JSON.
pub(super) fn array_of(data: &[Datum]) -> Value {
    data.iter().take(ELEMENTS).map(value_of).collect()
}

fn nested(datum: &Datum, depth: usize) -> Value {
    match datum.kind() {
        DatumKind::Nil => Value::Null,
        DatumKind::Integer(value) => value.to_i64().map_or_else(|| datum.to_string().into(), Value::from),
        // JSON has no infinities.
        DatumKind::Float(value) => {
            serde_json::Number::from_f64(*value).map_or_else(|| value.to_string().into(), Value::Number)
        }
        DatumKind::Ratio(..) => datum.to_string().into(),
        DatumKind::String(text) => text.to_string().into(),
        DatumKind::Symbol(symbol) if symbol.is_cl("T") => true.into(),
        DatumKind::Symbol(symbol) => symbol.name().to_lowercase().into(),
        DatumKind::Packed(PackedVector::Bytes(bytes)) if bytes.len() > ELEMENTS => {
            json!({ "bytes": bytes.len() })
        }
        DatumKind::Packed(packed) => packed_values(packed),
        _ if depth == 0 => datum.to_string().into(),
        DatumKind::Vector(items) => items.iter().take(ELEMENTS).map(|item| nested(item, depth - 1)).collect(),
        DatumKind::Cons(..) => list(datum, depth - 1),
        _ => datum.to_string().into(),
    }
}

fn packed_values(packed: &PackedVector) -> Value {
    match packed {
        PackedVector::Bytes(bytes) => bytes.iter().map(|&byte| Value::from(byte)).collect(),
        PackedVector::Integers(values) => {
            values.iter().take(ELEMENTS).map(|&value| Value::from(value)).collect()
        }
        PackedVector::Floats(values) => {
            values.iter().take(ELEMENTS).map(|&value| Value::from(value)).collect()
        }
    }
}

fn list(datum: &Datum, depth: usize) -> Value {
    let mut elements = datum.elements();
    let items: Vec<&Datum> = elements.by_ref().take(ELEMENTS).collect();
    if !elements.tail().is_nil() && items.len() < ELEMENTS {
        return datum.to_string().into();
    }
    let is_key = |item: &&&Datum| item.as_symbol().is_some_and(|symbol| symbol.is_keyword());
    let is_plist =
        items.len().is_multiple_of(2) && items.iter().step_by(2).filter(is_key).count() * 2 == items.len();
    if is_plist {
        let name = |key: &Datum| key.as_symbol().map_or_else(String::new, |key| key.name().to_lowercase());
        let pairs = items.chunks_exact(2).map(|pair| (name(pair[0]), nested(pair[1], depth)));
        return Value::Object(pairs.collect::<Map<String, Value>>());
    }
    items.into_iter().map(|item| nested(item, depth)).collect()
}

/// Returns the parts of a fact by its text, such as `(BATTERY 12.5)`: its name, and its arguments.
pub(super) fn fact_of(text: &str) -> (String, Vec<Value>) {
    let inner = text.strip_prefix('(').unwrap_or(text);
    let inner = inner.strip_suffix(')').unwrap_or(inner);
    let mut parts = split(inner).into_iter();
    let name = parts.next().unwrap_or_default().to_lowercase();
    (name, parts.map(atom).collect())
}

/// Returns the parts of a text between blanks outside of strings and parentheses.
fn split(text: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth, mut in_string, mut is_escaped) =
        (Vec::new(), 0, 0_u32, false, false);
    for (place, c) in text.char_indices() {
        match c {
            _ if is_escaped => is_escaped = false,
            '\\' => is_escaped = true,
            '"' => in_string = !in_string,
            '(' if !in_string => depth += 1,
            ')' if !in_string => depth = depth.saturating_sub(1),
            ' ' if !in_string && depth == 0 => {
                parts.push(&text[start..place]);
                start = place + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts.retain(|part| !part.is_empty());
    parts
}

fn atom(text: &str) -> Value {
    if let Ok(value) = text.parse::<i64>() {
        return value.into();
    }
    if let Some(number) = text.parse::<f64>().ok().and_then(serde_json::Number::from_f64) {
        return Value::Number(number);
    }
    match text {
        "T" => true.into(),
        "NIL" => Value::Null,
        _ => match text.strip_prefix('"').and_then(|text| text.strip_suffix('"')) {
            Some(inner) => inner.replace("\\\"", "\"").into(),
            None => text.trim_start_matches(':').to_lowercase().into(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facts_have_names_and_arguments() {
        let (name, arguments) = fact_of("(BATTERY A 12.5 -3 \"a b\" :LOW (X Y) T NIL)");
        assert_eq!(name, "battery");
        let expected = json!(["a", 12.5, -3, "a b", "low", "(x y)", true, null]);
        assert_eq!(Value::from(arguments), expected);
        assert_eq!(fact_of("(READY)"), ("ready".into(), Vec::new()));
    }
}
