//! Indexes of a relation: chains of its rows, by their cells at some positions.

use super::bucket::{Buckets, NONE, finish, mix};
use super::term::Term;
use esl_heap::stored;

/// Predecessor of a row that is in no chain.
pub(super) const UNLINKED: u32 = u32::MAX - 1;

#[derive(Clone, Copy, Debug)]
pub(super) struct ChainLink {
    pub(super) before: u32,
    pub(super) after: u32,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Ends {
    pub(super) first: u32,
    pub(super) last: u32,
}

pub(super) const EMPTY: Ends = Ends { first: NONE, last: NONE };

#[derive(Clone, Debug)]
pub(super) struct Group {
    pub(super) ends: Ends,
    pub(super) count: u32,
}

/// An index: the rows by their cells at some positions.
#[derive(Clone, Debug)]
pub(super) struct Index {
    pub(super) mask: u64,
    pub(super) keys: Buckets,
    pub(super) groups: Vec<Group>,
    pub(super) free_groups: Vec<u32>,
    pub(super) links: Vec<ChainLink>,
    /// Number of different keys.
    pub(super) distinct: usize,
    /// The next row to be indexed; [`NONE`] when the index is complete.
    pub(super) position: u32,
}

pub(super) fn push(links: &mut Vec<ChainLink>, ends: &mut Ends, row: u32) {
    if links.len() <= row as usize {
        links.resize(row as usize + 1, ChainLink { before: UNLINKED, after: NONE });
    }
    links[row as usize] = ChainLink { before: ends.last, after: NONE };
    match ends.last {
        NONE => ends.first = row,
        last => links[last as usize].after = row,
    }
    ends.last = row;
}

/// Takes a row out of its chain. The row keeps its successor, for queries with their cursor on it.
pub(super) fn unlink(links: &mut [ChainLink], ends: &mut Ends, row: u32) {
    let ChainLink { before, after } = links[row as usize];
    match before {
        NONE => ends.first = after,
        before => links[before as usize].after = after,
    }
    match after {
        NONE => ends.last = before,
        after => links[after as usize].before = before,
    }
    links[row as usize].before = UNLINKED;
}

pub(super) fn positions(mask: u64) -> impl Iterator<Item = usize> {
    let mut rest = mask;
    std::iter::from_fn(move || {
        let position = rest.trailing_zeros() as usize;
        rest &= rest.wrapping_sub(1);
        (position < 64).then_some(position)
    })
}

pub(super) fn hash_cells(cells: &[Term]) -> u32 {
    finish(cells.iter().fold(1, |hash, cell| mix(hash, cell.bits())))
}

pub(super) fn hash_key(mask: u64, cells: &[Term]) -> u32 {
    finish(positions(mask).fold(1, |hash, position| mix(hash, cells[position].bits())))
}

impl Index {
    pub(super) fn new(mask: u64, position: u32) -> Index {
        Index {
            mask,
            keys: Buckets::default(),
            groups: Vec::new(),
            free_groups: Vec::new(),
            links: Vec::new(),
            distinct: 0,
            position,
        }
    }

    pub(super) fn find(&self, key: &[Term], cells: &[Term], width: usize) -> Option<u32> {
        let is_it = |group: u32| {
            let start = self.groups[group as usize].ends.first as usize * width;
            positions(self.mask).all(|position| cells[start + position] == key[position])
        };
        self.keys.find(hash_key(self.mask, key), is_it)
    }

    pub(super) fn take_in(&mut self, row: u32, cells: &[Term], width: usize) {
        let start = row as usize * width;
        let key = &cells[start..start + width];
        let group = match self.find(key, cells, width) {
            Some(group) => group,
            None => {
                let fresh = Group { ends: EMPTY, count: 0 };
                let group = match self.free_groups.pop() {
                    Some(group) => {
                        self.groups[group as usize] = fresh;
                        group
                    }
                    None => {
                        self.groups.push(fresh);
                        (self.groups.len() - 1) as u32
                    }
                };
                self.keys.add(group, hash_key(self.mask, key));
                self.distinct += 1;
                group
            }
        };
        let entry = &mut self.groups[group as usize];
        push(&mut self.links, &mut entry.ends, row);
        entry.count += 1;
    }

    pub(super) fn leave(&mut self, row: u32, cells: &[Term], width: usize) {
        if self.links.get(row as usize).is_none_or(|link| link.before == UNLINKED) {
            return;
        }
        let start = row as usize * width;
        let Some(group) = self.find(&cells[start..start + width], cells, width) else { return };
        let entry = &mut self.groups[group as usize];
        entry.count -= 1;
        if entry.count == 0 {
            // The key of a group is that of its first row, so it is removed while that row is still there.
            self.keys.remove(group);
            self.free_groups.push(group);
            self.distinct -= 1;
        }
        unlink(&mut self.links, &mut self.groups[group as usize].ends, row);
    }
}

stored! { ChainLink { before, after } }
stored! { Ends { first, last } }
stored! { Group { ends, count } }
stored! { Index { mask, keys, groups, free_groups, links, distinct, position } }
