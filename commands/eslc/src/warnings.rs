//! Which warnings of the compiler a command takes for errors, and which it leaves out.

use std::fmt;

use clap::Args;
use esl::program::Compiled;
use esl_bytecode::diagnostic::Severity;
use esl_command::{USAGE, complain};
use esl_compiler::diagnostic::code;
use similar::TextDiff;

/// Stands for all warnings.
const ALL: &str = "warnings";

/// Warnings that are errors, and warnings that are left out.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct WarningOptions {
    /// Take warnings of this code for errors; `warnings` stands for all
    #[arg(long, value_name = "CODE", value_parser = parse_code)]
    pub(crate) deny: Vec<String>,
    /// Report no warnings of this code, also if all are denied
    #[arg(long, value_name = "CODE", value_parser = parse_code)]
    pub(crate) allow: Vec<String>,
}

/// Reason why a code cannot be denied or allowed.
#[derive(Clone, Debug)]
enum CodeError {
    /// It is the code of an error.
    OfError,
    /// There is no such code; the name of the nearest one, if one is near.
    Unknown(Option<&'static str>),
}

impl fmt::Display for CodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CodeError::OfError => {
                f.write_str("this is the code of an error, which cannot be allowed and is always denied")
            }
            CodeError::Unknown(Some(name)) => {
                write!(f, "no warning has this code; did you mean `{name}`?")
            }
            CodeError::Unknown(None) => {
                write!(f, "no warning has this code: it stands in brackets in a message; `{ALL}` is all")
            }
        }
    }
}

impl std::error::Error for CodeError {}

/// Checks the code of a warning.
fn parse_code(text: &str) -> Result<String, CodeError> {
    match code::find(text) {
        _ if text == ALL || esl_analysis::WARNINGS.contains(&text) => Ok(text.into()),
        Some(code) if code.severity == Severity::Warning => Ok(text.into()),
        Some(_) => Err(CodeError::OfError),
        None => {
            let warnings = code::ALL.iter().filter(|code| code.severity == Severity::Warning);
            let names = warnings.map(|code| code.name).chain(esl_analysis::WARNINGS);
            let near = names.map(|name| (TextDiff::from_chars(name, text).ratio(), name));
            let near = near.filter(|(likeness, _)| *likeness > 0.7).max_by(|a, b| a.0.total_cmp(&b.0));
            Err(CodeError::Unknown(near.map(|(_, name)| name)))
        }
    }
}

impl WarningOptions {
    /// Checks that no code is both denied and allowed.
    ///
    /// # Errors
    /// The exit status, after a message.
    pub(crate) fn check(&self) -> Result<(), u8> {
        match self.allow.iter().find(|code| self.deny.contains(code)) {
            None => Ok(()),
            Some(code) => {
                complain(format_args!("`{code}` is both denied and allowed: leave one of the options out"));
                Err(USAGE)
            }
        }
    }

    /// Leaves out the warnings that are allowed, and makes errors of those that are denied.
    pub(crate) fn apply(&self, compiled: &mut Compiled) {
        let has = |codes: &[String], name: &str| codes.iter().any(|code| code == name || code == ALL);
        compiled.diagnostics.retain(|diagnostic| {
            diagnostic.severity == Severity::Error || !has(&self.allow, diagnostic.code)
        });
        for diagnostic in &mut compiled.diagnostics {
            if has(&self.deny, diagnostic.code) {
                diagnostic.severity = Severity::Error;
            }
        }
    }
}
