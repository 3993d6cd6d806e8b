//! Events, and the waits of tasks for them.
//!
//! An event is an object of the heap with a count of its signals and a list of those who wait. A task is an event too: its
//! checkpoints and its end signal it. A wait is an object as well, one link for each event that it is for:
//!
//! ```text
//! event | name | count | first | last |          task | as an event | state | result | checkpoints |
//!                          |       +-----------------------------+
//! wait  | owner | event | previous | next | more | queue | deadline |
//! ```
//!
//! Guarantees (signals are in `wait/signal.rs`): a signal reaches everybody who waits when it is given, in the order in which they began; to look at a count and
//! to begin to wait is one step; a wait that has ended is in no list. A wait is either for one signal, and is over with it,
//! or keeps them: then signals are queued until it is closed, and none is lost.
//! Not here: whose turn it is (`schedule`), and what ends a wait from outside (`limit`).

use crate::value::Value;

mod delivery;

pub(crate) use delivery::Delivery;

/// Slots of an event.
pub(crate) mod event {
    /// What it is called: anything, or `NIL`.
    pub(crate) const NAME: usize = 0;
    /// How often it was signalled.
    pub(crate) const COUNT: usize = 1;
    /// The wait that began first, or `NIL`.
    pub(crate) const FIRST: usize = 2;
    /// The wait that began last, or `NIL`.
    pub(crate) const LAST: usize = 3;
    /// Of a task: its place while it lives, then its status.
    pub(crate) const STATE: usize = 4;
    /// Of a task: the number of the task that made it; when it has ended, its value or values, or the condition.
    pub(crate) const RESULT: usize = 5;
    /// Of a task: the checkpoints that it has passed.
    pub(crate) const CHECKPOINTS: usize = 6;
    /// Number of slots of a task.
    pub(crate) const TASK_LENGTH: usize = 7;
}

/// Slots and flags of a wait.
pub(crate) mod link {
    /// The task; in the links after the first, the first.
    pub(crate) const OWNER: usize = 0;
    /// The event whose list it is in, or `NIL`.
    pub(crate) const EVENT: usize = 1;
    /// The links before and after it in that list.
    pub(crate) const PREVIOUS: usize = 2;
    pub(crate) const NEXT: usize = 3;
    /// The next link of the same wait; in the last, what is waited for, for reports.
    pub(crate) const MORE: usize = 4;
    /// The arguments of the signal; of a wait that keeps signals, a pair of the first and the last of a list of them.
    pub(crate) const QUEUE: usize = 5;
    /// When it ends by itself, in nanoseconds, or `NIL`.
    pub(crate) const DEADLINE: usize = 6;
    pub(crate) const LENGTH: usize = 7;

    /// Flag: signals are kept until the wait is closed.
    pub(crate) const KEEPS: u8 = 1;
    /// Flag: its signal has come.
    pub(crate) const SIGNALLED: u8 = 2;
    /// Flag: who waits goes on without delay.
    pub(crate) const URGENT: u8 = 4;
    /// Flag: it is for the end of a child, which is bounded.
    pub(crate) const CHILD: u8 = 8;
}

/// What a wait is like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WaitOptions {
    /// Whether signals are kept.
    pub keeps: bool,
    /// Whether who waits goes on without delay.
    pub urgent: bool,
    /// Whether it is for the end of a child.
    pub child: bool,
    /// When it ends by itself.
    pub deadline: Option<u64>,
    /// What is waited for, for reports; `NIL` if the events say it.
    pub what: Value,
}

impl Default for WaitOptions {
    fn default() -> WaitOptions {
        WaitOptions { keeps: false, urgent: false, child: false, deadline: None, what: Value::NIL }
    }
}
