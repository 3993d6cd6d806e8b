//! The logical database: facts, rules, and queries over them.
//!
//! ```text
//! term      contents of facts          relation   facts and their indexes    bucket   hashing
//! formula   queries as written         rule       rules and their strata     plan     the order of goals
//! query     from question to answers   solver     running goals              scan     several relations
//! tuple     sets of answers
//! ```
//!
//! Guarantees: a query sees the facts as they were when it began, whatever happens meanwhile. No single
//! operation takes time in proportion to the number of facts; what does (making an index, a query) is done in
//! steps. Facts cost the collector nothing (see `term`), and their bytes count against the limit of the heap.
//!
//! Changes are numbered, and a fact has the numbers of the changes that made and ended it. A fact that has
//! ended stays until all queries that were open then have closed; then it leaves its chains. When all queries
//! that were open at that moment have closed, none has its cursor on the fact any more, and its row is free.
//!
//! Not here: the language's forms and the event of changes, which are ESL in `stdlib/database.esl`.
//!
//! Source: Gat 1997, section 5. The view of a query is the logical update view of Prolog (Lindholm and
//! O'Keefe 1987).

mod bucket;
mod formula;
mod plan;
mod query;
mod relation;
mod rule;
mod scan;
mod solver;
mod survey;
mod tabling;
mod term;
mod tuple;

#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use esl_heap::list_state;

use crate::heap::{AllocError, Heap, Holder};
use crate::value::Value;
use bucket::{Buckets, finish, mix};
pub(crate) use formula::FormulaError;
use formula::FormulaParser;
pub(crate) use query::{Progress, Query, QueryError};
use relation::Relation;
use rule::{Rule, Rules};
pub(crate) use term::Term;
use term::Terms;

/// Greatest number of answers taken in one step.
const PORTION: usize = 128;
/// Greatest number of rows freed by one operation.
const FREED_AT_ONCE: usize = 8;

/// A fact that has ended, and the number of the query to be opened next at that time. Open queries with
/// smaller numbers may see it.
#[derive(Clone, Copy, Debug)]
struct EndedFact {
    relation: u32,
    row: u32,
    serial: u64,
}

/// The facts and rules of a machine, and its open queries.
#[derive(Debug, Default)]
pub(crate) struct Database {
    terms: Terms,
    relations: Vec<Relation>,
    /// Relations by functor and width.
    by_name: Buckets,
    rules: Arc<Rules>,
    /// Number of the latest change.
    time: u64,
    facts: usize,
    /// Bytes of facts, approximately.
    bytes: usize,

    // ---- queries
    /// Open queries, by number; `None` while a query works on the database.
    queries: BTreeMap<u64, Option<Box<Query>>>,
    /// Number of the query to be opened next.
    serial: u64,
    /// Facts that have ended, still in their chains.
    ended: VecDeque<EndedFact>,
    /// Facts that have ended and left their chains.
    unlinked: VecDeque<EndedFact>,
    /// Terms of closed queries, to be released.
    released: Vec<Vec<Term>>,
    /// Terms of replaced rules, each with the number of the query to be opened next at that time.
    retired: VecDeque<(u64, Vec<Term>)>,
    cells: Vec<Term>,
}

list_state! { Database {
    terms: Visited,
    relations: Visited,
    by_name: Derived,
    rules: Visited,
    time: Run,
    facts: Derived,
    bytes: Derived,
    queries: Visited,
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
    /// Returns a copy; `None` while a query is open.
    pub(crate) fn copy(&self) -> Option<Database> {
        self.queries.is_empty().then(|| Database {
            terms: self.terms.clone(),
            relations: self.relations.clone(),
            by_name: self.by_name.clone(),
            rules: self.rules.clone(),
            time: self.time,
            facts: self.facts,
            bytes: self.bytes,
            queries: BTreeMap::new(),
            serial: self.serial,
            ended: self.ended.clone(),
            unlinked: self.unlinked.clone(),
            released: self.released.clone(),
            retired: self.retired.clone(),
            cells: Vec::new(),
        })
    }

    /// Returns the number of facts.
    fn facts(&self) -> usize {
        self.facts
    }

    /// Makes the table of objects if there is none yet; the caller keeps the returned object from being
    /// collected.
    pub(crate) fn prepare(&mut self, heap: &mut Heap) -> Result<Option<Value>, AllocError> {
        self.terms.make_object_table(heap)
    }

    fn find_relation(&self, functor: Term, width: usize) -> Option<u32> {
        self.by_name.find(name_hash(functor, width), |at| {
            let relation = &self.relations[at as usize];
            relation.functor == functor && relation.width == width
        })
    }

    /// Adds a fact. Returns `T` if it is new, `NIL` if it is there already, and the replaced fact if it is
    /// the value of a property. Adds the work done to `work`.
    ///
    /// # Errors
    /// [`FormulaError`] unless it is a fact and there is room; then nothing has changed.
    pub(crate) fn assert(
        &mut self,
        heap: &mut Heap,
        fact: Value,
        work: &mut usize,
    ) -> Result<Value, FormulaError> {
        self.tidy(heap);
        heap.set_external(Holder::Facts, self.footprint())?;
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
        // A relation is permanent, and holds its functor.
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

    /// Returns the fact of a row as a list.
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

    /// Makes the last of the `width` arguments of facts of this name unique for given others. Returns false
    /// if there are rules for such facts.
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

    /// Returns the value of a property for given arguments, unbound if there is none.
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

    /// Removes a fact. Returns whether it was there.
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

    /// Adds a rule; it replaces a rule made from the same source.
    ///
    /// # Errors
    /// [`FormulaError`] unless it is a rule and there is room.
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

    // ---- queries

    /// Begins a query (see [`Query::begin`]) and returns its number.
    ///
    /// # Errors
    /// [`FormulaError`] unless it is a query and there is room.
    pub(crate) fn open(
        &mut self,
        heap: &mut Heap,
        query: Value,
        inherited: Value,
        wants_facts: bool,
        work: &mut usize,
    ) -> Result<u64, FormulaError> {
        self.tidy(heap);
        heap.set_external(Holder::Facts, self.footprint())?;
        let query = Query::begin(self, heap, query, inherited, wants_facts, work)?;
        let number = self.serial;
        self.serial += 1;
        self.bytes += query.bytes();
        self.queries.insert(number, Some(Box::new(query)));
        Ok(number)
    }

    /// Runs a query until `work` is used up or the query needs something. `None` if it is not open.
    pub(crate) fn step(&mut self, key: u64, work: &mut usize) -> Option<Result<Progress, QueryError>> {
        let mut query = self.queries.get_mut(&key)?.take()?;
        let before = query.bytes();
        let progress = query.step(self, work);
        self.bytes += query.bytes();
        self.bytes -= before;
        self.queries.insert(key, Some(query));
        Some(progress)
    }

    /// Gives a query the outcome of the test that it has requested.
    pub(crate) fn tell(&mut self, key: u64, holds: bool) {
        if let Some(Some(query)) = self.queries.get_mut(&key) {
            query.tell(holds);
        }
    }

    /// Returns the next answers, as lists of bindings; the empty list at the end. `None` if the query is not
    /// open.
    ///
    /// # Errors
    /// As for every allocation; then no answer is taken.
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

    /// Removes the next fact that a query has found, if it is still there, and returns it; `NIL` at the end,
    /// `T` if there is more to be looked at. `None` if the query is not open.
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
                // The fact remains the next one.
                Err(_) => self.queries.get_mut(&key)?.as_mut()?.taken -= 1,
            }
            return Some(fact);
        }
    }

    /// Returns whether all answers found by a query were taken.
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

    /// Returns the object of a term.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn value(&self, heap: &mut Heap, term: Term) -> Result<Value, AllocError> {
        self.terms.value(heap, term, &mut 0)
    }

    /// Checks that there is room for the database's bytes.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn check_room(&self, heap: &mut Heap) -> Result<(), AllocError> {
        heap.set_external(Holder::Facts, self.footprint())
    }

    // ---- telling states apart

    /// Returns whether no query is open.
    pub(crate) fn is_quiet(&self) -> bool {
        self.queries.is_empty()
    }

    /// Calls `visit` with words and objects that determine the facts and rules, and their order.
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

    // ---- upkeep

    /// Returns the bytes that the database takes, approximately.
    pub(crate) fn footprint(&self) -> usize {
        self.bytes + self.terms.bytes
    }

    /// Releases some rows and terms that are no longer needed. Each change does a little of this.
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
