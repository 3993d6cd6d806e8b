//! Chunks: pieces of the program that are lowered and loaded by themselves, and the nodes that they are built of.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::machine::{Event, Job, Machine, To, Waiting};
use super::scope::{Entry, Function};
use crate::core::{
    Block, BlockId, Core, Lambda, LambdaId, Node, NodeId, NodeKind, Tagbody, TagbodyId, VarId, Variable,
};

/// What a chunk is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Purpose {
    /// Whether it belongs to the module that is being made.
    pub emit: bool,
    /// Whether it is to be loaded now.
    pub load: bool,
    /// Whether its value, a function, is wanted.
    pub keep: bool,
}

/// A finished piece of the program.
#[derive(Debug)]
pub struct Chunk {
    /// Its code.
    pub core: Core,
    /// What it is for.
    pub purpose: Purpose,
}

/// A chunk under construction.
#[derive(Debug)]
pub(super) struct Open {
    core: Core,
    /// How many errors there were when it was begun.
    errors: usize,
    span: Span,
    purpose: Purpose,
    /// The macros that it defines.
    macros: Vec<Symbol>,
}

impl Machine {
    /// The chunk that is being built.
    pub(super) fn core(&mut self) -> &mut Core {
        let open = self.open.last_mut();
        &mut open.expect("forms are expanded within a chunk").core
    }

    /// How many chunks are being built: the innermost one's level.
    pub(super) fn level(&self) -> usize {
        self.open.len()
    }

    /// Says what a node is.
    pub(super) fn fill(&mut self, to: To, kind: NodeKind) {
        let node = &mut self.core().nodes[to.node.index()];
        debug_assert!(matches!(node.kind, NodeKind::Hole), "a node is filled once");
        *node = Node { kind, span: to.span };
    }

    /// Makes a node `NIL`, whatever it was: its form is wrong.
    pub(super) fn fill_nil(&mut self, to: To) {
        self.core().nodes[to.node.index()] =
            Node { kind: NodeKind::Constant(Datum::nil(to.span)), span: to.span };
    }

    /// A fresh node within `to`, for a value that is used.
    pub(super) fn child(&mut self, to: To) -> To {
        To { is_dropped: false, ..self.result(to) }
    }

    /// A fresh node within `to`, for the value of `to`.
    pub(super) fn result(&mut self, to: To) -> To {
        let nodes = &mut self.core().nodes;
        let node = NodeId(nodes.len() as u32);
        nodes.push(Node { kind: NodeKind::Hole, span: to.span });
        To { node, depth: to.depth + 1, ..to }
    }

    /// Fresh nodes within `to`, one for each form, and the jobs that fill them.
    pub(super) fn children(
        &mut self,
        forms: impl IntoIterator<Item = Datum>,
        to: To,
    ) -> (Vec<NodeId>, Vec<Job>) {
        let mut nodes = Vec::new();
        let mut jobs = Vec::new();
        for form in forms {
            let child = self.child(to);
            nodes.push(child.node);
            jobs.push(Job::Expand(form, child));
        }
        (nodes, jobs)
    }

    /// A fresh node within `to` for `form`, the value of which is not used, and the job that fills it.
    pub(super) fn statement(&mut self, form: Datum, to: To) -> (NodeId, Job) {
        let child = To { is_dropped: true, ..self.child(to) };
        (child.node, Job::Expand(form, child))
    }

    /// A fresh node within `to` for `form`, and the job that fills it.
    pub(super) fn part(&mut self, form: Datum, to: To) -> (NodeId, Job) {
        let child = self.child(to);
        (child.node, Job::Expand(form, child))
    }

    /// A fresh lexical variable, bound in the lambda of `to`.
    pub(super) fn variable(&mut self, name: Symbol, span: Span, to: To) -> VarId {
        self.variable_in(name, span, to.lambda)
    }

    /// A fresh lexical variable, bound in `owner`.
    pub(super) fn variable_in(&mut self, name: Symbol, span: Span, owner: LambdaId) -> VarId {
        let variables = &mut self.core().variables;
        variables.push(Variable {
            name,
            span,
            owner,
            is_assigned: false,
            is_captured: false,
            is_read: false,
            never_returns: false,
        });
        VarId(variables.len() as u32 - 1)
    }

    /// Notes that code in the lambda of `to` reads a variable.
    pub(super) fn note_read(&mut self, variable: VarId, to: To) {
        let variable = &mut self.core().variables[variable.index()];
        variable.is_read = true;
        variable.is_captured |= variable.owner != to.lambda;
    }

    /// Makes `to` a read of a variable.
    pub(super) fn read(&mut self, variable: VarId, to: To) {
        self.note_read(variable, to);
        self.fill(to, NodeKind::Local(variable));
    }

    /// Notes that `to` sets a variable. Whoever uses the value of that counts as a reader.
    pub(super) fn note_assigned(&mut self, variable: VarId, to: To) {
        let variable = &mut self.core().variables[variable.index()];
        variable.is_assigned = true;
        variable.is_read |= !to.is_dropped;
        variable.is_captured |= variable.owner != to.lambda;
    }

    /// A fresh block in the lambda of `to`.
    pub(super) fn block(&mut self, name: Option<Symbol>, to: To) -> BlockId {
        let blocks = &mut self.core().blocks;
        blocks.push(Block { name, owner: to.lambda, is_captured: false, is_used: false });
        BlockId(blocks.len() as u32 - 1)
    }

    /// A fresh tagbody in the lambda of `to`.
    pub(super) fn tagbody(&mut self, to: To) -> TagbodyId {
        let tagbodies = &mut self.core().tagbodies;
        tagbodies.push(Tagbody { owner: to.lambda, is_captured: false });
        TagbodyId(tagbodies.len() as u32 - 1)
    }

    /// Begins a chunk, and gives the node of its first lambda's body.
    pub(super) fn begin_chunk(&mut self, span: Span, origin: Option<u32>, purpose: Purpose) -> To {
        let body = NodeId(0);
        let core = Core {
            nodes: vec![Node { kind: NodeKind::Hole, span }],
            lambdas: vec![Lambda::top_level(span, body)],
            ..Core::default()
        };
        self.open.push(Open { core, errors: self.errors, span, purpose, macros: Vec::new() });
        To { node: body, lambda: LambdaId(0), depth: 0, origin, span, is_dropped: false }
    }

    /// Whether something was wrong with the chunk that is being built.
    pub(super) fn is_failing(&self) -> bool {
        self.open.last().is_some_and(|open| self.errors > open.errors)
    }

    /// What the chunk that is being built is for.
    pub(super) fn purpose(&self) -> Purpose {
        self.open.last().expect("forms are expanded within a chunk").purpose
    }

    /// Notes that the chunk being built defines a macro.
    pub(super) fn note_macro(&mut self, symbol: &Symbol) {
        let open = self.open.last_mut();
        open.expect("forms are expanded within a chunk").macros.push(symbol.clone());
    }

    pub(super) fn finish_chunk(&mut self) {
        let open = self.open.pop().expect("a chunk was begun");
        let purpose = open.purpose;
        if self.errors > open.errors {
            for symbol in &open.macros {
                self.unit.note_broken_macro(symbol);
            }
            if purpose.keep {
                self.objects.push(None);
            }
            return;
        }
        debug_assert!(
            !open.core.nodes.iter().any(|node| matches!(node.kind, NodeKind::Hole)),
            "all nodes are filled"
        );
        self.waiting = match purpose {
            Purpose { keep: true, .. } => Waiting::Object(open.span),
            Purpose { load: true, .. } => Waiting::Load(open.span),
            _ => Waiting::Nothing,
        };
        self.stopped = Some(Event::Chunk(Box::new(Chunk { core: open.core, purpose })));
    }

    pub(super) fn enter_macros(&mut self, names: Vec<Symbol>) {
        let level = self.level();
        let functions = self.objects.split_off(self.objects.len() - names.len());
        for (name, function) in names.into_iter().zip(functions) {
            self.scope.enter(Entry::Function(name, Function::Macro(function)), level);
        }
    }
}
