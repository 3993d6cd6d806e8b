//! The types that instructions test, by their codes.

use esl_bytecode::opcode::TypeCode;

use esl_heap::array::storage;

use crate::heap::layout::SymbolObject;
use crate::heap::{Heap, Kind};
use crate::number;
use crate::value::Value;

/// Returns whether `value` is of the type with this code.
pub(crate) fn has_type_code(heap: &Heap, value: Value, code: TypeCode) -> bool {
    match code {
        TypeCode::Cons => value.is_cons(),
        TypeCode::Atom => !value.is_cons(),
        TypeCode::List => value.is_list(),
        TypeCode::Null => value.is_nil(),
        TypeCode::Symbol => is_symbol(heap, value),
        TypeCode::Keyword => {
            heap.symbol(value).is_some_and(|cell| cell.header.flags & SymbolObject::KEYWORD != 0)
        }
        TypeCode::Number => number::is_number(heap, value),
        TypeCode::Real => number::is_real(heap, value),
        TypeCode::Integer => number::is_integer(heap, value),
        TypeCode::Rational => number::is_rational(heap, value),
        TypeCode::Float => number::is_float(heap, value),
        TypeCode::Fixnum => value.is_fixnum(),
        TypeCode::Bignum => heap.is(value, Kind::Bignum),
        TypeCode::Ratio => heap.is(value, Kind::Ratio),
        TypeCode::Character => value.is_character(),
        TypeCode::String => is_string(heap, value),
        TypeCode::Vector => is_vector(heap, value),
        TypeCode::SimpleVector => heap.is(value, Kind::SimpleVector),
        TypeCode::Array => {
            matches!(heap.kind(value), Some(Kind::SimpleVector | Kind::String | Kind::Bytes | Kind::Array))
        }
        TypeCode::Sequence => value.is_list() || is_vector(heap, value),
        TypeCode::Function => heap.is(value, Kind::Function),
        TypeCode::HashTable => heap.is(value, Kind::HashTable),
    }
}

fn is_symbol(heap: &Heap, value: Value) -> bool {
    value.is_nil() || value == Value::T || heap.is(value, Kind::Symbol)
}

fn is_vector(heap: &Heap, value: Value) -> bool {
    match heap.kind(value) {
        Some(Kind::SimpleVector | Kind::String | Kind::Bytes) => true,
        Some(Kind::Array) => heap.array_dimensions(value).is_some_and(|sizes| sizes.len() == 1),
        _ => false,
    }
}

pub(crate) fn is_string(heap: &Heap, value: Value) -> bool {
    match heap.kind(value) {
        Some(Kind::String) => true,
        Some(Kind::Array) => {
            is_vector(heap, value)
                && storage(heap, value).is_some_and(|(data, _)| heap.is(data, Kind::String))
        }
        _ => false,
    }
}
