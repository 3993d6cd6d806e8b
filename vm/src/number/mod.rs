//! The numeric tower: integers of any size, ratios and doubles, with the contagion of Common Lisp. Arithmetic
//! of complex numbers is in ESL (`stdlib/complex.esl`).
//!
//! Functions on values, for the builtins, and for the interpreter when the operands of an instruction are
//! neither two fixnums nor two doubles.
//!
//! Guarantees: results are normalized, so that a number has one representation (a bignum never fits a fixnum;
//! a ratio is in lowest terms with a denominator above one) and `eql` compares representations. A float and a
//! rational are compared by their exact values. Results are always finite: an operation whose result would be
//! infinite or a NaN fails, as under SBCL's traps.
//!
//! Work is bounded, because a builtin cannot be interrupted:
//! - No integer has more than [`limit::BIT_LIMIT`] bits. An operation whose result would have more fails with
//!   an arithmetic error before it begins.
//! - Steps that are quadratic in the sizes of their operands (products, quotients, greatest common divisors,
//!   digits) take at most the work named in [`limit`]. Above, the outcome is [`Exit::Slowly`], and the ESL
//!   function in the builtin's row of the table (`+`, `*`, `floor`, …) does the operation in pieces.
//! - Work is charged: one unit for each pair of limbs multiplied and for each limb copied.
//!
//! Not here: the syntax of numbers (the compiler's reader), functions of any number of arguments
//! (`builtins`).

use crate::heap::{Heap, Kind};
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

pub(crate) use arithmetic::{add, check_gcd, divide, multiply, negate, subtract};
pub(crate) use compare::{less, less_or_equal, num_equal, sign, sign_of};
pub(crate) use esl_heap::number::{
    eql, is_float, is_integer, is_number, is_rational, is_real, is_zero, same_value,
};
pub(crate) use integer::Int;
pub(crate) use ratio::Ratio;
pub(crate) use rounding::{Rounding, modulo, remainder};

mod arithmetic;
pub(crate) mod bits;
mod compare;
pub(crate) mod elementary;
pub(crate) mod float;
pub(crate) mod gcd;
mod integer;
mod limbs;
pub(crate) mod limit;
pub(crate) mod power;
pub(crate) mod random;
mod ratio;
pub(crate) mod rounding;
pub(crate) mod text;
mod transcendental;

/// A number, read from its value.
#[derive(Clone, Debug)]
pub(crate) enum Number {
    /// An integer of any size.
    Int(Int),
    /// A ratio; never an integer.
    Ratio(Ratio),
    /// A double.
    Float(f64),
}

impl Number {
    /// Returns the number that `v` is; `None` for any other value.
    pub(crate) fn of(heap: &Heap, v: Value) -> Option<Number> {
        if let Some(x) = v.as_double() {
            return Some(Number::Float(x));
        }
        if v.is_fixnum() {
            return Int::of(heap, v).map(Number::Int);
        }
        match heap.kind(v)? {
            Kind::Bignum => Int::of(heap, v).map(Number::Int),
            Kind::Float => heap.as_double(v).map(Number::Float),
            Kind::Ratio => Ratio::of(heap, v).map(Number::Ratio),
            _ => None,
        }
    }
}

impl Vm {
    /// Returns the real number that `v` is. Any other value is a type error that names `expected`; where that
    /// is a number, a complex one is left to the builtin's twin.
    pub(crate) fn number(&mut self, v: Value, expected: &'static str) -> Result<Number, Exit> {
        match Number::of(&self.heap, v) {
            Some(number) => {
                self.exchange.charge(match &number {
                    Number::Int(n) => 2 * n.len(),
                    Number::Ratio(r) => 4 * r.len(),
                    Number::Float(_) => 0,
                });
                Ok(number)
            }
            // The ESL twins know complex numbers.
            None if expected == "NUMBER" && self.heap.is(v, Kind::Complex) => Err(Exit::Slowly),
            None => self.exchange.type_error(v, expected),
        }
    }

    /// Returns the integer that `v` is. Any other value is a type error.
    pub(crate) fn integer(&mut self, v: Value) -> Result<Int, Exit> {
        match Int::of(&self.heap, v) {
            Some(n) => {
                self.exchange.charge(2 * n.len());
                Ok(n)
            }
            None => self.exchange.type_error(v, "INTEGER"),
        }
    }

    /// Returns the double that `v` is or rounds to. Any other value is a type error that names `expected`; a
    /// rational that is too large fails as operation `op`.
    pub(crate) fn double_of(
        &mut self,
        op: &'static str,
        v: Value,
        expected: &'static str,
    ) -> Result<f64, Exit> {
        if let Some(x) = v.as_double() {
            return Ok(x);
        }
        let x = self.nearest_double(v, expected)?;
        if x.is_finite() { Ok(x) } else { self.exchange.raise(Raised::FloatOverflow(op)) }
    }

    /// Returns the real number `v` as the nearest double, which is infinite if `v` is too large for one.
    pub(crate) fn nearest_double(&mut self, v: Value, expected: &'static str) -> Result<f64, Exit> {
        if let Some(x) = v.as_double() {
            return Ok(x);
        }
        if let Some(n) = v.as_fixnum() {
            return Ok(n as f64);
        }
        Ok(match self.number(v, expected)? {
            Number::Float(x) => x,
            Number::Int(n) => n.to_f64(),
            Number::Ratio(r) => r.to_f64(),
        })
    }

    /// Returns the integer `n` as a value. Fails as operation `op` if it has too many bits.
    pub(crate) fn integer_value(&mut self, op: &'static str, n: &Int) -> Outcome {
        if let Some(n) = n.as_fixnum().and_then(Value::fixnum) {
            return Ok(n);
        }
        let (negative, limbs) = n.limbs();
        self.limbs_value(op, negative, &limbs)
    }

    /// Returns the ratio `r` as a value, an integer if its denominator is 1. Fails as operation `op` if a
    /// part has too many bits.
    pub(crate) fn ratio_value(&mut self, op: &'static str, r: &Ratio) -> Outcome {
        let numerator = self.integer_value(op, &r.numerator)?;
        if r.denominator.is_one() {
            return Ok(numerator);
        }
        let denominator = self.integer_value(op, &r.denominator)?;
        Ok(self.heap.alloc_ratio(numerator, denominator)?)
    }

    /// Returns the double `x`, a result of operation `op` on finite numbers, as a value. Fails as `op` if it
    /// is infinite or a NaN.
    #[inline]
    pub(crate) fn float_value(&mut self, op: &'static str, x: f64) -> Outcome {
        if x.is_finite() { Ok(self.heap.float(x)?) } else { self.float_trap(op, x) }
    }

    #[cold]
    fn float_trap(&mut self, op: &'static str, x: f64) -> Outcome {
        if x.is_nan() {
            self.exchange.raise(Raised::Arithmetic(op, "the result is not a number".into()))
        } else {
            self.exchange.raise(Raised::FloatOverflow(op))
        }
    }

    /// Returns several values; just the first if the caller wants one.
    #[inline]
    pub(crate) fn give_values(&mut self, values: &[Value]) -> Outcome {
        if self.cpu.wants_one {
            return Ok(values.first().copied().unwrap_or(Value::NIL));
        }
        self.exchange.values.clear();
        self.exchange.values.extend_from_slice(values);
        Err(Exit::Values)
    }
}

#[cfg(test)]
mod properties;
#[cfg(test)]
mod tests;
