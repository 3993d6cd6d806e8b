//! Division with an integer quotient: `floor`, `ceiling`, `truncate`, `round`, `mod`, `rem`.
//!
//! On floats, the quotient is the truncated float quotient, and the remainder is computed from it, as in
//! SBCL; so `(floor 1.0 0.1)` is 10, although the double 0.1 is slightly more than a tenth.

use std::cmp::Ordering;

use esl_heap::Value;

use super::arithmetic::{Pair, check_ratios, typed_operands};
use super::{Int, NumberFailure, NumberResult, Numbers, Ratio};

/// The choice of an integer near a quotient.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// The greatest integer not above it.
    Floor,
    /// The least integer not below it.
    Ceiling,
    /// Integer part.
    Truncate,
    /// The nearest integer; halves go to the even one.
    Round,
}

impl Rounding {
    /// Returns the correction of the truncated quotient of a division that left a remainder: −1, 0 or 1.
    ///
    /// `half` compares twice the remainder with the divisor, both without sign.
    fn step(self, remainder_negative: bool, divisor_negative: bool, is_odd: bool, half: Ordering) -> i32 {
        let outward = if remainder_negative == divisor_negative { 1 } else { -1 };
        match self {
            Rounding::Truncate => 0,
            Rounding::Floor => outward.min(0),
            Rounding::Ceiling => outward.max(0),
            Rounding::Round => match half {
                Ordering::Less => 0,
                Ordering::Equal => {
                    if is_odd {
                        outward
                    } else {
                        0
                    }
                }
                Ordering::Greater => outward,
            },
        }
    }
}

/// An integer quotient and the remainder that goes with it.
enum Division {
    Ints(Int, Int),
    Ratio(Int, Ratio),
    Float(Int, f64),
}

impl Division {
    fn quotient(&self) -> &Int {
        match self {
            Division::Ints(quotient, _) | Division::Ratio(quotient, _) | Division::Float(quotient, _) => {
                quotient
            }
        }
    }
}

/// Returns the remainder of `floor`.
pub fn modulo(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    rest(numbers, Rounding::Floor, a, b)
}

/// Returns the remainder of `truncate`.
pub fn remainder(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult {
    rest(numbers, Rounding::Truncate, a, b)
}

/// Returns quotient and remainder.
pub fn both(numbers: &mut Numbers<'_>, rounding: Rounding, a: Value, b: Value) -> NumberResult<[Value; 2]> {
    let division = match small(rounding, a, b) {
        Some((quotient, remainder)) => Division::Ints(quotient, remainder),
        None => division(numbers, rounding, a, b)?,
    };
    let quotient = numbers.integer_value("/", division.quotient())?;
    let remainder = remainder_value(numbers, division)?;
    Ok([quotient, remainder])
}

/// Returns the quotient as a float, and the remainder: `ffloor` and its family.
///
/// The quotient of floats may be minus zero, but for `fround`, whose quotient is that of `round`.
pub fn both_with_float(
    numbers: &mut Numbers<'_>,
    rounding: Rounding,
    a: Value,
    b: Value,
) -> NumberResult<[Value; 2]> {
    let (quotient, remainder) = match real_operands(numbers, a, b)? {
        Pair::Floats(x, y) if rounding != Rounding::Round => {
            let whole = float_quotient(numbers, [a, b], x, y)?.trunc();
            let (step, remainder) = float_remainder(rounding, x, y, whole);
            // A zero added would take the sign of minus zero away.
            let quotient = if step == 0 { whole } else { whole + f64::from(step) };
            (quotient, numbers.float_value("/", remainder)?)
        }
        operands => {
            let division = divide(numbers, rounding, [a, b], operands)?;
            (division.quotient().to_f64(), remainder_value(numbers, division)?)
        }
    };
    let quotient = numbers.float_value("/", quotient)?;
    Ok([quotient, remainder])
}

fn rest(numbers: &mut Numbers<'_>, rounding: Rounding, a: Value, b: Value) -> NumberResult {
    if let Some((_, remainder)) = small(rounding, a, b) {
        return numbers.integer_value("/", &remainder);
    }
    let division = division(numbers, rounding, a, b)?;
    remainder_value(numbers, division)
}

fn remainder_value(numbers: &mut Numbers<'_>, division: Division) -> NumberResult {
    match division {
        Division::Ints(_, remainder) => numbers.integer_value("/", &remainder),
        Division::Ratio(_, remainder) => numbers.ratio_value("/", &remainder),
        Division::Float(_, remainder) => numbers.float_value("/", remainder),
    }
}

/// Divides fixnums; `None` for other values and for a divisor of zero.
fn small(rounding: Rounding, a: Value, b: Value) -> Option<(Int, Int)> {
    let (a, b) = (a.as_fixnum()?, b.as_fixnum().filter(|&b| b != 0)?);
    let (mut quotient, mut remainder) = (a / b, a % b);
    if remainder != 0 {
        let half = (2 * remainder.unsigned_abs()).cmp(&b.unsigned_abs());
        let step = i64::from(rounding.step(remainder < 0, b < 0, quotient & 1 == 1, half));
        quotient += step;
        remainder -= step * b;
    }
    Some((Int::from(quotient), Int::from(remainder)))
}

fn division(numbers: &mut Numbers<'_>, rounding: Rounding, a: Value, b: Value) -> NumberResult<Division> {
    let operands = real_operands(numbers, a, b)?;
    divide(numbers, rounding, [a, b], operands)
}

fn real_operands(numbers: &mut Numbers<'_>, a: Value, b: Value) -> NumberResult<Pair> {
    if let Some(x) = a.as_double()
        && let Some(y) = b.as_double().or_else(|| b.as_fixnum().map(|n| n as f64))
    {
        return Ok(Pair::Floats(x, y));
    }
    typed_operands(numbers, "/", a, b, "REAL")
}

/// Divides numbers of one type, which the values `operands` are.
fn divide(
    numbers: &mut Numbers<'_>,
    rounding: Rounding,
    operands: [Value; 2],
    pair: Pair,
) -> NumberResult<Division> {
    match pair {
        Pair::Ints(_, y) if y.is_zero() => numbers.fail(NumberFailure::DivisionByZero("/", operands)),
        Pair::Ints(x, y) => {
            let (quotient, remainder) = int_division(numbers, rounding, &x, &y)?;
            Ok(Division::Ints(quotient, remainder))
        }
        Pair::Ratios(_, y) if y.numerator.is_zero() => {
            numbers.fail(NumberFailure::DivisionByZero("/", operands))
        }
        Pair::Ratios(x, y) => {
            check_ratios(numbers, &x, &y)?;
            // x / y is the integer quotient n / d; its remainder belongs over the common denominator.
            let n = x.numerator.times(&y.denominator);
            let d = x.denominator.times(&y.numerator);
            let (quotient, remainder) = int_division(numbers, rounding, &n, &d)?;
            Ok(Division::Ratio(quotient, Ratio::reduced(&remainder, &x.denominator.times(&y.denominator))))
        }
        Pair::Floats(x, y) => {
            // An integer quotient has no minus zero, so that the remainder of minus zero is minus zero.
            let whole = float_quotient(numbers, operands, x, y)?.trunc() + 0.0;
            let (step, remainder) = float_remainder(rounding, x, y, whole);
            Ok(Division::Float(Int::from_f64(whole).plus(&Int::from(i64::from(step))), remainder))
        }
    }
}

fn int_division(numbers: &mut Numbers<'_>, rounding: Rounding, a: &Int, b: &Int) -> NumberResult<(Int, Int)> {
    numbers.check_work(2 * (a.len() + 1).saturating_sub(b.len()), b.len())?;
    numbers.charge(a.len() + b.len());
    let (quotient, remainder) = a.div_rem(b);
    if remainder.is_zero() || rounding == Rounding::Truncate {
        return Ok((quotient, remainder));
    }
    let half = remainder.abs().shifted_left(1).compare(&b.abs());
    let step = rounding.step(remainder.is_negative(), b.is_negative(), quotient.is_odd(), half);
    Ok(match step {
        0 => (quotient, remainder),
        1 => (quotient.plus(&Int::ONE), remainder.minus(b)),
        _ => (quotient.minus(&Int::ONE), remainder.plus(b)),
    })
}

/// Returns the quotient of the doubles `x` and `y`, which the values `operands` are.
fn float_quotient(numbers: &mut Numbers<'_>, operands: [Value; 2], x: f64, y: f64) -> NumberResult<f64> {
    if y == 0.0 && x != 0.0 {
        return numbers.fail(NumberFailure::DivisionByZero("/", operands));
    }
    let quotient = x / y;
    if !quotient.is_finite() {
        return numbers.float_value("/", quotient).map(|_| unreachable!("the value is not finite"));
    }
    Ok(quotient)
}

/// Returns the correction of the truncated quotient `whole` of two doubles, and the remainder that goes with
/// it.
fn float_remainder(rounding: Rounding, x: f64, y: f64, whole: f64) -> (i32, f64) {
    let remainder = x - whole * y;
    if remainder == 0.0 {
        return (0, remainder);
    }
    let half = (2.0 * remainder.abs()).partial_cmp(&y.abs()).unwrap_or(Ordering::Less);
    // The rounded quotient may exceed the exact one; the sign of the remainder then names the wrong side.
    let is_negative = if rounding == Rounding::Round { remainder < 0.0 } else { x < 0.0 };
    let step = rounding.step(is_negative, y < 0.0, whole % 2.0 != 0.0, half);
    (step, remainder - f64::from(step) * y)
}
