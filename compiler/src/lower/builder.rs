//! The state of lowering: the module and the function that are being made.

use esl_bytecode::diagnostic::Diagnostic;
use esl_bytecode::module::{Capture, FunctionNumber, MAX_CONTROL, Module, ModuleFunction, PoolIdx};
use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{Count, Int16, Reg, SymbolIdx};
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use super::dest::Dest;
use super::graph::{Graph, SegmentExit, SegmentLabel};
use super::lines::SourceLines;
use super::pool::Pool;
use super::regalloc::RegisterStack;
use super::scopes::VariableScope;
use crate::core::*;
use crate::resolve::Resolution;

/// A function that does not fit the format.
pub(super) struct OversizedFunction {
    pub(super) lambda: LambdaId,
    /// Whether it would be too large without a body.
    pub(super) has_too_many_parameters: bool,
    /// Whether it makes a closure with too many captures, or is one.
    pub(super) has_many_captures: bool,
    pub(super) diagnostic: Diagnostic,
}

/// The module that is being made.
pub(super) struct ModuleBuilder<'a> {
    pub(super) core: &'a Core,
    pub(super) resolution: Resolution,
    pub(super) lines: &'a SourceLines,
    pub(super) pool: Pool,
    numbers: Vec<Option<FunctionNumber>>,
    /// Lambdas that have a number, in the order of the numbers.
    pub(super) numbered: Vec<LambdaId>,
    /// Sources of the captures of each lambda; known once the code that makes its closure is lowered.
    pub(super) captures: Vec<Vec<Capture>>,
    /// Register of each variable, while it is bound, in the frame that owns it.
    pub(super) variables: Vec<Reg>,
    /// Register of the tag of each block, likewise.
    pub(super) blocks: Vec<Reg>,
    /// Register of the tag of each tagbody, likewise.
    pub(super) tagbodies: Vec<Reg>,
    pub(super) oversized: Vec<OversizedFunction>,
    /// Number of registers in use from which on new variables go to the heap; `None` for never.
    pub(super) spills_from: Option<u8>,
    /// Whether points stand before uses of places that tasks may share.
    pub(super) has_points: bool,
}

impl<'a> ModuleBuilder<'a> {
    /// Creates the builder of the module for a top-level form that is resolved.
    pub(super) fn new(core: &'a Core, resolution: Resolution, lines: &'a SourceLines) -> ModuleBuilder<'a> {
        ModuleBuilder {
            core,
            resolution,
            lines,
            pool: Pool::default(),
            numbers: vec![None; core.lambdas.len()],
            numbered: Vec::new(),
            captures: vec![Vec::new(); core.lambdas.len()],
            variables: vec![Reg(0); core.variables.len()],
            blocks: vec![Reg(0); core.blocks.len()],
            tagbodies: vec![Reg(0); core.tagbodies.len()],
            oversized: Vec::new(),
            spills_from: None,
            has_points: false,
        }
    }

    /// Interrupts the work.
    pub(super) fn suspend(self) -> SuspendedBuilder {
        let ModuleBuilder {
            core: _,
            resolution,
            lines: _,
            pool,
            numbers,
            numbered,
            captures,
            variables,
            blocks,
            tagbodies,
            oversized,
            spills_from,
            has_points,
        } = self;
        SuspendedBuilder {
            resolution,
            pool,
            numbers,
            numbered,
            captures,
            variables,
            blocks,
            tagbodies,
            oversized,
            spills_from,
            has_points,
        }
    }

    /// Returns the number of a lambda's function in the module.
    pub(super) fn number(&mut self, lambda: LambdaId) -> FunctionNumber {
        let next = FunctionNumber(self.numbered.len() as u32);
        *self.numbers[lambda.index()].get_or_insert_with(|| {
            self.numbered.push(lambda);
            next
        })
    }

    /// Returns the finished module.
    pub(super) fn module(self, functions: Vec<ModuleFunction>) -> Module {
        Module {
            sources: self.lines.names().map(str::to_string).collect(),
            requires: Vec::new(),
            constants: self.pool.finish(),
            functions,
            toplevel: vec![FunctionNumber(0)],
        }
    }
}

/// A [`ModuleBuilder`] whose work is interrupted between two functions.
pub(super) struct SuspendedBuilder {
    resolution: Resolution,
    pool: Pool,
    numbers: Vec<Option<FunctionNumber>>,
    numbered: Vec<LambdaId>,
    captures: Vec<Vec<Capture>>,
    variables: Vec<Reg>,
    blocks: Vec<Reg>,
    tagbodies: Vec<Reg>,
    oversized: Vec<OversizedFunction>,
    spills_from: Option<u8>,
    has_points: bool,
}

impl SuspendedBuilder {
    /// Takes the work up again, with the same form.
    pub(super) fn resume<'a>(self, core: &'a Core, lines: &'a SourceLines) -> ModuleBuilder<'a> {
        ModuleBuilder {
            core,
            resolution: self.resolution,
            lines,
            pool: self.pool,
            numbers: self.numbers,
            numbered: self.numbered,
            captures: self.captures,
            variables: self.variables,
            blocks: self.blocks,
            tagbodies: self.tagbodies,
            oversized: self.oversized,
            spills_from: self.spills_from,
            has_points: self.has_points,
        }
    }
}

/// A dynamic extent that is open in the code of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// A binding of a special variable.
    Binding,
    /// A control entry that may be popped.
    Control,
    /// A cleanup, waiting or running. Control can leave it by throwing only.
    Cleanup,
}

/// How to leave a block of this frame.
#[derive(Clone, Copy)]
pub(super) struct BlockExit {
    pub(super) dest: Dest,
    pub(super) end: SegmentLabel,
    /// Number of extents outside of the block, its own catch apart.
    pub(super) depth: usize,
}

/// How to go to the tags of a tagbody of this frame.
pub(super) struct TagbodyExits {
    pub(super) tags: Vec<SegmentLabel>,
    /// Number of extents open while the forms of the tagbody run.
    pub(super) depth: usize,
}

/// The head of an inlined function whose body is being lowered.
#[derive(Clone, Copy)]
pub(super) struct LoopHead {
    pub(super) label: SegmentLabel,
    /// Number of extents open there.
    pub(super) depth: usize,
    /// Variables in scope there.
    pub(super) scope: VariableScope,
}

/// The vector of a frame for variables that find no room in its registers; see [`super::spill`].
#[derive(Debug)]
pub(super) struct Spill {
    /// Register that holds the vector.
    pub(super) register: Reg,
    /// Places of variables in the vector.
    pub(super) places: FxHashMap<VarId, Int16>,
    /// First free place.
    pub(super) next: i16,
    /// Number of places needed so far.
    pub(super) size: i16,
}

/// Part of a function that exceeds the limits of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Excess {
    Registers,
    Instructions,
    Constants,
    Captures,
    Extents,
}

impl Excess {
    /// Returns what the function has too many of.
    pub(super) fn what(self) -> &'static str {
        match self {
            Excess::Registers => "variables and intermediate values",
            Excess::Instructions => "instructions",
            Excess::Constants => "constants",
            Excess::Captures => "captured variables",
            Excess::Extents => "nested dynamic extents",
        }
    }
}

/// The function that is being lowered.
pub(super) struct FunctionBuilder<'b, 'a> {
    pub(super) module: &'b mut ModuleBuilder<'a>,
    pub(super) core: &'a Core,
    /// Lambda whose frame the function has.
    pub(super) lambda: LambdaId,
    pub(super) graph: Graph,
    pub(super) entry: SegmentLabel,
    /// Variables in scope at the entry.
    pub(super) entry_scope: VariableScope,
    pub(super) registers: RegisterStack,
    /// Open dynamic extents, the innermost last.
    pub(super) extents: Vec<Extent>,
    /// Blocks of this frame around the current form.
    pub(super) blocks: FxHashMap<BlockId, BlockExit>,
    /// Tagbodies of this frame around the current form.
    pub(super) tagbodies: FxHashMap<TagbodyId, TagbodyExits>,
    /// Inlined loops of this frame around the current form.
    pub(super) loops: FxHashMap<LambdaId, LoopHead>,
    /// Variables whose values are computed where they are read, once.
    pub(super) substitutes: FxHashMap<VarId, NodeId>,
    /// Variables that find no room in the registers.
    pub(super) spill: Option<Spill>,
    /// Variables that share the register of another one.
    pub(super) sharers: FxHashMap<Reg, Vec<VarId>>,
    /// Registers of the literals of the loop around the current form, if there is one.
    pub(super) literals: Option<FxHashMap<PoolIdx, Reg>>,
    /// Place of the current form.
    pub(super) span: Span,
    pub(super) constants: Vec<PoolIdx>,
    constant_indexes: FxHashMap<PoolIdx, u16>,
    /// The first part that does not fit the format, if any.
    pub(super) excess: Option<Excess>,
}

impl<'b, 'a> FunctionBuilder<'b, 'a> {
    /// Creates the builder of a lambda's function, without any code.
    pub(super) fn new(module: &'b mut ModuleBuilder<'a>, lambda: LambdaId) -> FunctionBuilder<'b, 'a> {
        let core = module.core;
        let (graph, entry) = Graph::new();
        FunctionBuilder {
            module,
            core,
            lambda,
            graph,
            entry,
            entry_scope: VariableScope::default(),
            registers: RegisterStack::new(),
            extents: Vec::new(),
            blocks: FxHashMap::default(),
            tagbodies: FxHashMap::default(),
            loops: FxHashMap::default(),
            substitutes: FxHashMap::default(),
            spill: None,
            sharers: FxHashMap::default(),
            literals: None,
            span: core.lambdas[lambda.index()].span,
            constants: Vec::new(),
            constant_indexes: FxHashMap::default(),
            excess: None,
        }
    }

    /// Appends an instruction.
    pub(super) fn emit(&mut self, instr: Instr) {
        if self.module.has_points && instr.sharing().is_some() {
            self.graph.push(Instr::Point {}, None, self.span);
        }
        self.graph.push(instr, None, self.span);
    }

    /// Appends an instruction that control does not pass.
    pub(super) fn end(&mut self, instr: Instr) {
        self.emit(instr);
        self.graph.leave(SegmentExit::End, self.span);
    }

    /// Pushes a control entry with a landing.
    pub(super) fn push_entry(&mut self, instr: Instr, landing: SegmentLabel, extent: Extent) {
        self.graph.push(instr, Some(landing), self.span);
        self.open(extent);
    }

    /// Notes that a dynamic extent has been opened.
    pub(super) fn open(&mut self, extent: Extent) {
        self.extents.push(extent);
        if self.extents.len() > MAX_CONTROL {
            self.excess = Some(Excess::Extents);
        }
    }

    /// Leaves the extents down to `depth`, in code that goes elsewhere. They stay open for the code that
    /// follows.
    pub(super) fn leave(&mut self, depth: usize) {
        let inside = &self.extents[depth..];
        let entries = inside.iter().filter(|&&extent| extent != Extent::Binding).count();
        let outermost = inside.iter().position(|&extent| extent != Extent::Binding);
        // Popping an entry undoes the bindings inside it.
        let bindings = outermost.unwrap_or(inside.len());
        if entries > 0 {
            self.emit(Instr::PopControl { count: Count(entries.min(255) as u8) });
        }
        if bindings > 0 {
            self.emit(Instr::Unbind { count: Count(bindings.min(255) as u8) });
        }
    }

    /// Leaves and closes the extents down to `depth`.
    pub(super) fn close(&mut self, depth: usize) {
        self.leave(depth);
        self.extents.truncate(depth);
    }

    /// Returns the index of a pool entry among the function's constants.
    pub(super) fn constant_index(&mut self, entry: PoolIdx) -> u16 {
        if let Some(&index) = self.constant_indexes.get(&entry) {
            return index;
        }
        let index = self.constants.len();
        if index > usize::from(u16::MAX) {
            self.excess = Some(Excess::Constants);
            return 0;
        }
        self.constants.push(entry);
        self.constant_indexes.insert(entry, index as u16);
        index as u16
    }

    /// Returns the index of a symbol among the function's constants.
    pub(super) fn symbol_index(&mut self, symbol: &Symbol) -> SymbolIdx {
        let entry = self.module.pool.symbol(symbol);
        SymbolIdx(self.constant_index(entry))
    }
}
