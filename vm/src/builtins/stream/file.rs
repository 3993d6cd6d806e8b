//! Files of the host as a whole: their texts and bytes, whether they are there.

use esl_host::{Host, HostError, Right, WriteMode};

use crate::builtins::array::{ArrayElements, vector_elements};
use crate::builtins::expect::{exactly, optional};
use crate::builtins::rights::demand;
use crate::builtins::symbol::text_of;
use crate::exchange::Exchange;
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// Returns the right that is needed for the file of the first argument: to read it, as a module if the second
/// one is `T`, to write it if it is anything else.
pub(in crate::builtins) fn right_to(arguments: &[Value]) -> Right {
    match optional(arguments, 1) {
        Value::NIL => Right::Read,
        Value::T => Right::Module,
        _ => Right::Write,
    }
}

pub(in crate::builtins) fn file_text(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let permitted = demand(vm, right_to(arguments), &path)?;
    match vm.outside.host.read_file(&permitted) {
        Ok(bytes) => {
            vm.exchange.charge_elements(bytes.len());
            Ok(vm.heap.alloc_str(&String::from_utf8_lossy(&bytes))?)
        }
        Err(error) => file_error(&mut vm.exchange, "read", &path, &error),
    }
}

pub(in crate::builtins) fn file_bytes(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let permitted = demand(vm, Right::Read, &path)?;
    match vm.outside.host.read_file(&permitted) {
        Ok(bytes) => {
            vm.exchange.charge_elements(bytes.len());
            Ok(vm.heap.alloc_bytes(&bytes)?)
        }
        Err(error) => file_error(&mut vm.exchange, "read", &path, &error),
    }
}

/// Returns the mode of a number.
fn write_mode(mode: usize) -> WriteMode {
    match mode {
        0 => WriteMode::Replace,
        1 => WriteMode::Append,
        _ => WriteMode::Create,
    }
}

pub(in crate::builtins) fn write_bytes(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [path, vector, mode] = exactly(arguments);
    let Some(path) = text_of(&vm.heap, path) else { return vm.exchange.type_error(path, "STRING") };
    let mode = vm.exchange.index_below(mode, 3)?;
    let permitted = demand(vm, Right::Write, &path)?;
    let Some(ArrayElements::Bytes(bytes)) = vector_elements(&vm.heap, vector) else {
        return vm.exchange.not_written(vector, "(VECTOR (UNSIGNED-BYTE 8))");
    };
    let length = bytes.len();
    let written = vm.outside.host.write_file(&permitted, bytes, write_mode(mode));
    vm.exchange.charge_elements(length);
    match written {
        Ok(()) => Ok(Value::NIL),
        Err(error) => file_error(&mut vm.exchange, "written", &path, &error),
    }
}

pub(in crate::builtins) fn file_exists_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let permitted = demand(vm, right_to(arguments), &path)?;
    Ok(Value::boolean(vm.outside.host.file_exists(&permitted)))
}

pub(in crate::builtins) fn delete_file(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = text_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let permitted = demand(vm, Right::Write, &path)?;
    match vm.outside.host.delete_file(&permitted) {
        Ok(()) => Ok(Value::T),
        Err(error) => file_error(&mut vm.exchange, "deleted", &path, &error),
    }
}

pub(in crate::builtins) fn file_error<T>(
    exchange: &mut Exchange,
    what: &str,
    path: &str,
    error: &HostError,
) -> Result<T, Exit> {
    exchange.raise(Raised::File(path.into(), format!("it cannot be {what}: {error}")))
}
