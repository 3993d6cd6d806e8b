//! The heap: memory for every object that a [`Value`] refers to by address.
//!
//! ```text
//! object    creating objects, a function per kind        access    checked reading and writing of objects
//! raw       those without values, such as strings        code      those that run: functions and code
//! layout    their form, to the byte                      alloc     bump allocation into holes
//! mark      incremental marking                          sweep     lazy sweeping
//! arena     1 MiB pieces of memory, in blocks            large     big objects, one by one
//! metadata  one byte per granule                     external  memory outside that counts against the limit
//! image     the contents at a time, to be had again  check     contradictions, for tests
//! contents  the contents, as bytes                    range     addresses that are the same in each process
//! ```
//!
//! Objects never move. A cycle of the collector marks what is reachable, in slices between which the program
//! runs; then it sweeps what was not marked, in slices and as the allocator needs memory. The times of cycles
//! and slices depend on the number of bytes allocated and on nothing else, so a run repeats exactly.
//!
//! Guarantees: safe code cannot break memory safety through this interface, however odd it is. The facts
//! behind that, which the `SAFETY:` notes name:
//!
//! * **H1, addresses.** A value with the tag of a cons or object is the address of a complete cons or object
//!   of this heap: only the allocation functions make such values, and the caller of [`Heap::new`] promises
//!   to use them with no other heap, and not after this one.
//! * **H2, life.** No allocation collects. Memory is reused only after [`Heap::end_marking`], whose caller
//!   promises that all values still in use were reached. So between two collections every value is good, and
//!   builtins need no roots.
//! * **H3, layout.** The kind and `len` in a header say what follows it (`layout`). All of it is initialised,
//!   and neither changes while the object lives, but for the kind of an unfinished vector or string.
//! * **H4, contents.** The name of a symbol is a String and its function a Function; the code of a function
//!   is a Code; the class of a structure is a Class; the data of an array is a SimpleVector, a String or
//!   Bytes. A hash table has the storage that [`crate::table`] says, and is its only owner. Allocation and
//!   setters test all this.
//! * **H5, borrows.** Access borrows the heap, so nothing is stored or collected while a slice of it is in
//!   use. Every store of a value passes the write barrier.
//!
//! When [`Heap::gc_due`], the VM takes one of these steps at the next tick:
//!
//! ```text
//! Idle       begin_cycle, mark the fixed roots
//! Marking    slice; when Drained: scan a stack not yet scanned in this cycle (cycle_id tells) with the
//!            visits left over, or end_marking when there is none
//! Sweeping   slice
//! ```
//!
//! There are three kinds of roots. *Fixed* roots are marked when the cycle begins; code that overwrites one
//! later first calls [`Heap::log_if_marking`] with the old value. *Stacks* are scanned once per cycle, before
//! their task runs in it (`mark` says why that is sound). Roots that are *few and change often* may be marked
//! at the beginning and all again before the end.
//!
//! Not here: the choice of roots; when to run a slice; weak references.

#![allow(unsafe_code)]

pub mod layout;

mod access;
mod alloc;
mod arena;
mod check;
mod code;
mod contents;
mod external;
mod image;
mod large;
mod mark;
mod metadata;
mod object;
mod range;
mod raw;
mod sweep;

pub use alloc::AllocError;
pub use check::HeapContradiction;
pub use code::CodeParts;
pub use contents::HeapMemory;
pub use external::Holder;
pub use image::HeapImage;
pub use layout::Kind;
pub use metadata::{NotCanonical, SweepCounts};
pub use range::{range_start, words_at};
pub use raw::BignumRef;

use crate::list_state;
use crate::state::StateSink;
use crate::value::{TAG_MASK, Value};
use alloc::Region;
use arena::{ARENA, Arena};
use external::External;
use large::LargeObject;
use mark::Marker;
use range::AddressRange;
use std::sync::Arc;
use sweep::Sweep;

/// Bytes added to the limit by [`Heap::open_reserve`]: an arena, and something for what is outside of the
/// heap.
pub const RESERVE: usize = ARENA + ARENA / 2;

/// Bytes above that which a cleanup may use ([`Heap::lend_to_cleanup`]).
pub const CLEANUP_RESERVE: usize = 2 * ARENA;

/// Number of visits of an ordinary slice.
///
/// With 100 MB live a slice takes 3 µs on a list in order of allocation, 85 µs on a random graph of vectors,
/// and 200 µs on a list linked in random order, where every visit waits for memory (cloud Xeon, 2.5 GHz).
pub const SLICE_VISITS: u32 = 1000;

/// Limit of a heap, and settings of its collector.
#[derive(Clone, Debug)]
pub struct HeapConfig {
    /// Bytes that the heap may take from the system, metadata included; at least one arena of 1 MiB.
    pub limit: usize,
    /// Bytes to allocate between the end of one cycle and the start of the next. If the last cycle found more
    /// than that live, the next one starts after as many bytes as were live; near the limit it starts sooner.
    pub cycle_floor: usize,
    /// Capacity of the mark stack, in objects of 8 bytes each. More objects wait in the metadata, which is
    /// slower.
    pub mark_stack: usize,
    /// Whether images may be taken of the heap ([`Heap::save`]). All memory is initialised for it.
    pub images: bool,
    /// Where the heap has its memory, so that the contents may be stored in a file
    /// ([`Heap::store_contents`]): the start of a range of addresses that it reserves; `None` for anywhere.
    /// [`range_start`] proposes one.
    pub range: Option<usize>,
}

impl Default for HeapConfig {
    fn default() -> Self {
        HeapConfig { limit: 1 << 30, cycle_floor: 8 << 20, mark_stack: 128 << 10, images: false, range: None }
    }
}

/// State of the collector.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Phase {
    /// Between two cycles.
    Idle,
    /// Marking what is reachable; stores log what they overwrite.
    Marking,
    /// Freeing what was not marked.
    Sweeping,
}

/// Work left after a slice.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
#[must_use]
pub enum SliceOutcome {
    /// The phase goes on.
    More,
    /// Everything marked has been followed: mark a stack that was not yet scanned, or end marking.
    Drained {
        /// Visits not used. A scanned word of a stack may count as a quarter of one.
        left: u32,
    },
    /// The cycle is over.
    Finished,
}

/// Figures of a heap since its creation.
#[derive(Copy, Clone, Default, Debug, PartialEq, Eq)]
pub struct HeapStats {
    /// Number of completed cycles.
    pub cycles: u64,
    /// Number of slices.
    pub slices: u64,
    /// Number of visits of the longest slice.
    pub longest_slice: u64,
    /// Bytes found live by the last cycle; whatever was allocated during the cycle counts as live.
    pub live: u64,
    /// Bytes allocated.
    pub allocated: u64,
    /// Bytes taken from the system now.
    pub committed: u64,
    /// Most bytes ever taken from the system at once.
    pub peak: u64,
}

/// Pace of the collector, in bytes allocated.
#[derive(Clone, Copy)]
struct Pacing {
    /// `HeapConfig::cycle_floor`.
    floor: u64,
    /// Value of `since_cycle` at which a cycle starts.
    threshold: u64,
    /// Allocated since the end of the last marking.
    since_cycle: u64,
    /// Allocated since the beginning of the marking under way.
    black: u64,
    /// Allocated during the cycle and not yet worked off by slices.
    owed: u64,
}

/// Heap of a machine. The module's documentation has the rules for its use.
pub struct Heap {
    // The fields that the interpreter's fast paths touch come first.
    first: Region,
    second: Region,
    marking: bool,
    due: bool,
    reserve_open: bool,
    lent_to_cleanup: bool,

    phase: Phase,
    epoch: u8,
    cycle_id: u64,
    pacing: Pacing,
    marker: Marker,
    sweep: Sweep,

    // Invariant: `committed` is the sum of all arenas and large objects.
    arenas: Vec<Option<Arena>>,
    large: Vec<LargeObject>,
    large_number: u64,
    committed: usize,
    external: External,
    limit: usize,
    /// Where new code begins to run; `None` for its first word.
    code_entry: Option<&'static u32>,

    stats: HeapStats,

    /// The addresses of its memory, if they are its own.
    range: Option<Arc<AddressRange>>,
    /// Whether images may be taken.
    has_images: bool,
    /// Tells its images from those of other heaps.
    identity: Arc<()>,
    /// Greatest number of a page of a vector that is the machine's own ([`Heap::own_vector`]).
    numbered: u64,
    /// Whether the system has had no memory for an arena or a large object.
    is_refused: bool,
}

crate::stored! { HeapStats { cycles, slices, longest_slice, live, allocated, committed, peak } }

list_state! { Pacing { floor: Run, threshold: Run, since_cycle: Run, black: Run, owed: Run } }

list_state! {
    HeapStats {
        cycles: Run,
        slices: Run,
        longest_slice: Run,
        live: Run,
        allocated: Run,
        committed: Derived,
        peak: Run,
    }
}

list_state! {
    Heap {
        first: Parts,
        second: Parts,
        marking: Derived,
        due: Derived,
        reserve_open: Run,
        lent_to_cleanup: Run,
        phase: Run by |&phase: &Phase, sink: &mut dyn StateSink| sink.word(phase as u64),
        epoch: Run,
        cycle_id: Run,
        pacing: Parts,
        marker: Parts,
        sweep: Parts,
        arenas: Parts,
        large: Parts,
        large_number: Run,
        committed: Derived,
        external: Parts,
        limit: Run,
        code_entry: Process,
        stats: Parts,
        range: Process,
        has_images: Process,
        identity: Process,
        numbered: Process,
        is_refused: Process,
    }
}

// SAFETY: a heap owns its memory, shares none of it, and has no state in any thread.
unsafe impl Send for Heap {}

impl Heap {
    /// Creates an empty heap.
    ///
    /// # Safety
    /// The caller promises that a value with an address is used only with the heap that it came from, and not
    /// after that heap was dropped.
    pub unsafe fn new(config: HeapConfig) -> Heap {
        let floor = config.cycle_floor as u64;
        Heap {
            first: Region::new(),
            second: Region::new(),
            marking: false,
            due: false,
            reserve_open: false,
            lent_to_cleanup: false,
            phase: Phase::Idle,
            epoch: 1,
            cycle_id: 0,
            pacing: Pacing { floor, threshold: floor, since_cycle: 0, black: 0, owed: 0 },
            marker: Marker::new(config.mark_stack),
            sweep: Sweep::default(),
            arenas: Vec::new(),
            large: Vec::new(),
            large_number: 0,
            committed: 0,
            external: External::default(),
            limit: config.limit.max(ARENA),
            code_entry: None,
            stats: HeapStats::default(),
            range: config.range.and_then(|start| AddressRange::reserve(start, config.limit.max(ARENA))),
            has_images: config.images,
            identity: Arc::default(),
            numbered: 0,
            is_refused: false,
        }
    }

    /// Creates a heap for a unit test of this crate.
    #[cfg(test)]
    pub(crate) fn for_tests() -> Heap {
        // SAFETY: H1: a test of this crate uses the values of one heap, while it has it.
        unsafe { Heap::new(HeapConfig::default()) }
    }

    /// Logs a value that is about to be overwritten, in the heap or in a fixed root, while marking is under
    /// way: the write barrier.
    #[inline(always)]
    pub fn log_if_marking(&mut self, old: Value) {
        if self.marking {
            self.log(old);
        }
    }

    #[cold]
    #[inline(never)]
    fn log(&mut self, old: Value) {
        self.mark(old);
    }

    /// Logs values as [`Heap::log_if_marking`] does each of them.
    #[inline(always)]
    pub fn log_all_if_marking(&mut self, old: &[Value]) {
        if self.marking {
            self.log_all(old);
        }
    }

    #[cold]
    #[inline(never)]
    fn log_all(&mut self, old: &[Value]) {
        for &old in old.iter().filter(|old| old.is_address()) {
            self.mark(old);
        }
    }

    /// Returns whether the collector wants to run at the next tick: to begin a cycle if idle, else to run a
    /// slice. The answer changes only on the slow path of allocation and by the collector's own functions.
    #[inline(always)]
    pub fn gc_due(&self) -> bool {
        self.due
    }

    /// Returns where machine code finds what [`Heap::gc_due`] returns.
    pub fn gc_due_at(&self) -> *const bool {
        &raw const self.due
    }

    /// Returns the state of the collector.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Returns the number of the cycle under way, or else of the last one. A task's stack notes it when it is
    /// scanned.
    pub fn cycle_id(&self) -> u64 {
        self.cycle_id
    }

    /// Returns whether the system has refused memory below the limit: what follows depends on that too.
    pub fn is_refused(&self) -> bool {
        self.is_refused
    }

    /// Opens the reserve above the limit, for the clause that handles `:heap-exhausted`. Returns false if it
    /// is open already.
    pub fn open_reserve(&mut self) -> bool {
        !std::mem::replace(&mut self.reserve_open, true)
    }

    /// Returns whether the reserve is open.
    pub fn is_reserve_open(&self) -> bool {
        self.reserve_open
    }

    /// Closes the reserve. Objects in it stay; the next allocation beyond the limit fails again.
    pub fn close_reserve(&mut self) {
        self.reserve_open = false;
    }

    /// Opens or closes the reserve above the limit, which is kept for cleanups, to allocations from now on.
    /// Other code cannot use the rest of the reserve: it gets arenas taken from the reserve only once the
    /// heap is within its limit again.
    #[inline]
    pub fn lend_to_cleanup(&mut self, lends: bool) {
        if lends != self.lent_to_cleanup {
            self.change_lending(lends);
        }
    }

    /// Returns a number that distinguishes a value from all others alive at the same time, and is the same in
    /// every run of the same program. Hash tables by `eq` use it as the hash.
    pub fn identity(&self, v: Value) -> u64 {
        if !v.is_address() {
            return v.bits();
        }
        // SAFETY: H1, H2: the value is the address of a live cons or object; by its size it lies in an arena
        // or is large.
        unsafe {
            if let Some(object) = v.as_object_ptr()
                && large::is_large((*object).size())
            {
                return 1 << 63 | (*large::header_of(object)).number << 3 | v.bits() & TAG_MASK;
            }
            let arena = u64::from((*arena::header_of(mark::address_of(v))).number);
            arena * ARENA as u64 + v.bits() % ARENA as u64
        }
    }

    /// Returns a number for an address in an arena, or behind its last object, that is the same in every run
    /// of the same program; 0 for any other address.
    pub fn place(&self, address: usize) -> u64 {
        let inside = address.saturating_sub(1);
        let holds = |arena: &Arena| std::ptr::from_ref(arena.header()).addr() == inside & !(ARENA - 1);
        let number = self.arenas.iter().position(|arena| arena.as_ref().is_some_and(holds));
        number.map_or(0, |number| (number * ARENA + inside % ARENA) as u64 + 1)
    }

    /// Returns the figures of this heap.
    pub fn stats(&self) -> HeapStats {
        let uncounted = (self.first.uncounted() + self.second.uncounted()) as u64;
        HeapStats {
            allocated: self.stats.allocated + uncounted,
            committed: self.committed as u64,
            ..self.stats
        }
    }

    /// Asserts that the address of `v` is one of this heap.
    #[cfg(feature = "paranoid")]
    fn assert_mine(&self, v: Value) {
        // SAFETY: none if `v` is foreign, which is what this looks for; for a value of this heap both are
        // live.
        unsafe {
            if let Some(object) = v.as_object_ptr()
                && large::is_large((*object).size())
            {
                let header = large::header_of(object);
                let known = self.large.get((*header).index);
                assert!(
                    known.is_some_and(|known| std::ptr::eq(known.header(), header)),
                    "{v:?} is not of this heap"
                );
            } else {
                let header = arena::header_of(mark::address_of(v));
                let known = self.arenas.get((*header).number as usize).and_then(Option::as_ref);
                assert!(
                    known.is_some_and(|known| std::ptr::eq(known.header(), header)),
                    "{v:?} is not of this heap"
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conses_hold_their_halves() {
        let mut heap = Heap::for_tests();
        let cell = heap.cons(Value::T, Value::NIL).unwrap();
        assert_eq!((heap.car(cell), heap.cdr(cell)), (Some(Value::T), Some(Value::NIL)));
    }

    #[test]
    #[cfg(debug_assertions)]
    fn freed_memory_is_poisoned() {
        let mut heap = Heap::for_tests();
        let dead = heap.cons(Value::T, Value::NIL).unwrap();
        let live = heap.cons(Value::T, Value::NIL).unwrap();
        // SAFETY: `dead` is read below although it was not marked, but its memory is not reused, and kept by
        // `live`.
        unsafe { heap.collect_fully(|heap| heap.mark(live)) };
        assert_eq!((heap.car(dead), heap.cdr(dead)), (Some(Value::POISON), Some(Value::POISON)));
        assert_eq!(heap.car(live), Some(Value::T));
    }
}
