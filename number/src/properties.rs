//! The tower against its definitions: operations on integers and ratios agree with `num-rational`, and floats
//! read back from their text.

use num_bigint::BigInt;
use num_rational::BigRational;
use num_traits::{Signed, ToPrimitive, Zero};
use proptest::prelude::*;

use super::*;

/// Integers of all sizes, with emphasis on the edges of fixnums and machine words.
fn integer() -> impl Strategy<Value = BigInt> {
    prop_oneof![
        (-20i64..20).prop_map(BigInt::from),
        any::<i64>().prop_map(BigInt::from),
        any::<i128>().prop_map(BigInt::from),
        (0u32..200, -2i64..3, any::<bool>()).prop_map(|(shift, offset, negative)| {
            let n = (BigInt::from(1) << shift) + offset;
            if negative { -n } else { n }
        }),
        prop::collection::vec(any::<u32>(), 0..20)
            .prop_map(|words| BigInt::from_slice(num_bigint::Sign::Minus, &words)),
    ]
}

fn rational() -> impl Strategy<Value = BigRational> {
    let ratio = (integer(), integer().prop_filter("not zero", |n| !n.is_zero()));
    prop_oneof![integer().prop_map(BigRational::from), ratio.prop_map(|(n, d)| BigRational::new(n, d))]
}

fn finite() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>().prop_filter("finite", |x| x.is_finite()),
        (-1_000_000i32..1_000_000, 0u32..4).prop_map(|(n, places)| f64::from(n) / 10f64.powi(places as i32)),
    ]
}

fn ratio(x: &BigRational) -> Ratio {
    Ratio { numerator: Int::from_big(x.numer().clone()), denominator: Int::from_big(x.denom().clone()) }
}

fn value(numbers: &mut Numbers<'_>, x: &BigRational) -> Value {
    numbers.ratio_value("", &ratio(x)).unwrap()
}

/// Returns the rational that a value is, checked to be in its one representation.
fn rational_of(numbers: &Numbers<'_>, v: Value) -> BigRational {
    let integer = |v: Value| {
        let n = Int::of(numbers.heap, v).unwrap();
        assert_eq!(v.is_fixnum(), n.as_fixnum().is_some(), "a number that fits is a fixnum");
        n.to_big()
    };
    match numbers.heap.ratio(v) {
        Some((numerator, denominator)) => {
            let (n, d) = (integer(numerator), integer(denominator));
            let reduced = BigRational::new(n.clone(), d.clone());
            assert!(d > BigInt::from(1) && *reduced.denom() == d, "{n}/{d} is in lowest terms");
            reduced
        }
        None => BigRational::from(integer(v)),
    }
}

fn floor(x: &BigRational) -> BigRational {
    x.floor()
}

proptest! {
    #[test]
    fn arithmetic_is_exact(a in rational(), b in rational()) {
        let mut heap = esl_heap_testing::heap();
        let mut numbers = Numbers::new(&mut heap);
        let (x, y) = (value(&mut numbers, &a), value(&mut numbers, &b));
        let sum = add(&mut numbers, x, y).unwrap();
        prop_assert_eq!(rational_of(&numbers, sum), &a + &b);
        let difference = subtract(&mut numbers, x, y).unwrap();
        prop_assert_eq!(rational_of(&numbers, difference), &a - &b);
        let product = multiply(&mut numbers, x, y).unwrap();
        prop_assert_eq!(rational_of(&numbers, product), &a * &b);
        let negative = negate(&mut numbers, x).unwrap();
        prop_assert_eq!(rational_of(&numbers, negative), -a.clone());
        match divide(&mut numbers, x, y) {
            Ok(quotient) => prop_assert_eq!(rational_of(&numbers, quotient), &a / &b),
            Err(_) => prop_assert!(b.is_zero()),
        }
        prop_assert_eq!(less(&mut numbers, x, y).unwrap(), a < b);
        prop_assert_eq!(less_or_equal(&mut numbers, x, y).unwrap(), a <= b);
        prop_assert_eq!(num_equal(&mut numbers, x, y).unwrap(), a == b);
        prop_assert_eq!(eql(numbers.heap, x, y), a == b);
    }

    #[test]
    fn division_rounds_as_defined(a in rational(), b in rational()) {
        prop_assume!(!b.is_zero());
        let mut heap = esl_heap_testing::heap();
        let mut numbers = Numbers::new(&mut heap);
        let (x, y) = (value(&mut numbers, &a), value(&mut numbers, &b));
        let exact = &a / &b;
        let half = BigRational::new(1.into(), 2.into());
        for rounding in [Rounding::Floor, Rounding::Ceiling, Rounding::Truncate, Rounding::Round] {
            let expected = match rounding {
                Rounding::Floor => floor(&exact),
                Rounding::Ceiling => exact.ceil(),
                Rounding::Truncate => exact.trunc(),
                Rounding::Round => {
                    let low = floor(&(&exact + &half));
                    let is_tie = &exact + &half == low;
                    let is_odd = !(low.numer() % 2i32).is_zero();
                    if is_tie && is_odd { low - BigRational::from(BigInt::from(1)) } else { low }
                }
            };
            let [quotient, remainder] = rounding::both(&mut numbers, rounding, x, y).unwrap();
            prop_assert_eq!(rational_of(&numbers, quotient), expected.clone());
            prop_assert_eq!(rational_of(&numbers, remainder), &a - &expected * &b);
        }
    }

    #[test]
    fn bits_are_those_of_twos_complement(a in integer(), b in integer(), shift in -300i64..300) {
        let mut heap = esl_heap_testing::heap();
        let mut numbers = Numbers::new(&mut heap);
        let (x, y) = (value(&mut numbers, &a.clone().into()), value(&mut numbers, &b.clone().into()));
        for (operation, expected) in [
            (bits::BitOperation::And, &a & &b),
            (bits::BitOperation::Or, &a | &b),
            (bits::BitOperation::Xor, &a ^ &b),
        ] {
            let joined = bits::join(&mut numbers, operation, x, y).unwrap();
            prop_assert_eq!(rational_of(&numbers, joined), BigRational::from(expected));
        }
        let shifted = bits::shift(&mut numbers, x, Value::fixnum(shift).unwrap()).unwrap();
        let power = BigRational::from(BigInt::from(2)).pow(shift as i32);
        prop_assert_eq!(rational_of(&numbers, shifted), floor(&(BigRational::from(a.clone()) * power)));
        let n = Int::from_big(a.clone());
        let two = BigInt::from(2);
        let length = n.length() as u32;
        prop_assert!(-two.pow(length) <= a && a < two.pow(length));
        prop_assert!(length == 0 || a < -two.pow(length - 1) || a >= two.pow(length - 1));
        let ones = (0..400u64).filter(|&index| n.bit(index) != n.is_negative()).count();
        prop_assert!(n.length() >= 400 || n.count_bits() as usize == ones);
    }

    #[test]
    fn doubles_and_rationals_meet_exactly(x in finite(), a in rational()) {
        let mut heap = esl_heap_testing::heap();
        let mut numbers = Numbers::new(&mut heap);
        let exact = BigRational::from_float(x).unwrap();
        let (v, r) = (numbers.heap.float(x).unwrap(), value(&mut numbers, &a));
        prop_assert_eq!(less(&mut numbers, v, r).unwrap(), exact < a);
        prop_assert_eq!(less(&mut numbers, r, v).unwrap(), a < exact);
        prop_assert_eq!(num_equal(&mut numbers, v, r).unwrap(), exact == a);
        let same = numbers.ratio_value("", &float::rational(x)).unwrap();
        prop_assert_eq!(rational_of(&numbers, same), exact.clone());
        prop_assert!(num_equal(&mut numbers, v, same).unwrap());
        // The simplest rational has at most the exact one's denominator, and rounds to the same double.
        let simple = float::rationalize(x);
        prop_assert!(simple.denominator.to_big() <= *exact.denom());
        prop_assert_eq!(simple.to_f64(), x);
    }

    #[test]
    fn rationals_round_once(a in rational()) {
        let r = ratio(&a);
        let x = r.to_f64();
        prop_assume!(x.is_finite());
        let distance = |y: f64| BigRational::from_float(y).map(|y| (y - &a).abs());
        for neighbour in [x.next_up(), x.next_down()] {
            if let Some(other) = distance(neighbour) {
                let own = distance(x).unwrap();
                prop_assert!(own < other || own == other && x.to_bits() & 1 == 0, "{x:e} for {a}");
            }
        }
        let numerator = a.numer().to_f64().unwrap_or(f64::INFINITY);
        prop_assert_eq!(numerator, Int::from_big(a.numer().clone()).to_f64());
    }

    #[test]
    fn text_reads_back(x in finite(), a in integer(), radix in 2u32..37) {
        let written = text::float_text(x);
        prop_assert_eq!(written.parse::<f64>().unwrap().to_bits(), x.to_bits(), "{}", written);
        let is_positional = !written.contains('e');
        prop_assert_eq!(is_positional, x == 0.0 || (1e-3..1e7).contains(&x.abs()));
        prop_assert!(written.contains('.') && !written.ends_with('.'));
        let mut heap = esl_heap_testing::heap();
        let mut numbers = Numbers::new(&mut heap);
        let digits = text::integer_text(&mut numbers, &Int::from_big(a.clone()), radix).unwrap();
        let characters: Vec<u32> = format!("  {digits} ").chars().map(|c| c as u32).collect();
        let end = characters.len() - 1;
        let parsed = text::parse_integer(&characters, 0, radix);
        prop_assert_eq!(parsed, text::Parsed::Integer(Int::from_big(a), end));
    }
}
