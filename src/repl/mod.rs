//! The REPL: reads forms, has them evaluated in a machine that lasts, prints their values.
//!
//! Lines are gathered until they hold a whole form. With a terminal there are line editing, history and completion; from a
//! pipe forms are read alike and nothing but results is written. Reading, evaluating and printing are functions of the
//! library; here is only what has to do with lines.
//!
//! Tasks that a form has made go on in the background: while other forms are evaluated, and while a line is awaited. They are
//! aborted, and their cleanups awaited, at the end of the session.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "the REPL talks with people")]

mod editor;
mod terminal;
mod typing;

use std::io::{IsTerminal, Write};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_vm::host::{FileAccess, Output, RealHost};
use esl_vm::run::RunOutcome;
use esl_vm::task::{TaskId, TaskResult};
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use crate::command::{SUCCESS, USAGE, complain, interrupt_on_signal};
use crate::library::Library;
use crate::program;
use editor::Printer;
use typing::{Line, Typing};

/// The prompt, and the one for further lines of a form.
const PROMPT: &str = "? ";
const CONTINUATION: &str = "  ";

/// Runs the REPL until the end of the input or `:quit`, with the modules of `library`. Gives the exit status.
///
/// # Errors
/// The exit status, if the machine could not be made.
pub fn run(config: Config, virtual_time: bool, library: &Library) -> Result<u8, u8> {
    let mut host = RealHost::new(Vec::new()).with_files(FileAccess::All);
    let is_interactive = std::io::stdin().is_terminal();
    let printer = Printer::default();
    if is_interactive {
        let printer = printer.clone();
        host = host.with_screen(Box::new(move |bytes| printer.print(bytes)));
    }
    if virtual_time {
        host = host.with_virtual_time();
    }
    let waker = host.waker();
    let setup = |text| {
        complain(text);
        USAGE
    };
    let mut machine = program::machine(config, Box::new(host)).map_err(setup)?;
    program::set_library(&mut machine, library).map_err(setup)?;
    machine.complain_to(Output::Standard);
    let typing = Typing::begin(is_interactive, printer, machine.stop_flag(), waker.clone())
        .map_err(|error| setup(format!("no thread can be made: {error}")))?;
    let mut session = Session { machine, typing, virtual_time, failure: None };
    session.call("%REPL-BEGIN", "");
    interrupt_on_signal(session.machine.interrupt_flag(), waker);
    let status = session.talk();
    session.machine.abort_all();
    session.machine.run(u64::MAX);
    session.machine.flush();
    status
}

/// Ticks that background tasks run between two looks at what they have written.
const BACKGROUND_TICKS: u64 = 100_000;

struct Session {
    machine: Vm,
    typing: Typing,
    /// Whether time passes only while a form is evaluated.
    virtual_time: bool,
    /// The report of the last failure, for `:bt`.
    failure: Option<String>,
}

/// What is to be done after a form.
enum Next {
    /// Read the next one.
    Form,
    /// The text is the beginning of a form.
    More,
    /// End with this status.
    Quit(u8),
}

impl Session {
    /// Runs background tasks until the next line has come.
    fn next_line(&mut self, prompt: &'static str) -> Line {
        self.typing.ask(prompt);
        loop {
            if let Some(line) = self.typing.take() {
                return line;
            }
            let outcome = if self.virtual_time {
                self.machine.run_ready(BACKGROUND_TICKS)
            } else {
                self.machine.run(BACKGROUND_TICKS)
            };
            if self.machine.exit_status().is_some() && self.typing.leave() {
                return Line::End;
            }
            self.machine.flush();
            match outcome {
                RunOutcome::TicksUsed | RunOutcome::Stopped => {}
                RunOutcome::Done | RunOutcome::Waiting | RunOutcome::BudgetSpent => {
                    return self.typing.wait();
                }
            }
        }
    }

    fn talk(&mut self) -> Result<u8, u8> {
        let mut text = String::new();
        loop {
            let prompt = if text.is_empty() { PROMPT } else { CONTINUATION };
            if text.is_empty() && self.typing.is_interactive {
                self.typing.learn(self.machine.accessible_names());
            }
            let line = self.next_line(prompt);
            if let Next::Quit(status) = self.next() {
                // A task has asked for the end meanwhile.
                return Ok(status);
            }
            match line {
                Line::Text(line)
                    if text.is_empty() && line.trim_start().starts_with(':') && is_command(&line) =>
                {
                    if let Next::Quit(status) = self.command(line.trim()) {
                        return Ok(status);
                    }
                    self.typing.remember(&line);
                }
                Line::Text(line) => {
                    text.push_str(&line);
                    text.push('\n');
                    match self.evaluate(&text) {
                        Next::More => {}
                        Next::Form => self.typing.remember(std::mem::take(&mut text).trim_end()),
                        Next::Quit(status) => return Ok(status),
                    }
                }
                Line::Dropped => text.clear(),
                Line::End => {
                    if !text.trim().is_empty() {
                        // The rest is no whole form: say so.
                        self.call("%REPL-INCOMPLETE", &text);
                        return Ok(crate::command::NOT_COMPILED);
                    }
                    self.machine.flush();
                    return Ok(SUCCESS);
                }
                Line::Failed(reason) => {
                    complain(format_args!("standard input cannot be read: {reason}"));
                    return Err(USAGE);
                }
            }
        }
    }

    /// Evaluates the forms of a text and prints their values, unless the last form is incomplete.
    fn evaluate(&mut self, text: &str) -> Next {
        match self.call("%REPL-EVALUATE", text) {
            Some(value) => match self.machine.export(value).ok().as_ref().map(Datum::kind) {
                Some(DatumKind::Symbol(symbol)) if symbol.name() == "MORE" => Next::More,
                _ => self.next(),
            },
            None => self.next(),
        }
    }

    /// What follows an evaluation: the next form, unless the program has asked for the end.
    fn next(&self) -> Next {
        self.machine.exit_status().map_or(Next::Form, Next::Quit)
    }

    fn command(&mut self, line: &str) -> Next {
        let (command, argument) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match command {
            ":quit" | ":exit" => {
                self.machine.flush();
                return Next::Quit(SUCCESS);
            }
            ":load" => {
                let path = argument.trim();
                let bare = path.strip_prefix('"').and_then(|path| path.strip_suffix('"'));
                self.call("%REPL-LOAD", bare.unwrap_or(path));
            }
            ":bt" => match &self.failure {
                Some(report) => print!("{report}"),
                None => println!("Nothing has failed."),
            },
            ":tasks" => print!("{}", self.machine.task_report()),
            _ => print!("{HELP}"),
        }
        self.next()
    }

    /// Runs the machine until `task` has ended, or can never do so.
    fn run(&mut self, task: TaskId) -> RunOutcome {
        loop {
            // A line that is awaited does not end an evaluation; it may have come just now.
            match self.machine.run_until(Some(task), u64::MAX) {
                RunOutcome::Stopped => {}
                outcome => return outcome,
            }
        }
    }

    /// Calls a function of the library with a text, in a task that Ctrl-C aborts. `None` if it did not return.
    fn call(&mut self, function: &str, text: &str) -> Option<Value> {
        let text = self.machine.import(&Datum::string(text, Default::default())).ok()?;
        let task = match self.machine.spawn_library(function, &[text]) {
            Ok(task) => task,
            Err(text) => {
                complain(text);
                return None;
            }
        };
        self.machine.set_interruptible(Some(task));
        if self.run(task) == RunOutcome::Waiting {
            let report = self.machine.deadlock_report();
            self.machine.complain(&report);
            self.machine.abort(task);
            self.run(task);
        }
        self.machine.set_interruptible(None);
        let result = self.machine.result(task);
        let report = self.machine.report(task);
        self.machine.forget(task);
        self.machine.flush();
        match result {
            TaskResult::Succeeded(values) => return values.first().copied(),
            TaskResult::Failed(_) => match report {
                Some(report) => {
                    print!("{}", in_short(&report));
                    self.failure = Some(report);
                }
                None => println!("Aborted"),
            },
            // What the task has written may end within a line.
            _ if self.machine.exit_status().is_none() => _ = self.call("%REPL-ABORTED", ""),
            _ => {}
        }
        // What could not be written will be missed when the next value is.
        _ = std::io::stdout().flush();
        None
    }
}

/// What is shown of a failure's report at once: what went wrong, unless the last lines say that already, and those. What is
/// left out are the frames, which `:bt` shows.
fn in_short(report: &str) -> String {
    let lines: Vec<&str> = report.lines().collect();
    let ending = lines.len().saturating_sub(2);
    let (text, ending) = lines.split_at(ending);
    let text = text.iter().take_while(|line| !line.starts_with("  in ") && !line.starts_with("  while "));
    let is_plain = lines.first().is_some_and(|line| line.starts_with("A failure of cause "));
    let shown = text.filter(|_| !is_plain).chain(ending);
    shown.flat_map(|line| [line, "\n"]).collect()
}

/// Whether a line that begins with a colon is a command of the REPL, not a keyword to be evaluated.
fn is_command(line: &str) -> bool {
    let word = line.split_whitespace().next().unwrap_or("");
    matches!(word, ":quit" | ":exit" | ":load" | ":bt" | ":tasks" | ":help")
}

const HELP: &str = "\
:load FILE   evaluate the forms of a file
:bt          show where the last failure came from
:tasks       show the tasks, who made them, and what they wait for
:help        this list; (help 'name) says what a function does
:quit        end
";
