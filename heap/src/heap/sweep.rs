//! Sweeping: frees the objects that the last marking did not reach.
//!
//! Blocks are swept by slices, or when the allocator comes to them, whichever is first; large objects by
//! slices only. An arena in which nothing is left goes back to the system, except for those that will be
//! filled before the next cycle: to take them from the system again would cost more than to fill them.
//!
//! Guarantees: every block is swept once between two markings. Sweeping does not touch objects allocated
//! since it began.

use super::arena::{ARENA, BLOCKS, BlockState};
use super::{Heap, Phase, SliceOutcome};
use crate::list_state;

/// Number of visits that the sweep of a block counts as.
const BLOCK_VISITS: i64 = 512;
/// Number of visits that freeing a large object counts as, besides its bytes.
const FREE_VISITS: i64 = 64;
/// Number of bytes given back to the system that count as one visit.
const BYTES_PER_VISIT: usize = 256;
/// Number of bytes of a large object that are given back at once.
const FREE_PIECE: usize = 64 << 10;
/// Least allocation, in bytes, between two cycles, however close the limit is.
const LEAST_THRESHOLD: u64 = 256 << 10;
/// Least allocation between two cycles, as a fraction of the memory that they trace and sweep, one in so
/// many: with less, cycles would take all the time, so an allocation that finds no room had better wait for
/// one.
const WORTH: u64 = 32;

/// Progress of the sweep.
#[derive(Clone, Copy, Default)]
pub(super) struct Sweep {
    /// Arena and block to sweep next.
    at: (usize, usize),
    /// Large objects below this index are still to be looked at, the last one first.
    large: usize,
    /// Number of empty arenas kept so far.
    spares: usize,
    /// Number of bytes found live.
    live: u64,
}

crate::stored! { Sweep { at, large, spares, live } }
list_state! { Sweep { at: Run, large: Run, spares: Run, live: Run } }

impl Heap {
    /// Turns from marking to sweeping.
    pub(super) fn begin_sweep(&mut self) {
        self.phase = Phase::Sweeping;
        for arena in self.arenas.iter_mut().flatten() {
            arena.expect_sweep();
        }
        self.sweep = Sweep { at: (0, 1), large: self.large.len(), spares: 0, live: 0 };
        // Most objects allocated during the cycle are garbage: they count as live here, but do not put off
        // the next cycle.
        let room = (self.limit as u64).saturating_sub(self.stats.live + self.external.total as u64) / 2;
        // A cycle goes over the stacks of all tasks, too.
        let live = self.marker.bytes + self.external.of_tasks() as u64;
        let least = LEAST_THRESHOLD.max(live / WORTH);
        self.pacing.threshold = live.max(self.pacing.floor).min(room.max(least));
        self.pacing.since_cycle = 0;
        self.pacing.owed = 0;
        self.due = false;
    }

    /// Sweeps a block if that is still to be done. Returns whether it was.
    pub(super) fn sweep_if_needed(&mut self, arena: usize, block: usize) -> bool {
        let Some(arena) = self.arenas.get_mut(arena).and_then(Option::as_mut) else { return false };
        if arena.block(block).state != BlockState::Unswept {
            return false;
        }
        self.sweep.live += arena.sweep(block, self.epoch) as u64;
        true
    }

    /// Sweeps until everything is swept or the budget is spent.
    pub(super) fn sweep_slice(&mut self, left: &mut i64) -> SliceOutcome {
        while *left > 0 {
            if self.sweep.at.0 < self.arenas.len() {
                let (arena, block) = self.sweep.at;
                *left -= if self.sweep_if_needed(arena, block) { BLOCK_VISITS } else { 1 };
                self.sweep.at = (arena, block + 1);
                if block == BLOCKS {
                    self.sweep.at = (arena + 1, 1);
                    if self.release_if_empty(arena) {
                        // To give back so much takes the system a while.
                        *left = (*left).min(0);
                    }
                }
            } else if self.sweep.large > 0 {
                self.free_large_if_dead(self.sweep.large - 1, left);
            } else {
                debug_assert_eq!(self.sweep.live, self.stats.live, "marking and sweeping count alike");
                self.phase = Phase::Idle;
                self.external.wanted = 0;
                self.pacing.owed = 0;
                self.due = self.pacing.since_cycle >= self.pacing.threshold;
                return SliceOutcome::Finished;
            }
        }
        SliceOutcome::More
    }

    /// Sweeps everything that is left.
    pub(super) fn finish_sweep(&mut self) {
        while self.phase == Phase::Sweeping
            && self.sweep_slice(&mut i64::from(u32::MAX)) == SliceOutcome::More
        {}
    }

    /// Gives an arena in which nothing lives back to the system, unless it is to be kept. Returns whether it
    /// did. Beyond the limit no arena is kept.
    fn release_if_empty(&mut self, arena: usize) -> bool {
        if self.arenas[arena].as_ref().is_none_or(|arena| !arena.is_empty()) {
            return false;
        }
        if (self.sweep.spares * ARENA) as u64 <= self.pacing.threshold && !self.is_crowded() {
            self.sweep.spares += 1;
            return false;
        }
        self.arenas[arena] = None;
        self.committed -= ARENA;
        true
    }

    /// Looks at the last large object that was not looked at, and frees it unless it was marked: as much of
    /// it as the budget allows.
    fn free_large_if_dead(&mut self, index: usize, left: &mut i64) {
        let header = self.large[index].header();
        debug_assert!(!header.gray && header.index == index);
        if header.epoch == self.epoch {
            self.sweep.live += (header.bytes - super::large::footprint(0)) as u64;
            self.sweep.large = index;
            *left -= 1;
            return;
        }
        let piece = FREE_PIECE.max(*left as usize * BYTES_PER_VISIT);
        if header.bytes > piece
            && let Some(bytes) = self.large[index].shrink(piece)
        {
            self.committed -= bytes;
            *left -= (bytes / BYTES_PER_VISIT) as i64;
            return;
        }
        let bytes = self.large[index].header().bytes;
        self.committed -= bytes;
        *left -= FREE_VISITS + (bytes / BYTES_PER_VISIT) as i64;
        self.sweep.large = index;
        self.large.swap_remove(index);
        if let Some(moved) = self.large.get_mut(index) {
            moved.header_mut().index = index;
        }
    }
}
