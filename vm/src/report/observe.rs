//! Telling observers what happens.

use super::{cause_label, event_label, reason_of, task_label};
use crate::observe::{Coming, Observer, Seen};
use crate::task::{Flags, TaskIndex, TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;

impl Vm {
    /// Lets an observer watch the run from now on. It learns of the tasks that are there.
    pub fn add_observer(&mut self, observer: Box<dyn Observer>) {
        let Vm { watch, outside, scheduler, .. } = self;
        watch.observers.begin(&mut outside.host, scheduler);
        watch.observers.list.push(observer);
        watch.update_is_watched();
        let time = watch.observers.time(&mut outside.host, scheduler);
        let tasks: Vec<(TaskNumber, String, Flags, Option<String>)> = self
            .scheduler
            .tasks
            .iter()
            .filter(|task| task.state != TaskState::Ended)
            .map(|task| {
                let reason = (task.state != TaskState::Runnable).then(|| reason_of(self, task));
                (task.number, task_label(self, task.object), task.flags, reason)
            })
            .collect();
        let Some(observer) = self.watch.observers.list.last_mut() else { return };
        for (number, name, flags, reason) in tasks {
            let is_hidden = flags.hidden();
            observer.see(time, number, Seen::Begins { name: &name, is_hidden });
            let seen = match &reason {
                None => Seen::IsReady,
                Some(reason) if flags.suspended() => Seen::IsSuspended(reason),
                Some(reason) => Seen::Waits(reason),
            };
            observer.see(time, number, seen);
        }
    }

    /// Returns the place where other threads leave observers.
    pub fn coming_observers(&self) -> Coming {
        self.watch.coming.clone()
    }

    /// Lets go of all observers, after they were told what they do not know yet.
    pub fn take_observers(&mut self) -> Vec<Box<dyn Observer>> {
        self.watch.observers.tell_unsaid();
        let list = std::mem::take(&mut self.watch.observers).list;
        self.watch.update_is_watched();
        list
    }
}

/// Tells observers of something, if there are any.
pub(crate) fn show(vm: &mut Vm, task: TaskNumber, seen: Seen<'_>) {
    vm.watch.show(&mut vm.outside.host, &vm.scheduler, task, seen);
}

/// Tells observers that a signal of `event` by a task has woken the one with this index.
pub(crate) fn tell_of_waking(vm: &mut Vm, event: Value, by: TaskNumber, index: TaskIndex) {
    let Some(number) = vm.scheduler.tasks.at(index).map(|task| task.number) else { return };
    let event = event_label(vm, event);
    show(vm, number, Seen::IsWokenBy { task: by, event: &event });
}

/// Tells observers that the running task has signalled `event`.
pub(crate) fn tell_of_signal(vm: &mut Vm, event: Value) {
    let number = vm.scheduler.running_number();
    let event = event_label(vm, event);
    show(vm, number, Seen::Signals(&event));
}

/// Tells observers that the running task fails, or recovers.
pub(crate) fn tell_of_failure(vm: &mut Vm, condition: Value, recovers: bool) {
    let number = vm.scheduler.task().number;
    let cause = cause_label(&vm.heap, condition);
    show(vm, number, if recovers { Seen::Recovers(&cause) } else { Seen::Fails(&cause) });
}

/// Tells observers that the running task has asserted or retracted a fact.
#[cold]
pub(crate) fn tell_of_change(vm: &mut Vm, fact: Value, is_there: bool) {
    let number = vm.scheduler.running_number();
    let fact = vm.describe(fact);
    show(vm, number, Seen::Changes { fact: &fact, is_there });
}
