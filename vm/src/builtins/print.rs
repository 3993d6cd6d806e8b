//! How atoms are written: symbols with the escapes that make them read back, strings in quotes, characters by
//! name.
//!
//! Not here: what the printer variables say and the way through lists and vectors, which are written in ESL;
//! packages.

use crate::character;
use crate::equality::characters_of;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

use super::COPY_LIMIT;

/// Returns the string in quotes, with `\` before `"` and `\`.
pub(super) fn string_escaped(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(characters) = characters_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    if characters.len() > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let mut written = Vec::with_capacity(characters.len() + 2);
    written.push('"' as u32);
    for &code in characters {
        if code == '"' as u32 || code == '\\' as u32 {
            written.push('\\' as u32);
        }
        written.push(code);
    }
    written.push('"' as u32);
    vm.exchange.charge(written.len());
    Ok(vm.heap.alloc_string(&written)?)
}

/// `#\` and the character or its name.
pub(super) fn character_escaped(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(code) = arguments[0].as_character() else {
        return vm.exchange.type_error(arguments[0], "CHARACTER");
    };
    let mut written = vec!['#' as u32, '\\' as u32];
    match character::name(code) {
        // The printer shows a blank as itself.
        Some(name) if code != ' ' as u32 => written.extend(name.chars().map(|c| c as u32)),
        _ => written.push(code),
    }
    Ok(vm.heap.alloc_string(&written)?)
}

pub(super) fn symbol_name_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, case, escape] = exactly(arguments);
    let Some(characters) = characters_of(&vm.heap, name) else {
        return vm.exchange.type_error(name, "STRING");
    };
    if characters.len() > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let written = if escape.is_true() && needs_bars(characters) {
        barred(characters)
    } else {
        in_case(characters, case)
    };
    vm.exchange.charge(written.len());
    Ok(vm.heap.alloc_string(&written)?)
}

fn barred(characters: &[u32]) -> Vec<u32> {
    let mut written = vec!['|' as u32];
    for &code in characters {
        if code == '|' as u32 || code == '\\' as u32 {
            written.push('\\' as u32);
        }
        written.push(code);
    }
    written.push('|' as u32);
    written
}

fn in_case(characters: &[u32], case: Value) -> Vec<u32> {
    let mut in_word = false;
    let change = |&code: &u32| {
        let changed = match case.as_fixnum() {
            Some(1) => character::downcase(code),
            Some(2) if in_word => character::downcase(code),
            _ => code,
        };
        in_word = character::is_alphanumeric(code);
        changed
    };
    characters.iter().map(change).collect()
}

/// Returns whether a name read as it stands would be another symbol, or none, or has a character that would
/// do that elsewhere.
fn needs_bars(characters: &[u32]) -> bool {
    let is_plain = |&code: &u32| {
        let c = char::from_u32(code).unwrap_or(' ');
        character::upcase(code) == code
            && !matches!(c, '"' | '#' | '\'' | '(' | ')' | ',' | ';' | '`' | ':' | '|' | '\\')
            && !c.is_whitespace()
            && !c.is_control()
    };
    characters.is_empty()
        || !characters.iter().all(is_plain)
        || characters.iter().all(|&code| code == '.' as u32)
        || looks_like_a_number(characters)
}

/// Returns whether a token is what the standard calls a potential number (2.3.1.1): it has a digit, begins
/// with a digit, sign, point or `^` or `_`, does not end with a sign, and consists of these, `/`, and letters
/// none of which are neighbours.
fn looks_like_a_number(characters: &[u32]) -> bool {
    let token: Option<Vec<u8>> = characters.iter().map(|&code| u8::try_from(code).ok()).collect();
    let Some(token) = token else { return false };
    let is_start = |c: u8| c.is_ascii_digit() || matches!(c, b'+' | b'-' | b'.' | b'^' | b'_');
    let is_part = |c: u8| is_start(c) || c == b'/' || c.is_ascii_alphabetic();
    token.first().is_some_and(|&c| is_start(c))
        && token.last().is_some_and(|&c| !matches!(c, b'+' | b'-'))
        && token.iter().any(u8::is_ascii_digit)
        && token.iter().all(|&c| is_part(c))
        && !token.windows(2).any(|pair| pair.iter().all(u8::is_ascii_alphabetic))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(name: &str, expected: &str) {
        let mut vm = Vm::for_tests();
        let name = vm.heap.alloc_str(name).unwrap();
        let written = symbol_name_string(&mut vm, &[name, Value::small(0), Value::T]).unwrap();
        assert_eq!(vm.heap.string_text(written).as_deref(), Some(expected));
    }

    #[test]
    fn names_that_would_not_read_back_have_bars() {
        for plain in ["FOO", "1+", "1-", "+", "-", "A.B", "..A", "/", "12AB", "A1", "FOO-BAR", "*X*", "É"] {
            check(plain, plain);
        }
        for (name, expected) in [
            ("", "||"),
            ("foo", "|foo|"),
            ("1", "|1|"),
            ("-1.5", "|-1.5|"),
            ("1/2", "|1/2|"),
            ("1/2/3", "|1/2/3|"),
            ("1E", "|1E|"),
            (".", "|.|"),
            ("A B", "|A B|"),
            ("A:B", "|A:B|"),
            ("A|B\\", "|A\\|B\\\\|"),
            ("#A", "|#A|"),
            ("A#", "|A#|"),
        ] {
            check(name, expected);
        }
    }
}
