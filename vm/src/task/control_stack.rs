//! The control stack of a task: what stands between a point of the program and its root.
//!
//! Entries are pushed and popped by instructions; a throw, a handler that takes a condition, and an abort
//! unwind them. Unwinding is a state of the task, not a Rust stack: entries are popped one by one, a tick
//! each, a cleanup runs as ordinary code and goes on with the unwinding when it ends. So a cleanup can be
//! preempted, and 10^6 entries unwind without delaying other tasks.
//!
//! Invariant: an entry of a frame is popped before the frame is left (the verifier's V9), so every entry's
//! `base` is that of a live frame.

use esl_heap::state::{StateSink, Stated};
use std::cell::OnceCell;
use std::ops::{Deref, DerefMut, Range};

use super::copy_with_room;
use crate::saved_pc::SavedPc;
use crate::task::Allowance;
use crate::task::Bindings;
use crate::value::Value;

/// Kind of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EntryKind {
    /// A catch; `data` is the tag.
    Catch,
    /// A cleanup that waits for an unwinding to pass.
    Cleanup,
    /// A cleanup that runs; `data` is its index in [`Control::running`], whose top belongs to the innermost
    /// of these.
    Running,
    /// Cases for conditions, which unwind to here; `data` is the vector of their types.
    HandlerCase,
    /// Functions for conditions, which run at the point of signalling; `data` is a list of `(type .
    /// function)`.
    Handlers,
    /// Recovery procedures; `data` is their table, or after the first failure that they were for the state
    /// made of it.
    Recovery,
    /// A cleanup for failures: the search for handlers ends there, and goes on outside when it has run.
    FailureCleanup,
    /// Entries from the fixnum `data` up to this one are not searched for handlers.
    Mask,
    /// A place down to which bindings are undone.
    Scope,
    /// A limit of time or ticks; `data` is the tag of the catch that it was. It belongs to the innermost of
    /// the task's limits.
    Limit,
    /// A function that runs where the task was interrupted; `data` is the wait at which it was parked, or
    /// `NIL`.
    Interrupt,
}

/// Entry of a control stack.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    /// Datum that belongs to the kind.
    pub data: Value,
    /// Address at which control goes on when an unwinding ends, or a cleanup begins, here.
    pub pc: SavedPc,
    /// Offset of the frame's base in the stack.
    pub base: u32,
    /// Number of bindings when the entry was pushed.
    pub bindings: u32,
    /// First register that the landing may write.
    pub window: u8,
    /// Number of values that the landing wants, as in [`esl_bytecode::operand::Want`].
    pub want: u8,
    /// Kind of the entry.
    pub kind: EntryKind,
}

/// Way a task ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TaskEnd {
    /// The function returned.
    Succeeded,
    /// A failure left it; the value is the condition.
    Failed(Value),
    /// It was aborted.
    Aborted,
    /// The budget was spent.
    Spent,
}

/// Target of an unwinding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum UnwindTarget {
    /// At the entry with this index.
    Entry(usize),
    /// At the task's root, which ends it.
    Root(TaskEnd),
    /// At the entry with this index, an expired limit.
    Limit(usize),
    /// At the entry with this index, a running cleanup that is cut off.
    Cleanup(usize),
    /// At the frame with this base, which returns the values. Its entries and those of frames inside it are
    /// popped, so that so many are left.
    Return {
        /// Entries that are left.
        entries: usize,
        /// Offset of the frame's base in the stack.
        base: u32,
    },
}

impl Stated for TaskEnd {
    fn tell(&self, sink: &mut dyn StateSink) {
        match *self {
            TaskEnd::Succeeded => sink.word(1),
            TaskEnd::Failed(condition) => sink.value(condition),
            TaskEnd::Aborted => sink.word(2),
            TaskEnd::Spent => sink.word(3),
        }
    }
}

impl UnwindTarget {
    /// Returns whether nothing that the program does may cancel an unwinding to it.
    pub(crate) fn is_forced(self) -> bool {
        matches!(
            self,
            UnwindTarget::Root(TaskEnd::Aborted | TaskEnd::Spent)
                | UnwindTarget::Limit(_)
                | UnwindTarget::Cleanup(_)
        )
    }

    /// Returns whether nothing that runs on the way can cancel the unwinding: the task ends, or is made to
    /// leave a form.
    pub(crate) fn is_final(self) -> bool {
        self.is_forced() || matches!(self, UnwindTarget::Root(_))
    }

    /// Returns the number of control entries that are left at it: the greater, the further inside.
    pub(crate) fn depth(self) -> usize {
        match self {
            UnwindTarget::Root(_) => 0,
            UnwindTarget::Entry(index) | UnwindTarget::Limit(index) | UnwindTarget::Cleanup(index) => {
                index + 1
            }
            UnwindTarget::Return { entries, .. } => entries,
        }
    }
}

/// An unwinding under way.
#[derive(Clone, Debug)]
pub(crate) struct Unwinding {
    /// Target.
    pub target: UnwindTarget,
    /// Values that it carries.
    pub values: Vec<Value>,
}

impl Unwinding {
    /// Calls `visit` with every value that it holds.
    fn visit(&self, visit: &mut dyn FnMut(Value)) {
        self.values.iter().copied().for_each(&mut *visit);
        if let UnwindTarget::Root(TaskEnd::Failed(condition)) = self.target {
            visit(condition);
        }
    }

    /// Returns the unwinding that goes on when a cleanup is left: this one, by which it is left, or the one
    /// that the cleanup interrupted. An exit of the program replaces another, but not the end of the task,
    /// nor an expired limit. A failure that was about to end the task does not get in the way of a cut-off:
    /// when the cleanup is left that is cut off, the task goes on as if that one had ended.
    pub(crate) fn or_interrupted(self, interrupted: Option<Unwinding>) -> Unwinding {
        let Some(interrupted) = interrupted else { return self };
        let is_cut_off = matches!(self.target, UnwindTarget::Cleanup(_)) && !interrupted.target.is_forced();
        let is_further = interrupted.target.depth() < self.target.depth() && !is_cut_off;
        if interrupted.target.is_final() && (!self.target.is_forced() || is_further) {
            interrupted
        } else {
            self
        }
    }
}

/// Running cleanup: what it has interrupted, and what it may use.
#[derive(Clone, Debug, Default)]
pub(crate) struct RunningCleanup {
    /// Index of its entry in the control stack.
    pub entry: usize,
    /// Unwinding that goes on when it ends; `None` if the protected form returned.
    pub pending: Option<Unwinding>,
    /// Value list of the protected form.
    pub values: Vec<Value>,
    /// Ticks and time that it may still use, once something waits for its end.
    pub allowance: Option<Allowance>,
    /// The least ticks and time of its allowance and of those of the cleanups around it.
    pub bound: Allowance,
}

/// Control stack of a task, with its bindings.
#[derive(Default)]
pub(crate) struct Control {
    /// Entries, innermost last.
    pub entries: Vec<Entry>,
    /// Running cleanups, innermost last.
    pub running: Vec<RunningCleanup>,
    /// Dynamic bindings.
    pub bindings: Bindings,
    /// Unwinding under way.
    pub unwinding: Option<Unwinding>,
}

impl Clone for Control {
    fn clone(&self) -> Control {
        Control {
            entries: copy_with_room(&self.entries),
            running: copy_with_room(&self.running),
            bindings: self.bindings.clone(),
            unwinding: self.unwinding.clone(),
        }
    }
}

/// Control stack that is made when it is first used: many tasks never use one.
#[derive(Clone, Default)]
pub(crate) struct LazyControl(pub(super) OnceCell<Box<Control>>);

/// Room for entries or bindings that is given back when it is not used.
const MANY: usize = 1 << 14;

impl LazyControl {
    /// As [`Control::trim`].
    pub(crate) fn trim(&mut self) -> bool {
        self.0.get_mut().is_some_and(|control| control.trim())
    }

    /// Returns the control stack, if there is one.
    #[inline(always)]
    pub(crate) fn get(&self) -> Option<&Control> {
        self.0.get().map(|control| &**control)
    }

    /// Returns whether an unwinding is under way.
    #[inline(always)]
    pub(crate) fn is_unwinding(&self) -> bool {
        self.get().is_some_and(|control| control.unwinding.is_some())
    }
}

impl Deref for LazyControl {
    type Target = Control;

    #[inline]
    fn deref(&self) -> &Control {
        self.0.get_or_init(Box::default)
    }
}

impl DerefMut for LazyControl {
    #[inline]
    fn deref_mut(&mut self) -> &mut Control {
        if self.0.get().is_none() {
            self.0 = OnceCell::from(Box::<Control>::default());
        }
        self.0.get_mut().expect("it was just made")
    }
}

/// Handlers found by a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    /// Index of the entry.
    pub index: usize,
    /// Kind of the entry: cases, handlers, recovery procedures or a cleanup for failures.
    pub kind: EntryKind,
    /// Datum of the entry.
    pub data: Value,
}

impl Control {
    /// Begins to run the cleanup on top of the stack, whose protected form has returned these values.
    #[inline]
    pub(crate) fn enter_cleanup(&mut self, values: Vec<Value>) {
        let bound = self.bound();
        let index = self.running.len();
        let Some(entry) = self.entries.last_mut() else { return };
        self.bindings.truncate(entry.bindings as usize);
        entry.kind = EntryKind::Running;
        entry.data = Value::index(index);
        let entry = self.entries.len() - 1;
        self.running.push(RunningCleanup { entry, pending: None, values, allowance: None, bound });
    }

    /// Begins to run the cleanup `entry`, on top of the stack. `running` is what it interrupts.
    pub(crate) fn run_cleanup(&mut self, entry: Entry, running: RunningCleanup) {
        let data = Value::index(self.running.len());
        self.bindings.truncate(entry.bindings as usize);
        let bound = self.bound().around(running.allowance);
        self.running.push(RunningCleanup { entry: self.entries.len(), bound, ..running });
        self.entries.push(Entry { kind: EntryKind::Running, data, ..entry });
    }

    /// Returns the index of the entry of the innermost running cleanup.
    pub(crate) fn innermost_cleanup(&self) -> Option<usize> {
        Some(self.running.last()?.entry)
    }

    /// Returns the least ticks and time that a running cleanup may use.
    pub(crate) fn bound(&self) -> Allowance {
        self.running.last().map_or(Allowance::OVER, |running| running.bound)
    }

    /// Gives the running cleanup at `position` an allowance.
    pub(crate) fn set_allowance(&mut self, position: usize, allowance: Allowance) {
        let (outer, inner) = self.running.split_at_mut(position);
        let mut bound = outer.last().map_or(Allowance::OVER, |running| running.bound);
        let Some(first) = inner.first_mut() else { return };
        first.allowance = Some(allowance);
        for running in inner {
            bound = bound.around(running.allowance);
            if std::mem::replace(&mut running.bound, bound) == bound {
                break;
            }
        }
    }

    /// Returns the position of the outermost running cleanup that `is_spent` holds for, of what it may use:
    /// if it holds for something, then for all that is less.
    pub(crate) fn outermost_spent(&self, is_spent: impl Fn(Allowance) -> bool) -> Option<usize> {
        let position = self.running.partition_point(|running| !is_spent(running.bound));
        (position < self.running.len()).then_some(position)
    }

    /// Returns the target of an interrupted unwinding that the running cleanup cannot cancel.
    pub(crate) fn final_unwinding(&self) -> Option<UnwindTarget> {
        let pending = self.running.iter().rev().filter_map(|running| running.pending.as_ref());
        pending.map(|unwinding| unwinding.target).find(|target| target.is_final())
    }

    /// Returns the index of the innermost entry that catches `tag`.
    pub(crate) fn find_catch(&self, tag: Value) -> Option<usize> {
        let catches = |entry: &Entry| matches!(entry.kind, EntryKind::Catch | EntryKind::Recovery);
        self.entries.iter().rposition(|entry| entry.data == tag && catches(entry))
    }

    /// Returns the innermost handlers below `height` that no mask hides, for a failure also recovery
    /// procedures and cleanups. A failure in a cleanup that runs because the task ends, or leaves an expired
    /// limit, finds nothing outside of it. Counts the entries looked at in `steps`.
    pub(crate) fn find_handlers(&self, height: usize, is_failure: bool, steps: &mut usize) -> Option<Found> {
        let mut end = height.min(self.entries.len());
        while end > 0 {
            let index = end - 1;
            let entry = &self.entries[index];
            *steps += 1;
            match entry.kind {
                EntryKind::HandlerCase | EntryKind::Handlers => {
                    return Some(Found { index, kind: entry.kind, data: entry.data });
                }
                EntryKind::Recovery | EntryKind::FailureCleanup if is_failure => {
                    return Some(Found { index, kind: entry.kind, data: entry.data });
                }
                EntryKind::Running => {
                    let running = entry.data.as_index().and_then(|index| self.running.get(index));
                    let pending = running.and_then(|running| running.pending.as_ref());
                    if is_failure && pending.is_some_and(|pending| pending.target.is_final()) {
                        return None;
                    }
                    end = index;
                }
                EntryKind::Mask => end = index.min(entry.data.as_index().unwrap_or(index)),
                _ => end = index,
            }
        }
        None
    }

    /// Returns the bytes that the control stack takes.
    pub(crate) fn bytes(&self) -> usize {
        size_of::<Control>()
            + self.entries.capacity() * size_of::<Entry>()
            + self.running.capacity() * size_of::<RunningCleanup>()
            + self.bindings.bytes()
    }

    /// Returns the words for which there is room among entries and bindings.
    pub(crate) fn words(&self) -> usize {
        words_of(self.entries.capacity(), self.bindings.capacity())
    }

    /// Returns the words that entries and bindings take of these.
    pub(crate) fn words_in_use(&self) -> usize {
        words_of(self.entries.len(), self.bindings.len())
    }

    /// Returns the words that running cleanups take, which need not be asked for.
    pub(crate) fn words_of_cleanups(&self) -> usize {
        self.running.len() * size_of::<RunningCleanup>() / size_of::<Value>()
    }

    /// Gives back the room of entries and bindings if there is twice as much as they need, and more than
    /// `few`. Returns whether there was.
    pub(crate) fn give_back(&mut self, few: usize) -> bool {
        let has_room = self.entries.capacity() > few.max(2 * self.entries.len());
        if has_room {
            self.entries.shrink_to(few);
        }
        if self.running.capacity() > few.max(2 * self.running.len()) {
            self.running.shrink_to(few);
        }
        self.bindings.give_back(few) | has_room
    }

    /// Gives back most of the room of entries and bindings if it is much too large for those that there are.
    /// Returns whether it was.
    pub(crate) fn trim(&mut self) -> bool {
        let has_many = self.entries.capacity() > MANY && self.entries.len() < self.entries.capacity() / 4;
        if has_many {
            self.entries.shrink_to(2 * self.entries.len());
        }
        let has_cleanups = self.running.capacity() > MANY && self.running.len() < self.running.capacity() / 4;
        if has_cleanups {
            self.running.shrink_to(2 * self.running.len());
        }
        self.bindings.trim(MANY) | has_many | has_cleanups
    }

    /// Returns the number of its parts: entries, bindings and running cleanups.
    pub(crate) fn parts(&self) -> usize {
        self.entries.len() + self.bindings.len() + self.running.len()
    }

    /// Calls `visit` with every value that a range of its parts holds.
    pub(crate) fn visit_parts(&self, parts: Range<usize>, visit: &mut dyn FnMut(Value)) {
        let Range { mut start, mut end } = parts;
        for entry in part_of(&self.entries, &mut start, &mut end) {
            visit(entry.data);
        }
        for binding in part_of(self.bindings.all(), &mut start, &mut end) {
            visit(binding.symbol);
            visit(binding.value);
        }
        for running in part_of(&self.running, &mut start, &mut end) {
            running.values.iter().copied().for_each(&mut *visit);
            if let Some(unwinding) = &running.pending {
                unwinding.visit(visit);
            }
        }
    }

    /// Calls `visit` with every value that the unwinding under way holds.
    pub(crate) fn visit_unwinding(&self, visit: &mut dyn FnMut(Value)) {
        if let Some(unwinding) = &self.unwinding {
            unwinding.visit(visit);
        }
    }
}

/// Returns the words that so many entries and bindings take at most.
fn words_of(entries: usize, bindings: usize) -> usize {
    (entries * size_of::<Entry>() + bindings * Bindings::BYTES) / size_of::<Value>()
}

/// Returns the items from `start` to before `end`, as far as they are there, and counts both on from behind
/// the last one that is.
fn part_of<'a, T>(items: &'a [T], start: &mut usize, end: &mut usize) -> &'a [T] {
    let count = items.len();
    let part = &items[(*start).min(count)..(*end).min(count)];
    *start = start.saturating_sub(count);
    *end = end.saturating_sub(count);
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(kind: EntryKind, data: i32) -> Entry {
        let data = Value::small(data);
        Entry { data, pc: SavedPc::NONE, base: 0, bindings: 0, window: 0, want: 0, kind }
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
        while let Some(next) = control.find_handlers(height, false, &mut steps) {
            found.push(next.data);
            height = next.index;
        }
        assert_eq!(found, [Value::small(13), Value::small(10)]);
        assert_eq!(steps, 3);
    }
}
