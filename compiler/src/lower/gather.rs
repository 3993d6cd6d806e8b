//! Variables of a long `let` that find no room in registers: they live in one vector on the heap, made each
//! time the `let` is entered.
//!
//! Closures capture the vector instead of the variables, of which they may refer to any number; and parts
//! into which the function is divided (`split`) do the same. This happens only in functions that do not fit
//! otherwise, since it makes each access slower.
//!
//! Where a closure has more captures than the format has room for, the variables of forms inside each other
//! share one vector, as far as the inner forms are entered at most once each time the outer one is.

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
    /// Nodes that are still to be looked at, and where they are.
    pending: Vec<(NodeId, GatherSite)>,
    /// Vectors so far.
    vectors: Vec<GatheredVector>,
    /// The `let` whose variables are being moved.
    current: Option<GatheredLet>,
    /// Number of nodes in which references have been replaced.
    replaced: usize,
    most: usize,
    /// Whether forms inside each other share a vector.
    shares: bool,
}

/// Where a node is: the lambda that it belongs to, and the number of the vector that it may share.
#[derive(Clone, Copy)]
struct GatherSite {
    lambda: LambdaId,
    vector: Option<usize>,
}

/// A `let` whose variables are being moved.
struct GatheredLet {
    node: NodeId,
    site: GatherSite,
    sequential: bool,
    bindings: Vec<(BoundVariable, NodeId)>,
    body: NodeId,
    /// Number of the vector, and the first place there that is free.
    vector: usize,
    place: u32,
    /// Number of bindings that are seen to.
    done: usize,
}

/// A vector of variables.
struct GatheredVector {
    variable: VarId,
    /// Node of its size.
    size: NodeId,
    /// Places in use.
    used: u32,
}

impl GatheredVariables {
    /// Begins with the texts of `lambdas`, where a `let` may have `most` variables. If it `shares` vectors,
    /// all variables go into some.
    pub(super) fn new(core: &Core, lambdas: &[LambdaId], most: usize, shares: bool) -> GatheredVariables {
        let mut pending = Vec::new();
        for &lambda in lambdas {
            let site = GatherSite { lambda, vector: None };
            lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push((node, site)));
        }
        let most = if shares { 0 } else { most };
        let (places, vectors) = (FxHashMap::default(), Vec::new());
        GatheredVariables { places, pending, vectors, current: None, replaced: 0, most, shares }
    }

    /// Goes on. Returns whether all is done; otherwise the work that is allowed is done.
    pub(super) fn run(&mut self, core: &mut Core, work: &mut Work) -> bool {
        loop {
            let mut gatherer = Gatherer { core, places: &mut self.places, vectors: &mut self.vectors };
            if let Some(mut current) = self.current.take() {
                if !gatherer.store(&mut current, work) {
                    self.current = Some(current);
                    return false;
                }
                gatherer.finish(current);
            }
            let Some((node, site)) = self.pending.pop() else { break };
            if work.is_done() {
                self.pending.push((node, site));
                return false;
            }
            let before = self.pending.len();
            let kind = &gatherer.core.nodes[node.index()].kind;
            children(kind, &mut |child| self.pending.push((child, site)));
            // The contents of these forms may be entered again.
            let repeats = matches!(kind, NodeKind::Tagbody(..) | NodeKind::Recovery { .. });
            work.add(1 + (self.pending.len() - before) as u64 / PARTS_PER_UNIT);
            self.current = gatherer.begin(node, site, self.most);
            let vector = self.current.as_ref().map(|current| current.vector);
            if let Some(vector) = vector.map(Some).or(repeats.then_some(None)).filter(|_| self.shares) {
                self.pending[before..].iter_mut().for_each(|(_, site)| site.vector = vector);
            }
        }
        for GatheredVector { size, used, .. } in self.vectors.drain(..) {
            let size = &mut core.nodes[size.index()];
            size.kind = NodeKind::Constant(Datum::integer(used, size.span));
        }
        // Without places there is nothing to replace.
        let end = if self.places.is_empty() { 0 } else { core.nodes.len() };
        while self.replaced < end {
            if work.is_done() {
                return false;
            }
            work.add(1);
            for index in self.replaced..end.min(self.replaced + PARTS_PER_UNIT as usize) {
                Gatherer { core, places: &mut self.places, vectors: &mut self.vectors }.reference(index);
            }
            self.replaced += PARTS_PER_UNIT as usize;
        }
        // Nodes added to the form later have no such references.
        self.replaced = usize::MAX;
        true
    }
}

/// Nodes that count as a unit of work.
const PARTS_PER_UNIT: u64 = 8;
/// Bindings that count as a unit of work.
const BINDINGS_PER_UNIT: usize = 2;

fn is_lexical(target: &BoundVariable) -> bool {
    matches!(target, BoundVariable::Lexical(_))
}

struct Gatherer<'a> {
    core: &'a mut Core,
    places: &'a mut FxHashMap<VarId, VectorPlace>,
    vectors: &'a mut Vec<GatheredVector>,
}

impl Gatherer<'_> {
    fn node(&mut self, kind: NodeKind, span: Span) -> NodeId {
        self.core.nodes.push(Node { kind, span });
        NodeId(self.core.nodes.len() as u32 - 1)
    }

    /// Begins to give the variables of a `let` places in a vector, if they are too many: in that of the site,
    /// if it has one.
    fn begin(&mut self, node: NodeId, site: GatherSite, most: usize) -> Option<GatheredLet> {
        let Node { kind: NodeKind::Let { bindings, .. }, span } = &mut self.core.nodes[node.index()] else {
            return None;
        };
        let count = bindings.iter().filter(|(target, _)| is_lexical(target)).count();
        if count <= most {
            return None;
        }
        let (span, old) = (*span, std::mem::replace(&mut self.core.nodes[node.index()].kind, NodeKind::Hole));
        let NodeKind::Let { sequential, bindings, body } = old else {
            unreachable!("the kind was looked at above")
        };
        let number = site.vector.unwrap_or_else(|| self.vector(site.lambda, span));
        let vector = &mut self.vectors[number];
        let place = vector.used;
        vector.used += count as u32;
        Some(GatheredLet { node, site, sequential, bindings, body, vector: number, place, done: 0 })
    }

    /// Has the values of variables stored where they would be bound; names are resolved, so it makes no
    /// difference that a variable of a parallel `let` has its value before others are computed. Returns
    /// whether all are seen to; otherwise the work that is allowed is done.
    fn store(&mut self, current: &mut GatheredLet, work: &mut Work) -> bool {
        let variable = self.vectors[current.vector].variable;
        while let Some((target, value)) = current.bindings.get_mut(current.done) {
            if current.done.is_multiple_of(BINDINGS_PER_UNIT) {
                if work.is_done() {
                    return false;
                }
                work.add(1);
            }
            current.done += 1;
            let BoundVariable::Lexical(bound) = *target else { continue };
            let place = (variable, current.place);
            current.place += 1;
            self.places.insert(bound, place);
            let span = self.core.nodes[value.index()].span;
            let store = self.set(place, *value, span);
            *value = self.node(store, span);
        }
        true
    }

    /// Puts what is left of a `let` in its place.
    fn finish(&mut self, current: GatheredLet) {
        let GatheredLet { node, site, sequential, bindings, body, vector, .. } = current;
        let span = self.core.nodes[node.index()].span;
        let inner = if bindings.iter().all(|(target, _)| is_lexical(target)) {
            let forms = bindings.into_iter().map(|(_, value)| value).chain([body]).collect();
            NodeKind::Progn(forms)
        } else {
            NodeKind::Let { sequential, bindings, body }
        };
        if site.vector.is_some() {
            self.core.nodes[node.index()].kind = inner;
            return;
        }
        let inner = self.node(inner, span);
        let nothing = self.node(NodeKind::Constant(Datum::nil(span)), span);
        let GatheredVector { variable, size, .. } = self.vectors[vector];
        let make = NodeKind::Call(Callee::Builtin(Builtin::MakeVector), vec![size, nothing]);
        let make = self.node(make, span);
        let bindings = vec![(BoundVariable::Lexical(variable), make)];
        self.core.nodes[node.index()].kind = NodeKind::Let { sequential: true, bindings, body: inner };
    }

    /// Adds a vector that a form of this lambda makes, and returns its number.
    fn vector(&mut self, lambda: LambdaId, span: Span) -> usize {
        let variable = VarId(self.core.variables.len() as u32);
        self.core.variables.push(Variable {
            name: Symbol::esl("%VARIABLES"),
            span,
            owner: lambda,
            is_assigned: false,
            is_captured: true,
            is_read: true,
            never_returns: false,
        });
        let size = self.node(NodeKind::Hole, span);
        self.vectors.push(GatheredVector { variable, size, used: 0 });
        self.vectors.len() - 1
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
