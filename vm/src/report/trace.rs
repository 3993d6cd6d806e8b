//! Events of tasks, for observers; and the trace of tasks: a line for each beginning, wait, resumption,
//! request of an abort, and end.

use super::{label_of, reason_of, show, task_label};
use crate::describe::describe;
use crate::observe::Seen;
use crate::task::TaskIndex;
use crate::value::Value;
use crate::vm::Vm;

/// Event in the life of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Happening {
    /// It was made.
    Begins,
    /// It is parked.
    Waits,
    /// It can run again.
    GoesOn,
    /// It was asked to end.
    IsToEnd,
}

impl Vm {
    /// Says whether what happens to tasks is written to the stream for reports.
    pub fn trace_tasks(&mut self, on: bool) {
        self.watch.traces_tasks = on;
        self.watch.update_is_watched();
    }
}

/// Notes an event of the task with this index, for trace and observers.
#[inline]
pub(crate) fn note(vm: &mut Vm, index: TaskIndex, happening: Happening) {
    if vm.watch.is_followed {
        note_for_watchers(vm, index, happening);
    }
}

#[cold]
fn note_for_watchers(vm: &mut Vm, index: TaskIndex, happening: Happening) {
    if vm.watch.traces_tasks {
        write_trace(vm, index, happening);
    }
    let Some(task) = vm.scheduler.tasks.at(index) else { return };
    if vm.watch.observers.list.is_empty() {
        return;
    }
    let number = task.number;
    match happening {
        Happening::Begins => {
            let (name, is_hidden) = (task_label(vm, task.object), task.flags.hidden());
            show(vm, number, Seen::Begins { name: &name, is_hidden });
            show(vm, number, Seen::IsReady);
        }
        Happening::Waits => {
            let (is_suspended, reason) = (vm.scheduler.is_suspended(&vm.heap, task), reason_of(vm, task));
            show(vm, number, if is_suspended { Seen::IsSuspended(&reason) } else { Seen::Waits(&reason) });
        }
        Happening::GoesOn => show(vm, number, Seen::IsReady),
        Happening::IsToEnd => show(vm, number, Seen::IsToEnd),
    }
}

fn write_trace(vm: &mut Vm, index: TaskIndex, happening: Happening) {
    let Some(task) = vm.scheduler.tasks.at(index).filter(|task| !task.flags.hidden()) else { return };
    let label = task_label(vm, task.object);
    let what = match happening {
        Happening::Begins => "begins".into(),
        Happening::Waits => format!("waits for {}", reason_of(vm, task)),
        Happening::GoesOn => "goes on".into(),
        Happening::IsToEnd => "abort requested".into(),
    };
    write_trace_line(vm, &label, &what);
}

/// Writes how the running task has ended, if tasks are traced.
pub(crate) fn trace_end(vm: &mut Vm, name: Value, status: Value) {
    let task = vm.scheduler.task();
    if vm.watch.traces_tasks && !task.flags.hidden() {
        let label = label_of(vm, name, task.number);
        let status = describe(&vm.heap, status).trim_start_matches(':').to_lowercase();
        let what = if status == "aborted" { "was aborted".into() } else { format!("has {status}") };
        write_trace_line(vm, &label, &what);
    }
}

fn write_trace_line(vm: &mut Vm, label: &str, what: &str) {
    let seconds = vm.scheduler.clock.read(&mut vm.outside.host) as f64 / 1e9;
    vm.outside.complain(&format!("; {seconds:.6} {label} {what}\n"));
}
