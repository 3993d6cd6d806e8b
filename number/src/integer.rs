//! Integers of any size, read from and written to values.
//!
//! An [`Int`] is `Small` exactly when it fits 127 bits and a sign: sums and products of fixnums, and most
//! integers of programs beyond them, never touch the native allocator. Above that it is a `BigInt`.
//!
//! Not here: the limits of size and work, which the callers check ([`super::limit`]).

use std::cmp::Ordering;

use esl_heap::{Heap, Value};
use num_bigint::{BigInt, BigUint, Sign};
use num_integer::Integer;
use num_traits::{Signed, ToPrimitive, Zero};
use smallvec::SmallVec;

/// An integer of any size.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Int {
    /// An integer of at most 127 bits and a sign.
    Small(i128),
    /// A longer one.
    Big(BigInt),
}

impl Int {
    /// Zero.
    pub const ZERO: Int = Int::Small(0);
    /// One.
    pub const ONE: Int = Int::Small(1);

    /// Returns the integer that `v` is; `None` for any other value.
    pub fn of(heap: &Heap, v: Value) -> Option<Int> {
        if let Some(n) = v.as_fixnum() {
            return Some(Int::Small(i128::from(n)));
        }
        let big = heap.bignum(v)?;
        let magnitude = match *big.limbs {
            [] => 0,
            [low] => u128::from(low),
            [low, high] if high >> 63 == 0 => u128::from(high) << 64 | u128::from(low),
            _ => {
                let words: SmallVec<[u32; 64]> =
                    big.limbs.iter().flat_map(|&limb| [limb as u32, (limb >> 32) as u32]).collect();
                let sign = if big.negative { Sign::Minus } else { Sign::Plus };
                return Some(Int::from_big(BigInt::from_biguint(sign, BigUint::from_slice(&words))));
            }
        };
        let magnitude = magnitude as i128;
        Some(Int::Small(if big.negative { -magnitude } else { magnitude }))
    }

    /// Returns the integer `n` in its one form.
    pub fn from_big(n: BigInt) -> Int {
        match n.to_i128() {
            Some(small) => Int::Small(small),
            None => Int::Big(n),
        }
    }

    /// Returns the integer as a `BigInt`.
    pub fn to_big(&self) -> BigInt {
        match self {
            Int::Small(n) => BigInt::from(*n),
            Int::Big(n) => n.clone(),
        }
    }

    /// Returns the integer with these limbs, least first.
    pub fn from_limbs(limbs: &[u64]) -> Int {
        match *limbs {
            [] => Int::ZERO,
            [low] => Int::Small(i128::from(low)),
            _ => {
                let words: SmallVec<[u32; 64]> =
                    limbs.iter().flat_map(|&limb| [limb as u32, (limb >> 32) as u32]).collect();
                BigUint::from_slice(&words).into()
            }
        }
    }

    /// Returns whether the integer is negative, and its limbs in the heap's order, least first.
    pub fn limbs(&self) -> (bool, SmallVec<[u64; 8]>) {
        match self {
            Int::Small(n) => {
                let magnitude = n.unsigned_abs();
                (*n < 0, SmallVec::from_slice(&[magnitude as u64, (magnitude >> 64) as u64]))
            }
            Int::Big(n) => (n.is_negative(), n.iter_u64_digits().collect()),
        }
    }

    /// Returns the fixnum; `None` if the integer does not fit.
    pub fn as_fixnum(&self) -> Option<i64> {
        match self {
            Int::Small(n) => {
                i64::try_from(*n).ok().filter(|n| (Value::FIXNUM_MIN..=Value::FIXNUM_MAX).contains(n))
            }
            Int::Big(_) => None,
        }
    }

    /// Returns the length of the magnitude in bits; 0 for zero.
    pub fn bits(&self) -> u64 {
        match self {
            Int::Small(n) => u64::from(128 - n.unsigned_abs().leading_zeros()),
            Int::Big(n) => n.bits(),
        }
    }

    /// Returns the length of the magnitude in limbs of 64 bits, at least 1: the unit of work.
    #[allow(clippy::len_without_is_empty, reason = "a number has at least one limb")]
    pub fn len(&self) -> usize {
        (self.bits() as usize).div_ceil(64).max(1)
    }

    /// Returns whether the integer is zero.
    pub fn is_zero(&self) -> bool {
        matches!(self, Int::Small(0))
    }

    /// Returns whether the integer is one.
    pub fn is_one(&self) -> bool {
        matches!(self, Int::Small(1))
    }

    /// Returns whether the integer is below zero.
    pub fn is_negative(&self) -> bool {
        match self {
            Int::Small(n) => *n < 0,
            Int::Big(n) => n.is_negative(),
        }
    }

    /// Returns whether the integer is odd.
    pub fn is_odd(&self) -> bool {
        match self {
            Int::Small(n) => n & 1 == 1,
            Int::Big(n) => n.is_odd(),
        }
    }

    /// Returns −1, 0 or 1, the sign.
    pub fn signum(&self) -> i32 {
        match self {
            Int::Small(n) => n.signum() as i32,
            Int::Big(n) => {
                if n.is_negative() {
                    -1
                } else {
                    1
                }
            }
        }
    }

    /// Returns the integer with the opposite sign.
    pub fn negated(&self) -> Int {
        match self {
            Int::Small(n) if let Some(negated) = n.checked_neg() => Int::Small(negated),
            _ => Int::from_big(-self.to_big()),
        }
    }

    /// Returns the magnitude.
    pub fn abs(&self) -> Int {
        if self.is_negative() { self.negated() } else { self.clone() }
    }

    /// Returns the sum.
    pub fn plus(&self, other: &Int) -> Int {
        match (self, other) {
            (Int::Small(a), Int::Small(b)) if let Some(sum) = a.checked_add(*b) => Int::Small(sum),
            (Int::Big(a), Int::Big(b)) => Int::from_big(a + b),
            (Int::Big(a), Int::Small(b)) | (Int::Small(b), Int::Big(a)) => Int::from_big(a + *b),
            (Int::Small(a), Int::Small(b)) => Int::from_big(BigInt::from(*a) + *b),
        }
    }

    /// Returns the difference.
    pub fn minus(&self, other: &Int) -> Int {
        match (self, other) {
            (Int::Small(a), Int::Small(b)) if let Some(difference) = a.checked_sub(*b) => {
                Int::Small(difference)
            }
            (Int::Big(a), Int::Big(b)) => Int::from_big(a - b),
            (Int::Big(a), Int::Small(b)) => Int::from_big(a - *b),
            (Int::Small(a), Int::Big(b)) => Int::from_big(*a - b),
            (Int::Small(a), Int::Small(b)) => Int::from_big(BigInt::from(*a) - *b),
        }
    }

    /// Returns the product.
    pub fn times(&self, other: &Int) -> Int {
        match (self, other) {
            (Int::Small(a), Int::Small(b)) if let Some(product) = a.checked_mul(*b) => Int::Small(product),
            (Int::Big(a), Int::Big(b)) => Int::from_big(a * b),
            (Int::Big(a), Int::Small(b)) | (Int::Small(b), Int::Big(a)) => {
                match u64::try_from(b.unsigned_abs()) {
                    Ok(limb) if *b < 0 => Int::from_big(-(a * limb)),
                    Ok(limb) => Int::from_big(a * limb),
                    Err(_) => Int::from_big(a * *b),
                }
            }
            (Int::Small(a), Int::Small(b)) => Int::from_big(BigInt::from(*a) * *b),
        }
    }

    /// Returns the quotient, rounded towards zero, and the remainder. `other` is not zero.
    pub fn div_rem(&self, other: &Int) -> (Int, Int) {
        match (self, other) {
            (Int::Small(a), Int::Small(b)) if let Some(quotient) = a.checked_div(*b) => {
                (Int::Small(quotient), Int::Small(a.wrapping_rem(*b)))
            }
            _ => {
                let (quotient, remainder) = self.to_big().div_rem(&other.to_big());
                (Int::from_big(quotient), Int::from_big(remainder))
            }
        }
    }

    /// Returns the quotient of a division without remainder.
    pub fn exact_quotient(&self, other: &Int) -> Int {
        if other.is_one() { self.clone() } else { self.div_rem(other).0 }
    }

    /// Returns `self · 2^shift`.
    pub fn shifted_left(&self, shift: u64) -> Int {
        match self {
            Int::Small(0) => Int::ZERO,
            Int::Small(n) if self.bits() + shift < 127 => Int::Small(n << shift),
            _ => Int::from_big(self.to_big() << shift),
        }
    }

    /// Returns `self / 2^shift`, rounded down.
    pub fn shifted_right(&self, shift: u64) -> Int {
        match self {
            Int::Small(n) => Int::Small(n >> shift.min(127)),
            Int::Big(n) if shift > n.bits() => Int::Small(if n.is_negative() { -1 } else { 0 }),
            Int::Big(n) => Int::from_big(n >> shift),
        }
    }

    /// Compares with `other`.
    pub fn compare(&self, other: &Int) -> Ordering {
        match (self, other) {
            (Int::Small(a), Int::Small(b)) => a.cmp(b),
            (Int::Big(a), Int::Big(b)) => a.cmp(b),
            (Int::Big(a), Int::Small(_)) => {
                if a.is_negative() {
                    Ordering::Less
                } else {
                    Ordering::Greater
                }
            }
            (Int::Small(_), Int::Big(b)) => {
                if b.is_negative() {
                    Ordering::Greater
                } else {
                    Ordering::Less
                }
            }
        }
    }

    /// Returns the nearest double, halves to even; infinite on overflow.
    pub fn to_f64(&self) -> f64 {
        match self {
            Int::Small(n) => *n as f64,
            Int::Big(n) => {
                // The 126 leading bits decide, with one more that says whether any later bit is set.
                let shift = n.bits() - 126;
                let leading = (n.magnitude() >> shift).to_u128().expect("126 bits fit");
                let sticky = n.magnitude().trailing_zeros().is_some_and(|zeros| zeros < shift);
                let magnitude = super::float::rounded(leading << 1 | u128::from(sticky), shift as i64 - 1);
                if n.is_negative() { -magnitude } else { magnitude }
            }
        }
    }

    /// Returns the integer equal to a finite double without fraction.
    pub fn from_f64(x: f64) -> Int {
        if x.abs() < 2f64.powi(126) {
            return Int::Small(x as i128);
        }
        let (mantissa, exponent) = super::float::decode(x);
        Int::Small(i128::from(mantissa)).shifted_left(exponent as u64)
    }
}

impl From<i64> for Int {
    fn from(n: i64) -> Int {
        Int::Small(i128::from(n))
    }
}

impl From<BigUint> for Int {
    fn from(n: BigUint) -> Int {
        if n.is_zero() { Int::ZERO } else { Int::from_big(BigInt::from(n)) }
    }
}

impl Int {
    /// Returns the integer `n`.
    pub fn from_unsigned(n: u128) -> Int {
        match i128::try_from(n) {
            Ok(n) => Int::Small(n),
            Err(_) => Int::Big(BigInt::from(n)),
        }
    }
}
