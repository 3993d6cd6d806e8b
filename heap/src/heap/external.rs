//! Memory outside of the heap that counts against its limit: what a machine keeps beside its objects, such as
//! the stacks of its tasks.
//!
//! Each [`Holder`] says how many bytes it has. Its bytes leave less room for arenas and large objects. Those
//! of tasks put off the next cycle as live objects do, since the collector goes over them.
//!
//! Guarantees: what a holder has is counted even if it is too much, so the sum is always that of the last
//! reports.

use super::alloc::AllocError;
use super::{Heap, Phase};
use crate::list_state;

/// Part of a machine that has memory of its own.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Holder {
    /// Facts, rules and queries.
    Facts,
    /// Tasks with their stacks.
    Tasks,
    /// Symbols and packages.
    Names,
    /// Compilations under way.
    Compiler,
}

/// Number of holders.
const HOLDERS: usize = Holder::Compiler as usize + 1;

/// Bytes outside of the heap, by holder.
#[derive(Clone, Copy, Default)]
pub(super) struct External {
    held: [usize; HOLDERS],
    /// The sum of these.
    pub(super) total: usize,
    /// Bytes that the last request for memory lacked; the next sweep keeps no empty arenas in their place.
    pub(super) wanted: usize,
}

crate::stored! { External { held, total, wanted } }
list_state! { External { held: Derived, total: Derived, wanted: Run } }

impl External {
    /// Returns the bytes of tasks.
    pub(super) fn of_tasks(&self) -> usize {
        self.held[Holder::Tasks as usize]
    }
}

impl Heap {
    /// Notes that `holder` has so many bytes outside of the heap, even if they are too many.
    ///
    /// # Errors
    /// [`AllocError::NeedCollection`] if the limit is passed.
    pub fn set_external(&mut self, holder: Holder, bytes: usize) -> Result<(), AllocError> {
        let held = std::mem::replace(&mut self.external.held[holder as usize], bytes);
        self.external.total = self.external.total.saturating_sub(held).saturating_add(bytes);
        self.check_room(0)
    }

    /// Notes that a part of what `holder` has takes `after` bytes instead of `before`.
    pub fn recount_external(&mut self, holder: Holder, before: usize, after: usize) {
        // The limit is not checked here: the code that requested the bytes has checked it.
        for count in [&mut self.external.held[holder as usize], &mut self.external.total] {
            *count = count.saturating_sub(before).saturating_add(after);
        }
    }

    /// Checks that there is room for so many bytes more, inside or outside of the heap.
    ///
    /// # Errors
    /// [`AllocError::NeedCollection`] if the limit would be passed, [`AllocError::TooLarge`] if they alone
    /// pass it.
    pub fn check_room(&mut self, bytes: usize) -> Result<(), AllocError> {
        if bytes > self.limit {
            return Err(AllocError::TooLarge { requested: bytes });
        }
        if self.taken().saturating_add(bytes) <= self.limit_now() {
            return Ok(());
        }
        self.external.wanted = bytes;
        Err(AllocError::NeedCollection)
    }

    /// Returns the number of bytes for which there is room, inside or outside of the heap, without a
    /// collection.
    pub fn room(&self) -> usize {
        self.limit_now().saturating_sub(self.taken())
    }

    /// Returns the number of bytes outside of the heap that count against its limit.
    pub fn external(&self) -> usize {
        self.external.total
    }

    /// Returns the number of bytes that count against the limit.
    pub(super) fn taken(&self) -> usize {
        self.committed.saturating_add(self.external.total)
    }

    /// Returns whether the limit leaves no room for empty arenas.
    pub(super) fn is_crowded(&self) -> bool {
        debug_assert_eq!(self.phase, Phase::Sweeping);
        self.taken().saturating_add(self.external.wanted) > self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heap::HeapConfig;
    use crate::heap::arena::ARENA;

    #[test]
    fn bytes_outside_leave_less_room_inside() {
        let config = HeapConfig { limit: 4 * ARENA, ..HeapConfig::default() };
        // SAFETY: H1: the values stay in this test.
        let mut heap = unsafe { Heap::new(config) };
        assert_eq!(heap.set_external(Holder::Tasks, 2 * ARENA), Ok(()));
        heap.recount_external(Holder::Tasks, ARENA, ARENA / 2);
        assert_eq!(heap.set_external(Holder::Names, ARENA), Ok(()));
        assert_eq!(heap.external(), 5 * ARENA / 2);
        let vector = |heap: &mut Heap, bytes: usize| heap.alloc_vector_filled(bytes / 8, crate::Value::NIL);
        assert_eq!(vector(&mut heap, 2 * ARENA).map(|_| ()), Err(AllocError::NeedCollection));
        assert!(vector(&mut heap, ARENA).is_ok());
        assert_eq!(heap.check_room(ARENA), Err(AllocError::NeedCollection));
        assert_eq!(heap.check_room(5 * ARENA), Err(AllocError::TooLarge { requested: 5 * ARENA }));
        assert_eq!(heap.set_external(Holder::Tasks, 4 * ARENA), Err(AllocError::NeedCollection));
        assert_eq!(heap.set_external(Holder::Tasks, 0), Ok(()));
        assert!(vector(&mut heap, ARENA).is_ok());
    }

    #[test]
    fn a_collection_for_room_outside_keeps_no_empty_arenas() {
        let config = HeapConfig { limit: 6 * ARENA, ..HeapConfig::default() };
        // SAFETY: H1: the values stay in this test.
        let mut heap = unsafe { Heap::new(config) };
        while heap.stats().committed < 5 * ARENA as u64 {
            heap.alloc_vector_filled(1000, crate::Value::NIL).expect("there is room");
        }
        assert_eq!(heap.check_room(4 * ARENA), Err(AllocError::NeedCollection));
        // SAFETY: H2: no vector is used again.
        unsafe { heap.collect_fully(|_| {}) };
        assert_eq!(heap.check_room(4 * ARENA), Ok(()));
    }
}
