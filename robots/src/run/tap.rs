//! The recorder that hears of the topics of ROS 2 of this process, whose payloads reach no observer.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{PoisonError, RwLock};

use super::recorder::RunRecorder;
use crate::message::MessageType;

static IS_ON: AtomicBool = AtomicBool::new(false);
static RECORDER: RwLock<Option<RunRecorder>> = RwLock::new(None);

/// Has a recorder hear of all topics, or none.
pub(super) fn set(recorder: Option<RunRecorder>) {
    IS_ON.store(recorder.is_some(), Ordering::Relaxed);
    *RECORDER.write().unwrap_or_else(PoisonError::into_inner) = recorder;
}

/// Returns whether there is a recorder.
pub(crate) fn is_on() -> bool {
    IS_ON.load(Ordering::Relaxed)
}

/// Tells the recorder, if there is one, of a message under a topic.
pub(crate) fn note_topic(topic: &str, of_type: &MessageType, payload: &[u8]) {
    if is_on()
        && let Some(recorder) = &*RECORDER.read().unwrap_or_else(PoisonError::into_inner)
    {
        recorder.note_topic(topic, of_type, payload);
    }
}
