//! Values, as C makes and reads them.

use std::ffi::c_char;
use std::ptr;

use esl::Data;
use esl::data::PackedVector;

use crate::border::{
    elements, free_text, freeing, give_text, guarded, hand, look_within, making, store, take, text,
};
use crate::failure::{Fault, c_text, esl_failure};
use crate::listed::values;
use crate::status::esl_status::{self, ESL_NOT_OF_TYPE};

/// A value from a program, or for one: numbers, texts, symbols, lists, vectors.
///
/// A value that a function returns as `esl_value *` belongs to the caller, who frees it; one that comes as
/// `const esl_value *` is a part of something else and lives as long as that. Values are never changed, and
/// may be read from several threads at a time.
#[repr(transparent)]
pub struct esl_value(pub(crate) Data);

/// Kinds of values.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum esl_kind {
    /// `NIL`: false, and the empty list.
    ESL_NIL = 0,
    /// `T`: true.
    ESL_TRUE = 1,
    /// An integer of 64 bits.
    ESL_INTEGER = 2,
    /// A larger integer; `esl_value_print` writes it.
    ESL_BIG_INTEGER = 3,
    /// A ratio; `esl_value_print` writes it.
    ESL_RATIO = 4,
    /// A double float.
    ESL_FLOAT = 5,
    /// A character; its text is that character.
    ESL_CHARACTER = 6,
    /// A string.
    ESL_STRING = 7,
    /// A keyword; its text is its name.
    ESL_KEYWORD = 8,
    /// Another symbol; its text is its name.
    ESL_SYMBOL = 9,
    /// A proper list, not empty.
    ESL_LIST = 10,
    /// A list whose last `cdr` is not `NIL`, which is its last item here.
    ESL_DOTTED_LIST = 11,
    /// A vector.
    ESL_VECTOR = 12,
    /// A vector of bytes.
    ESL_BYTES = 13,
    /// A vector of integers of 64 bits.
    ESL_INTEGERS = 14,
    /// A vector of double floats.
    ESL_FLOATS = 15,
    /// An object of the embedder's.
    ESL_HOST_OBJECT = 16,
    /// A hash table that compares its keys by `eq`, `eql` or `equal`; its items are its keys, each followed
    /// by its value.
    ESL_TABLE = 17,
}

use esl_kind::*;

/// Creates `NIL`. From any thread, as all functions for values.
#[unsafe(no_mangle)]
pub extern "C" fn esl_nil() -> *mut esl_value {
    making(|| Ok(esl_value(Data::Nil)))
}

/// Creates `T` or `NIL`.
#[unsafe(no_mangle)]
pub extern "C" fn esl_boolean(value: bool) -> *mut esl_value {
    making(|| Ok(esl_value(Data::boolean(value))))
}

/// Creates an integer. `esl_value_read` makes larger ones.
#[unsafe(no_mangle)]
pub extern "C" fn esl_integer(value: i64) -> *mut esl_value {
    making(|| Ok(esl_value(Data::Integer(value))))
}

/// Creates a double float.
#[unsafe(no_mangle)]
pub extern "C" fn esl_float(value: f64) -> *mut esl_value {
    making(|| Ok(esl_value(Data::Float(value))))
}

/// Creates a value of a text.
///
/// # Safety
/// `text` is a text with a null character at its end, or null.
unsafe fn of_text(text: *const c_char, make: impl FnOnce(&str) -> Data) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(make(unsafe { self::text(text, "text") }?))))
}

/// Creates a string. Returns null unless the text is UTF-8.
///
/// # Safety
/// `text` is a text with a null character at its end, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_string(text: *const c_char) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { of_text(text, |text| Data::String(text.into())) }
}

/// Creates the keyword of this name, in any case: of "on" `:ON`.
///
/// # Safety
/// `text` is a text with a null character at its end, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_keyword(text: *const c_char) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { of_text(text, |text| Data::Keyword(text.trim_start_matches(':').to_uppercase())) }
}

/// Creates the symbol of this name, in any case, in the package `ESL-USER`.
///
/// # Safety
/// `text` is a text with a null character at its end, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_symbol(text: *const c_char) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { of_text(text, |text| Data::Symbol(text.to_uppercase())) }
}

/// Creates a string of `length` bytes of UTF-8, which may have null characters. Returns null if they are not.
///
/// # Safety
/// `text` points to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_string_of_length(text: *const c_char, length: usize) -> *mut esl_value {
    making(|| {
        // SAFETY: each pointer is null, or to what C holds and lends.
        let bytes = unsafe { elements(text.cast::<u8>(), length, "text") }?;
        let text = std::str::from_utf8(bytes)
            .map_err(|_| Fault::new(ESL_NOT_OF_TYPE, "the text is not valid UTF-8"))?;
        Ok(esl_value(Data::String(text.into())))
    })
}

/// Creates a vector of bytes.
///
/// # Safety
/// `items` points to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_bytes(items: *const u8, count: usize) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(Data::from(unsafe { elements(items, count, "elements") }?))))
}

/// Creates a vector of integers.
///
/// # Safety
/// `items` points to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_integers(items: *const i64, count: usize) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(Data::from(unsafe { elements(items, count, "elements") }?))))
}

/// Creates a vector of double floats.
///
/// # Safety
/// `items` points to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_floats(items: *const f64, count: usize) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(Data::from(unsafe { elements(items, count, "elements") }?))))
}

/// Creates a vector of floats, which are double floats in the program.
///
/// # Safety
/// `items` points to `count` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_floats_of_singles(items: *const f32, count: usize) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(Data::from(unsafe { elements(items, count, "elements") }?))))
}

/// Creates a list of `count` values, which are copied: `NIL` if there are none. Returns null if one is null.
///
/// # Safety
/// `items` points to `count` values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_list(items: *const *const esl_value, count: usize) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(Data::list(unsafe { values(items, count) }?))))
}

/// Creates a vector of `count` values, which are copied. Returns null if one is null.
///
/// # Safety
/// `items` points to `count` values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_vector(items: *const *const esl_value, count: usize) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(Data::Vector(unsafe { values(items, count) }?))))
}

/// Creates a hash table of `count` keys and as many values, which are copied: `items` has each key, followed
/// by its value. The program compares the keys by `equal`; of equal keys, the last one counts. Returns null
/// if one is null.
///
/// # Safety
/// `items` points to twice `count` values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_table(items: *const *const esl_value, count: usize) -> *mut esl_value {
    making(|| {
        let both = count.checked_mul(2).ok_or_else(|| Fault::new(ESL_NOT_OF_TYPE, "too many keys"))?;
        // SAFETY: each pointer is null, or to what C holds and lends.
        let mut items = unsafe { values(items, both) }?.into_iter();
        let mut entries = Vec::with_capacity(count);
        while let (Some(key), Some(value)) = (items.next(), items.next()) {
            entries.push((key, value));
        }
        Ok(esl_value(Data::Table(entries)))
    })
}

/// Reads a value as programs write it: "(at ?robot (3.5 :north))".
///
/// # Safety
/// `text` is a text with a null character at its end; `value` and `failure` are places that can be written,
/// or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_read(
    text: *const c_char,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let read: Data = self::text(text, "text")?.parse().map_err(Fault::from)?;
            hand(value, esl_value(read));
            Ok(())
        })
    }
}

/// Copies a value. Returns null for null.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_copy(value: *const esl_value) -> *mut esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_value(unsafe { look_within(value) }?.0.clone())))
}

/// Frees a value that belongs to the caller; null is ignored.
///
/// # Safety
/// `value` was not freed before, and is not a part of something else.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_free(value: *mut esl_value) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(value) }));
}

/// Returns the kind of a value; `ESL_NIL` for null.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_kind(value: *const esl_value) -> esl_kind {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let Some(value) = (unsafe { value.as_ref() }) else { return ESL_NIL };
    match &value.0 {
        Data::Nil => ESL_NIL,
        Data::True => ESL_TRUE,
        Data::Integer(_) => ESL_INTEGER,
        Data::BigInteger(_) => ESL_BIG_INTEGER,
        Data::Ratio(..) => ESL_RATIO,
        Data::Float(_) => ESL_FLOAT,
        Data::Character(_) => ESL_CHARACTER,
        Data::String(_) => ESL_STRING,
        Data::Keyword(_) => ESL_KEYWORD,
        Data::Symbol(_) => ESL_SYMBOL,
        Data::List(_) => ESL_LIST,
        Data::DottedList(..) => ESL_DOTTED_LIST,
        Data::Vector(_) => ESL_VECTOR,
        Data::Packed(PackedVector::Bytes(_)) => ESL_BYTES,
        Data::Packed(PackedVector::Integers(_)) => ESL_INTEGERS,
        Data::Packed(PackedVector::Floats(_)) => ESL_FLOATS,
        Data::Opaque(_) => ESL_HOST_OBJECT,
        Data::Table(_) => ESL_TABLE,
    }
}

/// Returns whether a value counts as true: whether it is neither `NIL` nor null.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_is_true(value: *const esl_value) -> bool {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { value.as_ref() }.is_some_and(|value| value.0.is_true())
}

/// Reads a value as a type of C.
///
/// # Safety
/// `value` is a value or null, and `result` a place that can be written.
unsafe fn read<T>(value: *const esl_value, result: *mut T, read: impl FnOnce(&Data) -> Option<T>) -> bool {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let Some(read) = (unsafe { value.as_ref() }).and_then(|value| read(&value.0)) else { return false };
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { store(result, read) };
    true
}

/// Reads an integer of 64 bits.
/// Returns false, and stores nothing, for other values.
///
/// # Safety
/// `value` is a value or null, and `result` a place that can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_integer(value: *const esl_value, result: *mut i64) -> bool {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { read(value, result, |data| data.as_integer()) }
}

/// Reads a float, or an integer of 64 bits as one.
/// Returns false, and stores nothing, for other values.
///
/// # Safety
/// `value` is a value or null, and `result` a place that can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_float(value: *const esl_value, result: *mut f64) -> bool {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { read(value, result, |data| data.as_float()) }
}

/// Shows the elements of a value in place.
///
/// # Safety
/// `value` is a value or null, and `length` a place that can be written, or null.
unsafe fn show<T>(
    value: *const esl_value,
    length: *mut usize,
    show: impl FnOnce(&Data) -> Option<&[T]>,
) -> *const T {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let shown = unsafe { value.as_ref() }.and_then(|value| show(&value.0));
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { store(length, shown.map_or(0, <[T]>::len)) };
    shown.map_or(ptr::null(), <[T]>::as_ptr)
}

/// Shows the bytes of a vector of bytes.
/// The result is a part of the value; it is null, with 0 in `length`, for other values.
///
/// # Safety
/// `value` is a value or null, and `length` a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_bytes(value: *const esl_value, length: *mut usize) -> *const u8 {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { show(value, length, |data| data.as_bytes().map(|bytes| &bytes[..])) }
}

/// Shows the integers of a vector of integers.
/// The result is a part of the value; it is null, with 0 in `length`, for other values.
///
/// # Safety
/// `value` is a value or null, and `length` a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_integers(value: *const esl_value, length: *mut usize) -> *const i64 {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        show(value, length, |data| match data {
            Data::Packed(PackedVector::Integers(integers)) => Some(&integers[..]),
            _ => None,
        })
    }
}

/// Shows the floats of a vector of double floats.
/// The result is a part of the value; it is null, with 0 in `length`, for other values.
///
/// # Safety
/// `value` is a value or null, and `length` a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_floats(value: *const esl_value, length: *mut usize) -> *const f64 {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { show(value, length, |data| data.as_floats()) }
}

/// Shows the text of a string, or the name of a keyword or symbol, in UTF-8. It has no null character at
/// its end; `esl_value_text` copies it with one.
/// The result is a part of the value; it is null, with 0 in `length`, for other values.
///
/// # Safety
/// `value` is a value or null, and `length` a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_text_bytes(value: *const esl_value, length: *mut usize) -> *const u8 {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        show(value, length, |data| match data {
            Data::String(text) | Data::Keyword(text) | Data::Symbol(text) => Some(text.as_bytes()),
            _ => None,
        })
    }
}

/// Returns the number of items of a list, vector or table, two for each key; 0 for other values.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_count(value: *const esl_value) -> usize {
    // SAFETY: each pointer is null, or to what C holds and lends.
    match unsafe { value.as_ref() }.map(|value| &value.0) {
        Some(Data::List(items) | Data::Vector(items)) => items.len(),
        Some(Data::DottedList(items, _)) => items.len() + 1,
        Some(Data::Packed(vector)) => vector.len(),
        Some(Data::Table(entries)) => 2 * entries.len(),
        _ => 0,
    }
}

/// Returns an item of a list, vector or table, from 0. It is a part of the value. Returns null beyond the
/// last, and for vectors of numbers, whose elements other functions show.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_item(value: *const esl_value, index: usize) -> *const esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let item = match unsafe { value.as_ref() }.map(|value| &value.0) {
        Some(Data::List(items) | Data::Vector(items)) => items.get(index),
        Some(Data::DottedList(items, tail)) if index == items.len() => Some(&**tail),
        Some(Data::DottedList(items, _)) => items.get(index),
        Some(Data::Table(entries)) => {
            entries.get(index / 2).map(|(key, value)| if index.is_multiple_of(2) { key } else { value })
        }
        _ => None,
    };
    // A value is nothing but its data, as `repr(transparent)` says.
    item.map_or(ptr::null(), |data| ptr::from_ref(data).cast())
}

/// Copies the text of a string or a character, or the name of a keyword or symbol, for `esl_text_free`. Null
/// characters in it become U+FFFD. Returns null for other values.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_text(value: *const esl_value) -> *mut c_char {
    // SAFETY: each pointer is null, or to what C holds and lends.
    match unsafe { value.as_ref() }.map(|value| &value.0) {
        Some(Data::String(text) | Data::Keyword(text) | Data::Symbol(text)) => give_text(c_text(text)),
        Some(Data::Character(character)) => give_text(c_text(character.to_string())),
        _ => ptr::null_mut(),
    }
}

/// Writes a value as the program prints it, for `esl_text_free`. Returns null for null.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_print(value: *const esl_value) -> *mut c_char {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { value.as_ref() }.map_or(ptr::null_mut(), |value| give_text(c_text(value.0.to_string())))
}

/// Frees a text that belongs to the caller; null is ignored.
///
/// # Safety
/// `text` comes from a function that says so, and was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_text_free(text: *mut c_char) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { free_text(text) };
}
