//! Exploring the schedules of a program: which ways there are for it to end, and how it comes to each.
//!
//! See [`esl_vm::explore`] for what is explored, and what is not.
//!
//! ```
//! use esl::explore::{Settings, explore};
//! use esl::program::{Source, compile};
//!
//! // Both look for the fact before either asserts it.
//! let text = "(dotimes (i 2)
//!               (spawn (unless (db-query '(door open))
//!                        (assert '(door open))
//!                        (princ \"creak \"))))";
//! let program = compile(&[Source::new("door.esl", text)]).program.expect("it compiles");
//! let found = explore(&program, &Settings::default())?;
//! let mut outputs: Vec<&str> = found.endings.iter().map(|ending| &*ending.what.output).collect();
//! outputs.sort();
//! assert_eq!(outputs, ["creak ", "creak creak "]);
//! # Ok::<(), String>(())
//! ```

use std::cell::RefCell;

pub use esl_vm::explore::{Ending, Exploration, Grain, Settings};
use esl_vm::host::{Captured, VirtualHost};
use esl_vm::task::TaskId;
use esl_vm::vm::Vm;

use crate::program::{self, Ended, Program};

/// How a run has ended, and what it has written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// How it ended.
    pub ended: Ended,
    /// What was written to standard output.
    pub output: String,
    /// What was written to standard error.
    pub errors: String,
}

/// What is done to a machine before the program is loaded.
type Prepare<'a> = &'a dyn Fn(&mut Vm) -> Result<(), String>;

/// A machine that is about to run a program, its main task, and what it will write.
fn begin(program: &Program, prepare: Prepare<'_>) -> Result<(Vm, TaskId, Captured), String> {
    let host = VirtualHost::new();
    let captured = host.captured();
    let mut machine = program::machine(Default::default(), Box::new(host))?;
    prepare(&mut machine)?;
    let main = program::begin(&mut machine, program)?;
    Ok((machine, main, captured))
}

/// Runs a program under all schedules.
///
/// # Errors
/// A text, if the program could not be begun.
pub fn explore(program: &Program, settings: &Settings) -> Result<Exploration<Outcome>, String> {
    explore_with(program, settings, &|_| Ok(()))
}

/// As [`explore`], with something done to each machine before the program is loaded.
///
/// # Errors
/// As for [`explore`], and those of `prepare`.
pub fn explore_with(
    program: &Program,
    settings: &Settings,
    prepare: Prepare<'_>,
) -> Result<Exploration<Outcome>, String> {
    let present = RefCell::new(None);
    let begin = || {
        let (machine, main, captured) = begin(program, prepare)?;
        present.replace(Some((main, captured)));
        Ok(machine)
    };
    esl_vm::explore::explore(settings, begin, |machine, outcome| {
        let (main, captured) = present.take().expect("a machine that has run was begun");
        let ended = program::end(machine, main, outcome);
        Outcome { ended, output: captured.output(), errors: captured.error() }
    })
}

/// Runs a program by a list of choices that [`explore`] has found with the same settings.
///
/// # Errors
/// As for [`explore`].
pub fn follow(program: &Program, settings: &Settings, choices: &[u32]) -> Result<Outcome, String> {
    let (mut machine, main, captured) = begin(program, &|_| Ok(()))?;
    let outcome = machine.follow(settings, choices);
    let ended = program::end(&mut machine, main, outcome);
    Ok(Outcome { ended, output: captured.output(), errors: captured.error() })
}
