//! Hash tables: entries in the order of insertion, found by linear hashing.
//!
//! ```text
//! table     | count | used | free | room | entries | heads | test | hash | serial |      header.aux: which test
//! entries   directory of simple vectors:  | key | value | link | key | value | link | ...
//! heads     directory of Words32:         | head | head | head | ...
//! ```
//!
//! The link of an entry is a fixnum of the hash of its key (32 bits) and the number of the next entry of its bucket
//! (29 bits). Numbers of entries are one too high in links and heads, so that 0 ends a chain. So a search touches one
//! word of the heads, and what it needs of an entry is together. A segment of the directories holds [`SEGMENT`] entries,
//! or the [`PER_ENTRY`] buckets of each; only the first one grows, by doubling.
//!
//! Invariant: a table has [`PER_ENTRY`] buckets for each entry that was ever in use (and for one at least). So each new
//! entry adds as many, and each of these takes its share from one other bucket; nothing is ever rehashed at once, and no
//! operation takes time in proportion to the size of the table. What was removed leaves a free entry, and the last one freed is the first to be
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
/// Buckets for each entry. With one, a search for a key that is not there looks at one entry on the average, which may be
/// anywhere in memory; with two at half of one.
const PER_ENTRY: usize = 2;
/// Entries for which a new table has room.
const LEAST: usize = 8;

/// Values of an entry in its segment.
const ENTRY: usize = 3;

const COUNT: usize = 0;
const USED: usize = 1;
const FREE: usize = 2;
const ROOM: usize = 3;
const ENTRIES: usize = 4;
const HEADS: usize = 5;
const TEST: usize = 6;
const HASH: usize = 7;
const SERIAL: usize = 8;
const SLOTS: usize = 9;

/// Bits of a link that are the number of the next entry.
const NEXT_BITS: u32 = 29;
/// Entries that a table may have: what those bits count.
const MOST: usize = (1 << NEXT_BITS) - 1;

/// Hash and next entry, as the link of an entry.
fn link(hash: u32, next: usize) -> Value {
    Value::index((hash as usize) << NEXT_BITS | next)
}

/// Hash and next entry in a link.
#[inline]
fn unlink(link: Value) -> (u32, usize) {
    let word = link.as_index().unwrap_or(0);
    ((word >> NEXT_BITS) as u32, word & MOST)
}

/// Where an entry has its values in its segment.
#[inline]
fn place(entry: usize) -> usize {
    ENTRY * (entry & (SEGMENT - 1))
}

/// The segment of the heads that a bucket has its head in, and where.
#[inline]
fn place_of_head(bucket: usize) -> (usize, usize) {
    (bucket / (PER_ENTRY * SEGMENT), bucket % (PER_ENTRY * SEGMENT))
}

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
        let [entries, heads] = fresh_directories(heap, room)?;
        let mut slots = [Value::small(0); SLOTS];
        slots[ROOM] = Value::index(room);
        slots[ENTRIES] = entries;
        slots[HEADS] = heads;
        slots[TEST] = functions[0];
        slots[HASH] = functions[1];
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
        self.number(heap, ROOM)
    }

    /// The functions of the program by which it compares and hashes, or `NIL`.
    pub(crate) fn functions(self, heap: &Heap) -> [Value; 2] {
        [self.slot(heap, TEST), self.slot(heap, HASH)]
    }

    #[inline]
    fn view(self, heap: &Heap) -> View<'_> {
        let slots = heap.record(self.0, Kind::HashTable).and_then(<[Value]>::first_chunk::<SLOTS>);
        let slots = slots.unwrap_or(&[Value::NIL; SLOTS]);
        View {
            heap,
            entries: heap.vector(slots[ENTRIES]).unwrap_or_default(),
            heads: heap.vector(slots[HEADS]).unwrap_or_default(),
            buckets: PER_ENTRY * slots[USED].as_index().unwrap_or(0).max(1),
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
        let mut next = view.head(view.bucket(hash));
        while next != 0 {
            let [key, _, link] = view.entry(next - 1);
            let (other, after) = unlink(link);
            if other == hash {
                found.push((next - 1, key));
            }
            next = after;
        }
        found
    }

    /// Key and value of an entry; `None` for one that is free or was never used.
    #[inline]
    pub(crate) fn entry(self, heap: &Heap, entry: usize) -> Option<(Value, Value)> {
        let [key, value, _] = self.view(heap).entry(entry);
        if key == Value::UNBOUND { None } else { Some((key, value)) }
    }

    /// The value of an entry, if it has this very key.
    #[inline]
    pub(crate) fn value_of(self, heap: &Heap, entry: usize, key: Value) -> Option<Value> {
        let [candidate, value, _] = self.view(heap).entry(entry);
        if candidate == key && key != Value::UNBOUND { Some(value) } else { None }
    }

    /// Gives an entry another value.
    pub(crate) fn set_value(self, heap: &mut Heap, entry: usize, value: Value) {
        let segment = self.segment(heap, entry);
        heap.vector_set(segment, place(entry) + 1, value);
    }

    /// The entry of `key` and its value, with a test of the machine; `hash` is the key's.
    #[inline]
    pub(crate) fn find(
        self,
        heap: &Heap,
        test: Test,
        key: Value,
        hash: u32,
        work: &mut usize,
    ) -> Result<Option<(usize, Value)>, Trouble> {
        let view = self.view(heap);
        let mut next = view.head(view.bucket(hash));
        while next != 0 {
            let [candidate, value, link] = view.entry(next - 1);
            let (other, after) = unlink(link);
            // Where hashes differ, so do keys; that one key is another's very object is seen faster still.
            if candidate == key {
                return Ok(Some((next - 1, value)));
            }
            if other == hash && test != Test::Eq {
                match equality::same(heap, test, key, candidate, work) {
                    Some(true) => return Ok(Some((next - 1, value))),
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
            let (_, next) = unlink(self.view(heap).entry(free - 1)[2]);
            self.set_number(heap, FREE, next);
            free - 1
        } else {
            let used = self.used(heap);
            if used == self.room(heap) {
                self.grow(heap, used)?;
            }
            self.set_number(heap, USED, used + 1);
            if used > 0 {
                (PER_ENTRY * used..PER_ENTRY * (used + 1)).for_each(|bucket| self.split(heap, bucket));
            }
            used
        };
        let bucket = self.view(heap).bucket(hash);
        let head = self.view(heap).head(bucket);
        let segment = self.segment(heap, entry);
        for (offset, v) in [key, value, link(hash, head)].into_iter().enumerate() {
            heap.vector_set(segment, place(entry) + offset, v);
        }
        self.set_head(heap, bucket, entry + 1);
        let count = self.count(heap);
        self.set_number(heap, COUNT, count + 1);
        self.advance(heap);
        Ok(())
    }

    /// Frees an entry that is in use.
    pub(crate) fn delete(self, heap: &mut Heap, entry: usize) {
        let view = self.view(heap);
        let (hash, after) = unlink(view.entry(entry)[2]);
        let bucket = view.bucket(hash);
        let mut before = view.head(bucket);
        if before == entry + 1 {
            self.set_head(heap, bucket, after);
        } else {
            while before != 0 {
                let (other, next) = unlink(view.entry(before - 1)[2]);
                if next == entry + 1 {
                    self.set_link(heap, before - 1, link(other, after));
                    break;
                }
                before = next;
            }
        }
        let free = self.number(heap, FREE);
        let segment = self.segment(heap, entry);
        for (offset, v) in [Value::UNBOUND, Value::NIL, link(0, free)].into_iter().enumerate() {
            heap.vector_set(segment, place(entry) + offset, v);
        }
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
        let [entries, heads] = fresh_directories(heap, room)?;
        heap.record_set(self.0, Kind::HashTable, ENTRIES, entries);
        heap.record_set(self.0, Kind::HashTable, HEADS, heads);
        for slot in [COUNT, USED, FREE] {
            self.set_number(heap, slot, 0);
        }
        self.set_number(heap, ROOM, room);
        self.advance(heap);
        Ok(())
    }

    /// Makes room for one entry at least: twice the first segment, or one segment more.
    fn grow(self, heap: &mut Heap, room: usize) -> Result<(), AllocError> {
        let (old_entries, old_heads) = (self.slot(heap, ENTRIES), self.slot(heap, HEADS));
        if room >= MOST - SEGMENT {
            return Err(AllocError::TooLarge { requested: 8 * ENTRY * MOST });
        }
        if room < SEGMENT {
            let first = heap.vector(old_entries).and_then(|segments| heap.vector(segments[0]));
            let mut entries = first.unwrap_or_default().to_vec();
            entries.resize(2 * ENTRY * room, Value::UNBOUND);
            let first = heap.vector(old_heads).and_then(|segments| heap.words(segments[0]));
            let heads = first.unwrap_or_default().to_vec();
            let new_entries = heap.alloc_vector(&entries)?;
            let new_heads = heap.alloc_words(2 * PER_ENTRY * room, 0)?;
            if let Some(slots) = heap.words_mut(new_heads) {
                slots[..heads.len()].copy_from_slice(&heads);
            }
            heap.vector_set(old_entries, 0, new_entries);
            heap.vector_set(old_heads, 0, new_heads);
            self.set_number(heap, ROOM, 2 * room);
            return Ok(());
        }
        let segments = room >> SHIFT;
        let entries = heap.alloc_vector_filled(ENTRY * SEGMENT, Value::UNBOUND)?;
        let heads = heap.alloc_words(PER_ENTRY * SEGMENT, 0)?;
        let length = heap.vector(old_entries).map_or(0, <[Value]>::len);
        if segments < length {
            heap.vector_set(old_entries, segments, entries);
            heap.vector_set(old_heads, segments, heads);
        } else {
            // The directories are a small part of a thousandth of the table, so copying them is a small matter.
            let mut larger = [old_entries, old_heads];
            for (directory, segment) in larger.iter_mut().zip([entries, heads]) {
                let mut segments = heap.vector(*directory).unwrap_or_default().to_vec();
                segments.push(segment);
                segments.resize(2 * length.max(1), Value::NIL);
                *directory = heap.alloc_vector(&segments)?;
            }
            heap.record_set(self.0, Kind::HashTable, ENTRIES, larger[0]);
            heap.record_set(self.0, Kind::HashTable, HEADS, larger[1]);
        }
        self.set_number(heap, ROOM, room + SEGMENT);
        Ok(())
    }

    /// Moves to the new bucket `new`, which comes from no other new one, what belongs there from the bucket that has held it so far.
    fn split(self, heap: &mut Heap, new: usize) {
        let old = new - (1 << new.ilog2());
        let mut next = self.view(heap).head(old);
        let (mut stay, mut move_on) = (0, 0);
        // Both chains come out in reverse, which no search can tell.
        while next != 0 {
            let view = self.view(heap);
            let (hash, after) = unlink(view.entry(next - 1)[2]);
            let chain = if view.bucket(hash) == new { &mut move_on } else { &mut stay };
            self.set_link(heap, next - 1, link(hash, *chain));
            *chain = next;
            next = after;
        }
        self.set_head(heap, old, stay);
        self.set_head(heap, new, move_on);
    }

    fn segment(self, heap: &Heap, entry: usize) -> Value {
        self.view(heap).entries.get(entry >> SHIFT).copied().unwrap_or(Value::NIL)
    }

    fn set_link(self, heap: &mut Heap, entry: usize, link: Value) {
        let segment = self.segment(heap, entry);
        heap.vector_set(segment, place(entry) + 2, link);
    }

    fn set_head(self, heap: &mut Heap, bucket: usize, head: usize) {
        let (segment, at) = place_of_head(bucket);
        let heads = self.view(heap).heads.get(segment).copied().unwrap_or(Value::NIL);
        if let Some(slot) = heap.words_mut(heads).and_then(|heads| heads.get_mut(at)) {
            *slot = head as u32;
        }
    }
}

/// The parts of a table, to be read.
struct View<'a> {
    heap: &'a Heap,
    entries: &'a [Value],
    heads: &'a [Value],
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

    /// The first entry of a bucket, one too high; 0 if there is none.
    #[inline]
    fn head(&self, bucket: usize) -> usize {
        let (segment, at) = place_of_head(bucket);
        let heads = self.heads.get(segment).and_then(|&heads| self.heap.words(heads));
        heads.and_then(|heads| heads.get(at)).map_or(0, |&head| head as usize)
    }

    /// Key, value and link of an entry; what a free one has where there is none.
    #[inline]
    fn entry(&self, entry: usize) -> [Value; ENTRY] {
        let segment = self.entries.get(entry >> SHIFT).and_then(|&segment| self.heap.vector(segment));
        let at = place(entry);
        segment.and_then(|segment| segment.get(at..at + ENTRY)?.try_into().ok()).unwrap_or([
            Value::UNBOUND,
            Value::NIL,
            Value::small(0),
        ])
    }
}

/// Directories with one empty segment each.
fn fresh_directories(heap: &mut Heap, room: usize) -> Result<[Value; 2], AllocError> {
    let entries = heap.alloc_vector_filled(ENTRY * room, Value::UNBOUND)?;
    let heads = heap.alloc_words(PER_ENTRY * room, 0)?;
    Ok([heap.alloc_vector(&[entries])?, heap.alloc_vector(&[heads])?])
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
        table.find(heap, Test::Eql, key, hash, &mut 4096).unwrap().map(|(entry, _)| entry)
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
