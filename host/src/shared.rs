//! Values shared by a machine and the copies of its state.
//!
//! To copy one is to note that there are two; the first change makes a copy in fact. So large tables that
//! seldom change cost the copies of a machine nothing.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use esl_heap::state::{StateSink, Stated};
use esl_heap::store::{Stored, StoredBytes};

/// A value, copied when it is changed while there is another copy.
#[derive(Debug, Default)]
pub struct CopyOnWrite<T>(Arc<T>);

impl<T> CopyOnWrite<T> {
    /// Creates a value of which there is no copy.
    pub fn new(value: T) -> CopyOnWrite<T> {
        CopyOnWrite(Arc::new(value))
    }
}

impl<T> Clone for CopyOnWrite<T> {
    #[inline]
    fn clone(&self) -> CopyOnWrite<T> {
        CopyOnWrite(self.0.clone())
    }
}

impl<T> Deref for CopyOnWrite<T> {
    type Target = T;

    #[inline]
    fn deref(&self) -> &T {
        &self.0
    }
}

impl<T: Clone> DerefMut for CopyOnWrite<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut T {
        Arc::make_mut(&mut self.0)
    }
}

impl<T: Stated> Stated for CopyOnWrite<T> {
    fn tell(&self, sink: &mut dyn StateSink) {
        self.0.tell(sink);
    }
}

impl<T: Stored> Stored for CopyOnWrite<T> {
    fn store(&self, out: &mut Vec<u8>) {
        (**self).store(out);
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<CopyOnWrite<T>> {
        T::load(from).map(CopyOnWrite::new)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_of_one_copy_leaves_the_other() {
        let mut one = CopyOnWrite::new(vec![1]);
        let other = one.clone();
        one.push(2);
        assert_eq!((&*one, &*other), (&vec![1, 2], &vec![1]));
    }
}
