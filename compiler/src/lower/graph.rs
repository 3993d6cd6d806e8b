//! The graph of a function's code: straight segments and the edges between them.
//!
//! Lowering appends instructions to the open segment and ends it with a [`SegmentExit`]. Jumps refer to
//! segments by [`SegmentLabel`]s, which may be bound later. The order in which segments are bound is the
//! order of the finished code, so an edge to its own segment or an earlier one is a turn of a loop. Code that
//! is emitted while no segment is open is unreachable and vanishes.
//!
//! Not here: improving the graph ([`super::fuse`]), choosing jump instructions ([`super::assemble`]).

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{ClassIdx, ConstIdx, Int8, Int16, Reg, TypeIdx};
use esl_bytecode::span::Span;

use super::scopes::{VariableScope, VariableScopes};

/// A segment, bound or not yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct SegmentLabel(u32);

impl SegmentLabel {
    /// Returns the index into the segments.
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// Condition of a branch. A comparison that fails, or has a value put in its place, means the same for both
/// senses of the jump. So a condition is never replaced by the negation of another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cond {
    /// The register is `NIL`.
    Nil(Reg),
    /// The register is a pair.
    Cons(Reg),
    /// The parameter got an argument.
    Supplied(Reg),
    /// Both are the same object.
    Eq(Reg, Reg),
    /// Both are `eql`.
    Eql(Reg, Reg),
    /// The register is `eql` to the constant.
    EqlConst(Reg, ConstIdx),
    /// The register is of the type.
    Type(Reg, TypeIdx),
    /// The register is an instance of the class.
    Instance(Reg, ClassIdx),
    /// `=`
    NumEq(Reg, Reg),
    /// `<`
    Less(Reg, Reg),
    /// `<=`
    LessEq(Reg, Reg),
    /// `=` to a number.
    NumEqInt(Reg, Int16),
    /// `<` than a number.
    LessInt(Reg, Int16),
    /// `>` than a number.
    GreaterInt(Reg, Int16),
    /// A counter, once a step has been added, is below its limit.
    Count {
        /// The counter.
        counter: Reg,
        /// Limit of the counter.
        limit: Reg,
        /// Step that is added first.
        step: Int8,
    },
}

impl Cond {
    /// Whether a loop instruction jumps back if this holds (`sense`) or fails.
    pub(crate) fn loops(self, sense: bool) -> bool {
        match self {
            Cond::Nil(_) | Cond::Less(..) => true,
            Cond::Cons(_) | Cond::Count { .. } => sense,
            _ => false,
        }
    }
}

/// An instruction, and the landing of the control entry that it pushes, if any.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Op {
    /// The instruction. The distance of its jump, if any, is still open.
    pub(crate) instr: Instr,
    /// Segment at which an unwinding to the pushed entry continues.
    pub(crate) landing: Option<SegmentLabel>,
    /// Place in the source.
    pub(crate) span: Span,
    /// Variables in scope.
    pub(crate) scope: VariableScope,
}

/// How control leaves a segment.
#[derive(Clone, Copy, Debug)]
pub(crate) enum SegmentExit {
    /// Not at all: the last instruction is a return or a tail call.
    End,
    /// To a segment.
    Jump(SegmentLabel),
    /// To the segment that must come next. The last instruction is `enter-cleanup`.
    Fall(SegmentLabel),
    /// To one of two segments.
    Branch {
        /// Condition.
        cond: Cond,
        /// Segment if the condition holds.
        holds: SegmentLabel,
        /// Segment if it fails.
        fails: SegmentLabel,
    },
}

/// Straight code and its exit.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    /// Instructions.
    pub(crate) ops: Vec<Op>,
    /// Exit.
    pub(crate) exit: SegmentExit,
    /// Place of the exit in the source.
    pub(crate) span: Span,
    /// Variables in scope at the exit.
    pub(crate) scope: VariableScope,
}

/// The code of one function.
#[derive(Debug)]
pub(crate) struct Graph {
    /// Segments, by label.
    pub(crate) segments: Vec<Segment>,
    /// Bound segments in the order of the finished code. The first is the entry.
    pub(crate) order: Vec<SegmentLabel>,
    /// Variables in scope.
    pub(crate) scopes: VariableScopes,
    open: Option<SegmentLabel>,
}

impl Graph {
    /// Creates the graph of an empty function, with its entry open. Returns the graph and the entry.
    pub(crate) fn new() -> (Graph, SegmentLabel) {
        let mut graph =
            Graph { segments: Vec::new(), order: Vec::new(), scopes: VariableScopes::default(), open: None };
        let entry = graph.label();
        graph.order.push(entry);
        graph.open = Some(entry);
        (graph, entry)
    }

    /// Creates a label, to be bound later.
    pub(crate) fn label(&mut self) -> SegmentLabel {
        let label = SegmentLabel(self.segments.len() as u32);
        let (ops, scope) = (Vec::new(), VariableScope::default());
        self.segments.push(Segment { ops, exit: SegmentExit::End, span: Span::default(), scope });
        label
    }

    /// Whether control can reach the next instruction.
    pub(crate) fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Appends an instruction.
    pub(crate) fn push(&mut self, instr: Instr, landing: Option<SegmentLabel>, span: Span) {
        if let Some(open) = self.open {
            self.segments[open.index()].ops.push(Op { instr, landing, span, scope: self.scopes.current });
        }
    }

    /// Ends the open segment.
    pub(crate) fn leave(&mut self, exit: SegmentExit, span: Span) {
        if let Some(open) = self.open.take() {
            let segment = &mut self.segments[open.index()];
            segment.exit = exit;
            segment.span = span;
            segment.scope = self.scopes.current;
        }
    }

    /// Opens the segment of `label`, which is bound here and only here. Control continues in it from the open
    /// segment.
    pub(crate) fn bind(&mut self, label: SegmentLabel) {
        self.leave(SegmentExit::Jump(label), Span::default());
        self.order.push(label);
        self.open = Some(label);
    }

    /// Returns the position of each bound segment in the finished code, by label.
    pub(crate) fn positions(&self) -> Vec<usize> {
        let mut positions = vec![usize::MAX; self.segments.len()];
        for (position, label) in self.order.iter().enumerate() {
            positions[label.index()] = position;
        }
        positions
    }
}
