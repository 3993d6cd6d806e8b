//! Variables of a long `let` that find no room in registers: they live in one vector on the heap, made each
//! time the `let` is entered.
//!
//! Closures capture the vector instead of the variables, of which they may refer to any number; and parts
//! into which the function is divided (`split`) do the same. This happens only in functions that do not fit
//! otherwise, since it makes each access slower.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::compile::Work;
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use crate::core::*;
use crate::resolve::{children, lambda_nodes};

/// The place of a variable: the variable that holds the vector, and the index there.
type VectorPlace = (VarId, u32);

/// The work of moving the variables of each `let` with too many of them into a vector. It is done in parts;
/// each is given the same form.
pub(super) struct GatheredVariables {
    places: FxHashMap<VarId, VectorPlace>,
    /// Nodes that are still to be looked at, and the lambdas that they belong to.
    pending: Vec<(NodeId, LambdaId)>,
    /// Number of nodes in which references have been replaced.
    replaced: usize,
    most: usize,
}

impl GatheredVariables {
    /// Begins with the texts of `lambdas`, where a `let` may have `most` variables.
    pub(super) fn new(core: &Core, lambdas: &[LambdaId], most: usize) -> GatheredVariables {
        let mut pending = Vec::new();
        for &lambda in lambdas {
            lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push((node, lambda)));
        }
        GatheredVariables { places: FxHashMap::default(), pending, replaced: 0, most }
    }

    /// Goes on. Returns whether all is done; otherwise the work that is allowed is done.
    pub(super) fn run(&mut self, core: &mut Core, work: &mut Work) -> bool {
        while let Some((node, lambda)) = self.pending.pop() {
            if work.is_done() {
                self.pending.push((node, lambda));
                return false;
            }
            let before = self.pending.len();
            children(&core.nodes[node.index()].kind, &mut |child| self.pending.push((child, lambda)));
            work.add(1 + (self.pending.len() - before) as u64 / PARTS_PER_UNIT);
            Gatherer { core, places: &mut self.places }.let_form(node, lambda, self.most);
        }
        // Without places there is nothing to replace.
        let end = if self.places.is_empty() { 0 } else { core.nodes.len() };
        while self.replaced < end {
            if work.is_done() {
                return false;
            }
            work.add(1);
            for index in self.replaced..end.min(self.replaced + PARTS_PER_UNIT as usize) {
                Gatherer { core, places: &mut self.places }.reference(index);
            }
            self.replaced += PARTS_PER_UNIT as usize;
        }
        // What is added to the form later has no such references.
        self.replaced = usize::MAX;
        true
    }
}

/// Nodes that count as a unit of work.
const PARTS_PER_UNIT: u64 = 8;

struct Gatherer<'a> {
    core: &'a mut Core,
    places: &'a mut FxHashMap<VarId, VectorPlace>,
}

impl Gatherer<'_> {
    fn node(&mut self, kind: NodeKind, span: Span) -> NodeId {
        self.core.nodes.push(Node { kind, span });
        NodeId(self.core.nodes.len() as u32 - 1)
    }

    /// Gives the variables of a `let` places in a vector, if they are too many.
    fn let_form(&mut self, node: NodeId, lambda: LambdaId, most: usize) {
        let Node { kind: NodeKind::Let { bindings, .. }, span } = &mut self.core.nodes[node.index()] else {
            return;
        };
        let is_lexical = |target: &BoundVariable| matches!(target, BoundVariable::Lexical(_));
        let count = bindings.iter().filter(|(target, _)| is_lexical(target)).count();
        if count <= most {
            return;
        }
        let (span, old) = (*span, std::mem::replace(&mut self.core.nodes[node.index()].kind, NodeKind::Hole));
        let NodeKind::Let { sequential, mut bindings, body } = old else {
            unreachable!("the kind was looked at above")
        };
        let vector = VarId(self.core.variables.len() as u32);
        self.core.variables.push(Variable {
            name: Symbol::esl("%VARIABLES"),
            span,
            owner: lambda,
            is_assigned: false,
            is_captured: true,
            is_read: true,
            never_returns: false,
        });
        // Their values are stored where they would be bound; names are resolved, so it makes no difference
        // that a variable of a parallel `let` has its value before others are computed.
        let mut index = 0;
        for (target, value) in &mut bindings {
            let BoundVariable::Lexical(variable) = *target else { continue };
            let place = (vector, index);
            index += 1;
            self.places.insert(variable, place);
            let span = self.core.nodes[value.index()].span;
            let store = self.set(place, *value, span);
            *value = self.node(store, span);
        }
        let inner = if bindings.iter().all(|(target, _)| is_lexical(target)) {
            let forms = bindings.into_iter().map(|(_, value)| value).chain([body]).collect();
            NodeKind::Progn(forms)
        } else {
            NodeKind::Let { sequential, bindings, body }
        };
        let inner = self.node(inner, span);
        let size = self.node(NodeKind::Constant(Datum::integer(index, span)), span);
        let nothing = self.node(NodeKind::Constant(Datum::nil(span)), span);
        let make = NodeKind::Call(Callee::Builtin(Builtin::MakeVector), vec![size, nothing]);
        let make = self.node(make, span);
        let bindings = vec![(BoundVariable::Lexical(vector), make)];
        self.core.nodes[node.index()].kind = NodeKind::Let { sequential: true, bindings, body: inner };
    }

    /// Returns the operands that lead to a place.
    fn operands(&mut self, (vector, index): VectorPlace, span: Span) -> Vec<NodeId> {
        let vector = self.node(NodeKind::Local(vector), span);
        let index = self.node(NodeKind::Constant(Datum::integer(index, span)), span);
        vec![vector, index]
    }

    /// Returns an expression that reads a place.
    fn get(&mut self, place: VectorPlace, span: Span) -> NodeKind {
        NodeKind::Call(Callee::Builtin(Builtin::Svref), self.operands(place, span))
    }

    /// Returns an expression that stores the value of a node at a place, and has that value.
    fn set(&mut self, place: VectorPlace, value: NodeId, span: Span) -> NodeKind {
        let mut operands = self.operands(place, span);
        operands.push(value);
        NodeKind::Call(Callee::Builtin(Builtin::SetSvref), operands)
    }

    /// Replaces what a node refers to, if that is a variable that has got a place.
    fn reference(&mut self, index: usize) {
        let Node { kind, span } = &self.core.nodes[index];
        let span = *span;
        let variable = match kind {
            NodeKind::Local(variable)
            | NodeKind::SetLocal(variable, _)
            | NodeKind::Call(Callee::Local(variable), _)
            | NodeKind::Apply(Callee::Local(variable), _) => *variable,
            _ => return,
        };
        let Some(&place) = self.places.get(&variable) else { return };
        let old = std::mem::replace(&mut self.core.nodes[index].kind, NodeKind::Hole);
        let new = match old {
            NodeKind::SetLocal(_, value) => self.set(place, value, span),
            NodeKind::Call(_, arguments) => NodeKind::Call(self.callee(place, span), arguments),
            NodeKind::Apply(_, arguments) => NodeKind::Apply(self.callee(place, span), arguments),
            _ => self.get(place, span),
        };
        self.core.nodes[index].kind = new;
    }

    fn callee(&mut self, place: VectorPlace, span: Span) -> Callee {
        let function = self.get(place, span);
        Callee::Value(self.node(function, span))
    }
}
