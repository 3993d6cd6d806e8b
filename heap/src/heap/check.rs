//! Checks the metadata and the counts of a heap for contradictions, for tests.

use std::fmt;

use super::alloc::PIECE;
use super::arena::{ARENA, BLOCKS, BlockState};
use super::layout::GRANULE;
use super::metadata::{NotCanonical, SweepCounts, check_canonical};
use super::{Heap, Phase};

/// Contradiction in a heap.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HeapContradiction {
    /// The header of an arena has another number.
    ArenaNumber {
        /// Index of the arena.
        arena: usize,
        /// Number in its header.
        found: u32,
    },
    /// A block was left out of the sweep.
    Unswept {
        /// Index of the arena.
        arena: usize,
        /// The block in it.
        block: usize,
    },
    /// The counts of a swept block are wrong.
    Counts {
        /// Index of the arena.
        arena: usize,
        /// The block in it.
        block: usize,
        /// Counts that were noted.
        noted: SweepCounts,
        /// Counts of another sweep.
        found: SweepCounts,
    },
    /// The metadata of a swept block are not canonical.
    Metadata {
        /// Index of the arena.
        arena: usize,
        /// The block in it.
        block: usize,
        /// The first byte that differs.
        fault: NotCanonical,
    },
    /// The header of a large object has another index.
    LargeIndex {
        /// Index of the object.
        index: usize,
        /// Index in its header.
        found: usize,
    },
    /// The bytes taken from the system are not those noted.
    Committed {
        /// Bytes noted.
        noted: usize,
        /// Bytes of all arenas and large objects.
        found: usize,
    },
    /// The flags for the fast paths do not follow from phase and pacing.
    Flags,
    /// Live bytes are not whole granules.
    Live,
}

impl fmt::Display for HeapContradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use HeapContradiction::*;
        match self {
            ArenaNumber { arena, found } => write!(f, "arena {arena} says it is {found}"),
            Unswept { arena, block } => write!(f, "arena {arena} block {block} was left out of the sweep"),
            Counts { arena, block, noted, found } => {
                write!(f, "arena {arena} block {block}: {noted:?} is {found:?}")
            }
            Metadata { arena, block, fault } => write!(f, "arena {arena} block {block}: {fault}"),
            LargeIndex { index, found } => write!(f, "large object {index} says it is {found}"),
            Committed { noted, found } => write!(f, "{found} bytes are taken, {noted} noted"),
            Flags => f.write_str("the flags for the fast paths do not follow from phase and pacing"),
            Live => f.write_str("live bytes are not whole granules"),
        }
    }
}

impl std::error::Error for HeapContradiction {}

impl Heap {
    /// Checks the metadata and the counts for contradictions, for tests. Blocks still to be swept are left
    /// out.
    ///
    /// # Errors
    /// The first contradiction.
    pub fn check(&self) -> Result<(), HeapContradiction> {
        let mut committed = 0;
        for (number, arena) in self.arenas.iter().enumerate() {
            let Some(arena) = arena else { continue };
            committed += ARENA;
            if arena.header().number as usize != number {
                return Err(HeapContradiction::ArenaNumber { arena: number, found: arena.header().number });
            }
            for block in 1..=BLOCKS {
                let is = arena.block(block);
                if is.state == BlockState::Unswept && self.phase != Phase::Sweeping {
                    return Err(HeapContradiction::Unswept { arena: number, block });
                }
                if is.state != BlockState::Swept || self.phase == Phase::Marking {
                    continue;
                }
                match check_canonical(arena.metadata(block), self.epoch) {
                    Ok(counts) if counts == is.counts => {}
                    Ok(found) => {
                        let noted = is.counts;
                        return Err(HeapContradiction::Counts { arena: number, block, noted, found });
                    }
                    Err(fault) => return Err(HeapContradiction::Metadata { arena: number, block, fault }),
                }
            }
        }
        for (index, large) in self.large.iter().enumerate() {
            committed += large.header().bytes;
            let found = large.header().index;
            if found != index {
                return Err(HeapContradiction::LargeIndex { index, found });
            }
        }
        if committed != self.committed {
            return Err(HeapContradiction::Committed { noted: self.committed, found: committed });
        }
        let wants_slice = match self.phase {
            Phase::Idle => self.pacing.since_cycle >= self.pacing.threshold,
            Phase::Marking | Phase::Sweeping => self.pacing.owed >= PIECE as u64,
        };
        if self.due != wants_slice || self.marking != (self.phase == Phase::Marking) {
            return Err(HeapContradiction::Flags);
        }
        if !self.stats.live.is_multiple_of(GRANULE as u64) {
            return Err(HeapContradiction::Live);
        }
        Ok(())
    }
}
