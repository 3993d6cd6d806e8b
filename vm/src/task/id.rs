//! Numbers by which tasks, their states and their limits are told apart.

use esl_heap::list_state;
use esl_heap::stored;
use std::fmt;

/// Index of a task in the table of tasks. Used again after the task's end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct TaskIndex(pub(crate) u32);

list_state! { TaskIndex { 0: Run } }
list_state! { TaskNumber { 0: Run } }
list_state! { Serial { 0: Run } }
list_state! { LimitNumber { 0: Run } }

impl TaskIndex {
    /// Index of no task.
    pub(crate) const NONE: TaskIndex = TaskIndex(u32::MAX);

    /// Returns the index as the table uses it.
    #[inline]
    pub(crate) const fn as_usize(self) -> usize {
        self.0 as usize
    }
}

/// Ordinal of a task, counted from the machine's first task, which is 1. Never used again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TaskNumber(pub u64);

impl TaskNumber {
    /// Stands for no task, where the machine itself or the embedder acts.
    pub const NONE: TaskNumber = TaskNumber(0);
}

impl fmt::Display for TaskNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Serial number of a task's state: changes whenever the task is queued, held or parked.
///
/// Places in queues and timers note it, so an outdated one is recognised and need not be searched for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Serial(pub(crate) u64);

impl Serial {
    /// Advances to the next number, and returns it.
    #[inline]
    pub(crate) fn advance(&mut self) -> Serial {
        self.0 += 1;
        *self
    }
}

/// Number of a limit, unique in the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct LimitNumber(pub(crate) Serial);

stored! { TaskIndex { 0 } }
stored! { TaskNumber { 0 } }
stored! { Serial { 0 } }
stored! { LimitNumber { 0 } }
