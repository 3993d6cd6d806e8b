//! Lines from a terminal: editing, history across sessions, completion.

use std::path::PathBuf;

use rustyline::completion::Pair;
use rustyline::config::CompletionType;
use rustyline::error::ReadlineError;
use rustyline::history::DefaultHistory;
use rustyline::{Completer, Helper, Highlighter, Hinter, Validator};

use super::lines::{Line, Lines, WordCompletion};
use super::screen::PromptScreen;

/// Width of the list of completions.
const WIDTH: usize = 78;
/// Least width of the names in it, if there is something to say about any.
const NAMES: usize = 20;
/// Completions that are listed without asking.
const LISTED: usize = 60;

/// Function that completes the words of a line: it is given all before a word, and the beginning of the word.
pub(crate) type CompleteWord = Box<dyn Fn(&str, &str) -> Vec<WordCompletion>>;

/// The helper of the line editor.
#[derive(Helper, Hinter, Highlighter, Validator, Completer)]
struct EditorHelper {
    #[rustyline(Completer)]
    completer: WordCompleter,
}

/// Completes the word at the cursor.
struct WordCompleter(CompleteWord);

impl rustyline::completion::Completer for WordCompleter {
    type Candidate = Pair;

    fn complete(
        &self,
        line: &str,
        position: usize,
        _context: &rustyline::Context<'_>,
    ) -> rustyline::Result<(usize, Vec<Pair>)> {
        let start = line[..position].rfind(|c: char| "()'`,\"# ".contains(c)).map_or(0, |index| index + 1);
        let (before, word) = line[..position].split_at(start);
        let found = if word.is_empty() { Vec::new() } else { (self.0)(before, word) };
        Ok((start, listed(found)))
    }
}

/// Returns completions as they are listed: each with what there is to say about it.
fn listed(found: Vec<WordCompletion>) -> Vec<Pair> {
    let width = found.iter().map(|completion| completion.text.chars().count()).max().unwrap_or(0).max(NAMES);
    let shown = |WordCompletion { text, about }: WordCompletion| {
        let row = format!("{text:width$}  {about}");
        let display = if about.is_empty() { text.clone() } else { row.chars().take(WIDTH).collect() };
        Pair { display, replacement: text }
    };
    found.into_iter().map(shown).collect()
}

/// A terminal with line editing.
pub(crate) struct Editor {
    editor: Option<rustyline::Editor<EditorHelper, DefaultHistory>>,
    history: Option<PathBuf>,
}

impl Editor {
    /// Creates an editor that completes words by a function, with the history of earlier sessions in a
    /// file of this name in the person's home. From now on `screen` prints above the line that is edited.
    pub(crate) fn new(screen: &PromptScreen, history: &str, complete: CompleteWord) -> Editor {
        let config = rustyline::Config::builder()
            .completion_type(CompletionType::List)
            .completion_show_all_if_ambiguous(true)
            .completion_prompt_limit(LISTED)
            .build();
        let mut editor = rustyline::Editor::<EditorHelper, DefaultHistory>::with_config(config).ok();
        let external = editor.as_mut().and_then(|editor| editor.create_external_printer().ok());
        if let Some(external) = external {
            screen.print_through(Box::new(external));
        }
        let history = std::env::home_dir().map(|home| home.join(history));
        if let (Some(editor), Some(history)) = (&mut editor, &history) {
            editor.set_helper(Some(EditorHelper { completer: WordCompleter(complete) }));
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
    use rustyline::completion::Completer;

    use super::*;

    #[test]
    fn the_word_at_the_cursor_is_completed() {
        let complete = |before: &str, word: &str| {
            let about = if before.is_empty() { String::new() } else { format!("After {before}") };
            vec![WordCompletion { text: format!("{word}ure"), about }]
        };
        let completer = WordCompleter(Box::new(complete));
        let history = DefaultHistory::new();
        let context = rustyline::Context::new(&history);
        let found = |line: &str, position: usize| {
            let (start, found) = completer.complete(line, position, &context).expect("nothing can go wrong");
            let rows = found.into_iter().map(|pair| (pair.replacement, pair.display));
            (start, rows.collect::<Vec<_>>())
        };
        let about = "failure               After (print (".to_string();
        assert_eq!(found("(print (fail x", 12), (8, vec![("failure".into(), about)]));
        assert_eq!(found("fail", 4), (0, vec![("failure".into(), "failure".into())]));
        assert_eq!(found("(", 1), (1, vec![]));
    }
}
