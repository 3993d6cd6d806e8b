//! Writing characters, strings and line ends.

use super::StreamKind;
use crate::builtins::expect::optional;
use crate::raise::Outcome;
use crate::value::Value;
use crate::vm::Vm;

/// `(write-char character &optional stream)`
pub(in crate::builtins) fn write_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(code) = arguments[0].as_character() else {
        return vm.exchange.type_error(arguments[0], "CHARACTER");
    };
    let (stream, kind) = vm.designated_stream(optional(arguments, 1), false)?;
    vm.write_characters(stream, kind, &[code])?;
    Ok(arguments[0])
}

/// `(%write-string string stream start end)`
pub(in crate::builtins) fn write_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let &[string, stream, start, end] = arguments else { unreachable!("the table says four") };
    let characters = vm.few_characters(string, start, end)?;
    let (stream, kind) = vm.designated_stream(stream, false)?;
    vm.write_characters(stream, kind, &characters)?;
    Ok(string)
}

/// `(terpri &optional stream)`
pub(in crate::builtins) fn terpri(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = vm.designated_stream(optional(arguments, 0), false)?;
    vm.write_characters(stream, kind, &[u32::from('\n')])?;
    Ok(Value::NIL)
}

/// `(fresh-line &optional stream)`
pub(in crate::builtins) fn fresh_line(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = vm.designated_stream(optional(arguments, 0), false)?;
    if vm.column_of(stream, kind) == 0 {
        return Ok(Value::NIL);
    }
    vm.write_characters(stream, kind, &[u32::from('\n')])?;
    Ok(Value::T)
}

/// `(finish-output &optional stream)`, `(force-output &optional stream)`
pub(in crate::builtins) fn finish_output(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = vm.designated_stream(optional(arguments, 0), false)?;
    match kind {
        StreamKind::StandardOutput => {
            vm.outside.flush();
            vm.check_output()?;
        }
        StreamKind::FileOutput => vm.write_out(stream)?,
        _ => {}
    }
    Ok(Value::NIL)
}
