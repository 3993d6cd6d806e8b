//! Lists: pairs and their parts, building, joining and copying.
//!
//! A walk visits at most [`LIMIT`] pairs and then leaves to the function's ESL twin, which can be
//! interrupted; so a circular list is not a hang.

use crate::heap::Heap;
use crate::number::Int;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::LIMIT;
use super::expect::{exactly, optional};

/// Returns the items of a proper list of at most `limit` items; longer ones are for the ESL twin.
pub(crate) fn list_items(vm: &mut Vm, list: Value, limit: usize) -> Result<Vec<Value>, Exit> {
    let mut items = Vec::new();
    let mut rest = list;
    while let Some(pair) = vm.heap.as_cons(rest) {
        if items.len() == limit {
            return Err(Exit::Slowly);
        }
        items.push(pair.car);
        rest = pair.cdr;
    }
    if !rest.is_nil() {
        return vm.exchange.type_error(rest, "LIST");
    }
    vm.exchange.charge_elements(items.len());
    Ok(items)
}

/// Number of pairs of a list and what ends it, `NIL` if it is proper; too long ones are for the ESL twin.
fn measure(vm: &mut Vm, list: Value) -> Result<(usize, Value), Exit> {
    let mut rest = list;
    for length in 0..=LIMIT {
        match vm.heap.as_cons(rest) {
            Some(pair) => rest = pair.cdr,
            None if length == 0 && !rest.is_nil() => return vm.exchange.type_error(rest, "LIST"),
            None => {
                vm.exchange.charge_elements(length);
                return Ok((length, rest));
            }
        }
    }
    Err(Exit::Slowly)
}

/// Returns the items of the first `count` pairs, which are there.
fn leading_items(heap: &Heap, list: Value, count: usize) -> Vec<Value> {
    let mut rest = list;
    let mut items = Vec::with_capacity(count);
    while items.len() < count
        && let Some(pair) = heap.as_cons(rest)
    {
        items.push(pair.car);
        rest = pair.cdr;
    }
    items
}

/// Returns the list without its first `count` pairs, `NIL` where it is shorter. `count` is within the limit.
fn tail(vm: &mut Vm, list: Value, count: usize) -> Outcome {
    let mut rest = list;
    for _ in 0..count {
        rest = match vm.heap.as_cons(rest) {
            Some(pair) => pair.cdr,
            None if rest.is_nil() => return Ok(rest),
            None => return vm.exchange.type_error(rest, "LIST"),
        };
    }
    vm.exchange.charge_elements(count);
    Ok(rest)
}

fn part(vm: &mut Vm, v: Value, step: u8) -> Outcome {
    let part = if step == b'a' { vm.heap.car(v) } else { vm.heap.cdr(v) };
    match part {
        Some(part) => Ok(part),
        None => vm.exchange.type_error(v, "LIST"),
    }
}

/// Defines the parts of pairs: the letters between `c` and `r`, to be read from the right.
macro_rules! parts {
    ($( $name:ident = $path:literal; )*) => {
        $(
            #[doc = concat!("The part `c", $path, "r`.")]
            pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                $path.bytes().rev().try_fold(arguments[0], |v, step| part(vm, v, step))
            }
        )*
    };
}

parts! {
    car = "a"; cdr = "d";
    caar = "aa"; cadr = "ad"; cdar = "da"; cddr = "dd";
    caaar = "aaa"; caadr = "aad"; cadar = "ada"; caddr = "add";
    cdaar = "daa"; cdadr = "dad"; cddar = "dda"; cdddr = "ddd";
    caaaar = "aaaa"; caaadr = "aaad"; caadar = "aada"; caaddr = "aadd";
    cadaar = "adaa"; cadadr = "adad"; caddar = "adda"; cadddr = "addd";
    cdaaar = "daaa"; cdaadr = "daad"; cdadar = "dada"; cdaddr = "dadd";
    cddaar = "ddaa"; cddadr = "ddad"; cdddar = "ddda"; cddddr = "dddd";
}

/// Defines the items of a list by position.
macro_rules! items {
    ($( $name:ident = $index:literal; )*) => {
        $(
            #[doc = concat!("Item ", $index, " of a list.")]
            pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
                let tail = tail(vm, arguments[0], $index)?;
                part(vm, tail, b'a')
            }
        )*
    };
}

items! {
    fifth = 4; sixth = 5; seventh = 6; eighth = 7; ninth = 8; tenth = 9;
}

pub(super) fn cons(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [car, cdr] = exactly(arguments);
    Ok(vm.heap.cons(car, cdr)?)
}

fn check_pair(vm: &mut Vm, v: Value) -> Result<(), Exit> {
    if v.is_cons() { Ok(()) } else { vm.exchange.type_error(v, "CONS") }
}

pub(super) fn rplaca(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [pair, object] = exactly(arguments);
    check_pair(vm, pair)?;
    vm.heap.set_car(pair, object);
    Ok(pair)
}

pub(super) fn rplacd(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [pair, object] = exactly(arguments);
    check_pair(vm, pair)?;
    vm.heap.set_cdr(pair, object);
    Ok(pair)
}

pub(super) fn set_car(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    rplaca(vm, arguments)?;
    Ok(arguments[1])
}

pub(super) fn set_cdr(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    rplacd(vm, arguments)?;
    Ok(arguments[1])
}

pub(super) fn endp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if arguments[0].is_list() {
        Ok(arguments[0].is_nil().into())
    } else {
        vm.exchange.type_error(arguments[0], "LIST")
    }
}

pub(super) fn nth(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let tail = nthcdr(vm, arguments)?;
    part(vm, tail, b'a')
}

pub(super) fn nthcdr(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [skipped, list] = exactly(arguments);
    if Int::of(&vm.heap, skipped).is_none_or(|count| count.is_negative()) {
        return vm.exchange.type_error(skipped, "UNSIGNED-BYTE");
    }
    let count = skipped.as_index().unwrap_or(usize::MAX);
    if count <= LIMIT {
        return tail(vm, list, count);
    }
    // A long way down a short list is short.
    match measure(vm, list)? {
        (_, end) if end.is_nil() => Ok(end),
        (_, end) => vm.exchange.type_error(end, "LIST"),
    }
}

pub(super) fn list_length(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match measure(vm, arguments[0])? {
        (length, end) if end.is_nil() => Ok(Value::index(length)),
        (_, end) => vm.exchange.type_error(end, "LIST"),
    }
}

pub(super) fn list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.exchange.charge_elements(arguments.len());
    Ok(vm.heap.list(arguments)?)
}

pub(super) fn list_star(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.exchange.charge_elements(arguments.len());
    match arguments.split_last() {
        Some((&last, items)) => Ok(vm.heap.list_with_tail(items, last)?),
        None => Ok(Value::NIL),
    }
}

pub(super) fn make_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, item] = exactly(arguments);
    let size = vm.exchange.count(size)?;
    if size > LIMIT {
        return Err(Exit::Slowly);
    }
    vm.exchange.charge_elements(size);
    let mut list = Value::NIL;
    for _ in 0..size {
        list = vm.heap.cons(item, list)?;
    }
    Ok(list)
}

pub(super) fn acons(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [key, value, alist] = exactly(arguments);
    let pair = vm.heap.cons(key, value)?;
    Ok(vm.heap.cons(pair, alist)?)
}

pub(super) fn last(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let count = count_of(vm, arguments)?;
    let (length, _) = measure(vm, arguments[0])?;
    tail(vm, arguments[0], length.saturating_sub(count))
}

pub(super) fn butlast(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let count = count_of(vm, arguments)?;
    let (length, _) = measure(vm, arguments[0])?;
    let items = leading_items(&vm.heap, arguments[0], length.saturating_sub(count));
    Ok(vm.heap.list(&items)?)
}

pub(super) fn nbutlast(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let count = count_of(vm, arguments)?;
    let (length, _) = measure(vm, arguments[0])?;
    match length.saturating_sub(count) {
        0 => Ok(Value::NIL),
        kept => {
            let end = tail(vm, arguments[0], kept - 1)?;
            vm.heap.set_cdr(end, Value::NIL);
            Ok(arguments[0])
        }
    }
}

/// Returns how many pairs at the end: 1 unless said otherwise.
fn count_of(vm: &mut Vm, arguments: &[Value]) -> Result<usize, Exit> {
    match arguments.get(1) {
        None => Ok(1),
        Some(&count) => {
            let n = vm.integer(count)?;
            if n.is_negative() {
                return vm.exchange.type_error(count, "UNSIGNED-BYTE");
            }
            Ok(count.as_index().unwrap_or(usize::MAX))
        }
    }
}

pub(super) fn append(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some((&last, lists)) = arguments.split_last() else { return Ok(Value::NIL) };
    let mut items = Vec::new();
    for &list in lists {
        items.extend(list_items(vm, list, LIMIT - items.len())?);
    }
    Ok(vm.heap.list_with_tail(&items, last)?)
}

pub(super) fn nconc(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some((&last, lists)) = arguments.split_last() else { return Ok(Value::NIL) };
    // All ends are found before the first is changed.
    let mut ends = Vec::with_capacity(lists.len());
    let mut visited = 0;
    for &list in lists {
        let (length, _) = measure(vm, list)?;
        visited += length;
        if visited > LIMIT {
            return Err(Exit::Slowly);
        }
        if length > 0 {
            ends.push((list, tail(vm, list, length - 1)?));
        }
    }
    let heads = ends.iter().map(|&(list, _)| list).skip(1).chain([last]);
    let links: Vec<(Value, Value)> = ends.iter().map(|&(_, end)| end).zip(heads).collect();
    for (end, next) in links {
        vm.heap.set_cdr(end, next);
    }
    Ok(ends.first().map_or(last, |&(list, _)| list))
}

pub(super) fn revappend(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [list, tail] = exactly(arguments);
    let mut items = list_items(vm, list, LIMIT)?;
    items.reverse();
    Ok(vm.heap.list_with_tail(&items, tail)?)
}

pub(super) fn nreconc(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [list, tail] = exactly(arguments);
    let (_, end) = measure(vm, list)?;
    if !end.is_nil() {
        return vm.exchange.type_error(end, "LIST");
    }
    Ok(reverse_in_place(vm, list, tail))
}

/// Turns the pairs of a proper list round, in front of `tail`.
pub(super) fn reverse_in_place(vm: &mut Vm, list: Value, tail: Value) -> Value {
    let (mut rest, mut result) = (list, tail);
    while let Some(pair) = vm.heap.as_cons(rest) {
        vm.heap.set_cdr(rest, result);
        result = rest;
        rest = pair.cdr;
    }
    result
}

pub(super) fn copy_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (length, end) = measure(vm, arguments[0])?;
    let items = leading_items(&vm.heap, arguments[0], length);
    Ok(vm.heap.list_with_tail(&items, end)?)
}

pub(super) fn copy_alist(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let mut items = list_items(vm, arguments[0], LIMIT)?;
    for item in &mut items {
        if let Some(pair) = vm.heap.as_cons(*item) {
            *item = vm.heap.cons(pair.car, pair.cdr)?;
        }
    }
    Ok(vm.heap.list(&items)?)
}

pub(super) fn copy_tree(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(root) = vm.heap.as_cons(arguments[0]) else { return Ok(arguments[0]) };
    let copy = vm.heap.cons(root.car, root.cdr)?;
    // Pairs of the copy whose halves are still those of the original.
    let mut open = vec![copy];
    let mut visited = 0;
    while let Some(pair) = open.pop() {
        visited += 1;
        if visited > LIMIT {
            return Err(Exit::Slowly);
        }
        if let Some(half) = vm.heap.car(pair).and_then(|car| vm.heap.as_cons(car)) {
            let half = vm.heap.cons(half.car, half.cdr)?;
            vm.heap.set_car(pair, half);
            open.push(half);
        }
        if let Some(half) = vm.heap.cdr(pair).and_then(|cdr| vm.heap.as_cons(cdr)) {
            let half = vm.heap.cons(half.car, half.cdr)?;
            vm.heap.set_cdr(pair, half);
            open.push(half);
        }
    }
    vm.exchange.charge_elements(visited);
    Ok(copy)
}

pub(super) fn ldiff(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [list, object] = exactly(arguments);
    let (length, end) = measure(vm, list)?;
    let mut items = Vec::new();
    let mut rest = list;
    for _ in 0..length {
        if crate::number::eql(&vm.heap, rest, object) {
            return Ok(vm.heap.list(&items)?);
        }
        if let Some(pair) = vm.heap.as_cons(rest) {
            items.push(pair.car);
            rest = pair.cdr;
        }
    }
    let end = if crate::number::eql(&vm.heap, end, object) { Value::NIL } else { end };
    Ok(vm.heap.list_with_tail(&items, end)?)
}

pub(super) fn tailp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [object, list] = exactly(arguments);
    let (length, end) = measure(vm, list)?;
    let mut rest = list;
    for _ in 0..length {
        if rest == object {
            return Ok(Value::T);
        }
        rest = vm.heap.cdr(rest).unwrap_or(Value::NIL);
    }
    Ok(crate::number::eql(&vm.heap, end, object).into())
}

pub(super) fn pairlis(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let keys = list_items(vm, arguments[0], LIMIT)?;
    let data = list_items(vm, arguments[1], LIMIT)?;
    if keys.len() != data.len() {
        return vm
            .exchange
            .raise(crate::raise::Raised::Simple("the lists of keys and data differ in length".into()));
    }
    let mut alist = optional(arguments, 2);
    for (&key, &datum) in keys.iter().zip(&data) {
        let pair = vm.heap.cons(key, datum)?;
        alist = vm.heap.cons(pair, alist)?;
    }
    Ok(alist)
}
