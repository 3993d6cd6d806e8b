//! Resolution: facts about a whole form that lowering needs before it writes the first instruction.
//!
//! - The lambda in whose frame each piece of text runs: a local function that is called from one site only,
//!   apart from tail calls of itself, becomes part of the frame of that site ([`inline`]).
//! - The captures of each closure, transitively, since closures are flat; the variables that live in boxes,
//!   because they are captured and assigned; the local functions that capture nothing, so that they are
//!   constants ([`Captures`]).
//! - The blocks and tagbodies that control leaves from inside a closure or across a cleanup, so that they
//!   need a catch.
//! - The order of evaluation: every node has an interval of positions, every variable the positions at which
//!   it is read and set, so that lowering can ask whether an operand changes before it is used.
//! - The nodes that have exactly one value.
//!
//! All walks use explicit stacks and are linear in the form, apart from the number of captures.

mod capture;
mod children;
mod inline;

use std::ops::Range;

use esl_bytecode::compile::Work;
use rustc_hash::FxHashMap;

use crate::core::*;
use capture::Captures;
pub(crate) use capture::Lexical;
pub(crate) use children::children_mut;
pub use children::{children, lambda_nodes};
pub(crate) use inline::InlineDecision;

/// Representation of a local function in the code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FunctionKind {
    /// Nothing refers to it.
    Unused,
    /// Part of the frame that calls it.
    Inline,
    /// A constant, since it captures nothing.
    Constant,
    /// A closure in a register.
    Closure,
}

/// Facts about a form.
#[derive(Debug)]
pub(crate) struct Resolution {
    /// Lambda in whose frame each lambda runs: itself, unless it is inlined.
    frames: Vec<LambdaId>,
    /// Lambda of each variable that is a local function.
    functions: FxHashMap<VarId, LambdaId>,
    used: Vec<bool>,
    captures: Captures,
    /// Whether tail calls of a frame's own function may become jumps, which assign its parameters.
    self_called: Vec<bool>,
    block_catches: Vec<bool>,
    tagbody_catches: Vec<bool>,
    single: Vec<bool>,
    spans: Vec<(u32, u32)>,
    reads: Vec<Vec<u32>>,
    sets: Vec<Vec<u32>>,
}

impl Resolution {
    /// Returns the lambda in whose frame the text of `lambda` runs.
    pub(crate) fn frame(&self, lambda: LambdaId) -> LambdaId {
        self.frames[lambda.index()]
    }

    /// Returns the lambda of the local function `variable`; `None` for an ordinary variable.
    pub(crate) fn function(&self, variable: VarId) -> Option<LambdaId> {
        self.functions.get(&variable).copied()
    }

    /// Returns the representation of the local function with the text `lambda`.
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

    /// Returns the captures of the closure of `lambda`, in order.
    pub(crate) fn captures(&self, lambda: LambdaId) -> &[Lexical] {
        self.captures.of(lambda)
    }

    /// Returns the index of `lexical` among the captures of `lambda`.
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

    /// Returns the number of reads of the variable in the text.
    pub(crate) fn reads_of(&self, variable: VarId) -> usize {
        self.reads[variable.index()].len()
    }

    /// Whether jumps for self calls may assign the parameters of `lambda`.
    pub(crate) fn is_self_called(&self, lambda: LambdaId) -> bool {
        self.self_called[lambda.index()]
    }

    /// Whether control leaves the block from inside a closure or across a cleanup.
    pub(crate) fn block_needs_catch(&self, block: BlockId) -> bool {
        self.block_catches[block.index()]
    }

    /// Whether control goes to a tag of the tagbody from inside a closure or across a cleanup.
    pub(crate) fn tagbody_needs_catch(&self, tagbody: TagbodyId) -> bool {
        self.tagbody_catches[tagbody.index()]
    }

    /// Whether the node has exactly one value whenever control passes it.
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
#[cfg(test)]
pub(crate) fn resolve(core: &Core) -> Resolution {
    let mut decision = InlineDecision::new(core);
    decision.run(core, &mut Work::unbounded());
    let mut walk = ResolveWalk::new(core, decision);
    walk.run(core, &mut Work::unbounded());
    walk.finish(core)
}

/// Steps of the walk that count as a unit of work.
const STEPS_PER_UNIT: u32 = 8;

/// The walk over the form in the order of evaluation. Inlined functions are walked where they run. It goes on
/// in parts; each is given the same form.
pub(crate) struct ResolveWalk {
    frames: Vec<LambdaId>,
    functions: FxHashMap<VarId, LambdaId>,
    used: Vec<bool>,
    captures: Captures,
    /// References to local functions, and the frames that contain them.
    function_references: Vec<(VarId, LambdaId)>,
    self_called: Vec<bool>,
    /// Site of each block.
    block_sites: Vec<Site>,
    tagbody_sites: Vec<Site>,
    block_catches: Vec<bool>,
    tagbody_catches: Vec<bool>,
    /// Whether all exits from a block so far have one value.
    block_singles: Vec<bool>,
    single: Vec<bool>,
    spans: Vec<(u32, u32)>,
    reads: Vec<Vec<u32>>,
    sets: Vec<Vec<u32>>,
    clock: u32,
    pending: Vec<WalkStep>,
}

/// The frame in which a node runs, and the number of cleanups open around it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Site {
    frame: LambdaId,
    cleanups: u32,
}

/// A step of the walk.
enum WalkStep {
    Enter(NodeId, Site),
    Leave(NodeId),
}

impl ResolveWalk {
    /// Begins the walk over `core`, for which is known which functions are inlined.
    pub(crate) fn new(core: &Core, decision: InlineDecision) -> ResolveWalk {
        let inlining = decision.finish(core);
        let root = Site { frame: LambdaId(0), cleanups: 0 };
        let mut used = vec![false; core.lambdas.len()];
        if let Some(first) = used.first_mut() {
            *first = true;
        }
        let mut walk = ResolveWalk {
            frames: inlining.frames,
            functions: inlining.functions,
            used,
            captures: Captures::new(core),
            function_references: Vec::new(),
            self_called: vec![false; core.lambdas.len()],
            block_sites: vec![root; core.blocks.len()],
            tagbody_sites: vec![root; core.tagbodies.len()],
            block_catches: vec![false; core.blocks.len()],
            tagbody_catches: vec![false; core.tagbodies.len()],
            block_singles: vec![true; core.blocks.len()],
            single: vec![false; core.nodes.len()],
            spans: vec![(0, 0); core.nodes.len()],
            reads: vec![Vec::new(); core.variables.len()],
            sets: vec![Vec::new(); core.variables.len()],
            clock: 0,
            pending: Vec::new(),
        };
        walk.push_lambda(core, LambdaId(0), root);
        walk
    }

    /// Walks on. Returns whether the walk is over; otherwise the work that is allowed is done.
    pub(crate) fn run(&mut self, core: &Core, work: &mut Work) -> bool {
        while let Some(event) = self.pending.pop() {
            if self.clock.is_multiple_of(STEPS_PER_UNIT) {
                work.add(1);
                if work.is_done() {
                    self.pending.push(event);
                    return false;
                }
            }
            self.clock += 1;
            match event {
                WalkStep::Leave(node) => {
                    self.spans[node.index()].1 = self.clock;
                    self.single[node.index()] = self.gives_one(core, node);
                }
                WalkStep::Enter(node, site) => {
                    self.spans[node.index()].0 = self.clock;
                    self.pending.push(WalkStep::Leave(node));
                    let from = self.pending.len();
                    self.enter(core, node, site);
                    self.pending[from..].reverse();
                }
            }
        }
        true
    }

    /// Schedules the nodes of a lambda, in order.
    fn push_lambda(&mut self, core: &Core, lambda: LambdaId, site: Site) {
        let pending = &mut self.pending;
        lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push(WalkStep::Enter(node, site)));
    }

    /// Notes the effects of a node and schedules the nodes inside it, in order.
    fn enter(&mut self, core: &Core, node: NodeId, site: Site) {
        let kind = &core.nodes[node.index()].kind;
        match kind {
            NodeKind::Local(variable) => self.read(core, *variable, site),
            NodeKind::SetLocal(variable, _) => {
                self.sets[variable.index()].push(self.clock);
                self.capture(core, Lexical::Variable(*variable), site);
            }
            NodeKind::Lambda(lambda) => return self.closure(core, *lambda, site),
            NodeKind::Functions { definitions, .. } => {
                for &(_, lambda) in definitions {
                    if self.frames[lambda.index()] == lambda {
                        self.captures.set_parent(lambda, site.frame);
                        self.push_lambda(core, lambda, Site { frame: lambda, cleanups: 0 });
                    }
                }
            }
            NodeKind::Call(callee, arguments) => return self.call(core, callee, arguments, site),
            NodeKind::Apply(Callee::Local(variable), _) => self.read(core, *variable, site),
            NodeKind::Block(block, _) => self.block_sites[block.index()] = site,
            NodeKind::ReturnFrom(block, _) if self.block_sites[block.index()] != site => {
                self.block_catches[block.index()] = true;
                self.capture(core, Lexical::Block(*block), site);
            }
            NodeKind::Tagbody(tagbody, _) => self.tagbody_sites[tagbody.index()] = site,
            NodeKind::Go(tagbody, _) if self.tagbody_sites[tagbody.index()] != site => {
                self.tagbody_catches[tagbody.index()] = true;
                self.capture(core, Lexical::Tagbody(*tagbody), site);
            }
            NodeKind::FailureCleanup(body, cleanup) => {
                let inside = Site { cleanups: site.cleanups + 1, ..site };
                self.pending.push(WalkStep::Enter(*body, site));
                return self.pending.push(WalkStep::Enter(*cleanup, inside));
            }
            NodeKind::UnwindProtect(..) => {
                let inside = Site { cleanups: site.cleanups + 1, ..site };
                let pending = &mut self.pending;
                return children(kind, &mut |child| pending.push(WalkStep::Enter(child, inside)));
            }
            _ => {}
        }
        let pending = &mut self.pending;
        children(kind, &mut |child| pending.push(WalkStep::Enter(child, site)));
    }

    fn closure(&mut self, core: &Core, lambda: LambdaId, site: Site) {
        self.used[lambda.index()] = true;
        self.captures.set_parent(lambda, site.frame);
        self.push_lambda(core, lambda, Site { frame: lambda, cleanups: 0 });
    }

    fn call(&mut self, core: &Core, callee: &Callee, arguments: &[NodeId], site: Site) {
        let own = &core.lambdas[site.frame.index()];
        match callee {
            Callee::Value(function) => match core.nodes[function.index()].kind {
                NodeKind::Lambda(lambda) if self.frames[lambda.index()] != lambda => {
                    self.pending.extend(arguments.iter().map(|&child| WalkStep::Enter(child, site)));
                    return self.push_lambda(core, lambda, site);
                }
                _ => self.pending.push(WalkStep::Enter(*function, site)),
            },
            Callee::Global(name) => {
                if own.is_named(name) && own.takes_exactly(arguments.len()) {
                    self.self_called[site.frame.index()] = true;
                }
            }
            Callee::Local(variable) => {
                let target = self.functions.get(variable).copied();
                if let Some(lambda) = target.filter(|lambda| self.frames[lambda.index()] != *lambda) {
                    self.pending.extend(arguments.iter().map(|&child| WalkStep::Enter(child, site)));
                    // The call from outside contains the body; calls from inside jump to it.
                    if std::mem::replace(&mut self.used[lambda.index()], true) {
                        self.self_called[lambda.index()] = true;
                    } else {
                        self.push_lambda(core, lambda, site);
                    }
                    return;
                }
                if target == Some(site.frame) && own.takes_exactly(arguments.len()) {
                    self.self_called[site.frame.index()] = true;
                } else {
                    self.read(core, *variable, site);
                }
            }
            Callee::Builtin(_) => {}
        }
        self.pending.extend(arguments.iter().map(|&child| WalkStep::Enter(child, site)));
    }

    fn read(&mut self, core: &Core, variable: VarId, site: Site) {
        if let Some(&lambda) = self.functions.get(&variable) {
            self.used[lambda.index()] = true;
            self.function_references.push((variable, site.frame));
        } else {
            self.reads[variable.index()].push(self.clock);
            self.capture(core, Lexical::Variable(variable), site);
        }
    }

    fn capture(&mut self, core: &Core, lexical: Lexical, site: Site) {
        let owner = lexical.owner(core);
        self.captures.add(lexical, self.frames[owner.index()], site.frame, &mut |_| {});
    }

    /// Whether a node has exactly one value, once this is known of the nodes inside it.
    fn gives_one(&mut self, core: &Core, node: NodeId) -> bool {
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
            // A form with a cleanup for failures has the values with which the program recovers from the
            // failure.
            NodeKind::Call(..)
            | NodeKind::Apply(..)
            | NodeKind::CallValues(..)
            | NodeKind::Catch(..)
            | NodeKind::FailureCleanup(..) => false,
            _ => true,
        }
    }

    /// Returns the facts, when the walk is over.
    pub(crate) fn finish(mut self, core: &Core) -> Resolution {
        let functions = std::mem::take(&mut self.functions);
        let references = std::mem::take(&mut self.function_references);
        self.captures.add_functions(core, &self.frames, &functions, &references);
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
