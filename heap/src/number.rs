//! Numbers as the heap holds them: which values are numbers, and when two of them are equal.
//!
//! Comparisons look at the words and limbs in place; nothing is allocated or rounded.
//!
//! Guarantees: [`eql`] and [`same_value`] are exact for integers, ratios and doubles of any size. They rely
//! on numbers being normalized: an integer that fits a fixnum is one, a ratio is in lowest terms with a
//! denominator above 1.
//!
//! Not here: order and arithmetic, which the virtual machine does.

use crate::heap::{Heap, Kind};
use crate::value::Value;

/// Returns whether `v` is an integer.
pub fn is_integer(heap: &Heap, v: Value) -> bool {
    v.is_fixnum() || heap.is(v, Kind::Bignum)
}

/// Returns whether `v` is an integer or a ratio.
pub fn is_rational(heap: &Heap, v: Value) -> bool {
    v.is_fixnum() || matches!(heap.kind(v), Some(Kind::Bignum | Kind::Ratio))
}

/// Returns whether `v` is a double.
pub fn is_float(heap: &Heap, v: Value) -> bool {
    v.as_double().is_some() || heap.is(v, Kind::Float)
}

/// Returns whether `v` is a number.
pub fn is_number(heap: &Heap, v: Value) -> bool {
    is_real(heap, v) || heap.is(v, Kind::Complex)
}

/// Returns whether `v` is a number other than a complex one.
pub fn is_real(heap: &Heap, v: Value) -> bool {
    v.is_fixnum()
        || v.as_double().is_some()
        || matches!(heap.kind(v), Some(Kind::Bignum | Kind::Ratio | Kind::Float))
}

/// Returns whether `a` and `b` are the same object, or numbers of one type with one value. The sign of zero
/// counts.
#[inline]
pub fn eql(heap: &Heap, a: Value, b: Value) -> bool {
    a == b || a.is_object() && b.is_object() && boxed_eql(heap, a, b)
}

#[cold]
fn boxed_eql(heap: &Heap, a: Value, b: Value) -> bool {
    let kind = heap.kind(a);
    if kind != heap.kind(b) {
        return false;
    }
    match kind {
        Some(Kind::Float) => heap.as_double(a).map(f64::to_bits) == heap.as_double(b).map(f64::to_bits),
        Some(Kind::Bignum) => heap.bignum(a) == heap.bignum(b),
        Some(Kind::Ratio) => match (heap.ratio(a), heap.ratio(b)) {
            // The parts are integers, so the recursion is one level deep.
            (Some((a, b)), Some((c, d))) => eql(heap, a, c) && eql(heap, b, d),
            _ => false,
        },
        Some(Kind::Complex) => match (heap.complex(a), heap.complex(b)) {
            (Some((a, b)), Some((c, d))) => eql(heap, a, c) && eql(heap, b, d),
            _ => false,
        },
        _ => false,
    }
}

/// Returns whether `a` and `b` are numbers of one value, whatever their types.
pub fn same_value(heap: &Heap, a: Value, b: Value) -> bool {
    match (heap.complex(a), heap.complex(b)) {
        (None, None) => {}
        (Some((a, b)), Some((c, d))) => return same_value(heap, a, c) && same_value(heap, b, d),
        (Some((real, imaginary)), None) => return is_like(heap, real, imaginary, b),
        (None, Some((real, imaginary))) => return is_like(heap, real, imaginary, a),
    }
    match (heap.as_double(a), heap.as_double(b)) {
        (Some(x), Some(y)) => x == y,
        (Some(x), None) => exact_double(heap, b) == Some(x),
        (None, Some(y)) => exact_double(heap, a) == Some(y),
        // Rationals of equal value are `eql`.
        (None, None) => is_number(heap, a) && eql(heap, a, b),
    }
}

/// Returns whether a complex number with these parts has the value of `v`, which is not a complex number.
fn is_like(heap: &Heap, real: Value, imaginary: Value, v: Value) -> bool {
    is_zero(heap, imaginary) && same_value(heap, real, v)
}

/// Returns whether a number is zero.
pub fn is_zero(heap: &Heap, v: Value) -> bool {
    match heap.complex(v) {
        // The parts are real, so the recursion is one level deep.
        Some((real, imaginary)) => is_zero(heap, real) && is_zero(heap, imaginary),
        None => same_value(heap, v, Value::small(0)),
    }
}

/// Returns the double that equals `v`, if `v` is a number and there is one.
pub(crate) fn exact_double(heap: &Heap, v: Value) -> Option<f64> {
    if let Some(x) = heap.as_double(v) {
        return Some(x);
    }
    let (mut room_above, mut room_below) = ([0], [0]);
    let Some((numerator, denominator)) = heap.ratio(v) else {
        let (is_negative, integer) = magnitude(heap, v, &mut room_above)?;
        return scaled(is_negative, integer, 0);
    };
    // The denominator of a double is a power of two.
    let (_, below) = magnitude(heap, denominator, &mut room_below)?;
    let shift = trailing_zeros(below);
    if shift + 1 != bit_length(below) {
        return None;
    }
    let (is_negative, above) = magnitude(heap, numerator, &mut room_above)?;
    scaled(is_negative, above, -(shift as i64))
}

/// Returns whether an integer is below zero, and its magnitude in limbs, least first. `room` holds the limb
/// of a fixnum.
fn magnitude<'a>(heap: &'a Heap, v: Value, room: &'a mut [u64; 1]) -> Option<(bool, &'a [u64])> {
    if let Some(n) = v.as_fixnum() {
        room[0] = n.unsigned_abs();
        return Some((n < 0, room));
    }
    let big = heap.bignum(v)?;
    Some((big.negative, big.limbs))
}

/// Returns the double `±magnitude · 2^exponent`, if there is one of just that value.
fn scaled(is_negative: bool, magnitude: &[u64], exponent: i64) -> Option<f64> {
    let (length, zeros) = (bit_length(magnitude), trailing_zeros(magnitude));
    if length == 0 {
        return Some(0.0);
    }
    let (lowest, highest) = (zeros as i64 + exponent, length as i64 - 1 + exponent);
    if length - zeros > 53 || lowest < -1074 || highest > 1023 {
        return None;
    }
    let (limb, shift) = (zeros / 64, zeros % 64);
    let low = magnitude[limb] >> shift;
    let high = if shift == 0 { 0 } else { magnitude.get(limb + 1).map_or(0, |limb| limb << (64 - shift)) };
    // Both factors are doubles, and so is their product.
    let x = (low | high) as f64 * power_of_two(lowest);
    Some(if is_negative { -x } else { x })
}

/// Returns `2^exponent`, for exponents from −1074 to 1023.
fn power_of_two(exponent: i64) -> f64 {
    match exponent {
        ..-1022 => f64::from_bits(1 << (exponent + 1074)),
        _ => f64::from_bits(((exponent + 1023) as u64) << 52),
    }
}

/// Returns the number of bits of a magnitude; 0 for zero.
fn bit_length(magnitude: &[u64]) -> usize {
    let last = magnitude.iter().rposition(|&limb| limb != 0);
    last.map_or(0, |last| 64 * (last + 1) - magnitude[last].leading_zeros() as usize)
}

/// Returns the number of zero bits below the lowest one bit; 0 for zero.
fn trailing_zeros(magnitude: &[u64]) -> usize {
    let first = magnitude.iter().position(|&limb| limb != 0);
    first.map_or(0, |first| 64 * first + magnitude[first].trailing_zeros() as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An integer with these limbs, a fixnum where it fits.
    fn integer(heap: &mut Heap, is_negative: bool, limbs: &[u64]) -> Value {
        let small = match *limbs {
            [low] => i64::try_from(low).ok().and_then(|n| Value::fixnum(if is_negative { -n } else { n })),
            _ => None,
        };
        small.unwrap_or_else(|| heap.alloc_bignum(is_negative, limbs).unwrap())
    }

    #[track_caller]
    fn check_integer(limbs: &[u64], double: Option<f64>) {
        let mut heap = Heap::for_tests();
        for is_negative in [false, true] {
            let n = integer(&mut heap, is_negative, limbs);
            let expected = double.map(|x| if is_negative { -x } else { x });
            assert_eq!(exact_double(&heap, n), expected, "{limbs:?}");
            if let Some(x) = expected {
                let x = heap.float(x).unwrap();
                assert!(same_value(&heap, n, x) && same_value(&heap, x, n) && !eql(&heap, n, x));
            }
        }
    }

    #[track_caller]
    fn check_ratio(numerator: i32, denominator: &[u64], double: Option<f64>) {
        let mut heap = Heap::for_tests();
        let denominator = integer(&mut heap, false, denominator);
        let ratio = heap.alloc_ratio(Value::small(numerator), denominator).unwrap();
        assert_eq!(exact_double(&heap, ratio), double, "{numerator}/{denominator:?}");
    }

    #[test]
    fn integers_equal_the_doubles_of_their_value_only() {
        check_integer(&[1], Some(1.0));
        check_integer(&[(1 << 53) - 1], Some(9_007_199_254_740_991.0));
        check_integer(&[(1 << 53) + 1], None);
        check_integer(&[(1 << 53) + 2], Some(9_007_199_254_740_994.0));
        check_integer(&[1 << 63], Some(9_223_372_036_854_775_808.0));
        check_integer(&[0, 1], Some(18_446_744_073_709_551_616.0));
        check_integer(&[1, 1], None);
        check_integer(&[3 << 62, 5], Some(4_611_686_018_427_387_904.0 * 23.0));
        let mut limbs = [0; 16];
        limbs[15] = 0xFFFF_FFFF_FFFF_F800;
        check_integer(&limbs, Some(f64::MAX));
        limbs[15] = 0xFFFF_FFFF_FFFF_FC00;
        check_integer(&limbs, None);
        check_integer(&[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1], None);
    }

    #[test]
    fn ratios_equal_the_doubles_of_their_value_only() {
        check_ratio(1, &[2], Some(0.5));
        check_ratio(-3, &[8], Some(-0.375));
        check_ratio(1, &[3], None);
        check_ratio(5, &[0, 1], Some(5.0 / 18_446_744_073_709_551_616.0));
        let mut limbs = [0; 17];
        limbs[16] = 1 << 50;
        check_ratio(1, &limbs, Some(f64::from_bits(1)));
        check_ratio(3, &limbs, Some(f64::from_bits(3)));
        limbs[16] = 1 << 51;
        check_ratio(1, &limbs, None);
    }

    #[test]
    fn zeros_infinities_and_other_things() {
        let heap = Heap::for_tests();
        let zero = Value::small(0);
        assert!(same_value(&heap, zero, Value::NEGATIVE_ZERO));
        assert!(same_value(&heap, Value::POSITIVE_ZERO, Value::NEGATIVE_ZERO));
        assert!(!eql(&heap, Value::POSITIVE_ZERO, Value::NEGATIVE_ZERO));
        assert!(!same_value(&heap, Value::NAN, Value::NAN));
        assert!(!same_value(&heap, Value::T, Value::T) && !same_value(&heap, Value::T, zero));
        assert!(is_number(&heap, zero) && is_rational(&heap, zero) && is_integer(&heap, zero));
        assert!(is_float(&heap, Value::NAN) && !is_number(&heap, Value::NIL));
    }
}
