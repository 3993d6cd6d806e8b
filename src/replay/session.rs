//! The commands with which a person, or a script, moves through a replay.
#![allow(clippy::print_stdout, reason = "a session talks with people")]

use std::io::{BufRead, IsTerminal, Write};
use std::str::FromStr;

use super::breakpoint::{Breakpoint, Target};
use super::command::show;
use super::debugger::Debugger;
use super::file::Recorded;
use super::rerun::{Replayed, RerunError};
use crate::command::{DIVERGED, SUCCESS, complain};

const HELP: &str = "\
step [N]           go N ticks on; a tick is a call or a turn of a loop
turn [N]           go to the beginning of the next turn, or the N-th
continue           go on to the next breakpoint, or the end
until PLACE        go to tick:N, turn:N, time:SECONDS, record:N, or on to the next failure
back [N]           go N ticks back
back turn [N]      go back to the beginning of the turn, or of the N-th before it
reverse-continue   go back to the last breakpoint, or the beginning
break [WHAT]       stop at failure, failure:CAUSE, task:NAME, fact:PATTERN or function:NAME
where              say where the replay stands
tasks              show the tasks, and what they wait for
bt [TASK]          show the frames of a task, by its name or number
facts QUERY        show the answers to a query: facts (door ?name open)
print FORM         show the values of a form; nothing is changed by it
help, quit
";

/// Replays a run up to the target or the first breakpoint, and obeys the lines of standard input. Returns the
/// exit status.
///
/// # Errors
/// [`RerunError`].
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
    let mut lines = std::io::stdin().lock().lines();
    loop {
        if is_interactive {
            print!("(replay) ");
        }
        _ = std::io::stdout().flush();
        // Input that cannot be read has ended.
        let Some(Ok(line)) = lines.next() else { break };
        if !session.obey(line.trim())? {
            break;
        }
    }
    Ok(match session.debugger.replayed() {
        Some(Replayed::Diverged(_)) => DIVERGED,
        _ => SUCCESS,
    })
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
                    println!("{what}");
                    self.say_where()?;
                }
                None => {
                    println!("There is no breakpoint before: this is the beginning.");
                    self.say_where()?;
                }
            },
            "until" => match Target::from_str(argument) {
                Ok(target) => self.until(&target)?,
                Err(error) => println!("{error}"),
            },
            "break" if argument.is_empty() => {
                for breakpoint in self.debugger.breakpoints() {
                    println!("{breakpoint}");
                }
            }
            "break" => match Breakpoint::from_str(argument) {
                Ok(breakpoint) => self.debugger.add_breakpoint(breakpoint)?,
                Err(error) => println!("{error}"),
            },
            "where" => self.say_where()?,
            "tasks" => print!("{}", self.debugger.tasks()?),
            "bt" => print!("{}", self.debugger.backtrace(argument)?),
            "facts" if argument.is_empty() => expected("a query, such as (door ?name open)"),
            "facts" => {
                let quoted = argument.strip_prefix('\'').unwrap_or(argument);
                print!("{}", self.debugger.evaluate(&format!("(db-query '{quoted})"))?);
            }
            "print" | "p" if argument.is_empty() => expected("a form"),
            "print" | "p" => print!("{}", self.debugger.evaluate(argument)?),
            "quit" | "q" | "exit" => return Ok(false),
            "help" => print!("{HELP}"),
            _ => println!("There is no command `{command}`; `help` lists them."),
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
            println!("{what}");
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
            None => println!("{}", self.debugger.place()?),
            Some(Replayed::Equal(status)) => {
                println!("tick {}: the run has ended with status {status}", self.debugger.ticks());
            }
            Some(Replayed::Cut) => {
                println!("tick {}: the recording ends here, before the run", self.debugger.ticks());
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
    println!("Expected {what}; `help` shows how.");
}
