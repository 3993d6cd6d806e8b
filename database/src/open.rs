//! Open queries: a question is asked, goes on in steps, gives its answers, and is closed.

use esl_heap::Value;
use esl_heap::heap::{AllocError, Heap, Holder};

use super::query::QueryRoom;
use super::{Database, Effort, FormulaError, Progress, Query, QueryError};

impl Database {
    /// Begins a query (see `Query::begin`) and returns its number.
    ///
    /// # Errors
    /// [`FormulaError`] unless it is a query and there is room.
    pub fn open(
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

    /// Runs a query until the effort is used up or the query needs something. `None` if it is not open.
    pub fn step(&mut self, key: u64, effort: &mut Effort) -> Option<Result<Progress, QueryError>> {
        let mut query = self.queries.get_mut(&key)?.take()?;
        let before = query.bytes();
        let progress = query.step(self, effort);
        self.bytes += query.bytes();
        self.bytes -= before;
        self.queries.insert(key, Some(query));
        Some(progress)
    }

    /// Gives a query the outcome of the test that it has requested.
    #[inline]
    pub fn tell(&mut self, key: u64, holds: bool) {
        if let Some(Some(query)) = self.queries.get_mut(&key) {
            query.tell(holds);
        }
    }

    /// Returns the next answers, as lists of bindings; the empty list at the end. `None` if the query is not
    /// open.
    ///
    /// # Errors
    /// As for every allocation; then no answer is taken.
    pub fn answers(
        &mut self,
        heap: &mut Heap,
        key: u64,
        work: &mut usize,
    ) -> Option<Result<Value, AllocError>> {
        let query = self.queries.get_mut(&key)?.as_mut()?;
        let terms = &self.terms;
        let mut take = || -> Result<(Value, usize), AllocError> {
            let mut answers = Vec::with_capacity((query.tuples.len() - query.taken).min(PORTION));
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
    pub fn retract_next(
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
    #[inline]
    pub fn has_all_given(&self, key: u64) -> bool {
        let query = self.queries.get(&key).and_then(Option::as_ref);
        query.is_none_or(|query| query.taken == query.tuples.len())
    }

    /// Closes a query.
    pub fn close(&mut self, heap: &mut Heap, key: u64) {
        let Some(Some(mut query)) = self.queries.remove(&key) else { return };
        self.bytes -= query.bytes();
        self.released.push(std::mem::take(&mut query.held));
        self.room = QueryRoom::of(*query);
        self.tidy(heap);
    }
}

/// Greatest number of answers taken in one step.
const PORTION: usize = 128;
