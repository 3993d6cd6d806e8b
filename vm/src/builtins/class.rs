//! Structures and their classes.

use smallvec::SmallVec;

use crate::builtins::LIMIT;
use crate::builtins::define::definable;
use crate::builtins::list::list_items;
use crate::heap::layout::StructureObject;
use crate::heap::{Heap, Kind};
use crate::names::class::{self, MAX_DEPTH, class_slot, slot};
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Returns the class that `v` is or names.
///
/// # Errors
/// A failure if there is none.
fn expect_class(vm: &mut Vm, v: Value) -> Result<Value, Exit> {
    if vm.heap.is(v, Kind::Class) {
        return Ok(v);
    }
    if let Some(class) = vm.names.find_class(v) {
        return Ok(class);
    }
    if !vm.names.is_symbol(&vm.heap, v) {
        return vm.exchange.type_error(v, "CLASS");
    }
    let name = vm.describe(v);
    vm.exchange.program_error(format!("the structure or condition type {name} does not exist"))
}

/// Returns the classes that the list `supers` holds or names, for a class that inherits from them.
///
/// # Errors
/// `type-error` or `program-error` if an item is not a class, or its inheritance is at the maximum depth.
pub(super) fn superclasses(vm: &mut Vm, supers: Value) -> Result<Vec<Value>, Exit> {
    let mut classes = Vec::new();
    for class in list_items(vm, supers, LIMIT)? {
        classes.push(expect_class(vm, class)?);
    }
    let is_too_deep = classes.iter().any(|&class| {
        class_slot(&vm.heap, class, slot::DEPTH).as_index().is_some_and(|depth| depth >= MAX_DEPTH)
    });
    if is_too_deep {
        let text = format!("types include each other more than {MAX_DEPTH} levels deep");
        return vm.exchange.program_error(text);
    }
    Ok(classes)
}

/// Notes that `datum` is not an instance of `class`.
fn instance_error<T>(vm: &mut Vm, datum: Value, class: Value) -> Result<T, Exit> {
    let name = if vm.heap.is(class, Kind::Class) { class::name_of(&vm.heap, class) } else { class };
    vm.exchange.raise(Raised::Type(datum, Expected::Specifier(name)))
}

fn index_in(vm: &mut Vm, instance: Value, index: Value) -> Result<usize, Exit> {
    let Some(slots) = vm.heap.structure_slots(instance) else {
        return instance_error(vm, instance, vm.names.known.structure_object);
    };
    let length = slots.len();
    vm.exchange.index_below(index, length)
}

fn slot_value(heap: &Heap, instance: Value, index: usize) -> Value {
    heap.structure_slots(instance).and_then(|slots| slots.get(index)).copied().unwrap_or(Value::NIL)
}

pub(super) fn make_class(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, supers, slots, data] = exactly(arguments);
    if !vm.heap.is(name, Kind::Symbol) {
        return vm.exchange.type_error(name, "SYMBOL");
    }
    if vm.names.is_locked(&vm.heap, name) {
        let name = vm.describe(name);
        return vm
            .exchange
            .program_error(format!("{name} belongs to the language and cannot be redefined as a type"));
    }
    let classes = superclasses(vm, supers)?;
    let slots = list_items(vm, slots, LIMIT)?;
    Ok(vm.names.define_class(&mut vm.heap, name, &classes, &slots, data)?)
}

pub(super) fn set_class(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, class] = exactly(arguments);
    definable(vm, name, "type")?;
    if class.is_true() && !vm.heap.is(class, Kind::Class) {
        return vm.exchange.type_error(class, "CLASS");
    }
    vm.names.set_class(&mut vm.heap, name, Some(class).filter(|class| class.is_true()));
    Ok(name)
}

pub(super) fn find_class(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(vm.names.find_class(arguments[0]).unwrap_or(Value::NIL))
}

pub(super) fn class_of(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let whole = vm.heap.structure_whole(arguments[0]);
    Ok(vm.heap.structure_class(whole).unwrap_or(Value::NIL))
}

pub(super) fn classp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(vm.heap.is(arguments[0], Kind::Class)))
}

pub(super) fn class_name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let class = expect_class(vm, arguments[0])?;
    Ok(class::name_of(&vm.heap, class))
}

pub(super) fn class_supers(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let class = expect_class(vm, arguments[0])?;
    Ok(class_slot(&vm.heap, class, slot::SUPERS))
}

pub(super) fn class_slots(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let class = expect_class(vm, arguments[0])?;
    Ok(class_slot(&vm.heap, class, slot::SLOTS))
}

pub(super) fn class_data(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let class = expect_class(vm, arguments[0])?;
    Ok(class_slot(&vm.heap, class, slot::DATA))
}

pub(super) fn set_class_data(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class, data] = exactly(arguments);
    let class = expect_class(vm, class)?;
    vm.heap.record_set(class, Kind::Class, slot::DATA, data);
    Ok(data)
}

pub(super) fn subclass_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class, ancestor] = exactly(arguments);
    let class = expect_class(vm, class)?;
    let ancestor = expect_class(vm, ancestor)?;
    Ok(Value::boolean(vm.names.is_subclass(&vm.heap, class, ancestor)))
}

/// Slots without a value are `NIL`.
pub(super) fn make_structure(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let class = expect_class(vm, arguments[0])?;
    let count = class_slot(&vm.heap, class, slot::COUNT).as_index().unwrap_or(0);
    let values = &arguments[1..];
    if values.len() == count {
        return Ok(vm.heap.alloc_structure(class, values)?);
    }
    if values.len() > count {
        let name = class::name_of(&vm.heap, class);
        let name = vm.describe(name);
        let given = values.len();
        return vm.exchange.program_error(format!("{name} has {count} slots, but {given} values were given"));
    }
    let mut slots = values.to_vec();
    slots.resize(count, Value::NIL);
    Ok(vm.heap.alloc_structure(class, &slots)?)
}

pub(super) fn make_value_structure(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let instance = make_structure(vm, arguments)?;
    vm.heap.set_flags(instance, Kind::Structure, StructureObject::VALUE);
    Ok(instance)
}

pub(super) fn copy_structure(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let whole = vm.heap.structure_whole(arguments[0]);
    let (Some(class), Some(slots)) = (vm.heap.structure_class(whole), vm.heap.structure_slots(whole)) else {
        return instance_error(vm, arguments[0], vm.names.known.structure_object);
    };
    if vm.heap.is_instance(arguments[0]) {
        return instance_error(vm, arguments[0], vm.names.known.structure_object);
    }
    let slots: SmallVec<[Value; 8]> = slots.into();
    vm.exchange.charge(slots.len());
    Ok(vm.heap.alloc_structure(class, &slots)?)
}

pub(super) fn slot_place(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [instance, rows] = exactly(arguments);
    let Some(own) = vm.heap.structure_class(instance) else { return Ok(Value::NIL) };
    let is_of = |name: Value| {
        vm.names.find_class(name).is_some_and(|class| vm.names.is_subclass(&vm.heap, own, class))
    };
    let mut steps = 0;
    let mut pairs = class::list(&vm.heap, rows).filter_map(|row| vm.heap.as_cons(row));
    let place = pairs.find(|row| {
        steps += 1;
        is_of(row.car)
    });
    let place = place.and_then(|row| {
        let mut names = class::list(&vm.heap, class_slot(&vm.heap, own, slot::SLOTS));
        names.position(|name| name == row.cdr)
    });
    vm.exchange.charge(steps + place.unwrap_or(0));
    Ok(place.map_or(Value::NIL, Value::index))
}

pub(super) fn structure_ref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [instance, index] = exactly(arguments);
    let index = index_in(vm, instance, index)?;
    Ok(slot_value(&vm.heap, instance, index))
}

pub(super) fn set_structure_ref(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [instance, index, value] = exactly(arguments);
    let index = index_in(vm, instance, index)?;
    vm.heap.structure_set(instance, index, value);
    Ok(value)
}

pub(super) fn structurep(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(vm.heap.is(arguments[0], Kind::Structure)))
}

pub(super) fn define_accessor(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, class, index, access] = exactly(arguments);
    definable(vm, name, "function")?;
    if !vm.heap.is(class, Kind::Symbol) {
        return vm.exchange.type_error(class, "SYMBOL");
    }
    vm.exchange.index_below(index, usize::from(u16::MAX))?;
    let record = vm.heap.cons(index, access)?;
    let record = vm.heap.cons(class, record)?;
    let indicator = vm.names.known.accessor;
    super::symbol::put(vm, &[name, indicator, record])?;
    Ok(name)
}
