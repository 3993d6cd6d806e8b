//! Type predicates, and the tests for types that instructions make.

use esl_bytecode::opcode::TypeCode;

use crate::heap::Kind;
use crate::heap::layout::Symbol;
use crate::number;
use crate::raise::Outcome;
use crate::value::Value;
use crate::vm::Vm;

/// Whether `value` is of the type with this code.
pub(crate) fn has_type_code(vm: &Vm, value: Value, code: TypeCode) -> bool {
    let heap = &vm.heap;
    match code {
        TypeCode::Cons => value.is_cons(),
        TypeCode::Atom => !value.is_cons(),
        TypeCode::List => value.is_list(),
        TypeCode::Null => value.is_nil(),
        TypeCode::Symbol => is_symbol(vm, value),
        TypeCode::Keyword => heap.symbol(value).is_some_and(|cell| cell.header.flags & Symbol::KEYWORD != 0),
        TypeCode::Number | TypeCode::Real => number::is_number(heap, value),
        TypeCode::Integer => number::is_integer(heap, value),
        TypeCode::Rational => number::is_rational(heap, value),
        TypeCode::Float => number::is_float(heap, value),
        TypeCode::Fixnum => value.is_fixnum(),
        TypeCode::Bignum => heap.is(value, Kind::Bignum),
        TypeCode::Ratio => heap.is(value, Kind::Ratio),
        TypeCode::Character => value.is_character(),
        TypeCode::String => is_string(vm, value),
        TypeCode::Vector => is_vector(vm, value),
        TypeCode::SimpleVector => heap.is(value, Kind::SimpleVector),
        TypeCode::Array => {
            matches!(heap.kind(value), Some(Kind::SimpleVector | Kind::String | Kind::Bytes | Kind::Array))
        }
        TypeCode::Sequence => value.is_list() || is_vector(vm, value),
        TypeCode::Function => heap.is(value, Kind::Function),
        TypeCode::HashTable => heap.is(value, Kind::HashTable),
    }
}

fn is_symbol(vm: &Vm, value: Value) -> bool {
    value.is_nil() || value == Value::T || vm.heap.is(value, Kind::Symbol)
}

fn is_vector(vm: &Vm, value: Value) -> bool {
    match vm.heap.kind(value) {
        Some(Kind::SimpleVector | Kind::String | Kind::Bytes) => true,
        Some(Kind::Array) => vm.heap.array_dimensions(value).is_some_and(|sizes| sizes.len() == 1),
        _ => false,
    }
}

pub(super) fn is_string(vm: &Vm, value: Value) -> bool {
    match vm.heap.kind(value) {
        Some(Kind::String) => true,
        Some(Kind::Array) => {
            is_vector(vm, value)
                && vm.heap.array(value).is_some_and(|array| vm.heap.is(array.data, Kind::String))
        }
        _ => false,
    }
}

macro_rules! predicates {
    ($( $(#[$doc:meta])* $name:ident = $code:ident ; )*) => {
        $(
            $(#[$doc])*
            pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                Ok(Value::boolean(has_type_code(vm, arguments[0], TypeCode::$code)))
            }
        )*
    };
}

predicates! {
    consp = Cons;
    atom = Atom;
    listp = List;
    null = Null;
    symbolp = Symbol;
    keywordp = Keyword;
    numberp = Number;
    realp = Real;
    rationalp = Rational;
    integerp = Integer;
    floatp = Float;
    characterp = Character;
    stringp = String;
    vectorp = Vector;
    simple_vector_p = SimpleVector;
    arrayp = Array;
    functionp = Function;
    hash_table_p = HashTable;
}

pub(super) fn simple_string_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(vm.heap.is(arguments[0], Kind::String).into())
}

pub(super) fn random_state_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(vm.heap.is(arguments[0], Kind::RandomState).into())
}
