//! The control stack of a task: what stands between a point of the program and its root.
//!
//! Entries are pushed and popped by instructions; a throw, a handler that takes a condition, and an abort unwind them.
//! Unwinding is a state of the task, not a Rust stack: entries are popped one by one, a tick each, a cleanup runs as
//! ordinary code and goes on with the unwinding when it ends. So a cleanup can be preempted, and 10^6 entries unwind
//! without holding anybody up.
//!
//! Invariant: an entry of a frame is popped before the frame is left (the verifier's V9), so every entry's `base` is
//! that of a live frame.

use crate::binding::Bindings;
use crate::value::Value;

/// What an entry is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EntryKind {
    /// A catch; `data` is the tag.
    Catch,
    /// A cleanup that waits for an unwinding to pass.
    Cleanup,
    /// A cleanup that runs; the top of [`Control::running`] belongs to the innermost of these.
    Running,
    /// Cases for conditions, which unwind to here; `data` is the vector of their types.
    HandlerCase,
    /// Functions for conditions, which run at the point of signalling; `data` is a list of `(type . function)`.
    Handlers,
    /// Entries from the fixnum `data` up to this one are not searched for handlers.
    Mask,
    /// A place down to which bindings are undone.
    Scope,
}

/// An entry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    /// What goes with the kind.
    pub data: Value,
    /// Where control goes when an unwinding ends, or a cleanup begins, here.
    pub pc: *const u32,
    /// Offset of the frame's base in the stack.
    pub base: u32,
    /// Number of bindings when the entry was pushed.
    pub bindings: u32,
    /// First register that the landing may write.
    pub window: u8,
    /// How many values the landing wants, as in [`esl_bytecode::operand::Want`].
    pub want: u8,
    /// What the entry is.
    pub kind: EntryKind,
}

/// How a task ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    /// Its function returned.
    Succeeded,
    /// A failure left it; the value is the condition.
    Failed(Value),
    /// It was aborted.
    Aborted,
}

/// Where an unwinding ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// At the entry with this index.
    Entry(usize),
    /// At the task's root, which ends it.
    Root(End),
}

/// An unwinding under way.
#[derive(Clone, Debug)]
pub(crate) struct Unwinding {
    /// Where it ends.
    pub target: Target,
    /// The values that it carries.
    pub values: Vec<Value>,
}

/// What a running cleanup has interrupted.
#[derive(Clone, Debug, Default)]
pub(crate) struct Running {
    /// The unwinding that goes on when it ends; `None` if the protected form returned.
    pub pending: Option<Unwinding>,
    /// The value list of the protected form.
    pub values: Vec<Value>,
}

/// The control stack of a task, with its bindings.
#[derive(Default)]
pub(crate) struct Control {
    /// The entries, innermost last.
    pub entries: Vec<Entry>,
    /// What the running cleanups have interrupted, innermost last.
    pub running: Vec<Running>,
    /// The dynamic bindings.
    pub bindings: Bindings,
    /// The unwinding that is being worked on.
    pub unwinding: Option<Unwinding>,
}

/// The next handlers that a search has found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    /// Index of the entry.
    pub index: usize,
    /// Whether it is of the kind [`EntryKind::HandlerCase`].
    pub is_case: bool,
    /// Its data.
    pub data: Value,
}

impl Control {
    /// Index of the innermost catch for `tag`.
    pub(crate) fn find_catch(&self, tag: Value) -> Option<usize> {
        self.entries.iter().rposition(|entry| entry.kind == EntryKind::Catch && entry.data == tag)
    }

    /// The innermost handlers below `height` that no mask hides. Counts the entries that it looked at in `steps`.
    pub(crate) fn find_handlers(&self, height: usize, steps: &mut usize) -> Option<Found> {
        let mut end = height.min(self.entries.len());
        while end > 0 {
            let index = end - 1;
            let entry = &self.entries[index];
            *steps += 1;
            match entry.kind {
                EntryKind::HandlerCase | EntryKind::Handlers => {
                    let is_case = entry.kind == EntryKind::HandlerCase;
                    return Some(Found { index, is_case, data: entry.data });
                }
                EntryKind::Mask => end = index.min(entry.data.as_index().unwrap_or(index)),
                _ => end = index,
            }
        }
        None
    }

    /// Calls `visit` with every value that the control stack holds.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
        for entry in &self.entries {
            visit(entry.data);
        }
        for binding in self.bindings.iter() {
            visit(binding.symbol);
            visit(binding.value);
        }
        let pending = self.running.iter().filter_map(|running| running.pending.as_ref());
        for unwinding in pending.chain(&self.unwinding) {
            unwinding.values.iter().copied().for_each(&mut *visit);
            if let Target::Root(End::Failed(condition)) = unwinding.target {
                visit(condition);
            }
        }
        for running in &self.running {
            running.values.iter().copied().for_each(&mut *visit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(kind: EntryKind, data: i32) -> Entry {
        let data = Value::small(data);
        Entry { data, pc: std::ptr::null(), base: 0, bindings: 0, window: 0, want: 0, kind }
    }

    #[test]
    fn a_mask_hides_the_entries_below_it_down_to_its_mark() {
        let mut control = Control::default();
        for (kind, data) in [
            (EntryKind::Handlers, 10),
            (EntryKind::HandlerCase, 11),
            (EntryKind::Cleanup, 12),
            (EntryKind::Mask, 1),
            (EntryKind::Handlers, 13),
        ] {
            control.entries.push(entry(kind, data));
        }
        let mut found = Vec::new();
        let (mut height, mut steps) = (5, 0);
        while let Some(next) = control.find_handlers(height, &mut steps) {
            found.push(next.data);
            height = next.index;
        }
        assert_eq!(found, [Value::small(13), Value::small(10)]);
        assert_eq!(steps, 3);
    }
}
