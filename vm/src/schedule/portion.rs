//! Portions of a run: the embedder may give a run its ticks in portions, which changes nothing in the run.
//!
//! So the end of a portion ends no turn. The state of the slice that it falls into is kept, and the next
//! portion begins with the rest of that slice. Until then no counter that a program can see has changed.

use esl_heap::list_state;

use crate::task::{AccountId, TaskId};

/// A slice of which ticks are left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenSlice {
    /// Ticks left of it.
    pub(crate) left: u64,
    /// Ticks used of it, which its task was not charged yet.
    pub(crate) used: u64,
    /// Bytes allocated in it, if an account counts them, which its task was not charged either.
    pub(crate) bytes: u64,
    /// Account that they will be charged to.
    pub(crate) account: AccountId,
    /// Number of the collector's turns in it.
    pub(crate) collections: u32,
}

/// A turn into which the end of a portion has fallen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OpenTurn {
    /// Task whose turn it is.
    pub(crate) task: TaskId,
    /// Slice under way; `None` if the turn goes on with another slice.
    pub(crate) slice: Option<OpenSlice>,
}

list_state! { OpenSlice { left: Run, used: Run, bytes: Run, account: Run, collections: Run } }
list_state! { OpenTurn { task: Run, slice: Run } }
