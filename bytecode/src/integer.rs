//! Integers of any size as data have them: those of 64 bits, which are nearly all, take no memory of their
//! own.
//!
//! Guarantees: an integer has one representation, so equality and hashes need no conversion.
//! Not here: arithmetic of programs, which is in the crate `esl-number`.

use std::fmt;

use num_bigint::BigInt;
use num_traits::ToPrimitive;

/// An integer of any size.
///
/// ```
/// use esl_bytecode::{BigInt, Integer};
///
/// let (small, large) = (Integer::from(7), Integer::from(BigInt::from(1) << 80));
/// assert_eq!((i64::try_from(&small), u8::try_from(&small).ok()), (Ok(7), Some(7)));
/// assert!(i64::try_from(&large).is_err());
/// assert_eq!(Integer::from(large.to_big() - large.to_big()), Integer::from(0));
/// ```
#[derive(Clone, PartialEq, Eq, Hash)]
pub struct Integer(IntegerSize);

/// One that 64 bits hold is `Small`.
#[derive(Clone, PartialEq, Eq, Hash)]
enum IntegerSize {
    Small(i64),
    Large(Box<BigInt>),
}

/// The integer is not one of the wanted type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfRange;

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the integer is out of range")
    }
}

impl std::error::Error for OutOfRange {}

impl Integer {
    /// Returns the integer if 64 bits hold it.
    #[inline]
    pub fn as_small(&self) -> Option<i64> {
        match self.0 {
            IntegerSize::Small(value) => Some(value),
            IntegerSize::Large(_) => None,
        }
    }

    /// Returns the integer as one of any size, for arithmetic.
    pub fn to_big(&self) -> BigInt {
        match &self.0 {
            IntegerSize::Small(value) => BigInt::from(*value),
            IntegerSize::Large(value) => (**value).clone(),
        }
    }

    /// Returns its shortest two's complement, the lowest byte first.
    pub fn to_signed_bytes_le(&self) -> Vec<u8> {
        self.to_big().to_signed_bytes_le()
    }
}

impl From<BigInt> for Integer {
    fn from(value: BigInt) -> Integer {
        Integer(match i64::try_from(&value) {
            Ok(value) => IntegerSize::Small(value),
            Err(_) => IntegerSize::Large(Box::new(value)),
        })
    }
}

/// Defines conversions from types of Rust, which may be larger than 64 bits, and back.
macro_rules! convert {
    ($($ty:ty),*) => {
        $(
            impl From<$ty> for Integer {
                #[inline]
                fn from(value: $ty) -> Integer {
                    match i64::try_from(value) {
                        Ok(value) => Integer(IntegerSize::Small(value)),
                        Err(_) => Integer(IntegerSize::Large(Box::new(BigInt::from(value)))),
                    }
                }
            }

            impl TryFrom<&Integer> for $ty {
                type Error = OutOfRange;

                #[inline]
                fn try_from(integer: &Integer) -> Result<$ty, OutOfRange> {
                    match &integer.0 {
                        IntegerSize::Small(value) => <$ty>::try_from(*value).map_err(|_| OutOfRange),
                        IntegerSize::Large(value) => <$ty>::try_from(&**value).map_err(|_| OutOfRange),
                    }
                }
            }
        )*
    };
}

convert!(i8, i16, i32, i64, i128, isize, u8, u16, u32, u64, u128, usize);

impl ToPrimitive for Integer {
    fn to_i64(&self) -> Option<i64> {
        self.as_small()
    }

    fn to_u64(&self) -> Option<u64> {
        u64::try_from(self).ok()
    }

    fn to_i128(&self) -> Option<i128> {
        i128::try_from(self).ok()
    }

    fn to_u128(&self) -> Option<u128> {
        u128::try_from(self).ok()
    }

    fn to_f64(&self) -> Option<f64> {
        match &self.0 {
            IntegerSize::Small(value) => Some(*value as f64),
            IntegerSize::Large(value) => value.to_f64(),
        }
    }
}

impl fmt::Display for Integer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            IntegerSize::Small(value) => value.fmt(f),
            IntegerSize::Large(value) => value.fmt(f),
        }
    }
}

impl fmt::Debug for Integer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

const _: () = assert!(size_of::<Integer>() == 16, "data hold it in place");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_representation_at_the_limits() {
        for value in [i64::MIN, -1, 0, 1, i64::MAX] {
            let integer = Integer::from(BigInt::from(value));
            assert_eq!((integer.as_small(), integer.to_big()), (Some(value), value.into()));
            assert_eq!(integer, Integer::from(i128::from(value)));
            assert_eq!(integer.to_signed_bytes_le(), BigInt::from(value).to_signed_bytes_le());
        }
        for value in [i128::from(i64::MIN) - 1, i128::from(i64::MAX) + 1, i128::MAX] {
            let integer = Integer::from(value);
            assert_eq!((integer.as_small(), i128::try_from(&integer)), (None, Ok(value)));
            assert_eq!(integer, Integer::from(BigInt::from(value)));
            assert_eq!((integer.to_string(), integer.to_f64()), (value.to_string(), Some(value as f64)));
        }
        assert_eq!(u64::try_from(&Integer::from(u64::MAX)), Ok(u64::MAX));
        assert_eq!(u8::try_from(&Integer::from(256)), Err(OutOfRange));
        assert_eq!(u64::try_from(&Integer::from(-1)), Err(OutOfRange));
    }
}
