//! Whether code is the program's: or the library's, or that of a module that comes with the machine.

use esl_bytecode::compile::MODULE_SOURCES;
use esl_bytecode::module::{Module, ModuleFunction};

use crate::heap::layout::CodeObject;

/// Returns whether a function is one of a module that comes with the machine, by the name of its source.
pub(super) fn is_of_module(module: &Module, function: &ModuleFunction) -> bool {
    let line = function.lines.iter().find_map(|line| module.sources.get(line.source as usize));
    line.is_some_and(|source| source.starts_with(MODULE_SOURCES))
}

/// Returns whether code belongs to the library, or to a module that comes with the machine. The owner of the
/// former is the number of its image, that of the latter `T`.
pub(crate) fn is_of_library(code: &CodeObject) -> bool {
    code.owner.is_true()
}
