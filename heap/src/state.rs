//! The list of all state: what each field of the machine means for a run.
//!
//! [`list_state!`](crate::list_state) lists the fields of a struct, in any module that sees them. It takes
//! the struct apart without `..`, so a new field does not compile until the list gives it a [`FieldRole`]. A
//! field that consists of listed structs has the role `Parts`, which compiles only if they are listed too. So
//! [`Listed::FIELDS`] of a struct is a tree of everything that it owns.
//!
//! The same list tells the state of the run, field by field, to a [`StateSink`]: a fingerprint is made so.
//!
//! Guarantees: the tree is complete. Code that compares, saves or copies a machine can be checked against it.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};

use crate::value::Value;

/// Meaning of a field for a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldRole {
    /// State of the run: two machines that differ here may behave differently.
    Run,
    /// Follows from other fields, and is kept to save time.
    Derived,
    /// Belongs to the process: an address, a handle, a cache. Another one in its place makes no difference to
    /// the run.
    Process,
    /// Made of structs that are listed themselves; these are their fields.
    Parts(&'static [Field]),
}

/// A field of a listed struct.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name in the source.
    pub name: &'static str,
    /// Meaning for a run.
    pub role: FieldRole,
}

/// A struct whose fields are all listed by [`list_state!`](crate::list_state).
pub trait Listed {
    /// Fields, in the order of the list.
    const FIELDS: &'static [Field];
}

impl<T: Listed> Listed for Option<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed> Listed for Vec<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed> Listed for std::ptr::NonNull<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed, const N: usize> Listed for [T; N] {
    const FIELDS: &'static [Field] = T::FIELDS;
}

impl<T: Listed + ?Sized> Listed for Box<T> {
    const FIELDS: &'static [Field] = T::FIELDS;
}

/// A consumer of the state of a run, word by word.
pub trait StateSink {
    /// Takes a word that means the same in every process.
    fn word(&mut self, word: u64);

    /// Takes a value, in which there may be an address.
    fn value(&mut self, value: Value);

    /// Takes an address in the heap, of an object, between two or behind the last, or zero.
    fn address(&mut self, address: usize);
}

/// Something that is state of a run: what a list calls `Run` compiles only if it is this.
pub trait Stated {
    /// Tells the state, in an order that depends on it alone.
    fn tell(&self, sink: &mut dyn StateSink);
}

macro_rules! tell_words {
    ($($number:ty),*) => {
        $( impl Stated for $number {
            #[allow(clippy::cast_lossless, clippy::unnecessary_cast)]
            fn tell(&self, sink: &mut dyn StateSink) {
                sink.word(*self as u64);
            }
        } )*
    };
}

tell_words! { bool, u8, u16, u32, u64, usize, i64 }

impl Stated for Value {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.value(*self);
    }
}

impl Stated for String {
    fn tell(&self, sink: &mut dyn StateSink) {
        self.as_bytes().tell(sink);
    }
}

impl<T: Stated> Stated for Option<T> {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(u64::from(self.is_some()));
        self.iter().for_each(|part| part.tell(sink));
    }
}

impl<T: Stated> Stated for [T] {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(self.len() as u64);
        self.iter().for_each(|part| part.tell(sink));
    }
}

impl<T: Stated, const N: usize> Stated for [T; N] {
    fn tell(&self, sink: &mut dyn StateSink) {
        self.as_slice().tell(sink);
    }
}

impl<T: Stated> Stated for Vec<T> {
    fn tell(&self, sink: &mut dyn StateSink) {
        self.as_slice().tell(sink);
    }
}

impl<T: Stated> Stated for VecDeque<T> {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(self.len() as u64);
        self.iter().for_each(|part| part.tell(sink));
    }
}

impl<T: Stated + Ord> Stated for BinaryHeap<Reverse<T>> {
    fn tell(&self, sink: &mut dyn StateSink) {
        let mut parts: Vec<&Reverse<T>> = self.iter().collect();
        parts.sort_unstable();
        sink.word(parts.len() as u64);
        parts.iter().for_each(|part| part.0.tell(sink));
    }
}

impl<K: Stated, V: Stated> Stated for BTreeMap<K, V> {
    fn tell(&self, sink: &mut dyn StateSink) {
        sink.word(self.len() as u64);
        for (key, value) in self {
            key.tell(sink);
            value.tell(sink);
        }
    }
}

impl<A: Stated, B: Stated> Stated for (A, B) {
    fn tell(&self, sink: &mut dyn StateSink) {
        self.0.tell(sink);
        self.1.tell(sink);
    }
}

impl<A: Stated, B: Stated, C: Stated> Stated for (A, B, C) {
    fn tell(&self, sink: &mut dyn StateSink) {
        self.0.tell(sink);
        self.1.tell(sink);
        self.2.tell(sink);
    }
}

/// Returns the role of a field that consists of listed structs.
pub const fn parts_of<Owner, Part: Listed>(_field: fn(&Owner) -> &Part) -> FieldRole {
    FieldRole::Parts(Part::FIELDS)
}

/// Lists the fields of a struct:
/// `list_state! { Pacing { floor: Run, threshold: Run, since_cycle: Visited } }`.
///
/// The words are those of [`FieldRole`](crate::state::FieldRole), and two more for what is state of the run:
/// `Address`, an address in the heap, and `Visited`, which is told by other code, since it takes the machine
/// around it. `Run by FUNCTION` has a field told by a function of it and the sink.
#[macro_export]
macro_rules! list_state {
    ($owner:ident { $( $field:tt : $role:ident $(by $by:expr)? ),* $(,)? }) => {
        impl $crate::state::Listed for $owner {
            const FIELDS: &'static [$crate::state::Field] = {
                // A field that is not listed is an error here.
                let _ = |whole: &$owner| {
                    let $owner { $( $field: _ ),* } = whole;
                };
                &[ $( $crate::state::Field {
                    name: stringify!($field),
                    role: $crate::list_state!(@role $owner $field $role),
                } ),* ]
            };
        }

        impl $crate::state::Stated for $owner {
            #[allow(unused_variables)]
            fn tell(&self, sink: &mut dyn $crate::state::StateSink) {
                $( $crate::list_state!(@tell self sink $field $role $(by $by)?); )*
            }
        }
    };
    (@role $owner:ident $field:tt Parts) => { $crate::state::parts_of(|whole: &$owner| &whole.$field) };
    (@role $owner:ident $field:tt Address) => { $crate::state::FieldRole::Run };
    (@role $owner:ident $field:tt Visited) => { $crate::state::FieldRole::Run };
    (@role $owner:ident $field:tt $role:ident) => { $crate::state::FieldRole::$role };
    (@tell $self:ident $sink:ident $field:tt Run by $by:expr) => { $by(&$self.$field, $sink) };
    (@tell $self:ident $sink:ident $field:tt Parts by $by:expr) => { $by(&$self.$field, $sink) };
    (@tell $self:ident $sink:ident $field:tt Run) => { $crate::state::Stated::tell(&$self.$field, $sink) };
    (@tell $self:ident $sink:ident $field:tt Parts) => { $crate::state::Stated::tell(&$self.$field, $sink) };
    (@tell $self:ident $sink:ident $field:tt Address) => { $sink.address($self.$field) };
    (@tell $self:ident $sink:ident $field:tt $role:ident) => {};
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Inner {
        count: u32,
        _address: usize,
    }

    struct Outer {
        inner: Vec<Option<Inner>>,
        total: u32,
    }

    struct Single(Inner);

    list_state! { Inner { count: Run, _address: Process } }
    list_state! { Outer { inner: Parts, total: Derived } }
    list_state! { Single { 0: Parts } }

    #[test]
    fn a_list_is_a_tree_of_fields() {
        let inner: &[Field] = &[
            Field { name: "count", role: FieldRole::Run },
            Field { name: "_address", role: FieldRole::Process },
        ];
        assert_eq!(Inner::FIELDS, inner);
        assert_eq!(Outer::FIELDS[0], Field { name: "inner", role: FieldRole::Parts(inner) });
        assert_eq!(Outer::FIELDS[1], Field { name: "total", role: FieldRole::Derived });
        assert_eq!(Single::FIELDS, [Field { name: "0", role: FieldRole::Parts(inner) }]);
        let whole = Outer { inner: vec![Some(Inner { count: 1, _address: 0 })], total: 1 };
        assert_eq!(whole.inner.iter().flatten().map(|inner| inner.count).sum::<u32>(), whole.total);
        assert_eq!(Single(Inner { count: 2, _address: 0 }).0.count, 2);
    }

    impl StateSink for Vec<u64> {
        fn word(&mut self, word: u64) {
            self.push(word);
        }

        fn value(&mut self, value: Value) {
            self.push(value.bits());
        }

        fn address(&mut self, address: usize) {
            self.push(address as u64 % 16);
        }
    }

    #[test]
    fn what_is_state_of_the_run_is_told_in_order() {
        let mut told = Vec::new();
        let inner = vec![Some(Inner { count: 7, _address: 1 }), None];
        Outer { inner, total: 9 }.tell(&mut told);
        Single(Inner { count: 5, _address: 2 }).tell(&mut told);
        assert_eq!(told, [2, 1, 7, 0, 5]);
    }
}
