//! Messages of commands.
//!
//! Guarantees: a closed pipe or a full disk ends nothing. A run that controls a machine goes on to its end,
//! and the exit status states the result.
//! Not here: the output of programs (`esl_host`), and files that are the result of a command, whose errors
//! are reported.

use std::fmt::Arguments;
use std::io::Write;

/// Prints to standard output; for [`say!`](crate::say) and [`say_part!`](crate::say_part).
pub fn print_text(text: Arguments<'_>) {
    _ = std::io::stdout().write_fmt(text);
}

/// Prints to the error output; for [`say_error!`](crate::say_error) and
/// [`say_error_part!`](crate::say_error_part).
pub fn print_error(text: Arguments<'_>) {
    _ = std::io::stderr().write_fmt(text);
}

/// Prints a line to standard output.
#[macro_export]
macro_rules! say {
    () => { $crate::print_text(format_args!("\n")) };
    ($($part:tt)*) => { $crate::print_text(format_args!("{}\n", format_args!($($part)*))) };
}

/// Prints to standard output.
#[macro_export]
macro_rules! say_part {
    ($($part:tt)*) => { $crate::print_text(format_args!($($part)*)) };
}

/// Prints a line to the error output.
#[macro_export]
macro_rules! say_error {
    ($($part:tt)*) => { $crate::print_error(format_args!("{}\n", format_args!($($part)*))) };
}

/// Prints to the error output.
#[macro_export]
macro_rules! say_error_part {
    ($($part:tt)*) => { $crate::print_error(format_args!($($part)*)) };
}
