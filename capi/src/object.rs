//! Objects of C that programs hold.

use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl::Data;
use esl_bytecode::datum::OpaqueDatum;

use crate::border::{making, text};
use crate::function::{UserData, esl_destructor};
use crate::value::esl_value;

/// A pointer of the embedder's that a program holds, until it is closed.
struct ObjectOfC(Mutex<Option<UserData>>);

impl ObjectOfC {
    fn pointer(&self) -> MutexGuard<'_, Option<UserData>> {
        // The pointer is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the object that a value is.
    ///
    /// # Safety
    /// `value` is a value, or null.
    unsafe fn of<'a>(value: *const esl_value) -> Option<(&'a OpaqueDatum, &'a ObjectOfC)> {
        // SAFETY: each pointer is null, or to what C holds and lends.
        let Data::Opaque(datum) = &(unsafe { value.as_ref() }?).0 else { return None };
        datum.value().downcast_ref().map(|object| (datum, object))
    }
}

/// Creates a value for an object of the embedder's, such as an open device, which programs hold, hand on and
/// compare by `eq`. They print it as `#<TYPE LABEL>`. `destructor` is called with the pointer, once and on
/// any thread, when neither C nor a program has the value any more, or by `esl_object_close`. Returns null,
/// and calls it, if a text is invalid.
///
/// # Safety
/// `type` and `label` are texts with null characters at their ends; `pointer` can be handed to other threads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_object(
    r#type: *const c_char,
    label: *const c_char,
    pointer: *mut c_void,
    destructor: esl_destructor,
) -> *mut esl_value {
    let user = UserData::new(pointer, destructor);
    making(|| {
        // SAFETY: each pointer is null, or to what C holds and lends.
        let (kind, label) = unsafe { (text(r#type, "type")?, text(label, "label")?) };
        let object = Arc::new(ObjectOfC(Mutex::new(Some(user))));
        Ok(esl_value(Data::Opaque(OpaqueDatum::new(kind, label, object))))
    })
}

/// Returns the pointer of an object of this type. It is valid until the value is freed, if nothing else
/// refers to the object, or until it is closed. Returns null for other values, and for an object that was
/// closed.
///
/// # Safety
/// `value` is a value, or null; `type` is a text with a null character at its end, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_value_object(value: *const esl_value, r#type: *const c_char) -> *mut c_void {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let (object, kind) = unsafe { (ObjectOfC::of(value), text(r#type, "type")) };
    let (Some((datum, object)), Ok(kind)) = (object, kind) else { return ptr::null_mut() };
    if datum.kind() != kind {
        return ptr::null_mut();
    }
    object.pointer().as_ref().map_or(ptr::null_mut(), |user| user.pointer)
}

/// Takes an object away from programs, which keep an empty one: calls the destructor now. Returns false for
/// other values, and for an object that was closed before.
///
/// # Safety
/// `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_object_close(value: *const esl_value) -> bool {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let Some((_, object)) = (unsafe { ObjectOfC::of(value) }) else { return false };
    // The destructor may read the value, so the lock is let go before.
    let user = object.pointer().take();
    user.is_some()
}
