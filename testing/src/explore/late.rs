//! Definitions at top level beside which tasks may run, and whether these could miss them.

use std::collections::{HashMap, HashSet};

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Constant, FunctionNumber, Module, ModuleFunction, PoolIdx};
use esl_bytecode::opcode::Instr;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE, Symbol};

use super::named::{constant, functions_named, instructions};
use super::unseen::{UnseenKind, kinds_of};

/// Returns the number of the first form at top level beside which a task may run: those of `spawn` outlive
/// the form that makes them, and it, or a function that it calls, may spawn.
pub(super) fn first_late_form(module: &Module) -> usize {
    let is_spawn = |function: &ModuleFunction, instr| {
        functions_named(module, function, instr).contains(&Symbol::esl("%SPAWN"))
    };
    let all = module.functions.iter();
    if !all.clone().any(|function| instructions(function).any(|(_, instr)| is_spawn(function, instr))) {
        return usize::MAX;
    }
    let may_spawn = |function: &ModuleFunction| {
        let runs = |instr| match instr {
            Instr::CallGlobal { symbol, .. } | Instr::TailCallGlobal { symbol, .. } => {
                let symbol = constant(module, function, symbol.0 as usize);
                symbol.is_none_or(|symbol| !symbol.is_in(CL_PACKAGE) && !symbol.is_in(ESL_PACKAGE))
            }
            Instr::MakeClosure { .. } => true,
            Instr::LoadConst { constant: index, .. } => {
                let index = function.constants.get(index.0 as usize);
                let constant = index.and_then(|index| module.constants.get(index.0 as usize));
                matches!(constant, Some(Constant::Function(_)))
            }
            instr => is_spawn(function, instr),
        };
        let defines = |instr| kinds_of(module, function, instr).contains(&UnseenKind::Definition);
        let is_definition = instructions(function).any(|(_, instr)| defines(instr));
        !is_definition && instructions(function).any(|(_, instr)| runs(instr))
    };
    let spawning =
        |toplevel: &FunctionNumber| module.functions.get(toplevel.0 as usize).is_some_and(may_spawn);
    module.toplevel.iter().position(spawning).map_or(usize::MAX, |form| form + 1)
}

/// Returns whether an instruction defines a function, a macro or a variable.
pub(super) fn defines_function(instr: Instr) -> bool {
    let (Instr::CallBuiltin { builtin, .. } | Instr::TailCallBuiltin { builtin, .. }) = instr else {
        return false;
    };
    let defining =
        [Builtin::SetFunction, Builtin::SetMacro, Builtin::ProclaimSpecial, Builtin::DefineConstant];
    Builtin::from_number(builtin.0).is_some_and(|builtin| defining.contains(&builtin))
}

/// Functions that find a symbol by its name.
pub(super) const FINDING: &[&str] =
    &["FIND-SYMBOL", "READ", "READ-FROM-STRING", "READ-PRESERVING-WHITESPACE", "APROPOS-LIST"];

/// For each symbol, the first function that names it.
pub(super) struct FirstNames(HashMap<Symbol, usize>);

impl FirstNames {
    /// Reads a program whose first late form has this number. In one that may find symbols by their names,
    /// the first function of all names each.
    pub(super) fn of(module: &Module, late: usize) -> FirstNames {
        let mut first = HashMap::new();
        if late == usize::MAX {
            return FirstNames(first);
        }
        for (number, function) in module.functions.iter().enumerate() {
            for symbol in symbols_of(module, function) {
                first.entry(symbol).or_insert(number);
            }
        }
        if first.keys().any(|symbol| symbol.is_in(CL_PACKAGE) && FINDING.contains(&symbol.name())) {
            first.values_mut().for_each(|number| *number = 0);
        }
        FirstNames(first)
    }

    /// Returns whether no function before this one names a symbol of the program that it names.
    pub(super) fn are_new_in(&self, module: &Module, number: usize) -> bool {
        let names = module.functions.get(number).map(|function| symbols_of(module, function));
        let is_new =
            |name: &Symbol| is_of_library(name) || self.0.get(name).is_none_or(|&first| first >= number);
        names.into_iter().flatten().all(|name| is_new(&name))
    }
}

/// Returns the symbols among the constants of a function.
fn symbols_of(module: &Module, function: &ModuleFunction) -> HashSet<Symbol> {
    symbols_in(module, function.constants.clone())
}

/// Returns the symbols in constants.
pub(super) fn symbols_in(module: &Module, mut open: Vec<PoolIdx>) -> HashSet<Symbol> {
    let (mut seen, mut symbols) = (HashSet::new(), HashSet::new());
    while let Some(index) = open.pop() {
        if !seen.insert(index.0) {
            continue;
        }
        match module.constants.get(index.0 as usize) {
            Some(Constant::Symbol(symbol)) => {
                symbols.insert(symbol.clone());
            }
            Some(Constant::Cons(first, rest)) => open.extend([*first, *rest]),
            Some(Constant::Vector(elements) | Constant::Array(_, elements)) => open.extend(elements),
            _ => {}
        }
    }
    symbols
}

/// Returns whether a symbol belongs to the library.
fn is_of_library(symbol: &Symbol) -> bool {
    [CL_PACKAGE, ESL_PACKAGE, KEYWORD_PACKAGE].iter().any(|name| symbol.is_in(name))
}
