//! Messages that a program writes in one step: their times, and their payloads.
//!
//! Guarantees: a time is the nanosecond that is nearest to the given number of seconds, of two as near ones
//! the even one, as for a message that is written by itself.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_bytecode::packed::PackedVector;
use esl_host::{HostFailure, IntoDatum};
use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{Signed, ToPrimitive};

use super::reading::failure;

/// Nanoseconds of a second.
const SECOND: u32 = 1_000_000_000;

/// Returns the items of a list or a vector.
pub(super) fn items(sequence: &Datum) -> Result<Vec<Datum>, HostFailure> {
    let wrong = || HostFailure::of_type(sequence, "SEQUENCE");
    match sequence.kind() {
        DatumKind::Vector(items) => Ok(items.to_vec()),
        DatumKind::Nil | DatumKind::Cons(..) => {
            let mut elements = sequence.elements();
            let items = elements.by_ref().cloned().collect();
            if elements.tail().is_nil() { Ok(items) } else { Err(wrong()) }
        }
        _ => Err(wrong()),
    }
}

/// Returns the nanoseconds of a list or a vector of seconds.
pub(super) fn times(seconds: &Datum) -> Result<Vec<u64>, HostFailure> {
    if let DatumKind::Packed(PackedVector::Floats(floats)) = seconds.kind() {
        return floats.iter().map(|&float| of_float(float)).collect();
    }
    items(seconds)?.iter().map(of_datum).collect()
}

fn of_datum(seconds: &Datum) -> Result<u64, HostFailure> {
    match seconds.kind() {
        DatumKind::Float(float) => of_float(*float),
        DatumKind::Integer(whole) => in_range(&(whole.to_big() * SECOND), seconds),
        DatumKind::Ratio(over, under) => in_range(&rounded(&(over * SECOND), under), seconds),
        _ => Err(HostFailure::of_type(seconds, "REAL")),
    }
}

/// Returns the quotient, rounded to the nearest integer, of two as near ones to the even one.
fn rounded(over: &BigInt, under: &BigInt) -> BigInt {
    let (floor, rest) = over.div_mod_floor(under);
    match (rest * 2_u32).cmp(under) {
        std::cmp::Ordering::Less => floor,
        std::cmp::Ordering::Equal if floor.is_even() => floor,
        _ => floor + 1_u32,
    }
}

/// Returns nanoseconds as the format has them; none are before 1970.
fn in_range(nanoseconds: &BigInt, seconds: &Datum) -> Result<u64, HostFailure> {
    if nanoseconds.is_negative() {
        return Ok(0);
    }
    nanoseconds.to_u64().ok_or_else(|| out_of_range(seconds))
}

fn out_of_range(seconds: &Datum) -> HostFailure {
    failure(format!("{seconds} is not a time in seconds since 1970 that a file can hold"))
}

fn of_float(seconds: f64) -> Result<u64, HostFailure> {
    if seconds <= 0.0 {
        return Ok(0);
    }
    // Most times: the digits of the product are a whole number of at most 128 bits.
    let bits = seconds.to_bits();
    let exponent = (bits >> 52) as i32 - 1075;
    let digits = u128::from(bits & ((1 << 52) - 1) | 1 << 52) * u128::from(SECOND);
    if let Ok(places) = u32::try_from(-exponent)
        && (1..100).contains(&places)
    {
        let (floor, rest) = (digits >> places, digits & ((1 << places) - 1));
        let half = 1 << (places - 1);
        let nearest = floor + u128::from(rest > half || rest == half && floor & 1 == 1);
        return u64::try_from(nearest).map_err(|_| out_of_range(&seconds.into_datum()));
    }
    // The rest are less than a nanosecond, or at least 2^52 seconds, or not numbers.
    if seconds < 1.0 { Ok(0) } else { Err(out_of_range(&seconds.into_datum())) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use esl_bytecode::span::Span;

    fn time(kind: DatumKind) -> Result<u64, String> {
        let list = Datum::list([Datum::new(kind, Span::default())], Span::default());
        times(&list).map(|times| times[0]).map_err(|failure| format!("{failure:?}"))
    }

    #[test]
    fn floats_are_the_nearest_nanoseconds() {
        let exact = |seconds: f64| {
            let bits = seconds.to_bits();
            let digits = BigInt::from(bits & ((1 << 52) - 1) | 1 << 52) * SECOND;
            rounded(&digits, &(BigInt::from(1) << (1075 - (bits >> 52) as u32))).to_u64()
        };
        for seconds in [1e-9, 0.5e-9, 1.5e-9, 2.5e-9, 0.1, 0.3, 1.0, 100.75, 1.7e9 + 0.123_456_7, 4e9] {
            assert_eq!(of_float(seconds).ok(), exact(seconds), "{seconds}");
        }
        for seconds in [1e-300, f64::MIN_POSITIVE / 2.0, 0.0, -1.0, f64::NEG_INFINITY] {
            assert_eq!(of_float(seconds).ok(), Some(0), "{seconds}");
        }
        for seconds in [f64::NAN, f64::INFINITY, 1e300, 2e10] {
            assert!(of_float(seconds).is_err(), "{seconds}");
        }
    }

    #[test]
    fn integers_and_ratios_are_exact() {
        assert_eq!(time(DatumKind::Integer(7.into())), Ok(7_000_000_000));
        assert_eq!(time(DatumKind::Integer((-7).into())), Ok(0));
        assert_eq!(time(DatumKind::Ratio(1.into(), 3.into())), Ok(333_333_333));
        assert_eq!(time(DatumKind::Ratio(1.into(), 2_000_000_000.into())), Ok(0));
        assert_eq!(time(DatumKind::Ratio(3.into(), 2_000_000_000.into())), Ok(2));
        assert!(
            time(DatumKind::Integer(BigInt::from(1_u128 << 80).into()))
                .is_err_and(|text| text.contains("MCAP-ERROR"))
        );
        assert!(time(DatumKind::String("1".into())).is_err_and(|text| text.contains("TYPE-ERROR")));
    }
}
