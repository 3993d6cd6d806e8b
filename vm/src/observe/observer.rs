//! Watching a run from outside: an [`Observer`] is told what happens to tasks, of signals, failures and collections.
//!
//! Guarantees: what an observer is told comes in the order of time, and depends on the run alone; whether somebody watches changes nothing
//! in the run. A turn that follows on one of the same task, with nothing between them, is one turn.
//! Not here: what is made of it; nothing is kept.
//!
//! Times are in nanoseconds since the observer came. Where time is virtual, and stands still while tasks run, each tick
//! counts as one nanosecond more, so that work has a length.

/// What an observer is told.
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
    /// Its turn begins.
    Runs,
    /// It could run, but another one does.
    IsReady,
    /// It waits, for what this says.
    Waits(&'a str),
    /// Its end is asked for.
    IsToEnd,
    /// It has ended, as this says: `succeeded`, `failed` or `aborted`.
    Ends(&'a str),
    /// It has signalled the event of this name. The task is 0 if none did.
    Signals(&'a str),
    /// A signal that was just given by another task, or by none (0), has ended its wait.
    IsWokenBy {
        /// The task that gave the signal.
        task: u64,
        /// The name of the event.
        event: &'a str,
    },
    /// It fails, with this cause.
    Fails(&'a str),
    /// A recovery procedure begins to deal with a failure of this cause.
    Recovers(&'a str),
    /// The collector begins a cycle. The task is 0, as for all that the collector does.
    CollectionBegins,
    /// The collector begins a turn, in which no task runs.
    PauseBegins,
    /// The collector's turn is over.
    PauseEnds,
    /// The collector has ended a cycle.
    CollectionEnds,
}

/// Somebody who watches a run.
pub trait Observer: Send {
    /// Is told what happens, to the task of a number, and when in nanoseconds.
    fn see(&mut self, time: u64, task: u64, seen: Seen<'_>);
}

/// Who watches, and what they have yet to be told.
#[derive(Default)]
pub(crate) struct Observers {
    pub(crate) list: Vec<Box<dyn Observer>>,
    /// Whether time is virtual.
    pub(crate) is_virtual: bool,
    /// The time when the first of them came, and the latest that they were told.
    pub(crate) start: u64,
    pub(crate) latest: u64,
    /// The time at which the turn of a task was over that may go on at once.
    pub(crate) unsaid: Option<(u64, u64)>,
    /// Whether a cycle of the collector is under way.
    pub(crate) collects: bool,
}

impl Observers {
    pub(crate) fn tell(&mut self, time: u64, task: u64, seen: Seen<'_>) {
        // A clock that is read twice may seem to go back where two are mixed.
        self.latest = self.latest.max(time);
        for observer in &mut self.list {
            observer.see(self.latest, task, seen);
        }
    }
}
