//! The common part of the commands `eslc` and `eslvm`: exit statuses, reading their files, showing
//! diagnostics.
//!
//! ```
//! use esl_command::{SUCCESS, replace_file};
//!
//! let file = std::env::temp_dir().join(format!("esl-command-{}.txt", std::process::id()));
//! replace_file(&file, b"one line\n")?;
//! assert_eq!(std::fs::read(&file)?, b"one line\n");
//! std::fs::remove_file(&file)?;
//! assert_eq!(SUCCESS, 0);
//! # Ok::<(), std::io::Error>(())
//! ```
#![forbid(unsafe_code)]

#[macro_use]
mod say;

mod file;
mod folder;
mod shell;
mod status_line;
mod usage;
mod version;

use esl_bytecode::diagnostic::Severity;
use esl_compiler::diagnostic::{Format, Renderer};

use esl::program::{Compiled, Ended};

pub use file::{ProgramFile, read_program, read_source, refuse_compiled, refuse_overwriting, replace_file};
pub use folder::{is_test_file, sources_in};
pub use say::{print_error, print_text};
pub use shell::{print_completions, write_man_pages};
pub use status_line::{StatusLine, wants_color};
pub use usage::{Habits, arguments, command_name, parse};
pub use version::version_of_build;

/// Exit status of success.
pub const SUCCESS: u8 = Ended::SUCCESS;
/// Exit status of a run whose main task a failure left.
pub const FAILED: u8 = Ended::FAILED;
/// Exit status of wrong usage, or of a file that cannot be read or written.
pub const USAGE: u8 = 2;
/// Exit status of a program that does not compile, or whose bytecode is refused.
pub const NOT_COMPILED: u8 = 3;
/// Exit status of `eslvm test` if there was no test to run.
pub const NO_TESTS: u8 = 5;
/// Exit status of a replay that has taken another course than the recorded run.
pub const DIVERGED: u8 = 6;
/// Exit status of an exploration that has found nothing, and has not tried everything.
pub const NOT_PROVED: u8 = 7;
/// Exit status of a run that a signal has ended, less the number of the signal, as shells report it.
pub const SIGNALLED: u8 = Ended::SIGNALLED;

/// Adds the modules of the features that the command is built with. To be called before anything is compiled.
pub fn add_modules() {
    esl_world::add_modules(esl_trees::MODULES);
    esl_world::add_modules(esl_plans::MODULES);
    #[cfg(feature = "robots")]
    esl_world::add_modules(esl_robots::MODULES);
}

/// Prints a message of the command itself.
pub fn complain(text: impl std::fmt::Display) {
    say_error!("{}: {text}", command_name());
}

/// Errors, and warnings, that are shown to people. To find the place of one takes time with the length of its
/// line.
const SHOWN_DIAGNOSTICS: usize = 100;

/// Prints the diagnostics of a compilation: for tools all; for people the first errors and warnings, and the
/// numbers of all.
pub fn print_diagnostics(compiled: &Compiled, renderer: &Renderer) {
    if renderer.format == Format::Json {
        for diagnostic in &compiled.diagnostics {
            say_error!("{}", renderer.render(diagnostic, &compiled.sources));
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
            say_error!("{}\n", renderer.render(diagnostic, &compiled.sources));
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
