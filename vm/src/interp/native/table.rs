//! Hash tables in machine code: what a search alone can do. For all else it calls the builtin.

use esl_native::NativeContext;

use super::step::parts;
use crate::lookup::{KeyPlace, Lookup};
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
        end_lookup(context, at_once(vm, LookupOperation::Get, key, table, Value::from_bits(default)))
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
        end_lookup(context, at_once(vm, LookupOperation::Set, key, table, Value::from_bits(value)))
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
        end_lookup(context, at_once(vm, LookupOperation::Add, key, table, Value::from_bits(delta)))
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

/// The operation on a key.
#[derive(Clone, Copy, PartialEq, Eq)]
enum LookupOperation {
    /// A `gethash` that wants one value, given the default.
    Get,
    /// A `%puthash` of a key that is there, given the value.
    Set,
    /// An `%add-to-value` of a fixnum that is there, given another one, if the sum is one too.
    Add,
}

/// Does something with a key; `None`, without effect, if that takes more than a search.
#[inline(always)]
fn at_once(vm: &mut Vm, operation: LookupOperation, key: Value, table: Value, given: Value) -> Option<Value> {
    let table = Table::of(&vm.heap, table)?;
    match key.as_fixnum() {
        Some(n) => {
            let found = vm.exchange.lookups.locate_fixnum(&vm.heap, table, key, n).ok()?;
            act(vm, operation, key, table, &found, given)
        }
        None => with_other_key(vm, operation, key, table, given),
    }
}

/// As [`at_once`], for keys of any kind: so the path for fixnums needs no memory.
#[inline(never)]
fn with_other_key(
    vm: &mut Vm,
    operation: LookupOperation,
    key: Value,
    table: Table,
    given: Value,
) -> Option<Value> {
    let found = vm.exchange.lookups.locate_other(&vm.heap, table, key).ok()?;
    act(vm, operation, key, table, &found, given)
}

/// Does something with a key that was searched.
#[inline(always)]
fn act(
    vm: &mut Vm,
    operation: LookupOperation,
    key: Value,
    table: Table,
    found: &Lookup,
    given: Value,
) -> Option<Value> {
    let value = match (operation, &found.place) {
        (LookupOperation::Get, &KeyPlace::Entry(_, value)) => value,
        (LookupOperation::Get, KeyPlace::None(_)) | (LookupOperation::Set, KeyPlace::Entry(..)) => given,
        (LookupOperation::Add, KeyPlace::Entry(_, value)) => {
            Value::fixnum(value.as_fixnum()?.checked_add(given.as_fixnum()?)?)?
        }
        (LookupOperation::Set | LookupOperation::Add, KeyPlace::None(_)) => return None,
    };
    vm.exchange.note_lookup(&vm.heap, table, key, found);
    if let KeyPlace::Entry(entry, _) = found.place
        && operation != LookupOperation::Get
    {
        table.set_value(&mut vm.heap, entry, value);
    }
    Some(value)
}
