//! Lines that are typed while the machine runs: a thread of their own waits for them.
//!
//! The thread reads a line only on request, so that a form that is being evaluated has the standard input to
//! itself.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use esl_host::{Inbox, Incoming};

use super::editor::Editor;
use super::lines::{CompletionRequest, Line, Lines, Pipe, WordCompletion};
use super::screen::PromptScreen;
use super::terminal::Terminal;

/// Request to the thread.
enum Request {
    /// Read a line, with this prompt.
    Line(&'static str),
    /// Add a form to the history.
    Remember(String),
}

/// Name of the file with the history of sessions in which forms are typed.
const HISTORY: &str = ".esl-history";
/// Time that the machine has to say how something can be completed.
const PATIENCE: Duration = Duration::from_secs(2);

/// Source of the lines of a session.
pub(super) struct Typing {
    requests: Sender<Request>,
    lines: Receiver<Line>,
    /// For lines that are not typed.
    other_lines: Sender<Line>,
    /// Whether a person types at a terminal.
    pub(super) is_interactive: bool,
    /// Settings of the terminal when the session began.
    terminal: Option<Terminal>,
    screen: PromptScreen,
}

/// Asks the session, which waits for a line, how a word can be completed: by a command at the beginning of a
/// line, or else by a name.
fn completions(session: &Sender<Line>, bell: &Inbox, before: &str, word: &str) -> Vec<WordCompletion> {
    let (reply, replied) = channel();
    let is_command = before.trim().is_empty() && word.starts_with(':');
    let request = CompletionRequest { word: word.into(), is_command, reply };
    if session.send(Line::Completing(request)).is_err() {
        return Vec::new();
    }
    bell.put(Incoming::Stop);
    replied.recv_timeout(PATIENCE).unwrap_or_default()
}

impl Typing {
    /// Starts the thread: it reads from a terminal, with an editor that prints through `screen`, or from a
    /// pipe. When a line comes, it has the machine come back from its background tasks.
    ///
    /// # Errors
    /// If the system makes no thread.
    pub(super) fn begin(is_interactive: bool, screen: PromptScreen, inbox: Inbox) -> std::io::Result<Typing> {
        let (requests, asked) = channel();
        let (answer, lines) = channel();
        let other_lines = answer.clone();
        let terminal = if is_interactive { Terminal::now() } else { None };
        let above = screen.clone();
        std::thread::Builder::new().name("typing".into()).spawn(move || {
            let (asked_of, bell) = (answer.clone(), inbox.clone());
            let complete = move |before: &str, word: &str| completions(&asked_of, &bell, before, word);
            let mut source: Box<dyn Lines> = if is_interactive {
                Box::new(Editor::new(&above, HISTORY, Box::new(complete)))
            } else {
                Box::new(Pipe)
            };
            while let Ok(request) = asked.recv() {
                match request {
                    Request::Line(prompt) => {
                        let line = source.next(prompt);
                        if answer.send(line).is_err() {
                            return;
                        }
                        inbox.put(Incoming::Stop);
                    }
                    Request::Remember(form) => source.remember(&form),
                }
            }
        })?;
        Ok(Typing { requests, lines, other_lines, is_interactive, terminal, screen })
    }

    fn request(&self, request: Request) {
        // The thread may have ended; `wait` reports that.
        _ = self.requests.send(request);
    }

    /// Returns what sends lines that are not typed.
    pub(super) fn other_lines(&self) -> Sender<Line> {
        self.other_lines.clone()
    }

    /// Requests the next line.
    pub(super) fn ask(&self, prompt: &'static str) {
        self.request(Request::Line(prompt));
    }

    /// Abandons the requested line, for good, and restores the terminal. Returns whether that could be done.
    pub(super) fn leave(&self) -> bool {
        if !self.is_interactive {
            return true;
        }
        let is_left = self.terminal.as_ref().is_some_and(Terminal::restore);
        if is_left {
            self.screen.leave_editor();
        }
        is_left
    }

    /// Adds a whole form to the history.
    pub(super) fn remember(&self, form: &str) {
        self.request(Request::Remember(form.into()));
    }

    /// Takes the requested line, if it has come.
    pub(super) fn take(&self) -> Option<Line> {
        self.lines.try_recv().ok()
    }

    /// Waits for the requested line, or for a request to complete a word before it.
    pub(super) fn wait(&self) -> Line {
        self.lines.recv().unwrap_or_else(|_| Line::Failed("the thread that reads it has ended".into()))
    }
}
