//! Lowering: the core language to bytecode.
//!
//! Destinations drive the code generator: every form is told where its value is wanted (`dest::Dest`) and
//! puts it there, so that few moves are needed and tests never make a boolean. Each function becomes a graph
//! of segments, which is improved (`fuse`) and then written out (`assemble`).
//!
//! Guarantees: the emitted code passes the verifier. A form that is too large for the format gives a
//! diagnostic. Not here: the meaning of names (the expander), linking modules (`esl_bytecode::link`).
//!
//! The walk recurses on the native stack, which is extended as needed (`builder::FunctionBuilder::form`); its
//! depth is the depth of the core tree, which the expander bounds.
//!
//! Layers: `graph`, `dest`, `regalloc`, `pool` and `lines`; then the state of lowering (`builder`), then one
//! file for each family of forms, whose methods are methods of the `builder::FunctionBuilder`, and last
//! `function` with the dispatch over forms. A file uses only files before it; `tests/layers.rs` holds that.
//!
//! Source: Dybvig, Hieb and Butler 1990, "Destination-driven code generation".

mod arithmetic;
mod assemble;
mod builder;
mod call;
mod closure;
mod deliver;
mod dest;
mod dynamic;
mod exit;
mod function;
mod fuse;
mod graph;
mod lines;
mod literals;
mod loops;
mod operator;
mod pool;
mod recovery;
mod regalloc;
mod spill;
mod split;
mod structure;
mod test;
mod values;
mod variable;

#[cfg(test)]
mod tests;

use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::module::Module;

use crate::core::{Core, LambdaId};
use builder::ModuleBuilder;
pub use lines::SourceLines;

/// Lowers a top-level form to a module whose only top-level function it is.
///
/// # Errors
/// `function-too-large`, for each function that does not fit the format even in parts.
pub fn lower(core: &Core, lines: &SourceLines) -> Result<Module, Vec<Diagnostic>> {
    let mut builder = ModuleBuilder::new(core, lines);
    let functions = builder.functions();
    if builder.oversized.is_empty() {
        return Ok(builder.module(functions));
    }
    let diagnostics = builder.oversized.iter().map(|function| function.diagnostic.clone()).collect();
    lower_large(core, lines).ok_or(diagnostics)
}

/// Number of registers in use from which on variables go to the heap, in forms that do not fit otherwise.
const SPILLS_FROM: u8 = 80;

/// Lowers a form with functions that do not fit as they are.
fn lower_large(core: &Core, lines: &SourceLines) -> Option<Module> {
    let mut divided = core.clone();
    let mut limits = split::LIMITS.iter();
    loop {
        let mut builder = ModuleBuilder::new(&divided, lines);
        builder.spills_from = Some(SPILLS_FROM);
        let functions = builder.functions();
        if builder.oversized.is_empty() {
            return Some(builder.module(functions));
        }
        let resolution = &builder.resolution;
        let too_large: Vec<LambdaId> = (0..divided.lambdas.len())
            .map(|index| LambdaId(index as u32))
            .filter(|&lambda| {
                builder.oversized.iter().any(|function| function.lambda == resolution.frame(lambda))
            })
            .collect();
        split::split(&mut divided, &too_large, *limits.next()?);
    }
}
