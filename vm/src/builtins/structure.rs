//! Slots of structures, where an instruction does not reach: classes named at run time, more slots than an operand
//! counts.

use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// Checks that `instance` is one of the class named `name` and has the slot.
fn check(vm: &mut Vm, name: Value, index: Value, instance: Value) -> Result<usize, Exit> {
    let slots = vm.heap.structure_slots(instance).map(<[Value]>::len);
    match (vm.find_class(name), slots, index.as_index()) {
        (Some(class), Some(slots), Some(index)) if index < slots && vm.is_instance(instance, class) => {
            Ok(index)
        }
        _ => vm.exchange.raise(Raised::Type(instance, Expected::Specifier(name))),
    }
}

/// `(%slot class index instance)`
pub(super) fn slot(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let &[class, index, instance] = arguments else { unreachable!("the table says three") };
    let index = check(vm, class, index, instance)?;
    Ok(vm.heap.structure_slots(instance).map_or(Value::NIL, |slots| slots[index]))
}

/// `(%set-slot class index instance value)`
pub(super) fn set_slot(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let &[class, index, instance, value] = arguments else { unreachable!("the table says four") };
    let index = check(vm, class, index, instance)?;
    vm.heap.structure_set(instance, index, value);
    Ok(value)
}

/// `(%instance-p class object)`
pub(super) fn is_instance(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let class = vm.find_class(arguments[0]);
    Ok(class.is_some_and(|class| vm.is_instance(arguments[1], class)).into())
}
