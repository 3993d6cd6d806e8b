//! Bits of integers, as infinite rows of bits in two's complement.

use num_bigint::BigInt;
use num_traits::Signed;

use super::Int;
use super::limbs::{BigOperand, Limbs};
use crate::raise::{Exit, Outcome};
use crate::value::Value;
use crate::vm::Vm;

/// A bitwise operation on two integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BitOperation {
    /// Bits set in both.
    And,
    /// Bits set in either.
    Or,
    /// Bits set in exactly one.
    Xor,
}

/// Returns `a` and `b` joined bit by bit.
pub(crate) fn join(vm: &mut Vm, operation: BitOperation, a: Value, b: Value) -> Outcome {
    if let (Some(a), Some(b)) = (a.as_fixnum(), b.as_fixnum()) {
        // Fixnums in two's complement are closed under all of these.
        let joined = match operation {
            BitOperation::And => a & b,
            BitOperation::Or => a | b,
            BitOperation::Xor => a ^ b,
        };
        return Ok(Value::fixnum(joined).unwrap_or(Value::NIL));
    }
    let (a, b) = (vm.integer(a)?, vm.integer(b)?);
    vm.exchange.charge(a.len() + b.len());
    vm.integer_value("LOGAND", &a.joined(operation, &b))
}

/// Implements `(lognot a)`.
pub(crate) fn complement(vm: &mut Vm, a: Value) -> Outcome {
    let a = vm.integer(a)?;
    vm.exchange.charge(a.len());
    vm.integer_value("LOGNOT", &a.complement())
}

/// Implements `(ash a count)`.
pub(crate) fn shift(vm: &mut Vm, a: Value, count: Value) -> Outcome {
    if let Some(distance) = count.as_fixnum()
        && let Some((bits, is_negative)) = magnitude_bits(vm, a)
        && (distance >= 0 || !is_negative)
    {
        let limbs = (bits / 64) as usize;
        if distance > 0 && bits > 0 {
            vm.check_bits("ASH", bits + distance.unsigned_abs())?;
            vm.exchange.charge(limbs + distance as usize / 64);
        } else {
            vm.exchange.charge(limbs);
        }
        let shifted = BigOperand::of(&vm.heap, a, &mut [0]).map(|n| match u64::try_from(distance) {
            Ok(shift) if bits > 0 => n.shifted_left(shift),
            Ok(_) => Limbs::new(),
            Err(_) => n.field(distance.unsigned_abs(), u64::MAX),
        });
        return vm.limbs_value("ASH", is_negative, &shifted.unwrap_or_default());
    }
    let (n, count) = (vm.integer(a)?, vm.integer(count)?);
    vm.exchange.charge(n.len());
    if n.is_zero() {
        return Ok(a);
    }
    if count.is_negative() {
        let shift = u64::try_from(count.negated().to_big()).unwrap_or(u64::MAX);
        return vm.integer_value("ASH", &n.shifted_right(shift));
    }
    // A count beyond 64 bits exceeds the limit in any case.
    let shift = u64::try_from(count.to_big()).unwrap_or(u64::MAX >> 1).min(u64::MAX >> 1);
    vm.check_bits("ASH", n.bits() + shift)?;
    vm.exchange.charge(shift as usize / 64);
    vm.integer_value("ASH", &n.shifted_left(shift))
}

/// Implements `(logbitp index a)`: an index past the last bit sees the sign.
pub(crate) fn bit(vm: &mut Vm, index: Value, a: Value) -> Result<bool, Exit> {
    let n = vm.integer(a)?;
    match Int::of(&vm.heap, index) {
        Some(index) if !index.is_negative() => Ok(match u64::try_from(index.to_big()) {
            Ok(index) => n.bit(index),
            Err(_) => n.is_negative(),
        }),
        _ => vm.exchange.type_error(index, "UNSIGNED-BYTE"),
    }
}

/// Returns the length of the magnitude of an integer in bits, and whether the integer is negative. `None` for
/// any other value.
fn magnitude_bits(vm: &Vm, v: Value) -> Option<(u64, bool)> {
    BigOperand::of(&vm.heap, v, &mut [0]).map(|n| (n.bits(), n.is_negative()))
}

/// Returns `size` bits of `a` from bit `position` up, as an integer that is not negative.
pub(crate) fn field(vm: &mut Vm, size: u64, position: u64, a: Value) -> Outcome {
    if let Some((bits, false)) = magnitude_bits(vm, a) {
        vm.exchange.charge((size.min(bits) / 64) as usize);
        let field = BigOperand::of(&vm.heap, a, &mut [0]).map(|n| n.field(position, size));
        return vm.limbs_value("LDB", false, &field.unwrap_or_default());
    }
    let n = vm.integer(a)?;
    vm.check_bits("LDB", size)?;
    vm.exchange.charge(n.len() + size as usize / 64);
    let field = n.shifted_right(position).joined(BitOperation::And, &mask(size));
    vm.integer_value("LDB", &field)
}

/// Returns `a` with the field of `size` bits from `position` up replaced by the lowest bits of `new`.
pub(crate) fn deposit(vm: &mut Vm, new: &Int, size: u64, position: u64, a: &Int) -> Result<Int, Exit> {
    if size == 0 {
        return Ok(a.clone());
    }
    vm.check_bits("DPB", size.saturating_add(position))?;
    vm.exchange.charge(a.len() + (size + position) as usize / 64);
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
    pub(crate) fn joined(&self, operation: BitOperation, other: &Int) -> Int {
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
    pub(crate) fn complement(&self) -> Int {
        match self {
            Int::Small(n) => Int::Small(!n),
            Int::Big(n) => Int::from_big(-BigInt::from(1) - n),
        }
    }

    /// Returns the bit at `index`.
    pub(crate) fn bit(&self, index: u64) -> bool {
        match self {
            Int::Small(n) => n >> index.min(127) & 1 == 1,
            Int::Big(n) => n.bit(index),
        }
    }

    /// Returns the number of ones of an integer that is not negative, of zeros of a negative one.
    pub(crate) fn count_bits(&self) -> u64 {
        let ones = |n: &BigInt| n.iter_u64_digits().map(|limb| u64::from(limb.count_ones())).sum();
        match self {
            Int::Small(n) => u64::from(if *n < 0 { n.count_zeros() } else { n.count_ones() }),
            Int::Big(n) if n.is_negative() => ones(&(-BigInt::from(1) - n)),
            Int::Big(n) => ones(n),
        }
    }

    /// Returns the length in two's complement, in bits, without the sign.
    pub(crate) fn length(&self) -> u64 {
        if self.is_negative() { self.complement().bits() } else { self.bits() }
    }
}
