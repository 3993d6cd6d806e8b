//! Handling forms: which failures of a body end in which clause, and which leave the form.

use std::collections::BTreeSet;

use esl_bytecode::datum::Datum;

use crate::cause::{Applies, clause_applies, is_of_type, mistakes_named, mistakes_of_type};
use crate::clause::{Clause, ClauseLimit};
use crate::effect::FailureKind;
use crate::forms::CoreForms;
use crate::value::Numbering;
use esl_bytecode::symbol::Symbol;

/// A failure: its number among the failures of the program.
pub(crate) type FailureId = u32;

/// Failures and programming errors that may leave a piece of code.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct LeavingFailures {
    pub(crate) failures: BTreeSet<FailureId>,
    pub(crate) mistakes: u8,
    /// Those that may begin in a cleanup, while control leaves for a clause that has been called already.
    pub(crate) late: BTreeSet<FailureId>,
    pub(crate) late_mistakes: u8,
}

impl LeavingFailures {
    /// Has all of them be late, as those of a cleanup are.
    pub(crate) fn delay(&mut self) {
        self.late.clone_from(&self.failures);
        self.late_mistakes = self.mistakes;
    }

    /// Adds those of another. Returns whether that has added any.
    pub(crate) fn add(&mut self, other: &LeavingFailures) -> bool {
        let size =
            |one: &LeavingFailures| (one.failures.len(), one.mistakes, one.late.len(), one.late_mistakes);
        let before = size(self);
        self.failures.extend(&other.failures);
        self.mistakes |= other.mistakes;
        self.late.extend(&other.late);
        self.late_mistakes |= other.late_mistakes;
        before != size(self)
    }

    /// Whether it is empty.
    pub(crate) fn is_empty(&self) -> bool {
        self.failures.is_empty() && self.mistakes == 0
    }
}

/// Knowledge of a program's failures.
pub(crate) struct FailureFacts<'k> {
    pub(crate) forms: &'k CoreForms,
    pub(crate) names: &'k Numbering<Symbol>,
    /// Kinds of the failures, by their numbers.
    pub(crate) kinds: &'k [FailureKind],
}

/// Result of a handling form.
#[derive(Clone, Debug, Default)]
pub(crate) struct Handled {
    /// Failures that come from the body of the form.
    pub(crate) arriving: LeavingFailures,
    /// Failures that leave the form.
    pub(crate) leaving: LeavingFailures,
    /// Failures that each clause takes; for each, whether it may also go on outward.
    pub(crate) taken: Vec<BTreeSet<(FailureId, bool)>>,
    /// Programming errors that each clause takes.
    pub(crate) mistakes: Vec<u8>,
}

/// Returns the result of a recovery form. `effects` are those of the clauses, `resumes` says whether control
/// can reach their ends.
pub(crate) fn recover(
    known: &FailureFacts<'_>,
    body: &LeavingFailures,
    clauses: &[Clause],
    effects: &[LeavingFailures],
    resumes: &[bool],
) -> Handled {
    let count = clauses.len();
    let mut handled = Handled {
        arriving: body.clone(),
        leaving: LeavingFailures::default(),
        taken: vec![BTreeSet::new(); count],
        mistakes: vec![0; count],
    };
    let applies = |failure: FailureId, clause: usize| {
        clause_applies(known.forms, known.names, known.kinds[failure as usize], &clauses[clause].cause)
    };
    // A clause that runs inside another one may have spent its retries.
    let triggers = |from: usize, to: usize| {
        effects[from].failures.iter().any(|failure| applies(*failure, to) != Applies::No)
    };
    // A clause has the body begin again by itself, or by another clause that takes its failure.
    let mut begins_again: Vec<bool> = clauses.iter().map(|clause| clause.ways.retries).collect();
    loop {
        let found = (0..count).find(|from| {
            !begins_again[*from] && (0..count).any(|to| begins_again[to] && triggers(*from, to))
        });
        let Some(found) = found else { break };
        begins_again[found] = true;
    }
    let passes_on = |clause: usize, from: Option<usize>| {
        let comes_back = begins_again[clause] || resumes[clause];
        let may_be_spent = comes_back || from.is_some_and(|from| from == clause || triggers(clause, from));
        match clauses[clause].limit {
            ClauseLimit::None => false,
            // It may be 0.
            ClauseLimit::Computed => true,
            ClauseLimit::Times(_) => may_be_spent,
        }
    };
    let mut done = vec![false; count];
    let mut sources: Vec<(Option<usize>, &LeavingFailures)> = vec![(None, body)];
    while let Some((from, source)) = sources.pop() {
        for failure in &source.failures {
            let mut goes_on = true;
            for (clause, guarding) in clauses.iter().enumerate() {
                if !goes_on || guarding.limit == ClauseLimit::Times(0) {
                    continue;
                }
                let match_ = applies(*failure, clause);
                if match_ == Applies::No {
                    continue;
                }
                let is_late = guarding.limit != ClauseLimit::None && source.late.contains(failure);
                goes_on = match_ == Applies::Perhaps || passes_on(clause, from) || is_late;
                handled.taken[clause].insert((*failure, goes_on));
            }
            if goes_on {
                handled.leaving.failures.insert(*failure);
                if source.late.contains(failure) {
                    handled.leaving.late.insert(*failure);
                }
            }
        }
        let mut left = source.mistakes;
        for (clause, guarding) in clauses.iter().enumerate() {
            let (all, some) = mistakes_named(guarding.cause.name());
            handled.mistakes[clause] |= left & some;
            if !passes_on(clause, from) && guarding.limit != ClauseLimit::Times(0) {
                let late = if guarding.limit == ClauseLimit::None { 0 } else { source.late_mistakes };
                left &= !all | late;
            }
        }
        handled.leaving.mistakes |= left;
        handled.leaving.late_mistakes |= left & source.late_mistakes;
        for (clause, guarding) in clauses.iter().enumerate() {
            // A limit of the run may come at any place.
            let is_wide = matches!(
                guarding.cause.name(),
                "GENERAL-FAILURE" | "STACK-EXHAUSTED" | "HEAP-EXHAUSTED" | "STORAGE-CONDITION"
            );
            let is_reached = is_wide || !handled.taken[clause].is_empty() || handled.mistakes[clause] != 0;
            if is_reached && !done[clause] {
                done[clause] = true;
                sources.push((Some(clause), &effects[clause]));
            }
        }
    }
    handled
}

/// Returns the result of a form that unwinds to a clause for a type of conditions.
pub(crate) fn take(known: &FailureFacts<'_>, body: &LeavingFailures, types: &[Datum]) -> Handled {
    let count = types.len();
    let mut handled = Handled {
        arriving: body.clone(),
        leaving: LeavingFailures::default(),
        taken: vec![BTreeSet::new(); count],
        mistakes: vec![0; count],
    };
    for failure in &body.failures {
        let mut goes_on = true;
        for (index, wanted) in types.iter().enumerate() {
            if goes_on {
                let match_ = is_of_type(known.forms, known.names, known.kinds[*failure as usize], wanted);
                if match_ != Applies::No {
                    goes_on = match_ == Applies::Perhaps;
                    handled.taken[index].insert((*failure, goes_on));
                }
            }
        }
        if goes_on {
            handled.leaving.failures.insert(*failure);
            if body.late.contains(failure) {
                handled.leaving.late.insert(*failure);
            }
        }
    }
    let mut left = body.mistakes;
    for (index, wanted) in types.iter().enumerate() {
        let (all, some) = mistakes_of_type(wanted);
        handled.mistakes[index] |= left & some;
        left &= !all;
    }
    handled.leaving.mistakes = left;
    handled.leaving.late_mistakes = left & body.late_mistakes;
    handled
}
