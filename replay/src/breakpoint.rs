//! Where a replay stops: at places of the run, and at what happens in it.

use std::fmt;
use std::str::FromStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;

use super::pattern::{FactPattern, NotAPattern};

/// Reason why a text names no place to go to, or nothing to stop at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StopError {
    /// The text is not a number.
    NotANumber(String),
    /// The text is not a number of seconds, or is one that no run has.
    NotSeconds(String),
    /// The text names no kind of place.
    NotAPlace,
    /// A name is missing.
    NoName,
    /// The text is not a pattern of facts.
    Pattern(NotAPattern),
    /// The text names no kind of breakpoint.
    NotABreakpoint,
}

impl fmt::Display for StopError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StopError::NotANumber(text) => write!(f, "expected a number, found `{text}`"),
            StopError::NotSeconds(text) => write!(f, "expected seconds, found `{text}`"),
            StopError::NotAPlace => f.write_str("expected tick:N, turn:N, time:SECONDS, record:N or failure"),
            StopError::NoName => f.write_str("expected a name"),
            StopError::Pattern(error) => error.fmt(f),
            StopError::NotABreakpoint => {
                f.write_str("expected failure, failure:CAUSE, task:NAME, fact:PATTERN or function:NAME")
            }
        }
    }
}

impl std::error::Error for StopError {}

/// A place to go to.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// After so many ticks.
    Tick(u64),
    /// The beginning of the turn of this number.
    Turn(u64),
    /// When the program learns that so many nanoseconds have passed.
    Time(u64),
    /// When the run has taken so many records.
    Record(u64),
    /// The next failure.
    Failure,
}

impl FromStr for Target {
    type Err = StopError;

    fn from_str(text: &str) -> Result<Target, StopError> {
        let number = |text: &str| text.parse().map_err(|_| StopError::NotANumber(text.into()));
        match text.split_once(':') {
            None if text == "failure" => Ok(Target::Failure),
            Some(("tick", n)) => number(n).map(Target::Tick),
            Some(("turn", n)) => number(n).map(Target::Turn),
            Some(("record", n)) => number(n).map(Target::Record),
            Some(("time", seconds)) => match seconds.parse::<f64>() {
                Ok(seconds) if (0.0..1e9).contains(&seconds) => Ok(Target::Time((seconds * 1e9) as u64)),
                _ => Err(StopError::NotSeconds(seconds.into())),
            },
            _ => Err(StopError::NotAPlace),
        }
    }
}

/// Something at which a replay stops.
#[derive(Clone, Debug, PartialEq)]
pub enum Breakpoint {
    /// A failure, of this cause if one is given.
    Failure(Option<String>),
    /// The task of this name has its turn.
    Task(String),
    /// A fact that matches is asserted or retracted.
    Fact(FactPattern),
    /// The function of this name is about to be called.
    Function(String),
}

impl FromStr for Breakpoint {
    type Err = StopError;

    fn from_str(text: &str) -> Result<Breakpoint, StopError> {
        let named = |name: &str| match name.trim() {
            "" => Err(StopError::NoName),
            name => Ok(name.to_uppercase()),
        };
        match text.split_once(':') {
            None if text == "failure" => Ok(Breakpoint::Failure(None)),
            Some(("failure", cause)) => {
                let cause = named(cause.trim().trim_start_matches(':'))?;
                Ok(Breakpoint::Failure(Some(cause)))
            }
            Some(("task", name)) => named(name).map(Breakpoint::Task),
            Some(("fact", pattern)) => {
                FactPattern::parse(pattern).map(Breakpoint::Fact).map_err(StopError::Pattern)
            }
            Some(("function", name)) => named(name).map(Breakpoint::Function),
            _ => Err(StopError::NotABreakpoint),
        }
    }
}

impl fmt::Display for Breakpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Breakpoint::Failure(None) => f.write_str("failure"),
            Breakpoint::Failure(Some(cause)) => write!(f, "failure:{cause}"),
            Breakpoint::Task(name) => write!(f, "task:{name}"),
            Breakpoint::Fact(pattern) => write!(f, "fact:{pattern}"),
            Breakpoint::Function(name) => write!(f, "function:{name}"),
        }
    }
}

/// The events so far that breakpoints refer to.
#[derive(Debug, Default)]
pub(super) struct Happened {
    pub(super) breakpoints: Vec<Breakpoint>,
    /// Names of tasks, by number.
    pub(super) names: Vec<(TaskNumber, String)>,
    /// How often.
    pub(super) count: u64,
    /// The last of it, in words.
    pub(super) last: String,
    /// Number of failures.
    pub(super) failures: u64,
}

/// Tells [`Happened`] what happens.
pub(super) struct Witness(pub(super) Arc<Mutex<Happened>>);

pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The guarded data are consistent at every moment, so a panic elsewhere does not corrupt them.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Observer for Witness {
    fn see(&mut self, _time: u64, task: TaskNumber, seen: Seen<'_>) {
        let happened = &mut *lock(&self.0);
        let name = |happened: &Happened| {
            let named = happened.names.iter().find(|(number, _)| *number == task);
            named.map_or_else(|| format!("task {task}"), |(_, name)| name.clone())
        };
        let what = match seen {
            Seen::Begins { name, .. } | Seen::IsNamed(name) => {
                happened.names.retain(|(number, _)| *number != task);
                happened.names.push((task, name.into()));
                return;
            }
            Seen::Ends(_) => return happened.names.retain(|(number, _)| *number != task),
            Seen::Fails(cause) => {
                happened.failures += 1;
                let is_it = |wanted: &Breakpoint| match wanted {
                    Breakpoint::Failure(None) => true,
                    Breakpoint::Failure(Some(wanted)) => {
                        cause.trim_start_matches(':').eq_ignore_ascii_case(wanted)
                    }
                    _ => false,
                };
                if !happened.breakpoints.iter().any(is_it) {
                    return;
                }
                format!("{} fails with {cause}", name(happened))
            }
            Seen::Runs => {
                let name = name(happened);
                let bare = name.strip_prefix("task ").unwrap_or(&name);
                let bare = bare.trim_matches('"');
                let is_it = |wanted: &Breakpoint| {
                    let Breakpoint::Task(wanted) = wanted else { return false };
                    name.eq_ignore_ascii_case(wanted)
                        || bare.eq_ignore_ascii_case(wanted)
                        || *wanted == task.to_string()
                };
                if !happened.breakpoints.iter().any(is_it) {
                    return;
                }
                format!("{name} has its turn")
            }
            Seen::Changes { fact, is_there } => {
                let is_it = |wanted: &Breakpoint| matches!(wanted, Breakpoint::Fact(pattern) if pattern.matches(fact));
                if !happened.breakpoints.iter().any(is_it) {
                    return;
                }
                format!("{} {} {fact}", name(happened), if is_there { "asserts" } else { "retracts" })
            }
            _ => return,
        };
        happened.count += 1;
        happened.last = what;
    }
}
