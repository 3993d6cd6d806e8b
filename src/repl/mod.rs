//! The REPL: reads forms, evaluates them in a machine that lasts, prints their values.
//!
//! Lines are gathered until they hold a whole form. At a terminal there are line editing, history and
//! completion; from a pipe forms are read alike, and nothing but results is written. Reading, evaluating and
//! printing are functions of the library; this module deals with lines only.
//!
//! Tasks that a form has made go on in the background: while other forms are evaluated, and while a line is
//! awaited. At the end of the session they are aborted, and their cleanups awaited.
//!
//! ```
//! use esl::Config;
//! use esl::host::Rights;
//! use esl::module_path::ModulePath;
//!
//! // Standard input ends at once here, and so does the session.
//! let status = esl::repl::run(Config::default(), Rights::none(), false, &ModulePath::none());
//! assert_eq!(status, Ok(0));
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "the REPL talks with people")]

mod attached;
mod editor;
mod lines;
mod screen;
mod terminal;
mod typing;
mod wire;

use std::io::{IsTerminal, Write};
use std::ops::ControlFlow::{self, Break, Continue};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_vm::host::{Output, RealHost, Rights};
use esl_vm::run::RunOutcome;
use esl_vm::task::{TaskId, TaskResult};
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use crate::command::{Interrupts, NOT_COMPILED, SIGNALLED, SUCCESS, USAGE, complain, interrupt_on_signal};
use crate::module_path::ModulePath;
use crate::program;
pub use attached::attach;
use lines::Line;
use screen::PromptScreen;
use typing::Typing;
pub use wire::AttachSecurity;

/// Prompt for a form.
const PROMPT: &str = "? ";
/// Prompt for further lines of a form.
const CONTINUATION: &str = "  ";

/// Runs the REPL until the end of the input or `:quit`, with these rights and the modules of `path`. Returns
/// the exit status.
///
/// # Errors
/// The exit status, after a message, if the machine could not be made or standard input cannot be read.
pub fn run(config: Config, rights: Rights, virtual_time: bool, path: &ModulePath) -> Result<u8, u8> {
    let mut host = RealHost::new(Vec::new()).with_rights(path.with_rights(rights));
    let is_interactive = std::io::stdin().is_terminal();
    let screen = PromptScreen::default();
    if is_interactive {
        let screen = screen.clone();
        host = host.with_screen(Box::new(move |bytes| screen.print(bytes)));
    }
    if virtual_time {
        host = host.with_virtual_time();
    }
    let setup = |error| {
        complain(error);
        USAGE
    };
    let mut machine = program::machine(config, Box::new(host)).map_err(setup)?;
    if !virtual_time {
        esl_world::install_operations(&mut machine);
    }
    program::set_module_path(&mut machine, path).map_err(setup)?;
    machine.complain_to(Output::Standard);
    let typing = Typing::begin(is_interactive, screen, machine.inbox()).map_err(|error| {
        complain(format_args!("no thread can be made to read standard input: {error}"));
        USAGE
    })?;
    let lines = typing.other_lines();
    let end = move |signal| {
        // When nobody listens, the session is at its end.
        drop(lines.send(Line::Signalled(signal)));
    };
    let interrupts = interrupt_on_signal(machine.inbox(), end);
    machine.tell_variables();
    let mut repl = Repl { machine, typing, interrupts, virtual_time, failure: None };
    repl.call("%REPL-BEGIN", "");
    let status = repl.talk();
    program::end_rest(&mut repl.machine);
    status
}

/// Ticks that background tasks run between two looks at what they have written.
const BACKGROUND_TICKS: u64 = 100_000;

/// A session: the machine, and the lines that are typed.
struct Repl {
    machine: Vm,
    typing: Typing,
    interrupts: Interrupts,
    /// Whether time passes only while a form is evaluated.
    virtual_time: bool,
    /// Report of the last failure, for `:bt`.
    failure: Option<String>,
}

impl Repl {
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

    /// Evaluates lines until the session ends. Returns the exit status.
    fn talk(&mut self) -> Result<u8, u8> {
        let mut text = String::new();
        loop {
            let prompt = if text.is_empty() { PROMPT } else { CONTINUATION };
            if text.is_empty() && self.typing.is_interactive {
                self.typing.learn(self.machine.accessible_names());
            }
            let line = self.next_line(prompt);
            if let Break(status) = self.unless_exited() {
                // A background task has asked for the end.
                return Ok(status);
            }
            match line {
                Line::Text(line) if text.is_empty() && is_command(&line) => {
                    if let Break(status) = self.command(line.trim()) {
                        return Ok(status);
                    }
                    self.typing.remember(&line);
                }
                Line::Text(line) => {
                    text.push_str(&line);
                    text.push('\n');
                    let is_whole = self.evaluate(&text);
                    if let Break(status) = self.unless_exited() {
                        return Ok(status);
                    }
                    if is_whole {
                        self.typing.remember(std::mem::take(&mut text).trim_end());
                    }
                }
                Line::Dropped => text.clear(),
                Line::Signalled(signal) => {
                    self.typing.leave();
                    return Ok(SIGNALLED + signal.number());
                }
                Line::End => {
                    if !text.trim().is_empty() {
                        // The rest is not a whole form: reading it again reports what is missing.
                        self.call("%REPL-INCOMPLETE", &text);
                        return Ok(NOT_COMPILED);
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

    /// Evaluates the forms of a text and prints their values. Returns whether the last form is complete; if
    /// it is not, nothing has been evaluated.
    fn evaluate(&mut self, text: &str) -> bool {
        let Some(value) = self.call("%REPL-EVALUATE", text) else { return true };
        let datum = self.machine.export(value).ok();
        !matches!(datum.as_ref().map(Datum::kind), Some(DatumKind::Symbol(symbol)) if symbol.name() == "MORE")
    }

    /// Breaks with the exit status that the program has asked to end with.
    fn unless_exited(&self) -> ControlFlow<u8> {
        self.machine.exit_status().map_or(Continue(()), Break)
    }

    /// Obeys a command of the REPL; breaks with the exit status at the end of the session.
    fn command(&mut self, line: &str) -> ControlFlow<u8> {
        let (command, argument) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match command {
            ":quit" | ":exit" => {
                self.machine.flush();
                return Break(SUCCESS);
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
        self.unless_exited()
    }

    /// Runs the machine until `task` has ended, or can never do so.
    fn run(&mut self, task: TaskId) -> RunOutcome {
        loop {
            // A requested line does not end an evaluation; it may have come just now.
            match self.machine.run_until(Some(task), u64::MAX) {
                RunOutcome::Stopped => {}
                outcome => return outcome,
            }
        }
    }

    /// Calls a function of the library with a text, in a task that Ctrl-C aborts. Returns nothing if it did
    /// not return.
    fn call(&mut self, function: &str, text: &str) -> Option<Value> {
        let text = self.machine.import(&Datum::string(text, Default::default())).ok()?;
        let task = match self.machine.spawn_library(function, &[text]) {
            Ok(task) => task,
            Err(error) => {
                complain(error);
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
        self.interrupts.forget();
        let result = self.machine.result(task);
        let report = self.machine.detailed_report(task);
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
            // The output of the task may have ended within a line.
            _ if self.machine.exit_status().is_none() => _ = self.call("%REPL-ABORTED", ""),
            _ => {}
        }
        // A standard output that cannot be written is noticed when the next value is printed.
        _ = std::io::stdout().flush();
        None
    }
}

/// Returns the part of a failure's report that is shown at once: what went wrong, unless the last lines say
/// so already, and the last lines. `:bt` shows the rest, the frames.
fn in_short(report: &str) -> String {
    let lines: Vec<&str> = report.lines().collect();
    let ending = lines.len().saturating_sub(2);
    let (text, ending) = lines.split_at(ending);
    let text = text.iter().take_while(|line| !line.starts_with("  in ") && !line.starts_with("  while "));
    let is_plain = lines.first().is_some_and(|line| line.starts_with("A failure of cause "));
    let shown = text.filter(|_| !is_plain).chain(ending);
    shown.flat_map(|line| [line, "\n"]).collect()
}

/// Returns whether a line is a command of the REPL, not a keyword to be evaluated.
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
