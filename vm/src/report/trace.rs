//! What happens to tasks, for those who watch; and what is written when tasks are traced: a line for each beginning, wait, going
//! on, request of an abort, and end.

use crate::observe::Seen;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

/// What happens to a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Happening {
    /// It was made.
    Begins,
    /// It is parked.
    Waits,
    /// It can run again.
    GoesOn,
    /// Its end is asked for.
    IsToEnd,
}

impl Vm {
    /// Has what happens to tasks written to standard error.
    pub fn trace_tasks(&mut self, on: bool) {
        self.watch.traces_tasks = on;
        self.note_who_watches();
    }

    /// Notes what happens to the task at a place, for whoever watches.
    #[inline]
    pub(crate) fn note(&mut self, index: u32, happening: Happening) {
        if self.watch.is_watched {
            self.note_for_watchers(index, happening);
        }
    }

    #[cold]
    fn note_for_watchers(&mut self, index: u32, happening: Happening) {
        if self.watch.traces_tasks {
            self.write_trace(index, happening);
        }
        let Some(task) = self.scheduler.tasks.at(index) else { return };
        let number = task.number;
        match happening {
            Happening::Begins => {
                let (name, is_hidden) = (self.task_label(task.object), task.flags.hidden());
                self.show(number, Seen::Begins { name: &name, is_hidden });
                self.show(number, Seen::IsReady);
            }
            Happening::Waits => {
                let reason = self.reason_of(task);
                self.show(number, Seen::Waits(&reason));
            }
            Happening::GoesOn => self.show(number, Seen::IsReady),
            Happening::IsToEnd => self.show(number, Seen::IsToEnd),
        }
    }

    fn write_trace(&mut self, index: u32, happening: Happening) {
        let Some(task) = self.scheduler.tasks.at(index).filter(|task| !task.flags.hidden()) else { return };
        let label = self.task_label(task.object);
        let what = match happening {
            Happening::Begins => "begins".into(),
            Happening::Waits => format!("waits for {}", self.reason_of(task)),
            Happening::GoesOn => "goes on".into(),
            Happening::IsToEnd => "is to be aborted".into(),
        };
        self.write_trace_line(&label, &what);
    }

    /// Writes how a task has ended, if tasks are traced.
    pub(crate) fn trace_end(&mut self, name: Value, status: Value) {
        if self.watch.traces_tasks && !self.scheduler.task().flags.hidden() {
            let label = self.label_of(name, self.scheduler.task().number);
            let status = self.describe(status).trim_start_matches(':').to_lowercase();
            let what = if status == "aborted" { "was aborted".into() } else { format!("has {status}") };
            self.write_trace_line(&label, &what);
        }
    }

    fn write_trace_line(&mut self, label: &str, what: &str) {
        let seconds = self.time() as f64 / 1e9;
        self.outside.complain(&format!("; {seconds:.6} {label} {what}\n"));
    }

    /// How reports call a task.
    pub(crate) fn task_label(&self, object: Value) -> String {
        let index = self.slot(object, event::STATE).as_index();
        let is_running = index == Some(self.scheduler.turn.index as usize);
        let task = if is_running { self.scheduler.running.as_deref() } else { None };
        let number = task.or_else(|| self.scheduler.tasks.at(index? as u32)).map_or(0, |task| task.number);
        self.label_of(self.slot(object, event::NAME), number)
    }

    pub(crate) fn label_of(&self, name: Value, number: u64) -> String {
        if name.is_true() {
            format!("task {}", self.describe(name))
        } else if self.scheduler.main_number == Some(number) {
            "the main task".into()
        } else if number == 0 {
            "a task that has ended".into()
        } else {
            format!("task {number}")
        }
    }
}
