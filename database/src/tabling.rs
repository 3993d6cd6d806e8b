//! Tables of derived facts: their consumers, the agenda of what waits for them, and the application of rules.
//!
//! See `solver` for how goals and tables work together.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use smallvec::SmallVec;

use super::Database;
use super::bucket::{finish, mix};
use super::effort::Effort;
use super::formula::Pattern;
use super::plan::{Goal, GoalId, Planner};
use super::query::{AgendaItem, Answers, Consumer, Continuation, Query, QueryError, Sink};
use super::relation::INDEXED_POSITIONS;
use super::rule::{NO_STRATUM, Predicate, Rule};
use super::solver::{Choice, SOLVED, SolverState};
use super::term::Term;
use super::tuple::Tuples;

/// Number of variables of a call up to which they are searched for one by one.
const FEW_VARIABLES: usize = 8;
/// Bytes that a table takes besides its call and its answers: its destinations and the goal of its facts.
const TABLE_BYTES: usize = 256;

impl Query {
    pub(super) fn continuation(&self, goal: GoalId) -> Continuation {
        let keys =
            if self.is_reordered && self.sink == 0 { self.keys.clone().into() } else { Box::default() };
        Continuation { goal, sink: self.sink, bindings: self.bindings.clone().into(), keys }
    }

    pub(super) fn set_aside(&mut self, work: AgendaItem, stratum: usize) {
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
    pub(super) fn call(
        &mut self,
        database: &mut Database,
        pattern: &Pattern,
        predicate: usize,
        next: GoalId,
        effort: &mut Effort,
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
        if !database.terms.matches(pattern.functor, functor, bindings, trail, effort) {
            self.undo(before);
            return Ok(());
        }
        let mut variables: SmallVec<[u32; 4]> = SmallVec::new();
        let mut numbers: BTreeMap<usize, usize> = BTreeMap::new();
        let mut number = |variable: usize| {
            let known = match variables.len() {
                ..=FEW_VARIABLES => variables.iter().position(|&other| other as usize == variable),
                _ => numbers.get(&variable).copied(),
            };
            known.unwrap_or_else(|| {
                variables.push(variable as u32);
                if variables.len() > FEW_VARIABLES {
                    let all = variables.iter().enumerate();
                    let missing = all.skip(numbers.len()).map(|(at, &variable)| (variable as usize, at));
                    numbers.extend(missing);
                }
                variables.len() - 1
            })
        };
        effort.spend_cells(2 * width);
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
            let part = database.terms.rebuild(argument, held, effort, &mut |variable| {
                let term = bindings[variable];
                Some(if term.is_unbound() { Term::variable(number(variable) as u32) } else { term })
            })?;
            call.push(part.unwrap_or(Term::NIL));
        }
        let table = self.table(predicate, call, variables.len());
        self.consume(table, variables, pattern.rank, next, before, effort);
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
        self.table_bytes += size_of::<Answers>() + 16 * call.len() + TABLE_BYTES;
        self.tables.push(Answers { predicate, call, stratum, width, tuples, idle: Vec::new() });
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
        effort: &mut Effort,
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
        effort.spend_cells(self.bindings.len());
        self.waiting_bytes += size_of::<Consumer>() + continuation.bytes() + 4 * variables.len();
        self.undo(before);
        let consumer = self.consumers.len() as u32;
        self.consumers.push(Consumer { table, at: 0, variables, continuation, rank });
        let answers = &mut self.tables[table as usize];
        if answers.tuples.len() == 0 {
            answers.idle.push(consumer);
        } else {
            self.set_aside(AgendaItem::Feed(consumer), self.stratum);
        }
    }

    /// Continues with the next answer of the table of the latest choice.
    pub(super) fn next_table_answer(&mut self, effort: &mut Effort) {
        let Query { choices, tables, consumers, bindings, trail: bound, .. } = self;
        let Some(Choice::Table { table, at, variables, consumer, trail, rank, next }) = choices.last_mut()
        else {
            unreachable!("answers of a table")
        };
        for variable in bound.drain(*trail..) {
            bindings[variable as usize] = Term::UNBOUND;
        }
        let Answers { tuples, idle, .. } = &mut tables[*table as usize];
        if *at >= tuples.len() {
            if let Some(consumer) = *consumer {
                consumers[consumer as usize].at = *at;
                idle.push(consumer);
            }
            choices.pop();
            return;
        }
        let answer = tuples.get(*at);
        effort.spend_cells(variables.len());
        // An answer has a value for each of the variables.
        for (position, &variable) in variables.iter().enumerate() {
            bindings[variable as usize] = answer[position];
            bound.push(variable);
        }
        let (rank, key, next) = (*rank, *at as u64, *next);
        *at += 1;
        self.set_key(rank, key);
        self.state = SolverState::Goal(next);
    }

    /// Takes up the next piece of work, from the lowest stratum that has some.
    pub(super) fn next_work(
        &mut self,
        database: &mut Database,
        effort: &mut Effort,
    ) -> Result<(), QueryError> {
        self.trail.clear();
        self.operations.clear();
        let next = self.agenda.iter_mut().find_map(VecDeque::pop_front);
        let Some(work) = next else {
            self.state = SolverState::Done;
            return Ok(());
        };
        match work {
            AgendaItem::Expand { table, rule } => self.expand(database, table, rule, effort)?,
            AgendaItem::Feed(number) => {
                let consumer = &self.consumers[number as usize];
                let (table, at, rank) = (consumer.table, consumer.at, consumer.rank);
                let variables = consumer.variables.clone();
                let continuation = consumer.continuation.clone();
                effort.spend_cells(2 * continuation.bindings.len() + continuation.keys.len());
                let next = continuation.goal;
                self.resume(continuation);
                self.state = SolverState::Back;
                let consumer = Some(number);
                self.choices.push(Choice::Table { table, at, variables, consumer, trail: 0, rank, next });
            }
            AgendaItem::Resume(continuation) => {
                let goal = continuation.goal;
                effort.spend_cells(continuation.bindings.len());
                self.waiting_bytes -= continuation.bytes();
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
    fn expand(
        &mut self,
        database: &mut Database,
        table: u32,
        rule: usize,
        effort: &mut Effort,
    ) -> Result<(), QueryError> {
        let answers = &self.tables[table as usize];
        let (stratum, predicate) = (answers.stratum, answers.predicate);
        let call = answers.call.clone();
        let width = answers.width;
        effort.spend_cells(2 * call.len());
        let Predicate { functor, rules, .. } = &self.rules.predicates[predicate];
        self.stratum = stratum;
        self.state = SolverState::Back;
        if rule == 0 {
            let pattern = Pattern::new(0, *functor, call.into(), Term::NIL);
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
        effort.spend_cells(found.names.len());
        let mut given = 0_u64;
        for (position, (&head, &part)) in found.head.arguments.iter().zip(&call).enumerate() {
            if !database.terms.is_ground(part) {
                continue;
            }
            if position < INDEXED_POSITIONS {
                given |= 1 << position;
            }
            if !database.terms.matches(head, part, &mut self.bindings, &mut self.trail, effort) {
                return Ok(());
            }
        }
        self.sink = self.sinks.len() as u32;
        let start = self.rule_start(database, predicate, rule - 1, given, &found, effort);
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
        effort: &mut Effort,
    ) -> GoalId {
        if let Some(&start) = self.rule_goals.get(&(predicate, number, given)) {
            return start;
        }
        let mut bound: Vec<bool> = self.bindings.iter().map(|term| !term.is_unbound()).collect();
        let rules = self.rules.clone();
        let mut planner =
            Planner { database, rules: &rules, goals: &mut self.goals, is_reordered: false, work: 0 };
        let start = planner.plan(&rule.body, &mut bound, SOLVED);
        // As much as for the planning of a query.
        effort.spend(4 * planner.work);
        self.table_bytes += 16 * planner.work;
        self.rule_goals.insert((predicate, number, given), start);
        start
    }

    /// Handles an answer.
    pub(super) fn solved(&mut self, database: &mut Database, effort: &mut Effort) -> Result<(), QueryError> {
        let Query { sinks, sink, tables, bindings, held, .. } = self;
        let (table, rule) = match &sinks[*sink as usize] {
            Sink::Query => {
                self.answer(effort);
                return Ok(());
            }
            Sink::Facts(table) => (*table, None),
            Sink::Rule(table, rule) => (*table, Some(rule)),
        };
        let Answers { call, tuples, width, .. } = &mut tables[table as usize];
        let width = *width;
        effort.spend_cells(2 * call.len());
        let is_new = match rule {
            None => tuples.insert(bindings[..width].iter().copied()),
            Some(rule) => {
                let mut values: SmallVec<[Term; 4]> = SmallVec::from_elem(Term::UNBOUND, width);
                let mut bound = Vec::new();
                for (&head, &part) in rule.head.arguments.iter().zip(&*call) {
                    if database.terms.is_ground(part) {
                        continue;
                    }
                    let Some(term) = database.terms.instantiate(head, bindings, held, effort)? else {
                        return Err(QueryError::Unbound(rule.head.functor));
                    };
                    if let Some(place) = part.as_variable().map(|variable| &mut values[variable])
                        && place.is_unbound()
                    {
                        *place = term;
                    } else if !database.terms.matches(part, term, &mut values, &mut bound, effort) {
                        return Ok(());
                    }
                }
                tuples.insert(values.iter().copied())
            }
        };
        if is_new {
            self.table_bytes += 8 * width + 12;
            self.wake_consumers(table);
        }
        Ok(())
    }

    /// Has those go on that wait for answers of a table. Each of them takes work before it waits again, so
    /// their number needs no account.
    fn wake_consumers(&mut self, table: u32) {
        let mut idle = std::mem::take(&mut self.tables[table as usize].idle);
        idle.sort_unstable();
        for number in idle.drain(..) {
            let stratum = self.stratum_of(self.consumers[number as usize].continuation.sink);
            self.set_aside(AgendaItem::Feed(number), stratum);
        }
        // None has come to wait meanwhile.
        self.tables[table as usize].idle = idle;
    }
}
