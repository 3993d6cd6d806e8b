//! Order and equality of numbers by their exact values.

use std::cmp::Ordering;

use esl_heap::{Heap, Value};

use super::limbs::BigOperand;
use super::{Int, Number, NumberResult, Numbers, Ratio, float, same_value};

/// Returns both numbers as doubles of exactly their values, if neither is an object in the heap.
#[inline]
fn exact_doubles(a: Value, b: Value) -> Option<(f64, f64)> {
    let exact = |v: Value| match v.as_fixnum() {
        Some(n) if n.unsigned_abs() <= 1 << 53 => Some(n as f64),
        Some(_) => None,
        None => v.as_double(),
    };
    Some((exact(a)?, exact(b)?))
}

/// Implements `(= a b)`.
#[inline]
pub fn num_equal(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult<bool> {
    if let Some((x, y)) = exact_doubles(a, b) {
        return Ok(x == y);
    }
    for v in [a, b] {
        if !super::is_number(numbers.heap, v) {
            return numbers.type_error(v, "NUMBER");
        }
    }
    Ok(same_value(numbers.heap, a, b))
}

/// Implements `(< a b)`.
#[inline]
pub fn less(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult<bool> {
    Ok(compare(numbers, "<", a, b, "REAL")? == Some(Ordering::Less))
}

/// Implements `(<= a b)`.
#[inline]
pub fn less_or_equal(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult<bool> {
    Ok(matches!(compare(numbers, "<=", a, b, "REAL")?, Some(Ordering::Less | Ordering::Equal)))
}

/// Returns −1, 0 or 1, as `a` is below, at or above zero.
#[inline]
pub fn sign(numbers: &mut Numbers<'_>, a: Value, expected: &'static str) -> NumberResult<i32> {
    match sign_of(numbers.heap, a) {
        Some(sign) => Ok(sign),
        None => numbers.type_error(a, expected),
    }
}

/// As [`sign`]; `None` unless `a` is a number.
#[inline]
pub fn sign_of(heap: &Heap, a: Value) -> Option<i32> {
    if let Some(n) = a.as_fixnum() {
        return Some(n.signum() as i32);
    }
    if let Some(big) = heap.bignum(a) {
        return Some(if big.negative { -1 } else { 1 });
    }
    if let Some((numerator, _)) = heap.ratio(a) {
        return sign_of(heap, numerator);
    }
    let x = heap.as_double(a)?;
    Some(i32::from(x > 0.0) - i32::from(x < 0.0))
}

/// Compares `a` with `b`; `None` if one of them is a NaN.
fn compare(
    numbers: &mut Numbers<'_>,
    op: &'static str,
    a: Value,
    b: Value,
    expected: &'static str,
) -> NumberResult<Option<Ordering>> {
    if let (Some(x), Some(y)) = (a.as_fixnum(), b.as_fixnum()) {
        return Ok(Some(x.cmp(&y)));
    }
    if let Some((x, y)) = exact_doubles(a, b) {
        return Ok(x.partial_cmp(&y));
    }
    if let (Some(x), Some(y)) =
        (BigOperand::of(numbers.heap, a, &mut [0]), BigOperand::of(numbers.heap, b, &mut [0]))
    {
        let (order, work) = (x.compare(&y), x.len().min(y.len()));
        numbers.charge(work);
        return Ok(Some(order));
    }
    let (x, y) = (numbers.number(a, expected)?, numbers.number(b, expected)?);
    Ok(match (&x, &y) {
        (Number::Int(x), Number::Int(y)) => Some(x.compare(y)),
        (Number::Float(x), Number::Float(y)) => x.partial_cmp(y),
        (Number::Float(x), Number::Int(y)) => float_and_int(*x, y),
        (Number::Int(x), Number::Float(y)) => float_and_int(*y, x).map(Ordering::reverse),
        (Number::Float(x), Number::Ratio(y)) => float_and_ratio(numbers, op, *x, y)?,
        (Number::Ratio(x), Number::Float(y)) => float_and_ratio(numbers, op, *y, x)?.map(Ordering::reverse),
        (Number::Ratio(x), Number::Ratio(y)) => Some(x.compare(numbers, op, y)?),
        (Number::Ratio(x), Number::Int(y)) => Some(x.compare(numbers, op, &Ratio::integer(y.clone()))?),
        (Number::Int(x), Number::Ratio(y)) => Some(Ratio::integer(x.clone()).compare(numbers, op, y)?),
    })
}

fn float_and_int(x: f64, n: &Int) -> Option<Ordering> {
    match n {
        // Integers below 2^53 are exact as doubles.
        Int::Small(n) if n.unsigned_abs() < 1 << 53 => x.partial_cmp(&(*n as f64)),
        _ if !x.is_finite() => x.partial_cmp(&0.0),
        _ => {
            let whole = x.trunc();
            let order = Int::from_f64(whole).compare(n);
            Some(if order == Ordering::Equal { x.total_cmp(&whole) } else { order })
        }
    }
}

fn float_and_ratio(
    numbers: &mut Numbers<'_>,
    op: &'static str,
    x: f64,
    r: &Ratio,
) -> NumberResult<Option<Ordering>> {
    if x.is_finite() { float::rational(x).compare(numbers, op, r).map(Some) } else { Ok(x.partial_cmp(&0.0)) }
}
