//! JSON: values of a text that are neither long nor deep, parts of strings, and escapes.
//!
//! The module `:json`, which is in ESL and can be interrupted, takes long or deep values apart and passes the
//! parts to this one. Nothing here recurses deeper than [`DEPTH`].

use smallvec::SmallVec;

use crate::builtins::stream::{few_characters, write_part as write_characters};
use crate::builtins::table::puthash;
use crate::equality::KeyTest;
use crate::number::text;
use crate::raise::{Exit, Outcome};
use crate::table::{KeyComparison, Table};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Characters that one call reads.
const LENGTH: usize = 1 << 13;
/// Lists within lists that one call reads.
const DEPTH: usize = 100;

const QUOTE: u32 = 0x22;
const BACKSLASH: u32 = 0x5C;

/// Reason why a value is not read.
enum JsonStop {
    /// The text is wrong here.
    Fault(usize, &'static str),
    /// The value is too long or too deep for one call.
    Large,
    /// As for every builtin.
    Exit(Exit),
}

impl From<Exit> for JsonStop {
    fn from(exit: Exit) -> JsonStop {
        match exit {
            Exit::Slowly => JsonStop::Large,
            exit => JsonStop::Exit(exit),
        }
    }
}

impl From<crate::heap::AllocError> for JsonStop {
    fn from(error: crate::heap::AllocError) -> JsonStop {
        JsonStop::Exit(error.into())
    }
}

/// A text that is being read.
struct JsonReader<'a> {
    vm: &'a mut Vm,
    text: &'a [u32],
    at: usize,
    values: JsonValues,
}

/// The program's choice of values for those of a text.
#[derive(Clone, Copy)]
struct JsonValues {
    /// Whether objects become hash tables.
    are_tables: bool,
    /// Whether an empty object becomes a hash table.
    is_table_if_empty: bool,
    /// The value for `false`.
    no: Value,
    /// The value for `null`.
    null: Value,
}

fn is_blank(code: u32) -> bool {
    matches!(code, 0x20 | 0x09 | 0x0A | 0x0D)
}

fn is_digit(code: Option<u32>) -> bool {
    code.is_some_and(|code| (0x30..=0x39).contains(&code))
}

/// Returns the length of the value at the beginning of a text, or of all of it if it has no end; `None` if
/// that is too long, or the value too deep.
fn extent(text: &[u32]) -> Option<usize> {
    let end = text.len().min(LENGTH);
    let (mut at, mut depth) = (0, 0);
    while at < end {
        match text[at] {
            QUOTE => {
                at += 1;
                while at < end && text[at] != QUOTE {
                    // An escaped character does not end the string.
                    at += if text[at] == BACKSLASH { 2 } else { 1 };
                }
                if at >= end {
                    break;
                }
                if depth == 0 {
                    return Some(at + 1);
                }
            }
            // [ and {
            0x5B | 0x7B => {
                depth += 1;
                if depth > DEPTH {
                    return None;
                }
            }
            // ] and }
            0x5D | 0x7D if depth <= 1 => return Some(at + depth),
            0x5D | 0x7D => depth -= 1,
            0x2C if depth == 0 => return Some(at),
            code if depth == 0 && is_blank(code) => return Some(at),
            _ => {}
        }
        at += 1;
    }
    (text.len() <= LENGTH).then_some(text.len())
}

impl JsonReader<'_> {
    fn peek(&self) -> Option<u32> {
        self.text.get(self.at).copied()
    }

    fn skip_blanks(&mut self) {
        while self.peek().is_some_and(is_blank) {
            self.at += 1;
        }
    }

    fn is_next(&mut self, character: char) -> bool {
        let is_next = self.peek() == Some(u32::from(character));
        self.at += usize::from(is_next);
        is_next
    }

    fn word(&mut self, word: &str, value: Value) -> Result<Value, JsonStop> {
        let is_here = word
            .chars()
            .enumerate()
            .all(|(index, character)| self.text.get(self.at + index).copied() == Some(u32::from(character)));
        if !is_here {
            return Err(JsonStop::Fault(self.at, "expected a value"));
        }
        self.at += word.len();
        Ok(value)
    }

    /// Reads a value, after blanks.
    fn value(&mut self) -> Result<Value, JsonStop> {
        self.skip_blanks();
        match self.peek().and_then(char::from_u32) {
            Some('{') => self.object(),
            Some('[') => self.array(),
            Some('"') => self.string(),
            Some('-' | '0'..='9') => self.number(),
            Some('t') => self.word("true", Value::T),
            Some('f') => self.word("false", self.values.no),
            Some('n') => self.word("null", self.values.null),
            _ => Err(JsonStop::Fault(self.at, "expected a value")),
        }
    }

    fn array(&mut self) -> Result<Value, JsonStop> {
        self.at += 1;
        let mut items: SmallVec<[Value; 16]> = SmallVec::new();
        self.skip_blanks();
        if !self.is_next(']') {
            loop {
                items.push(self.value()?);
                self.skip_blanks();
                if self.is_next(']') {
                    break;
                }
                if !self.is_next(',') {
                    return Err(JsonStop::Fault(self.at, "expected `,` or `]`"));
                }
            }
        }
        Ok(self.vm.heap.alloc_vector(&items)?)
    }

    fn object(&mut self) -> Result<Value, JsonStop> {
        self.at += 1;
        let mut members: SmallVec<[(Value, Value); 8]> = SmallVec::new();
        self.skip_blanks();
        if !self.is_next('}') {
            loop {
                self.skip_blanks();
                if self.peek() != Some(QUOTE) {
                    return Err(JsonStop::Fault(self.at, "expected a key, a string"));
                }
                let key = self.string()?;
                self.skip_blanks();
                if !self.is_next(':') {
                    return Err(JsonStop::Fault(self.at, "expected `:` after the key"));
                }
                members.push((key, self.value()?));
                self.skip_blanks();
                if self.is_next('}') {
                    break;
                }
                if !self.is_next(',') {
                    return Err(JsonStop::Fault(self.at, "expected `,` or `}`"));
                }
            }
        }
        let is_table =
            if members.is_empty() { self.values.is_table_if_empty } else { self.values.are_tables };
        if !is_table {
            let pairs: Result<Vec<Value>, _> =
                members.into_iter().map(|(key, value)| self.vm.heap.cons(key, value)).collect();
            return Ok(self.vm.heap.list(&pairs?)?);
        }
        let comparison = KeyComparison::Native(KeyTest::Equal);
        let table = Table::make(&mut self.vm.heap, comparison, members.len(), [Value::NIL; 2])?;
        for (key, value) in members {
            puthash(self.vm, &[key, table, value])?;
        }
        Ok(table)
    }

    fn string(&mut self) -> Result<Value, JsonStop> {
        self.at += 1;
        let text = self.text;
        let part = &text[self.at..text.len().min(self.at + LENGTH)];
        // Most strings have no escapes, and are taken as they are.
        let length = part.iter().position(|&code| code == QUOTE || code == BACKSLASH || code < 0x20);
        if let Some(length) = length.filter(|&length| part[length] == QUOTE) {
            self.at += length + 1;
            return Ok(self.vm.heap.alloc_string(&part[..length])?);
        }
        let mut characters = Vec::new();
        let (at, end) = string_part_of(self.text, self.at, &mut characters);
        self.at = at;
        match end {
            PartEnd::Quote => Ok(self.vm.heap.alloc_string(&characters)?),
            PartEnd::Limit => Err(JsonStop::Large),
            PartEnd::Fault(reason) => Err(JsonStop::Fault(at, reason)),
        }
    }

    fn number(&mut self) -> Result<Value, JsonStop> {
        let start = self.at;
        self.is_next('-');
        let first = self.at;
        while is_digit(self.peek()) {
            self.at += 1;
        }
        if self.at == first {
            return Err(JsonStop::Fault(self.at, "expected a digit"));
        }
        if self.at > first + 1 && self.text[first] == u32::from('0') {
            return Err(JsonStop::Fault(first, "expected no digit after a leading zero"));
        }
        let end_of_integer = self.at;
        if self.is_next('.') {
            self.digits()?;
        }
        if self.is_next('e') || self.is_next('E') {
            if !self.is_next('-') {
                self.is_next('+');
            }
            self.digits()?;
        }
        let text = &self.text[start..self.at];
        if self.at == end_of_integer {
            if text == [u32::from('-'), u32::from('0')] {
                // No integer has a sign without a value.
                return Ok(self.vm.heap.float(-0.0)?);
            }
            if let Some(integer) = small_integer(text) {
                return Ok(integer);
            }
            return match text::parse_integer(text, 0, 10) {
                text::Parsed::Integer(integer, _) => Ok(self.vm.integer_value("PARSE-INTEGER", &integer)?),
                _ => Err(JsonStop::Large),
            };
        }
        // It consists of digits, signs, a point and an E.
        let text: SmallVec<[u8; 32]> = text.iter().map(|&code| code as u8).collect();
        match std::str::from_utf8(&text).unwrap_or("").parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(self.vm.heap.float(number)?),
            _ => Err(JsonStop::Fault(start, "expected a number in the range of doubles")),
        }
    }

    fn digits(&mut self) -> Result<(), JsonStop> {
        let start = self.at;
        while is_digit(self.peek()) {
            self.at += 1;
        }
        if self.at == start { Err(JsonStop::Fault(self.at, "expected a digit")) } else { Ok(()) }
    }
}

/// Returns the integer that digits, with a minus sign or without, write, if they are few.
fn small_integer(text: &[u32]) -> Option<Value> {
    let (sign, digits) = match text {
        [sign, digits @ ..] if *sign == u32::from('-') => (-1, digits),
        _ => (1, text),
    };
    // More would not fit.
    if digits.len() > 18 {
        return None;
    }
    let number = digits.iter().fold(0_i64, |number, &digit| number * 10 + i64::from(digit) - i64::from(b'0'));
    Value::fixnum(sign * number)
}

/// Where a part of a string ends.
enum PartEnd {
    /// After the quote that ends the string.
    Quote,
    /// At the limit of one call.
    Limit,
    /// At what is wrong.
    Fault(&'static str),
}

/// Reads characters of a string that has begun, from `at` on. Returns the index after them.
fn string_part_of(text: &[u32], start: usize, characters: &mut Vec<u32>) -> (usize, PartEnd) {
    let mut at = start;
    while at - start < LENGTH {
        match text.get(at).copied() {
            None => return (at, PartEnd::Fault("the string has no end")),
            Some(QUOTE) => return (at + 1, PartEnd::Quote),
            Some(BACKSLASH) => match escape(&text[at..]) {
                Ok((code, length)) => {
                    characters.push(code);
                    at += length;
                }
                Err(reason) => return (at, PartEnd::Fault(reason)),
            },
            Some(code) if code < 0x20 => {
                return (at, PartEnd::Fault("a control character in a string has to be escaped"));
            }
            Some(code) => {
                characters.push(code);
                at += 1;
            }
        }
    }
    (at, PartEnd::Limit)
}

/// Returns the character of the escape at the beginning of a text, and the escape's length.
fn escape(text: &[u32]) -> Result<(u32, usize), &'static str> {
    let unknown = "expected one of \"\\/bfnrt or u after `\\`";
    let code = match text.get(1).copied().and_then(char::from_u32) {
        Some(same @ ('"' | '\\' | '/')) => u32::from(same),
        Some('b') => 0x08,
        Some('f') => 0x0C,
        Some('n') => 0x0A,
        Some('r') => 0x0D,
        Some('t') => 0x09,
        Some('u') => return unicode_escape(text),
        _ => return Err(unknown),
    };
    Ok((code, 2))
}

fn unicode_escape(text: &[u32]) -> Result<(u32, usize), &'static str> {
    let first = hexadecimal(text.get(2..6))?;
    match first {
        0xD800..=0xDBFF => {
            let half = "expected the second half of a pair of surrogates";
            if text.get(6..8) != Some(&[BACKSLASH, 0x75]) {
                return Err(half);
            }
            match hexadecimal(text.get(8..12))? {
                second @ 0xDC00..=0xDFFF => Ok((0x1_0000 + ((first - 0xD800) << 10) + (second - 0xDC00), 12)),
                _ => Err(half),
            }
        }
        0xDC00..=0xDFFF => Err("expected the first half of a pair of surrogates before the second"),
        code => Ok((code, 6)),
    }
}

fn hexadecimal(digits: Option<&[u32]>) -> Result<u32, &'static str> {
    let digits = digits.ok_or("expected four hexadecimal digits after `\\u`")?;
    digits.iter().try_fold(0, |code, &digit| {
        let digit = char::from_u32(digit).and_then(|digit| digit.to_digit(16));
        Ok(code * 16 + digit.ok_or("expected four hexadecimal digits after `\\u`")?)
    })
}

/// Returns the string that is the first argument and the index that is the second one.
fn place(vm: &mut Vm, string: Value, start: Value) -> Result<usize, Exit> {
    let Some(length) = vm.heap.string(string).map(<[u32]>::len) else {
        return vm.exchange.type_error(string, "SIMPLE-STRING");
    };
    vm.exchange.index_below(start, length + 1)
}

/// `(%json-value string start are-tables is-table-if-empty false null)`
pub(super) fn value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, start, are_tables, is_table_if_empty, no, null] = exactly(arguments);
    let start = place(vm, string, start)?;
    let text = vm.heap.string(string).unwrap_or_default();
    let blanks = text[start..].iter().take(LENGTH).take_while(|&&code| is_blank(code)).count();
    let start = start + blanks;
    if blanks == LENGTH {
        vm.exchange.charge(LENGTH / 16);
        return vm.give_values(&[Value::NIL, Value::index(start), Value::T]);
    }
    let Some(length) = extent(&text[start..]) else {
        vm.exchange.charge(LENGTH / 16);
        return vm.give_values(&[Value::NIL, Value::index(start), Value::T]);
    };
    let values = JsonValues {
        are_tables: are_tables.is_true(),
        is_table_if_empty: is_table_if_empty.is_true(),
        no,
        null,
    };
    // One more, so that what follows the value is seen.
    let text = text[start..text.len().min(start + length + 1)].to_vec();
    vm.exchange.charge((blanks + length) / 4);
    let mut reader = JsonReader { vm, text: &text, at: 0, values };
    let result = reader.value();
    let end = start + reader.at;
    match result {
        Ok(value) => vm.give_values(&[value, Value::index(end), Value::NIL]),
        Err(JsonStop::Large) => vm.give_values(&[Value::NIL, Value::index(start), Value::T]),
        Err(JsonStop::Fault(at, reason)) => {
            let reason = vm.heap.alloc_str(reason)?;
            vm.give_values(&[Value::NIL, Value::index(start + at), reason])
        }
        Err(JsonStop::Exit(exit)) => Err(exit),
    }
}

/// `(%json-string-part string start)`
pub(super) fn string_part(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, start] = exactly(arguments);
    let start = place(vm, string, start)?;
    let text = vm.heap.string(string).unwrap_or_default();
    let mut characters = Vec::new();
    let (at, end) = string_part_of(text, start, &mut characters);
    vm.exchange.charge_elements(at - start);
    let part = vm.heap.alloc_string(&characters)?;
    let end = match end {
        PartEnd::Quote => Value::T,
        PartEnd::Limit => Value::NIL,
        PartEnd::Fault(reason) => vm.heap.alloc_str(reason)?,
    };
    vm.give_values(&[part, Value::index(at), end])
}

/// `(%json-write-part string stream start end)`
pub(super) fn write_part(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, stream, start, end] = exactly(arguments);
    let characters = few_characters(vm, string, start, end)?;
    let mut escaped = Vec::with_capacity(characters.len());
    let add = |escaped: &mut Vec<u32>, text: &str| escaped.extend(text.chars().map(u32::from));
    for code in characters {
        match code {
            0x22 => add(&mut escaped, "\\\""),
            0x5C => add(&mut escaped, "\\\\"),
            0x0A => add(&mut escaped, "\\n"),
            0x0D => add(&mut escaped, "\\r"),
            0x09 => add(&mut escaped, "\\t"),
            // Control characters, and codes that are not characters to others.
            0..0x20 | 0x7F | 0xD800..=0xDFFF => add(&mut escaped, &format!("\\u{code:04x}")),
            code => escaped.push(code),
        }
    }
    write_characters(vm, stream, &escaped)?;
    Ok(Value::NIL)
}
