//! The REPL of a run that is under way elsewhere: lines are typed here, and evaluated there.

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};

use esl_vm::host::{Inbox, Incoming, Rights};

use super::lines::Line;
use super::screen::PromptScreen;
use super::typing::Typing;
use super::wire::{AttachSecurity, Wire};
use super::{CONTINUATION, PROMPT, in_short};
use crate::command::{FAILED, NOT_COMPILED, SIGNALLED, SUCCESS, USAGE, complain, interrupt_on_signal};
use crate::operate::attach::{self, WireForm};

/// Environment variable with the secret, unless a file is named.
const SECRET: &str = "ESL_SECRET";
/// Name of the role that may evaluate.
const PATCH: &str = "patch";

const HELP: &str = "\
:tasks              the tasks of the run, as a tree, with their numbers
:bt [N]             the backtrace of the last failure here, or what task N does and where
:failures           the latest failures of the run, if the run notes them
:facts [NAME [N]]   facts of the database, 500 at a time, after the first N
:data               relations, locks of properties, and inputs
:watch FORM         writes the value of a form, and again after each change of what it reads
:abort N            aborts task N
:suspend N          suspends task N and the tasks that it has made
:resume N           resumes task N and the tasks that it has made
:pause, :continue   stops all tasks, and lets them go on
:signal NAME DATA…  signals an input, or the event that a variable holds
:patch FILE         makes the definitions of a file in one step, or none of them
:undo-patch         undoes the newest patch
:quit               ends this session; the run goes on
";

/// Returns whether a line is a command, not a keyword to be evaluated.
fn is_command(line: &str) -> bool {
    let word = line.split_whitespace().next().unwrap_or("");
    let is_listed = |entry: &str| entry.split([' ', ',']).any(|listed| listed == word);
    word.starts_with(':')
        && (matches!(word, ":help" | ":exit")
            || HELP.lines().any(|line| is_listed(&line[..20.min(line.len())])))
}

/// Reason why a session could not be begun.
#[derive(Debug)]
enum AttachError {
    /// No run can be reached at this address.
    Unreachable(String, io::Error),
    /// Nobody has said the secret.
    NoSecret,
    /// The file with the secret cannot be read.
    SecretFile(PathBuf, io::Error),
    /// No thread can be made to read standard input.
    NoReader(io::Error),
    /// No thread can be made to hear the run.
    NoHearer(io::Error),
    /// The connection cannot be shared, or no thread can be made to interrupt the run.
    Connection(io::Error),
}

impl fmt::Display for AttachError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AttachError::Unreachable(address, error) => {
                write!(f, "no run can be reached at {address}: {error}")
            }
            AttachError::NoSecret => {
                write!(f, "a port asks for a secret: use --secret-file, or the environment variable {SECRET}")
            }
            AttachError::SecretFile(file, error) => write!(f, "{}: {error}", file.display()),
            AttachError::NoReader(error) => {
                write!(f, "no thread can be made to read standard input: {error}")
            }
            AttachError::NoHearer(error) => write!(f, "no thread can be made to hear the run: {error}"),
            AttachError::Connection(error) => error.fmt(f),
        }
    }
}

/// Reason why a request came to nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
enum RequestRefusal {
    /// The run says so, in these words.
    ByRun(String),
    /// The run has answered something that is no answer.
    NotAnAnswer,
    /// The command needs something.
    Needs(String, &'static str),
    /// The file cannot be read, for the reason that the system gives.
    Unreadable(String, String),
    /// There is no patch to be undone.
    NoPatch,
}

impl fmt::Display for RequestRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RequestRefusal::ByRun(text) => f.write_str(text),
            RequestRefusal::NotAnAnswer => f.write_str("it is no answer"),
            RequestRefusal::Needs(command, needed) => write!(f, "`{command}` needs {needed}"),
            RequestRefusal::Unreadable(file, reason) => write!(f, "{file} cannot be read: {reason}"),
            RequestRefusal::NoPatch => f.write_str("there is no patch to be undone"),
        }
    }
}

/// What a request comes to.
type RunAnswer = Result<WireForm, RequestRefusal>;

/// Where what the run says is printed.
#[derive(Clone)]
struct SessionPrinter {
    screen: PromptScreen,
    is_interactive: bool,
}

impl SessionPrinter {
    fn print(&self, text: &str) {
        // Who does not read it misses it.
        _ = if self.is_interactive {
            self.screen.print(text.as_bytes())
        } else {
            let mut out = std::io::stdout().lock();
            out.write_all(text.as_bytes()).and_then(|()| out.flush())
        };
    }
}

/// Reads the secret: that of the file, or of the environment.
fn secret(file: Option<&Path>) -> Result<String, AttachError> {
    match file {
        None => std::env::var(SECRET).map_err(|_| AttachError::NoSecret),
        Some(file) => {
            let unread = |error| AttachError::SecretFile(file.into(), error);
            let text = std::fs::read_to_string(file).map_err(unread)?;
            let line = text.lines().next().unwrap_or_default().trim();
            Ok(line.rsplit(char::is_whitespace).next().unwrap_or_default().to_string())
        }
    }
}

/// Attaches to the run at an address, a path or a port, until the end of the input, of the run, or `:quit`.
/// What is evaluated has these rights, as far as the run has them. Returns the exit status.
///
/// # Errors
/// The exit status, after a message, if there is no such run, or standard input cannot be read.
pub fn attach(
    address: &str,
    security: AttachSecurity<'_>,
    secret_file: Option<&Path>,
    rights: &Rights,
) -> Result<u8, u8> {
    let usage = |error: AttachError| {
        complain(error);
        USAGE
    };
    let mut wire = Wire::connect(address, security)
        .map_err(|error| usage(AttachError::Unreachable(address.into(), error)))?;
    if wire.needs_secret() {
        let secret = secret(secret_file).map_err(usage)?;
        // A run that refuses it closes the connection, which the reader sees.
        _ = attach::write(&mut wire, &WireForm::Text(secret));
    }
    let is_interactive = std::io::stdin().is_terminal();
    let screen = PromptScreen::default();
    let printer = SessionPrinter { screen: screen.clone(), is_interactive };
    let inbox = Inbox::new();
    let typing = Typing::begin(is_interactive, screen, inbox.clone())
        .map_err(|error| usage(AttachError::NoReader(error)))?;
    let lines = typing.other_lines();
    let (answer, answers) = channel();
    let from = wire.try_clone().map_err(|error| usage(AttachError::Connection(error)))?;
    let hears = printer.clone();
    let heard = std::thread::Builder::new().name("run".into()).spawn(move || {
        hear(from, &hears, &answer);
        drop(answer);
        drop(lines.send(Line::End));
    });
    heard.map_err(|error| usage(AttachError::NoHearer(error)))?;
    interrupt_run(&wire, &typing, inbox).map_err(|error| usage(AttachError::Connection(error)))?;
    let mut attached = Attached { wire, answers, typing, printer, asked: 0, failure: None };
    let status = attached.begin(address, rights).and_then(|()| attached.talk());
    attached.wire.close();
    status
}

/// Has Ctrl-C interrupt what the session evaluates.
fn interrupt_run(wire: &Wire, typing: &Typing, inbox: Inbox) -> io::Result<()> {
    let mut wire = wire.try_clone()?;
    let lines = typing.other_lines();
    let signals = Inbox::new();
    let interrupts = interrupt_on_signal(signals.clone(), move |signal| {
        // When nobody listens, the session is at its end.
        drop(lines.send(Line::Signalled(signal)));
    });
    let pass_on = move || {
        while signals.wait(None) {
            for incoming in signals.take() {
                if matches!(incoming, Incoming::Signal(_)) {
                    interrupts.forget();
                    let interrupt = [WireForm::symbol(":emacs-interrupt"), WireForm::symbol("t")];
                    _ = attach::write(&mut wire, &WireForm::list(interrupt));
                }
            }
            // Lines that come ring the other one.
            inbox.take();
        }
    };
    let started = std::thread::Builder::new().name("interrupts".into()).spawn(pass_on);
    started.map(drop)
}

/// Prints what the run writes, and passes answers on, until the connection ends.
fn hear(mut from: Wire, printer: &SessionPrinter, answers: &Sender<(i64, RunAnswer)>) {
    while let Ok(form) = attach::read(&mut from) {
        let items = form.items().unwrap_or_default();
        match (items.first().and_then(WireForm::name).as_deref(), items) {
            (Some(":write-string"), [_, WireForm::Text(text), ..]) => printer.print(text),
            (Some(":return"), [_, result, WireForm::Integer(number)]) => {
                let result = match result.items() {
                    Some([kind, value]) if kind.name().as_deref() == Some(":ok") => Ok(value.clone()),
                    Some([_, WireForm::Text(reason)]) => Err(RequestRefusal::ByRun(reason.clone())),
                    _ => Err(RequestRefusal::NotAnAnswer),
                };
                if answers.send((*number, result)).is_err() {
                    return;
                }
            }
            _ => {}
        }
    }
}

/// A session.
struct Attached {
    wire: Wire,
    answers: Receiver<(i64, RunAnswer)>,
    typing: Typing,
    printer: SessionPrinter,
    /// Number of requests so far.
    asked: i64,
    /// Report of the last failure.
    failure: Option<String>,
}

/// What ended a session.
struct Disconnected;

impl Attached {
    /// Asks something, without waiting for the answer.
    fn send(&mut self, name: &str, arguments: &[WireForm]) -> Result<i64, Disconnected> {
        self.asked += 1;
        let form = WireForm::list([WireForm::symbol(name)].into_iter().chain(arguments.iter().cloned()));
        let request = WireForm::list([
            WireForm::symbol(":emacs-rex"),
            form,
            WireForm::nil(),
            WireForm::symbol("t"),
            WireForm::Integer(self.asked),
        ]);
        attach::write(&mut self.wire, &request).map_err(|_| Disconnected)?;
        Ok(self.asked)
    }

    /// Asks something, and waits for the answer.
    fn ask(&mut self, name: &str, arguments: &[WireForm]) -> Result<RunAnswer, Disconnected> {
        let asked = self.send(name, arguments)?;
        loop {
            let (number, answer) = self.answers.recv().map_err(|_| Disconnected)?;
            if number == asked {
                return Ok(answer);
            }
            if let Err(reason) = answer {
                self.printer.print(&format!("; {reason}\n"));
            }
        }
    }

    /// Greets the run, and tells it the rights of what is evaluated here, if anything may be.
    fn begin(&mut self, address: &str, rights: &Rights) -> Result<(), u8> {
        let role = match self.ask("swank:connection-info", &[]) {
            Ok(Ok(info)) => info.items().and_then(|items| items.last()?.as_text().map(str::to_string)),
            Ok(Err(reason)) => {
                complain(reason);
                return Err(USAGE);
            }
            Err(Disconnected) => {
                let or = if matches!(self.wire, Wire::Tcp(_)) { ", or it speaks TLS: use --tls" } else { "" };
                complain(format_args!("the run at {address} refuses: the secret is not one of its own{or}"));
                return Err(USAGE);
            }
        };
        if role.as_deref() == Some(PATCH) {
            let parts = rights.parts().flat_map(|(right, object)| [right.name(), object.unwrap_or_default()]);
            let parts: Vec<WireForm> = parts.map(WireForm::text).collect();
            let refused = match self.ask("esl:rights", &parts) {
                Ok(Ok(value)) if value.name().as_deref() == Some("t") => None,
                Ok(Ok(value)) => Some(value.to_string()),
                Ok(Err(reason)) => Some(reason.to_string()),
                Err(Disconnected) => Some("the run has ended".into()),
            };
            if let Some(reason) = refused {
                complain(format_args!(
                    "the run at {address} does not narrow the rights of a session: {reason}"
                ));
                return Err(USAGE);
            }
        }
        if self.typing.is_interactive {
            let role = role.unwrap_or_default();
            self.printer.print(&format!("; attached to {address} as {role}; :help lists the commands\n"));
        }
        Ok(())
    }

    /// Takes lines until the session ends. Returns the exit status.
    fn talk(&mut self) -> Result<u8, u8> {
        let mut text = String::new();
        loop {
            self.typing.ask(if text.is_empty() { PROMPT } else { CONTINUATION });
            let done = match self.typing.wait() {
                Line::Text(line) if text.is_empty() && is_command(&line) => {
                    let line = line.trim();
                    if matches!(line, ":quit" | ":exit") {
                        return Ok(SUCCESS);
                    }
                    self.typing.remember(line);
                    self.command(line)
                }
                Line::Text(line) => {
                    text.push_str(&line);
                    text.push('\n');
                    self.evaluate(&mut text)
                }
                Line::Dropped => {
                    text.clear();
                    Ok(())
                }
                Line::Signalled(signal) => {
                    self.typing.leave();
                    return Ok(SIGNALLED + signal.number());
                }
                Line::End if text.trim().is_empty() => return Ok(self.end()),
                Line::End => {
                    complain("the last form is incomplete");
                    return Ok(NOT_COMPILED);
                }
                Line::Failed(reason) => {
                    complain(format_args!("standard input cannot be read: {reason}"));
                    return Err(USAGE);
                }
            };
            if let Err(Disconnected) = done {
                self.typing.leave();
                complain("the run has ended");
                return Ok(FAILED);
            }
        }
    }

    /// Returns the exit status at the end of the lines, or of the run.
    fn end(&mut self) -> u8 {
        match self.send("swank:connection-info", &[]) {
            Ok(_) => SUCCESS,
            Err(Disconnected) => {
                self.typing.leave();
                complain("the run has ended");
                FAILED
            }
        }
    }

    /// Evaluates the forms of a text, unless they are incomplete.
    fn evaluate(&mut self, text: &mut String) -> Result<(), Disconnected> {
        if text.trim().is_empty() {
            text.clear();
            return Ok(());
        }
        let answer = self.ask("esl:evaluate", &[WireForm::text(text.as_str())])?;
        if matches!(&answer, Ok(value) if value.name().as_deref() == Some(":more")) {
            return Ok(());
        }
        self.typing.remember(text.trim_end());
        text.clear();
        self.show(answer);
        Ok(())
    }

    /// Prints what came of a request, but for values that say nothing.
    fn show(&mut self, answer: RunAnswer) {
        match answer {
            Err(reason) => self.printer.print(&format!("; {reason}\n")),
            Ok(WireForm::Text(text)) => self.printer.print(&text),
            Ok(WireForm::List(items)) => {
                if let [kind, WireForm::Text(report)] = &items[..]
                    && kind.name().as_deref() == Some(":failed")
                {
                    self.printer.print(&in_short(report));
                    self.failure = Some(report.clone());
                }
            }
            Ok(_) => {}
        }
    }

    /// Obeys a command.
    fn command(&mut self, line: &str) -> Result<(), Disconnected> {
        let (command, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let number = rest.parse().map(WireForm::Integer).unwrap_or(WireForm::nil());
        let needed = match command {
            ":abort" | ":suspend" | ":resume" => Some("the number of a task, which `:tasks` shows"),
            ":bt" if !rest.is_empty() => Some("the number of a task, which `:tasks` shows, or nothing"),
            _ => None,
        };
        if let (Some(needed), false) = (needed, matches!(number, WireForm::Integer(_))) {
            self.show(Err(RequestRefusal::Needs(command.into(), needed)));
            return Ok(());
        }
        let needs = |needed| Err(RequestRefusal::Needs(command.into(), needed));
        let answer = match command {
            ":tasks" => self.ask("esl:tasks", &[])?,
            ":bt" if rest.is_empty() => {
                let report = self.failure.clone();
                Ok(WireForm::Text(report.unwrap_or_else(|| "Nothing has failed here.\n".into())))
            }
            ":bt" => self.ask("esl:backtrace", &[number])?,
            ":failures" => self.ask("esl:failures", &[])?,
            ":facts" => {
                let (name, from) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
                let from = from.trim().parse().map(WireForm::Integer).unwrap_or(WireForm::nil());
                self.ask("esl:facts", &[WireForm::text(name), from])?
            }
            ":data" => self.ask("esl:data", &[])?,
            ":watch" if !rest.is_empty() => {
                self.send("esl:watch", &[WireForm::text(rest)])?;
                return Ok(());
            }
            ":abort" => self.ask("esl:abort", &[number])?,
            ":suspend" => self.ask("esl:suspend", &[number])?,
            ":resume" => self.ask("esl:resume", &[number])?,
            ":pause" => self.ask("esl:pause", &[])?,
            ":continue" => self.ask("esl:continue", &[])?,
            ":signal" if !rest.is_empty() => {
                let (name, data) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
                self.ask("esl:signal", &[WireForm::text(name), WireForm::text(data)])?
            }
            ":patch" if !rest.is_empty() => match std::fs::read_to_string(rest) {
                Err(error) => Err(RequestRefusal::Unreadable(rest.into(), error.to_string())),
                Ok(text) => {
                    let answer = self.ask("esl:patch", &[WireForm::text(rest), WireForm::Text(text)])?;
                    match answer {
                        Ok(WireForm::Integer(count)) => {
                            Ok(WireForm::Text(format!("; {count} definitions are changed\n")))
                        }
                        answer => answer,
                    }
                }
            },
            ":undo-patch" => match self.ask("esl:undo-patch", &[])? {
                Ok(WireForm::Integer(count)) => {
                    Ok(WireForm::Text(format!("; {count} definitions are as before\n")))
                }
                Ok(WireForm::List(items)) if items.is_empty() => Err(RequestRefusal::NoPatch),
                answer => answer,
            },
            ":watch" => needs("a form"),
            ":signal" => needs("the name of an input, or of a variable with an event"),
            ":patch" => needs("the path of a file"),
            _ => Ok(WireForm::text(HELP)),
        };
        self.show(answer);
        Ok(())
    }
}
