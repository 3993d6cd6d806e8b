//! The turn of the running task.

use crate::task::{Shortage, TaskEnd, TaskIndex};
use esl_heap::{stored, stored_enum};

/// Why a task is about to park.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Parking {
    /// For input from outside.
    #[default]
    Input,
    /// For room for output.
    Output,
    /// For a signal, or until a time in nanoseconds.
    Wait(Option<u64>),
}

/// Consequence of a slice after which the task could run on, in order of precedence.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum TurnEnd {
    /// The ticks are used up: the task goes to the end of its queue.
    #[default]
    Spent,
    /// The slice was cut short, because its length or its account is no longer right: the task goes on with
    /// another slice, if anything is left of the turn.
    Cut,
    /// The task lets others go first: it goes to the end of its queue.
    Passed,
    /// The task is held back until all signals are delivered.
    Held,
}

/// State of the running task that is over with its turn.
#[derive(Clone)]
pub(crate) struct Turn {
    /// Index of the task.
    pub(crate) index: TaskIndex,
    /// Consequence of the present slice.
    pub(crate) end: TurnEnd,
    /// Ticks left of the turn: those of all its slices together, but for what a critical section takes
    /// beyond. `None` before the first slice.
    pub(crate) left: Option<u64>,
    /// Ticks left of the task's critical section.
    pub(crate) critical_left: i64,
    /// Whether its critical section has begun in this slice, whose ticks so far do not count.
    pub(crate) critical_is_new: bool,
    /// Whether something was noted of it when its slice began.
    pub(crate) had_attention: bool,
    /// For what want of room its last turn has ended.
    pub(crate) shortage: Shortage,
    /// Ticks used in the present slice before the present portion.
    pub(crate) used_before: u64,
    /// Why it is about to park.
    pub(crate) parking: Parking,
    /// How it ends, once its unwinding has reached the root.
    pub(crate) ending: Option<TaskEnd>,
}

impl Turn {
    /// Notes what follows on the slice, unless something else takes precedence.
    #[inline]
    pub(crate) fn end_with(&mut self, end: TurnEnd) {
        self.end = self.end.max(end);
    }

    /// Notes what a slice has used.
    #[inline]
    pub(crate) fn charge(&mut self, used: u64) {
        self.left = self.left.map(|left| left.saturating_sub(used));
    }

    /// Returns whether nothing was left of the turn at the end of the last slice.
    #[inline]
    pub(crate) fn is_spent(&self) -> bool {
        self.left == Some(0)
    }

    /// Makes up for ticks of this slice that do not count for the critical section.
    pub(crate) fn extend_critical(&mut self, ticks: u64) {
        if !self.critical_is_new {
            self.critical_left = self.critical_left.saturating_add_unsigned(ticks);
        }
    }
}

impl Default for Turn {
    fn default() -> Turn {
        Turn {
            index: TaskIndex::NONE,
            end: TurnEnd::default(),
            left: None,
            critical_left: 0,
            critical_is_new: false,
            had_attention: false,
            shortage: Shortage::default(),
            used_before: 0,
            parking: Parking::default(),
            ending: None,
        }
    }
}

stored_enum! { Parking { Input = 0, Output = 1, Wait(deadline) = 2 } }
stored_enum! { TurnEnd { Spent = 0, Cut = 1, Passed = 2, Held = 3 } }
stored! { Turn {
    index, end, left, critical_left, critical_is_new, had_attention, shortage, used_before, parking, ending,
} }
