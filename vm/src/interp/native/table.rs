//! Hash tables in machine code: what a search alone can do. For all else it calls the builtin.

use esl_native::NativeContext;

use super::step::parts;
use crate::lookup::KeyPlace;
use crate::table::Table;
use crate::value::Value;
use crate::vm::Vm;

/// Finds the value of a key in a hash table.
pub(super) unsafe extern "C" fn value_of_key(
    context: *mut NativeContext,
    key: u64,
    table: u64,
    default: u64,
    _: u64,
) -> u64 {
    // SAFETY: all are values of the program.
    unsafe {
        let (vm, _) = parts(context);
        let (key, table) = (Value::from_bits(key), Value::from_bits(table));
        end_lookup(context, value_of_key_at_once(vm, key, table, Value::from_bits(default)))
    }
}

/// Sets the value of a key that a hash table has.
pub(super) unsafe extern "C" fn set_value_of_key(
    context: *mut NativeContext,
    key: u64,
    table: u64,
    value: u64,
    _: u64,
) -> u64 {
    // SAFETY: all are values of the program.
    unsafe {
        let (vm, _) = parts(context);
        let (key, table) = (Value::from_bits(key), Value::from_bits(table));
        end_lookup(context, set_value_of_key_at_once(vm, key, table, Value::from_bits(value)))
    }
}

/// Adds to the value of a key that a hash table has.
pub(super) unsafe extern "C" fn add_to_value_of_key(
    context: *mut NativeContext,
    key: u64,
    table: u64,
    _: u64,
    delta: u64,
) -> u64 {
    // SAFETY: all are values of the program.
    unsafe {
        let (vm, _) = parts(context);
        let (key, table) = (Value::from_bits(key), Value::from_bits(table));
        end_lookup(context, add_to_value_of_key_at_once(vm, key, table, Value::from_bits(delta)))
    }
}

/// Returns what machine code hears of a search in a hash table.
///
/// # Safety
/// That of a helper.
#[inline(always)]
unsafe fn end_lookup(context: *mut NativeContext, found: Option<Value>) -> u64 {
    let Some(value) = found else { return Value::UNBOUND.bits() };
    // SAFETY: by the contract the context is that of `run`. A search allocates nothing.
    unsafe {
        let (vm, _) = parts(context);
        if vm.wants_safepoint() {
            (*context).ticks = vm.prepare_safepoint((*context).ticks);
        }
    }
    value.bits()
}

/// Does a `gethash` that wants one value; `None`, without effect, if that takes more than a search.
#[inline(always)]
fn value_of_key_at_once(vm: &mut Vm, key: Value, table: Value, default: Value) -> Option<Value> {
    let table = Table::of(&vm.heap, table)?;
    let found = vm.exchange.lookups.locate(&vm.heap, table, key).ok()?;
    vm.exchange.note_lookup(&vm.heap, table, key, &found);
    Some(match found.place {
        KeyPlace::Entry(_, value) => value,
        KeyPlace::None(_) => default,
    })
}

/// Does a `puthash` of a key that the table has; `None`, without effect, if it has none, or that takes more
/// than a search.
#[inline(always)]
fn set_value_of_key_at_once(vm: &mut Vm, key: Value, table: Value, value: Value) -> Option<Value> {
    let table = Table::of(&vm.heap, table)?;
    let found = vm.exchange.lookups.locate(&vm.heap, table, key).ok()?;
    let KeyPlace::Entry(entry, _) = found.place else { return None };
    vm.exchange.note_lookup(&vm.heap, table, key, &found);
    table.set_value(&mut vm.heap, entry, value);
    Some(value)
}

/// Does an `add_to_value` of a key that the table has, whose value is a fixnum, as are `delta` and the sum;
/// `None`, without effect, for all others, or if that takes more than a search.
#[inline(always)]
fn add_to_value_of_key_at_once(vm: &mut Vm, key: Value, table: Value, delta: Value) -> Option<Value> {
    let table = Table::of(&vm.heap, table)?;
    let found = vm.exchange.lookups.locate(&vm.heap, table, key).ok()?;
    let KeyPlace::Entry(entry, value) = found.place else { return None };
    let sum = Value::fixnum(value.as_fixnum()?.checked_add(delta.as_fixnum()?)?)?;
    vm.exchange.note_lookup(&vm.heap, table, key, &found);
    table.set_value(&mut vm.heap, entry, sum);
    Some(sum)
}
