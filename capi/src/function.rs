//! Functions that C implements.

use std::ffi::{c_char, c_void};
use std::ptr;

use esl::Data;
use esl::engine::{Call, Failure};

use crate::border::{guarded, take, text};
use crate::engine::esl_engine;
use crate::failure::{Fault, esl_failure};
use crate::status::esl_status::{self, ESL_INVALID_ARGUMENT};
use crate::value::esl_value;

/// A function that programs call. It gets the arguments in the order of the lambda list's variables, those
/// left out as the lambda list says; they live until it returns. It stores its value in `*result`, which the
/// engine frees, or leaves it null for `NIL`, and returns null; or it returns a failure, which the engine
/// frees, and the call fails so.
///
/// It is called on the thread of the engine, while no task runs: it returns soon, and neither uses the engine
/// nor waits for a reply. It must not leave by an exception of C++ or by `longjmp`.
pub type esl_function = Option<
    unsafe extern "C" fn(
        user: *mut c_void,
        arguments: *const *const esl_value,
        count: usize,
        result: *mut *mut esl_value,
    ) -> *mut esl_failure,
>;

/// A function that frees what `user` points to: once, on any thread, when ESL does not need it any more.
pub type esl_destructor = Option<unsafe extern "C" fn(user: *mut c_void)>;

/// The pointer of the embedder's that a function of C gets, with its destructor.
pub(crate) struct UserData {
    pub(crate) pointer: *mut c_void,
    destructor: esl_destructor,
}

// SAFETY: the functions of the API that take a pointer say that it is used on other threads.
unsafe impl Send for UserData {}

impl UserData {
    pub(crate) fn new(pointer: *mut c_void, destructor: esl_destructor) -> UserData {
        UserData { pointer, destructor }
    }
}

impl Drop for UserData {
    fn drop(&mut self) {
        if let Some(destructor) = self.destructor {
            // SAFETY: the embedder has given the destructor for this pointer, and it is called once.
            unsafe { destructor(self.pointer) };
        }
    }
}

/// Returns the fault of a callback that is null.
pub(crate) fn no_callback() -> Fault {
    Fault::new(ESL_INVALID_ARGUMENT, "expected a function, not a null pointer")
}

/// Defines a function that programs call and C implements. `lambda_list` is that of the function, in ESL:
/// "(metres &key (speed 0.1))". A function of this name is replaced, and its `user` freed at the end of the
/// engine at the latest. With a status other than `ESL_OK`, `user` is freed at once.
///
/// # Safety
/// `engine` is an engine; the texts end with null characters; `function` and `destructor` can be called with
/// `user`; `failure` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_define(
    engine: *mut esl_engine,
    name: *const c_char,
    lambda_list: *const c_char,
    documentation: *const c_char,
    function: esl_function,
    user: *mut c_void,
    destructor: esl_destructor,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (name, lambda_list) = (text(name, "name")?, text(lambda_list, "lambda list")?);
            let documentation = text(documentation, "documentation")?;
            let function = function.ok_or_else(no_callback)?;
            let mut engine = esl_engine::lock(engine)?;
            engine.define(name, lambda_list, documentation, move |call| {
                call_function(function, &user, &call)
            })?;
            Ok(())
        })
    }
}

/// Takes an object that C hands over, if it does.
///
/// # Safety
/// As [`take`].
unsafe fn handed<T>(pointer: *mut T) -> Option<Box<T>> {
    // The fault of a null pointer has a text, which takes longer than the rest of a call.
    if pointer.is_null() {
        return None;
    }
    // SAFETY: the caller promises that the pointer is valid.
    unsafe { take(pointer) }.ok()
}

/// Calls a function that C implements.
pub(crate) fn call_function(
    function: unsafe extern "C" fn(
        *mut c_void,
        *const *const esl_value,
        usize,
        *mut *mut esl_value,
    ) -> *mut esl_failure,
    user: &UserData,
    call: &Call,
) -> Result<Data, Failure> {
    // Most calls have few arguments, whose pointers need no memory of their own.
    let (mut few, many): ([*const esl_value; 8], Vec<*const esl_value>);
    let pointers = call.arguments().iter().map(|argument| ptr::from_ref(argument).cast());
    let arguments = if pointers.len() <= 8 {
        few = [ptr::null(); 8];
        few.iter_mut().zip(pointers).for_each(|(place, pointer)| *place = pointer);
        &few[..call.arguments().len()]
    } else {
        many = pointers.collect();
        &many
    };
    let mut result: *mut esl_value = ptr::null_mut();
    // SAFETY: the embedder has given the function for this pointer; the arguments live until it returns.
    let failure = unsafe { function(user.pointer, arguments.as_ptr(), arguments.len(), &raw mut result) };
    // SAFETY: the function hands over what it returns.
    let (failure, result) = unsafe { (handed(failure), handed(result)) };
    match (failure, result) {
        (Some(failure), _) => Err(failure.to_engine()),
        (None, result) => Ok(result.map_or(Data::Nil, |value| value.0)),
    }
}
