//! `Value`: one 64-bit word that is any datum of a program.
//!
//! ```text
//! low bits   what                  rest of the word
//!      x00   fixnum                62-bit signed integer, shifted left by two
//!      x11   double                (bits + 3·2^60) rotated left by three, for 2^-255 <= |x| < 2^257
//!      001   cons                  address of a 16-byte `Cons`, plus one
//!      101   object                address of a `Header`, plus five
//!      010   immediate             sub-tag in bits 3..8, payload from bit 8
//!      110   handle                generation in bits 3..32, index in bits 32..64
//! ```
//!
//! Guarantees: two values are `eq` in the language exactly when their words are equal; nothing is promised
//! about boxed numbers. A word that safe code can make either has no address in it or comes from the heap.
//! Truth is one comparison with [`Value::NIL`]. Fixnums are added, subtracted and compared without untagging;
//! the test for two fixnums is `(a | b) & 3 == 0`, that for two immediate doubles `a & b & 3 == 3`.
//!
//! The two low bits of an instruction's address are clear, so the collector takes it for a fixnum; therefore
//! a stack may hold return addresses between values.
//!
//! Not here: following an address (`heap`); doubles outside the window and big integers, which are boxed
//! (`heap`); names and property lists of `nil` and `t`. The VM keeps symbol objects for these two aside: in
//! programs [`Value::NIL`] and [`Value::T`] are their only representation.
//!
//! Unsafe invariants:
//! 1. A word tagged as cons or object was made from the address of a live object of the heap of this VM
//!    ([`Value::from_cons`], [`Value::from_object`]), whose provenance was exposed.
//! 2. Everything else a word says is arithmetic on the word alone.
//!
//! Source: the float encoding is the one-range member of the family in Melançon, Serrano and Feeley 2024
//! (arXiv 2411.16544), as in CRuby's flonums; the tags follow the measurements in the design notes.

#![allow(unsafe_code)]

use crate::heap::layout::{Cons, Header};
use std::fmt;

/// A datum: a number, character or constant in the word itself, or the address of a cons or object in the
/// heap.
///
/// `==` is the language's `eq`.
#[repr(transparent)]
#[derive(Copy, Clone, PartialEq, Eq)]
pub struct Value(u64);

const _: () = assert!(size_of::<Value>() == 8 && align_of::<Value>() == 8);

/// Mask of the three tag bits.
pub const TAG_MASK: u64 = 7;
/// Tag of a cons.
pub const TAG_CONS: u64 = 1;
/// Tag of a heap object with a header.
pub const TAG_OBJECT: u64 = 5;
/// Tag of an immediate constant or character.
pub const TAG_IMMEDIATE: u64 = 2;
/// Tag of a handle.
pub const TAG_HANDLE: u64 = 6;

const SUB_NIL: u64 = 0;
const SUB_T: u64 = 1;
const SUB_UNBOUND: u64 = 2;
const SUB_UNSUPPLIED: u64 = 3;
const SUB_EOF: u64 = 4;
const SUB_CHARACTER: u64 = 5;
const SUB_POSITIVE_ZERO: u64 = 6;
const SUB_NEGATIVE_ZERO: u64 = 7;
const SUB_INFINITY: u64 = 8;
const SUB_NEGATIVE_INFINITY: u64 = 9;
const SUB_NAN: u64 = 10;
const SUB_TERM: u64 = 29;
const SUB_VARIABLE: u64 = 30;
const SUB_POISON: u64 = 31;

const fn immediate(sub: u64, payload: u64) -> Value {
    Value(payload << 8 | sub << 3 | TAG_IMMEDIATE)
}

impl Value {
    /// Added to the bits of a double to move the exponents of the window to the two patterns that the
    /// rotation turns into the tag.
    pub const DOUBLE_BIAS: u64 = 3 << 60;

    /// The empty list and falsehood.
    pub const NIL: Value = immediate(SUB_NIL, 0);
    /// Truth.
    pub const T: Value = immediate(SUB_T, 0);
    /// Content of a variable without a value. Never seen by a program.
    pub const UNBOUND: Value = immediate(SUB_UNBOUND, 0);
    /// Content of a parameter that got no argument. Never seen by a program.
    pub const UNSUPPLIED: Value = immediate(SUB_UNSUPPLIED, 0);
    /// Result of reading past the end. Never seen by a program.
    pub const EOF: Value = immediate(SUB_EOF, 0);
    /// The double `+0.0`.
    pub const POSITIVE_ZERO: Value = immediate(SUB_POSITIVE_ZERO, 0);
    /// The double `-0.0`.
    pub const NEGATIVE_ZERO: Value = immediate(SUB_NEGATIVE_ZERO, 0);
    /// The double positive infinity.
    pub const INFINITY: Value = immediate(SUB_INFINITY, 0);
    /// The double negative infinity.
    pub const NEGATIVE_INFINITY: Value = immediate(SUB_NEGATIVE_INFINITY, 0);
    /// The only NaN; payloads of other NaNs are dropped.
    pub const NAN: Value = immediate(SUB_NAN, 0);
    /// Written over freed memory by debug builds. No live object holds it.
    pub const POISON: Value = immediate(SUB_POISON, 0xBAD_F00D);

    /// Least fixnum, −2^61.
    pub const FIXNUM_MIN: i64 = -(1 << 61);
    /// Greatest fixnum, 2^61 − 1.
    pub const FIXNUM_MAX: i64 = (1 << 61) - 1;
    /// One more than the greatest code of a character.
    pub const CHARACTER_LIMIT: u32 = 0x11_0000;
    /// One more than the greatest generation of a handle.
    pub const GENERATION_LIMIT: u32 = 1 << 29;

    /// Returns the word itself, for the interpreter and for tables keyed by the identity of what has no
    /// address.
    ///
    /// An address must not decide anything that a program can see; see
    /// [`Heap::identity`](crate::Heap::identity) for a number that may.
    #[inline(always)]
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Returns the value with this word.
    ///
    /// # Safety
    /// The word was made by [`Value::bits`], or it has neither the tag of a cons nor that of an object.
    #[inline(always)]
    pub const unsafe fn from_bits(bits: u64) -> Value {
        Value(bits)
    }

    // Fixnums.

    /// Returns the fixnum `n`; `None` if `n` does not fit into 62 bits.
    #[inline(always)]
    pub const fn fixnum(n: i64) -> Option<Value> {
        if n >= Self::FIXNUM_MIN && n <= Self::FIXNUM_MAX { Some(Value((n << 2) as u64)) } else { None }
    }

    /// Returns the fixnum `n`, for counts and small constants.
    #[inline(always)]
    pub const fn small(n: i32) -> Value {
        Value(((n as i64) << 2) as u64)
    }

    /// Returns the fixnum for a length or index.
    ///
    /// # Panics
    /// In debug builds, if `n` is not below 2^61. No length reaches that.
    #[inline(always)]
    pub const fn index(n: usize) -> Value {
        debug_assert!(n as u64 <= Self::FIXNUM_MAX as u64);
        Value((n as u64) << 2)
    }

    /// Returns whether this is a fixnum.
    #[inline(always)]
    pub const fn is_fixnum(self) -> bool {
        self.0 & 3 == 0
    }

    /// Returns whether both are fixnums, in one test.
    #[inline(always)]
    pub const fn both_fixnums(a: Value, b: Value) -> bool {
        (a.0 | b.0) & 3 == 0
    }

    /// Returns the integer, if this is a fixnum.
    #[inline(always)]
    pub const fn as_fixnum(self) -> Option<i64> {
        if self.is_fixnum() { Some(self.0 as i64 >> 2) } else { None }
    }

    /// Returns the integer, if this is a fixnum that is not negative, and no more than an address has bits
    /// for.
    #[inline(always)]
    pub const fn as_index(self) -> Option<usize> {
        let is_index = self.is_fixnum() && self.0 as i64 >= 0 && self.0 >> 2 <= usize::MAX as u64;
        if is_index { Some((self.0 >> 2) as usize) } else { None }
    }

    // Doubles.

    /// Returns the double `x`, if it needs no box: inside the window, zero, infinite, or not a number.
    ///
    /// [`Heap::float`](crate::Heap::float) takes every double.
    #[inline(always)]
    pub const fn double(x: f64) -> Option<Value> {
        let word = x.to_bits().wrapping_add(Self::DOUBLE_BIAS).rotate_left(3);
        if word & 3 == 3 { Some(Value(word)) } else { Self::special_double(x) }
    }

    /// Returns a double that has a constant of its own.
    #[cold]
    const fn special_double(x: f64) -> Option<Value> {
        const NEGATIVE_ZERO_BITS: u64 = 1 << 63;
        match x.to_bits() {
            0 => Some(Self::POSITIVE_ZERO),
            NEGATIVE_ZERO_BITS => Some(Self::NEGATIVE_ZERO),
            _ if x.is_nan() => Some(Self::NAN),
            _ if x.is_infinite() => Some(if x > 0.0 { Self::INFINITY } else { Self::NEGATIVE_INFINITY }),
            _ => None,
        }
    }

    /// Returns whether this is a double inside the window. Zero, the infinities, NaN and boxed doubles are
    /// not.
    #[inline(always)]
    pub const fn is_windowed_double(self) -> bool {
        self.0 & 3 == 3
    }

    /// Returns whether both are doubles inside the window, in one test.
    #[inline(always)]
    pub const fn both_windowed_doubles(a: Value, b: Value) -> bool {
        a.0 & b.0 & 3 == 3
    }

    /// Returns the double, for a value that [`Value::is_windowed_double`]; any other gives an arbitrary
    /// number.
    #[inline(always)]
    pub const fn windowed_double(self) -> f64 {
        f64::from_bits(self.0.rotate_right(3).wrapping_sub(Self::DOUBLE_BIAS))
    }

    /// Returns the double, if this is one without a box. [`Heap::as_double`](crate::Heap::as_double) knows
    /// boxed ones too.
    #[inline(always)]
    pub const fn as_double(self) -> Option<f64> {
        if self.is_windowed_double() { Some(self.windowed_double()) } else { self.as_special_double() }
    }

    #[cold]
    const fn as_special_double(self) -> Option<f64> {
        match self {
            Self::POSITIVE_ZERO => Some(0.0),
            Self::NEGATIVE_ZERO => Some(-0.0),
            Self::INFINITY => Some(f64::INFINITY),
            Self::NEGATIVE_INFINITY => Some(f64::NEG_INFINITY),
            Self::NAN => Some(f64::NAN),
            _ => None,
        }
    }

    // Immediates.

    /// Returns `t` for true, `nil` for false.
    #[inline(always)]
    pub const fn boolean(b: bool) -> Value {
        if b { Self::T } else { Self::NIL }
    }

    /// Returns whether this is `nil`.
    #[inline(always)]
    pub const fn is_nil(self) -> bool {
        self.0 == Self::NIL.0
    }

    /// Returns whether this is anything but `nil`.
    #[inline(always)]
    pub const fn is_true(self) -> bool {
        !self.is_nil()
    }

    /// Returns the character with this code; `None` from [`Value::CHARACTER_LIMIT`] on. Surrogates are
    /// characters, as in SBCL.
    #[inline(always)]
    pub const fn character(code: u32) -> Option<Value> {
        if code < Self::CHARACTER_LIMIT { Some(immediate(SUB_CHARACTER, code as u64)) } else { None }
    }

    /// Returns whether this is a character.
    #[inline(always)]
    pub const fn is_character(self) -> bool {
        self.0 & 0xFF == SUB_CHARACTER << 3 | TAG_IMMEDIATE
    }

    /// Returns the code, if this is a character.
    #[inline(always)]
    pub const fn as_character(self) -> Option<u32> {
        if self.is_character() { Some((self.0 >> 8) as u32) } else { None }
    }

    // Terms of the logical database.

    /// Returns the entry with this index among the terms of the database. Never seen by a program.
    #[inline(always)]
    pub const fn term(index: u32) -> Value {
        immediate(SUB_TERM, index as u64)
    }

    /// Returns the index, if this is an entry among the terms of the database.
    #[inline(always)]
    pub const fn as_term(self) -> Option<u32> {
        if self.0 & 0xFF == SUB_TERM << 3 | TAG_IMMEDIATE { Some((self.0 >> 8) as u32) } else { None }
    }

    /// Returns the logical variable with this number. Never seen by a program.
    #[inline(always)]
    pub const fn variable(number: u32) -> Value {
        immediate(SUB_VARIABLE, number as u64)
    }

    /// Returns the number, if this is a logical variable.
    #[inline(always)]
    pub const fn as_variable(self) -> Option<u32> {
        if self.0 & 0xFF == SUB_VARIABLE << 3 | TAG_IMMEDIATE { Some((self.0 >> 8) as u32) } else { None }
    }

    // Handles.

    /// Returns the handle with this index and generation; `None` from [`Value::GENERATION_LIMIT`] on.
    #[inline(always)]
    pub const fn handle(index: u32, generation: u32) -> Option<Value> {
        if generation < Self::GENERATION_LIMIT {
            Some(Value((index as u64) << 32 | (generation as u64) << 3 | TAG_HANDLE))
        } else {
            None
        }
    }

    /// Returns index and generation, if this is a handle.
    #[inline(always)]
    pub const fn as_handle(self) -> Option<(u32, u32)> {
        if self.0 & TAG_MASK == TAG_HANDLE {
            Some(((self.0 >> 32) as u32, (self.0 as u32) >> 3))
        } else {
            None
        }
    }

    // Addresses, which the heap and the interpreter follow.

    /// Returns whether this is a cons.
    #[inline(always)]
    pub const fn is_cons(self) -> bool {
        self.0 & TAG_MASK == TAG_CONS
    }

    /// Returns whether this is a cons or `nil`.
    #[inline(always)]
    pub const fn is_list(self) -> bool {
        self.is_cons() || self.is_nil()
    }

    /// Returns whether this is an object with a header; the heap knows its kind.
    #[inline(always)]
    pub const fn is_object(self) -> bool {
        self.0 & TAG_MASK == TAG_OBJECT
    }

    /// Returns whether this is an address: a cons or an object. The collector follows these and no others.
    #[inline(always)]
    pub const fn is_address(self) -> bool {
        self.0 & 3 == 1
    }

    /// Returns the address of the cons, if this is one.
    #[inline(always)]
    pub fn as_cons_ptr(self) -> Option<*mut Cons> {
        if self.is_cons() { Some(self.cons_ptr()) } else { None }
    }

    /// Returns the address of the object, if this is one.
    #[inline(always)]
    pub fn as_object_ptr(self) -> Option<*mut Header> {
        if self.is_object() { Some(self.object_ptr()) } else { None }
    }

    /// Returns the address of the cons; any other value gives an address without meaning.
    #[inline(always)]
    pub fn cons_ptr(self) -> *mut Cons {
        debug_assert!(self.is_cons());
        std::ptr::with_exposed_provenance_mut((self.0 - TAG_CONS) as usize)
    }

    /// Returns the address of the object; any other value gives an address without meaning.
    #[inline(always)]
    pub fn object_ptr(self) -> *mut Header {
        debug_assert!(self.is_object());
        std::ptr::with_exposed_provenance_mut((self.0 - TAG_OBJECT) as usize)
    }

    /// Returns the value for the cons at `cons`.
    ///
    /// # Safety
    /// `cons` is the address of an initialised cons in the heap of this VM.
    #[inline(always)]
    pub unsafe fn from_cons(cons: *mut Cons) -> Value {
        let address = cons.expose_provenance() as u64;
        debug_assert!(address & 15 == 0);
        Value(address + TAG_CONS)
    }

    /// Returns the value for the object at `object`.
    ///
    /// # Safety
    /// `object` is the address of an object in the heap of this VM, all of it initialised.
    #[inline(always)]
    pub unsafe fn from_object(object: *mut Header) -> Value {
        let address = object.expose_provenance() as u64;
        debug_assert!(address & 15 == 0);
        Value(address + TAG_OBJECT)
    }
}

impl From<bool> for Value {
    fn from(b: bool) -> Value {
        Value::boolean(b)
    }
}

/// For developers: shows the tag and the content of the word. Addresses are shown, so no program may see
/// this.
impl fmt::Debug for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(n) = self.as_fixnum() {
            return write!(f, "{n}");
        }
        if let Some(x) = self.as_double() {
            return write!(f, "{x:?}");
        }
        if let Some(code) = self.as_character() {
            return write!(f, "#\\u+{code:X}");
        }
        if let Some((index, generation)) = self.as_handle() {
            return write!(f, "handle {index}.{generation}");
        }
        match *self {
            Value::NIL => f.write_str("nil"),
            Value::T => f.write_str("t"),
            Value::UNBOUND => f.write_str("unbound"),
            Value::UNSUPPLIED => f.write_str("unsupplied"),
            Value::EOF => f.write_str("eof"),
            Value::POISON => f.write_str("poison"),
            v if v.is_cons() => write!(f, "cons@{:x}", v.0),
            v if v.is_object() => write!(f, "object@{:x}", v.0),
            v => write!(f, "invalid {:x}", v.0),
        }
    }
}

#[cfg(test)]
mod tests;
