//! Arithmetic on doubles, for the loop.
//!
//! A double in a register of the frame is decoded, used and encoded without leaving the vector unit where
//! there is one: the way through general registers and back takes as long as a multiplication, and programs
//! wait for it, since the result of one operation is what the next one needs.
//!
//! Not here: comparisons, whose results no operation waits for, and doubles in boxes, which are the numeric
//! tower's.
#![allow(unsafe_code)]

use crate::value::Value;

#[cfg(all(target_arch = "x86_64", not(miri)))]
mod register {
    use std::arch::asm;

    use crate::value::Value;

    /// Operand in memory, in the form that instructions of the vector unit need.
    #[repr(align(16))]
    struct VectorOperand(#[expect(dead_code, reason = "read by instructions only")] [u64; 2]);

    static BIAS: VectorOperand = VectorOperand([Value::DOUBLE_BIAS, 0]);

    /// Returns the double in a register, of which [`Value::is_windowed_double`] is true.
    ///
    /// # Safety
    /// `register` points to a value.
    #[inline(always)]
    pub(in super::super) unsafe fn load(register: *const Value) -> f64 {
        let x: f64;
        // SAFETY: the code reads the 8 bytes of a value, by the contract, and `BIAS`; it writes registers
        // only: a rotation to the right, less the bias. As intrinsics, this would be compiled to the way
        // through general registers again.
        unsafe {
            asm!(
                "movq {x}, qword ptr [{register}]",
                "movdqa {low}, {x}",
                "psrlq {x}, 3",
                "psllq {low}, 61",
                "por {x}, {low}",
                "psubq {x}, xmmword ptr [rip + {bias}]",
                register = in(reg) register,
                x = out(xmm_reg) x,
                low = out(xmm_reg) _,
                bias = sym BIAS,
                options(pure, readonly, nostack, preserves_flags),
            );
        }
        x
    }

    /// Puts a double into a register, if it is one that needs no box and has no constant of its own.
    ///
    /// # Safety
    /// `register` points to a place for a value.
    #[inline(always)]
    pub(in super::super) unsafe fn store(register: *mut Value, x: f64) -> bool {
        let (word, bits): (f64, u64);
        // SAFETY: the code reads `BIAS` and writes registers only: the bias is added, and a rotation to the
        // left follows.
        unsafe {
            asm!(
                "paddq {x}, xmmword ptr [rip + {bias}]",
                "movdqa {high}, {x}",
                "psllq {x}, 3",
                "psrlq {high}, 61",
                "por {x}, {high}",
                "movq {bits}, {x}",
                x = inout(xmm_reg) x => word,
                high = out(xmm_reg) _,
                bits = out(reg) bits,
                bias = sym BIAS,
                options(pure, readonly, nostack, preserves_flags),
            );
        }
        if bits & 3 != 3 {
            return false;
        }
        // SAFETY: by the contract there is a place for a value; the word is that of a double.
        unsafe { *register.cast::<f64>() = word };
        true
    }
}

#[cfg(not(all(target_arch = "x86_64", not(miri))))]
mod register {
    use crate::value::Value;

    /// Returns the double in a register, of which [`Value::is_windowed_double`] is true.
    ///
    /// # Safety
    /// `register` points to a value.
    #[inline(always)]
    pub(in super::super) unsafe fn load(register: *const Value) -> f64 {
        // SAFETY: by the contract there is a value.
        unsafe { (*register).windowed_double() }
    }

    /// Puts a double into a register, if it is one that needs no box and has no constant of its own.
    ///
    /// # Safety
    /// `register` points to a place for a value.
    #[inline(always)]
    pub(in super::super) unsafe fn store(register: *mut Value, x: f64) -> bool {
        match Value::double(x).filter(|v| v.is_windowed_double()) {
            // SAFETY: by the contract there is a place for a value.
            Some(v) => unsafe { *register = v },
            None => return false,
        }
        true
    }
}

pub(super) use register::{load, store};

/// The operations between a double and a fixnum, and on the doubles that have a constant of their own (zeros,
/// above all): too long for the loop, too common for the way that all numbers take. They are leaves, so that
/// the loop's registers stay where they are. Each gives `UNBOUND` for what it leaves to the numeric tower:
/// other operands, results that need a box, and those that fail.
macro_rules! define_mixed {
    ($($name:ident $operator:tt;)*) => { $(
        #[inline(never)]
        pub(super) fn $name(a: Value, b: Value) -> Value {
            match (unboxed(a), unboxed(b)) {
                (Some(x), Some(y)) if !Value::both_fixnums(a, b) => encoded(x $operator y),
                _ => Value::UNBOUND,
            }
        }
    )* };
}

define_mixed! {
    mixed_add +;
    mixed_subtract -;
    mixed_multiply *;
    mixed_divide /;
}

/// Returns a double without a box, or a fixnum, as a double.
#[inline(always)]
fn unboxed(v: Value) -> Option<f64> {
    match v.as_fixnum() {
        Some(n) => Some(n as f64),
        None => v.as_double(),
    }
}

/// Returns a finite double that needs no box, or `UNBOUND`.
#[inline(always)]
fn encoded(x: f64) -> Value {
    match Value::double(x) {
        Some(v) if v.is_windowed_double() => v,
        Some(v) if x == 0.0 => v,
        _ => Value::UNBOUND,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_hold_what_values_of_doubles_hold() {
        for exponent in 0..2048u64 {
            for low in [0, 1, 0x000F_FFFF_FFFF_FFFF, 1 << 63] {
                let x = f64::from_bits(exponent << 52 | low);
                let mut register = Value::NIL;
                // SAFETY: the register is a local variable.
                let (is_stored, back) = unsafe { (store(&raw mut register, x), load(&raw const register)) };
                let expected = Value::double(x).filter(|v| v.is_windowed_double());
                assert_eq!(is_stored.then_some(register), expected, "{x:e}");
                if is_stored {
                    assert_eq!(back.to_bits(), x.to_bits());
                }
            }
        }
    }

    #[test]
    fn mixed_operations_leave_what_fails_to_the_tower() {
        let double = |x| Value::double(x).unwrap();
        assert_eq!(mixed_add(Value::small(1), double(0.5)), double(1.5));
        assert_eq!(mixed_subtract(double(0.0), Value::small(2)), double(-2.0));
        assert_eq!(mixed_multiply(double(0.0), double(3.0)), Value::POSITIVE_ZERO);
        assert_eq!(mixed_divide(Value::small(1), double(4.0)), double(0.25));
        for (a, b) in [
            (Value::small(1), Value::small(2)),
            (double(1.0), Value::small(0)),
            (Value::NIL, double(1.0)),
            (Value::INFINITY, double(1.0)),
        ] {
            assert_eq!(mixed_divide(a, b), Value::UNBOUND);
        }
    }
}
