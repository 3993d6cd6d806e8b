//! `eslvm explore`: runs a program under all schedules, and tells of those that end badly.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "commands print")]

mod tell;

use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use esl::Error;
use esl::module_path::ModulePath;
use esl::program::Schedule;
use esl::program::{Ended, Program};
use esl_command::{FAILED, NOT_PROVED, SUCCESS, StatusLine, USAGE, complain};
use esl_testing::explore::{
    Behaviour, Exploration, ExplorationScope, Grain, Livelock, Prepare, ScheduleEvent, SearchLimit,
    SearchProgress, Settings, SourceForms, TimerGrain, explore_together, grains, tell_steps,
};
use esl_timeline::Timeline;
use esl_vm::vm::Vm;
use serde_json::json;

/// Prints a line, and ignores a closed pipe; the exit status states the result in any case.
macro_rules! say {
    ($($part:tt)*) => { _ = writeln!(std::io::stdout(), $($part)*) };
}

/// How to explore, and what to say of it.
#[derive(Clone, Debug)]
pub struct ExplorationOptions {
    /// The settings of the exploration, except the grain.
    pub settings: Settings,
    /// The grain, if one is asked for.
    pub grain: Option<Grain>,
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
    /// The report of the end: of a deadlock or of a failure.
    errors: String,
}

/// Explores a program, and prints what was found. Returns the exit status: 0 if no schedule ends badly, 1 if
/// one does, 7 if none was found and there may be one.
pub fn run(program: &Program, file: &Path, path: &ModulePath, options: &ExplorationOptions) -> u8 {
    let prepare = |machine: &mut Vm| esl::program::set_module_path(machine, path);
    let started = Instant::now();
    let grains = grains(program, options.grain);
    let mut tried = Vec::new();
    let (settings, scope, found, findings) = loop {
        let settings = Settings { grain: grains[tried.len()], ..options.settings };
        let found = match search(program, options, &settings, &prepare, started) {
            Ok(found) => found,
            Err(error) => {
                complain(error);
                return USAGE;
            }
        };
        let scope = ExplorationScope::new(program, &settings, &found);
        let findings = findings(&found);
        let is_last = tried.len() + 1 == grains.len();
        if is_last || !findings.is_empty() || found.limit.is_some() {
            break (settings, scope, found, findings);
        }
        tried.push(scope);
    };
    let mut forms = SourceForms::default();
    for (finding, number) in findings.iter().zip(1..) {
        let told = tell(program, file, &prepare, (options, &settings), finding, number, &mut forms);
        if let Err(error) = told {
            complain(error);
            return USAGE;
        }
    }
    if options.json {
        let limit = found.limit.map(|limit| match limit {
            SearchLimit::Asked => "time".into(),
            limit => format!("{limit:?}").to_lowercase(),
        });
        let verdict = match (findings.is_empty(), scope.is_complete()) {
            (false, _) => "violation",
            (true, true) => "complete",
            (true, false) => "bounded",
        };
        let unseen: Vec<String> = scope.unseen.iter().map(ToString::to_string).collect();
        let (grain, timers) = (scope.grain.name(), scope.timers.name());
        let (states, runs, count) = (found.states, found.runs, findings.len());
        say!(
            "{}",
            json!({
                "verdict": verdict, "grain": grain, "timers": timers, "unseen": unseen, "states": states,
                "runs": runs, "findings": count, "limit": limit, "seconds": started.elapsed().as_secs_f64(),
            })
        );
    } else {
        print_summary(&scope, &tried, found.has_cycle, findings.len());
    }
    match (findings.is_empty(), scope.is_complete()) {
        (false, _) => FAILED,
        (true, true) => SUCCESS,
        (true, false) => NOT_PROVED,
    }
}

/// Explores a program with these settings, and tells a terminal how far it is.
///
/// # Errors
/// As [`explore_together`].
fn search(
    program: &Program,
    options: &ExplorationOptions,
    settings: &Settings,
    prepare: Prepare<'_>,
    started: Instant,
) -> Result<Exploration<Behaviour>, Error> {
    let line = Mutex::new(format!("exploring at grain {}", settings.grain.name()));
    let search = || {
        let mut told = started;
        explore_together(program, settings, options.jobs, prepare, |progress| {
            if told.elapsed() > Duration::from_millis(100) {
                told = Instant::now();
                *line.lock().unwrap_or_else(PoisonError::into_inner) = progress_line(progress, started);
            }
            started.elapsed() < options.time
        })
    };
    let status_line = StatusLine::new(options.is_quiet);
    status_line.during(|| line.lock().unwrap_or_else(PoisonError::into_inner).clone(), search)
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
    prepare: Prepare<'_>,
    (options, settings): (&ExplorationOptions, &Settings),
    finding: &Finding,
    number: usize,
    forms: &mut SourceForms,
) -> Result<(), TellError> {
    let name = schedule_name(file, number);
    let schedule = Schedule::new(program, settings, finding.choices.clone());
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
    let mut steps = Vec::new();
    tell_steps(program, settings, &finding.choices, finding.ends, &prepare, &mut |step| steps.push(step))
        .map_err(TellError::Program)?;
    if let Some(timeline) = pictured.into_inner().unwrap_or_else(PoisonError::into_inner) {
        let told = timeline.and_then(Timeline::complete);
        told.map_err(TellError::Timeline)?;
    }
    let switches = steps.iter().filter_map(|step| match &step.event {
        ScheduleEvent::Switch(switch) => Some(switch),
        ScheduleEvent::Use { .. } => None,
    });
    if options.json {
        let switches: Vec<_> = switches.map(|switch| tell::text(switch, forms)).collect();
        let (what, errors, repeated) = (&finding.what, &finding.errors, finding.repeated);
        let steps = tell::json(&steps, forms);
        say!(
            "{}",
            json!({
                "finding": what, "grain": settings.grain.name(), "timers": settings.timers.name(),
                "switches": switches, "steps": steps, "repeated": repeated, "report": errors, "schedule": name,
            })
        );
        return Ok(());
    }
    say!("finding {number}: {}", finding.what);
    for line in tell::lines(&steps, forms) {
        say!("  {}", line.replace('\n', "\n  "));
    }
    match (finding.repeated, switches.count()) {
        (0, _) => {}
        (1, number) => say!("  then {number} again, and so on"),
        (repeated, number) => say!("  then {} to {number} again, and so on", number + 1 - repeated),
    }
    finding.errors.lines().for_each(|line| say!("  {line}"));
    say!("  again: eslvm run --schedule {name} {}\n", file.display());
    Ok(())
}

/// Prints the verdict, and in a line what was not tried. `tried` are the scopes at coarser grains, at which
/// nothing was found.
fn print_summary(scope: &ExplorationScope, tried: &[ExplorationScope], has_cycle: bool, findings: usize) {
    match (findings, scope.why_not_complete()) {
        (0, None) => say!("complete: no schedule ends badly ({scope})"),
        (0, Some(why)) => say!("bounded, not proved: {why}; no schedule so far ends badly ({scope})"),
        (_, Some(why)) if scope.limit.is_some() => {
            say!("violation: findings: {findings}; bounded: {why} ({scope})")
        }
        (_, _) => say!("violation: findings: {findings} ({scope})"),
    }
    if let (0, Some(coarser)) = (findings, tried.last())
        && !scope.is_complete()
    {
        let why = coarser.why_not_complete().unwrap_or_default();
        say!("all schedules at grain {} were tried before ({coarser}), but {why}", coarser.grain.name());
    }
    let timers = (scope.timers == TimerGrain::Idle).then_some("timers that end early (--timers any)");
    let cycle = has_cycle.then_some("schedules that are unfair to a task, which may go on for ever");
    let left: Vec<&str> = [timers, cycle].into_iter().flatten().collect();
    if !left.is_empty() {
        say!("not tried: {}", left.join("; "));
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
        USAGE
    })?;
    // A file that is not text is not a schedule either, as its first line shows.
    Schedule::parse(&String::from_utf8_lossy(&bytes)).map_err(|error| {
        complain(format_args!("{} is not a schedule: {error}", path.display()));
        USAGE
    })
}
