//! Reading characters and lines.

use crate::builtins::COPY_LIMIT;
use crate::builtins::expect::optional;
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::{
    SKIP_LIMIT, StreamKind, at_end, channel, designated_stream, give_back, input_of, next_character,
    set_stream_slot, slot, stream_index, stream_slot,
};

/// `(read-char &optional stream (eof-error-p t) eof-value recursive-p)`
pub(in crate::builtins) fn read_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, optional(arguments, 0), true)?;
    match next_character(vm, stream, kind)? {
        Some(code) => Ok(Value::character(code).unwrap_or(Value::NIL)),
        None => at_end(&mut vm.exchange, stream, arguments, 1),
    }
}

/// `(read-char-no-hang &optional stream (eof-error-p t) eof-value recursive-p)`
pub(in crate::builtins) fn read_char_no_hang(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match read_char(vm, arguments) {
        Err(Exit::Park) => Ok(Value::NIL),
        outcome => outcome,
    }
}

/// `(listen &optional stream)`
pub(in crate::builtins) fn listen(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, optional(arguments, 0), true)?;
    match next_character(vm, stream, kind) {
        Ok(Some(code)) => {
            give_back(vm, stream, kind, code);
            Ok(Value::T)
        }
        Ok(None) | Err(Exit::Park) => Ok(Value::NIL),
        Err(exit) => Err(exit),
    }
}

/// `(peek-char &optional peek-type stream (eof-error-p t) eof-value recursive-p)`
pub(in crate::builtins) fn peek_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let wanted = optional(arguments, 0);
    let (stream, kind) = designated_stream(vm, optional(arguments, 1), true)?;
    for _ in 0..SKIP_LIMIT {
        let Some(code) = next_character(vm, stream, kind)? else {
            return at_end(&mut vm.exchange, stream, arguments, 2);
        };
        let is_it = match wanted.as_character() {
            Some(wanted) => code == wanted,
            None => wanted.is_nil() || !char::from_u32(code).is_some_and(char::is_whitespace),
        };
        if is_it {
            give_back(vm, stream, kind, code);
            return Ok(Value::character(code).unwrap_or(Value::NIL));
        }
    }
    // Skipped characters stay skipped: the library's twin goes on from there.
    vm.exchange.charge_elements(SKIP_LIMIT);
    Err(Exit::Slowly)
}

/// `(unread-char character &optional stream)`
pub(in crate::builtins) fn unread_char(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(code) = arguments[0].as_character() else {
        return vm.exchange.type_error(arguments[0], "CHARACTER");
    };
    let (stream, kind) = designated_stream(vm, optional(arguments, 1), true)?;
    give_back(vm, stream, kind, code);
    Ok(Value::NIL)
}

/// `(read-line &optional stream (eof-error-p t) eof-value recursive-p)`
pub(in crate::builtins) fn read_line(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, optional(arguments, 0), true)?;
    let (line, is_cut) = if kind == StreamKind::StandardInput {
        let taken = vm.outside.console.await_line(&mut vm.outside.host, COPY_LIMIT);
        match input_of(vm, taken)? {
            Some(true) => {}
            Some(false) => return Err(Exit::Slowly),
            None => return end_of_line(vm, stream, arguments),
        }
        let (line, has_ended) = console_line(vm)?;
        (line, !has_ended)
    } else {
        let (start, end) =
            (stream_index(&vm.heap, stream, slot::POSITION), stream_index(&vm.heap, stream, slot::END));
        let is_open = channel::may_go_on(&vm.heap, stream, kind);
        if start >= end && !is_open {
            return end_of_line(vm, stream, arguments);
        }
        let buffer = stream_slot(&vm.heap, stream, slot::BUFFER);
        let rest = vm.heap.string(buffer).map_or(&[][..], |all| &all[start..end]);
        let length = rest.iter().take(COPY_LIMIT).position(|&c| c == u32::from('\n'));
        if length.is_none() && (is_open || rest.len() > COPY_LIMIT) {
            return Err(Exit::Slowly);
        }
        let line = rest[..length.unwrap_or(rest.len())].to_vec();
        vm.exchange.charge_elements(line.len());
        let text = vm.heap.alloc_string(&line)?;
        let next = start + line.len() + usize::from(length.is_some());
        set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::index(next));
        (text, length.is_none())
    };
    vm.give_values(&[line, Value::boolean(is_cut)])
}

/// Returns what has arrived of a line of standard input, at most [`COPY_LIMIT`] characters, as a string, and
/// whether the line has ended with it.
fn console_line(vm: &mut Vm) -> Result<(Value, bool), Exit> {
    let (line, has_ended) = vm.outside.console.take_line(COPY_LIMIT);
    vm.exchange.charge_elements(line.len());
    match vm.heap.alloc_string(&line) {
        Ok(text) => Ok((text, has_ended)),
        Err(error) => {
            // The builtin will be done again.
            vm.outside.console.unread_line(&line, has_ended);
            Err(error.into())
        }
    }
}

/// `(%line-piece stream)`
pub(in crate::builtins) fn line_piece(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, arguments[0], true)?;
    let (piece, has_ended, is_last) = if kind == StreamKind::StandardInput {
        // At most one character: whatever has arrived will do.
        let taken = vm.outside.console.await_line(&mut vm.outside.host, 1);
        let is_last = input_of(vm, taken)?.is_none();
        let (piece, has_ended) = console_line(vm)?;
        (piece, has_ended, is_last)
    } else {
        let (start, end) =
            (stream_index(&vm.heap, stream, slot::POSITION), stream_index(&vm.heap, stream, slot::END));
        let buffer = stream_slot(&vm.heap, stream, slot::BUFFER);
        let rest = vm.heap.string(buffer).and_then(|all| all.get(start..end)).unwrap_or_default();
        let piece = &rest[..rest.len().min(COPY_LIMIT)];
        let line_end = piece.iter().position(|&c| c == u32::from('\n'));
        let piece = piece[..line_end.unwrap_or(piece.len())].to_vec();
        let is_last = piece.is_empty() && line_end.is_none() && !channel::may_go_on(&vm.heap, stream, kind);
        vm.exchange.charge_elements(piece.len());
        let text = vm.heap.alloc_string(&piece)?;
        let next = start + piece.len() + usize::from(line_end.is_some());
        set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::index(next));
        (text, line_end.is_some(), is_last)
    };
    vm.give_values(&[piece, Value::boolean(has_ended), Value::boolean(is_last)])
}

fn end_of_line(vm: &mut Vm, stream: Value, arguments: &[Value]) -> Outcome {
    let value = at_end(&mut vm.exchange, stream, arguments, 1)?;
    vm.give_values(&[value, Value::T])
}
