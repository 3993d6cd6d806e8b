//! Integers: bits, divisors, roots, and their text.

use crate::equality::characters_of;
use crate::number::bits::{self, BitOperation};
use crate::number::{self, Int, gcd, limit, power, text};
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

use super::COPY_LIMIT;

/// Joins integers bit by bit.
fn fold(vm: &mut Vm, operation: BitOperation, identity: i32, integers: &[Value]) -> Outcome {
    match *integers {
        [] => Ok(Value::small(identity)),
        [only] => vm.integer(only).map(|_| only),
        [first, ref rest @ ..] => {
            let ceiling = vm.exchange.charges.ticks() + limit::WORK_LIMIT as u64 / 64;
            let mut result = first;
            for &integer in rest {
                if vm.exchange.charges.ticks() > ceiling {
                    return Err(Exit::Slowly);
                }
                result = vm.with_numbers(|numbers| bits::join(numbers, operation, result, integer))?;
            }
            Ok(result)
        }
    }
}

pub(super) fn logand(vm: &mut Vm, integers: &[Value]) -> Outcome {
    fold(vm, BitOperation::And, -1, integers)
}

pub(super) fn logior(vm: &mut Vm, integers: &[Value]) -> Outcome {
    fold(vm, BitOperation::Or, 0, integers)
}

pub(super) fn logxor(vm: &mut Vm, integers: &[Value]) -> Outcome {
    fold(vm, BitOperation::Xor, 0, integers)
}

/// `logeqv` of two integers
pub(super) fn logeqv(vm: &mut Vm, integers: &[Value]) -> Outcome {
    // Each pair turns the bits over once; an even number of integers leaves them turned.
    let joined = fold(vm, BitOperation::Xor, 0, integers)?;
    if integers.len().is_multiple_of(2) { complement(vm, joined) } else { Ok(joined) }
}

fn complement(vm: &mut Vm, integer: Value) -> Outcome {
    vm.with_numbers(|numbers| bits::complement(numbers, integer))
}

/// Joins two integers, either of them and the result turned over or not.
fn joined(vm: &mut Vm, arguments: &[Value], operation: BitOperation, turned: [bool; 3]) -> Outcome {
    let turn = |n: Int, turn: bool| if turn { n.complement() } else { n };
    let a = turn(vm.integer(arguments[0])?, turned[0]);
    let b = turn(vm.integer(arguments[1])?, turned[1]);
    vm.exchange.charge(a.len() + b.len());
    let result = turn(a.joined(operation, &b), turned[2]);
    vm.integer_value("LOGAND", &result)
}

pub(super) fn logandc1(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    joined(vm, arguments, BitOperation::And, [true, false, false])
}

pub(super) fn logandc2(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    joined(vm, arguments, BitOperation::And, [false, true, false])
}

pub(super) fn lognand(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    joined(vm, arguments, BitOperation::And, [false, false, true])
}

pub(super) fn lognor(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    joined(vm, arguments, BitOperation::Or, [false, false, true])
}

pub(super) fn logorc1(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    joined(vm, arguments, BitOperation::Or, [true, false, false])
}

pub(super) fn logorc2(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    joined(vm, arguments, BitOperation::Or, [false, true, false])
}

pub(super) fn lognot(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    complement(vm, arguments[0])
}

pub(super) fn logtest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [left, right] = exactly(arguments);
    let joined = vm.with_numbers(|numbers| bits::join(numbers, BitOperation::And, left, right))?;
    Ok((joined != Value::small(0)).into())
}

pub(super) fn logbitp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [index, integer] = exactly(arguments);
    Ok(vm.with_numbers(|numbers| bits::bit(numbers, index, integer))?.into())
}

pub(super) fn logcount(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let n = vm.integer(arguments[0])?;
    vm.exchange.charge(n.len());
    Ok(Value::index(n.count_bits() as usize))
}

pub(super) fn integer_length(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let n = vm.integer(arguments[0])?;
    Ok(Value::index(n.length() as usize))
}

pub(super) fn ash(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [integer, count] = exactly(arguments);
    vm.with_numbers(|numbers| bits::shift(numbers, integer, count))
}

pub(super) fn evenp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok((!is_odd(vm, arguments[0])?).into())
}

pub(super) fn oddp(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    Ok(is_odd(vm, arguments[0])?.into())
}

fn is_odd(vm: &mut Vm, v: Value) -> Result<bool, Exit> {
    match v.as_fixnum() {
        Some(n) => Ok(n & 1 == 1),
        None => match vm.heap.bignum(v) {
            Some(big) => Ok(big.limbs.first().is_some_and(|limb| limb & 1 == 1)),
            None => vm.exchange.type_error(v, "INTEGER"),
        },
    }
}

/// Size and position of a field: two counts.
fn field(vm: &mut Vm, size: Value, position: Value) -> Result<(u64, u64), Exit> {
    let mut count = |v: Value| match v.as_index() {
        Some(n) => Ok(n as u64),
        None => vm.exchange.type_error(v, "UNSIGNED-BYTE"),
    };
    Ok((count(size)?, count(position)?))
}

pub(super) fn load_byte(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [size, position, integer] = exactly(arguments);
    let (size, position) = field(vm, size, position)?;
    vm.with_numbers(|numbers| bits::field(numbers, size, position, integer))
}

pub(super) fn deposit_byte(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [new, size, position, integer] = exactly(arguments);
    let (size, position) = field(vm, size, position)?;
    vm.with_numbers(|numbers| {
        let (new, n) = (numbers.integer(new)?, numbers.integer(integer)?);
        let result = bits::deposit(numbers, &new, size, position, &n)?;
        numbers.integer_value("DPB", &result)
    })
}

pub(super) fn gcd(vm: &mut Vm, integers: &[Value]) -> Outcome {
    vm.with_numbers(|numbers| {
        let mut divisor = Int::ZERO;
        for &v in integers {
            let n = numbers.integer(v)?;
            number::check_gcd(numbers, divisor.len(), n.len())?;
            divisor = gcd::gcd(&divisor, &n);
        }
        numbers.integer_value("GCD", &divisor)
    })
}

/// `%gcd-step`: two smaller integers with the same greatest common divisor, or the divisor and zero.
pub(super) fn gcd_step(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [left, right] = exactly(arguments);
    let both = vm.with_numbers(|numbers| {
        let (a, b) = (numbers.integer(left)?, numbers.integer(right)?);
        let (long, short) = (a.len().max(b.len()), a.len().min(b.len()));
        numbers.check_work(2 * (long - short + 1), short)?;
        let steps = gcd::steps_within_limit(long);
        numbers.charge(8 * long * steps);
        let (a, b) = gcd::reduced(&a, &b, steps);
        Ok([numbers.integer_value("GCD", &a)?, numbers.integer_value("GCD", &b)?])
    })?;
    vm.give_values(&both)
}

pub(super) fn lcm(vm: &mut Vm, integers: &[Value]) -> Outcome {
    vm.with_numbers(|numbers| {
        let mut multiple = Int::ONE;
        for &v in integers {
            let n = numbers.integer(v)?;
            number::check_gcd(numbers, multiple.len(), n.len())?;
            let divisor = gcd::gcd(&multiple, &n);
            multiple = if n.is_zero() || multiple.is_zero() {
                Int::ZERO
            } else {
                multiple.times(&n.exact_quotient(&divisor)).abs()
            };
            numbers.check_bits("LCM", multiple.bits())?;
        }
        numbers.integer_value("LCM", &multiple)
    })
}

pub(super) fn isqrt(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.with_numbers(|numbers| power::isqrt(numbers, arguments[0]))
}

/// Returns a radix from 2 to 36.
pub(crate) fn radix(vm: &mut Vm, v: Value) -> Result<u32, Exit> {
    match v.as_index() {
        Some(radix @ 2..=36) => Ok(radix as u32),
        _ => vm.exchange.not_written(v, "(INTEGER 2 36)"),
    }
}

pub(super) fn integer_string(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [integer, base] = exactly(arguments);
    let n = vm.integer(integer)?;
    let radix = radix(vm, base)?;
    let text = vm.with_numbers(|numbers| text::integer_text(numbers, &n, radix))?;
    Ok(vm.heap.alloc_str(&text)?)
}

/// `%parse-integer`: the integer, or `NIL`, and the index where reading stopped.
pub(super) fn parse_integer(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [string, start, end, radix_value, junk_allowed] = exactly(arguments);
    let radix = radix(vm, radix_value)?;
    let Some(length) = characters_of(&vm.heap, string).map(<[u32]>::len) else {
        return vm.exchange.type_error(string, "STRING");
    };
    let (start, end) = vm.exchange.bounds(start, end, length)?;
    if end - start > COPY_LIMIT {
        return Err(Exit::Slowly);
    }
    let characters = &characters_of(&vm.heap, string).unwrap_or_default()[..end];
    let parsed = text::parse_integer(characters, start, radix);
    let rest_is_blank = |from: usize| characters[from..].iter().all(|&c| text::is_blank(c));
    let problem = match &parsed {
        text::Parsed::Integer(_, at) if junk_allowed.is_true() || rest_is_blank(*at) => None,
        text::Parsed::TooLong => return Err(Exit::Slowly),
        text::Parsed::Nothing(_) if junk_allowed.is_true() => None,
        text::Parsed::Nothing(at) if *at == end => Some("no digits in string"),
        _ => Some("junk in string"),
    };
    if let Some(problem) = problem {
        let shown = characters[start..end.min(start + 80)].iter();
        let shown: String =
            shown.map(|&code| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
        return vm.exchange.raise(Raised::Parse(format!("{problem} \"{shown}\"")));
    }
    let digits = (end - start).min(limit::PARSED_DIGITS);
    vm.exchange.charge(end - start + digits * digits / 64);
    let (value, at) = match parsed {
        text::Parsed::Integer(n, at) => {
            let at = if junk_allowed.is_true() { at } else { end };
            (vm.integer_value("PARSE-INTEGER", &n)?, at)
        }
        text::Parsed::Nothing(at) => (Value::NIL, at),
        text::Parsed::TooLong => return Err(Exit::Slowly),
    };
    vm.give_values(&[value, Value::index(at)])
}
