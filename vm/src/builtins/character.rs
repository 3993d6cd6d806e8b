//! Characters: codes, case, classes, digits, names, comparison.

use crate::builtins::string::string_designator;
use crate::character;
use crate::raise::{Exit, Outcome};
use crate::types::is_string;
use crate::value::Value;
use crate::vm::Vm;

use super::integer::radix;

/// Returns the code of the character that `v` is; a type error for anything else.
fn code(vm: &mut Vm, v: Value) -> Result<u32, Exit> {
    match v.as_character() {
        Some(code) => Ok(code),
        None => vm.exchange.type_error(v, "CHARACTER"),
    }
}

fn character_of(code: u32) -> Value {
    Value::character(code).unwrap_or(Value::NIL)
}

pub(super) fn char_code(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::index(code(vm, arguments[0])? as usize))
}

pub(super) fn code_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let code = arguments[0].as_index().and_then(|code| u32::try_from(code).ok());
    match code.and_then(Value::character) {
        // Surrogates are not characters: text has no form for them.
        Some(_) if code.is_some_and(|code| char::from_u32(code).is_none()) => Ok(Value::NIL),
        Some(character) => Ok(character),
        None => vm.exchange.index_error(arguments[0], Value::CHARACTER_LIMIT as usize),
    }
}

pub(super) fn to_character(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let v = arguments[0];
    if v.is_character() {
        return Ok(v);
    }
    let is_designator = is_string(&vm.heap, v) || vm.names.is_symbol(&vm.heap, v);
    let string = if is_designator { string_designator(vm, v)? } else { Value::NIL };
    match crate::equality::characters_of(&vm.heap, string) {
        Some(&[code]) => Ok(character_of(code)),
        _ => vm.exchange.not_written(v, "(OR CHARACTER (STRING 1))"),
    }
}

/// Defines functions of one character.
macro_rules! functions {
    ($( $(#[$doc:meta])* $name:ident = |$code:ident| $result:expr; )*) => {
        $( $(#[$doc])* pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
            let $code = code(vm, arguments[0])?;
            Ok($result)
        } )*
    };
}

functions! {
    char_upcase = |code| character_of(character::upcase(code));
    char_downcase = |code| character_of(character::downcase(code));
    upper_case_p = |code| character::is_upper(code).into();
    lower_case_p = |code| character::is_lower(code).into();
    both_case_p = |code| (character::is_upper(code) || character::is_lower(code)).into();
    alpha_char_p = |code| character::is_alphabetic(code).into();
    alphanumericp = |code| character::is_alphanumeric(code).into();
    graphic_char_p = |code| character::is_graphic(code).into();
    standard_char_p = |code| (code == 10 || (0x20..0x7F).contains(&code)).into();
}

pub(super) fn digit_char_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let code = code(vm, arguments[0])?;
    let radix = radix_argument(vm, arguments)?;
    Ok(character::digit_weight(code, radix).map_or(Value::NIL, |weight| Value::index(weight as usize)))
}

pub(super) fn digit_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let radix = radix_argument(vm, arguments)?;
    let weight = vm.integer(arguments[0])?;
    if weight.is_negative() {
        return vm.exchange.type_error(arguments[0], "UNSIGNED-BYTE");
    }
    let weight = arguments[0].as_index().and_then(|weight| u32::try_from(weight).ok());
    let digit = weight.and_then(|weight| char::from_digit(weight, radix));
    Ok(digit.map_or(Value::NIL, |digit| character_of(digit.to_ascii_uppercase() as u32)))
}

fn radix_argument(vm: &mut Vm, arguments: &[Value]) -> Result<u32, Exit> {
    match arguments.get(1) {
        Some(&v) => radix(vm, v),
        None => Ok(10),
    }
}

pub(super) fn char_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let code = code(vm, arguments[0])?;
    match character::name(code) {
        Some(name) => Ok(vm.heap.alloc_str(&name)?),
        None => Ok(Value::NIL),
    }
}

pub(super) fn name_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let string = string_designator(vm, arguments[0])?;
    let characters = crate::equality::characters_of(&vm.heap, string).unwrap_or_default();
    if characters.len() > 64 {
        return Ok(Value::NIL);
    }
    let name: Option<String> = characters.iter().map(|&code| char::from_u32(code)).collect();
    Ok(name.and_then(|name| character::named(&name)).map_or(Value::NIL, character_of))
}

/// Returns whether `holds` is true of all neighbours, as codes. All arguments are checked, also behind a pair
/// for which it is not.
fn chain(vm: &mut Vm, arguments: &[Value], fold: bool, holds: impl Fn(u32, u32) -> bool) -> Outcome {
    let mut codes = Vec::with_capacity(arguments.len());
    for &v in arguments {
        let code = code(vm, v)?;
        codes.push(if fold { character::fold(code) } else { code });
    }
    vm.exchange.charge(codes.len());
    Ok(codes.windows(2).all(|pair| holds(pair[0], pair[1])).into())
}

/// Defines comparisons, exact and without regard to case.
macro_rules! comparisons {
    ($( $exact:ident $loose:ident = $holds:expr; )*) => {
        $(
            #[doc = concat!("`", stringify!($exact), "`")]
            pub(super) fn $exact(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                chain(vm, arguments, false, $holds)
            }

            #[doc = concat!("`", stringify!($loose), "`")]
            pub(super) fn $loose(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                chain(vm, arguments, true, $holds)
            }
        )*
    };
}

comparisons! {
    char_equal_exactly char_equal = |a, b| a == b;
    char_less char_lessp = |a, b| a < b;
    char_greater char_greaterp = |a, b| a > b;
    char_less_equal char_not_greaterp = |a, b| a <= b;
    char_greater_equal char_not_lessp = |a, b| a >= b;
}

/// Returns whether no two characters are the same.
fn all_differ(vm: &mut Vm, arguments: &[Value], fold: bool) -> Outcome {
    chain(vm, arguments, fold, |_, _| true)?;
    let key = |v: &Value| v.as_character().map(|code| if fold { character::fold(code) } else { code });
    let mut codes: Vec<Option<u32>> = arguments.iter().map(key).collect();
    codes.sort_unstable();
    Ok(codes.windows(2).all(|pair| pair[0] != pair[1]).into())
}

pub(super) fn char_not_equal_exactly(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    all_differ(vm, arguments, false)
}

pub(super) fn char_not_equal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    all_differ(vm, arguments, true)
}
