//! Observers: what they are told, and what they have yet to be told.
//!
//! Guarantees: what an observer is told comes in the order of time, and depends on the run alone. A turn that
//! follows on one of the same task, with nothing between them, is one turn. Nothing is kept of what was told.
//!
//! Times are in nanoseconds since the first observer came. Where time is virtual, and stands still while
//! tasks run, each tick counts as one nanosecond more, so that work has a length.

use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_host::Host;

use crate::schedule::Scheduler;
use crate::task::TaskNumber;

/// Event reported to an observer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen<'a> {
    /// The task was made, or was there when the observer came.
    Begins {
        /// How reports call it.
        name: &'a str,
        /// Whether it belongs to the library.
        is_hidden: bool,
    },
    /// Reports call the task by another name from now on.
    IsNamed(&'a str),
    /// The task's turn begins.
    Runs,
    /// It could run, but another one does.
    IsReady,
    /// It waits, for what this says.
    Waits(&'a str),
    /// It stands still, as it was suspended: it waits to be resumed, and this names the task that suspended
    /// it.
    IsSuspended(&'a str),
    /// The task's end is asked for.
    IsToEnd,
    /// It has ended, as this says: `succeeded`, `failed` or `aborted`.
    Ends(&'a str),
    /// It has signalled the event of this name. The task is [`TaskNumber::NONE`] if none did.
    Signals(&'a str),
    /// A signal that was just given has ended its wait.
    IsWokenBy {
        /// The task that gave the signal, or [`TaskNumber::NONE`].
        task: TaskNumber,
        /// The name of the event.
        event: &'a str,
    },
    /// It fails, with this cause.
    Fails(&'a str),
    /// A recovery procedure begins to deal with a failure of this cause.
    Recovers(&'a str),
    /// A fact was asserted or retracted.
    Changes {
        /// The fact, as a short text.
        fact: &'a str,
        /// Whether it is in the database now.
        is_there: bool,
    },
    /// The collector begins a cycle. The task is [`TaskNumber::NONE`], as for all that the collector does.
    CollectionBegins,
    /// The collector begins a turn, in which no task runs.
    PauseBegins,
    /// The collector's turn is over.
    PauseEnds,
    /// The collector has ended a cycle.
    CollectionEnds,
}

/// A watcher of a run.
pub trait Observer: Send {
    /// Is told what happens to a task, and when, in nanoseconds.
    fn see(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>);

    /// Returns whether it wants to be told nothing more: the machine drops it before the next event.
    fn is_over(&self) -> bool {
        false
    }
}

/// Observers on their way to a machine, from other threads.
#[derive(Clone, Default)]
pub struct Coming(Arc<Mutex<Vec<Box<dyn Observer>>>>);

impl fmt::Debug for Coming {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Coming")
    }
}

impl Coming {
    fn list(&self) -> MutexGuard<'_, Vec<Box<dyn Observer>>> {
        // The list is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds an observer. The machine learns of it by [`Inspection::Watch`](esl_host::Inspection::Watch).
    pub fn add(&self, observer: Box<dyn Observer>) {
        self.list().push(observer);
    }

    /// Takes those that have come.
    pub(crate) fn take(&self) -> Vec<Box<dyn Observer>> {
        std::mem::take(&mut self.list())
    }
}

/// The observers of a run, and what they have yet to be told.
#[derive(Default)]
pub(crate) struct Observers {
    /// The observers.
    pub(crate) list: Vec<Box<dyn Observer>>,
    /// Time at which the first of them came.
    pub(crate) start: u64,
    /// Latest time that they were told.
    pub(crate) latest: u64,
    /// End of a turn not yet reported, since the same task may run on.
    pub(crate) unsaid: Option<(u64, TaskNumber)>,
    /// Whether a cycle of the collector is under way.
    pub(crate) collects: bool,
}

impl Observers {
    /// Notes the time, if the first observer is about to come.
    pub(crate) fn begin(&mut self, host: &mut dyn Host, scheduler: &Scheduler) {
        if self.list.is_empty() {
            self.start = self.clock(host, scheduler);
        }
    }

    fn clock(&self, host: &mut dyn Host, scheduler: &Scheduler) -> u64 {
        if scheduler.clock.is_virtual { scheduler.clock.now + scheduler.spent } else { host.stopwatch() }
    }

    /// Returns the time since the first observer came.
    pub(crate) fn time(&self, host: &mut dyn Host, scheduler: &Scheduler) -> u64 {
        self.clock(host, scheduler).saturating_sub(self.start)
    }

    /// Tells observers of something.
    pub(crate) fn show(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        match seen {
            Seen::Runs if self.unsaid.is_some_and(|(_, last)| last == task) => {
                self.unsaid = None;
                return;
            }
            _ => self.tell_unsaid(),
        }
        self.tell(time, task, seen);
    }

    /// Notes that the turn of a task is over, though the task could run on.
    pub(crate) fn end_turn(&mut self, time: u64, task: TaskNumber) {
        self.tell_unsaid();
        self.unsaid = Some((time, task));
    }

    /// Tells observers what they have yet to be told.
    pub(crate) fn tell_unsaid(&mut self) {
        if let Some((time, task)) = self.unsaid.take() {
            self.tell(time, task, Seen::IsReady);
        }
    }

    fn tell(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        // A clock that is read twice may seem to go back where two are mixed.
        self.latest = self.latest.max(time);
        self.list.retain(|observer| !observer.is_over());
        for observer in &mut self.list {
            observer.see(self.latest, task, seen);
        }
    }
}
