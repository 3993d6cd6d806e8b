//! Handling forms: which failures of a body end in which clause, and which leave the form.

use std::collections::BTreeSet;

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::Symbol;
use rustc_hash::FxHashMap;

use crate::cause::{Applies, is_of_type, mistakes_named, mistakes_of_type};
use crate::clause::{Clause, ClauseLimit};
use crate::effect::{FailureKind, mistake};
use crate::forms::CoreForms;
use crate::spent::{ClauseFinder, SpentClauses};
use crate::value::Numbering;

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
    /// Failures that interrupt code, and that a form inside takes, so that control goes on there.
    pub(crate) stopped: BTreeSet<FailureId>,
    /// Failures that leave a form inside which takes a late one: while control leaves for a clause that has
    /// taken one of these, a cleanup may have that form go on.
    pub(crate) crossed: BTreeSet<FailureId>,
    /// Whether control may leave for a place around the failure that the code runs for.
    pub(crate) jumps: bool,
    /// Whether the code may wait.
    pub(crate) waits: bool,
}

impl LeavingFailures {
    /// Has all of them be late, as those of a cleanup are. A failure that is taken there has the cleanup go
    /// on, not the code that control leaves.
    pub(crate) fn delay(&mut self) {
        self.stopped.clear();
        self.crossed.clear();
        self.late.clone_from(&self.failures);
        self.late_mistakes = self.mistakes;
    }

    /// Adds those of another. Returns whether that has added any.
    pub(crate) fn add(&mut self, other: &LeavingFailures) -> bool {
        let size = |one: &LeavingFailures| {
            let flags = (one.mistakes, one.late_mistakes, one.jumps, one.waits);
            (one.failures.len(), one.late.len(), one.stopped.len(), one.crossed.len(), flags)
        };
        let before = size(self);
        self.failures.extend(&other.failures);
        self.mistakes |= other.mistakes;
        self.late.extend(&other.late);
        self.late_mistakes |= other.late_mistakes;
        self.stopped.extend(&other.stopped);
        self.crossed.extend(&other.crossed);
        self.jumps |= other.jumps;
        self.waits |= other.waits;
        before != size(self)
    }

    /// Whether it is empty.
    pub(crate) fn is_empty(&self) -> bool {
        self.failures.is_empty() && self.mistakes == 0
    }

    /// Adds what happens inside a form, whether failures leave it or not.
    fn add_inside(&mut self, other: &LeavingFailures) {
        self.stopped.extend(&other.stopped);
        self.crossed.extend(&other.crossed);
        self.jumps |= other.jumps;
        self.waits |= other.waits;
    }

    /// Notes that a form takes a failure.
    fn stop(&mut self, known: &FailureFacts<'_>, failure: FailureId) {
        if known.interrupted.contains_key(&failure) {
            self.stopped.insert(failure);
        }
    }

    /// Adds a failure of `from`.
    fn pass(&mut self, failure: FailureId, from: &LeavingFailures) {
        self.failures.insert(failure);
        if from.late.contains(&failure) {
            self.late.insert(failure);
        }
    }
}

/// Knowledge of a program's failures.
pub(crate) struct FailureFacts<'k> {
    pub(crate) forms: &'k CoreForms,
    pub(crate) names: &'k Numbering<Symbol>,
    /// Kinds of the failures, by their numbers.
    pub(crate) kinds: &'k [FailureKind],
    /// Failures that interrupt code, as that of a limit does, each with the failures of that code.
    pub(crate) interrupted: &'k FxHashMap<FailureId, LeavingFailures>,
    /// Causes of the clauses whose ends control can reach.
    pub(crate) resuming: &'k [Symbol],
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
    /// Clauses that run within code that a failure interrupts.
    pub(crate) interrupted: Vec<(FailureId, Vec<usize>)>,
}

impl Handled {
    fn new(body: &LeavingFailures, count: usize) -> Handled {
        let mut handled = Handled {
            arriving: body.clone(),
            taken: vec![BTreeSet::new(); count],
            mistakes: vec![0; count],
            ..Handled::default()
        };
        handled.leaving.add_inside(body);
        handled
    }

    /// Notes which failures leave a form that takes a late one.
    fn cross(&mut self, takes_late: bool) {
        if takes_late {
            self.leaving.crossed.extend(&self.leaving.failures);
        }
    }
}

/// Whether a limit of the run, which may come at any place, is one that a clause for this cause takes.
fn takes_limits(cause: &str) -> bool {
    matches!(cause, "GENERAL-FAILURE" | "STACK-EXHAUSTED" | "HEAP-EXHAUSTED" | "STORAGE-CONDITION")
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
    let mut handled = Handled::new(body, clauses.len());
    let finder = ClauseFinder::new(known, clauses);
    let spent = SpentClauses::new(&finder, body, effects, resumes);
    handled.interrupted = spent.interrupted();
    // Clauses that take programming errors, with all kinds and some kinds of these.
    let named = |clause: usize| mistakes_named(clauses[clause].cause.name());
    let of_mistakes: Vec<usize> =
        (0..clauses.len()).filter(|clause| clauses[*clause].limit != ClauseLimit::Times(0)).collect();
    let of_mistakes: Vec<(usize, u8, u8)> = of_mistakes
        .into_iter()
        .map(|clause| (clause, named(clause).0, named(clause).1))
        .filter(|(_, all, some)| all | some != 0)
        .collect();
    let mut reached: Vec<usize> =
        (0..clauses.len()).filter(|clause| takes_limits(clauses[*clause].cause.name())).collect();
    let mut takes_late = false;
    let mut done = vec![false; clauses.len()];
    let mut sources: Vec<Option<usize>> = vec![None];
    while let Some(from) = sources.pop() {
        let source = from.map_or(body, |clause| &effects[clause]);
        let before = spent.before(from);
        for failure in &source.failures {
            let mut goes_on = true;
            for (clause, applies) in finder.clauses_for(*failure).iter() {
                if !goes_on {
                    break;
                }
                goes_on = *applies == Applies::Perhaps
                    || spent.passes(*clause, &before)
                    || (clauses[*clause].limit != ClauseLimit::None
                        && (source.late.contains(failure) || spent.is_interrupted(*clause, *failure)));
                handled.taken[*clause].insert((*failure, goes_on));
                handled.leaving.stop(known, *failure);
                takes_late |= source.late.contains(failure);
                reached.push(*clause);
            }
            if goes_on {
                handled.leaving.pass(*failure, source);
            }
        }
        let mut left = source.mistakes;
        if from.is_some() && left != 0 {
            // The clause may run where the body must not wait.
            left |= body.mistakes & mistake::CRITICAL;
        }
        for (clause, all, some) in &of_mistakes {
            if left == 0 {
                break;
            }
            if left & some != 0 {
                handled.mistakes[*clause] |= left & some;
                reached.push(*clause);
            }
            if !spent.passes(*clause, &before) {
                let is_limited = clauses[*clause].limit != ClauseLimit::None;
                left &= !all | if is_limited { source.late_mistakes } else { 0 };
            }
        }
        handled.leaving.mistakes |= left;
        handled.leaving.late_mistakes |= left & source.late_mistakes;
        for clause in reached.drain(..) {
            if !std::mem::replace(&mut done[clause], true) {
                handled.leaving.add_inside(&effects[clause]);
                sources.push(Some(clause));
            }
        }
    }
    handled.cross(takes_late);
    handled
}

/// Returns the result of a form that unwinds to a clause for a type of conditions.
pub(crate) fn take(known: &FailureFacts<'_>, body: &LeavingFailures, types: &[Datum]) -> Handled {
    let mut handled = Handled::new(body, types.len());
    let mut takes_late = false;
    for failure in &body.failures {
        let mut goes_on = true;
        for (index, wanted) in types.iter().enumerate() {
            if goes_on {
                let match_ = is_of_type(known.forms, known.names, known.kinds[*failure as usize], wanted);
                if match_ != Applies::No {
                    goes_on = match_ == Applies::Perhaps;
                    handled.taken[index].insert((*failure, goes_on));
                    handled.leaving.stop(known, *failure);
                    takes_late |= body.late.contains(failure);
                }
            }
        }
        if goes_on {
            handled.leaving.pass(*failure, body);
        }
    }
    handled.cross(takes_late);
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
