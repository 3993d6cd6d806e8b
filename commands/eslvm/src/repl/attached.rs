//! The REPL of a run that is under way elsewhere: lines are typed here, and evaluated there.

use std::io::{self, IsTerminal};
use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use esl_command::{FAILED, NOT_COMPILED, SIGNALLED, SUCCESS, USAGE, complain};
use esl_host::{Inbox, Incoming, Rights};
use esl_operate::attach::{self, WireForm};

use super::commands::{LineMeaning, SessionCommand, completions_of, help, meaning_of};
use super::foreign::foreign;
use super::lines::{CompletionRequest, Line, WordCompletion};
use super::refusal::{AttachError, RequestRefusal};
use super::screen::{PromptScreen, SessionPrinter};
use super::typing::Typing;
use super::wire::{AttachSecurity, Wire};
use super::{CONTINUATION, PROMPT, in_short};
use crate::signal::interrupt_on_signal;

/// Environment variable with the secret, unless a file is named.
pub(super) const SECRET: &str = "ESL_SECRET";
/// Name of the role that may evaluate.
const PATCH: &str = "patch";

/// Time that the reason has to be heard for which the connection has ended.
const HEARING: Duration = Duration::from_secs(1);

/// The commands.
const COMMANDS: &[SessionCommand] = &[
    row(&[":tasks"], "", "the tasks of the run, as a tree, with their numbers"),
    row(
        &[":bt"],
        "[full | N]",
        "the backtrace of the newest failure, with all calls of the library, or the frames of task N",
    ),
    row(&[":failures"], "", "the latest failures of the run"),
    row(&[":facts"], "[NAME [N]]", "facts of the database, 500 at a time, after the first N"),
    row(&[":data"], "", "relations, locks of properties, and inputs"),
    row(
        &[":watch"],
        "FORM",
        "writes the value of a form, and again after each change of a source that it reads",
    ),
    row(&[":abort"], "N", "aborts task N"),
    row(&[":suspend"], "N", "suspends task N and the tasks that it has made"),
    row(&[":resume"], "N", "resumes task N and the tasks that it has made"),
    row(&[":pause"], "", "stops all tasks"),
    row(&[":continue"], "", "lets all tasks go on"),
    row(&[":signal"], "NAME DATA…", "signals an input, or the event that a variable holds"),
    row(&[":patch"], "FILE", "makes the definitions of a file in one step, or none of them"),
    row(&[":undo-patch"], "", "undoes the newest patch"),
    row(&[":help"], "", "this list; (help 'name) describes a name"),
    row(&[":quit", ":exit"], "", "ends this session, as Ctrl-D does; the run goes on"),
];

const fn row(names: &'static [&'static str], arguments: &'static str, does: &'static str) -> SessionCommand {
    SessionCommand { names, arguments, does }
}

/// The outcome of a request.
type RunAnswer = Result<WireForm, RequestRefusal>;

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
/// Evaluated forms have these rights, as far as the run has them. Returns the exit status.
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
    let end = EndOfSession::default();
    let told = end.clone();
    let heard = std::thread::Builder::new().name("run".into()).spawn(move || {
        hear(from, &hears, &answer, &told);
        drop(answer);
        drop(lines.send(Line::End));
    });
    heard.map_err(|error| usage(AttachError::NoHearer(error)))?;
    interrupt_run(&wire, &typing, inbox).map_err(|error| usage(AttachError::Connection(error)))?;
    let mut attached = Attached { wire, answers, typing, printer, asked: 0, failure: None, end };
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
        // Without a receiver the session has ended.
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

/// Why the connection ends, as the run says it.
#[derive(Clone, Default)]
struct EndOfSession(Arc<Mutex<Option<String>>>);

impl EndOfSession {
    fn note(&self, reason: &str) {
        // The text is whole at every moment.
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(reason.into());
    }

    fn reason(&self) -> Option<String> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Prints what the run writes, and passes answers on, until the connection ends.
fn hear(mut from: Wire, printer: &SessionPrinter, answers: &Sender<(i64, RunAnswer)>, end: &EndOfSession) {
    while let Ok(form) = attach::read(&mut from) {
        let items = form.items().unwrap_or_default();
        match (items.first().and_then(WireForm::name).as_deref(), items) {
            (Some(":write-string"), [_, WireForm::Text(text), ..]) => printer.print(text),
            (Some(":refused" | ":run-ended"), [_, WireForm::Text(reason)]) => end.note(reason),
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
    /// Report of the last failure, and that with all calls of the library.
    failure: Option<(String, String)>,
    /// Why the connection ends.
    end: EndOfSession,
}

/// The end of the connection of a session.
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
        let role = match self.ask("swank:connection-info", &[WireForm::text(attach::CLIENT)]) {
            Ok(Ok(info)) => info.items().and_then(|items| items.last()?.as_text().map(str::to_string)),
            Ok(Err(reason)) => {
                complain(reason);
                return Err(USAGE);
            }
            Err(Disconnected) if self.end.reason().is_some() => {
                complain(format_args!(
                    "the run at {address} refuses: {}",
                    self.end.reason().unwrap_or_default()
                ));
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
            let line = loop {
                match self.typing.wait() {
                    Line::Completing(request) if self.complete(&request).is_ok() => {}
                    // The reader says that the connection has ended, too.
                    Line::Completing(_) => {}
                    line => break line,
                }
            };
            let done = match line {
                Line::Text(line) if text.is_empty() && meaning_of(&line, COMMANDS) != LineMeaning::Form => {
                    self.typing.remember(line.trim());
                    match meaning_of(&line, COMMANDS) {
                        LineMeaning::Command(":quit", _) => return Ok(SUCCESS),
                        LineMeaning::Command(command, rest) => self.command(command, rest),
                        LineMeaning::NoCommand(reason) => {
                            self.show(Err(RequestRefusal::NoCommand(reason)));
                            Ok(())
                        }
                        LineMeaning::Form => Ok(()),
                    }
                }
                Line::Text(line) => {
                    text.push_str(&line);
                    text.push('\n');
                    match self.evaluate(&mut text) {
                        Ok(true) => return Ok(SUCCESS),
                        Ok(false) => Ok(()),
                        Err(Disconnected) => Err(Disconnected),
                    }
                }
                Line::Completing(_) => Ok(()),
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
                return Ok(self.ended());
            }
        }
    }

    /// Returns the exit status at the end of the lines, or of the run.
    fn end(&mut self) -> u8 {
        if self.end.reason().is_some() {
            return self.ended();
        }
        match self.send("swank:connection-info", &[]) {
            Ok(_) => SUCCESS,
            Err(Disconnected) => self.ended(),
        }
    }

    /// Says that the run has ended, and returns the exit status.
    fn ended(&self) -> u8 {
        // A request that cannot be written any more is noticed before what was written last is heard.
        while self.answers.recv_timeout(HEARING).is_ok() {}
        self.typing.leave();
        complain(self.end.reason().unwrap_or_else(|| "the run has ended".into()));
        FAILED
    }

    /// Evaluates the forms of a text, unless they are incomplete. Returns whether they ask for the end of the
    /// session.
    fn evaluate(&mut self, text: &mut String) -> Result<bool, Disconnected> {
        if text.trim().is_empty() {
            text.clear();
            return Ok(false);
        }
        if let Some(answer) = foreign(text) {
            self.printer.print(&answer);
            self.typing.remember(text.trim_end());
            text.clear();
            return Ok(false);
        }
        let answer = self.ask("esl:evaluate", &[WireForm::text(text.as_str())])?;
        let word = answer.as_ref().ok().and_then(WireForm::name);
        if word.as_deref() == Some(":more") {
            return Ok(false);
        }
        self.typing.remember(text.trim_end());
        text.clear();
        match word.as_deref() {
            Some(":quit") => return Ok(true),
            Some(":help") => self.printer.print(&help(COMMANDS)),
            _ => self.show(answer),
        }
        Ok(false)
    }

    /// Says how a word can be completed.
    fn complete(&mut self, request: &CompletionRequest) -> Result<(), Disconnected> {
        let found = if request.is_command {
            completions_of(&request.word, COMMANDS)
        } else {
            let answer = self.ask("esl:complete", &[WireForm::text(request.word.as_str())])?;
            let rows = answer.as_ref().ok().and_then(WireForm::items).unwrap_or_default();
            let completion = |row: &WireForm| match row.items()? {
                [WireForm::Text(text), WireForm::Text(about)] => {
                    Some(WordCompletion { text: text.clone(), about: about.clone() })
                }
                _ => None,
            };
            rows.iter().filter_map(completion).collect()
        };
        // The person may have gone on.
        _ = request.reply.send(found);
        Ok(())
    }

    /// Prints what came of a request, but for values that say nothing.
    fn show(&mut self, answer: RunAnswer) {
        match answer {
            Err(reason) => self.printer.print(&format!("; {reason}\n")),
            Ok(WireForm::Text(text)) => self.printer.print(&text),
            Ok(WireForm::List(items)) => {
                if let [kind, WireForm::Text(report), full @ ..] = &items[..]
                    && kind.name().as_deref() == Some(":failed")
                {
                    self.printer.print(&in_short(report));
                    let full = full.first().and_then(WireForm::as_text);
                    self.failure = Some((report.clone(), full.unwrap_or(report).into()));
                }
            }
            Ok(_) => {}
        }
    }

    /// Obeys a command.
    fn command(&mut self, command: &str, rest: &str) -> Result<(), Disconnected> {
        let number = rest.parse().map(WireForm::Integer).unwrap_or(WireForm::nil());
        let needed = match command {
            ":abort" | ":suspend" | ":resume" => Some("the number of a task, which `:tasks` shows"),
            ":bt" if !matches!(rest, "" | "full") => {
                Some("the number of a task, which `:tasks` shows, or `full`, or nothing")
            }
            _ => None,
        };
        if let (Some(needed), false) = (needed, matches!(number, WireForm::Integer(_))) {
            self.show(Err(RequestRefusal::Needs(command.into(), needed)));
            return Ok(());
        }
        let needs = |needed| Err(RequestRefusal::Needs(command.into(), needed));
        let answer = match command {
            ":tasks" => self.ask("esl:tasks", &[])?,
            ":bt" if matches!(rest, "" | "full") => {
                let reports = self.failure.clone();
                let report = reports.map(|(report, full)| if rest.is_empty() { report } else { full });
                Ok(WireForm::Text(report.unwrap_or_else(|| {
                    "Nothing has failed here; `:failures` shows the failures of the run.\n".into()
                })))
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
            _ => Ok(WireForm::text(help(COMMANDS))),
        };
        self.show(answer);
        Ok(())
    }
}
