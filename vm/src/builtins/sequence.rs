//! Lists and vectors alike: length, elements, parts, copies, reversal, and the ways between the two.
//!
//! Lists are walked up to [`LIMIT`] pairs. Vectors are copied up to [`COPY_LIMIT`] elements, which takes
//! about as long.

use crate::builtins::array::{check_element, store_element};
use crate::builtins::list::list_items;
use crate::heap::Kind;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::array::{ArrayElements, all_elements, set_element, storage, vector_elements, vector_length};
use super::expect::{exactly, optional, short_part};
use super::list::reverse_in_place;
use super::{COPY_LIMIT, LIMIT};

/// Copies `count` elements between what keeps the elements of two arrays, as if by way of a third. The
/// ranges are inside.
///
/// # Errors
/// `type-error` for the first element that the target cannot keep; nothing has been copied then.
pub(crate) fn copy_elements(
    vm: &mut Vm,
    from: Value,
    from_start: usize,
    to: Value,
    to_start: usize,
    count: usize,
) -> Result<(), Exit> {
    vm.exchange.charge_elements(count);
    if vm.heap.vector_copy(from, from_start, to, to_start, count).is_some() {
        return Ok(());
    }
    let Some(elements) = all_elements(&vm.heap, from) else { return Ok(()) };
    let elements = Owned::of(elements.part(from_start, from_start + count));
    if let Owned::Characters(characters) = &elements
        && let Some(target) = vm.heap.string_mut(to)
    {
        target[to_start..to_start + count].copy_from_slice(characters);
        return Ok(());
    }
    let accepts_all = vm.heap.is(to, Kind::SimpleVector);
    let values = elements.into_values();
    if !accepts_all {
        for &value in &values {
            check_element(vm, to, value)?;
        }
    }
    for (offset, &value) in values.iter().enumerate() {
        store_element(&mut vm.heap, to, to_start + offset, value);
    }
    Ok(())
}

/// Returns the length of a vector; a type error for anything else.
pub(crate) fn expect_length(vm: &mut Vm, v: Value) -> Result<usize, Exit> {
    match vector_length(&vm.heap, v) {
        Some(length) => Ok(length),
        None => vm.exchange.type_error(v, "VECTOR"),
    }
}

/// Returns a new simple vector with these elements, of the kind that keeps them.
fn new_vector(vm: &mut Vm, elements: &Owned) -> Outcome {
    Ok(match elements {
        Owned::Values(values) => vm.heap.alloc_vector(values)?,
        Owned::Characters(characters) => vm.heap.alloc_string(characters)?,
        Owned::Bytes(bytes) => vm.heap.alloc_bytes(bytes)?,
        Owned::Bits(bits) => vm.heap.alloc_bits(bits)?,
    })
}

/// Elements out of the heap, to be put into it again.
enum Owned {
    Values(Vec<Value>),
    Characters(Vec<u32>),
    Bytes(Vec<u8>),
    Bits(Vec<u8>),
}

impl Owned {
    fn of(elements: ArrayElements<'_>) -> Owned {
        match elements {
            ArrayElements::Values(values) => Owned::Values(values.to_vec()),
            ArrayElements::Characters(characters) => Owned::Characters(characters.to_vec()),
            ArrayElements::Bytes(bytes) => Owned::Bytes(bytes.to_vec()),
            ArrayElements::Bits(bits) => Owned::Bits(bits.to_vec()),
        }
    }

    fn into_values(self) -> Vec<Value> {
        match self {
            Owned::Values(values) => values,
            Owned::Characters(characters) => characters.into_iter().filter_map(Value::character).collect(),
            Owned::Bytes(bytes) | Owned::Bits(bytes) => {
                bytes.into_iter().map(|byte| Value::small(i32::from(byte))).collect()
            }
        }
    }

    fn reverse(&mut self) {
        match self {
            Owned::Values(values) => values.reverse(),
            Owned::Characters(characters) => characters.reverse(),
            Owned::Bytes(bytes) | Owned::Bits(bytes) => bytes.reverse(),
        }
    }
}

pub(super) fn length(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let sequence = arguments[0];
    if let Some(length) = vector_length(&vm.heap, sequence) {
        return Ok(Value::index(length));
    }
    if !sequence.is_list() {
        return vm.exchange.type_error(sequence, "SEQUENCE");
    }
    super::list::list_length(vm, arguments)
}

pub(super) fn elt(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [sequence, index] = exactly(arguments);
    if let Some(elements) = vector_elements(&vm.heap, sequence) {
        let length = elements.len();
        return match index.as_index().and_then(|index| elements.get(index)) {
            Some(value) => Ok(value),
            None => vm.exchange.index_error(index, length),
        };
    }
    let pair = list_element(vm, sequence, index)?;
    Ok(vm.heap.car(pair).unwrap_or(Value::NIL))
}

pub(super) fn set_elt(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [sequence, index, value] = exactly(arguments);
    if let Some(length) = vector_length(&vm.heap, sequence) {
        let index = vm.exchange.index_below(index, length)?;
        return set_element(vm, sequence, index, value);
    }
    let pair = list_element(vm, sequence, index)?;
    vm.heap.set_car(pair, value);
    Ok(value)
}

/// Returns the pair of a list that has its element `index`.
fn list_element(vm: &mut Vm, list: Value, index: Value) -> Outcome {
    if !list.is_list() {
        return vm.exchange.type_error(list, "SEQUENCE");
    }
    let Some(wanted) = index.as_index() else { return vm.exchange.type_error(index, "UNSIGNED-BYTE") };
    let mut rest = list;
    for at in 0..=wanted.min(LIMIT) {
        match vm.heap.as_cons(rest) {
            Some(_) if at == wanted => {
                vm.exchange.charge_elements(at);
                return Ok(rest);
            }
            Some(pair) => rest = pair.cdr,
            None if rest.is_nil() => return vm.exchange.index_error(index, at),
            None => return vm.exchange.type_error(rest, "LIST"),
        }
    }
    Err(Exit::Slowly)
}

pub(super) fn subseq(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (sequence, start, end) = (arguments[0], arguments[1], optional(arguments, 2));
    if let Some(elements) = vector_elements(&vm.heap, sequence) {
        let length = elements.len();
        let (start, end) = short_part(vm, start, end, length)?;
        if vm.heap.string(sequence).is_some() {
            return Ok(vm.heap.alloc_string_of(end - start, 1, |heap, _| {
                heap.string(sequence).and_then(|all| all.get(start..end)).unwrap_or_default()
            })?);
        }
        let part = vector_elements(&vm.heap, sequence).map(|elements| Owned::of(elements.part(start, end)));
        return part.map_or(Ok(Value::NIL), |part| new_vector(vm, &part));
    }
    if !sequence.is_list() {
        return vm.exchange.type_error(sequence, "SEQUENCE");
    }
    if end.is_nil() || end.as_index().is_none_or(|end| end > LIMIT) {
        let items = list_items(vm, sequence, LIMIT)?;
        let (start, end) = vm.exchange.bounds(start, end, items.len())?;
        return Ok(vm.heap.list(&items[start..end])?);
    }
    // Of a long list only the part up to the end is walked.
    let mut items = Vec::new();
    let mut rest = sequence;
    let wanted = end.as_index().unwrap_or(0);
    while items.len() < wanted {
        match vm.heap.as_cons(rest) {
            Some(pair) => {
                items.push(pair.car);
                rest = pair.cdr;
            }
            None if rest.is_nil() => return vm.exchange.bounds_error(start, end, items.len()),
            None => return vm.exchange.type_error(rest, "LIST"),
        }
    }
    vm.exchange.charge_elements(wanted);
    if start.as_index().is_none_or(|start| start > wanted) {
        // The failure tells how long the list is.
        let length = list_items(vm, sequence, LIMIT)?.len();
        return vm.exchange.bounds_error(start, end, length);
    }
    let (start, end) = vm.exchange.bounds(start, end, wanted)?;
    Ok(vm.heap.list(&items[start..end])?)
}

pub(super) fn copy_seq(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    subseq(vm, &[arguments[0], Value::small(0)])
}

pub(super) fn reverse(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let sequence = arguments[0];
    if let Some(elements) = vector_elements(&vm.heap, sequence) {
        let length = elements.len();
        if length > COPY_LIMIT {
            return Err(Exit::Slowly);
        }
        let mut reversed = Owned::of(elements);
        vm.exchange.charge_elements(length);
        reversed.reverse();
        return new_vector(vm, &reversed);
    }
    if !sequence.is_list() {
        return vm.exchange.type_error(sequence, "SEQUENCE");
    }
    let mut items = list_items(vm, sequence, LIMIT)?;
    items.reverse();
    Ok(vm.heap.list(&items)?)
}

pub(super) fn nreverse(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let sequence = arguments[0];
    if let Some(length) = vector_length(&vm.heap, sequence) {
        let (data, start) = storage(&vm.heap, sequence).unwrap_or((sequence, 0));
        if length > COPY_LIMIT {
            return Err(Exit::Slowly);
        }
        vm.exchange.charge_elements(length);
        if let Some(characters) = vm.heap.string_mut(data) {
            characters[start..start + length].reverse();
            return Ok(sequence);
        }
        for (low, high) in (0..length / 2).map(|low| (start + low, start + length - 1 - low)) {
            let elements = all_elements(&vm.heap, data);
            if let Some((a, b)) = elements.and_then(|elements| elements.get(low).zip(elements.get(high))) {
                store_element(&mut vm.heap, data, low, b);
                store_element(&mut vm.heap, data, high, a);
            }
        }
        return Ok(sequence);
    }
    if !sequence.is_list() {
        return vm.exchange.type_error(sequence, "SEQUENCE");
    }
    // The walk comes first, so that nothing has changed where it ends badly.
    super::list::list_length(vm, arguments)?;
    Ok(reverse_in_place(vm, sequence, Value::NIL))
}

pub(super) fn fill(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [vector, item, start, end] = exactly(arguments);
    let length = expect_length(vm, vector)?;
    let (start, end) = vm.exchange.bounds(start, end, length)?;
    if end - start > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let (data, offset) = storage(&vm.heap, vector).unwrap_or((vector, 0));
    check_element(vm, data, item)?;
    vm.exchange.charge_elements(end - start);
    let (start, end) = (offset + start, offset + end);
    if let Some(code) = item.as_character()
        && let Some(characters) = vm.heap.string_mut(data)
    {
        characters[start..end].fill(code);
        return Ok(vector);
    }
    if vm.heap.vector_fill(data, start, end, item).is_some() {
        return Ok(vector);
    }
    for index in start..end {
        store_element(&mut vm.heap, data, index, item);
    }
    Ok(vector)
}

/// The arguments of `%replace`, whose sequences are vectors.
pub(super) fn replace(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [target, source, start1, end1, start2, end2] = exactly(arguments);
    let (to_length, from_length) = (expect_length(vm, target)?, expect_length(vm, source)?);
    let (to, to_end) = vm.exchange.bounds(start1, end1, to_length)?;
    let (from, from_end) = vm.exchange.bounds(start2, end2, from_length)?;
    let count = (to_end - to).min(from_end - from);
    if count > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let (to_data, to_offset) = storage(&vm.heap, target).unwrap_or((target, 0));
    let (from_data, from_offset) = storage(&vm.heap, source).unwrap_or((source, 0));
    copy_elements(vm, from_data, from_offset + from, to_data, to_offset + to, count)?;
    Ok(target)
}

pub(super) fn list_vector(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let items = list_items(vm, arguments[0], LIMIT)?;
    Ok(vm.heap.alloc_vector(&items)?)
}

pub(super) fn list_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let items = list_items(vm, arguments[0], LIMIT)?;
    let mut characters = Vec::with_capacity(items.len());
    for item in items {
        match item.as_character() {
            Some(code) => characters.push(code),
            None => return vm.exchange.type_error(item, "CHARACTER"),
        }
    }
    Ok(vm.heap.alloc_string(&characters)?)
}

pub(super) fn vector_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [vector, start, end] = exactly(arguments);
    let length = expect_length(vm, vector)?;
    let (start, end) = vm.exchange.bounds(start, end, length)?;
    if end - start > LIMIT {
        return Err(Exit::Slowly);
    }
    vm.exchange.charge_elements(end - start);
    let mut list = Value::NIL;
    for index in (start..end).rev() {
        let item = vector_elements(&vm.heap, vector).and_then(|elements| elements.get(index));
        list = vm.heap.cons(item.unwrap_or(Value::NIL), list)?;
    }
    Ok(list)
}
