//! Places for things of a program that are opened by an operation: a file, a request.
//!
//! The program has the place before the operation begins, so that a call that is left early leaves nothing
//! open.

use std::sync::{Arc, Mutex};

use crate::socket::lock;

/// A place for a thing: new, then with the thing, then closed for ever.
pub(crate) struct OpenSlot<T>(Mutex<SlotStage<T>>);

enum SlotStage<T> {
    New,
    Open(Arc<T>),
    Closed,
}

impl<T> Default for OpenSlot<T> {
    fn default() -> OpenSlot<T> {
        OpenSlot(Mutex::new(SlotStage::New))
    }
}

impl<T> OpenSlot<T> {
    /// Returns the thing, if it is open.
    pub(crate) fn get(&self) -> Option<Arc<T>> {
        match &*lock(&self.0) {
            SlotStage::Open(thing) => Some(thing.clone()),
            SlotStage::New | SlotStage::Closed => None,
        }
    }

    /// Puts a thing into the place, if it is new. Returns whether it was, and was not closed meanwhile.
    pub(crate) fn open(&self, thing: T) -> bool {
        let mut stage = lock(&self.0);
        let is_new = matches!(*stage, SlotStage::New);
        if is_new {
            *stage = SlotStage::Open(Arc::new(thing));
        }
        is_new
    }

    /// Closes the place. Returns the thing, if it was open.
    pub(crate) fn close(&self) -> Option<Arc<T>> {
        match std::mem::replace(&mut *lock(&self.0), SlotStage::Closed) {
            SlotStage::Open(thing) => Some(thing),
            SlotStage::New | SlotStage::Closed => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_opened_once_and_not_after_it_was_closed() {
        let slot = OpenSlot::default();
        assert_eq!(slot.get(), None);
        assert!(slot.open(1) && !slot.open(2));
        assert_eq!((slot.get().as_deref(), slot.close().as_deref()), (Some(&1), Some(&1)));
        assert!(!slot.open(3) && slot.get().is_none() && slot.close().is_none());
    }
}
