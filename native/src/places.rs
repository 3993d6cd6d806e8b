//! Sets of registers, and which of them are not in their places in the stack.

/// A set of registers of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct RegisterBits([u64; 4]);

impl RegisterBits {
    pub(crate) const NONE: RegisterBits = RegisterBits([0; 4]);

    /// Returns the registers from `first` on.
    pub(crate) fn all_from(first: u8) -> RegisterBits {
        let mut registers = RegisterBits::NONE;
        registers.insert_range(usize::from(first), 256 - usize::from(first));
        registers
    }

    pub(crate) fn contains(self, register: usize) -> bool {
        self.0.get(register / 64).is_some_and(|word| word >> (register % 64) & 1 != 0)
    }

    pub(crate) fn insert(&mut self, register: usize) {
        if let Some(word) = self.0.get_mut(register / 64) {
            *word |= 1 << (register % 64);
        }
    }

    pub(crate) fn remove(&mut self, register: usize) {
        if let Some(word) = self.0.get_mut(register / 64) {
            *word &= !(1 << (register % 64));
        }
    }

    pub(crate) fn insert_range(&mut self, first: usize, count: usize) {
        (first..first + count).for_each(|register| self.insert(register));
    }

    pub(crate) fn remove_range(&mut self, first: usize, count: usize) {
        (first..first + count).for_each(|register| self.remove(register));
    }

    /// Returns those that are in `others` too.
    pub(crate) fn within(self, others: RegisterBits) -> RegisterBits {
        self.without(RegisterBits(others.0.map(|word| !word)))
    }

    /// Returns those that are not in `others`.
    pub(crate) fn without(mut self, others: RegisterBits) -> RegisterBits {
        for (word, less) in self.0.iter_mut().zip(others.0) {
            *word &= !less;
        }
        self
    }

    /// Inserts all of `others`; returns whether that changed anything.
    pub(crate) fn unite(&mut self, others: RegisterBits) -> bool {
        let before = *self;
        for (word, more) in self.0.iter_mut().zip(others.0) {
            *word |= more;
        }
        *self != before
    }

    /// Returns the bits, 64 registers in each word.
    pub(crate) fn words(self) -> [u64; 4] {
        self.0
    }

    pub(crate) fn iter(self) -> impl Iterator<Item = usize> {
        (0..256).filter(move |&register| self.contains(register))
    }
}

/// A side exit: where machine code is left, and the doubles to be saved before that. Equal side exits share a
/// block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct SideExit {
    /// Word of the instruction that the interpreter does next.
    pub(crate) at: usize,
    /// One of the statuses of `abi`.
    pub(crate) status: u64,
    /// Registers that are unspilled, or may be.
    pub(crate) unspilled: RegisterBits,
}
