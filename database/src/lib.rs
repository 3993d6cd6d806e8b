//! The logical database: facts, rules, and queries over them.
//!
//! ```text
//! term      contents of facts          relation   facts and their indexes    bucket   hashing
//! formula   queries as written         rule       rules and their strata     plan     the order of goals
//! query     from question to answers   solver     running goals              scan     several relations
//! tuple     sets of answers            facts      changes of facts           open     queries that are open
//! effort    work, as it is charged
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

#![forbid(unsafe_code)]

mod bucket;
mod effort;
mod facts;
mod formula;
mod index;
mod open;
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

stored! { EndedFact { relation, row, serial } }
stored! { Database {
    terms, relations, by_name, rules, time, facts, bytes, serial, ended, unlinked, released, retired, cells,
} with { queries: BTreeMap::new(), room: QueryRoom::default() } }

#[cfg(test)]
mod tests;

use esl_heap::stored;
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use esl_heap::Value;
use esl_heap::heap::{AllocError, Heap, Holder};
use esl_heap::list_state;

use bucket::Buckets;
pub use effort::Effort;
pub use formula::FormulaError;
use formula::FormulaParser;
use query::Query;
use query::QueryRoom;
pub use query::{Progress, QueryError};
use relation::Relation;
use rule::{Rule, Rules};
pub use survey::{Describe, RelationFigures, TermContents};
pub use term::Term;
use term::Terms;

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
pub struct Database {
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
    /// Lists of the query that was closed last.
    room: QueryRoom,
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
    room: Derived,
} }

impl Database {
    /// Returns a copy; `None` while a query is open.
    pub fn copy(&self) -> Option<Database> {
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
            room: QueryRoom::default(),
        })
    }

    /// Returns the number of facts.
    fn facts(&self) -> usize {
        self.facts
    }

    /// Makes the table of objects if there is none yet; the caller keeps the returned object from being
    /// collected.
    pub fn prepare(&mut self, heap: &mut Heap) -> Result<Option<Value>, AllocError> {
        self.terms.make_object_table(heap)
    }

    /// Adds a rule; it replaces a rule made from the same source.
    ///
    /// # Errors
    /// [`FormulaError`] unless it is a rule and there is room.
    pub fn define_rule(
        &mut self,
        heap: &mut Heap,
        [head_text, body, source]: [Value; 3],
        work: &mut usize,
    ) -> Result<(), FormulaError> {
        self.tidy(heap);
        self.check_room(heap)?;
        let mut parser = FormulaParser::new(&mut self.terms, heap, head_text);
        let parsed = parser
            .pattern(head_text)
            .and_then(|head| Ok((head, parser.formula(body, 0)?, parser.text(source)?)));
        *work += 4 * parser.work();
        let FormulaParser { held, names, .. } = parser;
        *work += self.terms.take_work();
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
            return Err(FormulaError::Malformed(head_text, "the head of a rule, which is not a property"));
        }
        let rule = Rule { head, body, names, source, held };
        *work += self.rules_to_copy();
        self.bytes += rule.bytes();
        if let Some(replaced) = Arc::make_mut(&mut self.rules).add(rule, work) {
            self.bytes -= replaced.bytes();
            self.retired.push_back((self.serial, replaced.held.clone()));
        }
        Ok(())
    }

    /// Removes the rule made from this source, as it is written. Returns whether there was one.
    ///
    /// # Errors
    /// [`FormulaError`] if the source is not that of a rule, or there is no room for its terms.
    pub fn remove_rule(
        &mut self,
        heap: &mut Heap,
        source: Value,
        work: &mut usize,
    ) -> Result<bool, FormulaError> {
        self.tidy(heap);
        let mut parser = FormulaParser::new(&mut self.terms, heap, source);
        let text = parser.text(source);
        *work += 4 * parser.work();
        let FormulaParser { held, .. } = parser;
        *work += self.terms.take_work();
        *work += self.rules_to_copy();
        let rules = Arc::make_mut(&mut self.rules);
        let removed = text.as_ref().ok().and_then(|&source| rules.remove(source, work));
        held.into_iter().for_each(|term| self.terms.release(term));
        if let Some(rule) = &removed {
            self.bytes -= rule.bytes();
            self.retired.push_back((self.serial, rule.held.clone()));
        }
        text.map(|_| removed.is_some())
    }

    /// Returns the number of predicates and rules that a change of the rules copies for an open query.
    fn rules_to_copy(&self) -> usize {
        if Arc::strong_count(&self.rules) == 1 {
            return 0;
        }
        self.rules.predicates.iter().map(|predicate| 1 + predicate.rules.len() / 8).sum()
    }

    // ---- terms and room

    /// Returns the object of a term. Adds the work done to `work`.
    ///
    /// # Errors
    /// As for every allocation.
    #[inline]
    pub fn value(&self, heap: &mut Heap, term: Term, work: &mut usize) -> Result<Value, AllocError> {
        self.terms.value(heap, term, work)
    }

    /// Checks that there is room for the database's bytes.
    ///
    /// # Errors
    /// As for every allocation.
    #[inline]
    pub fn check_room(&self, heap: &mut Heap) -> Result<(), AllocError> {
        heap.set_external(Holder::Facts, self.footprint())
    }

    // ---- telling states apart

    /// Returns whether no query is open.
    #[inline]
    pub fn is_quiet(&self) -> bool {
        self.queries.is_empty()
    }

    /// Calls `visit` with words and objects that determine the facts and rules, and their order.
    pub fn visit_state(&self, visit: &mut dyn FnMut(Result<u64, Value>)) {
        // Without `..`: a new field does not compile until it is handled here.
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
            room: _,
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
    #[inline]
    pub fn footprint(&self) -> usize {
        self.bytes + self.terms.bytes
    }

    /// Releases some rows and terms that are no longer needed. Each change does a little of this.
    #[inline]
    fn tidy(&mut self, heap: &mut Heap) {
        let is_tidy = self.ended.is_empty()
            && self.unlinked.is_empty()
            && self.retired.is_empty()
            && self.released.is_empty();
        if !is_tidy {
            self.release_some();
        }
        self.terms.sweep(heap, 8 * FREED_AT_ONCE);
    }

    fn release_some(&mut self) {
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
            let (before, bytes) = relation.recount();
            self.bytes = self.bytes + bytes - before;
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
    }
}

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
