//! The clauses of a recovery form that apply to a failure, and those that may have been called before it
//! comes.
//!
//! A clause with a limit that has been called before may be spent, so that the failure passes it. That is so
//! if control comes back into the body after the clause, and if the failure begins while the clause runs. In
//! doubt a clause counts as spent: how often it has run is not counted.

use std::cell::RefCell;
use std::rc::Rc;

use esl_bytecode::symbol::Symbol;
use rustc_hash::{FxHashMap, FxHashSet};

use crate::cause::{Applies, clause_applies, clause_causes};
use crate::clause::{Clause, ClauseLimit};
use crate::guard::{FailureFacts, FailureId, LeavingFailures};

/// Clauses that may take a failure, in the order of the text.
type ApplyingClauses = Rc<[(usize, Applies)]>;

/// Finds the clauses that apply to failures.
pub(crate) struct ClauseFinder<'r> {
    known: &'r FailureFacts<'r>,
    clauses: &'r [Clause],
    by_cause: FxHashMap<&'r Symbol, Vec<usize>>,
    found: RefCell<FxHashMap<FailureId, ApplyingClauses>>,
}

impl<'r> ClauseFinder<'r> {
    pub(crate) fn new(known: &'r FailureFacts<'r>, clauses: &'r [Clause]) -> ClauseFinder<'r> {
        let mut by_cause: FxHashMap<&Symbol, Vec<usize>> = FxHashMap::default();
        for (position, clause) in clauses.iter().enumerate() {
            by_cause.entry(&clause.cause).or_default().push(position);
        }
        ClauseFinder { known, clauses, by_cause, found: RefCell::default() }
    }

    /// Returns the clauses that may take a failure, without those that never run.
    pub(crate) fn clauses_for(&self, failure: FailureId) -> ApplyingClauses {
        if let Some(found) = self.found.borrow().get(&failure) {
            return Rc::clone(found);
        }
        let (forms, names) = (self.known.forms, self.known.names);
        let kind = self.known.kinds[failure as usize];
        let positions: Vec<usize> = match clause_causes(forms, names, kind) {
            Some(mut causes) => {
                causes.push(Symbol::keyword("GENERAL-FAILURE"));
                let of_causes = causes.iter().filter_map(|cause| self.by_cause.get(cause));
                let mut positions: Vec<usize> = of_causes.flatten().copied().collect();
                positions.sort_unstable();
                positions.dedup();
                positions
            }
            None => (0..self.clauses.len()).collect(),
        };
        let row = positions.into_iter().filter_map(|position| {
            let clause = &self.clauses[position];
            let applies = clause_applies(forms, names, kind, &clause.cause);
            let is_it = applies != Applies::No && clause.limit != ClauseLimit::Times(0);
            is_it.then_some((position, applies))
        });
        let row: ApplyingClauses = row.collect();
        self.found.borrow_mut().insert(failure, Rc::clone(&row));
        row
    }
}

/// The clauses of a form that may have been called before a failure.
pub(crate) struct SpentClauses<'r> {
    clauses: &'r [Clause],
    /// Whether control can reach the end of each clause, so that the failed call gets its value.
    resumes: &'r [bool],
    /// Clauses after which the body may go on or begin again, so that a later failure finds them spent.
    is_left: Vec<bool>,
    /// For each point that control can reach, those from which it does. The points are the clauses, the
    /// cleanups of the body, and the failures that interrupt it.
    before: Vec<Vec<usize>>,
    /// Clauses that may run in code which a failure interrupts.
    interrupted: FxHashMap<FailureId, FxHashSet<usize>>,
}

impl<'r> SpentClauses<'r> {
    pub(crate) fn new(
        finder: &ClauseFinder<'r>,
        body: &LeavingFailures,
        effects: &[LeavingFailures],
        resumes: &'r [bool],
    ) -> SpentClauses<'r> {
        let clauses = finder.clauses;
        let known = finder.known;
        let count = clauses.len();
        let all = || std::iter::once(body).chain(effects);
        let takers = |failures: &mut dyn Iterator<Item = &FailureId>| -> Vec<usize> {
            let mut row = Vec::new();
            for failure in failures {
                row.extend(finder.clauses_for(*failure).iter().map(|(clause, _)| *clause));
            }
            row.sort_unstable();
            row.dedup();
            row
        };
        let mut after: Vec<Vec<usize>> =
            effects.iter().map(|effect| takers(&mut effect.failures.iter())).collect();
        let mut is_left: Vec<bool> =
            (0..count).map(|one| clauses[one].ways.retries || effects[one].jumps).collect();
        // While control leaves a clause, a cleanup may fail.
        let cleanups = takers(&mut all().flat_map(|one| &one.late));
        if !cleanups.is_empty() {
            after.iter_mut().for_each(|row| row.push(count));
        }
        is_left.push(false);
        after.push(cleanups);
        let crossed = takers(&mut all().flat_map(|one| &one.crossed));
        reach(&after, crossed, count).into_iter().for_each(|clause| is_left[clause] = true);
        let mut interrupted = FxHashMap::default();
        for failure in all().flat_map(|one| one.failures.iter().chain(&one.stopped)) {
            let Some(inside) = known.interrupted.get(failure) else { continue };
            if interrupted.contains_key(failure) {
                continue;
            }
            let mut running = reach(&after, takers(&mut inside.failures.iter()), count);
            // One that neither waits nor fails has left by then.
            running.retain(|clause| effects[*clause].waits || !effects[*clause].failures.is_empty());
            if running.is_empty() {
                continue;
            }
            let takers: Vec<usize> = finder.clauses_for(*failure).iter().map(|(clause, _)| *clause).collect();
            let kind = known.kinds[*failure as usize];
            let comes_back =
                |cause: &Symbol| clause_applies(known.forms, known.names, kind, cause) != Applies::No;
            is_left.push(
                all().any(|one| one.stopped.contains(failure)) || known.resuming.iter().any(comes_back),
            );
            let point = after.len();
            after.push(takers);
            running.iter().for_each(|clause| after[*clause].push(point));
            interrupted.insert(*failure, running);
        }
        let mut before = vec![Vec::new(); after.len()];
        for (point, row) in after.iter().enumerate() {
            row.iter().for_each(|next| before[*next].push(point));
        }
        let left: Vec<usize> = (0..is_left.len()).filter(|point| is_left[*point]).collect();
        reach(&before, left, usize::MAX).into_iter().for_each(|point| is_left[point] = true);
        SpentClauses { clauses, resumes, is_left, before, interrupted }
    }

    /// Returns the clauses that may run while a clause does, with itself.
    pub(crate) fn before(&self, clause: Option<usize>) -> FxHashSet<usize> {
        reach(&self.before, clause.into_iter().collect(), self.clauses.len())
    }

    /// Whether a failure may pass a clause that applies to it. `before` are the clauses that run already.
    pub(crate) fn passes(&self, clause: usize, before: &FxHashSet<usize>) -> bool {
        match self.clauses[clause].limit {
            ClauseLimit::None => false,
            // It may be 0.
            ClauseLimit::Computed => true,
            ClauseLimit::Times(_) => self.is_left[clause] || self.resumes[clause] || before.contains(&clause),
        }
    }

    /// Whether a clause may run in code that a failure interrupts.
    pub(crate) fn is_interrupted(&self, clause: usize, failure: FailureId) -> bool {
        self.interrupted.get(&failure).is_some_and(|running| running.contains(&clause))
    }

    /// Returns the failures that interrupt code in which clauses may run, with these clauses.
    pub(crate) fn interrupted(&self) -> Vec<(FailureId, Vec<usize>)> {
        self.interrupted
            .iter()
            .map(|(failure, running)| (*failure, running.iter().copied().collect()))
            .collect()
    }
}

/// Returns the points below `most` that can be reached, and from where this begins.
fn reach(edges: &[Vec<usize>], from: Vec<usize>, most: usize) -> FxHashSet<usize> {
    let mut found: FxHashSet<usize> = FxHashSet::default();
    let mut pending = from;
    while let Some(point) = pending.pop() {
        if found.insert(point) {
            pending.extend(&edges[point]);
        }
    }
    found.retain(|point| *point < most);
    found
}
