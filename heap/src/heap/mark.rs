//! Marking: finds the objects that are reachable from the roots as they were when the cycle began.
//!
//! The collector is incremental, snapshot-at-the-beginning (Yuasa 1990). Every object reachable when the
//! cycle began survives it, whatever the program does meanwhile: a value in the heap is marked before it is
//! overwritten. Objects allocated during the cycle survive it too, without being followed. So a cycle may
//! take as many slices as it likes, and nothing is ever scanned twice; garbage that arises during the cycle
//! is found by the next.
//!
//! Stacks are not scanned at the beginning. Each is scanned once in the cycle: before its task runs in it, or
//! by the marker at its leisure. That is sound because only the task itself reads its stack. Nothing leaves a
//! stack before it is scanned, and whatever others write into it comes from scanned stacks, from marked
//! objects, or from new ones.
//!
//! ```text
//! begin_cycle, mark(fixed roots) -> slice ... -> Drained -> mark_slice(stack), slice ... -> end_marking
//! ```
//!
//! Guarantees: there is no recursion on the native stack. The mark stack has a fixed capacity; beyond it
//! objects wait as gray bytes in the metadata. The work of a slice is bounded by its visits; a vector is
//! followed in pieces of [`PIECE_LENGTH`] elements.
//!
//! Invariants while marking:
//! 1. A marked object that may hold unmarked addresses of the snapshot is on the mark stack, in `pieces`, or
//!    gray.
//! 2. A marked object's last granule carries the end bit: it is set together with the mark, since the size is
//!    known.

use super::arena::{self, Arena, BLOCKS, metadata_of};
use super::large;
use super::layout::{CodeObject, Cons, GRANULE, Header, Kind};
use super::metadata::{END, EPOCH, GRAY, GRAY_CONS, next_epoch, next_gray};
use super::{Heap, Phase, SliceOutcome};
use crate::list_state;
use crate::value::Value;

/// Number of elements of a record that are followed at once.
const PIECE_LENGTH: usize = if cfg!(miri) { 64 } else { 1024 };
/// Number of elements that count as one visit.
const ELEMENTS_PER_VISIT: i64 = 4;
/// Entries that the mark stack has room for at first.
const FIRST_ROOM: usize = 64;
/// Number of visits that the search for gray bytes in one arena counts as.
const GRAY_SEARCH_VISITS: i64 = 256;

/// The marked objects that are still to be followed.
pub(super) struct Marker {
    /// Marked objects that have not been visited.
    stack: Vec<Value>,
    /// Greatest number of entries of `stack`.
    capacity: usize,
    /// Records that have been followed in part, with the slot to go on at.
    pieces: Vec<(Value, usize)>,
    /// Number of gray granules in arenas and of gray large objects.
    grays: usize,
    /// Bytes marked in this cycle.
    pub(super) bytes: u64,
}

crate::stored! { Marker { stack, capacity, pieces, grays, bytes } }
list_state! { Marker { stack: Run, capacity: Run, pieces: Run, grays: Derived, bytes: Run } }

impl Marker {
    pub(super) fn new(capacity: usize) -> Marker {
        Marker { stack: Vec::new(), capacity: capacity.max(1), pieces: Vec::new(), grays: 0, bytes: 0 }
    }

    fn is_drained(&self) -> bool {
        self.stack.is_empty() && self.pieces.is_empty() && self.grays == 0
    }

    /// Forgets what was to be followed: no marking is under way. The last one has marked so many bytes.
    pub(super) fn forget(&mut self, bytes: u64) {
        self.stack.clear();
        self.pieces.clear();
        (self.grays, self.bytes) = (0, bytes);
    }

    /// Moves gray objects of an arena to the stack, as many as there is room for.
    fn take_grays_of(&mut self, arena: &mut Arena) {
        for block in 1..=BLOCKS {
            let start = arena.address(block);
            let mut from = 0;
            while let Some(granule) = next_gray(arena.metadata(block), from) {
                if self.stack.len() >= self.capacity {
                    return;
                }
                let byte = &mut arena.metadata_mut(block)[granule];
                let is_cons = *byte & GRAY_CONS != 0;
                *byte &= !(GRAY | GRAY_CONS);
                arena.header_mut().grays -= 1;
                self.grays -= 1;
                let address = start + granule * GRANULE;
                // SAFETY: `make_gray` made this byte gray for the cons or object that starts here.
                self.stack.push(unsafe {
                    if is_cons {
                        Value::from_cons(std::ptr::with_exposed_provenance_mut(address))
                    } else {
                        Value::from_object(std::ptr::with_exposed_provenance_mut(address))
                    }
                });
                from = granule + 1;
            }
        }
    }
}

impl Heap {
    /// Begins a cycle. The caller marks the fixed roots at once, before anything else runs. While marking is
    /// under way nothing happens; a sweep under way is finished first.
    pub fn begin_cycle(&mut self) {
        match self.phase {
            Phase::Marking => return,
            Phase::Sweeping => self.finish_sweep(),
            Phase::Idle => {}
        }
        self.start_marking();
    }

    fn start_marking(&mut self) {
        debug_assert!(self.marker.is_drained());
        self.count_regions();
        self.phase = Phase::Marking;
        self.marking = true;
        self.epoch = next_epoch(self.epoch);
        self.cycle_id += 1;
        self.due = false;
        self.marker.bytes = 0;
        (self.pacing.owed, self.pacing.black) = (0, 0);
        self.first.begin_marking(self.epoch);
        self.second.begin_marking(self.epoch);
    }

    /// Marks a value: it outlives this cycle with everything reachable from it. Without a marking under way
    /// nothing happens.
    #[inline]
    pub fn mark(&mut self, v: Value) {
        if self.marking && v.is_address() && self.set_mark(v) {
            self.push(v);
        }
    }

    /// Marks all values of a root or stack. Addresses of instructions among them do no harm.
    pub fn mark_slice(&mut self, values: &[Value]) {
        for &v in values {
            self.mark(v);
        }
    }

    /// Returns whether `v` is marked in the cycle under way; without one the answer means nothing. A value
    /// without an address counts as marked.
    pub fn is_marked(&self, v: Value) -> bool {
        if !v.is_address() {
            return true;
        }
        // SAFETY: H1, H2: the value is the address of a live cons or object; by its size it lies in an arena
        // or is large.
        unsafe {
            if let Some(object) = v.as_object_ptr()
                && large::is_large((*object).size())
            {
                return (*large::header_of(object)).epoch == self.epoch;
            }
            *metadata_of(address_of(v)) & EPOCH == self.epoch
        }
    }

    /// Sets the mark of an address. Returns whether it was unmarked and has to be followed.
    #[inline]
    fn set_mark(&mut self, v: Value) -> bool {
        debug_assert!(v != Value::POISON && v.is_address());
        #[cfg(feature = "paranoid")]
        self.assert_mine(v);
        let epoch = self.epoch;
        if v.is_cons() {
            let byte = metadata_of(v.cons_ptr().addr());
            // SAFETY: H1, H2: a cons value is the address of a live cons, which lies in an arena.
            unsafe {
                if *byte & EPOCH == epoch {
                    return false;
                }
                *byte = epoch | END;
            }
            self.marker.bytes += GRANULE as u64;
            return true;
        }
        let object = v.object_ptr();
        // SAFETY: H1, H2: an object value is the address of a live object; by its size it lies in an arena or
        // is large.
        unsafe {
            let header = *object;
            let bytes = header.size();
            if large::is_large(bytes) {
                let large = large::header_of(object);
                if (*large).epoch == epoch {
                    return false;
                }
                (*large).epoch = epoch;
            } else {
                let first = metadata_of(object.addr());
                if *first & EPOCH == epoch {
                    return false;
                }
                *first = *first & !EPOCH | epoch;
                *first.add(bytes / GRANULE - 1) |= END;
            }
            self.marker.bytes += bytes as u64;
            !header.kind.is_raw() && header.len != 0
        }
    }

    /// Notes a marked object that has to be followed.
    #[inline(always)]
    fn push(&mut self, v: Value) {
        if self.marker.stack.len() < self.marker.stack.capacity() {
            self.marker.stack.push(v);
        } else {
            self.push_or_make_gray(v);
        }
    }

    /// As [`Heap::push`], where the stack has to grow for it, or is full. Apart, since most marking calls
    /// nothing then, and so saves no registers.
    #[cold]
    #[inline(never)]
    fn push_or_make_gray(&mut self, v: Value) {
        if self.marker.stack.len() < self.marker.capacity {
            let length = self.marker.stack.len();
            self.marker.stack.reserve_exact(length.max(FIRST_ROOM).min(self.marker.capacity - length));
            self.marker.stack.push(v);
        } else {
            self.make_gray(v);
        }
    }

    #[cold]
    fn make_gray(&mut self, v: Value) {
        self.marker.grays += 1;
        // SAFETY: `v` was marked just now, so it is live, in an arena or large.
        unsafe {
            if let Some(object) = v.as_object_ptr()
                && large::is_large((*object).size())
            {
                (*large::header_of(object)).gray = true;
                return;
            }
            let address = address_of(v);
            *metadata_of(address) |= if v.is_cons() { GRAY | GRAY_CONS } else { GRAY };
            (*arena::header_of(address)).grays += 1;
        }
    }

    /// Runs a slice of marking or sweeping of about `max_visits` objects, twice as many if allocation has run
    /// ahead. Every slice pays for 16 KiB allocated; [`Heap::gc_due`] tells whether the next one is due
    /// already.
    pub fn slice(&mut self, max_visits: u32) -> SliceOutcome {
        let behind = self.pacing.since_cycle > 2 * self.pacing.threshold + self.stats.live;
        let budget = i64::from(max_visits) * if behind { 2 } else { 1 };
        self.pacing.owed = self.pacing.owed.saturating_sub(super::alloc::PIECE as u64);
        self.due = self.pacing.owed >= super::alloc::PIECE as u64;
        let mut left = budget;
        let outcome = match self.phase {
            Phase::Idle => {
                self.due = self.pacing.since_cycle >= self.pacing.threshold;
                return SliceOutcome::Finished;
            }
            Phase::Marking => self.follow(&mut left),
            Phase::Sweeping => self.sweep_slice(&mut left),
        };
        self.stats.slices += 1;
        self.stats.longest_slice = self.stats.longest_slice.max((budget - left) as u64);
        outcome
    }

    /// Follows marked objects until none is left or the budget is spent.
    fn follow(&mut self, left: &mut i64) -> SliceOutcome {
        while *left > 0 {
            debug_assert!(self.marker.stack.len() <= self.marker.capacity);
            if let Some(v) = self.marker.stack.pop() {
                self.visit(v, left);
            } else if let Some((v, from)) = self.marker.pieces.pop() {
                self.visit_record(v, from, left);
            } else if self.marker.grays > 0 {
                self.collect_grays(left);
            } else {
                return SliceOutcome::Drained { left: *left as u32 };
            }
        }
        SliceOutcome::More
    }

    /// Follows a marked object, then the first unmarked cons or object that it leads to, and so on.
    fn visit(&mut self, mut v: Value, left: &mut i64) {
        while v.is_cons() {
            if *left <= 0 {
                return self.push(v);
            }
            *left -= 1;
            // SAFETY: H1, H2: a marked value is the address of a live cons.
            let Cons { car, cdr } = unsafe { *v.cons_ptr() };
            let follow_cdr = cdr.is_address() && self.set_mark(cdr);
            let follow_car = car.is_address() && self.set_mark(car);
            v = match (follow_car, follow_cdr) {
                (true, true) => {
                    self.push(cdr);
                    car
                }
                (true, false) => car,
                (false, true) => cdr,
                (false, false) => return,
            };
        }
        self.visit_record(v, 0, left);
    }

    /// Follows a marked object from slot `from` on.
    fn visit_record(&mut self, v: Value, from: usize, left: &mut i64) {
        let object = v.object_ptr();
        // SAFETY: H1, H2: a marked value is the address of a live object; H3: its kind says which of its
        // words are values; none of them is written while this runs.
        let (slots, more): (&[Value], &[Value]) = unsafe {
            let header = *object;
            let first = object.add(1).cast::<Value>();
            if header.kind == Kind::Code {
                let code = object.cast::<CodeObject>();
                let constants = object.byte_add(CodeObject::CONSTANTS_OFFSET).cast::<Value>();
                let n = (*code).nconsts as usize;
                (std::slice::from_raw_parts(first, 3), std::slice::from_raw_parts(constants, n))
            } else {
                debug_assert!(header.kind.is_record());
                (&[], std::slice::from_raw_parts(first, header.len as usize))
            }
        };
        let end = more.len().min(from + PIECE_LENGTH);
        if end < more.len() {
            self.marker.pieces.push((v, end));
        }
        if from == 0 {
            self.mark_slice(slots);
        }
        self.mark_slice(&more[from..end]);
        *left -= 1 + (end - from) as i64 / ELEMENTS_PER_VISIT;
    }

    /// Moves gray objects to the empty mark stack: as many as there is room for, from one arena or from among
    /// the large objects.
    fn collect_grays(&mut self, left: &mut i64) {
        debug_assert!(self.marker.stack.is_empty());
        *left -= GRAY_SEARCH_VISITS;
        if let Some(arena) = self.arenas.iter_mut().flatten().find(|arena| arena.header().grays > 0) {
            return self.marker.take_grays_of(arena);
        }
        for large in self.large.iter_mut().filter(|large| large.header().gray).take(self.marker.capacity) {
            large.header_mut().gray = false;
            self.marker.grays -= 1;
            // SAFETY: a gray large object is marked, so it is a live object in full.
            self.marker.stack.push(unsafe { Value::from_object(large.object().as_ptr().cast::<Header>()) });
        }
    }

    /// Ends marking. Everything that was neither marked nor allocated in this cycle will be freed.
    ///
    /// # Safety
    /// Every value that will still be used was marked, is reachable from a marked one, or was allocated
    /// since the cycle began.
    ///
    /// # Panics
    /// Unless marking is under way and the last slice was [`SliceOutcome::Drained`], with nothing marked
    /// since.
    pub unsafe fn end_marking(&mut self) {
        assert!(
            self.phase == Phase::Marking && self.marker.is_drained(),
            "something is still to be followed"
        );
        self.count_regions();
        self.first.restart(true);
        self.second.restart(true);
        self.stats.live = self.marker.bytes + self.pacing.black;
        self.stats.cycles += 1;
        self.marking = false;
        self.begin_sweep();
    }

    /// Abandons the marking under way. Its marks stay in the metadata; the sweep of the next cycle clears
    /// them.
    fn abandon_marking(&mut self) {
        self.count_regions();
        self.first.restart(true);
        self.second.restart(true);
        self.marker.stack.clear();
        self.marker.pieces.clear();
        while self.marker.grays > 0 {
            self.collect_grays(&mut 0);
            self.marker.stack.clear();
        }
        self.marking = false;
        self.phase = Phase::Idle;
    }

    /// Runs a whole cycle at once: gives up one in progress, calls `mark_roots`, follows everything, and
    /// frees the rest.
    ///
    /// # Safety
    /// The contract of [`Heap::end_marking`], for what `mark_roots` marks.
    pub unsafe fn collect_fully(&mut self, mark_roots: impl FnOnce(&mut Heap)) {
        // SAFETY: by the contract `mark_roots` marks every value that will be used.
        unsafe { self.collect_fully_and_tell(mark_roots, |_| {}) }
    }

    /// As [`Heap::collect_fully`]; `tell` is called when [`Heap::is_marked`] says what goes on living, before
    /// the rest is freed.
    ///
    /// # Safety
    /// The contract of [`Heap::end_marking`], for what `mark_roots` marks.
    pub unsafe fn collect_fully_and_tell(
        &mut self,
        mark_roots: impl FnOnce(&mut Heap),
        tell: impl FnOnce(&Heap),
    ) {
        // SAFETY: the contract is the same.
        unsafe { self.collect_fully_and_find(None, mark_roots, tell) };
    }

    /// As [`Heap::collect_fully_and_tell`]. Returns the structures that go on living and are instances of
    /// just this class, if one is given.
    ///
    /// # Safety
    /// The contract of [`Heap::end_marking`], for what `mark_roots` marks.
    pub unsafe fn collect_fully_and_find(
        &mut self,
        class: Option<Value>,
        mark_roots: impl FnOnce(&mut Heap),
        tell: impl FnOnce(&Heap),
    ) -> Vec<Value> {
        match self.phase {
            Phase::Marking => self.abandon_marking(),
            Phase::Sweeping => self.finish_sweep(),
            Phase::Idle => {}
        }
        self.start_marking();
        mark_roots(self);
        let found = class.map_or(Vec::new(), |class| self.follow_and_find(class));
        while let SliceOutcome::More = self.follow(&mut i64::from(u32::MAX)) {}
        tell(self);
        // SAFETY: by the contract, `mark_roots` has marked every value that will be used, and everything
        // reachable from those was followed.
        unsafe { self.end_marking() };
        self.finish_sweep();
        found
    }

    /// Follows marked objects until none is left. Returns the instances of just this class among them.
    fn follow_and_find(&mut self, class: Value) -> Vec<Value> {
        let (mut found, mut left) = (Vec::new(), i64::MAX);
        loop {
            // Every marked object that has values comes to the stack once, and to `pieces` behind that.
            if let Some(v) = self.marker.stack.pop() {
                if let Some(Cons { car, cdr }) = self.as_cons(v) {
                    self.mark(cdr);
                    self.mark(car);
                    continue;
                }
                if self.structure_class(v) == Some(class) {
                    found.push(v);
                }
                self.visit_record(v, 0, &mut left);
            } else if let Some((v, from)) = self.marker.pieces.pop() {
                self.visit_record(v, from, &mut left);
            } else if self.marker.grays > 0 {
                self.collect_grays(&mut left);
            } else {
                return found;
            }
        }
    }
}

/// Returns the address of a cons or object.
#[inline(always)]
pub(super) fn address_of(v: Value) -> usize {
    (v.bits() & !crate::value::TAG_MASK) as usize
}
