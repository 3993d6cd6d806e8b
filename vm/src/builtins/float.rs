//! Doubles: elementary functions, their parts, and the way between them and the rationals.

use crate::number::elementary::{self, Elementary};
use crate::number::{Int, Ratio, float, power, random, text};
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// Defines functions of one double.
macro_rules! functions {
    ($( $(#[doc = $doc:literal])* $name:ident = $function:ident; )*) => {
        $( $(#[doc = $doc])* pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
            const FUNCTION: Elementary = elementary::$function;
            FUNCTION.apply(vm, arguments[0])
        } )*
    };
}

functions! {
    /// `sin`
    sin = SIN;
    /// `cos`
    cos = COS;
    /// `tan`
    tan = TAN;
    /// `asin`
    asin = ASIN;
    /// `acos`
    acos = ACOS;
    /// `sinh`
    sinh = SINH;
    /// `cosh`
    cosh = COSH;
    /// `tanh`
    tanh = TANH;
    /// `asinh`
    asinh = ASINH;
    /// `acosh`
    acosh = ACOSH;
    /// `atanh`
    atanh = ATANH;
}

/// `atan`
pub(super) fn atan(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match *arguments {
        [y, x] => elementary::angle(vm, y, x),
        _ => elementary::ATAN.apply(vm, arguments[0]),
    }
}

/// `exp`
pub(super) fn exp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    power::exp(vm, arguments[0])
}

/// `log`
pub(super) fn log(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match *arguments {
        [number, base] => power::log_in_base(vm, number, base),
        _ => power::log(vm, arguments[0]),
    }
}

/// `expt`
pub(super) fn expt(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    power::expt(vm, arguments[0], arguments[1])
}

/// `sqrt`
pub(super) fn sqrt(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    power::sqrt(vm, arguments[0])
}

/// `numerator`
pub(super) fn numerator(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    part(vm, arguments[0], |(numerator, _)| numerator, arguments[0])
}

/// `denominator`
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

/// `rational`
pub(super) fn rational(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    convert(vm, "RATIONAL", arguments[0], float::rational)
}

/// `rationalize`
pub(super) fn rationalize(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    convert(vm, "RATIONALIZE", arguments[0], float::rationalize)
}

fn convert(vm: &mut Vm, op: &'static str, v: Value, from_float: fn(f64) -> Ratio) -> Outcome {
    match vm.heap.as_double(v) {
        Some(x) if x.is_finite() => vm.ratio_value(op, &from_float(x)),
        Some(_) => vm.exchange.raise(Raised::Arithmetic(op, "the float is not a finite number".into())),
        None if crate::number::is_rational(&vm.heap, v) => Ok(v),
        None => vm.exchange.type_error(v, "REAL"),
    }
}

/// `float`
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

/// The double that `v` is; a type error for any other number.
fn the_float(vm: &mut Vm, v: Value) -> Result<f64, Exit> {
    match vm.heap.as_double(v) {
        Some(x) => Ok(x),
        None => vm.exchange.type_error(v, "FLOAT"),
    }
}

/// The finite double that `v` is.
fn finite_float(vm: &mut Vm, op: &'static str, v: Value) -> Result<f64, Exit> {
    let x = the_float(vm, v)?;
    if x.is_finite() {
        return Ok(x);
    }
    vm.exchange.raise(Raised::Arithmetic(op, "the float is not a finite number".into()))
}

/// `decode-float`
pub(super) fn decode_float(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "DECODE-FLOAT", arguments[0])?;
    let (fraction, exponent) = float::fraction_and_exponent(x);
    let fraction = vm.heap.float(fraction)?;
    let sign = vm.heap.float(1f64.copysign(x))?;
    vm.give_values(&[fraction, Value::small(exponent), sign])
}

/// `integer-decode-float`
pub(super) fn integer_decode_float(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "INTEGER-DECODE-FLOAT", arguments[0])?;
    let (mantissa, exponent) = float::decode(x);
    let exponent = if mantissa == 0 { 0 } else { exponent };
    let mantissa = vm.integer_value("INTEGER-DECODE-FLOAT", &Int::from(mantissa).abs())?;
    let sign = if x.is_sign_negative() { -1 } else { 1 };
    vm.give_values(&[mantissa, Value::small(exponent), Value::small(sign)])
}

/// `scale-float`
pub(super) fn scale_float(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "SCALE-FLOAT", arguments[0])?;
    let exponent = vm.integer(arguments[1])?;
    let extreme = if exponent.is_negative() { i64::MIN } else { i64::MAX };
    vm.float_value("SCALE-FLOAT", float::scaled(x, exponent.as_fixnum().unwrap_or(extreme)))
}

/// `float-sign`
pub(super) fn float_sign(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = the_float(vm, arguments[0])?;
    let magnitude = match arguments.get(1) {
        Some(&other) => the_float(vm, other)?.abs(),
        None => 1.0,
    };
    Ok(vm.heap.float(magnitude.copysign(x))?)
}

/// `float-digits`
pub(super) fn float_digits(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    the_float(vm, arguments[0])?;
    Ok(Value::small(53))
}

/// `float-radix`
pub(super) fn float_radix(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    the_float(vm, arguments[0])?;
    Ok(Value::small(2))
}

/// `float-precision`
pub(super) fn float_precision(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let x = finite_float(vm, "FLOAT-PRECISION", arguments[0])?;
    let mantissa = float::decode(x).0.unsigned_abs();
    Ok(Value::small(64 - mantissa.leading_zeros() as i32))
}

/// `%float-string`
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

/// `%make-random-state`
pub(super) fn make_random_state(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let seed = arguments[0];
    if seed.is_nil() {
        return random::make_state(vm, vm.config.seed);
    }
    match Int::of(&vm.heap, seed) {
        Some(n) => random::make_state(vm, n.limbs().1.iter().fold(0, |seed, &limb| seed ^ limb)),
        None => random::copy_state(vm, seed),
    }
}

/// `%random`
pub(super) fn random(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match crate::number::sign_of(&vm.heap, arguments[0]) {
        Some(1) if vm.heap.ratio(arguments[0]).is_none() => random::random(vm, arguments[0], arguments[1]),
        _ => vm.specifier_error(arguments[0], "(OR (INTEGER 1) (FLOAT (0)))"),
    }
}
