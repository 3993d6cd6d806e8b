//! Observers that C implements.

use std::ffi::{c_char, c_void};
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use esl::engine::{Observer, Seen, TaskNumber};

use crate::border::{guarded, hand, look};
use crate::failure::{c_text, esl_failure};
use crate::function::{UserData, esl_destructor, no_callback};
use crate::handle::esl_handle;
use crate::program::{Watched, esl_watch};
use crate::status::esl_status;

/// Kind of an event of a run.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum esl_event {
    /// The task was made, or was there when the observer came; the text is its name.
    ESL_TASK_BEGINS = 0,
    /// Reports call the task by another name from now on.
    ESL_TASK_IS_NAMED = 1,
    /// The task's turn begins.
    ESL_TASK_RUNS = 2,
    /// It could run, but another one does.
    ESL_TASK_IS_READY = 3,
    /// It waits, for what the text says.
    ESL_TASK_WAITS = 4,
    /// It is suspended by the task that the text names.
    ESL_TASK_IS_SUSPENDED = 5,
    /// It is to be aborted.
    ESL_TASK_IS_TO_END = 6,
    /// It has ended, as the text says: succeeded, failed or aborted.
    ESL_TASK_ENDS = 7,
    /// It has signalled the event of this name.
    ESL_TASK_SIGNALS = 8,
    /// A signal of the other task, or of none, has ended its wait; the text names the event.
    ESL_TASK_IS_WOKEN = 9,
    /// It fails, with this cause.
    ESL_TASK_FAILS = 10,
    /// A recovery procedure begins to deal with a failure of this cause.
    ESL_TASK_RECOVERS = 11,
    /// The fact of the text was asserted.
    ESL_FACT_ASSERTED = 12,
    /// The fact of the text was retracted.
    ESL_FACT_RETRACTED = 13,
    /// The collector begins a cycle. The task is 0, as for all that the collector does.
    ESL_COLLECTION_BEGINS = 14,
    /// The collector begins a turn, in which no task runs.
    ESL_PAUSE_BEGINS = 15,
    /// The collector's turn is over.
    ESL_PAUSE_ENDS = 16,
    /// The collector has ended a cycle.
    ESL_COLLECTION_ENDS = 17,
}

use esl_event::*;

/// An event of a run. The text lives until the observer returns; it is empty where the event has none.
#[repr(C)]
pub struct esl_seen {
    /// The event.
    pub event: esl_event,
    /// Nanoseconds since the first observer came.
    pub time: u64,
    /// Number of the task; 0 if there is none.
    pub task: u64,
    /// Number of another task that is involved; 0 if there is none.
    pub other_task: u64,
    /// Whether the task, where it begins, belongs to the library.
    pub is_hidden: bool,
    /// The text.
    pub text: *const c_char,
}

/// A function that is told what happens in a run. It is called on the thread of the engine, at each event: it
/// returns soon, and uses handles only. It must not leave by an exception of C++ or by `longjmp`.
pub type esl_observer = Option<unsafe extern "C" fn(user: *mut c_void, seen: *const esl_seen)>;

struct ObserverOfC {
    function: unsafe extern "C" fn(user: *mut c_void, seen: *const esl_seen),
    user: UserData,
    is_over: Arc<AtomicBool>,
}

/// Ends an observer when it is dropped.
pub(crate) struct RunWatch(Arc<AtomicBool>);

impl Drop for RunWatch {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Observer for ObserverOfC {
    fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    fn see(&mut self, time: u64, task: TaskNumber, seen: Seen<'_>) {
        let mut other_task = 0;
        let mut is_hidden_task = false;
        let (event, text) = match seen {
            Seen::Begins { name, is_hidden } => {
                is_hidden_task = is_hidden;
                (ESL_TASK_BEGINS, name)
            }
            Seen::IsNamed(name) => (ESL_TASK_IS_NAMED, name),
            Seen::Runs => (ESL_TASK_RUNS, ""),
            Seen::IsReady => (ESL_TASK_IS_READY, ""),
            Seen::Waits(object) => (ESL_TASK_WAITS, object),
            Seen::IsSuspended(by) => (ESL_TASK_IS_SUSPENDED, by),
            Seen::IsToEnd => (ESL_TASK_IS_TO_END, ""),
            Seen::Ends(how) => (ESL_TASK_ENDS, how),
            Seen::Signals(event) => (ESL_TASK_SIGNALS, event),
            Seen::IsWokenBy { task, event } => {
                other_task = task.0;
                (ESL_TASK_IS_WOKEN, event)
            }
            Seen::Fails(cause) => (ESL_TASK_FAILS, cause),
            Seen::Recovers(cause) => (ESL_TASK_RECOVERS, cause),
            Seen::Changes { fact, is_there: true } => (ESL_FACT_ASSERTED, fact),
            Seen::Changes { fact, is_there: false } => (ESL_FACT_RETRACTED, fact),
            Seen::CollectionBegins => (ESL_COLLECTION_BEGINS, ""),
            Seen::PauseBegins => (ESL_PAUSE_BEGINS, ""),
            Seen::PauseEnds => (ESL_PAUSE_ENDS, ""),
            Seen::CollectionEnds => (ESL_COLLECTION_ENDS, ""),
        };
        let text = c_text(text);
        let text = text.as_ptr();
        let seen = esl_seen { event, time, task: task.0, other_task, is_hidden: is_hidden_task, text };
        // SAFETY: the embedder has given the function for this pointer; the event lives until it returns.
        unsafe { (self.function)(self.user.pointer, ptr::from_ref(&seen)) };
    }
}

/// Has an observer told what happens in the run, from the next turn on, until the watch is freed: `user` is
/// freed before the next event then. Where `watch` is null, until the end of the engine. With a status other
/// than `ESL_OK`, `user` is freed at once. From any thread.
///
/// # Safety
/// `handle` is a handle; `observer` and `destructor` can be called with `user`; `watch` and `failure` are
/// places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_handle_subscribe(
    handle: *const esl_handle,
    observer: esl_observer,
    user: *mut c_void,
    destructor: esl_destructor,
    watch: *mut *mut esl_watch,
    failure: *mut *mut esl_failure,
) -> esl_status {
    let user = UserData::new(user, destructor);
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let function = observer.ok_or_else(no_callback)?;
            let is_over = Arc::<AtomicBool>::default();
            look(handle)?.0.subscribe(ObserverOfC { function, user, is_over: is_over.clone() });
            if !watch.is_null() {
                hand(watch, esl_watch(Watched::Run(RunWatch(is_over))));
            }
            Ok(())
        })
    }
}
