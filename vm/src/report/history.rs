//! Where failures began: the frames of a task, noted in few words while it fails, and read when they are
//! reported.
//!
//! A note is a simple vector: the code with which the task began, and for each frame, innermost first, its
//! code and a number: flags, and in front of them the word at which it stands plus one, 0 if that is unknown.
//! Functions that have left by a tail call are among the frames, as far as they are known. Failures that a
//! form takes over from its tasks, or that go on after a cleanup, carry such notes with them: see
//! `handlers.esl`.

use esl_bytecode::compile::SourcePlace;
use esl_host::FailureFrame;

use super::tail_calls::{TailCallSearch, TailCaller, UNITS_PER_WORD};
use super::task_label;
use crate::describe::describe;
use crate::heap::AllocError;
use crate::interp::start::first_code_of;
use crate::names::load::{TOP_LEVEL, is_of_library};
use crate::names::records::history;
use crate::value::Value;
use crate::vm::Vm;

/// Most frames, and tasks, of a failure that are told of.
const MOST_FRAMES: usize = 500;
const MOST_TASKS: usize = 100;
/// Words of a function among which one is looked for that has a place.
const WORDS_TO_PLACE: u32 = 64;

/// Flag of a frame in a note: it is that of a form at top level.
const AT_TOP_LEVEL: usize = 1;
/// Flag of a frame in a note: its function has left by a tail call.
const BY_TAIL_CALL: usize = 2;
/// Bits of a frame's number for flags.
const FLAG_BITS: u32 = 2;

/// A frame of a note.
pub(crate) struct NotedFrame {
    /// Name of its function: a symbol or a list, `NIL` if it has none.
    pub name: Value,
    /// Whether it is that of a form at top level.
    pub is_top_level: bool,
    /// Where it stands.
    pub place: Option<SourcePlace>,
    /// Whether its function is one of the library.
    pub is_of_library: bool,
    /// Whether its function has left by a tail call, so that the task has no such frame.
    pub has_left: bool,
}

impl Vm {
    /// Notes the innermost frames of the running task.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn note_frames(&mut self, limit: usize) -> Result<Value, AllocError> {
        let (note, words) = self.frames_to_note(limit);
        self.exchange.charge(4 * note.len() + words * UNITS_PER_WORD);
        self.heap.alloc_vector(&note)
    }

    /// Returns the items of a note, and the number of words of code that were read for it.
    fn frames_to_note(&self, limit: usize) -> (Vec<Value>, usize) {
        let first = self.scheduler.running.as_ref().map_or(Value::NIL, |task| first_code_of(task));
        let mut note = vec![first];
        let mut search = TailCallSearch::new(self);
        let mut frames = self.frames().peekable();
        while note.len() / 2 < limit
            && let Some(frame) = frames.next()
        {
            let Some(code) = self.heap.function_code(frame.function) else { continue };
            let header = self.heap.header(frame.function);
            let is_top_level = header.is_some_and(|header| header.aux == TOP_LEVEL);
            let flags = if is_top_level { AT_TOP_LEVEL } else { 0 };
            note.extend([code, frame_number(Some(frame.place() as usize), flags)]);
            let called = match frames.peek() {
                Some(caller) => search.named_by(caller),
                None => Some(first),
            };
            for TailCaller { code, word } in search.between(called.unwrap_or(code), code) {
                note.extend([code, frame_number(word, BY_TAIL_CALL)]);
            }
        }
        (note, search.words)
    }

    /// Returns the frames of a note.
    pub(crate) fn noted_frames(&self, note: Value) -> Vec<NotedFrame> {
        let items = self.heap.vector(note).unwrap_or_default();
        let read = |pair: &[Value]| {
            let number = pair[1].as_index()?;
            let code = self.heap.code(pair[0])?;
            Some(NotedFrame {
                name: code.name,
                is_top_level: number & AT_TOP_LEVEL != 0,
                place: (number >> FLAG_BITS)
                    .checked_sub(1)
                    .and_then(|word| self.names.source_place(&self.heap, pair[0], word as u32)),
                is_of_library: is_of_library(code),
                has_left: number & BY_TAIL_CALL != 0,
            })
        };
        items.get(1..).unwrap_or_default().chunks_exact(2).filter_map(read).collect()
    }

    /// Returns where the body of the task of a note begins.
    pub(crate) fn beginning(&self, note: Value) -> Option<SourcePlace> {
        let code = *self.heap.vector(note)?.first()?;
        self.place_of_code(code)
    }

    /// Returns the place of the first call in code of the program; `None` for code of the library.
    pub(crate) fn place_of_code(&self, code: Value) -> Option<SourcePlace> {
        if is_of_library(self.heap.code(code)?) {
            return None;
        }
        (0..WORDS_TO_PLACE).find_map(|word| self.names.source_place(&self.heap, code, word))
    }

    /// Returns the calls of a history, innermost first: those of the tasks in which the failure began come
    /// first. `task` is the one that has failed.
    pub(crate) fn frames_of_history(&self, history: Value, task: Value) -> Vec<FailureFrame> {
        let mut notes = vec![(task, history)];
        let mut history = history;
        while notes.len() < MOST_TASKS
            && let Some(origin) = self.heap.as_cons(self.field_of(history, history::ORIGIN))
        {
            notes.push((origin.car, origin.cdr));
            history = origin.cdr;
        }
        let mut frames = Vec::new();
        for (task, history) in notes.into_iter().rev() {
            let label = task_label(self, task);
            let row = |frame: NotedFrame| FailureFrame {
                task: label.clone(),
                function: match frame.name {
                    _ if frame.is_top_level => "top level".into(),
                    name if name.is_nil() => "(LAMBDA)".into(),
                    name => describe(&self.heap, name),
                },
                place: frame.place,
                is_of_library: frame.is_of_library,
                has_left: frame.has_left,
            };
            frames.extend(self.noted_frames(self.field_of(history, history::FRAMES)).into_iter().map(row));
        }
        frames.truncate(MOST_FRAMES);
        frames
    }

    /// Returns a field of a history; `NIL` if there is none.
    fn field_of(&self, history: Value, index: usize) -> Value {
        let fields = self.heap.structure_slots(history).unwrap_or_default();
        fields.get(index).copied().unwrap_or(Value::NIL)
    }
}

/// Returns the number of a frame in a note.
fn frame_number(word: Option<usize>, flags: usize) -> Value {
    Value::index(word.map_or(0, |word| word + 1) << FLAG_BITS | flags)
}
