//! Allocation of raw memory.

use super::Heap;
use std::ptr::NonNull;

/// Why there was no memory.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum AllocError {
    /// The limit would be passed: collect, try again, and raise `:heap-exhausted` if that fails too.
    NeedCollection,
    /// A single object beyond what the limit, or the length of an object, could ever hold.
    TooLarge {
        /// Bytes asked for.
        requested: usize,
    },
}

/// Free memory of which objects are cut off at the front.
pub(crate) struct Hole {
    pub(crate) next: usize,
    pub(crate) end: usize,
}

impl Hole {
    pub(crate) const fn empty() -> Hole {
        Hole { next: 0, end: 0 }
    }
}

impl Heap {
    #[inline(always)]
    pub(super) fn bump(&mut self, bytes: usize) -> Option<NonNull<u8>> {
        let start = self.hole.next;
        if self.hole.end - start < bytes {
            return None;
        }
        self.hole.next = start + bytes;
        NonNull::new(std::ptr::with_exposed_provenance_mut(start))
    }

    #[inline(always)]
    pub(super) fn allocate(&mut self, bytes: usize) -> Result<NonNull<u8>, AllocError> {
        match self.bump(bytes) {
            Some(p) => Ok(p),
            None => self.allocate_slow(bytes),
        }
    }

    #[cold]
    #[inline(never)]
    fn allocate_slow(&mut self, bytes: usize) -> Result<NonNull<u8>, AllocError> {
        let size = bytes.max(1 << 20);
        let layout = std::alloc::Layout::from_size_align(size, 16).map_err(|_| AllocError::NeedCollection)?;
        // SAFETY: the size is not zero.
        let p = unsafe { std::alloc::alloc(layout) };
        if p.is_null() {
            return Err(AllocError::NeedCollection);
        }
        self.arenas.push(p);
        self.hole.next = p.expose_provenance();
        self.hole.end = self.hole.next + size;
        self.bump(bytes).ok_or(AllocError::NeedCollection)
    }
}
