//! Hash tables: entries in the order of insertion, found by linear hashing.
//!
//! ```text
//! table   | count | used | free | pairs | words | test | hash | serial |     header.aux: which test
//! pairs   directory of simple vectors:  | key | value | key | value | ...
//! words   directory of Words32:         | head | hash | next | head | hash | next | ...
//! ```
//!
//! Entry `i` has its key and value in `pairs`, the hash of its key and the number of the next entry of its bucket in
//! `words`; bucket `i` has its first entry in `head` of the same place. Numbers of entries are one too high, so that 0
//! ends a chain. A segment of the directories holds [`SEGMENT`] entries; only the first one grows, by doubling.
//!
//! Invariant: a table has as many buckets as entries were ever in use (at least one). So each new entry adds one bucket,
//! and that takes its share from one other bucket; nothing is ever rehashed at once, and no operation takes time in
//! proportion to the size of the table. What was removed leaves a free entry, and the last one freed is the first to be
//! taken again, which is also where SBCL puts a new key: the order of iteration is the same.
//!
//! Not here: tests that are functions of the program. ESL calls them, over [`Table::candidates`], and [`Table::serial`] says
//! whether keys came or went meanwhile.
//! Source: Larson, "Dynamic hash tables", 1988, for growing by one bucket. We keep the entries apart from the
//! buckets, for the order.

use crate::equality::{self, Test};
use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;

/// Entries of a segment.
pub(crate) const SEGMENT: usize = 1 << SHIFT;
const SHIFT: usize = 12;
/// Entries for which a new table has room.
const LEAST: usize = 8;

const COUNT: usize = 0;
const USED: usize = 1;
const FREE: usize = 2;
const PAIRS: usize = 3;
const WORDS: usize = 4;
const TEST: usize = 5;
const HASH: usize = 6;
const SERIAL: usize = 7;

/// How a table compares keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Comparison {
    /// By a test of the machine.
    Native(Test),
    /// By a function of the program.
    Program,
}

/// Why an operation was not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trouble {
    /// The comparison of keys takes too much work, or a function of the program.
    Slowly,
    /// There is no room.
    Room(AllocError),
}

impl From<AllocError> for Trouble {
    fn from(error: AllocError) -> Trouble {
        Trouble::Room(error)
    }
}

/// A table, checked to be one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Table(Value);

impl Table {
    /// The table that `v` is, if it is one.
    #[inline]
    pub(crate) fn of(heap: &Heap, v: Value) -> Option<Table> {
        if heap.is(v, Kind::HashTable) { Some(Table(v)) } else { None }
    }

    /// A new table with room for about `size` entries. `test` and `hash` are the functions of the program, or `NIL`.
    ///
    /// # Errors
    /// As for every allocation.
    pub(crate) fn make(
        heap: &mut Heap,
        comparison: Comparison,
        size: usize,
        functions: [Value; 2],
    ) -> Result<Value, AllocError> {
        let room = size.clamp(LEAST, SEGMENT).next_power_of_two();
        let [pairs, words] = fresh_directories(heap, room)?;
        let zero = Value::small(0);
        let slots = [zero, zero, zero, pairs, words, functions[0], functions[1], zero];
        let number = match comparison {
            Comparison::Native(Test::Eq) => 0,
            Comparison::Native(Test::Eql) => 1,
            Comparison::Native(Test::Equal) => 2,
            Comparison::Native(Test::Equalp) => 3,
            Comparison::Program => 4,
        };
        heap.alloc_record(Kind::HashTable, 0, number, &slots)
    }

    /// How it compares keys.
    #[inline]
    pub(crate) fn comparison(self, heap: &Heap) -> Comparison {
        match heap.header(self.0).map_or(0, |header| header.aux) {
            0 => Comparison::Native(Test::Eq),
            1 => Comparison::Native(Test::Eql),
            2 => Comparison::Native(Test::Equal),
            3 => Comparison::Native(Test::Equalp),
            _ => Comparison::Program,
        }
    }

    #[inline]
    fn slot(self, heap: &Heap, index: usize) -> Value {
        heap.record(self.0, Kind::HashTable).map_or(Value::NIL, |slots| slots[index])
    }

    #[inline]
    fn number(self, heap: &Heap, index: usize) -> usize {
        self.slot(heap, index).as_index().unwrap_or(0)
    }

    fn set_number(self, heap: &mut Heap, index: usize, n: usize) {
        heap.record_set(self.0, Kind::HashTable, index, Value::index(n));
    }

    /// Number of keys.
    pub(crate) fn count(self, heap: &Heap) -> usize {
        self.number(heap, COUNT)
    }

    /// Number of entries that were ever in use: where iteration ends.
    pub(crate) fn used(self, heap: &Heap) -> usize {
        self.number(heap, USED)
    }

    /// Entries for which there is room without more memory.
    pub(crate) fn room(self, heap: &Heap) -> usize {
        self.view(heap).room()
    }

    /// The functions of the program by which it compares and hashes, or `NIL`.
    pub(crate) fn functions(self, heap: &Heap) -> [Value; 2] {
        [self.slot(heap, TEST), self.slot(heap, HASH)]
    }

    #[inline]
    fn view(self, heap: &Heap) -> View<'_> {
        let slots = heap.record(self.0, Kind::HashTable).unwrap_or(&[Value::NIL; 8]);
        View {
            heap,
            pairs: heap.vector(slots[PAIRS]).unwrap_or_default(),
            words: heap.vector(slots[WORDS]).unwrap_or_default(),
            buckets: slots[USED].as_index().unwrap_or(0).max(1),
        }
    }

    /// A number that changes whenever a key comes or goes.
    pub(crate) fn serial(self, heap: &Heap) -> usize {
        self.number(heap, SERIAL)
    }

    fn advance(self, heap: &mut Heap) {
        // Nobody waits for as many changes as there are fixnums.
        let next = self.serial(heap).wrapping_add(1) & (Value::FIXNUM_MAX as usize);
        self.set_number(heap, SERIAL, next);
    }

    /// The entries whose keys have this hash, with the keys.
    pub(crate) fn candidates(self, heap: &Heap, hash: u32) -> Vec<(usize, Value)> {
        let view = self.view(heap);
        let mut found = Vec::new();
        let mut next = view.word(view.bucket(hash), 0);
        while next != 0 {
            let entry = next as usize - 1;
            let [_, other, after] = view.words_of(entry);
            if other == hash
                && let Some((key, _)) = view.pair(entry)
            {
                found.push((entry, key));
            }
            next = after;
        }
        found
    }

    /// Key and value of an entry; `None` for one that is free or was never used.
    #[inline]
    pub(crate) fn entry(self, heap: &Heap, entry: usize) -> Option<(Value, Value)> {
        let (key, value) = self.view(heap).pair(entry)?;
        if key == Value::UNBOUND { None } else { Some((key, value)) }
    }

    /// Gives an entry another value.
    pub(crate) fn set_value(self, heap: &mut Heap, entry: usize, value: Value) {
        if let Some(pairs) = self.pairs_of(heap, entry) {
            heap.vector_set(pairs, 2 * (entry & (SEGMENT - 1)) + 1, value);
        }
    }

    /// The entry of `key`, with a test of the machine; `hash` is the key's.
    #[inline]
    pub(crate) fn find(
        self,
        heap: &Heap,
        test: Test,
        key: Value,
        hash: u32,
        work: &mut usize,
    ) -> Result<Option<usize>, Trouble> {
        let view = self.view(heap);
        let mut next = view.word(view.bucket(hash), 0);
        while next != 0 {
            let entry = next as usize - 1;
            let [_, other, after] = view.words_of(entry);
            if other == hash {
                let (candidate, _) = view.pair(entry).unwrap_or((Value::UNBOUND, Value::NIL));
                match equality::same(heap, test, key, candidate, work) {
                    Some(true) => return Ok(Some(entry)),
                    Some(false) => {}
                    None => return Err(Trouble::Slowly),
                }
            }
            *work = work.checked_sub(1).ok_or(Trouble::Slowly)?;
            next = after;
        }
        Ok(None)
    }

    /// Adds an entry for a key that the table does not have.
    ///
    /// # Errors
    /// As for every allocation; nothing has changed then.
    pub(crate) fn add(self, heap: &mut Heap, hash: u32, key: Value, value: Value) -> Result<(), AllocError> {
        let free = self.number(heap, FREE);
        let entry = if free > 0 {
            let next = self.view(heap).word(free - 1, 2);
            self.set_number(heap, FREE, next as usize);
            free - 1
        } else {
            let used = self.used(heap);
            if used == self.room(heap) {
                self.grow(heap, used)?;
            }
            self.set_number(heap, USED, used + 1);
            if used > 0 {
                self.split(heap, used);
            }
            used
        };
        if let Some(pairs) = self.pairs_of(heap, entry) {
            let at = 2 * (entry & (SEGMENT - 1));
            heap.vector_set(pairs, at, key);
            heap.vector_set(pairs, at + 1, value);
        }
        self.set_word(heap, entry, 1, hash);
        self.link(heap, entry, hash);
        let count = self.count(heap);
        self.set_number(heap, COUNT, count + 1);
        self.advance(heap);
        Ok(())
    }

    /// Frees an entry that is in use.
    pub(crate) fn delete(self, heap: &mut Heap, entry: usize) {
        let view = self.view(heap);
        let number = entry as u32 + 1;
        let bucket = view.bucket(view.word(entry, 1));
        let after = view.word(entry, 2);
        let mut before = view.word(bucket, 0);
        if before == number {
            self.set_word(heap, bucket, 0, after);
        } else {
            while before != 0 && view.word(before as usize - 1, 2) != number {
                before = view.word(before as usize - 1, 2);
            }
            if before == 0 {
                return;
            }
            self.set_word(heap, before as usize - 1, 2, after);
        }
        if let Some(pairs) = self.pairs_of(heap, entry) {
            let at = 2 * (entry & (SEGMENT - 1));
            heap.vector_set(pairs, at, Value::UNBOUND);
            heap.vector_set(pairs, at + 1, Value::NIL);
        }
        let free = self.number(heap, FREE);
        self.set_word(heap, entry, 2, free as u32);
        self.set_number(heap, FREE, entry + 1);
        let count = self.count(heap);
        self.set_number(heap, COUNT, count - 1);
        self.advance(heap);
    }

    /// Forgets all entries.
    ///
    /// # Errors
    /// As for every allocation; nothing has changed then.
    pub(crate) fn clear(self, heap: &mut Heap) -> Result<(), AllocError> {
        let room = self.room(heap).min(SEGMENT);
        let [pairs, words] = fresh_directories(heap, room)?;
        heap.record_set(self.0, Kind::HashTable, PAIRS, pairs);
        heap.record_set(self.0, Kind::HashTable, WORDS, words);
        for slot in [COUNT, USED, FREE] {
            self.set_number(heap, slot, 0);
        }
        self.advance(heap);
        Ok(())
    }

    /// Makes room for one entry at least: twice the first segment, or one segment more.
    fn grow(self, heap: &mut Heap, room: usize) -> Result<(), AllocError> {
        let (old_pairs, old_words) = (self.slot(heap, PAIRS), self.slot(heap, WORDS));
        if room < SEGMENT {
            let first = heap.vector(old_pairs).and_then(|segments| heap.vector(segments[0]));
            let mut pairs = first.unwrap_or_default().to_vec();
            pairs.resize(4 * room, Value::UNBOUND);
            let first = heap.vector(old_words).and_then(|segments| heap.words(segments[0]));
            let mut words = first.unwrap_or_default().to_vec();
            words.resize(6 * room, 0);
            let new_pairs = heap.alloc_vector(&pairs)?;
            let new_words = heap.alloc_words(words.len(), 0)?;
            if let Some(slots) = heap.words_mut(new_words) {
                slots.copy_from_slice(&words);
            }
            heap.vector_set(old_pairs, 0, new_pairs);
            heap.vector_set(old_words, 0, new_words);
            return Ok(());
        }
        let segments = room >> SHIFT;
        let pairs = heap.alloc_vector_filled(2 * SEGMENT, Value::UNBOUND)?;
        let words = heap.alloc_words(3 * SEGMENT, 0)?;
        let length = heap.vector(old_pairs).map_or(0, <[Value]>::len);
        if segments < length {
            heap.vector_set(old_pairs, segments, pairs);
            heap.vector_set(old_words, segments, words);
            return Ok(());
        }
        // The directories are a thousandth of the table, so copying them is a small matter.
        let mut larger = [old_pairs, old_words];
        for (directory, segment) in larger.iter_mut().zip([pairs, words]) {
            let mut entries = heap.vector(*directory).unwrap_or_default().to_vec();
            entries.push(segment);
            entries.resize(2 * length.max(1), Value::NIL);
            *directory = heap.alloc_vector(&entries)?;
        }
        heap.record_set(self.0, Kind::HashTable, PAIRS, larger[0]);
        heap.record_set(self.0, Kind::HashTable, WORDS, larger[1]);
        Ok(())
    }

    /// Moves to the new bucket `new`, the last one, what belongs there from the bucket that has held it so far.
    fn split(self, heap: &mut Heap, new: usize) {
        let old = new - (1 << new.ilog2());
        let mut next = self.view(heap).word(old, 0);
        let mut keeps = old;
        let mut word = 0;
        // `keeps` and `word` say where the number of the next entry that stays belongs.
        while next != 0 {
            let entry = next as usize - 1;
            let view = self.view(heap);
            let [_, hash, after] = view.words_of(entry);
            if view.bucket(hash) == new {
                let head = view.word(new, 0);
                self.set_word(heap, entry, 2, head);
                self.set_word(heap, new, 0, next);
            } else {
                self.set_word(heap, keeps, word, next);
                (keeps, word) = (entry, 2);
            }
            next = after;
        }
        self.set_word(heap, keeps, word, 0);
    }

    /// Puts an entry at the head of its bucket.
    fn link(self, heap: &mut Heap, entry: usize, hash: u32) {
        let view = self.view(heap);
        let bucket = view.bucket(hash);
        let head = view.word(bucket, 0);
        self.set_word(heap, entry, 2, head);
        self.set_word(heap, bucket, 0, entry as u32 + 1);
    }

    fn pairs_of(self, heap: &Heap, entry: usize) -> Option<Value> {
        self.view(heap).pairs.get(entry >> SHIFT).copied()
    }

    #[inline]
    fn set_word(self, heap: &mut Heap, entry: usize, word: usize, n: u32) {
        let words = self.view(heap).words.get(entry >> SHIFT).copied().unwrap_or(Value::NIL);
        if let Some(slot) =
            heap.words_mut(words).and_then(|words| words.get_mut(3 * (entry & (SEGMENT - 1)) + word))
        {
            *slot = n;
        }
    }
}

/// The parts of a table, to be read.
struct View<'a> {
    heap: &'a Heap,
    pairs: &'a [Value],
    words: &'a [Value],
    buckets: usize,
}

impl View<'_> {
    /// The bucket of a hash: its low bits, one fewer where that bucket is still to come.
    #[inline]
    fn bucket(&self, hash: u32) -> usize {
        let mask = self.buckets.next_power_of_two() - 1;
        let bucket = hash as usize & mask;
        if bucket < self.buckets { bucket } else { bucket & mask >> 1 }
    }

    /// Head, hash and next at the place of an entry; zeros where there is none.
    #[inline]
    fn words_of(&self, entry: usize) -> [u32; 3] {
        let words = self.words.get(entry >> SHIFT).and_then(|&words| self.heap.words(words));
        let at = 3 * (entry & (SEGMENT - 1));
        words.and_then(|words| words.get(at..at + 3)?.try_into().ok()).unwrap_or([0; 3])
    }

    #[inline]
    fn word(&self, entry: usize, word: usize) -> u32 {
        self.words_of(entry)[word]
    }

    #[inline]
    fn pair(&self, entry: usize) -> Option<(Value, Value)> {
        let pairs = self.heap.vector(*self.pairs.get(entry >> SHIFT)?)?;
        let at = 2 * (entry & (SEGMENT - 1));
        match pairs.get(at..at + 2)? {
            &[key, value] => Some((key, value)),
            _ => None,
        }
    }

    fn room(&self) -> usize {
        let full = self.pairs.iter().filter(|segment| segment.is_true()).count();
        let first =
            self.pairs.first().and_then(|&pairs| self.heap.vector(pairs)).map_or(0, <[Value]>::len) / 2;
        if full <= 1 { first } else { full << SHIFT }
    }
}

/// Directories with one empty segment each.
fn fresh_directories(heap: &mut Heap, room: usize) -> Result<[Value; 2], AllocError> {
    let pairs = heap.alloc_vector_filled(2 * room, Value::UNBOUND)?;
    let words = heap.alloc_words(3 * room, 0)?;
    Ok([heap.alloc_vector(&[pairs])?, heap.alloc_vector(&[words])?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashMap;

    /// What a table must be: slots in order, the last one freed taken first.
    #[derive(Default)]
    struct Model {
        slots: Vec<Option<(i32, i32)>>,
        free: Vec<usize>,
        places: HashMap<i32, usize>,
    }

    impl Model {
        fn put(&mut self, key: i32, value: i32) {
            let place = *self.places.entry(key).or_insert_with(|| {
                self.free.pop().unwrap_or_else(|| {
                    self.slots.push(None);
                    self.slots.len() - 1
                })
            });
            self.slots[place] = Some((key, value));
        }

        fn remove(&mut self, key: i32) -> bool {
            match self.places.remove(&key) {
                Some(place) => {
                    self.slots[place] = None;
                    self.free.push(place);
                    true
                }
                None => false,
            }
        }

        fn entries(&self) -> Vec<(i32, i32)> {
            self.slots.iter().flatten().copied().collect()
        }
    }

    fn new(heap: &mut Heap, test: Test) -> Table {
        let v = Table::make(heap, Comparison::Native(test), 0, [Value::NIL; 2]).unwrap();
        Table::of(heap, v).unwrap()
    }

    fn find(heap: &Heap, table: Table, key: i32) -> Option<usize> {
        let key = Value::small(key);
        let hash = equality::hash(heap, Test::Eql, key);
        table.find(heap, Test::Eql, key, hash, &mut 4096).unwrap()
    }

    fn put(heap: &mut Heap, table: Table, key: i32, value: i32) {
        match find(heap, table, key) {
            Some(entry) => table.set_value(heap, entry, Value::small(value)),
            None => {
                let hash = equality::hash(heap, Test::Eql, Value::small(key));
                table.add(heap, hash, Value::small(key), Value::small(value)).unwrap();
            }
        }
    }

    fn entries(heap: &Heap, table: Table) -> Vec<(i32, i32)> {
        let small = |v: Value| v.as_fixnum().unwrap() as i32;
        let used = 0..table.used(heap);
        used.filter_map(|entry| table.entry(heap, entry)).map(|(k, v)| (small(k), small(v))).collect()
    }

    proptest! {
        #[test]
        fn agrees_with_the_model(
            range in prop_oneof![Just(4), Just(30), Just(500)],
            operations in prop::collection::vec((0u8..10, any::<u16>(), any::<i16>()), 0..800),
        ) {
            let mut heap = Heap::for_tests();
            let table = new(&mut heap, Test::Eql);
            let mut model = Model::default();
            for (operation, key, value) in operations {
                let (key, value) = (i32::from(key) % range, i32::from(value));
                match operation {
                    0..6 => {
                        put(&mut heap, table, key, value);
                        model.put(key, value);
                    }
                    6..9 => {
                        let found = find(&heap, table, key);
                        if let Some(entry) = found {
                            table.delete(&mut heap, entry);
                        }
                        prop_assert_eq!(found.is_some(), model.remove(key));
                    }
                    _ if value % 16 == 0 => {
                        table.clear(&mut heap).unwrap();
                        model = Model::default();
                    }
                    _ => prop_assert_eq!(find(&heap, table, key).is_some(), model.places.contains_key(&key)),
                }
                prop_assert_eq!(table.count(&heap), model.places.len());
            }
            prop_assert_eq!(entries(&heap, table), model.entries());
            for key in model.places.keys() {
                prop_assert!(find(&heap, table, *key).is_some());
            }
        }
    }

    #[test]
    fn a_large_table_keeps_everything() {
        let mut heap = Heap::for_tests();
        let table = new(&mut heap, Test::Eql);
        let n = 3 * SEGMENT as i32 + 17;
        for key in 0..n {
            put(&mut heap, table, key * 7, key);
        }
        assert_eq!(table.count(&heap), n as usize);
        for key in 0..n {
            let entry = find(&heap, table, key * 7).unwrap();
            assert_eq!(table.entry(&heap, entry), Some((Value::small(key * 7), Value::small(key))));
            assert_eq!(find(&heap, table, key * 7 + 1), None);
        }
        for key in (0..n).step_by(2) {
            let entry = find(&heap, table, key * 7).unwrap();
            table.delete(&mut heap, entry);
        }
        let expected: Vec<(i32, i32)> = (0..n).skip(1).step_by(2).map(|key| (key * 7, key)).collect();
        assert_eq!(entries(&heap, table), expected);
        for key in 0..n {
            put(&mut heap, table, -key - 1, key);
        }
        assert_eq!(table.count(&heap), expected.len() + n as usize);
        assert_eq!(
            find(&heap, table, 7).map(|entry| table.entry(&heap, entry).unwrap().1),
            Some(Value::small(1))
        );
    }

    #[test]
    fn keys_of_one_hash_are_candidates() {
        let mut heap = Heap::for_tests();
        let table = new(&mut heap, Test::Eql);
        for key in 0..20 {
            table.add(&mut heap, 5 + 8 * (key as u32 % 2), Value::small(key), Value::NIL).unwrap();
        }
        let candidates = table.candidates(&heap, 5);
        let mut keys: Vec<i64> = candidates.iter().map(|(_, key)| key.as_fixnum().unwrap()).collect();
        keys.sort_unstable();
        assert_eq!(keys, (0..20).step_by(2).collect::<Vec<i64>>());
        assert!(candidates.iter().all(|&(entry, key)| table.entry(&heap, entry) == Some((key, Value::NIL))));
        assert_eq!(table.candidates(&heap, 6), []);
        let before = table.serial(&heap);
        table.set_value(&mut heap, 3, Value::T);
        assert_eq!(table.serial(&heap), before);
        table.delete(&mut heap, 3);
        assert_ne!(table.serial(&heap), before);
    }
}
