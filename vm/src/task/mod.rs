//! Tasks: threads of control of the program, each with its own stack.
//!
//! A task has two parts. Programs hold an object of the heap, which is an event too, and knows the task's
//! name, how it ended, and the checkpoints that it passed. The machine runs a `Task`, a small record in
//! `Tasks`, which goes away at the task's end.
//!
//! While a task runs, its record is out of the table, in `Scheduler::running`, and the interpreter keeps `pc`
//! and `base`. At a safepoint they are put back, and the record is all there is: no Rust frame holds any
//! state.

mod binding;
mod control_stack;
mod failure;
pub(crate) mod guard;
mod id;
mod limit;
mod standstill;
mod stored;
mod tasks;

pub(crate) use binding::{Binding, Bindings};
pub(crate) use control_stack::{
    Control, Entry, EntryKind, LazyControl, RunningCleanup, TaskEnd, UnwindTarget, Unwinding,
};
pub(crate) use failure::FailureReport;
pub use id::TaskNumber;
pub(crate) use id::{LimitNumber, Serial, TaskIndex};
pub(crate) use limit::{AccountId, Allowance, Fund, Limit};
pub(crate) use standstill::{Rest, Standstill};
pub use tasks::TaskId;
pub(crate) use tasks::Tasks;

use crate::heap::{Heap, Holder};
use crate::saved_pc::SavedPc;
use crate::stack::Stack;
use crate::value::Value;
use esl_heap::{stored, stored_enum};

/// State of a task with regard to running.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TaskState {
    /// It can run, and is in a run queue or running.
    Runnable,
    /// It waits for a signal or for a time.
    Waiting,
    /// It waits for input from outside.
    Reading,
    /// It waits until output has room.
    Writing,
    /// It has ended, and its record is kept for the embedder.
    Ended,
}

/// Record of a task. There may be a million of them, so rarely used parts are behind pointers: [`Extra`] and
/// [`LazyControl`]. The fields that are read in all tasks of a tree come first, so that they share one line
/// of the cache, or two.
#[derive(Clone)]
#[repr(C)]
pub(crate) struct Task {
    /// Object that programs hold.
    pub object: Value,
    /// Ordinal, counted from the machine's first task.
    pub number: TaskNumber,
    /// Wait at which it is parked, until it goes on; otherwise `NIL`.
    pub wait: Value,
    /// Control stack and bindings.
    pub control: LazyControl,
    /// Rarely used parts.
    pub extra: Option<Box<Extra>>,
    /// Properties that are true or false.
    pub flags: Flags,
    /// Whether it can run.
    pub state: TaskState,
    /// Priority from 0 to 7, most urgent last.
    pub priority: u8,
    /// Number of critical sections that it is in.
    pub critical: u8,
    /// Whether the wait at which it is parked ends by itself at a time.
    pub has_deadline: bool,
    /// Registers of its frames.
    pub stack: Stack,
    /// Next instruction, while it does not run.
    pub pc: SavedPc,
    /// Told of its end, beside the waits for it: a cons with the wait of a net, into whose queue it is put
    /// then, so that the end needs no memory; a guard; or `NIL`.
    pub notify: Value,
    /// Ticks used.
    pub ticks: u64,
    /// Serial number of its state, see [`Serial`].
    pub serial: Serial,
    /// Cycle of the collector in which the stack was last scanned.
    pub scanned: u64,
    /// Offset of the running frame's base, while it does not run.
    pub base: u32,
    /// Number of its turns.
    pub turns: u32,
    /// Account that its ticks are charged to.
    pub account: AccountId,
    /// Bytes that the heap counts for it, in units of [`UNIT`].
    pub counted: u32,
}

/// Properties of a task that are true or false.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Flags(u16);

macro_rules! define_flags {
    ($( $(#[doc = $doc:literal])* $name:ident $set:ident = $bit:literal ; )*) => {
        impl Flags {
            /// Returns all flags as a word.
            pub(crate) const fn bits(self) -> u16 {
                self.0
            }

            $(
                $(#[doc = $doc])*
                #[inline(always)]
                pub(crate) const fn $name(self) -> bool {
                    self.0 & 1 << $bit != 0
                }

                /// Sets the flag of this name.
                #[inline(always)]
                pub(crate) fn $set(&mut self, on: bool) {
                    self.0 = self.0 & !(1 << $bit) | u16::from(on) << $bit;
                }
            )*
        }
    };
}

define_flags! {
    /// It is to be aborted as soon as it may be.
    abort_pending set_abort_pending = 0;
    /// The stack's reserve is open, because a failure for lack of stack is being handled.
    uses_reserve set_uses_reserve = 1;
    /// It does not keep the run from ending.
    daemon set_daemon = 2;
    /// It belongs to the library, not to the program.
    hidden set_hidden = 3;
    /// The record stays after the task's end, for the embedder.
    kept set_kept = 4;
    /// The task's turns come before those of others: it is being ended, or its end is waited for.
    urgent set_urgent = 5;
    /// Something is pending that is delivered before it goes on: an expired limit, cleanups that have run
    /// out, an interrupt.
    attention set_attention = 6;
    /// It has waited twice with a stack that is much too large.
    oversized set_oversized = 7;
    /// It stands at a point, before it does what others can see: see `explore`.
    at_point set_at_point = 8;
    /// It stands still, by an interrupt: of what is pending only its end is delivered.
    suspended set_suspended = 9;
    /// It uses the memory that is kept for cleanups, since there is no other.
    uses_cleanup_memory set_uses_cleanup_memory = 10;
    /// A cleanup has made it, or a task that works for one.
    serves_cleanup set_serves_cleanup = 11;
    /// Its last turn has ended since there was no room for something, which it does again in the next.
    lacks_room set_lacks_room = 12;
    /// Since it came to lack room, everything has been collected.
    collected_for set_collected_for = 13;
    /// It stands at a tick, where its last turn has ended: see `explore`.
    at_tick set_at_tick = 14;
}

/// Whether a task's last turn has ended for lack of room, and the collections since.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Shortage {
    /// That was not how it ended.
    #[default]
    None,
    /// Nothing has been done about it.
    Noted,
    /// Everything has been collected since, in the turn of another task.
    Collected,
}

impl Flags {
    /// Returns for what want of room the last turn has ended, and notes that another has begun.
    #[inline(always)]
    pub(crate) fn take_shortage(&mut self) -> Shortage {
        if !self.lacks_room() {
            return Shortage::None;
        }
        let is_collected = self.collected_for();
        self.set_lacks_room(false);
        self.set_collected_for(false);
        if is_collected { Shortage::Collected } else { Shortage::Noted }
    }
}

/// Rarely used parts.
#[derive(Default)]
pub(crate) struct Extra {
    /// Report of the failure that ends it.
    pub report: Option<FailureReport>,
    /// Way it ended, for the embedder.
    pub end: Option<TaskEnd>,
    /// Values that it returned, for the embedder.
    pub values: Vec<Value>,
    /// Open limits, outermost first: one for each entry of the control stack of that kind.
    pub limits: Vec<Limit>,
    /// The common allowance of its cleanups, while an abort or an expired limit has them run.
    pub fund: Option<Fund>,
    /// Guards that interrupt it as soon as may be.
    pub interrupts: Vec<Value>,
}

impl Extra {
    /// Returns the bytes that it takes, with the timers of its limits.
    fn bytes(&self) -> usize {
        size_of::<Extra>() + self.limits.capacity() * 2 * size_of::<Limit>()
    }

    /// Drops the contents, to be used again. Returns whether it is as good as new: room for limits counts as
    /// memory of its task.
    pub(super) fn clear(&mut self) -> bool {
        (self.report, self.end, self.fund) = (None, None, None);
        self.values.clear();
        self.interrupts.clear();
        self.limits.capacity() == 0
    }

    /// Calls `visit` with every value that it holds.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(Value)) {
        self.limits.iter().filter_map(|limit| limit.expired).for_each(&mut *visit);
        self.interrupts.iter().chain(&self.values).copied().for_each(&mut *visit);
        if let Some(TaskEnd::Failed(condition)) = self.end {
            visit(condition);
        }
    }
}

/// Returns a copy with the same room, since the room counts as memory.
fn copy_with_room<T: Clone>(list: &Vec<T>) -> Vec<T> {
    let mut copy = Vec::with_capacity(list.capacity());
    copy.extend_from_slice(list);
    copy
}

impl Clone for Extra {
    fn clone(&self) -> Extra {
        Extra {
            report: self.report.clone(),
            end: self.end,
            values: self.values.clone(),
            limits: copy_with_room(&self.limits),
            fund: self.fund,
            interrupts: self.interrupts.clone(),
        }
    }
}

/// Result of a task, for the embedder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TaskResult {
    /// It has not ended.
    Running,
    /// It returned these values.
    Succeeded(Vec<Value>),
    /// It ended by a failure: the condition.
    Failed(Value),
    /// It was aborted.
    Aborted,
}

impl Task {
    /// Returns the offset of an address in its stack, in words.
    #[inline]
    pub(crate) fn offset_of(&self, base: *mut Value) -> usize {
        (base.addr() - self.stack.start().addr()) / size_of::<Value>()
    }

    /// Creates a task that has yet to be given a frame.
    pub(crate) fn new(object: Value, words: usize) -> Task {
        Task::with_stack(object, Stack::new(words))
    }

    fn with_stack(object: Value, stack: Stack) -> Task {
        Task {
            object,
            number: TaskNumber::NONE,
            wait: Value::NIL,
            control: LazyControl::default(),
            extra: None,
            flags: Flags::default(),
            state: TaskState::Runnable,
            priority: DEFAULT_PRIORITY,
            critical: 0,
            has_deadline: false,
            stack,
            pc: SavedPc::NONE,
            notify: Value::NIL,
            ticks: 0,
            serial: Serial::default(),
            scanned: 0,
            base: 0,
            turns: 0,
            account: AccountId::NONE,
            counted: 0,
        }
    }

    /// Makes a new task of one that has ended and holds nothing any more.
    fn renew(&mut self, object: Value) {
        let stack = std::mem::replace(&mut self.stack, Stack::none());
        *self = Task { counted: self.counted, ..Task::with_stack(object, stack) };
    }

    /// Returns the bytes that a new task with so many words of stack takes.
    pub(crate) fn bytes_with(words: usize) -> usize {
        RECORD_BYTES + words * size_of::<Value>()
    }

    /// Returns the bytes that it takes outside of the heap.
    fn bytes(&self) -> usize {
        let extra = self.extra.as_ref().map_or(0, |extra| extra.bytes());
        let control = self.control.get().map_or(0, Control::bytes);
        Task::bytes_with(self.stack.capacity()) + extra + control
    }

    /// Has the heap count what it takes now.
    pub(crate) fn recount(&mut self, heap: &mut Heap) {
        let counted = (self.bytes() / UNIT) as u32;
        let before = std::mem::replace(&mut self.counted, counted);
        if before != counted {
            heap.recount_external(Holder::Tasks, before as usize * UNIT, counted as usize * UNIT);
        }
    }

    /// Has the heap count it no more: it is gone.
    pub(crate) fn uncount(&mut self, heap: &mut Heap) {
        let before = std::mem::take(&mut self.counted);
        heap.recount_external(Holder::Tasks, before as usize * UNIT, 0);
    }

    /// Returns the fields that few tasks need, made if they are not there.
    pub(crate) fn extra_mut(&mut self) -> &mut Extra {
        self.extra.get_or_insert_default()
    }

    /// Returns whether it waits since it got this serial number.
    pub(crate) fn is_waiting_since(&self, serial: Serial) -> bool {
        self.serial == serial && self.state == TaskState::Waiting
    }

    /// Returns whether one of its cleanups runs.
    pub(crate) fn runs_cleanup(&self) -> bool {
        self.control.get().is_some_and(|control| !control.running.is_empty())
    }

    /// Returns the ticks that its cleanups may still use; `None` if they have no allowance, or none runs.
    #[inline]
    pub(crate) fn cleanup_ticks_left(&self) -> Option<u64> {
        let bound = self.control.get()?.bound();
        (bound.ticks != u64::MAX).then(|| bound.ticks.saturating_sub(self.ticks))
    }

    /// Returns the entry of its outermost limit that has expired, of those that were opened in the cleanup
    /// with the entry `cleanup`, if there is one; and the cause.
    pub(crate) fn expired_limit(&self, cleanup: Option<usize>) -> Option<(usize, Value)> {
        let limits = self.extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
        let inside = limits.iter().filter(|limit| cleanup.is_none_or(|entry| entry < limit.entry as usize));
        inside.into_iter().find_map(|limit| Some((limit.entry as usize, limit.expired?)))
    }

    /// Begins to unwind it to its root, which ends it.
    pub(crate) fn begin_end(&mut self, end: TaskEnd) {
        self.control.unwinding = Some(Unwinding { target: UnwindTarget::Root(end), values: Vec::new() });
    }

    /// Returns the unwinding that goes on when the entry of a cleanup that was cut off has been popped.
    /// `interrupted` is the unwinding that the cleanup has interrupted.
    pub(crate) fn after_cut_off(&mut self, interrupted: Option<Unwinding>) -> Unwinding {
        if let Some(interrupted) = interrupted {
            return interrupted;
        }
        // It followed a form that had returned. The reason for its end concerns the whole task or a form
        // further out; if a cleanup is around it, that cleanup ends.
        if let Some(entry) = self.control.innermost_cleanup() {
            return Unwinding { target: UnwindTarget::Cleanup(entry), values: Vec::new() };
        }
        if !self.flags.abort_pending()
            && let Some((entry, cause)) = self.expired_limit(None)
        {
            return Unwinding { target: UnwindTarget::Limit(entry), values: vec![cause] };
        }
        let end = if self.flags.abort_pending() { TaskEnd::Aborted } else { TaskEnd::Spent };
        self.flags.set_abort_pending(false);
        self.flags.set_urgent(true);
        Unwinding { target: UnwindTarget::Root(end), values: Vec::new() }
    }

    /// Returns the values with which it has succeeded, if it has and they are kept for the embedder.
    pub(crate) fn values(&self) -> Option<&[Value]> {
        let extra = self.extra.as_ref()?;
        matches!(extra.end, Some(TaskEnd::Succeeded)).then_some(&*extra.values)
    }

    /// Returns its result, as far as that is kept for the embedder.
    pub(crate) fn result(&self) -> TaskResult {
        let Some(extra) = &self.extra else { return TaskResult::Running };
        match extra.end {
            Some(TaskEnd::Succeeded) => TaskResult::Succeeded(extra.values.clone()),
            Some(TaskEnd::Failed(condition)) => TaskResult::Failed(condition),
            Some(TaskEnd::Aborted) => TaskResult::Aborted,
            // A budget that was spent is noted as a failure.
            Some(TaskEnd::Spent) | None => TaskResult::Running,
        }
    }
}

/// Bytes of a task beside its stack: its record, its place in the table, in a queue and among the timers, and
/// what the allocator takes for itself.
const RECORD_BYTES: usize = size_of::<Task>() + 160;

/// Bytes in which the heap counts what a task takes.
const UNIT: usize = 16;

/// Priority of a task that is given none.
pub(crate) const DEFAULT_PRIORITY: u8 = 4;
/// Highest priority.
pub(crate) const HIGHEST_PRIORITY: u8 = PRIORITIES as u8 - 1;
/// Number of priorities.
pub(crate) const PRIORITIES: usize = 8;

const _: () = assert!(size_of::<Task>() <= 120, "there may be a million tasks");

stored_enum! { TaskState { Runnable = 0, Waiting = 1, Reading = 2, Writing = 3, Ended = 4 } }
stored_enum! { Shortage { None = 0, Noted = 1, Collected = 2 } }
stored! { Flags { 0 } }
stored! { Extra { report, end, values, limits, fund, interrupts } }
stored! { Task {
    object, number, wait, control, extra, flags, state, priority, critical, has_deadline, stack, pc, notify, ticks,
    serial, scanned, base, turns, account, counted,
} }

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_independent() {
        let mut flags = Flags::default();
        flags.set_daemon(true);
        flags.set_kept(true);
        flags.set_daemon(false);
        assert!(flags.kept() && !flags.daemon());
    }
}
