//! Reading without a program: for tests, fuzzing and tools.

use esl_bytecode::compile::{Environment, Global, GlobalFunction, InternError, NameUse};
use esl_bytecode::datum::Datum;
use esl_bytecode::package::{PackageId, Packages};
use esl_bytecode::span::SourceId;
use esl_bytecode::symbol::Symbol;

use super::{Reader, decode};

/// An environment with the standard packages and no definitions. The current package is `ESL-USER`.
#[derive(Clone, Debug)]
pub struct BareEnvironment {
    packages: Packages,
    uninterned: u32,
}

impl BareEnvironment {
    /// Creates an environment with the standard packages as at the start of a program.
    pub fn new() -> BareEnvironment {
        BareEnvironment { packages: Packages::standard(), uninterned: 0 }
    }
}

impl Default for BareEnvironment {
    fn default() -> BareEnvironment {
        BareEnvironment::new()
    }
}

impl Environment for BareEnvironment {
    fn global(&self, _: &Symbol) -> Global {
        Global::default()
    }

    fn setf_function(&self, _: &Symbol) -> GlobalFunction {
        GlobalFunction::Undefined
    }

    fn property(&self, _: &Symbol, _: &Symbol) -> Option<Datum> {
        None
    }

    fn intern(&mut self, package: Option<&str>, name: &str, internal: bool) -> Result<Symbol, InternError> {
        self.packages.read(PackageId::USER, package, name, internal)
    }

    fn fresh(&mut self) -> u32 {
        self.uninterned += 1;
        self.uninterned
    }

    fn similar(&self, _: &Symbol, _: NameUse) -> Vec<Symbol> {
        Vec::new()
    }
}

/// Reads any bytes as a file; returns the number of data and of diagnostics. Entry point for fuzzing, which
/// looks for panics.
pub fn read_anything(bytes: &[u8]) -> (usize, usize) {
    let Ok(text) = decode(SourceId::default(), bytes.to_vec()) else { return (0, 1) };
    let mut reader = Reader::new(SourceId::default(), text);
    let mut environment = BareEnvironment::new();
    let (mut data, mut diagnostics) = (0, 0);
    while let Some(read) = reader.next(&mut environment) {
        match read {
            Ok(_) => data += 1,
            Err(_) => diagnostics += 1,
        }
    }
    (data, diagnostics)
}
