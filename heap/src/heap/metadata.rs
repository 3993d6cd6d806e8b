//! The collector's metadata of a block: one byte for every granule of 16 bytes, as a plain slice of bytes.
//!
//! ```text
//! bits 0..2  epoch   1, 2 or 3 at the first granule of what is live; 0 elsewhere
//! bit  2     end     the last granule of what is live
//! bit  3     gray    marked, but still to be followed: the mark stack was full
//! bit  4     cons    beside gray: the granule is a cons, not an object with a header
//! bit  5     body    a granule between the first and the last
//! ```
//!
//! An *extent* is a run of granules that stays: its first byte carries the epoch, its last byte the end bit
//! (one byte may be both). It is one marked object, or all that was allocated in one hole while marking. A
//! *hole* is a maximal run outside of extents.
//!
//! Invariants:
//! 1. In a *canonical* block the bytes of extents are `epoch body … body end` and all others are zero.
//!    [`sweep`] makes a block canonical, and allocation begins only in canonical blocks. Allocating writes no
//!    metadata: objects allocated since the last sweep look like a hole, which is why a hole is handed out
//!    once per sweep and never looked for again behind the allocator. Marking writes into extents, but never
//!    a zero; so the zeros of a canonical block are its holes at any time.
//! 2. An end bit is only ever set on the last granule of an object, so a stale one never cuts a live object
//!    in two.
//! 3. While marking, a hole is filled with the epoch before it is handed out: every object that starts in it
//!    is marked already. When the hole is given up the used part becomes one extent and the rest zero.
//! 4. Every block is swept between two cycles, so the epoch of a new cycle stands only where that cycle has
//!    put it.
//!
//! Source: one byte per granule, end bits and bump allocation into the holes are Nofl's (Wingo 2025, arXiv
//! 2503.16971). We differ in writing no byte when allocating, and in treating all that was allocated while
//! marking as one extent.

use std::fmt;
use std::ops::Range;

use crate::list_state;

/// Mask of the epoch's bits.
pub(super) const EPOCH: u8 = 3;
/// Bit of the last granule of an extent.
pub(super) const END: u8 = 4;
/// Bit of a granule that is marked and to be followed later.
pub(super) const GRAY: u8 = 8;
/// Bit beside [`GRAY`]: the granule is a cons.
pub(super) const GRAY_CONS: u8 = 16;
/// Bit of a granule of an extent that is neither its first nor its last.
const BODY: u8 = 32;

/// Returns the epoch after `epoch`.
pub(super) const fn next_epoch(epoch: u8) -> u8 {
    epoch % 3 + 1
}

/// Result of sweeping a block, in granules.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct SweepCounts {
    /// Number of granules outside of extents.
    pub free: usize,
    /// Length of the longest hole.
    pub largest: usize,
}

crate::stored! { SweepCounts { free, largest } }
list_state! { SweepCounts { free: Run, largest: Run } }

/// Returns the eight bytes at `at`, if there are that many and `at` is a multiple of eight.
#[inline(always)]
fn word(bytes: &[u8], at: usize) -> Option<u64> {
    if at & 7 != 0 {
        return None;
    }
    Some(u64::from_ne_bytes(*bytes.get(at..)?.first_chunk::<8>()?))
}

const fn splat(byte: u8) -> u64 {
    byte as u64 * 0x0101_0101_0101_0101
}

/// Makes a block canonical: keeps the extents of `epoch`, clears everything else, and calls `dead` with each
/// hole.
pub(super) fn sweep(bytes: &mut [u8], epoch: u8, mut dead: impl FnMut(Range<usize>)) -> SweepCounts {
    let mut summary = SweepCounts { free: 0, largest: 0 };
    let mut close = |hole: Range<usize>| {
        if !hole.is_empty() {
            summary.free += hole.len();
            summary.largest = summary.largest.max(hole.len());
            dead(hole);
        }
    };
    let single = epoch | END;
    let (mut at, mut hole) = (0, 0);
    while at < bytes.len() {
        // Eight free granules, or eight live ones of one granule each, such as conses: the common cases.
        match word(bytes, at) {
            Some(0) => {
                at += 8;
                continue;
            }
            Some(w) if w == splat(single) => {
                close(hole..at);
                at += 8;
                hole = at;
                continue;
            }
            _ => {}
        }
        let byte = bytes[at];
        debug_assert!(byte & GRAY == 0, "sweeping an object that the marking has not followed");
        if byte & EPOCH != epoch {
            bytes[at] = 0;
            at += 1;
            continue;
        }
        close(hole..at);
        bytes[at] = byte & (EPOCH | END);
        if byte & END == 0 {
            at += 1;
            while bytes[at] & END == 0 {
                bytes[at] = BODY;
                at += 1;
            }
            bytes[at] = END;
        }
        at += 1;
        hole = at;
    }
    close(hole..at);
    summary
}

/// Returns the first hole of at least `min` granules at or after `from`, in a block that is canonical from
/// there on.
pub(super) fn next_hole(bytes: &[u8], from: usize, min: usize) -> Option<Range<usize>> {
    let mut at = from;
    loop {
        let start = at + bytes.get(at..)?.iter().position(|&byte| byte == 0)?;
        at = start;
        while at < bytes.len() {
            if word(bytes, at) == Some(0) {
                at += 8;
            } else if bytes[at] == 0 {
                at += 1;
            } else {
                break;
            }
        }
        if at - start >= min {
            return Some(start..at);
        }
    }
}

/// Returns the first gray granule at or after `from`.
pub(super) fn next_gray(bytes: &[u8], from: usize) -> Option<usize> {
    let mut at = from;
    while at < bytes.len() {
        if word(bytes, at).is_some_and(|w| w & splat(GRAY) == 0) {
            at += 8;
        } else if bytes[at] & GRAY == 0 {
            at += 1;
        } else {
            return Some(at);
        }
    }
    None
}

/// A byte of a block's metadata that a sweep would change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotCanonical {
    /// The granule, from the beginning of the block.
    pub granule: usize,
    /// Its byte.
    pub found: u8,
    /// The byte that a sweep leaves.
    pub canonical: u8,
}

impl fmt::Display for NotCanonical {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "granule {}: {:#x}, canonical is {:#x}", self.granule, self.found, self.canonical)
    }
}

/// Checks that a block is canonical for `epoch`, and returns the counts of a sweep.
pub(super) fn check_canonical(bytes: &[u8], epoch: u8) -> Result<SweepCounts, NotCanonical> {
    let mut copy = bytes.to_vec();
    let summary = sweep(&mut copy, epoch, |_| {});
    match bytes.iter().zip(&copy).position(|(is, should)| is != should) {
        None => Ok(summary),
        Some(granule) => Err(NotCanonical { granule, found: bytes[granule], canonical: copy[granule] }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One character per granule: `.` zero, digits epochs, `-` body, `)` end, letters epoch and end (`a` =
    /// 1).
    fn parse(text: &str) -> Vec<u8> {
        let byte = |c| match c {
            '.' => 0,
            ')' => END,
            '1'..='3' => c as u8 - b'0',
            'a'..='c' => (c as u8 - b'a' + 1) | END,
            'g' => GRAY,
            '-' => BODY,
            _ => unreachable!("{c} is not a granule"),
        };
        text.chars().map(byte).collect()
    }

    #[track_caller]
    fn check_sweep(before: &str, after: &str, free: usize, largest: usize) {
        let mut bytes = parse(before);
        let mut dead = vec![false; bytes.len()];
        let summary = sweep(&mut bytes, 2, |hole| dead[hole].iter_mut().for_each(|d| *d = true));
        assert_eq!(bytes, parse(after));
        assert_eq!(summary, SweepCounts { free, largest });
        assert_eq!(dead.iter().filter(|&&d| d).count(), free);
        assert_eq!(check_canonical(&bytes, 2), Ok(summary));
    }

    #[test]
    fn sweeping_keeps_only_the_epoch() {
        check_sweep("", "", 0, 0);
        check_sweep("........", "........", 8, 8);
        check_sweep("bbbbbbbb", "bbbbbbbb", 0, 0);
        check_sweep("aaaaaaaabbbbbbbb........", "........bbbbbbbb........", 16, 8);
        check_sweep("b1-)2-)..c", "b...2-)...", 6, 3);
        check_sweep("2222222222)........", "2---------)........", 8, 8);
        check_sweep("1111)2..2).b", ".....2---).b", 6, 5);
        check_sweep("a)2.1.3.)", "..2-----)", 2, 2);
    }

    #[test]
    fn holes_are_found_in_order() {
        let bytes = parse("..b..2--)........c.....1-2-)-a--)");
        assert_eq!(next_hole(&bytes, 0, 1), Some(0..2));
        assert_eq!(next_hole(&bytes, 2, 1), Some(3..5));
        assert_eq!(next_hole(&bytes, 5, 1), Some(9..17));
        assert_eq!(next_hole(&bytes, 0, 6), Some(9..17));
        assert_eq!(next_hole(&bytes, 17, 1), Some(18..23));
        assert_eq!(next_hole(&bytes, 23, 1), None);
        assert_eq!(next_hole(&bytes, bytes.len(), 1), None);
        assert_eq!(next_hole(&bytes, 0, 9), None);
    }

    #[test]
    fn grays_are_found() {
        let bytes = parse("b...........g...g");
        assert_eq!(next_gray(&bytes, 0), Some(12));
        assert_eq!(next_gray(&bytes, 13), Some(16));
        assert_eq!(next_gray(&bytes, 17), None);
    }

    #[test]
    fn epochs_follow_each_other() {
        assert_eq!([1, 2, 3].map(next_epoch), [2, 3, 1]);
    }

    #[test]
    fn what_is_not_canonical_is_told() {
        assert!(check_canonical(&parse("22)"), 2).is_err());
        assert!(check_canonical(&parse("2--)..."), 2).is_ok());
        assert!(check_canonical(&parse("2.-)..."), 2).is_err());
        assert!(check_canonical(&parse("2--)..a"), 2).is_err());
    }
}
