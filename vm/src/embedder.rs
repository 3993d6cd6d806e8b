//! Values that the embedder holds, and its requests.

use std::collections::{BTreeMap, VecDeque};

use esl_bytecode::compile::SourcePlace;
use esl_host::{Incoming, ProcessSignal};

use crate::heap::Heap;
use crate::task::{TaskId, TaskIndex};
use crate::value::Value;

/// Values that the embedder holds, and its requests.
#[derive(Clone, Default)]
pub(crate) struct Embedder {
    /// Values that are kept from being collected.
    pub(crate) pinned: Vec<Value>,
    /// Numbers of the questions from outside for which tasks run, by the places of these.
    pub(crate) calls: BTreeMap<TaskIndex, u64>,
    /// The call from outside that goes first, while what has come after it is deferred.
    pub(crate) first: Option<TaskId>,
    /// The deferred arrivals, in their order.
    pub(crate) deferred: VecDeque<Incoming>,
    /// Values that the outside holds, by number.
    pub(crate) kept: BTreeMap<u64, Value>,
    /// Number of values kept so far.
    pub(crate) kept_so_far: u64,
    /// The task that an interrupt aborts.
    pub(crate) interruptible: Option<TaskId>,
    /// Functions that are called for signals of the process, by the numbers of these. They are pinned.
    pub(crate) handlers: BTreeMap<u8, Value>,
    /// Signal that has come while no task was named, and is for the next one.
    pub(crate) signal_waits: Option<ProcessSignal>,
    /// Signal that has ended the run, or a task that was named.
    pub(crate) ended_by: Option<ProcessSignal>,
    /// Whether every task is to end.
    pub(crate) is_ending: bool,
    /// Whether a further interrupt has cut that short.
    pub(crate) is_cut_short: bool,
    /// Text of a failure that ended a task while there was no library to deal with it.
    pub(crate) last_words: Option<String>,
    /// Innermost place in the program of the failure that ended a task last, if there is one.
    pub(crate) last_place: Option<SourcePlace>,
}

impl Embedder {
    /// Keeps a value from being collected, until [`Embedder::unpin`].
    pub(crate) fn pin(&mut self, heap: &mut Heap, value: Value) {
        heap.log_if_marking(value);
        self.pinned.push(value);
    }

    /// Keeps a value for the outside, and returns the number under which it is kept.
    pub(crate) fn keep(&mut self, heap: &mut Heap, value: Value) -> u64 {
        heap.log_if_marking(value);
        self.kept_so_far += 1;
        self.kept.insert(self.kept_so_far, value);
        self.kept_so_far
    }

    /// Forgets what an earlier program has asked for, and how it has ended. Returns how many signals of the
    /// process it has handled.
    pub(crate) fn begin_program(&mut self) -> u64 {
        let handlers = std::mem::take(&mut self.handlers);
        handlers.values().for_each(|&function| self.unpin(function));
        (self.interruptible, self.ended_by, self.last_words, self.last_place) = (None, None, None, None);
        (self.is_ending, self.is_cut_short) = (false, false);
        handlers.len() as u64
    }

    /// Calls `visit` with each value that the embedder or the outside holds.
    pub(crate) fn visit(&self, visit: &mut impl FnMut(Value)) {
        self.pinned.iter().chain(self.kept.values()).for_each(|&value| visit(value));
    }

    /// Lets go of a pinned value.
    pub(crate) fn unpin(&mut self, value: Value) {
        if let Some(index) = self.pinned.iter().rposition(|&pinned| pinned == value) {
            self.pinned.swap_remove(index);
        }
    }
}
