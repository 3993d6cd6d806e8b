//! The solver: backtracking over facts, and tables for derived facts.
//!
//! A goal about facts makes a choice, which yields one fact after the other; after an answer, and when a goal
//! has no (more) facts, the solver returns to the latest choice. Nothing here recurses: the solver's position
//! is kept in the [`Query`], so it can stop after any amount of work.
//!
//! A goal about a predicate with rules looks up the table of the same call. Unless the table is complete, the
//! rest of the computation is suspended as one of its consumers, and gets each answer once, whenever it is
//! found. So each combination of answers is considered once, and rules with finitely many answers terminate,
//! in whatever order they are written. Work is done by strata: a negated call is complete before its negation
//! is evaluated; a negation that reaches an incomplete table is suspended as well. The tables are in
//! `tabling`.
//!
//! Source: OLD resolution with tabulation (Tamaki and Sato 1986), with the continuations of SLG; the strata
//! are those of Apt, Blair and Walker.

use smallvec::SmallVec;

use super::Database;
use super::effort::{Effort, ITEM};
use super::formula::Pattern;
use super::plan::{Goal, GoalId};
use super::query::{AgendaItem, Progress, Query, QueryError, Sink, test_bindings};
use super::relation::{Access, INDEXED_POSITIONS};
use super::scan::RelationScan;
use super::term::Term;

/// Least effort of a step; with less, some goals would make no progress.
const LEAST: usize = 4 * ITEM;

/// Goal at the end of a query or rule.
pub(super) const SOLVED: GoalId = 0;

/// The solver's next action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SolverState {
    /// Run this goal.
    Goal(GoalId),
    /// Return to the latest choice.
    Back,
    /// Wait for the outcome of the test that is this goal.
    Testing(GoalId),
    /// Stop: all answers are found.
    Done,
}

/// An operation on a cell of a fact.
#[derive(Clone, Copy, Debug)]
pub(super) enum MatchOperation {
    /// Compare it with this term.
    Same(u32, Term),
    /// Bind a variable to it.
    Bind(u32, u32),
    /// Match it with a pattern.
    Match(u32, Term),
}

/// A choice to return to.
#[derive(Debug)]
pub(super) enum Choice {
    /// Facts of one relation.
    Rows {
        relation: u32,
        index: Option<usize>,
        row: u32,
        operations: usize,
        trail: usize,
        rank: usize,
        next: GoalId,
    },
    /// Facts of several relations.
    Scan { scan: Box<RelationScan>, trail: usize, next: GoalId },
    /// Answers of a table; with a consumer, including those yet to be found.
    Table {
        table: u32,
        at: usize,
        variables: SmallVec<[u32; 4]>,
        consumer: Option<u32>,
        trail: usize,
        rank: usize,
        next: GoalId,
    },
    /// Alternatives.
    Branch { goal: GoalId, at: usize, trail: usize },
    /// The inside of a negation, and whether everything it depends on was complete.
    Negation { goal: GoalId, trail: usize, is_complete: bool },
}

impl Query {
    /// Runs until all answers are found, a test is requested, or the effort is used up.
    pub(super) fn step(
        &mut self,
        database: &mut Database,
        effort: &mut Effort,
    ) -> Result<Progress, QueryError> {
        // Each step makes progress.
        effort.allow(LEAST);
        loop {
            if !effort.take_item() {
                return Ok(Progress::More);
            }
            match self.state {
                SolverState::Goal(goal) => {
                    if let Some(progress) = self.run_goal(database, goal, effort)? {
                        return Ok(progress);
                    }
                }
                SolverState::Back => {
                    if !self.go_back(database, effort)? {
                        return Ok(Progress::More);
                    }
                }
                SolverState::Testing(goal) => {
                    let Goal::Test { test, .. } = &self.goals[goal as usize] else { unreachable!("a test") };
                    let names = match &self.sinks[self.sink as usize] {
                        Sink::Rule(_, rule) => &rule.names,
                        _ => &self.names,
                    };
                    effort.spend_cells(test.variables.len());
                    return Ok(Progress::Test(test.function, test_bindings(test, names, &self.bindings)));
                }
                SolverState::Done => {
                    let done = self.put_into_order(effort);
                    return Ok(if done { Progress::Done } else { Progress::More });
                }
            }
        }
    }

    /// Continues with the outcome of the requested test.
    pub(super) fn tell(&mut self, holds: bool) {
        if let SolverState::Testing(goal) = self.state
            && let Goal::Test { next, .. } = self.goals[goal as usize]
        {
            self.state = if holds { SolverState::Goal(next) } else { SolverState::Back };
        }
    }

    fn run_goal(
        &mut self,
        database: &mut Database,
        goal: GoalId,
        effort: &mut Effort,
    ) -> Result<Option<Progress>, QueryError> {
        match &self.goals[goal as usize] {
            Goal::Match { pattern, relation, next } => {
                let next = *next;
                match *relation {
                    Some(relation) => {
                        let pattern = pattern.clone();
                        return self.find_rows(database, &pattern, relation, next, effort);
                    }
                    None if pattern.functor.as_variable().is_none() && pattern.tail == Term::NIL => {
                        self.state = SolverState::Back;
                    }
                    None => {
                        let scan = Box::new(RelationScan::new(pattern.clone()));
                        self.choices.push(Choice::Scan { scan, trail: self.trail.len(), next });
                        self.state = SolverState::Back;
                    }
                }
            }
            Goal::Call { pattern, predicate, next } => {
                let (pattern, predicate, next) = (pattern.clone(), *predicate, *next);
                self.call(database, &pattern, predicate, next, effort)?;
            }
            Goal::Branch { .. } => {
                self.choices.push(Choice::Branch { goal, at: 0, trail: self.trail.len() });
                self.state = SolverState::Back;
            }
            Goal::Not { inside, .. } => {
                self.state = SolverState::Goal(*inside);
                self.choices.push(Choice::Negation { goal, trail: self.trail.len(), is_complete: true });
            }
            Goal::Proved => {
                while let Some(choice) = self.choices.pop() {
                    self.drop_operations(&choice);
                    if let Choice::Negation { trail, .. } = choice {
                        self.undo(trail);
                        break;
                    }
                }
                self.state = SolverState::Back;
            }
            Goal::Test { .. } => self.state = SolverState::Testing(goal),
            Goal::Solved => {
                self.solved(database, effort)?;
                self.state = SolverState::Back;
            }
        }
        Ok(None)
    }

    fn drop_operations(&mut self, choice: &Choice) {
        if let Choice::Rows { operations, .. } = choice {
            self.operations.truncate(*operations);
        }
    }

    pub(super) fn undo(&mut self, trail: usize) {
        for &variable in &self.trail[trail..] {
            self.bindings[variable as usize] = Term::UNBOUND;
        }
        self.trail.truncate(trail);
    }

    pub(super) fn set_key(&mut self, rank: usize, key: u64) {
        // The ranks inside rules do not matter for the order of answers.
        if self.is_reordered
            && self.sink == 0
            && let Some(place) = self.keys.get_mut(rank)
        {
            *place = key;
        }
    }

    /// Makes a choice of the rows of a relation that may match.
    fn find_rows(
        &mut self,
        database: &mut Database,
        pattern: &Pattern,
        relation: u32,
        next: GoalId,
        effort: &mut Effort,
    ) -> Result<Option<Progress>, QueryError> {
        let width = pattern.arguments.len();
        effort.spend_cells(width);
        let mut key: SmallVec<[Term; 8]> = SmallVec::from_elem(Term::UNBOUND, width);
        let first_operation = self.operations.len();
        let (mut bound, mut known, mut is_flat) = (0_u64, 0, true);
        for (position, &argument) in pattern.arguments.iter().enumerate() {
            let at = position as u32;
            match database.terms.instantiate(argument, &self.bindings, &mut self.held, effort)? {
                Some(term) => {
                    key[position] = term;
                    known += 1;
                    if position < INDEXED_POSITIONS {
                        bound |= 1 << position;
                    }
                    self.operations.push(MatchOperation::Same(at, term));
                }
                None => match argument.as_variable() {
                    Some(variable) if is_flat && position < pattern.first_repeated => {
                        self.operations.push(MatchOperation::Bind(at, variable as u32));
                    }
                    _ => {
                        // From here on a variable may have its value from this very fact.
                        is_flat = false;
                        self.operations.push(MatchOperation::Match(at, argument));
                    }
                },
            }
        }
        let facts = &mut database.relations[relation as usize];
        let access = facts.access(bound, known == width, &key, self.time, effort);
        let (index, row) = match access {
            Access::Nothing => {
                self.operations.truncate(first_operation);
                self.state = SolverState::Back;
                return Ok(None);
            }
            Access::Build(index) => {
                self.operations.truncate(first_operation);
                // Afterwards the goal is run again.
                let done = database.relations[relation as usize].build(index, effort);
                return Ok(if done { None } else { Some(Progress::More) });
            }
            Access::One(row) => {
                self.operations.truncate(first_operation);
                let born = database.relations[relation as usize].born(row);
                self.matched_row(relation, row, pattern.rank, born);
                self.state = SolverState::Goal(next);
                return Ok(None);
            }
            Access::Chain(index, row) => (index, row),
        };
        let choice = Choice::Rows {
            relation,
            index,
            row,
            operations: first_operation,
            trail: self.trail.len(),
            rank: pattern.rank,
            next,
        };
        // Its first fact is searched for at once; if the effort is used up on the way, the choice remains.
        self.state = SolverState::Back;
        let goes_on = self.next_row(database, choice, effort);
        Ok(if goes_on { None } else { Some(Progress::More) })
    }

    fn matched_row(&mut self, relation: u32, row: u32, rank: usize, born: u64) {
        self.set_key(rank, born);
        if let Some(rows) = &mut self.rows {
            rows.push((relation, row));
        }
    }

    /// Returns to the latest choice. The result is false if the effort is used up on the way.
    fn go_back(&mut self, database: &mut Database, effort: &mut Effort) -> Result<bool, QueryError> {
        if let Some(Choice::Table { .. }) = self.choices.last() {
            self.next_table_answer(effort);
            return Ok(true);
        }
        let Some(choice) = self.choices.pop() else {
            self.next_work(database, effort)?;
            return Ok(true);
        };
        match choice {
            Choice::Rows { .. } => return Ok(self.next_row(database, choice, effort)),
            Choice::Scan { mut scan, trail, next } => {
                self.undo(trail);
                let found = scan.next(database, self, effort)?;
                let is_unfinished = found.is_none() && !scan.is_exhausted();
                if let Some((relation, row)) = found {
                    let born = database.relations[relation as usize].born(row);
                    self.matched_row(relation, row, scan.rank(), born);
                    self.state = SolverState::Goal(next);
                }
                if !scan.is_exhausted() {
                    self.choices.push(Choice::Scan { scan, trail, next });
                }
                return Ok(!is_unfinished);
            }
            Choice::Table { .. } => unreachable!("seen to above"),
            Choice::Branch { goal, at, trail } => {
                self.undo(trail);
                let Goal::Branch { alternatives, rank, ranks_end } = &self.goals[goal as usize] else {
                    unreachable!("alternatives")
                };
                let (rank, ranks_end) = (*rank, *ranks_end);
                let Some(&alternative) = alternatives.get(at) else { return Ok(true) };
                if at + 1 < alternatives.len() {
                    self.choices.push(Choice::Branch { goal, at: at + 1, trail });
                }
                self.state = SolverState::Goal(alternative);
                if self.is_reordered && self.sink == 0 {
                    let ranks = rank.min(self.keys.len())..ranks_end.min(self.keys.len());
                    effort.spend_cells(ranks.len());
                    self.keys[ranks].fill(0);
                    self.set_key(rank, at as u64);
                }
            }
            Choice::Negation { goal, trail, is_complete } => {
                self.undo(trail);
                let Goal::Not { next, .. } = self.goals[goal as usize] else { unreachable!("a negation") };
                if is_complete {
                    self.state = SolverState::Goal(next);
                } else if !self.doubt() {
                    let continuation = self.continuation(goal);
                    effort.spend_cells(self.bindings.len());
                    self.waiting_bytes += continuation.bytes();
                    self.set_aside(AgendaItem::Resume(continuation), self.stratum);
                }
            }
        }
        Ok(true)
    }

    /// Marks the innermost negation as undecided. Returns false if there is none.
    pub(super) fn doubt(&mut self) -> bool {
        let negations = self.choices.iter_mut().rev();
        for choice in negations {
            if let Choice::Negation { is_complete, .. } = choice {
                *is_complete = false;
                return true;
            }
        }
        false
    }

    fn next_row(&mut self, database: &mut Database, choice: Choice, effort: &mut Effort) -> bool {
        let Choice::Rows { relation, index, mut row, operations, trail, rank, next } = choice else {
            unreachable!("rows")
        };
        let again = |row| Choice::Rows { relation, index, row, operations, trail, rank, next };
        self.undo(trail);
        let facts = &database.relations[relation as usize];
        while row != super::bucket::NONE {
            if !effort.take_item() {
                self.choices.push(again(row));
                return false;
            }
            let after = facts.after(index, row);
            let born = facts.born(row);
            if born > self.time {
                // Rows after it are younger still.
                break;
            }
            if facts.is_visible(row, self.time) {
                let cells = facts.row(row);
                let Query { operations: all, bindings, trail: bound, .. } = self;
                let differs = all[operations..].iter().position(|operation| match *operation {
                    MatchOperation::Same(at, term) => cells[at as usize] != term,
                    MatchOperation::Bind(at, variable) => {
                        bindings[variable as usize] = cells[at as usize];
                        bound.push(variable);
                        false
                    }
                    MatchOperation::Match(at, pattern) => {
                        !database.terms.matches(pattern, cells[at as usize], bindings, bound, effort)
                    }
                });
                effort.spend_cells(differs.unwrap_or(cells.len()));
                if differs.is_none() {
                    self.matched_row(relation, row, rank, born);
                    self.state = SolverState::Goal(next);
                    if after == super::bucket::NONE {
                        self.operations.truncate(operations);
                    } else {
                        self.choices.push(again(after));
                    }
                    return true;
                }
                self.undo(trail);
            }
            row = after;
        }
        self.operations.truncate(operations);
        true
    }
}
