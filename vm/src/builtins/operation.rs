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
use smallvec::SmallVec;

use super::expect::exactly;

/// Arguments of a call of the host, of which most calls have few.
pub(super) type HostArguments = SmallVec<[Datum; 6]>;

/// Returns a function of the host, if there is one, and its arguments, from a symbol and a list.
///
/// # Errors
/// A failure if an argument is not data, or if the program does not have a right that the function needs.
pub(super) fn host_call(vm: &mut Vm, call: &[Value]) -> Result<(Option<GivenIndex>, HostArguments), Exit> {
    let (name, arguments) = (call[0], call[1]);
    let function = function_named(vm, name);
    let mut data = HostArguments::new();
    let mut rest = arguments;
    while let Some(pair) = vm.heap.as_cons(rest) {
        match datum::export(&vm.heap, &vm.names, pair.car, describe) {
            Ok((datum, work)) => {
                vm.exchange.charge(work);
                data.push(datum);
            }
            Err(DatumError::NoRoom(bytes)) => {
                vm.heap.check_room(bytes)?;
                return Err(Exit::Collect);
            }
            Err(error) => return vm.exchange.raise(Raised::Simple(error.to_string())),
        }
        rest = pair.cdr;
    }
    let mut permitted = Vec::new();
    for need in function.map_or(Vec::new(), |function| vm.outside.needs(function)) {
        // One argument may need several rights, and each refusal names it as the program does.
        if let Some(DatumKind::String(object)) = data.get(need.argument).map(Datum::kind) {
            permitted.push((need.argument, demand(vm, need.right, object.as_ref())?));
        }
    }
    for (argument, object) in permitted {
        data[argument] = Datum::string(&object, Span::default());
    }
    Ok((function, data))
}

/// Returns the function of the host that a symbol names.
fn function_named(vm: &Vm, symbol: Value) -> Option<GivenIndex> {
    let name = vm.heap.symbol(symbol)?.name;
    let characters = vm.heap.string(name)?;
    // Almost all names are short and ASCII, and need no memory of their own.
    let mut bytes = [0_u8; 64];
    if let Some(bytes) = bytes.get_mut(..characters.len())
        && characters.iter().all(|&code| code < 0x80)
    {
        bytes.iter_mut().zip(characters).for_each(|(byte, &code)| *byte = code as u8);
        return vm.outside.function(std::str::from_utf8(bytes).ok()?);
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
    let [_, _, detached] = exactly(arguments);
    let (function, data) = host_call(vm, arguments)?;
    let Some(function) = function.filter(|&function| vm.outside.is_operation(function)) else {
        return vm.exchange.raise(Raised::Cause("NOT-IN-THIS-WORLD", arguments[0]));
    };
    run::admit(vm, Measure::Operations)?;
    let number = vm.outside.operations.next_number();
    let handle = handle::make(&mut vm.heap, arguments[0], number, vm.names.known.pending)?;
    vm.scheduler.accounts.take(vm.scheduler.running_account(), Measure::Operations);
    let task = vm.scheduler.running_number();
    vm.outside.begin_operation(function, &data, handle, detached.is_true(), task);
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
