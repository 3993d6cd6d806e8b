//! Watching a run: who is told of it, and the figures that are gathered of it.

mod figures;
mod observer;

pub(crate) use figures::Figures;
pub use figures::{Pauses, TaskFigures};
pub(crate) use observer::Observers;
pub use observer::{Observer, Seen};

/// Everything that is kept for those who watch a run.
#[derive(Default)]
pub(crate) struct Watch {
    /// Whether anybody has to be told what happens.
    pub(crate) is_watched: bool,
    /// The observers.
    pub(crate) observers: Observers,
    /// The figures.
    pub(crate) figures: Figures,
    /// Whether what happens to tasks is written to the stream for reports.
    pub(crate) traces_tasks: bool,
}
