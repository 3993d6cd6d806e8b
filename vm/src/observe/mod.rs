//! Watching a run: its observers, and the figures gathered about it.
//!
//! Observation changes nothing in the run. Not here: the texts about tasks and events (`report`).

mod figures;
mod journal;
mod meter;
mod observer;

pub(crate) use figures::Figures;
pub use figures::{Pauses, TaskFigures};
pub(crate) use journal::Journal;
pub(crate) use meter::Meter;
pub use meter::UsedResources;
pub(crate) use observer::Observers;
pub use observer::{Coming, Observer, Seen};

use esl_bytecode::compile::SourcePlace;
use esl_host::{FrameVariable, Host};

use crate::schedule::Scheduler;
use crate::task::TaskNumber;

/// A frame of a task that does not run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StandingFrame {
    /// Name of the function.
    pub function: String,
    /// Where in its source it stands.
    pub place: Option<SourcePlace>,
    /// The variables that are in scope there.
    pub variables: Vec<FrameVariable>,
}

/// The calls in which a task stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenCalls {
    /// The task, as reports call it.
    pub task: String,
    /// Names of the functions, innermost first.
    pub functions: Vec<String>,
    /// Where the innermost call stands, if that is known.
    pub place: Option<SourcePlace>,
}

/// All data about a run that exist for its observation.
#[derive(Default)]
pub(crate) struct Watch {
    /// Whether failures and collections are to be noted or sent to observers.
    pub(crate) is_watched: bool,
    /// Whether each turn, signal and fact is to be noted, too.
    pub(crate) is_followed: bool,
    /// Whether reports of failures are kept with the variables of their frames.
    pub(crate) tells_variables: bool,
    /// Whether turns are to be told of, or measured.
    pub(crate) are_turns_noted: bool,
    /// The observers.
    pub(crate) observers: Observers,
    /// Observers on their way.
    pub(crate) coming: Coming,
    /// The figures.
    pub(crate) figures: Figures,
    /// The consumption of tasks in their turns.
    pub(crate) meter: Meter,
    /// The latest failures and delays, for surveys.
    pub(crate) journal: Journal,
    /// Whether the trace of tasks is written to the stream for reports.
    pub(crate) traces_tasks: bool,
    /// How often control has passed each counted place; `None` unless passages are counted.
    pub(crate) passages: Option<Vec<u64>>,
}

impl Watch {
    /// Updates `is_watched`, `is_followed` and `are_turns_noted`.
    pub(crate) fn update_is_watched(&mut self) {
        self.is_followed = self.traces_tasks || !self.observers.list.is_empty() || self.figures.of_tasks;
        self.are_turns_noted = self.is_followed || self.meter.is_on;
        self.is_watched = self.are_turns_noted || self.figures.are_wanted || self.journal.is_kept;
    }

    /// Counts that control passes a place, if that is wanted.
    pub(crate) fn note_passage(&mut self, place: usize) {
        let Some(passages) = &mut self.passages else { return };
        if place >= passages.len() {
            passages.resize(place + 1, 0);
        }
        passages[place] += 1;
    }

    /// Tells observers of something, if there are any.
    pub(crate) fn show(
        &mut self,
        host: &mut dyn Host,
        scheduler: &Scheduler,
        task: TaskNumber,
        seen: Seen<'_>,
    ) {
        if !self.observers.list.is_empty() {
            let time = self.observers.time(host, scheduler);
            self.observers.show(time, task, seen);
        }
    }

    /// Notes that the turn of a task is over, though the task could run on.
    pub(crate) fn end_turn(&mut self, host: &mut dyn Host, scheduler: &Scheduler, task: TaskNumber) {
        if !self.observers.list.is_empty() {
            let time = self.observers.time(host, scheduler);
            self.observers.end_turn(time, task);
        }
    }

    /// Begins a turn of the collector, and returns its time by the host's stopwatch, in nanoseconds.
    pub(crate) fn begin_pause(&mut self, host: &mut dyn Host, scheduler: &Scheduler) -> u64 {
        if !std::mem::replace(&mut self.observers.collects, true) {
            self.show(host, scheduler, TaskNumber::NONE, Seen::CollectionBegins);
        }
        self.show(host, scheduler, TaskNumber::NONE, Seen::PauseBegins);
        host.stopwatch()
    }

    /// Ends the turn of the collector that began at this time. `is_last` says whether its cycle is over.
    pub(crate) fn end_pause(
        &mut self,
        host: &mut dyn Host,
        scheduler: &Scheduler,
        began: u64,
        is_last: bool,
    ) {
        self.figures.note_pause(host.stopwatch().saturating_sub(began));
        self.show(host, scheduler, TaskNumber::NONE, Seen::PauseEnds);
        if is_last {
            self.observers.collects = false;
            self.show(host, scheduler, TaskNumber::NONE, Seen::CollectionEnds);
        }
    }
}
