//! What a program asks of the outside: its arguments, the time, and the embedder's functions.

use crate::datum;
use crate::raise::{Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// Seconds from the beginning of 1900 to that of 1970.
const UNIX_EPOCH: i64 = 2_208_988_800;

pub(super) fn command_line_arguments(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let mut strings = Vec::new();
    for argument in vm.outside.host.arguments() {
        strings.push(vm.heap.alloc_str(&argument)?);
    }
    Ok(vm.heap.list(&strings)?)
}

pub(super) fn now(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let seconds = vm.outside.host.monotonic() as f64 / 1e9;
    Ok(vm.heap.float(seconds)?)
}

pub(super) fn internal_real_time(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    // Nanoseconds are far below 2^61 for the next 70 years.
    Ok(Value::fixnum((vm.outside.host.monotonic() / 1000) as i64).unwrap_or(Value::NIL))
}

pub(super) fn universal_time(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let seconds = vm.outside.host.wall_clock().div_euclid(1_000_000_000);
    Ok(Value::fixnum(seconds.saturating_add(UNIX_EPOCH)).unwrap_or(Value::NIL))
}

pub(super) fn call_host(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let number = arguments[0].as_index().filter(|&number| number < vm.outside.functions.len());
    let Some(number) = number else {
        return vm.exchange.index_error(arguments[0], vm.outside.functions.len());
    };
    let mut data = Vec::with_capacity(arguments.len());
    for &argument in &arguments[1..] {
        match datum::export(&vm.heap, &vm.world, argument) {
            Ok((datum, work)) => {
                vm.exchange.charge(work);
                data.push(datum);
            }
            Err(error) => return vm.exchange.raise(Raised::Simple(error.to_string())),
        }
    }
    // The function has effects that cannot be done twice, so what it gives is kept until there is room for
    // it.
    let answer = match vm.outside.answer.take() {
        Some(answer) => answer,
        None => (vm.outside.functions[number])(&data),
    };
    match answer {
        Ok(datum) => match datum::import(&mut vm.heap, &mut vm.world, &datum) {
            Ok((value, work)) => {
                vm.exchange.charge(work);
                Ok(value)
            }
            Err(error) => {
                vm.outside.answer = Some(Ok(datum));
                Err(error.into())
            }
        },
        Err(text) => vm.exchange.raise(Raised::Simple(text)),
    }
}
