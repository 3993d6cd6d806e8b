//! Objects without values: strings, bytes, words and the limbs of bignums. Creating them, and their elements.

use std::slice;

use super::layout::{Bignum, Bytes, Kind};
use super::{AllocError, Heap};
use crate::value::Value;

/// Sign and magnitude of a bignum.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct BignumRef<'a> {
    /// Whether the number is below zero.
    pub negative: bool,
    /// Magnitude in limbs of 64 bits, least first; the last one is not zero.
    pub limbs: &'a [u64],
}

impl Heap {
    /// Creates a string of these code points.
    pub fn alloc_string(&mut self, characters: &[u32]) -> Result<Value, AllocError> {
        self.raw_from(Kind::String, 0, characters)
    }

    /// Creates a string of `len` characters: those of `part(heap, 0)` and so on for `count` parts, and code
    /// point 0 for what they lack.
    pub fn alloc_string_of(
        &mut self,
        len: usize,
        count: usize,
        part: impl for<'a> Fn(&'a Heap, usize) -> &'a [u32],
    ) -> Result<Value, AllocError> {
        let object = self.begin_object(Kind::String, 0, 0, len)?;
        // SAFETY: `begin_object` gave room for `len` code points, which are unreachable until the value is
        // made; all are written by then.
        unsafe {
            let characters = object.add(1).cast::<u32>();
            let mut written = 0;
            for index in 0..count {
                let part = part(self, index);
                let fitting = part.len().min(len - written);
                std::ptr::copy_nonoverlapping(part.as_ptr(), characters.add(written), fitting);
                written += fitting;
            }
            for lacking in written..len {
                characters.add(lacking).write(0);
            }
            Ok(Value::from_object(object))
        }
    }

    /// Creates a string of `len` times the code point `fill`.
    pub fn alloc_string_filled(&mut self, len: usize, fill: u32) -> Result<Value, AllocError> {
        self.raw_filled(Kind::String, len, fill)
    }

    /// Creates a string with this text.
    pub fn alloc_str(&mut self, text: &str) -> Result<Value, AllocError> {
        let object = self.begin_object(Kind::String, 0, 0, text.chars().count())?;
        // SAFETY: `begin_object` gave room for as many words as `text` has characters; they are written
        // before the value is made.
        unsafe {
            let characters = object.add(1).cast::<u32>();
            for (i, c) in text.chars().enumerate() {
                characters.add(i).write(c as u32);
            }
            Ok(Value::from_object(object))
        }
    }

    /// Creates a bignum. Leading zero limbs are cut off; the caller sees to it that the number is not a
    /// fixnum.
    pub fn alloc_bignum(&mut self, negative: bool, limbs: &[u64]) -> Result<Value, AllocError> {
        let significant = limbs.iter().rposition(|&limb| limb != 0).map_or(0, |last| last + 1);
        let flags = if negative { Bignum::NEGATIVE } else { 0 };
        self.raw_from(Kind::Bignum, flags, &limbs[..significant])
    }

    /// Creates a Words32 object of `len` elements, all `fill`.
    pub fn alloc_words(&mut self, len: usize, fill: u32) -> Result<Value, AllocError> {
        self.raw_filled(Kind::Words32, len, fill)
    }

    /// Creates a Words64 object of `len` elements, all 0.
    pub(crate) fn alloc_words64(&mut self, len: usize) -> Result<Value, AllocError> {
        self.raw_filled(Kind::Words64, len, 0u64)
    }

    /// Creates a Bytes object of these bytes.
    pub fn alloc_bytes(&mut self, bytes: &[u8]) -> Result<Value, AllocError> {
        self.raw_from(Kind::Bytes, 0, bytes)
    }

    /// Creates a Bytes object of `len` bytes, all `fill`.
    pub fn alloc_bytes_filled(&mut self, len: usize, fill: u8) -> Result<Value, AllocError> {
        self.raw_filled(Kind::Bytes, len, fill)
    }

    /// Creates a Bytes object of bits. Bytes above 1 become 1.
    pub fn alloc_bits(&mut self, bits: &[u8]) -> Result<Value, AllocError> {
        let bits: Vec<u8> = bits.iter().map(|&bit| bit.min(1)).collect();
        self.raw_from(Kind::Bytes, Bytes::BITS, &bits)
    }

    /// Creates a Bytes object of `len` bits.
    pub fn alloc_bits_filled(&mut self, len: usize, fill: bool) -> Result<Value, AllocError> {
        self.raw_filled_with(Kind::Bytes, Bytes::BITS, len, u8::from(fill))
    }

    fn raw_from<T: Copy>(&mut self, kind: Kind, flags: u8, elements: &[T]) -> Result<Value, AllocError> {
        debug_assert!(kind.is_raw() && 1 << kind.element_shift() == size_of::<T>());
        let object = self.begin_object(kind, flags, 0, elements.len())?;
        // SAFETY: `begin_object` gave room for as many elements of this size; they are written before the
        // value is made.
        unsafe {
            std::ptr::copy_nonoverlapping(elements.as_ptr(), object.add(1).cast::<T>(), elements.len());
            Ok(Value::from_object(object))
        }
    }

    fn raw_filled<T: Copy>(&mut self, kind: Kind, len: usize, fill: T) -> Result<Value, AllocError> {
        self.raw_filled_with(kind, 0, len, fill)
    }

    fn raw_filled_with<T: Copy>(
        &mut self,
        kind: Kind,
        flags: u8,
        len: usize,
        fill: T,
    ) -> Result<Value, AllocError> {
        debug_assert!(kind.is_raw() && 1 << kind.element_shift() == size_of::<T>());
        let object = self.begin_object(kind, flags, 0, len)?;
        // SAFETY: `begin_object` gave room for `len` elements of this size; they are written before the value
        // is made.
        unsafe {
            let elements = object.add(1).cast::<T>();
            for i in 0..len {
                elements.add(i).write(fill);
            }
            Ok(Value::from_object(object))
        }
    }

    /// Returns sign and limbs of a bignum.
    pub fn bignum(&self, v: Value) -> Option<BignumRef<'_>> {
        let limbs = self.raw(v, Kind::Bignum)?;
        Some(BignumRef { negative: self.header(v)?.flags & Bignum::NEGATIVE != 0, limbs })
    }

    /// Returns the code points of a string.
    #[inline(always)]
    pub fn string(&self, v: Value) -> Option<&[u32]> {
        self.raw(v, Kind::String)
    }

    /// Returns the code points of a string, to be changed in place.
    #[inline(always)]
    pub fn string_mut(&mut self, v: Value) -> Option<&mut [u32]> {
        self.raw_mut(v, Kind::String)
    }

    /// Returns the text of a string; U+FFFD stands for a code point that is not a Unicode scalar value.
    pub fn string_text(&self, v: Value) -> Option<String> {
        let characters = self.string(v)?;
        // Most texts are ASCII, and copied faster than characters are encoded one by one.
        if characters.iter().fold(0, |all, code| all | code) < 0x80 {
            return String::from_utf8(characters.iter().map(|&code| code as u8).collect()).ok();
        }
        let text = |&code: &u32| char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER);
        Some(characters.iter().map(text).collect())
    }

    /// Returns the elements of a Words32 object.
    #[inline(always)]
    pub fn words(&self, v: Value) -> Option<&[u32]> {
        self.raw(v, Kind::Words32)
    }

    /// Returns the elements of a Words32 object, to be changed in place.
    #[inline(always)]
    pub fn words_mut(&mut self, v: Value) -> Option<&mut [u32]> {
        self.raw_mut(v, Kind::Words32)
    }

    /// Returns the elements of a Bytes object.
    pub fn bytes(&self, v: Value) -> Option<&[u8]> {
        self.raw(v, Kind::Bytes)
    }

    /// Returns whether `v` is a Bytes object of bits.
    pub fn is_bits(&self, v: Value) -> bool {
        self.flags(v, Kind::Bytes).is_some_and(|flags| flags & Bytes::BITS != 0)
    }

    /// Returns the elements of a Bytes object, to be changed in place. The caller keeps bits bits.
    pub fn bytes_mut(&mut self, v: Value) -> Option<&mut [u8]> {
        self.raw_mut(v, Kind::Bytes)
    }

    /// Returns the elements of a raw object. `T` must be the integer of their size.
    #[inline(always)]
    fn raw<T: RawElement>(&self, v: Value, kind: Kind) -> Option<&[T]> {
        debug_assert!(kind.is_raw() && 1 << kind.element_shift() == size_of::<T>());
        let object = self.object_of(v, kind)?;
        // SAFETY: H3: a raw object has `len` elements of this size, of a type without invalid patterns; H5:
        // they are borrowed with the heap.
        Some(unsafe { slice::from_raw_parts(object.add(1).cast(), (*object).len as usize) })
    }

    #[inline(always)]
    fn raw_mut<T: RawElement>(&mut self, v: Value, kind: Kind) -> Option<&mut [T]> {
        debug_assert!(kind.is_raw() && 1 << kind.element_shift() == size_of::<T>());
        let object = self.object_of(v, kind)?;
        // SAFETY: H3: a raw object has `len` elements of this size, of a type without invalid patterns; H5:
        // the heap is borrowed mutably, so nothing else refers to them.
        Some(unsafe { slice::from_raw_parts_mut(object.add(1).cast(), (*object).len as usize) })
    }
}

/// An element of a raw object.
trait RawElement: Copy {}
impl RawElement for u8 {}
impl RawElement for u32 {}
impl RawElement for u64 {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strings_are_made_of_parts_of_others() {
        let mut heap = Heap::for_tests();
        let word = heap.alloc_str("word").unwrap();
        let joined = heap.alloc_string_of(6, 2, |heap, part| &heap.string(word).unwrap()[part + 1..]);
        assert_eq!(heap.string_text(joined.unwrap()).unwrap(), "ordrd\0");
        let cut = heap.alloc_string_of(3, 2, |heap, _| heap.string(word).unwrap());
        assert_eq!(heap.string_text(cut.unwrap()).unwrap(), "wor");
    }
}
