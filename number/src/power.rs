//! Powers, roots, exponentials and logarithms.
//!
//! Powers of exact numbers with an integer exponent are exact; all other results are doubles. Where the
//! result is a complex number, these functions leave the work to their ESL twins.

use esl_heap::Value;
use num_traits::Pow;

use super::limit::{self, BIT_LIMIT};
use super::{Int, Number, NumberFailure, NumberResult, NumberStop, Numbers, Ratio, float, transcendental};

/// Implements `(expt base power)`.
pub fn expt(numbers: &mut Numbers<'_>, base: Value, power: Value) -> NumberResult {
    let (x, y) = (numbers.number(base, "NUMBER")?, numbers.number(power, "NUMBER")?);
    match (x, y) {
        (x, Number::Int(y)) if y.is_zero() => match x {
            Number::Float(_) => Ok(numbers.heap.float(1.0)?),
            _ => Ok(Value::small(1)),
        },
        (Number::Int(x), Number::Int(y)) => {
            if x.is_zero() && y.is_negative() {
                return numbers.fail(NumberFailure::DivisionByZero("EXPT", [base, power]));
            }
            let result = int_power(numbers, &x, &y.abs())?;
            let result = Ratio::integer(result);
            numbers.ratio_value("EXPT", &if y.is_negative() { result.inverted() } else { result })
        }
        (Number::Ratio(x), Number::Int(y)) => {
            let magnitude = y.abs();
            let numerator = int_power(numbers, &x.numerator, &magnitude)?;
            let denominator = int_power(numbers, &x.denominator, &magnitude)?;
            let result = Ratio { numerator, denominator };
            numbers.ratio_value("EXPT", &if y.is_negative() { result.inverted() } else { result })
        }
        (Number::Float(x), Number::Int(y)) if !y.to_f64().is_finite() => {
            // The power has a limit unless it grows beyond the doubles.
            if x == 0.0 && y.is_negative() {
                return numbers.fail(NumberFailure::DivisionByZero("EXPT", [base, power]));
            }
            let magnitude = transcendental::pow(x.abs(), y.to_f64());
            let is_negative = x.is_sign_negative() && y.is_odd();
            numbers.float_value("EXPT", if is_negative { -magnitude } else { magnitude })
        }
        (_, y) => {
            let (bits, x) = parts(numbers, base, "NUMBER")?;
            let is_float = matches!(y, Number::Float(_));
            let sign = super::sign(numbers, power, "NUMBER")?;
            let y = numbers.double_of("EXPT", power, "NUMBER")?;
            if y == 0.0 && sign != 0 && x == 0.0 {
                // The power is too small for a double, and is not zero.
                return real_power(numbers, [base, power], is_float, x, f64::from(sign));
            }
            if bits == 0 {
                return real_power(numbers, [base, power], is_float, x, y);
            }
            if x < 0.0 && y.fract() != 0.0 {
                return Err(NumberStop::Slowly);
            }
            let exponent = y * bits as f64;
            let power = transcendental::pow(x, y) * transcendental::pow(2.0, exponent.fract());
            numbers.float_value("EXPT", float::scaled(power, exponent.trunc() as i64))
        }
    }
}

/// Returns a real number as `(bits, x)`, meaning `x · 2^bits`; `bits` is 0 unless the number is beyond the
/// doubles.
pub(crate) fn parts(numbers: &mut Numbers<'_>, v: Value, expected: &'static str) -> NumberResult<(i64, f64)> {
    if let Some(x) = v.as_double().or_else(|| v.as_fixnum().map(|n| n as f64)) {
        return Ok((0, x));
    }
    let ratio = match numbers.number(v, expected)? {
        Number::Float(x) => return Ok((0, x)),
        Number::Int(n) => Ratio::integer(n),
        Number::Ratio(r) => r,
    };
    let is_negative = ratio.numerator.is_negative();
    let (bits, x) = scaled(&Ratio { numerator: ratio.numerator.abs(), denominator: ratio.denominator });
    Ok((bits as i64, if is_negative { -x } else { x }))
}

/// Returns an integer to the power of an exponent that is not negative. 0 to the power of 0 is 1.
fn int_power(numbers: &mut Numbers<'_>, base: &Int, exponent: &Int) -> NumberResult<Int> {
    if base.is_one() || exponent.is_zero() {
        return Ok(Int::ONE);
    }
    if base.is_zero() {
        return Ok(Int::ZERO);
    }
    if *base == Int::Small(-1) {
        return Ok(if exponent.is_odd() { base.clone() } else { Int::ONE });
    }
    // The magnitude is at least 2^(bits - 1), so the power has more than (bits - 1)·exponent bits.
    let exponent = exponent.as_fixnum().map_or(BIT_LIMIT + 1, |exponent| exponent.unsigned_abs());
    let zeros = base.trailing_zeros();
    let odd = base.shifted_right(zeros);
    let least_bits = (base.bits() - 1).saturating_mul(exponent).saturating_add(1);
    numbers.check_bits("EXPT", least_bits)?;
    let limbs = (odd.bits().saturating_mul(exponent) as usize).div_ceil(64);
    // The last product has factors of half the length; all others together cost a third of it.
    numbers.check_work(limbs / 2 + 1, if odd.bits() == 1 { 1 } else { limbs / 2 + 1 })?;
    let power = match odd {
        Int::Small(1) => Int::ONE,
        Int::Small(-1) => Int::Small(if exponent & 1 == 1 { -1 } else { 1 }),
        odd => {
            let exponent = u32::try_from(exponent).expect("the limit of bits is far below");
            match &odd {
                Int::Small(n) if let Some(power) = n.checked_pow(exponent) => Int::Small(power),
                odd => Int::from_big(Pow::pow(odd.to_big(), exponent)),
            }
        }
    };
    let shift = zeros * exponent;
    numbers.check_bits("EXPT", power.bits() + shift)?;
    numbers.charge(shift as usize / 64);
    Ok(power.shifted_left(shift))
}

fn real_power(
    numbers: &mut Numbers<'_>,
    operands: [Value; 2],
    is_float: bool,
    x: f64,
    y: f64,
) -> NumberResult {
    if x == 0.0 && y == 0.0 && is_float {
        return numbers.fail(NumberFailure::Arithmetic(
            "EXPT",
            "zero to the power of a zero float has no value".into(),
        ));
    }
    if x == 0.0 && y < 0.0 {
        return numbers.fail(NumberFailure::DivisionByZero("EXPT", operands));
    }
    if x < 0.0 && y.fract() != 0.0 {
        return Err(NumberStop::Slowly);
    }
    numbers.float_value("EXPT", transcendental::pow(x, y))
}

/// Implements `(sqrt a)`.
pub fn sqrt(numbers: &mut Numbers<'_>, a: Value) -> NumberResult {
    let (bits, x) = parts(numbers, a, "NUMBER")?;
    if x < 0.0 {
        return Err(NumberStop::Slowly);
    }
    if bits == 0 {
        return numbers.float_value("SQRT", x.sqrt());
    }
    // The exponent is halved, so it must be even.
    let (half, odd) = (bits.div_euclid(2), bits.rem_euclid(2));
    numbers.float_value("SQRT", float::scaled(float::scaled(x, odd).sqrt(), half))
}

/// Implements `(isqrt a)`: the greatest integer whose square is at most `a`.
pub fn isqrt(numbers: &mut Numbers<'_>, a: Value) -> NumberResult {
    match Int::of(numbers.heap, a) {
        Some(n) if !n.is_negative() => {
            if n.len() > limit::ROOT_LIMBS {
                return Err(NumberStop::Slowly);
            }
            numbers.charge(4 * n.len() * n.len());
            let root = match n {
                Int::Small(n) => Int::from_unsigned(n.unsigned_abs().isqrt()),
                Int::Big(n) => Int::from_big(n.sqrt()),
            };
            numbers.integer_value("ISQRT", &root)
        }
        _ => numbers.type_error(a, "UNSIGNED-BYTE"),
    }
}

/// Implements `(exp a)`.
pub fn exp(numbers: &mut Numbers<'_>, a: Value) -> NumberResult {
    let x = numbers.nearest_double(a, "NUMBER")?;
    numbers.float_value("EXP", transcendental::exp(x))
}

/// The natural logarithm of 2 in two parts. The first has so few bits that its product with a bit count is
/// exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// Implements `(log a)`.
pub fn log(numbers: &mut Numbers<'_>, a: Value) -> NumberResult {
    let (bits, x) = log_parts(numbers, a)?;
    numbers.float_value("LOG", natural_log(bits, x))
}

/// Returns the natural logarithm of `x · 2^bits`.
fn natural_log(bits: f64, x: f64) -> f64 {
    (transcendental::log(x) + bits * LN_2_LOW) + bits * LN_2_HIGH
}

/// Implements `(log a base)`.
pub fn log_in_base(numbers: &mut Numbers<'_>, a: Value, base: Value) -> NumberResult {
    numbers.number(a, "NUMBER")?;
    numbers.number(base, "NUMBER")?;
    if super::sign(numbers, base, "NUMBER")? == 0 {
        return Ok(Value::POSITIVE_ZERO);
    }
    let (a_bits, x) = log_parts(numbers, a)?;
    let (base_bits, y) = log_parts(numbers, base)?;
    if let Some(power) = exact_log(numbers, a, base) {
        return numbers.float_value("LOG", power);
    }
    let (numerator, denominator) = (natural_log(a_bits, x), natural_log(base_bits, y));
    if denominator == 0.0 {
        return numbers.fail(NumberFailure::DivisionByZero("LOG", [a, base]));
    }
    numbers.float_value("LOG", numerator / denominator)
}

/// Returns a number above zero as `(bits, x)`, meaning `x · 2^bits`; `bits` is 0 unless the number is beyond
/// the doubles.
fn log_parts(numbers: &mut Numbers<'_>, a: Value) -> NumberResult<(f64, f64)> {
    let number = numbers.number(a, "NUMBER")?;
    let (is_zero, is_negative) = match &number {
        Number::Int(n) => (n.is_zero(), n.is_negative()),
        Number::Ratio(r) => (false, r.numerator.is_negative()),
        Number::Float(x) => (*x == 0.0, *x < 0.0),
    };
    if is_zero {
        return numbers.fail(NumberFailure::DivisionByZero("LOG", [a, Value::small(0)]));
    }
    if is_negative {
        return Err(NumberStop::Slowly);
    }
    Ok(match number {
        Number::Float(x) => (0.0, x),
        Number::Int(n) => scaled(&Ratio::integer(n)),
        Number::Ratio(r) => scaled(&r),
    })
}

/// Returns a ratio above zero as `(bits, x)`, meaning `x · 2^bits`.
fn scaled(r: &Ratio) -> (f64, f64) {
    let x = r.to_f64();
    if x.is_normal() {
        return (0.0, x);
    }
    // A double holds no more of a quotient than the leading bits of both parts determine.
    let cut = |n: &Int| n.bits().saturating_sub(120);
    let (above, below) = (cut(&r.numerator), cut(&r.denominator));
    let leading = |n: &Int, cut: u64| n.shifted_right(cut).to_f64();
    let x = leading(&r.numerator, above) / leading(&r.denominator, below);
    (above as f64 - below as f64, x)
}

/// Returns the exponent if `a` is a power of `base` and both are integers; a quotient of rounded logarithms
/// may miss it.
fn exact_log(numbers: &Numbers<'_>, a: Value, base: Value) -> Option<f64> {
    let (a, base) = (Int::of(numbers.heap, a)?, Int::of(numbers.heap, base)?);
    if base.bits() < 2 || a.bits() > 4096 {
        return None;
    }
    let guess = ((a.bits() as f64) / transcendental::log2(base.to_f64())).round();
    [guess - 1.0, guess].into_iter().find(|&power| {
        power >= 0.0
            && power * (base.bits() - 1) as f64 <= 4096.0
            && Int::from_big(Pow::pow(base.to_big(), power as u32)) == a
    })
}

impl Int {
    /// Returns the number of zeros below the lowest one; 0 for zero.
    pub fn trailing_zeros(&self) -> u64 {
        match self {
            Int::Small(0) => 0,
            Int::Small(n) => u64::from(n.trailing_zeros()),
            Int::Big(n) => n.trailing_zeros().unwrap_or(0),
        }
    }
}
