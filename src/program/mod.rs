//! Whole programs: compiling source files, keeping the result in a file, running it to its end.
//!
//! ```
//! use esl::Config;
//! use esl::host::VirtualHost;
//! use esl::program::{Ended, Program, Source, compile, run};
//!
//! let compiled = compile(&[Source::new("greet.esl", "(format t \"hello from ~a~%\" 'greet)")]);
//! assert!(!compiled.has_errors());
//! let bytes = compiled.program.expect("there are no errors").to_bytes()?;
//!
//! let host = VirtualHost::new();
//! let captured = host.captured();
//! let summary = run(&Program::from_bytes(&bytes)?, Config::default(), Box::new(host))?;
//! assert_eq!(summary.ended, Ended::Normally(0));
//! assert_eq!(captured.output(), "hello from GREET\n");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod compile;
mod identity;
mod operators;
mod run;
mod schedule;

use std::sync::Arc;

use esl_bytecode::file::WriteError;
use esl_bytecode::module::Module;
use esl_bytecode::verify::verify;
use esl_bytecode::{disasm, file};
use esl_vm::load::LoadError;

pub use compile::{
    Compiled, Instrumentation, Modules, compile, compile_covered, compile_for_run, compile_on, compile_with,
    compile_with_core, compile_with_points, expand,
};
pub use esl_vm::explore::Settings;
pub use identity::{EXECUTION_EPOCH, ExecutionIdentity};
pub use operators::{TELL_OPERATOR, WRITE_OPERATOR, has_operators, load_operators};
pub use run::{
    Ended, Summary, begin, begin_with, end, end_rest, finish, load, machine, run, run_by, run_in,
    run_in_portions, set_kept, set_module_folders, set_module_path, set_program_file, set_traces,
};
pub use schedule::{Schedule, ScheduleError};

/// A source text and its name in diagnostics and backtraces.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name: a path, or `<stdin>`.
    pub name: String,
    /// Text.
    pub text: Arc<str>,
}

impl Source {
    /// Creates a source.
    pub fn new(name: impl Into<String>, text: impl Into<Arc<str>>) -> Source {
        Source { name: name.into(), text: text.into() }
    }
}

/// A compiled program.
///
/// ```
/// use esl::program::{Program, Source, compile};
///
/// let program = compile(&[Source::new("one.esl", "(print 1)")]).program.expect("it compiles");
/// let bytes = program.to_bytes()?;
/// assert_eq!(Program::from_bytes(&bytes)?.disassemble(), program.disassemble());
/// assert!(Program::from_bytes(&bytes[..bytes.len() - 1]).is_err(), "it was cut off");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Program {
    module: Module,
    /// The file that it was read from; `None` if it was compiled just now.
    file: Option<Arc<[u8]>>,
}

impl Program {
    /// Reads a program from the bytes of an `.eslb` file, and verifies it.
    ///
    /// # Errors
    /// [`LoadError::Damaged`] or [`LoadError::Refused`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Program, LoadError> {
        let module = file::read(bytes)?;
        verify(&module).map_err(LoadError::Refused)?;
        Ok(Program { module, file: Some(bytes.into()) })
    }

    /// Returns the bytes of an `.eslb` file.
    ///
    /// # Errors
    /// [`WriteError`], if the program contains an object that no file can hold, or is too large.
    pub fn to_bytes(&self) -> Result<Vec<u8>, WriteError> {
        match &self.file {
            Some(bytes) => Ok(bytes.to_vec()),
            None => file::write(&self.module),
        }
    }

    /// Returns the compiled unit.
    pub fn module(&self) -> &Module {
        &self.module
    }

    /// Returns the program as text, instruction by instruction.
    pub fn disassemble(&self) -> String {
        disasm::module(&self.module)
    }
}
