//! Operations: beginning and cancelling them, and what has become of them.

use crate::builtins::rights::demand;
use crate::builtins::task::expect_task;
use crate::datum::{self, DatumError};
use crate::describe::describe;
use crate::outside::GivenIndex;
use crate::raise::{Exit, Outcome, Raised};
use crate::run;
use crate::schedule::Measure;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::handle;
use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::span::Span;

use super::expect::exactly;

/// Returns a function of the host, if there is one, for a call by a symbol and a list, and makes that list
/// the arguments of the call, for as long as it is made.
///
/// # Errors
/// A failure if an argument is not data, or if the program does not have a right that the function needs.
pub(super) fn host_call(vm: &mut Vm, call: &[Value]) -> Result<Option<GivenIndex>, Exit> {
    let function = function_named(vm, call[0]);
    let result = export_arguments(vm, call[1]).and_then(|()| match function {
        Some(function) => demand_rights(vm, function),
        None => Ok(()),
    });
    if result.is_err() {
        vm.outside.let_go_of_arguments();
    }
    result.map(|()| function)
}

/// Makes a list the arguments of the call of the host that is being made.
fn export_arguments(vm: &mut Vm, list: Value) -> Result<(), Exit> {
    let (mut rest, mut count) = (list, 0);
    while let Some(pair) = vm.heap.as_cons(rest) {
        rest = pair.cdr;
        let data = &mut vm.outside.arguments;
        if let Some(place) = data.get_mut(count)
            && let Some(number) = datum::number_of(&vm.heap, pair.car)
        {
            place.put(number);
            vm.exchange.charge(datum::WORK_OF_ATOM);
        } else {
            data.truncate(count);
            match datum::export(&vm.heap, &vm.names, pair.car, describe) {
                Ok((datum, work)) => {
                    vm.exchange.charge(work);
                    vm.outside.arguments.push(datum);
                }
                Err(DatumError::NoRoom(bytes)) => {
                    vm.heap.check_room(bytes)?;
                    return Err(Exit::Collect);
                }
                Err(error) => return vm.exchange.raise(Raised::Simple(error.to_string())),
            }
        }
        count += 1;
    }
    vm.outside.arguments.truncate(count);
    Ok(())
}

/// Checks that the program has the rights that a function of the host needs for its arguments.
fn demand_rights(vm: &mut Vm, function: GivenIndex) -> Result<(), Exit> {
    let mut permitted = Vec::new();
    for need in vm.outside.needs(function) {
        // One argument may need several rights, and each refusal names it as the program does.
        let Some(argument) = vm.outside.arguments.get(need.argument).cloned() else { continue };
        if let DatumKind::String(object) = argument.kind() {
            permitted.push((need.argument, demand(vm, need.right, object.as_ref())?));
        }
    }
    for (argument, object) in permitted {
        vm.outside.arguments[argument] = Datum::string(&object, Span::default());
    }
    Ok(())
}

/// Returns the function of the host that a symbol names.
fn function_named(vm: &mut Vm, symbol: Value) -> Option<GivenIndex> {
    let name = vm.heap.symbol(symbol)?.name;
    let characters = vm.heap.string(name)?;
    if let Some(function) = vm.outside.found_before(symbol, characters) {
        return Some(function);
    }
    // Almost all names are short and ASCII, and need no memory of their own.
    let mut bytes = [0_u8; 64];
    if let Some(bytes) = bytes.get_mut(..characters.len())
        && characters.iter().all(|&code| code < 0x80)
    {
        bytes.iter_mut().zip(characters).for_each(|(byte, &code)| *byte = code as u8);
        let function = vm.outside.function(std::str::from_utf8(bytes).ok()?)?;
        vm.outside.note_found(symbol, function);
        return Some(function);
    }
    vm.outside.function(&vm.heap.string_text(name)?)
}

/// Returns the handle of an operation that `v` is.
///
/// # Errors
/// A failure if it is none.
fn expect_handle(vm: &mut Vm, v: Value) -> Result<Value, Exit> {
    if handle::is_handle(&vm.heap, v) { Ok(v) } else { vm.exchange.not_a(v, vm.names.known.operation) }
}

pub(super) fn begin_operation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let function = host_call(vm, arguments)?;
    let begun = begin_by(vm, function, arguments);
    vm.outside.let_go_of_arguments();
    begun
}

/// Begins an operation by a function of the host, which has its arguments.
fn begin_by(vm: &mut Vm, function: Option<GivenIndex>, arguments: &[Value]) -> Outcome {
    let [_, _, detached] = exactly(arguments);
    let Some(function) = function.filter(|&function| vm.outside.is_operation(function)) else {
        return vm.exchange.raise(Raised::Cause("NOT-IN-THIS-WORLD", arguments[0]));
    };
    run::admit(vm, Measure::Operations)?;
    let number = vm.outside.operations.next_number();
    let handle = handle::make(&mut vm.heap, arguments[0], number, vm.names.known.pending)?;
    vm.scheduler.accounts.take(vm.scheduler.running_account(), Measure::Operations);
    let task = vm.scheduler.running_number();
    vm.outside.begin_operation(function, handle, detached.is_true(), task);
    Ok(handle)
}

pub(super) fn tell_of_suspension(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let task = vm.scheduler.running_number();
    let told = vm.outside.operations.suspend(task, arguments[0].is_true());
    vm.exchange.charge(told);
    Ok(Value::NIL)
}

pub(super) fn may_await(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let function = function_named(vm, arguments[0]);
    let is_there = function.is_some_and(|function| vm.outside.is_operation(function));
    Ok(Value::boolean(is_there && vm.scheduler.task().critical == 0))
}

pub(super) fn cancel_operation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let handle = expect_handle(vm, arguments[0])?;
    vm.outside.operations.cancel(handle::number(&vm.heap, handle));
    Ok(Value::NIL)
}

pub(super) fn operation_state(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    let handle = expect_handle(vm, arguments[0])?;
    let slot = |slot| vm.heap.slot_or_nil(handle, slot);
    let values = [slot(handle::STATE), slot(handle::RESULT)];
    vm.give_values(&values)
}

pub(super) fn operation_progress(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point_of_read()?;
    let handle = expect_handle(vm, arguments[0])?;
    Ok(vm.heap.slot_or_nil(handle, handle::PROGRESS))
}

pub(super) fn note_operation_progress(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [handle, values] = exactly(arguments);
    let handle = expect_handle(vm, handle)?;
    vm.scheduler.wait_for_deliveries()?;
    if vm.heap.slot_or_nil(handle, handle::STATE) == vm.names.known.pending {
        vm.signal_event(handle, &[])?;
        vm.heap.slot_set(handle, handle::PROGRESS, values);
    }
    Ok(Value::NIL)
}

pub(super) fn operation_number(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let handle = expect_handle(vm, arguments[0])?;
    Ok(Value::index(handle::number(&vm.heap, handle) as usize))
}

pub(super) fn operationp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(handle::is_handle(&vm.heap, arguments[0])))
}

pub(super) fn make_operation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    run::admit(vm, Measure::Operations)?;
    let number = vm.outside.operations.next_number();
    let handle = handle::make(&mut vm.heap, arguments[0], number, vm.names.known.pending)?;
    vm.scheduler.accounts.take(vm.scheduler.running_account(), Measure::Operations);
    vm.outside.operations.count();
    Ok(handle)
}

pub(super) fn end_operation(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [handle, state, result] = exactly(arguments);
    let handle = expect_handle(vm, handle)?;
    vm.scheduler.wait_for_deliveries()?;
    if vm.heap.slot_or_nil(handle, handle::STATE) == vm.names.known.pending {
        vm.signal_event(handle, &[])?;
        vm.heap.slot_set(handle, handle::RESULT, result);
        vm.heap.slot_set(handle, handle::STATE, state);
    }
    Ok(Value::NIL)
}

pub(super) fn operation_performer(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let handle = expect_handle(vm, arguments[0])?;
    Ok(vm.heap.slot_or_nil(handle, handle::PERFORMER))
}

pub(super) fn set_operation_performer(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [handle, task] = exactly(arguments);
    let handle = expect_handle(vm, handle)?;
    let task = expect_task(vm, task)?;
    vm.heap.slot_set(handle, handle::PERFORMER, task);
    Ok(task)
}
