//! Answers to come.

use std::ffi::c_void;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Wake, Waker};

use esl::Data;
use esl::engine::{QueryAnswer, Reply};
use esl::host::TaskInfo;

use crate::border::{freeing, guarded, hand, look, take};
use crate::failure::{Fault, esl_failure};
use crate::fork::Process;
use crate::function::{UserData, esl_destructor, no_callback};
use crate::operation::esl_notice_function;
use crate::status::esl_status::{self, ESL_PENDING};
use crate::value::esl_value;

/// An answer to come from a run. It belongs to the caller, who frees it, which changes nothing in the run.
/// From any thread, one at a time.
pub struct esl_reply(Mutex<AwaitedAnswer>, Process);

impl esl_reply {
    fn answer(&self) -> MutexGuard<'_, AwaitedAnswer> {
        // The answer is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The reply of an engine, by the type that it has there.
pub(crate) enum AwaitedAnswer {
    Value(Reply<Data>),
    Truth(Reply<bool>),
    Count(Reply<i64>),
    Facts(Reply<Vec<QueryAnswer>>),
    Tasks(Reply<Vec<TaskInfo>>),
    /// The answer has come, and waits to be taken.
    Come(Result<Data, esl::Error>),
    /// The answer was taken.
    Taken,
}

/// Has the waker woken when the answer of a reply has come, or returns the answer.
fn poll<T>(
    reply: &mut Reply<T>,
    waker: &Waker,
    data: impl FnOnce(T) -> Data,
) -> Option<Result<Data, esl::Error>> {
    match Pin::new(reply).poll(&mut Context::from_waker(waker)) {
        Poll::Ready(result) => Some(result.map(data)),
        Poll::Pending => None,
    }
}

/// A function of C that is called once, when an answer has come.
struct Notice(Mutex<Option<NoticeOfC>>);

struct NoticeOfC {
    function: unsafe extern "C" fn(user: *mut c_void),
    user: UserData,
}

impl Wake for Notice {
    fn wake(self: Arc<Notice>) {
        let notice = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(NoticeOfC { function, user }) = notice {
            // SAFETY: the embedder has given the function for this pointer, and it is called once.
            unsafe { function(user.pointer) };
        }
    }
}

/// Returns a list of association lists of variables, which are keywords, and values.
fn data_of(answers: Vec<QueryAnswer>) -> Data {
    Data::list(answers.into_iter().map(|bindings| {
        Data::list(bindings.iter().flat_map(|(name, value)| [Data::Keyword(name.to_owned()), value.clone()]))
    }))
}

/// Returns a list of property lists.
fn data_of_tasks(tasks: Vec<TaskInfo>) -> Data {
    let number = |number: u64| Data::Integer(i64::try_from(number).unwrap_or(i64::MAX));
    Data::list(tasks.into_iter().map(|task| {
        let row = [
            ("NUMBER", number(task.number)),
            ("MAKER", number(task.maker)),
            ("NAME", Data::String(task.name)),
            ("WAITS-FOR", task.waits_for.map_or(Data::Nil, Data::String)),
            ("TICKS", number(task.ticks)),
        ];
        Data::list(row.into_iter().flat_map(|(name, value)| [Data::Keyword(name.to_owned()), value]))
    }))
}

impl AwaitedAnswer {
    pub(crate) fn into_reply(self) -> esl_reply {
        esl_reply(Mutex::new(self), Process::this())
    }

    /// Has the waker woken when the answer has come. Returns whether it has come already.
    fn wake_when_come(&mut self, waker: &Waker) -> bool {
        let come = match self {
            AwaitedAnswer::Value(reply) => poll(reply, waker, |data| data),
            AwaitedAnswer::Truth(reply) => poll(reply, waker, Data::boolean),
            AwaitedAnswer::Count(reply) => poll(reply, waker, Data::Integer),
            AwaitedAnswer::Facts(reply) => poll(reply, waker, data_of),
            AwaitedAnswer::Tasks(reply) => poll(reply, waker, data_of_tasks),
            AwaitedAnswer::Come(_) | AwaitedAnswer::Taken => return true,
        };
        come.map(|result| *self = AwaitedAnswer::Come(result)).is_some()
    }

    fn take(&self) -> Option<Result<Data, esl::Error>> {
        match self {
            AwaitedAnswer::Value(reply) => reply.take(),
            AwaitedAnswer::Truth(reply) => reply.take().map(|result| result.map(Data::boolean)),
            AwaitedAnswer::Count(reply) => reply.take().map(|result| result.map(Data::Integer)),
            AwaitedAnswer::Facts(reply) => reply.take().map(|result| result.map(data_of)),
            AwaitedAnswer::Tasks(reply) => reply.take().map(|result| result.map(data_of_tasks)),
            AwaitedAnswer::Come(result) => Some(result.clone()),
            AwaitedAnswer::Taken => Some(Err(esl::Error::Ended)),
        }
    }

    fn wait(self) -> Result<Data, esl::Error> {
        match self {
            AwaitedAnswer::Value(reply) => reply.wait(),
            AwaitedAnswer::Truth(reply) => reply.wait().map(Data::boolean),
            AwaitedAnswer::Count(reply) => reply.wait().map(Data::Integer),
            AwaitedAnswer::Facts(reply) => reply.wait().map(data_of),
            AwaitedAnswer::Tasks(reply) => reply.wait().map(data_of_tasks),
            AwaitedAnswer::Come(result) => result,
            AwaitedAnswer::Taken => Err(esl::Error::Ended),
        }
    }
}

/// Takes the answer if it has come; otherwise returns `ESL_PENDING`. An answer can be taken once.
///
/// # Safety
/// `reply` is a reply; `value` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_reply_take(
    reply: *const esl_reply,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let mut is_pending = false;
    // SAFETY: each pointer is null, or to what C holds and lends.
    let status = unsafe {
        guarded(failure, || {
            let mut answer = look(reply)?.answer();
            match answer.take() {
                None => is_pending = true,
                Some(result) => {
                    *answer = AwaitedAnswer::Taken;
                    hand(value, esl_value(result?));
                }
            }
            Ok(())
        })
    };
    if is_pending { ESL_PENDING } else { status }
}

/// Waits for the answer, on a thread other than the engine's: an engine answers only while it runs.
///
/// # Safety
/// `reply` is a reply that no other thread uses; `value` and `failure` are places that can be written, or
/// null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_reply_wait(
    reply: *const esl_reply,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            look(reply)?.1.check()?;
            let mut answer = look(reply)?.answer();
            let data = std::mem::replace(&mut *answer, AwaitedAnswer::Taken).wait().map_err(Fault::from)?;
            hand(value, esl_value(data));
            Ok(())
        })
    }
}

/// Has `function` called once, when the answer has come or the engine is gone; at once if it has come
/// already. `esl_reply_take` then has the answer. One function at a time: a second one replaces the first. It
/// is called on the thread of the engine, while no task runs: it uses replies and handles only, and may free
/// this reply. `user` is freed after the call; with a status other than `ESL_OK` at once.
///
/// # Safety
/// `reply` is a reply; `function` and `destructor` can be called with `user` on any thread; `failure` is a
/// place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_reply_on_answer(
    reply: *const esl_reply,
    function: esl_notice_function,
    user: *mut c_void,
    destructor: esl_destructor,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends; `function` gets the pointer that came with
    // it.
    unsafe {
        guarded(failure, || {
            let function = function.ok_or_else(no_callback)?;
            look(reply)?.1.check()?;
            let notice = Notice(Mutex::new(Some(NoticeOfC { function, user })));
            let waker = Waker::from(Arc::new(notice));
            // The function may take the answer, or free the reply: the lock is let go before.
            if look(reply)?.answer().wake_when_come(&waker) {
                waker.wake();
            }
            Ok(())
        })
    }
}

/// Frees a reply; null is ignored.
///
/// # Safety
/// `reply` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_reply_free(reply: *mut esl_reply) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(reply) }));
}
