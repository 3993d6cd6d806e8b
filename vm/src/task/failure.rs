//! The report of the failure that has ended a task.

use esl_heap::stored;
use std::sync::Arc;

use esl_heap::list_state;
use esl_host::FailureFrame;

/// Report of a failure.
#[derive(Clone, Debug)]
pub(crate) struct FailureReport {
    /// Account of what happened, and where. Calls of the library are folded.
    pub story: String,
    /// The account with all calls of the library, if it may be requested.
    pub full: Option<Arc<str>>,
    /// Line that says that there is no recovery.
    pub ending: String,
    /// The account with the variables of its frames, if reports are to have them; and the length of that
    /// without them.
    pub detailed: Option<(Arc<str>, usize)>,
    /// The calls that the failure has left unfinished, innermost first.
    pub frames: Arc<[FailureFrame]>,
}

list_state! {
    FailureReport { story: Run, full: Process, ending: Run, detailed: Process, frames: Process }
}

impl FailureReport {
    /// Adds the story of a failure of a cleanup that this one has had run.
    pub(crate) fn add_cleanup(&mut self, story: &str) {
        let added = format!("In a cleanup after that:\n{story}");
        if let Some(full) = &mut self.full {
            *full = format!("{full}{added}").into();
        }
        self.story.push_str(&added);
    }

    /// Returns the whole report.
    pub(crate) fn text(&self) -> String {
        format!("{}{}Aborted\n", self.story, self.ending)
    }

    /// Returns the whole report with all calls of the library; `None` if it was not kept.
    pub(crate) fn full_text(&self) -> Option<String> {
        self.full.as_ref().map(|full| format!("{full}{}Aborted\n", self.ending))
    }

    /// Returns the whole report, with the variables of its frames if they were noted.
    pub(crate) fn detailed_text(&self) -> String {
        match &self.detailed {
            // Cleanups may have added to it since.
            Some((detailed, length)) => {
                let added = self.story.get(*length..).unwrap_or_default();
                format!("{detailed}{added}{}Aborted\n", self.ending)
            }
            None => self.text(),
        }
    }
}

stored! { FailureReport { story, full, ending, detailed, frames } }
