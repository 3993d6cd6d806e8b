//! Tests of lowering, on core trees in a notation of their own.

mod generate;
mod interpreter;
mod listing;
mod model;
mod notation;
mod random;
mod value;

use esl_bytecode::compile::Work;
use esl_bytecode::disasm;
use esl_bytecode::module::Module;
use esl_bytecode::verify::verify;

use super::{ModuleBuilder, SourceLines, lower};
use crate::core::Core;
use crate::resolve::resolve;

/// Lowers a form, and verifies the module.
fn module(text: &str) -> Module {
    module_of(&notation::core_in_big_stack(text), text)
}

/// Lowers a core tree, and verifies the module.
fn module_of(core: &Core, text: &str) -> Module {
    let module = lower(core, &SourceLines::new()).unwrap_or_else(|faults| panic!("{faults:?}\n{text}"));
    verified(module, text)
}

fn verified(module: Module, text: &str) -> Module {
    if let Err(fault) = verify(&module) {
        panic!("{fault}\n{text}\n{}", disasm::module(&module));
    }
    module
}

/// Lowers a core tree with nearly all variables spilled to the heap, and verifies the module.
fn spilled_module_of(core: &Core, text: &str) -> Module {
    let lines = SourceLines::new();
    let mut builder = ModuleBuilder::new(core, resolve(core), &lines);
    builder.spills_from = Some(2);
    let mut functions = Vec::new();
    assert!(builder.functions(&mut functions, &mut Work::unbounded()));
    assert!(builder.oversized.is_empty(), "{text}");
    verified(builder.module(functions), text)
}

/// The listing of what a form is lowered to.
fn code(text: &str) -> String {
    disasm::module(&module(text))
}
