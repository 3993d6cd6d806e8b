//! The guess that the last search in a hash table gives for the next one.

use super::Table;
use crate::heap::Heap;
use crate::value::Value;

/// The entry that was found last in a hash table, by which the next one is guessed.
///
/// A key is often the one that was looked up last, as in `(push item (gethash key table))`. And keys that are
/// integers were often entered in order: their entries lie at one distance from them.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct LastLookup {
    /// The key that was looked up.
    pub key: Value,
    /// Number of the entry.
    pub entry: usize,
    /// Number of the entry, minus the key if that is an integer.
    pub distance: i64,
    /// Whether the search before led to an entry at the same distance.
    pub is_steady: bool,
}

crate::stored! { LastLookup { key, entry, distance, is_steady } }

impl Default for LastLookup {
    fn default() -> LastLookup {
        LastLookup { key: Value::UNBOUND, entry: 0, distance: 0, is_steady: false }
    }
}

impl LastLookup {
    /// Returns the entry of a key and its value, if the guess is right.
    #[inline(always)]
    pub fn find(&self, heap: &Heap, table: Table, key: Value) -> Option<(usize, Value)> {
        let entry = self.guess(key)?;
        Some((entry, table.value_of(heap, entry, key)?))
    }

    /// Returns the number of the entry that probably has `key`.
    #[inline(always)]
    fn guess(&self, key: Value) -> Option<usize> {
        if self.is_steady
            && let Some(n) = key.as_fixnum()
        {
            return Some((n + self.distance) as usize);
        }
        if self.key == key { Some(self.entry) } else { None }
    }

    /// Notes that a search for `key` led to `entry`.
    #[inline(always)]
    pub fn note(&mut self, key: Value, entry: usize) {
        let distance = entry as i64 - key.as_fixnum().unwrap_or(0);
        *self = LastLookup { key, entry, distance, is_steady: distance == self.distance };
    }
}
