//! Search through several relations: for patterns whose functor is a variable, or that leave the length open.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

use smallvec::SmallVec;

use super::Database;
use super::bucket::NONE;
use super::effort::Effort;
use super::formula::Pattern;
use super::query::{Query, QueryError};
use super::relation::{Access, INDEXED_POSITIONS};
use super::term::Term;

/// The state of a search through several relations, in the order in which their facts were asserted.
#[derive(Debug)]
pub(super) struct RelationScan {
    pattern: Arc<Pattern>,
    /// The next relation to be opened.
    opening: u32,
    /// The next row of each opened relation: change that made it, relation, row.
    heads: BinaryHeap<Reverse<(u64, u32, u32)>>,
    indexes: Vec<(u32, Option<usize>)>,
    is_opened: bool,
}

impl RelationScan {
    pub(super) fn new(pattern: Arc<Pattern>) -> RelationScan {
        RelationScan { pattern, opening: 0, heads: BinaryHeap::new(), indexes: Vec::new(), is_opened: false }
    }

    pub(super) fn rank(&self) -> usize {
        self.pattern.rank
    }

    /// Returns whether the search has ended.
    pub(super) fn is_exhausted(&self) -> bool {
        self.is_opened && self.heads.is_empty()
    }

    /// Returns the next fact that matches, with its variables bound. `None` if the work is used up or the
    /// search has ended.
    pub(super) fn next(
        &mut self,
        database: &mut Database,
        query: &mut Query,
        effort: &mut Effort,
    ) -> Result<Option<(u32, u32)>, QueryError> {
        while !self.is_opened {
            if !self.open(database, query, effort)? {
                return Ok(None);
            }
        }
        while let Some(Reverse((born, number, row))) = self.heads.pop() {
            let facts = &database.relations[number as usize];
            let place = self.indexes.binary_search_by_key(&number, |&(relation, _)| relation);
            let index = place.ok().and_then(|place| self.indexes[place].1);
            let after = facts.after(index, row);
            if born <= query.time && after != NONE {
                self.heads.push(Reverse((facts.born(after), number, after)));
            }
            let trail = query.trail.len();
            if facts.is_visible(row, query.time) && self.matches(database, query, number, row, effort)? {
                return Ok(Some((number, row)));
            }
            query.undo(trail);
            if !effort.take_item() {
                return Ok(None);
            }
        }
        Ok(None)
    }

    /// Opens the next relation. Returns false if the work is used up.
    fn open(
        &mut self,
        database: &mut Database,
        query: &mut Query,
        effort: &mut Effort,
    ) -> Result<bool, QueryError> {
        let number = self.opening;
        let Some(facts) = database.relations.get(number as usize) else {
            self.is_opened = true;
            return Ok(true);
        };
        if !effort.take_item() {
            return Ok(false);
        }
        let arguments = &self.pattern.arguments;
        let is_open = self.pattern.tail != Term::NIL;
        let Query { bindings, held, .. } = query;
        let functor = database.terms.instantiate(self.pattern.functor, bindings, held, effort)?;
        let fits = match functor {
            Some(functor) => facts.functor == functor,
            None => true,
        };
        let right_width = facts.width == arguments.len() || is_open && facts.width > arguments.len();
        if !fits || !right_width {
            self.opening += 1;
            return Ok(true);
        }
        let mut key: SmallVec<[Term; 8]> = SmallVec::from_elem(Term::UNBOUND, facts.width);
        effort.spend_cells(facts.width);
        let (mut bound, mut known) = (0_u64, 0);
        for (position, &argument) in arguments.iter().enumerate() {
            if let Some(term) = database.terms.instantiate(argument, bindings, held, effort)? {
                key[position] = term;
                known += 1;
                if position < INDEXED_POSITIONS {
                    bound |= 1 << position;
                }
            }
        }
        let facts = &mut database.relations[number as usize];
        match facts.access(bound, known == facts.width, &key, query.time, effort) {
            Access::Nothing => {}
            Access::Build(index) => return Ok(facts.build(index, effort)),
            // The chain continues after this row, but only with rows that do not match.
            Access::One(row) => self.begin(facts.born(row), number, row, None),
            Access::Chain(index, row) => self.begin(facts.born(row), number, row, index),
        }
        self.opening += 1;
        Ok(true)
    }

    fn begin(&mut self, born: u64, relation: u32, row: u32, index: Option<usize>) {
        self.heads.push(Reverse((born, relation, row)));
        self.indexes.push((relation, index));
    }

    fn matches(
        &self,
        database: &mut Database,
        query: &mut Query,
        relation: u32,
        row: u32,
        effort: &mut Effort,
    ) -> Result<bool, QueryError> {
        let Database { relations, terms, .. } = database;
        let facts = &relations[relation as usize];
        let cells = facts.row(row);
        let Query { bindings, trail, held, .. } = query;
        let arguments = &self.pattern.arguments;
        effort.spend_cells(cells.len());
        if !terms.matches(self.pattern.functor, facts.functor, bindings, trail, effort) {
            return Ok(false);
        }
        for (&argument, &cell) in arguments.iter().zip(cells) {
            if !terms.matches(argument, cell, bindings, trail, effort) {
                return Ok(false);
            }
        }
        if self.pattern.tail == Term::NIL {
            return Ok(true);
        }
        let rest = terms.list(&cells[arguments.len()..], Term::NIL)?;
        held.push(rest);
        Ok(terms.matches(self.pattern.tail, rest, bindings, trail, effort))
    }
}
