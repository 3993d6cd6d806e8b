//! The border to C: pointers that come in, objects that go out, panics that stay inside.
//!
//! An object goes out as a pointer by [`give`], and comes back for good by [`take`]. Between them C holds it,
//! and [`look`] lends it to a function. Builds with debug assertions keep a list of the objects that C holds,
//! so that a second `free` and other uses of a freed object are refused instead of undefined.
//!
//! Not here: what the objects are.

use std::any::type_name;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

use crate::failure::{Fault, esl_failure};
use crate::status::esl_status::{self, ESL_INVALID_ARGUMENT, ESL_OK, ESL_PANIC};

/// Addresses and types of the objects that C holds, in builds with debug assertions.
#[cfg(debug_assertions)]
mod held {
    use std::collections::HashMap;
    use std::sync::{Mutex, MutexGuard, PoisonError};

    use super::name_of;

    static HELD: Mutex<Option<HashMap<usize, &'static str>>> = Mutex::new(None);

    fn held() -> MutexGuard<'static, Option<HashMap<usize, &'static str>>> {
        // The map is whole at every moment, so a panic elsewhere does not corrupt it.
        HELD.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn add<T>(pointer: *const T) {
        held().get_or_insert_default().insert(pointer.addr(), name_of::<T>());
    }

    pub(super) fn remove<T>(pointer: *const T) -> bool {
        let is_held = has(pointer);
        if is_held {
            held().get_or_insert_default().remove(&pointer.addr());
        }
        is_held
    }

    pub(super) fn has<T>(pointer: *const T) -> bool {
        held().get_or_insert_default().get(&pointer.addr()) == Some(&name_of::<T>())
    }
}

/// Hands an object to C.
pub(crate) fn give<T>(object: T) -> *mut T {
    let pointer = Box::into_raw(Box::new(object));
    #[cfg(debug_assertions)]
    held::add(pointer);
    pointer
}

/// Name of a type as C knows it.
fn name_of<T>() -> &'static str {
    type_name::<T>().rsplit("::").next().unwrap_or_default()
}

fn invalid(text: String) -> Fault {
    Fault::new(ESL_INVALID_ARGUMENT, text)
}

/// Takes an object back from C.
///
/// # Errors
/// A fault, if the pointer is null; in builds with debug assertions also if C does not hold that object.
///
/// # Safety
/// The pointer is null, or comes from [`give`] and was not taken since. No other thread uses the object.
pub(crate) unsafe fn take<T>(pointer: *mut T) -> Result<Box<T>, Fault> {
    if pointer.is_null() {
        return Err(invalid(format!("expected a pointer to `{}`, not a null pointer", name_of::<T>())));
    }
    #[cfg(debug_assertions)]
    if !held::remove(pointer) {
        return Err(invalid(format!("expected a live `{}`: this one was freed before", name_of::<T>())));
    }
    // SAFETY: the caller promises that the pointer is null or valid; `give` has made the pointer from a box.
    Ok(unsafe { Box::from_raw(pointer) })
}

/// Lends an object that C holds.
///
/// # Errors
/// As [`take`].
///
/// # Safety
/// The pointer is null, or comes from [`give`], and the object is not taken while the reference lives.
pub(crate) unsafe fn look<'a, T>(pointer: *const T) -> Result<&'a T, Fault> {
    #[cfg(debug_assertions)]
    if !pointer.is_null() && !held::has(pointer) {
        return Err(invalid(format!("expected a live `{}`: this one was freed before", name_of::<T>())));
    }
    // SAFETY: the caller promises that the pointer is null or valid.
    unsafe { look_within(pointer) }
}

/// Lends an object that C holds, or a part of one.
///
/// # Errors
/// A fault, if the pointer is null.
///
/// # Safety
/// As [`look`], for the object or that of which it is a part.
pub(crate) unsafe fn look_within<'a, T>(pointer: *const T) -> Result<&'a T, Fault> {
    // SAFETY: the caller promises that the pointer is null or valid.
    unsafe { pointer.as_ref() }
        .ok_or_else(|| invalid(format!("expected a pointer to `{}`, not a null pointer", name_of::<T>())))
}

/// Reads a text that ends with a null character.
///
/// # Errors
/// A fault, if the pointer is null or the text is not UTF-8; `what` names the argument.
///
/// # Safety
/// The pointer is null, or to a text with a null character at its end that does not change while the
/// reference lives.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Fault> {
    if pointer.is_null() {
        return Err(invalid(format!("expected the {what} as a text, not a null pointer")));
    }
    // SAFETY: the caller promises that the pointer is null or valid.
    let text = unsafe { CStr::from_ptr(pointer) };
    if text.to_bytes().is_ascii() {
        // SAFETY: ASCII is valid UTF-8. To see that takes a tenth of the time in which the rest is checked.
        return Ok(unsafe { str::from_utf8_unchecked(text.to_bytes()) });
    }
    text.to_str().map_err(|_| invalid(format!("the {what} is not valid UTF-8")))
}

/// Reads `length` elements.
///
/// # Errors
/// A fault, if the pointer is null and the length is not 0.
///
/// # Safety
/// The pointer is null, or to so many elements that do not change while the reference lives.
pub(crate) unsafe fn elements<'a, T>(pointer: *const T, length: usize, what: &str) -> Result<&'a [T], Fault> {
    match (pointer.is_null(), length) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(invalid(format!("expected the {what}, not a null pointer"))),
        // SAFETY: the caller promises that the pointer is null or valid.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(pointer, length) }),
    }
}

/// Hands a text to C, until [`free_text`].
pub(crate) fn give_text(text: CString) -> *mut c_char {
    let pointer = text.into_raw();
    #[cfg(debug_assertions)]
    held::add(pointer);
    pointer
}

/// Frees a text that C holds. Null is ignored; so is, in builds with debug assertions, one that C does not
/// hold.
///
/// # Safety
/// The pointer is null, or comes from [`give_text`] and was not freed since.
pub(crate) unsafe fn free_text(pointer: *mut c_char) {
    #[cfg(debug_assertions)]
    if !held::remove(pointer) {
        return;
    }
    if !pointer.is_null() {
        // SAFETY: the caller promises that the pointer is null or valid; `give_text` has made it.
        drop(unsafe { CString::from_raw(pointer) });
    }
}

/// Stores a result where the caller wants it.
///
/// # Safety
/// The pointer is null, or to a place that can be written.
pub(crate) unsafe fn store<T>(place: *mut T, value: T) {
    if !place.is_null() {
        // SAFETY: the caller promises that the pointer is null or valid.
        unsafe { place.write(value) };
    }
}

/// Hands an object to the caller, if it wants one.
///
/// # Safety
/// The pointer is null, or to a place that can be written.
pub(crate) unsafe fn hand<T>(place: *mut *mut T, object: T) {
    if !place.is_null() {
        // SAFETY: the caller promises that the pointer is null or valid.
        unsafe { place.write(give(object)) };
    }
}

/// Runs the body of a function of the API. A fault becomes a status, and a failure for the caller to read; so
/// does a panic.
///
/// # Safety
/// The pointer is null, or to a place that can be written.
pub(crate) unsafe fn guarded(
    failure: *mut *mut esl_failure,
    body: impl FnOnce() -> Result<(), Fault>,
) -> esl_status {
    // A panic that left an object half-changed is a fault of ESL, which the caller is told to report.
    let result = catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("panic without a text");
        Err(Fault::new(ESL_PANIC, format!("fault of ESL, please report it: {text}")))
    });
    match result {
        Ok(()) => ESL_OK,
        Err(fault) => {
            let status = fault.status();
            if !failure.is_null() {
                // SAFETY: the caller promises that the pointer is null or valid.
                unsafe { failure.write(give(fault.into_failure())) };
            }
            status
        }
    }
}

/// Runs the body of a function that makes an object. Returns null if an argument is invalid.
pub(crate) fn making<T>(body: impl FnOnce() -> Result<T, Fault>) -> *mut T {
    match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(object)) => give(object),
        Ok(Err(_)) | Err(_) => ptr::null_mut(),
    }
}

/// Runs the body of a function that frees an object: what it frees may run code of the embedder's.
pub(crate) fn freeing(body: impl FnOnce()) {
    drop(catch_unwind(AssertUnwindSafe(body)));
}
