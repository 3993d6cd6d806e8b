//! Sum, difference, product and quotient of any two numbers.

use esl_heap::Value;

use super::limbs::BigOperand;
use super::{Int, Number, NumberFailure, NumberResult, NumberStop, Numbers, Ratio, limit};

/// Returns `a + b`.
#[inline]
pub fn add(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    if let (Some(x), Some(y)) = (a.as_fixnum(), b.as_fixnum())
        && let Some(result) = Value::fixnum(x + y)
    {
        return Ok(result);
    }
    add_others(numbers, a, b)
}

/// Adds numbers that are not fixnums, or whose sum is not a fixnum.
#[inline(never)]
fn add_others(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return numbers.float_value("+", x + y);
    }
    if let (Some(x), Some(y)) =
        (BigOperand::of(numbers.heap, a, &mut [0]), BigOperand::of(numbers.heap, b, &mut [0]))
    {
        let (negative, limbs) = x.plus(&y);
        numbers.charge(limbs.len());
        return numbers.limbs_value("+", negative, &limbs);
    }
    match operands(numbers, "+", a, b)? {
        Pair::Ints(x, y) => numbers.integer_value("+", &x.plus(&y)),
        Pair::Ratios(x, y) => {
            check_sum(numbers, &x, &y)?;
            numbers.ratio_value("+", &x.plus(&y))
        }
        Pair::Floats(x, y) => numbers.float_value("+", x + y),
    }
}

/// Returns `a - b`.
#[inline]
pub fn subtract(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    if let (Some(x), Some(y)) = (a.as_fixnum(), b.as_fixnum())
        && let Some(result) = Value::fixnum(x - y)
    {
        return Ok(result);
    }
    subtract_others(numbers, a, b)
}

/// Subtracts numbers other than fixnums, and fixnums whose difference is not one.
#[inline(never)]
fn subtract_others(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return numbers.float_value("-", x - y);
    }
    if let (Some(x), Some(y)) =
        (BigOperand::of(numbers.heap, a, &mut [0]), BigOperand::of(numbers.heap, b, &mut [0]))
    {
        let (negative, limbs) = x.plus(&y.negated());
        numbers.charge(limbs.len());
        return numbers.limbs_value("-", negative, &limbs);
    }
    match operands(numbers, "-", a, b)? {
        Pair::Ints(x, y) => numbers.integer_value("-", &x.minus(&y)),
        Pair::Ratios(x, y) => {
            check_sum(numbers, &x, &y)?;
            numbers.ratio_value("-", &x.plus(&y.negated()))
        }
        Pair::Floats(x, y) => numbers.float_value("-", x - y),
    }
}

/// Returns `-a`.
pub fn negate(numbers: &mut Numbers<'_>, a: Value) -> NumberResult {
    match numbers.number(a, "NUMBER")? {
        Number::Int(n) => {
            numbers.charge(n.len());
            numbers.integer_value("-", &n.negated())
        }
        Number::Ratio(r) => {
            numbers.charge(r.len());
            numbers.ratio_value("-", &r.negated())
        }
        Number::Float(x) => Ok(numbers.heap.float(-x)?),
    }
}

/// Returns `a · b`.
pub fn multiply(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return numbers.float_value("*", x * y);
    }
    let sizes = BigOperand::of(numbers.heap, a, &mut [0])
        .zip(BigOperand::of(numbers.heap, b, &mut [0]))
        .map(|(x, y)| (x.bits() + y.bits(), x.len(), y.len()));
    if let Some((bits, left, right)) = sizes {
        numbers.check_bits("*", bits.saturating_sub(1))?;
        numbers.check_work(left, right)?;
        let product = BigOperand::of(numbers.heap, a, &mut [0])
            .zip(BigOperand::of(numbers.heap, b, &mut [0]))
            .and_then(|(x, y)| x.times(&y));
        if let Some((negative, limbs)) = product {
            return numbers.limbs_value("*", negative, &limbs);
        }
    }
    match operands(numbers, "*", a, b)? {
        Pair::Ints(x, y) => numbers.integer_value("*", &x.times(&y)),
        Pair::Ratios(x, y) => {
            check_ratios(numbers, &x, &y)?;
            numbers.ratio_value("*", &x.times(&y))
        }
        Pair::Floats(x, y) => numbers.float_value("*", x * y),
    }
}

/// Returns `a / b`, a ratio where the division of integers leaves a remainder.
pub fn divide(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return float_quotient(numbers, "/", [a, b], x, y);
    }
    match operands(numbers, "/", a, b)? {
        Pair::Ints(_, y) if y.is_zero() => numbers.fail(NumberFailure::DivisionByZero("/", [a, b])),
        Pair::Ints(Int::Small(x), Int::Small(y)) if x.checked_rem(y) == Some(0) => {
            numbers.integer_value("/", &Int::Small(x / y))
        }
        Pair::Ints(x, y) => {
            check_gcd(numbers, x.len(), y.len())?;
            numbers.ratio_value("/", &Ratio::reduced(&x, &y))
        }
        Pair::Ratios(_, y) if y.numerator.is_zero() => {
            numbers.fail(NumberFailure::DivisionByZero("/", [a, b]))
        }
        Pair::Ratios(x, y) => {
            check_ratios(numbers, &x, &y)?;
            numbers.ratio_value("/", &x.times(&y.inverted()))
        }
        Pair::Floats(x, y) => float_quotient(numbers, "/", [a, b], x, y),
    }
}

/// Returns the quotient of the doubles `x` and `y`; `operands` are their values, for the condition of a
/// failure.
pub(crate) fn float_quotient(
    numbers: &mut Numbers<'_>,
    op: &'static str,
    operands: [Value; 2],
    x: f64,
    y: f64,
) -> NumberResult {
    if y == 0.0 && x != 0.0 {
        return numbers.fail(NumberFailure::DivisionByZero(op, operands));
    }
    numbers.float_value(op, x / y)
}

/// Returns two doubles, or a double and a fixnum, as doubles, if neither is an object in the heap.
#[inline]
fn unboxed_doubles(a: Value, b: Value) -> Option<(f64, f64)> {
    match (a.as_fixnum(), b.as_fixnum()) {
        (Some(_), Some(_)) => None,
        (Some(x), None) => Some((x as f64, b.as_double()?)),
        (None, Some(y)) => Some((a.as_double()?, y as f64)),
        (None, None) => Some((a.as_double()?, b.as_double()?)),
    }
}

/// Two numbers of one type.
pub(crate) enum Pair {
    Ints(Int, Int),
    Ratios(Ratio, Ratio),
    Floats(f64, f64),
}

/// Returns the numbers `a` and `b`, converted to one type by contagion.
pub(crate) fn operands(
    numbers: &mut Numbers<'_>,
    op: &'static str,
    a: Value,
    b: Value,
) -> NumberResult<Pair> {
    typed_operands(numbers, op, a, b, "NUMBER")
}

/// As [`operands`], with type errors that name `expected`.
pub(crate) fn typed_operands(
    numbers: &mut Numbers<'_>,
    op: &'static str,
    a: Value,
    b: Value,
    expected: &'static str,
) -> NumberResult<Pair> {
    let (x, y) = (numbers.number(a, expected)?, numbers.number(b, expected)?);
    Ok(match (x, y) {
        (Number::Int(x), Number::Int(y)) => Pair::Ints(x, y),
        (Number::Ratio(x), Number::Ratio(y)) => Pair::Ratios(x, y),
        (Number::Ratio(x), Number::Int(y)) => Pair::Ratios(x, Ratio::integer(y)),
        (Number::Int(x), Number::Ratio(y)) => Pair::Ratios(Ratio::integer(x), y),
        (Number::Float(x), Number::Float(y)) => Pair::Floats(x, y),
        (Number::Float(x), _) => Pair::Floats(x, numbers.double_of(op, b, expected)?),
        (_, Number::Float(y)) => Pair::Floats(numbers.double_of(op, a, expected)?, y),
    })
}

/// Charges for arithmetic on ratios.
///
/// # Errors
/// [`NumberStop::Slowly`] if the parts are too large for one operation.
pub(crate) fn check_ratios(numbers: &mut Numbers<'_>, x: &Ratio, y: &Ratio) -> NumberResult<()> {
    check_gcd(numbers, x.len(), y.len())
}

/// As [`check_ratios`], for a sum. A sum with an integer takes one product and no divisor, so that a ratio
/// plus a fixnum is always within the limit.
fn check_sum(numbers: &mut Numbers<'_>, x: &Ratio, y: &Ratio) -> NumberResult<()> {
    if x.denominator.is_one() || y.denominator.is_one() {
        return numbers.check_work(2 * x.len(), y.len());
    }
    check_ratios(numbers, x, y)
}

/// Charges for a greatest common divisor of integers of `a` and `b` limbs.
///
/// # Errors
/// [`NumberStop::Slowly`] if that is too much work for one operation.
pub fn check_gcd(numbers: &mut Numbers<'_>, a: usize, b: usize) -> NumberResult<()> {
    let (long, short) = (a.max(b), a.min(b));
    if short > limit::GCD_LIMBS || 2 * long.saturating_mul(short) > limit::WORK_LIMIT {
        return Err(NumberStop::Slowly);
    }
    if long > 2 {
        // One division brings both to the size of the shorter; then every limb takes two passes over both.
        numbers.charge((long + 4 * short) * short);
    }
    Ok(())
}
