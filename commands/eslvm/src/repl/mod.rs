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
//! let status = eslvm::repl::run(Config::default(), Rights::none(), false, &ModulePath::none());
//! assert_eq!(status, Ok(0));
//! ```

mod attached;
pub(crate) mod commands;
pub(crate) mod editor;
mod foreign;
mod held;
pub(crate) mod lines;
mod refusal;
pub(crate) mod screen;
mod terminal;
mod typing;
mod wire;

use std::io::{IsTerminal, Write};
use std::ops::ControlFlow::{self, Break, Continue};

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{Incoming, Output, RealHost, Rights, SurveyRequest};
use esl_vm::run::RunOutcome;
use esl_vm::task::{TaskId, TaskResult};
use esl_vm::value::Value;
use esl_vm::vm::{Config, Vm};

use crate::signal::{Interrupts, interrupt_on_signal};
pub use attached::attach;
use commands::{LineMeaning, SessionCommand, completions_of, help, meaning_of};
use esl::module_path::ModulePath;
use esl::program;
use esl_command::{NOT_COMPILED, SIGNALLED, SUCCESS, USAGE, complain, say, say_part};
use foreign::foreign;
use held::HeldFailures;
use lines::{CompletionRequest, Line, WordCompletion};
use screen::PromptScreen;
use typing::Typing;
pub use wire::AttachSecurity;

/// Prompt for a form.
const PROMPT: &str = "? ";
/// Prompts while so many forms wait for the choice of a restart.
const HELD_PROMPTS: [&str; 10] = [PROMPT, "1? ", "2? ", "3? ", "4? ", "5? ", "6? ", "7? ", "8? ", "9? "];
/// Prompt for further lines of a form.
const CONTINUATION: &str = "  ";

/// The commands.
const COMMANDS: &[SessionCommand] = &[
    SessionCommand { names: &[":load"], arguments: "FILE", does: "evaluates the forms of a file" },
    SessionCommand {
        names: &[":bt"],
        arguments: "[full]",
        does: "shows the newest failure, and its frames with their variables, or also those of the library",
    },
    SessionCommand {
        names: &[":restart"],
        arguments: "[N [ARGUMENT…]]",
        does: "goes on with the newest form that has failed by a restart, by its number or name; lists them",
    },
    SessionCommand {
        names: &[":tasks"],
        arguments: "",
        does: "shows the tasks, their makers and their waits",
    },
    SessionCommand { names: &[":abort"], arguments: "N", does: "aborts the task with the number N" },
    SessionCommand {
        names: &[":help"],
        arguments: "",
        does: "shows this list; (help 'name) describes a name",
    },
    SessionCommand { names: &[":quit", ":exit"], arguments: "", does: "ends the session, as Ctrl-D does" },
];

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
        complain(format_args!("cannot start the thread that reads standard input: {error}"));
        USAGE
    })?;
    let lines = typing.other_lines();
    let end = move |signal| {
        // Without a receiver the session has ended.
        drop(lines.send(Line::Signalled(signal)));
    };
    let interrupts = interrupt_on_signal(machine.inbox(), end);
    machine.tell_variables();
    machine.keep_journal();
    if is_interactive {
        say!("ESL {}; :help lists the commands, TAB completes, Ctrl-D ends", env!("CARGO_PKG_VERSION"));
    }
    let held_failures = HeldFailures::install(&mut machine);
    let (failure, held) = (None, Vec::new());
    let mut repl = Repl { machine, typing, interrupts, virtual_time, failure, held_failures, held };
    repl.call("%REPL-BEGIN", "");
    let status = repl.talk();
    program::end_rest(&mut repl.machine);
    status
}

/// Ticks that background tasks run between two checks of their output.
const BACKGROUND_TICKS: u64 = 100_000;

/// A session: the machine, and the lines that are typed.
struct Repl {
    machine: Vm,
    typing: Typing,
    interrupts: Interrupts,
    /// Whether time passes only while a form is evaluated.
    virtual_time: bool,
    /// The last failure of a form.
    failure: Option<FormFailure>,
    /// The failures at which forms wait for the choice of a restart.
    held_failures: HeldFailures,
    /// The tasks of forms that do, the newest last.
    held: Vec<TaskId>,
}

/// A failure of a form.
struct FormFailure {
    report: String,
    /// The report with all calls of the library.
    full: Option<String>,
    /// Number that the journal had given by then.
    noted: u64,
}

/// The outcome of evaluating a text.
enum Evaluated {
    /// The last form is incomplete, and nothing was evaluated.
    More,
    /// It is over.
    Done,
    /// The text asks for the end of the session.
    Quit,
    /// The text asks for the list of commands.
    Help,
}

impl Repl {
    /// Runs background tasks until the next line has come.
    fn next_line(&mut self, prompt: &'static str) -> Line {
        self.typing.ask(prompt);
        loop {
            match self.typing.take() {
                Some(Line::Completing(request)) => {
                    self.complete(&request);
                    continue;
                }
                Some(line) => return line,
                None => {}
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
                    match self.typing.wait() {
                        Line::Completing(request) => self.complete(&request),
                        line => return line,
                    }
                }
            }
        }
    }

    /// Says how a word can be completed.
    fn complete(&mut self, request: &CompletionRequest) {
        let found = if request.is_command {
            completions_of(&request.word, COMMANDS)
        } else {
            let found = self.call("%REPL-COMPLETE", &request.word);
            let found = found.and_then(|value| self.machine.export(value).ok());
            found.map_or(Vec::new(), |found| {
                found.as_list().unwrap_or_default().into_iter().filter_map(completion_of).collect()
            })
        };
        // The person may have gone on.
        _ = request.reply.send(found);
    }

    /// Evaluates lines until the session ends. Returns the exit status.
    fn talk(&mut self) -> Result<u8, u8> {
        let mut text = String::new();
        loop {
            self.settle_held();
            let prompt = if text.is_empty() { HELD_PROMPTS[self.held.len().min(9)] } else { CONTINUATION };
            let line = self.next_line(prompt);
            if let Break(status) = self.unless_exited() {
                // A background task has asked for the end.
                return Ok(status);
            }
            match line {
                Line::Text(line) if text.is_empty() && meaning_of(&line, COMMANDS) != LineMeaning::Form => {
                    if let Break(status) = self.command(&line) {
                        return Ok(status);
                    }
                    self.typing.remember(&line);
                }
                Line::Text(line) => {
                    text.push_str(&line);
                    text.push('\n');
                    let evaluated = self.evaluate(&text);
                    if let Break(status) = self.unless_exited() {
                        return Ok(status);
                    }
                    match evaluated {
                        Evaluated::More => continue,
                        Evaluated::Done => {}
                        Evaluated::Quit => {
                            self.machine.flush();
                            return Ok(SUCCESS);
                        }
                        Evaluated::Help => say_part!("{}", help(COMMANDS)),
                    }
                    self.typing.remember(std::mem::take(&mut text).trim_end());
                }
                // They were seen to before.
                Line::Completing(_) => {}
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

    /// Evaluates the forms of a text and prints their values.
    fn evaluate(&mut self, text: &str) -> Evaluated {
        if let Some(answer) = foreign(text) {
            say_part!("{answer}");
            return Evaluated::Done;
        }
        let Some(value) = self.call("%REPL-EVALUATE", text) else { return Evaluated::Done };
        let datum = self.machine.export(value).ok();
        match datum.as_ref().and_then(Datum::as_symbol).map(|symbol| symbol.name()) {
            Some("MORE") => Evaluated::More,
            Some("QUIT") => Evaluated::Quit,
            Some("HELP") => Evaluated::Help,
            _ => Evaluated::Done,
        }
    }

    /// Breaks with the exit status that the program has asked to end with.
    fn unless_exited(&self) -> ControlFlow<u8> {
        self.machine.exit_status().map_or(Continue(()), Break)
    }

    /// Obeys a command of the REPL; breaks with the exit status at the end of the session.
    fn command(&mut self, line: &str) -> ControlFlow<u8> {
        let (command, path) = match meaning_of(line, COMMANDS) {
            LineMeaning::Command(command, argument) => (command, argument),
            LineMeaning::NoCommand(reason) => {
                say!("; {reason}");
                return Continue(());
            }
            LineMeaning::Form => return Continue(()),
        };
        match command {
            ":quit" => {
                self.machine.flush();
                return Break(SUCCESS);
            }
            ":load" if path.is_empty() => say!("; `:load` needs the path of a file"),
            ":load" => {
                let bare = path.strip_prefix('"').and_then(|path| path.strip_suffix('"'));
                self.call("%REPL-LOAD", bare.unwrap_or(path));
            }
            ":bt" => match self.newest_failure() {
                Some((_, Some(full))) if path.trim() == "full" => say_part!("{full}"),
                Some((report, _)) => say_part!("{report}"),
                None => say!("Nothing has failed."),
            },
            ":restart" => self.restart(path),
            ":tasks" => say_part!("{}", self.machine.task_report()),
            ":abort" => self.abort(path),
            _ => say_part!("{}", help(COMMANDS)),
        }
        self.unless_exited()
    }

    /// Aborts a task in the background.
    fn abort(&mut self, number: &str) {
        let named = number.parse().unwrap_or(0);
        let request = SurveyRequest { named: vec![named], ..SurveyRequest::default() };
        match self.machine.survey(&request).tasks.first() {
            Some(task) => {
                say!("; {} is aborted", task.name);
                self.machine.inbox().put(Incoming::Abort(named));
            }
            None if number.is_empty() => {
                say!("; `:abort` needs the number of a task, which `:tasks` shows");
            }
            None => say!("; task {number} does not exist; `:tasks` shows their numbers"),
        }
    }

    /// Returns the report of the newest failure that was not recovered from, of a form or of another task,
    /// and that with all calls of the library if it was kept.
    fn newest_failure(&self) -> Option<(String, Option<String>)> {
        let request = SurveyRequest { failures_after: Some(0), ..SurveyRequest::default() };
        let failures = self.machine.survey(&request).failures;
        let newest = failures.into_iter().rev().find(|row| row.report.is_some());
        match (&self.failure, newest) {
            (Some(form), row) if row.as_ref().is_none_or(|row| row.number <= form.noted) => {
                Some((form.report.clone(), form.full.clone()))
            }
            (_, row) => row.and_then(|row| Some((row.report?, row.full_report))),
        }
    }

    /// Returns the number of the newest failure that the journal has.
    fn noted_failures(&self) -> u64 {
        let request = SurveyRequest { failures_after: Some(0), ..SurveyRequest::default() };
        self.machine.survey(&request).failures.last().map_or(0, |row| row.number)
    }

    /// Runs the machine until `task` has ended, can never do so, or is held.
    fn run(&mut self, task: TaskId) -> RunOutcome {
        loop {
            match self.machine.run_until(Some(task), u64::MAX) {
                // A requested line does not end an evaluation; it may have come just now.
                RunOutcome::Stopped if !self.hold(task) => {}
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
        self.attend(task)
    }

    /// Runs a task that Ctrl-C aborts until it has ended or is held, and says what became of it. Returns its
    /// first value.
    fn attend(&mut self, task: TaskId) -> Option<Value> {
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
        if matches!(result, TaskResult::Running) {
            // It waits for the choice of a restart.
            _ = std::io::stdout().flush();
            return None;
        }
        let report = self.machine.detailed_report(task);
        let full = self.machine.full_report(task);
        self.machine.forget(task);
        self.machine.flush();
        match result {
            TaskResult::Succeeded(values) => return values.first().copied(),
            TaskResult::Failed(_) => match report {
                Some(report) => {
                    say_part!("{}", in_short(&report));
                    self.failure = Some(FormFailure { report, full, noted: self.noted_failures() });
                }
                None => say!("Aborted"),
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

/// Returns the completion that a list of a name and a text stands for.
fn completion_of(row: &Datum) -> Option<WordCompletion> {
    let text = |datum: &Datum| match datum.kind() {
        DatumKind::String(text) => Some(text.to_string()),
        _ => None,
    };
    match row.as_list()?[..] {
        [name, about] => Some(WordCompletion { text: text(name)?, about: text(about)? }),
        _ => None,
    }
}
