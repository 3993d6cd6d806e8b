//! Limits: the size of a number, and the work of one operation.
//!
//! Measured on one core of a 2.5 GHz server, release build, in microseconds: a product of 1024 by 1024 limbs
//! 230, of 65,520 by 16 limbs 1100; a quotient of 1024 by 512 limbs 190, of 32,000 by 16 limbs 1200; a
//! greatest common divisor of two numbers of 256 limbs 450; the decimal digits of 1024 limbs 660; reading
//! 16,384 digits 270; a root of 512 limbs 350. The limits are half of these sizes, so that quadratic work
//! takes about a quarter of the time: other tasks wait for the longest step.

use super::{NumberFailure, NumberResult, NumberStop, Numbers};

/// Greatest size of an integer, in bits.
pub const BIT_LIMIT: u64 = 1 << 22;

/// Greatest product of the operands' lengths in one multiplication, in pairs of limbs. A division counts
/// double.
pub const WORK_LIMIT: usize = 1 << 19;

/// Greatest length, in limbs, of the operands of a greatest common divisor and of the parts of ratios in one
/// operation.
pub const GCD_LIMBS: usize = 128;

/// Greatest length, in limbs, of an integer whose root is taken in one operation.
pub const ROOT_LIMBS: usize = 256;

/// Greatest length, in limbs, of an integer written in one operation in a radix that is not a power of two.
pub const DIGIT_LIMBS: usize = 512;

/// Greatest number of digits written in one operation in a radix that is a power of two, which takes linear
/// time.
pub const WRITTEN_DIGITS: u64 = 1 << 17;

/// Greatest number of digits read in one operation.
pub const PARSED_DIGITS: usize = 8192;

impl Numbers<'_> {
    /// Fails as operation `op` if an integer of `bits` bits is too large.
    pub fn check_bits(&mut self, op: &'static str, bits: u64) -> NumberResult<()> {
        if bits <= BIT_LIMIT {
            return Ok(());
        }
        self.fail(NumberFailure::Arithmetic(
            op,
            format!("the result would have more than {BIT_LIMIT} bits, the limit of an integer"),
        ))
    }

    /// Charges for work on `a` by `b` limbs.
    ///
    /// # Errors
    /// [`NumberStop::Slowly`] if that is too much for one operation.
    pub fn check_work(&mut self, a: usize, b: usize) -> NumberResult<()> {
        let work = a.saturating_mul(b);
        if work > WORK_LIMIT {
            return Err(NumberStop::Slowly);
        }
        self.charge(work);
        Ok(())
    }
}
