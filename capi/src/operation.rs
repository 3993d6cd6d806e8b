//! Operations that C performs.

use std::cell::OnceCell;
use std::ffi::{CString, c_char, c_void};
use std::ptr;

use esl::engine::Operation;

use crate::border::{elements, freeing, give, guarded, look, look_within, store, take, text};
use crate::engine::esl_engine;
use crate::failure::{Fault, esl_failure};
use crate::function::{UserData, esl_destructor, no_callback};
use crate::status::esl_status::{self, ESL_NOT_DURABLE};
use crate::value::esl_value;

/// Work that C does for a task of the program, which waits for its end. It belongs to C, which ends it once,
/// by `esl_operation_complete` or `esl_operation_fail`, on any thread and at any time, also when the engine
/// is gone. Until then it may be used from one thread at a time.
pub struct esl_operation {
    operation: Operation,
    /// The identity of the call, as C has asked for it.
    action: OnceCell<Option<CString>>,
    /// The state that an earlier process has saved.
    restored: Option<Vec<u8>>,
}

impl esl_operation {
    pub(crate) fn new(operation: Operation) -> esl_operation {
        let restored = operation.restore();
        esl_operation { operation, action: OnceCell::new(), restored }
    }
}

/// A function that begins an operation, which it hands to a thread or a queue. It is called on the thread of
/// the engine, and does not wait.
pub type esl_operation_function =
    Option<unsafe extern "C" fn(user: *mut c_void, operation: *mut esl_operation)>;

/// A function that is told something about an operation or a reply. It is called on the thread of the engine,
/// and only hands on the message. It neither ends the operation nor uses the engine.
pub type esl_notice_function = Option<unsafe extern "C" fn(user: *mut c_void)>;

/// Defines a function whose calls are operations, as `esl_define` defines functions.
///
/// # Safety
/// As for `esl_define`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_define_operation(
    engine: *mut esl_engine,
    name: *const c_char,
    lambda_list: *const c_char,
    documentation: *const c_char,
    begin: esl_operation_function,
    user: *mut c_void,
    destructor: esl_destructor,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends; `begin` gets the pointer that came with it.
    unsafe {
        guarded(failure, || {
            let (name, lambda_list) = (text(name, "name")?, text(lambda_list, "lambda list")?);
            let documentation = text(documentation, "documentation")?;
            let begin = begin.ok_or_else(no_callback)?;
            let mut engine = esl_engine::lock(engine)?;
            engine.define_operation(name, lambda_list, documentation, move |operation| {
                let user: &UserData = &user;
                begin(user.pointer, give(esl_operation::new(operation)));
            })?;
            Ok(())
        })
    }
}

/// Returns the number of arguments.
///
/// # Safety
/// `operation` is an operation, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_argument_count(operation: *const esl_operation) -> usize {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { look(operation) }.map_or(0, |operation| operation.operation.call().arguments().len())
}

/// Returns an argument, from 0, in the order of the lambda list's variables; null beyond the last. It is a
/// part of the operation.
///
/// # Safety
/// `operation` is an operation, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_argument(
    operation: *const esl_operation,
    index: usize,
) -> *const esl_value {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let Ok(operation) = (unsafe { look(operation) }) else { return ptr::null() };
    operation.operation.call().arguments().get(index).map_or(ptr::null(), |data| ptr::from_ref(data).cast())
}

/// Ends an operation, which is freed: the call returns the value, or `NIL` for null. The value is copied.
///
/// # Safety
/// `operation` is an operation that has not ended; `value` is a value, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_complete(
    operation: *mut esl_operation,
    value: *const esl_value,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            let data = if value.is_null() { None } else { Some(look_within(value)?.0.clone()) };
            take(operation)?.operation.complete(data);
            Ok(())
        })
    }
}

/// Ends an operation, which is freed: the call fails with the failure, which is freed too.
///
/// # Safety
/// `operation` is an operation that has not ended; `failure` is a failure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_fail(
    operation: *mut esl_operation,
    failure: *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            let failure = take(failure);
            let operation = take(operation)?.operation;
            // Without a failure it is dropped, which the call learns.
            operation.fail(failure?.to_engine());
            Ok(())
        })
    }
}

/// Frees an operation that nobody performs: the call fails with `:OPERATION-DROPPED`, and one that was
/// cancelled has stopped. Null is ignored.
///
/// # Safety
/// `operation` has not ended.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_free(operation: *mut esl_operation) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(operation) }));
}

/// Reports how far an operation is, for `operation-progress`. The value is copied.
///
/// # Safety
/// `operation` is an operation that has not ended; `value` is a value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_report_progress(
    operation: *const esl_operation,
    value: *const esl_value,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            look(operation)?.operation.report_progress(look_within(value)?.0.clone());
            Ok(())
        })
    }
}

/// Returns whether the program has left the call, or cancelled the operation.
///
/// # Safety
/// `operation` is an operation that has not ended, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_is_cancelled(operation: *const esl_operation) -> bool {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { look(operation) }.is_ok_and(|operation| operation.operation.is_cancelled())
}

/// Has `function` called when the program leaves the call, or cancels the operation; at once if it has done
/// so already. The program waits until the operation has ended or is freed, so that what is still moving is
/// not commanded again.
///
/// # Safety
/// `operation` is an operation that has not ended; `function` and `destructor` can be called with `user` on
/// any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_on_cancel(
    operation: *const esl_operation,
    function: esl_notice_function,
    user: *mut c_void,
    destructor: esl_destructor,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends; `function` gets the pointer that came with
    // it.
    unsafe {
        guarded(ptr::null_mut(), || {
            let function = function.ok_or_else(no_callback)?;
            look(operation)?.operation.on_cancel(move || {
                let user: &UserData = &user;
                function(user.pointer);
            });
            Ok(())
        })
    }
}

/// Returns the identity of the call in a durable run, 32 hexadecimal digits, the same in each process that
/// performs it; null in a run that is not durable. It lives as long as the operation.
///
/// # Safety
/// `operation` is an operation that has not ended, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_action(operation: *const esl_operation) -> *const c_char {
    // SAFETY: each pointer is null, or to what C holds and lends.
    let Ok(operation) = (unsafe { look(operation) }) else { return ptr::null() };
    let action = operation.action.get_or_init(|| {
        let action = operation.operation.action()?;
        CString::new(action.to_string()).ok()
    });
    action.as_ref().map_or(ptr::null(), |action| action.as_ptr())
}

/// Keeps `length` bytes of C's own with the state of a durable run, in place of those that the operation has
/// saved before, and returns when they are as safe as the run demands. The next process begins an operation
/// that has saved a state again, whatever its effect is, and gets the bytes by `esl_operation_restore`.
/// Returns `ESL_NOT_DURABLE` if they cannot be kept, since the disk has failed or they are more than 64 MiB:
/// then the operation does not go on: it fails, or is freed. In a run that is not durable it has no effect.
///
/// # Safety
/// `operation` is an operation that has not ended; `bytes` points to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_save(
    operation: *const esl_operation,
    bytes: *const c_void,
    length: usize,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            let state = elements(bytes.cast::<u8>(), length, "state")?;
            if look(operation)?.operation.save(state) {
                return Ok(());
            }
            Err(Fault::new(ESL_NOT_DURABLE, "the state of the operation cannot be kept"))
        })
    }
}

/// Returns the bytes that the operation had saved last when it was begun, in an earlier process, and stores
/// their number; null if there are none. They live as long as the operation.
///
/// # Safety
/// `operation` is an operation that has not ended; `length` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_operation_restore(
    operation: *const esl_operation,
    length: *mut usize,
) -> *const c_void {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        let Ok(operation) = look(operation) else { return ptr::null() };
        let Some(state) = &operation.restored else { return ptr::null() };
        store(length, state.len());
        state.as_ptr().cast()
    }
}
