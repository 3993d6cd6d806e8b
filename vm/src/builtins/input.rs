//! Inputs: events that the outside may signal by name, and that queue signals until a task takes them.

use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::input::{self, WhenFull};

use super::expect::exactly;

/// Returns the input that `v` is.
///
/// # Errors
/// A failure if it is none.
fn expect_input(vm: &mut Vm, v: Value) -> Result<Value, Exit> {
    if input::is_input(&vm.heap, v) { Ok(v) } else { vm.exchange.not_a(v, vm.names.known.input) }
}

/// Returns the name under which the outside knows an input: a string, or that of a symbol.
pub(super) fn key_of(vm: &Vm, v: Value) -> Option<String> {
    let name = vm.heap.symbol(v).map_or(v, |symbol| symbol.name);
    vm.heap.string_text(name).filter(|_| v.is_true())
}

pub(super) fn add_input(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [name, capacity, rule] = exactly(arguments);
    let Some(capacity) = capacity.as_index().filter(|&capacity| capacity > 0) else {
        return vm.exchange.not_written(capacity, "(INTEGER 1)");
    };
    let when_full = rule.as_index().and_then(WhenFull::from_number).unwrap_or(WhenFull::DropOldest);
    let Some(key) = key_of(vm, name) else { return vm.exchange.type_error(name, "SYMBOL") };
    let input = match vm.outside.inputs.get(&key) {
        Some(&input) => {
            input::change(&mut vm.heap, input, capacity, when_full);
            input
        }
        None => {
            let input = input::make(&mut vm.heap, name, capacity, when_full)?;
            vm.outside.inputs.insert(key.clone(), input);
            input
        }
    };
    vm.outside.inbox.open_input(&key, (when_full == WhenFull::Wait).then_some(capacity));
    Ok(input)
}

pub(super) fn input_rule(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let input = expect_input(vm, arguments[0])?;
    let capacity = Value::index(input::capacity(&vm.heap, input));
    let rule = Value::index(input::when_full(&vm.heap, input) as usize);
    vm.give_values(&[capacity, rule])
}

pub(super) fn remove_input(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if let Some(key) = key_of(vm, arguments[0])
        && let Some(input) = vm.outside.inputs.remove(&key)
    {
        vm.heap.log_if_marking(input);
        vm.outside.inbox.remove_input(&key);
    }
    Ok(Value::NIL)
}

pub(super) fn input_dropped(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    let input = expect_input(vm, arguments[0])?;
    Ok(Value::index(input::dropped(&vm.heap, input)))
}

pub(super) fn inputp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(input::is_input(&vm.heap, arguments[0])))
}
