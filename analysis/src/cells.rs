//! Cells with sets of values, and copies from cell to cell: inclusion constraints, solved by differences.
//!
//! A cell sends only values that are new in it. Cells that are copied to each other in a cycle have equal
//! sets in the end; now and then, all such cycles are found, and the cells of each become one. Sources:
//! Tarjan 1972; Fähndrich, Foster, Su and Aiken 1998.

use std::collections::VecDeque;

use rustc_hash::FxHashSet;

use crate::value::CellId;

/// Least work between two searches for cycles.
const WORK_BETWEEN_SEARCHES: usize = 20_000;

/// A set of numbers of values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct ValueSet {
    /// Each block has a number and a bit for each of 64 values; in the order of the numbers.
    blocks: Vec<(u32, u64)>,
    count: usize,
}

impl ValueSet {
    /// Adds a value. Returns whether it is new.
    pub(crate) fn insert(&mut self, value: u32) -> bool {
        let (number, bit) = (value / 64, 1 << (value % 64));
        match self.blocks.binary_search_by_key(&number, |block| block.0) {
            Ok(index) => {
                let is_new = self.blocks[index].1 & bit == 0;
                self.blocks[index].1 |= bit;
                self.count += usize::from(is_new);
                is_new
            }
            Err(index) => {
                self.blocks.insert(index, (number, bit));
                self.count += 1;
                true
            }
        }
    }

    /// Returns the values in increasing order.
    pub(crate) fn iter(&self) -> impl Iterator<Item = u32> {
        self.blocks.iter().flat_map(|(number, bits)| {
            let bits = *bits;
            (0..64).filter(move |bit| bits >> bit & 1 != 0).map(move |bit| number * 64 + bit)
        })
    }

    /// Returns the number of values.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Returns those of another set that this one does not have.
    fn lacks(&self, other: &ValueSet) -> ValueSet {
        let mut missing = ValueSet::default();
        let mut index = 0;
        for (number, bits) in &other.blocks {
            index += self.blocks[index..].partition_point(|block| block.0 < *number);
            let known = self.blocks.get(index).filter(|block| block.0 == *number).map_or(0, |block| block.1);
            if bits & !known != 0 {
                missing.blocks.push((*number, bits & !known));
                missing.count += (bits & !known).count_ones() as usize;
            }
        }
        missing
    }

    /// Adds values of which it has none.
    fn add_new(&mut self, others: &ValueSet) {
        self.count += others.count;
        if self.blocks.is_empty() {
            self.blocks.clone_from(&others.blocks);
            return;
        }
        for (number, bits) in &others.blocks {
            match self.blocks.binary_search_by_key(number, |block| block.0) {
                Ok(index) => self.blocks[index].1 |= bits,
                Err(index) => self.blocks.insert(index, (*number, *bits)),
            }
        }
    }

    /// Adds the values of another set.
    fn add(&mut self, others: &ValueSet) {
        let missing = self.lacks(others);
        self.add_new(&missing);
    }
}

/// A cell.
#[derive(Debug)]
struct Cell<W> {
    values: ValueSet,
    /// Those that it has not sent yet.
    fresh: ValueSet,
    is_queued: bool,
    copies: Vec<CellId>,
    copied: FxHashSet<CellId>,
    watchers: Vec<W>,
    watching: FxHashSet<W>,
}

/// A cell has new values, or a new watcher.
#[derive(Debug)]
enum SentValues<W> {
    Values(CellId),
    Watcher(W, CellId),
}

/// Cells, with watchers of the values that arrive in them.
#[derive(Debug)]
pub(crate) struct Cells<W> {
    cells: Vec<Cell<W>>,
    /// The cell that each one has become a part of, or itself.
    merged: Vec<CellId>,
    queue: VecDeque<SentValues<W>>,
    /// Copies from cells to cells.
    copies: usize,
    /// Work at which cycles are looked for.
    next_search: usize,
    /// Whether cycles have been looked for since this was set to false.
    pub(crate) has_merged: bool,
    /// Work done: values and blocks of values that have been sent.
    pub(crate) sent: usize,
}

/// Values for watchers.
#[derive(Debug)]
pub(crate) struct Sending<W> {
    pub(crate) cell: CellId,
    pub(crate) values: ValueSet,
    pub(crate) watchers: Vec<W>,
}

impl<W: Copy + Eq + std::hash::Hash> Cells<W> {
    /// Creates no cells.
    pub(crate) fn new() -> Cells<W> {
        Cells {
            cells: Vec::new(),
            merged: Vec::new(),
            queue: VecDeque::new(),
            copies: 0,
            next_search: WORK_BETWEEN_SEARCHES,
            has_merged: false,
            sent: 0,
        }
    }

    /// Creates the next cell.
    pub(crate) fn create(&mut self) {
        self.merged.push(CellId(self.cells.len() as u32));
        self.cells.push(Cell {
            values: ValueSet::default(),
            fresh: ValueSet::default(),
            is_queued: false,
            copies: Vec::new(),
            copied: FxHashSet::default(),
            watchers: Vec::new(),
            watching: FxHashSet::default(),
        });
    }

    /// Returns the cell that a cell has become a part of.
    pub(crate) fn find(&mut self, cell: CellId) -> CellId {
        let mut root = cell;
        while self.merged[root.index()] != root {
            root = self.merged[root.index()];
        }
        let mut one = cell;
        while one != root {
            one = std::mem::replace(&mut self.merged[one.index()], root);
        }
        root
    }

    /// Returns the values of a cell.
    pub(crate) fn values(&self, cell: CellId) -> &ValueSet {
        let mut cell = cell;
        while self.merged[cell.index()] != cell {
            cell = self.merged[cell.index()];
        }
        &self.cells[cell.index()].values
    }

    fn enqueue(&mut self, cell: CellId) {
        if !std::mem::replace(&mut self.cells[cell.index()].is_queued, true) {
            self.queue.push_back(SentValues::Values(cell));
        }
    }

    /// Adds a value to a cell.
    pub(crate) fn add(&mut self, cell: CellId, value: u32) {
        let cell = self.find(cell);
        let place = &mut self.cells[cell.index()];
        if place.values.insert(value) {
            place.fresh.insert(value);
            self.enqueue(cell);
        }
    }

    /// Adds values to a cell.
    fn add_all(&mut self, cell: CellId, values: &ValueSet) {
        self.sent += 1 + values.blocks.len();
        let place = &mut self.cells[cell.index()];
        let missing = place.values.lacks(values);
        if missing.count > 0 {
            place.values.add_new(&missing);
            place.fresh.add_new(&missing);
            self.enqueue(cell);
        }
    }

    /// Has the values of a cell flow to another one.
    pub(crate) fn copy(&mut self, from: CellId, to: CellId) {
        let (from, to) = (self.find(from), self.find(to));
        if from == to || !self.cells[from.index()].copied.insert(to) {
            return;
        }
        self.cells[from.index()].copies.push(to);
        self.copies += 1;
        let values = std::mem::take(&mut self.cells[from.index()].values);
        self.add_all(to, &values);
        self.cells[from.index()].values = values;
    }

    /// Has a watcher look at the values of a cell, and at those that come.
    pub(crate) fn watch(&mut self, cell: CellId, watcher: W) {
        let cell = self.find(cell);
        let place = &mut self.cells[cell.index()];
        if place.watching.insert(watcher) {
            place.watchers.push(watcher);
            if place.values.count > 0 {
                self.queue.push_back(SentValues::Watcher(watcher, cell));
            }
        }
    }

    /// Sends values on, until some of them are for watchers, which are returned. Returns nothing at the end.
    pub(crate) fn next(&mut self) -> Option<Sending<W>> {
        loop {
            if self.sent > self.next_search {
                self.merge_cycles();
                self.has_merged = true;
                self.next_search = self.sent + WORK_BETWEEN_SEARCHES.max(2 * self.copies);
            }
            match self.queue.pop_front()? {
                SentValues::Watcher(watcher, cell) => {
                    let cell = self.find(cell);
                    let values = self.cells[cell.index()].values.clone();
                    return Some(Sending { cell, values, watchers: vec![watcher] });
                }
                SentValues::Values(cell) => {
                    if self.merged[cell.index()] != cell {
                        continue;
                    }
                    let place = &mut self.cells[cell.index()];
                    place.is_queued = false;
                    let values = std::mem::take(&mut place.fresh);
                    let watchers = place.watchers.clone();
                    for index in 0..self.cells[cell.index()].copies.len() {
                        let to = self.cells[cell.index()].copies[index];
                        let to = self.find(to);
                        if to != cell {
                            self.add_all(to, &values);
                        }
                    }
                    if !watchers.is_empty() {
                        return Some(Sending { cell, values, watchers });
                    }
                }
            }
        }
    }

    /// Makes cells one that are copied to each other.
    fn merge_cycles(&mut self) {
        /// Number of a cell that is not visited.
        const NEW: u32 = u32::MAX;
        let count = self.cells.len();
        // The order of the visits; and for each cell the first one to which copies are known to lead from it.
        let (mut numbers, mut lowest) = (vec![NEW; count], vec![NEW; count]);
        let mut is_open = vec![false; count];
        let (mut open, mut way) = (Vec::new(), Vec::<(CellId, usize)>::new());
        let mut visited = 0;
        for start in (0..count as u32).map(CellId) {
            if self.merged[start.index()] != start || numbers[start.index()] != NEW {
                continue;
            }
            way.push((start, 0));
            while let Some((cell, next)) = way.last_mut() {
                let (cell, index) = (*cell, *next);
                if index == 0 {
                    (numbers[cell.index()], lowest[cell.index()]) = (visited, visited);
                    visited += 1;
                    open.push(cell);
                    is_open[cell.index()] = true;
                }
                *next += 1;
                if let Some(copy) = self.cells[cell.index()].copies.get(index).copied() {
                    let copy = self.find(copy);
                    if numbers[copy.index()] == NEW {
                        way.push((copy, 0));
                    } else if is_open[copy.index()] {
                        lowest[cell.index()] = lowest[cell.index()].min(numbers[copy.index()]);
                    }
                    continue;
                }
                way.pop();
                if let Some((around, _)) = way.last() {
                    lowest[around.index()] = lowest[around.index()].min(lowest[cell.index()]);
                }
                if lowest[cell.index()] == numbers[cell.index()] {
                    while let Some(last) = open.pop() {
                        is_open[last.index()] = false;
                        if last == cell {
                            break;
                        }
                        self.merge(cell, last);
                    }
                }
            }
        }
    }

    /// Makes a cell a part of another one.
    pub(crate) fn merge(&mut self, into: CellId, other: CellId) {
        let (into, other) = (self.find(into), self.find(other));
        if into == other {
            return;
        }
        self.merged[other.index()] = into;
        let other = &mut self.cells[other.index()];
        let (values, fresh) = (std::mem::take(&mut other.values), std::mem::take(&mut other.fresh));
        let (copies, watchers) = (std::mem::take(&mut other.copies), std::mem::take(&mut other.watchers));
        (other.copied, other.watching) = (FxHashSet::default(), FxHashSet::default());
        let place = &mut self.cells[into.index()];
        // Values that were in one cell only are new to the copies and the watchers of the other.
        let mut unsent = place.values.lacks(&values);
        unsent.add(&values.lacks(&place.values));
        unsent.add(&fresh);
        place.values.add(&values);
        place.fresh.add(&unsent);
        let has_unsent = place.fresh.count > 0;
        for watcher in watchers {
            if place.watching.insert(watcher) {
                place.watchers.push(watcher);
            }
        }
        for copy in copies {
            let copy = self.find(copy);
            let place = &mut self.cells[into.index()];
            if copy != into && place.copied.insert(copy) {
                place.copies.push(copy);
            }
        }
        if has_unsent {
            self.enqueue(into);
        }
    }
}
