//! Arithmetic, comparison and rounding for any number of arguments.

use crate::number::{self, Rounding, limit::WORK_LIMIT};
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

use super::LIMIT;

/// The one of integers, where it is left out.
const ONE: Value = Value::small(1);

/// Joins numbers from the left. The cost of all steps together is bounded like that of one.
fn fold(
    vm: &mut Vm,
    first: Value,
    rest: &[Value],
    step: impl Fn(&mut Vm, Value, Value) -> Outcome,
) -> Outcome {
    let ceiling = vm.exchange.charges.ticks() + WORK_LIMIT as u64 / 64;
    let mut result = first;
    for &number in rest {
        if vm.exchange.charges.ticks() > ceiling {
            return Err(Exit::Slowly);
        }
        result = step(vm, result, number)?;
    }
    Ok(result)
}

pub(super) fn add(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    match *numbers {
        [] => Ok(Value::small(0)),
        [only] if number::is_number(&vm.heap, only) => Ok(only),
        [only] => vm.exchange.type_error(only, "NUMBER"),
        [first, ref rest @ ..] => fold(vm, first, rest, number::add),
    }
}

pub(super) fn multiply(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    match *numbers {
        [] => Ok(ONE),
        [only] if number::is_number(&vm.heap, only) => Ok(only),
        [only] => vm.exchange.type_error(only, "NUMBER"),
        [first, ref rest @ ..] => fold(vm, first, rest, number::multiply),
    }
}

pub(super) fn subtract(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    match *numbers {
        [only] => number::negate(vm, only),
        _ => fold(vm, numbers[0], &numbers[1..], number::subtract),
    }
}

pub(super) fn divide(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    match *numbers {
        [only] => number::divide(vm, ONE, only),
        _ => fold(vm, numbers[0], &numbers[1..], number::divide),
    }
}

pub(super) fn increment(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    number::add(vm, arguments[0], ONE)
}

pub(super) fn decrement(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    number::subtract(vm, arguments[0], ONE)
}

/// Returns whether `holds` is true of all neighbours. All arguments are checked, also behind a pair for which
/// it is not.
fn chain(
    vm: &mut Vm,
    numbers: &[Value],
    expected: &'static str,
    holds: impl Fn(&mut Vm, Value, Value) -> Result<bool, Exit>,
) -> Outcome {
    if numbers.len() > LIMIT {
        return Err(Exit::Slowly);
    }
    if let Some(&wrong) = numbers.iter().find(|&&v| !number::is_number(&vm.heap, v)) {
        return vm.exchange.type_error(wrong, expected);
    }
    for pair in numbers.windows(2) {
        if !holds(vm, pair[0], pair[1])? {
            return Ok(Value::NIL);
        }
    }
    Ok(Value::T)
}

pub(super) fn num_equal(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    chain(vm, numbers, "NUMBER", number::num_equal)
}

pub(super) fn less(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    chain(vm, numbers, "REAL", number::less)
}

pub(super) fn less_equal(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    chain(vm, numbers, "REAL", number::less_or_equal)
}

pub(super) fn greater(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    chain(vm, numbers, "REAL", |vm, a, b| number::less(vm, b, a))
}

pub(super) fn greater_equal(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    chain(vm, numbers, "REAL", |vm, a, b| number::less_or_equal(vm, b, a))
}

pub(super) fn num_not_equal(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    if numbers.len() * numbers.len() / 2 > LIMIT {
        return Err(Exit::Slowly);
    }
    chain(vm, numbers, "NUMBER", |_, _, _| Ok(true))?;
    for (at, &a) in numbers.iter().enumerate() {
        for &b in &numbers[at + 1..] {
            if number::num_equal(vm, a, b)? {
                return Ok(Value::NIL);
            }
        }
    }
    Ok(Value::T)
}

pub(super) fn max(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    chain(vm, numbers, "REAL", |_, _, _| Ok(true))?;
    fold(vm, numbers[0], &numbers[1..], |vm, a, b| Ok(if number::less(vm, a, b)? { b } else { a }))
}

pub(super) fn min(vm: &mut Vm, numbers: &[Value]) -> Outcome {
    chain(vm, numbers, "REAL", |_, _, _| Ok(true))?;
    fold(vm, numbers[0], &numbers[1..], |vm, a, b| Ok(if number::less(vm, b, a)? { b } else { a }))
}

pub(super) fn zerop(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if !number::is_number(&vm.heap, arguments[0]) {
        return vm.exchange.type_error(arguments[0], "NUMBER");
    }
    Ok(number::is_zero(&vm.heap, arguments[0]).into())
}

pub(super) fn plusp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok((number::sign(vm, arguments[0], "REAL")? > 0).into())
}

pub(super) fn minusp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok((number::sign(vm, arguments[0], "REAL")? < 0).into())
}

pub(super) fn abs(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    if let Some(x) = vm.heap.as_double(arguments[0]) {
        return Ok(vm.heap.float(x.abs())?);
    }
    vm.number(arguments[0], "NUMBER")?;
    let sign = number::sign(vm, arguments[0], "NUMBER")?;
    if sign < 0 { number::negate(vm, arguments[0]) } else { Ok(arguments[0]) }
}

pub(super) fn signum(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match vm.heap.as_double(arguments[0]) {
        Some(x) => Ok(vm.heap.float(if x == 0.0 { x } else { x.signum() })?),
        None => {
            vm.number(arguments[0], "NUMBER")?;
            Ok(Value::small(number::sign(vm, arguments[0], "NUMBER")?))
        }
    }
}

/// Defines division by rounding mode.
macro_rules! roundings {
    ($( $(#[doc = $doc:literal])* $name:ident = $function:ident $rounding:ident; )*) => {
        $( $(#[doc = $doc])* pub(super) fn $name(vm: &mut Vm, arguments: &[Value]) -> Outcome {
            let divisor = arguments.get(1).copied().unwrap_or(ONE);
            number::$function(vm, Rounding::$rounding, arguments[0], divisor)
        } )*
    };
}

roundings! {
    floor = both Floor;
    ceiling = both Ceiling;
    truncate = both Truncate;
    round = both Round;
    ffloor = both_with_float Floor;
    fceiling = both_with_float Ceiling;
    ftruncate = both_with_float Truncate;
    fround = both_with_float Round;
}

pub(super) fn complexp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(vm.heap.complex(arguments[0]).is_some().into())
}

pub(super) fn make_complex(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [real, imaginary] = exactly(arguments);
    for part in [real, imaginary] {
        vm.number(part, "REAL")?;
    }
    Ok(vm.heap.alloc_complex(real, imaginary)?)
}

pub(super) fn real_part(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match vm.heap.complex(arguments[0]) {
        Some((real, _)) => Ok(real),
        None => vm.number(arguments[0], "NUMBER").map(|_| arguments[0]),
    }
}

pub(super) fn imaginary_part(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    match vm.heap.complex(arguments[0]) {
        Some((_, imaginary)) => Ok(imaginary),
        None => number::multiply(vm, Value::small(0), arguments[0]),
    }
}

pub(super) fn modulo(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [number, divisor] = exactly(arguments);
    number::modulo(vm, number, divisor)
}

pub(super) fn remainder(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [number, divisor] = exactly(arguments);
    number::remainder(vm, number, divisor)
}
