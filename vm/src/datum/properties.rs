//! Property lists of the host, which become objects without data for their parts.

use esl_bytecode::properties::{PropertyList, PropertyValue};

use super::packed::integer_of;
use crate::heap::{AllocError, Heap};
use crate::names::Names;
use crate::value::Value;

/// Returns the work of moving a property list, without its values that are data: that of the list that it is,
/// so that a replayed run, which gets the list, costs as much.
pub(super) fn work_of(properties: &PropertyList) -> usize {
    let scalars = properties.values().iter().filter(|value| !matches!(value, PropertyValue::Datum(_)));
    // Of each pair the key and two conses, and the end.
    3 * properties.keys().len() + scalars.count() + 1
}

/// Returns the object of a property list, whose values that are data became `objects`.
///
/// # Errors
/// As for every allocation.
pub(super) fn value_of(
    heap: &mut Heap,
    names: &mut Names,
    properties: &PropertyList,
    objects: &[Value],
) -> Result<Value, AllocError> {
    let mut objects = objects.iter().rev();
    let mut list = Value::NIL;
    for (key, value) in properties.keys().iter().zip(properties.values()).rev() {
        let value = match value {
            PropertyValue::Integer(n) => integer_of(heap, *n)?,
            PropertyValue::Float(x) => heap.float(*x)?,
            PropertyValue::Datum(_) => objects.next().copied().unwrap_or(Value::NIL),
        };
        let key = match key.as_symbol() {
            Some(symbol) => names.intern(heap, symbol)?,
            None => Value::NIL,
        };
        let rest = heap.cons(value, list)?;
        list = heap.cons(key, rest)?;
    }
    Ok(list)
}
