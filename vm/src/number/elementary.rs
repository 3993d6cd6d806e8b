//! Trigonometric and hyperbolic functions, on doubles.
//!
//! Here are names, domains and failures; the computation is in `transcendental`.

use super::transcendental;
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// A function of one double.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Elementary {
    /// Name in `COMMON-LISP`.
    pub(crate) name: &'static str,
    /// The function itself.
    pub(crate) function: fn(f64) -> f64,
    /// Whether the result is real for this argument.
    pub(crate) domain: fn(f64) -> bool,
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
            pub(crate) const $id: Elementary =
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
    /// Applies the function to `a`.
    pub(crate) fn apply(&self, vm: &mut Vm, a: Value) -> Outcome {
        let x = vm.double_of(self.name, a, "NUMBER")?;
        if !(self.domain)(x) {
            // The result is complex.
            return Err(Exit::Slowly);
        }
        let y = (self.function)(x);
        if y.is_infinite() && x.abs() == 1.0 {
            return vm.exchange.raise(Raised::DivisionByZero(self.name, [a, Value::small(0)]));
        }
        vm.float_value(self.name, y)
    }
}

/// Implements `(atan y x)`: the angle of the point with these coordinates.
pub(crate) fn angle(vm: &mut Vm, y: Value, x: Value) -> Outcome {
    let (y, x) = (vm.double_of("ATAN", y, "REAL")?, vm.double_of("ATAN", x, "REAL")?);
    vm.float_value("ATAN", transcendental::atan2(y, x))
}
