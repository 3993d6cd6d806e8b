//! The heap: where everything lives that a [`Value`] has the address of.
#![allow(unsafe_code)]

pub mod layout;

mod access;
mod alloc;
mod object;

pub use alloc::AllocError;
pub use layout::Kind;
pub use object::CodeParts;

use crate::value::Value;

/// What a heap may use, and when it collects.
#[derive(Clone, Debug)]
pub struct HeapConfig {
    /// Bytes that the heap may take from the system, metadata included.
    pub limit: usize,
    /// A cycle starts when this much, or as much as was live if that is more, was allocated since the last one.
    pub cycle_floor: usize,
}

impl Default for HeapConfig {
    fn default() -> Self {
        HeapConfig { limit: 1 << 30, cycle_floor: 8 << 20 }
    }
}

/// What the collector is doing.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Phase {
    /// Nothing; a cycle starts when enough was allocated.
    Idle,
    /// Marking what is reachable; stores log what they overwrite.
    Marking,
    /// Giving back what was not marked.
    Sweeping,
}

/// What a slice has left to do.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum SliceOutcome {
    /// More of the same.
    More,
    /// All that was marked has been followed: mark the stacks not yet scanned, or end marking.
    Drained,
    /// The cycle is over.
    Finished,
}

/// Figures of a heap since it was made.
#[derive(Copy, Clone, Default, Debug, PartialEq, Eq)]
pub struct HeapStats {
    /// Cycles completed.
    pub cycles: u64,
    /// Slices run.
    pub slices: u64,
    /// Visits of the longest slice.
    pub longest_slice: u64,
    /// Bytes found live by the last cycle.
    pub live: u64,
    /// Bytes allocated.
    pub allocated: u64,
    /// Bytes taken from the system now.
    pub committed: u64,
    /// Most bytes ever taken from the system at once.
    pub peak: u64,
}

/// A heap.
pub struct Heap {
    pub(crate) hole: alloc::Hole,
    marking: bool,
    arenas: Vec<*mut u8>,
}

impl Heap {
    /// Makes an empty heap.
    ///
    /// # Safety
    /// The caller promises that a value with an address is used only with the heap that it came from, and not after
    /// that heap was dropped.
    pub unsafe fn new(_config: HeapConfig) -> Heap {
        Heap { hole: alloc::Hole::empty(), marking: false, arenas: Vec::new() }
    }

    /// A heap for the unit tests of this crate.
    #[cfg(test)]
    pub(crate) fn for_tests() -> Heap {
        // SAFETY: tests of this crate make one heap each and keep to it.
        unsafe { Heap::new(HeapConfig::default()) }
    }

    /// The write barrier: whoever overwrites a value in the heap, or in a root that is scanned only once per cycle,
    /// calls this with the old value first.
    #[inline(always)]
    pub fn log_if_marking(&mut self, old: Value) {
        if self.marking {
            self.log(old);
        }
    }

    #[cold]
    fn log(&mut self, _old: Value) {}

    /// Whether the collector wants to run at the next tick: begin a cycle when idle, else run a slice.
    #[inline(always)]
    pub fn gc_due(&self) -> bool {
        false
    }

    /// What the collector is doing.
    pub fn phase(&self) -> Phase {
        Phase::Idle
    }

    /// Number of the cycle that runs or ran last; a task stack notes it when it was scanned.
    pub fn cycle_id(&self) -> u64 {
        0
    }

    /// Begins a cycle. The caller marks the fixed roots at once, before anything else runs.
    pub fn begin_cycle(&mut self) {}

    /// Marks a value: it, and what it leads to, outlives this cycle.
    #[inline]
    pub fn mark(&mut self, _v: Value) {}

    /// Marks all values of a root or stack. Raw return addresses among them do no harm.
    pub fn mark_slice(&mut self, _values: &[Value]) {}

    /// Runs a slice of marking or sweeping, of about `max_visits` objects.
    pub fn slice(&mut self, _max_visits: u32) -> SliceOutcome {
        SliceOutcome::Finished
    }

    /// Ends marking; what was neither marked nor allocated in this cycle will be freed.
    ///
    /// # Safety
    /// Every value that anyone will still use was marked, is reachable from what was marked, or was allocated since
    /// the cycle began.
    ///
    /// # Panics
    /// Unless the last slice was [`SliceOutcome::Drained`] and nothing was marked since.
    pub unsafe fn end_marking(&mut self) {}

    /// A whole cycle at once: drops one in progress, calls `mark_roots`, follows everything, and frees the rest.
    ///
    /// # Safety
    /// As for [`Heap::end_marking`], of what `mark_roots` marks.
    pub unsafe fn collect_fully(&mut self, mark_roots: impl FnOnce(&mut Heap)) {
        mark_roots(self);
    }

    /// Opens the reserve above the limit, once, for the clause that handles `:heap-exhausted`; whether it was closed.
    pub fn open_reserve(&mut self) -> bool {
        true
    }

    /// Closes the reserve again.
    pub fn close_reserve(&mut self) {}

    /// A number that tells a value from all others alive at the same time, the same in every run of the same program:
    /// what `eq` hash tables hash.
    pub fn identity(&self, v: Value) -> u64 {
        v.bits()
    }

    /// Figures since the heap was made.
    pub fn stats(&self) -> HeapStats {
        HeapStats::default()
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
}
