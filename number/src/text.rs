//! Numbers as text: integers in any radix, doubles by the shortest digits that read back.
//!
//! Not here: the effect of `*print-base*` and `*print-radix*`, and the directives of `format`, which are
//! written in ESL on top of these functions; reading numbers in source text (the compiler's reader).

use num_bigint::{BigInt, BigUint};
use num_integer::Integer;
use num_traits::{Pow, Zero};

use super::{Int, NumberResult, NumberStop, Numbers, float, limit};

/// Returns the digits of `n` in `radix`, from 2 to 36, with `-` in front of a negative number.
///
/// # Errors
/// [`NumberStop::Slowly`] for a number above [`limit::DIGIT_LIMBS`] in a radix that is not a power of two, or
/// with more than about [`limit::WRITTEN_DIGITS`] digits.
pub fn integer_text(numbers: &mut Numbers<'_>, n: &Int, radix: u32) -> NumberResult<String> {
    match n {
        Int::Small(n) if radix == 10 => Ok(n.to_string()),
        _ => {
            let len = n.len();
            if n.bits() / u64::from(radix.ilog2()) > limit::WRITTEN_DIGITS {
                return Err(NumberStop::Slowly);
            }
            if !radix.is_power_of_two() {
                if len > limit::DIGIT_LIMBS {
                    return Err(NumberStop::Slowly);
                }
                numbers.charge(len * len);
            }
            numbers.charge(64 * len);
            Ok(n.to_big().to_str_radix(radix).to_uppercase())
        }
    }
}

/// Returns a double as `prin1` writes it: positional from 1e-3 to below 1e7, else with an exponent.
pub fn float_text(x: f64) -> String {
    if x.is_nan() {
        return "#<FLOAT NAN>".into();
    }
    let sign = if x.is_sign_negative() { "-" } else { "" };
    if x.is_infinite() {
        return format!("#<FLOAT {}INFINITY>", if x < 0.0 { "-" } else { "+" });
    }
    let magnitude = x.abs();
    if magnitude == 0.0 {
        return format!("{sign}0.0");
    }
    if (1e-3..1e7).contains(&magnitude) {
        let digits = magnitude.to_string();
        let point = if digits.contains('.') { "" } else { ".0" };
        return format!("{sign}{digits}{point}");
    }
    let (digits, exponent) = scientific(magnitude);
    let (first, rest) = digits.split_at(1);
    let rest = if rest.is_empty() { "0" } else { rest };
    format!("{sign}{first}.{rest}e{exponent}")
}

/// Returns the shortest digits of a finite double above zero that read back, without a point, and the decimal
/// exponent of the first digit.
fn scientific(x: f64) -> (String, i32) {
    let text = format!("{x:e}");
    let (digits, exponent) = text.split_once('e').expect("this format has an exponent");
    (digits.replace('.', ""), exponent.parse().expect("an exponent is an integer"))
}

/// Returns the position of the point and the decimal digits of a finite double that is not negative: the
/// number is `0.d1d2d3… · 10^k`.
///
/// With a `position`, digits below `10^position` are dropped: the digits are the shortest in the closed
/// interval of half a unit of that position about the exact value. `format` prints these.
///
/// Source: Burger and Dybvig, "Printing floating-point numbers quickly and accurately", 1996, with the cutoff
/// of SBCL's `flonum-to-digits`, whose every choice is kept.
pub fn float_digits(x: f64, position: Option<i32>) -> (i32, String) {
    let Some(position) = position else {
        if x == 0.0 {
            return (0, "0".into());
        }
        let (digits, exponent) = scientific(x);
        return (exponent + 1, digits);
    };
    let (mantissa, exponent) = float::decode(x);
    let mantissa = mantissa.unsigned_abs();
    // x is r/s; half the gaps to its neighbours are low/s and high/s.
    let is_boundary = mantissa == 1 << 52 && exponent > -1074;
    let unit = if is_boundary { 2u32 } else { 1 };
    let mut r = BigUint::from(mantissa) * 2u32 * unit;
    let mut s = BigUint::from(2u32 * unit);
    let (mut low, mut high) = (BigUint::from(1u32), BigUint::from(unit));
    if exponent >= 0 {
        for n in [&mut r, &mut low, &mut high] {
            *n <<= exponent;
        }
    } else {
        s <<= exponent.unsigned_abs();
    }
    // Half a unit of the requested position: s · 10^position / 2, on a common scale.
    let power: BigUint = Pow::pow(BigUint::from(10u32), position.unsigned_abs());
    if position < 0 {
        for n in [&mut r, &mut s, &mut low, &mut high] {
            *n *= &power;
        }
    }
    for n in [&mut r, &mut s, &mut low, &mut high] {
        *n <<= 1u32;
    }
    let half: BigUint = if position < 0 { &s / &power } else { &s * &power } >> 1u32;
    scale_and_generate(r, s, low.max(half.clone()), high.max(half))
}

fn scale_and_generate(mut r: BigUint, mut s: BigUint, mut low: BigUint, mut high: BigUint) -> (i32, String) {
    let mut k = 0;
    while &r + &high >= s {
        s *= 10u32;
        k += 1;
    }
    loop {
        if r <= low || (&r + &high) * 10u32 >= s {
            break;
        }
        k -= 1;
        for n in [&mut r, &mut low, &mut high] {
            *n *= 10u32;
        }
    }
    let mut digits = String::new();
    loop {
        for n in [&mut r, &mut low, &mut high] {
            *n *= 10u32;
        }
        let (digit, rest) = r.div_rem(&s);
        r = rest;
        let digit = digit.iter_u32_digits().next().unwrap_or(0);
        let (is_low, is_high) = (r <= low, &r + &high >= s);
        let digit = match (is_low, is_high) {
            (false, false) => digit,
            (false, true) => digit + 1,
            (true, false) => digit,
            (true, true) => digit + u32::from(&r * 2u32 >= s),
        };
        // Scaling ensures that the first digit does not carry; an interval with a carry out of a later digit
        // would have ended at the digit before.
        digits.push(char::from_digit(digit, 10).unwrap_or('9'));
        if is_low || is_high {
            return (k, digits);
        }
    }
}

/// The result of reading an integer.
#[derive(Debug, PartialEq, Eq)]
pub enum Parsed {
    /// An integer, and the index after its last digit.
    Integer(Int, usize),
    /// No digit where one is expected; the index of the character there.
    Nothing(usize),
    /// Too many digits for one operation.
    TooLong,
}

/// Reads an integer in `radix` from the characters from `start` on: white space, a sign, digits.
pub fn parse_integer(characters: &[u32], start: usize, radix: u32) -> Parsed {
    let character = |at: usize| characters.get(at).copied().and_then(char::from_u32);
    let mut at = start;
    while characters.get(at).copied().is_some_and(is_blank) {
        at += 1;
    }
    let is_negative = character(at) == Some('-');
    if is_negative || character(at) == Some('+') {
        at += 1;
    }
    let first = at;
    let mut small = 0i128;
    let mut digits = Vec::new();
    while let Some(digit) = character(at).and_then(|c| c.to_digit(radix)) {
        // 24 digits fit in any radix.
        if at - first < 24 {
            small = small * i128::from(radix) + i128::from(digit);
        }
        digits.push(digit as u8);
        at += 1;
    }
    if at == first {
        return Parsed::Nothing(at);
    }
    if digits.len() > limit::PARSED_DIGITS {
        return Parsed::TooLong;
    }
    let magnitude = if digits.len() <= 24 {
        Int::Small(small)
    } else {
        let n = BigUint::from_radix_be(&digits, radix).unwrap_or_else(BigUint::zero);
        Int::from_big(BigInt::from(n))
    };
    Parsed::Integer(if is_negative { magnitude.negated() } else { magnitude }, at)
}

/// Returns whether `parse-integer` skips the character.
pub fn is_blank(code: u32) -> bool {
    matches!(code, 0x20 | 0x08..=0x0D | 0xA0)
}
