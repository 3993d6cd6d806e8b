//! Strings: designators, comparison, case, trimming, joining, searching.
//!
//! A string is a vector of code points, with or without a fill pointer. The functions with keyword arguments
//! are written in ESL over these; a bound that is `NIL` is the beginning or the end.

use std::cmp::Ordering;

use crate::builtins::array::{all_elements, set_element, storage};
use crate::builtins::list::list_items;
use crate::character;
use crate::equality::characters_of;
use crate::raise::{Exit, Outcome};
use crate::types::is_string;
use crate::value::Value;
use crate::vm::Vm;

use super::COPY_LIMIT;
use super::expect::{exactly, optional, short_part};

/// Length of a pattern times that of the string in which it may be looked for at once.
const SEARCH_LIMIT: usize = 1 << 20;

/// Returns the string that a designator stands for: a string itself, the name of a symbol, a character as a
/// string of one.
pub(crate) fn string_designator(vm: &mut Vm, v: Value) -> Outcome {
    if characters_of(&vm.heap, v).is_some() {
        return Ok(v);
    }
    if let Some(code) = v.as_character() {
        return Ok(vm.heap.alloc_string(&[code])?);
    }
    match vm.names.object_of(&vm.heap, v).and_then(|object| vm.heap.symbol(object)) {
        Some(symbol) => Ok(symbol.name),
        None => vm.exchange.not_written(v, "(OR STRING SYMBOL CHARACTER)"),
    }
}

/// Returns a designator's string, and the bounds of a part of it.
fn designated_part(vm: &mut Vm, v: Value, start: Value, end: Value) -> Result<(Value, usize, usize), Exit> {
    let string = string_designator(vm, v)?;
    let length = text(vm, string).len();
    let (start, end) = short_part(vm, start, end, length)?;
    Ok((string, start, end))
}

/// Returns the characters of a string.
fn text(vm: &Vm, string: Value) -> &[u32] {
    characters_of(&vm.heap, string).unwrap_or_default()
}

pub(super) fn string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    string_designator(vm, arguments[0])
}

/// Returns the string and the index that `char` and its like are given.
fn string_and_index(vm: &mut Vm, string: Value, index: Value) -> Result<usize, Exit> {
    if !is_string(&vm.heap, string) {
        return vm.exchange.type_error(string, "STRING");
    }
    // Like `aref`, it sees the characters behind a fill pointer.
    let size = all_elements(&vm.heap, string).map_or(0, |elements| elements.len());
    vm.exchange.index_below(index, size)
}

pub(super) fn char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, index] = exactly(arguments);
    if let (Some(characters), Some(index)) = (vm.heap.string(string), index.as_index())
        && let Some(v) = characters.get(index).and_then(|&code| Value::character(code))
    {
        return Ok(v);
    }
    let index = string_and_index(vm, string, index)?;
    Ok(all_elements(&vm.heap, string).and_then(|elements| elements.get(index)).unwrap_or(Value::NIL))
}

pub(super) fn set_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, index, character] = exactly(arguments);
    let index = string_and_index(vm, string, index)?;
    set_element(vm, string, index, character)
}

pub(super) fn make_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, character] = exactly(arguments);
    let size = vm.exchange.count(size)?;
    let Some(code) = character.as_character() else { return vm.exchange.type_error(character, "CHARACTER") };
    if size > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let string = vm.heap.alloc_string_filled(size, code)?;
    vm.exchange.charge_elements(size);
    Ok(string)
}

/// How two parts of strings compare, and where in the first they begin to differ.
fn compare(vm: &mut Vm, arguments: &[Value], fold: bool) -> Result<(Ordering, usize), Exit> {
    let (a, start1, end1) =
        designated_part(vm, arguments[0], optional(arguments, 2), optional(arguments, 3))?;
    let (b, start2, end2) =
        designated_part(vm, arguments[1], optional(arguments, 4), optional(arguments, 5))?;
    let (left, right) = (&text(vm, a)[start1..end1], &text(vm, b)[start2..end2]);
    let key = |code: u32| if fold { character::fold(code) } else { code };
    let differ = left.iter().zip(right).position(|(&a, &b)| a != b && key(a) != key(b));
    Ok(match differ {
        Some(at) => (key(left[at]).cmp(&key(right[at])), start1 + at),
        None => (left.len().cmp(&right.len()), start1 + left.len().min(right.len())),
    })
}

/// Returns whether two parts of strings are the same; of different lengths they are not, without a look at
/// them.
fn same(vm: &mut Vm, arguments: &[Value], fold: bool) -> Outcome {
    if let [a, b] = *arguments
        && let (Some(left), Some(right)) = (characters_of(&vm.heap, a), characters_of(&vm.heap, b))
        && left.len() != right.len()
    {
        return Ok(Value::NIL);
    }
    Ok((compare(vm, arguments, fold)?.0 == Ordering::Equal).into())
}

pub(super) fn string_equal_exactly(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    same(vm, arguments, false)
}

pub(super) fn string_equal_loosely(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    same(vm, arguments, true)
}

pub(super) fn string_compare(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (order, at) = compare(vm, &arguments[..6], arguments[6].is_true())?;
    vm.give_values(&[Value::small(order as i32), Value::index(at)])
}

/// A way to change the case of a word.
#[derive(Clone, Copy)]
enum Case {
    Up,
    Down,
    Capital,
}

impl Case {
    fn convert(self, characters: &mut [u32]) {
        let mut in_word = false;
        for code in characters {
            *code = match self {
                Case::Up => character::upcase(*code),
                Case::Down => character::downcase(*code),
                Case::Capital if in_word => character::downcase(*code),
                Case::Capital => character::upcase(*code),
            };
            in_word = character::is_alphanumeric(*code);
        }
    }
}

/// Returns a fresh string with a part of it in another case.
fn converted(vm: &mut Vm, arguments: &[Value], case: Case) -> Outcome {
    let (string, start, end) = designated_part(vm, arguments[0], arguments[1], arguments[2])?;
    let mut characters = text(vm, string).to_vec();
    if characters.len() > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    case.convert(&mut characters[start..end]);
    Ok(vm.heap.alloc_string(&characters)?)
}

/// Returns the string itself, a part of it changed.
fn converted_in_place(vm: &mut Vm, arguments: &[Value], case: Case) -> Outcome {
    if !is_string(&vm.heap, arguments[0]) {
        return vm.exchange.type_error(arguments[0], "STRING");
    }
    let (string, start, end) = designated_part(vm, arguments[0], arguments[1], arguments[2])?;
    let (data, offset) = storage(&vm.heap, string).unwrap_or((string, 0));
    if let Some(characters) = vm.heap.string_mut(data) {
        case.convert(&mut characters[offset + start..offset + end]);
    }
    Ok(string)
}

pub(super) fn upcase(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    converted(vm, arguments, Case::Up)
}

pub(super) fn downcase(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    converted(vm, arguments, Case::Down)
}

pub(super) fn capitalize(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    converted(vm, arguments, Case::Capital)
}

pub(super) fn upcase_in_place(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    converted_in_place(vm, arguments, Case::Up)
}

pub(super) fn downcase_in_place(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    converted_in_place(vm, arguments, Case::Down)
}

pub(super) fn capitalize_in_place(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    converted_in_place(vm, arguments, Case::Capital)
}

/// Returns the string without the characters of a bag at its ends.
fn trimmed(vm: &mut Vm, arguments: &[Value], left: bool, right: bool) -> Outcome {
    let bag = match super::array::vector_elements(&vm.heap, arguments[0]) {
        Some(elements) => {
            (0..elements.len().min(COPY_LIMIT)).filter_map(|index| elements.get(index)).collect()
        }
        None if arguments[0].is_list() => list_items(vm, arguments[0], COPY_LIMIT)?,
        None => return vm.exchange.type_error(arguments[0], "SEQUENCE"),
    };
    let (string, start, end) = designated_part(vm, arguments[1], Value::NIL, Value::NIL)?;
    let characters = &text(vm, string)[start..end];
    let bag: Vec<u32> = bag.into_iter().filter_map(Value::as_character).collect();
    let is_kept = |code: &u32| !bag.contains(code);
    let from = if left { characters.iter().position(is_kept).unwrap_or(characters.len()) } else { 0 };
    let to =
        if right { characters.iter().rposition(is_kept).map_or(from, |at| at + 1) } else { characters.len() };
    let kept = characters[from..to.max(from)].to_vec();
    let removed = end - start - kept.len();
    vm.exchange.charge_elements(bag.len().saturating_mul(removed));
    Ok(vm.heap.alloc_string(&kept)?)
}

pub(super) fn trim(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    trimmed(vm, arguments, true, true)
}

pub(super) fn left_trim(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    trimmed(vm, arguments, true, false)
}

pub(super) fn right_trim(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    trimmed(vm, arguments, false, true)
}

/// The twin takes other sequences too.
pub(super) fn concat(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let mut length = 0;
    for &string in arguments {
        let Some(more) = characters_of(&vm.heap, string) else { return Err(Exit::Slowly) };
        length += more.len();
    }
    if length > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    vm.exchange.charge_elements(length);
    Ok(vm.heap.alloc_string_of(length, arguments.len(), |heap, index| {
        characters_of(heap, arguments[index]).unwrap_or_default()
    })?)
}

pub(super) fn search(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [pattern, string, start, end, from_end] = exactly(arguments);
    for v in [pattern, string] {
        if !is_string(&vm.heap, v) {
            return vm.exchange.type_error(v, "STRING");
        }
    }
    let (start, end) = vm.exchange.bounds(start, end, text(vm, string).len())?;
    let length = text(vm, pattern).len();
    // A long string is searched in part: what is often found there need not be left to the twin.
    let limit = COPY_LIMIT.min(SEARCH_LIMIT / length.max(1));
    let is_partial = end - start > limit;
    let (start, end) = match is_partial {
        true if from_end.is_true() => (end - limit, end),
        true => (start, start + limit),
        false => (start, end),
    };
    let (pattern, part) = (text(vm, pattern), &text(vm, string)[start..end]);
    let Some((&first, rest)) = pattern.split_first() else {
        return Ok(Value::index(if from_end.is_true() { end } else { start }));
    };
    // Where the pattern may begin; what follows is looked at where its first character is.
    let starts = &part[..(part.len() + 1).saturating_sub(length)];
    let mut compared = 0;
    let mut is_there = |(at, &code): (usize, &u32)| {
        code == first && {
            compared += length;
            part[at + 1..].starts_with(rest)
        }
    };
    let found = if from_end.is_true() {
        starts.iter().enumerate().rev().find(|&place| is_there(place))
    } else {
        starts.iter().enumerate().find(|&place| is_there(place))
    };
    let found = found.map(|(at, _)| at);
    let passed = match found {
        Some(at) if from_end.is_true() => starts.len() - at,
        Some(at) => at,
        None => starts.len(),
    };
    vm.exchange.charge_elements(passed / 4 + compared);
    match found {
        Some(at) => Ok(Value::index(start + at)),
        None if is_partial => Err(Exit::Slowly),
        None => Ok(Value::NIL),
    }
}
