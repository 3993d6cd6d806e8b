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
//! Layers: `scopes`, `graph`, `dest`, `regalloc`, `pool` and `lines`; then the state of lowering (`builder`),
//! then one file for each family of forms, whose methods are methods of the `builder::FunctionBuilder`, and
//! last `function` with the dispatch over forms. A file uses only files before it; `tests/layers.rs` holds
//! that.
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
mod gather;
mod graph;
mod lines;
mod literals;
mod loops;
mod operator;
mod pool;
mod recovery;
mod regalloc;
mod scopes;
mod spill;
mod split;
mod structure;
mod test;
mod values;
mod variable;

#[cfg(test)]
mod tests;

use esl_bytecode::compile::Work;
use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::module::{Module, ModuleFunction};

use crate::core::{Core, LambdaId};
use crate::resolve::{InlineDecision, ResolveWalk};
use builder::{ModuleBuilder, OversizedFunction, SuspendedBuilder};
pub use lines::SourceLines;

/// Lowers a top-level form to a module whose only top-level function it is.
///
/// # Errors
/// `function-too-large`, for each function that does not fit the format even in parts.
pub fn lower(core: &Core, lines: &SourceLines) -> Result<Module, Vec<Diagnostic>> {
    let mut lowering = Lowering::new(core.clone());
    loop {
        if let Some(outcome) = lowering.run(lines, &mut Work::unbounded()) {
            return outcome;
        }
    }
}

/// Number of registers in use from which on variables go to the heap, in forms that do not fit otherwise.
const SPILLS_FROM: u8 = 80;

/// The lowering of a top-level form in parts. A part ends between two steps of a walk over the form, or
/// between two functions.
pub struct Lowering {
    core: Core,
    stage: LoweringStage,
    /// Whether functions have been divided that are too large to be lowered in one part.
    is_in_parts: bool,
    /// Faults of the functions that did not fit undivided; `None` before the first attempt.
    oversized: Option<Vec<Diagnostic>>,
    /// Limits that are left for dividing functions.
    limits: std::slice::Iter<'static, split::Limits>,
    /// Whether points stand before uses of places that tasks may share.
    has_points: bool,
}

/// The next step of a [`Lowering`].
enum LoweringStage {
    Begin,
    Divide(Box<split::FunctionDivision>),
    Inline(Box<InlineDecision>),
    Resolve(Box<ResolveWalk>),
    Functions(Box<SuspendedBuilder>, Vec<ModuleFunction>),
    /// The form is freed, which takes a part of the time that it takes to make it.
    Free(Box<Module>),
}

impl Lowering {
    /// Begins to lower a top-level form.
    pub fn new(core: Core) -> Lowering {
        let limits = split::LIMITS.iter();
        let stage = LoweringStage::Begin;
        Lowering { core, stage, is_in_parts: false, oversized: None, limits, has_points: false }
    }

    /// Puts points before uses of places that tasks may share, if wanted.
    #[must_use]
    pub fn with_points(mut self, has_points: bool) -> Lowering {
        self.has_points = has_points;
        self
    }

    /// Returns about how many bytes it takes.
    pub fn bytes(&self) -> usize {
        // Resolution and code are about as large as the form.
        self.core.bytes() * 2
    }

    /// Has functions divided next.
    fn divide(&mut self, lambdas: Vec<LambdaId>, limits: split::Limits, shares_vectors: bool) {
        let division = split::FunctionDivision::new(&self.core, lambdas, limits, shares_vectors);
        self.stage = LoweringStage::Divide(Box::new(division));
    }

    /// Goes on with the work. Returns the module, or what is wrong with the form; `None` if the work that is
    /// allowed is done before.
    pub fn run(&mut self, lines: &SourceLines, work: &mut Work) -> Option<Result<Module, Vec<Diagnostic>>> {
        loop {
            match std::mem::replace(&mut self.stage, LoweringStage::Begin) {
                LoweringStage::Begin => {
                    if !std::mem::replace(&mut self.is_in_parts, true) {
                        work.add(self.core.nodes.len() as u64 / NODES_PER_UNIT);
                        let large = split::larger_than(&self.core, LARGE_FUNCTION);
                        if !large.is_empty() {
                            self.divide(large, split::LIMITS[0], false);
                            continue;
                        }
                    }
                    self.stage = LoweringStage::Inline(Box::new(InlineDecision::new(&self.core)));
                }
                LoweringStage::Divide(mut division) => {
                    if !division.run(&mut self.core, work) {
                        self.stage = LoweringStage::Divide(division);
                        return None;
                    }
                }
                LoweringStage::Inline(mut decision) => {
                    if !decision.run(&self.core, work) {
                        self.stage = LoweringStage::Inline(decision);
                        return None;
                    }
                    let walk = ResolveWalk::new(&self.core, *decision);
                    self.stage = LoweringStage::Resolve(Box::new(walk));
                }
                LoweringStage::Resolve(mut walk) => {
                    if !walk.run(&self.core, work) {
                        self.stage = LoweringStage::Resolve(walk);
                        return None;
                    }
                    let mut builder = ModuleBuilder::new(&self.core, walk.finish(&self.core), lines);
                    builder.spills_from = self.oversized.is_some().then_some(SPILLS_FROM);
                    builder.has_points = self.has_points;
                    self.stage = LoweringStage::Functions(Box::new(builder.suspend()), Vec::new());
                }
                LoweringStage::Functions(builder, mut functions) => {
                    let mut builder = builder.resume(&self.core, lines);
                    if !builder.functions(&mut functions, work) {
                        self.stage = LoweringStage::Functions(Box::new(builder.suspend()), functions);
                        return None;
                    }
                    if builder.oversized.is_empty() {
                        self.stage = LoweringStage::Free(Box::new(builder.module(functions)));
                        continue;
                    }
                    // To divide the texts of functions does not give them fewer parameters.
                    let parameters = |function: &&OversizedFunction| function.has_too_many_parameters;
                    let hopeless = builder.oversized.iter().filter(parameters);
                    let hopeless: Vec<_> = hopeless.map(|function| function.diagnostic.clone()).collect();
                    if !hopeless.is_empty() {
                        return Some(Err(hopeless));
                    }
                    let Some(diagnostics) = self.oversized.take() else {
                        let found = builder.oversized.iter().map(|function| function.diagnostic.clone());
                        self.oversized = Some(found.collect());
                        continue;
                    };
                    let Some(&limits) = self.limits.next() else { return Some(Err(diagnostics)) };
                    self.oversized = Some(diagnostics);
                    let resolution = &builder.resolution;
                    let too_large: Vec<LambdaId> = (0..self.core.lambdas.len())
                        .map(|index| LambdaId(index as u32))
                        .filter(|&lambda| {
                            let frame = resolution.frame(lambda);
                            builder.oversized.iter().any(|function| function.lambda == frame)
                        })
                        .collect();
                    let shares_vectors = builder.oversized.iter().any(|function| function.has_many_captures);
                    drop(builder);
                    self.divide(too_large, limits, shares_vectors);
                }
                LoweringStage::Free(module) => {
                    let (nodes, lambdas) = (self.core.nodes.len(), self.core.lambdas.len());
                    if nodes == 0 && lambdas == 0 {
                        return Some(Ok(*module));
                    }
                    self.stage = LoweringStage::Free(module);
                    if work.is_done() {
                        return None;
                    }
                    self.core.nodes.truncate(nodes.saturating_sub(FREED_PER_UNIT));
                    self.core.lambdas.truncate(lambdas.saturating_sub(LAMBDAS_FREED_PER_UNIT));
                    work.add(1);
                }
            }
        }
    }
}

/// Number of nodes above which a function is divided before it is lowered, since that is done in one part.
const LARGE_FUNCTION: usize = 12_000;

/// Nodes that are freed in a unit of work.
const FREED_PER_UNIT: usize = 16;

/// Lambdas that are freed in a unit of work.
const LAMBDAS_FREED_PER_UNIT: usize = 4;

/// Nodes that count as a unit of work where the whole form is looked at.
const NODES_PER_UNIT: u64 = 8;
