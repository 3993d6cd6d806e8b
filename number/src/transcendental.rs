//! Elementary functions on doubles.
//!
//! Correctly rounded functions are used where available: their digits are the same on every machine, and
//! agree with those of a good C library in all but about one result in a hundred. The hyperbolic functions
//! and their inverses are the classical formulas, evaluated as C libraries do, so that they share the digits.

use std::f64::consts::LN_2;

pub(crate) use libm::{atanh, sinh};
use libm::{expm1, log1p};
pub(crate) use pxfm::{
    f_acos as acos, f_asin as asin, f_atan as atan, f_cos as cos, f_exp as exp, f_log as log, f_log2 as log2,
    f_pow as pow, f_sin as sin, f_tan as tan,
};

/// From here on, a number and its square root of the square plus or minus one are the same double.
const LARGE: f64 = (1_u64 << 28) as f64;
/// Up to here, the sine, the tangent and their inverses return their argument.
const TINY: f64 = 1.0 / LARGE;
/// From here on, the hyperbolic functions consist of one exponential.
const ONE_EXPONENTIAL: f64 = 22.0;
/// Greatest multiple of a tenth whose exponential is a double.
const LARGEST_EXPONENT: f64 = 709.7;

/// Returns the hyperbolic cosine.
pub(crate) fn cosh(x: f64) -> f64 {
    let x = x.abs();
    if x < LN_2 / 2.0 {
        let t = expm1(x);
        return 1.0 + t * t / (2.0 * (1.0 + t));
    }
    if x < ONE_EXPONENTIAL {
        let power = exp(x);
        return power / 2.0 + 0.5 / power;
    }
    if x < LARGEST_EXPONENT {
        return exp(x) / 2.0;
    }
    // The exponential itself may be infinite.
    let half = exp(x / 2.0);
    half / 2.0 * half
}

/// Returns the hyperbolic tangent.
pub(crate) fn tanh(x: f64) -> f64 {
    let size = x.abs();
    let result = if size < TINY {
        size
    } else if size >= ONE_EXPONENTIAL {
        1.0
    } else if size >= 1.0 {
        1.0 - 2.0 / (expm1(2.0 * size) + 2.0)
    } else {
        let t = expm1(-2.0 * size);
        -t / (t + 2.0)
    };
    result.copysign(x)
}

/// Returns the inverse of the hyperbolic sine.
pub(crate) fn asinh(x: f64) -> f64 {
    let size = x.abs();
    let result = if size < TINY {
        size
    } else if size > LARGE {
        log(size) + LN_2
    } else if size > 2.0 {
        log(2.0 * size + 1.0 / ((size * size + 1.0).sqrt() + size))
    } else {
        let square = size * size;
        log1p(size + square / (1.0 + (1.0 + square).sqrt()))
    };
    result.copysign(x)
}

/// Returns the inverse of the hyperbolic cosine, for `x` from 1.
pub(crate) fn acosh(x: f64) -> f64 {
    if x > LARGE {
        log(x) + LN_2
    } else if x > 2.0 {
        log(2.0 * x - 1.0 / (x + (x * x - 1.0).sqrt()))
    } else {
        let t = x - 1.0;
        log1p(t + (2.0 * t + t * t).sqrt())
    }
}

/// Returns the angle of a point. An angle too small for a double is a zero with the sign of `y`.
pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    let angle = pxfm::f_atan2(y, x);
    if angle == 0.0 { angle.copysign(y) } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn well_known_digits() {
        assert_eq!(exp(1.0), std::f64::consts::E);
        assert_eq!(exp(-1.0), 0.367_879_441_171_442_33);
        assert_eq!(log(10.0), std::f64::consts::LN_10);
        assert_eq!(log2(10.0), std::f64::consts::LOG2_10);
        assert_eq!(sin(0.5), 0.479_425_538_604_203);
        assert_eq!(cos(100.0), 0.862_318_872_287_683_9);
        assert_eq!(tan(1e22), -1.628_778_225_606_898_8);
        assert_eq!(4.0 * atan(1.0), std::f64::consts::PI);
        assert_eq!(pow(1.1, 10.0), 2.593_742_460_100_002_3);
        assert_eq!(cosh(1.0), 1.543_080_634_815_243_7);
        assert_eq!(sinh(4.0), 27.289_917_197_127_75);
        assert_eq!(cosh(4.830_571_047_624_649), 62.645_232_228_778_07);
        assert_eq!(tanh(0.385_623_992_668_479_8), 0.367_581_592_350_071_2);
        assert_eq!(asinh(2.637_527_741_697_860_4), 1.697_130_775_846_669_8);
        assert_eq!(acosh(2.932_878_902_648_042), 1.738_712_221_362_118_2);
        assert_eq!(
            (acosh(1.0), asinh(1e300), acosh(1e300)),
            (0.0, 691.468_675_078_773_6, 691.468_675_078_773_6)
        );
    }

    #[test]
    fn zeros_keep_their_sign() {
        for function in [sin, tan, asin, atan, sinh, tanh, asinh, atanh] {
            assert!(function(-0.0).is_sign_negative() && !function(0.0).is_sign_negative());
        }
        assert!(atan2(-1e-300, 1e300).is_sign_negative());
        assert!(!atan2(1e-300, 1e300).is_sign_negative());
        assert_eq!(atan2(-0.0, -1.0), -std::f64::consts::PI);
    }

    #[test]
    fn ends_of_the_range() {
        assert_eq!((exp(710.0), exp(-750.0)), (f64::INFINITY, 0.0));
        assert_eq!(exp(709.782_712_893_384), 1.797_693_134_862_273_2e308);
        assert_eq!((log(f64::INFINITY), log(0.0)), (f64::INFINITY, f64::NEG_INFINITY));
        assert_eq!((pow(2.0, 1024.0), pow(2.0, -1074.0), pow(2.0, -1075.0)), (f64::INFINITY, 5e-324, 0.0));
        assert_eq!((sinh(711.0), cosh(711.0), tanh(711.0)), (f64::INFINITY, f64::INFINITY, 1.0));
        assert!(cosh(710.4).is_finite() && cosh(-30.0) == cosh(30.0));
        assert!([sin, cos, tan].iter().all(|function| function(f64::INFINITY).is_nan()));
    }
}
