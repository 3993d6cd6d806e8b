//! The decision which local functions become part of the frame that calls them.
//!
//! A function is inlined if it takes required parameters only, all its uses are calls with the right number
//! of arguments, and all calls but one are tail calls of itself. Those become jumps, and the call from
//! outside enters the loop. `((lambda (x) …) 1)` is the case without jumps; a named loop is the case with
//! them. Functions that tail-call each other become one loop if each but one is called from one place only.

use esl_bytecode::compile::Work;
use rustc_hash::FxHashMap;

use super::STEPS_PER_UNIT;
use super::children::{children, lambda_nodes};
use crate::core::*;

/// The frames of all lambdas.
pub(super) struct Inlining {
    /// Lambda in whose frame each lambda runs.
    pub(super) frames: Vec<LambdaId>,
    /// Lambda of each local function.
    pub(super) functions: FxHashMap<VarId, LambdaId>,
}

/// A call of a local function.
#[derive(Clone, Copy)]
struct CallSite {
    /// Lambda that contains the call.
    lambda: LambdaId,
    /// Whether it is a tail call.
    tail: bool,
    /// Whether the number of arguments is right.
    fits: bool,
}

/// Facts on which the decision depends.
struct InlineSurvey {
    functions: FxHashMap<VarId, LambdaId>,
    /// The functions in the order of their definitions.
    order: Vec<VarId>,
    sites: Vec<Vec<CallSite>>,
    /// Whether each function has uses other than calls.
    values: Vec<bool>,
    /// Whether control leaves each block from another lambda or across a cleanup.
    escaping: Vec<bool>,
    /// For lambdas that are called where they are written: the lambda around the call, and whether it is a
    /// tail call.
    hosts: Vec<Option<(LambdaId, bool)>>,
}

/// Repetitions of the decision, since inlining one function may make another one inlinable.
const ROUNDS: usize = 8;

/// The decision in which frame each lambda runs. It is made in parts; each is given the same form.
pub(crate) struct InlineDecision {
    survey: InlineSurvey,
    /// Whether control leaves each block from another lambda or across a cleanup, once the first survey has
    /// found that: whether a form is in tail position depends on it.
    escaping: Option<Vec<bool>>,
    blocks: Vec<Visit>,
    pending: Vec<(NodeId, Visit)>,
    steps: u32,
}

impl InlineDecision {
    /// Begins the decision.
    pub(crate) fn new(core: &Core) -> InlineDecision {
        let mut decision = InlineDecision {
            survey: InlineSurvey::new(core),
            escaping: None,
            blocks: Vec::new(),
            pending: Vec::new(),
            steps: 0,
        };
        decision.begin(core);
        decision
    }

    fn begin(&mut self, core: &Core) {
        self.survey = InlineSurvey::new(core);
        self.blocks = vec![Visit::TOP; core.blocks.len()];
        enter_lambda(core, LambdaId(0), &mut self.pending);
    }

    /// Goes on. Returns whether all is known; otherwise the work that is allowed is done.
    pub(crate) fn run(&mut self, core: &Core, work: &mut Work) -> bool {
        loop {
            while let Some((node, at)) = self.pending.pop() {
                if self.steps.is_multiple_of(STEPS_PER_UNIT) {
                    work.add(1);
                    if work.is_done() {
                        self.pending.push((node, at));
                        return false;
                    }
                }
                self.steps = self.steps.wrapping_add(1);
                self.visit(core, node, at);
            }
            if self.escaping.is_some() {
                return true;
            }
            self.escaping = Some(std::mem::take(&mut self.survey.escaping));
            self.begin(core);
        }
    }

    /// Returns the frames, once all is known.
    pub(super) fn finish(self, core: &Core) -> Inlining {
        let survey = self.survey;
        let mut hosts = survey.hosts;
        for _ in 0..ROUNDS {
            let mut changed = false;
            for &name in survey.order.iter().rev() {
                let lambda = survey.functions[&name];
                let text = &core.lambdas[lambda.index()];
                let is_plain = text.is_exact() && text.required.iter().all(|parameter| !parameter.is_special);
                if hosts[lambda.index()].is_some() || survey.values[name.index()] || !is_plain {
                    continue;
                }
                if let Some(host) = only_caller(lambda, &survey.sites[name.index()], &hosts) {
                    hosts[lambda.index()] = Some(host);
                    changed = true;
                }
            }
            if !changed {
                break;
            }
        }
        let frames =
            (0..core.lambdas.len()).map(|index| settle(LambdaId(index as u32), true, &hosts).0).collect();
        Inlining { frames, functions: survey.functions }
    }
}

/// Returns the lambda in whose frame `lambda` runs, and whether a tail position of `lambda` is one of that
/// frame.
fn settle(mut lambda: LambdaId, mut tail: bool, hosts: &[Option<(LambdaId, bool)>]) -> (LambdaId, bool) {
    while let Some((host, host_tail)) = hosts[lambda.index()] {
        lambda = host;
        tail &= host_tail;
    }
    (lambda, tail)
}

/// Returns the call from outside, if it is the only one and all other calls of the function are tail calls of
/// itself.
fn only_caller(
    lambda: LambdaId,
    sites: &[CallSite],
    hosts: &[Option<(LambdaId, bool)>],
) -> Option<(LambdaId, bool)> {
    let mut outside = None;
    for site in sites {
        let (frame, tail) = settle(site.lambda, site.tail, hosts);
        if !site.fits {
            return None;
        }
        if frame == lambda {
            if !tail {
                return None;
            }
        } else if outside.replace((site.lambda, site.tail)).is_some() {
            return None;
        }
    }
    outside
}

/// Circumstances of a node to be visited.
#[derive(Clone, Copy)]
struct Visit {
    lambda: LambdaId,
    /// Whether the node is in tail position.
    tail: bool,
    /// Number of dynamic extents around the node.
    extents: u32,
    /// Number of cleanups around the node.
    cleanups: u32,
}

impl Visit {
    const TOP: Visit = Visit { lambda: LambdaId(0), tail: true, extents: 0, cleanups: 0 };

    fn no_tail(self) -> Visit {
        Visit { tail: false, ..self }
    }

    fn inside(self) -> Visit {
        Visit { tail: false, extents: self.extents + 1, ..self }
    }
}

impl InlineSurvey {
    fn new(core: &Core) -> InlineSurvey {
        InlineSurvey {
            functions: FxHashMap::default(),
            order: Vec::new(),
            sites: vec![Vec::new(); core.variables.len()],
            values: vec![false; core.variables.len()],
            escaping: vec![false; core.blocks.len()],
            hosts: vec![None; core.lambdas.len()],
        }
    }
}

impl InlineDecision {
    /// Notes what a node tells, and schedules the nodes inside it.
    fn visit(&mut self, core: &Core, node: NodeId, at: Visit) {
        let InlineDecision { survey, escaping, blocks, pending, .. } = self;
        let escapes = |block: BlockId| escaping.as_ref().is_some_and(|all| all[block.index()]);
        let kind = &core.nodes[node.index()].kind;
        // Circumstances of the last child, and of the others.
        let mut last = at.no_tail();
        let mut rest = at.no_tail();
        match kind {
            NodeKind::Local(variable) => survey.values[variable.index()] = true,
            NodeKind::Lambda(lambda) => enter_lambda(core, *lambda, pending),
            NodeKind::If(test, consequent, alternative) => {
                pending.extend([(*test, rest), (*consequent, at), (*alternative, at)]);
                return;
            }
            NodeKind::Progn(_) | NodeKind::And(_) | NodeKind::Or(_) => last = at,
            NodeKind::Let { bindings, .. } => {
                last = if bindings.iter().any(|(target, _)| is_special(target)) { at.inside() } else { at };
                // Later values of a sequential `let` are computed under earlier special bindings.
                rest = if last.tail { rest } else { at.inside() };
            }
            NodeKind::BindValues(targets, ..) => {
                last = if targets.iter().any(is_special) { at.inside() } else { at };
            }
            NodeKind::Functions { definitions, body } => {
                for &(name, lambda) in definitions {
                    if survey.functions.insert(name, lambda).is_none() {
                        survey.order.push(name);
                    }
                    enter_lambda(core, lambda, pending);
                }
                pending.push((*body, at));
                return;
            }
            NodeKind::Block(block, _) => {
                last = if escapes(*block) { at.inside() } else { at };
                blocks[block.index()] = last;
            }
            NodeKind::ReturnFrom(block, _) => {
                let home = blocks[block.index()];
                if home.lambda != at.lambda || home.cleanups != at.cleanups {
                    survey.escaping[block.index()] = true;
                } else if home.extents == at.extents {
                    last.tail = home.tail;
                }
            }
            NodeKind::UnwindProtect(..) => {
                rest = Visit { cleanups: at.cleanups + 1, ..at.inside() };
                last = rest;
            }
            NodeKind::Catch(..)
            | NodeKind::Progv(..)
            | NodeKind::Handlers(..)
            | NodeKind::Mask(..)
            | NodeKind::Recovery { .. } => {
                last = at.inside();
            }
            NodeKind::FailureCleanup(body, cleanup) => {
                pending.push((*body, at.inside()));
                pending.push((*cleanup, Visit { cleanups: at.cleanups + 1, ..at.inside() }));
                return;
            }
            NodeKind::Tagbody(..) => {
                // Its tags may need a control entry while the forms run.
                last = at.inside();
                rest = at.inside();
            }
            NodeKind::HandlerCase(body, clauses) => {
                pending.push((*body, at.inside()));
                pending.extend(clauses.iter().map(|clause| (clause.body, at)));
                return;
            }
            NodeKind::Call(Callee::Value(function), arguments) => {
                if let NodeKind::Lambda(lambda) = core.nodes[function.index()].kind
                    && core.lambdas[lambda.index()].takes_exactly(arguments.len())
                {
                    survey.hosts[lambda.index()] = Some((at.lambda, at.tail));
                    enter_lambda(core, lambda, pending);
                    pending.extend(arguments.iter().map(|&argument| (argument, rest)));
                    return;
                }
            }
            NodeKind::Call(Callee::Local(name), arguments) => {
                let fits = survey
                    .functions
                    .get(name)
                    .is_some_and(|lambda| core.lambdas[lambda.index()].takes_exactly(arguments.len()));
                survey.sites[name.index()].push(CallSite { lambda: at.lambda, tail: at.tail, fits });
            }
            NodeKind::Apply(Callee::Local(name), _) => survey.values[name.index()] = true,
            _ => {}
        }
        let from = pending.len();
        children(kind, &mut |child| pending.push((child, rest)));
        if pending.len() > from
            && let Some(end) = pending.last_mut()
        {
            end.1 = last;
        }
    }
}

fn is_special(target: &BoundVariable) -> bool {
    matches!(target, BoundVariable::Special(_))
}

fn enter_lambda(core: &Core, lambda: LambdaId, pending: &mut Vec<(NodeId, Visit)>) {
    let text = &core.lambdas[lambda.index()];
    let parameters = text.required.iter().chain(&text.rest);
    let optional = text.optional.iter().chain(text.keys.iter().flatten().map(|key| &key.optional));
    let mut parameters =
        parameters.copied().chain(optional.flat_map(|o| [o.parameter].into_iter().chain(o.supplied)));
    let has_special = parameters.any(|parameter| parameter.is_special);
    let extents = u32::from(has_special);
    let visit = Visit { lambda, tail: false, extents, cleanups: 0 };
    lambda_nodes(text, &mut |node| pending.push((node, visit)));
    if let Some((_, body)) = pending.last_mut() {
        body.tail = !has_special;
    }
}
