//! The command `eslc`, run as a process: exit statuses, outputs, and what it does to files.

mod author;
mod checking;
mod editor;
mod editors;
mod failing;
mod findings;
mod frames;
mod grammar;
mod handling;
mod import;
mod lsp;
mod renaming;
mod typing;

use std::process::Command;

use esl_conformance::process;

const ESLC: &str = env!("CARGO_BIN_EXE_eslc");

/// The command `eslc` with these arguments.
fn eslc(arguments: &[&str]) -> Command {
    process::command(ESLC, arguments)
}

/// The command `eslvm` with these arguments, which is built beside `eslc`.
fn eslvm(arguments: &[&str]) -> Command {
    process::command(&process::beside(ESLC, "eslvm"), arguments)
}

/// Says that a test was left out, and why.
#[allow(clippy::print_stderr, reason = "whoever runs the tests sees what is left out")]
fn say_left_out(reason: &str) {
    eprintln!("left out: {reason}");
}
