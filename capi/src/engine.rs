//! Engines: evaluation, and the loop.

use std::ffi::{c_char, c_int};
use std::sync::{Mutex, MutexGuard, OnceLock, TryLockError};
use std::time::Instant;

use esl::engine::{Ending, Poll};
use esl::{Data, Engine, Error};

use crate::border::{guarded, hand, look, store, take, text};
use crate::config::{Memory, Settings, esl_config};
use crate::failure::{Fault, esl_failure};
use crate::fork::Process;
use crate::listed::copies;
use crate::reply::{AwaitedAnswer, esl_reply};
use crate::status::esl_status::{self, ESL_BUSY, ESL_DIVERGED, ESL_PANIC};
use crate::value::esl_value;
use crate::wakeup::Wakeup;

/// A machine in which programs run. It serves one thread at a time; a call while another one is under way
/// returns `ESL_BUSY`. Other threads reach the run by handles.
pub struct esl_engine {
    engine: Mutex<Engine>,
    pub(crate) memory: Memory,
    process: Process,
    wakeup: OnceLock<Wakeup>,
}

/// Where a run stands.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum esl_state {
    /// Some task can go on at once.
    ESL_RUNNING = 0,
    /// All tasks wait.
    ESL_WAITING = 1,
    /// Every task has ended.
    ESL_DONE = 2,
    /// The program has asked to end, with a status.
    ESL_EXITED = 3,
    /// The tasks that are left wait for what cannot come.
    ESL_STUCK = 4,
    /// The budget of the run is spent.
    ESL_SPENT = 5,
    /// `esl_handle_stop` has ended the run for now.
    ESL_HALTED = 6,
}

use esl_state::*;

/// Where a run stands after a portion of it.
#[repr(C)]
pub struct esl_progress {
    /// The state.
    pub state: esl_state,
    /// For `ESL_EXITED` the status with which the program has asked to end.
    pub exit_status: u8,
    /// For `ESL_WAITING` the nanoseconds until the first task goes on; -1 if none waits for a time.
    pub wait: i64,
}

impl esl_engine {
    /// Returns the engine that C names.
    ///
    /// # Errors
    /// A fault, if it is in a call.
    ///
    /// # Safety
    /// The pointer is null, or to an engine that is not freed meanwhile.
    pub(crate) unsafe fn lock<'a>(engine: *const esl_engine) -> Result<MutexGuard<'a, Engine>, Fault> {
        // SAFETY: each pointer is null, or to what C holds and lends.
        let engine = unsafe { look(engine) }?;
        engine.process.check()?;
        match engine.engine.try_lock() {
            Ok(engine) => Ok(engine),
            Err(TryLockError::Poisoned(_)) => Err(Fault::new(
                ESL_PANIC,
                "a fault of ESL has ended an earlier call of this engine: free it, and make a new one",
            )),
            Err(TryLockError::WouldBlock) => Err(Fault::new(
                ESL_BUSY,
                "the engine is in a call: it serves one thread at a time, and the functions that it calls \
                 do not call it; use a handle",
            )),
        }
    }
}

impl esl_engine {
    /// Returns the fault of a replay that has done something else than the recorded run.
    ///
    /// # Errors
    /// That fault.
    fn check_replay(&self) -> Result<(), Fault> {
        let Memory::Replayed(host) = &self.memory else { return Ok(()) };
        let text = match (host.divergence(), host.asked_at_end()) {
            (Some(divergence), _) => divergence.to_string(),
            (None, Some(asked)) => format!("the recording is at its end, and the program asks {asked}"),
            (None, None) => return Ok(()),
        };
        Err(Fault::new(
            ESL_DIVERGED,
            format!("{text}; give the engine the definitions and texts of the recorded one"),
        ))
    }
}

fn progress(ending: Ending) -> esl_progress {
    let (state, exit_status) = match ending {
        Ending::Done => (ESL_DONE, 0),
        Ending::Exited(status) => (ESL_EXITED, status),
        Ending::Deadlocked => (ESL_STUCK, 0),
        Ending::BudgetSpent => (ESL_SPENT, 0),
        _ => (ESL_HALTED, 0),
    };
    esl_progress { state, exit_status, wait: -1 }
}

/// Creates an engine with the library of ESL. `config` may be null, for the defaults.
///
/// # Safety
/// `config` is settings, or null; `engine` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_engine_new(
    config: *const esl_config,
    engine: *mut *mut esl_engine,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let settings = Settings::of(config)?;
            let process = Process::this();
            let (host, memory) = settings.host();
            let mut made = Engine::with(settings.machine.clone(), host)?;
            if let Some(ticks) = settings.ticks {
                made = made.with_ticks(ticks);
            }
            hand(engine, esl_engine { engine: Mutex::new(made), memory, process, wakeup: OnceLock::new() });
            Ok(())
        })
    }
}

/// Ends what still runs in an engine, as `esl_engine_end`, and frees it. Null is ignored. Returns `ESL_BUSY`,
/// and frees nothing, while the engine is in a call. In a child of the process that has made it, ends
/// nothing.
///
/// # Safety
/// `engine` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_engine_free(engine: *mut esl_engine) -> esl_status {
    if engine.is_null() {
        return esl_status::ESL_OK;
    }
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(std::ptr::null_mut(), || {
            if !look(engine)?.process.is_this() {
                // Its tasks are those of the parent: to end them here would wait for threads of the parent.
                std::mem::forget(take(engine)?);
                return Ok(());
            }
            // The lock is a part of the engine: it is let go before.
            match esl_engine::lock(engine).map(drop) {
                Err(fault) if fault.status() != ESL_PANIC => Err(fault),
                _ => take(engine).map(drop),
            }
        })
    }
}

/// Ends what still runs: aborts all tasks, newest first, and runs their cleanups; cancels operations under
/// way, and waits until they have stopped.
///
/// # Safety
/// `engine` is an engine; `failure` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_engine_end(
    engine: *const esl_engine,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            esl_engine::lock(engine)?.end();
            Ok(())
        })
    }
}

/// Evaluates with an engine, and stores the value.
///
/// # Safety
/// As the functions of the API that call it.
unsafe fn evaluate(
    engine: *const esl_engine,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
    evaluation: impl FnOnce(&mut Engine) -> Result<Result<Data, Error>, Fault>,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let data = evaluation(&mut *esl_engine::lock(engine)?)?;
            if data.is_err() {
                look(engine)?.check_replay()?;
            }
            let data = data?;
            hand(value, esl_value(data));
            Ok(())
        })
    }
}

/// Evaluates the forms of a text one after another, and stores the first value of the last form.
///
/// # Safety
/// `engine` is an engine; `text` ends with a null character; `value` and `failure` are places that can be
/// written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_eval(
    engine: *const esl_engine,
    text: *const c_char,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { evaluate(engine, value, failure, |engine| Ok(engine.eval(self::text(text, "text")?))) }
}

/// Evaluates the forms of a source file, or runs a compiled file (`.eslb`), and stores the first value of the
/// last form. The program needs no right for it. `require` finds modules beside the file if the program may
/// read them.
///
/// # Safety
/// As for `esl_eval`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_load(
    engine: *const esl_engine,
    path: *const c_char,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { evaluate(engine, value, failure, |engine| Ok(engine.load(text(path, "path")?))) }
}

/// Calls a function of the program, by its name in any case, with `count` arguments, which are copied. Stores
/// its first value.
///
/// # Safety
/// `engine` is an engine; `function` ends with a null character; `arguments` points to `count` values;
/// `value` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_call(
    engine: *const esl_engine,
    function: *const c_char,
    arguments: *const *const esl_value,
    count: usize,
    value: *mut *mut esl_value,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        evaluate(engine, value, failure, |engine| {
            let (function, arguments) = (text(function, "name of the function")?, copies(arguments, count)?);
            Ok(engine.call(function, arguments))
        })
    }
}

/// Has a text evaluated as a task of the runs to come; runs nothing. `reply` gets what will become of it.
///
/// # Safety
/// `engine` is an engine; `text` ends with a null character; `reply` and `failure` are places that can be
/// written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_begin(
    engine: *const esl_engine,
    text: *const c_char,
    reply: *mut *mut esl_reply,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let text = self::text(text, "text")?;
            let answer = esl_engine::lock(engine)?.begin(text);
            hand(reply, AwaitedAnswer::Value(answer).into_reply());
            Ok(())
        })
    }
}

/// Runs tasks until all have ended or wait for what cannot come. Waits while all of them wait.
///
/// # Safety
/// `engine` is an engine; `progress` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_run(
    engine: *const esl_engine,
    progress: *mut esl_progress,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let ending = esl_engine::lock(engine)?.run();
            store(progress, self::progress(ending));
            look(engine)?.check_replay()
        })
    }
}

/// Runs tasks for a number of ticks, for a loop of the caller's; never waits. When all tasks wait, the caller
/// waits for the time that `progress` names, and for the file descriptor of `esl_wakeup_fd`.
///
/// # Safety
/// As for `esl_run`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_poll(
    engine: *const esl_engine,
    ticks: u64,
    progress: *mut esl_progress,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let mut guard = esl_engine::lock(engine)?;
            let wakeup = look(engine)?.wakeup.get();
            if let Some(wakeup) = wakeup {
                wakeup.clear();
            }
            let now = Instant::now();
            let read = match guard.poll(now, ticks) {
                Poll::Busy => esl_progress { state: ESL_RUNNING, exit_status: 0, wait: 0 },
                Poll::Idle { until } => {
                    let wait = until.map(|until| until.saturating_duration_since(Instant::now()));
                    let nanoseconds = wait.map(|wait| i64::try_from(wait.as_nanos()).unwrap_or(i64::MAX));
                    esl_progress { state: ESL_WAITING, exit_status: 0, wait: nanoseconds.unwrap_or(-1) }
                }
                Poll::Ended(ending) => self::progress(ending),
            };
            if let Some(wakeup) = wakeup {
                match read.state {
                    // Tasks that can go on at once do not wait for the descriptor.
                    ESL_RUNNING => wakeup.waker().wake_by_ref(),
                    _ => guard.wake_when_ready(wakeup.waker()),
                }
            }
            let is_over = !matches!(read.state, ESL_RUNNING | ESL_WAITING);
            store(progress, read);
            if is_over { look(engine)?.check_replay() } else { Ok(()) }
        })
    }
}

/// Stores a file descriptor that becomes readable when something has come for the engine, so that a loop
/// waits for it by `poll`, `epoll` or the like, and calls `esl_poll` then. It belongs to the engine: the
/// caller neither reads nor closes it.
///
/// # Safety
/// `engine` is an engine; `descriptor` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_wakeup_fd(
    engine: *const esl_engine,
    descriptor: *mut c_int,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let guard = esl_engine::lock(engine)?;
            let place = &look(engine)?.wakeup;
            if place.get().is_none() {
                let wakeup = Wakeup::new().map_err(|error| {
                    Fault::new(esl_status::ESL_NO_MEMORY, format!("the system gives no descriptor: {error}"))
                })?;
                guard.wake_when_ready(wakeup.waker());
                // The lock of the engine is held, so no other thread has set it.
                _ = place.set(wakeup);
            }
            store(descriptor, place.get().map_or(-1, Wakeup::descriptor));
            Ok(())
        })
    }
}
