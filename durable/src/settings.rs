//! Comparing the program and the settings of a run with those with which it has begun.

use esl::program::Program;
use esl_bytecode::module::Module;
use esl_replay::{Beginning, RecordedError};
use esl_vm::vm::Config;

use super::{DurableError, changes};

/// Returns whether two programs are one. The name of its file as it is typed may be another one.
pub(crate) fn is_same_program(before: &Program, given: &Program) -> bool {
    let renamed = Module { sources: before.module().sources.clone(), ..given.module().clone() };
    renamed == *before.module()
}

/// Refuses to go on with a run that has begun with another program or other settings.
pub(crate) fn compare(found: &Beginning, given: &Beginning, program: &Program) -> Result<(), DurableError> {
    if found.program != given.program {
        let before = Program::from_bytes(&found.program)
            .map_err(|_| DurableError::Journal(RecordedError::OtherMachine))?;
        if !is_same_program(&before, program) {
            let changes = changes::changes(&before, program, &Default::default());
            return Err(DurableError::OtherProgram(Box::new(changes)));
        }
    }
    compare_settings(found, given)
}

/// Refuses to go on with a run that has begun with other settings.
pub(crate) fn compare_settings(found: &Beginning, given: &Beginning) -> Result<(), DurableError> {
    if found.config != given.config {
        return Err(DurableError::OtherLimits(options_of(&found.config, &given.config)));
    }
    let settings = [
        (found.traces == given.traces, "other traces"),
        (found.functions == given.functions, "other functions of the host"),
        (found.has_operators == given.has_operators, "other options for operators"),
    ];
    match settings.iter().find(|(is_equal, _)| !is_equal) {
        Some((_, which)) => Err(DurableError::OtherSettings(which)),
        None => Ok(()),
    }
}

/// Returns the settings that differ, as options of the command with the values of `found`.
fn options_of(found: &Config, given: &Config) -> String {
    let mut options = Vec::new();
    let mut compare = |name: &str, one: Option<u64>, other: Option<u64>| {
        if one != other {
            options.push(one.map_or(format!("no --{name}"), |one| format!("--{name} {one}")));
        }
    };
    compare("memory", Some(found.memory as u64), Some(given.memory as u64));
    compare("stack", found.stack.map(|words| 8 * words as u64), given.stack.map(|words| 8 * words as u64));
    compare("slice", Some(found.slice.into()), Some(given.slice.into()));
    compare("budget", found.budget, given.budget);
    compare("seed", Some(found.seed), Some(given.seed));
    if options.is_empty() { "those settings".into() } else { options.join(" ") }
}
