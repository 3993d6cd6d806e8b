//! The tower against known results.

use super::*;

/// Reads `3`, `-1/2`, `1.5` or `2^70+1` (powers of two make bignums readable).
fn parse(numbers: &mut Numbers<'_>, text: &str) -> Value {
    if let Some((n, d)) = text.split_once('/') {
        let (n, d) = (parse(numbers, n), parse(numbers, d));
        return divide(numbers, n, d).unwrap();
    }
    if text.contains(['.', 'e']) {
        return numbers.heap.float(text.parse().unwrap()).unwrap();
    }
    if let Some((_, rest)) = text.split_once("2^") {
        let split = rest.find(['+', '-']).unwrap_or(rest.len());
        let power = Int::ONE.shifted_left(rest[..split].parse().unwrap());
        let offset = if split < rest.len() { rest[split..].parse::<i64>().unwrap() } else { 0 };
        let sum = power.plus(&Int::from(offset));
        return numbers.integer_value("+", &if text.starts_with('-') { sum.negated() } else { sum }).unwrap();
    }
    let n: num_bigint::BigInt = text.parse().unwrap();
    numbers.integer_value("+", &Int::from_big(n)).unwrap()
}

fn show(numbers: &Numbers<'_>, v: Value) -> String {
    match Number::of(numbers.heap, v) {
        Some(Number::Int(n)) => n.to_big().to_string(),
        Some(Number::Ratio(r)) => format!("{}/{}", r.numerator.to_big(), r.denominator.to_big()),
        Some(Number::Float(x)) => format!("{x:?}"),
        None => format!("{v:?}"),
    }
}

/// One result, or two.
trait Results {
    fn all(self) -> Vec<Value>;
}

impl Results for Value {
    fn all(self) -> Vec<Value> {
        vec![self]
    }
}

impl Results for [Value; 2] {
    fn all(self) -> Vec<Value> {
        self.to_vec()
    }
}

/// Applies a function to two numbers.
fn apply<T: Results>(f: fn(&mut Numbers<'_>, Value, Value) -> NumberResult<T>, a: &str, b: &str) -> String {
    let mut heap = esl_heap_testing::heap();
    let mut numbers = Numbers::new(&mut heap);
    let (a, b) = (parse(&mut numbers, a), parse(&mut numbers, b));
    match f(&mut numbers, a, b) {
        Ok(results) => {
            let shown: Vec<String> = results.all().into_iter().map(|v| show(&numbers, v)).collect();
            shown.join(" ")
        }
        Err(NumberStop::Failed) => match numbers.take_failure() {
            Some(NumberFailure::DivisionByZero(..)) => "division-by-zero".into(),
            Some(NumberFailure::FloatOverflow(_)) => "overflow".into(),
            Some(NumberFailure::Arithmetic(_, text)) => text,
            other => format!("{other:?}"),
        },
        Err(stop) => format!("{stop:?}"),
    }
}

#[track_caller]
fn check<T: Results>(f: fn(&mut Numbers<'_>, Value, Value) -> NumberResult<T>, cases: &[(&str, &str, &str)]) {
    for (a, b, expected) in cases {
        assert_eq!(apply(f, a, b), *expected, "of {a} and {b}");
    }
}

#[test]
fn sums() {
    check(
        add,
        &[
            ("1", "2", "3"),
            ("2^61-1", "1", "2305843009213693952"),
            ("-2^61", "-1", "-2305843009213693953"),
            ("2^70", "-2^70", "0"),
            ("2^127-1", "2^127-1", "340282366920938463463374607431768211454"),
            ("-2^127", "-2^127", "-340282366920938463463374607431768211456"),
            ("1/2", "1/2", "1"),
            ("1/2", "1/3", "5/6"),
            ("1/6", "1/3", "1/2"),
            ("1/2", "0.5", "1.0"),
            ("0.1", "0.2", "0.30000000000000004"),
            ("0", "-0.0", "0.0"),
            ("1e308", "1e308", "overflow"),
            ("2^5000", "1.0", "overflow"),
        ],
    );
}

#[test]
fn differences() {
    check(
        subtract,
        &[
            ("1", "2", "-1"),
            ("-2^61", "1", "-2305843009213693953"),
            ("2^127", "2^127-1", "1"),
            ("2^200", "2^200-5", "5"),
            ("1", "2^200", "-1606938044258990275541962092341162602522202993782792835301375"),
            ("1/2", "1/3", "1/6"),
            ("0", "0.0", "0.0"),
        ],
    );
}

#[test]
fn products() {
    check(
        multiply,
        &[
            ("6", "-7", "-42"),
            ("2^61-1", "2^61-1", "5316911983139663487003542222693990401"),
            ("2^64", "2^63", "170141183460469231731687303715884105728"),
            ("2^100", "-3", "-3802951800684688204490109616128"),
            ("2/3", "3/4", "1/2"),
            ("2/3", "3", "2"),
            ("0", "-1.5", "-0.0"),
            ("2", "0.1", "0.2"),
            ("1e300", "1e300", "overflow"),
            ("2^4194303", "2", "the result would have more than 4194304 bits, the limit of an integer"),
            (
                "2^4000000",
                "2^4000000",
                "the result would have more than 4194304 bits, the limit of an integer",
            ),
            ("2^2000000", "2^2000000", "Slowly"),
        ],
    );
}

#[test]
fn quotients() {
    check(
        divide,
        &[
            ("6", "4", "3/2"),
            ("4", "2", "2"),
            ("1", "-2", "-1/2"),
            ("1/2", "-1/2", "-1"),
            ("2^200", "2^199", "2"),
            ("2^200", "3", "1606938044258990275541962092341162602522202993782792835301376/3"),
            ("1", "0", "division-by-zero"),
            ("1.0", "0", "division-by-zero"),
            ("1.0", "0.0", "division-by-zero"),
            ("0.0", "0.0", "the result is not a number"),
            ("1", "3.0", "0.3333333333333333"),
            ("1e300", "1e-300", "overflow"),
            ("2^2000000", "2^1999999-1", "Slowly"),
        ],
    );
}

#[test]
fn integer_division_rounds_as_asked() {
    let floor =
        |numbers: &mut Numbers<'_>, a: Value, b: Value| rounding::both(numbers, Rounding::Floor, a, b);
    let ceiling =
        |numbers: &mut Numbers<'_>, a: Value, b: Value| rounding::both(numbers, Rounding::Ceiling, a, b);
    let truncate =
        |numbers: &mut Numbers<'_>, a: Value, b: Value| rounding::both(numbers, Rounding::Truncate, a, b);
    let round =
        |numbers: &mut Numbers<'_>, a: Value, b: Value| rounding::both(numbers, Rounding::Round, a, b);
    check(
        floor,
        &[
            ("-7", "2", "-4 1"),
            ("7", "-2", "-4 -1"),
            ("7.5", "1", "7 0.5"),
            ("7/2", "1", "3 1/2"),
            ("-2^61", "-1", "2305843009213693952 0"),
            ("2^100+1", "2^50", "1125899906842624 1"),
            ("-2^100", "3", "-422550200076076467165567735126 2"),
            ("1.0", "0.1", "10 0.0"),
            ("7/2", "0.5", "7 0.0"),
            ("-0.5", "1", "-1 0.5"),
            ("1", "0", "division-by-zero"),
            ("1.0", "0", "division-by-zero"),
            ("-7/2", "1/3", "-11 1/6"),
            ("2^2000000", "2^1000000-1", "Slowly"),
        ],
    );
    check(
        ceiling,
        &[
            ("-7", "2", "-3 -1"),
            ("7", "2", "4 -1"),
            ("-0.5", "1", "0 -0.5"),
            ("2^70+1", "2^70", "2 -1180591620717411303423"),
        ],
    );
    check(truncate, &[("-7", "2", "-3 -1"), ("-0.5", "1", "0 -0.5"), ("1e10", "1", "10000000000 0.0")]);
    check(
        round,
        &[
            ("-7", "2", "-4 1"),
            ("5", "2", "2 1"),
            ("7", "2", "4 -1"),
            ("2.5", "1", "2 0.5"),
            ("-7.5", "1", "-8 0.5"),
            ("7.5", "2", "4 -0.5"),
            ("2.5", "0.5", "5 0.0"),
            ("3/2", "1", "2 -1/2"),
            ("5/2", "1", "2 1/2"),
            ("2^70+1", "2", "590295810358705651712 1"),
            ("2^70+3", "2", "590295810358705651714 -1"),
        ],
    );
}

#[test]
fn remainders() {
    check(
        modulo,
        &[
            ("-7", "2", "1"),
            ("7", "-2", "-1"),
            ("5.5", "2", "1.5"),
            ("-1/2", "1", "1/2"),
            ("-5.5", "2", "0.5"),
            ("1e20", "3", "0.0"),
        ],
    );
    check(
        remainder,
        &[("-7", "2", "-1"), ("7", "-2", "1"), ("-5.5", "2", "-1.5"), ("1", "0", "division-by-zero")],
    );
}

#[test]
fn float_quotients_of_ffloor() {
    let ffloor = |numbers: &mut Numbers<'_>, a: Value, b: Value| {
        rounding::both_with_float(numbers, Rounding::Floor, a, b)
    };
    let ftruncate = |numbers: &mut Numbers<'_>, a: Value, b: Value| {
        rounding::both_with_float(numbers, Rounding::Truncate, a, b)
    };
    let fceiling = |numbers: &mut Numbers<'_>, a: Value, b: Value| {
        rounding::both_with_float(numbers, Rounding::Ceiling, a, b)
    };
    let fround = |numbers: &mut Numbers<'_>, a: Value, b: Value| {
        rounding::both_with_float(numbers, Rounding::Round, a, b)
    };
    check(ffloor, &[("7", "2", "3.0 1"), ("-0.5", "1", "-1.0 0.5"), ("7.5", "2", "3.0 1.5")]);
    check(ftruncate, &[("-0.3", "1", "-0.0 -0.3"), ("0.3", "1", "0.0 0.3"), ("1e300", "1", "1e300 0.0")]);
    check(fceiling, &[("-0.3", "1", "-0.0 -0.3")]);
    check(fround, &[("-0.3", "1", "0.0 -0.3")]);
}

/// Returns the relation of two numbers, from all three comparisons.
fn relation(a: &str, b: &str) -> &'static str {
    let mut heap = esl_heap_testing::heap();
    let mut numbers = Numbers::new(&mut heap);
    let (a, b) = (parse(&mut numbers, a), parse(&mut numbers, b));
    let (eq, lt, le) = (
        num_equal(&mut numbers, a, b).unwrap(),
        less(&mut numbers, a, b).unwrap(),
        less_or_equal(&mut numbers, a, b).unwrap(),
    );
    let (gt, ge) = (less(&mut numbers, b, a).unwrap(), less_or_equal(&mut numbers, b, a).unwrap());
    match (eq, lt, le, gt, ge) {
        (true, false, true, false, true) => "=",
        (false, true, true, false, false) => "<",
        (false, false, false, true, true) => ">",
        _ => "inconsistent",
    }
}

#[test]
fn comparison_is_exact() {
    for (a, b, expected) in [
        ("1", "1.0", "="),
        ("0.0", "-0.0", "="),
        ("1/3", "0.3333333333333333", ">"),
        ("1/2", "0.5", "="),
        ("10000000000000000000001", "1e22", ">"),
        ("10000000000000000000000", "1e22", "="),
        ("2^53+1", "9007199254740992.0", ">"),
        ("2^53", "9007199254740992.0", "="),
        ("-2^53-1", "-9007199254740992.0", ">"),
        ("2^2000", "1e308", ">"),
        ("-2^2000", "1e308", "<"),
        ("2^1000", "2^1000", "="),
        ("2^1000", "2^1000+1", "<"),
        ("-2^1000", "2^1000", "<"),
        ("1/3", "1/2", "<"),
        ("-1/3", "-1/2", ">"),
        ("1/3", "0", ">"),
        ("1/3", "1", "<"),
        ("2.5", "2", ">"),
        ("2.5", "5/2", "="),
        ("2^200/3", "2^200", "<"),
        ("2^70", "1180591620717411303424.0", "="),
        ("2^70+1", "1180591620717411303424.0", ">"),
        ("-2^70", "-1180591620717411565568.0", ">"),
    ] {
        assert_eq!(relation(a, b), expected, "{a} against {b}");
    }
}

#[test]
fn eql_tells_types_and_zeros() {
    for (a, b, expected) in [
        ("1", "1.0", false),
        ("1.5", "1.5", true),
        ("2^80", "2^80", true),
        ("2^80", "-2^80", false),
        ("0.0", "-0.0", false),
        ("1e300", "1e300", true),
        ("2/3", "2/3", true),
        ("2^80/3", "2^80/3", true),
        ("2^80/3", "2^80/7", false),
    ] {
        let mut heap = esl_heap_testing::heap();
        let mut numbers = Numbers::new(&mut heap);
        let (x, y) = (parse(&mut numbers, a), parse(&mut numbers, b));
        assert_eq!(eql(numbers.heap, x, y), expected, "{a} and {b}");
    }
}

#[test]
fn what_is_no_number_is_named() {
    let mut heap = esl_heap_testing::heap();
    let mut numbers = Numbers::new(&mut heap);
    for (a, b) in [(Value::T, Value::small(1)), (Value::small(1), Value::T)] {
        assert_eq!(add(&mut numbers, a, b), Err(NumberStop::Failed));
        assert_eq!(numbers.take_failure(), Some(NumberFailure::Type(Value::T, "NUMBER")));
    }
    assert_eq!(less(&mut numbers, Value::small(1), Value::NIL), Err(NumberStop::Failed));
    assert_eq!(numbers.take_failure(), Some(NumberFailure::Type(Value::NIL, "REAL")));
}

#[test]
fn ratios_round_to_the_nearest_double() {
    for (ratio, expected) in [
        ("1/3", 1.0 / 3.0),
        ("-1/3", -1.0 / 3.0),
        ("2^1000/3", 2f64.powi(1000) / 3.0),
        ("9007199254740993/2", 4503599627370496.0),
        ("9007199254740995/2", 4503599627370498.0),
        ("1/2^1074", f64::from_bits(1)),
        ("1/2^1075", 0.0),
        ("3/2^1076", f64::from_bits(1)),
        ("2^1100/2^1099-1", 2.0),
        ("1/2^1022-1", f64::MIN_POSITIVE),
    ] {
        let mut heap = esl_heap_testing::heap();
        let mut numbers = Numbers::new(&mut heap);
        let v = parse(&mut numbers, ratio);
        assert_eq!(numbers.double_of("float", v, "REAL"), Ok(expected), "{ratio}");
    }
}
