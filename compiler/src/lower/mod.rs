//! Lowering: the core language to bytecode.
//!
//! The code generator is driven by destinations: every form is told where its value is wanted (`dest::Dest`) and puts
//! it there, so that few moves are needed and tests never make a boolean. Each function becomes a graph of segments,
//! which is improved (`fuse`) and then written out (`assemble`).
//!
//! Guarantees: what is emitted passes the verifier. A form that is too large for the format gives a diagnostic.
//! Not here: what names mean (the expander), linking modules (`esl_bytecode::link`).
//!
//! The walk recurses on the native stack, which is extended as needed (`frame::Frame::form`); its depth is the depth
//! of the core tree, which the expander bounds.
//!
//! Source: Dybvig, Hieb and Butler 1990, "Destination-driven code generation".

mod arithmetic;
mod assemble;
mod call;
mod closure;
mod dest;
mod dynamic;
mod exit;
mod frame;
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
use esl_bytecode::module::{Capture, Function, FunctionNumber, Module};

use crate::core::{Core, LambdaId};
use crate::resolve::{Resolution, resolve};
pub use lines::SourceLines;
use pool::Pool;

/// Lowers a top-level form to a module whose only top-level function it is.
///
/// # Errors
/// `function-too-large`, for each function that does not fit the format, not even in parts.
pub fn lower(core: &Core, lines: &SourceLines) -> Result<Module, Vec<Diagnostic>> {
    let mut builder = Builder::new(core, lines);
    let functions = builder.functions();
    if builder.excesses.is_empty() {
        return Ok(builder.module(functions));
    }
    let diagnostics = builder.excesses.iter().map(|excess| excess.diagnostic.clone()).collect();
    lower_large(core, lines).ok_or(diagnostics)
}

/// Of forms that have not fit otherwise, variables go to the heap when so many registers are in use.
const SPILLS_FROM: u8 = 80;

/// Lowers a form with functions that do not fit as they are.
fn lower_large(core: &Core, lines: &SourceLines) -> Option<Module> {
    let mut divided = core.clone();
    let mut limits = split::LIMITS.iter();
    loop {
        let mut builder = Builder::new(&divided, lines);
        builder.spills_from = Some(SPILLS_FROM);
        let functions = builder.functions();
        if builder.excesses.is_empty() {
            return Some(builder.module(functions));
        }
        let resolution = &builder.resolution;
        let too_large: Vec<LambdaId> = (0..divided.lambdas.len())
            .map(|index| LambdaId(index as u32))
            .filter(|&lambda| builder.excesses.iter().any(|excess| excess.lambda == resolution.frame(lambda)))
            .collect();
        split::split(&mut divided, &too_large, *limits.next()?);
    }
}

/// A function that does not fit the format.
struct Excess {
    lambda: LambdaId,
    diagnostic: Diagnostic,
}

/// The module that is being made.
struct Builder<'a> {
    core: &'a Core,
    resolution: Resolution,
    lines: &'a SourceLines,
    pool: Pool,
    numbers: Vec<Option<FunctionNumber>>,
    numbered: Vec<LambdaId>,
    /// Where the captures of each lambda come from, by lambda; known when the code that makes its closure is lowered.
    captures: Vec<Vec<Capture>>,
    /// The register of each variable, while it is bound, in the frame that owns it; so for the tags of blocks and
    /// tagbodies.
    variables: Vec<u8>,
    blocks: Vec<u8>,
    tagbodies: Vec<u8>,
    excesses: Vec<Excess>,
    /// Variables that are bound when so many registers are in use go to the heap; none if `None`.
    spills_from: Option<u8>,
}

impl<'a> Builder<'a> {
    fn new(core: &'a Core, lines: &'a SourceLines) -> Builder<'a> {
        Builder {
            core,
            resolution: resolve(core),
            lines,
            pool: Pool::default(),
            numbers: vec![None; core.lambdas.len()],
            numbered: Vec::new(),
            captures: vec![Vec::new(); core.lambdas.len()],
            variables: vec![0; core.variables.len()],
            blocks: vec![0; core.blocks.len()],
            tagbodies: vec![0; core.tagbodies.len()],
            excesses: Vec::new(),
            spills_from: None,
        }
    }

    /// Lowers all functions, beginning with the form itself.
    fn functions(&mut self) -> Vec<Function> {
        self.number(LambdaId(0));
        let mut functions = Vec::new();
        // Functions get their numbers when code that refers to them is lowered, and are lowered in that order.
        while let Some(&lambda) = self.numbered.get(functions.len()) {
            functions.push(frame::function(self, lambda));
        }
        for (function, lambda) in functions.iter_mut().zip(&self.numbered) {
            function.captures = std::mem::take(&mut self.captures[lambda.index()]);
        }
        functions
    }

    fn module(self, functions: Vec<Function>) -> Module {
        Module {
            sources: self.lines.names().map(str::to_string).collect(),
            requires: Vec::new(),
            constants: self.pool.finish(),
            functions,
            toplevel: vec![FunctionNumber(0)],
        }
    }

    /// The number of a lambda's function in the module.
    fn number(&mut self, lambda: LambdaId) -> FunctionNumber {
        let next = FunctionNumber(self.numbered.len() as u32);
        *self.numbers[lambda.index()].get_or_insert_with(|| {
            self.numbered.push(lambda);
            next
        })
    }
}
