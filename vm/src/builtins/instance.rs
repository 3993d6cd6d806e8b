//! Instances of classes that `defclass` defines.
//!
//! An instance is a structure with two slots, marked by a flag: its *layout* and its *slots*, both simple
//! vectors. The indirection lets `change-class` give it another class, and more slots, without changing its
//! identity. The library finds the index of a slot (`instances.esl`) and keeps it in a *cache*, a simple
//! vector of a layout and an index. A builtin uses the index if the instance has that layout, and the layout
//! is still the current one of its class: then it begins with `T`.
//!
//! Guarantee: a cache that does not fit, whatever it contains, leads to the library's function that looks the
//! slot up.

use crate::builtins::class::superclasses;
use crate::builtins::list::list_items;
use crate::heap::layout::StructureObject;
use crate::heap::{AllocError, Heap, Kind};
use crate::names::class::{self, class_slot, slot};
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Index of the layout in the structure that represents an instance.
const LAYOUT: usize = 0;
/// Index of the vector of slots.
const SLOTS: usize = 1;

/// Returns layout and slots of an instance, `None` for every other value.
#[inline]
fn parts(heap: &Heap, v: Value) -> Option<(Value, Value)> {
    if !heap.is_instance(v) {
        return None;
    }
    // An instance never moves, so its slots are its own.
    let [_, layout, slots] = *heap.slots(v, Kind::Structure)?;
    Some((layout, slots))
}

/// Returns the slots of `instance` and the index in `cache`; `None` if the cache is for another layout, or
/// for one that is out of date.
#[inline]
fn locate(heap: &Heap, instance: Value, cache: Value) -> Option<(Value, usize)> {
    let (layout, slots) = parts(heap, instance)?;
    let &[known, index, ..] = heap.vector(cache)? else { return None };
    let is_current = known == layout && heap.vector(layout)?.first() == Some(&Value::T);
    if is_current { Some((slots, index.as_index()?)) } else { None }
}

pub(super) fn slot_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [instance, _, cache] = exactly(arguments);
    let value = locate(&vm.heap, instance, cache)
        .and_then(|(slots, index)| vm.heap.vector(slots)?.get(index).copied())
        .filter(|&value| value != Value::UNBOUND);
    value.ok_or(Exit::Slowly)
}

pub(super) fn set_slot_value(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [instance, _, cache, value] = exactly(arguments);
    locate(&vm.heap, instance, cache)
        .and_then(|(slots, index)| vm.heap.vector_set(slots, index, value))
        .map(|()| value)
        .ok_or(Exit::Slowly)
}

pub(super) fn unbound_marker(_vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    Ok(Value::UNBOUND)
}

pub(super) fn instancep(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(parts(&vm.heap, arguments[0]).is_some().into())
}

pub(super) fn new_instance(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class, layout, slots] = exactly(arguments);
    if !vm.heap.is(class, Kind::Class) {
        return vm.exchange.type_error(class, "CLASS");
    }
    let instance = vm.heap.alloc_structure(class, &[layout, slots])?;
    vm.heap.set_flags(instance, Kind::Structure, StructureObject::INSTANCE);
    Ok(instance)
}

pub(super) fn change_instance(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [instance, class, layout, slots] = exactly(arguments);
    if parts(&vm.heap, instance).is_none() {
        return vm.exchange.type_error(instance, "STANDARD-OBJECT");
    }
    let count = class_slot(&vm.heap, class, slot::COUNT).as_index();
    if count != Some(2) || vm.heap.instance_set_class(instance, class).is_none() {
        return vm.exchange.type_error(class, "STANDARD-CLASS");
    }
    vm.heap.structure_set(instance, LAYOUT, layout);
    vm.heap.structure_set(instance, SLOTS, slots);
    Ok(instance)
}

pub(super) fn instances_of(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class] = exactly(arguments);
    if !vm.heap.is(class, Kind::Class) {
        return vm.exchange.type_error(class, "CLASS");
    }
    match vm.exchange.found.take() {
        Some((of, found)) if of == class => {
            vm.exchange.charge(found.len());
            Ok(vm.heap.list(&found)?)
        }
        _ => {
            // A full collection finds them, and the call is made again behind it.
            vm.exchange.sought = Some(class);
            Err(AllocError::NeedCollection.into())
        }
    }
}

pub(super) fn move_structures(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [olds, news, class] = exactly(arguments);
    let (olds, news) = (list_items(vm, olds, usize::MAX)?, list_items(vm, news, usize::MAX)?);
    vm.exchange.charge(olds.len());
    for (&old, &new) in olds.iter().zip(&news) {
        if vm.heap.structure_move(old, new, class).is_none() {
            return vm.exchange.type_error(old, "STRUCTURE-OBJECT");
        }
    }
    Ok(Value::index(olds.len()))
}

pub(super) fn update_class(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class, supers] = exactly(arguments);
    if !vm.heap.is(class, Kind::Class) {
        return vm.exchange.type_error(class, "CLASS");
    }
    let supers = superclasses(vm, supers)?;
    if supers.iter().any(|&parent| vm.names.is_subclass(&vm.heap, parent, class)) {
        let name = vm.describe(class_slot(&vm.heap, class, slot::NAME));
        return vm.exchange.program_error(format!("the class {name} cannot inherit from itself"));
    }
    class::update(&mut vm.heap, class, &supers)?;
    Ok(class)
}

pub(super) fn cached_methods(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(class) = vm.heap.structure_class(arguments[1]) else { return Ok(Value::NIL) };
    let cache = vm.heap.vector(arguments[0]).unwrap_or(&[]);
    let found = cache.chunks_exact(2).find(|entry| entry[0] == class);
    Ok(found.map_or(Value::NIL, |entry| entry[1]))
}
