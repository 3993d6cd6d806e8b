//! The numeric tower: integers of any size, ratios and doubles, with the contagion of Common Lisp. Arithmetic
//! of complex numbers is in ESL (`stdlib/complex.esl`).
//!
//! Functions on values of a heap ([`Numbers`]), for the builtins, and for the interpreter when the operands
//! of an instruction are neither two fixnums nor two doubles.
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
//!   digits) take at most the work named in [`limit`]. Above, the outcome is [`NumberStop::Slowly`], and the
//!   ESL function in the builtin's row of the table (`+`, `*`, `floor`, …) does the operation in pieces.
//! - Work is charged: one unit for each pair of limbs multiplied and for each limb copied.
//!
//! Not here: the syntax of numbers (the compiler's reader), functions of any number of arguments
//! (`builtins`).

#![forbid(unsafe_code)]

use esl_heap::{Heap, Kind, Value};

pub use arithmetic::{add, check_gcd, divide, multiply, negate, subtract};
pub use compare::{less, less_or_equal, num_equal, sign, sign_of};
pub use esl_heap::number::{eql, is_float, is_integer, is_number, is_rational, is_real, is_zero, same_value};
pub use integer::Int;
pub use numbers::{NumberFailure, NumberResult, NumberStop, Numbers};
pub use ratio::Ratio;
pub use rounding::{Rounding, modulo, remainder};

mod arithmetic;
pub mod bits;
mod compare;
pub mod elementary;
pub mod float;
pub mod gcd;
mod integer;
mod limbs;
pub mod limit;
mod numbers;
pub mod power;
pub mod random;
mod ratio;
pub mod rounding;
pub mod text;
mod transcendental;

/// A number, read from its value.
#[derive(Clone, Debug)]
pub enum Number {
    /// An integer of any size.
    Int(Int),
    /// A ratio; never an integer.
    Ratio(Ratio),
    /// A double.
    Float(f64),
}

impl Number {
    /// Returns the number that `v` is; `None` for any other value.
    pub fn of(heap: &Heap, v: Value) -> Option<Number> {
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

#[cfg(test)]
mod properties;
#[cfg(test)]
mod tests;

/// The example of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
