//! What the two commands have in common: exit statuses, reading their files, showing diagnostics.
#![allow(clippy::print_stderr, reason = "commands print")]

use std::fs::File;
use std::io::{IsTerminal, Read};
use std::path::Path;
#[cfg(feature = "cli")]
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use esl_bytecode::file::MAGIC;
use esl_compiler::diagnostic::{Format, Renderer, Sources};
use esl_compiler::reader::decode;

#[cfg(feature = "cli")]
use esl_vm::host::Waker;

use crate::program::{Compiled, Program, Source};

/// Exit status: all went well.
pub const SUCCESS: u8 = 0;
/// Exit status: the command was called wrongly, or a file cannot be read or written.
pub const USAGE: u8 = 2;
/// Exit status: the program does not compile, or its bytecode is refused.
pub const NOT_COMPILED: u8 = 3;
/// Exit status: ended from outside, as a shell reports a command that a signal has ended.
pub const INTERRUPTED: u8 = 130;

/// A file that a command was given.
pub enum Input {
    /// Source text.
    Source(Source),
    /// A compiled program.
    Program(Program),
}

/// The name of the running command, for messages.
fn command_name() -> String {
    let path = std::env::args_os().next().unwrap_or_default();
    Path::new(&path).file_stem().map_or("esl".into(), |name| name.to_string_lossy().into_owned())
}

/// Prints a message of the command itself.
pub fn complain(text: impl std::fmt::Display) {
    eprintln!("{}: {text}", command_name());
}

/// The most bytes that a file may have: a text beyond is not one that somebody wrote, or does not end at all.
const MAX_BYTES: u64 = 64 << 20;

fn read_bytes(path: &Path) -> Result<(String, Vec<u8>), u8> {
    let is_stdin = path.as_os_str() == "-";
    let name = if is_stdin { "<stdin>".into() } else { path.display().to_string() };
    let mut bytes = Vec::new();
    let result = if is_stdin {
        std::io::stdin().take(MAX_BYTES + 1).read_to_end(&mut bytes)
    } else {
        File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes))
    };
    match result {
        Ok(length) if length as u64 > MAX_BYTES => {
            complain(format_args!("{name} is too long: at most {} MiB are read", MAX_BYTES >> 20));
            Err(USAGE)
        }
        Ok(_) => Ok((name, bytes)),
        Err(error) => {
            let reason = match error.kind() {
                std::io::ErrorKind::NotFound => "there is no such file".into(),
                std::io::ErrorKind::IsADirectory => "it is a directory; name a file in it".into(),
                std::io::ErrorKind::PermissionDenied => "it may not be read".into(),
                _ => error.to_string(),
            };
            complain(format_args!("{name} cannot be read: {reason}"));
            Err(USAGE)
        }
    }
}

fn source(name: String, bytes: Vec<u8>) -> Result<Source, u8> {
    let mut sources = Sources::new();
    let id = sources.add(name.clone(), None);
    decode(id, bytes).map(|text| Source::new(name, text)).map_err(|diagnostic| {
        let renderer = Renderer { color: std::io::stderr().is_terminal(), format: Format::Human };
        eprintln!("{}", renderer.render(&diagnostic, &sources));
        NOT_COMPILED
    })
}

/// Reads a source file; `-` is standard input.
///
/// # Errors
/// The exit status, after a message.
pub fn read_source(path: &Path) -> Result<Source, u8> {
    let (name, bytes) = read_bytes(path)?;
    if bytes.starts_with(&MAGIC) {
        complain(format_args!("{name} is compiled already; name its source"));
        return Err(USAGE);
    }
    source(name, bytes)
}

/// Reads a source or a bytecode file, which is told by its first bytes; `-` is standard input.
///
/// # Errors
/// The exit status, after a message.
pub fn read_program(path: &Path) -> Result<Input, u8> {
    let (name, bytes) = read_bytes(path)?;
    if !bytes.starts_with(&MAGIC) && path.extension().is_none_or(|extension| extension != "eslb") {
        return source(name, bytes).map(Input::Source);
    }
    Program::from_bytes(&bytes).map(Input::Program).map_err(|text| {
        complain(format_args!("{name} is no sound program: {text}"));
        NOT_COMPILED
    })
}

/// Prints what a compilation has found, and how much of it there is.
pub fn print_diagnostics(compiled: &Compiled, renderer: &Renderer) {
    for diagnostic in &compiled.diagnostics {
        eprintln!("{}\n", renderer.render(diagnostic, &compiled.sources));
    }
    if renderer.format == Format::Json || compiled.diagnostics.is_empty() {
        return;
    }
    let is_error = |diagnostic: &&esl_bytecode::diagnostic::Diagnostic| {
        diagnostic.severity == esl_bytecode::diagnostic::Severity::Error
    };
    let errors = compiled.diagnostics.iter().filter(is_error).count();
    let warnings = compiled.diagnostics.len() - errors;
    let count = |n: usize, what: &str| match n {
        0 => None,
        1 => Some(format!("1 {what}")),
        n => Some(format!("{n} {what}s")),
    };
    let counts: Vec<String> =
        [count(errors, "error"), count(warnings, "warning")].into_iter().flatten().collect();
    complain(counts.join(", "));
}

#[cfg(feature = "cli")]
/// Sets the flag, and wakes the host, when the process is asked to stop with Ctrl-C. A second one, before the first is seen
/// to, ends it.
pub fn interrupt_on_signal(flag: Arc<AtomicBool>, waker: Waker) {
    let result = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(INTERRUPTED.into());
        }
        waker.wake();
    });
    // Without a handler Ctrl-C ends the process at once, which is what it would do anyway.
    drop(result);
}

#[cfg(feature = "cli")]
/// Has the first Ctrl-C set the flag and end the wait of the machine's host, and the second one end the process.
pub fn end_on_signal(flag: Arc<AtomicBool>, waker: Waker) {
    let was_asked = AtomicBool::new(false);
    let result = ctrlc::set_handler(move || {
        if was_asked.swap(true, Ordering::Relaxed) {
            complain("interrupted");
            std::process::exit(INTERRUPTED.into());
        }
        flag.store(true, Ordering::Relaxed);
        waker.wake();
    });
    // As above.
    drop(result);
}

/// Reads a size in bytes, with K, M or G for multiples of 1024.
///
/// # Errors
/// A text that says what was expected.
pub fn parse_size(text: &str) -> Result<usize, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((last, 'K' | 'k')) => (&text[..last], 1 << 10),
        Some((last, 'M' | 'm')) => (&text[..last], 1 << 20),
        Some((last, 'G' | 'g')) => (&text[..last], 1 << 30),
        _ => (text, 1),
    };
    let number: usize = digits.parse().map_err(|_| "expected a number, maybe with K, M or G behind it")?;
    match number.checked_mul(unit) {
        Some(size) if size >= 4 << 20 => Ok(size),
        Some(_) => Err("the library alone takes more; give at least 4M".into()),
        None => Err("that is more than there can be".into()),
    }
}
