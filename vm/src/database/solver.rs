//! The solver: backtracking over facts, and tables for derived facts.
//!
//! A goal about facts makes a choice, which yields one fact after the other; after an answer, and when a goal
//! has no (more) facts, the solver returns to the latest choice. Nothing here recurses: the solver's position
//! is kept in the [`Query`], so it can stop after any amount of work.
//!
//! A goal about a predicate with rules looks up the table of the same call. Unless the table is complete, the
//! rest of the computation is set aside as one of its consumers, and gets each answer once, whenever it is
//! found. So each combination of answers is considered once, and rules with finitely many answers terminate,
//! in whatever order they are written. Work is done by strata: a negated call is complete before its negation
//! is evaluated; a negation that reaches an incomplete table is set aside as well.
//!
//! Source: OLD resolution with tabulation (Tamaki and Sato 1986), with the continuations of SLG; the strata
//! are those of Apt, Blair and Walker.

use std::collections::VecDeque;
use std::sync::Arc;

use smallvec::SmallVec;

use super::Database;
use super::bucket::{finish, mix};
use super::formula::Pattern;
use super::plan::{Goal, GoalId, Planner};
use super::query::{
    AgendaItem, Answers, Consumer, Continuation, Progress, Query, QueryError, Sink, test_bindings,
};
use super::relation::{Access, INDEXED_POSITIONS};
use super::rule::{NO_STRATUM, Predicate, Rule};
use super::scan::RelationScan;
use super::term::Term;
use super::tuple::Tuples;

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
    /// Runs until all answers are found, a test is requested, or the work is used up.
    pub(super) fn step(&mut self, database: &mut Database, work: &mut usize) -> Result<Progress, QueryError> {
        // Each step makes progress.
        *work = (*work).max(LEAST_WORK);
        loop {
            let Some(left) = work.checked_sub(1) else { return Ok(Progress::More) };
            *work = left;
            match self.state {
                SolverState::Goal(goal) => {
                    if let Some(progress) = self.run_goal(database, goal, work)? {
                        return Ok(progress);
                    }
                }
                SolverState::Back => {
                    if !self.go_back(database, work)? {
                        return Ok(Progress::More);
                    }
                }
                SolverState::Testing(goal) => {
                    let Goal::Test { test, .. } = &self.goals[goal as usize] else { unreachable!("a test") };
                    let names = match &self.sinks[self.sink as usize] {
                        Sink::Rule(_, rule) => &rule.names,
                        _ => &self.names,
                    };
                    return Ok(Progress::Test(test.function, test_bindings(test, names, &self.bindings)));
                }
                SolverState::Done => {
                    let done = self.put_into_order(work);
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
        work: &mut usize,
    ) -> Result<Option<Progress>, QueryError> {
        match &self.goals[goal as usize] {
            Goal::Match { pattern, relation, next } => {
                let next = *next;
                match *relation {
                    Some(relation) => {
                        let pattern = pattern.clone();
                        return self.find_rows(database, &pattern, relation, next, work);
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
                self.call(database, &pattern, predicate, next)?;
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
                self.solved(database)?;
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
        for variable in self.trail.drain(trail..) {
            self.bindings[variable as usize] = Term::UNBOUND;
        }
    }

    fn set_key(&mut self, rank: usize, key: u64) {
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
        work: &mut usize,
    ) -> Result<Option<Progress>, QueryError> {
        let width = pattern.arguments.len();
        let mut key: SmallVec<[Term; 8]> = SmallVec::from_elem(Term::UNBOUND, width);
        let first_operation = self.operations.len();
        let (mut bound, mut known, mut is_flat) = (0_u64, 0, true);
        for (position, &argument) in pattern.arguments.iter().enumerate() {
            let at = position as u32;
            match database.terms.instantiate(argument, &self.bindings, &mut self.held)? {
                Some(term) => {
                    key[position] = term;
                    known += 1;
                    if position < INDEXED_POSITIONS {
                        bound |= 1 << position;
                    }
                    self.operations.push(MatchOperation::Same(at, term));
                }
                None => match argument.as_variable() {
                    Some(variable) if is_flat && !pattern.arguments[..position].contains(&argument) => {
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
        let access = database.relations[relation as usize].access(bound, known == width, &key, self.time);
        let (index, row) = match access {
            Access::Nothing => {
                self.operations.truncate(first_operation);
                self.state = SolverState::Back;
                return Ok(None);
            }
            Access::Build(index) => {
                self.operations.truncate(first_operation);
                // Afterwards the goal is run again.
                let done = database.relations[relation as usize].build(index, work);
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
        // Its first fact is searched for at once; if the work is used up on the way, the choice remains.
        self.state = SolverState::Back;
        let goes_on = self.next_row(database, choice, work);
        Ok(if goes_on { None } else { Some(Progress::More) })
    }

    fn matched_row(&mut self, relation: u32, row: u32, rank: usize, born: u64) {
        self.set_key(rank, born);
        if let Some(rows) = &mut self.rows {
            rows.push((relation, row));
        }
    }

    /// Returns to the latest choice. The result is false if the work is used up on the way.
    fn go_back(&mut self, database: &mut Database, work: &mut usize) -> Result<bool, QueryError> {
        if let Some(Choice::Table { .. }) = self.choices.last() {
            self.next_table_answer();
            return Ok(true);
        }
        let Some(choice) = self.choices.pop() else {
            self.next_work(database)?;
            return Ok(true);
        };
        match choice {
            Choice::Rows { .. } => return Ok(self.next_row(database, choice, work)),
            Choice::Scan { mut scan, trail, next } => {
                self.undo(trail);
                let found = scan.next(database, self, work)?;
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
                    self.set_aside(AgendaItem::Resume(continuation), self.stratum);
                }
            }
        }
        Ok(true)
    }

    /// Marks the innermost negation as undecided. Returns false if there is none.
    fn doubt(&mut self) -> bool {
        let negations = self.choices.iter_mut().rev();
        for choice in negations {
            if let Choice::Negation { is_complete, .. } = choice {
                *is_complete = false;
                return true;
            }
        }
        false
    }

    fn next_row(&mut self, database: &mut Database, choice: Choice, work: &mut usize) -> bool {
        let Choice::Rows { relation, index, mut row, operations, trail, rank, next } = choice else {
            unreachable!("rows")
        };
        let again = |row| Choice::Rows { relation, index, row, operations, trail, rank, next };
        self.undo(trail);
        let facts = &database.relations[relation as usize];
        while row != super::bucket::NONE {
            let Some(left) = work.checked_sub(1) else {
                self.choices.push(again(row));
                return false;
            };
            *work = left;
            let after = facts.after(index, row);
            let born = facts.born(row);
            if born > self.time {
                // Rows after it are younger still.
                break;
            }
            if facts.is_visible(row, self.time) {
                let cells = facts.row(row);
                let Query { operations: all, bindings, trail: bound, .. } = self;
                let matches = all[operations..].iter().all(|operation| match *operation {
                    MatchOperation::Same(at, term) => cells[at as usize] == term,
                    MatchOperation::Bind(at, variable) => {
                        bindings[variable as usize] = cells[at as usize];
                        bound.push(variable);
                        true
                    }
                    MatchOperation::Match(at, pattern) => {
                        database.terms.matches(pattern, cells[at as usize], bindings, bound)
                    }
                });
                if matches {
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

    // ---- rules

    fn continuation(&self, goal: GoalId) -> Continuation {
        let keys =
            if self.is_reordered && self.sink == 0 { self.keys.clone().into() } else { Box::default() };
        Continuation { goal, sink: self.sink, bindings: self.bindings.clone().into(), keys }
    }

    fn set_aside(&mut self, work: AgendaItem, stratum: usize) {
        if self.agenda.len() <= stratum {
            self.agenda.resize_with(stratum + 1, Default::default);
        }
        self.agenda[stratum].push_back(work);
    }

    fn stratum_of(&self, sink: u32) -> usize {
        match self.sinks[sink as usize] {
            Sink::Query => self.rules.strata,
            Sink::Facts(table) | Sink::Rule(table, _) => self.tables[table as usize].stratum,
        }
    }

    /// Returns whether all answers of a table have been found.
    fn is_complete(&self, table: u32) -> bool {
        let stratum = self.tables[table as usize].stratum;
        stratum < self.stratum && self.agenda[..=stratum].iter().all(|waiting| waiting.is_empty())
    }

    /// Continues with the answers to a call of a predicate with rules.
    fn call(
        &mut self,
        database: &mut Database,
        pattern: &Pattern,
        predicate: usize,
        next: GoalId,
    ) -> Result<(), QueryError> {
        self.state = SolverState::Back;
        let Predicate { functor, width, stratum, .. } = &self.rules.predicates[predicate];
        let (functor, width, stratum) = (*functor, *width, *stratum);
        if stratum == NO_STRATUM {
            return Err(QueryError::Circular(functor));
        }
        // A pattern whose functor is a variable matches this predicate if the variable can be its functor.
        let before = self.trail.len();
        let Query { bindings, held, trail, .. } = self;
        if !database.terms.matches(pattern.functor, functor, bindings, trail) {
            self.undo(before);
            return Ok(());
        }
        let mut variables: SmallVec<[u32; 4]> = SmallVec::new();
        let mut number = |variable: usize| {
            let known = variables.iter().position(|&other| other as usize == variable);
            known.unwrap_or_else(|| {
                variables.push(variable as u32);
                variables.len() - 1
            })
        };
        let mut call = Vec::with_capacity(width);
        for &argument in &pattern.arguments {
            if database.terms.is_ground(argument) {
                call.push(argument);
                continue;
            }
            if let Some(variable) = argument.as_variable() {
                let term = bindings[variable];
                call.push(if term.is_unbound() { Term::variable(number(variable) as u32) } else { term });
                continue;
            }
            let part = database.terms.rebuild(argument, held, &mut |variable| {
                let term = bindings[variable];
                Some(if term.is_unbound() { Term::variable(number(variable) as u32) } else { term })
            })?;
            call.push(part.unwrap_or(Term::NIL));
        }
        let table = self.table(predicate, call, variables.len());
        self.consume(table, variables, pattern.rank, next, before);
        Ok(())
    }

    /// Returns the table of a call; makes it if there is none yet.
    fn table(&mut self, predicate: usize, call: Vec<Term>, width: usize) -> u32 {
        let hash = finish(call.iter().fold(mix(8, predicate as u64), |hash, part| mix(hash, part.bits())));
        let Query { tables, by_call, .. } = self;
        let is_it = |at: u32| {
            let table = &tables[at as usize];
            table.predicate == predicate && table.call == call
        };
        if let Some(table) = by_call.find(hash, is_it) {
            return table;
        }
        let table = tables.len() as u32;
        by_call.add(table, hash);
        let stratum = self.rules.predicates[predicate].stratum;
        let tuples = Tuples::new(width);
        self.tables.push(Answers { predicate, call, stratum, width, tuples, consumers: Vec::new() });
        self.set_aside(AgendaItem::Expand { table, rule: 0 }, stratum);
        table
    }

    /// Continues with the answers of a table, now or as they are found. `before` is the length of the trail
    /// before the call.
    fn consume(
        &mut self,
        table: u32,
        variables: SmallVec<[u32; 4]>,
        rank: usize,
        next: GoalId,
        before: usize,
    ) {
        if self.is_complete(table) {
            // The functor may have been bound just now; returning to an earlier choice undoes that.
            let trail = self.trail.len();
            self.choices.push(Choice::Table { table, at: 0, variables, consumer: None, trail, rank, next });
            return;
        }
        if self.doubt() {
            self.undo(before);
            return;
        }
        let continuation = self.continuation(next);
        self.undo(before);
        let consumer = self.consumers.len() as u32;
        let is_idle = self.tables[table as usize].tuples.len() == 0;
        self.consumers.push(Consumer { table, at: 0, is_idle, variables, continuation, rank });
        self.tables[table as usize].consumers.push(consumer);
        if !is_idle {
            self.set_aside(AgendaItem::Feed(consumer), self.stratum);
        }
    }

    /// Continues with the next answer of the table of the latest choice.
    fn next_table_answer(&mut self) {
        let Query { choices, tables, consumers, bindings, trail: bound, .. } = self;
        let Some(Choice::Table { table, at, variables, consumer, trail, rank, next }) = choices.last_mut()
        else {
            unreachable!("answers of a table")
        };
        for variable in bound.drain(*trail..) {
            bindings[variable as usize] = Term::UNBOUND;
        }
        let answers = &tables[*table as usize].tuples;
        if *at >= answers.len() {
            if let Some(consumer) = *consumer {
                let consumer = &mut consumers[consumer as usize];
                consumer.at = *at;
                consumer.is_idle = true;
            }
            choices.pop();
            return;
        }
        for (&variable, &value) in variables.iter().zip(answers.get(*at)) {
            bindings[variable as usize] = value;
            bound.push(variable);
        }
        let (rank, key, next) = (*rank, *at as u64, *next);
        *at += 1;
        self.set_key(rank, key);
        self.state = SolverState::Goal(next);
    }

    /// Takes up the next piece of work, from the lowest stratum that has some.
    fn next_work(&mut self, database: &mut Database) -> Result<(), QueryError> {
        self.trail.clear();
        self.operations.clear();
        let next = self.agenda.iter_mut().find_map(VecDeque::pop_front);
        let Some(work) = next else {
            self.state = SolverState::Done;
            return Ok(());
        };
        match work {
            AgendaItem::Expand { table, rule } => self.expand(database, table, rule)?,
            AgendaItem::Feed(number) => {
                let consumer = &self.consumers[number as usize];
                let (table, at, rank) = (consumer.table, consumer.at, consumer.rank);
                let variables = consumer.variables.clone();
                let continuation = consumer.continuation.clone();
                let next = continuation.goal;
                self.resume(continuation);
                self.state = SolverState::Back;
                let consumer = Some(number);
                self.choices.push(Choice::Table { table, at, variables, consumer, trail: 0, rank, next });
            }
            AgendaItem::Resume(continuation) => {
                let goal = continuation.goal;
                self.resume(continuation);
                self.state = SolverState::Goal(goal);
            }
        }
        Ok(())
    }

    fn resume(&mut self, continuation: Continuation) {
        self.sink = continuation.sink;
        self.stratum = self.stratum_of(continuation.sink);
        self.bindings.clear();
        self.bindings.extend_from_slice(&continuation.bindings);
        if !continuation.keys.is_empty() {
            self.keys.copy_from_slice(&continuation.keys);
        }
    }

    /// Begins to find the answers of a table: from its facts first, then from one rule after the other.
    fn expand(&mut self, database: &mut Database, table: u32, rule: usize) -> Result<(), QueryError> {
        let answers = &self.tables[table as usize];
        let (stratum, predicate) = (answers.stratum, answers.predicate);
        let call = answers.call.clone();
        let width = answers.width;
        let Predicate { functor, rules, .. } = &self.rules.predicates[predicate];
        self.stratum = stratum;
        self.state = SolverState::Back;
        if rule == 0 {
            let pattern = Pattern { rank: 0, functor: *functor, arguments: call.into(), tail: Term::NIL };
            self.set_aside(AgendaItem::Expand { table, rule: 1 }, stratum);
            let Some(relation) = database.find_relation(pattern.functor, pattern.arguments.len()) else {
                return Ok(());
            };
            self.sink = self.sinks.len() as u32;
            self.sinks.push(Sink::Facts(table));
            self.bindings.clear();
            self.bindings.resize(width, Term::UNBOUND);
            let pattern = Arc::new(pattern);
            self.goals.push(Goal::Match { pattern, relation: Some(relation), next: SOLVED });
            self.state = SolverState::Goal(self.goals.len() as GoalId - 1);
            return Ok(());
        }
        let Some(found) = rules.get(rule - 1).cloned() else { return Ok(()) };
        if rule < rules.len() {
            self.set_aside(AgendaItem::Expand { table, rule: rule + 1 }, stratum);
        }
        self.bindings.clear();
        self.bindings.resize(found.names.len(), Term::UNBOUND);
        let mut given = 0_u64;
        for (position, (&head, &part)) in found.head.arguments.iter().zip(&call).enumerate() {
            if !database.terms.is_ground(part) {
                continue;
            }
            if position < INDEXED_POSITIONS {
                given |= 1 << position;
            }
            if !database.terms.matches(head, part, &mut self.bindings, &mut self.trail) {
                return Ok(());
            }
        }
        self.sink = self.sinks.len() as u32;
        let start = self.rule_start(database, predicate, rule - 1, given, &found);
        self.sinks.push(Sink::Rule(table, found));
        self.state = SolverState::Goal(start);
        Ok(())
    }

    /// Returns the first goal of a rule's body, for given arguments.
    fn rule_start(
        &mut self,
        database: &Database,
        predicate: usize,
        number: usize,
        given: u64,
        rule: &Arc<Rule>,
    ) -> GoalId {
        if let Some(&start) = self.rule_goals.get(&(predicate, number, given)) {
            return start;
        }
        let mut bound: Vec<bool> = self.bindings.iter().map(|term| !term.is_unbound()).collect();
        let rules = self.rules.clone();
        let mut planner =
            Planner { database, rules: &rules, goals: &mut self.goals, is_reordered: false, work: 0 };
        let start = planner.plan(&rule.body, &mut bound, SOLVED);
        self.rule_goals.insert((predicate, number, given), start);
        start
    }

    /// Handles an answer.
    fn solved(&mut self, database: &mut Database) -> Result<(), QueryError> {
        let Query { sinks, sink, tables, bindings, held, .. } = self;
        let (table, rule) = match &sinks[*sink as usize] {
            Sink::Query => {
                self.answer();
                return Ok(());
            }
            Sink::Facts(table) => (*table, None),
            Sink::Rule(table, rule) => (*table, Some(rule)),
        };
        let Answers { call, tuples, width, .. } = &mut tables[table as usize];
        let width = *width;
        let is_new = match rule {
            None => tuples.insert(bindings[..width].iter().copied()),
            Some(rule) => {
                let mut values: SmallVec<[Term; 4]> = SmallVec::from_elem(Term::UNBOUND, width);
                let mut bound = Vec::new();
                for (&head, &part) in rule.head.arguments.iter().zip(&*call) {
                    if database.terms.is_ground(part) {
                        continue;
                    }
                    let Some(term) = database.terms.instantiate(head, bindings, held)? else {
                        return Err(QueryError::Unbound(rule.head.functor));
                    };
                    if let Some(place) = part.as_variable().map(|variable| &mut values[variable])
                        && place.is_unbound()
                    {
                        *place = term;
                    } else if !database.terms.matches(part, term, &mut values, &mut bound) {
                        return Ok(());
                    }
                }
                tuples.insert(values.into_iter())
            }
        };
        if is_new {
            self.table_bytes += 8 * width + 12;
            self.wake_consumers(table);
        }
        Ok(())
    }

    fn wake_consumers(&mut self, table: u32) {
        for at in 0..self.tables[table as usize].consumers.len() {
            let number = self.tables[table as usize].consumers[at];
            let consumer = &mut self.consumers[number as usize];
            if consumer.is_idle {
                consumer.is_idle = false;
                let stratum = self.stratum_of(self.consumers[number as usize].continuation.sink);
                self.set_aside(AgendaItem::Feed(number), stratum);
            }
        }
    }
}

/// Least work of a step; with less, some goals would make no progress.
const LEAST_WORK: usize = 4;

/// Goal at the end of a query or rule.
const SOLVED: GoalId = 0;
