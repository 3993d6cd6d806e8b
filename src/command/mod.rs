//! The common part of the commands `eslc` and `eslvm`: exit statuses, reading their files, showing
//! diagnostics.
//!
//! ```
//! use esl::command::{BUDGET_OR_MEMORY_SPENT, exit_status, parse_size};
//! use esl::program::Ended;
//!
//! assert_eq!(exit_status(Ended::BudgetSpent), BUDGET_OR_MEMORY_SPENT);
//! assert_eq!(parse_size("64M"), Ok(64 << 20));
//! ```
#![allow(clippy::print_stderr, reason = "commands print")]

mod file;
mod folder;
#[cfg(feature = "cli")]
mod rights;
#[cfg(feature = "cli")]
mod shell;
#[cfg(feature = "cli")]
mod signal;
mod size;
#[cfg(feature = "cli")]
mod status_line;
#[cfg(feature = "cli")]
mod usage;
#[cfg(feature = "cli")]
mod warnings;

use std::path::Path;

use esl_bytecode::diagnostic::Severity;
use esl_compiler::diagnostic::{Format, Renderer};

use crate::program::{Compiled, Ended};

pub use file::{ProgramFile, read_program, read_source, refuse_overwriting, replace_file};
pub use folder::{is_test_file, sources_in};
#[cfg(feature = "cli")]
pub use rights::RightsOptions;
#[cfg(feature = "cli")]
pub use shell::{print_completions, write_man_pages};
#[cfg(feature = "cli")]
pub use signal::{Interrupts, SignalTarget, end_on_signal, interrupt_on_signal};
pub use size::{SizeError, parse_size, parse_stack};
#[cfg(feature = "cli")]
pub use status_line::{StatusLine, wants_color};
#[cfg(feature = "cli")]
pub use usage::{Habits, parse};
#[cfg(feature = "cli")]
pub use warnings::WarningOptions;

/// Exit status of success.
pub const SUCCESS: u8 = 0;
/// Exit status of a run whose main task a failure left.
pub const FAILED: u8 = 1;
/// Exit status of wrong usage, or of a file that cannot be read or written.
pub const USAGE: u8 = 2;
/// Exit status of a program that does not compile, or whose bytecode is refused.
pub const NOT_COMPILED: u8 = 3;
/// Exit status of a run in which no task can ever run again.
pub const DEADLOCKED: u8 = 4;
/// Exit status of `eslvm test` if there was no test to run.
pub const NO_TESTS: u8 = 5;
/// Exit status of a run that has spent its budget, or needs more memory than it may have.
pub const BUDGET_OR_MEMORY_SPENT: u8 = 5;
/// Exit status of a replay that has taken another course than the recorded run.
pub const DIVERGED: u8 = 6;
/// Exit status of an exploration that has found nothing, and has not tried everything.
pub const NOT_PROVED: u8 = 7;
/// Exit status of a run that a signal has ended, less the number of the signal, as shells report it.
pub const SIGNALLED: u8 = 128;

/// Returns the exit status of a run.
pub fn exit_status(ended: Ended) -> u8 {
    match ended {
        Ended::Normally(status) => status,
        Ended::Failed => FAILED,
        Ended::Deadlocked => DEADLOCKED,
        Ended::BudgetSpent | Ended::HeapExhausted => BUDGET_OR_MEMORY_SPENT,
        Ended::Signalled(signal) => SIGNALLED + signal.number(),
    }
}

/// Returns the name of the running command, for messages.
fn command_name() -> String {
    let path = std::env::args_os().next().unwrap_or_default();
    Path::new(&path).file_stem().map_or("esl".into(), |name| name.to_string_lossy().into_owned())
}

/// Prints a message of the command itself.
pub fn complain(text: impl std::fmt::Display) {
    eprintln!("{}: {text}", command_name());
}

/// Errors, and warnings, that are shown to people. To find the place of one takes time with the length of its
/// line.
const SHOWN_DIAGNOSTICS: usize = 100;

/// Prints the diagnostics of a compilation: for tools all; for people the first errors and warnings, and the
/// numbers of all.
pub fn print_diagnostics(compiled: &Compiled, renderer: &Renderer) {
    if renderer.format == Format::Json {
        for diagnostic in &compiled.diagnostics {
            eprintln!("{}", renderer.render(diagnostic, &compiled.sources));
        }
        return;
    }
    let (mut errors, mut warnings) = (0, 0);
    for diagnostic in &compiled.diagnostics {
        let number = match diagnostic.severity {
            Severity::Error => &mut errors,
            Severity::Warning => &mut warnings,
        };
        *number += 1;
        if *number <= SHOWN_DIAGNOSTICS {
            eprintln!("{}\n", renderer.render(diagnostic, &compiled.sources));
        }
    }
    if compiled.diagnostics.is_empty() {
        return;
    }
    let count = |n: usize, what: &str| match n {
        0 => None,
        1 => Some(format!("1 {what}")),
        2..=SHOWN_DIAGNOSTICS => Some(format!("{n} {what}s")),
        n => Some(format!("{n} {what}s, of which the first {SHOWN_DIAGNOSTICS} are shown")),
    };
    let counts: Vec<String> =
        [count(errors, "error"), count(warnings, "warning")].into_iter().flatten().collect();
    complain(counts.join(", "));
}
