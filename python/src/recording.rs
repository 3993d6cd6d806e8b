//! Recordings of engines, and their replay.

use std::sync::Arc;

use esl::Error;
use esl::host::{Host, NotedRecord, RealHost, RecordingHost, ReplayHost};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::failure::exception;
use crate::output::Screen;

/// Everything that a run has learnt from outside, for a replay.
#[pyclass(frozen, module = "esl")]
pub(crate) struct Recording(Arc<[NotedRecord]>);

#[pymethods]
impl Recording {
    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __repr__(&self) -> String {
        format!("<esl.Recording of {} records>", self.0.len())
    }
}

/// The recording that an engine keeps or replays.
pub(crate) enum Memory {
    None,
    Recorded(esl::host::Recording),
    Replayed(ReplayHost),
}

impl Memory {
    /// Returns the host of an engine that replays a recording, or that is recorded, or neither.
    ///
    /// # Errors
    /// `ValueError` for both.
    pub(crate) fn host(
        real: RealHost,
        screen: Option<Screen>,
        is_recorded: bool,
        replayed: Option<&Recording>,
    ) -> PyResult<(Box<dyn Host + Send>, Memory)> {
        if let Some(recording) = replayed {
            if is_recorded {
                let text =
                    "an engine that replays a recording keeps none: pass `record` or `replay`, not both";
                return Err(PyValueError::new_err(text));
            }
            let mut host = ReplayHost::new(recording.0.clone());
            if let Some(mut screen) = screen {
                host = host.with_screen(move |_, bytes| drop(screen(bytes)));
            }
            return Ok((Box::new(host.clone()), Memory::Replayed(host)));
        }
        let real = match screen {
            Some(screen) => real.with_screen(screen),
            None => real,
        };
        if !is_recorded {
            return Ok((Box::new(real), Memory::None));
        }
        let host = RecordingHost::new(real);
        let recording = host.recording();
        Ok((Box::new(host), Memory::Recorded(recording)))
    }

    /// Returns what was recorded so far.
    ///
    /// # Errors
    /// `RuntimeError`, if the engine is not recorded.
    pub(crate) fn recording(&self) -> PyResult<Recording> {
        match self {
            Memory::Recorded(kept) => Ok(Recording(kept.to_records().into())),
            Memory::None | Memory::Replayed(_) => Err(PyRuntimeError::new_err(
                "the engine keeps no recording: make it by `esl.Engine(record=True)`",
            )),
        }
    }

    /// Returns the exception of an evaluation that has no value: `esl.Diverged` if the engine replays a
    /// recording that does not have it.
    pub(crate) fn exception(
        &self,
        py: Python<'_>,
        error: Error,
        other: impl FnOnce(Error) -> PyErr,
    ) -> PyErr {
        match (self.check_replay(py), error) {
            (Err(diverged), _) => diverged,
            (Ok(()), Error::Ended) if matches!(self, Memory::Replayed(_)) => {
                let text = "the recording has no such evaluation: give the engine those of the recorded one";
                exception(py, "Diverged", (text,))
            }
            (Ok(()), error) => other(error),
        }
    }

    /// # Errors
    /// `esl.Diverged`, if the engine replays a recording and has done something else than the recorded run.
    pub(crate) fn check_replay(&self, py: Python<'_>) -> PyResult<()> {
        let Memory::Replayed(host) = self else { return Ok(()) };
        let text = match (host.divergence(), host.asked_at_end()) {
            (Some(divergence), _) => divergence.to_string(),
            (None, Some(asked)) => format!("the recording is at its end, and the program asks {asked}"),
            (None, None) => return Ok(()),
        };
        let text = format!("{text}; give the engine the definitions and texts of the recorded one");
        Err(exception(py, "Diverged", (text,)))
    }
}
