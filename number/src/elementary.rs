//! Trigonometric and hyperbolic functions, on doubles.
//!
//! Here are names, domains and failures; the computation is in `transcendental`.

use esl_heap::Value;

use super::transcendental;
use super::{NumberFailure, NumberResult, NumberStop, Numbers, float, power};

/// A function of one double.
#[derive(Clone, Copy, Debug)]
pub struct Elementary {
    /// Name in `COMMON-LISP`.
    pub name: &'static str,
    /// The function itself.
    pub function: fn(f64) -> f64,
    /// Whether the result is real for this argument.
    pub domain: fn(f64) -> bool,
}

fn everywhere(_: f64) -> bool {
    true
}

fn within_one(x: f64) -> bool {
    (-1.0..=1.0).contains(&x)
}

macro_rules! elementary {
    ($( $id:ident = $name:literal $function:path, $domain:expr; )*) => {
        $(
            #[doc = concat!("The function `", $name, "`.")]
            pub const $id: Elementary =
                Elementary { name: $name, function: $function, domain: $domain };
        )*
    };
}

elementary! {
    SIN = "SIN" transcendental::sin, everywhere;
    COS = "COS" transcendental::cos, everywhere;
    TAN = "TAN" transcendental::tan, everywhere;
    ASIN = "ASIN" transcendental::asin, within_one;
    ACOS = "ACOS" transcendental::acos, within_one;
    ATAN = "ATAN" transcendental::atan, everywhere;
    SINH = "SINH" transcendental::sinh, everywhere;
    COSH = "COSH" transcendental::cosh, everywhere;
    TANH = "TANH" transcendental::tanh, everywhere;
    ASINH = "ASINH" transcendental::asinh, everywhere;
    ACOSH = "ACOSH" transcendental::acosh, |x| x >= 1.0;
    ATANH = "ATANH" transcendental::atanh, within_one;
}

impl Elementary {
    /// Applies the function to `a`. A rational beyond the doubles counts as infinite, for functions that have
    /// limits there.
    pub fn apply(&self, numbers: &mut Numbers<'_>, a: Value) -> NumberResult {
        let x = numbers.nearest_double(a, "NUMBER")?;
        if !(self.domain)(x) {
            // The result is complex.
            return Err(NumberStop::Slowly);
        }
        let y = (self.function)(x);
        if y.is_infinite() && x.abs() == 1.0 {
            return numbers.fail(NumberFailure::DivisionByZero(self.name, [a, Value::small(0)]));
        }
        if x.is_infinite() && y.is_nan() {
            return numbers.fail(NumberFailure::FloatOverflow(self.name));
        }
        numbers.float_value(self.name, y)
    }
}

/// Implements `(atan y x)`: the angle of the point with these coordinates.
pub fn angle(numbers: &mut Numbers<'_>, y: Value, x: Value) -> NumberResult {
    let (above, y) = power::parts(numbers, y, "REAL")?;
    let (right, x) = power::parts(numbers, x, "REAL")?;
    let angle = if above == right || y == 0.0 || x == 0.0 {
        transcendental::atan2(y, x)
    } else {
        // The quotient may be a double where a coordinate is not.
        let quotient = float::scaled((y / x).abs(), above - right);
        transcendental::atan2(quotient.copysign(y), 1f64.copysign(x))
    };
    numbers.float_value("ATAN", angle)
}
