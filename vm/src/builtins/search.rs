//! Searching sequences by `eql` and `equal`: what `find`, `position`, `count` and `remove` do without a
//! function of the program.

use crate::builtins::array::{ArrayElements, vector_elements};
use crate::builtins::list::list_items;
use crate::equality::{self, KeyTest};
use crate::number;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::{exactly, short_part};
use super::{COPY_LIMIT, LIMIT};

/// Returns the index of an element that is the same as `item`, between two bounds, the first or the last of
/// them.
fn position(vm: &mut Vm, test: KeyTest, arguments: &[Value]) -> Outcome {
    let [item, sequence, start, end, from_end] = exactly(arguments);
    let from_end = from_end.is_true();
    if let Some(elements) = vector_elements(&vm.heap, sequence) {
        let length = elements.len();
        let (start, end) = vm.exchange.bounds(start, end, length)?;
        let found = in_vector(vm, test, item, sequence, start..end, from_end)?;
        return Ok(found.map_or(Value::NIL, Value::index));
    }
    if !sequence.is_list() {
        return vm.exchange.type_error(sequence, "SEQUENCE");
    }
    let items = list_items(vm, sequence, LIMIT)?;
    let (start, end) = vm.exchange.bounds(start, end, items.len())?;
    let mut work = LIMIT;
    let mut found = None;
    for (at, &candidate) in items.iter().enumerate().take(end).skip(start) {
        if equality::same(&vm.heap, test, item, candidate, &mut work).ok_or(Exit::Slowly)? {
            found = Some(at);
            if !from_end {
                break;
            }
        }
    }
    vm.exchange.charge_elements(LIMIT - work);
    Ok(found.map_or(Value::NIL, Value::index))
}

fn in_vector(
    vm: &mut Vm,
    test: KeyTest,
    item: Value,
    vector: Value,
    range: std::ops::Range<usize>,
    from_end: bool,
) -> Result<Option<usize>, Exit> {
    let Some(elements) = vector_elements(&vm.heap, vector) else { return Ok(None) };
    let limit = if test == KeyTest::Equal { LIMIT } else { COPY_LIMIT };
    // Of many elements a part is looked at: what is found there need not be left to the twin.
    let is_partial = range.len() > limit;
    let range = match is_partial {
        true if from_end => range.end - limit..range.end,
        true => range.start..range.start + limit,
        false => range,
    };
    let found = match (elements.part(range.start, range.end), item.as_character()) {
        (ArrayElements::Characters(characters), Some(code)) => {
            let mut matches = characters.iter();
            let is_it = |&other: &u32| other == code;
            Ok(if from_end { matches.rposition(is_it) } else { matches.position(is_it) })
        }
        (ArrayElements::Characters(_), None) => Ok(None),
        (part, _) => {
            let mut work = LIMIT;
            let heap = &vm.heap;
            let mut is_it = |index: usize| {
                let candidate = part.get(index).unwrap_or(Value::UNBOUND);
                equality::same(heap, test, item, candidate, &mut work)
            };
            let mut indexes = 0..part.len();
            let mut found = Ok(None);
            while let Some(index) = if from_end { indexes.next_back() } else { indexes.next() } {
                match is_it(index) {
                    Some(false) => {}
                    Some(true) => {
                        found = Ok(Some(index));
                        break;
                    }
                    None => {
                        found = Err(Exit::Slowly);
                        break;
                    }
                }
            }
            found
        }
    };
    vm.exchange.charge_elements(match &found {
        Ok(Some(index)) if from_end => range.len() - index,
        Ok(Some(index)) => *index,
        _ => range.len(),
    });
    match found? {
        Some(index) => Ok(Some(range.start + index)),
        None if is_partial => Err(Exit::Slowly),
        None => Ok(None),
    }
}

pub(super) fn position_eql(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    position(vm, KeyTest::Eql, arguments)
}

pub(super) fn position_equal(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    position(vm, KeyTest::Equal, arguments)
}

pub(super) fn count_eql(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [item, sequence, start, end] = exactly(arguments);
    if let Some(elements) = vector_elements(&vm.heap, sequence) {
        let length = elements.len();
        let (start, end) = short_part(vm, start, end, length)?;
        let heap = &vm.heap;
        let is_it = |index: &usize| {
            vector_elements(heap, sequence)
                .and_then(|elements| elements.get(*index))
                .is_some_and(|candidate| number::eql(heap, item, candidate))
        };
        return Ok(Value::index((start..end).filter(is_it).count()));
    }
    if !sequence.is_list() {
        return vm.exchange.type_error(sequence, "SEQUENCE");
    }
    let items = list_items(vm, sequence, LIMIT)?;
    let (start, end) = vm.exchange.bounds(start, end, items.len())?;
    let is_it = |candidate: &&Value| number::eql(&vm.heap, item, **candidate);
    Ok(Value::index(items[start..end].iter().filter(is_it).count()))
}

pub(super) fn remove_eql(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [item, list] = exactly(arguments);
    let items = list_items(vm, list, LIMIT)?;
    let kept: Vec<Value> = items.iter().copied().filter(|&v| !number::eql(&vm.heap, item, v)).collect();
    // As it was, where there was nothing to remove.
    if kept.len() == items.len() { Ok(list) } else { Ok(vm.heap.list(&kept)?) }
}
