//! What lowering must know of a whole form before it writes the first instruction.
//!
//! - Which lambda's frame each piece of text runs in: a local function that is called from one place only, apart from
//!   tail calls of itself, becomes part of the frame of that place ([`inline`]).
//! - What each closure captures, transitively, since closures are flat; which variables live in boxes, because they
//!   are captured and assigned; which local functions capture nothing, so that they are constants ([`Captures`]).
//! - Which blocks and tagbodies are left from inside a closure or across a cleanup, so that they need a catch.
//! - In which order the form is evaluated: every node has an interval of positions, every variable the positions at
//!   which it is read and set, so that lowering can ask whether an operand changes before it is used.
//! - Which nodes give exactly one value.
//!
//! All walks use explicit stacks and are linear in the form, apart from the number of captures.

mod capture;
mod children;
mod inline;

use std::ops::Range;

use rustc_hash::FxHashMap;

use crate::core::*;
use capture::Captures;
pub(crate) use capture::Lexical;
pub(crate) use children::{children, lambda_nodes};

/// What a local function is in the code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FunctionKind {
    /// Nobody refers to it.
    Unused,
    /// Part of the frame that calls it.
    Inline,
    /// A constant, since it captures nothing.
    Constant,
    /// A closure in a register.
    Closure,
}

/// What is known of a form.
#[derive(Debug)]
pub(crate) struct Resolution {
    /// The lambda in whose frame each lambda runs; its own unless it is inlined.
    frames: Vec<LambdaId>,
    /// The lambda of each variable that stands for a local function.
    functions: FxHashMap<VarId, LambdaId>,
    used: Vec<bool>,
    captures: Captures,
    /// Whether tail calls of a frame's own function may turn into jumps, which assign its parameters.
    self_called: Vec<bool>,
    block_catches: Vec<bool>,
    tagbody_catches: Vec<bool>,
    single: Vec<bool>,
    spans: Vec<(u32, u32)>,
    reads: Vec<Vec<u32>>,
    sets: Vec<Vec<u32>>,
}

impl Resolution {
    /// The lambda in whose frame the text of `lambda` runs.
    pub(crate) fn frame(&self, lambda: LambdaId) -> LambdaId {
        self.frames[lambda.index()]
    }

    /// The lambda that the local function `variable` stands for; `None` if it is an ordinary variable.
    pub(crate) fn function(&self, variable: VarId) -> Option<LambdaId> {
        self.functions.get(&variable).copied()
    }

    /// What the local function `variable`, with the text `lambda`, is in the code.
    pub(crate) fn function_kind(&self, lambda: LambdaId) -> FunctionKind {
        if self.frame(lambda) != lambda {
            FunctionKind::Inline
        } else if !self.used[lambda.index()] {
            FunctionKind::Unused
        } else if self.captures(lambda).is_empty() {
            FunctionKind::Constant
        } else {
            FunctionKind::Closure
        }
    }

    /// What the closure of `lambda` captures, in order.
    pub(crate) fn captures(&self, lambda: LambdaId) -> &[Lexical] {
        self.captures.of(lambda)
    }

    /// The number of `lexical` among the captures of `lambda`.
    pub(crate) fn capture_index(&self, lambda: LambdaId, lexical: Lexical) -> Option<usize> {
        self.captures.index(lambda, lexical)
    }

    /// Whether the variable lives in a box.
    pub(crate) fn is_boxed(&self, variable: VarId) -> bool {
        !self.sets[variable.index()].is_empty() && self.captures.is_captured(variable)
    }

    /// Whether a closure captures the variable.
    pub(crate) fn is_captured(&self, variable: VarId) -> bool {
        self.captures.is_captured(variable)
    }

    /// Whether anything sets the variable after it is bound, apart from jumps of inlined functions.
    pub(crate) fn is_assigned(&self, variable: VarId) -> bool {
        !self.sets[variable.index()].is_empty()
    }

    /// Whether anything reads or sets the variable.
    pub(crate) fn is_used(&self, variable: VarId) -> bool {
        !self.reads[variable.index()].is_empty() || self.is_assigned(variable)
    }

    /// How often the variable is read in the text.
    pub(crate) fn reads_of(&self, variable: VarId) -> usize {
        self.reads[variable.index()].len()
    }

    /// Whether jumps for self calls may assign the parameters of `lambda`.
    pub(crate) fn is_self_called(&self, lambda: LambdaId) -> bool {
        self.self_called[lambda.index()]
    }

    /// Whether the block is left from inside a closure or across a cleanup.
    pub(crate) fn block_needs_catch(&self, block: BlockId) -> bool {
        self.block_catches[block.index()]
    }

    /// Whether a tag of the tagbody is gone to from inside a closure or across a cleanup.
    pub(crate) fn tagbody_needs_catch(&self, tagbody: TagbodyId) -> bool {
        self.tagbody_catches[tagbody.index()]
    }

    /// Whether the node always gives exactly one value, if it gives any at all.
    pub(crate) fn is_single(&self, node: NodeId) -> bool {
        self.single[node.index()]
    }

    /// Whether evaluating `nodes` may set `variable`.
    pub(crate) fn is_set_in(&self, variable: VarId, nodes: &[NodeId]) -> bool {
        self.occurs(&self.sets[variable.index()], nodes)
    }

    /// Whether evaluating `nodes` may read `variable`.
    pub(crate) fn is_read_in(&self, variable: VarId, nodes: &[NodeId]) -> bool {
        self.occurs(&self.reads[variable.index()], nodes)
    }

    fn occurs(&self, positions: &[u32], nodes: &[NodeId]) -> bool {
        let (Some(first), Some(last)) = (nodes.first(), nodes.last()) else { return false };
        let range: Range<u32> = self.spans[first.index()].0..self.spans[last.index()].1;
        let at = positions.partition_point(|&position| position < range.start);
        positions.get(at).is_some_and(|&position| position < range.end)
    }
}

/// Resolves `core`.
pub(crate) fn resolve(core: &Core) -> Resolution {
    let inlining = inline::decide(core);
    let mut walk = Walk::new(core, inlining);
    walk.run();
    walk.finish()
}

/// The walk over the form in the order of evaluation, local functions placed where they run.
struct Walk<'a> {
    core: &'a Core,
    frames: Vec<LambdaId>,
    functions: FxHashMap<VarId, LambdaId>,
    used: Vec<bool>,
    captures: Captures,
    /// References to local functions, from which frame.
    function_references: Vec<(VarId, LambdaId)>,
    self_called: Vec<bool>,
    /// Frame and number of open cleanups at each block and tagbody.
    block_places: Vec<Site>,
    tagbody_places: Vec<Site>,
    block_catches: Vec<bool>,
    tagbody_catches: Vec<bool>,
    /// Whether all exits from a block so far give one value.
    block_singles: Vec<bool>,
    single: Vec<bool>,
    spans: Vec<(u32, u32)>,
    reads: Vec<Vec<u32>>,
    sets: Vec<Vec<u32>>,
    clock: u32,
    pending: Vec<WalkStep>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Site {
    frame: LambdaId,
    cleanups: u32,
}

enum WalkStep {
    Enter(NodeId, Site),
    Leave(NodeId),
}

impl<'a> Walk<'a> {
    fn new(core: &'a Core, inlining: inline::Inlining) -> Walk<'a> {
        let root = Site { frame: LambdaId(0), cleanups: 0 };
        let mut used = vec![false; core.lambdas.len()];
        if let Some(first) = used.first_mut() {
            *first = true;
        }
        Walk {
            core,
            frames: inlining.frames,
            functions: inlining.functions,
            used,
            captures: Captures::new(core),
            function_references: Vec::new(),
            self_called: vec![false; core.lambdas.len()],
            block_places: vec![root; core.blocks.len()],
            tagbody_places: vec![root; core.tagbodies.len()],
            block_catches: vec![false; core.blocks.len()],
            tagbody_catches: vec![false; core.tagbodies.len()],
            block_singles: vec![true; core.blocks.len()],
            single: vec![false; core.nodes.len()],
            spans: vec![(0, 0); core.nodes.len()],
            reads: vec![Vec::new(); core.variables.len()],
            sets: vec![Vec::new(); core.variables.len()],
            clock: 0,
            pending: Vec::new(),
        }
    }

    fn run(&mut self) {
        self.push_lambda(LambdaId(0), Site { frame: LambdaId(0), cleanups: 0 });
        while let Some(event) = self.pending.pop() {
            self.clock += 1;
            match event {
                WalkStep::Leave(node) => {
                    self.spans[node.index()].1 = self.clock;
                    self.single[node.index()] = self.gives_one(node);
                }
                WalkStep::Enter(node, place) => {
                    self.spans[node.index()].0 = self.clock;
                    self.pending.push(WalkStep::Leave(node));
                    let from = self.pending.len();
                    self.enter(node, place);
                    self.pending[from..].reverse();
                }
            }
        }
    }

    /// Lists the nodes of a lambda to be walked next, in order.
    fn push_lambda(&mut self, lambda: LambdaId, place: Site) {
        let pending = &mut self.pending;
        lambda_nodes(&self.core.lambdas[lambda.index()], &mut |node| {
            pending.push(WalkStep::Enter(node, place))
        });
    }

    /// Notes what a node does, and lists what is walked inside it, in order.
    fn enter(&mut self, node: NodeId, place: Site) {
        let core = self.core;
        let kind = &core.nodes[node.index()].kind;
        match kind {
            NodeKind::Local(variable) => self.read(*variable, place),
            NodeKind::SetLocal(variable, _) => {
                self.sets[variable.index()].push(self.clock);
                self.capture(Lexical::Variable(*variable), place);
            }
            NodeKind::Lambda(lambda) => return self.closure(*lambda, place),
            NodeKind::Functions { definitions, .. } => {
                for &(_, lambda) in definitions {
                    if self.frames[lambda.index()] == lambda {
                        self.captures.set_parent(lambda, place.frame);
                        self.push_lambda(lambda, Site { frame: lambda, cleanups: 0 });
                    }
                }
            }
            NodeKind::Call(callee, arguments) => return self.call(callee, arguments, place),
            NodeKind::Apply(Callee::Local(variable), _) => self.read(*variable, place),
            NodeKind::Block(block, _) => self.block_places[block.index()] = place,
            NodeKind::ReturnFrom(block, _) if self.block_places[block.index()] != place => {
                self.block_catches[block.index()] = true;
                self.capture(Lexical::Block(*block), place);
            }
            NodeKind::Tagbody(tagbody, _) => self.tagbody_places[tagbody.index()] = place,
            NodeKind::Go(tagbody, _) if self.tagbody_places[tagbody.index()] != place => {
                self.tagbody_catches[tagbody.index()] = true;
                self.capture(Lexical::Tagbody(*tagbody), place);
            }
            NodeKind::FailureCleanup(body, cleanup) => {
                let inside = Site { cleanups: place.cleanups + 1, ..place };
                self.pending.push(WalkStep::Enter(*body, place));
                return self.pending.push(WalkStep::Enter(*cleanup, inside));
            }
            NodeKind::UnwindProtect(..) => {
                let inside = Site { cleanups: place.cleanups + 1, ..place };
                let pending = &mut self.pending;
                return children(kind, &mut |child| pending.push(WalkStep::Enter(child, inside)));
            }
            _ => {}
        }
        let pending = &mut self.pending;
        children(kind, &mut |child| pending.push(WalkStep::Enter(child, place)));
    }

    fn closure(&mut self, lambda: LambdaId, place: Site) {
        self.used[lambda.index()] = true;
        self.captures.set_parent(lambda, place.frame);
        self.push_lambda(lambda, Site { frame: lambda, cleanups: 0 });
    }

    fn call(&mut self, callee: &Callee, arguments: &[NodeId], place: Site) {
        let own = &self.core.lambdas[place.frame.index()];
        match callee {
            Callee::Value(function) => match self.core.nodes[function.index()].kind {
                NodeKind::Lambda(lambda) if self.frames[lambda.index()] != lambda => {
                    self.pending.extend(arguments.iter().map(|&child| WalkStep::Enter(child, place)));
                    return self.push_lambda(lambda, place);
                }
                _ => self.pending.push(WalkStep::Enter(*function, place)),
            },
            Callee::Global(name) => {
                if own.is_named(name) && own.takes_exactly(arguments.len()) {
                    self.self_called[place.frame.index()] = true;
                }
            }
            Callee::Local(variable) => {
                let target = self.functions.get(variable).copied();
                if let Some(lambda) = target.filter(|lambda| self.frames[lambda.index()] != *lambda) {
                    self.pending.extend(arguments.iter().map(|&child| WalkStep::Enter(child, place)));
                    // The call from outside has the body in it; those from inside jump to it.
                    if std::mem::replace(&mut self.used[lambda.index()], true) {
                        self.self_called[lambda.index()] = true;
                    } else {
                        self.push_lambda(lambda, place);
                    }
                    return;
                }
                if target == Some(place.frame) && own.takes_exactly(arguments.len()) {
                    self.self_called[place.frame.index()] = true;
                } else {
                    self.read(*variable, place);
                }
            }
            Callee::Builtin(_) => {}
        }
        self.pending.extend(arguments.iter().map(|&child| WalkStep::Enter(child, place)));
    }

    fn read(&mut self, variable: VarId, place: Site) {
        if let Some(&lambda) = self.functions.get(&variable) {
            self.used[lambda.index()] = true;
            self.function_references.push((variable, place.frame));
        } else {
            self.reads[variable.index()].push(self.clock);
            self.capture(Lexical::Variable(variable), place);
        }
    }

    fn capture(&mut self, lexical: Lexical, place: Site) {
        let owner = lexical.owner(self.core);
        self.captures.add(lexical, self.frames[owner.index()], place.frame, &mut |_| {});
    }

    /// Whether a node gives exactly one value, now that this is known of everything inside it.
    fn gives_one(&mut self, node: NodeId) -> bool {
        let core = self.core;
        let of = |id: &NodeId| self.single[id.index()];
        match &core.nodes[node.index()].kind {
            NodeKind::If(_, consequent, alternative) => of(consequent) && of(alternative),
            NodeKind::Progn(forms) | NodeKind::And(forms) | NodeKind::Or(forms) => {
                forms.last().is_none_or(of)
            }
            NodeKind::Let { body, .. }
            | NodeKind::Functions { body, .. }
            | NodeKind::Progv(_, _, body)
            | NodeKind::BindValues(_, _, body)
            | NodeKind::Handlers(_, body)
            | NodeKind::Mask(_, body)
            | NodeKind::Recovery { body, .. } => of(body),
            NodeKind::FirstValues(first, _) | NodeKind::UnwindProtect(first, _) => of(first),
            NodeKind::ReturnFrom(block, value) => {
                let value = of(value);
                self.block_singles[block.index()] &= value;
                true
            }
            NodeKind::Block(block, body) => self.block_singles[block.index()] && of(body),
            NodeKind::HandlerCase(body, clauses) => of(body) && clauses.iter().all(|clause| of(&clause.body)),
            NodeKind::Values(forms) => forms.len() == 1,
            NodeKind::Call(Callee::Builtin(builtin), _) => builtin.info().returns_one,
            // What recovers from the failure gives the values of a form with a cleanup for failures.
            NodeKind::Call(..)
            | NodeKind::Apply(..)
            | NodeKind::CallValues(..)
            | NodeKind::Catch(..)
            | NodeKind::FailureCleanup(..) => false,
            _ => true,
        }
    }

    fn finish(mut self) -> Resolution {
        let functions = std::mem::take(&mut self.functions);
        let references = std::mem::take(&mut self.function_references);
        self.captures.add_functions(self.core, &self.frames, &functions, &references);
        Resolution {
            single: self.single,
            frames: self.frames,
            functions,
            used: self.used,
            captures: self.captures,
            self_called: self.self_called,
            block_catches: self.block_catches,
            tagbody_catches: self.tagbody_catches,
            spans: self.spans,
            reads: self.reads,
            sets: self.sets,
        }
    }
}
