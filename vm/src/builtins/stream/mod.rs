//! Streams: the standard ones, and those that read from or write to a string or a text file.
//!
//! A Stream is a record ([`crate::world::stream`]). A file is read as a whole when it is opened; output to a
//! file is gathered, and written in blocks and when the stream is closed. Output to a string is gathered in
//! strings that never grow, so that the millionth character takes as long as the first. Every output stream
//! knows its column.

use smallvec::SmallVec;

use crate::builtins::expect::optional;
use crate::builtins::{COPY_LIMIT, LIMIT};
use crate::equality::characters_of;
use crate::heap::Kind;
use crate::host::{HostError, Output, Taken, WriteMode, column_after, encode};
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::run;
use crate::task::End;
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;
use crate::world::stream::{StreamKind, make_stream, slot};

mod read;
mod write;

pub(super) use read::{listen, peek_char, read_char, read_char_no_hang, read_line, unread_char};
pub(super) use write::{finish_output, fresh_line, terpri, write_char, write_string};

/// Characters that a file's stream gathers before it writes them.
const BLOCK: usize = 1 << 15;
/// Characters that a string stream gathers in one string, but for what is written at once.
const GATHERED: usize = 1 << 13;
/// Characters that `peek-char` skips at once.
const SKIP_LIMIT: usize = 1 << 14;
/// Characters of the first buffer of a string stream.
const FIRST_BUFFER: usize = 24;

/// What a stream has to read from.
pub(crate) enum Source {
    /// The rest of a string or file.
    Text(String),
    /// Standard input.
    Console {
        /// What has come in.
        text: String,
        /// Whether nothing more will.
        is_at_end: bool,
    },
}

impl Vm {
    fn stream_slot(&self, stream: Value, index: usize) -> Value {
        self.heap.record(stream, Kind::Stream).map_or(Value::NIL, |slots| slots[index])
    }

    fn stream_index(&self, stream: Value, index: usize) -> usize {
        self.stream_slot(stream, index).as_index().unwrap_or(0)
    }

    fn set_stream_slot(&mut self, stream: Value, index: usize, value: Value) {
        self.heap.record_set(stream, Kind::Stream, index, value);
    }

    /// The open stream that `v` designates for reading or writing: `NIL` is the standard one, `T` the
    /// terminal.
    fn designated_stream(&mut self, v: Value, is_input: bool) -> Result<(Value, StreamKind), Exit> {
        let known = self.world.known;
        let [input, output, _] = self.world.streams;
        let (variable, terminal) =
            if is_input { (known.standard_input, input) } else { (known.standard_output, output) };
        let stream = match v {
            Value::NIL => self.symbol_value(variable).unwrap_or(Value::NIL),
            Value::T => terminal,
            v => v,
        };
        let Some(kind) = StreamKind::of(&self.heap, stream) else {
            let expected = Expected::Type("STREAM");
            return self.exchange.raise(match v {
                Value::NIL => Raised::Variable(variable, stream, expected),
                _ => Raised::Type(stream, expected),
            });
        };
        if kind.is_input() != is_input {
            let text = if is_input { "it is not open for reading" } else { "it is not open for writing" };
            return self.exchange.raise(Raised::Stream(stream, text.into()));
        }
        if self.stream_slot(stream, slot::OPEN).is_nil() {
            return self.exchange.raise(Raised::Stream(stream, "it is closed".into()));
        }
        Ok((stream, kind))
    }

    /// Gives the program what standard input has to say; `None` at the end.
    fn taken<T>(&mut self, taken: Taken<T>) -> Result<Option<T>, Exit> {
        match taken {
            Taken::Next(value) => Ok(Some(value)),
            Taken::End => Ok(None),
            // The builtin is done again when the task is woken.
            Taken::WouldBlock => Err(Exit::Park),
            Taken::Failed(error) => {
                let stream = self.world.streams[0];
                self.exchange.raise(Raised::Stream(stream, format!("it cannot be read: {error}")))
            }
        }
    }

    fn next_character(&mut self, stream: Value, kind: StreamKind) -> Result<Option<u32>, Exit> {
        if kind == StreamKind::StandardInput {
            let taken = self.outside.console.read(&mut *self.outside.host);
            return self.taken(taken);
        }
        let position = self.stream_index(stream, slot::POSITION);
        if position >= self.stream_index(stream, slot::END) {
            return Ok(None);
        }
        let buffer = self.stream_slot(stream, slot::BUFFER);
        let character = self.heap.string(buffer).and_then(|characters| characters.get(position)).copied();
        self.set_stream_slot(stream, slot::POSITION, Value::index(position + 1));
        Ok(character)
    }

    fn give_back(&mut self, stream: Value, kind: StreamKind, character: u32) {
        if kind == StreamKind::StandardInput {
            self.outside.console.unread(character);
            return;
        }
        let position = self.stream_index(stream, slot::POSITION);
        self.set_stream_slot(stream, slot::POSITION, Value::index(position.saturating_sub(1)));
    }

    /// What reading gives at the end: a failure, or the value given for it.
    fn at_end(&mut self, stream: Value, arguments: &[Value], first: usize) -> Outcome {
        let is_error = arguments.get(first).is_none_or(|v| v.is_true());
        if is_error {
            self.exchange.raise(Raised::EndOfFile(stream))
        } else {
            Ok(optional(arguments, first + 1))
        }
    }

    /// Writes characters to an open output stream.
    fn write_characters(&mut self, stream: Value, kind: StreamKind, characters: &[u32]) -> Result<(), Exit> {
        self.exchange.charge_elements(characters.len());
        match kind {
            StreamKind::StandardOutput => {
                self.outside.console.write(&mut *self.outside.host, Output::Standard, characters);
                self.check_output()
            }
            StreamKind::StandardError => {
                self.outside.console.write(&mut *self.outside.host, Output::Error, characters);
                Ok(())
            }
            _ => {
                let end = self.gather(stream, kind, characters)?;
                let column = column_after(self.stream_index(stream, slot::COLUMN), characters);
                self.set_stream_slot(stream, slot::POSITION, Value::index(end));
                self.set_stream_slot(stream, slot::COLUMN, Value::index(column));
                if kind == StreamKind::FileOutput && end >= BLOCK { self.write_out(stream) } else { Ok(()) }
            }
        }
    }

    /// Puts characters behind those in the buffer of a stream; where the next will go.
    fn gather(&mut self, stream: Value, kind: StreamKind, characters: &[u32]) -> Result<usize, Exit> {
        let position = self.stream_index(stream, slot::POSITION);
        let buffer = self.stream_slot(stream, slot::BUFFER);
        let capacity = self.heap.string(buffer).map_or(0, <[u32]>::len);
        let end = position + characters.len();
        if end <= capacity {
            if let Some(room) = self.heap.string_mut(buffer).and_then(|all| all.get_mut(position..end)) {
                room.copy_from_slice(characters);
            }
            return Ok(end);
        }
        let (now, rest) = characters.split_at((capacity - position).min(characters.len()));
        if kind == StreamKind::StringOutput && end > GATHERED {
            // The buffer is filled up, and another one goes on.
            let next = self.heap.alloc_string_filled(rest.len().max(GATHERED), 0)?;
            let full = self.heap.cons(buffer, self.stream_slot(stream, slot::FULL))?;
            if let Some(room) = self.heap.string_mut(buffer) {
                room[position..].copy_from_slice(now);
            }
            if let Some(room) = self.heap.string_mut(next) {
                room[..rest.len()].copy_from_slice(rest);
            }
            let before = self.stream_index(stream, slot::BEFORE) + capacity;
            self.set_stream_slot(stream, slot::BUFFER, next);
            self.set_stream_slot(stream, slot::FULL, full);
            self.set_stream_slot(stream, slot::BEFORE, Value::index(before));
            self.exchange.charge_elements(GATHERED);
            return Ok(rest.len());
        }
        let larger = self.heap.alloc_string_filled(end.max(capacity * 2).max(FIRST_BUFFER), 0)?;
        let gathered = self.heap.string(buffer).map_or(Vec::new(), |all| all[..position].to_vec());
        if let Some(room) = self.heap.string_mut(larger) {
            room[..position].copy_from_slice(&gathered);
            room[position..end].copy_from_slice(characters);
        }
        self.set_stream_slot(stream, slot::BUFFER, larger);
        self.exchange.charge_elements(position);
        Ok(end)
    }

    /// Writes what a file's stream has gathered.
    fn write_out(&mut self, stream: Value) -> Result<(), Exit> {
        let position = self.stream_index(stream, slot::POSITION);
        let buffer = self.stream_slot(stream, slot::BUFFER);
        let mut bytes = Vec::new();
        encode(self.heap.string(buffer).map_or(&[], |all| &all[..position]), &mut bytes);
        let mode = write_mode(self.stream_index(stream, slot::MODE));
        let name = self.text_of(self.stream_slot(stream, slot::NAME)).unwrap_or_default();
        // What cannot be written is not tried again: the next block would fail too, and closing has to
        // succeed.
        self.set_stream_slot(stream, slot::POSITION, Value::small(0));
        self.set_stream_slot(stream, slot::MODE, Value::small(1));
        match self.outside.host.write_file(&name, &bytes, mode) {
            Ok(()) => Ok(()),
            Err(error) => {
                self.exchange.raise(Raised::Stream(stream, format!("it cannot be written: {error}")))
            }
        }
    }

    /// What becomes of a program whose standard output could not be written: it fails, or if nobody reads it
    /// any more, the run ends.
    fn check_output(&mut self) -> Result<(), Exit> {
        if self.outside.console.is_broken() {
            if self.outside.exit_status.is_some() {
                // The run ends already; its cleanups may go on writing.
                return Ok(());
            }
            self.outside.exit_status = Some(self.outside.host.broken_output_status());
            run::abort_others(self);
            self.scheduler.task_mut().begin_end(End::Aborted);
            return Err(Exit::Unwind);
        }
        match self.outside.console.take_failure() {
            None => Ok(()),
            Some(error) => {
                let stream = self.world.streams[1];
                self.exchange.raise(Raised::Stream(stream, format!("it cannot be written: {error}")))
            }
        }
    }

    fn column_of(&self, stream: Value, kind: StreamKind) -> usize {
        match kind {
            StreamKind::StandardOutput => self.outside.console.column(Output::Standard),
            StreamKind::StandardError => self.outside.console.column(Output::Error),
            _ => self.stream_index(stream, slot::COLUMN),
        }
    }

    /// As [`Vm::characters`], unless they are too many for one step.
    fn few_characters(&mut self, v: Value, start: Value, end: Value) -> Result<Vec<u32>, Exit> {
        let length = characters_of(&self.heap, v).map_or(0, <[u32]>::len);
        if length > COPY_LIMIT {
            let (start, end) = self.bounds(start, end, length)?;
            if end - start > COPY_LIMIT {
                return Err(Exit::Slowly);
            }
        }
        self.characters(v, start, end)
    }

    /// The characters of a string, also of one with a fill pointer, from `start` to before `end`.
    pub(crate) fn characters(&mut self, v: Value, start: Value, end: Value) -> Result<Vec<u32>, Exit> {
        let Some(length) = characters_of(&self.heap, v).map(<[u32]>::len) else {
            return self.exchange.type_error(v, "STRING");
        };
        let (start, end) = self.bounds(start, end, length)?;
        Ok(characters_of(&self.heap, v).map_or(Vec::new(), |characters| characters[start..end].to_vec()))
    }

    /// What a stream has to read from.
    ///
    /// # Errors
    /// A failure if it is no open input stream.
    pub(crate) fn source(&mut self, stream: Value) -> Result<Source, Exit> {
        let (stream, kind) = self.designated_stream(stream, true)?;
        if kind == StreamKind::StandardInput {
            return Ok(Source::Console {
                text: self.outside.console.pending(),
                is_at_end: self.outside.console.is_at_end(),
            });
        }
        let (start, end) = (self.stream_index(stream, slot::POSITION), self.stream_index(stream, slot::END));
        let buffer = self.stream_slot(stream, slot::BUFFER);
        let rest = self.heap.string(buffer).and_then(|all| all.get(start..end)).unwrap_or(&[]);
        let text = |&code: &u32| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
        Ok(Source::Text(rest.iter().map(text).collect()))
    }

    /// Takes so many characters from a stream of which `source` was the rest.
    pub(crate) fn skip_source(&mut self, stream: Value, source: &Source, characters: usize) {
        if matches!(source, Source::Console { .. }) {
            self.outside.console.skip(characters);
        } else if let Ok((stream, _)) = self.designated_stream(stream, true) {
            let position = self.stream_index(stream, slot::POSITION) + characters;
            self.set_stream_slot(stream, slot::POSITION, Value::index(position));
        }
    }

    /// Has more of standard input come in.
    ///
    /// # Errors
    /// [`Exit::Park`] if there is none yet, or a failure.
    pub(crate) fn more_input(&mut self) -> Result<(), Exit> {
        let taken = self.outside.console.fill(&mut *self.outside.host);
        self.taken(taken).map(|_| ())
    }

    pub(super) fn file_error<T>(&mut self, what: &str, path: &str, error: &HostError) -> Result<T, Exit> {
        self.exchange.raise(Raised::File(path.into(), format!("it cannot be {what}: {error}")))
    }
}

// ---- making and closing

pub(super) fn standard_stream(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let index = vm.index_below(arguments[0], 3)?;
    Ok(vm.world.streams[index])
}

pub(super) fn make_string_input(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, start, end] = exactly(arguments);
    let characters = vm.few_characters(string, start, end)?;
    vm.exchange.charge_elements(characters.len());
    let buffer = vm.heap.alloc_string(&characters)?;
    Ok(make_stream(&mut vm.heap, StreamKind::StringInput, buffer, 0, characters.len())?)
}

pub(super) fn read_from_copy(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(length) = vm.heap.string(arguments[0]).map(<[u32]>::len) else {
        return vm.exchange.type_error(arguments[0], "SIMPLE-STRING");
    };
    Ok(make_stream(&mut vm.heap, StreamKind::StringInput, arguments[0], 0, length)?)
}

pub(super) fn string_input_position(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, _) = vm.designated_stream(arguments[0], true)?;
    Ok(vm.stream_slot(stream, slot::POSITION))
}

pub(super) fn make_string_output(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let buffer = vm.heap.alloc_string_filled(FIRST_BUFFER, 0)?;
    Ok(make_stream(&mut vm.heap, StreamKind::StringOutput, buffer, 0, 0)?)
}

pub(super) fn get_output_stream_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = arguments[0];
    if StreamKind::of(&vm.heap, stream) != Some(StreamKind::StringOutput) {
        return vm.exchange.type_error(stream, "STRING-STREAM");
    }
    let position = vm.stream_index(stream, slot::POSITION);
    let length = vm.stream_index(stream, slot::BEFORE) + position;
    if length > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let full = vm.list_items(vm.stream_slot(stream, slot::FULL), LIMIT)?;
    let mut gathered: SmallVec<[u32; 64]> = SmallVec::with_capacity(length);
    for &string in full.iter().rev() {
        gathered.extend_from_slice(vm.heap.string(string).unwrap_or_default());
    }
    let buffer = vm.stream_slot(stream, slot::BUFFER);
    gathered.extend_from_slice(vm.heap.string(buffer).map_or(&[], |all| &all[..position]));
    vm.exchange.charge_elements(length);
    let text = vm.heap.alloc_string(&gathered)?;
    vm.set_stream_slot(stream, slot::POSITION, Value::small(0));
    vm.set_stream_slot(stream, slot::FULL, Value::NIL);
    vm.set_stream_slot(stream, slot::BEFORE, Value::small(0));
    Ok(text)
}

pub(super) fn gathered_length(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = arguments[0];
    if StreamKind::of(&vm.heap, stream) != Some(StreamKind::StringOutput) {
        return vm.exchange.type_error(stream, "STRING-STREAM");
    }
    Ok(Value::index(vm.stream_index(stream, slot::BEFORE) + vm.stream_index(stream, slot::POSITION)))
}

pub(super) fn take_gathered(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let stream = arguments[0];
    if gathered_length(vm, arguments)? != arguments[1] {
        return Ok(Value::NIL);
    }
    let fresh = vm.heap.alloc_string_filled(FIRST_BUFFER, 0)?;
    let last = vm.stream_slot(stream, slot::BUFFER);
    let strings = vm.heap.cons(last, vm.stream_slot(stream, slot::FULL))?;
    vm.set_stream_slot(stream, slot::BUFFER, fresh);
    vm.set_stream_slot(stream, slot::POSITION, Value::small(0));
    vm.set_stream_slot(stream, slot::FULL, Value::NIL);
    vm.set_stream_slot(stream, slot::BEFORE, Value::small(0));
    Ok(strings)
}

pub(super) fn open_input(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    let buffer = file_text(vm, arguments)?;
    let length = vm.heap.string(buffer).map_or(0, <[u32]>::len);
    let stream = make_stream(&mut vm.heap, StreamKind::StringInput, buffer, 0, length)?;
    let name = vm.heap.alloc_str(&path)?;
    vm.set_stream_slot(stream, slot::NAME, name);
    Ok(stream)
}

pub(super) fn open_output(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [path, mode] = exactly(arguments);
    let Some(path) = vm.text_of(path) else { return vm.exchange.type_error(path, "STRING") };
    let mode = vm.index_below(mode, 3)?;
    let buffer = vm.heap.alloc_string_filled(FIRST_BUFFER, 0)?;
    let stream = make_stream(&mut vm.heap, StreamKind::FileOutput, buffer, 0, 0)?;
    let name = vm.heap.alloc_str(&path)?;
    vm.set_stream_slot(stream, slot::NAME, name);
    // Nothing is written at once, so that a file that cannot be made fails here.
    match vm.outside.host.write_file(&path, &[], write_mode(mode)) {
        Ok(()) => {
            vm.set_stream_slot(stream, slot::MODE, Value::small(1));
            Ok(stream)
        }
        Err(error) => vm.file_error("written", &path, &error),
    }
}

/// What the mode of a stream says of the file.
fn write_mode(mode: usize) -> WriteMode {
    match mode {
        0 => WriteMode::Replace,
        1 => WriteMode::Append,
        _ => WriteMode::Create,
    }
}

pub(super) fn close(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [stream, abort] = exactly(arguments);
    let Some(kind) = StreamKind::of(&vm.heap, stream) else {
        return vm.exchange.type_error(stream, "STREAM");
    };
    if vm.stream_slot(stream, slot::OPEN).is_nil() {
        return Ok(Value::NIL);
    }
    match kind {
        StreamKind::StandardInput | StreamKind::StandardOutput | StreamKind::StandardError => {
            vm.outside.flush();
            return Ok(Value::T);
        }
        StreamKind::FileOutput if abort.is_nil() => {
            vm.set_stream_slot(stream, slot::OPEN, Value::NIL);
            vm.write_out(stream)?;
        }
        _ => vm.set_stream_slot(stream, slot::OPEN, Value::NIL),
    }
    Ok(Value::T)
}

pub(super) fn file_text(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    match vm.outside.host.read_file(&path) {
        Ok(bytes) => {
            vm.exchange.charge_elements(bytes.len());
            Ok(vm.heap.alloc_str(&String::from_utf8_lossy(&bytes))?)
        }
        Err(error) => vm.file_error("read", &path, &error),
    }
}

pub(super) fn file_exists_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    Ok(Value::boolean(vm.outside.host.file_exists(&path)))
}

pub(super) fn delete_file(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(path) = vm.text_of(arguments[0]) else { return vm.exchange.type_error(arguments[0], "STRING") };
    match vm.outside.host.delete_file(&path) {
        Ok(()) => Ok(Value::T),
        Err(error) => vm.file_error("deleted", &path, &error),
    }
}

// ---- asking

pub(super) fn streamp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(Value::boolean(StreamKind::of(&vm.heap, arguments[0]).is_some()))
}

pub(super) fn input_stream_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match StreamKind::of(&vm.heap, arguments[0]) {
        Some(kind) => Ok(Value::boolean(kind.is_input())),
        None => vm.exchange.type_error(arguments[0], "STREAM"),
    }
}

pub(super) fn output_stream_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match StreamKind::of(&vm.heap, arguments[0]) {
        Some(kind) => Ok(Value::boolean(!kind.is_input())),
        None => vm.exchange.type_error(arguments[0], "STREAM"),
    }
}

pub(super) fn open_stream_p(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match StreamKind::of(&vm.heap, arguments[0]) {
        Some(_) => Ok(vm.stream_slot(arguments[0], slot::OPEN)),
        None => vm.exchange.type_error(arguments[0], "STREAM"),
    }
}

pub(super) fn stream_sort(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(kind) = StreamKind::of(&vm.heap, arguments[0]) else {
        return vm.exchange.type_error(arguments[0], "STREAM");
    };
    let name = vm.stream_slot(arguments[0], slot::NAME);
    let kind = match kind {
        StreamKind::StandardInput | StreamKind::StandardOutput | StreamKind::StandardError => "STANDARD",
        StreamKind::StringInput | StreamKind::StringOutput if name.is_nil() => "STRING",
        _ => "FILE",
    };
    let kind = vm.world.keyword(&mut vm.heap, kind)?;
    vm.give_values(&[kind, name])
}

pub(super) fn stream_column(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let (stream, kind) = vm.designated_stream(arguments[0], false)?;
    Ok(Value::index(vm.column_of(stream, kind)))
}
