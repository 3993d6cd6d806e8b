//! Symbols and constants of a file, read in place.

use num_bigint::BigInt;

use crate::module::{FunctionNumber, PoolIdx};

/// Where a symbol of a file is at home.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SymbolHome {
    /// In the package of this number; [`ModuleImage::packages`](super::ModuleImage::packages) has the names.
    Package(u32),
    /// Nowhere; the number tells apart the uninterned symbols of the file.
    Uninterned(u32),
}

/// A symbol of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SymbolRecord<'a> {
    /// Where it is at home.
    pub home: SymbolHome,
    /// Name of the package.
    pub name: &'a str,
}

/// A constant of a file. Symbols are given by their number in the file.
#[derive(Clone, Debug, PartialEq)]
pub enum ConstantRecord<'a> {
    /// `NIL`.
    Nil,
    /// `T`.
    True,
    /// A symbol other than these.
    Symbol(u32),
    /// An integer of 64 bits.
    Fixnum(i64),
    /// A larger integer.
    Integer(BigInt),
    /// Numerator and denominator.
    Ratio(BigInt, BigInt),
    /// A double float.
    Float(f64),
    /// A character.
    Character(char),
    /// A string.
    String(&'a str),
    /// A pair of earlier constants.
    Cons(PoolIdx, PoolIdx),
    /// A simple vector of earlier constants.
    Vector(PoolIndexes<'a>),
    /// Dimensions and elements of an array.
    Array(Vec<u32>, PoolIndexes<'a>),
    /// A function.
    Function(FunctionNumber),
    /// The structure class that this symbol names.
    Class(u32),
}

/// Constants as they are listed in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoolIndexes<'a>(pub(super) &'a [[u8; 4]]);

impl<'a> PoolIndexes<'a> {
    /// Returns how many there are.
    pub fn len(self) -> usize {
        self.0.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(self) -> bool {
        self.0.is_empty()
    }

    /// Returns the one with this position.
    pub fn get(self, position: usize) -> Option<PoolIdx> {
        self.0.get(position).map(|word| PoolIdx(u32::from_le_bytes(*word)))
    }

    /// One after the other.
    pub fn iter(self) -> impl DoubleEndedIterator<Item = PoolIdx> + ExactSizeIterator + 'a {
        self.0.iter().map(|word| PoolIdx(u32::from_le_bytes(*word)))
    }
}
