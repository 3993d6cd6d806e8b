//! Reading and compiling the program that is to be run or explored.

use std::path::Path;

use esl::host::ProcessSignal;
use esl::module_path::ModulePath;
use esl::program::{self, Compiled, Ended, Instrumentation, Program};
use esl_command as command;
use esl_command::{NOT_COMPILED, ProgramFile, USAGE, complain};
use esl_compiler::diagnostic::{Format, Renderer, Sources};
use esl_testing::coverage::Coverage;

use super::options::MachineOptions;
use crate::signal::SignalTarget;

/// Reads the program in a file, and compiles it if it is a source, within the limits of its run. Returns
/// its coverage too, if its passages are counted.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn program(
    file: &Path,
    path: &ModulePath,
    options: &MachineOptions,
    instrumentation: Instrumentation,
    is_quiet: bool,
    signals: &SignalTarget,
) -> Result<(Program, Option<Coverage>), u8> {
    let (program, _, coverage) =
        program_with_sources(file, path, options, instrumentation, is_quiet, signals)?;
    Ok((program, coverage))
}

/// As [`program`]. Returns the sources of the program too; none of a compiled one.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn program_with_sources(
    file: &Path,
    path: &ModulePath,
    options: &MachineOptions,
    instrumentation: Instrumentation,
    is_quiet: bool,
    signals: &SignalTarget,
) -> Result<(Program, Sources, Option<Coverage>), u8> {
    let is_covered = instrumentation == Instrumentation::Passages;
    let source = match command::read_program(file)? {
        ProgramFile::Compiled(_) if is_covered => return Err(command::refuse_compiled(file)),
        ProgramFile::Compiled(_) if instrumentation == Instrumentation::Points => {
            complain(format_args!("{} is compiled; a strict schedule needs its source", file.display()));
            return Err(USAGE);
        }
        ProgramFile::Compiled(program) => return Ok((program, Sources::new(), None)),
        ProgramFile::Source(source) => source,
    };
    let mut watch = |inbox| signals.set(inbox);
    let config = options.config();
    let compile = || program::compile_for_run(&[source], path, instrumentation, &config, &mut watch);
    let compiled = compiling(file, is_quiet, compile);
    if let Some(ended) = compiled.stopped {
        match ended {
            Ended::BudgetSpent => complain("compiling the program exceeds the budget"),
            Ended::Signalled(signal) => complain_of_signal(signal),
            _ => {
                complain(format_args!("compiling the program exceeds {} MiB of memory", config.memory >> 20))
            }
        }
        return Err(ended.exit_status());
    }
    let color = command::wants_color();
    command::print_diagnostics(&compiled, &Renderer { color, format: Format::Human });
    let coverage = is_covered.then(|| Coverage::new(&compiled));
    Ok((compiled.program.ok_or(NOT_COMPILED)?, compiled.sources, coverage))
}

/// Compiles a program, and says at a terminal that it takes long, if it does.
pub(crate) fn compiling(file: &Path, is_quiet: bool, compile: impl FnOnce() -> Compiled) -> Compiled {
    command::StatusLine::new(is_quiet).during(|| format!("compiling {}", file.display()), compile)
}

/// Prints that a signal has ended the run.
pub(crate) fn complain_of_signal(signal: ProcessSignal) {
    match signal {
        ProcessSignal::HangUp => complain("hung up"),
        ProcessSignal::Interrupt => complain("interrupted"),
        ProcessSignal::Terminate => complain("terminated"),
        other => complain(format_args!("ended by signal {}", other.number())),
    }
}
