//! Calls of functions that are values, and multiple values.

use crate::interp::arguments::MAX_SPREAD;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

/// The largest number of values of a form.
const MAX_VALUES: usize = 4096;

pub(super) fn funcall(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.exchange.request_call(arguments[0], &arguments[1..]);
    Err(Exit::Call)
}

pub(super) fn apply(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (&list, given) = arguments[1..].split_last().expect("the table asks for two arguments");
    let (mut spread, mut rest) = (given.to_vec(), list);
    while let Some(pair) = vm.heap.as_cons(rest) {
        if spread.len() == MAX_SPREAD {
            return vm.exchange.program_error(format!("more than {MAX_SPREAD} arguments"));
        }
        spread.push(pair.car);
        rest = pair.cdr;
    }
    if rest.is_true() {
        return vm.exchange.type_error(rest, "LIST");
    }
    vm.exchange.charge(spread.len());
    vm.exchange.request_call(arguments[0], &spread);
    Err(Exit::Call)
}

pub(super) fn values(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.exchange.values.clear();
    vm.exchange.values.extend_from_slice(arguments);
    Err(Exit::Values)
}

pub(super) fn values_list(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let mut rest = arguments[0];
    vm.exchange.values.clear();
    while let Some(pair) = vm.heap.as_cons(rest) {
        if vm.exchange.values.len() == MAX_VALUES {
            return vm.exchange.program_error(format!("more than {MAX_VALUES} values"));
        }
        vm.exchange.values.push(pair.car);
        rest = pair.cdr;
    }
    if rest.is_true() {
        return vm.exchange.type_error(rest, "LIST");
    }
    vm.exchange.charge(vm.exchange.values.len());
    Err(Exit::Values)
}

pub(super) fn identity(_vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(arguments[0])
}
