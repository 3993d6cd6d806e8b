//! Literals in loops: loaded once, in front of the loop, into registers of their own.
//!
//! Only literals that an instruction takes from a register profit. Literals that become part of an
//! instruction stay where they are, and so do arguments of calls, which need a register of the window anyway.
//! The outermost loop of a frame loads the literals of all loops inside it.

use esl_bytecode::module::PoolIdx;
use esl_bytecode::operand::Reg;
use rustc_hash::{FxHashMap, FxHashSet};

use super::builder::FunctionBuilder;
use super::dest::Dest;
use super::operator::takes_literals;
use crate::core::*;
use crate::resolve::{FunctionKind, children, lambda_nodes};

/// Literals that a loop keeps in registers at most.
const MAX_LITERALS: usize = 16;
/// First free register above which a frame keeps no literals.
const MAX_TOP: Reg = Reg(150);

/// Findings of a walk through a loop.
struct LiteralSurvey {
    /// Literals, in the order of their first use.
    literals: Vec<NodeId>,
    entries: FxHashSet<PoolIdx>,
    /// Whether there is a jump back.
    turns: bool,
}

impl FunctionBuilder<'_, '_> {
    /// Loads the literals of a tagbody, if it is a loop. Returns whether it is, so that the caller forgets
    /// them later.
    pub(super) fn load_tagbody_literals(&mut self, tagbody: TagbodyId, items: &[TagbodyItem]) -> bool {
        if !self.may_load_literals() {
            return false;
        }
        let mut survey = LiteralSurvey { literals: Vec::new(), entries: FxHashSet::default(), turns: false };
        let mut tags = 0;
        for item in items {
            match item {
                TagbodyItem::Tag => tags += 1,
                TagbodyItem::Form(form) => self.survey(&mut survey, *form, Some((tagbody, tags))),
            }
        }
        self.load_literals(survey)
    }

    /// Loads the literals of the body of an inlined loop.
    pub(super) fn load_body_literals(&mut self, body: NodeId) -> bool {
        if !self.may_load_literals() {
            return false;
        }
        let mut survey = LiteralSurvey { literals: Vec::new(), entries: FxHashSet::default(), turns: true };
        self.survey(&mut survey, body, None);
        self.load_literals(survey)
    }

    fn may_load_literals(&self) -> bool {
        self.literals.is_none() && self.registers.top() <= MAX_TOP
    }

    /// Walks through a form of this frame. `back` is a tagbody and the number of its tags in front of the
    /// form.
    fn survey(&mut self, survey: &mut LiteralSurvey, form: NodeId, back: Option<(TagbodyId, u32)>) {
        let core = self.core;
        let mut entered: FxHashSet<LambdaId> = FxHashSet::default();
        let mut pending = vec![form];
        while let Some(node) = pending.pop() {
            let kind = &core.nodes[node.index()].kind;
            match kind {
                NodeKind::Go(tagbody, tag)
                    if back.is_some_and(|(this, tags)| *tagbody == this && *tag < tags) =>
                {
                    survey.turns = true;
                }
                NodeKind::Call(Callee::Builtin(builtin), arguments) => {
                    let literals = arguments.iter().enumerate().filter(|(index, argument)| {
                        matches!(core.nodes[argument.index()].kind, NodeKind::Constant(_))
                            && takes_literals(core, *builtin, arguments, *index)
                    });
                    for (_, &literal) in literals {
                        self.note_literal(survey, literal);
                    }
                }
                NodeKind::Call(Callee::Local(function), _) => {
                    let resolution = &self.module.resolution;
                    let lambda = resolution.function(*function);
                    let inline =
                        lambda.filter(|lambda| resolution.function_kind(*lambda) == FunctionKind::Inline);
                    if let Some(lambda) = inline.filter(|lambda| entered.insert(*lambda)) {
                        lambda_nodes(&core.lambdas[lambda.index()], &mut |node| pending.push(node));
                    }
                }
                _ => {}
            }
            let from = pending.len();
            children(kind, &mut |child| pending.push(child));
            pending[from..].reverse();
        }
    }

    fn note_literal(&mut self, survey: &mut LiteralSurvey, literal: NodeId) {
        if survey.literals.len() < MAX_LITERALS
            && let Some(datum) = self.literal(literal).cloned()
            && survey.entries.insert(self.module.pool.datum(&datum))
        {
            survey.literals.push(literal);
        }
    }

    fn load_literals(&mut self, survey: LiteralSurvey) -> bool {
        if !survey.turns {
            return false;
        }
        let mut loaded = FxHashMap::default();
        for literal in survey.literals {
            let Some(datum) = self.literal(literal).cloned() else { continue };
            let entry = self.module.pool.datum(&datum);
            let register = self.registers.top();
            self.constant(&datum, Dest::Fresh(register));
            loaded.insert(entry, self.registers.take(1));
        }
        self.literals = Some(loaded);
        true
    }

    /// Returns the register in which a loop keeps the literal `node`.
    pub(super) fn loaded_literal(&mut self, node: NodeId) -> Option<Reg> {
        self.literals.as_ref()?;
        let datum = self.literal(node).cloned()?;
        let entry = self.module.pool.datum(&datum);
        self.literals.as_ref()?.get(&entry).copied()
    }
}
