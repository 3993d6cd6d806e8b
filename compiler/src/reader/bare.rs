//! Reading without a program around it: for tests, fuzzing and tools.

use std::sync::Arc;

use esl_bytecode::compile::{Environment, Global, GlobalFunction, InternError};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::SourceId;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, Symbol, USER_PACKAGE};
use rustc_hash::FxHashMap;

use super::{Reader, decode};

/// An environment with the standard packages in which nothing is defined. A name without a package belongs to
/// `ESL-USER`, `NIL` and `T` apart; every name of a package is external.
#[derive(Debug, Default)]
pub struct BareEnvironment {
    symbols: FxHashMap<String, Symbol>,
    packages: FxHashMap<String, Arc<str>>,
    uninterned: u32,
}

impl BareEnvironment {
    /// An environment without symbols.
    pub fn new() -> BareEnvironment {
        BareEnvironment::default()
    }

    fn package(&mut self, name: &str) -> Option<Arc<str>> {
        let home = match name {
            "CL" | CL_PACKAGE => CL_PACKAGE,
            "KEYWORD" => KEYWORD_PACKAGE,
            "ESL" => ESL_PACKAGE,
            USER_PACKAGE => USER_PACKAGE,
            _ => return None,
        };
        Some(self.packages.entry(home.into()).or_insert_with(|| home.into()).clone())
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

    fn intern(&mut self, package: Option<&str>, name: &str, _: bool) -> Result<Symbol, InternError> {
        if let Some(package) = package {
            let home = self.package(package).ok_or_else(|| InternError::NoPackage(package.into()))?;
            return Ok(Symbol::new(&home, name));
        }
        if let Some(symbol) = self.symbols.get(name) {
            return Ok(symbol.clone());
        }
        let home = if matches!(name, "NIL" | "T") { CL_PACKAGE } else { USER_PACKAGE };
        let home = self.package(home).expect("a standard package");
        let symbol = Symbol::new(&home, name);
        self.symbols.insert(name.into(), symbol.clone());
        Ok(symbol)
    }

    fn fresh(&mut self) -> u32 {
        self.uninterned += 1;
        self.uninterned
    }

    fn similar(&self, _: &Symbol, _: bool) -> Vec<Symbol> {
        Vec::new()
    }
}

/// Reads bytes as a file, whatever they are, and gives the numbers of data and of diagnostics: the entry point for
/// fuzzing, which looks for panics.
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
