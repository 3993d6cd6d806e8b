//! Bits of integers, as infinite rows of bits in two's complement.

use esl_heap::Value;
use num_bigint::BigInt;
use num_traits::Signed;

use super::Int;
use super::limbs::{BigOperand, Limbs};
use super::{NumberResult, Numbers};

/// A bitwise operation on two integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BitOperation {
    /// Bits set in both.
    And,
    /// Bits set in either.
    Or,
    /// Bits set in exactly one.
    Xor,
}

/// Returns `a` and `b` joined bit by bit.
pub fn join(numbers: &mut Numbers<'_>, operation: BitOperation, a: Value, b: Value) -> NumberResult {
    if let (Some(a), Some(b)) = (a.as_fixnum(), b.as_fixnum()) {
        // Fixnums in two's complement are closed under all of these.
        let joined = match operation {
            BitOperation::And => a & b,
            BitOperation::Or => a | b,
            BitOperation::Xor => a ^ b,
        };
        return Ok(Value::fixnum(joined).unwrap_or(Value::NIL));
    }
    let (a, b) = (numbers.integer(a)?, numbers.integer(b)?);
    numbers.charge(a.len() + b.len());
    numbers.integer_value("LOGAND", &a.joined(operation, &b))
}

/// Implements `(lognot a)`.
pub fn complement(numbers: &mut Numbers<'_>, a: Value) -> NumberResult {
    let a = numbers.integer(a)?;
    numbers.charge(a.len());
    numbers.integer_value("LOGNOT", &a.complement())
}

/// Implements `(ash a count)`.
pub fn shift(numbers: &mut Numbers<'_>, a: Value, count: Value) -> NumberResult {
    if let Some(distance) = count.as_fixnum()
        && let Some((bits, is_negative)) = magnitude_bits(numbers, a)
        && (distance >= 0 || !is_negative)
    {
        let limbs = (bits / 64) as usize;
        if distance > 0 && bits > 0 {
            numbers.check_bits("ASH", bits + distance.unsigned_abs())?;
            numbers.charge(limbs + distance as usize / 64);
        } else {
            numbers.charge(limbs);
        }
        let shifted = BigOperand::of(numbers.heap, a, &mut [0]).map(|n| match u64::try_from(distance) {
            Ok(shift) if bits > 0 => n.shifted_left(shift),
            Ok(_) => Limbs::new(),
            Err(_) => n.field(distance.unsigned_abs(), u64::MAX),
        });
        return numbers.limbs_value("ASH", is_negative, &shifted.unwrap_or_default());
    }
    let (n, count) = (numbers.integer(a)?, numbers.integer(count)?);
    numbers.charge(n.len());
    if n.is_zero() {
        return Ok(a);
    }
    if count.is_negative() {
        let shift = u64::try_from(count.negated().to_big()).unwrap_or(u64::MAX);
        return numbers.integer_value("ASH", &n.shifted_right(shift));
    }
    // A count beyond 64 bits exceeds the limit in any case.
    let shift = u64::try_from(count.to_big()).unwrap_or(u64::MAX >> 1).min(u64::MAX >> 1);
    numbers.check_bits("ASH", n.bits() + shift)?;
    numbers.charge(shift as usize / 64);
    numbers.integer_value("ASH", &n.shifted_left(shift))
}

/// Implements `(logbitp index a)`: an index past the last bit sees the sign.
pub fn bit(numbers: &mut Numbers<'_>, index: Value, a: Value) -> NumberResult<bool> {
    let n = numbers.integer(a)?;
    match Int::of(numbers.heap, index) {
        Some(index) if !index.is_negative() => Ok(match u64::try_from(index.to_big()) {
            Ok(index) => n.bit(index),
            Err(_) => n.is_negative(),
        }),
        _ => numbers.type_error(index, "UNSIGNED-BYTE"),
    }
}

/// Returns the length of the magnitude of an integer in bits, and whether the integer is negative. `None` for
/// any other value.
fn magnitude_bits(numbers: &Numbers<'_>, v: Value) -> Option<(u64, bool)> {
    BigOperand::of(numbers.heap, v, &mut [0]).map(|n| (n.bits(), n.is_negative()))
}

/// Returns `size` bits of `a` from bit `position` up, as an integer that is not negative.
pub fn field(numbers: &mut Numbers<'_>, size: u64, position: u64, a: Value) -> NumberResult {
    if let Some((bits, false)) = magnitude_bits(numbers, a) {
        numbers.charge((size.min(bits) / 64) as usize);
        let field = BigOperand::of(numbers.heap, a, &mut [0]).map(|n| n.field(position, size));
        return numbers.limbs_value("LDB", false, &field.unwrap_or_default());
    }
    let n = numbers.integer(a)?;
    numbers.check_bits("LDB", size)?;
    numbers.charge(n.len() + size as usize / 64);
    let field = n.shifted_right(position).joined(BitOperation::And, &mask(size));
    numbers.integer_value("LDB", &field)
}

/// Returns `a` with the field of `size` bits from `position` up replaced by the lowest bits of `new`.
pub fn deposit(numbers: &mut Numbers<'_>, new: &Int, size: u64, position: u64, a: &Int) -> NumberResult<Int> {
    if size == 0 {
        return Ok(a.clone());
    }
    numbers.check_bits("DPB", size.saturating_add(position))?;
    numbers.charge(a.len() + (size + position) as usize / 64);
    let mask = mask(size);
    let kept = a.joined(BitOperation::And, &mask.shifted_left(position).complement());
    let placed = new.joined(BitOperation::And, &mask).shifted_left(position);
    Ok(kept.joined(BitOperation::Or, &placed))
}

/// Returns an integer of `size` ones.
fn mask(size: u64) -> Int {
    Int::ONE.shifted_left(size).minus(&Int::ONE)
}

impl Int {
    /// Returns both integers joined bit by bit.
    pub fn joined(&self, operation: BitOperation, other: &Int) -> Int {
        if let (Int::Small(a), Int::Small(b)) = (self, other) {
            return Int::Small(match operation {
                BitOperation::And => a & b,
                BitOperation::Or => a | b,
                BitOperation::Xor => a ^ b,
            });
        }
        let (a, b) = (self.to_big(), other.to_big());
        Int::from_big(match operation {
            BitOperation::And => a & b,
            BitOperation::Or => a | b,
            BitOperation::Xor => a ^ b,
        })
    }

    /// Returns the integer with all bits inverted: `-1 - self`.
    pub fn complement(&self) -> Int {
        match self {
            Int::Small(n) => Int::Small(!n),
            Int::Big(n) => Int::from_big(-BigInt::from(1) - n),
        }
    }

    /// Returns the bit at `index`.
    pub fn bit(&self, index: u64) -> bool {
        match self {
            Int::Small(n) => n >> index.min(127) & 1 == 1,
            Int::Big(n) => n.bit(index),
        }
    }

    /// Returns the number of ones of an integer that is not negative, of zeros of a negative one.
    pub fn count_bits(&self) -> u64 {
        let ones = |n: &BigInt| n.iter_u64_digits().map(|limb| u64::from(limb.count_ones())).sum();
        match self {
            Int::Small(n) => u64::from(if *n < 0 { n.count_zeros() } else { n.count_ones() }),
            Int::Big(n) if n.is_negative() => ones(&(-BigInt::from(1) - n)),
            Int::Big(n) => ones(n),
        }
    }

    /// Returns the length in two's complement, in bits, without the sign.
    pub fn length(&self) -> u64 {
        if self.is_negative() { self.complement().bits() } else { self.bits() }
    }
}
