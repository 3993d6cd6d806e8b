//! `eslvm explore`: runs a program under all schedules, and tells of those that end badly.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "commands print")]

use std::collections::HashMap;
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use esl_vm::vm::Vm;
use serde_json::json;

use super::{
    Behaviour, Exploration, Grain, Livelock, Schedule, SearchLimit, SearchProgress, Settings, StandingTask,
    Switch, TimerGrain, explore_together, tell_switches,
};
use crate::command::{self, FAILED, NOT_PROVED, SUCCESS, StatusLine, USAGE, complain};
use crate::error::Error;
use crate::module_path::ModulePath;
use crate::program::{Ended, Program};
use crate::timeline::Timeline;

/// Prints a line. Whoever has closed the pipe wants no more of it; the exit status still tells.
macro_rules! say {
    ($($part:tt)*) => { _ = writeln!(std::io::stdout(), $($part)*) };
}

/// How to explore, and what to say of it.
#[derive(Clone, Debug)]
pub struct ExplorationOptions {
    /// What is explored.
    pub settings: Settings,
    /// Number of threads.
    pub jobs: usize,
    /// Time after which the search gives up.
    pub time: Duration,
    /// File for a timeline of the first finding.
    pub timeline: Option<PathBuf>,
    /// Whether findings are written as JSON, one object a line.
    pub json: bool,
    /// Whether a terminal is not to be told how far the search is.
    pub is_quiet: bool,
}

/// A way in which the program ends badly.
struct Finding {
    /// In a few words.
    what: String,
    choices: Vec<u32>,
    /// Whether the schedule comes to an end.
    ends: bool,
    /// Number of switches at the end that can be repeated for ever.
    repeated: usize,
    /// What is told of the end: the report of a deadlock or of a failure.
    errors: String,
}

/// The lines of the sources that places lie in.
#[derive(Default)]
struct PlaceTexts(HashMap<String, Vec<String>>);

impl PlaceTexts {
    /// Returns a place with the text of its line, if its source can still be read.
    fn describe(&mut self, place: &str) -> String {
        let mut parts = place.rsplitn(3, ':');
        let (_, line, source) = (parts.next(), parts.next(), parts.next());
        let (Some(line), Some(source)) = (line.and_then(|line| line.parse::<usize>().ok()), source) else {
            return place.into();
        };
        let lines = self.0.entry(source.into()).or_insert_with(|| {
            let text = std::fs::read_to_string(source).unwrap_or_default();
            text.lines().map(|line| line.trim().to_string()).collect()
        });
        match lines.get(line.saturating_sub(1)) {
            Some(text) if !text.is_empty() => format!("{place}: {text}"),
            _ => place.into(),
        }
    }
}

/// Explores a program, and prints what was found. Returns the exit status: 0 if no schedule ends badly, 1 if
/// one does, 7 if none was found and not all were tried.
pub fn run(program: &Program, file: &Path, path: &ModulePath, options: &ExplorationOptions) -> u8 {
    let prepare = |machine: &mut Vm| crate::program::set_module_path(machine, path);
    let started = Instant::now();
    let status_line = StatusLine::new(options.is_quiet);
    let line = Mutex::new(String::from("exploring"));
    let search = || {
        let mut told = started;
        explore_together(program, &options.settings, options.jobs, &prepare, |progress| {
            if told.elapsed() > Duration::from_millis(100) {
                told = Instant::now();
                *line.lock().unwrap_or_else(PoisonError::into_inner) = progress_line(progress, started);
            }
            started.elapsed() < options.time
        })
    };
    let found = status_line.during(|| line.lock().unwrap_or_else(PoisonError::into_inner).clone(), search);
    let found = match found {
        Ok(found) => found,
        Err(error) => {
            complain(error);
            return USAGE;
        }
    };
    let findings = findings(&found);
    let mut lines = PlaceTexts::default();
    for (finding, number) in findings.iter().zip(1..) {
        if let Err(error) = tell(program, file, &prepare, options, finding, number, &mut lines) {
            complain(error);
            return USAGE;
        }
    }
    let seconds = started.elapsed().as_secs_f64();
    if options.json {
        let limit = found.limit.map(|limit| match limit {
            SearchLimit::Asked => "time".into(),
            limit => format!("{limit:?}").to_lowercase(),
        });
        let (states, runs, count) = (found.states, found.runs, findings.len());
        say!(
            "{}",
            json!({ "states": states, "runs": runs, "findings": count, "limit": limit, "seconds": seconds })
        );
    } else {
        print_summary(&found, &options.settings, findings.len());
    }
    match (findings.is_empty(), found.limit) {
        (false, _) => FAILED,
        (true, None) => SUCCESS,
        (true, Some(_)) => NOT_PROVED,
    }
}

/// Returns the ways in which runs end badly, the one with the fewest switches first.
fn findings(found: &Exploration<Behaviour>) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for ending in &found.endings {
        let Behaviour { ended, errors, .. } = &ending.what;
        let what = match ended {
            Ended::Normally(0) => continue,
            Ended::Normally(status) => format!("the program ends with status {status}"),
            Ended::Failed => "a failure leaves the main task".into(),
            Ended::Deadlocked => "no task can ever run again".into(),
            Ended::BudgetSpent => "the budget is spent".into(),
            Ended::HeapExhausted => "the memory is exhausted".into(),
            Ended::Signalled(signal) => format!("the signal {} ends the program", signal.number()),
        };
        // Runs that differ only in what they had printed before are one finding.
        if !findings.iter().any(|known| known.what == what && known.errors == *errors) {
            findings.push(Finding {
                what,
                choices: ending.choices.clone(),
                ends: true,
                repeated: 0,
                errors: errors.clone(),
            });
        }
    }
    if let Some(choices) = &found.endless {
        let what = "from here on, the program never ends".into();
        let choices = choices.clone();
        findings.push(Finding { what, choices, ends: false, repeated: 0, errors: String::new() });
    }
    if let Some(Livelock { choices, lap }) = &found.livelock {
        let what = "tasks can go on for ever, though each has its turns".into();
        let repeated = choices[*lap..].iter().filter(|&&choice| choice > 0).count();
        let choices = choices.clone();
        findings.push(Finding { what, choices, ends: false, repeated, errors: String::new() });
    }
    findings
}

/// Returns the name of the file for the schedule of a finding.
fn schedule_name(file: &Path, number: usize) -> String {
    let stem = file.file_stem().map_or("program".into(), |stem| stem.to_string_lossy());
    format!("{}-{number}.schedule", if stem == "-" { "program".into() } else { stem })
}

/// Reason why a finding cannot be told.
#[derive(Debug)]
enum TellError {
    /// The file with the schedule, of this name, cannot be written.
    Schedule(String, io::Error),
    /// The program cannot be begun again.
    Program(Error),
    /// The timeline cannot be written.
    Timeline(io::Error),
}

impl fmt::Display for TellError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TellError::Schedule(name, error) => write!(f, "{name} cannot be written: {error}"),
            TellError::Program(error) => error.fmt(f),
            TellError::Timeline(error) => write!(f, "the timeline cannot be written: {error}"),
        }
    }
}

/// Writes the schedule of a finding, and prints the finding.
///
/// # Errors
/// [`TellError`].
fn tell(
    program: &Program,
    file: &Path,
    prepare: super::Prepare<'_>,
    options: &ExplorationOptions,
    finding: &Finding,
    number: usize,
    lines: &mut PlaceTexts,
) -> Result<(), TellError> {
    let name = schedule_name(file, number);
    let schedule = Schedule::new(program, &options.settings, finding.choices.clone());
    let written = std::fs::write(&name, schedule.to_string());
    written.map_err(|error| TellError::Schedule(name.clone(), error))?;
    let timeline = options.timeline.as_ref().filter(|_| number == 1);
    let pictured = Mutex::new(None);
    let prepare = |machine: &mut Vm| {
        prepare(machine)?;
        if let Some(path) = timeline {
            let timeline = Timeline::begin(path, machine);
            *pictured.lock().unwrap_or_else(PoisonError::into_inner) = Some(timeline);
        }
        Ok::<(), Error>(())
    };
    let mut switches = Vec::new();
    let mut told = |switch| switches.push(switch);
    tell_switches(program, &options.settings, &finding.choices, finding.ends, &prepare, &mut told)
        .map_err(TellError::Program)?;
    if let Some(timeline) = pictured.into_inner().unwrap_or_else(PoisonError::into_inner) {
        let told = timeline.and_then(Timeline::complete);
        told.map_err(TellError::Timeline)?;
    }
    if options.json {
        let switches: Vec<_> = switches.iter().map(|switch| text(switch, lines)).collect();
        let (what, errors) = (&finding.what, &finding.errors);
        let repeated = finding.repeated;
        say!(
            "{}",
            json!({ "finding": what, "switches": switches, "repeated": repeated, "report": errors, "schedule": name })
        );
        return Ok(());
    }
    say!("finding {number}: {}", finding.what);
    for (switch, number) in switches.iter().zip(1..) {
        say!("  {number}. {}", text(switch, lines).replace('\n', "\n     "));
    }
    match (finding.repeated, switches.len()) {
        (0, _) => {}
        (1, number) => say!("  then {number} again, and so on"),
        (repeated, number) => say!("  then {} to {number} again, and so on", number + 1 - repeated),
    }
    finding.errors.lines().for_each(|line| say!("  {line}"));
    say!("  again: eslvm run --schedule {name} {}\n", file.display());
    Ok(())
}

/// Returns a choice in words.
fn text(switch: &Switch, lines: &mut PlaceTexts) -> String {
    let mut place = |task: &StandingTask, word: &str| {
        task.place.as_ref().map_or(String::new(), |place| format!(" {word} {}", lines.describe(place)))
    };
    match switch {
        Switch::Preemption { stopped, next } => format!(
            "{} stops{}\n{} goes on{}",
            stopped.label,
            place(stopped, "before"),
            next.label,
            place(next, "at")
        ),
        Switch::Order { oldest, next } => {
            format!("{} goes on{}\nbefore {} does", next.label, place(next, "at"), oldest.label)
        }
        Switch::Timer { task, passed } => format!(
            "{} s pass, and timers end,\nbefore {} goes on{}",
            *passed as f64 / 1e9,
            task.label,
            place(task, "at")
        ),
        Switch::Choice { task, form } => {
            format!("{} chooses form {}{}", task.label, form + 1, place(task, "at"))
        }
    }
}

fn print_summary(found: &Exploration<Behaviour>, settings: &Settings, findings: usize) {
    let counted = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let figures = format!("{}, {}", counted(found.states, "state"), counted(found.runs, "run"));
    let why = match found.limit {
        None => None,
        Some(SearchLimit::States) => Some("the limit of states is reached"),
        Some(SearchLimit::Memory) => Some("the limit of memory is reached"),
        Some(SearchLimit::Switches) => Some("schedules with more switches were not tried"),
        Some(SearchLimit::Faults) => Some("more choices that are not the first were not tried"),
        Some(SearchLimit::Asked) => Some("the time is over"),
    };
    match (findings, why) {
        (0, None) => say!("complete: no schedule ends badly ({figures})"),
        (0, Some(why)) => say!("bounded, not proved: {why}; no schedule so far ends badly ({figures})"),
        (_, None) => say!("complete: findings: {findings} ({figures})"),
        (_, Some(why)) => say!("bounded: {why}; findings: {findings} ({figures})"),
    }
    if found.has_cycle {
        say!(
            "Some schedules return to where they were: they can go on for ever, if they are unfair to a task."
        );
    }
    let timers = match settings.timers {
        TimerGrain::Idle => "; timers that end before others have done their work (--timers any)",
        TimerGrain::Any => "",
    };
    let reads = match settings.grain {
        Grain::Changes => "; switches before a task only looks at what others do (--grain reads)",
        Grain::Reads | Grain::Variables | Grain::Ticks => "",
    };
    let variables = match settings.grain {
        Grain::Variables | Grain::Ticks => "",
        Grain::Changes | Grain::Reads => "variables (--grain variables), and of ",
    };
    let objects = format!(
        "changes of {variables}slots and tables (--grain ticks), by tasks that are outside of critical sections"
    );
    match (settings.grain, settings.timers) {
        (Grain::Ticks, TimerGrain::Any) => {}
        (Grain::Ticks, TimerGrain::Idle) => say!("Not seen: {}.", timers.trim_start_matches("; ")),
        _ => say!("Not seen: {objects}{reads}{timers}."),
    }
}

/// Says how far a search is that began at `started`.
fn progress_line(progress: &SearchProgress, started: Instant) -> String {
    let SearchProgress { states, open, switches, endings, .. } = *progress;
    let rate = states as f64 / started.elapsed().as_secs_f64();
    format!(
        "{states} states, {rate:.0} a second; {open} choices open, {switches} switches, {endings} endings"
    )
}

/// Reads a schedule from a file.
///
/// # Errors
/// The exit status, after a message.
pub fn read_schedule(path: &Path) -> Result<Schedule, u8> {
    let bytes = std::fs::read(path).map_err(|error| {
        complain(format_args!("{} cannot be read: {error}", path.display()));
        command::USAGE
    })?;
    // What is no text is not a schedule, either: its first line says so.
    Schedule::parse(&String::from_utf8_lossy(&bytes)).map_err(|error| {
        complain(format_args!("{} is no schedule: {error}", path.display()));
        command::USAGE
    })
}
