//! Type predicates.

use esl_bytecode::opcode::TypeCode;

use crate::heap::Kind;
use crate::raise::Outcome;
use crate::types::has_type_code;
use crate::value::Value;
use crate::vm::Vm;

macro_rules! predicates {
    ($( $(#[$doc:meta])* $name:ident = $code:ident ; )*) => {
        $(
            $(#[$doc])*
            pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                Ok(Value::boolean(has_type_code(&vm.heap, arguments[0], TypeCode::$code)))
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
