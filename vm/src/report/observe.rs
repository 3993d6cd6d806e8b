//! Telling observers what happens.

use esl_host::FailureRow;

use super::{
    arguments_label, cause_label, event_label, label_of, place_in_program, reason_of, report_in_short,
    task_label,
};
use crate::observe::{Coming, Observer, Seen};
use crate::task::{TaskIndex, TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

impl Vm {
    /// Lets an observer watch the run from now on. It learns of the tasks that are there.
    pub fn add_observer(&mut self, observer: Box<dyn Observer>) {
        let Vm { watch, outside, scheduler, .. } = self;
        watch.observers.list.retain(|observer| !observer.is_over());
        watch.observers.begin(&mut outside.host, scheduler);
        watch.observers.list.push(observer);
        watch.update_is_watched();
        let time = watch.observers.time(&mut outside.host, scheduler);
        let tasks: Vec<(TaskNumber, String, [bool; 2], Option<String>)> = self
            .scheduler
            .tasks
            .iter()
            .filter(|task| task.state != TaskState::Ended)
            .map(|task| {
                let reason = (task.state != TaskState::Runnable).then(|| reason_of(self, task));
                let is_suspended = self.scheduler.is_suspended(&self.heap, task);
                (task.number, task_label(self, task.object), [task.flags.hidden(), is_suspended], reason)
            })
            .collect();
        let Some(observer) = self.watch.observers.list.last_mut() else { return };
        for (number, name, [is_hidden, is_suspended], reason) in tasks {
            observer.see(time, number, Seen::Begins { name: &name, is_hidden });
            let seen = match &reason {
                None => Seen::IsReady,
                Some(reason) if is_suspended => Seen::IsSuspended(reason),
                Some(reason) => Seen::Waits(reason),
            };
            observer.see(time, number, seen);
        }
    }

    /// Has a journal kept of failures and late timers from now on, for surveys.
    pub fn keep_journal(&mut self) {
        self.watch.journal.is_kept = true;
        self.watch.tells_variables = true;
        self.watch.update_is_watched();
    }

    /// Has the reports of failures kept with the variables of their frames from now on, for
    /// [`Vm::detailed_report`].
    pub fn tell_variables(&mut self) {
        self.watch.tells_variables = true;
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
    if vm.watch.observers.list.is_empty() {
        return;
    }
    let number = vm.scheduler.running_number();
    let event = event_label(vm, event);
    show(vm, number, Seen::Signals(&event));
}

/// Notes in the journal that the running task fails.
fn note_failure(vm: &mut Vm, cause: &str, condition: Value, arguments: Value) {
    let task = vm.scheduler.task();
    let place = place_in_program(vm, task, vm.frames());
    let row = FailureRow {
        number: 0,
        time: vm.scheduler.clock.now,
        task: task.number.0,
        name: label_of(vm, vm.heap.slot_or_nil(task.object, event::NAME), task.number),
        cause: cause.into(),
        arguments: arguments_label(vm, condition, arguments),
        place: place.map(|place| format!("{}:{}:{}", place.source, place.line, place.column)),
        report: None,
        full_report: None,
        frames: Vec::new(),
    };
    vm.watch.journal.note_failure(row);
}

/// Notes in the journal that a failure has ended the running task, with its report.
pub(crate) fn note_end_by_failure(vm: &mut Vm, condition: Value, history: Option<Value>) {
    let task = vm.scheduler.task();
    let report = task.extra.as_ref().and_then(|extra| extra.report.as_ref());
    let text = report.map_or_else(|| report_in_short(&vm.heap, condition), |report| report.detailed_text());
    // A task that belongs to a form has no report, but the history that the form is given.
    let of_history = || history.map(|history| vm.frames_of_history(history, task.object)).unwrap_or_default();
    let frames = report.map_or_else(of_history, |report| report.frames.to_vec());
    let full = report.and_then(|report| report.full_text());
    vm.watch.journal.note_end(task.number.0, text, full, frames);
}

/// Tells observers that the running task fails with a condition, or with a cause and a list of arguments.
pub(crate) fn tell_of_failure(vm: &mut Vm, failure: Value, arguments: Value) {
    let number = vm.scheduler.task().number;
    let cause = cause_label(&vm.heap, failure);
    if vm.watch.journal.is_kept {
        note_failure(vm, &cause, failure, arguments);
    }
    show(vm, number, Seen::Fails(&cause));
}

/// Tells observers that the running task recovers from a failure.
pub(crate) fn tell_of_recovery(vm: &mut Vm, failure: Value) {
    let number = vm.scheduler.task().number;
    let cause = cause_label(&vm.heap, failure);
    if vm.watch.journal.is_kept {
        vm.watch.journal.recoveries += 1;
    }
    show(vm, number, Seen::Recovers(&cause));
}

/// Tells observers that the running task has asserted or retracted a fact.
#[cold]
pub(crate) fn tell_of_change(vm: &mut Vm, fact: Value, is_there: bool) {
    let number = vm.scheduler.running_number();
    let fact = vm.describe(fact);
    show(vm, number, Seen::Changes { fact: &fact, is_there });
}
