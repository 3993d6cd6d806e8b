//! Buckets of numbered entries, found by hash; the entries themselves are kept elsewhere.
//!
//! Guarantees: no operation takes time in proportion to the number of entries. A new entry adds one bucket,
//! which takes its share from one other.
//!
//! Not here: the entries. Searches are given a function that compares them.
//!
//! Source: Larson, "Dynamic hash tables", 1988, as in `esl_heap::table`.

use esl_heap::stored;

/// No entry.
pub(super) const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct BucketLink {
    hash: u32,
    next: u32,
}

/// Buckets of numbered entries. Numbers should be small: there is a link for each number up to the largest.
#[derive(Clone, Debug, Default)]
pub(super) struct Buckets {
    heads: Vec<u32>,
    links: Vec<BucketLink>,
    count: usize,
}

/// Mixes a word into a hash.
#[inline]
pub(super) fn mix(hash: u64, word: u64) -> u64 {
    (hash.rotate_left(5) ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15)
}

/// Returns the upper half of a product, which depends on all bits of its factors.
#[inline]
pub(super) fn finish(hash: u64) -> u32 {
    (hash >> 32) as u32
}

impl Buckets {
    #[inline]
    fn bucket(&self, hash: u32) -> usize {
        let mask = self.heads.len().next_power_of_two() - 1;
        let bucket = hash as usize & mask;
        if bucket < self.heads.len() { bucket } else { bucket & (mask >> 1) }
    }

    /// Returns an entry with this hash for which `same` holds.
    #[inline]
    pub(super) fn find(&self, hash: u32, mut same: impl FnMut(u32) -> bool) -> Option<u32> {
        if self.heads.is_empty() {
            return None;
        }
        let mut at = self.heads[self.bucket(hash)];
        while at != NONE {
            let link = self.links[at as usize];
            if link.hash == hash && same(at) {
                return Some(at);
            }
            at = link.next;
        }
        None
    }

    /// Loads the entry that adding one will move to a new bucket. It is mostly not in the cache: before a
    /// search, whose entries are not either, so that it is waited for at the same time.
    #[inline(always)]
    pub(super) fn look_ahead(&self) {
        let new = self.heads.len();
        if new > 0 && self.count >= new {
            let at = self.heads[new - (1 << new.ilog2())];
            std::hint::black_box(self.links.get(at as usize).map(|link| link.next));
        }
    }

    /// Adds an entry that is in no bucket yet.
    pub(super) fn add(&mut self, entry: u32, hash: u32) {
        if self.count >= self.heads.len() {
            self.split();
        }
        let at = entry as usize;
        if at >= self.links.len() {
            self.links.resize(at + 1, BucketLink { hash: 0, next: NONE });
        }
        let bucket = self.bucket(hash);
        self.links[at] = BucketLink { hash, next: self.heads[bucket] };
        self.heads[bucket] = entry;
        self.count += 1;
    }

    /// Removes an entry, which must be there.
    pub(super) fn remove(&mut self, entry: u32) {
        let BucketLink { hash, next } = self.links[entry as usize];
        let bucket = self.bucket(hash);
        let mut at = self.heads[bucket];
        if at == entry {
            self.heads[bucket] = next;
            self.count -= 1;
            return;
        }
        while at != NONE {
            let after = self.links[at as usize].next;
            if after == entry {
                self.links[at as usize].next = next;
                self.count -= 1;
                return;
            }
            at = after;
        }
    }

    /// Adds a bucket, and moves its entries there from the bucket that held them so far.
    fn split(&mut self) {
        let new = self.heads.len();
        self.heads.push(NONE);
        if new == 0 {
            return;
        }
        let old = new - (1 << new.ilog2());
        let mut at = std::mem::replace(&mut self.heads[old], NONE);
        while at != NONE {
            let BucketLink { hash, next } = self.links[at as usize];
            let bucket = self.bucket(hash);
            self.links[at as usize].next = self.heads[bucket];
            self.heads[bucket] = at;
            at = next;
        }
    }
}

stored! { BucketLink { hash, next } }
stored! { Buckets { heads, links, count } }

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn finds_what_is_there(operations in prop::collection::vec((any::<bool>(), 0u32..60), 0..400)) {
            let hash = |entry: u32| finish(mix(1, u64::from(entry % 20)));
            let mut buckets = Buckets::default();
            let mut there = std::collections::BTreeSet::new();
            for (adds, entry) in operations {
                if adds && there.insert(entry) {
                    buckets.add(entry, hash(entry));
                } else if !adds && there.remove(&entry) {
                    buckets.remove(entry);
                }
                for entry in 0..60 {
                    let found = buckets.find(hash(entry), |other| other == entry);
                    prop_assert_eq!(found.is_some(), there.contains(&entry));
                }
            }
        }
    }
}
