//! Order and equality of numbers by their exact values.

use std::cmp::Ordering;

use super::limbs::BigOperand;
use super::{Int, Number, Ratio, float, same_value};
use crate::heap::Heap;
use crate::raise::Exit;
use crate::value::Value;
use crate::vm::Vm;

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
pub(crate) fn num_equal(vm: &mut Vm, a: Value, b: Value) -> Result<bool, Exit> {
    if let Some((x, y)) = exact_doubles(a, b) {
        return Ok(x == y);
    }
    for v in [a, b] {
        if !super::is_number(&vm.heap, v) {
            return vm.exchange.type_error(v, "NUMBER");
        }
    }
    Ok(same_value(&vm.heap, a, b))
}

/// Implements `(< a b)`.
pub(crate) fn less(vm: &mut Vm, a: Value, b: Value) -> Result<bool, Exit> {
    Ok(compare(vm, "<", a, b, "REAL")? == Some(Ordering::Less))
}

/// Implements `(<= a b)`.
pub(crate) fn less_or_equal(vm: &mut Vm, a: Value, b: Value) -> Result<bool, Exit> {
    Ok(matches!(compare(vm, "<=", a, b, "REAL")?, Some(Ordering::Less | Ordering::Equal)))
}

/// Returns −1, 0 or 1, as `a` is below, at or above zero.
pub(crate) fn sign(vm: &mut Vm, a: Value, expected: &'static str) -> Result<i32, Exit> {
    match sign_of(&vm.heap, a) {
        Some(sign) => Ok(sign),
        None => vm.exchange.type_error(a, expected),
    }
}

/// As [`sign`]; `None` unless `a` is a number.
pub(crate) fn sign_of(heap: &Heap, a: Value) -> Option<i32> {
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
    vm: &mut Vm,
    op: &'static str,
    a: Value,
    b: Value,
    expected: &'static str,
) -> Result<Option<Ordering>, Exit> {
    if let (Some(x), Some(y)) = (a.as_fixnum(), b.as_fixnum()) {
        return Ok(Some(x.cmp(&y)));
    }
    if let Some((x, y)) = exact_doubles(a, b) {
        return Ok(x.partial_cmp(&y));
    }
    if let (Some(x), Some(y)) = (BigOperand::of(&vm.heap, a, &mut [0]), BigOperand::of(&vm.heap, b, &mut [0]))
    {
        let (order, work) = (x.compare(&y), x.len().min(y.len()));
        vm.exchange.charge(work);
        return Ok(Some(order));
    }
    let (x, y) = (vm.number(a, expected)?, vm.number(b, expected)?);
    Ok(match (&x, &y) {
        (Number::Int(x), Number::Int(y)) => Some(x.compare(y)),
        (Number::Float(x), Number::Float(y)) => x.partial_cmp(y),
        (Number::Float(x), Number::Int(y)) => float_and_int(*x, y),
        (Number::Int(x), Number::Float(y)) => float_and_int(*y, x).map(Ordering::reverse),
        (Number::Float(x), Number::Ratio(y)) => float_and_ratio(vm, op, *x, y)?,
        (Number::Ratio(x), Number::Float(y)) => float_and_ratio(vm, op, *y, x)?.map(Ordering::reverse),
        (Number::Ratio(x), Number::Ratio(y)) => Some(x.compare(vm, op, y)?),
        (Number::Ratio(x), Number::Int(y)) => Some(x.compare(vm, op, &Ratio::integer(y.clone()))?),
        (Number::Int(x), Number::Ratio(y)) => Some(Ratio::integer(x.clone()).compare(vm, op, y)?),
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

fn float_and_ratio(vm: &mut Vm, op: &'static str, x: f64, r: &Ratio) -> Result<Option<Ordering>, Exit> {
    if x.is_finite() { float::rational(x).compare(vm, op, r).map(Some) } else { Ok(x.partial_cmp(&0.0)) }
}
