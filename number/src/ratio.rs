//! Ratios: quotients of integers in lowest terms.

use std::cmp::Ordering;

use esl_heap::{Heap, Value};

use super::gcd::gcd;
use super::{Int, NumberFailure, NumberResult, Numbers, limit};

/// A quotient of integers; an integer has the denominator 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Ratio {
    /// Numerator, which carries the sign.
    pub numerator: Int,
    /// Denominator; above zero, and coprime to the numerator.
    pub denominator: Int,
}

impl Ratio {
    /// Returns the ratio that `v` is; `None` for any other value.
    pub fn of(heap: &Heap, v: Value) -> Option<Ratio> {
        let (numerator, denominator) = heap.ratio(v)?;
        Some(Ratio { numerator: Int::of(heap, numerator)?, denominator: Int::of(heap, denominator)? })
    }

    /// Returns the integer `n` over 1.
    pub fn integer(n: Int) -> Ratio {
        Ratio { numerator: n, denominator: Int::ONE }
    }

    /// Returns `numerator / denominator` in lowest terms. The denominator is not zero.
    pub fn reduced(numerator: &Int, denominator: &Int) -> Ratio {
        let divisor = gcd(numerator, denominator);
        let divisor = if denominator.is_negative() { divisor.negated() } else { divisor };
        Ratio {
            numerator: numerator.exact_quotient(&divisor),
            denominator: denominator.exact_quotient(&divisor),
        }
    }

    /// Returns the sum.
    pub fn plus(&self, other: &Ratio) -> Ratio {
        // Knuth 4.5.1: these divisors are much smaller than that of the full products.
        let divisor = gcd(&self.denominator, &other.denominator);
        let (left, right) =
            (self.denominator.exact_quotient(&divisor), other.denominator.exact_quotient(&divisor));
        let sum = self.numerator.times(&right).plus(&other.numerator.times(&left));
        if divisor.is_one() {
            return Ratio { numerator: sum, denominator: left.times(&other.denominator) };
        }
        let common = gcd(&sum, &divisor);
        Ratio {
            numerator: sum.exact_quotient(&common),
            denominator: left.times(&other.denominator.exact_quotient(&common)),
        }
    }

    /// Returns the product.
    pub fn times(&self, other: &Ratio) -> Ratio {
        let first = gcd(&self.numerator, &other.denominator);
        let second = gcd(&other.numerator, &self.denominator);
        let numerator = self.numerator.exact_quotient(&first).times(&other.numerator.exact_quotient(&second));
        let denominator =
            self.denominator.exact_quotient(&second).times(&other.denominator.exact_quotient(&first));
        Ratio { numerator, denominator }
    }

    /// Returns the ratio with the opposite sign.
    pub fn negated(&self) -> Ratio {
        Ratio { numerator: self.numerator.negated(), denominator: self.denominator.clone() }
    }

    /// Returns the reciprocal of a ratio that is not zero.
    pub fn inverted(&self) -> Ratio {
        if self.numerator.is_negative() {
            Ratio { numerator: self.denominator.negated(), denominator: self.numerator.negated() }
        } else {
            Ratio { numerator: self.denominator.clone(), denominator: self.numerator.clone() }
        }
    }

    /// Returns the length of the longer part in limbs: the unit of work.
    #[allow(clippy::len_without_is_empty, reason = "a number has at least one limb")]
    pub fn len(&self) -> usize {
        self.numerator.len().max(self.denominator.len())
    }

    /// Returns the nearest double, halves to even; infinite on overflow.
    pub fn to_f64(&self) -> f64 {
        if self.denominator.is_one() {
            return self.numerator.to_f64();
        }
        // A quotient of at least 66 bits, and whether there was a remainder, determine the one rounding.
        let shift = 66 + self.denominator.bits() as i64 - self.numerator.bits() as i64;
        let (mut numerator, mut denominator) = (self.numerator.abs(), self.denominator.clone());
        if shift > 0 {
            numerator = numerator.shifted_left(shift as u64);
        } else {
            denominator = denominator.shifted_left(shift.unsigned_abs());
        }
        let (quotient, remainder) = numerator.div_rem(&denominator);
        let Int::Small(quotient) = quotient else { unreachable!("the quotient has at most 67 bits") };
        let leading = (quotient as u128) << 1 | u128::from(!remainder.is_zero());
        let magnitude = super::float::rounded(leading, -shift - 1);
        if self.numerator.is_negative() { -magnitude } else { magnitude }
    }

    /// Compares with `other`. Fails as operation `op` if that takes too much work.
    pub fn compare(
        &self,
        numbers: &mut Numbers<'_>,
        op: &'static str,
        other: &Ratio,
    ) -> NumberResult<Ordering> {
        let (left, right) = (self.numerator.signum(), other.numerator.signum());
        if left != right || left == 0 {
            return Ok(left.cmp(&right));
        }
        // a/b against c/d is a·d against c·b; the lengths of these products often decide.
        let low = (self.numerator.bits() + other.denominator.bits()) as i64;
        let high = (other.numerator.bits() + self.denominator.bits()) as i64;
        if (low - high).abs() > 1 {
            let by_size = low.cmp(&high);
            return Ok(if left < 0 { by_size.reverse() } else { by_size });
        }
        let work =
            self.numerator.len() * other.denominator.len() + other.numerator.len() * self.denominator.len();
        if work > limit::WORK_LIMIT {
            let text = format!("ratios of {low} bits that are nearly equal are too large to be compared");
            return numbers.fail(NumberFailure::Arithmetic(op, text));
        }
        numbers.charge(work);
        Ok(self.numerator.times(&other.denominator).compare(&other.numerator.times(&self.denominator)))
    }
}
