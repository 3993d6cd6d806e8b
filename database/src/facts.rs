//! Facts and properties: added, looked up and ended.

use esl_heap::Value;
use esl_heap::heap::{AllocError, Heap, Holder};

use super::bucket::{finish, mix};
use super::formula;
use super::{Database, EndedFact, FormulaError, Relation, Term};

impl Database {
    pub(super) fn find_relation(&self, functor: Term, width: usize) -> Option<u32> {
        self.by_name.find(name_hash(functor, width), |at| {
            let relation = &self.relations[at as usize];
            relation.functor == functor && relation.width == width
        })
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

    /// Adds a fact. Returns `T` if it is new, `NIL` if it is there already, and the replaced fact if it is
    /// the value of a property. Adds the work done to `work`.
    ///
    /// # Errors
    /// [`FormulaError`] unless it is a fact and there is room; then nothing has changed.
    pub fn assert(&mut self, heap: &mut Heap, fact: Value, work: &mut usize) -> Result<Value, FormulaError> {
        self.tidy(heap);
        heap.set_external(Holder::Facts, self.footprint())?;
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        let made = formula::fact(&mut self.terms, heap, fact, &mut cells, work);
        *work += self.terms.take_work();
        let outcome = made.and_then(|()| self.add(heap, &cells, work));
        self.cells = cells;
        outcome
    }

    /// Adds a fact whose cells are held.
    fn add(&mut self, heap: &mut Heap, cells: &[Term], work: &mut usize) -> Result<Value, FormulaError> {
        let (functor, arguments) = (cells[0], &cells[1..]);
        let number = self.relation(functor, arguments.len());
        self.terms.release(functor);
        let relation = &self.relations[number as usize];
        let mut outcome = Value::T;
        if relation.find(arguments, work).is_some() {
            outcome = Value::NIL;
        } else if let Some(row) = relation.replaced(arguments, work) {
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
        relation.add(arguments, self.time);
        let (before, bytes) = relation.recount();
        self.bytes = self.bytes + bytes - before;
        self.facts += 1;
        Ok(outcome)
    }

    /// Returns the fact of a row as a list.
    pub(super) fn fact_value(
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
    pub fn define_property(
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

    /// Facts of this name with `width` arguments are ordinary facts from now on. Those that there are stay.
    ///
    /// # Errors
    /// As for every allocation.
    pub fn drop_property(&mut self, heap: &mut Heap, name: Value, width: usize) -> Result<(), AllocError> {
        let functor = self.terms.atom(heap, name)?;
        if let Some(number) = self.find_relation(functor, width) {
            self.relations[number as usize].drop_property();
        }
        self.terms.release(functor);
        Ok(())
    }

    /// Returns the value of a property for given arguments, unbound if there is none.
    ///
    /// # Errors
    /// As for [`Database::assert`].
    pub fn property_value(
        &mut self,
        heap: &mut Heap,
        arguments: Value,
        work: &mut usize,
    ) -> Result<Value, FormulaError> {
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        let made = formula::fact(&mut self.terms, heap, arguments, &mut cells, work);
        *work += self.terms.take_work();
        let value = made.and_then(|()| {
            let found = self.find_relation(cells[0], cells.len());
            cells.push(Term::NIL);
            let row = found.and_then(|number| {
                Some((number, self.relations[number as usize].replaced(&cells[1..], work)?))
            });
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
    pub fn retract(&mut self, heap: &mut Heap, fact: Value, work: &mut usize) -> Result<bool, FormulaError> {
        self.tidy(heap);
        let mut cells = std::mem::take(&mut self.cells);
        cells.clear();
        let made = formula::fact(&mut self.terms, heap, fact, &mut cells, work);
        *work += self.terms.take_work();
        let was_there = made.map(|()| {
            let found = self.find_relation(cells[0], cells.len() - 1);
            let row = found
                .and_then(|number| Some((number, self.relations[number as usize].find(&cells[1..], work)?)));
            cells.iter().for_each(|&term| self.terms.release(term));
            if let Some((number, row)) = row {
                self.end(number, row);
            }
            row.is_some()
        });
        self.cells = cells;
        was_there
    }

    pub(super) fn end(&mut self, relation: u32, row: u32) {
        self.time += 1;
        self.relations[relation as usize].end(row, self.time);
        self.facts -= 1;
        self.ended.push_back(EndedFact { relation, row, serial: self.serial });
    }
}

pub(super) fn name_hash(functor: Term, width: usize) -> u32 {
    finish(mix(mix(9, functor.bits()), width as u64))
}
