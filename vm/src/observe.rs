//! Watching a run from outside: an [`Observer`] is told what happens to tasks, of signals, failures and collections.
//!
//! Guarantees: what an observer is told comes in the order of time, and depends on the run alone; whether somebody watches changes nothing
//! in the run. A turn that follows on one of the same task, with nothing between them, is one turn.
//! Not here: what is made of it; nothing is kept.
//!
//! Times are in nanoseconds since the observer came. Where time is virtual, and stands still while tasks run, each tick
//! counts as one nanosecond more, so that work has a length.

use crate::heap::Phase;
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

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
    list: Vec<Box<dyn Observer>>,
    /// Whether time is virtual.
    is_virtual: bool,
    /// The time when the first of them came, and the latest that they were told.
    start: u64,
    latest: u64,
    /// The time at which the turn of a task was over that may go on at once.
    unsaid: Option<(u64, u64)>,
    /// Whether a cycle of the collector is under way.
    collects: bool,
}

impl Observers {
    fn tell(&mut self, time: u64, task: u64, seen: Seen<'_>) {
        // A clock that is read twice may seem to go back where two are mixed.
        self.latest = self.latest.max(time);
        for observer in &mut self.list {
            observer.see(self.latest, task, seen);
        }
    }
}

impl Vm {
    /// Lets an observer watch the run from now on. It learns of the tasks that are there.
    pub fn add_observer(&mut self, observer: Box<dyn Observer>) {
        if self.observers.list.is_empty() {
            self.observers.is_virtual = self.host.is_virtual();
            self.observers.start = self.observed_clock();
        }
        self.observers.list.push(observer);
        self.note_who_watches();
        let time = self.observed_time();
        let tasks: Vec<(u64, String, bool, Option<String>)> = self
            .tasks
            .iter()
            .filter(|task| task.state != TaskState::Ended)
            .map(|task| {
                let reason = (task.state != TaskState::Runnable).then(|| self.reason_of(task));
                (task.number, self.task_label(task.object), task.flags.hidden(), reason)
            })
            .collect();
        let Some(observer) = self.observers.list.last_mut() else { return };
        for (number, name, is_hidden, reason) in tasks {
            observer.see(time, number, Seen::Begins { name: &name, is_hidden });
            observer.see(time, number, reason.as_deref().map_or(Seen::IsReady, Seen::Waits));
        }
    }

    /// Lets go of all observers, after they were told what they do not know yet.
    pub fn take_observers(&mut self) -> Vec<Box<dyn Observer>> {
        self.tell_what_is_unsaid();
        let list = std::mem::take(&mut self.observers).list;
        self.note_who_watches();
        list
    }

    /// Notes whether anybody has to be told of anything.
    pub(crate) fn note_who_watches(&mut self) {
        self.is_watched = self.traces_tasks || !self.observers.list.is_empty() || self.figures.are_wanted();
    }

    fn observed_clock(&mut self) -> u64 {
        if self.observers.is_virtual { self.now + self.spent } else { self.host.stopwatch() }
    }

    fn observed_time(&mut self) -> u64 {
        self.observed_clock().saturating_sub(self.observers.start)
    }

    fn tell_what_is_unsaid(&mut self) {
        if let Some((time, task)) = self.observers.unsaid.take() {
            self.observers.tell(time, task, Seen::IsReady);
        }
    }

    /// Tells observers of something, if there are any.
    pub(crate) fn show(&mut self, task: u64, seen: Seen<'_>) {
        if self.observers.list.is_empty() {
            return;
        }
        let time = self.observed_time();
        match seen {
            Seen::Runs if self.observers.unsaid.is_some_and(|(_, last)| last == task) => {
                self.observers.unsaid = None;
                return;
            }
            _ => self.tell_what_is_unsaid(),
        }
        self.observers.tell(time, task, seen);
    }

    /// Notes that the turn of a task is over, though it could run on.
    pub(crate) fn tell_end_of_turn(&mut self, task: u64) {
        if !self.observers.list.is_empty() {
            self.tell_what_is_unsaid();
            self.observers.unsaid = Some((self.observed_time(), task));
        }
    }

    /// Tells observers that a signal of `event` by a task has woken the one at a place.
    pub(crate) fn tell_of_waking(&mut self, event: Value, by: u64, index: u32) {
        let Some(number) = self.tasks.at(index).map(|task| task.number) else { return };
        let event = self.event_label(event);
        self.show(number, Seen::IsWokenBy { task: by, event: &event });
    }

    /// Tells observers that the running task has signalled `event`.
    pub(crate) fn tell_of_signal(&mut self, event: Value) {
        let number = self.running.as_ref().map_or(0, |task| task.number);
        let event = self.event_label(event);
        self.show(number, Seen::Signals(&event));
    }

    /// Tells observers that the running task fails, or recovers.
    pub(crate) fn tell_of_failure(&mut self, condition: Value, recovers: bool) {
        let number = self.task().number;
        let cause = self.cause_label(condition);
        self.show(number, if recovers { Seen::Recovers(&cause) } else { Seen::Fails(&cause) });
    }

    /// What a condition is called where it is said that it was signalled: its cause, or the name of its type.
    fn cause_label(&self, condition: Value) -> String {
        let Some(class) = self.heap.structure_class(condition) else { return self.describe(condition) };
        let name = self.describe(self.class_name(class));
        if name == "FAILURE" {
            let cause = self.heap.structure_slots(condition).and_then(|slots| slots.first());
            cause.map_or(name, |&cause| self.describe(cause))
        } else {
            format!(":{name}")
        }
    }

    /// The collector's turn, with observers and figures told of it.
    pub(crate) fn watched_pause(&mut self, collect: impl FnOnce(&mut Vm)) {
        if !std::mem::replace(&mut self.observers.collects, true) {
            self.show(0, Seen::CollectionBegins);
        }
        self.show(0, Seen::PauseBegins);
        let began = self.host.stopwatch();
        collect(self);
        let length = self.host.stopwatch().saturating_sub(began);
        self.figures.note_pause(length);
        self.show(0, Seen::PauseEnds);
        if self.heap.phase() == Phase::Idle {
            self.observers.collects = false;
            self.show(0, Seen::CollectionEnds);
        }
    }

    /// How a task has ended, in a word.
    pub(crate) fn end_label(&self, task: &Task) -> &'static str {
        let status = self.slot(task.object, event::STATE);
        let known = &self.world.known;
        match status {
            status if status == known.succeeded => "succeeded",
            status if status == known.failed => "failed",
            _ => "aborted",
        }
    }
}
