//! What a program asks of the outside: its arguments and the time.

use crate::raise::Outcome;
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
