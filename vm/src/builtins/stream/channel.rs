//! Channels: streams that functions of the library read from and write to, as for sockets.
//!
//! A channel has the characters that were supplied and not read yet, and a string stream that gathers what is
//! written. A builtin that needs the functions returns [`Exit::Slowly`]: its twin has more
//! supplied, or writes what was gathered, and calls the builtin again.

use crate::builtins::COPY_LIMIT;
use crate::builtins::expect::exactly;
use crate::heap::Heap;
use crate::names::stream::{StreamKind, make_stream, slot};
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::{BLOCK, FIRST_BUFFER, StreamUse, set_stream_slot, stream_index, stream_slot};

/// Returns whether more may be supplied to a stream.
pub(super) fn may_go_on(heap: &Heap, stream: Value, kind: StreamKind) -> bool {
    kind == StreamKind::Channel && stream_index(heap, stream, slot::BOUND) == 0
}

/// Returns whether a channel is for a use.
pub(super) fn is_for(heap: &Heap, channel: Value, purpose: StreamUse) -> bool {
    match stream_index(heap, channel, slot::FULL) {
        1 => purpose == StreamUse::Reading,
        2 => purpose == StreamUse::Writing,
        _ => true,
    }
}

/// Returns whether a string stream gathers the output of a channel.
pub(super) fn is_bounded(heap: &Heap, stream: Value) -> bool {
    stream_index(heap, stream, slot::BOUND) == 1
}

/// Returns the stream that gathers the output of a channel.
///
/// # Errors
/// [`Exit::Slowly`] if it has to be written first.
pub(super) fn output_to_write(vm: &mut Vm, channel: Value) -> Result<(Value, StreamKind), Exit> {
    let output = stream_slot(&vm.heap, channel, slot::OUTPUT);
    let gathered =
        stream_index(&vm.heap, output, slot::BEFORE) + stream_index(&vm.heap, output, slot::POSITION);
    if gathered >= BLOCK { Err(Exit::Slowly) } else { Ok((output, StreamKind::StringOutput)) }
}

fn expect_channel(vm: &mut Vm, v: Value) -> Result<Value, Exit> {
    match StreamKind::of(&vm.heap, v) {
        Some(StreamKind::Channel) => Ok(v),
        _ => vm.exchange.type_error(v, "STREAM"),
    }
}

/// `(%make-channel handler file direction)`
pub(in crate::builtins) fn make_channel(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [handler, file, direction] = exactly(arguments);
    let buffer = vm.heap.alloc_string_filled(FIRST_BUFFER, 0)?;
    let output = make_stream(&mut vm.heap, StreamKind::StringOutput, buffer, 0, 0)?;
    set_stream_slot(&mut vm.heap, output, slot::BOUND, Value::small(1));
    let empty = vm.heap.alloc_string(&[])?;
    let channel = make_stream(&mut vm.heap, StreamKind::Channel, empty, 0, 0)?;
    set_stream_slot(&mut vm.heap, channel, slot::HANDLER, handler);
    set_stream_slot(&mut vm.heap, channel, slot::OUTPUT, output);
    set_stream_slot(&mut vm.heap, channel, slot::FILE, file);
    set_stream_slot(&mut vm.heap, channel, slot::FULL, direction);
    Ok(channel)
}

/// `(%channel-handler object)`
pub(in crate::builtins) fn channel_handler(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match StreamKind::of(&vm.heap, arguments[0]) {
        Some(StreamKind::Channel) => Ok(stream_slot(&vm.heap, arguments[0], slot::HANDLER)),
        _ => Ok(Value::NIL),
    }
}

/// `(%channel-output channel)`
pub(in crate::builtins) fn channel_output(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let channel = expect_channel(vm, arguments[0])?;
    Ok(stream_slot(&vm.heap, channel, slot::OUTPUT))
}

/// `(%channel-state channel)`
pub(in crate::builtins) fn channel_state(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let channel = expect_channel(vm, arguments[0])?;
    let (start, end) =
        (stream_index(&vm.heap, channel, slot::POSITION), stream_index(&vm.heap, channel, slot::END));
    let buffer = stream_slot(&vm.heap, channel, slot::BUFFER);
    let rest = vm.heap.string(buffer).and_then(|all| all.get(start..end)).unwrap_or_default();
    let has_line = rest.iter().take(COPY_LIMIT).any(|&code| code == u32::from('\n'));
    let count = rest.len();
    vm.exchange.charge_elements(count.min(COPY_LIMIT));
    let is_at_end = !may_go_on(&vm.heap, channel, StreamKind::Channel);
    vm.give_values(&[Value::index(count), Value::boolean(has_line), Value::boolean(is_at_end)])
}

/// `(%supply-channel channel text)`
pub(in crate::builtins) fn supply_channel(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [channel, text] = exactly(arguments);
    let channel = expect_channel(vm, channel)?;
    if text.is_nil() {
        set_stream_slot(&mut vm.heap, channel, slot::BOUND, Value::small(1));
        return Ok(Value::NIL);
    }
    let Some(more) = vm.heap.string(text) else { return vm.exchange.type_error(text, "SIMPLE-STRING") };
    let (start, end) =
        (stream_index(&vm.heap, channel, slot::POSITION), stream_index(&vm.heap, channel, slot::END));
    let buffer = stream_slot(&vm.heap, channel, slot::BUFFER);
    // The character before the first unread one stays, so that it can be put back.
    let kept = start.saturating_sub(1);
    let mut all = vm.heap.string(buffer).and_then(|all| all.get(kept..end)).unwrap_or_default().to_vec();
    all.extend_from_slice(more);
    vm.exchange.charge_elements(all.len());
    let (position, length) = (start - kept, all.len());
    let before = stream_index(&vm.heap, channel, slot::BEFORE) + kept;
    let buffer = vm.heap.alloc_string(&all)?;
    set_stream_slot(&mut vm.heap, channel, slot::BUFFER, buffer);
    set_stream_slot(&mut vm.heap, channel, slot::POSITION, Value::index(position));
    set_stream_slot(&mut vm.heap, channel, slot::END, Value::index(length));
    set_stream_slot(&mut vm.heap, channel, slot::BEFORE, Value::index(before));
    set_stream_slot(&mut vm.heap, channel, slot::BOUND, Value::small(0));
    Ok(Value::T)
}
