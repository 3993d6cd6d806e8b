//! Operations on numbers, for the machine: their work is charged to the running task, and their failures are
//! noted in the exchange. The numeric tower itself is `esl-number`.

pub(crate) use esl_number::{
    Int, Number, Ratio, Rounding, bits, check_gcd, elementary, eql, float, gcd, is_float, is_integer,
    is_number, is_rational, is_real, is_zero, limit, power, random, sign_of, text,
};
use esl_number::{NumberFailure, NumberResult, NumberStop, Numbers};

use crate::raise::{ArithmeticCall, Exit, Expected, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// Defines operations on two numbers with one result.
macro_rules! operations {
    ($( $(#[doc = $doc:literal])* $name:ident -> $result:ty; )*) => {
        $(
            $(#[doc = $doc])*
            #[inline]
            pub(crate) fn $name(vm: &mut Vm, a: Value, b: Value) -> Result<$result, Exit> {
                vm.with_numbers(|numbers| esl_number::$name(numbers, a, b))
            }
        )*
    };
}

operations! {
    /// Returns `a + b`.
    add -> Value;
    /// Returns `a - b`.
    subtract -> Value;
    /// Returns `a · b`.
    multiply -> Value;
    /// Returns `a / b`, a ratio where the division of integers leaves a remainder.
    divide -> Value;
    /// Implements `(= a b)`.
    num_equal -> bool;
    /// Implements `(< a b)`.
    less -> bool;
    /// Implements `(<= a b)`.
    less_or_equal -> bool;
    /// Returns the remainder of `floor`.
    modulo -> Value;
    /// Returns the remainder of `truncate`.
    remainder -> Value;
}

/// Returns `-a`.
pub(crate) fn negate(vm: &mut Vm, a: Value) -> Outcome {
    vm.with_numbers(|numbers| esl_number::negate(numbers, a))
}

/// Returns −1, 0 or 1, as `a` is below, at or above zero.
pub(crate) fn sign(vm: &mut Vm, a: Value, expected: &'static str) -> Result<i32, Exit> {
    vm.with_numbers(|numbers| esl_number::sign(numbers, a, expected))
}

/// Returns quotient and remainder, as two values.
pub(crate) fn both(vm: &mut Vm, rounding: Rounding, a: Value, b: Value) -> Outcome {
    let both = vm.with_numbers(|numbers| esl_number::rounding::both(numbers, rounding, a, b))?;
    vm.give_values(&both)
}

/// Returns the quotient as a float, and the remainder: `ffloor` and its family.
pub(crate) fn both_with_float(vm: &mut Vm, rounding: Rounding, a: Value, b: Value) -> Outcome {
    let both = vm.with_numbers(|numbers| esl_number::rounding::both_with_float(numbers, rounding, a, b))?;
    vm.give_values(&both)
}

/// Returns the way in which a builtin ends whose operation on numbers has stopped.
#[cold]
fn exit(vm: &mut Vm, stop: NumberStop, failure: Option<NumberFailure>) -> Exit {
    match stop {
        NumberStop::Slowly => Exit::Slowly,
        NumberStop::Room => Exit::Collect,
        NumberStop::Failed => {
            vm.exchange.raised = failure.map(|failure| match failure {
                NumberFailure::Type(datum, expected) => Raised::Type(datum, Expected::Type(expected)),
                NumberFailure::DivisionByZero(operation, operands) => {
                    Raised::DivisionByZero(ArithmeticCall::step(operation, &operands))
                }
                NumberFailure::Arithmetic(operation, text) => {
                    Raised::Arithmetic(ArithmeticCall::step(operation, &[]), text)
                }
                NumberFailure::FloatOverflow(operation) => {
                    Raised::FloatOverflow(ArithmeticCall::step(operation, &[]))
                }
            });
            Exit::Raise
        }
    }
}

impl Vm {
    /// Returns the result of operations on numbers, whose work is charged.
    ///
    /// # Errors
    /// As the operations.
    #[inline]
    pub(crate) fn with_numbers<T>(
        &mut self,
        operations: impl FnOnce(&mut Numbers<'_>) -> NumberResult<T>,
    ) -> Result<T, Exit> {
        let mut numbers = Numbers::new(&mut self.heap);
        let result = operations(&mut numbers);
        let ticks = numbers.ticks();
        match result {
            Ok(result) => {
                self.exchange.charges.add(ticks);
                Ok(result)
            }
            Err(stop) => {
                let failure = numbers.take_failure();
                self.exchange.charges.add(ticks);
                Err(exit(self, stop, failure))
            }
        }
    }

    /// Returns the real number that `v` is. Any other value is a type error that names `expected`; where that
    /// is a number, a complex one is left to the builtin's twin.
    pub(crate) fn number(&mut self, v: Value, expected: &'static str) -> Result<Number, Exit> {
        self.with_numbers(|numbers| numbers.number(v, expected))
    }

    /// Returns the integer that `v` is. Any other value is a type error.
    pub(crate) fn integer(&mut self, v: Value) -> Result<Int, Exit> {
        self.with_numbers(|numbers| numbers.integer(v))
    }

    /// Returns the double that `v` is or rounds to. Any other value is a type error that names `expected`; a
    /// rational that is too large fails as operation `op`.
    pub(crate) fn double_of(
        &mut self,
        op: &'static str,
        v: Value,
        expected: &'static str,
    ) -> Result<f64, Exit> {
        self.with_numbers(|numbers| numbers.double_of(op, v, expected))
    }

    /// Returns the real number `v` as the nearest double, which is infinite if `v` is too large for one.
    pub(crate) fn nearest_double(&mut self, v: Value, expected: &'static str) -> Result<f64, Exit> {
        self.with_numbers(|numbers| numbers.nearest_double(v, expected))
    }

    /// Returns the integer `n` as a value. Fails as operation `op` if it has too many bits.
    pub(crate) fn integer_value(&mut self, op: &'static str, n: &Int) -> Outcome {
        self.with_numbers(|numbers| numbers.integer_value(op, n))
    }
}
