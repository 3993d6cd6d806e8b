//! Sum, difference, product and quotient of any two numbers.

use super::limbs::BigOperand;
use super::{Int, Number, Ratio, limit};
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// Returns `a + b`.
#[inline]
pub(crate) fn add(vm: &mut Vm, a: Value, b: Value) -> Outcome {
    if let (Some(x), Some(y)) = (a.as_fixnum(), b.as_fixnum())
        && let Some(result) = Value::fixnum(x + y)
    {
        return Ok(result);
    }
    add_others(vm, a, b)
}

/// Adds what are no fixnums, or have no fixnum for their sum.
#[inline(never)]
fn add_others(vm: &mut Vm, a: Value, b: Value) -> Outcome {
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return vm.float_value("+", x + y);
    }
    if let (Some(x), Some(y)) = (BigOperand::of(&vm.heap, a, &mut [0]), BigOperand::of(&vm.heap, b, &mut [0]))
    {
        let (negative, limbs) = x.plus(&y);
        vm.exchange.charge(limbs.len());
        return vm.limbs_value("+", negative, &limbs);
    }
    match operands(vm, "+", a, b)? {
        Pair::Ints(x, y) => vm.integer_value("+", &x.plus(&y)),
        Pair::Ratios(x, y) => {
            check_sum(vm, &x, &y)?;
            vm.ratio_value("+", &x.plus(&y))
        }
        Pair::Floats(x, y) => vm.float_value("+", x + y),
    }
}

/// Returns `a - b`.
pub(crate) fn subtract(vm: &mut Vm, a: Value, b: Value) -> Outcome {
    if let (Some(x), Some(y)) = (a.as_fixnum(), b.as_fixnum())
        && let Some(result) = Value::fixnum(x - y)
    {
        return Ok(result);
    }
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return vm.float_value("-", x - y);
    }
    if let (Some(x), Some(y)) = (BigOperand::of(&vm.heap, a, &mut [0]), BigOperand::of(&vm.heap, b, &mut [0]))
    {
        let (negative, limbs) = x.plus(&y.negated());
        vm.exchange.charge(limbs.len());
        return vm.limbs_value("-", negative, &limbs);
    }
    match operands(vm, "-", a, b)? {
        Pair::Ints(x, y) => vm.integer_value("-", &x.minus(&y)),
        Pair::Ratios(x, y) => {
            check_sum(vm, &x, &y)?;
            vm.ratio_value("-", &x.plus(&y.negated()))
        }
        Pair::Floats(x, y) => vm.float_value("-", x - y),
    }
}

/// Returns `-a`.
pub(crate) fn negate(vm: &mut Vm, a: Value) -> Outcome {
    match vm.number(a, "NUMBER")? {
        Number::Int(n) => {
            vm.exchange.charge(n.len());
            vm.integer_value("-", &n.negated())
        }
        Number::Ratio(r) => {
            vm.exchange.charge(r.len());
            vm.ratio_value("-", &r.negated())
        }
        Number::Float(x) => Ok(vm.heap.float(-x)?),
    }
}

/// Returns `a · b`.
pub(crate) fn multiply(vm: &mut Vm, a: Value, b: Value) -> Outcome {
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return vm.float_value("*", x * y);
    }
    let sizes = BigOperand::of(&vm.heap, a, &mut [0])
        .zip(BigOperand::of(&vm.heap, b, &mut [0]))
        .map(|(x, y)| (x.bits() + y.bits(), x.len(), y.len()));
    if let Some((bits, left, right)) = sizes {
        vm.check_bits("*", bits.saturating_sub(1))?;
        vm.check_work(left, right)?;
        let product = BigOperand::of(&vm.heap, a, &mut [0])
            .zip(BigOperand::of(&vm.heap, b, &mut [0]))
            .and_then(|(x, y)| x.times(&y));
        if let Some((negative, limbs)) = product {
            return vm.limbs_value("*", negative, &limbs);
        }
    }
    match operands(vm, "*", a, b)? {
        Pair::Ints(x, y) => vm.integer_value("*", &x.times(&y)),
        Pair::Ratios(x, y) => {
            check_ratios(vm, &x, &y)?;
            vm.ratio_value("*", &x.times(&y))
        }
        Pair::Floats(x, y) => vm.float_value("*", x * y),
    }
}

/// Returns `a / b`, a ratio where the division of integers leaves a remainder.
pub(crate) fn divide(vm: &mut Vm, a: Value, b: Value) -> Outcome {
    if let Some((x, y)) = unboxed_doubles(a, b) {
        return float_quotient(vm, "/", [a, b], x, y);
    }
    match operands(vm, "/", a, b)? {
        Pair::Ints(_, y) if y.is_zero() => vm.exchange.raise(Raised::DivisionByZero("/", [a, b])),
        Pair::Ints(Int::Small(x), Int::Small(y)) if x.checked_rem(y) == Some(0) => {
            vm.integer_value("/", &Int::Small(x / y))
        }
        Pair::Ints(x, y) => {
            check_gcd(vm, x.len(), y.len())?;
            vm.ratio_value("/", &Ratio::reduced(&x, &y))
        }
        Pair::Ratios(_, y) if y.numerator.is_zero() => vm.exchange.raise(Raised::DivisionByZero("/", [a, b])),
        Pair::Ratios(x, y) => {
            check_ratios(vm, &x, &y)?;
            vm.ratio_value("/", &x.times(&y.inverted()))
        }
        Pair::Floats(x, y) => float_quotient(vm, "/", [a, b], x, y),
    }
}

/// Returns the quotient of the doubles `x` and `y`; `operands` are their values, for the condition of a
/// failure.
pub(crate) fn float_quotient(vm: &mut Vm, op: &'static str, operands: [Value; 2], x: f64, y: f64) -> Outcome {
    if y == 0.0 && x != 0.0 {
        return vm.exchange.raise(Raised::DivisionByZero(op, operands));
    }
    vm.float_value(op, x / y)
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
pub(crate) fn operands(vm: &mut Vm, op: &'static str, a: Value, b: Value) -> Result<Pair, Exit> {
    typed_operands(vm, op, a, b, "NUMBER")
}

/// As [`operands`], with type errors that name `expected`.
pub(crate) fn typed_operands(
    vm: &mut Vm,
    op: &'static str,
    a: Value,
    b: Value,
    expected: &'static str,
) -> Result<Pair, Exit> {
    let (x, y) = (vm.number(a, expected)?, vm.number(b, expected)?);
    Ok(match (x, y) {
        (Number::Int(x), Number::Int(y)) => Pair::Ints(x, y),
        (Number::Ratio(x), Number::Ratio(y)) => Pair::Ratios(x, y),
        (Number::Ratio(x), Number::Int(y)) => Pair::Ratios(x, Ratio::integer(y)),
        (Number::Int(x), Number::Ratio(y)) => Pair::Ratios(Ratio::integer(x), y),
        (Number::Float(x), Number::Float(y)) => Pair::Floats(x, y),
        (Number::Float(x), _) => Pair::Floats(x, vm.double_of(op, b, expected)?),
        (_, Number::Float(y)) => Pair::Floats(vm.double_of(op, a, expected)?, y),
    })
}

/// Charges for arithmetic on ratios.
///
/// # Errors
/// [`Exit::Slowly`] if the parts are too large for one operation.
pub(crate) fn check_ratios(vm: &mut Vm, x: &Ratio, y: &Ratio) -> Result<(), Exit> {
    check_gcd(vm, x.len(), y.len())
}

/// As [`check_ratios`], for a sum. A sum with an integer takes one product and no divisor, so that a ratio
/// plus a fixnum is always within the limit.
fn check_sum(vm: &mut Vm, x: &Ratio, y: &Ratio) -> Result<(), Exit> {
    if x.denominator.is_one() || y.denominator.is_one() {
        return vm.check_work(2 * x.len(), y.len());
    }
    check_ratios(vm, x, y)
}

/// Charges for a greatest common divisor of integers of `a` and `b` limbs.
///
/// # Errors
/// [`Exit::Slowly`] if that is too much work for one operation.
pub(crate) fn check_gcd(vm: &mut Vm, a: usize, b: usize) -> Result<(), Exit> {
    let (long, short) = (a.max(b), a.min(b));
    if short > limit::GCD_LIMBS || 2 * long.saturating_mul(short) > limit::WORK_LIMIT {
        return Err(Exit::Slowly);
    }
    if long > 2 {
        // One division brings both to the size of the shorter; then every limb takes two passes over both.
        vm.exchange.charge((long + 4 * short) * short);
    }
    Ok(())
}
