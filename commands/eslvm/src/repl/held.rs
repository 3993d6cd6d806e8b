//! Forms that have failed where restarts are active, and wait for the choice of one.

use std::sync::{Arc, Mutex, PoisonError};

use esl_command::say_part;
use esl_host::{HostRows, Incoming};
use esl_vm::task::{TaskId, TaskNumber, TaskResult};
use esl_vm::vm::Vm;

use super::{FormFailure, Repl, in_short};

/// A failure at which the task of a form stands.
pub(super) struct HeldFailure {
    /// Number of the task.
    pub(super) task: TaskNumber,
    /// The report, without its last lines; and with all calls of the library.
    pub(super) story: String,
    pub(super) full: Option<String>,
    /// The line that says that there is no recovery.
    pub(super) ending: String,
    /// The list of restarts, as it is shown.
    pub(super) restarts: String,
}

/// The latest failure that a form is held at, until the session takes it.
#[derive(Clone, Default)]
pub(super) struct HeldFailures(Arc<Mutex<Option<HeldFailure>>>);

impl HeldFailures {
    /// Gives a machine the function that tells of them.
    pub(super) fn install(machine: &mut Vm) -> HeldFailures {
        let failures = HeldFailures::default();
        let (told, inbox) = (failures.clone(), machine.inbox());
        let mut rows = HostRows::new(&inbox);
        let bell = inbox.clone();
        let hold = move |task: i64, story: String, ending: String, full: Option<String>, restarts: String| {
            let task = TaskNumber(task.cast_unsigned());
            let failure = HeldFailure { task, story, full, ending, restarts };
            *told.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
            // The session comes back from the evaluation.
            bell.put(Incoming::Stop);
            Ok(())
        };
        let parameters = ["task", "story", "ending", "full", "restarts"];
        rows.at_once("%REPL-HOLD", parameters, "Tells that the form of TASK waits for a restart.", hold)
            .everywhere();
        rows.into_iter().for_each(|row| machine.add_host_row(row));
        failures
    }

    /// Takes the latest one, if it was not taken.
    pub(super) fn take(&self) -> Option<HeldFailure> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

impl Repl {
    /// Has the newest held form go on by a restart.
    pub(super) fn restart(&mut self, text: &str) {
        let Some(value) = self.call("%REPL-RESTART", text) else { return };
        let is_chosen = self.machine.export(value).is_ok_and(|datum| !datum.is_nil());
        if is_chosen && let Some(task) = self.held.pop() {
            self.attend(task);
        }
    }

    /// Sees to held forms that have ended without a choice, as by an abort.
    pub(super) fn settle_held(&mut self) {
        let is_over = |machine: &Vm, task: TaskId| !matches!(machine.result(task), TaskResult::Running);
        while let Some(at) = self.held.iter().position(|&task| is_over(&self.machine, task)) {
            let task = self.held.remove(at);
            self.attend(task);
        }
    }

    /// Takes the failure that a form is held at, if there is a new one, and shows it. Returns whether the
    /// form is that of `task`.
    pub(super) fn hold(&mut self, task: TaskId) -> bool {
        let Some(failure) = self.held_failures.take() else { return false };
        let is_it = self.machine.number_of(task) == Some(failure.task);
        let story = self.machine.report_with_variables(failure.task, &failure.story);
        let end = |story: &str| format!("{story}{}", failure.ending);
        self.machine.flush();
        let shown = in_short(&format!("{}Aborted\n", end(&failure.story)));
        say_part!("{}", shown.strip_suffix("Aborted\n").unwrap_or(&shown));
        say_part!("Restarts, chosen by `:restart N`:\n{}", failure.restarts);
        let (report, full) = (end(&story), failure.full.as_deref().map(end));
        self.failure = Some(FormFailure { report, full, noted: self.noted_failures() });
        if is_it {
            self.held.push(task);
        }
        is_it
    }
}
