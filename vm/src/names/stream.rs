//! Streams as objects of the program.
//!
//! A Stream is a record; `aux` is its [`StreamKind`], [`slot`] names its slots.
//!
//! Not here: reading and writing (`builtins::stream`).

use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;

/// Slots of a Stream.
pub(crate) mod slot {
    /// A String: the text to be read, or the latest text gathered.
    pub(crate) const BUFFER: usize = 0;
    /// Number of characters in the buffer that were read or written.
    pub(crate) const POSITION: usize = 1;
    /// Index in the buffer at which reading ends.
    pub(crate) const END: usize = 2;
    /// Characters written since the last line end.
    pub(crate) const COLUMN: usize = 3;
    /// For a channel what reads and writes for it.
    pub(crate) const HANDLER: usize = 4;
    /// Whether the stream is open.
    pub(crate) const OPEN: usize = 5;
    /// For a channel 1 if nothing comes after what it has to read; for its output 1, since that is bounded.
    pub(crate) const BOUND: usize = 6;
    /// List of the full strings gathered before the buffer, the last first. For a channel what it is for: 1
    /// for reading, 2 for writing, otherwise both.
    pub(crate) const FULL: usize = 7;
    /// Number of characters in the full strings. For a channel of those that were read and are not in the
    /// buffer any more.
    pub(crate) const BEFORE: usize = 8;
    /// For a channel the string stream that gathers its output.
    pub(crate) const OUTPUT: usize = 9;
    /// For a channel the name of the file that is behind it.
    pub(crate) const FILE: usize = 10;
    /// Number of slots.
    pub(crate) const LEN: usize = 11;
}

/// Source or destination of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub(crate) enum StreamKind {
    StandardInput = 0,
    StandardOutput = 1,
    StandardError = 2,
    /// A string.
    StringInput = 3,
    StringOutput = 4,
    /// Anything else: the operations are in ESL, over the object in the buffer's slot.
    Custom = 5,
    /// A socket, a file or the like, which functions of the library read and write.
    Channel = 6,
}

impl StreamKind {
    /// Returns whether the stream is for reading.
    pub(crate) fn is_input(self) -> bool {
        matches!(self, StreamKind::StandardInput | StreamKind::StringInput | StreamKind::Channel)
    }

    /// Returns whether the stream is for writing.
    pub(crate) fn is_output(self) -> bool {
        self == StreamKind::Channel || !self.is_input()
    }

    /// Returns the kind of a stream; `None` for any other value.
    pub(crate) fn of(heap: &Heap, stream: Value) -> Option<StreamKind> {
        let header = heap.header(stream).filter(|header| header.kind == Kind::Stream)?;
        Some(match header.aux {
            0 => StreamKind::StandardInput,
            1 => StreamKind::StandardOutput,
            2 => StreamKind::StandardError,
            3 => StreamKind::StringInput,
            4 => StreamKind::StringOutput,
            5 => StreamKind::Custom,
            _ => StreamKind::Channel,
        })
    }
}

/// Makes a stream of which `buffer` holds characters from `start` to before `end`.
///
/// # Errors
/// As for every allocation.
pub(crate) fn make_stream(
    heap: &mut Heap,
    kind: StreamKind,
    buffer: Value,
    start: usize,
    end: usize,
) -> Result<Value, AllocError> {
    let mut slots = [Value::NIL; slot::LEN];
    slots[slot::BUFFER] = buffer;
    slots[slot::POSITION] = Value::index(start);
    slots[slot::END] = Value::index(end);
    slots[slot::COLUMN] = Value::small(0);
    slots[slot::OPEN] = Value::T;
    slots[slot::BOUND] = Value::small(0);
    slots[slot::BEFORE] = Value::small(0);
    heap.alloc_record(Kind::Stream, 0, kind as u16, &slots)
}

/// Makes standard input, output and error.
///
/// # Errors
/// As for every allocation.
pub(super) fn standard_streams(heap: &mut Heap) -> Result<[Value; 3], AllocError> {
    let mut stream = |kind| make_stream(heap, kind, Value::NIL, 0, 0);
    Ok([
        stream(StreamKind::StandardInput)?,
        stream(StreamKind::StandardOutput)?,
        stream(StreamKind::StandardError)?,
    ])
}
