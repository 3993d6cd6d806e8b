//! The register stack of one task: a growable segment of words.
//!
//! ```text
//! | callee | return pc | registers of the first frame ... | callee | return pc | registers ... |   unused,
//! nil   |
//!                      ^ base of the first frame                               ^ base of the running frame
//! ```
//!
//! Frames overlap: the window of a call becomes the callee's frame. Nothing in the heap points into a stack,
//! so to grow one is to copy it.
//!
//! Invariants:
//! 1. Every word from the start to `capacity` is initialised and reads as a valid [`Value`]: a return pc has
//!    its low bits clear and so looks like a fixnum.
//! 2. Words that may hold an address of a dead object are above the top of the running frame; [`Stack::wipe`]
//!    clears them before each scan.

#![allow(unsafe_code)]

use std::alloc::{Layout, alloc, dealloc, handle_alloc_error, realloc};
use std::ptr::NonNull;

use crate::list_state;
use crate::store::{Stored, StoredBytes};
use crate::value::Value;

/// Register stack of a task.
pub struct Stack {
    start: NonNull<Value>,
    capacity: u32,
    /// How far the scan under way has come, in units of its own.
    pub scan: u32,
}

// The words behind `start` are the run's, their address is the process's.
list_state! { Stack { start: Visited, capacity: Run, scan: Derived } }

// SAFETY: a stack owns its segment; the values in it belong to the heap of the machine that owns the stack.
unsafe impl Send for Stack {}

/// Words of the smallest stack: enough for a task whose function waits at once, of which there may be
/// millions. With the word that an allocator takes for itself it fills a block of 64 bytes; the other sizes
/// fill blocks likewise.
const SMALLEST: usize = 7;

/// Words from which on a segment fills whole pages, with the two words that an allocator takes for itself.
const LARGE: usize = 1 << 14;

/// Most words by which a stack grows or shrinks at once, if that is not a small part of it: in about a
/// millisecond.
const MOST: usize = 1 << 18;

/// Words of two pages.
const PAGES: usize = 1024;

/// Returns the size of the smallest segment with at least `words` words: 7, 11, 15, 23, 31, 47, 63, 95, …
fn segment(words: usize) -> usize {
    assert!(words < 1 << 31, "a stack has less than 2^31 words");
    if words >= LARGE {
        return (words + 2).next_multiple_of(PAGES) - 2;
    }
    let power = (words + 1).max(SMALLEST + 1).next_power_of_two();
    let between = power / 4 * 3 - 1;
    if between >= words.max(SMALLEST) { between } else { power - 1 }
}

impl Stack {
    /// Creates a stack of at least `words` words, all `nil`.
    ///
    /// # Panics
    /// If `words` is not below 2^31.
    pub fn new(words: usize) -> Stack {
        let capacity = segment(words);
        Stack { start: allocate(capacity), capacity: capacity as u32, scan: 0 }
    }

    /// Creates a stack without words, to stand in for one that was taken away.
    pub const fn none() -> Stack {
        Stack { start: NonNull::dangling(), capacity: 0, scan: 0 }
    }

    /// Returns the address of the first word.
    #[inline(always)]
    pub fn start(&self) -> *mut Value {
        self.start.as_ptr()
    }

    /// Returns the number of words.
    #[inline(always)]
    pub fn capacity(&self) -> usize {
        self.capacity as usize
    }

    /// Returns the number of words to grow to if there are to be at least `words`: so many that the copies of
    /// a stack that keeps growing are a bounded part of the work that fills it, and not so many that filling
    /// the new ones takes long.
    pub fn larger(&self, words: usize) -> usize {
        let capacity = self.capacity();
        words.max(capacity + (capacity / 4).min((capacity / 32).max(MOST)))
    }

    /// Makes room for at least `words` words and keeps the contents. The stack moves.
    ///
    /// # Panics
    /// If `words` is not below 2^31.
    pub fn grow(&mut self, words: usize) {
        self.move_to(segment(words.max(self.capacity())));
    }

    /// Returns the memory that the words below `top` do not need to the system, so much of it as does not
    /// take long. The stack moves.
    pub fn shrink(&mut self, top: usize) {
        self.move_to(segment(top.max(self.capacity().saturating_sub(MOST))));
    }

    fn move_to(&mut self, capacity: usize) {
        let old = self.capacity();
        if old == 0 {
            self.start = allocate(capacity);
        } else {
            let (before, after) = (layout(old), layout(capacity));
            // SAFETY: `allocate` made the segment with the layout `before`, and neither size is zero.
            // For large segments the system moves pages instead of copying words.
            let start = unsafe { realloc(self.start.as_ptr().cast(), before, after.size()) };
            let Some(start) = NonNull::new(start.cast::<Value>()) else { handle_alloc_error(after) };
            self.start = start;
            fill(start, old, capacity);
        }
        self.capacity = capacity as u32;
    }

    /// Sets all words from `top` on to `nil`, so that a scan sees only those below.
    pub fn wipe(&mut self, top: usize) {
        // The interpreter does not note how high it has written, since that would cost each call a store.
        fill(self.start, top, self.capacity());
    }

    /// Sets the words of a range to `nil`, as far as they are there.
    pub fn wipe_range(&mut self, from: usize, to: usize) {
        fill(self.start, from, to.min(self.capacity()));
    }

    /// Returns the words below `top`.
    pub fn words(&self, top: usize) -> &[Value] {
        debug_assert!(top <= self.capacity());
        // SAFETY: invariant 1: every word below the capacity is a value; the slice borrows the stack.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), top.min(self.capacity())) }
    }
}

impl Stored for Stack {
    fn store(&self, out: &mut Vec<u8>) {
        self.capacity.store(out);
        self.scan.store(out);
        // The unused words at the end are `nil` most often.
        let words = self.words(self.capacity());
        let used = words.iter().rposition(|&word| word != Value::NIL).map_or(0, |last| last + 1);
        used.store(out);
        words[..used].iter().for_each(|word| word.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Stack> {
        let (capacity, scan, used) = (u32::load(from)?, u32::load(from)?, usize::load(from)?);
        let words = capacity as usize;
        if used > words || words >= 1 << 31 {
            return None;
        }
        if words == 0 {
            return Some(Stack { scan, ..Stack::none() });
        }
        let stack = Stack { start: allocate(words), capacity, scan };
        for index in 0..used {
            let word = Value::load(from)?;
            // SAFETY: the segment has more than `used` words, or as many.
            unsafe { stack.start.add(index).write(word) };
        }
        Some(stack)
    }
}

impl Clone for Stack {
    fn clone(&self) -> Stack {
        let words = self.capacity();
        if words == 0 {
            return Stack::none();
        }
        let start = allocate(words);
        // SAFETY: both segments have so many words, all initialised, and the new one has no other owner.
        unsafe { start.copy_from_nonoverlapping(self.start, words) };
        Stack { start, ..*self }
    }
}

impl Drop for Stack {
    fn drop(&mut self) {
        free(self.start, self.capacity());
    }
}

fn layout(words: usize) -> Layout {
    Layout::array::<Value>(words).expect("a stack is far smaller than the address space")
}

/// Frees a segment, unless it has no words.
fn free(start: NonNull<Value>, words: usize) {
    if words > 0 {
        // SAFETY: `allocate` made every segment with words, with this layout; its owner uses it no longer.
        unsafe { dealloc(start.as_ptr().cast(), layout(words)) };
    }
}

fn allocate(words: usize) -> NonNull<Value> {
    let layout = layout(words);
    // SAFETY: the layout is not empty, since the smallest segment is not.
    let Some(start) = NonNull::new(unsafe { alloc(layout) }.cast::<Value>()) else {
        handle_alloc_error(layout)
    };
    fill(start, 0, words);
    start
}

/// Sets the words of a segment from `from` to before `to` to `nil`. The segment has that many words.
fn fill(start: NonNull<Value>, from: usize, to: usize) {
    for index in from..to {
        // SAFETY: every caller passes a segment and at most its capacity, so the word lies in it.
        unsafe { start.as_ptr().add(index).write(Value::NIL) };
    }
}

#[cfg(test)]
mod tests {
    use super::{Stack, segment};
    use crate::value::Value;

    #[test]
    fn a_stack_without_words_grows_and_shrinks_like_any_other() {
        let mut stack = Stack::none();
        assert_eq!((stack.capacity(), stack.words(0).len()), (0, 0));
        stack.wipe(0);
        stack.grow(20);
        assert_eq!(stack.words(20), [Value::NIL; 20]);
        stack.shrink(3);
        assert_eq!(stack.capacity(), segment(3));
    }

    #[test]
    fn a_stack_that_grows_keeps_its_words_and_fills_the_rest() {
        let mut stack = Stack::new(3);
        // SAFETY: the first word lies in the segment.
        unsafe { stack.start().write(Value::T) };
        for words in [40, 20_000, 50] {
            let larger = stack.larger(words);
            assert!(larger >= words && larger <= words.max(stack.capacity() + stack.capacity() / 4));
            stack.grow(larger);
            assert_eq!(stack.words(2), [Value::T, Value::NIL]);
            assert_eq!(stack.words(stack.capacity()).last(), Some(&Value::NIL));
        }
    }

    #[test]
    fn a_copy_of_a_stack_has_its_words_and_its_size() {
        let mut stack = Stack::new(20);
        // SAFETY: the first word lies in the segment.
        unsafe { stack.start().write(Value::T) };
        let copy = stack.clone();
        stack.wipe(0);
        assert_eq!((copy.words(2), copy.capacity()), (&[Value::T, Value::NIL][..], stack.capacity()));
        assert_eq!(Stack::none().clone().capacity(), 0);
    }

    #[test]
    fn a_range_of_words_is_wiped_as_far_as_they_are_there() {
        let mut stack = Stack::new(15);
        for index in 0..15 {
            // SAFETY: the word lies in the segment.
            unsafe { stack.start().add(index).write(Value::T) };
        }
        stack.wipe_range(2, 5);
        stack.wipe_range(14, 100);
        stack.wipe_range(20, 30);
        let wiped = |index: usize| (2..5).contains(&index) || index == 14;
        let words = stack.words(15);
        assert!((0..15).all(|index| words[index] == if wiped(index) { Value::NIL } else { Value::T }));
    }

    #[test]
    #[cfg(not(miri))]
    fn a_large_stack_grows_and_shrinks_by_steps() {
        use super::{MOST, PAGES};
        let mut stack = Stack::new(4 * MOST);
        assert!(stack.larger(0) < 5 * MOST + 2 * PAGES);
        stack.shrink(3);
        assert!(stack.capacity() >= 3 * MOST);
        for _ in 0..4 {
            stack.shrink(3);
        }
        assert_eq!(stack.capacity(), segment(3));
    }

    #[test]
    fn segments_are_as_large_as_asked_for_and_not_much_larger() {
        assert_eq!([1, 7, 8, 11, 12, 15, 16, 23].map(segment), [7, 7, 11, 11, 15, 15, 23, 23]);
        assert_eq!([24, 31, 32, 47, 48].map(segment), [31, 31, 47, 47, 63]);
        for words in (1..5000).chain(16_000..20_000) {
            let segment = segment(words);
            assert!(segment >= words && (segment <= 7 || segment * 2 <= words * 3), "{words} {segment}");
        }
    }
}
