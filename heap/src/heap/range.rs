//! A range of addresses that a heap keeps to itself, so that its contents can be had again in another process
//! at the same addresses: no value has to be translated.
//!
//! ```text
//! start            start + arenas MiB                                end
//! | arena 0 | arena 1 | …  | large objects, in whole pages …          |
//! ```
//!
//! The range is reserved as a whole; the system provides pages when they are first touched, full of zeros,
//! and has them back when an arena or a large object is freed. An arena is at the place of its number. Large
//! objects take the first room that is large enough.
//!
//! Guarantees: memory that was given back reads as zeros when it is taken again. All of it is initialised.
//!
//! Not here: systems other than Linux, which cannot be asked for a range that must be free.

use std::collections::BTreeMap;
use std::ptr::NonNull;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::arena::ARENA;

/// Unit in which large objects take room, in bytes.
const PAGE: usize = 4096;

/// Room for large objects, as a multiple of the limit of the heap: freed ones leave gaps.
const LARGE_ROOM: usize = 16;

/// A range of addresses of this process, reserved.
pub(super) struct AddressRange {
    start: usize,
    arenas: usize,
    end: usize,
    /// Free room for large objects: bytes by address.
    free: Mutex<BTreeMap<usize, usize>>,
}

impl AddressRange {
    /// Reserves the range at `start` for a heap with this limit in bytes; `None` if something is there, or
    /// the system has no such ranges.
    pub(super) fn reserve(start: usize, limit: usize) -> Option<Arc<AddressRange>> {
        let arenas = limit.checked_add(super::RESERVE + super::CLEANUP_RESERVE)?.div_ceil(ARENA) + 1;
        let large = start.checked_add(arenas.checked_mul(ARENA)?)?;
        let room = limit.checked_mul(LARGE_ROOM)?.next_multiple_of(ARENA);
        let end = large.checked_add(room)?;
        if start == 0 || !start.is_multiple_of(ARENA) || !map(start, end - start) {
            return None;
        }
        Some(Arc::new(AddressRange { start, arenas, end, free: Mutex::new([(large, room)].into()) }))
    }

    /// Returns the address of the first byte.
    pub(super) fn start(&self) -> usize {
        self.start
    }

    /// Returns the memory of the arena with this number; `None` if there is no room for it.
    pub(super) fn arena(&self, number: u32) -> Option<NonNull<u8>> {
        let number = number as usize;
        if number >= self.arenas {
            return None;
        }
        NonNull::new(std::ptr::with_exposed_provenance_mut(self.start + number * ARENA))
    }

    fn free(&self) -> MutexGuard<'_, BTreeMap<usize, usize>> {
        // Each change is made as a whole, so a panic elsewhere does not corrupt the table.
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes room for a large object of so many bytes.
    pub(super) fn take(&self, bytes: usize) -> Option<NonNull<u8>> {
        let bytes = bytes.checked_next_multiple_of(PAGE)?;
        let mut free = self.free();
        let (&start, &room) = free.iter().find(|&(_, &room)| room >= bytes)?;
        free.remove(&start);
        if room > bytes {
            free.insert(start + bytes, room - bytes);
        }
        NonNull::new(std::ptr::with_exposed_provenance_mut(start))
    }

    /// Takes the room at `start` for a large object of so many bytes; `None` unless it is free.
    pub(super) fn claim(&self, start: usize, bytes: usize) -> Option<NonNull<u8>> {
        let bytes = bytes.checked_next_multiple_of(PAGE)?;
        let mut free = self.free();
        let (&before, &room) = free.range(..=start).next_back()?;
        let end = start.checked_add(bytes)?;
        if !start.is_multiple_of(PAGE) || bytes == 0 || before + room < end {
            return None;
        }
        free.remove(&before);
        if before < start {
            free.insert(before, start - before);
        }
        if end < before + room {
            free.insert(end, before + room - end);
        }
        NonNull::new(std::ptr::with_exposed_provenance_mut(start))
    }

    /// Gives back room that was taken, or its end.
    pub(super) fn give_back(&self, start: usize, bytes: usize) {
        let (first, end) = (start.next_multiple_of(PAGE), (start + bytes).next_multiple_of(PAGE));
        if first >= end {
            return;
        }
        self.clear(first, end - first);
        let mut free = self.free();
        let (mut start, mut room) = (first, end - first);
        if let Some((&before, &bytes)) = free.range(..start).next_back()
            && before + bytes == start
        {
            free.remove(&before);
            (start, room) = (before, room + bytes);
        }
        if let Some(bytes) = free.remove(&end) {
            room += bytes;
        }
        free.insert(start, room);
    }

    /// Writes bytes at an address. `None` if a part of them is outside of the range.
    ///
    /// # Safety
    /// Nothing refers to these bytes of the range.
    pub(super) unsafe fn write(&self, start: usize, bytes: &[u8]) -> Option<()> {
        if start < self.start || start.checked_add(bytes.len())? > self.end {
            return None;
        }
        let place = std::ptr::with_exposed_provenance_mut::<u8>(start);
        // SAFETY: all of the range is mapped; by the contract nothing else refers to the bytes, so
        // `bytes` are elsewhere.
        unsafe { place.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len()) };
        Some(())
    }

    /// Gives the pages of a part of the range back to the system.
    pub(super) fn clear(&self, start: usize, bytes: usize) {
        debug_assert!(self.start <= start && start + bytes <= self.end);
        clear(start, bytes);
    }
}

impl Drop for AddressRange {
    fn drop(&mut self) {
        unmap(self.start, self.end - self.start);
    }
}

/// Maps zeros at these addresses. Returns whether nothing was there, and they are.
#[cfg(all(target_os = "linux", target_pointer_width = "64", not(miri)))]
pub(super) fn map(start: usize, bytes: usize) -> bool {
    // SAFETY: MAP_FIXED_NOREPLACE changes no mapping that is there. A system that does not know it takes the
    // address for a hint; its mapping elsewhere is given back.
    unsafe {
        let at = libc::mmap(
            std::ptr::without_provenance_mut(start),
            bytes,
            libc::PROT_READ | libc::PROT_WRITE,
            libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_NORESERVE | libc::MAP_FIXED_NOREPLACE,
            -1,
            0,
        );
        if at == libc::MAP_FAILED {
            return false;
        }
        if at.expose_provenance() != start {
            libc::munmap(at, bytes);
            return false;
        }
        true
    }
}

#[cfg(all(target_os = "linux", target_pointer_width = "64", not(miri)))]
fn clear(start: usize, bytes: usize) {
    // SAFETY: the range belongs to the caller, who gives this part of it back: nothing refers to it.
    unsafe { libc::madvise(std::ptr::with_exposed_provenance_mut(start), bytes, libc::MADV_DONTNEED) };
}

#[cfg(all(target_os = "linux", target_pointer_width = "64", not(miri)))]
fn unmap(start: usize, bytes: usize) {
    // SAFETY: the range belongs to the caller, who gives it up: nothing refers to it.
    unsafe { libc::munmap(std::ptr::with_exposed_provenance_mut(start), bytes) };
}

#[cfg(not(all(target_os = "linux", target_pointer_width = "64", not(miri))))]
pub(super) fn map(_start: usize, _bytes: usize) -> bool {
    false
}

#[cfg(not(all(target_os = "linux", target_pointer_width = "64", not(miri))))]
fn clear(_start: usize, _bytes: usize) {}

#[cfg(not(all(target_os = "linux", target_pointer_width = "64", not(miri))))]
fn unmap(_start: usize, _bytes: usize) {}

/// Returns a copy of words that is at the address `start` in every process, and stays there; `None` if
/// something else is there. To be called once for each address.
pub fn words_at(start: usize, words: &[u32]) -> Option<&'static [u32]> {
    let bytes = size_of_val(words).next_multiple_of(PAGE);
    if start == 0 || !start.is_multiple_of(PAGE) || !map(start, bytes) {
        return None;
    }
    let copy = std::ptr::with_exposed_provenance_mut::<u32>(start);
    // SAFETY: `map` has made as many bytes at that address, which nothing else refers to and which are never
    // given back. After the copy nothing changes them.
    unsafe {
        copy.copy_from_nonoverlapping(words.as_ptr(), words.len());
        Some(std::slice::from_raw_parts(copy, words.len()))
    }
}

/// Returns where a range may be tried, from a random number: addresses that Linux gives to nothing by itself.
/// `None` on systems of 32 bits.
pub fn range_start(chance: u64) -> Option<usize> {
    const FIRST: u64 = 0x1000_0000_0000;
    const STEP: u64 = 1 << 32;
    const STEPS: u64 = 0x3000;
    usize::try_from(FIRST + chance % STEPS * STEP).ok()
}

#[cfg(all(test, target_os = "linux", target_pointer_width = "64", not(miri)))]
mod tests {
    use super::*;

    const START: usize = 0x0f10_0000_0000;

    #[test]
    fn a_range_is_reserved_once_and_its_room_is_taken_and_given_back() {
        let range = AddressRange::reserve(START, ARENA).expect("nothing is there");
        assert!(AddressRange::reserve(START, ARENA).is_none());
        let address = |place: Option<NonNull<u8>>| place.map_or(0, |place| place.addr().get());
        let first = address(range.take(5000));
        let second = address(range.take(1));
        assert_eq!(second, first + 2 * PAGE);
        assert!(range.claim(first, 1).is_none());
        let third = range.claim(second + 4 * PAGE, 3 * PAGE).expect("it is free");
        // SAFETY: the room was taken.
        unsafe { third.write(7) };
        // The end of the second object's room, which is none, and all of the first's.
        range.give_back(second + 1, PAGE - 1);
        range.give_back(first, 5000);
        range.give_back(third.addr().get(), 3 * PAGE);
        assert_eq!(address(range.take(2 * PAGE)), first);
        let again = range.claim(third.addr().get(), PAGE).expect("it is free");
        // SAFETY: the room was taken.
        assert_eq!(unsafe { again.read() }, 0);
        assert_eq!(range.arena(0).map(|arena| arena.addr().get()), Some(START));
        drop(range);
        assert!(AddressRange::reserve(START, ARENA).is_some());
    }

    #[test]
    fn words_are_at_their_address() {
        let words = words_at(0x0f00_0000_0000, &[1, 2, 3]).expect("nothing is there");
        assert_eq!((words, words.as_ptr().addr()), (&[1, 2, 3][..], 0x0f00_0000_0000));
        assert!(words_at(0x0f00_0000_0000, &[1]).is_none());
    }
}
