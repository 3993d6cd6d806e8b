//! Storage of hash tables: entries and heads of chains. Reading them needs no tests, since the heap
//! guarantees the layout.
//!
//! ```text
//! table     | count | used | free | room | entries | heads | test | hash | serial |      header.aux: which
//! test entries   directory of simple vectors:  | key | value | link | key | value | link | ... heads
//! directory of Words64:         | link | link | link | ...
//! ```
//!
//! A directory lists segments of [`SEGMENT`] entries, or of the [`PER_ENTRY`] heads of each. Only the first
//! segment grows, by doubling, so nothing here takes time in proportion to the size of a table.
//!
//! Invariant: the segments in the directories hold `room` entries and [`PER_ENTRY`] heads for each of them,
//! `used` is at most `room`, and no other object has the directories or segments. So every entry with a
//! number below `used` is there, and every head with one below `Storage::heads`.
//!
//! Not here: the content of entries, and how keys are found ([`super`]).

#![allow(unsafe_code)]

use std::marker::PhantomData;

use crate::heap::layout::{HashTable, Kind};
use crate::heap::{AllocError, Heap};
use crate::value::Value;

/// Number of entries of a segment.
pub(super) const SEGMENT: usize = 1 << SHIFT;
const SHIFT: u32 = HashTable::SEGMENT_SHIFT;
pub(super) const PER_ENTRY: usize = HashTable::PER_ENTRY;
pub(super) const ENTRY: usize = HashTable::ENTRY;
const MOST: usize = HashTable::MOST;

/// Content of a free entry in place of a key: no program has it.
const FREE: Value = Value::UNBOUND;

/// Read access to the storage of a table.
#[derive(Clone, Copy)]
pub(super) struct Storage<'a> {
    which_test: u16,
    used: usize,
    entries: *const Value,
    heads: *const Value,
    heap: PhantomData<&'a Heap>,
}

impl Storage<'_> {
    /// Returns the number of the test that the table was made with.
    #[inline(always)]
    pub(super) fn which_test(&self) -> u16 {
        self.which_test
    }

    /// Returns the number of entries that were ever in use.
    #[inline(always)]
    pub(super) fn used(&self) -> usize {
        self.used
    }

    /// Returns the number of heads in use: [`PER_ENTRY`] for each entry that was ever in use, and for one at
    /// least.
    #[inline(always)]
    fn heads(&self) -> usize {
        PER_ENTRY * self.used.max(1)
    }

    /// Returns the head of the chain of a hash: the low bits of the hash, one bit fewer if that chain does
    /// not exist yet.
    #[inline(always)]
    pub(super) fn head_of(&self, hash: u32) -> usize {
        let heads = self.heads();
        let half = 1 << heads.ilog2();
        let head = hash as usize & (2 * half - 1);
        if head < heads { head } else { head - half }
    }

    /// Returns the content of the head of the chain of a hash.
    #[inline(always)]
    pub(super) fn first(&self, hash: u32) -> u64 {
        // SAFETY: what `head_of` gives is less than `heads`: if the low bits are not, they are at least
        // `half`, which is at most `heads`, and at most `half` is left of them. So the head is in use, and
        // lies in a segment (invariant).
        unsafe { *self.place_of_head(self.head_of(hash)) }
    }

    /// Returns the content of a head; 0 if it is not in use.
    #[inline(always)]
    pub(super) fn head(&self, head: usize) -> u64 {
        if head >= self.heads() {
            return 0;
        }
        // SAFETY: the head is in use, so it lies in a segment (invariant).
        unsafe { *self.place_of_head(head) }
    }

    /// Returns key, value and link of an entry; `None` if it was never in use.
    #[inline(always)]
    pub(super) fn entry(&self, entry: usize) -> Option<[Value; ENTRY]> {
        if entry >= self.used {
            return None;
        }
        // SAFETY: the entry was in use, so it lies in a segment (invariant).
        Some(unsafe { *self.place_of_entry(entry).cast::<[Value; ENTRY]>() })
    }

    /// Returns the address of an entry.
    ///
    /// # Safety
    /// `entry` is less than the table's room.
    #[inline(always)]
    unsafe fn place_of_entry(&self, entry: usize) -> *mut Value {
        // SAFETY: by the contract and the invariant there is such a segment, and the entry in it.
        unsafe { elements::<Value>(*self.entries.add(entry >> SHIFT)).add(ENTRY * (entry & (SEGMENT - 1))) }
    }

    /// Returns the address of a head.
    ///
    /// # Safety
    /// `head` is less than [`PER_ENTRY`] times the table's room.
    #[inline(always)]
    unsafe fn place_of_head(&self, head: usize) -> *mut u64 {
        const HEADS: usize = PER_ENTRY * SEGMENT;
        // SAFETY: by the contract and the invariant there is such a segment, and the head in it.
        unsafe { elements::<u64>(*self.heads.add(head / HEADS)).add(head % HEADS) }
    }
}

/// Returns the address of the first element of an object.
///
/// # Safety
/// `object` is a live object.
#[inline(always)]
unsafe fn elements<T>(object: Value) -> *mut T {
    // SAFETY: by the contract this is a live object; its elements follow the header.
    unsafe { object.object_ptr().add(1).cast() }
}

/// A counter of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counter {
    /// Number of keys.
    Count,
    /// The number of the entry freed last, plus one; 0 if none is free.
    Free,
    /// A number that changes whenever a key comes or goes.
    Serial,
}

impl Heap {
    /// Creates a table with room for `room` entries, at most [`SEGMENT`]. `functions` are the program's
    /// functions for test and hash, or `NIL`.
    ///
    /// # Errors
    /// As for every allocation.
    pub(super) fn alloc_table(
        &mut self,
        which_test: u16,
        room: usize,
        functions: [Value; 2],
    ) -> Result<Value, AllocError> {
        let room = room.clamp(1, SEGMENT).next_power_of_two();
        let [entries, heads] = self.fresh_directories(room)?;
        let zero = Value::small(0);
        let [test, hash] = functions;
        let slots = [zero, zero, zero, Value::index(room), entries, heads, test, hash, zero];
        self.vouched_record(Kind::HashTable, which_test, &slots)
    }

    #[inline(always)]
    fn table_object(&self, v: Value) -> Option<*mut HashTable> {
        Some(self.object_of(v, Kind::HashTable)?.cast())
    }

    /// Returns the storage of a table.
    #[inline(always)]
    pub(super) fn table_storage(&self, v: Value) -> Option<Storage<'_>> {
        let table = self.table_object(v)?;
        // SAFETY: H3: the kind says that this is a HashTable; H4: its directories are live objects.
        unsafe {
            Some(Storage {
                which_test: (*table).header.aux,
                used: ((*table).used.bits() >> 2) as usize,
                entries: elements((*table).entries),
                heads: elements((*table).heads),
                heap: PhantomData,
            })
        }
    }

    /// Returns the number of entries for which a table has room without more memory.
    pub(super) fn table_room(&self, v: Value) -> Option<usize> {
        // SAFETY: H3: the kind says that this is a HashTable.
        self.table_object(v).and_then(|table| unsafe { (*table).room }.as_index())
    }

    /// Returns the program's functions for test and hash of a table, or `NIL`.
    pub(super) fn table_functions(&self, v: Value) -> Option<[Value; 2]> {
        // SAFETY: H3: the kind says that this is a HashTable.
        self.table_object(v).map(|table| unsafe { [(*table).test, (*table).hash] })
    }

    /// Returns a counter of a table.
    #[inline]
    pub(super) fn table_counter(&self, v: Value, counter: Counter) -> Option<usize> {
        let table = self.table_object(v)?;
        // SAFETY: H3: the kind says that this is a HashTable.
        let value = unsafe {
            match counter {
                Counter::Count => (*table).count,
                Counter::Free => (*table).free,
                Counter::Serial => (*table).serial,
            }
        };
        value.as_index()
    }

    /// Sets a counter; `None` if `v` is not a table.
    #[inline]
    pub(super) fn table_set_counter(&mut self, v: Value, counter: Counter, n: usize) -> Option<()> {
        let table = self.table_object(v)?;
        // SAFETY: H3: the kind says that this is a HashTable; nothing relies on these counters. No address is
        // overwritten, so the barrier has no work.
        unsafe {
            match counter {
                Counter::Count => (*table).count = Value::index(n),
                Counter::Free => (*table).free = Value::index(n),
                Counter::Serial => (*table).serial = Value::index(n),
            }
        }
        Some(())
    }

    /// Sets the values of an entry, from number `first` on; `None` if it was never in use.
    #[inline(always)]
    pub(super) fn table_set_entry<const N: usize>(
        &mut self,
        v: Value,
        entry: usize,
        first: usize,
        values: [Value; N],
    ) -> Option<()> {
        let storage = self.table_storage(v)?;
        if entry >= storage.used || first + N > ENTRY {
            return None;
        }
        // SAFETY: the entry was in use, so it lies in a segment (invariant), and so do all values of it.
        unsafe {
            let place = storage.place_of_entry(entry).add(first);
            for (i, value) in values.into_iter().enumerate() {
                self.store(place.add(i), value);
            }
        }
        Some(())
    }

    /// Sets the content of a head; `None` if it is not in use.
    #[inline]
    pub(super) fn table_set_head(&mut self, v: Value, head: usize, link: u64) -> Option<()> {
        let storage = self.table_storage(v)?;
        if head >= storage.heads() {
            return None;
        }
        // SAFETY: the head is in use, so it lies in a segment (invariant).
        unsafe { *storage.place_of_head(head) = link };
        Some(())
    }

    /// Takes one more entry and its heads into use, and returns the number of the entry.
    ///
    /// # Errors
    /// As for every allocation; nothing has changed then.
    pub(super) fn table_extend(&mut self, v: Value) -> Result<usize, AllocError> {
        let Some(table) = self.table_object(v) else { unreachable!("the caller has a table") };
        // SAFETY: H3: the kind says that this is a HashTable.
        let (used, room) =
            unsafe { ((*table).used.as_index().unwrap_or(0), (*table).room.as_index().unwrap_or(0)) };
        if used == room {
            self.grow_table(table, room)?;
        }
        // SAFETY: H3: the kind says that this is a HashTable; there is room for one more. A fixnum is
        // overwritten, so the barrier has no work.
        unsafe { (*table).used = Value::index(used + 1) };
        Ok(used)
    }

    /// Removes all entries; none is in use or free afterwards. The functions stay.
    ///
    /// # Errors
    /// As for every allocation; nothing has changed then.
    pub(super) fn table_clear(&mut self, v: Value) -> Result<(), AllocError> {
        let Some(table) = self.table_object(v) else { unreachable!("the caller has a table") };
        // SAFETY: H3: the kind says that this is a HashTable.
        let room = unsafe { (*table).room }.as_index().unwrap_or(0).min(SEGMENT);
        let [entries, heads] = self.fresh_directories(room)?;
        // SAFETY: H3: the kind says that this is a HashTable; the new directories have room for `room`.
        unsafe {
            self.store(&raw mut (*table).entries, entries);
            self.store(&raw mut (*table).heads, heads);
            (*table).used = Value::small(0);
            (*table).count = Value::small(0);
            (*table).free = Value::small(0);
            (*table).room = Value::index(room);
        }
        Ok(())
    }

    /// Makes room for one entry at least: doubles the first segment, or adds a segment.
    fn grow_table(&mut self, table: *mut HashTable, room: usize) -> Result<(), AllocError> {
        if room >= MOST {
            return Err(AllocError::TooLarge { requested: 8 * ENTRY * room });
        }
        // SAFETY: H3: the kind says that this is a HashTable.
        let (old_entries, old_heads) = unsafe { ((*table).entries, (*table).heads) };
        if room < SEGMENT {
            let entries = self.alloc_vector_filled(2 * ENTRY * room, FREE)?;
            let heads = self.alloc_words64(2 * PER_ENTRY * room)?;
            // SAFETY: the first segments have room for `room` entries, the new ones for twice as many; no
            // other object has the new ones, so the barrier has no work but where the directories are
            // changed.
            unsafe {
                let (from_entries, from_heads) =
                    (elements::<Value>(old_entries), elements::<Value>(old_heads));
                elements::<Value>(*from_entries).copy_to_nonoverlapping(elements(entries), ENTRY * room);
                elements::<u64>(*from_heads).copy_to_nonoverlapping(elements(heads), PER_ENTRY * room);
                self.store(from_entries, entries);
                self.store(from_heads, heads);
                (*table).room = Value::index(2 * room);
            }
            return Ok(());
        }
        let segments = room >> SHIFT;
        let entries = self.alloc_vector_filled(ENTRY * SEGMENT, FREE)?;
        let heads = self.alloc_words64(PER_ENTRY * SEGMENT)?;
        let mut directories = [old_entries, old_heads];
        for (directory, segment) in directories.iter_mut().zip([entries, heads]) {
            if self.vector_set(*directory, segments, segment).is_none() {
                // A directory is a tiny part of the table, less than a thousandth, so copying it hardly
                // counts.
                let mut longer = self.vector(*directory).unwrap_or_default().to_vec();
                longer.push(segment);
                longer.resize(2 * segments, Value::NIL);
                *directory = self.alloc_vector(&longer)?;
            }
        }
        // SAFETY: H3: the kind says that this is a HashTable; the directories have one segment more than
        // before.
        unsafe {
            self.store(&raw mut (*table).entries, directories[0]);
            self.store(&raw mut (*table).heads, directories[1]);
            (*table).room = Value::index(room + SEGMENT);
        }
        Ok(())
    }

    /// Allocates directories with one empty segment each.
    fn fresh_directories(&mut self, room: usize) -> Result<[Value; 2], AllocError> {
        let entries = self.alloc_vector_filled(ENTRY * room, FREE)?;
        let heads = self.alloc_words64(PER_ENTRY * room)?;
        Ok([self.alloc_vector(&[entries])?, self.alloc_vector(&[heads])?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(n: usize) -> [Value; ENTRY] {
        [Value::index(n), Value::index(2 * n), Value::index(3 * n)]
    }

    /// The test covers the doubling of the first segment and that of the directories.
    #[test]
    fn what_was_stored_stays_as_a_table_grows() {
        let mut heap = Heap::for_tests();
        let v = heap.alloc_table(1, 3, [Value::NIL, Value::T]).unwrap();
        let n = 5 * SEGMENT + 3;
        for i in 0..n {
            assert_eq!(heap.table_extend(v), Ok(i));
            assert_eq!(heap.table_set_entry(v, i, 0, entry(i)), Some(()));
            for head in PER_ENTRY * i..PER_ENTRY * (i + 1) {
                assert_eq!(heap.table_storage(v).unwrap().head(head), 0);
                assert_eq!(heap.table_set_head(v, head, head as u64 + 7), Some(()));
            }
        }
        let storage = heap.table_storage(v).unwrap();
        assert_eq!((storage.used(), storage.which_test()), (n, 1));
        assert!((0..n).all(|i| storage.entry(i) == Some(entry(i))));
        assert!((0..PER_ENTRY * n).all(|head| storage.head(head) == head as u64 + 7));
        assert!(heap.table_room(v).unwrap() >= n);
        assert_eq!(heap.table_functions(v), Some([Value::NIL, Value::T]));
    }

    #[test]
    fn what_was_never_in_use_cannot_be_reached() {
        let mut heap = Heap::for_tests();
        let v = heap.alloc_table(0, 8, [Value::NIL; 2]).unwrap();
        assert_eq!(heap.table_storage(v).unwrap().entry(0), None);
        assert_eq!(heap.table_set_entry(v, 0, 0, entry(1)), None);
        assert_eq!(heap.table_extend(v), Ok(0));
        assert_eq!(heap.table_set_entry(v, 0, 2, [Value::T, Value::T]), None, "beyond the entry");
        assert_eq!(heap.table_set_head(v, PER_ENTRY, 1), None);
        assert_eq!(heap.table_set_head(v, PER_ENTRY - 1, 1), Some(()));
        assert_eq!(heap.table_clear(v), Ok(()));
        assert_eq!(heap.table_storage(v).unwrap().used(), 0);
        assert_eq!(heap.table_storage(v).unwrap().head(PER_ENTRY - 1), 0);
        assert!(heap.table_storage(Value::NIL).is_none());
    }

    #[test]
    fn every_hash_has_a_head_in_use() {
        let mut heap = Heap::for_tests();
        let v = heap.alloc_table(0, 8, [Value::NIL; 2]).unwrap();
        for used in 0..40 {
            let storage = heap.table_storage(v).unwrap();
            for hash in (0..200).chain([u32::MAX, u32::MAX - 1, 1 << 31]) {
                let head = storage.head_of(hash);
                assert!(head < PER_ENTRY * used.max(1), "{hash} of {used}");
                assert_eq!(storage.first(hash), 0);
            }
            heap.table_extend(v).unwrap();
        }
    }

    #[test]
    fn tables_live_through_a_collection() {
        let mut heap = Heap::for_tests();
        let v = heap.alloc_table(0, 8, [Value::NIL; 2]).unwrap();
        for i in 0..2 * SEGMENT {
            let text = heap.alloc_str("kept").unwrap();
            heap.table_extend(v).unwrap();
            heap.table_set_entry(v, i, 0, [text, Value::NIL, Value::small(0)]).unwrap();
        }
        // SAFETY: nothing but the table is used below.
        unsafe { heap.collect_fully(|heap| heap.mark(v)) };
        let storage = heap.table_storage(v).unwrap();
        assert!(
            (0..storage.used()).all(|i| heap.string_text(storage.entry(i).unwrap()[0]).unwrap() == "kept")
        );
    }
}
