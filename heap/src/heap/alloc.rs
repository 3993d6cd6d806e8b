//! Allocation: bump pointers into the holes that the last sweep left.
//!
//! Two regions cut objects off the front of their current hole. The first takes every object that fits. If
//! one does not, a small object (up to [`SMALL`]) moves the first region on to its next hole, and a medium
//! one goes to the second region, so that a big object does not waste the rest of a small hole. Large objects
//! have memory of their own (`large`). Regions walk the blocks in order of address and sweep those they come
//! to; then they take a new arena, and at the limit the small holes that they passed over.
//!
//! Guarantees: nothing here collects. Objects allocated while marking count as marked. A refill sweeps at
//! most [`REFILL_SWEEPS`] blocks while the heap may grow. In every run the same allocations return the same
//! addresses relative to their arenas, and ask for slices at the same points.
//!
//! Invariants: `next <= end <= hole_end`; the granules from `next` to `hole_end` are free and in one block
//! whose state is Taken; their metadata is zero, or the epoch while marking (see `metadata`, invariant 3).

use super::arena::{ARENA, Arena, BLOCK, BLOCKS, BlockState, metadata_of};
use super::large::{LargeObject, footprint, is_large};
use super::layout::GRANULE;
use super::metadata::{END, next_hole};
use super::{Heap, Phase};
use crate::list_state;
use std::ptr::NonNull;

/// Size of the greatest object, in bytes, for which the first region moves on to its next hole.
const SMALL: usize = 256;
/// Bytes of the pieces in which a hole is used, so that slices come in time; also the bytes that one slice
/// pays for. Together with `SLICE_VISITS` this sets the pace: one visit for every cons allocated.
pub(super) const PIECE: usize = 16 << 10;
/// Number of blocks that one refill sweeps in vain before it takes a new arena, if it may.
const REFILL_SWEEPS: usize = 8;
/// Least number of free bytes for which the first region uses a block before the limit is reached.
const WORTHWHILE: usize = BLOCK / 16;

/// Reason why there is no memory.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum AllocError {
    /// The limit would be passed: collect, try again, and raise `:heap-exhausted` if that fails too.
    NeedCollection,
    /// A single object is larger than the limit, or longer than any object can be.
    TooLarge {
        /// Bytes asked for.
        requested: usize,
    },
}

impl std::fmt::Display for AllocError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            AllocError::NeedCollection => f.write_str("there is no room before a collection"),
            AllocError::TooLarge { .. } => f.write_str("the object would be larger than the heap may be"),
        }
    }
}

impl std::error::Error for AllocError {}

/// One of the two regions.
#[derive(Copy, Clone, PartialEq, Eq)]
enum Which {
    First,
    Second,
}

/// Current hole of a region, and the place where it looks for the next one.
#[derive(Clone, Debug)]
pub(super) struct Region {
    /// Address of the next object.
    next: usize,
    /// End of the current piece of the hole.
    end: usize,
    /// End of the hole.
    hole_end: usize,
    /// Address below which objects have been counted.
    counted: usize,
    /// Address from which on the objects of this hole were allocated while marking.
    black_from: usize,
    /// Arena, block and granule from which on to look for further holes in the current block.
    scan: Option<(usize, usize, usize)>,
    /// Arena and block to consider next.
    cursor: (usize, usize),
    /// Arena and block of a new arena to consider before that.
    fresh: Option<(usize, usize)>,
}

crate::stored! { Region { next, end, hole_end, counted, black_from, scan, cursor, fresh } }

list_state! {
    Region {
        next: Address,
        end: Address,
        hole_end: Address,
        counted: Address,
        black_from: Address,
        scan: Run,
        cursor: Run,
        fresh: Run,
    }
}

impl Region {
    pub(super) const fn new() -> Region {
        Region {
            next: 0,
            end: 0,
            hole_end: 0,
            counted: 0,
            black_from: 0,
            scan: None,
            cursor: (0, 1),
            fresh: None,
        }
    }

    #[inline(always)]
    fn bump(&mut self, bytes: usize) -> Option<NonNull<u8>> {
        let start = self.next;
        if self.end - start < bytes {
            return None;
        }
        self.next = start + bytes;
        debug_assert!(start != 0 && bytes != 0);
        // SAFETY: there are `bytes`, more than none, from `start` on, so there is a hole, and no hole is at
        // address zero.
        Some(unsafe { NonNull::new_unchecked(std::ptr::with_exposed_provenance_mut(start)) })
    }

    /// Returns the part of the hole that nothing was allocated in yet, as addresses.
    pub(super) fn unused(&self) -> std::ops::Range<usize> {
        self.next..self.hole_end
    }

    /// Returns the number of bytes allocated and not counted yet.
    pub(super) fn uncounted(&self) -> usize {
        self.next - self.counted
    }

    /// Begins to count objects allocated in the current hole as marked.
    pub(super) fn begin_marking(&mut self, epoch: u8) {
        self.black_from = self.next;
        fill_metadata(self.next, self.hole_end, epoch);
    }

    /// Abandons the current hole. While marking, all objects allocated black in it become one extent.
    fn retire(&mut self, marking: bool) {
        if marking && self.next < self.hole_end {
            fill_metadata(self.next, self.hole_end, 0);
        }
        if marking && self.black_from < self.next {
            // SAFETY: something was allocated since `black_from`, so the granule before `next` lies in the
            // current hole, in a live arena.
            unsafe { *metadata_of(self.next - GRANULE) |= END };
        }
        debug_assert_eq!(self.uncounted(), 0);
        (self.next, self.end, self.hole_end, self.counted, self.black_from) = (0, 0, 0, 0, 0);
    }

    /// Starts over at the first block.
    pub(super) fn restart(&mut self, marking: bool) {
        self.retire(marking);
        (self.scan, self.cursor, self.fresh) = (None, (0, 1), None);
    }
}

/// Sets the metadata of the free granules from `start` to `end`, addresses in one block.
fn fill_metadata(start: usize, end: usize, byte: u8) {
    if start < end {
        // SAFETY: a hole lies in one block of a live arena, and its metadata bytes are next to each other.
        unsafe { metadata_of(start).write_bytes(byte, (end - start) / GRANULE) };
    }
}

impl Heap {
    /// Returns memory of `bytes`, a multiple of the granule, if the current hole has it.
    #[inline(always)]
    pub(super) fn bump(&mut self, bytes: usize) -> Option<NonNull<u8>> {
        self.first.bump(bytes)
    }

    /// Returns uninitialised memory of `bytes`, a multiple of the granule.
    #[inline(always)]
    pub(super) fn allocate(&mut self, bytes: usize) -> Result<NonNull<u8>, AllocError> {
        debug_assert!(bytes != 0 && bytes.is_multiple_of(GRANULE));
        // The size alone decides where an object lives, even if there is room in the hole, since the marker
        // goes by the size.
        match if is_large(bytes) { None } else { self.bump(bytes) } {
            Some(p) => Ok(p),
            None => self.allocate_slow(bytes),
        }
    }

    #[cold]
    #[inline(never)]
    fn allocate_slow(&mut self, bytes: usize) -> Result<NonNull<u8>, AllocError> {
        if is_large(bytes) {
            return self.allocate_large(bytes, self.has_images);
        }
        let which = if bytes <= SMALL { Which::First } else { Which::Second };
        if let Some(p) = self.region(which).bump(bytes) {
            return Ok(p);
        }
        self.refill(which, bytes)?;
        Ok(self.region(which).bump(bytes).unwrap_or_else(|| unreachable!("a refill makes room")))
    }

    fn region(&mut self, which: Which) -> &mut Region {
        match which {
            Which::First => &mut self.first,
            Which::Second => &mut self.second,
        }
    }

    /// Makes room for `bytes` in the current piece of a region.
    fn refill(&mut self, which: Which, bytes: usize) -> Result<(), AllocError> {
        let (marking, epoch) = (self.phase == Phase::Marking, self.epoch);
        loop {
            let region = self.region(which);
            let allocated = region.uncounted();
            region.counted = region.next;
            if region.hole_end - region.next >= bytes {
                region.end = region.hole_end.min(region.next + PIECE.max(bytes));
                self.count_allocated(allocated);
                return Ok(());
            }
            region.retire(marking);
            self.count_allocated(allocated);

            let scan = match self.region(which).scan {
                Some(scan) => scan,
                None => {
                    let (arena, block) = self.next_block(which, bytes)?;
                    (arena, block, 0)
                }
            };
            let (arena, block, from) = scan;
            let hole = self.arenas[arena].as_ref().and_then(|arena| {
                let hole = next_hole(arena.metadata(block), from, bytes / GRANULE)?;
                Some((arena.address(block), hole))
            });
            let region = self.region(which);
            region.scan = None;
            if let Some((address, hole)) = hole {
                region.scan = Some((arena, block, hole.end));
                region.next = address + hole.start * GRANULE;
                region.hole_end = address + hole.end * GRANULE;
                (region.end, region.counted) = (region.next, region.next);
                if marking {
                    region.begin_marking(epoch);
                }
            }
        }
    }

    /// Takes a swept block with room for `bytes`, and returns it.
    fn next_block(&mut self, which: Which, bytes: usize) -> Result<(usize, usize), AllocError> {
        // 1. The rest of the arena that this region had to ask for.
        while let Some((arena, block)) = self.region(which).fresh {
            self.region(which).fresh = if block < BLOCKS { Some((arena, block + 1)) } else { None };
            if self.take_if(arena, block, |block| block.is_empty()) {
                return Ok((arena, block));
            }
        }
        // 2. Blocks in order of address, unless that takes too long.
        let may_grow = self.taken().saturating_add(ARENA) <= self.limit_now();
        let mut swept_in_vain = 0;
        while self.region(which).cursor.0 < self.arenas.len() {
            let (arena, block) = self.region(which).cursor;
            if may_grow && swept_in_vain == REFILL_SWEEPS {
                break;
            }
            self.region(which).cursor = if block < BLOCKS { (arena, block + 1) } else { (arena + 1, 1) };
            swept_in_vain += usize::from(self.sweep_if_needed(arena, block));
            let fits = |block: &super::arena::BlockInfo| match which {
                Which::First => {
                    block.counts.free * GRANULE >= WORTHWHILE && block.counts.largest * GRANULE >= bytes
                }
                Which::Second => block.counts.largest * GRANULE >= super::arena::LARGE,
            };
            if self.take_if(arena, block, fits) {
                return Ok((arena, block));
            }
        }
        // 3. A new arena.
        if may_grow && let Some(arena) = self.grow() {
            self.region(which).fresh = Some((arena, 2));
            let taken = self.take_if(arena, 1, |_| true);
            debug_assert!(taken);
            return Ok((arena, 1));
        }
        // 4. Any hole that is long enough. The cursor has passed every block, unless the system refused
        //    memory.
        for arena in 0..self.arenas.len() {
            for block in 1..=BLOCKS {
                self.sweep_if_needed(arena, block);
                if self.take_if(arena, block, |block| block.counts.largest * GRANULE >= bytes) {
                    return Ok((arena, block));
                }
            }
        }
        Err(AllocError::NeedCollection)
    }

    /// Takes a block if it is swept and `fits`. Returns whether it did.
    fn take_if(
        &mut self,
        arena: usize,
        block: usize,
        fits: impl Fn(&super::arena::BlockInfo) -> bool,
    ) -> bool {
        let may_take_lent = self.lent_to_cleanup || self.taken() <= self.limit;
        let Some(arena) = self.arenas.get_mut(arena).and_then(Option::as_mut) else { return false };
        if arena.is_lent && !may_take_lent {
            return false;
        }
        let takes = arena.block(block).state == BlockState::Swept && fits(arena.block(block));
        if takes {
            arena.take(block);
        }
        takes
    }

    /// Returns the number of bytes that may be taken from the system, with the reserves that are open.
    pub(super) fn limit_now(&self) -> usize {
        if self.lent_to_cleanup {
            // The other reserve may be used up for good.
            return self.limit.saturating_add(super::RESERVE + super::CLEANUP_RESERVE);
        }
        self.limit_for_all()
    }

    /// Returns the number of bytes that code outside cleanups may take from the system.
    fn limit_for_all(&self) -> usize {
        if self.reserve_open { self.limit.saturating_add(super::RESERVE) } else { self.limit }
    }

    /// Lends what is kept for cleanups, or takes it back: then both regions leave an arena that is lent.
    #[cold]
    pub(super) fn change_lending(&mut self, lends: bool) {
        self.lent_to_cleanup = lends;
        if lends || self.taken() <= self.limit {
            return;
        }
        let marking = self.phase == Phase::Marking;
        for which in [Which::First, Which::Second] {
            // The cursor has passed the block of the current hole, or stands at its end.
            let address = self.region(which).next;
            let lent = self.arenas.iter().flatten().any(|arena| arena.is_lent && arena.contains(address));
            if lent {
                let region = self.region(which);
                let allocated = region.uncounted();
                region.counted = region.next;
                region.retire(marking);
                region.scan = None;
                self.count_allocated(allocated);
            }
        }
    }

    /// Takes a new arena from the system. Its number is the least free one.
    fn grow(&mut self) -> Option<usize> {
        let number = self.arenas.iter().position(Option::is_none).unwrap_or(self.arenas.len());
        let arena = Arena::new(u32::try_from(number).ok()?, self.has_images, self.range.as_ref());
        self.is_refused |= arena.is_none();
        let mut arena = arena?;
        arena.is_lent = self.taken().saturating_add(ARENA) > self.limit_for_all();
        if number == self.arenas.len() {
            self.arenas.push(Some(arena));
        } else {
            self.arenas[number] = Some(arena);
        }
        self.commit(ARENA);
        Some(number)
    }

    fn commit(&mut self, bytes: usize) {
        self.committed += bytes;
        self.stats.peak = self.stats.peak.max(self.committed as u64);
    }

    /// Returns memory of its own for a large object, all of it zero if it `is_zeroed`. The system gives that
    /// without touching it.
    pub(super) fn allocate_large(
        &mut self,
        bytes: usize,
        is_zeroed: bool,
    ) -> Result<NonNull<u8>, AllocError> {
        self.check_room(footprint(bytes)).map_err(|error| match error {
            AllocError::TooLarge { .. } => AllocError::TooLarge { requested: bytes },
            error => error,
        })?;
        // The current epoch: marked while marking and not yet swept while sweeping; stale by the next cycle.
        let large = LargeObject::new(
            bytes,
            self.large_number,
            self.large.len(),
            self.epoch,
            is_zeroed,
            self.range.as_ref(),
        );
        self.is_refused |= large.is_none();
        let large = large.ok_or(AllocError::NeedCollection)?;
        let object = large.object();
        self.large.push(large);
        self.large_number += 1;
        self.commit(footprint(bytes));
        self.count_allocated(bytes);
        Ok(object)
    }

    /// Counts bytes allocated, and asks for the collector when it is time.
    fn count_allocated(&mut self, bytes: usize) {
        self.stats.allocated += bytes as u64;
        self.pacing.since_cycle += bytes as u64;
        match self.phase {
            Phase::Idle => self.due |= self.pacing.since_cycle >= self.pacing.threshold,
            Phase::Marking | Phase::Sweeping => {
                if self.phase == Phase::Marking {
                    self.pacing.black += bytes as u64;
                }
                self.pacing.owed += bytes as u64;
                self.due |= self.pacing.owed >= PIECE as u64;
            }
        }
    }

    /// Counts the bytes that the regions have allocated in their current holes.
    pub(super) fn count_regions(&mut self) {
        for which in [Which::First, Which::Second] {
            let region = self.region(which);
            let allocated = region.uncounted();
            region.counted = region.next;
            self.count_allocated(allocated);
        }
    }
}
