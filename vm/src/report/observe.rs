//! Telling observers what happens.

use crate::heap::Phase;
use crate::observe::{Observer, Seen};
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

impl Vm {
    /// Lets an observer watch the run from now on. It learns of the tasks that are there.
    pub fn add_observer(&mut self, observer: Box<dyn Observer>) {
        if self.watch.observers.list.is_empty() {
            self.watch.observers.is_virtual = self.outside.host.is_virtual();
            self.watch.observers.start = self.observed_clock();
        }
        self.watch.observers.list.push(observer);
        self.note_who_watches();
        let time = self.observed_time();
        let tasks: Vec<(u64, String, bool, Option<String>)> = self
            .scheduler
            .tasks
            .iter()
            .filter(|task| task.state != TaskState::Ended)
            .map(|task| {
                let reason = (task.state != TaskState::Runnable).then(|| self.reason_of(task));
                (task.number, self.task_label(task.object), task.flags.hidden(), reason)
            })
            .collect();
        let Some(observer) = self.watch.observers.list.last_mut() else { return };
        for (number, name, is_hidden, reason) in tasks {
            observer.see(time, number, Seen::Begins { name: &name, is_hidden });
            observer.see(time, number, reason.as_deref().map_or(Seen::IsReady, Seen::Waits));
        }
    }

    /// Lets go of all observers, after they were told what they do not know yet.
    pub fn take_observers(&mut self) -> Vec<Box<dyn Observer>> {
        self.tell_what_is_unsaid();
        let list = std::mem::take(&mut self.watch.observers).list;
        self.note_who_watches();
        list
    }

    /// Notes whether anybody has to be told of anything.
    pub(crate) fn note_who_watches(&mut self) {
        self.watch.is_watched = self.watch.traces_tasks
            || !self.watch.observers.list.is_empty()
            || self.watch.figures.are_wanted();
    }

    fn observed_clock(&mut self) -> u64 {
        if self.watch.observers.is_virtual {
            self.scheduler.clock.now + self.scheduler.spent
        } else {
            self.outside.host.stopwatch()
        }
    }

    fn observed_time(&mut self) -> u64 {
        self.observed_clock().saturating_sub(self.watch.observers.start)
    }

    fn tell_what_is_unsaid(&mut self) {
        if let Some((time, task)) = self.watch.observers.unsaid.take() {
            self.watch.observers.tell(time, task, Seen::IsReady);
        }
    }

    /// Tells observers of something, if there are any.
    pub(crate) fn show(&mut self, task: u64, seen: Seen<'_>) {
        if self.watch.observers.list.is_empty() {
            return;
        }
        let time = self.observed_time();
        match seen {
            Seen::Runs if self.watch.observers.unsaid.is_some_and(|(_, last)| last == task) => {
                self.watch.observers.unsaid = None;
                return;
            }
            _ => self.tell_what_is_unsaid(),
        }
        self.watch.observers.tell(time, task, seen);
    }

    /// Notes that the turn of a task is over, though it could run on.
    pub(crate) fn tell_end_of_turn(&mut self, task: u64) {
        if !self.watch.observers.list.is_empty() {
            self.tell_what_is_unsaid();
            self.watch.observers.unsaid = Some((self.observed_time(), task));
        }
    }

    /// Tells observers that a signal of `event` by a task has woken the one at a place.
    pub(crate) fn tell_of_waking(&mut self, event: Value, by: u64, index: u32) {
        let Some(number) = self.scheduler.tasks.at(index).map(|task| task.number) else { return };
        let event = self.event_label(event);
        self.show(number, Seen::IsWokenBy { task: by, event: &event });
    }

    /// Tells observers that the running task has signalled `event`.
    pub(crate) fn tell_of_signal(&mut self, event: Value) {
        let number = self.scheduler.running.as_ref().map_or(0, |task| task.number);
        let event = self.event_label(event);
        self.show(number, Seen::Signals(&event));
    }

    /// Tells observers that the running task fails, or recovers.
    pub(crate) fn tell_of_failure(&mut self, condition: Value, recovers: bool) {
        let number = self.scheduler.task().number;
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
        if !std::mem::replace(&mut self.watch.observers.collects, true) {
            self.show(0, Seen::CollectionBegins);
        }
        self.show(0, Seen::PauseBegins);
        let began = self.outside.host.stopwatch();
        collect(self);
        let length = self.outside.host.stopwatch().saturating_sub(began);
        self.watch.figures.note_pause(length);
        self.show(0, Seen::PauseEnds);
        if self.heap.phase() == Phase::Idle {
            self.watch.observers.collects = false;
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
