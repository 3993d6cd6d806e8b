//! Tasks that never run at the same time: those of different tests, and those of forms that one task
//! evaluates one after another, since a form with tasks of its own ends them before it ends itself.
//!
//! Not known: tasks for whose end another waits by an event or by `wait-for-task`, and the order of the
//! bodies of one form.

use std::collections::BTreeSet;

use esl_compiler::core::{LambdaId, NodeKind};
use rustc_hash::FxHashSet;

use crate::effect::NodeEffect;
use crate::flow::ValueFlow;
use crate::orders::Taker;
use crate::table::top_level;
use crate::value::{Code, TaskKind, WorkId, WorkKey};

/// Most tasks around a task that are looked at.
const DEEPEST: usize = 50;

/// The tasks that begin each task.
pub(crate) struct TaskMeetings<'w, 'a> {
    flow: &'w ValueFlow<'a>,
    parents: Vec<BTreeSet<Taker>>,
}

impl<'w, 'a> TaskMeetings<'w, 'a> {
    pub(crate) fn new(flow: &'w ValueFlow<'a>, bodies: &[Vec<Code>]) -> TaskMeetings<'w, 'a> {
        let mut parents = vec![BTreeSet::new(); flow.works.len()];
        let works = (0..bodies.len()).map(|index| Some(WorkId(index as u32)));
        for taker in [None].into_iter().chain(works) {
            let mut pending = match taker {
                Some(work) => bodies[work.index()].clone(),
                None => top_level(flow.forms),
            };
            let mut seen: FxHashSet<Code> = pending.iter().copied().collect();
            while let Some(code) = pending.pop() {
                let Some(number) = flow.number_of(code) else { continue };
                let mut next = clauses_in(flow, code);
                for (_, effect) in &flow.running[number].effects {
                    match effect {
                        NodeEffect::Call(_) | NodeEffect::CallMany | NodeEffect::Absorb(_) => {
                            next.extend_from_slice(flow.called_by(effect));
                        }
                        NodeEffect::Start(work) => _ = parents[work.index()].insert(taker),
                        _ => {}
                    }
                }
                pending.extend(next.into_iter().filter(|code| seen.insert(*code)));
            }
        }
        TaskMeetings { flow, parents }
    }

    /// Whether two tasks never run at the same time.
    pub(crate) fn are_apart(&self, one: Taker, other: Taker) -> bool {
        let (first, second) = (self.tests_around(one), self.tests_around(other));
        let is_of_tests =
            |tests: &Option<BTreeSet<WorkId>>| tests.as_ref().is_some_and(|tests| !tests.is_empty());
        let are_in_others =
            first.as_ref().zip(second.as_ref()).is_some_and(|(first, second)| first.is_disjoint(second));
        is_of_tests(&first) && is_of_tests(&second) && are_in_others || self.are_successive(one, other)
    }

    /// Returns the tests that begin a task, directly or not; `None` if something else does, too.
    fn tests_around(&self, taker: Taker) -> Option<BTreeSet<WorkId>> {
        let mut tests = BTreeSet::new();
        let mut seen = FxHashSet::default();
        let mut pending = vec![taker?];
        while let Some(work) = pending.pop() {
            if !seen.insert(work) {
                continue;
            }
            if self.flow.works[work.index()].kind == TaskKind::Test {
                tests.insert(work);
                continue;
            }
            let parents = &self.parents[work.index()];
            if parents.is_empty() || parents.contains(&None) {
                return None;
            }
            pending.extend(parents.iter().flatten());
        }
        Some(tests)
    }

    /// Whether two tasks are parts of forms that one task evaluates one after another, or one of them is that
    /// task.
    fn are_successive(&self, one: Taker, other: Taker) -> bool {
        let (first, second) = (self.row_outward(one), self.row_outward(other));
        // The innermost task that is around both, and the parts in it.
        let common = first.iter().enumerate().find_map(|(place, taker)| {
            Some((place, second.iter().position(|known| known == taker)?, *taker))
        });
        let Some((place, second_place, around)) = common else { return false };
        let site = |row: &[Taker], place: usize| match self.flow.works[row[place - 1]?.index()].key {
            WorkKey::Begun(spot, _) => Some((spot.form, spot.node)),
            _ => None,
        };
        let is_around_one = place == 0 || second_place == 0;
        let are_successive = is_around_one
            || site(&first, place) != site(&second, second_place) && site(&first, place).is_some();
        one != other && are_successive && self.is_once(around, DEEPEST)
    }

    /// Returns a task and those around it, as far as each is a part of a form of the next one.
    fn row_outward(&self, taker: Taker) -> Vec<Taker> {
        let mut row = vec![taker];
        let mut inner = taker;
        while let Some(work) = inner
            && self.flow.works[work.index()].kind == TaskKind::Part
            && let Some(parent) = self.only_parent(work)
            && row.len() < DEEPEST
        {
            row.push(parent);
            inner = parent;
        }
        row
    }

    fn only_parent(&self, work: WorkId) -> Option<Taker> {
        let parents = &self.parents[work.index()];
        parents.first().copied().filter(|_| parents.len() == 1)
    }

    /// Whether there is never more than one task of a place.
    fn is_once(&self, taker: Taker, depth: usize) -> bool {
        let Some(work) = taker else { return true };
        let parent =
            || self.only_parent(work).is_some_and(|parent| depth > 0 && self.is_once(parent, depth - 1));
        match self.flow.works[work.index()].kind {
            TaskKind::Main | TaskKind::Test => true,
            TaskKind::Part => parent(),
            TaskKind::Spawned => !is_begun_often(self.flow, work) && parent(),
            _ => false,
        }
    }
}

/// Returns the code of the recovery procedures in a piece of code.
fn clauses_in(flow: &ValueFlow<'_>, code: Code) -> Vec<Code> {
    let form = &flow.forms.forms[code.form as usize];
    let procedures = form.nodes_of[code.lambda.index()].iter().filter_map(|node| match form.kind(*node) {
        NodeKind::Recovery { procedures, .. } => match form.kind(*procedures) {
            NodeKind::Lambda(lambda) => Some(Code { lambda: *lambda, ..code }),
            _ => None,
        },
        _ => None,
    });
    procedures.collect()
}

/// Whether the place that begins a task may be evaluated more than once.
pub(crate) fn is_begun_often(flow: &ValueFlow<'_>, work: WorkId) -> bool {
    let WorkKey::Begun(spot, _) = flow.works[work.index()].key else { return true };
    let form = &flow.forms.forms[spot.form as usize];
    let own = form.core.nodes[spot.node.index()].span;
    let is_in_loop = form
        .core
        .nodes
        .iter()
        .any(|node| matches!(node.kind, NodeKind::Tagbody(..)) && node.span.contains(own));
    form.owners[spot.node.index()] != LambdaId(0) || is_in_loop
}
