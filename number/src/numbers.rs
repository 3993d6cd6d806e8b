//! The heap that operations on numbers take from and give to, with the ways in which they end.

use esl_heap::{AllocError, Heap, Kind, Value};

use super::{Int, Number, Ratio};

/// Units of work that are a tick.
const UNITS: u64 = 64;

/// The reason why an operation gives no value. As wide as a value, so that a [`NumberResult`] comes back in
/// two registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub enum NumberStop {
    /// It failed; [`Numbers`] holds the [`NumberFailure`].
    Failed,
    /// The work is above the limit of one operation. It has had no effect.
    Slowly,
    /// It needs room: collect, then do it again. It has had no effect.
    Room,
}

/// The result of an operation, or the reason why there is none.
pub type NumberResult<T = Value> = Result<T, NumberStop>;

/// The failure of an operation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NumberFailure {
    /// The value is not of the type with this name in `COMMON-LISP`.
    Type(Value, &'static str),
    /// Name of the operation in `COMMON-LISP`, and its operands.
    DivisionByZero(&'static str, [Value; 2]),
    /// Name of the operation, and a text: the result does not exist or is too large.
    Arithmetic(&'static str, String),
    /// Name of the operation, whose result is too large for a double.
    FloatOverflow(&'static str),
}

impl From<AllocError> for NumberStop {
    fn from(error: AllocError) -> NumberStop {
        match error {
            // A result that is too large remains so after a collection; then the heap counts as exhausted.
            AllocError::NeedCollection | AllocError::TooLarge { .. } => NumberStop::Room,
        }
    }
}

/// The context of operations on numbers: a heap with the operands and results, the work done, and the failure
/// of the last operation.
pub struct Numbers<'a> {
    /// The heap.
    pub heap: &'a mut Heap,
    ticks: u64,
    /// In a box of its own, so that an operation that succeeds has a word to clear and to test.
    failure: Option<Box<NumberFailure>>,
}

impl Numbers<'_> {
    /// Begins operations on a heap. No work has been done yet.
    #[inline]
    pub fn new(heap: &mut Heap) -> Numbers<'_> {
        Numbers { heap, ticks: 0, failure: None }
    }

    /// Charges units of work, 64 to a tick. A unit takes about as long as a step of arithmetic on limbs.
    #[inline]
    pub fn charge(&mut self, units: usize) {
        self.ticks += units as u64 / UNITS;
    }

    /// Returns the ticks that the operations have taken.
    #[inline]
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Takes the failure of an operation that ended with [`NumberStop::Failed`].
    pub fn take_failure(&mut self) -> Option<NumberFailure> {
        self.failure.take().map(|failure| *failure)
    }

    /// Notes a failure; the result is for the operation to return.
    ///
    /// # Errors
    /// Always [`NumberStop::Failed`].
    #[cold]
    pub fn fail<T>(&mut self, failure: NumberFailure) -> NumberResult<T> {
        self.failure = Some(Box::new(failure));
        Err(NumberStop::Failed)
    }

    /// Notes that `datum` is not of the type with this name in `COMMON-LISP`.
    ///
    /// # Errors
    /// Always [`NumberStop::Failed`].
    #[cold]
    pub fn type_error<T>(&mut self, datum: Value, expected: &'static str) -> NumberResult<T> {
        self.fail(NumberFailure::Type(datum, expected))
    }
}

impl Numbers<'_> {
    /// Returns the real number that `v` is. Any other value is a type error that names `expected`; where that
    /// is a number, a complex one is left to the builtin's twin.
    pub fn number(&mut self, v: Value, expected: &'static str) -> NumberResult<Number> {
        match Number::of(self.heap, v) {
            Some(number) => {
                self.charge(match &number {
                    Number::Int(n) => 2 * n.len(),
                    Number::Ratio(r) => 4 * r.len(),
                    Number::Float(_) => 0,
                });
                Ok(number)
            }
            // The ESL twins know complex numbers.
            None if expected == "NUMBER" && self.heap.is(v, Kind::Complex) => Err(NumberStop::Slowly),
            None => self.type_error(v, expected),
        }
    }

    /// Returns the integer that `v` is. Any other value is a type error.
    pub fn integer(&mut self, v: Value) -> NumberResult<Int> {
        match Int::of(self.heap, v) {
            Some(n) => {
                self.charge(2 * n.len());
                Ok(n)
            }
            None => self.type_error(v, "INTEGER"),
        }
    }

    /// Returns the double that `v` is or rounds to. Any other value is a type error that names `expected`; a
    /// rational that is too large fails as operation `op`.
    pub fn double_of(&mut self, op: &'static str, v: Value, expected: &'static str) -> NumberResult<f64> {
        if let Some(x) = v.as_double() {
            return Ok(x);
        }
        let x = self.nearest_double(v, expected)?;
        if x.is_finite() { Ok(x) } else { self.fail(NumberFailure::FloatOverflow(op)) }
    }

    /// Returns the real number `v` as the nearest double, which is infinite if `v` is too large for one.
    pub fn nearest_double(&mut self, v: Value, expected: &'static str) -> NumberResult<f64> {
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
    pub fn integer_value(&mut self, op: &'static str, n: &Int) -> NumberResult {
        if let Some(n) = n.as_fixnum().and_then(Value::fixnum) {
            return Ok(n);
        }
        let (negative, limbs) = n.limbs();
        self.limbs_value(op, negative, &limbs)
    }

    /// Returns the ratio `r` as a value, an integer if its denominator is 1. Fails as operation `op` if a
    /// part has too many bits.
    pub fn ratio_value(&mut self, op: &'static str, r: &Ratio) -> NumberResult {
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
    pub fn float_value(&mut self, op: &'static str, x: f64) -> NumberResult {
        if x.is_finite() { Ok(self.heap.float(x)?) } else { self.float_trap(op, x) }
    }

    #[cold]
    fn float_trap(&mut self, op: &'static str, x: f64) -> NumberResult {
        if x.is_nan() {
            self.fail(NumberFailure::Arithmetic(op, "the result is not a number".into()))
        } else {
            self.fail(NumberFailure::FloatOverflow(op))
        }
    }
}
