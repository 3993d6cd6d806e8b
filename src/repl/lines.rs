//! Lines of input: what reading one gives, where they come from, and the lines of a pipe.

use std::io::BufRead;

use esl_vm::host::ProcessSignal;

/// Result of reading a line.
pub(super) enum Line {
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
}

/// A place that lines come from.
pub(super) trait Lines {
    /// Reads the next line.
    fn next(&mut self, prompt: &str) -> Line;
    /// Adds a whole form to the history.
    fn remember(&mut self, _form: &str) {}
    /// Takes the names to complete from.
    fn learn(&mut self, _names: Vec<String>) {}
}

/// Lines from a pipe or a file.
pub(super) struct Pipe;

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
