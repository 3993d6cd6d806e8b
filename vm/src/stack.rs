//! The register stack of one task: a growable segment of words.
//!
//! ```text
//! | callee | return pc | registers of the first frame ... | callee | return pc | registers ... |   unused, nil   |
//!                      ^ base of the first frame                               ^ base of the running frame
//! ```
//!
//! Frames overlap: the window of a call becomes the callee's frame. Nothing in the heap points into a stack, so growing
//! one is a copy.
//!
//! Invariants:
//! 1. Every word from the start to `capacity` is initialised and reads as a valid [`Value`]: a return pc has its low bits
//!    clear and so looks like a fixnum.
//! 2. Words that may hold an address of a dead object are above the top of the running frame; [`Stack::wipe`] clears
//!    them before each scan.
#![allow(unsafe_code)]

use std::alloc::{Layout, alloc, dealloc, handle_alloc_error};
use std::ptr::NonNull;

use crate::value::Value;

/// A stack.
pub(crate) struct Stack {
    start: NonNull<Value>,
    capacity: usize,
}

// SAFETY: a stack owns its segment; the values in it belong to the heap of the machine that owns the stack.
unsafe impl Send for Stack {}

/// Words of a new stack: one frame of a small function.
const INITIAL: usize = 24;

impl Stack {
    /// A stack of nils.
    pub(crate) fn new() -> Stack {
        let start = allocate(INITIAL);
        Stack { start, capacity: INITIAL }
    }

    /// Address of the first word.
    #[inline(always)]
    pub(crate) fn start(&self) -> *mut Value {
        self.start.as_ptr()
    }

    /// Number of words.
    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }

    /// Makes room for at least `words` words, keeping the contents. Moves the stack.
    pub(crate) fn grow(&mut self, words: usize) {
        let capacity = words.next_power_of_two().max(self.capacity * 2);
        let start = allocate(capacity);
        // SAFETY: both segments are ours and hold at least `self.capacity` words.
        unsafe { std::ptr::copy_nonoverlapping(self.start.as_ptr(), start.as_ptr(), self.capacity) };
        let old = std::mem::replace(&mut self.start, start);
        // SAFETY: `old` was allocated with this layout and is no longer used.
        unsafe { dealloc(old.as_ptr().cast(), layout(self.capacity)) };
        self.capacity = capacity;
    }

    /// Clears everything from `top` on, so that what is below is all that a scan sees.
    pub(crate) fn wipe(&mut self, top: usize) {
        // The interpreter does not note how high it has written: that would cost each call a store.
        for index in top..self.capacity {
            // SAFETY: the index is below the capacity.
            unsafe { self.start.as_ptr().add(index).write(Value::NIL) };
        }
    }

    /// The words below `top`.
    pub(crate) fn words(&self, top: usize) -> &[Value] {
        debug_assert!(top <= self.capacity);
        // SAFETY: invariant 1.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), top.min(self.capacity)) }
    }
}

impl Drop for Stack {
    fn drop(&mut self) {
        // SAFETY: the segment was allocated with this layout.
        unsafe { dealloc(self.start.as_ptr().cast(), layout(self.capacity)) };
    }
}

fn layout(words: usize) -> Layout {
    Layout::array::<Value>(words).expect("a stack is far smaller than the address space")
}

fn allocate(words: usize) -> NonNull<Value> {
    let layout = layout(words);
    // SAFETY: the layout is not empty.
    let Some(start) = NonNull::new(unsafe { alloc(layout) }.cast::<Value>()) else {
        handle_alloc_error(layout)
    };
    for index in 0..words {
        // SAFETY: the index is below the size of the fresh segment.
        unsafe { start.as_ptr().add(index).write(Value::NIL) };
    }
    start
}
