//! Elementary functions on doubles.
//!
//! Correctly rounded functions are used where available: their digits are the same on every machine, and
//! agree with those of a good C library in all but about one result in a hundred. The inverse hyperbolic
//! functions and `tanh` are the classical ones in plain arithmetic, whose digits C libraries share.

pub(crate) use libm::{acosh, asinh, atanh, tanh};
pub(crate) use pxfm::{
    f_acos as acos, f_asin as asin, f_atan as atan, f_cos as cos, f_cosh as cosh, f_exp as exp, f_log as log,
    f_log2 as log2, f_pow as pow, f_sin as sin, f_tan as tan,
};

/// Returns the angle of a point. An angle too small for a double is a zero with the sign of `y`.
pub(crate) fn atan2(y: f64, x: f64) -> f64 {
    let angle = pxfm::f_atan2(y, x);
    if angle == 0.0 { angle.copysign(y) } else { angle }
}

/// Returns the hyperbolic sine; at zero, too, it has the sign of `x`.
pub(crate) fn sinh(x: f64) -> f64 {
    if x == 0.0 { x } else { pxfm::f_sinh(x) }
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
        assert_eq!(sinh(711.0), f64::INFINITY);
        assert!([sin, cos, tan].iter().all(|function| function(f64::INFINITY).is_nan()));
    }
}
