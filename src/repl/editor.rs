//! Lines from a terminal: editing, history across sessions, completion of names.

use std::path::PathBuf;

use rustyline::error::ReadlineError;
use rustyline::history::DefaultHistory;
use rustyline::{Completer, Helper, Highlighter, Hinter, Validator};

use super::{Line, Lines};

/// The helper of the line editor. Completion asks the table of builtins and special operators.
#[derive(Default, Helper, Hinter, Highlighter, Validator, Completer)]
struct Names {
    #[rustyline(Completer)]
    completer: NameCompleter,
}

/// Completes names of the language.
#[derive(Default)]
struct NameCompleter;

impl rustyline::completion::Completer for NameCompleter {
    type Candidate = String;

    fn complete(
        &self,
        line: &str,
        position: usize,
        _context: &rustyline::Context<'_>,
    ) -> rustyline::Result<(usize, Vec<String>)> {
        let start = line[..position].rfind(|c: char| "()'`,\"# ".contains(c)).map_or(0, |index| index + 1);
        let prefix = line[start..position].to_uppercase();
        let names = esl_bytecode::builtin::BUILTINS
            .iter()
            .filter(|info| info.visibility != esl_bytecode::builtin::Visibility::Internal)
            .map(|info| info.name)
            .filter(|name| !prefix.is_empty() && name.starts_with(&prefix));
        Ok((start, names.map(str::to_lowercase).collect()))
    }
}

/// A terminal with line editing.
pub(super) struct Editor {
    editor: Option<rustyline::Editor<Names, DefaultHistory>>,
    history: Option<PathBuf>,
}

impl Editor {
    /// An editor with the history of earlier sessions, if there is one.
    pub(super) fn new() -> Editor {
        let mut editor = rustyline::Editor::<Names, DefaultHistory>::new().ok();
        let history = std::env::home_dir().map(|home| home.join(".esl-history"));
        if let (Some(editor), Some(history)) = (&mut editor, &history) {
            editor.set_helper(Some(Names::default()));
            // The first session has none.
            _ = editor.load_history(history);
        }
        Editor { editor, history }
    }
}

impl Lines for Editor {
    fn next(&mut self, prompt: &str) -> Line {
        let Some(editor) = &mut self.editor else {
            return Line::Failed("the terminal cannot be used".into());
        };
        match editor.readline(prompt) {
            Ok(line) => Line::Text(line),
            Err(ReadlineError::Interrupted) => Line::Dropped,
            Err(ReadlineError::Eof) => Line::End,
            Err(error) => Line::Failed(error.to_string()),
        }
    }

    fn remember(&mut self, form: &str) {
        let Some(editor) = &mut self.editor else { return };
        // A history that cannot be kept is no reason to stop.
        _ = editor.add_history_entry(form.replace('\n', " "));
        if let Some(history) = &self.history {
            _ = editor.save_history(history);
        }
    }
}
