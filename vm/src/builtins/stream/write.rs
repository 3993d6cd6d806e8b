//! Writing characters, strings and line ends.

use crate::builtins::expect::optional;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::{
    StreamKind, channel, check_output, column_of, designated_stream, few_characters, finish_standard,
    write_characters,
};

/// `(write-char character &optional stream)`
pub(in crate::builtins) fn write_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(code) = arguments[0].as_character() else {
        return vm.exchange.type_error(arguments[0], "CHARACTER");
    };
    let (stream, kind) = designated_stream(vm, optional(arguments, 1), false)?;
    write_characters(vm, stream, kind, &[code])?;
    Ok(arguments[0])
}

/// `(%write-string string stream start end)`
pub(in crate::builtins) fn write_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let &[string, stream, start, end] = arguments else { unreachable!("the table says four") };
    let characters = few_characters(vm, string, start, end)?;
    let (stream, kind) = designated_stream(vm, stream, false)?;
    write_characters(vm, stream, kind, &characters)?;
    Ok(string)
}

/// `(terpri &optional stream)`
pub(in crate::builtins) fn terpri(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, optional(arguments, 0), false)?;
    write_characters(vm, stream, kind, &[u32::from('\n')])?;
    Ok(Value::NIL)
}

/// `(fresh-line &optional stream)`
pub(in crate::builtins) fn fresh_line(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, optional(arguments, 0), false)?;
    if column_of(vm, stream, kind) == 0 {
        return Ok(Value::NIL);
    }
    write_characters(vm, stream, kind, &[u32::from('\n')])?;
    Ok(Value::T)
}

/// `(finish-output &optional stream)`, `(force-output &optional stream)`
pub(in crate::builtins) fn finish_output(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, optional(arguments, 0), false)?;
    match kind {
        StreamKind::StandardOutput => {
            finish_standard(vm)?;
            check_output(vm)?;
        }
        StreamKind::StandardError => finish_standard(vm)?,
        StreamKind::StringOutput if channel::is_bounded(&vm.heap, stream) => return Err(Exit::Slowly),
        _ => {}
    }
    Ok(Value::NIL)
}
