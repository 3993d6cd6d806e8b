//! Hash tables.
//!
//! Tables that compare by a test of the machine are searched here, within a limit of work; above it, and for
//! tests that are functions of the program, the ESL twin compares the keys that have the same hash. Since it
//! can be interrupted, what it has found is checked again where it is used: an entry must still have the very
//! key, a table the same keys.

use crate::equality::{self, KeyTest};
use crate::lookup::KeyPlace;
use crate::number;
use crate::raise::{Exit, Outcome};
use crate::table::{KeyComparison, Table, Trouble};
use crate::value::Value;
use crate::vm::Vm;

use super::LIMIT;
use super::expect::{exactly, optional};

impl From<Trouble> for Exit {
    fn from(trouble: Trouble) -> Exit {
        match trouble {
            Trouble::Slowly => Exit::Slowly,
            Trouble::Room(error) => error.into(),
        }
    }
}

/// Returns the table that `v` is; a type error for anything else.
fn table(vm: &mut Vm, v: Value) -> Result<Table, Exit> {
    match Table::of(&vm.heap, v) {
        Some(table) => Ok(table),
        None => vm.exchange.type_error(v, "HASH-TABLE"),
    }
}

/// Finds a key, and charges for that.
#[inline(always)]
fn find(vm: &mut Vm, table: Table, key: Value) -> Result<KeyPlace, Exit> {
    let found = vm.exchange.lookups.locate(&vm.heap, table, key)?;
    vm.exchange.note_lookup(&vm.heap, table, key, &found);
    Ok(found.place)
}

pub(super) fn make_hash_table(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [test, size, test_function, hash_function] = exactly(arguments);
    let comparison = match test.as_index() {
        Some(0) => KeyComparison::Native(KeyTest::Eq),
        Some(1) => KeyComparison::Native(KeyTest::Eql),
        Some(2) => KeyComparison::Native(KeyTest::Equal),
        Some(3) => KeyComparison::Native(KeyTest::Equalp),
        Some(4) => KeyComparison::Program,
        _ => return vm.exchange.index_error(test, 5),
    };
    let size = vm.exchange.count(size)?;
    let table = Table::make(&mut vm.heap, comparison, size, [test_function, hash_function])?;
    vm.exchange.charge_elements(size.min(LIMIT));
    Ok(table)
}

pub(super) fn gethash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let table = table(vm, arguments[1])?;
    match find(vm, table, arguments[0])? {
        KeyPlace::Entry(_, value) => vm.give_values(&[value, Value::T]),
        KeyPlace::None(_) => vm.give_values(&[optional(arguments, 2), Value::NIL]),
    }
}

pub(super) fn puthash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [key, table_value, value] = exactly(arguments);
    let table = table(vm, table_value)?;
    match find(vm, table, key)? {
        KeyPlace::Entry(entry, _) => table.set_value(&mut vm.heap, entry, value),
        KeyPlace::None(hash) => add(vm, table, hash, key, value)?,
    }
    Ok(value)
}

pub(super) fn add_to_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [key, table_value, default, delta] = exactly(arguments);
    let table = table(vm, table_value)?;
    let place = find(vm, table, key)?;
    let old = match place {
        KeyPlace::Entry(_, value) => value,
        KeyPlace::None(_) => default,
    };
    let sum = match number::add(vm, old, delta) {
        Err(Exit::Collect) => return Err(Exit::Collect),
        // The twin fails at the addition, so that what it may be given instead of the sum is stored.
        Err(_) => return Err(Exit::Slowly),
        Ok(sum) => sum,
    };
    match place {
        KeyPlace::Entry(entry, _) => table.set_value(&mut vm.heap, entry, sum),
        KeyPlace::None(hash) => add(vm, table, hash, key, sum)?,
    }
    Ok(sum)
}

fn add(vm: &mut Vm, table: Table, hash: u32, key: Value, value: Value) -> Result<(), Exit> {
    let room = table.room(&vm.heap);
    table.add(&mut vm.heap, hash, key, value)?;
    let grown = table.room(&vm.heap) - room;
    vm.exchange.charge(4 * grown);
    Ok(())
}

pub(super) fn remhash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [key, table_value] = exactly(arguments);
    let table = table(vm, table_value)?;
    let KeyComparison::Native(test) = table.comparison(&vm.heap) else { return Err(Exit::Slowly) };
    let (hash, hashing) = equality::hash_with_work(&vm.heap, test, key);
    let mut work = LIMIT;
    let found = table.find(&vm.heap, test, key, hash, &mut work)?;
    vm.exchange.charge_elements(LIMIT - work + hashing);
    Ok(found.is_some_and(|(entry, _)| table.delete(&mut vm.heap, entry, hash)).into())
}

pub(super) fn clrhash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let table = table(vm, arguments[0])?;
    vm.exchange.charge(table.room(&vm.heap));
    table.clear(&mut vm.heap)?;
    Ok(arguments[0])
}

pub(super) fn hash_table_count(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let table = table(vm, arguments[0])?;
    Ok(Value::index(table.count(&vm.heap)))
}

pub(super) fn hash_table_size(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let table = table(vm, arguments[0])?;
    Ok(Value::index(table.room(&vm.heap)))
}

pub(super) fn hash_table_test(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let table = table(vm, arguments[0])?;
    let number = match table.comparison(&vm.heap) {
        KeyComparison::Native(KeyTest::Eq) => 0,
        KeyComparison::Native(KeyTest::Eql) => 1,
        KeyComparison::Native(KeyTest::Equal) => 2,
        KeyComparison::Native(KeyTest::Equalp) => 3,
        KeyComparison::Program => 4,
    };
    let [test, hash] = table.functions(&vm.heap);
    vm.give_values(&[Value::small(number), test, hash])
}

pub(super) fn table_next(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [table_value, position] = exactly(arguments);
    let table = table(vm, table_value)?;
    let position = vm.exchange.count(position)?;
    let used = table.used(&vm.heap);
    for at in position..used.min(position.saturating_add(LIMIT)) {
        if let Some((key, value)) = table.entry(&vm.heap, at) {
            vm.exchange.charge_elements(at - position);
            return vm.give_values(&[Value::index(at + 1), key, value]);
        }
    }
    if used > position.saturating_add(LIMIT) {
        return Err(Exit::Slowly);
    }
    vm.give_values(&[Value::NIL; 3])
}

/// Passes at most [`LIMIT`] free entries.
pub(super) fn table_skip(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [table_value, position] = exactly(arguments);
    let table = table(vm, table_value)?;
    let position = vm.exchange.count(position)?;
    let end = table.used(&vm.heap).min(position.saturating_add(LIMIT)).max(position);
    vm.exchange.charge_elements(end - position);
    let next = (position..end).find(|&at| table.entry(&vm.heap, at).is_some());
    Ok(Value::index(next.unwrap_or(end)))
}

pub(super) fn table_hash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [table_value, key] = exactly(arguments);
    let table = table(vm, table_value)?;
    let test = match table.comparison(&vm.heap) {
        KeyComparison::Native(test) => test,
        KeyComparison::Program => KeyTest::Equalp,
    };
    let (hash, work) = equality::hash_with_work(&vm.heap, test, key);
    vm.exchange.charge_elements(work);
    Ok(Value::index(hash as usize))
}

/// Returns the 32 bits of a hash: a fixnum as [`table_hash`] gives it, or any integer of a hash function of
/// the program.
fn hash_argument(vm: &mut Vm, v: Value) -> Result<u32, Exit> {
    match v.as_index().and_then(|hash| u32::try_from(hash).ok()) {
        Some(hash) => Ok(hash),
        None => Ok(equality::given_hash(vm.integer(v)?.limbs().1.first().copied().unwrap_or(0))),
    }
}

pub(super) fn table_candidates(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [table_value, hash] = exactly(arguments);
    let table = table(vm, table_value)?;
    let hash = hash_argument(vm, hash)?;
    let candidates = table.candidates(&vm.heap, hash);
    vm.exchange.charge_elements(candidates.len());
    let mut list = Value::NIL;
    for (entry, key) in candidates {
        let pair = vm.heap.cons(Value::index(entry), key)?;
        list = vm.heap.cons(pair, list)?;
    }
    Ok(list)
}

pub(super) fn table_serial(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let table = table(vm, arguments[0])?;
    Ok(Value::index(table.serial(&vm.heap)))
}

/// Returns the table, and the entry with its value if it still has this very key.
fn entry_of_key(vm: &mut Vm, arguments: &[Value]) -> Result<(Table, Option<(usize, Value)>), Exit> {
    let table = table(vm, arguments[0])?;
    let entry = vm.exchange.count(arguments[1])?;
    let value = table.entry(&vm.heap, entry).filter(|&(key, _)| key == arguments[2]).map(|(_, value)| value);
    Ok((table, value.map(|value| (entry, value))))
}

pub(super) fn table_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match entry_of_key(vm, arguments)? {
        (_, Some((_, value))) => vm.give_values(&[value, Value::T]),
        _ => vm.give_values(&[Value::NIL, Value::NIL]),
    }
}

pub(super) fn set_table_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (table, found) = entry_of_key(vm, arguments)?;
    if let Some((entry, _)) = found {
        table.set_value(&mut vm.heap, entry, arguments[3]);
    }
    Ok(found.is_some().into())
}

pub(super) fn table_add(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [table_value, hash, key, value, serial] = exactly(arguments);
    let table = table(vm, table_value)?;
    let hash = hash_argument(vm, hash)?;
    if serial.as_index() != Some(table.serial(&vm.heap)) {
        return Ok(Value::NIL);
    }
    add(vm, table, hash, key, value)?;
    Ok(Value::T)
}

pub(super) fn table_delete(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (table, found) = entry_of_key(vm, arguments)?;
    let hash = hash_argument(vm, arguments[3])?;
    Ok(found.is_some_and(|(entry, _)| table.delete(&mut vm.heap, entry, hash)).into())
}
