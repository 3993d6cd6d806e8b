//! Relations: the facts with the same functor and the same number of arguments, and their indexes.
//!
//! A fact is a row of cells, with the numbers of the changes that made and ended it; queries that began in
//! between see it. Rows are chained in the order of assertion, and so are, in each index, the rows with the
//! same cells at the index's positions.
//!
//! A row that has ended stays where it is until every query that may see it has closed; then it leaves its
//! chains. Its place is used again when every query that may have its cursor on it has closed
//! ([`super::Database`] keeps these times). An index is made on demand of a query, in steps; until it is
//! complete it holds the rows before its position. An index is worth making for the positions that a query
//! has bound once such queries have looked at more rows in vain than there are facts. So the work of any
//! sequence of queries is at most a few times that with the best choice of indexes.

use super::bucket::{Buckets, NONE};
use super::effort::Effort;
use super::index::{ChainLink, EMPTY, Ends, Index, hash_cells, push, unlink};
use super::term::Term;
use esl_heap::stored;

/// Number of rows below which looking at all of them is best.
const FEW: usize = 8;
/// Greatest number of indexes of a relation.
const MOST_INDEXES: usize = 8;
/// Number of leading arguments that an index can cover.
pub(super) const INDEXED_POSITIONS: usize = 64;

/// The changes that made and ended a fact.
#[derive(Clone, Copy, Debug)]
struct Lifespan {
    born: u64,
    died: u64,
}

#[derive(Clone, Debug)]
struct WantedIndex {
    mask: u64,
    vain: usize,
}

/// The facts with one functor and width.
#[derive(Clone, Debug)]
pub(super) struct Relation {
    pub(super) functor: Term,
    /// Number of arguments.
    pub(super) width: usize,
    /// Whether the last argument is unique for given others.
    is_property: bool,
    cells: Vec<Term>,
    spans: Vec<Lifespan>,
    links: Vec<ChainLink>,
    ends: Ends,
    set: Buckets,
    indexes: Vec<Index>,
    wanted: Vec<WantedIndex>,
    free: Vec<u32>,
    live: usize,
    /// Bytes for it that the database has counted.
    counted: usize,
}

/// How to find the rows for a query.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    /// Follow a chain from this row on: that of the given index, or of all rows.
    Chain(Option<usize>, u32),
    /// Look at this row only.
    One(u32),
    /// There are no rows.
    Nothing,
    /// Complete this index first.
    Build(usize),
}

impl Relation {
    pub(super) fn new(functor: Term, width: usize) -> Relation {
        Relation {
            functor,
            width,
            is_property: false,
            cells: Vec::new(),
            spans: Vec::new(),
            links: Vec::new(),
            ends: EMPTY,
            set: Buckets::default(),
            indexes: Vec::new(),
            wanted: Vec::new(),
            free: Vec::new(),
            live: 0,
            counted: 0,
        }
    }

    /// Returns the arguments of a fact.
    #[inline]
    pub(super) fn row(&self, row: u32) -> &[Term] {
        let start = row as usize * self.width;
        &self.cells[start..start + self.width]
    }

    /// Returns the change that made a row.
    #[inline]
    pub(super) fn born(&self, row: u32) -> u64 {
        self.spans[row as usize].born
    }

    /// Returns whether a query that began after change `time` sees a row.
    #[inline]
    pub(super) fn is_visible(&self, row: u32, time: u64) -> bool {
        let span = self.spans[row as usize];
        span.born <= time && time < span.died
    }

    /// Returns whether a row is a fact now.
    pub(super) fn is_live(&self, row: u32) -> bool {
        self.spans[row as usize].died == u64::MAX
    }

    /// Returns the row of a current fact. Adds the rows looked at to `work`.
    pub(super) fn find(&self, cells: &[Term], work: &mut usize) -> Option<u32> {
        let is_it = |row| {
            *work += 1;
            self.is_live(row) && self.row(row) == cells
        };
        self.set.find(hash_cells(cells), is_it)
    }

    /// Returns the number of current facts.
    pub(super) fn count(&self) -> usize {
        self.live
    }

    /// Returns the rows of all current facts.
    pub(super) fn live_rows(&self) -> impl Iterator<Item = u32> {
        (0..self.spans.len() as u32).filter(|&row| self.is_live(row))
    }

    /// Returns whether the last argument is unique for given others.
    pub(super) fn is_property(&self) -> bool {
        self.is_property
    }

    /// Makes the last argument unique for given others. Adds the work done to `work`.
    pub(super) fn make_property(&mut self, work: &mut usize) {
        self.is_property = true;
        let mask = Relation::arguments_mask(self.width);
        if mask == 0 || self.indexes.iter().any(|index| index.mask == mask && index.position == NONE) {
            return;
        }
        self.indexes.retain(|index| index.mask != mask);
        self.indexes.insert(0, Index::new(mask, self.ends.first));
        let mut effort = Effort::unbounded();
        self.build(0, &mut effort);
        *work += effort.spent() / 4;
    }

    /// Lets there be several last arguments for given others.
    pub(super) fn drop_property(&mut self) {
        self.is_property = false;
    }

    /// Returns the positions of all arguments but the last, as a mask.
    fn arguments_mask(width: usize) -> u64 {
        if (2..=INDEXED_POSITIONS).contains(&width) { (1 << (width - 1)) - 1 } else { 0 }
    }

    /// Returns the row that a new fact replaces, as the value of a property. Adds the rows looked at to
    /// `work`.
    pub(super) fn replaced(&self, cells: &[Term], work: &mut usize) -> Option<u32> {
        if !self.is_property {
            return None;
        }
        let shared = &cells[..self.width.saturating_sub(1)];
        let mask = Relation::arguments_mask(self.width);
        let index = self.indexes.iter().position(|index| index.mask == mask && mask != 0);
        let mut row = match index {
            Some(index) => match self.indexes[index].find(cells, &self.cells, self.width) {
                Some(group) => self.indexes[index].groups[group as usize].ends.first,
                None => return None,
            },
            None => self.ends.first,
        };
        while row != NONE {
            *work += 1;
            if self.is_live(row) && self.row(row).starts_with(shared) {
                return Some(row);
            }
            row = self.after(index, row);
        }
        None
    }

    /// Returns the row of a fact as of change `time`.
    fn find_at(&self, cells: &[Term], time: u64, effort: &mut Effort) -> Option<u32> {
        let is_it = |row| {
            effort.spend(1);
            self.is_visible(row, time) && self.row(row) == cells
        };
        self.set.find(hash_cells(cells), is_it)
    }

    /// Counts the bytes that its facts take, approximately. Returns those that were counted before, and those
    /// that are now: a new index has facts take more that were there before it.
    pub(super) fn recount(&mut self) -> (usize, usize) {
        let rows = self.spans.len() - self.free.len();
        let bytes = rows * (8 * self.width + 40 + 8 * self.indexes.len());
        (std::mem::replace(&mut self.counted, bytes), bytes)
    }

    /// Adds a fact that is not there. The relation then holds its cells.
    pub(super) fn add(&mut self, cells: &[Term], time: u64) -> u32 {
        let span = Lifespan { born: time, died: u64::MAX };
        let row = match self.free.pop() {
            Some(row) => {
                let start = row as usize * self.width;
                self.cells[start..start + self.width].copy_from_slice(cells);
                self.spans[row as usize] = span;
                row
            }
            None => {
                self.cells.extend_from_slice(cells);
                self.spans.push(span);
                (self.spans.len() - 1) as u32
            }
        };
        push(&mut self.links, &mut self.ends, row);
        self.set.add(row, hash_cells(cells));
        self.live += 1;
        let Relation { indexes, cells, width, .. } = self;
        for index in indexes.iter_mut().filter(|index| index.position == NONE) {
            index.take_in(row, cells, *width);
        }
        row
    }

    /// Ends a fact.
    pub(super) fn end(&mut self, row: u32, time: u64) {
        self.spans[row as usize].died = time;
        self.live -= 1;
    }

    /// Takes a row that has ended out of all chains.
    pub(super) fn unlink(&mut self, row: u32) {
        let after = self.links[row as usize].after;
        unlink(&mut self.links, &mut self.ends, row);
        self.set.remove(row);
        let Relation { indexes, cells, width, .. } = self;
        for index in indexes.iter_mut() {
            if index.position == row {
                index.position = after;
            }
            index.leave(row, cells, *width);
        }
    }

    /// Makes the place of an unlinked row available again.
    pub(super) fn free(&mut self, row: u32) {
        self.free.push(row);
    }

    // ---- finding rows

    /// Returns the next row of a chain.
    #[inline]
    pub(super) fn after(&self, index: Option<usize>, row: u32) -> u32 {
        match index {
            None => self.links[row as usize].after,
            Some(index) => self.indexes[index].links[row as usize].after,
        }
    }

    /// Returns how to find the rows with the cells of `key` at the positions of `bound`, as of change `time`.
    /// `is_all` says that all positions are bound.
    pub(super) fn access(
        &mut self,
        bound: u64,
        is_all: bool,
        key: &[Term],
        time: u64,
        effort: &mut Effort,
    ) -> Access {
        if is_all {
            return self.find_at(key, time, effort).map_or(Access::Nothing, Access::One);
        }
        let rows = self.spans.len() - self.free.len();
        if bound == 0 || rows < FEW {
            return self.chain(None, self.ends.first);
        }
        let mut best: Option<(usize, Ends, usize)> = None;
        for (number, index) in self.indexes.iter().enumerate() {
            if index.mask & !bound != 0 {
                continue;
            }
            if index.position != NONE {
                if index.mask == bound {
                    return Access::Build(number);
                }
                continue;
            }
            let Some(group) = index.find(key, &self.cells, self.width) else { return Access::Nothing };
            let group = &index.groups[group as usize];
            if index.mask == bound {
                return self.chain(Some(number), group.ends.first);
            }
            if best.is_none_or(|(.., count)| (group.count as usize) < count) {
                best = Some((number, group.ends, group.count as usize));
            }
        }
        let cost = best.map_or(rows, |(.., count)| count);
        if cost > FEW && self.wants(bound, cost) {
            self.indexes.push(Index::new(bound, self.ends.first));
            return Access::Build(self.indexes.len() - 1);
        }
        match best {
            Some((number, ends, _)) => self.chain(Some(number), ends.first),
            None => self.chain(None, self.ends.first),
        }
    }

    fn chain(&self, index: Option<usize>, first: u32) -> Access {
        if first == NONE { Access::Nothing } else { Access::Chain(index, first) }
    }

    /// Notes that rows are looked at for lack of an index. Returns whether they are enough for making it.
    fn wants(&mut self, mask: u64, rows: usize) -> bool {
        if self.indexes.len() >= MOST_INDEXES {
            return false;
        }
        let at = match self.wanted.iter().position(|wanted| wanted.mask == mask) {
            Some(at) => at,
            None if self.wanted.len() < 4 * MOST_INDEXES => {
                self.wanted.push(WantedIndex { mask, vain: 0 });
                self.wanted.len() - 1
            }
            None => return false,
        };
        self.wanted[at].vain += rows;
        if self.wanted[at].vain < self.live {
            return false;
        }
        self.wanted.swap_remove(at);
        true
    }

    /// Works on an index until it is complete or the effort is used up. Returns whether it is complete.
    pub(super) fn build(&mut self, number: usize, effort: &mut Effort) -> bool {
        let index = &mut self.indexes[number];
        let covered = index.mask.count_ones() as usize;
        while index.position != NONE {
            if !effort.take_item() {
                return false;
            }
            effort.spend_cells(covered);
            let row = index.position;
            index.position = self.links[row as usize].after;
            index.take_in(row, &self.cells, self.width);
        }
        true
    }

    /// Estimates the number of rows with given cells at the positions of `bound`; `key` has the cells if they
    /// are known.
    pub(super) fn estimate(&self, bound: u64, is_all: bool, key: Option<&[Term]>) -> f64 {
        let live = self.live as f64;
        if is_all {
            return live.min(1.0);
        }
        let complete = self.indexes.iter().filter(|index| index.position == NONE && index.mask & !bound == 0);
        let by_index = complete.map(|index| match key {
            Some(key) => index
                .find(key, &self.cells, self.width)
                .map_or(0.0, |group| f64::from(index.groups[group as usize].count)),
            None => live / index.distinct.max(1) as f64,
        });
        // Without an index, the guess is that each bound position reduces the number of rows, by an unknown
        // factor.
        let guess = live.powf(1.0 / (1.0 + f64::from(bound.count_ones())));
        by_index.reduce(f64::min).unwrap_or(guess)
    }
}

stored! { Lifespan { born, died } }
stored! { WantedIndex { mask, vain } }
stored! { Relation {
    functor, width, is_property, cells, spans, links, ends, set, indexes, wanted, free, live, counted,
} }
