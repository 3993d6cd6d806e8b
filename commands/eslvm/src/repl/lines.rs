//! Lines of input: what reading one gives, where they come from, and the lines of a pipe.

use std::io::BufRead;
use std::sync::mpsc::Sender;

use esl_host::ProcessSignal;

/// Result of reading a line.
pub(crate) enum Line {
    /// Text of a line, without its newline.
    Text(String),
    /// The person drops what was typed so far.
    Dropped,
    /// There are no more lines.
    End,
    /// A signal of the process ends the session.
    Signalled(ProcessSignal),
    /// Reading failed, for this reason.
    Failed(String),
    /// The person wants to know how something can be completed. The line is still to come.
    Completing(CompletionRequest),
}

/// A word that is to be completed.
pub(crate) struct CompletionRequest {
    /// The word.
    pub(crate) word: String,
    /// Whether it is a command, not a name.
    pub(crate) is_command: bool,
    /// Takes the completions.
    pub(crate) reply: Sender<Vec<WordCompletion>>,
}

/// A text that completes what was typed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct WordCompletion {
    /// The text.
    pub(crate) text: String,
    /// Its description, in a line.
    pub(crate) about: String,
}

/// A place that lines come from.
pub(crate) trait Lines {
    /// Reads the next line.
    fn next(&mut self, prompt: &str) -> Line;
    /// Adds a whole form to the history.
    fn remember(&mut self, _form: &str) {}
}

/// Lines from a pipe or a file.
pub(crate) struct Pipe;

impl Lines for Pipe {
    fn next(&mut self, _prompt: &str) -> Line {
        let mut line = String::new();
        match std::io::stdin().lock().read_line(&mut line) {
            Ok(0) => Line::End,
            Ok(_) => Line::Text(line.trim_end_matches(['\n', '\r']).to_string()),
            Err(error) => Line::Failed(error.to_string()),
        }
    }
}
