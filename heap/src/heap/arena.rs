//! Arenas: 1 MiB of memory from the system, aligned to its size, cut into 16 blocks.
//!
//! ```text
//! block 0                                     blocks 1 to 15
//! | ArenaHeader | metadata of blocks 1 to 15 | objects ...
//! ```
//!
//! One byte of metadata for 16 bytes is a sixteenth, so the metadata of all blocks has just the size of one
//! block, and the bytes that would describe block 0 itself make room for the header. From any address in an
//! arena, masking leads to the header, and shifting to the byte of the granule.
//!
//! Unsafe invariants:
//! 1. An arena is live, and its metadata initialised, from [`Arena::new`] until its memory is dropped; its
//!    provenance is exposed.
//! 2. References to metadata are made only through a borrow of the [`Arena`], and live no longer than one
//!    function.

use super::layout::GRANULE;
use super::metadata::{self, SweepCounts};
use super::range::AddressRange;
use crate::list_state;
use crate::state::StateSink;
use std::alloc::{Layout, alloc, dealloc};
use std::ops::Range;
use std::ptr::NonNull;
use std::sync::Arc;

/// Bytes of a block. Blocks are smaller under Miri, which would otherwise spend its time on metadata.
pub(super) const BLOCK: usize = if cfg!(miri) { 4 << 10 } else { 64 << 10 };
/// Bytes of an arena, and its alignment.
pub(super) const ARENA: usize = BLOCK * 16;
/// Number of blocks for objects; their numbers are 1 to 15.
pub(super) const BLOCKS: usize = 15;
/// Granules of a block.
pub(super) const BLOCK_GRANULES: usize = BLOCK / GRANULE;
/// Objects above this size, in bytes, live outside of arenas.
pub(super) const LARGE: usize = BLOCK / 8;

const LAYOUT: Layout = match Layout::from_size_align(ARENA, ARENA) {
    Ok(layout) => layout,
    Err(_) => unreachable!(),
};

/// Header at the start of an arena: the fields that must be found from an address alone.
#[repr(C)]
pub(super) struct ArenaHeader {
    /// Index in the heap's table.
    pub(super) number: u32,
    /// Number of granules marked gray.
    pub(super) grays: u32,
}

const _: () = assert!(size_of::<ArenaHeader>() <= BLOCK / GRANULE);

/// State of a block between two cycles.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum BlockState {
    /// Holds objects that the last cycle did not mark; not to be allocated from.
    Unswept,
    /// Canonical, and not allocated from since.
    Swept,
    /// Allocated from since it was swept.
    Taken,
}

/// State of a block, and the counts of the last sweep.
#[derive(Copy, Clone, Debug)]
pub(super) struct BlockInfo {
    pub(super) state: BlockState,
    pub(super) counts: SweepCounts,
}

crate::stored_enum! { BlockState { Unswept = 0, Swept = 1, Taken = 2 } }
crate::stored! { BlockInfo { state, counts } }
list_state! { ArenaHeader { number: Derived, grays: Derived } }
list_state! { BlockInfo { state: Run by |&state: &BlockState, sink: &mut dyn StateSink| sink.word(state as u64), counts: Parts } }

impl BlockInfo {
    const EMPTY: BlockInfo = BlockInfo {
        state: BlockState::Swept,
        counts: SweepCounts { free: BLOCK_GRANULES, largest: BLOCK_GRANULES },
    };

    /// Returns whether nothing at all lives in the block.
    pub(super) fn is_empty(&self) -> bool {
        self.state == BlockState::Swept && self.counts.free == BLOCK_GRANULES
    }
}

/// Memory of an arena, in the range of the heap if it has one. An image of the heap shares it, so that the
/// arena can be had again at its address.
pub(super) struct ArenaMemory(NonNull<u8>, Option<Arc<AddressRange>>);

// SAFETY: this only frees the memory; whatever reads or writes it goes through the heap, which has the arena.
unsafe impl Send for ArenaMemory {}
// SAFETY: a shared reference gives no access to the memory.
unsafe impl Sync for ArenaMemory {}

impl Drop for ArenaMemory {
    fn drop(&mut self) {
        match &self.1 {
            Some(range) => range.clear(self.0.addr().get(), ARENA),
            // SAFETY: `Arena::new` has allocated the memory with this layout; it is dropped once.
            None => unsafe { dealloc(self.0.as_ptr(), LAYOUT) },
        }
    }
}

/// Arena of the heap, owned.
pub(super) struct Arena {
    base: NonNull<u8>,
    blocks: [BlockInfo; BLOCKS + 1],
    /// Whether it was taken from what is kept for cleanups.
    pub(super) is_lent: bool,
    memory: Arc<ArenaMemory>,
}

// The objects and metadata behind `base` are the run's, their address is the process's.
list_state! { Arena { base: Visited, blocks: Parts, is_lent: Run, memory: Process } }

impl Arena {
    /// Creates an arena with empty blocks; `None` if the system has no memory. All of it is initialised if it
    /// `is_zeroed`. It is in the range, if there is one, at the place of its number.
    pub(super) fn new(number: u32, is_zeroed: bool, range: Option<&Arc<AddressRange>>) -> Option<Arena> {
        // SAFETY: the size is not zero. The metadata block is zeroed and the header written before anything
        // reads them. Memory of a range is zero, and belongs to the arena of its number alone.
        unsafe {
            let base = match range {
                Some(range) => range.arena(number)?,
                None => {
                    let base = NonNull::new(alloc(LAYOUT))?;
                    base.write_bytes(0, if is_zeroed { ARENA } else { BLOCK });
                    base
                }
            };
            base.cast().write(ArenaHeader { number, grays: 0 });
            base.as_ptr().expose_provenance();
            let memory = Arc::new(ArenaMemory(base, range.cloned()));
            let arena = Arena { base, blocks: [BlockInfo::EMPTY; BLOCKS + 1], is_lent: false, memory };
            if cfg!(debug_assertions) {
                for block in 1..=BLOCKS {
                    poison(arena.address(block), 0..BLOCK_GRANULES);
                }
            }
            Some(arena)
        }
    }

    /// Returns the arena with this memory, which `blocks` describes, as it was.
    pub(super) fn again(memory: &Arc<ArenaMemory>, blocks: [BlockInfo; BLOCKS + 1], is_lent: bool) -> Arena {
        Arena { base: memory.0, blocks, is_lent, memory: memory.clone() }
    }

    /// Returns whether an address lies in the arena.
    pub(super) fn contains(&self, address: usize) -> bool {
        address & !(ARENA - 1) == self.base.addr().get()
    }

    /// Returns the memory.
    pub(super) fn memory(&self) -> &Arc<ArenaMemory> {
        &self.memory
    }

    /// Gives the blocks states and counts.
    pub(super) fn set_blocks(&mut self, blocks: [BlockInfo; BLOCKS + 1]) {
        self.blocks = blocks;
    }

    /// Returns the states and counts of all blocks; that at 0 means nothing.
    pub(super) fn blocks(&self) -> [BlockInfo; BLOCKS + 1] {
        self.blocks
    }

    /// Returns the objects of a block, as bytes.
    ///
    /// # Safety
    /// The arena was made zeroed, or in a range, and no object of the block is changed while the slice lives.
    pub(super) unsafe fn objects(&self, block: usize) -> &[u8] {
        // SAFETY: invariant 1: the arena is live; by the contract all of it is initialised, since objects
        // are, and nothing changes the block; the slice borrows the arena.
        unsafe {
            let start: *const u8 = std::ptr::with_exposed_provenance(self.address(block));
            std::slice::from_raw_parts(start, BLOCK)
        }
    }

    /// Returns the objects of a block, as bytes that may be changed.
    ///
    /// # Safety
    /// The arena was made zeroed, or in a range, and no object of the block is used while the slice lives.
    pub(super) unsafe fn objects_mut(&mut self, block: usize) -> &mut [u8] {
        // SAFETY: invariant 1: the arena is live; by the contract all of it is initialised, since objects
        // are, and nothing else refers to the block; the slice borrows the arena mutably.
        unsafe {
            let start: *mut u8 = std::ptr::with_exposed_provenance_mut(self.address(block));
            std::slice::from_raw_parts_mut(start, BLOCK)
        }
    }

    /// Returns the address of the first byte of a block.
    pub(super) fn address(&self, block: usize) -> usize {
        debug_assert!((1..=BLOCKS).contains(&block));
        self.base.addr().get() + block * BLOCK
    }

    /// Returns the state and counts of a block.
    pub(super) fn block(&self, block: usize) -> &BlockInfo {
        &self.blocks[block]
    }

    /// Notes that a block is allocated from.
    pub(super) fn take(&mut self, block: usize) {
        debug_assert_eq!(self.blocks[block].state, BlockState::Swept);
        self.blocks[block].state = BlockState::Taken;
    }

    /// Returns whether nothing lives in any block.
    pub(super) fn is_empty(&self) -> bool {
        self.blocks[1..].iter().all(BlockInfo::is_empty)
    }

    /// Notes that a marking has ended: all blocks but empty ones are to be swept.
    pub(super) fn expect_sweep(&mut self) {
        for block in &mut self.blocks[1..] {
            if !block.is_empty() {
                block.state = BlockState::Unswept;
            }
        }
    }

    /// Sweeps a block, and returns the number of bytes that live in it.
    pub(super) fn sweep(&mut self, block: usize, epoch: u8) -> usize {
        debug_assert_eq!(self.blocks[block].state, BlockState::Unswept);
        let address = self.address(block);
        let counts = metadata::sweep(self.metadata_mut(block), epoch, |hole| {
            if cfg!(debug_assertions) {
                // SAFETY: H2: a hole of a block just swept holds nothing that will be read.
                unsafe { poison(address, hole) };
            }
        });
        self.blocks[block] = BlockInfo { state: BlockState::Swept, counts };
        (BLOCK_GRANULES - counts.free) * GRANULE
    }

    /// Returns the metadata of a block.
    pub(super) fn metadata(&self, block: usize) -> &[u8] {
        debug_assert!((1..=BLOCKS).contains(&block));
        // SAFETY: invariant 1: the arena is live; the bytes of block b stand at offset b * BLOCK / 16;
        // invariant 2: the slice borrows the arena.
        unsafe {
            let start = self.base.as_ptr().add(block * BLOCK_GRANULES);
            std::slice::from_raw_parts(start, BLOCK_GRANULES)
        }
    }

    /// Returns the metadata of a block, to be changed.
    pub(super) fn metadata_mut(&mut self, block: usize) -> &mut [u8] {
        debug_assert!((1..=BLOCKS).contains(&block));
        // SAFETY: invariant 1: the arena is live; the bytes of block b stand at offset b * BLOCK / 16;
        // invariant 2: the slice borrows the arena mutably.
        unsafe {
            let start = self.base.as_ptr().add(block * BLOCK_GRANULES);
            std::slice::from_raw_parts_mut(start, BLOCK_GRANULES)
        }
    }

    /// Returns the header, to be changed.
    pub(super) fn header_mut(&mut self) -> &mut ArenaHeader {
        // SAFETY: invariant 1: the arena is live and begins with its header, which is borrowed mutably with
        // it.
        unsafe { self.base.cast().as_mut() }
    }

    /// Returns the header.
    pub(super) fn header(&self) -> &ArenaHeader {
        // SAFETY: invariant 1: the arena is live and begins with its header, which is borrowed with it.
        unsafe { self.base.cast().as_ref() }
    }
}

/// Returns the header of the arena around an address.
#[inline(always)]
pub(super) fn header_of(address: usize) -> *mut ArenaHeader {
    std::ptr::with_exposed_provenance_mut(address & !(ARENA - 1))
}

/// Returns the metadata byte of the granule at an address in an arena.
#[inline(always)]
pub(super) fn metadata_of(address: usize) -> *mut u8 {
    let offset = address & (ARENA - 1);
    std::ptr::with_exposed_provenance_mut((address - offset) + offset / GRANULE)
}

/// Writes a value that no program has over granules of the block at `address`.
///
/// # Safety
/// The granules are not read before they are allocated again.
unsafe fn poison(address: usize, granules: Range<usize>) {
    let start = std::ptr::with_exposed_provenance_mut::<u64>(address + granules.start * GRANULE);
    // SAFETY: the granules lie in one block of a live arena, and by the contract nothing else uses them.
    unsafe {
        for i in 0..granules.len() * (GRANULE / 8) {
            start.add(i).write(crate::value::Value::POISON.bits());
        }
    }
}
