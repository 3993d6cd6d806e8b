//! Handles: how other threads reach a run.

use std::ffi::c_char;
use std::ptr;

use esl::Data;
use esl::engine::{Handle, TaskHandle};
use esl::host::ProcessSignal;

use crate::border::{freeing, give, guarded, hand, look, look_within, making, take, text};
use crate::engine::esl_engine;
use crate::failure::esl_failure;
use crate::listed::values;
use crate::reply::{AwaitedAnswer, esl_reply};
use crate::status::esl_status;
use crate::value::esl_value;

/// A way into a run, from all threads at the same time. While a program has a handle, it waits for what may
/// come by it instead of being deadlocked.
pub struct esl_handle(pub(crate) Handle);

/// A task that was started by a handle.
pub struct esl_task(TaskHandle);

/// Creates a handle of an engine, on the thread that uses the engine.
///
/// # Safety
/// `engine` is an engine; `handle` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_engine_handle(
    engine: *const esl_engine,
    handle: *mut *mut esl_handle,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let made = esl_engine::lock(engine)?.handle();
            hand(handle, esl_handle(made));
            Ok(())
        })
    }
}

/// Creates another handle of the same engine. Returns null for null.
///
/// # Safety
/// `handle` is a handle, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_copy(handle: *const esl_handle) -> *mut esl_handle {
    // SAFETY: each pointer is null, or to what C holds and lends.
    making(|| Ok(esl_handle(unsafe { look(handle) }?.0.clone())))
}

/// Frees a handle; null is ignored.
///
/// # Safety
/// `handle` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_free(handle: *mut esl_handle) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(handle) }));
}

/// Signals an input of the program, by its name in any case, with `count` arguments, which are copied. If the
/// input is full, and its rule is that senders wait, waits with `waits`, and otherwise returns `ESL_FULL`.
/// Not on the thread of the engine with `waits`.
///
/// # Safety
/// `handle` is a handle; `input` ends with a null character; `arguments` points to `count` values; `failure`
/// is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_signal(
    handle: *const esl_handle,
    input: *const c_char,
    arguments: *const *const esl_value,
    count: usize,
    waits: bool,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (handle, input) = (&look(handle)?.0, text(input, "name of the input")?);
            let arguments = values(arguments, count)?;
            match waits {
                true => handle.signal(input, arguments)?,
                false => handle.try_signal(input, arguments)?,
            }
            Ok(())
        })
    }
}

/// Asks a run with one value.
///
/// # Safety
/// `handle` is a handle and `value` a value; `reply` and `failure` are places that can be written, or null.
unsafe fn ask(
    handle: *const esl_handle,
    value: *const esl_value,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
    ask: impl FnOnce(&Handle, Data) -> AwaitedAnswer,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (handle, data) = (&look(handle)?.0, look_within(value)?.0.clone());
            hand(reply, ask(handle, data).into_reply());
            Ok(())
        })
    }
}

/// Adds a fact to the program's database. The answer is whether it is new. `reply` may be null.
///
/// # Safety
/// `handle` is a handle and `value` a value; `reply` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_assert(
    handle: *const esl_handle,
    value: *const esl_value,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { ask(handle, value, reply, failure, |handle, data| AwaitedAnswer::Truth(handle.assert(data))) }
}

/// Removes the facts that match a pattern. The answer is how many there were. `reply` may be null.
///
/// # Safety
/// `handle` is a handle and `value` a value; `reply` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_retract(
    handle: *const esl_handle,
    value: *const esl_value,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { ask(handle, value, reply, failure, |handle, data| AwaitedAnswer::Count(handle.retract(data))) }
}

/// Asks the program's database. The query is what `db-query` takes: a pattern, such as
/// "(at ?robot ?place)", or `(and query…)` and the like. The answer is a list of property lists:
/// ((:ROBOT ROVER :PLACE RIDGE)).
///
/// # Safety
/// `handle` is a handle and `value` a value; `reply` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_query(
    handle: *const esl_handle,
    value: *const esl_value,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { ask(handle, value, reply, failure, |handle, data| AwaitedAnswer::Facts(handle.query(data))) }
}

/// Sets a property of the program for `count` arguments. The answer is whether that has changed its value.
///
/// # Safety
/// `handle` is a handle; `property` ends with a null character; `arguments` points to `count` values; `value`
/// is a value; `reply` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_set(
    handle: *const esl_handle,
    property: *const c_char,
    arguments: *const *const esl_value,
    count: usize,
    value: *const esl_value,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (handle, property) = (&look(handle)?.0, text(property, "name of the property")?);
            let (arguments, value) = (values(arguments, count)?, look_within(value)?.0.clone());
            hand(reply, AwaitedAnswer::Truth(handle.set(property, arguments, value)).into_reply());
            Ok(())
        })
    }
}

/// Calls a function of the program, by its name in any case, in a task of its own. The answer is its first
/// value.
///
/// # Safety
/// `handle` is a handle; `function` ends with a null character; `arguments` points to `count` values; `reply`
/// and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_call(
    handle: *const esl_handle,
    function: *const c_char,
    arguments: *const *const esl_value,
    count: usize,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (handle, function) = (&look(handle)?.0, text(function, "name of the function")?);
            let arguments = values(arguments, count)?;
            hand(reply, AwaitedAnswer::Value(handle.call(function, arguments)).into_reply());
            Ok(())
        })
    }
}

/// Starts a task that calls a function of the program, by its name in any case.
///
/// # Safety
/// As for `esl_handle_call`; `task` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_spawn(
    handle: *const esl_handle,
    function: *const c_char,
    arguments: *const *const esl_value,
    count: usize,
    task: *mut *mut esl_task,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let (handle, function) = (&look(handle)?.0, text(function, "name of the function")?);
            let started = handle.spawn(function, values(arguments, count)?);
            hand(task, esl_task(started));
            Ok(())
        })
    }
}

/// Aborts a task: it unwinds and runs its cleanups. Nothing happens if it has ended. From any thread.
///
/// # Safety
/// `task` is a task.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_task_abort(task: *const esl_task) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            look(task)?.0.abort();
            Ok(())
        })
    }
}

/// Returns the reply of a task, which is freed: the first value of its function. Returns null for null.
///
/// # Safety
/// `task` is a task that was not freed before, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_task_into_reply(task: *mut esl_task) -> *mut esl_reply {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { take(task) }
        .map_or(ptr::null_mut(), |task| give(AwaitedAnswer::Value(task.0.into_reply()).into_reply()))
}

/// Frees a task, which goes on; null is ignored.
///
/// # Safety
/// `task` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_task_free(task: *mut esl_task) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(task) }));
}

/// Asks for the tasks that have not ended, in the order in which they were made. The answer is a list of
/// property lists: ((:NUMBER 3 :MAKER 0 :NAME "PATROL-1" :WAITS-FOR "the timer" :TICKS 120)), where the maker
/// is 0 for a task that the embedder has made, and `:WAITS-FOR` is `NIL` for one that can run.
///
/// # Safety
/// `handle` is a handle; `reply` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_tasks(
    handle: *const esl_handle,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            hand(reply, AwaitedAnswer::Tasks(look(handle)?.0.tasks()).into_reply());
            Ok(())
        })
    }
}

/// Aborts the task with this number, which `esl_handle_tasks` and observers tell. Nothing happens if it has
/// ended.
///
/// # Safety
/// `handle` is a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_abort(handle: *const esl_handle, task: u64) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { tell(handle, |handle| handle.abort(task)) }
}

/// Tells a run something.
///
/// # Safety
/// `handle` is a handle, or null.
unsafe fn tell(handle: *const esl_handle, tell: impl FnOnce(&Handle)) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(ptr::null_mut(), || {
            tell(&look(handle)?.0);
            Ok(())
        })
    }
}

/// Has no task run, until `esl_handle_resume` or the end of the last handle. The clock goes on, if it is
/// not virtual.
///
/// # Safety
/// `handle` is a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_pause(handle: *const esl_handle) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { tell(handle, |handle| handle.pause()) }
}

/// Has tasks run again.
///
/// # Safety
/// `handle` is a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_resume(handle: *const esl_handle) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { tell(handle, |handle| handle.resume()) }
}

/// Has an evaluation or a run of the engine end with `ESL_STOPPED`. Tasks go on in the next run.
///
/// # Safety
/// `handle` is a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_stop(handle: *const esl_handle) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { tell(handle, |handle| handle.stop()) }
}

/// Has the program end as if the process had got SIGTERM: tasks unwind and run their cleanups, unless the
/// program handles the signal.
///
/// # Safety
/// `handle` is a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_terminate(handle: *const esl_handle) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { tell(handle, |handle| handle.send_signal(ProcessSignal::Terminate)) }
}
