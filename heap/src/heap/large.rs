//! Large objects: those above an eighth of a block. Each has memory of its own. The sweep gives it back to
//! the system piece by piece, since the system takes as long for that as it took to provide the memory.
//!
//! ```text
//! | LargeHeader (32 bytes) | Header | elements ...
//!                          ^ the address in the value
//! ```
//!
//! The size of an object, and so its header, tells whether it is large: the marker needs no table.

use super::arena::LARGE;
use super::layout::{GRANULE, Header};
use super::range::AddressRange;
use crate::list_state;
use crate::state::{StateSink, Stated};
use std::alloc::{Layout, alloc, alloc_zeroed, dealloc, realloc};
use std::ptr::NonNull;
use std::sync::Arc;

/// Header before a large object.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
pub(super) struct LargeHeader {
    /// Bytes of the whole allocation, this header included.
    pub(super) bytes: usize,
    /// Ordinal among the large objects of the heap, and so the object's identity.
    pub(super) number: u64,
    /// Index in the heap's list of large objects.
    pub(super) index: usize,
    /// Epoch in which the object was marked or allocated.
    pub(super) epoch: u8,
    /// Whether the object is marked, but still to be followed.
    pub(super) gray: bool,
    /// Number of elements that have been filled, if the object is unfinished.
    pub(super) filled: u32,
}

const _: () = assert!(size_of::<LargeHeader>() == 32 && size_of::<LargeHeader>().is_multiple_of(GRANULE));

crate::stored! { LargeHeader { bytes, number, index, epoch, gray, filled } }

list_state! {
    LargeHeader {
        bytes: Run,
        number: Run,
        index: Derived,
        epoch: Run,
        gray: Run,
        filled: Run,
    }
}

/// Returns the bytes that an object of this size takes from the system.
pub(super) const fn footprint(bytes: usize) -> usize {
    bytes + size_of::<LargeHeader>()
}

/// Returns whether an object of this size is large.
#[inline(always)]
pub(super) const fn is_large(bytes: usize) -> bool {
    bytes > LARGE
}

/// Memory of a large object. An image of the heap shares it, so that the object can be had again at its
/// address.
pub(super) struct LargeMemory {
    start: NonNull<LargeHeader>,
    /// The range of the heap, if it has one: then the memory is there.
    range: Option<Arc<AddressRange>>,
    /// Bytes from the system. The header may say less, of an object that is being freed.
    bytes: usize,
}

// SAFETY: this only frees the memory; whatever reads or writes it goes through the heap, which has the
// object.
unsafe impl Send for LargeMemory {}
// SAFETY: a shared reference gives no access to the memory.
unsafe impl Sync for LargeMemory {}

impl Drop for LargeMemory {
    fn drop(&mut self) {
        if let Some(range) = &self.range {
            return range.give_back(self.start.addr().get(), self.bytes);
        }
        // SAFETY: `LargeObject::new` or `shrink` has allocated the memory with this layout; it is dropped
        // once.
        unsafe { dealloc(self.start.as_ptr().cast(), Layout::from_size_align_unchecked(self.bytes, GRANULE)) }
    }
}

/// Large object, owned.
pub(super) struct LargeObject {
    start: NonNull<LargeHeader>,
    memory: Arc<LargeMemory>,
    /// Numbers of the pages, if these are the machine's own: contents have one that no others have had
    /// ([`super::image`]).
    pub(super) numbers: Vec<u64>,
}

// The header and the object are the run's, their address is the process's.
list_state! { LargeObject { start: Parts by tell_header, memory: Process, numbers: Process } }

fn tell_header(header: &NonNull<LargeHeader>, sink: &mut dyn StateSink) {
    // SAFETY: the header lives as long as the object that owns it, which the caller borrows.
    unsafe { header.as_ref() }.tell(sink);
}

impl LargeObject {
    /// Allocates memory for an object of `bytes`; `None` if the system has none. All of it is initialised if
    /// it `is_zeroed`.
    pub(super) fn new(
        bytes: usize,
        number: u64,
        index: usize,
        epoch: u8,
        is_zeroed: bool,
        range: Option<&Arc<AddressRange>>,
    ) -> Option<LargeObject> {
        let bytes = footprint(bytes);
        let layout = Layout::from_size_align(bytes, GRANULE).ok()?;
        // SAFETY: the size is not zero, and the header is written at once.
        unsafe {
            let start = match range {
                Some(range) => range.take(bytes)?,
                None => NonNull::new(if is_zeroed { alloc_zeroed(layout) } else { alloc(layout) })?,
            };
            let start = start.cast::<LargeHeader>();
            start.write(LargeHeader { bytes, number, index, epoch, gray: false, filled: 0 });
            start.as_ptr().expose_provenance();
            let memory = Arc::new(LargeMemory { start, range: range.cloned(), bytes });
            Some(LargeObject { start, memory, numbers: Vec::new() })
        }
    }

    /// Returns an object at `start` in a range, with this header; `None` unless there is room. Its elements
    /// are zero.
    pub(super) fn at(start: usize, header: LargeHeader, range: &Arc<AddressRange>) -> Option<LargeObject> {
        let bytes = header.bytes;
        if bytes < footprint(LARGE) {
            return None;
        }
        let start = range.claim(start, bytes)?.cast::<LargeHeader>();
        let memory = Arc::new(LargeMemory { start, range: Some(range.clone()), bytes });
        // SAFETY: the room was taken just now, and is larger than a header.
        unsafe { start.write(header) };
        Some(LargeObject { start, memory, numbers: Vec::new() })
    }

    /// Returns the address of the allocation.
    pub(super) fn address(&self) -> usize {
        self.start.addr().get()
    }

    /// Returns the object with this memory, which has this header and pages of these numbers again.
    ///
    /// # Safety
    /// The header is one that this object has had, and the object is not borrowed.
    pub(super) unsafe fn again(
        memory: &Arc<LargeMemory>,
        header: LargeHeader,
        numbers: Vec<u64>,
    ) -> LargeObject {
        // SAFETY: the memory is live, begins with the header, and by the contract is not borrowed.
        unsafe { memory.start.write(header) };
        LargeObject { start: memory.start, memory: memory.clone(), numbers }
    }

    /// Returns the memory.
    pub(super) fn memory(&self) -> &Arc<LargeMemory> {
        &self.memory
    }

    /// Returns the object proper, as bytes.
    ///
    /// # Safety
    /// The object was made zeroed, or in a range, its header states its bytes, and it is not changed while
    /// the slice lives.
    pub(super) unsafe fn bytes(&self) -> &[u8] {
        let bytes = self.header().bytes - footprint(0);
        // SAFETY: so many bytes follow the header; by the contract they are initialised and nothing changes
        // them.
        unsafe { std::slice::from_raw_parts(self.object().as_ptr(), bytes) }
    }

    /// Returns the object proper, as bytes that may be changed.
    ///
    /// # Safety
    /// The object was made zeroed, or in a range, its header states its bytes, and it is not used while the
    /// slice lives.
    pub(super) unsafe fn bytes_mut(&mut self) -> &mut [u8] {
        let bytes = self.header().bytes - footprint(0);
        // SAFETY: so many bytes follow the header; by the contract they are initialised and nothing else
        // refers to them.
        unsafe { std::slice::from_raw_parts_mut(self.object().as_ptr(), bytes) }
    }

    /// Returns the address of the object proper.
    pub(super) fn object(&self) -> NonNull<u8> {
        // SAFETY: the allocation is longer than the header.
        unsafe { self.start.add(1).cast() }
    }

    /// Gives about `bytes` from the end of an object that is no longer in use back to the system, and returns
    /// their number. `None` if few would be left, or the system does not want them: then the object is to be
    /// dropped.
    pub(super) fn shrink(&mut self, bytes: usize) -> Option<usize> {
        let old = self.header().bytes;
        let bytes = bytes / GRANULE * GRANULE;
        let new = old.checked_sub(bytes).filter(|&new| bytes > 0 && new > super::arena::LARGE)?;
        // Memory that an image shares stays; it counts as given back all the same.
        if let Some(memory) = Arc::get_mut(&mut self.memory) {
            if let Some(range) = &memory.range {
                range.give_back(memory.start.addr().get() + new, old - new);
                memory.bytes = new;
                self.header_mut().bytes = new;
                return Some(bytes);
            }
            // SAFETY: this is the layout of the allocation, and `new` is a smaller size; the header is at the
            // start, which stays.
            unsafe {
                let layout = Layout::from_size_align_unchecked(memory.bytes, GRANULE);
                memory.start = NonNull::new(realloc(memory.start.as_ptr().cast(), layout, new))?.cast();
            }
            memory.bytes = new;
            self.start = memory.start;
        }
        self.header_mut().bytes = new;
        Some(bytes)
    }

    /// Returns the header.
    pub(super) fn header(&self) -> &LargeHeader {
        // SAFETY: `new` has written the header, which lives until `self` is dropped and is borrowed with it.
        unsafe { self.start.as_ref() }
    }

    /// Returns the header, to be changed.
    pub(super) fn header_mut(&mut self) -> &mut LargeHeader {
        // SAFETY: `new` has written the header, which lives until `self` is dropped and is borrowed mutably
        // with it.
        unsafe { self.start.as_mut() }
    }
}

/// Returns the header before a large object.
///
/// # Safety
/// `object` is a live large object.
#[inline(always)]
pub(super) unsafe fn header_of(object: *mut Header) -> *mut LargeHeader {
    // SAFETY: by the contract the object is large, so its header precedes it in the same allocation.
    unsafe { object.cast::<LargeHeader>().sub(1) }
}
