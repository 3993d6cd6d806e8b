//! The code and the tasks that the fixed point of effects looks at next.
//!
//! A round looks at code from the last found to the first, so that mostly functions come before their
//! callers, then at tasks. Code is looked at again only if the failures of code, tasks or forms that it
//! depends on have changed.

use std::collections::BTreeSet;

use rustc_hash::FxHashMap;

use crate::effect::NodeEffect;
use crate::flow::ValueFlow;
use crate::forms::ScopeKind;
use crate::solve::bodies_of_works;
use crate::value::{Code, Spot, WorkId};

/// Code and tasks that wait to be looked at, and the code that depends on others.
#[derive(Debug, Default)]
pub(crate) struct PendingCode {
    /// Code of this round, and of the next one.
    now: BTreeSet<usize>,
    next: BTreeSet<usize>,
    /// Tasks of this round.
    works: BTreeSet<usize>,
    /// Code that is looked at.
    current: Option<usize>,
    /// Code that calls each piece of code.
    callers: Vec<Vec<usize>>,
    /// Whether each piece of code is called at the places with too many functions.
    of_many: Vec<bool>,
    /// Code with such places.
    calls_many: Vec<usize>,
    /// Tasks that each piece of code is a body of.
    works_of: Vec<Vec<usize>>,
    /// Code that fails as each task does.
    waiting: Vec<Vec<usize>>,
    /// Code that fails again with a failure that a form has caught.
    again: FxHashMap<Spot, Vec<usize>>,
    /// Code with the recovery forms whose clauses a piece of code runs.
    around: FxHashMap<usize, usize>,
}

impl PendingCode {
    /// Has all code and all tasks of a program wait.
    pub(crate) fn new(flow: &ValueFlow<'_>) -> PendingCode {
        let count = flow.running.len();
        let mut pending = PendingCode {
            now: (0..count).collect(),
            callers: vec![Vec::new(); count],
            of_many: vec![false; count],
            works_of: vec![Vec::new(); count],
            waiting: vec![Vec::new(); flow.works.len()],
            ..PendingCode::default()
        };
        for number in flow.many.codes.iter().filter_map(|code| flow.number_of(*code)) {
            pending.of_many[number] = true;
        }
        for (number, running) in flow.running.iter().enumerate() {
            for (_, effect) in &running.effects {
                pending.note(flow, number, *effect);
            }
            let code = running.code;
            let form = &flow.forms.forms[code.form as usize];
            for scope in &form.scopes_of[code.lambda.index()] {
                if let ScopeKind::Recovery { procedures, .. } = &form.scopes[*scope].kind
                    && let Some(runner) = flow.number_of(Code { lambda: *procedures, ..code })
                {
                    pending.around.insert(runner, number);
                }
            }
        }
        for (work, codes) in bodies_of_works(flow).into_iter().enumerate() {
            pending.works.insert(work);
            for number in codes.into_iter().filter_map(|code| flow.number_of(code)) {
                pending.works_of[number].push(work);
            }
        }
        pending
    }

    /// Notes on which others a piece of code depends by an effect.
    fn note(&mut self, flow: &ValueFlow<'_>, number: usize, effect: NodeEffect) {
        match effect {
            NodeEffect::Call(code) | NodeEffect::InterruptsBy(code) => {
                if let Some(called) = flow.number_of(code) {
                    self.callers[called].push(number);
                }
            }
            NodeEffect::CallMany => self.calls_many.push(number),
            NodeEffect::FailAs(work) | NodeEffect::FailAll(work) | NodeEffect::FailByCauseOf(work) => {
                self.waiting[work.index()].push(number);
            }
            NodeEffect::Again(guard) | NodeEffect::AgainByCause(guard) => {
                self.again.entry(guard).or_default().push(number);
            }
            NodeEffect::Absorb(_)
            | NodeEffect::Start(_)
            | NodeEffect::Body(..)
            | NodeEffect::Fail(_)
            | NodeEffect::FailAllWith(_)
            | NodeEffect::Limit(..)
            | NodeEffect::Interrupts(_)
            | NodeEffect::Jump
            | NodeEffect::Wait
            | NodeEffect::Mistake(_) => {}
        }
    }

    /// Returns the next piece of code of this round.
    pub(crate) fn next_code(&mut self) -> Option<usize> {
        self.current = self.now.pop_last();
        self.current
    }

    /// Returns the next task of this round, once there is no more code.
    pub(crate) fn next_work(&mut self) -> Option<WorkId> {
        self.works.pop_first().map(|work| WorkId(work as u32))
    }

    /// Begins the next round. Returns false if nothing waits.
    pub(crate) fn begin_round(&mut self) -> bool {
        std::mem::swap(&mut self.now, &mut self.next);
        !self.now.is_empty() || !self.works.is_empty()
    }

    /// Has a piece of code looked at: in this round, if its turn comes yet.
    pub(crate) fn add(&mut self, number: usize) {
        match self.current {
            Some(current) if number < current => self.now.insert(number),
            _ => self.next.insert(number),
        };
    }

    /// Notes that the failures that leave a piece of code, or one of the clauses in it, have changed.
    pub(crate) fn change_code(&mut self, number: usize) {
        for index in 0..self.callers[number].len() {
            self.add(self.callers[number][index]);
        }
        self.works.extend(&self.works_of[number]);
        if let Some(around) = self.around.get(&number) {
            self.add(*around);
        }
    }

    /// Whether a piece of code is called at the places with too many functions.
    pub(crate) fn is_of_many(&self, number: usize) -> bool {
        self.of_many[number]
    }

    /// Notes that the failures of calls at places with too many functions have changed.
    pub(crate) fn change_many(&mut self) {
        for index in 0..self.calls_many.len() {
            self.add(self.calls_many[index]);
        }
    }

    /// Notes that the failures of a task have changed.
    pub(crate) fn change_work(&mut self, work: WorkId) {
        for index in 0..self.waiting[work.index()].len() {
            self.add(self.waiting[work.index()][index]);
        }
    }

    /// Notes that a form has caught more failures.
    pub(crate) fn change_caught(&mut self, guard: Spot) {
        for number in self.again.get(&guard).cloned().unwrap_or_default() {
            self.add(number);
        }
    }
}
