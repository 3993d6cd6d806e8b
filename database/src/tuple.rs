//! Sequences of tuples of terms, all of one width, in the order of insertion; optionally without repetition.

use super::bucket::{Buckets, finish, mix};
use super::term::Term;

/// Tuples of terms.
#[derive(Debug, Default)]
pub(super) struct Tuples {
    width: usize,
    count: usize,
    cells: Vec<Term>,
    set: Buckets,
}

impl Tuples {
    pub(super) fn new(width: usize) -> Tuples {
        Tuples { width, ..Tuples::default() }
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Returns the bytes in use, approximately.
    pub(super) fn bytes(&self) -> usize {
        8 * self.cells.len() + 12 * self.count
    }

    #[inline]
    pub(super) fn get(&self, at: usize) -> &[Term] {
        &self.cells[at * self.width..(at + 1) * self.width]
    }

    /// Appends a tuple.
    pub(super) fn push(&mut self, tuple: impl Iterator<Item = Term>) {
        self.cells.extend(tuple);
        self.count += 1;
    }

    /// Appends a tuple unless it is there; returns whether it is new. Not to be mixed with [`Tuples::push`].
    pub(super) fn insert(&mut self, tuple: impl Iterator<Item = Term>) -> bool {
        let start = self.cells.len();
        self.cells.extend(tuple);
        let hash = finish(self.cells[start..].iter().fold(7, |hash, cell| mix(hash, cell.bits())));
        let Tuples { width, count, cells, set } = self;
        let is_it = |at: u32| {
            let other = at as usize * *width;
            (0..*width).all(|cell| cells[other + cell] == cells[start + cell])
        };
        set.look_ahead();
        if set.find(hash, is_it).is_some() {
            self.cells.truncate(start);
            return false;
        }
        set.add(*count as u32, hash);
        *count += 1;
        true
    }
}
