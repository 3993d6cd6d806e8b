//! Trigonometric and hyperbolic functions, on doubles.
//!
//! The functions come from `libm`, so they give the same digits on every machine.

use crate::raise::{Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;

/// A function of one double.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Elementary {
    /// Its name in `COMMON-LISP`.
    pub(crate) name: &'static str,
    /// The function.
    pub(crate) function: fn(f64) -> f64,
    /// Where its results are real.
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
        $( pub(crate) const $id: Elementary = Elementary { name: $name, function: $function, domain: $domain }; )*
    };
}

elementary! {
    SIN = "SIN" libm::sin, everywhere;
    COS = "COS" libm::cos, everywhere;
    TAN = "TAN" libm::tan, everywhere;
    ASIN = "ASIN" libm::asin, within_one;
    ACOS = "ACOS" libm::acos, within_one;
    ATAN = "ATAN" libm::atan, everywhere;
    SINH = "SINH" libm::sinh, everywhere;
    COSH = "COSH" libm::cosh, everywhere;
    TANH = "TANH" libm::tanh, everywhere;
    ASINH = "ASINH" libm::asinh, everywhere;
    ACOSH = "ACOSH" libm::acosh, |x| x >= 1.0;
    ATANH = "ATANH" libm::atanh, within_one;
}

impl Elementary {
    /// The function at `a`.
    pub(crate) fn apply(&self, vm: &mut Vm, a: Value) -> Outcome {
        let x = vm.double_of(self.name, a, "NUMBER")?;
        if !(self.domain)(x) {
            return vm.raise(Raised::Arithmetic(self.name, "the result would be a complex number".into()));
        }
        let y = (self.function)(x);
        if y.is_infinite() && x.abs() == 1.0 {
            return vm.raise(Raised::DivisionByZero(self.name, [a, Value::small(0)]));
        }
        vm.float_value(self.name, y)
    }
}

/// `(atan y x)`: the angle of the point with these coordinates.
pub(crate) fn angle(vm: &mut Vm, y: Value, x: Value) -> Outcome {
    let (y, x) = (vm.double_of("ATAN", y, "REAL")?, vm.double_of("ATAN", x, "REAL")?);
    vm.float_value("ATAN", libm::atan2(y, x))
}
