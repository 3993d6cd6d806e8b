//! The fixed point of effects: the failures that may leave each piece of code, each task and each clause.

use std::collections::BTreeSet;

use esl_bytecode::symbol::Symbol;
use esl_compiler::core::NodeId;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::effect::{FailureKind, NodeEffect, mistake};
use crate::flow::{RunningCode, ValueFlow};
use crate::forms::ScopeKind;
use crate::guard::{FailureFacts, FailureId, Handled, LeavingFailures, recover, take};
use crate::pending::PendingCode;
use crate::resuming::resuming_clauses;
use crate::value::{Code, Numbering, Spot, WorkId, WorkKey};

/// A failure of the program: its kind, and the form and node where it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Failing {
    pub(crate) kind: FailureKind,
    pub(crate) form: u32,
    pub(crate) node: NodeId,
}

/// The result of the analysis of effects.
#[derive(Debug, Default)]
pub(crate) struct Solution {
    /// All failures.
    pub(crate) failures: Numbering<Failing>,
    pub(crate) kinds: Vec<FailureKind>,
    /// Failures that leave each piece of code.
    pub(crate) leaving: Vec<LeavingFailures>,
    /// Failures that leave each clause of a lambda that runs clauses.
    pub(crate) of_clauses: FxHashMap<(usize, usize), LeavingFailures>,
    /// Failures that leave calls at places with too many functions.
    of_many: LeavingFailures,
    /// Failures that end each task.
    pub(crate) of_works: Vec<LeavingFailures>,
    /// Code that waits to be looked at.
    pending: PendingCode,
    /// Failures of which more interrupted code is known since the round began.
    further_interrupted: FxHashSet<FailureId>,
    /// Failures that interrupt code, with the failures of that code and of the clauses that run in it.
    interrupted: FxHashMap<FailureId, LeavingFailures>,
    /// Causes of the clauses in `resuming`.
    resuming_causes: Vec<Symbol>,
    /// Failures that handling forms catch.
    caught: FxHashMap<Spot, LeavingFailures>,
    /// Results of handling forms, by the piece of code and the scope.
    pub(crate) handled: FxHashMap<(usize, usize), Handled>,
    /// Clauses whose ends control can reach, by form, node of the recovery form, and position.
    pub(crate) resuming: FxHashSet<(u32, NodeId, usize)>,
}

/// Finds the failures of all code that the flow has found.
pub(crate) fn solve(flow: &ValueFlow<'_>) -> Solution {
    let mut solution = Solution {
        leaving: vec![LeavingFailures::default(); flow.running.len()],
        of_works: vec![LeavingFailures::default(); flow.works.len()],
        resuming: resuming_clauses(flow.forms),
        pending: PendingCode::new(flow),
        ..Solution::default()
    };
    solution.resuming_causes = causes_of(flow, &solution.resuming);
    let bodies = bodies_of_works(flow);
    loop {
        while let Some(number) = solution.pending.next_code() {
            solution.look_at(flow, number);
        }
        while let Some(work) = solution.pending.next_work() {
            solution.end_work(flow, work, &bodies[work.index()]);
        }
        solution.look_at_interrupted_again(flow);
        if !solution.pending.begin_round() {
            break;
        }
    }
    solution
}

/// Returns the causes of clauses.
fn causes_of(flow: &ValueFlow<'_>, wanted: &FxHashSet<(u32, NodeId, usize)>) -> Vec<Symbol> {
    let mut causes: FxHashSet<&Symbol> = FxHashSet::default();
    for (number, form) in flow.forms.forms.iter().enumerate() {
        for scope in &form.scopes {
            let ScopeKind::Recovery { node, clauses, .. } = &scope.kind else { continue };
            let named = clauses.iter().enumerate();
            let named = named.filter(|(position, _)| wanted.contains(&(number as u32, *node, *position)));
            causes.extend(named.map(|(_, clause)| &clause.cause));
        }
    }
    causes.into_iter().cloned().collect()
}

/// Returns the code that each task or operation runs.
pub(crate) fn bodies_of_works(flow: &ValueFlow<'_>) -> Vec<Vec<Code>> {
    let mut bodies = vec![Vec::new(); flow.works.len()];
    for running in &flow.running {
        for (_, effect) in &running.effects {
            if let NodeEffect::Body(work, code) = effect {
                let row: &mut Vec<Code> = &mut bodies[work.index()];
                if !row.contains(code) {
                    row.push(*code);
                }
            }
        }
    }
    bodies
}

impl Solution {
    fn failure(&mut self, kind: FailureKind, form: u32, node: NodeId) -> FailureId {
        let (number, is_new) = self.failures.number(&Failing { kind, form, node });
        if is_new {
            self.kinds.push(kind);
        }
        number
    }

    /// Returns failures with the causes of others: they are no longer of the types of their conditions.
    fn by_cause(&mut self, others: &LeavingFailures) -> LeavingFailures {
        let mut leaving = LeavingFailures::default();
        for id in &others.failures {
            let failing = self.failures.keys[*id as usize];
            let id = match failing.kind {
                FailureKind::Condition(name) => {
                    self.failure(FailureKind::CauseOf(name), failing.form, failing.node)
                }
                _ => *id,
            };
            leaving.failures.insert(id);
        }
        let plain = mistake::CRITICAL | mistake::CONSEQUENCE | mistake::CAUSE;
        leaving.mistakes = others.mistakes & plain;
        if others.mistakes & !plain != 0 {
            leaving.mistakes |= mistake::CAUSE;
        }
        leaving
    }

    /// Finds the failures that end a task.
    fn end_work(&mut self, flow: &ValueFlow<'_>, work: WorkId, codes: &[Code]) {
        let mut all = LeavingFailures::default();
        for code in codes {
            if let Some(number) = flow.number_of(*code) {
                all.add(&self.leaving[number]);
            }
        }
        if self.of_works[work.index()].add(&all) {
            self.pending.change_work(work);
        }
    }

    /// Has the handling forms looked at again that see failures of which more interrupted code is known.
    fn look_at_interrupted_again(&mut self, flow: &ValueFlow<'_>) {
        let changed = std::mem::take(&mut self.further_interrupted);
        if changed.is_empty() {
            return;
        }
        let sees = |leaving: &LeavingFailures| {
            leaving.failures.iter().chain(&leaving.stopped).any(|failure| changed.contains(failure))
        };
        for ((number, scope), handled) in &self.handled {
            let code = flow.running[*number].code;
            let form = &flow.forms.forms[code.form as usize];
            let is_in_clause = match &form.scopes[*scope].kind {
                ScopeKind::Recovery { clauses, procedures, .. } => {
                    let runner = flow.number_of(Code { lambda: *procedures, ..code });
                    let mut effects =
                        (0..clauses.len()).filter_map(|one| self.of_clauses.get(&(runner?, one)));
                    effects.any(sees)
                }
                _ => false,
            };
            if is_in_clause || sees(&handled.arriving) {
                self.pending.add(*number);
            }
        }
    }

    /// Notes that a failure interrupts code that can fail so.
    fn interrupt(&mut self, failure: FailureId, inside: &LeavingFailures) {
        let is_new = !self.interrupted.contains_key(&failure);
        if self.interrupted.entry(failure).or_default().add(inside) || is_new {
            self.further_interrupted.insert(failure);
        }
    }

    /// Finds the failures that leave a piece of code.
    fn look_at(&mut self, flow: &ValueFlow<'_>, number: usize) {
        let running = &flow.running[number];
        let code = running.code;
        let form = &flow.forms.forms[code.form as usize];
        self.note_interruptions(flow, number);
        let mut result = LeavingFailures::default();
        let mut scopes: FxHashMap<usize, LeavingFailures> = FxHashMap::default();
        for (node, effect) in &running.effects {
            let mut leaving = self.effect(flow, code, *node, *effect);
            if form.in_cleanup[node.index()] {
                leaving.delay();
            }
            match form.scope_of[node.index()] {
                Some(scope) => _ = scopes.entry(scope).or_default().add(&leaving),
                None => _ = result.add(&leaving),
            }
        }
        let mut has_changed = false;
        // Those around others come first.
        for scope in form.scopes_of[code.lambda.index()].iter().rev().copied() {
            if !scopes.contains_key(&scope) && form.scopes[scope].kind.node().is_none() {
                continue;
            }
            let inside = scopes.remove(&scope).unwrap_or_default();
            let mut out = match &form.scopes[scope].kind {
                ScopeKind::ClauseBody(position) => {
                    let known = self.of_clauses.entry((number, *position)).or_default();
                    has_changed |= known.add(&inside);
                    continue;
                }
                kind => self.handle(flow, code, number, scope, kind, &inside),
            };
            if form.scopes[scope].kind.node().is_some_and(|node| form.in_cleanup[node.index()]) {
                out.delay();
            }
            match form.scopes[scope].parent {
                Some(parent) => _ = scopes.entry(parent).or_default().add(&out),
                None => _ = result.add(&out),
            }
        }
        if self.leaving[number].add(&result) || has_changed {
            self.pending.change_code(number);
        }
        if self.pending.is_of_many(number) && self.of_many.add(&self.leaving[number]) {
            self.pending.change_many();
        }
    }

    /// Notes which failures interrupt the code that a piece of code calls, and how that can fail.
    fn note_interruptions(&mut self, flow: &ValueFlow<'_>, number: usize) {
        let RunningCode { code, effects } = &flow.running[number];
        let mut calls: FxHashMap<NodeId, Vec<Code>> = FxHashMap::default();
        for (node, effect) in effects {
            if matches!(effect, NodeEffect::Interrupts(_) | NodeEffect::InterruptsBy(_)) {
                calls.entry(*node).or_default();
            }
        }
        if calls.is_empty() {
            return;
        }
        for (node, effect) in effects {
            if let (NodeEffect::Call(_) | NodeEffect::CallMany, Some(row)) = (effect, calls.get_mut(node)) {
                row.extend(flow.called_by(effect));
            }
        }
        for (node, effect) in effects {
            let (failures, alarm) = match effect {
                NodeEffect::Interrupts(cause) => {
                    let failure = self.failure(FailureKind::Cause(*cause), code.form, *node);
                    (BTreeSet::from([failure]), None)
                }
                NodeEffect::InterruptsBy(alarm) => {
                    let leaving = flow.number_of(*alarm).map(|number| self.leaving[number].failures.clone());
                    (leaving.unwrap_or_default(), Some(alarm))
                }
                _ => continue,
            };
            let mut inside = LeavingFailures::default();
            let others = calls.get(node).into_iter().flatten().filter(|called| Some(*called) != alarm);
            for called in others.filter_map(|called| flow.number_of(*called)) {
                inside.failures.extend(&self.leaving[called].failures);
            }
            for failure in failures {
                self.interrupt(failure, &inside);
            }
        }
    }

    /// Returns the failures that leave a handling form.
    fn handle(
        &mut self,
        flow: &ValueFlow<'_>,
        code: Code,
        number: usize,
        scope: usize,
        kind: &ScopeKind,
        inside: &LeavingFailures,
    ) -> LeavingFailures {
        let known = FailureFacts {
            forms: flow.forms,
            names: &flow.names,
            kinds: &self.kinds,
            interrupted: &self.interrupted,
            resuming: &self.resuming_causes,
        };
        let spot = |node: NodeId| Spot { form: code.form, node, context: code.context };
        let (handled, guard) = match kind {
            ScopeKind::Recovery { node, clauses, procedures } => {
                let runner = flow.number_of(Code { lambda: *procedures, ..code });
                let of = |position| runner.and_then(|number| self.of_clauses.get(&(number, position)));
                let effects: Vec<LeavingFailures> =
                    (0..clauses.len()).map(|one| of(one).cloned().unwrap_or_default()).collect();
                let resumes: Vec<bool> =
                    (0..clauses.len()).map(|one| self.resuming.contains(&(code.form, *node, one))).collect();
                let handled = recover(&known, inside, clauses, &effects, &resumes);
                // The effects of a clause are those of the code that has called it.
                for (failure, clauses) in &handled.interrupted {
                    for clause in clauses {
                        let failures = effects[*clause].failures.clone();
                        self.interrupt(*failure, &LeavingFailures { failures, ..LeavingFailures::default() });
                    }
                }
                (handled, None)
            }
            ScopeKind::Cases { node, types } => (take(&known, inside, types), Some(spot(*node))),
            ScopeKind::Handlers { node, types } => {
                let handled = take(&known, inside, types);
                // All handlers see the signalled condition.
                let mut all = LeavingFailures::default();
                all.add(inside);
                if self.caught.entry(spot(*node)).or_default().add(&all) {
                    self.pending.change_caught(spot(*node));
                }
                (handled, None)
            }
            ScopeKind::ClauseBody(_) => return inside.clone(),
        };
        if let Some(guard) = guard {
            let all = LeavingFailures {
                failures: handled.taken.iter().flatten().map(|(failure, _)| *failure).collect(),
                mistakes: handled.mistakes.iter().fold(0, |all, one| all | one),
                ..LeavingFailures::default()
            };
            if self.caught.entry(guard).or_default().add(&all) {
                self.pending.change_caught(guard);
            }
        }
        let leaving = handled.leaving.clone();
        self.handled.insert((number, scope), handled);
        leaving
    }

    /// Returns the failures that an effect of a node brings there.
    fn effect(
        &mut self,
        flow: &ValueFlow<'_>,
        code: Code,
        node: NodeId,
        effect: NodeEffect,
    ) -> LeavingFailures {
        let mut leaving = LeavingFailures::default();
        match effect {
            NodeEffect::Call(called) => {
                if let Some(number) = flow.number_of(called) {
                    return self.leaving[number].clone();
                }
            }
            NodeEffect::CallMany => return self.of_many.clone(),
            NodeEffect::Absorb(_) | NodeEffect::Start(_) | NodeEffect::Body(..) | NodeEffect::FailAll(_) => {}
            NodeEffect::Limit(work, cause) => {
                let failure = self.failure(FailureKind::Cause(cause), code.form, node);
                if self.of_works[work.index()].failures.insert(failure) {
                    self.pending.change_work(work);
                }
            }
            NodeEffect::Fail(kind) => {
                let failure = self.failure(kind, code.form, node);
                leaving.failures.insert(failure);
            }
            NodeEffect::FailAs(work) => {
                // It is a failure of this place.
                let of_work = &self.of_works[work.index()];
                leaving.failures.clone_from(&of_work.failures);
                leaving.mistakes = of_work.mistakes;
                if let WorkKey::Host(name) = flow.works[work.index()].key {
                    for kind in kinds_of_host(flow, name) {
                        let failure = self.failure(kind, code.form, node);
                        leaving.failures.insert(failure);
                    }
                }
            }
            NodeEffect::FailAllWith(cause) => {
                let number = flow.number_of(code).unwrap_or_default();
                let all = flow.running[number].effects.iter().filter(|(other, _)| *other == node);
                let tasks: Vec<WorkId> = all
                    .filter_map(|(_, effect)| match effect {
                        NodeEffect::FailAll(work) => Some(*work),
                        _ => None,
                    })
                    .collect();
                let fails = |work: &WorkId| !self.of_works[work.index()].failures.is_empty();
                // Tasks of other forms may be among them where values are not told apart.
                let is_mixed = flow.objects.are_mixed || !flow.many.places.is_empty();
                // Those that one place begins are the tasks of a form; others may have come along by data.
                let mut forms: FxHashMap<Option<Spot>, bool> = FxHashMap::default();
                for task in &tasks {
                    let place = match flow.works[task.index()].key {
                        WorkKey::Begun(spot, _) => Some(spot),
                        _ => None,
                    };
                    *forms.entry(place).or_insert(true) &= fails(task);
                }
                let may_all_fail = tasks.is_empty()
                    || forms.values().any(|fail| *fail)
                    || (is_mixed && tasks.iter().any(fails));
                if flow.forms.aborts || may_all_fail {
                    let failure = self.failure(FailureKind::Cause(cause), code.form, node);
                    leaving.failures.insert(failure);
                } else if is_mixed || tasks.iter().all(|work| !self.of_works[work.index()].is_empty()) {
                    leaving.mistakes = mistake::CONSEQUENCE;
                }
            }
            NodeEffect::AgainByCause(guard) => {
                let caught = self.caught.get(&guard).cloned().unwrap_or_default();
                return self.by_cause(&caught);
            }
            NodeEffect::FailByCauseOf(work) => {
                let ends = self.of_works[work.index()].clone();
                return self.by_cause(&ends);
            }
            NodeEffect::Again(guard) => return self.caught.get(&guard).cloned().unwrap_or_default(),
            NodeEffect::Interrupts(_) | NodeEffect::InterruptsBy(_) => {}
            NodeEffect::Jump => leaving.jumps = true,
            NodeEffect::Wait => leaving.waits = true,
            NodeEffect::Mistake(kinds) => leaving.mistakes = kinds,
        }
        leaving
    }
}

/// Returns the kinds of failure of an operation of the host.
fn kinds_of_host(flow: &ValueFlow<'_>, name: crate::value::NameId) -> Vec<FailureKind> {
    let declared = flow.forms.declared.get(flow.symbol(name));
    let known = |symbol: &Symbol| flow.names.keys.iter().position(|known| known == symbol);
    match declared {
        Some(declared) => {
            let names = declared.causes.iter().filter_map(known);
            names.map(|index| FailureKind::Below(crate::value::NameId(index as u32))).collect()
        }
        None => vec![FailureKind::Unknown(name)],
    }
}
