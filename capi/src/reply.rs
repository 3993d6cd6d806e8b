//! Answers to come.

use std::sync::{Mutex, MutexGuard, PoisonError};

use esl::Data;
use esl::engine::{QueryAnswer, Reply};

use crate::border::{freeing, guarded, hand, look, take};
use crate::failure::{Fault, esl_failure};
use crate::fork::Process;
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
    /// The answer was taken.
    Taken,
}

/// Returns a list of association lists of variables, which are keywords, and values.
fn data_of(answers: Vec<QueryAnswer>) -> Data {
    Data::list(answers.into_iter().map(|bindings| {
        Data::list(bindings.iter().flat_map(|(name, value)| [Data::Keyword(name.to_owned()), value.clone()]))
    }))
}

impl AwaitedAnswer {
    pub(crate) fn into_reply(self) -> esl_reply {
        esl_reply(Mutex::new(self), Process::this())
    }

    fn take(&self) -> Option<Result<Data, esl::Error>> {
        match self {
            AwaitedAnswer::Value(reply) => reply.take(),
            AwaitedAnswer::Truth(reply) => reply.take().map(|result| result.map(Data::boolean)),
            AwaitedAnswer::Count(reply) => reply.take().map(|result| result.map(Data::Integer)),
            AwaitedAnswer::Facts(reply) => reply.take().map(|result| result.map(data_of)),
            AwaitedAnswer::Taken => Some(Err(esl::Error::Ended)),
        }
    }

    fn wait(self) -> Result<Data, esl::Error> {
        match self {
            AwaitedAnswer::Value(reply) => reply.wait(),
            AwaitedAnswer::Truth(reply) => reply.wait().map(Data::boolean),
            AwaitedAnswer::Count(reply) => reply.wait().map(Data::Integer),
            AwaitedAnswer::Facts(reply) => reply.wait().map(data_of),
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

/// Frees a reply; null is ignored.
///
/// # Safety
/// `reply` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_reply_free(reply: *mut esl_reply) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(reply) }));
}
