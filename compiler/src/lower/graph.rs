//! The code of a function while it is being made: straight segments and the edges between them.
//!
//! Lowering appends instructions to the open segment and ends it with an [`Exit`]; jumps name segments by [`Label`]s,
//! which may be bound later. Segments keep the order in which they were bound: that is the order of the finished code,
//! so an edge to a segment at or before its own is a turn of a loop. Code that is emitted while no segment is open
//! cannot be reached and vanishes.
//!
//! Not here: improving the graph ([`super::fuse`]), choosing jump instructions ([`super::assemble`]).

use esl_bytecode::opcode::Instr;
use esl_bytecode::operand::{ClassIdx, ConstIdx, Int8, Int16, Reg, TypeIdx};
use esl_bytecode::span::Span;

/// A segment, bound or not yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Label(u32);

impl Label {
    /// As an index into the segments.
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }
}

/// What a branch asks. Failing and substituted comparisons mean the same for both senses of the jump, so a condition
/// is never replaced by the negation of another.
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
        /// Its limit.
        limit: Reg,
        /// What is added first.
        step: Int8,
    },
}

impl Cond {
    /// Whether a loop instruction jumps back when this holds (`sense`) or fails.
    pub(crate) fn loops(self, sense: bool) -> bool {
        match self {
            Cond::Nil(_) | Cond::Less(..) => true,
            Cond::Cons(_) | Cond::Count { .. } => sense,
            _ => false,
        }
    }
}

/// An instruction, and where it lands if it pushes a control entry.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Op {
    /// The instruction; its jump, if any, is still open.
    pub(crate) instr: Instr,
    /// The segment at which an unwinding to the pushed entry goes on.
    pub(crate) landing: Option<Label>,
    /// Where it was written.
    pub(crate) span: Span,
}

/// How control leaves a segment.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Exit {
    /// The last instruction does not let it past: a return or a tail call.
    End,
    /// To a segment.
    Jump(Label),
    /// To the segment that must come next: the last instruction is `enter-cleanup`.
    Fall(Label),
    /// To one of two segments.
    Branch {
        /// What decides.
        cond: Cond,
        /// Where control goes if the condition holds.
        holds: Label,
        /// Where it goes if not.
        fails: Label,
    },
}

/// Straight code and its exit.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    /// The instructions.
    pub(crate) ops: Vec<Op>,
    /// The way out.
    pub(crate) exit: Exit,
    /// Where the exit was written.
    pub(crate) span: Span,
}

/// The code of one function.
#[derive(Debug)]
pub(crate) struct Graph {
    /// The segments, by label.
    pub(crate) segments: Vec<Segment>,
    /// The bound segments in the order of the finished code; the first is the entry.
    pub(crate) order: Vec<Label>,
    open: Option<Label>,
}

impl Graph {
    /// An empty function with its entry open, and the entry.
    pub(crate) fn new() -> (Graph, Label) {
        let mut graph = Graph { segments: Vec::new(), order: Vec::new(), open: None };
        let entry = graph.label();
        graph.order.push(entry);
        graph.open = Some(entry);
        (graph, entry)
    }

    /// A label to be bound later.
    pub(crate) fn label(&mut self) -> Label {
        let label = Label(self.segments.len() as u32);
        self.segments.push(Segment { ops: Vec::new(), exit: Exit::End, span: Span::default() });
        label
    }

    /// Whether control can get here.
    pub(crate) fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Appends an instruction.
    pub(crate) fn push(&mut self, instr: Instr, landing: Option<Label>, span: Span) {
        if let Some(open) = self.open {
            self.segments[open.index()].ops.push(Op { instr, landing, span });
        }
    }

    /// Ends the open segment.
    pub(crate) fn leave(&mut self, exit: Exit, span: Span) {
        if let Some(open) = self.open.take() {
            let segment = &mut self.segments[open.index()];
            segment.exit = exit;
            segment.span = span;
        }
    }

    /// Opens the segment of `label`, which is bound here and only here. Control that arrives from above goes on in it.
    pub(crate) fn bind(&mut self, label: Label) {
        self.leave(Exit::Jump(label), Span::default());
        self.order.push(label);
        self.open = Some(label);
    }

    /// The position of each bound segment in the finished code, by label.
    pub(crate) fn positions(&self) -> Vec<usize> {
        let mut positions = vec![usize::MAX; self.segments.len()];
        for (position, label) in self.order.iter().enumerate() {
            positions[label.index()] = position;
        }
        positions
    }
}
