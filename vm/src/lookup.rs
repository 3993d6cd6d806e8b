//! Searches in hash tables, and the guesses that shorten them.
//!
//! Guesses change nothing that a program can tell: neither what is found, nor the ticks that it takes. But a
//! program that changes a key while a table has it, which the standard leaves undefined, may find the key by
//! a guess where a search would miss it.

use crate::equality::{self, KeyTest};
use crate::heap::Heap;
use crate::table::{KeyComparison, LastLookup, Table, Trouble};
use crate::value::Value;

/// Most steps of a search; what takes more is left to ESL.
const MOST_STEPS: usize = 4096;

/// Steps of a search for which nothing is charged, at least.
pub(crate) const STEPS_FOR_NOTHING: usize = 16;

/// A search that has come to its end.
pub(crate) struct Lookup {
    pub(crate) place: KeyPlace,
    /// Steps that it has taken.
    pub(crate) steps: usize,
    way: Way,
}

impl Lookup {
    /// The search that was not needed, since the last one told the entry.
    #[inline(always)]
    fn by_last(entry: usize, value: Value) -> Lookup {
        Lookup { place: KeyPlace::Entry(entry, value), steps: 0, way: Way::Last }
    }
}

/// Outcome of a search.
pub(crate) enum KeyPlace {
    /// The entry with the key, and its value.
    Entry(usize, Value),
    /// There is none; the hash of the key.
    None(u32),
}

/// How an entry was found.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    /// As the one that follows from the last search.
    Last,
    /// By what is noted already, or needs no note.
    Guess,
    /// By its hash, to be noted.
    Search,
}

/// The latest results of searches in hash tables.
#[derive(Debug, Default)]
pub(crate) struct Lookups {
    /// The entry found last.
    pub(crate) last: LastLookup,
    /// Entries found before.
    entries: FoundEntries,
}

impl Lookups {
    /// Goes on after the search that has led to this entry.
    pub(crate) fn after(last: LastLookup) -> Lookups {
        Lookups { last, entries: FoundEntries::default() }
    }

    /// Returns these lookups without what a state of the machine can do without.
    pub(crate) fn saved(&self) -> Lookups {
        Lookups { last: self.last, entries: FoundEntries::default() }
    }

    /// Finds a key, by a test of the machine.
    ///
    /// # Errors
    /// [`Trouble::Slowly`] if that takes too much, or only ESL can tell.
    #[inline(always)]
    pub(crate) fn locate(&self, heap: &Heap, table: Table, key: Value) -> Result<Lookup, Trouble> {
        match key.as_fixnum() {
            Some(n) => self.locate_fixnum(heap, table, key, n),
            None => self.locate_other(heap, table, key),
        }
    }

    /// As [`Lookups::locate`], for the key that is the fixnum `n`.
    #[inline(always)]
    pub(crate) fn locate_fixnum(
        &self,
        heap: &Heap,
        table: Table,
        key: Value,
        n: i64,
    ) -> Result<Lookup, Trouble> {
        match table.comparison(heap) {
            KeyComparison::Program => Err(Trouble::Slowly),
            KeyComparison::Native(KeyTest::Equalp) => self.locate_other(heap, table, key),
            KeyComparison::Native(_) => match self.last.find(heap, table, key) {
                Some((entry, value)) => Ok(Lookup::by_last(entry, value)),
                // A fixnum is the same as itself alone, and needs no better guess than its hash.
                None => search(heap, table, KeyTest::Eq, key, equality::fixnum_hash(n), Way::Guess),
            },
        }
    }

    /// As [`Lookups::locate`], for keys of any kind.
    #[inline(never)]
    pub(crate) fn locate_other(&self, heap: &Heap, table: Table, key: Value) -> Result<Lookup, Trouble> {
        let KeyComparison::Native(test) = table.comparison(heap) else { return Err(Trouble::Slowly) };
        if let Some((entry, value)) = self.last.find(heap, table, key) {
            return Ok(Lookup::by_last(entry, value));
        }
        if let Some(entry) = self.entries.guess(key, table.value(), table.serial(heap))
            && let Some(value) = table.value_of(heap, entry, key)
        {
            return Ok(Lookup { place: KeyPlace::Entry(entry, value), steps: 0, way: Way::Guess });
        }
        let (hash, work) = equality::hash_with_work(heap, test, key);
        let mut found = search(heap, table, test, key, hash, Way::Search)?;
        found.steps += work;
        Ok(found)
    }

    /// Notes what a search has found.
    #[inline(always)]
    pub(crate) fn note(&mut self, heap: &Heap, table: Table, key: Value, found: &Lookup) {
        if found.way == Way::Last {
            return;
        }
        if let KeyPlace::Entry(entry, _) = found.place {
            self.last.note(key, entry);
            if found.way == Way::Search
                && found.steps < STEPS_FOR_NOTHING
                // Of a key that is equal only, the next search will not ask again.
                && table.value_of(heap, entry, key).is_some()
            {
                self.entries.note(key, table.value(), table.serial(heap), entry);
            }
        }
    }
}

#[inline(always)]
fn search(
    heap: &Heap,
    table: Table,
    test: KeyTest,
    key: Value,
    hash: u32,
    way: Way,
) -> Result<Lookup, Trouble> {
    let mut left = MOST_STEPS;
    let place = match table.find(heap, test, key, hash, &mut left)? {
        Some((entry, value)) => KeyPlace::Entry(entry, value),
        None => KeyPlace::None(hash),
    };
    Ok(Lookup { place, steps: MOST_STEPS - left, way })
}

/// The entries that searches for keys other than integers have lately led to, by which later ones for the
/// very same keys are guessed: a text is not read then, nor its hash computed.
///
/// A guess holds if the entry has that very key, and the table has got and lost none since, so that a search
/// would take what it has taken then: less than what is charged for. So ticks do not depend on guesses.
#[derive(Debug, Default)]
struct FoundEntries {
    /// Number of an entry, then serial of its table, then a part of the hash of key and table, at the place
    /// that the rest of the hash gives. Empty until the first search.
    places: Box<[u64]>,
}

impl FoundEntries {
    const PLACES: usize = 1 << 14;
    /// Bits of the number of an entry.
    const ENTRY: u32 = 28;
    /// Bits of the serial.
    const SERIAL: u32 = 24;

    /// Returns the place for a key of a table, and what it holds if it is for them, but for the entry.
    #[inline(always)]
    fn place(key: Value, table: Value, serial: usize) -> (usize, u64) {
        let hash = (key.bits() ^ table.bits().rotate_left(32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let rest = hash >> (FoundEntries::ENTRY + FoundEntries::SERIAL - 14) & 0xfff;
        let serial = serial as u64 & ((1 << FoundEntries::SERIAL) - 1);
        let place = hash >> (u64::BITS - FoundEntries::PLACES.ilog2());
        (place as usize, rest << FoundEntries::SERIAL | serial)
    }

    /// Returns the number of the entry that probably has a key.
    #[inline(always)]
    fn guess(&self, key: Value, table: Value, serial: usize) -> Option<usize> {
        let (place, expected) = FoundEntries::place(key, table, serial);
        let found = *self.places.get(place)?;
        let is_same = found >> FoundEntries::ENTRY == expected;
        if is_same { Some(found as usize & ((1 << FoundEntries::ENTRY) - 1)) } else { None }
    }

    /// Notes that a search, for which nothing is charged, led to an entry.
    #[inline(always)]
    fn note(&mut self, key: Value, table: Value, serial: usize, entry: usize) {
        if self.places.is_empty() {
            self.places = vec![0; FoundEntries::PLACES].into();
        }
        let (place, expected) = FoundEntries::place(key, table, serial);
        if let Some(place) = self.places.get_mut(place) {
            *place = expected << FoundEntries::ENTRY | entry as u64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heap::HeapConfig;
    use crate::trust::new_heap;

    fn text(heap: &mut Heap, text: &str) -> Value {
        heap.alloc_str(text).expect("there is room")
    }

    fn equal_table(heap: &mut Heap) -> Table {
        let comparison = KeyComparison::Native(KeyTest::Equal);
        let table = Table::make(heap, comparison, 8, [Value::NIL; 2]).expect("there is room");
        Table::of(heap, table).expect("it is a table")
    }

    /// Finds and notes a key, and returns its value and whether that took a search.
    fn find(lookups: &mut Lookups, heap: &Heap, table: Table, key: Value) -> (Option<Value>, bool) {
        let found = lookups.locate(heap, table, key).expect("it takes little");
        lookups.note(heap, table, key, &found);
        let value = match found.place {
            KeyPlace::Entry(_, value) => Some(value),
            KeyPlace::None(_) => None,
        };
        (value, found.way == Way::Search)
    }

    #[test]
    fn the_very_same_key_is_searched_once_until_its_table_changes() {
        let mut heap = new_heap(HeapConfig::default());
        let mut lookups = Lookups::default();
        let (table, other) = (equal_table(&mut heap), equal_table(&mut heap));
        let keys: Vec<Value> = (0..50).map(|i| text(&mut heap, &format!("key {i}"))).collect();
        for (i, &key) in keys.iter().enumerate() {
            let hash = equality::hash(&heap, KeyTest::Equal, key);
            table.add(&mut heap, hash, key, Value::index(i)).expect("there is room");
        }
        for round in 0..3 {
            for (i, &key) in keys.iter().enumerate() {
                assert_eq!(find(&mut lookups, &heap, table, key), (Some(Value::index(i)), round == 0), "{i}");
                assert_eq!(find(&mut lookups, &heap, other, key), (None, true), "{i}");
            }
        }
        // An equal key leads to the same entry, by a search each time.
        let (equal, another) = (text(&mut heap, "key 7"), text(&mut heap, "key 8"));
        for _ in 0..3 {
            assert_eq!(find(&mut lookups, &heap, table, equal), (Some(Value::index(7)), true));
            assert_eq!(find(&mut lookups, &heap, table, another), (Some(Value::index(8)), true));
        }
        let found = lookups.locate(&heap, table, keys[0]).expect("it takes little");
        let KeyPlace::Entry(entry, _) = found.place else { panic!("it is there") };
        let hash = equality::hash(&heap, KeyTest::Equal, keys[0]);
        assert!(table.delete(&mut heap, entry, hash));
        assert_eq!(find(&mut lookups, &heap, table, keys[0]), (None, true));
        assert_eq!(find(&mut lookups, &heap, table, keys[1]), (Some(Value::index(1)), true));
        // Another key in the same entry is not taken for the first.
        let hash = equality::hash(&heap, KeyTest::Equal, another);
        table.add(&mut heap, hash, another, Value::T).expect("there is room");
        assert_eq!(find(&mut lookups, &heap, table, keys[0]), (None, true));
    }

    /// Keys that need steps for which something is charged are searched each time, since that is charged.
    #[test]
    fn what_is_charged_for_is_searched_each_time() {
        let mut heap = new_heap(HeapConfig::default());
        let mut lookups = Lookups::default();
        let table = equal_table(&mut heap);
        let keys: Vec<Value> = (0..40).map(|i| text(&mut heap, &format!("key {i}"))).collect();
        let key = keys[0];
        let hash = equality::hash(&heap, KeyTest::Equal, key);
        for &key in &keys {
            // All are in one chain, the first at its end.
            table.add(&mut heap, hash, key, Value::T).expect("there is room");
        }
        for _ in 0..3 {
            let found = lookups.locate(&heap, table, key).expect("it takes little");
            assert!(found.steps >= 39 && found.way == Way::Search, "{}", found.steps);
            let last = std::mem::take(&mut lookups.last);
            lookups.note(&heap, table, key, &found);
            lookups.last = last;
        }
    }
}
