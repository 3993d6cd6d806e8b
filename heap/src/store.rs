//! The state of a machine as bytes, for a file that the same build of the machine reads.
//!
//! [`stored!`](crate::stored) and [`stored_enum!`](crate::stored_enum) list the fields and the variants of a
//! type; a type that is read back is complete, so a new field does not compile until it is listed. Numbers
//! have their full width, since most of a state is pages of the heap anyway. Lists keep the room that they
//! had, because room counts as memory.
//!
//! Guarantees: [`Stored::load`] returns `None` for bytes that end too early.
//!
//! Not here: the meaning of addresses. Values are written with their addresses, which are good in a heap at
//! the same addresses only ([`crate::heap::HeapConfig::range`]).

#![allow(unsafe_code)]

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet, BinaryHeap, HashMap, VecDeque};
use std::hash::{BuildHasher, Hash};
use std::sync::Arc;

use smallvec::SmallVec;

use crate::value::Value;

/// Bytes that are read back, in the order in which they were written.
#[derive(Clone, Debug)]
pub struct StoredBytes<'a>(&'a [u8]);

impl<'a> StoredBytes<'a> {
    /// Takes bytes to be read.
    ///
    /// # Safety
    /// They were written by [`Stored::store`], of the types that are read from them. If there are values
    /// among them, these are used with a heap that has the contents that it had then, at the same addresses.
    pub unsafe fn new(bytes: &'a [u8]) -> StoredBytes<'a> {
        StoredBytes(bytes)
    }

    /// Returns the next bytes.
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    /// Returns the next bytes, to be read as such.
    pub fn take_part(&mut self, count: usize) -> Option<StoredBytes<'a>> {
        self.take(count).map(StoredBytes)
    }

    /// Returns whether all was read.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*bytes)
    }

    /// Returns the next byte.
    pub fn byte(&mut self) -> Option<u8> {
        self.array::<1>().map(|[byte]| byte)
    }

    /// Reads a number of items, each of which takes a byte at least.
    fn count(&mut self) -> Option<usize> {
        usize::load(self).filter(|&count| count <= self.0.len())
    }
}

/// Data that are written as bytes, and read back by the same build.
pub trait Stored: Sized {
    /// Adds the bytes to `out`.
    fn store(&self, out: &mut Vec<u8>);

    /// Reads a value that was written; `None` if the bytes end before.
    fn load(from: &mut StoredBytes<'_>) -> Option<Self>;
}

/// Lists the fields that are stored: `stored! { Timer { time, due } }`. Behind `with` are the fields that are
/// given in place of reading them.
#[macro_export]
macro_rules! stored {
    ($owner:ident { $($field:tt),* $(,)? } $(with { $($given:tt : $value:expr),* $(,)? })?) => {
        impl $crate::store::Stored for $owner {
            #[allow(unused_variables)]
            fn store(&self, out: &mut Vec<u8>) {
                $( $crate::store::Stored::store(&self.$field, out); )*
            }

            #[allow(unused_variables)]
            fn load(from: &mut $crate::store::StoredBytes<'_>) -> Option<Self> {
                Some($owner {
                    $( $field: $crate::store::Stored::load(from)?, )*
                    $($( $given: $value, )*)?
                })
            }
        }
    };
}

/// Lists the variants of an enum that is stored, with their numbers:
/// `stored_enum! { Due { Wait(serial) = 0, Cleanup = 1 } }`.
#[macro_export]
macro_rules! stored_enum {
    ($owner:ident {
        $( $variant:ident $(( $($part:ident),* ))? $({ $($field:ident),* })? = $tag:literal ),* $(,)?
    }) => {
        impl $crate::store::Stored for $owner {
            #[allow(unused_variables)]
            fn store(&self, out: &mut Vec<u8>) {
                match self {
                    $( $owner::$variant $(( $($part),* ))? $({ $($field),* })? => {
                        out.push($tag);
                        $( $( $crate::store::Stored::store($part, out); )* )?
                        $( $( $crate::store::Stored::store($field, out); )* )?
                    } )*
                }
            }

            fn load(from: &mut $crate::store::StoredBytes<'_>) -> Option<Self> {
                Some(match from.byte()? {
                    $( $tag => {
                        $( $( let $part = $crate::store::Stored::load(from)?; )* )?
                        $( $( let $field = $crate::store::Stored::load(from)?; )* )?
                        $owner::$variant $(( $($part),* ))? $({ $($field),* })?
                    } )*
                    _ => return None,
                })
            }
        }
    };
}

macro_rules! stored_numbers {
    ($($number:ty),*) => { $(
        impl Stored for $number {
            #[inline]
            fn store(&self, out: &mut Vec<u8>) {
                out.extend_from_slice(&self.to_le_bytes());
            }

            #[inline]
            fn load(from: &mut StoredBytes<'_>) -> Option<Self> {
                from.array().map(<$number>::from_le_bytes)
            }
        }
    )* };
}

stored_numbers! { u8, u16, u32, u64, u128, usize, i32, i64 }

impl Stored for () {
    fn store(&self, _out: &mut Vec<u8>) {}

    fn load(_from: &mut StoredBytes<'_>) -> Option<()> {
        Some(())
    }
}

impl Stored for bool {
    fn store(&self, out: &mut Vec<u8>) {
        out.push((*self).into());
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<bool> {
        match from.byte()? {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        }
    }
}

impl Stored for Value {
    #[inline]
    fn store(&self, out: &mut Vec<u8>) {
        self.bits().store(out);
    }

    #[inline]
    fn load(from: &mut StoredBytes<'_>) -> Option<Value> {
        // SAFETY: the caller of `StoredBytes::new` has promised that the bytes are a value of a heap that has
        // its contents, at its addresses, again.
        u64::load(from).map(|bits| unsafe { Value::from_bits(bits) })
    }
}

impl Stored for String {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        out.extend_from_slice(self.as_bytes());
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<String> {
        let count = from.count()?;
        std::str::from_utf8(from.take(count)?).ok().map(str::to_owned)
    }
}

impl Stored for Arc<str> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        out.extend_from_slice(self.as_bytes());
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Arc<str>> {
        let count = from.count()?;
        std::str::from_utf8(from.take(count)?).ok().map(Arc::from)
    }
}

impl<T: Stored> Stored for Option<T> {
    fn store(&self, out: &mut Vec<u8>) {
        self.is_some().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Option<T>> {
        if bool::load(from)? { T::load(from).map(Some) } else { Some(None) }
    }
}

impl<T: Stored> Stored for Vec<T> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.capacity().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Vec<T>> {
        let (count, room) = (from.count()?, usize::load(from)?);
        let mut list = Vec::new();
        list.try_reserve_exact(room.max(count)).ok()?;
        for _ in 0..count {
            list.push(T::load(from)?);
        }
        Some(list)
    }
}

impl<T: Stored> Stored for VecDeque<T> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<VecDeque<T>> {
        (0..from.count()?).map(|_| T::load(from)).collect()
    }
}

impl<T: Stored> Stored for Box<[T]> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Box<[T]>> {
        (0..from.count()?).map(|_| T::load(from)).collect()
    }
}

impl<T: Stored> Stored for Arc<[T]> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Arc<[T]>> {
        (0..from.count()?).map(|_| T::load(from)).collect()
    }
}

impl<T: Stored, const N: usize> Stored for SmallVec<[T; N]>
where
    [T; N]: smallvec::Array<Item = T>,
{
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<SmallVec<[T; N]>> {
        (0..from.count()?).map(|_| T::load(from)).collect()
    }
}

impl<T: Stored> Stored for Box<T> {
    fn store(&self, out: &mut Vec<u8>) {
        (**self).store(out);
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Box<T>> {
        T::load(from).map(Box::new)
    }
}

impl<T: Stored> Stored for Arc<T> {
    fn store(&self, out: &mut Vec<u8>) {
        (**self).store(out);
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Arc<T>> {
        T::load(from).map(Arc::new)
    }
}

impl<T: Stored> Stored for Reverse<T> {
    fn store(&self, out: &mut Vec<u8>) {
        self.0.store(out);
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<Reverse<T>> {
        T::load(from).map(Reverse)
    }
}

impl<T: Stored, const N: usize> Stored for [T; N] {
    fn store(&self, out: &mut Vec<u8>) {
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<[T; N]> {
        let parts: Option<Vec<T>> = (0..N).map(|_| T::load(from)).collect();
        parts?.try_into().ok()
    }
}

impl<A: Stored, B: Stored> Stored for (A, B) {
    fn store(&self, out: &mut Vec<u8>) {
        self.0.store(out);
        self.1.store(out);
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<(A, B)> {
        Some((A::load(from)?, B::load(from)?))
    }
}

impl<A: Stored, B: Stored, C: Stored> Stored for (A, B, C) {
    fn store(&self, out: &mut Vec<u8>) {
        self.0.store(out);
        self.1.store(out);
        self.2.store(out);
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<(A, B, C)> {
        Some((A::load(from)?, B::load(from)?, C::load(from)?))
    }
}

/// The order of its items stays: a heap that is in order is not changed by making it one.
impl<T: Stored + Ord> Stored for BinaryHeap<T> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<BinaryHeap<T>> {
        let items: Option<Vec<T>> = (0..from.count()?).map(|_| T::load(from)).collect();
        items.map(BinaryHeap::from)
    }
}

impl<K: Stored + Ord, V: Stored> Stored for BTreeMap<K, V> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        for (key, value) in self {
            key.store(out);
            value.store(out);
        }
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<BTreeMap<K, V>> {
        (0..usize::load(from)?).map(|_| Some((K::load(from)?, V::load(from)?))).collect()
    }
}

impl<T: Stored + Ord> Stored for BTreeSet<T> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.iter().for_each(|part| part.store(out));
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<BTreeSet<T>> {
        (0..from.count()?).map(|_| T::load(from)).collect()
    }
}

/// It is written in the order of its keys. The order in which it is iterated may be another one afterwards.
impl<K: Stored + Ord + Hash, V: Stored, S: BuildHasher + Default> Stored for HashMap<K, V, S> {
    fn store(&self, out: &mut Vec<u8>) {
        self.len().store(out);
        self.capacity().store(out);
        let mut entries: Vec<(&K, &V)> = self.iter().collect();
        entries.sort_unstable_by_key(|&(key, _)| key);
        for (key, value) in entries {
            key.store(out);
            value.store(out);
        }
    }

    fn load(from: &mut StoredBytes<'_>) -> Option<HashMap<K, V, S>> {
        let (count, room) = (from.count()?, usize::load(from)?);
        let mut map = HashMap::default();
        map.try_reserve(room.max(count)).ok()?;
        for _ in 0..count {
            map.insert(K::load(from)?, V::load(from)?);
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq)]
    enum Shape {
        Point,
        Circle(u32, Value),
        Box { width: u64, label: Option<String> },
    }

    #[derive(Clone, Debug, PartialEq)]
    struct Picture {
        shapes: Vec<Shape>,
        order: VecDeque<(u8, bool)>,
        cached: u32,
    }

    stored_enum! { Shape { Point = 0, Circle(radius, color) = 1, Box { width, label } = 2 } }
    stored! { Picture { shapes, order } with { cached: 7 } }

    #[test]
    fn what_is_stored_is_read_back_with_its_room() {
        let mut shapes = Vec::with_capacity(10);
        shapes.extend([
            Shape::Point,
            Shape::Circle(3, Value::T),
            Shape::Box { width: 9, label: Some("é".into()) },
        ]);
        let picture = Picture { shapes, order: [(1, true), (2, false)].into(), cached: 7 };
        let mut bytes = Vec::new();
        picture.store(&mut bytes);
        // SAFETY: the bytes are those that were written, and the values have no addresses.
        let read = |bytes: &[u8]| Picture::load(&mut unsafe { StoredBytes::new(bytes) });
        let again = read(&bytes).expect("the bytes are whole");
        assert_eq!((again.shapes.capacity(), &again), (10, &picture));
        assert!((0..bytes.len()).all(|length| read(&bytes[..length]).is_none()));
    }
}
