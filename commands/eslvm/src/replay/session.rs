//! The commands with which a person, or a script, moves through a replay.

use std::io::{IsTerminal, Write};
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};

use esl_command::{DIVERGED, SUCCESS, complain, say, say_part};
use esl_replay::{Breakpoint, Debugger, Recorded, Replayed, RerunError, Target};

use super::show;
use crate::repl::commands::{SessionCommand, completions_of, help, nearest};
use crate::repl::editor::Editor;
use crate::repl::lines::{Line, Lines, Pipe, WordCompletion};
use crate::repl::screen::PromptScreen;

/// The commands.
const COMMANDS: &[SessionCommand] = &[
    row(&["step", "s"], "[N]", "goes N ticks on; a tick is a call or a turn of a loop"),
    row(&["turn"], "[N]", "goes to the beginning of the next turn, or the N-th"),
    row(&["continue", "c"], "", "goes on to the next breakpoint, or the end"),
    row(&["until"], "PLACE", "goes to tick:N, turn:N, time:SECONDS, record:N, or on to the next failure"),
    row(&["back", "b"], "[N]", "goes N ticks back; `back turn N` goes back to the beginning of a turn"),
    row(&["reverse-continue", "rc"], "", "goes back to the last breakpoint, or the beginning"),
    row(&["break"], "[WHAT]", "stops at failure, failure:CAUSE, task:NAME, fact:PATTERN or function:NAME"),
    row(&["where"], "", "says where the replay stands"),
    row(&["tasks"], "", "shows the tasks and their waits"),
    row(&["bt"], "[TASK]", "shows the frames of a task, by its name or number"),
    row(&["facts"], "QUERY", "shows the answers to a query: facts (door ?name open)"),
    row(&["print", "p"], "FORM", "shows the values of a form, evaluated in a copy"),
    row(&["help"], "", "shows this list"),
    row(&["quit", "q", "exit"], "", "ends, as Ctrl-D does"),
];

const fn row(names: &'static [&'static str], arguments: &'static str, does: &'static str) -> SessionCommand {
    SessionCommand { names, arguments, does }
}

/// Name of the file with the commands of earlier sessions, in the person's home.
const HISTORY: &str = ".esl-replay-history";

/// Replays a run up to the target or the first breakpoint, and obeys the lines of standard input. Returns
/// the exit status.
///
/// # Errors [`RerunError`].
pub(super) fn run(
    recorded: Recorded,
    until: Option<Target>,
    breakpoints: Vec<Breakpoint>,
) -> Result<u8, RerunError> {
    let mut session = Session { debugger: Debugger::begin(recorded, breakpoints, show)? };
    match until {
        Some(target) => session.until(&target)?,
        None => session.go_on()?,
    }
    let is_interactive = std::io::stdin().is_terminal();
    let names = Arc::new(Mutex::new(Vec::new()));
    let mut lines: Box<dyn Lines> = if is_interactive {
        say!("`help` lists the commands, TAB completes, Ctrl-D ends");
        let known = names.clone();
        let complete = move |before: &str, word: &str| completions(before, word, &lock(&known));
        Box::new(Editor::new(&PromptScreen::default(), HISTORY, Box::new(complete)))
    } else {
        Box::new(Pipe)
    };
    loop {
        _ = std::io::stdout().flush();
        if is_interactive {
            *lock(&names) = session.debugger.names();
        }
        let line = match lines.next("(replay) ") {
            Line::Text(line) => line,
            Line::Dropped | Line::Completing(_) => continue,
            // Input that cannot be read has ended.
            Line::End | Line::Signalled(_) | Line::Failed(_) => break,
        };
        if !line.trim().is_empty() {
            lines.remember(line.trim());
        }
        if !session.obey(line.trim())? {
            break;
        }
    }
    Ok(match session.debugger.replayed() {
        Some(Replayed::Diverged(_)) => DIVERGED,
        _ => SUCCESS,
    })
}

fn lock(names: &Mutex<Vec<String>>) -> std::sync::MutexGuard<'_, Vec<String>> {
    // The names are whole at every moment.
    names.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns how a word can be completed: the first of a line by a command, another one by a name of the
/// program.
fn completions(before: &str, word: &str, names: &[String]) -> Vec<WordCompletion> {
    if before.trim().is_empty() {
        return completions_of(word, COMMANDS);
    }
    // As in `break function:NAME`.
    let (prefix, stem) =
        word.rsplit_once(':').map_or(("", word), |(_, stem)| word.split_at(word.len() - stem.len()));
    let stem = stem.to_uppercase();
    let begun = names.iter().filter(|name| name.starts_with(&stem));
    begun
        .map(|name| WordCompletion { text: prefix.to_string() + &name.to_lowercase(), about: String::new() })
        .collect()
}

struct Session {
    debugger: Debugger,
}

impl Session {
    /// Obeys a command. Returns whether there may be another one.
    fn obey(&mut self, line: &str) -> Result<bool, RerunError> {
        let (command, argument) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let argument = argument.trim();
        match command {
            "" => {}
            "step" | "s" => match number(argument) {
                Some(ticks) => {
                    self.debugger.step(ticks)?;
                    self.say_where()?;
                }
                None => expected("a number of ticks"),
            },
            "turn" => match number(argument) {
                Some(turns) => {
                    self.debugger.turn(turns)?;
                    self.say_where()?;
                }
                None => expected("a number of turns"),
            },
            "back" | "b" => self.back(argument)?,
            "continue" | "c" => self.go_on()?,
            "reverse-continue" | "rc" => match self.debugger.go_back()? {
                Some(what) => {
                    say!("{what}");
                    self.say_where()?;
                }
                None => {
                    say!("No breakpoint before this place: this is the beginning.");
                    self.say_where()?;
                }
            },
            "until" => match Target::from_str(argument) {
                Ok(target) => self.until(&target)?,
                Err(error) => say!("{error}"),
            },
            "break" if argument.is_empty() => {
                for breakpoint in self.debugger.breakpoints() {
                    say!("{breakpoint}");
                }
            }
            "break" => match Breakpoint::from_str(argument) {
                Ok(breakpoint) => self.debugger.add_breakpoint(breakpoint)?,
                Err(error) => say!("{error}"),
            },
            "where" => self.say_where()?,
            "tasks" => say_part!("{}", self.debugger.tasks()?),
            "bt" => say_part!("{}", self.debugger.backtrace(argument)?),
            "facts" if argument.is_empty() => expected("a query, such as (door ?name open)"),
            "facts" => {
                let quoted = argument.strip_prefix('\'').unwrap_or(argument);
                say_part!("{}", self.debugger.evaluate(&format!("(db-query '{quoted})"))?);
            }
            "print" | "p" if argument.is_empty() => expected("a form"),
            "print" | "p" => say_part!("{}", self.debugger.evaluate(argument)?),
            "quit" | "q" | "exit" => return Ok(false),
            "help" => say_part!("{}", help(COMMANDS)),
            _ => match nearest(command, COMMANDS) {
                Some(name) => say!("Unknown command `{command}`; did you mean `{name}`?"),
                None => say!("Unknown command `{command}`; `help` lists them."),
            },
        }
        Ok(true)
    }

    fn back(&mut self, argument: &str) -> Result<(), RerunError> {
        let (ticks, turns) = match argument.strip_prefix("turn") {
            Some("") => (None, Some(0)),
            Some(turns) => (None, number(turns.trim())),
            None => (number(argument), None),
        };
        match (ticks, turns) {
            (Some(ticks), _) => self.debugger.step(-ticks)?,
            (_, Some(turns)) => _ = self.debugger.turn(-turns)?,
            _ => {
                expected("a number of ticks, or `turn` and a number of turns");
                return Ok(());
            }
        }
        self.say_where()
    }

    fn go_on(&mut self) -> Result<(), RerunError> {
        let found = self.debugger.go_on()?;
        self.debugger.show_output();
        if let Some(what) = found {
            say!("{what}");
        }
        self.say_where()
    }

    fn until(&mut self, target: &Target) -> Result<(), RerunError> {
        self.debugger.go(target)?;
        self.say_where()
    }

    fn say_where(&mut self) -> Result<(), RerunError> {
        self.debugger.show_output();
        match self.debugger.replayed() {
            None => say!("{}", self.debugger.place()?),
            Some(Replayed::Equal(status)) => {
                say!("tick {}: the run has ended with status {status}", self.debugger.ticks());
            }
            Some(Replayed::Cut) => {
                say!("tick {}: the recording ends here, before the run", self.debugger.ticks());
            }
            Some(Replayed::Diverged(text)) => complain(text),
        }
        Ok(())
    }
}

/// Returns a number, 1 if there is none.
fn number(text: &str) -> Option<i64> {
    if text.is_empty() { Some(1) } else { text.parse().ok().filter(|&number: &i64| number >= 0) }
}

fn expected(what: &str) {
    say!("Expected {what}; `help` shows how.");
}
