//! Sums, differences, products and shifts of magnitudes in the heap's representation: limbs of 64 bits, least
//! first.
//!
//! Most operations on big integers are sums, or products with a small factor. Here they work on the heap's
//! limbs directly, without a conversion and without native allocation. Products of two long numbers are left
//! to `num-bigint`, whose algorithms are subquadratic.

use std::cmp::Ordering;

use esl_heap::{Heap, Value};
use smallvec::SmallVec;

use super::{NumberResult, Numbers};

/// Limbs of a result; up to 24 stay on the native stack.
pub(crate) type Limbs = SmallVec<[u64; 24]>;

/// Number of limbs of which the room for a long result is a multiple.
const ROUNDED: usize = 1024;

/// Greatest length, in limbs, of the shorter factor of a product; longer ones are for `num-bigint`.
const SCHOOL_LIMBS: usize = 32;

/// An integer in the heap, or a fixnum in the same form.
pub(crate) struct BigOperand<'a> {
    negative: bool,
    limbs: &'a [u64],
}

impl<'a> BigOperand<'a> {
    /// Returns the integer that `v` is; `None` for any other value. `room` holds the limb of a fixnum.
    #[inline]
    pub(crate) fn of(heap: &'a Heap, v: Value, room: &'a mut [u64; 1]) -> Option<BigOperand<'a>> {
        if let Some(n) = v.as_fixnum() {
            room[0] = n.unsigned_abs();
            return Some(BigOperand { negative: n < 0, limbs: if n == 0 { &[] } else { room } });
        }
        let big = heap.bignum(v)?;
        Some(BigOperand { negative: big.negative, limbs: big.limbs })
    }

    /// Returns the number of limbs, at least 1.
    pub(crate) fn len(&self) -> usize {
        self.limbs.len().max(1)
    }

    /// Returns the length of the magnitude in bits.
    pub(crate) fn bits(&self) -> u64 {
        self.limbs.last().map_or(0, |last| 64 * self.limbs.len() as u64 - u64::from(last.leading_zeros()))
    }

    /// Returns whether the integer is below zero.
    pub(crate) fn is_negative(&self) -> bool {
        self.negative
    }

    /// Returns the magnitude times `2^shift`.
    pub(crate) fn shifted_left(&self, shift: u64) -> Limbs {
        shifted_left(self.limbs, shift)
    }

    /// Returns `size` bits of the magnitude from bit `position` up.
    pub(crate) fn field(&self, position: u64, size: u64) -> Limbs {
        field(self.limbs, position, size)
    }

    /// Compares with `other`.
    pub(crate) fn compare(&self, other: &BigOperand<'_>) -> Ordering {
        let lengths = self.limbs.len().cmp(&other.limbs.len());
        let magnitudes = lengths.then_with(|| self.limbs.iter().rev().cmp(other.limbs.iter().rev()));
        match (self.negative, other.negative) {
            (false, false) => magnitudes,
            (true, true) => magnitudes.reverse(),
            (false, true) => Ordering::Greater,
            (true, false) => Ordering::Less,
        }
    }

    /// Returns the operand with the opposite sign.
    pub(crate) fn negated(self) -> BigOperand<'a> {
        BigOperand { negative: !self.negative, limbs: self.limbs }
    }

    /// Returns the sum: whether it is negative, and its magnitude.
    pub(crate) fn plus(&self, other: &BigOperand<'_>) -> (bool, Limbs) {
        if self.negative == other.negative {
            return (self.negative, sum(self.limbs, other.limbs));
        }
        if is_less(self.limbs, other.limbs) {
            (other.negative, difference(other.limbs, self.limbs))
        } else {
            (self.negative, difference(self.limbs, other.limbs))
        }
    }

    /// Returns the product (whether it is negative, and its magnitude), unless both numbers are long.
    pub(crate) fn times(&self, other: &BigOperand<'_>) -> Option<(bool, Limbs)> {
        let (long, short) = if self.limbs.len() < other.limbs.len() { (other, self) } else { (self, other) };
        if short.limbs.len() > SCHOOL_LIMBS {
            return None;
        }
        Some((self.negative != other.negative, product(long.limbs, short.limbs)))
    }
}

fn is_less(a: &[u64], b: &[u64]) -> bool {
    a.len() < b.len() || a.len() == b.len() && a.iter().rev().lt(b.iter().rev())
}

/// Returns no limbs, with room for so many.
fn with_room(limbs: usize) -> Limbs {
    // The result is copied into the heap while these are there. If the next one is a little longer, it is to
    // fit where these have been; otherwise a hole remains beside each number.
    Limbs::with_capacity(if limbs < ROUNDED { limbs } else { limbs.next_multiple_of(ROUNDED) })
}

fn sum(a: &[u64], b: &[u64]) -> Limbs {
    let (long, short) = if a.len() < b.len() { (b, a) } else { (a, b) };
    let mut result = with_room(long.len() + 1);
    let mut carry = false;
    for (i, &limb) in long.iter().enumerate() {
        let (partial, over) = limb.overflowing_add(short.get(i).copied().unwrap_or(0));
        let (total, over_again) = partial.overflowing_add(u64::from(carry));
        carry = over | over_again;
        result.push(total);
    }
    if carry {
        result.push(1);
    }
    result
}

/// Returns `a - b`, where `a` is not less.
fn difference(a: &[u64], b: &[u64]) -> Limbs {
    let mut result = with_room(a.len());
    let mut borrow = false;
    for (i, &limb) in a.iter().enumerate() {
        let (partial, under) = limb.overflowing_sub(b.get(i).copied().unwrap_or(0));
        let (total, under_again) = partial.overflowing_sub(u64::from(borrow));
        borrow = under | under_again;
        result.push(total);
    }
    debug_assert!(!borrow, "the first is not less");
    result
}

/// Returns `a · 2^shift`. The number of limbs of the result must fit in memory.
fn shifted_left(a: &[u64], shift: u64) -> Limbs {
    let (zeros, offset) = ((shift / 64) as usize, shift % 64);
    let mut result = with_room(zeros + a.len() + 1);
    result.resize(zeros, 0);
    if offset == 0 {
        result.extend_from_slice(a);
        return result;
    }
    let mut below = 0;
    for &limb in a {
        result.push(limb << offset | below);
        below = limb >> (64 - offset);
    }
    result.push(below);
    result
}

/// Returns `size` bits of `a` from bit `position` up.
fn field(a: &[u64], position: u64, size: u64) -> Limbs {
    let (first, offset) = (usize::try_from(position / 64).unwrap_or(usize::MAX), position % 64);
    let Some(a) = a.get(first..) else { return Limbs::new() };
    let count = usize::try_from(size.div_ceil(64)).unwrap_or(usize::MAX).min(a.len());
    let mut result = Limbs::from_slice(&a[..count]);
    if offset != 0 {
        let above = a.iter().skip(1).copied().chain([0]);
        for (limb, above) in result.iter_mut().zip(above) {
            *limb = *limb >> offset | above << (64 - offset);
        }
    }
    // `count` limbs may hold more bits than the field.
    let excess = (64 * count as u64).saturating_sub(size);
    if let Some(last) = result.last_mut() {
        *last &= u64::MAX >> excess;
    }
    result
}

fn product(long: &[u64], short: &[u64]) -> Limbs {
    let mut result = Limbs::from_elem(0, long.len() + short.len());
    for (offset, &factor) in short.iter().enumerate() {
        let mut carry = 0;
        for (slot, &limb) in result[offset..].iter_mut().zip(long) {
            let total = u128::from(limb) * u128::from(factor) + u128::from(*slot) + u128::from(carry);
            *slot = total as u64;
            carry = (total >> 64) as u64;
        }
        result[offset + long.len()] = carry;
    }
    result
}

impl Numbers<'_> {
    /// Returns the integer with this sign and magnitude as a value. Fails as operation `op` if it has too
    /// many bits.
    pub fn limbs_value(&mut self, op: &'static str, negative: bool, limbs: &[u64]) -> NumberResult {
        let significant = limbs.iter().rposition(|&limb| limb != 0).map_or(0, |last| last + 1);
        let limbs = &limbs[..significant];
        match *limbs {
            [] => return Ok(Value::small(0)),
            [limb] if limb <= Value::FIXNUM_MIN.unsigned_abs() => {
                let n = if negative { (limb as i64).wrapping_neg() } else { limb as i64 };
                if let Some(n) = Value::fixnum(n) {
                    return Ok(n);
                }
            }
            [.., last] => self.check_bits(op, 64 * limbs.len() as u64 - u64::from(last.leading_zeros()))?,
        }
        Ok(self.heap.alloc_bignum(negative, limbs)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_bigint::BigUint;
    use proptest::prelude::*;

    fn magnitude() -> impl Strategy<Value = Vec<u64>> {
        let limb = prop_oneof![Just(0), Just(1), Just(u64::MAX), any::<u64>()];
        prop::collection::vec(limb, 0..40).prop_map(|mut limbs| {
            while limbs.last() == Some(&0) {
                limbs.pop();
            }
            limbs
        })
    }

    fn big(limbs: &[u64]) -> BigUint {
        BigUint::new(limbs.iter().flat_map(|&limb| [limb as u32, (limb >> 32) as u32]).collect())
    }

    proptest! {
        #[test]
        fn agrees_with_num_bigint(a in magnitude(), b in magnitude()) {
            prop_assert_eq!(big(&sum(&a, &b)), big(&a) + big(&b));
            let (high, low) = if is_less(&a, &b) { (&b, &a) } else { (&a, &b) };
            prop_assert_eq!(is_less(&a, &b), big(&a) < big(&b));
            prop_assert_eq!(big(&difference(high, low)), big(high) - big(low));
            prop_assert_eq!(big(&product(&a, &b)), big(&a) * big(&b));
            let order = big(&a).cmp(&big(&b));
            for (negative, expected) in [(false, order), (true, order.reverse())] {
                let (a, b) = (BigOperand { negative, limbs: &a }, BigOperand { negative, limbs: &b });
                prop_assert_eq!(a.compare(&b), expected);
            }
        }

        #[test]
        fn shifts_agree_with_num_bigint(a in magnitude(), shift in 0u64..300, size in 0u64..300) {
            prop_assert_eq!(big(&shifted_left(&a, shift)), big(&a) << shift);
            let mask = (BigUint::from(1u32) << size) - 1u32;
            prop_assert_eq!(big(&field(&a, shift, size)), (big(&a) >> shift) & mask);
            prop_assert_eq!(big(&field(&a, shift, u64::MAX)), big(&a) >> shift);
            prop_assert!(field(&a, u64::MAX, u64::MAX).is_empty());
        }
    }
}
