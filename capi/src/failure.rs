//! Failures, as C reads them.

use std::ffi::{CString, c_char};
use std::ptr;

use esl::engine::Failure;
use esl::host::{FailureFrame, SendError};
use esl::{Data, Error};

use crate::border::{freeing, look, making, store, take, text};
use crate::listed::values;
use crate::status::esl_status::{self, ESL_FAILED};
use crate::value::esl_value;

/// Why a call has not done what it says.
///
/// A failure belongs to its caller, who frees it. Texts and values that are read from it live as long as it.
/// From any thread, one at a time.
pub struct esl_failure {
    status: esl_status,
    cause: CString,
    message: CString,
    report: CString,
    arguments: Vec<esl_value>,
    frames: Vec<FrameTexts>,
}

struct FrameTexts {
    function: CString,
    task: CString,
    source: CString,
    line: u32,
    column: u32,
    is_of_library: bool,
}

/// A call that a failure has left unfinished.
#[repr(C)]
pub struct esl_frame {
    /// Name of the function, as the program prints it.
    pub function: *const c_char,
    /// Name of the task.
    pub task: *const c_char,
    /// Name of the source; empty if it is not known.
    pub source: *const c_char,
    /// Line, from 1; 0 if it is not known.
    pub line: u32,
    /// Column in characters, from 1; 0 if it is not known.
    pub column: u32,
    /// Whether the function belongs to the library, or to a module that comes with the machine.
    pub is_of_library: bool,
}

/// A failure on its way to the caller.
pub(crate) struct Fault(Box<esl_failure>);

/// Returns a text for C. Null characters, which would end it, become U+FFFD.
pub(crate) fn c_text(text: impl AsRef<str>) -> CString {
    CString::new(text.as_ref().replace('\0', "\u{FFFD}")).unwrap_or_default()
}

impl Fault {
    pub(crate) fn new(status: esl_status, message: impl AsRef<str>) -> Fault {
        let message = c_text(message);
        Fault(Box::new(esl_failure {
            status,
            cause: status.cause().to_owned(),
            report: message.clone(),
            message,
            arguments: Vec::new(),
            frames: Vec::new(),
        }))
    }

    pub(crate) fn status(&self) -> esl_status {
        self.0.status
    }

    pub(crate) fn into_failure(self) -> esl_failure {
        *self.0
    }
}

/// Returns the text of an error, in which limits have the names that they have in C.
fn message_of(error: &Error) -> String {
    match error {
        Error::NoMemory(thing) => {
            format!("the memory limit leaves no room for {thing}: raise it by `esl_config_set_memory`")
        }
        Error::BudgetSpent => {
            "the engine has spent its budget of ticks: make a new one, or raise the limit by \
                               `esl_config_set_budget`"
                .into()
        }
        Error::TicksUsed(ticks) => format!(
            "the evaluation did not end within {ticks} ticks: raise the limit by `esl_config_set_ticks`"
        ),
        error => error.to_string(),
    }
}

impl From<Error> for Fault {
    fn from(error: Error) -> Fault {
        let mut fault = Fault::new(esl_status::of_error(&error), message_of(&error));
        if let Error::Exited(status) = error {
            fault.0.arguments = vec![esl_value(Data::Integer(status.into()))];
        }
        if let Error::Failed { cause, report, arguments, frames, .. } = error {
            fault.0.cause = c_text(cause);
            fault.0.report = c_text(report);
            fault.0.arguments = arguments.into_iter().map(esl_value).collect();
            fault.0.frames = frames.iter().map(FrameTexts::of).collect();
        }
        fault
    }
}

impl From<SendError> for Fault {
    fn from(error: SendError) -> Fault {
        Fault::new(esl_status::of_send(&error), error.to_string())
    }
}

impl FrameTexts {
    fn of(frame: &FailureFrame) -> FrameTexts {
        let place = frame.place.as_ref();
        FrameTexts {
            function: c_text(&frame.function),
            task: c_text(&frame.task),
            source: c_text(place.map(|place| place.source.as_str()).unwrap_or_default()),
            line: place.map_or(0, |place| place.line),
            column: place.map_or(0, |place| place.column),
            is_of_library: frame.is_of_library,
        }
    }
}

impl esl_failure {
    /// Returns the failure of a function of the embedder's, as the engine takes it.
    pub(crate) fn to_engine(&self) -> Failure {
        let cause = self.cause.to_string_lossy();
        let arguments = self.arguments.iter().map(|argument| argument.0.clone());
        Failure::new(cause.trim_start_matches(':'), arguments)
    }
}

/// Creates a failure for a function or an operation of the embedder's to fail with. `cause` is the name of a
/// keyword, such as "valve-stuck"; the `count` arguments are copied. Returns null if an argument is invalid.
/// From any thread.
///
/// # Safety
/// `cause` is a text with a null character at its end; `arguments` points to `count` values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_new(
    cause: *const c_char,
    arguments: *const *const esl_value,
    count: usize,
) -> *mut esl_failure {
    making(|| {
        // SAFETY: `failure` is null, or a failure that C holds.
        let (cause, arguments) = unsafe { (text(cause, "cause")?, values(arguments, count)?) };
        let cause = cause.trim_start_matches(':').to_uppercase();
        let mut fault = Fault::new(ESL_FAILED, &cause);
        fault.0.cause = c_text(format!(":{cause}"));
        fault.0.arguments = arguments.into_iter().map(esl_value).collect();
        Ok(fault.into_failure())
    })
}

/// Frees a failure; a null pointer is ignored.
///
/// # Safety
/// `failure` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_free(failure: *mut esl_failure) {
    // SAFETY: `failure` is null, or a failure that C holds.
    freeing(|| drop(unsafe { take(failure) }));
}

/// Returns the status that the call had.
///
/// # Safety
/// `failure` is a failure, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_status(failure: *const esl_failure) -> esl_status {
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { look(failure) }.map_or(esl_status::ESL_INVALID_ARGUMENT, |failure| failure.status)
}

/// Returns a text of a failure; an empty one for null.
///
/// # Safety
/// `failure` is a failure, or null.
unsafe fn text_of(failure: *const esl_failure, text: fn(&esl_failure) -> &CString) -> *const c_char {
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { look(failure) }.map_or(c"".as_ptr(), |failure| text(failure).as_ptr())
}

/// Returns the cause, as the program prints it: ":VALVE-STUCK".
///
/// # Safety
/// `failure` is a failure, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_cause(failure: *const esl_failure) -> *const c_char {
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { text_of(failure, |failure| &failure.cause) }
}

/// Returns the message, a sentence.
///
/// # Safety
/// `failure` is a failure, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_message(failure: *const esl_failure) -> *const c_char {
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { text_of(failure, |failure| &failure.message) }
}

/// Returns the message, the frames, and the failures that were being recovered from, as the commands print
/// them.
///
/// # Safety
/// `failure` is a failure, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_report(failure: *const esl_failure) -> *const c_char {
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { text_of(failure, |failure| &failure.report) }
}

/// Returns the number of arguments.
///
/// # Safety
/// `failure` is a failure, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_argument_count(failure: *const esl_failure) -> usize {
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { look(failure) }.map_or(0, |failure| failure.arguments.len())
}

/// Returns an argument, from 0; null beyond the last. It is a part of the failure.
///
/// # Safety
/// `failure` is a failure, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_argument(failure: *const esl_failure, index: usize) -> *const esl_value {
    // SAFETY: `failure` is null, or a failure that C holds.
    let failure = unsafe { look(failure) };
    failure.ok().and_then(|failure| failure.arguments.get(index)).map_or(ptr::null(), ptr::from_ref)
}

/// Returns the number of frames.
///
/// # Safety
/// `failure` is a failure, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_frame_count(failure: *const esl_failure) -> usize {
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { look(failure) }.map_or(0, |failure| failure.frames.len())
}

/// Reads a frame, from 0, innermost first. The calls of a failed task of a net come before those of the task
/// with the net. Returns false beyond the last.
///
/// # Safety
/// `failure` is a failure or null, and `frame` a place that can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_failure_frame(
    failure: *const esl_failure,
    index: usize,
    frame: *mut esl_frame,
) -> bool {
    // SAFETY: `failure` is null, or a failure that C holds.
    let Ok(failure) = (unsafe { look(failure) }) else { return false };
    let Some(texts) = failure.frames.get(index) else { return false };
    let read = esl_frame {
        function: texts.function.as_ptr(),
        task: texts.task.as_ptr(),
        source: texts.source.as_ptr(),
        line: texts.line,
        column: texts.column,
        is_of_library: texts.is_of_library,
    };
    // SAFETY: `failure` is null, or a failure that C holds.
    unsafe { store(frame, read) };
    true
}
