//! Streams that read from strings, and those that gather strings.

use smallvec::SmallVec;

use crate::builtins::expect::{exactly, optional};
use crate::builtins::list::list_items;
use crate::builtins::{COPY_LIMIT, LIMIT};
use crate::names::stream::{StreamKind, make_stream, slot};
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::{FIRST_BUFFER, designated_stream, few_characters, set_stream_slot, stream_index, stream_slot};

pub(in crate::builtins) fn make_string_input(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, start, end] = exactly(arguments);
    let characters = few_characters(vm, string, start, end)?;
    vm.exchange.charge_elements(characters.len());
    let buffer = vm.heap.alloc_string(&characters)?;
    Ok(make_stream(&mut vm.heap, StreamKind::StringInput, buffer, 0, characters.len())?)
}

pub(in crate::builtins) fn read_from_copy(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(length) = vm.heap.string(arguments[0]).map(<[u32]>::len) else {
        return vm.exchange.type_error(arguments[0], "SIMPLE-STRING");
    };
    Ok(make_stream(&mut vm.heap, StreamKind::StringInput, arguments[0], 0, length)?)
}

pub(in crate::builtins) fn string_input_position(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, arguments[0], true)?;
    let position = stream_index(&vm.heap, stream, slot::POSITION);
    if optional(arguments, 1).is_true() {
        let end = stream_index(&vm.heap, stream, slot::END);
        let buffer = stream_slot(&vm.heap, stream, slot::BUFFER);
        let rest = vm.heap.string(buffer).and_then(|all| all.get(position..end)).unwrap_or_default();
        let bytes = rest.iter().map(|&code| char::from_u32(code).map_or(3, char::len_utf8)).sum();
        vm.exchange.charge_elements(rest.len());
        return Ok(Value::index(bytes));
    }
    let before = match kind {
        StreamKind::Channel => stream_index(&vm.heap, stream, slot::BEFORE),
        _ => 0,
    };
    Ok(Value::index(before + position))
}

pub(in crate::builtins) fn set_string_input_position(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, arguments[0], true)?;
    let end = stream_index(&vm.heap, stream, slot::END);
    let position = if arguments[1].is_true() { arguments[1].as_index() } else { Some(end) };
    match position {
        Some(position) if kind == StreamKind::StringInput && position <= end => {
            set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::index(position));
            Ok(Value::T)
        }
        _ => Ok(Value::NIL),
    }
}

pub(in crate::builtins) fn make_string_output(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let buffer = vm.heap.alloc_string_filled(FIRST_BUFFER, 0)?;
    Ok(make_stream(&mut vm.heap, StreamKind::StringOutput, buffer, 0, 0)?)
}

pub(in crate::builtins) fn get_output_stream_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = arguments[0];
    if StreamKind::of(&vm.heap, stream) != Some(StreamKind::StringOutput) {
        return vm.exchange.type_error(stream, "STRING-STREAM");
    }
    let position = stream_index(&vm.heap, stream, slot::POSITION);
    let length = stream_index(&vm.heap, stream, slot::BEFORE) + position;
    if length > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let full = list_items(vm, stream_slot(&vm.heap, stream, slot::FULL), LIMIT)?;
    let mut gathered: SmallVec<[u32; 64]> = SmallVec::with_capacity(length);
    for &string in full.iter().rev() {
        gathered.extend_from_slice(vm.heap.string(string).unwrap_or_default());
    }
    let buffer = stream_slot(&vm.heap, stream, slot::BUFFER);
    gathered.extend_from_slice(vm.heap.string(buffer).map_or(&[], |all| &all[..position]));
    vm.exchange.charge_elements(length);
    let text = vm.heap.alloc_string(&gathered)?;
    set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::small(0));
    set_stream_slot(&mut vm.heap, stream, slot::FULL, Value::NIL);
    set_stream_slot(&mut vm.heap, stream, slot::BEFORE, Value::small(0));
    Ok(text)
}

pub(in crate::builtins) fn gathered_length(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = arguments[0];
    if StreamKind::of(&vm.heap, stream) != Some(StreamKind::StringOutput) {
        return vm.exchange.type_error(stream, "STRING-STREAM");
    }
    Ok(Value::index(
        stream_index(&vm.heap, stream, slot::BEFORE) + stream_index(&vm.heap, stream, slot::POSITION),
    ))
}

pub(in crate::builtins) fn take_gathered(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = arguments[0];
    if gathered_length(vm, arguments)? != arguments[1] {
        return Ok(Value::NIL);
    }
    let fresh = vm.heap.alloc_string_filled(FIRST_BUFFER, 0)?;
    let last = stream_slot(&vm.heap, stream, slot::BUFFER);
    let strings = vm.heap.cons(last, stream_slot(&vm.heap, stream, slot::FULL))?;
    set_stream_slot(&mut vm.heap, stream, slot::BUFFER, fresh);
    set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::small(0));
    set_stream_slot(&mut vm.heap, stream, slot::FULL, Value::NIL);
    set_stream_slot(&mut vm.heap, stream, slot::BEFORE, Value::small(0));
    Ok(strings)
}
