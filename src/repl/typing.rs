//! Lines that are typed while the machine runs: a thread of its own waits for them.
//!
//! It reads a line only when it is asked to, so that a program that is evaluated has the standard input to itself.

use std::io::BufRead;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};

use esl_vm::host::Waker;

use super::editor::{Editor, Printer};
use super::terminal::Terminal;

/// What reading a line gave.
pub(super) enum Line {
    /// A line.
    Text(String),
    /// The person wants to drop what was typed so far.
    Dropped,
    /// There are no more lines.
    End,
    /// Reading failed.
    Failed(String),
}

/// Where lines come from.
pub(super) trait Lines {
    /// The next line, without its newline.
    fn next(&mut self, prompt: &str) -> Line;
    /// Notes a whole form for the history.
    fn remember(&mut self, _form: &str) {}
    /// Takes the names that are there now.
    fn learn(&mut self, _names: Vec<String>) {}
}

/// Lines from a pipe or a file.
struct Pipe;

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

/// What the thread is asked for.
enum Request {
    /// A line, with this prompt.
    Line(&'static str),
    Remember(String),
    Learn(Vec<String>),
}

/// The lines of a session.
pub(super) struct Typing {
    requests: Sender<Request>,
    lines: Receiver<Line>,
    /// Set when a line has come, so that the machine stops what it runs meanwhile.
    has_come: Arc<AtomicBool>,
    /// Whether a person types at a terminal.
    pub is_interactive: bool,
    /// How the terminal was, if there is one.
    terminal: Option<Terminal>,
    printer: Printer,
}

impl Typing {
    /// Begins to read: from a terminal with an editor, whose printer goes to `printer`, or from a pipe. When a line comes, the flag
    /// is set and the machine woken.
    pub(super) fn begin(
        is_interactive: bool,
        printer: Printer,
        has_come: Arc<AtomicBool>,
        waker: Waker,
    ) -> std::io::Result<Typing> {
        let (requests, asked) = channel();
        let (answer, lines) = channel();
        let flag = has_come.clone();
        let terminal = if is_interactive { Terminal::now() } else { None };
        let above = printer.clone();
        std::thread::Builder::new().name("typing".into()).spawn(move || {
            let mut source: Box<dyn Lines> =
                if is_interactive { Box::new(Editor::new(&above)) } else { Box::new(Pipe) };
            while let Ok(request) = asked.recv() {
                match request {
                    Request::Line(prompt) => {
                        let line = source.next(prompt);
                        // The flag is cleared when the line is taken, so it comes first.
                        flag.store(true, Ordering::Relaxed);
                        if answer.send(line).is_err() {
                            return;
                        }
                        waker.wake();
                    }
                    Request::Remember(form) => source.remember(&form),
                    Request::Learn(names) => source.learn(names),
                }
            }
        })?;
        Ok(Typing { requests, lines, has_come, is_interactive, terminal, printer })
    }

    fn request(&self, request: Request) {
        // Without the thread there is nothing to ask; `take` and `wait` say so.
        _ = self.requests.send(request);
    }

    /// Has the next line read.
    pub(super) fn ask(&self, prompt: &'static str) {
        self.request(Request::Line(prompt));
    }

    /// Gives up the line that is awaited, for good; whether that can be done.
    pub(super) fn leave(&self) -> bool {
        if !self.is_interactive {
            return true;
        }
        let is_left = self.terminal.as_ref().is_some_and(Terminal::restore);
        if is_left {
            self.printer.leave_editor();
        }
        is_left
    }

    /// Notes a whole form for the history.
    pub(super) fn remember(&self, form: &str) {
        self.request(Request::Remember(form.into()));
    }

    /// Takes the names that are there now, to complete what is typed.
    pub(super) fn learn(&self, names: Vec<String>) {
        self.request(Request::Learn(names));
    }

    /// The line that was asked for, if it has come.
    pub(super) fn take(&self) -> Option<Line> {
        self.lines.try_recv().ok().inspect(|_| self.has_come.store(false, Ordering::Relaxed))
    }

    /// Waits for the line that was asked for.
    pub(super) fn wait(&self) -> Line {
        let line = self.lines.recv();
        self.has_come.store(false, Ordering::Relaxed);
        line.unwrap_or_else(|_| Line::Failed("its reader is gone".into()))
    }
}
