//! The turn of the running task.

use crate::task::End;

/// How a task comes to be parked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Parking {
    /// For input from outside.
    #[default]
    Input,
    /// For a signal, or until a time in nanoseconds.
    Wait(Option<u64>),
}

/// State of the running task that is over with its turn.
pub(crate) struct Turn {
    /// Place of the task, which is free while it runs.
    pub(crate) index: u32,
    /// Ticks left of its critical section.
    pub(crate) critical_left: i64,
    /// Whether its critical section has begun in this slice, whose ticks so far do not count.
    pub(crate) critical_is_new: bool,
    /// Whether its slice was cut short and goes on with another one.
    pub(crate) slice_is_cut: bool,
    /// Whether it lets others have their turns.
    pub(crate) passes_turn: bool,
    /// Whether it is to be held back.
    pub(crate) holds_task: bool,
    /// Whether something was noted of it when its slice began.
    pub(crate) had_attention: bool,
    /// Why it is about to park.
    pub(crate) parking: Parking,
    /// How it ends, once its unwinding has reached the root.
    pub(crate) ending: Option<End>,
}

impl Default for Turn {
    fn default() -> Turn {
        Turn {
            index: u32::MAX,
            critical_left: 0,
            critical_is_new: false,
            slice_is_cut: false,
            passes_turn: false,
            holds_task: false,
            had_attention: false,
            parking: Parking::default(),
            ending: None,
        }
    }
}
