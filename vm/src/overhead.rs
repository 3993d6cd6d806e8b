//! The overhead of collections that leave hardly any room.
//!
//! Near the limit of memory each of a thousand tasks could have everything collected for a few bytes, one
//! after the other, so that a program that is out of memory would seem to hang. Such collections may take
//! about as much time as what runs between them; beyond that, some are allowed in a row. What wants another
//! one then is told that the heap is exhausted.

/// A collection leaves hardly any room if it leaves less than one part in so many of the limit.
const PART_OF_LIMIT: usize = 64;

/// So many collections are allowed in a row, however little runs between them.
const ALLOWED: u64 = 16;

/// The overhead of collections for want of room. Times are in ticks of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct CollectionOverhead {
    /// Time that collections have taken when the last one had ended, less what ran between them.
    owed: u64,
    /// When the last one had ended.
    at: u64,
    /// Time that the last one has taken.
    last: u64,
}

impl CollectionOverhead {
    /// Returns whether another collection now would be one too many.
    pub(crate) fn is_too_much(&self, now: u64) -> bool {
        self.last > 0 && self.owed_at(now) >= ALLOWED * self.last
    }

    /// Notes a collection that has taken so much time, and has left so many bytes of a limit.
    pub(crate) fn note(&mut self, now: u64, took: u64, room: usize, limit: usize) {
        *self = if room >= limit / PART_OF_LIMIT {
            CollectionOverhead::default()
        } else {
            CollectionOverhead { owed: self.owed_at(now) + took, at: now, last: took }
        };
    }

    fn owed_at(&self, now: u64) -> u64 {
        self.owed.saturating_sub(now.saturating_sub(self.at))
    }

    /// Returns the words that say all of it.
    pub(crate) fn words(&self) -> [u64; 3] {
        [self.owed, self.at, self.last]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: usize = 64 << 20;

    #[test]
    fn collections_in_a_row_are_too_much_until_as_much_has_run() {
        let mut overhead = CollectionOverhead::default();
        for _ in 0..ALLOWED {
            assert!(!overhead.is_too_much(5));
            overhead.note(5, 1000, LIMIT / 64 - 1, LIMIT);
        }
        assert!(overhead.is_too_much(5) && overhead.is_too_much(5 - 1));
        assert!(!overhead.is_too_much(6));
        overhead.note(1005, 1000, 0, LIMIT);
        assert!(overhead.is_too_much(1005) && !overhead.is_too_much(1006));
    }

    #[test]
    fn a_collection_that_leaves_room_makes_up_for_all() {
        let mut overhead = CollectionOverhead::default();
        for _ in 0..2 * ALLOWED {
            overhead.note(5, 1000, 0, LIMIT);
        }
        assert!(overhead.is_too_much(5));
        overhead.note(5, 1000, LIMIT / 64, LIMIT);
        assert!(!overhead.is_too_much(5));
        assert_eq!(overhead.words(), [0; 3]);
    }

    #[test]
    fn what_runs_as_long_as_its_collections_may_have_them_for_ever() {
        let mut overhead = CollectionOverhead::default();
        for i in 0..1000 {
            assert!(!overhead.is_too_much(i * 1000));
            overhead.note(i * 1000, 1000, 0, LIMIT);
        }
    }
}
