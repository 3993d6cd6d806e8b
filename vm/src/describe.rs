//! Values as short texts, for messages of the machine itself.
//!
//! The printer that programs use is written in ESL; this one is for failures that are put into words before
//! any ESL can run, such as a wrong number of arguments. It shows a few elements and levels and no more.

use num_bigint::BigInt;

use crate::heap::layout::{CodeObject, SymbolObject};
use crate::heap::{Heap, Kind};
use crate::names::class;
use crate::value::Value;

/// Elements of a list or vector, characters of a string, and levels that are shown.
const LENGTH: usize = 10;
const CHARACTERS: usize = 60;
const DEPTH: usize = 3;
/// Limbs of an integer whose digits are shown.
const LIMBS: usize = 8;

/// Returns a short text for a value.
pub(crate) fn describe(heap: &Heap, value: Value) -> String {
    let mut text = String::new();
    describe_into(heap, value, DEPTH, &mut text);
    text
}

/// Returns the name of a function.
pub(crate) fn function_name(heap: &Heap, function: Value) -> String {
    let mut text = String::new();
    describe_function_name(heap, function, DEPTH + 1, &mut text);
    text
}

fn describe_function_name(heap: &Heap, function: Value, depth: usize, text: &mut String) {
    let code = heap.function_code(function).and_then(|code| heap.code(code));
    match code {
        Some(CodeObject { name, .. }) if name.is_true() => describe_name(heap, *name, depth, text),
        _ => text.push_str("an anonymous function"),
    }
}

/// Describes the name of a function or of a class. In a file, any constant may name a function, even the
/// function itself: a name other than a symbol is a level deeper.
fn describe_name(heap: &Heap, name: Value, depth: usize, text: &mut String) {
    if heap.is(name, Kind::Symbol) {
        describe_symbol(heap, name, text);
    } else if depth == 0 {
        text.push('#');
    } else {
        describe_into(heap, name, depth - 1, text);
    }
}

// The depth is bounded by `DEPTH`, so recursion is fine here.
fn describe_into(heap: &Heap, value: Value, depth: usize, text: &mut String) {
    if let Some(n) = value.as_fixnum() {
        text.push_str(&n.to_string());
    } else if let Some(x) = heap.as_double(value) {
        text.push_str(&format!("{x:?}"));
    } else if let Some(code) = value.as_character() {
        text.push_str("#\\");
        text.push(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
    } else if value.is_nil() {
        text.push_str("NIL");
    } else if value == Value::T {
        text.push('T');
    } else if value.is_cons() {
        describe_list(heap, value, depth, text);
    } else {
        describe_object(heap, value, depth, text);
    }
}

fn describe_list(heap: &Heap, list: Value, depth: usize, text: &mut String) {
    if depth == 0 {
        text.push('#');
        return;
    }
    text.push('(');
    let mut rest = list;
    for i in 0.. {
        let Some(pair) = heap.as_cons(rest) else { break };
        if i > 0 {
            text.push(' ');
        }
        if i == LENGTH {
            text.push_str("...)");
            return;
        }
        describe_into(heap, pair.car, depth - 1, text);
        rest = pair.cdr;
    }
    if rest.is_true() {
        text.push_str(" . ");
        describe_into(heap, rest, depth - 1, text);
    }
    text.push(')');
}

fn describe_object(heap: &Heap, value: Value, depth: usize, text: &mut String) {
    match heap.kind(value) {
        Some(Kind::Symbol) => describe_symbol(heap, value, text),
        Some(Kind::String) => {
            let characters = heap.string(value).unwrap_or(&[]);
            let shown: String = characters
                .iter()
                .take(CHARACTERS)
                .map(|&code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER))
                .collect();
            let more = if characters.len() > CHARACTERS { "..." } else { "" };
            text.push_str(&format!("\"{shown}{more}\""));
        }
        Some(Kind::Bignum) => {
            if let Some(big) = heap.bignum(value)
                && big.limbs.len() <= LIMBS
            {
                let bytes: Vec<u8> = big.limbs.iter().flat_map(|limb| limb.to_le_bytes()).collect();
                let magnitude = BigInt::from_bytes_le(num_bigint::Sign::Plus, &bytes);
                text.push_str(&if big.negative { -magnitude } else { magnitude }.to_string());
            } else {
                text.push_str("a large integer");
            }
        }
        Some(Kind::Ratio) => {
            if let Some((numerator, denominator)) = heap.ratio(value) {
                describe_into(heap, numerator, depth, text);
                text.push('/');
                describe_into(heap, denominator, depth, text);
            }
        }
        Some(Kind::Complex) => {
            if let Some((real, imaginary)) = heap.complex(value) {
                text.push_str("#C(");
                describe_into(heap, real, depth, text);
                text.push(' ');
                describe_into(heap, imaginary, depth, text);
                text.push(')');
            }
        }
        Some(Kind::SimpleVector) => {
            if depth == 0 {
                text.push('#');
                return;
            }
            text.push_str("#(");
            for (i, &element) in heap.vector(value).unwrap_or(&[]).iter().enumerate() {
                if i > 0 {
                    text.push(' ');
                }
                if i == LENGTH {
                    text.push_str("...");
                    break;
                }
                describe_into(heap, element, depth - 1, text);
            }
            text.push(')');
        }
        Some(Kind::Function) => {
            text.push_str("#<function ");
            describe_function_name(heap, value, depth, text);
            text.push('>');
        }
        Some(Kind::Structure) => {
            let class = heap.structure_class(value).unwrap_or(Value::NIL);
            text.push_str("#<");
            describe_name(heap, class::name_of(heap, class), depth, text);
            text.push('>');
        }
        Some(kind) => text.push_str(&format!("#<{}>", format!("{kind:?}").to_lowercase())),
        None => text.push_str("#<object>"),
    }
}

fn describe_symbol(heap: &Heap, symbol: Value, text: &mut String) {
    let Some(cell) = heap.symbol(symbol) else { return };
    if cell.header.flags & SymbolObject::KEYWORD != 0 {
        text.push(':');
    }
    text.push_str(&heap.string_text(cell.name).unwrap_or_default());
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::{CodeKind, Shape};
    use crate::trust::{self, heap_for_tests};

    #[test]
    fn functions_that_are_names_of_functions_are_shown_to_a_depth() {
        let mut heap = heap_for_tests();
        let mut name = Value::small(7);
        for level in 0..100_000 {
            let shape = Shape::other(CodeKind::Undefined, 0);
            let code =
                trust::alloc_stub(&mut heap, name, Value::NIL, shape, 1, trust::UNDEFINED_WORD).unwrap();
            name = trust::alloc_function(&mut heap, code, &[Value::NIL]).unwrap();
            if level == 1 {
                assert_eq!(describe(&heap, name), "#<function #<function 7>>");
            }
        }
        let shown = "#<function #<function #<function #>>>";
        assert_eq!(describe(&heap, name), format!("#<function {shown}>"));
        assert_eq!(function_name(&heap, name), format!("#<function {shown}>"));
    }
}
