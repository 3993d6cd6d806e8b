//! Building the tree: nodes, variables, blocks and whole chunks.

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;

use super::chunk::{Chunk, OpenChunk, Purpose};
use super::expander::{Expander, Stop};
use super::job::{AwaitedOutcome, Job, To};
use super::origin::OriginId;
use super::scope::{FunctionMeaning, ScopeEntry};
use crate::core::{
    Block, BlockId, Core, Lambda, LambdaId, Node, NodeId, NodeKind, Tagbody, TagbodyId, VarId, Variable,
};

impl Expander {
    /// Returns the tree of the chunk that is being built.
    pub(super) fn core(&mut self) -> &mut Core {
        let open = self.open.last_mut();
        &mut open.expect("forms are expanded within a chunk").core
    }

    /// Returns the level of the innermost chunk: the number of chunks that are being built.
    pub(super) fn level(&self) -> usize {
        self.open.len()
    }

    /// Fills a node.
    pub(super) fn fill(&mut self, to: To, kind: NodeKind) {
        let node = &mut self.core().nodes[to.node.index()];
        debug_assert!(matches!(node.kind, NodeKind::Hole), "a node is filled once");
        *node = Node { kind, span: to.span };
    }

    /// Makes a node `NIL`, whatever it was, because its form is faulty.
    pub(super) fn fill_nil(&mut self, to: To) {
        self.core().nodes[to.node.index()] =
            Node { kind: NodeKind::Constant(Datum::nil(to.span)), span: to.span };
    }

    /// Adds a node within `to`, for a value that is used.
    pub(super) fn child(&mut self, to: To) -> To {
        To { is_dropped: false, ..self.result(to) }
    }

    /// Adds a node within `to`, for the value of `to`.
    pub(super) fn result(&mut self, to: To) -> To {
        let nodes = &mut self.core().nodes;
        let node = NodeId(nodes.len() as u32);
        nodes.push(Node { kind: NodeKind::Hole, span: to.span });
        To { node, depth: to.depth + 1, ..to }
    }

    /// Adds a node within `to` for each form; returns the nodes and the jobs that fill them.
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

    /// Adds a node within `to` for a form whose value is unused; returns the node and the job that fills it.
    pub(super) fn statement(&mut self, form: Datum, to: To) -> (NodeId, Job) {
        let child = To { is_dropped: true, ..self.child(to) };
        (child.node, Job::Expand(form, child))
    }

    /// Adds a node within `to` for a form; returns the node and the job that fills it.
    pub(super) fn part(&mut self, form: Datum, to: To) -> (NodeId, Job) {
        let child = self.child(to);
        (child.node, Job::Expand(form, child))
    }

    /// Adds a lexical variable, bound in the lambda of `to`.
    pub(super) fn variable(&mut self, name: Symbol, span: Span, to: To) -> VarId {
        self.variable_in(name, span, to.lambda)
    }

    /// Adds a lexical variable, bound in `owner`.
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

    /// Notes that `to` sets a variable. If the value of the assignment is used, that counts as reading it.
    pub(super) fn note_assigned(&mut self, variable: VarId, to: To) {
        let variable = &mut self.core().variables[variable.index()];
        variable.is_assigned = true;
        variable.is_read |= !to.is_dropped;
        variable.is_captured |= variable.owner != to.lambda;
    }

    /// Adds a block, in the lambda of `to`.
    pub(super) fn block(&mut self, name: Option<Symbol>, to: To) -> BlockId {
        let blocks = &mut self.core().blocks;
        blocks.push(Block { name, owner: to.lambda, is_captured: false, is_used: false });
        BlockId(blocks.len() as u32 - 1)
    }

    /// Adds a tagbody, in the lambda of `to`.
    pub(super) fn tagbody(&mut self, to: To) -> TagbodyId {
        let tagbodies = &mut self.core().tagbodies;
        tagbodies.push(Tagbody { owner: to.lambda, is_captured: false });
        TagbodyId(tagbodies.len() as u32 - 1)
    }

    /// Begins a chunk; returns the destination of the body of its first lambda.
    pub(super) fn begin_chunk(&mut self, span: Span, origin: Option<OriginId>, purpose: Purpose) -> To {
        let body = NodeId(0);
        let core = Core {
            nodes: vec![Node { kind: NodeKind::Hole, span }],
            lambdas: vec![Lambda::without_parameters(None, span, body)],
            ..Core::default()
        };
        self.open.push(OpenChunk { core, errors: self.errors, span, purpose, macros: Vec::new() });
        To { node: body, lambda: LambdaId(0), depth: 0, origin, span, is_dropped: false }
    }

    /// Whether an error has been found in the chunk that is being built.
    pub(super) fn is_failing(&self) -> bool {
        self.open.last().is_some_and(|open| self.errors > open.errors)
    }

    /// Returns the purpose of the chunk that is being built.
    pub(super) fn purpose(&self) -> Purpose {
        self.open.last().expect("forms are expanded within a chunk").purpose
    }

    /// Notes that the chunk that is being built defines a macro.
    pub(super) fn note_macro(&mut self, symbol: &Symbol) {
        let open = self.open.last_mut();
        open.expect("forms are expanded within a chunk").macros.push(symbol.clone());
    }

    /// Finishes the innermost chunk and stops for it, unless it has errors.
    pub(super) fn finish_chunk(&mut self) {
        let open = self.open.pop().expect("a chunk was begun");
        let purpose = open.purpose;
        if self.errors > open.errors {
            for symbol in &open.macros {
                self.globals.note_broken_macro(symbol);
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
            Purpose { keep: true, .. } => AwaitedOutcome::Object(open.span),
            Purpose { load: true, .. } => AwaitedOutcome::Load(open.span),
            _ => AwaitedOutcome::Nothing,
        };
        self.stopped = Some(Stop::Chunk(Box::new(Chunk { core: open.core, purpose })));
    }

    /// Gives names to the newest of the kept objects, the functions of local macros.
    pub(super) fn enter_macros(&mut self, names: Vec<Symbol>) {
        let level = self.level();
        let functions = self.objects.split_off(self.objects.len() - names.len());
        for (name, function) in names.into_iter().zip(functions) {
            self.scope.enter(ScopeEntry::Function(name, FunctionMeaning::Macro(function)), level, false);
        }
    }
}
