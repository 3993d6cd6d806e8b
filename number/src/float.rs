//! Doubles: their parts, and conversion to and from rationals, each rounded once.

use super::{Int, Ratio};

/// Returns the double nearest to `mantissa · 2^exponent`, halves to even: infinite on overflow, and exact
/// about denormalized numbers. If `mantissa` has 66 bits or more, its last bit may say that more bits follow.
pub fn rounded(mantissa: u128, exponent: i64) -> f64 {
    if mantissa == 0 {
        return 0.0;
    }
    let bits = i64::from(128 - mantissa.leading_zeros());
    let leading = exponent + bits - 1;
    if leading > 1023 {
        return f64::INFINITY;
    }
    // Denormalized numbers, below 2^-1022, have fewer bits.
    let precision = if leading >= -1022 { 53 } else { 53 - (-1022 - leading) };
    if precision < 0 {
        return 0.0;
    }
    let drop = bits - precision;
    if drop <= 0 {
        return libm::scalbn(mantissa as f64, exponent as i32);
    }
    let kept = mantissa.checked_shr(drop as u32).unwrap_or(0);
    let rest = mantissa - kept.checked_shl(drop as u32).unwrap_or(0);
    let half = 1u128 << (drop - 1);
    let up = rest > half || rest == half && kept & 1 == 1;
    libm::scalbn((kept + u128::from(up)) as f64, (exponent + drop) as i32)
}

/// Returns mantissa (with the sign) and exponent of a finite double: `x = mantissa · 2^exponent`, exactly.
pub fn decode(x: f64) -> (i64, i32) {
    let bits = x.to_bits();
    let fraction = (bits & ((1 << 52) - 1)) as i64;
    let biased = (bits >> 52 & 0x7FF) as i32;
    let (mantissa, exponent) =
        if biased == 0 { (fraction, -1074) } else { (fraction | 1 << 52, biased - 1075) };
    (if x.is_sign_negative() { -mantissa } else { mantissa }, exponent)
}

/// Returns the rational with exactly the value of a finite double.
pub fn rational(x: f64) -> Ratio {
    let (mantissa, exponent) = decode(x);
    if mantissa == 0 || exponent >= 0 {
        return Ratio::integer(Int::from(mantissa).shifted_left(u64::try_from(exponent).unwrap_or(0)));
    }
    let zeros = mantissa.trailing_zeros().min(exponent.unsigned_abs());
    Ratio {
        numerator: Int::from(mantissa >> zeros),
        denominator: Int::ONE.shifted_left(u64::from(exponent.unsigned_abs() - zeros)),
    }
}

/// Returns the simplest rational that reads as the finite double `x`: the one with the least denominator in
/// the interval that rounds to `x`.
pub fn rationalize(x: f64) -> Ratio {
    let (mantissa, exponent) = decode(x);
    if exponent >= 0 || mantissa == 0 {
        return rational(x);
    }
    // The ends of the interval lie half a unit of the last place away.
    let denominator = Int::ONE.shifted_left(u64::from(exponent.unsigned_abs()) + 1);
    let magnitude = i128::from(mantissa.unsigned_abs());
    let low = Ratio::reduced(&Int::Small(2 * magnitude - 1), &denominator);
    let high = Ratio::reduced(&Int::Small(2 * magnitude + 1), &denominator);
    let simplest = simplest_between(low, high);
    if mantissa < 0 { simplest.negated() } else { simplest }
}

/// Returns the ratio with the least denominator in a closed interval of numbers above zero, by continued
/// fractions.
fn simplest_between(low: Ratio, high: Ratio) -> Ratio {
    let (mut low, mut high) = (low, high);
    // The last two convergents p/q.
    let (mut p0, mut q0, mut p1, mut q1) = (Int::ZERO, Int::ONE, Int::ONE, Int::ZERO);
    loop {
        let (whole, rest) = low.numerator.div_rem(&low.denominator);
        let term = if rest.is_zero() { whole.clone() } else { whole.plus(&Int::ONE) };
        let is_inside = high.numerator.compare(&term.times(&high.denominator)).is_ge();
        let quotient = if is_inside { term } else { whole };
        let (p2, q2) = (quotient.times(&p1).plus(&p0), quotient.times(&q1).plus(&q0));
        if is_inside {
            return Ratio { numerator: p2, denominator: q2 };
        }
        (p0, q0, p1, q1) = (p1, q1, p2, q2);
        let fraction = |r: &Ratio| Ratio {
            numerator: r.numerator.minus(&quotient.times(&r.denominator)),
            denominator: r.denominator.clone(),
        };
        // Reciprocals reverse the order of the ends.
        (low, high) = (fraction(&high).inverted(), fraction(&low).inverted());
    }
}

/// Returns `x · 2^exponent`, rounded once.
pub fn scaled(x: f64, exponent: i64) -> f64 {
    libm::scalbn(x, exponent.clamp(-5000, 5000) as i32)
}

/// Returns the fraction of a finite double, from 1/2 to below 1 without the sign, and its exponent.
pub fn fraction_and_exponent(x: f64) -> (f64, i32) {
    libm::frexp(x.abs())
}
