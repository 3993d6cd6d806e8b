//! Lines from a terminal: editing, history across sessions, completion of names.

use std::path::PathBuf;

use rustyline::error::ReadlineError;
use rustyline::history::DefaultHistory;
use rustyline::{Completer, Helper, Highlighter, Hinter, Validator};

use super::lines::{Line, Lines};
use super::screen::PromptScreen;

/// The helper of the line editor.
#[derive(Default, Helper, Hinter, Highlighter, Validator, Completer)]
struct EditorHelper {
    #[rustyline(Completer)]
    completer: NameCompleter,
}

/// Completes the names of the language, and those that the person has used. They are sorted.
#[derive(Default)]
struct NameCompleter {
    names: Vec<String>,
}

impl NameCompleter {
    /// Returns the start of the name that ends at `position`, and all names that begin with that part of it.
    fn candidates(&self, line: &str, position: usize) -> (usize, Vec<String>) {
        let start = line[..position].rfind(|c: char| "()'`,\"# ".contains(c)).map_or(0, |index| index + 1);
        let prefix = line[start..position].to_uppercase();
        if prefix.is_empty() {
            return (start, Vec::new());
        }
        let first = self.names.partition_point(|name| *name < prefix);
        let names = self.names[first..].iter().take_while(|name| name.starts_with(&prefix));
        (start, names.map(|name| name.to_lowercase()).collect())
    }
}

impl rustyline::completion::Completer for NameCompleter {
    type Candidate = String;

    fn complete(
        &self,
        line: &str,
        position: usize,
        _context: &rustyline::Context<'_>,
    ) -> rustyline::Result<(usize, Vec<String>)> {
        Ok(self.candidates(line, position))
    }
}

/// A terminal with line editing.
pub(super) struct Editor {
    editor: Option<rustyline::Editor<EditorHelper, DefaultHistory>>,
    history: Option<PathBuf>,
}

impl Editor {
    /// Creates an editor with the history of earlier sessions. From now on `screen` prints above the line
    /// that is edited.
    pub(super) fn new(screen: &PromptScreen) -> Editor {
        let mut editor = rustyline::Editor::<EditorHelper, DefaultHistory>::new().ok();
        let external = editor.as_mut().and_then(|editor| editor.create_external_printer().ok());
        if let Some(external) = external {
            screen.print_through(Box::new(external));
        }
        let history = std::env::home_dir().map(|home| home.join(".esl-history"));
        if let (Some(editor), Some(history)) = (&mut editor, &history) {
            editor.set_helper(Some(EditorHelper::default()));
            // The first session has none.
            _ = editor.load_history(history);
        }
        Editor { editor, history }
    }
}

impl Lines for Editor {
    fn next(&mut self, prompt: &str) -> Line {
        let Some(editor) = &mut self.editor else {
            return Line::Failed("the terminal cannot be used for editing".into());
        };
        match editor.readline(prompt) {
            Ok(line) => Line::Text(line),
            Err(ReadlineError::Interrupted) => Line::Dropped,
            Err(ReadlineError::Eof) => Line::End,
            Err(error) => Line::Failed(error.to_string()),
        }
    }

    fn learn(&mut self, names: Vec<String>) {
        if let Some(helper) = self.editor.as_mut().and_then(|editor| editor.helper_mut()) {
            helper.completer.names = names;
        }
    }

    fn remember(&mut self, form: &str) {
        let Some(editor) = &mut self.editor else { return };
        // The session goes on without a history that cannot be kept.
        _ = editor.add_history_entry(form.replace('\n', " "));
        if let Some(history) = &self.history {
            _ = editor.save_history(history);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_completed_from_their_beginning() {
        let names = ["FAIL", "FAILURE-CAUSE", "FALSE", "WIDGET-OK?"].map(String::from).to_vec();
        let completer = NameCompleter { names };
        assert_eq!(completer.candidates("(print (fai", 11), (8, vec!["fail".into(), "failure-cause".into()]));
        assert_eq!(completer.candidates("(wid)", 4), (1, vec!["widget-ok?".into()]));
        assert_eq!(completer.candidates("(", 1), (1, vec![]));
        assert_eq!(completer.candidates("(x", 2), (1, vec![]));
    }
}
