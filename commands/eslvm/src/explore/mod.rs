//! `eslvm explore`: runs a program under all schedules, and tells of those that end badly.

use std::cell::{OnceCell, RefCell};
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use esl::Error;
use esl::module_path::ModulePath;
use esl::program::Schedule;
use esl::program::{Ended, Program};
use esl_command::{FAILED, NOT_PROVED, SUCCESS, StatusLine, USAGE, complain, say};
use esl_testing::explore::{
    Behaviour, Exploration, ExplorationScope, ExploredEnding, Fairness, Grain, Livelock, Prepare,
    RandomSettings, ScheduleStep, SearchLimit, SearchProgress, Settings, SourceForms, TimerGrain,
    explore_together, grains, name_of_condition, shortest, tell_steps,
};
use esl_timeline::Timeline;
use esl_vm::vm::Vm;
use serde_json::{Value as Json, json};

mod picture;
mod progress;
mod random;
mod strict;
pub(crate) mod tell;

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
    /// Whether the program is meant to go on for ever: then a schedule may go on without an end.
    pub is_endless: bool,
    /// File for a timeline of the first finding.
    pub timeline: Option<PathBuf>,
    /// File for a picture of the first finding.
    pub svg: Option<PathBuf>,
    /// File for the findings as JSON, which editors show.
    pub findings: Option<PathBuf>,
    /// File for the progress of random schedules, from which a later run goes on.
    pub progress: Option<PathBuf>,
    /// Whether uses of shared places that are safe by chance only are looked for, too.
    pub strict: bool,
    /// Whether these are an error.
    pub deny_fragile: bool,
    /// The random schedules to try in place of all.
    pub random: Option<RandomSettings>,
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

/// Explores a program, and prints what was found. `with_points` compiles the program with points before the
/// uses of places that tasks may share, if its source is there. Returns the exit status: 0 if no schedule
/// ends badly, 1 if one does, 7 if none was found and there may be one.
pub fn run(
    program: &Program,
    with_points: &dyn Fn() -> Option<Program>,
    file: &Path,
    path: &ModulePath,
    options: &ExplorationOptions,
) -> u8 {
    let prepare = |machine: &mut Vm| esl::program::set_module_path(machine, path);
    let session = CommandExploration {
        program,
        with_points,
        marked: OnceCell::new(),
        file,
        prepare: &prepare,
        options,
        started: Instant::now(),
        forms: RefCell::default(),
        told: RefCell::default(),
    };
    let status = match options.random {
        Some(random) => session.try_random(random),
        None => session.try_all(),
    };
    status.and_then(|status| session.write_findings().map(|()| status)).unwrap_or_else(|error| {
        complain(error);
        USAGE
    })
}

/// An exploration of a program by the command.
struct CommandExploration<'a> {
    program: &'a Program,
    with_points: &'a dyn Fn() -> Option<Program>,
    /// The program with points, once it was needed.
    marked: OnceCell<Option<Program>>,
    file: &'a Path,
    prepare: Prepare<'a>,
    options: &'a ExplorationOptions,
    started: Instant,
    forms: RefCell<SourceForms>,
    /// The findings that were told, as JSON.
    told: RefCell<Vec<Json>>,
}

/// The outcome of the searches at one grain after the other.
struct Searched {
    settings: Settings,
    scope: ExplorationScope,
    /// The scopes at coarser grains, at which nothing was found.
    tried: Vec<ExplorationScope>,
    found: Exploration<Behaviour>,
    findings: Vec<Finding>,
}

impl CommandExploration<'_> {
    /// Returns the program with points, if its source is there.
    fn marked(&self) -> Option<&Program> {
        self.marked.get_or_init(self.with_points).as_ref()
    }

    /// Tries all schedules. Returns the exit status.
    ///
    /// # Errors
    /// [`TellError`].
    fn try_all(&self) -> Result<u8, TellError> {
        let searched = self.search_grains(self.program, false)?;
        let Searched { settings, scope, tried, found, findings } = &searched;
        for (finding, number) in findings.iter().zip(1..) {
            self.tell((self.program, settings), finding, &format!("finding {number}"), number)?;
        }
        let (has_findings, is_complete) = (!findings.is_empty(), scope.is_complete());
        if self.options.json {
            self.say_figures(&searched);
        } else {
            let cycle = if !found.has_cycle {
                None
            } else if self.options.is_endless {
                Some("schedules that go on for ever, other than by conditions (--endless)")
            } else if settings.fairness == Fairness::Weak {
                Some("schedules that are unfair to a task, which may go on for ever")
            } else {
                None
            };
            print_summary(scope, tried, cycle, findings.len());
        }
        let is_fragile = self.options.strict && !has_findings && self.try_strictly()?;
        Ok(match (has_findings, is_complete) {
            (true, _) => FAILED,
            _ if is_fragile && self.options.deny_fragile => FAILED,
            (false, true) => SUCCESS,
            (false, false) => NOT_PROVED,
        })
    }

    /// Searches at one grain after the other, until something is found. `program` has points if it is
    /// explored strictly.
    ///
    /// # Errors
    /// [`TellError`].
    fn search_grains(&self, program: &Program, strict: bool) -> Result<Searched, TellError> {
        let grains = grains(self.program, self.options.grain);
        let mut tried = Vec::new();
        loop {
            let grain = grains[tried.len()];
            let settings = Settings { grain, strict, ..self.options.settings };
            let found = self.search(program, &settings).map_err(TellError::Program)?;
            let scope = ExplorationScope::new(self.program, &settings, &found);
            let mut findings = findings(&found.endings);
            findings.extend(self.endless_findings(program, &settings, &found).map_err(TellError::Program)?);
            let is_last = tried.len() + 1 == grains.len();
            if is_last || !findings.is_empty() || found.limit.is_some() {
                return Ok(Searched { settings, scope, tried, found, findings });
            }
            tried.push(scope);
        }
    }

    /// Returns the schedules that go on for ever and should not.
    ///
    /// # Errors
    /// As [`name_of_condition`].
    fn endless_findings(
        &self,
        program: &Program,
        settings: &Settings,
        found: &Exploration<Behaviour>,
    ) -> Result<Vec<Finding>, Error> {
        let how = match settings.fairness {
            Fairness::Weak => "though each has its turns",
            Fairness::None => "if the schedule may be unfair",
        };
        let finding = |what: String, Livelock { choices, lap }: &Livelock| {
            let repeated = choices[*lap..].iter().filter(|&&choice| choice > 0).count();
            Finding { what, choices: choices.clone(), ends: false, repeated, errors: String::new() }
        };
        let mut findings = Vec::new();
        for unmet in &found.unmet {
            let name = name_of_condition(program, settings, unmet, self.prepare)?;
            let what = format!("{name} never comes true while tasks go on for ever, {how}");
            findings.push(finding(what, &unmet.schedule));
        }
        if self.options.is_endless {
            return Ok(findings);
        }
        if let Some(choices) = &found.endless {
            let (what, choices) = ("from here on, the program never ends".into(), choices.clone());
            findings.push(Finding { what, choices, ends: false, repeated: 0, errors: String::new() });
        }
        if let Some(livelock) = &found.livelock {
            findings.push(finding(format!("tasks can go on for ever, {how}"), livelock));
        }
        Ok(findings)
    }

    /// Explores a program with these settings, and tells a terminal how far it is.
    ///
    /// # Errors
    /// As [`explore_together`].
    fn search(&self, program: &Program, settings: &Settings) -> Result<Exploration<Behaviour>, Error> {
        let (options, started) = (self.options, self.started);
        let line = Mutex::new(format!("exploring at grain {}", settings.grain.name()));
        let search = || {
            let mut told = started;
            explore_together(program, settings, options.jobs, self.prepare, |progress| {
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

    /// Prints the figures of a search as JSON.
    fn say_figures(&self, searched: &Searched) {
        let Searched { scope, found, findings, .. } = searched;
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
        let fairness = self.options.settings.fairness;
        say!(
            "{}",
            json!({
                "verdict": verdict, "grain": grain, "timers": timers, "aborts": scope.aborts, "crashes": scope.crashes,
                "symmetry": scope.symmetry, "unseen": unseen, "states": states,
                "runs": runs, "findings": count, "limit": limit, "endless": self.options.is_endless,
                "fairness": if fairness == Fairness::Weak { "weak" } else { "none" },
                "seconds": self.started.elapsed().as_secs_f64(),
            })
        );
    }

    /// Writes the schedule of a finding, and prints the finding under a title. `program` is the one in which
    /// it was found, with these settings. Returns the steps of the schedule.
    ///
    /// # Errors
    /// [`TellError`].
    fn tell(
        &self,
        (program, settings): (&Program, &Settings),
        finding: &Finding,
        title: &str,
        number: usize,
    ) -> Result<Vec<ScheduleStep>, TellError> {
        let (options, forms) = (self.options, &mut *self.forms.borrow_mut());
        let name = schedule_name(self.file, number);
        let choices = match finding.ends {
            true => {
                shortest(program, settings, &finding.choices, self.prepare).map_err(TellError::Program)?
            }
            false => finding.choices.clone(),
        };
        let schedule = Schedule::new(program, settings, choices.clone());
        write_file(Path::new(&name), &schedule.to_string())?;
        let timeline = options.timeline.as_ref().filter(|_| number == 1);
        let pictured = Mutex::new(None);
        let prepare = |machine: &mut Vm| {
            (self.prepare)(machine)?;
            if let Some(path) = timeline {
                let timeline = Timeline::begin(path, machine);
                *pictured.lock().unwrap_or_else(PoisonError::into_inner) = Some(timeline);
            }
            Ok::<(), Error>(())
        };
        let mut steps = Vec::new();
        // Points say where the uses of places are; only a strict exploration stops at them.
        let told = self.marked().unwrap_or(program);
        tell_steps(told, settings, &choices, finding.ends, &prepare, &mut |step| steps.push(step))
            .map_err(TellError::Program)?;
        if let Some(timeline) = pictured.into_inner().unwrap_or_else(PoisonError::into_inner) {
            let told = timeline.and_then(Timeline::complete);
            told.map_err(TellError::Timeline)?;
        }
        let last_again = tell::last_again(finding.repeated);
        if let Some(file) = options.svg.as_ref().filter(|_| number == 1) {
            let title = format!("{title}: {}", finding.what);
            let report = last_again.iter().map(String::as_str).chain(finding.errors.lines());
            write_file(file, &picture::draw(&title, &tell::rows(&steps, forms), report, forms))?;
        }
        if options.json || options.findings.is_some() {
            let told = tell::finding(finding, title, settings, &steps, &name, forms);
            if options.json {
                say!("{told}");
            }
            self.told.borrow_mut().push(told);
        }
        if options.json {
            return Ok(steps);
        }
        say!("{title}: {}", finding.what);
        tell::lines(&steps, forms).iter().for_each(|line| say!("{line}"));
        if let Some(text) = last_again {
            say!("  {text}");
        }
        finding.errors.lines().for_each(|line| say!("  {line}"));
        say!("  again: eslvm run --schedule {name} {}\n", self.file.display());
        Ok(steps)
    }

    /// Writes the findings for editors, also if there are none, in place of those of an earlier exploration.
    ///
    /// # Errors
    /// [`TellError::File`].
    fn write_findings(&self) -> Result<(), TellError> {
        let Some(file) = &self.options.findings else { return Ok(()) };
        let folder = std::env::current_dir().map_err(|error| TellError::File(file.clone(), error))?;
        let text = json!({ "folder": folder, "program": self.file, "findings": *self.told.borrow() });
        write_file(file, &format!("{text}\n"))
    }
}

/// Writes a text to a file.
///
/// # Errors
/// [`TellError::File`].
fn write_file(file: &Path, text: &str) -> Result<(), TellError> {
    std::fs::write(file, text).map_err(|error| TellError::File(file.to_owned(), error))
}

/// Returns the ways in which runs end badly, the one with the fewest switches first.
fn findings(endings: &[ExploredEnding<Behaviour>]) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for ending in endings {
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
    /// A file cannot be written: a schedule, a picture, findings, or progress.
    File(PathBuf, io::Error),
    /// The file of progress cannot be read, or is not one.
    Progress(PathBuf, progress::ProgressError),
    /// The program cannot be begun again.
    Program(Error),
    /// The timeline cannot be written.
    Timeline(io::Error),
    /// The program is compiled without points.
    NoSource,
}

impl fmt::Display for TellError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TellError::File(file, error) => write!(f, "{} cannot be written: {error}", file.display()),
            TellError::Progress(file, error) => write!(f, "{} {error}", file.display()),
            TellError::Program(error) => error.fmt(f),
            TellError::Timeline(error) => write!(f, "the timeline cannot be written: {error}"),
            TellError::NoSource => f.write_str("--strict needs the source of the program"),
        }
    }
}

/// Prints the verdict, and in a line what was not tried. `tried` are the scopes at coarser grains, at which
/// nothing was found; `cycle` says which schedules that go on for ever are left out.
fn print_summary(scope: &ExplorationScope, tried: &[ExplorationScope], cycle: Option<&str>, findings: usize) {
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
    let aborts = (scope.aborts == 0).then_some("aborts by an operator (--aborts)");
    let crashes =
        (scope.crashes == 0 && scope.has_restarts).then_some("restarts of a durable run (--crashes)");
    let left: Vec<&str> = [timers, aborts, crashes, cycle].into_iter().flatten().collect();
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
