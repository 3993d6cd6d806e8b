//! The logical database: facts, rules, and queries over them.
//!
//! ```text
//! term      what facts consist of        relation   facts and their indexes     bucket   hashing
//! formula   queries as written           rule       rules and their strata      plan     the order of goals
//! query     from question to answers     machine    running goals               scan     facts of many relations
//! tuple     sets of answers
//! ```
//!
//! Guarantees: a query sees the facts that there were when it began, whatever happens meanwhile; nothing takes a time in
//! proportion to the number of facts at once, what does (making an index, a query) is done in steps; facts cost the
//! collector nothing (see `term`), and their bytes count against the limit of the heap.
//!
//! Every change has a number, and a fact those of the changes that made and ended it. A fact that has ended stays until all
//! queries have closed that were open then; then it leaves its chains, and when all have closed that were open at that time,
//! nobody stands on it any more, and its place is free.
//!
//! Not here: the language's forms and the event of changes, which are ESL in `stdlib/database.esl`.
//! Source: Gat 1997, section 5. The view of queries is the logical update view of Prolog (Lindholm and O'Keefe 1987).

mod bucket;
mod formula;
mod plan;
mod query;
mod relation;
mod rule;
mod scan;
mod solver;
mod term;
mod tuple;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use esl_heap::list_state;

use crate::heap::{AllocError, Heap};
use crate::value::Value;
use bucket::{Buckets, finish, mix};
pub(crate) use formula::FormulaError;
use formula::FormulaParser;
pub(crate) use query::{Progress, Query, QueryError};
use relation::Relation;
use rule::{Rule, Rules};
pub(crate) use term::Term;
use term::Terms;

/// Answers that one step gives at most.
const PORTION: usize = 128;
/// Places that one operation frees at most.
const FREED_AT_ONCE: usize = 8;

/// A fact that has ended, and the query before which no open one may know it.
#[derive(Clone, Copy, Debug)]
struct EndedFact {
    relation: u32,
    row: u32,
    serial: u64,
}

/// See the module documentation.
#[derive(Debug, Default)]
pub(crate) struct Database {
    terms: Terms,
    relations: Vec<Relation>,
    /// Relations by functor and width.
    by_name: Buckets,
    rules: Arc<Rules>,
    /// The number of the latest change.
    time: u64,
    facts: usize,
    /// Bytes of facts, about.
    bytes: usize,

    // ---- queries
    /// Those that are open, by number; out of its place while it uses the database.
    queries: BTreeMap<u64, Option<Box<Query>>>,
    /// The number of the next query.
    serial: u64,
    /// Facts that have ended and are still in their chains.
    ended: VecDeque<EndedFact>,
    /// Those that have left their chains.
    unlinked: VecDeque<EndedFact>,
    /// Terms to be given up, of queries that were closed.
    released: Vec<Vec<Term>>,
    /// Terms of rules that were replaced, and the query before which no open one may know them.
    retired: VecDeque<(u64, Vec<Term>)>,
    cells: Vec<Term>,
}

list_state! { Database {
    terms: Run,
    relations: Run,
    by_name: Derived,
    rules: Run,
    time: Run,
    facts: Derived,
    bytes: Derived,
    queries: Run,
    serial: Run,
    ended: Derived,
    unlinked: Derived,
    released: Derived,
    retired: Derived,
    cells: Derived,
} }

fn name_hash(functor: Term, width: usize) -> u32 {
    finish(mix(mix(9, functor.bits()), width as u64))
}

impl Database {
    /// Number of facts.
    fn facts(&self) -> usize {
        self.facts
    }

    /// Makes what the database needs of the heap; gives what is to be kept from being collected.
    pub(crate) fn prepare(&mut self, heap: &mut Heap) -> Result<Option<Value>, AllocError> {
        self.terms.make_object_table(heap)
    }

    fn find_relation(&self, functor: Term, width: usize) -> Option<u32> {
        self.by_name.find(name_hash(functor, width), |at| {
            let relation = &self.relations[at as usize];
            relation.functor == functor && relation.width == width
        })
    }

    /// Adds a fact; `T` if it is new, or the fact that it replaces, as the value of a property. `work` is what that took.
    ///
    /// # Errors
    /// [`FormulaError`] if it is no fact, or there is no room; then nothing has changed.
    pub(crate) fn assert(
        &mut self,
        heap: &mut Heap,
        fact: Value,
        work: &mut usize,
    ) -> Result<Value, FormulaError> {
        self.tidy(heap);
        heap.set_external(self.footprint())?;
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        let made = formula::fact(&mut self.terms, heap, fact, &mut cells, work);
        let outcome = made.and_then(|()| self.add(heap, &cells, work));
        self.cells = cells;
        outcome
    }

    fn relation(&mut self, functor: Term, width: usize) -> u32 {
        if let Some(number) = self.find_relation(functor, width) {
            return number;
        }
        let number = self.relations.len() as u32;
        // A relation stays, and holds its functor.
        self.terms.retain(functor);
        self.relations.push(Relation::new(functor, width));
        self.by_name.add(number, name_hash(functor, width));
        self.bytes += size_of::<Relation>();
        number
    }

    /// Adds a fact whose cells are held.
    fn add(&mut self, heap: &mut Heap, cells: &[Term], work: &mut usize) -> Result<Value, FormulaError> {
        let (functor, arguments) = (cells[0], &cells[1..]);
        let number = self.relation(functor, arguments.len());
        self.terms.release(functor);
        let relation = &self.relations[number as usize];
        let mut outcome = Value::T;
        if relation.find(arguments).is_some() {
            outcome = Value::NIL;
        } else if let Some(row) = relation.replaced(arguments) {
            match self.fact_value(heap, number, row, work) {
                Ok(replaced) => outcome = replaced,
                Err(error) => {
                    arguments.iter().for_each(|&term| self.terms.release(term));
                    return Err(error.into());
                }
            }
            self.end(number, row);
        }
        if outcome.is_nil() {
            arguments.iter().for_each(|&term| self.terms.release(term));
            return Ok(outcome);
        }
        self.time += 1;
        let relation = &mut self.relations[number as usize];
        self.bytes += relation.row_bytes();
        relation.add(arguments, self.time);
        self.facts += 1;
        Ok(outcome)
    }

    /// The fact of a row as a list.
    fn fact_value(
        &self,
        heap: &mut Heap,
        number: u32,
        row: u32,
        work: &mut usize,
    ) -> Result<Value, AllocError> {
        let relation = &self.relations[number as usize];
        let mut parts = Vec::with_capacity(relation.width + 1);
        for &cell in [&relation.functor].into_iter().chain(relation.row(row)) {
            parts.push(self.terms.value(heap, cell, work)?);
        }
        heap.list(&parts)
    }

    /// From now on the last of the `width` arguments of facts of this name is unique for given others; false if there are
    /// rules for them.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn define_property(
        &mut self,
        heap: &mut Heap,
        name: Value,
        width: usize,
        work: &mut usize,
    ) -> Result<bool, AllocError> {
        let functor = self.terms.atom(heap, name)?;
        let number = self.relation(functor, width);
        self.terms.release(functor);
        if self.rules.has(functor, width) {
            return Ok(false);
        }
        self.relations[number as usize].make_property(work);
        Ok(true)
    }

    /// The value of a property for given arguments, unbound if there is none.
    ///
    /// # Errors
    /// As for [`Database::assert`].
    pub(crate) fn property_value(
        &mut self,
        heap: &mut Heap,
        arguments: Value,
        work: &mut usize,
    ) -> Result<Value, FormulaError> {
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        let made = formula::fact(&mut self.terms, heap, arguments, &mut cells, work);
        let value = made.and_then(|()| {
            let found = self.find_relation(cells[0], cells.len());
            cells.push(Term::NIL);
            let row = found
                .and_then(|number| Some((number, self.relations[number as usize].replaced(&cells[1..])?)));
            cells.pop();
            cells.iter().for_each(|&term| self.terms.release(term));
            match row {
                Some((number, row)) => {
                    let relation = &self.relations[number as usize];
                    let value = relation.row(row).last().copied().unwrap_or(Term::NIL);
                    Ok(self.terms.value(heap, value, work)?)
                }
                None => Ok(Value::UNBOUND),
            }
        });
        self.cells = cells;
        value
    }

    /// Removes a fact; whether it was there.
    ///
    /// # Errors
    /// As for [`Database::assert`].
    pub(crate) fn retract(
        &mut self,
        heap: &mut Heap,
        fact: Value,
        work: &mut usize,
    ) -> Result<bool, FormulaError> {
        self.tidy(heap);
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        let made = formula::fact(&mut self.terms, heap, fact, &mut cells, work);
        let was_there = made.map(|()| {
            let found = self.find_relation(cells[0], cells.len() - 1);
            let row =
                found.and_then(|number| Some((number, self.relations[number as usize].find(&cells[1..])?)));
            cells.iter().for_each(|&term| self.terms.release(term));
            if let Some((number, row)) = row {
                self.end(number, row);
            }
            row.is_some()
        });
        self.cells = cells;
        was_there
    }

    fn end(&mut self, relation: u32, row: u32) {
        self.time += 1;
        self.relations[relation as usize].end(row, self.time);
        self.facts -= 1;
        self.ended.push_back(EndedFact { relation, row, serial: self.serial });
    }

    /// Adds a rule, unless the very rule is there.
    ///
    /// # Errors
    /// [`FormulaError`] if it is no rule, or there is no room.
    pub(crate) fn define_rule(
        &mut self,
        heap: &mut Heap,
        [head_text, body, source]: [Value; 3],
        work: &mut usize,
    ) -> Result<(), FormulaError> {
        self.tidy(heap);
        let mut parser = FormulaParser::new(&mut self.terms, heap, head_text);
        let parsed = parser
            .pattern(head_text)
            .and_then(|head| Ok((head, parser.formula(body, 0)?, parser.text(source)?)));
        *work += 4 * parser.work();
        let FormulaParser { held, names, .. } = parser;
        let (head, body, source) = match parsed {
            Ok(parts) => parts,
            Err(error) => {
                held.into_iter().for_each(|term| self.terms.release(term));
                return Err(error);
            }
        };
        let relation = self.find_relation(head.functor, head.arguments.len());
        if relation.is_some_and(|number| self.relations[number as usize].is_property()) {
            held.into_iter().for_each(|term| self.terms.release(term));
            return Err(FormulaError::Malformed(head_text, "the head of a rule, which is no property"));
        }
        let rule = Rule { head, body, names, source, held };
        if let Some(replaced) = Arc::make_mut(&mut self.rules).add(rule) {
            self.retired.push_back((self.serial, replaced.held.clone()));
        }
        Ok(())
    }

    // Queries.

    /// Begins a query; see [`Query::begin`].
    ///
    /// # Errors
    /// [`FormulaError`] if it is no query, or there is no room.
    pub(crate) fn open(
        &mut self,
        heap: &mut Heap,
        query: Value,
        inherited: Value,
        wants_facts: bool,
        work: &mut usize,
    ) -> Result<u64, FormulaError> {
        self.tidy(heap);
        heap.set_external(self.footprint())?;
        let query = Query::begin(self, heap, query, inherited, wants_facts, work)?;
        let number = self.serial;
        self.serial += 1;
        self.bytes += query.bytes();
        self.queries.insert(number, Some(Box::new(query)));
        Ok(number)
    }

    /// Works on a query.
    pub(crate) fn step(&mut self, key: u64, work: &mut usize) -> Option<Result<Progress, QueryError>> {
        let mut query = self.queries.get_mut(&key)?.take()?;
        let before = query.bytes();
        let progress = query.step(self, work);
        self.bytes += query.bytes();
        self.bytes -= before;
        self.queries.insert(key, Some(query));
        Some(progress)
    }

    /// Tells a query the outcome of the test that it has asked for.
    pub(crate) fn tell(&mut self, key: u64, holds: bool) {
        if let Some(Some(query)) = self.queries.get_mut(&key) {
            query.tell(holds);
        }
    }

    /// The next answers: lists of bindings. `None` for a query that is not open; an empty list at the end.
    ///
    /// # Errors
    /// As for every allocation; then none is taken.
    pub(crate) fn answers(
        &mut self,
        heap: &mut Heap,
        key: u64,
        work: &mut usize,
    ) -> Option<Result<Value, AllocError>> {
        let query = self.queries.get_mut(&key)?.as_mut()?;
        let terms = &self.terms;
        let mut take = || -> Result<(Value, usize), AllocError> {
            let mut answers = Vec::with_capacity(PORTION);
            let mut bindings = Vec::new();
            while let Some(answer) = query.next_answer(answers.len()) {
                bindings.clear();
                for (name, value) in answer {
                    let name = terms.value(heap, name, work)?;
                    let value = terms.value(heap, value, work)?;
                    *work += 1;
                    bindings.push(heap.cons(name, value)?);
                }
                answers.push(heap.list(&bindings)?);
                if answers.len() == PORTION || *work > 32 * PORTION {
                    break;
                }
            }
            Ok((heap.list(&answers)?, answers.len()))
        };
        let taken = take();
        if let Ok((_, count)) = taken {
            query.taken += count;
        }
        Some(taken.map(|(list, _)| list))
    }

    /// Removes the next fact that a query has found and that is still there, and gives it; `NIL` at the end, `T` to be asked
    /// again.
    ///
    /// # Errors
    /// As for every allocation; then nothing is removed.
    pub(crate) fn retract_next(
        &mut self,
        heap: &mut Heap,
        key: u64,
        work: &mut usize,
    ) -> Option<Result<Value, AllocError>> {
        self.tidy(heap);
        let query = self.queries.get_mut(&key)?.as_mut()?;
        loop {
            let Some(&(number, row)) = query.rows.as_ref().and_then(|rows| rows.get(query.taken)) else {
                return Some(Ok(Value::NIL));
            };
            *work += 1;
            let relation = &self.relations[number as usize];
            if !relation.is_live(row) {
                query.taken += 1;
                if *work > 8 * PORTION {
                    return Some(Ok(Value::T));
                }
                continue;
            }
            query.taken += 1;
            let fact = self.fact_value(heap, number, row, work);
            match fact {
                Ok(_) => self.end(number, row),
                // It is the next one still.
                Err(_) => self.queries.get_mut(&key)?.as_mut()?.taken -= 1,
            }
            return Some(fact);
        }
    }

    /// Whether all answers that a query has found were taken.
    pub(crate) fn has_all_given(&self, key: u64) -> bool {
        let query = self.queries.get(&key).and_then(Option::as_ref);
        query.is_none_or(|query| query.taken == query.tuples.len())
    }

    /// Closes a query.
    pub(crate) fn close(&mut self, heap: &mut Heap, key: u64) {
        let Some(Some(mut query)) = self.queries.remove(&key) else { return };
        self.bytes -= query.bytes();
        self.released.push(std::mem::take(&mut query.held));
        self.tidy(heap);
    }

    /// The object of a term.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn value(&self, heap: &mut Heap, term: Term) -> Result<Value, AllocError> {
        self.terms.value(heap, term, &mut 0)
    }

    /// Whether there is room for what the database has.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn check_room(&self, heap: &mut Heap) -> Result<(), AllocError> {
        heap.set_external(self.footprint())
    }

    // For those who look at states.

    /// Whether no query is open.
    pub(crate) fn is_quiet(&self) -> bool {
        self.queries.is_empty()
    }

    /// Calls `visit` with words and objects that say which facts and rules there are, and in which order they came.
    pub(crate) fn visit_state(&self, visit: &mut dyn FnMut(Result<u64, Value>)) {
        // Without `..`: a new field does not compile before somebody has thought of it here.
        let Database {
            terms,
            relations,
            rules,
            // Numbers of changes and of queries: how the facts came, not which there are.
            time: _,
            serial: _,
            // While one is open, the caller takes no other state to be like this one.
            queries: _,
            // These follow from the facts and rules, or wait to be given up.
            by_name: _,
            facts: _,
            bytes: _,
            ended: _,
            unlinked: _,
            released: _,
            retired: _,
            cells: _,
        } = self;
        let mut rows: Vec<(u64, &Relation, u32)> = Vec::new();
        for relation in relations {
            rows.extend(relation.live_rows().map(|row| (relation.born(row), relation, row)));
        }
        rows.sort_unstable_by_key(|&(born, ..)| born);
        for (_, relation, row) in rows {
            visit(Ok(relation.width as u64));
            for &term in [&relation.functor].into_iter().chain(relation.row(row)) {
                terms.visit_state(term, visit);
            }
        }
        for rule in rules.predicates.iter().flat_map(|predicate| &predicate.rules) {
            terms.visit_state(rule.source, visit);
        }
        for relation in relations.iter().filter(|relation| relation.is_property()) {
            terms.visit_state(relation.functor, visit);
        }
    }

    // Keeping order.

    /// Bytes that the database takes, about.
    fn footprint(&self) -> usize {
        self.bytes + self.terms.bytes
    }

    /// Does a little of what is to be done sometime: gives back places and terms.
    fn tidy(&mut self, heap: &mut Heap) {
        let oldest = self.queries.keys().next().copied().unwrap_or(u64::MAX);
        for _ in 0..FREED_AT_ONCE {
            let Some(&ended) = self.ended.front() else { break };
            if oldest < ended.serial {
                break;
            }
            self.ended.pop_front();
            self.relations[ended.relation as usize].unlink(ended.row);
            self.unlinked.push_back(EndedFact { serial: self.serial, ..ended });
        }
        for _ in 0..FREED_AT_ONCE {
            let Some(&ended) = self.unlinked.front() else { break };
            if oldest < ended.serial {
                break;
            }
            self.unlinked.pop_front();
            let relation = &mut self.relations[ended.relation as usize];
            relation.free(ended.row);
            self.bytes = self.bytes.saturating_sub(relation.row_bytes());
            for &term in relation.row(ended.row) {
                self.terms.release(term);
            }
        }
        while let Some((_, terms)) = self.retired.pop_front_if(|(serial, _)| oldest >= *serial) {
            self.released.push(terms);
        }
        for _ in 0..4 * FREED_AT_ONCE {
            let Some(terms) = self.released.last_mut() else { break };
            match terms.pop() {
                Some(term) => self.terms.release(term),
                None => _ = self.released.pop(),
            }
        }
        self.terms.sweep(heap, 8 * FREED_AT_ONCE);
    }
}
