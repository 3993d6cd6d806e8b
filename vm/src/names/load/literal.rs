//! Literal characters, numbers and arrays as values.

use esl_bytecode::{BigInt, Integer};

use crate::heap::{AllocError, Heap};
use crate::value::Value;

pub(crate) fn character(c: char) -> Value {
    Value::character(u32::from(c)).unwrap_or(Value::NIL)
}

/// Returns an integer of any size as a value.
///
/// # Errors
/// As for every allocation.
pub(crate) fn integer(heap: &mut Heap, value: &BigInt) -> Result<Value, AllocError> {
    if let Some(fixnum) = i64::try_from(value).ok().and_then(Value::fixnum) {
        return Ok(fixnum);
    }
    let limbs: Vec<u64> = value.iter_u64_digits().collect();
    heap.alloc_bignum(value.sign() == num_bigint::Sign::Minus, &limbs)
}

/// Returns the integer of a datum as a value.
///
/// # Errors
/// As for every allocation.
pub(crate) fn integer_value(heap: &mut Heap, value: &Integer) -> Result<Value, AllocError> {
    match value.as_small().and_then(Value::fixnum) {
        Some(fixnum) => Ok(fixnum),
        None => integer(heap, &value.to_big()),
    }
}

/// Returns the integer that a value is, of any size; `None` for any other value.
pub(crate) fn integer_of(heap: &Heap, v: Value) -> Option<Integer> {
    if let Some(n) = v.as_fixnum() {
        return Some(n.into());
    }
    let big = heap.bignum(v)?;
    let bytes: Vec<u8> = big.limbs.iter().flat_map(|limb| limb.to_le_bytes()).collect();
    let sign = if big.negative { num_bigint::Sign::Minus } else { num_bigint::Sign::Plus };
    Some(BigInt::from_bytes_le(sign, &bytes).into())
}

/// Returns a ratio in lowest terms as a value.
///
/// # Errors
/// As for every allocation.
pub(crate) fn ratio(heap: &mut Heap, numerator: &BigInt, denominator: &BigInt) -> Result<Value, AllocError> {
    let numerator = integer(heap, numerator)?;
    let denominator = integer(heap, denominator)?;
    heap.alloc_ratio(numerator, denominator)
}

/// Makes a literal array of a rank other than 1.
///
/// # Errors
/// As for every allocation.
pub(crate) fn array(heap: &mut Heap, dimensions: &[u32], items: &[Value]) -> Result<Value, AllocError> {
    let data = heap.alloc_vector(items)?;
    let dimensions: Vec<Value> = dimensions.iter().map(|&size| Value::index(size as usize)).collect();
    heap.alloc_array(0, data, Value::NIL, &dimensions)
}
