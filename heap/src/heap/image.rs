//! Images: the contents of a heap at a time, to be had again at the same addresses.
//!
//! An image consists of pages. A page that is as it was in another image is shared with that one, so an image
//! of a heap in which little has changed since takes little memory; to find out, the pages are compared. The
//! pages of large vectors that are the machine's own ([`Heap::own_vector`]) have numbers, which each change
//! renews, and are compared by these. The memory of arenas and large objects lives as long as an image needs
//! it, even if the heap has given it up.
//!
//! Guarantees: after [`Heap::restore`] the heap goes on as after [`Heap::save`], to the byte: the same
//! allocations return the same addresses and ask for slices at the same points.
//!
//! Not here: values outside of the heap, of which those that came into being since are of no use any more.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::alloc::Region;
use super::arena::{Arena, ArenaMemory, BLOCK, BLOCKS, BlockInfo};
use super::external::External;
use super::large::{self, LargeHeader, LargeMemory, LargeObject};
use super::layout::Header;
use super::sweep::Sweep;
use super::{Heap, HeapStats, Kind, Pacing, Phase};
use crate::value::Value;

/// Bytes of a page.
const PAGE: usize = 1024;
/// Number of pages of a block.
const BLOCK_PAGES: usize = BLOCK / PAGE;

/// Part of the contents, and a count of the bytes that all pages of one heap take.
struct Page {
    bytes: Box<[u8]>,
    count: Arc<AtomicUsize>,
}

/// Bytes of a page beside its contents.
const PAGE_BYTES: usize = size_of::<Page>() + 32;

impl Page {
    fn of(bytes: &[u8], count: &Arc<AtomicUsize>) -> Arc<Page> {
        count.fetch_add(bytes.len() + PAGE_BYTES, Ordering::Relaxed);
        Arc::new(Page { bytes: bytes.into(), count: count.clone() })
    }

    /// Returns the page with these contents: `old`, if it has them.
    fn like(old: Option<&Arc<Page>>, bytes: &[u8], count: &Arc<AtomicUsize>) -> Arc<Page> {
        match old {
            Some(old) if old.is_like(bytes) => old.clone(),
            _ => Page::of(bytes, count),
        }
    }

    fn is_like(&self, bytes: &[u8]) -> bool {
        *self.bytes == *bytes
    }

    /// Writes the contents to where they come from.
    fn put(&self, bytes: &mut [u8]) {
        if !self.is_like(bytes) {
            bytes.copy_from_slice(&self.bytes);
        }
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        self.count.fetch_sub(self.bytes.len() + PAGE_BYTES, Ordering::Relaxed);
    }
}

/// Contents of a block in which something lives.
#[derive(Clone)]
struct BlockImage {
    metadata: Arc<Page>,
    /// Pages; `None` where there is nothing but room.
    pages: [Option<Arc<Page>>; BLOCK_PAGES],
}

/// An arena: its memory, and what was in its blocks.
struct ArenaImage {
    memory: Arc<ArenaMemory>,
    blocks: [BlockInfo; BLOCKS + 1],
    is_lent: bool,
    contents: [Option<Arc<BlockImage>>; BLOCKS + 1],
}

/// A large object: its memory, and what was in it.
struct LargeImage {
    memory: Arc<LargeMemory>,
    header: LargeHeader,
    /// Numbers of the pages, if they have any.
    numbers: Vec<u64>,
    contents: Vec<Arc<Page>>,
}

impl LargeImage {
    /// Returns whether a page has the contents that it has in the object, as its number says.
    fn has_page_of(&self, object: &LargeObject, page: usize) -> bool {
        let number = self.numbers.get(page);
        number.is_some() && number == object.numbers.get(page)
    }
}

/// The contents of a heap at a time.
pub struct HeapImage {
    identity: Arc<()>,
    count: Arc<AtomicUsize>,
    arenas: Vec<Option<ArenaImage>>,
    large: Vec<LargeImage>,
    first: Region,
    second: Region,
    due: bool,
    reserve_open: bool,
    lent_to_cleanup: bool,
    epoch: u8,
    cycle_id: u64,
    pacing: Pacing,
    marked: u64,
    sweep: Sweep,
    large_number: u64,
    committed: usize,
    external: External,
    stats: HeapStats,
}

impl HeapImage {
    /// Returns the bytes that all images of this heap take, about, which exist now.
    pub fn bytes_of_all(&self) -> usize {
        self.count.load(Ordering::Relaxed)
    }

    /// Returns the bytes that this image takes beside pages: its tables of them.
    pub fn bytes_of_tables(&self) -> usize {
        let page = size_of::<Arc<Page>>() + size_of::<u64>();
        let large = |image: &LargeImage| size_of::<LargeImage>() + image.contents.len() * page;
        self.arenas.len() * size_of::<Option<ArenaImage>>() + self.large.iter().map(large).sum::<usize>()
    }
}

impl Heap {
    /// Takes an image of the contents, which shares with `base` what has not changed since. `None` while the
    /// collector works, and if the heap was not made for images.
    pub fn save(&mut self, base: Option<&HeapImage>) -> Option<HeapImage> {
        if self.phase != Phase::Idle || !self.has_images {
            return None;
        }
        let base = base.filter(|base| Arc::ptr_eq(&base.identity, &self.identity));
        let count = base.map_or_else(Arc::default, |base| base.count.clone());
        let unused = [self.first.unused(), self.second.unused()];
        let arenas = self.arenas.iter_mut().enumerate().map(|(number, arena)| {
            let arena = arena.as_mut()?;
            let old = base.and_then(|base| base.arenas.get(number)?.as_ref());
            let old = old.filter(|old| Arc::ptr_eq(&old.memory, arena.memory()));
            let contents = std::array::from_fn(|block| {
                if block == 0 || arena.block(block).is_empty() {
                    return None;
                }
                let old = old.and_then(|old| old.contents[block].as_ref());
                Some(block_image(arena, block, &unused, old, &count))
            });
            let (blocks, is_lent) = (arena.blocks(), arena.is_lent);
            Some(ArenaImage { memory: arena.memory().clone(), blocks, is_lent, contents })
        });
        let arenas = arenas.collect();
        let large = self.large.iter_mut().enumerate().map(|(index, object)| {
            let old = base.and_then(|base| base.large.get(index));
            let old = old.filter(|old| Arc::ptr_eq(&old.memory, object.memory()));
            let (header, numbers) = (*object.header(), object.numbers.clone());
            let kept = |page: usize| {
                let kept = old.filter(|old| old.has_page_of(object, page))?;
                kept.contents.get(page).cloned()
            };
            let kept: Vec<Option<Arc<Page>>> = (0..numbers.len()).map(kept).collect();
            // SAFETY: the heap has images, so the object was made zeroed; its header is its own, and the heap
            // is borrowed mutably.
            let bytes = unsafe { object.bytes_mut() };
            let mut kept = kept.into_iter();
            let pages = bytes.chunks(PAGE).enumerate().map(|(page, bytes)| match kept.next().flatten() {
                Some(kept) => {
                    debug_assert!(kept.is_like(bytes), "a page with a number has changed");
                    kept
                }
                None => Page::like(old.and_then(|old| old.contents.get(page)), bytes, &count),
            });
            let contents = pages.collect();
            LargeImage { memory: object.memory().clone(), header, numbers, contents }
        });
        Some(HeapImage {
            large: large.collect(),
            arenas,
            identity: self.identity.clone(),
            count,
            first: self.first.clone(),
            second: self.second.clone(),
            due: self.due,
            reserve_open: self.reserve_open,
            lent_to_cleanup: self.lent_to_cleanup,
            epoch: self.epoch,
            cycle_id: self.cycle_id,
            pacing: self.pacing,
            marked: self.marker.bytes,
            sweep: self.sweep,
            large_number: self.large_number,
            committed: self.committed,
            external: self.external,
            stats: self.stats,
        })
    }

    /// Makes the contents those of an image again. Returns whether it is one of this heap; if not, nothing
    /// happens.
    ///
    /// # Safety
    /// From now on no value is used that was created after the image was taken.
    #[must_use]
    pub unsafe fn restore(&mut self, image: &HeapImage) -> bool {
        if !Arc::ptr_eq(&image.identity, &self.identity) {
            return false;
        }
        let mut present = std::mem::take(&mut self.arenas);
        let arenas = image.arenas.iter().enumerate().map(|(number, arena)| {
            let now = present.get_mut(number).and_then(Option::take);
            Some(restore_arena(now, arena.as_ref()?))
        });
        self.arenas = arenas.collect();
        let present = std::mem::take(&mut self.large);
        let large = image.large.iter().enumerate().map(|(index, object)| {
            let now = present.get(index).filter(|now| Arc::ptr_eq(now.memory(), &object.memory));
            // SAFETY: the header is that of the time of the image, and the heap, which has the object, is
            // borrowed mutably.
            let mut again =
                unsafe { LargeObject::again(&object.memory, object.header, object.numbers.clone()) };
            // SAFETY: the heap has images, so the object was made zeroed; its header is its own.
            let bytes = unsafe { again.bytes_mut() };
            for (page, (contents, bytes)) in object.contents.iter().zip(bytes.chunks_mut(PAGE)).enumerate() {
                if now.is_some_and(|now| object.has_page_of(now, page)) {
                    debug_assert!(contents.is_like(bytes), "a page with a number has changed");
                } else {
                    contents.put(bytes);
                }
            }
            again
        });
        self.large = large.collect();
        self.marker.forget(image.marked);
        self.phase = Phase::Idle;
        self.marking = false;
        (self.first, self.second) = (image.first.clone(), image.second.clone());
        (self.due, self.reserve_open) = (image.due, image.reserve_open);
        self.lent_to_cleanup = image.lent_to_cleanup;
        (self.epoch, self.cycle_id) = (image.epoch, image.cycle_id);
        (self.pacing, self.sweep) = (image.pacing, image.sweep);
        (self.large_number, self.committed) = (image.large_number, image.committed);
        (self.external, self.stats) = (image.external, image.stats);
        true
    }
}

impl Heap {
    /// Makes a simple vector the machine's own. If it is large, images compare its pages by numbers.
    ///
    /// # Safety
    /// From now on the vector is changed by [`Heap::own_vector_set`] only.
    pub unsafe fn own_vector(&mut self, v: Value) {
        let first = self.numbered + 1;
        let Some(object) = self.large_vector(v) else { return };
        let pages = (object.header().bytes - large::footprint(0)).div_ceil(PAGE) as u64;
        object.numbers = (first..first + pages).collect();
        self.numbered += pages;
    }

    /// Sets an element of a simple vector that is the machine's own; `None` if `v` is not a simple vector or
    /// has no such element.
    pub fn own_vector_set(&mut self, v: Value, index: usize, new: Value) -> Option<()> {
        self.vector_set(v, index, new)?;
        let number = self.numbered + 1;
        if let Some(object) = self.large_vector(v)
            && let Some(page) =
                object.numbers.get_mut((size_of::<Header>() + index * size_of::<Value>()) / PAGE)
        {
            *page = number;
            self.numbered = number;
        }
        Some(())
    }

    /// Returns a simple vector that is large.
    fn large_vector(&mut self, v: Value) -> Option<&mut LargeObject> {
        let object = self.object_of(v, Kind::SimpleVector)?;
        // SAFETY: H1, H2: the value is the address of a live object, which by its size is large.
        let index = unsafe {
            if !large::is_large((*object).size()) {
                return None;
            }
            (*large::header_of(object)).index
        };
        self.large.get_mut(index)
    }
}

/// Returns the contents of a block: those of `old`, where they are the same.
fn block_image(
    arena: &mut Arena,
    block: usize,
    unused: &[std::ops::Range<usize>; 2],
    old: Option<&Arc<BlockImage>>,
    count: &Arc<AtomicUsize>,
) -> Arc<BlockImage> {
    let metadata = Page::like(old.map(|old| &old.metadata), arena.metadata(block), count);
    let address = arena.address(block);
    let is_room = |page: usize| {
        let (from, to) = (address + page * PAGE, address + (page + 1) * PAGE);
        unused.iter().any(|range| range.start <= from && to <= range.end)
    };
    // SAFETY: the heap has images, so the arena was made zeroed, and the heap is borrowed mutably.
    let bytes = unsafe { arena.objects_mut(block) };
    let bytes = |page: usize| &bytes[page * PAGE..(page + 1) * PAGE];
    let is_same: [bool; BLOCK_PAGES] = std::array::from_fn(|page| match old.map(|old| &old.pages[page]) {
        Some(Some(old)) => !is_room(page) && old.is_like(bytes(page)),
        Some(None) => is_room(page),
        None => false,
    });
    if let Some(old) = old
        && Arc::ptr_eq(&old.metadata, &metadata)
        && is_same.iter().all(|&is_same| is_same)
    {
        return old.clone();
    }
    let pages = std::array::from_fn(|page| match old {
        Some(old) if is_same[page] => old.pages[page].clone(),
        _ if is_room(page) => None,
        _ => Some(Page::of(bytes(page), count)),
    });
    Arc::new(BlockImage { metadata, pages })
}

/// Returns an arena as it was. `now` is what has its number at present.
fn restore_arena(now: Option<Arena>, image: &ArenaImage) -> Arena {
    let now = now.filter(|now| Arc::ptr_eq(now.memory(), &image.memory));
    let mut arena = Arena::again(&image.memory, image.blocks, image.is_lent);
    arena.header_mut().grays = 0;
    for block in 1..=BLOCKS {
        let Some(contents) = &image.contents[block] else {
            // Nothing lived there, so the block was canonical.
            if now.as_ref().is_none_or(|now| !now.block(block).is_empty()) {
                arena.metadata_mut(block).fill(0);
            }
            continue;
        };
        contents.metadata.put(arena.metadata_mut(block));
        // SAFETY: the heap has images, so the arena was made zeroed, and the heap is borrowed mutably.
        let bytes = unsafe { arena.objects_mut(block) };
        for (page, bytes) in contents.pages.iter().zip(bytes.chunks_exact_mut(PAGE)) {
            if let Some(page) = page {
                page.put(bytes);
            }
        }
    }
    arena
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heap::HeapConfig;
    use crate::value::Value;

    fn heap() -> Heap {
        // SAFETY: H1: a test uses the values of one heap, while it has it.
        unsafe { Heap::new(HeapConfig { images: true, cycle_floor: 64 << 10, ..HeapConfig::default() }) }
    }

    /// Makes a list of vectors of all sizes, large ones among them, and drops some of them.
    fn work(heap: &mut Heap, mut list: Value, rounds: usize) -> Value {
        for round in 0..rounds {
            let size = if round % 40 == 7 { BLOCK / 8 } else { round % 50 };
            let vector = heap.alloc_vector_filled(size, Value::index(round)).expect("there is room");
            let rest = if round % 64 == 63 { Value::NIL } else { list };
            list = heap.cons(vector, rest).expect("there is room");
            if heap.gc_due() {
                // SAFETY: H2: the list is all that is used.
                unsafe { heap.collect_fully(|heap| heap.mark(list)) };
            }
        }
        list
    }

    fn read(heap: &Heap, mut list: Value) -> Vec<u64> {
        let mut read = Vec::new();
        while let Some(pair) = heap.as_cons(list) {
            read.push(heap.identity(pair.car));
            read.extend(heap.vector(pair.car).unwrap_or_default().iter().map(|v| v.bits()));
            list = pair.cdr;
        }
        read
    }

    #[test]
    fn a_heap_goes_on_from_an_image_as_it_did_before() {
        let rounds = if cfg!(miri) { 70 } else { 1500 };
        let mut heap = heap();
        let first_list = work(&mut heap, Value::NIL, rounds);
        let first = heap.save(None).expect("the collector rests");
        let first_read = read(&heap, first_list);
        let second_list = work(&mut heap, first_list, rounds);
        let second = heap.save(Some(&first)).expect("the collector rests");
        let second_read = read(&heap, second_list);
        let third_list = work(&mut heap, second_list, 2 * rounds);
        let (third_read, stats) = (read(&heap, third_list), heap.stats());
        for _ in 0..2 {
            // SAFETY: the lists that are read are those of the image.
            assert!(unsafe { heap.restore(&first) });
            heap.check().expect("it is whole");
            assert_eq!(read(&heap, first_list), first_read);
            assert_eq!(work(&mut heap, first_list, rounds), second_list);
            assert_eq!(read(&heap, second_list), second_read);
            // SAFETY: the lists that are read are those of this image.
            assert!(unsafe { heap.restore(&second) });
            assert_eq!(read(&heap, second_list), second_read);
            assert_eq!(work(&mut heap, second_list, 2 * rounds), third_list);
            assert_eq!((read(&heap, third_list), heap.stats()), (third_read.clone(), stats));
        }
        let taken = second.bytes_of_all();
        drop(first);
        assert!(second.bytes_of_all() < taken);
    }

    #[test]
    fn an_image_shares_what_has_not_changed() {
        let mut heap = heap();
        work(&mut heap, Value::NIL, 60);
        let first = heap.save(None).expect("the collector rests");
        let taken = first.bytes_of_all();
        heap.cons(Value::T, Value::NIL).expect("there is room");
        let _second = heap.save(Some(&first)).expect("the collector rests");
        assert!(first.bytes_of_all() - taken <= 2 * (PAGE + PAGE_BYTES));
    }

    #[test]
    fn vectors_of_the_machine_are_compared_by_the_numbers_of_their_pages() {
        // On another page than the first elements.
        let far = BLOCK / 8 + 5;
        let mut heap = heap();
        let vector = heap.alloc_vector_filled(2 * BLOCK / 8, Value::NIL).expect("there is room");
        // SAFETY: the vector is changed as the machine's own only.
        unsafe { heap.own_vector(vector) };
        let mut images = vec![heap.save(None).expect("the collector rests")];
        for index in [0, far, far] {
            heap.own_vector_set(vector, index, Value::index(images.len())).expect("it has the element");
            let image = heap.save(images.last()).expect("the collector rests");
            images.push(image);
        }
        let taken = images[0].bytes_of_all();
        images.push(heap.save(images.last()).expect("the collector rests"));
        assert_eq!(images[0].bytes_of_all(), taken);
        let at = |heap: &Heap, index: usize| heap.vector(vector).expect("it is a vector")[index];
        let (none, one, two, three) = (Value::NIL, Value::index(1), Value::index(2), Value::index(3));
        for (image, first, other) in [(3, one, three), (1, one, none), (0, none, none), (2, one, two)] {
            // SAFETY: the vector is older than the images.
            assert!(unsafe { heap.restore(&images[image]) });
            assert_eq!((at(&heap, 0), at(&heap, far)), (first, other));
            heap.own_vector_set(vector, 7, Value::T).expect("it has the element");
            // SAFETY: the vector is older than the images.
            assert!(unsafe { heap.restore(&images[image]) });
            assert_eq!((at(&heap, 0), at(&heap, far), at(&heap, 7)), (first, other, none));
        }
        assert!(taken < 2 * BLOCK + 12 * (PAGE + PAGE_BYTES) + 2 * BLOCK / 8);
    }

    #[test]
    fn a_heap_takes_images_if_it_was_made_for_that_and_the_collector_rests() {
        assert!(Heap::for_tests().save(None).is_none());
        let (mut one, mut other) = (heap(), heap());
        let image = one.save(None).expect("the collector rests");
        // SAFETY: the values of the contents until now are not used again.
        assert!(!unsafe { other.restore(&image) });
        one.begin_cycle();
        assert!(one.save(None).is_none());
        // SAFETY: the values of the contents until now are not used again.
        assert!(unsafe { one.restore(&image) });
        assert!(one.save(None).is_some());
    }
}
