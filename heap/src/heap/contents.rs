//! The contents of a heap as bytes, for a file from which another process has them again.
//!
//! The memory of such a heap is in a range of addresses ([`super::range`]) that the other process reserves
//! too. So pages are written as they are: the work of the collector that is under way, free room and all.
//!
//! ```text
//! fields     of the heap, its arenas and its large objects    Heap::store_contents, Heap::load_contents
//! memory     runs of pages that are not zero, each behind its address and its length, then a zero
//! ```
//!
//! The two are apart because the memory can be written while the program goes on, by a fork of the process
//! ([`crate::fork`]).
//!
//! Guarantees: after [`Heap::load_contents`] the heap goes on as the other one did after
//! [`Heap::store_contents`], to the byte.
//!
//! Not here: values outside of the heap; the checksum of the file.

use super::arena::{Arena, BLOCKS, BlockInfo};
use super::large::{LargeHeader, LargeObject};
use super::{Heap, Pacing, Phase};
use crate::store::{Stored, StoredBytes};

/// Bytes that are left out if all are zero.
const PAGE: usize = if cfg!(miri) { 1 << 10 } else { 4 << 10 };

/// Bytes before a run of pages: its address and its length.
const RUN_HEAD: usize = 16;

/// The memory of a heap that belongs to its contents, while nothing changes it.
#[derive(Debug)]
pub struct HeapMemory<'h>(Vec<&'h [u8]>);

impl<'h> HeapMemory<'h> {
    /// Calls `put` with the bytes of the memory, piece by piece, until it returns false. Returns whether it
    /// never did. Allocates nothing.
    pub fn write_to(&self, put: &mut impl FnMut(&[u8]) -> bool) -> bool {
        self.0.iter().all(|part| runs(part).all(|run| put(&run_head(run)) && put(run))) && put(&[0; RUN_HEAD])
    }

    /// Adds the bytes of the memory to `out`.
    pub fn append_to(&self, out: &mut Vec<u8>) {
        self.write_to(&mut |bytes| {
            out.extend_from_slice(bytes);
            true
        });
    }

    /// Returns the greatest number of bytes that it may take.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|part| part.len()).sum()
    }
}

/// Returns the address and the length of a run of pages.
fn run_head(run: &[u8]) -> [u8; RUN_HEAD] {
    let head = (run.as_ptr().addr() as u128) | (run.len() as u128) << 64;
    head.to_le_bytes()
}

/// Returns whether a page is zero.
fn is_zero(page: &[u8]) -> bool {
    static ZEROS: [u8; PAGE] = [0; PAGE];
    ZEROS.get(..page.len()) == Some(page)
}

/// Returns the longest runs of pages of a part of the memory that are not zero.
fn runs(part: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = part;
    std::iter::from_fn(move || {
        let skipped: usize = rest.chunks(PAGE).take_while(|page| is_zero(page)).map(<[u8]>::len).sum();
        rest = rest.get(skipped..)?;
        let length = rest.chunks(PAGE).take_while(|page| !is_zero(page)).map(<[u8]>::len).sum();
        let (run, behind) = rest.split_at_checked(length)?;
        rest = behind;
        (!run.is_empty()).then_some(run)
    })
}

crate::stored_enum! { Phase { Idle = 0, Marking = 1, Sweeping = 2 } }
crate::stored! { Pacing { floor, threshold, since_cycle, black, owed } }

impl Heap {
    /// Returns the start of the range of addresses that the heap has its memory in, if it has one.
    pub fn range(&self) -> Option<usize> {
        self.range.as_ref().map(|range| range.start())
    }

    /// Adds the fields to `out`, and returns the memory. `None` if that is not possible: the heap has its
    /// memory elsewhere than in a range, or its code begins at a place outside of it.
    pub fn store_contents(&mut self, out: &mut Vec<u8>) -> Option<HeapMemory<'_>> {
        if self.range.is_none() || self.code_entry.is_some() {
            return None;
        }
        let mut memory = HeapMemory(Vec::new());
        // Without `..`: a new field does not compile until it is handled here.
        let Heap {
            first,
            second,
            marking: _,
            due,
            reserve_open,
            lent_to_cleanup,
            phase,
            epoch,
            cycle_id,
            pacing,
            marker,
            sweep,
            arenas,
            large,
            large_number,
            committed,
            external,
            limit,
            code_entry: _,
            stats,
            range: _,
            has_images: _,
            identity: _,
            numbered: _,
            is_refused,
        } = self;
        limit.store(out);
        first.store(out);
        second.store(out);
        [*due, *reserve_open, *lent_to_cleanup, *is_refused].store(out);
        phase.store(out);
        epoch.store(out);
        cycle_id.store(out);
        large_number.store(out);
        committed.store(out);
        pacing.store(out);
        marker.store(out);
        sweep.store(out);
        external.store(out);
        stats.store(out);
        arenas.len().store(out);
        for arena in arenas {
            arena.is_some().store(out);
            if let Some(arena) = arena {
                store_arena(arena, &mut memory, out);
            }
        }
        large.len().store(out);
        for object in large {
            object.address().store(out);
            object.header().store(out);
            // SAFETY: the heap has a range, so all is initialised; its header is its own, and the heap is
            // borrowed mutably while the memory is.
            memory.0.push(unsafe { object.bytes() });
        }
        Some(memory)
    }

    /// Makes the contents those that another heap had, given its fields and its memory. `None` if they do not
    /// fit this heap, which is of no use then: its limit or its range is another one, or the bytes end too
    /// early.
    ///
    /// # Safety
    /// From now on no value is used that was created before. The bytes were written by
    /// [`Heap::store_contents`] and [`HeapMemory::write_to`], of a heap with the same range.
    pub unsafe fn load_contents(
        &mut self,
        from: &mut StoredBytes<'_>,
        memory: &mut StoredBytes<'_>,
    ) -> Option<()> {
        let range = self.range.clone()?;
        if usize::load(from)? != self.limit {
            return None;
        }
        (self.first, self.second) = (Stored::load(from)?, Stored::load(from)?);
        [self.due, self.reserve_open, self.lent_to_cleanup, self.is_refused] = Stored::load(from)?;
        self.phase = Stored::load(from)?;
        self.marking = self.phase == Phase::Marking;
        self.epoch = Stored::load(from)?;
        (self.cycle_id, self.large_number) = (Stored::load(from)?, Stored::load(from)?);
        self.committed = Stored::load(from)?;
        self.pacing = Stored::load(from)?;
        self.marker = Stored::load(from)?;
        self.sweep = Stored::load(from)?;
        self.external = Stored::load(from)?;
        self.stats = Stored::load(from)?;
        // The memory is given back before it is taken again, so that it is full of zeros.
        self.arenas.clear();
        self.large.clear();
        for number in 0..usize::load(from)? {
            let arena = if bool::load(from)? {
                let mut arena = Arena::new(u32::try_from(number).ok()?, false, Some(&range))?;
                load_arena(&mut arena, from)?;
                Some(arena)
            } else {
                None
            };
            self.arenas.push(arena);
        }
        for _ in 0..usize::load(from)? {
            let (address, header) = (usize::load(from)?, LargeHeader::load(from)?);
            self.large.push(LargeObject::at(address, header, &range)?);
        }
        loop {
            let (address, length) = (usize::load(memory)?, usize::load(memory)?);
            if length == 0 {
                return Some(());
            }
            // SAFETY: by the contract, the run is of the memory of an arena or a large object, which the heap
            // has now, and nothing refers to it.
            unsafe { range.write(address, memory.take(length)?) }?;
        }
    }
}

fn store_arena<'h>(arena: &'h mut Arena, memory: &mut HeapMemory<'h>, out: &mut Vec<u8>) {
    arena.is_lent.store(out);
    arena.header().grays.store(out);
    arena.blocks().store(out);
    let arena = &*arena;
    for block in (1..=BLOCKS).filter(|&block| !arena.block(block).is_empty()) {
        memory.0.push(arena.metadata(block));
        // SAFETY: the heap has a range, so all is initialised, and it is borrowed mutably while the memory
        // is.
        memory.0.push(unsafe { arena.objects(block) });
    }
}

fn load_arena(arena: &mut Arena, from: &mut StoredBytes<'_>) -> Option<()> {
    arena.is_lent = Stored::load(from)?;
    arena.header_mut().grays = Stored::load(from)?;
    let blocks: [BlockInfo; BLOCKS + 1] = Stored::load(from)?;
    arena.set_blocks(blocks);
    if cfg!(debug_assertions) {
        for block in (1..=BLOCKS).filter(|&block| !blocks[block].is_empty()) {
            // SAFETY: the memory of a range is initialised, and nothing refers to the arena.
            unsafe { arena.objects_mut(block) }.fill(0);
        }
    }
    Some(())
}

#[cfg(all(test, target_os = "linux", target_pointer_width = "64", not(miri)))]
mod tests {
    use super::*;
    use crate::heap::HeapConfig;
    use crate::heap::arena::BLOCK;
    use crate::value::Value;

    const START: usize = 0x0f20_0000_0000;

    fn heap() -> Heap {
        let config = HeapConfig {
            range: Some(START),
            limit: 64 << 20,
            cycle_floor: 64 << 10,
            ..HeapConfig::default()
        };
        // SAFETY: H1: a test uses the values of one heap, while it has it.
        unsafe { Heap::new(config) }
    }

    /// Makes lists of vectors of all sizes, drops some, and lets the collector work in slices.
    fn work(heap: &mut Heap, mut list: Value, rounds: usize) -> Value {
        for round in 0..rounds {
            let size = if round % 40 == 7 { BLOCK / 8 + round } else { round % 50 };
            let vector = heap.alloc_vector_filled(size, Value::index(round)).expect("there is room");
            let rest = if round % 512 == 511 { Value::NIL } else { list };
            list = heap.cons(vector, rest).expect("there is room");
            if heap.gc_due() {
                match heap.phase() {
                    Phase::Idle => heap.begin_cycle(),
                    Phase::Marking => {
                        heap.mark(list);
                        if let crate::heap::SliceOutcome::Drained { .. } = heap.slice(40) {
                            // SAFETY: H2: the list is all that is used.
                            unsafe { heap.end_marking() };
                        }
                    }
                    Phase::Sweeping => _ = heap.slice(40),
                }
            }
        }
        list
    }

    fn contents(heap: &mut Heap) -> (Vec<u8>, Vec<u8>) {
        let (mut fields, mut bytes) = (Vec::new(), Vec::new());
        let memory = heap.store_contents(&mut fields).expect("it has a range");
        memory.append_to(&mut bytes);
        assert!(bytes.len() <= memory.bytes() * 2);
        (fields, bytes)
    }

    #[test]
    fn a_heap_goes_on_from_its_bytes_as_it_did_before() {
        let mut phases = std::collections::BTreeSet::new();
        for rounds in [3, 500, 700, 801, 933, 1101, 1500] {
            let mut first = heap();
            let list = work(&mut first, Value::NIL, rounds);
            phases.insert(first.phase() as u8);
            let stored = contents(&mut first);
            let later = work(&mut first, list, 1000);
            let expected = contents(&mut first);
            drop(first);
            let mut second = heap();
            work(&mut second, Value::NIL, 77);
            // SAFETY: the bytes are those of a heap at the same addresses; the values of before are not used.
            let loaded = unsafe {
                second.load_contents(&mut StoredBytes::new(&stored.0), &mut StoredBytes::new(&stored.1))
            };
            assert_eq!(loaded, Some(()), "{rounds}");
            second.check().expect("it is whole");
            assert!(contents(&mut second) == stored, "{rounds}");
            assert_eq!(work(&mut second, list, 1000), later);
            assert!(contents(&mut second) == expected, "{rounds}");
        }
        assert!(phases.len() == 3, "{phases:?}");
    }

    #[test]
    fn a_heap_without_a_range_has_no_bytes() {
        assert!(Heap::for_tests().store_contents(&mut Vec::new()).is_none());
    }
}
