//! Streams: the standard ones, those that read from or write to a string, and channels, for which functions
//! of the library read and write, such as those of files and sockets.
//!
//! A Stream is a record ([`crate::names::stream`]). The operations of a custom stream are in ESL: its
//! builtins leave it to their twins. Output to a string is gathered in strings that never grow, so that the
//! millionth character takes as long as the first. Every output stream knows its column.

use esl_host::machine::{Taken, column_after, encode};
use esl_host::{Host, Output};

use crate::builtins::COPY_LIMIT;
use crate::builtins::array::{ArrayElements, vector_elements};
use crate::builtins::expect::{exactly, optional};
use crate::builtins::symbol::text_between;
use crate::equality::characters_of;
use crate::exchange::Exchange;
use crate::heap::{Heap, Kind};
use crate::names::stream::{StreamKind, make_stream, slot};
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::run;
use crate::schedule::Parking;
use crate::task::TaskEnd;
use crate::value::Value;
use crate::vm::Vm;

mod channel;
mod file;
mod read;
mod text;
mod write;

pub(super) use channel::{channel_handler, channel_output, channel_state, make_channel, supply_channel};
pub(super) use file::{delete_file, file_bytes, file_error, file_exists_p, file_text, right_to, write_bytes};
pub(super) use read::{line_piece, listen, peek_char, read_char, read_char_no_hang, read_line, unread_char};
pub(super) use text::{
    gathered_length, get_output_stream_string, make_string_input, make_string_output, read_from_copy,
    set_string_input_position, string_input_position, take_gathered,
};
pub(super) use write::{finish_output, fresh_line, terpri, write_char, write_string};

/// Characters that a channel gathers before its function has to write them.
const BLOCK: usize = 1 << 15;
/// Characters that a string stream gathers in one string, but for what is written at once.
const GATHERED: usize = 1 << 13;
/// Characters that `peek-char` skips at once.
const SKIP_LIMIT: usize = 1 << 14;
/// Characters of the first buffer of a string stream.
const FIRST_BUFFER: usize = 24;

/// The beginning of what a stream has to read.
pub(crate) struct StreamSource {
    /// The text.
    pub(crate) text: String,
    /// The text after it.
    pub(crate) then: Then,
    /// Whether the stream is standard input.
    pub(crate) is_console: bool,
}

/// The continuation of the beginning of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Then {
    /// Nothing.
    End,
    /// More of the text.
    Rest,
    /// Input that is still to come.
    Input,
}

/// The direction in which a stream is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum StreamUse {
    Reading,
    Writing,
}

/// Returns whether a stream is for a use.
fn is_for(heap: &Heap, stream: Value, kind: StreamKind, purpose: StreamUse) -> bool {
    match purpose {
        _ if kind == StreamKind::Channel => channel::is_for(heap, stream, purpose),
        StreamUse::Reading => kind.is_input(),
        StreamUse::Writing => kind.is_output(),
    }
}

fn stream_slot(heap: &Heap, stream: Value, index: usize) -> Value {
    heap.record(stream, Kind::Stream).map_or(Value::NIL, |slots| slots[index])
}

fn stream_index(heap: &Heap, stream: Value, index: usize) -> usize {
    stream_slot(heap, stream, index).as_index().unwrap_or(0)
}

fn set_stream_slot(heap: &mut Heap, stream: Value, index: usize, value: Value) {
    heap.record_set(stream, Kind::Stream, index, value);
}

/// Returns the open stream that `v` designates for reading or writing: `NIL` is the standard one, `T` the
/// terminal.
fn designated_stream(vm: &mut Vm, v: Value, is_input: bool) -> Result<(Value, StreamKind), Exit> {
    let known = vm.names.known;
    let [input, output, _] = vm.names.streams;
    let (variable, terminal) =
        if is_input { (known.standard_input, input) } else { (known.standard_output, output) };
    let stream = match v {
        Value::NIL => vm.symbol_value(variable).unwrap_or(Value::NIL),
        Value::T => terminal,
        v => v,
    };
    let Some(kind) = StreamKind::of(&vm.heap, stream) else {
        let expected = Expected::Type("STREAM");
        return vm.exchange.raise(match v {
            Value::NIL => Raised::Variable(variable, stream, expected),
            _ => Raised::Type(stream, expected),
        });
    };
    let purpose = if is_input { StreamUse::Reading } else { StreamUse::Writing };
    if kind != StreamKind::Custom && !is_for(&vm.heap, stream, kind, purpose) {
        let text = if is_input { "it is not open for reading" } else { "it is not open for writing" };
        return vm.exchange.raise(Raised::Stream(stream, text.into()));
    }
    if stream_slot(&vm.heap, stream, slot::OPEN).is_nil() {
        return vm.exchange.raise(Raised::Stream(stream, "it is closed".into()));
    }
    if kind == StreamKind::Custom {
        return Err(Exit::Slowly);
    }
    if kind == StreamKind::Channel && !is_input {
        return channel::output_to_write(vm, stream);
    }
    Ok((stream, kind))
}

/// Returns what was taken from standard input; `None` at the end.
fn input_of<T>(vm: &mut Vm, taken: Taken<T>) -> Result<Option<T>, Exit> {
    match taken {
        Taken::Next(value) => Ok(Some(value)),
        Taken::End => Ok(None),
        // The builtin is done again when the task is woken.
        Taken::WouldBlock => Err(Exit::Park),
        Taken::Failed(error) => {
            let stream = vm.names.streams[0];
            vm.exchange.raise(Raised::Stream(stream, format!("it cannot be read: {error}")))
        }
    }
}

fn next_character(vm: &mut Vm, stream: Value, kind: StreamKind) -> Result<Option<u32>, Exit> {
    if kind == StreamKind::StandardInput {
        let taken = vm.outside.console.read(&mut vm.outside.host);
        return input_of(vm, taken);
    }
    let position = stream_index(&vm.heap, stream, slot::POSITION);
    if position >= stream_index(&vm.heap, stream, slot::END) {
        return if channel::may_go_on(&vm.heap, stream, kind) { Err(Exit::Slowly) } else { Ok(None) };
    }
    let buffer = stream_slot(&vm.heap, stream, slot::BUFFER);
    let character = vm.heap.string(buffer).and_then(|characters| characters.get(position)).copied();
    set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::index(position + 1));
    Ok(character)
}

fn give_back(vm: &mut Vm, stream: Value, kind: StreamKind, character: u32) {
    if kind == StreamKind::StandardInput {
        vm.outside.console.unread(character);
        return;
    }
    let position = stream_index(&vm.heap, stream, slot::POSITION);
    set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::index(position.saturating_sub(1)));
}

/// Returns the result of reading at the end: the value given for it, or a failure.
fn at_end(exchange: &mut Exchange, stream: Value, arguments: &[Value], first: usize) -> Outcome {
    let is_error = arguments.get(first).is_none_or(|v| v.is_true());
    if is_error { exchange.raise(Raised::EndOfFile(stream)) } else { Ok(optional(arguments, first + 1)) }
}

/// Writes characters to the stream that `stream` designates.
pub(super) fn write_part(vm: &mut Vm, stream: Value, characters: &[u32]) -> Result<(), Exit> {
    let (stream, kind) = designated_stream(vm, stream, false)?;
    write_characters(vm, stream, kind, characters)
}

/// Writes characters to an open output stream.
fn write_characters(vm: &mut Vm, stream: Value, kind: StreamKind, characters: &[u32]) -> Result<(), Exit> {
    vm.exchange.charge_elements(characters.len());
    match kind {
        StreamKind::StandardOutput => {
            await_room(vm, Output::Standard)?;
            vm.outside.console.write(&mut vm.outside.host, Output::Standard, characters);
            check_output(vm)
        }
        StreamKind::StandardError => {
            await_room(vm, Output::Error)?;
            vm.outside.console.write(&mut vm.outside.host, Output::Error, characters);
            Ok(())
        }
        _ => {
            let end = gather(vm, stream, kind, characters)?;
            let column = column_after(stream_index(&vm.heap, stream, slot::COLUMN), characters);
            set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::index(end));
            set_stream_slot(&mut vm.heap, stream, slot::COLUMN, Value::index(column));
            Ok(())
        }
    }
}

/// Puts characters behind those in the buffer of a stream; where the next will go.
fn gather(vm: &mut Vm, stream: Value, kind: StreamKind, characters: &[u32]) -> Result<usize, Exit> {
    let position = stream_index(&vm.heap, stream, slot::POSITION);
    let buffer = stream_slot(&vm.heap, stream, slot::BUFFER);
    let capacity = vm.heap.string(buffer).map_or(0, <[u32]>::len);
    let end = position + characters.len();
    if end <= capacity {
        if let Some(room) = vm.heap.string_mut(buffer).and_then(|all| all.get_mut(position..end)) {
            room.copy_from_slice(characters);
        }
        return Ok(end);
    }
    let (now, rest) = characters.split_at((capacity - position).min(characters.len()));
    if kind == StreamKind::StringOutput && end > GATHERED {
        // The buffer is filled up, and another one goes on.
        let next = vm.heap.alloc_string_filled(rest.len().max(GATHERED), 0)?;
        let full = vm.heap.cons(buffer, stream_slot(&vm.heap, stream, slot::FULL))?;
        if let Some(room) = vm.heap.string_mut(buffer) {
            room[position..].copy_from_slice(now);
        }
        if let Some(room) = vm.heap.string_mut(next) {
            room[..rest.len()].copy_from_slice(rest);
        }
        let before = stream_index(&vm.heap, stream, slot::BEFORE) + capacity;
        set_stream_slot(&mut vm.heap, stream, slot::BUFFER, next);
        set_stream_slot(&mut vm.heap, stream, slot::FULL, full);
        set_stream_slot(&mut vm.heap, stream, slot::BEFORE, Value::index(before));
        vm.exchange.charge_elements(GATHERED);
        return Ok(rest.len());
    }
    let larger = vm.heap.alloc_string_filled(end.max(capacity * 2).max(FIRST_BUFFER), 0)?;
    let gathered = vm.heap.string(buffer).map_or(Vec::new(), |all| all[..position].to_vec());
    if let Some(room) = vm.heap.string_mut(larger) {
        room[..position].copy_from_slice(&gathered);
        room[position..end].copy_from_slice(characters);
    }
    set_stream_slot(&mut vm.heap, stream, slot::BUFFER, larger);
    vm.exchange.charge_elements(position);
    Ok(end)
}

/// Has the running task wait until a standard stream has room. A task that must not wait writes what there is
/// before, however long that takes.
///
/// # Errors
/// [`Exit::Park`] while there is no room.
fn await_room(vm: &mut Vm, output: Output) -> Result<(), Exit> {
    if vm.outside.console.has_room(&mut vm.outside.host, output) {
        return Ok(());
    }
    if vm.scheduler.task().critical > 0 {
        vm.outside.flush();
        return Ok(());
    }
    park_for_output(vm)
}

/// Parks the running task until there is room for output; the instruction is done again then.
fn park_for_output<T>(vm: &mut Vm) -> Result<T, Exit> {
    vm.scheduler.turn.parking = Parking::Output;
    Err(Exit::Park)
}

/// Writes what standard output and standard error have gathered, and waits until that is done.
///
/// # Errors
/// [`Exit::Park`] while there is no room.
fn finish_standard(vm: &mut Vm) -> Result<(), Exit> {
    if vm.scheduler.task().critical > 0 {
        vm.outside.flush();
    } else {
        vm.outside.pass_on();
        if vm.outside.console.is_behind() {
            return park_for_output(vm);
        }
    }
    Ok(())
}

/// Checks whether standard output could be written: if not, the program fails, or if the pipe is closed, the
/// run ends.
fn check_output(vm: &mut Vm) -> Result<(), Exit> {
    if vm.outside.console.is_broken() {
        if vm.outside.exit_status.is_some() {
            // The run ends already; its cleanups may go on writing.
            return Ok(());
        }
        vm.outside.exit_status = Some(vm.outside.host.broken_output_status());
        run::abort_others(vm);
        vm.scheduler.task_mut().begin_end(TaskEnd::Aborted);
        return Err(Exit::Unwind);
    }
    match vm.outside.console.take_failure() {
        None => Ok(()),
        Some(error) => {
            let stream = vm.names.streams[1];
            vm.exchange.raise(Raised::Stream(stream, format!("it cannot be written: {error}")))
        }
    }
}

fn column_of(vm: &Vm, stream: Value, kind: StreamKind) -> usize {
    match kind {
        StreamKind::StandardOutput => vm.outside.console.column(Output::Standard),
        StreamKind::StandardError => vm.outside.console.column(Output::Error),
        _ => stream_index(&vm.heap, stream, slot::COLUMN),
    }
}

/// As [`Vm::characters`], unless they are too many for one step.
pub(super) fn few_characters(vm: &mut Vm, v: Value, start: Value, end: Value) -> Result<Vec<u32>, Exit> {
    let length = characters_of(&vm.heap, v).map_or(0, <[u32]>::len);
    if length > COPY_LIMIT {
        let (start, end) = vm.exchange.bounds(start, end, length)?;
        if end - start > COPY_LIMIT {
            return Err(Exit::Slowly);
        }
    }
    characters(vm, v, start, end)
}

/// Returns the characters of a string, also of one with a fill pointer, from `start` to before `end`.
pub(crate) fn characters(vm: &mut Vm, v: Value, start: Value, end: Value) -> Result<Vec<u32>, Exit> {
    let Some(length) = characters_of(&vm.heap, v).map(<[u32]>::len) else {
        return vm.exchange.type_error(v, "STRING");
    };
    let (start, end) = vm.exchange.bounds(start, end, length)?;
    Ok(characters_of(&vm.heap, v).map_or(Vec::new(), |characters| characters[start..end].to_vec()))
}

/// Returns what a stream has to read, up to `limit` characters.
///
/// # Errors
/// A failure if it is not an open input stream.
pub(crate) fn source(vm: &mut Vm, stream: Value, limit: usize) -> Result<StreamSource, Exit> {
    let (stream, kind) = designated_stream(vm, stream, true)?;
    if kind == StreamKind::StandardInput {
        let console = &vm.outside.console;
        let then = match console.is_at_end() {
            _ if console.pending() > limit => Then::Rest,
            true => Then::End,
            false => Then::Input,
        };
        return Ok(StreamSource { text: console.first_pending(limit), then, is_console: true });
    }
    let (start, end) =
        (stream_index(&vm.heap, stream, slot::POSITION), stream_index(&vm.heap, stream, slot::END));
    let limit = end.min(start.saturating_add(limit));
    let text = text_between(&vm.heap, stream_slot(&vm.heap, stream, slot::BUFFER), start, limit);
    let then = match channel::may_go_on(&vm.heap, stream, kind) {
        _ if limit < end => Then::Rest,
        true => Then::Input,
        false => Then::End,
    };
    Ok(StreamSource { text, then, is_console: false })
}

/// Takes so many characters from a stream of which `source` was the beginning.
pub(crate) fn skip_source(vm: &mut Vm, stream: Value, source: &StreamSource, characters: usize) {
    if source.is_console {
        vm.outside.console.skip(characters);
    } else if let Ok((stream, _)) = designated_stream(vm, stream, true) {
        let position = stream_index(&vm.heap, stream, slot::POSITION) + characters;
        set_stream_slot(&mut vm.heap, stream, slot::POSITION, Value::index(position));
    }
}

/// Waits for more of standard input.
///
/// # Errors
/// [`Exit::Park`] if there is none yet, or a failure.
pub(crate) fn more_input(vm: &mut Vm) -> Result<(), Exit> {
    let taken = vm.outside.console.fill(&mut vm.outside.host);
    input_of(vm, taken).map(|_| ())
}

// ---- making and closing

pub(super) fn standard_stream(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let index = vm.exchange.index_below(arguments[0], 3)?;
    Ok(vm.names.streams[index])
}

pub(super) fn close(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [stream] = exactly(arguments);
    let Some(kind) = StreamKind::of(&vm.heap, stream) else {
        return vm.exchange.type_error(stream, "STREAM");
    };
    if stream_slot(&vm.heap, stream, slot::OPEN).is_nil() {
        return Ok(Value::NIL);
    }
    match kind {
        StreamKind::StandardInput | StreamKind::StandardOutput | StreamKind::StandardError => {
            finish_standard(vm)?;
            return Ok(Value::T);
        }
        _ => set_stream_slot(&mut vm.heap, stream, slot::OPEN, Value::NIL),
    }
    Ok(Value::T)
}

pub(super) fn bytes_of_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(characters) = characters_of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STRING");
    };
    let mut bytes = Vec::new();
    if optional(arguments, 1).is_true() {
        encode(characters, &mut bytes);
    } else if let Some(&code) = characters.iter().find(|&&code| code > 0xFF) {
        return vm.exchange.not_written(Value::small(code.cast_signed()), "(UNSIGNED-BYTE 8)");
    } else {
        bytes.extend(characters.iter().map(|&code| code as u8));
    }
    vm.exchange.charge_elements(bytes.len());
    Ok(vm.heap.alloc_bytes(&bytes)?)
}

pub(super) fn string_of_bytes(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(ArrayElements::Bytes(bytes)) = vector_elements(&vm.heap, arguments[0]) else {
        return vm.exchange.not_written(arguments[0], "(VECTOR (UNSIGNED-BYTE 8))");
    };
    let characters: Vec<u32> = if optional(arguments, 1).is_true() {
        String::from_utf8_lossy(bytes).chars().map(u32::from).collect()
    } else {
        bytes.iter().map(|&byte| u32::from(byte)).collect()
    };
    vm.exchange.charge_elements(characters.len());
    Ok(vm.heap.alloc_string(&characters)?)
}

pub(super) fn make_custom_stream(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(make_stream(&mut vm.heap, StreamKind::Custom, arguments[0], 0, 0)?)
}

pub(super) fn custom_stream_data(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(match StreamKind::of(&vm.heap, arguments[0]) {
        Some(StreamKind::Custom) => stream_slot(&vm.heap, arguments[0], slot::BUFFER),
        _ => Value::NIL,
    })
}

// ---- asking

pub(super) fn streamp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(StreamKind::of(&vm.heap, arguments[0]).is_some()))
}

pub(super) fn input_stream_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match StreamKind::of(&vm.heap, arguments[0]) {
        Some(StreamKind::Custom) => Err(Exit::Slowly),
        Some(kind) => Ok(Value::boolean(is_for(&vm.heap, arguments[0], kind, StreamUse::Reading))),
        None => vm.exchange.type_error(arguments[0], "STREAM"),
    }
}

pub(super) fn output_stream_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match StreamKind::of(&vm.heap, arguments[0]) {
        Some(StreamKind::Custom) => Err(Exit::Slowly),
        Some(kind) => Ok(Value::boolean(is_for(&vm.heap, arguments[0], kind, StreamUse::Writing))),
        None => vm.exchange.type_error(arguments[0], "STREAM"),
    }
}

pub(super) fn open_stream_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match StreamKind::of(&vm.heap, arguments[0]) {
        Some(_) => Ok(stream_slot(&vm.heap, arguments[0], slot::OPEN)),
        None => vm.exchange.type_error(arguments[0], "STREAM"),
    }
}

pub(super) fn stream_sort(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(kind) = StreamKind::of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STREAM");
    };
    let name = stream_slot(&vm.heap, arguments[0], slot::FILE);
    let kind = match kind {
        StreamKind::StandardInput | StreamKind::StandardOutput | StreamKind::StandardError => "STANDARD",
        StreamKind::Custom => "CUSTOM",
        StreamKind::StringInput | StreamKind::StringOutput => "STRING",
        StreamKind::Channel if name.is_nil() => "CHANNEL",
        StreamKind::Channel => "FILE",
    };
    let kind = vm.names.keyword(&mut vm.heap, kind)?;
    vm.give_values(&[kind, name])
}

pub(super) fn stream_column(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = designated_stream(vm, arguments[0], false)?;
    Ok(Value::index(column_of(vm, stream, kind)))
}
