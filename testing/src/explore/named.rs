//! The functions that the instructions of a program name.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::module::{Constant, Module, ModuleFunction};
use esl_bytecode::opcode::Instr;
use esl_bytecode::symbol::{CL_PACKAGE, ESL_PACKAGE, Symbol};

use super::late::symbols_in;

/// Returns the instructions of a function, each with its place in the code.
pub(super) fn instructions(function: &ModuleFunction) -> impl Iterator<Item = (usize, Instr)> + '_ {
    let mut at = 0;
    std::iter::from_fn(move || {
        let instr = Instr::decode(&function.code, at)?;
        let pc = at;
        at += instr.opcode().words();
        Some((pc, instr))
    })
}

/// Functions of the library that call a function which they are given, beside those whose names end in `-IF`
/// or `-IF-NOT`, or begin with `MAP`; and the keywords by which others are given one.
const CALLING: &[&str] = &[
    "APPLY",
    "FUNCALL",
    "COMPLEMENT",
    "EVERY",
    "SOME",
    "NOTANY",
    "NOTEVERY",
    "REDUCE",
    "SORT",
    "STABLE-SORT",
    "MERGE",
    "TEST",
    "TEST-NOT",
    "KEY",
    "SET-MACRO-CHARACTER",
    "SET-DISPATCH-MACRO-CHARACTER",
    "HASH-FUNCTION",
];

/// Returns whether a program calls functions that are values, so that a symbol in its data may name one.
fn calls_found_functions(module: &Module) -> bool {
    let is_calling = |symbol: &Symbol| {
        let name = symbol.name();
        CALLING.contains(&name)
            || name.starts_with("MAP")
            || name.ends_with("-IF")
            || name.ends_with("-IF-NOT")
            || name.starts_with("%CALL")
    };
    let names_one = |constant: &Constant| matches!(constant, Constant::Symbol(symbol) if is_calling(symbol));
    module.constants.iter().any(names_one)
        || module.functions.iter().any(|function| {
            instructions(function).any(|(_, instr)| match instr {
                Instr::CallBuiltin { builtin, .. } | Instr::TailCallBuiltin { builtin, .. } => {
                    Builtin::from_number(builtin.0).is_some_and(|builtin| is_calling(&builtin.symbol()))
                }
                Instr::PushHandlers { .. } => true,
                instr => instr.call().is_some_and(|call| call.callee.is_in_window()),
            })
        })
}

/// Returns the constant that names the function that an instruction calls or refers to.
pub(super) fn called(instr: Instr) -> Option<usize> {
    match instr {
        Instr::CallGlobal { symbol, .. } | Instr::TailCallGlobal { symbol, .. } => Some(symbol.0 as usize),
        Instr::FunctionRef { symbol, .. } => Some(symbol.0 as usize),
        _ => None,
    }
}

/// Returns the names of the functions that an instruction calls or refers to, if only by a symbol in data: a
/// program may call functions that it finds in a list.
pub(super) fn functions_named(module: &Module, function: &ModuleFunction, instr: Instr) -> Vec<Symbol> {
    match instr {
        Instr::CallBuiltin { builtin: number, .. } | Instr::TailCallBuiltin { builtin: number, .. } => {
            Builtin::from_number(number.0).map(Builtin::symbol).into_iter().collect()
        }
        Instr::LoadConst { constant: index, .. } => {
            let Some(&index) = function.constants.get(index.0 as usize) else { return Vec::new() };
            let mut symbols = symbols_in(module, vec![index]);
            if !matches!(module.constants.get(index.0 as usize), Some(Constant::Symbol(_))) {
                symbols.retain(|symbol| symbol.is_in(CL_PACKAGE) || symbol.is_in(ESL_PACKAGE));
                if !symbols.is_empty() && !calls_found_functions(module) {
                    symbols.clear();
                }
            }
            symbols.into_iter().collect()
        }
        instr => called(instr).and_then(|index| constant(module, function, index)).into_iter().collect(),
    }
}

/// Returns the symbol that is a constant of a function.
pub(super) fn constant(module: &Module, function: &ModuleFunction, index: usize) -> Option<Symbol> {
    match module.constants.get(function.constants.get(index)?.0 as usize)? {
        Constant::Symbol(symbol) => Some(symbol.clone()),
        _ => None,
    }
}
