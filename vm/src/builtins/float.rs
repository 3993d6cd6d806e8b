//! Doubles: elementary functions, their parts, and the way between them and the rationals.

use crate::number::elementary::{self, Elementary};
use crate::number::{Int, Ratio, float, power, random, text};
use crate::raise::{ArithmeticCall, Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

/// Defines functions of one double.
macro_rules! functions {
    ($( $(#[doc = $doc:literal])* $name:ident = $function:ident; )*) => {
        $( $(#[doc = $doc])* pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
            const FUNCTION: Elementary = elementary::$function;
            vm.with_numbers(|numbers| FUNCTION.apply(numbers, arguments[0]))
        } )*
    };
}

functions! {
    sin = SIN;
    cos = COS;
    tan = TAN;
    asin = ASIN;
    acos = ACOS;
    sinh = SINH;
    cosh = COSH;
    tanh = TANH;
    asinh = ASINH;
    acosh = ACOSH;
    atanh = ATANH;
}

pub(super) fn atan(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.with_numbers(|numbers| match *arguments {
        [y, x] => elementary::angle(numbers, y, x),
        _ => elementary::ATAN.apply(numbers, arguments[0]),
    })
}

pub(super) fn exp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.with_numbers(|numbers| power::exp(numbers, arguments[0]))
}

pub(super) fn log(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.with_numbers(|numbers| match *arguments {
        [number, base] => power::log_in_base(numbers, number, base),
        _ => power::log(numbers, arguments[0]),
    })
}

pub(super) fn expt(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [base, power] = exactly(arguments);
    vm.with_numbers(|numbers| power::expt(numbers, base, power))
}

pub(super) fn sqrt(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.with_numbers(|numbers| power::sqrt(numbers, arguments[0]))
}

pub(super) fn numerator(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    part(vm, arguments[0], |(numerator, _)| numerator, arguments[0])
}

pub(super) fn denominator(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    part(vm, arguments[0], |(_, denominator)| denominator, Value::small(1))
}

fn part(vm: &mut Vm, v: Value, part: impl Fn((Value, Value)) -> Value, of_integer: Value) -> Outcome {
    match vm.heap.ratio(v) {
        Some(parts) => Ok(part(parts)),
        None if crate::number::is_integer(&vm.heap, v) => Ok(of_integer),
        None => vm.exchange.type_error(v, "RATIONAL"),
    }
}

/// The caller has divided both by their common factors.
pub(super) fn make_ratio(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [numerator, denominator] = exactly(arguments);
    vm.integer(numerator)?;
    let below = vm.integer(denominator)?;
    if below.is_negative() || below.is_zero() || denominator == Value::small(1) {
        return vm.exchange.not_written(denominator, "(INTEGER 2)");
    }
    Ok(vm.heap.alloc_ratio(numerator, denominator)?)
}

pub(super) fn rational(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    convert(vm, "RATIONAL", arguments[0], float::rational)
}

pub(super) fn rationalize(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    convert(vm, "RATIONALIZE", arguments[0], float::rationalize)
}

fn convert(vm: &mut Vm, op: &'static str, v: Value, from_float: fn(f64) -> Ratio) -> Outcome {
    match vm.heap.as_double(v) {
        Some(x) if x.is_finite() => vm.with_numbers(|numbers| numbers.ratio_value(op, &from_float(x))),
        Some(_) => not_finite(vm, op, v),
        None if crate::number::is_rational(&vm.heap, v) => Ok(v),
        None => vm.exchange.type_error(v, "REAL"),
    }
}

pub(super) fn to_float(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if let Some(&prototype) = arguments.get(1) {
        the_float(vm, prototype)?;
    }
    if crate::number::is_float(&vm.heap, arguments[0]) {
        return Ok(arguments[0]);
    }
    let x = vm.double_of("FLOAT", arguments[0], "REAL")?;
    Ok(vm.heap.float(x)?)
}

/// Returns the double that `v` is; a type error for any other number.
fn the_float(vm: &mut Vm, v: Value) -> Result<f64, Exit> {
    match vm.heap.as_double(v) {
        Some(x) => Ok(x),
        None => vm.exchange.type_error(v, "FLOAT"),
    }
}

fn not_finite<T>(vm: &mut Vm, op: &'static str, v: Value) -> Result<T, Exit> {
    let operation = ArithmeticCall::step(op, &[v]);
    vm.exchange.raise(Raised::Arithmetic(operation, "the float is not a finite number".into()))
}

/// Returns the finite double that `v` is.
fn finite_float(vm: &mut Vm, op: &'static str, v: Value) -> Result<f64, Exit> {
    let x = the_float(vm, v)?;
    if x.is_finite() {
        return Ok(x);
    }
    not_finite(vm, op, v)
}

pub(super) fn decode_float(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "DECODE-FLOAT", arguments[0])?;
    let (fraction, exponent) = float::fraction_and_exponent(x);
    let fraction = vm.heap.float(fraction)?;
    let sign = vm.heap.float(1f64.copysign(x))?;
    vm.give_values(&[fraction, Value::small(exponent), sign])
}

pub(super) fn integer_decode_float(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "INTEGER-DECODE-FLOAT", arguments[0])?;
    let (mantissa, exponent) = float::decode(x);
    let exponent = if mantissa == 0 { 0 } else { exponent };
    let mantissa = vm.integer_value("INTEGER-DECODE-FLOAT", &Int::from(mantissa).abs())?;
    let sign = if x.is_sign_negative() { -1 } else { 1 };
    vm.give_values(&[mantissa, Value::small(exponent), Value::small(sign)])
}

pub(super) fn scale_float(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [float, exponent] = exactly(arguments);
    let x = finite_float(vm, "SCALE-FLOAT", float)?;
    let exponent = vm.integer(exponent)?;
    let extreme = if exponent.is_negative() { i64::MIN } else { i64::MAX };
    let scaled = float::scaled(x, exponent.as_fixnum().unwrap_or(extreme));
    vm.with_numbers(|numbers| numbers.float_value("SCALE-FLOAT", scaled))
}

pub(super) fn float_sign(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = the_float(vm, arguments[0])?;
    let magnitude = match arguments.get(1) {
        Some(&other) => the_float(vm, other)?.abs(),
        None => 1.0,
    };
    Ok(vm.heap.float(magnitude.copysign(x))?)
}

pub(super) fn float_digits(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    the_float(vm, arguments[0])?;
    Ok(Value::small(53))
}

pub(super) fn float_radix(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    the_float(vm, arguments[0])?;
    Ok(Value::small(2))
}

pub(super) fn float_precision(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "FLOAT-PRECISION", arguments[0])?;
    let mantissa = float::decode(x).0.unsigned_abs();
    Ok(Value::small(64 - mantissa.leading_zeros() as i32))
}

pub(super) fn float_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let text = text::float_text(the_float(vm, arguments[0])?);
    Ok(vm.heap.alloc_str(&text)?)
}

/// `%float-digits`: where the point goes, and the digits.
pub(super) fn decimal_digits(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "FORMAT", arguments[0])?;
    let position = match arguments.get(1) {
        None | Some(&Value::NIL) => None,
        Some(&v) => match v.as_fixnum() {
            // Below the last digit of the least double, and above the first of the greatest, nothing changes.
            Some(position) => Some(position.clamp(-1100, 400) as i32),
            None => return vm.exchange.type_error(v, "FIXNUM"),
        },
    };
    vm.exchange.charge(4096);
    let (point, digits) = text::float_digits(x.abs(), position);
    let digits = vm.heap.alloc_str(&digits)?;
    vm.give_values(&[Value::small(point), digits])
}

pub(super) fn make_random_state(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let seed = arguments[0];
    if seed.is_nil() {
        let seed = vm.config.seed;
        return vm.with_numbers(|numbers| random::make_state(numbers, seed));
    }
    match Int::of(&vm.heap, seed) {
        Some(n) => {
            let seed = n.limbs().1.iter().fold(0, |seed, &limb| seed ^ limb);
            vm.with_numbers(|numbers| random::make_state(numbers, seed))
        }
        None => vm.with_numbers(|numbers| random::copy_state(numbers, seed)),
    }
}

pub(super) fn random(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [limit, state] = exactly(arguments);
    vm.scheduler.points.note_shown();
    match crate::number::sign_of(&vm.heap, limit) {
        Some(1) if vm.heap.ratio(limit).is_none() => {
            vm.with_numbers(|numbers| random::random(numbers, limit, state))
        }
        _ => vm.exchange.not_written(limit, "(OR (INTEGER 1) (FLOAT (0)))"),
    }
}
