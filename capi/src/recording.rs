//! Recordings of runs, for a replay.

use std::sync::Arc;

use esl::host::NotedRecord;

use crate::border::{freeing, guarded, hand, look, take};
use crate::config::{Memory, esl_config};
use crate::engine::esl_engine;
use crate::failure::{Fault, esl_failure};
use crate::status::esl_status::{self, ESL_INVALID_ARGUMENT};

/// Everything that a run has learnt from outside: the answers of its host, the messages of handles, and the
/// results of functions and operations. It belongs to the caller, who frees it. From any thread.
pub struct esl_recording(Arc<[NotedRecord]>);

/// Has engines keep a recording in memory, which `esl_engine_recording` returns.
///
/// # Safety
/// `config` is settings, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_recording(
    config: *const esl_config,
    is_recorded: bool,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { crate::config::change(config, |settings| settings.is_recorded = is_recorded) }
}

/// Has engines replay a recording, which they copy: they call neither functions nor operations of the
/// embedder, ask no clock, and write nothing, but do the same as the recorded engine if they are given the
/// same definitions and texts. `esl_engine_canary` tells whether they did; a call returns `ESL_DIVERGED` when
/// they ask for something else. Such an engine waits for nothing: what came from outside comes again by
/// itself, so other threads need not send it. A question to it that was not recorded ends with `ESL_ENDED`.
///
/// # Safety
/// `config` is settings and `recording` a recording; `failure` is a place that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_config_set_replay(
    config: *const esl_config,
    recording: *const esl_recording,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let records = look(recording)?.0.clone();
            look(config)?.0.borrow_mut().replayed = Some(records);
            Ok(())
        })
    }
}

/// Copies what has been recorded of an engine so far.
///
/// # Safety
/// `engine` is an engine; `recording` and `failure` are places that can be written, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_engine_recording(
    engine: *const esl_engine,
    recording: *mut *mut esl_recording,
    failure: *mut *mut esl_failure,
) -> esl_status {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe {
        guarded(failure, || {
            let guard = esl_engine::lock(engine)?;
            let Memory::Recorded(kept) = &look(engine)?.memory else {
                let message = "the engine keeps no recording: make it with `esl_config_set_recording`";
                return Err(Fault::new(ESL_INVALID_ARGUMENT, message));
            };
            let records = kept.to_records();
            drop(guard);
            hand(recording, esl_recording(records.into()));
            Ok(())
        })
    }
}

/// Frees a recording; null is ignored.
///
/// # Safety
/// `recording` was not freed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_recording_free(recording: *mut esl_recording) {
    // SAFETY: each pointer is null, or to what C holds and lends.
    freeing(|| drop(unsafe { take(recording) }));
}

/// Returns the canary of the run so far: a hash of the turns of its tasks and of the questions to its host.
/// Runs with the same canary took the same course. Returns 0 if the engine is in a call.
///
/// # Safety
/// `engine` is an engine, or null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn esl_engine_canary(engine: *const esl_engine) -> u64 {
    // SAFETY: each pointer is null, or to what C holds and lends.
    unsafe { esl_engine::lock(engine) }.map_or(0, |engine| engine.canary())
}
