//! The overhead of collections for want of room.
//!
//! Near the limit of memory each of a thousand tasks could have everything collected for a few bytes, one
//! after the other, so that a program that is out of memory would seem to hang. So collections have to be
//! paid for: by the time of what runs between them, or by what is allocated there. Some are allowed in
//! advance. A further request then fails because the heap is exhausted.

use esl_heap::stored;

/// A collection is paid for by the allocation of one part in so many of the limit.
const PART_OF_LIMIT: u64 = 64;

/// So many collections are allowed in advance.
const ALLOWED: u64 = 16;

/// The state of the run when a collection is requested.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CollectionPoint {
    /// Ticks of the machine so far.
    pub(crate) ticks: u64,
    /// Bytes allocated so far.
    pub(crate) allocated: u64,
    /// The limit of memory, in bytes.
    pub(crate) limit: u64,
}

/// The overhead of collections for want of room. Times are in ticks of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct CollectionOverhead {
    /// Time that collections have taken when the last one had ended, less what they were paid.
    owed: u64,
    /// When the last one had ended.
    at: u64,
    /// Bytes that were allocated before the last one.
    allocated: u64,
    /// Time that the last one has taken.
    last: u64,
}

impl CollectionOverhead {
    /// Returns whether another collection now would be one too many.
    pub(crate) fn is_too_much(&self, now: CollectionPoint) -> bool {
        self.last > 0 && self.owed_at(now) >= ALLOWED * self.last
    }

    /// Notes a collection that has taken so much time.
    pub(crate) fn note(&mut self, now: CollectionPoint, took: u64) {
        *self = CollectionOverhead {
            owed: self.owed_at(now) + took,
            at: now.ticks,
            allocated: now.allocated,
            last: took,
        };
    }

    /// Allows another collection: an exhaustion has been handled, and much may have been let go.
    pub(crate) fn allow_another(&mut self) {
        self.owed = self.owed.min((ALLOWED - 1) * self.last);
    }

    fn owed_at(&self, now: CollectionPoint) -> u64 {
        let (ran, gained) = (now.ticks.saturating_sub(self.at), now.allocated.saturating_sub(self.allocated));
        let part = (now.limit / PART_OF_LIMIT).max(1);
        self.owed.saturating_sub(ran).saturating_sub(gained.saturating_mul(self.last) / part)
    }

    /// Returns the words that say all of it.
    pub(crate) fn words(&self) -> [u64; 4] {
        [self.owed, self.at, self.allocated, self.last]
    }
}

stored! { CollectionOverhead { owed, at, allocated, last } }

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: u64 = 64 << 20;

    fn point(ticks: u64, allocated: u64) -> CollectionPoint {
        CollectionPoint { ticks, allocated, limit: LIMIT }
    }

    #[test]
    fn collections_in_a_row_are_too_much_until_as_much_has_run() {
        let mut overhead = CollectionOverhead::default();
        for _ in 0..ALLOWED {
            assert!(!overhead.is_too_much(point(5, 0)));
            overhead.note(point(5, 0), 1000);
        }
        assert!(overhead.is_too_much(point(5, 0)) && overhead.is_too_much(point(4, 0)));
        assert!(!overhead.is_too_much(point(6, 0)));
        overhead.note(point(1005, 0), 1000);
        assert!(overhead.is_too_much(point(1005, 0)) && !overhead.is_too_much(point(1006, 0)));
    }

    #[test]
    fn handling_an_exhaustion_allows_one_collection() {
        let mut overhead = CollectionOverhead::default();
        overhead.allow_another();
        assert_eq!(overhead, CollectionOverhead::default());
        for _ in 0..2 * ALLOWED {
            overhead.note(point(5, 0), 1000);
        }
        assert!(overhead.is_too_much(point(5, 0)));
        overhead.allow_another();
        assert!(!overhead.is_too_much(point(5, 0)));
        overhead.note(point(5, 0), 1000);
        assert!(overhead.is_too_much(point(5, 0)));
    }

    #[test]
    fn what_is_allocated_pays_for_collections() {
        let mut overhead = CollectionOverhead::default();
        for i in 0..1000 {
            assert!(!overhead.is_too_much(point(5, i * LIMIT / 64)));
            overhead.note(point(5, i * LIMIT / 64), 1000);
        }
        for i in 0..2 * ALLOWED {
            assert_eq!(overhead.is_too_much(point(5, 999 * LIMIT / 64)), i >= ALLOWED - 1, "{i}");
            overhead.note(point(5, 999 * LIMIT / 64), 1000);
        }
        assert_eq!(overhead.words(), [33_000, 5, 999 * LIMIT / 64, 1000]);
        assert!(overhead.is_too_much(point(5, 1016 * LIMIT / 64)));
        assert!(!overhead.is_too_much(point(5, 1017 * LIMIT / 64)));
        assert!(!overhead.is_too_much(point(5, u64::MAX)));
    }

    #[test]
    fn what_runs_as_long_as_its_collections_may_have_them_for_ever() {
        let mut overhead = CollectionOverhead::default();
        for i in 0..1000 {
            assert!(!overhead.is_too_much(point(i * 1000, 0)));
            overhead.note(point(i * 1000, 0), 1000);
        }
    }
}
