//! Numbers: the tokens that are numbers, and their values.
//!
//! The syntax is that of Common Lisp. A token that only resembles a number, such as `1+` or
//! `1/2/3`, is a name. Work is bounded: digits are counted before they are converted, since conversion takes
//! quadratic time.

use esl_bytecode::BigInt;
use num_integer::Integer;

/// Digits of an integer, at most.
pub const MAX_DIGITS: usize = 100_000;
/// Digits of either part of a ratio, at most. Reducing a ratio takes longer than reading an integer.
pub const MAX_RATIO_DIGITS: usize = 10_000;

/// A number.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum NumberToken {
    Integer(BigInt),
    /// In lowest terms, the denominator above 1.
    Ratio(BigInt, BigInt),
    Float(f64),
}

/// Why a token with the syntax of a number has no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberError {
    /// The denominator is zero.
    ZeroDenominator,
    /// The float is larger than any double.
    OutOfRange,
    /// There are more digits than this limit.
    TooLong(usize),
}

/// Returns the number that `token` denotes, an integer or a ratio in base `base`, from 2 to 36, if that is
/// possible; `None` if it does not have the syntax of a number. Floats, and integers before a point, are
/// decimal.
pub(super) fn parse(token: &str, base: u32) -> Option<Result<NumberToken, NumberError>> {
    if base == 10 { decimal(token) } else { parse_radix(token, base).or_else(|| pointed(token)) }
}

/// Returns the number that `token` denotes in base ten.
fn decimal(token: &str) -> Option<Result<NumberToken, NumberError>> {
    let unsigned = token.strip_prefix(['+', '-']).unwrap_or(token);
    // Most tokens are names, which the first character rules out.
    if !unsigned.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
        return None;
    }
    let whole = unsigned.bytes().take_while(u8::is_ascii_digit).count();
    match unsigned.as_bytes().get(whole) {
        None => Some(integer(token, 10)),
        Some(b'.') if whole > 0 && whole + 1 == unsigned.len() => {
            Some(integer(&token[..token.len() - 1], 10))
        }
        Some(b'/') => {
            let denominator = &unsigned[whole + 1..];
            let is_ratio = whole > 0 && is_digits(denominator, 10);
            is_ratio.then(|| ratio(&token[..token.len() - denominator.len() - 1], denominator, 10))
        }
        _ => float(token, unsigned, whole),
    }
}

/// Returns the number that `token` denotes if it is decimal in every base: a float, or an integer before a
/// point.
fn pointed(token: &str) -> Option<Result<NumberToken, NumberError>> {
    let is_rational = token.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'+' | b'-' | b'/'));
    if is_rational { None } else { decimal(token) }
}

/// Returns the rational number that `token` denotes in base `radix`; `None` if it does not have the syntax of
/// one.
pub(super) fn parse_radix(token: &str, radix: u32) -> Option<Result<NumberToken, NumberError>> {
    let unsigned = token.strip_prefix(['+', '-']).unwrap_or(token);
    match unsigned.split_once('/') {
        None => is_digits(unsigned, radix).then(|| integer(token, radix)),
        Some((numerator, denominator)) => {
            let is_ratio = is_digits(numerator, radix) && is_digits(denominator, radix);
            is_ratio.then(|| ratio(&token[..token.len() - denominator.len() - 1], denominator, radix))
        }
    }
}

fn is_digits(text: &str, radix: u32) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_digit(radix))
}

fn integer(digits: &str, radix: u32) -> Result<NumberToken, NumberError> {
    big(digits, radix, MAX_DIGITS).map(NumberToken::Integer)
}

fn ratio(numerator: &str, denominator: &str, radix: u32) -> Result<NumberToken, NumberError> {
    let numerator = big(numerator, radix, MAX_RATIO_DIGITS)?;
    let denominator = big(denominator, radix, MAX_RATIO_DIGITS)?;
    if denominator == BigInt::ZERO {
        return Err(NumberError::ZeroDenominator);
    }
    let divisor = numerator.gcd(&denominator);
    let (numerator, denominator) = (numerator / &divisor, denominator / divisor);
    Ok(if denominator == BigInt::from(1) {
        NumberToken::Integer(numerator)
    } else {
        NumberToken::Ratio(numerator, denominator)
    })
}

fn big(digits: &str, radix: u32, limit: usize) -> Result<BigInt, NumberError> {
    if digits.len() > limit {
        return Err(NumberError::TooLong(limit));
    }
    if radix == 10 && digits.len() < 19 {
        // Nearly all integers of programs. The parser of `i64` accepts a sign.
        let small: i64 = digits.parse().expect("digits with an optional sign");
        return Ok(BigInt::from(small));
    }
    Ok(BigInt::parse_bytes(digits.as_bytes(), radix).expect("digits with an optional sign"))
}

/// Parses `[+-] digits* [. digits*] [marker [+-] digits+]`, with digits after the point or a marker.
fn float(token: &str, unsigned: &str, whole: usize) -> Option<Result<NumberToken, NumberError>> {
    let bytes = unsigned.as_bytes();
    let digits_from = |at: usize| bytes[at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mut at = whole;
    let mut fraction = 0;
    if bytes.get(at) == Some(&b'.') {
        fraction = digits_from(at + 1);
        at += 1 + fraction;
    }
    if at == bytes.len() {
        return (fraction > 0).then(|| double(token.to_owned()));
    }
    let is_marker = matches!(bytes[at].to_ascii_lowercase(), b'e' | b'd' | b'f' | b's' | b'l');
    let sign = usize::from(matches!(bytes.get(at + 1), Some(b'+' | b'-')));
    let first = at + 1 + sign;
    if !is_marker
        || whole + fraction == 0
        || first >= bytes.len()
        || first + digits_from(first) != bytes.len()
    {
        return None;
    }
    let marker = token.len() - bytes.len() + at;
    Some(double(format!("{}e{}", &token[..marker], &token[marker + 1..])))
}

/// Converts a text in the float syntax of Rust. Numbers too small for a double become zero.
fn double(text: String) -> Result<NumberToken, NumberError> {
    let value: f64 = text.parse().expect("the syntax of a float");
    if value.is_finite() { Ok(NumberToken::Float(value)) } else { Err(NumberError::OutOfRange) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn show(number: Option<Result<NumberToken, NumberError>>) -> String {
        match number {
            None => "name".into(),
            Some(Err(fault)) => format!("{fault:?}"),
            Some(Ok(NumberToken::Integer(value))) => value.to_string(),
            Some(Ok(NumberToken::Ratio(numerator, denominator))) => format!("{numerator}/{denominator}"),
            Some(Ok(NumberToken::Float(value))) => format!("{value:?}"),
        }
    }

    fn check(tokens: &[&str], expected: &[&str]) {
        let shown: Vec<String> = tokens.iter().map(|token| show(parse(token, 10))).collect();
        assert_eq!(shown, expected);
    }

    #[test]
    fn integers_and_ratios() {
        check(&["1", "1.", "+5", "-0", "007", "-7."], &["1", "1", "5", "0", "7", "-7"]);
        check(&["6/4", "-6/4", "4/2", "0/5", "+1/2"], &["3/2", "-3/2", "2", "0", "1/2"]);
        check(&["123456789012345678901234567890"], &["123456789012345678901234567890"]);
        check(
            &["9223372036854775808", "-9223372036854775809"],
            &["9223372036854775808", "-9223372036854775809"],
        );
        check(&["1/0"], &["ZeroDenominator"]);
    }

    #[test]
    fn floats() {
        check(
            &[".5", "-.5", "1.5", "1e3", "1.e5", "-.5e+3"],
            &["0.5", "-0.5", "1.5", "1000.0", "100000.0", "-500.0"],
        );
        check(&["1d0", "1.5f0", "1.5S0", "1.5L0", "2S-1"], &["1.0", "1.5", "1.5", "1.5", "0.2"]);
        check(&["-0.0", "1e-400", "1e400", "-1d999999999999"], &["-0.0", "0.0", "OutOfRange", "OutOfRange"]);
    }

    #[test]
    fn names_that_resemble_numbers() {
        let names =
            ["1+", "+", "-", "1/2/3", "a.b", "..a", "1e", "-a", "1.5e", "+.", ".e5", "-.e5", "1.5.5", ".5."];
        let more =
            ["1+e5", "-1/-2", "1e5e5", "/", "1/", "/2", "1_000", "--1", "+-1", "e5", "1e+", "1.5/2", "１"];
        for name in names.iter().chain(&more) {
            assert_eq!(show(parse(name, 10)), "name", "{name}");
        }
    }

    #[test]
    fn other_radixes() {
        let check = |token, radix, expected| assert_eq!(show(parse_radix(token, radix)), expected, "{token}");
        check("FF", 16, "255");
        check("-10", 16, "-16");
        check("zz", 36, "1295");
        check("1/F", 16, "1/15");
        check("1/10", 2, "1/2");
        check("12", 2, "name");
        check("", 2, "name");
        check("1.5", 16, "name");
        check("1/0", 16, "ZeroDenominator");
    }

    #[test]
    fn another_base_for_what_has_no_prefix() {
        let check = |token, base, expected| assert_eq!(show(parse(token, base)), expected, "{token}");
        check("face", 16, "64206");
        check("1e3", 16, "483");
        check("1/F", 16, "1/15");
        check("10.", 16, "10");
        check("1.5", 16, "1.5");
        check("1e3", 2, "1000.0");
        check("12", 2, "name");
        check("1/2", 2, "name");
        check("-11", 2, "-3");
        check("NIL", 36, "30477");
    }

    #[test]
    fn giant_numbers_are_refused_before_they_are_converted() {
        let digits = "1".repeat(MAX_DIGITS + 1);
        assert_eq!(show(parse(&digits, 10)), format!("TooLong({MAX_DIGITS})"));
        assert_eq!(show(parse(&format!("1/{digits}"), 10)), format!("TooLong({MAX_RATIO_DIGITS})"));
        assert_eq!(show(parse(&digits[1..], 10)).len(), MAX_DIGITS);
    }
}
