//! The known contents of the registers of a frame at one place of its code.

use smallvec::SmallVec;

/// A set of registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RegisterSet([u64; 4]);

impl RegisterSet {
    fn place(register: u8) -> (usize, u64) {
        (usize::from(register >> 6), 1 << (register & 63))
    }

    fn contains(self, register: u8) -> bool {
        let (word, bit) = RegisterSet::place(register);
        self.0[word] & bit != 0
    }

    pub(super) fn insert(&mut self, register: u8) {
        let (word, bit) = RegisterSet::place(register);
        self.0[word] |= bit;
    }

    pub(super) fn remove(&mut self, register: u8) {
        let (word, bit) = RegisterSet::place(register);
        self.0[word] &= !bit;
    }

    fn keep_below(&mut self, end: u8) {
        let (word, bit) = RegisterSet::place(end);
        self.0[word] &= bit - 1;
        self.0[word + 1..].fill(0);
    }

    /// Returns the first register that is in neither `some` nor `others`.
    fn first_outside(self, some: RegisterSet, others: RegisterSet) -> Option<u8> {
        let rest = |word: usize| self.0[word] & !(some.0[word] | others.0[word]);
        (0..self.0.len()).find_map(|word| match rest(word) {
            0 => None,
            bits => Some((word << 6) as u8 + bits.trailing_zeros() as u8),
        })
    }

    /// Removes what is not in `other`; says whether that was anything.
    fn intersect(&mut self, other: RegisterSet) -> bool {
        let before = *self;
        for (word, &mask) in self.0.iter_mut().zip(&other.0) {
            *word &= mask;
        }
        *self != before
    }
}

/// Known contents of a register that may be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Class {
    /// An object of the program.
    Value,
    /// A box of `make-box`.
    Box,
    /// An argument, or the marker that there was none.
    MaybeUnsupplied,
}

/// Known contents of each register, and of the value list. Less is known after paths join.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Registers {
    values: RegisterSet,
    boxes: RegisterSet,
    maybe_unsupplied: RegisterSet,
    /// Registers with a closure that this frame has made, and of which function of the module, where that
    /// matters.
    closures: SmallVec<[(u8, u32); 2]>,
    /// Whether this frame has set the value list.
    pub(super) value_list: bool,
}

impl Registers {
    /// Returns the contents of `register`; `None` when they are not known.
    pub(super) fn class(&self, register: u8) -> Option<Class> {
        if self.values.contains(register) {
            Some(Class::Value)
        } else if self.boxes.contains(register) {
            Some(Class::Box)
        } else if self.maybe_unsupplied.contains(register) {
            Some(Class::MaybeUnsupplied)
        } else {
            None
        }
    }

    /// Returns the first of `registers` in which neither an object of the program nor a box is known to be.
    pub(super) fn first_unknown(&self, registers: RegisterSet) -> Option<u8> {
        registers.first_outside(self.values, self.boxes)
    }

    /// `register` now holds something of `class`, or nothing that is known. Says whether something else was
    /// known.
    pub(super) fn set(&mut self, register: u8, class: Option<Class>) -> bool {
        let before = self.class(register);
        let closures = self.closures.len();
        self.closures.retain(|&mut (holder, _)| holder != register);
        for set in [&mut self.values, &mut self.boxes, &mut self.maybe_unsupplied] {
            set.remove(register);
        }
        match class {
            Some(Class::Value) => self.values.insert(register),
            Some(Class::Box) => self.boxes.insert(register),
            Some(Class::MaybeUnsupplied) => self.maybe_unsupplied.insert(register),
            None => {}
        }
        (before.is_some() && before != class) || self.closures.len() < closures
    }

    /// `register` holds a closure of `function`, made by this frame.
    pub(super) fn note_closure(&mut self, register: u8, function: u32) {
        self.closures.push((register, function));
        self.closures.sort_unstable();
    }

    /// Returns the function whose closure, made by this frame, is in `register`, if that is known.
    pub(super) fn closure(&self, register: u8) -> Option<u32> {
        self.closures.iter().find(|&&(holder, _)| holder == register).map(|&(_, function)| function)
    }

    /// Nothing is known of the registers from `end` on.
    pub(super) fn keep_below(&mut self, end: u8) {
        for set in [&mut self.values, &mut self.boxes, &mut self.maybe_unsupplied] {
            set.keep_below(end);
        }
        self.closures.retain(|&mut (holder, _)| holder < end);
    }

    /// Only what holds in `other` too is known; says whether anything is not any more.
    pub(super) fn meet(&mut self, other: &Registers) -> bool {
        let mut changed = self.values.intersect(other.values);
        changed |= self.boxes.intersect(other.boxes);
        changed |= self.maybe_unsupplied.intersect(other.maybe_unsupplied);
        let closures = self.closures.len();
        self.closures.retain(|known| other.closures.binary_search(known).is_ok());
        changed |= self.closures.len() < closures;
        changed |= self.value_list && !other.value_list;
        self.value_list &= other.value_list;
        changed
    }

    /// Roughly how much memory this takes, beside its fixed size.
    pub(super) fn weight(&self) -> usize {
        self.closures.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_from_an_end_on_are_forgotten() {
        for end in [0, 1, 63, 64, 65, 128, 200, 255] {
            let mut registers = Registers::default();
            for register in 0..=255 {
                registers.set(register, Some(Class::Value));
            }
            registers.keep_below(end);
            for register in 0..=255 {
                assert_eq!(registers.class(register).is_some(), register < end, "{register} below {end}");
            }
        }
    }

    #[test]
    fn registers_that_differ_are_unknown_where_paths_join() {
        let mut one = Registers::default();
        let mut other = Registers::default();
        one.set(3, Some(Class::Value));
        other.set(3, Some(Class::Box));
        one.set(4, Some(Class::Box));
        other.set(4, Some(Class::Box));
        assert!(one.meet(&other));
        assert_eq!((one.class(3), one.class(4)), (None, Some(Class::Box)));
        assert!(!one.meet(&other));
    }
}
