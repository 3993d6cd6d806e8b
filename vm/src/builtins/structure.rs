//! Slots of structures, where an instruction does not reach: classes named at run time, more slots than an
//! operand counts.

use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Checks that `instance` is one of the class named `name` and has the slot.
fn check(vm: &mut Vm, name: Value, index: Value, instance: Value) -> Result<usize, Exit> {
    let slots = vm.heap.structure_slots(instance).map(<[Value]>::len);
    match (vm.names.find_class(name), slots, index.as_index()) {
        (Some(class), Some(slots), Some(index))
            if index < slots && vm.names.is_instance(&vm.heap, instance, class) =>
        {
            Ok(index)
        }
        _ => vm.exchange.raise(Raised::Type(instance, Expected::Specifier(name))),
    }
}

pub(super) fn slot(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class, index, instance] = exactly(arguments);
    let index = check(vm, class, index, instance)?;
    Ok(vm.heap.structure_slots(instance).map_or(Value::NIL, |slots| slots[index]))
}

pub(super) fn set_slot(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class, index, instance, value] = exactly(arguments);
    let index = check(vm, class, index, instance)?;
    vm.heap.structure_set(instance, index, value);
    Ok(value)
}

pub(super) fn is_instance(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [class, object] = exactly(arguments);
    let class = vm.names.find_class(class);
    Ok(class.is_some_and(|class| vm.names.is_instance(&vm.heap, object, class)).into())
}
