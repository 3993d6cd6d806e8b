//! Control stacks as bytes: see [`crate::stored`].

use std::cell::OnceCell;

use esl_heap::store::{Stored, StoredBytes};
use esl_heap::{stored, stored_enum};

use super::{Control, Entry, EntryKind, LazyControl, RunningCleanup, TaskEnd, UnwindTarget, Unwinding};

stored_enum! { EntryKind {
    Catch = 0, Cleanup = 1, Running = 2, HandlerCase = 3, Handlers = 4, Recovery = 5, FailureCleanup = 6, Mask = 7,
    Scope = 8, Limit = 9, Interrupt = 10,
} }
stored! { Entry { data, pc, base, bindings, window, want, kind } }
stored_enum! { TaskEnd { Succeeded = 0, Failed(condition) = 1, Aborted = 2, Spent = 3 } }
stored_enum! { UnwindTarget {
    Entry(entry) = 0, Root(end) = 1, Limit(entry) = 2, Cleanup(entry) = 3, Return { entries, base } = 4,
} }
stored! { Unwinding { target, values } }
stored! { RunningCleanup { entry, pending, values, allowance, bound } }
stored! { Control { entries, running, bindings, unwinding } }

impl Stored for LazyControl {
    fn store(&self, out: &mut Vec<u8>) {
        self.0.get().is_some().store(out);
        self.0.get().into_iter().for_each(|control| control.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<LazyControl> {
        let control = Option::<Box<Control>>::load(from)?;
        Some(LazyControl(control.map_or_else(OnceCell::new, OnceCell::from)))
    }
}
