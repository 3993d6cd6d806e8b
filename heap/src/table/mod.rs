//! Hash tables: entries in the order of insertion, found by linear hashing.
//!
//! A link leads to an entry. It consists of the hash of the entry's key (32 bits), the entry's number plus
//! one (28 bits; 0 leads nowhere), and whether the chain goes on behind the entry. Heads of chains are links,
//! and each entry has the link to the next one of its chain. So a search knows the hash of a key before it
//! goes there, and can mostly tell that a key is missing without a look at any entry. `storage` says how
//! all this is stored.
//!
//! Invariant: a table has `PER_ENTRY` chains for each entry that was ever in use, and for one at least. So
//! each new entry adds that many chains, each of which takes its share from one older chain; nothing is ever
//! rehashed at once, and no operation takes time in proportion to the size of the table. A removed key leaves
//! a free entry, and the entry freed last is taken first. SBCL puts a new key there too, so the order of
//! iteration is the same.
//!
//! Not here: tests that are functions of the program. ESL calls them for [`Table::candidates`], and
//! [`Table::serial`] says whether keys came or went meanwhile.
//! Source: Larson, "Dynamic hash tables", 1988, for growing by one bucket. We keep the entries apart from the
//! buckets, for the sake of their order.

use crate::equality::{self, KeyTest};
use crate::heap::layout::HashTable;
use crate::heap::{AllocError, Heap, Kind};
use crate::value::Value;
use storage::{Counter, ENTRY, PER_ENTRY, SEGMENT, Storage};

mod last;
mod storage;

pub use last::LastLookup;

/// Room of a new table, in entries, at least.
const LEAST: usize = 8;

const NUMBER_BITS: u32 = HashTable::NUMBER_BITS;

/// Link to an entry.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Link(u64);

impl Link {
    const END: Link = Link(0);

    /// Creates the link to an entry whose key has this hash; `next` goes on behind it.
    #[inline(always)]
    fn new(hash: u32, entry: usize, next: Link) -> Link {
        let goes_on = u64::from(next != Link::END);
        Link((u64::from(hash) << NUMBER_BITS | (entry as u64 + 1)) << 1 | goes_on)
    }

    /// Returns the link in the last word of an entry.
    #[inline(always)]
    fn of(v: Value) -> Link {
        Link(v.bits() >> 2)
    }

    #[inline(always)]
    fn value(self) -> Value {
        Value::index(self.0 as usize)
    }

    /// Returns the hash of the entry's key.
    #[inline(always)]
    fn hash(self) -> u32 {
        (self.0 >> (NUMBER_BITS + 1)) as u32
    }

    /// Returns the number of the entry, if there is one.
    #[inline(always)]
    fn entry(self) -> Option<usize> {
        ((self.0 >> 1 & ((1 << NUMBER_BITS) - 1)) as usize).checked_sub(1)
    }

    /// Returns whether there may be another entry in the chain; if not, there is none.
    #[inline(always)]
    fn goes_on(self) -> bool {
        self.0 & 1 != 0
    }
}

/// Returns the link in the entry that a link leads to.
#[inline]
fn next(storage: &Storage<'_>, link: Link) -> Link {
    let entry = link.entry().and_then(|entry| storage.entry(entry));
    entry.map_or(Link::END, |[_, _, next]| Link::of(next))
}

/// The way in which a table compares keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyComparison {
    /// By a test of the machine.
    Native(KeyTest),
    /// By a function of the program.
    Program,
}

/// Reason why an operation was not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The comparison of keys takes too much work, or needs a function of the program.
    Slowly,
    /// There is no room.
    Room(AllocError),
}

impl From<AllocError> for Trouble {
    fn from(error: AllocError) -> Trouble {
        Trouble::Room(error)
    }
}

/// A hash table.
#[derive(Clone, Copy, Debug)]
pub struct Table(Value);

impl Table {
    /// Returns the table that `v` is, if it is one.
    #[inline(always)]
    pub fn of(heap: &Heap, v: Value) -> Option<Table> {
        if heap.is(v, Kind::HashTable) { Some(Table(v)) } else { None }
    }

    /// Returns the value that the table is.
    #[inline(always)]
    pub fn value(self) -> Value {
        self.0
    }

    /// Creates a table with room for about `size` entries. `functions` are the program's functions for test
    /// and hash, or `NIL`.
    ///
    /// # Errors
    /// As for every allocation.
    pub fn make(
        heap: &mut Heap,
        comparison: KeyComparison,
        size: usize,
        functions: [Value; 2],
    ) -> Result<Value, AllocError> {
        let number = match comparison {
            KeyComparison::Native(KeyTest::Eq) => 0,
            KeyComparison::Native(KeyTest::Eql) => 1,
            KeyComparison::Native(KeyTest::Equal) => 2,
            KeyComparison::Native(KeyTest::Equalp) => 3,
            KeyComparison::Program => 4,
        };
        heap.alloc_table(number, size.clamp(LEAST, SEGMENT), functions)
    }

    /// Returns how the table compares keys.
    #[inline(always)]
    pub fn comparison(self, heap: &Heap) -> KeyComparison {
        match self.storage(heap).which_test() {
            0 => KeyComparison::Native(KeyTest::Eq),
            1 => KeyComparison::Native(KeyTest::Eql),
            2 => KeyComparison::Native(KeyTest::Equal),
            3 => KeyComparison::Native(KeyTest::Equalp),
            _ => KeyComparison::Program,
        }
    }

    #[inline(always)]
    fn storage(self, heap: &Heap) -> Storage<'_> {
        match heap.table_storage(self.0) {
            Some(storage) => storage,
            None => unreachable!("a table was checked to be one"),
        }
    }

    #[inline]
    fn counter(self, heap: &Heap, counter: Counter) -> usize {
        heap.table_counter(self.0, counter).unwrap_or(0)
    }

    /// Returns the number of keys.
    pub fn count(self, heap: &Heap) -> usize {
        self.counter(heap, Counter::Count)
    }

    /// Returns the number of entries that were ever in use, where iteration ends.
    pub fn used(self, heap: &Heap) -> usize {
        self.storage(heap).used()
    }

    /// Returns the number of entries for which there is room without more memory.
    pub fn room(self, heap: &Heap) -> usize {
        heap.table_room(self.0).unwrap_or(0)
    }

    /// Returns the program's functions for test and hash, or `NIL`.
    pub fn functions(self, heap: &Heap) -> [Value; 2] {
        heap.table_functions(self.0).unwrap_or([Value::NIL; 2])
    }

    /// Returns a number that changes whenever a key comes or goes.
    #[inline]
    pub fn serial(self, heap: &Heap) -> usize {
        self.counter(heap, Counter::Serial)
    }

    fn advance(self, heap: &mut Heap) {
        // A counter of changes does not run through all fixnums, so wrapping around repeats no serial number
        // in use.
        let next = self.serial(heap).wrapping_add(1) & (Value::FIXNUM_MAX as usize);
        heap.table_set_counter(self.0, Counter::Serial, next);
    }

    /// Returns the entries whose keys have this hash, with the keys.
    pub fn candidates(self, heap: &Heap, hash: u32) -> Vec<(usize, Value)> {
        let storage = self.storage(heap);
        let mut found = Vec::new();
        let mut link = Link(storage.first(hash));
        while let Some(entry) = link.entry() {
            let [key, _, next] = storage.entry(entry).unwrap_or(FREE);
            if link.hash() == hash {
                found.push((entry, key));
            }
            link = Link::of(next);
        }
        found
    }

    /// Returns key and value of an entry; `None` if it is free or was never used.
    #[inline]
    pub fn entry(self, heap: &Heap, entry: usize) -> Option<(Value, Value)> {
        let [key, value, _] = self.storage(heap).entry(entry)?;
        if key == Value::UNBOUND { None } else { Some((key, value)) }
    }

    /// Returns the value of an entry, if it has this very key.
    #[inline(always)]
    pub fn value_of(self, heap: &Heap, entry: usize, key: Value) -> Option<Value> {
        let [candidate, value, _] = self.storage(heap).entry(entry)?;
        if candidate == key && key != Value::UNBOUND { Some(value) } else { None }
    }

    /// Sets the value of an entry.
    #[inline(always)]
    pub fn set_value(self, heap: &mut Heap, entry: usize, value: Value) {
        heap.table_set_entry(self.0, entry, 1, [value]);
    }

    /// Finds the entry of `key`, whose hash is `hash`, by a test of the machine: its number and its value.
    ///
    /// # Errors
    /// [`Trouble::Slowly`] if `work` is used up, or only ESL can compare two of the keys.
    #[inline(always)]
    pub fn find(
        self,
        heap: &Heap,
        test: KeyTest,
        key: Value,
        hash: u32,
        work: &mut usize,
    ) -> Result<Option<(usize, Value)>, Trouble> {
        let storage = self.storage(heap);
        let mut link = Link(storage.first(hash));
        loop {
            // Keys of different hashes differ. The test for the very same object is the fastest, so it comes
            // first.
            if link.hash() == hash
                && let Some(entry) = link.entry()
            {
                let [candidate, value, _] = storage.entry(entry).unwrap_or(FREE);
                if candidate == key {
                    return Ok(Some((entry, value)));
                }
                if test != KeyTest::Eq {
                    match equality::same(heap, test, key, candidate, work) {
                        Some(true) => return Ok(Some((entry, value))),
                        Some(false) => {}
                        None => return Err(Trouble::Slowly),
                    }
                }
            }
            if !link.goes_on() {
                return Ok(None);
            }
            *work = work.checked_sub(1).ok_or(Trouble::Slowly)?;
            link = next(&storage, link);
        }
    }

    /// Adds an entry for a key that is not in the table.
    ///
    /// # Errors
    /// As for every allocation; nothing has changed then.
    pub fn add(self, heap: &mut Heap, hash: u32, key: Value, value: Value) -> Result<(), AllocError> {
        let free = self.counter(heap, Counter::Free);
        let entry = if free > 0 {
            let [_, _, next] = self.storage(heap).entry(free - 1).unwrap_or(FREE);
            heap.table_set_counter(self.0, Counter::Free, next.as_index().unwrap_or(0));
            free - 1
        } else {
            let entry = heap.table_extend(self.0)?;
            if entry > 0 {
                (PER_ENTRY * entry..PER_ENTRY * (entry + 1)).for_each(|chain| self.split(heap, chain));
            }
            entry
        };
        let storage = self.storage(heap);
        let chain = storage.head_of(hash);
        let head = Link(storage.head(chain));
        heap.table_set_entry(self.0, entry, 0, [key, value, head.value()]);
        heap.table_set_head(self.0, chain, Link::new(hash, entry, head).0);
        let count = self.count(heap);
        heap.table_set_counter(self.0, Counter::Count, count + 1);
        self.advance(heap);
        Ok(())
    }

    /// Frees an entry that is in use and whose key has this hash. Returns whether the entry was in the chain
    /// of that hash.
    pub fn delete(self, heap: &mut Heap, entry: usize, hash: u32) -> bool {
        let storage = self.storage(heap);
        let chain = storage.head_of(hash);
        let mut link = Link(storage.head(chain));
        let mut before = None;
        while let Some(current) = link.entry() {
            let [_, _, next] = storage.entry(current).unwrap_or(FREE);
            if current == entry {
                match before {
                    None => heap.table_set_head(self.0, chain, Link::of(next).0),
                    Some(before) => heap.table_set_entry(self.0, before, 2, [next]),
                };
                let free = self.counter(heap, Counter::Free);
                heap.table_set_entry(self.0, entry, 0, [Value::UNBOUND, Value::NIL, Value::index(free)]);
                heap.table_set_counter(self.0, Counter::Free, entry + 1);
                let count = self.count(heap);
                heap.table_set_counter(self.0, Counter::Count, count - 1);
                self.advance(heap);
                return true;
            }
            before = Some(current);
            link = Link::of(next);
        }
        false
    }

    /// Removes all keys.
    ///
    /// # Errors
    /// As for every allocation; nothing has changed then.
    pub fn clear(self, heap: &mut Heap) -> Result<(), AllocError> {
        heap.table_clear(self.0)?;
        self.advance(heap);
        Ok(())
    }

    /// Moves the entries that belong to the chain `new`, which is new, there from the older chain that has
    /// held them.
    fn split(self, heap: &mut Heap, new: usize) {
        let old = new - (1 << new.ilog2());
        let mut link = Link(self.storage(heap).head(old));
        let (mut stay, mut move_on) = (Link::END, Link::END);
        // Both chains come out in reverse, which makes no difference to a search.
        while let Some(entry) = link.entry() {
            let storage = self.storage(heap);
            let [_, _, next] = storage.entry(entry).unwrap_or(FREE);
            let chain = if storage.head_of(link.hash()) == new { &mut move_on } else { &mut stay };
            heap.table_set_entry(self.0, entry, 2, [chain.value()]);
            *chain = Link::new(link.hash(), entry, *chain);
            link = Link::of(next);
        }
        heap.table_set_head(self.0, old, stay.0);
        heap.table_set_head(self.0, new, move_on.0);
    }
}

/// Content of an entry that was never in use; no link leads there.
const FREE: [Value; ENTRY] = [Value::UNBOUND, Value::NIL, Value::small(0)];

#[cfg(test)]
mod tests;
