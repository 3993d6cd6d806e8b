//! Values that the embedder holds, and its requests.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;

use esl_bytecode::compile::SourcePlace;

use crate::heap::Heap;
use crate::task::TaskId;
use crate::value::Value;

/// Values that the embedder holds, and its requests.
#[derive(Default)]
pub(crate) struct Embedder {
    /// Values that are kept from being collected.
    pub(crate) pinned: Vec<Value>,
    /// Set from outside to abort the task named in `interruptible`.
    pub(crate) interrupt: Arc<AtomicBool>,
    /// Set from outside to have a run come back.
    pub(crate) stop: Arc<AtomicBool>,
    /// The task that an interrupt aborts.
    pub(crate) interruptible: Option<TaskId>,
    /// Whether an interrupt has aborted one.
    pub(crate) was_interrupted: bool,
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

    /// Lets go of a pinned value.
    pub(crate) fn unpin(&mut self, value: Value) {
        if let Some(index) = self.pinned.iter().rposition(|&pinned| pinned == value) {
            self.pinned.swap_remove(index);
        }
    }

    /// Takes an interrupt, and returns the task that it aborts.
    pub(crate) fn take_interrupt(&self) -> Option<TaskId> {
        let id = self.interruptible?;
        take(&self.interrupt).then_some(id)
    }

    /// Takes a request to have the run come back.
    pub(crate) fn take_stop(&self) -> bool {
        take(&self.stop)
    }
}

/// Takes a flag that is set from outside.
fn take(flag: &AtomicBool) -> bool {
    // A plain look first: it is done once a turn, and writing would cost more.
    flag.load(Relaxed) && flag.swap(false, Relaxed)
}
