//! `eslvm run --state` and `eslvm state`.

use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use clap::Args;
use esl::host::{ProcessSignal, RealHost, SurveyRequest};
use esl::module_path::ModulePath;
use esl::program::{self, Instrumentation};
use esl_command::{DIVERGED, NOT_COMPILED, SUCCESS, USAGE, complain, say};
use esl_durable::{
    Downtime, Durability, DurableError, DurableOptions, DurableRun, DurableState, Resumed, look,
};
use esl_replay::RunSetup;
use esl_vm::vm::Tier;
use eslvm::operate::tell_manager;
use eslvm::signal::{SignalTarget, end_on_signal_unless};

use crate::figures::print_stats;
use crate::options::{ClockChoice, MachineOptions};
use crate::program::{complain_of_signal, program};
use crate::run::RunReports;

/// Options of a durable run.
#[derive(Args)]
pub(crate) struct StateOptions {
    /// Make the run durable: keep its journal in this folder, or go on with the run of this folder. Needs the
    /// same program each time
    #[arg(long, value_name = "FOLDER", conflicts_with_all = [
        "schedule", "record", "coverage", "profile", "timeline", "mcap", "foxglove", "metrics", "listen", "monitor",
    ])]
    pub(crate) state: Option<std::path::PathBuf>,
    /// Let a durable run survive the end of its process, or loss of power as well, for which it waits for the
    /// disk before each effect
    #[arg(long, value_enum, default_value = "process", requires = "state", value_name = "EVENT")]
    pub(crate) durability: DurabilityChoice,
    /// Count the time between two processes for the clock of a durable program, or leave it out
    #[arg(long, value_enum, default_value = "counts", requires = "state", value_name = "HOW")]
    pub(crate) downtime: DowntimeChoice,
    /// Pause a durable run at SIGTERM, so that the same command goes on, or end it with its cleanups
    #[arg(long, value_enum, default_value = "pause", requires = "state", value_name = "ACTION")]
    pub(crate) on_term: OnTerm,
}

/// The events that a durable run survives.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum DurabilityChoice {
    /// The end of its process
    Process,
    /// Loss of power too
    Power,
}

/// How the time between two processes counts.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum DowntimeChoice {
    /// It has passed
    Counts,
    /// The clock has stood still
    Stops,
}

/// The reaction to SIGTERM.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum OnTerm {
    /// Pauses the run
    Pause,
    /// Ends the run
    End,
}

/// Options of `eslvm state`.
#[derive(Args)]
pub(crate) struct LookOptions {
    /// Show the facts of this relation
    #[arg(long, value_name = "NAME")]
    facts: Option<String>,
    /// Folder of a durable run
    #[arg(value_name = "FOLDER")]
    folder: std::path::PathBuf,
}

/// Prints why a durable run cannot begin, or go on. Returns the exit status.
fn refused(error: &DurableError) -> u8 {
    complain(error);
    match error {
        DurableError::Diverged(_) => DIVERGED,
        DurableError::Journal(esl_replay::RecordedError::OtherMachine) => DIVERGED,
        DurableError::Journal(_) | DurableError::Program(_) => NOT_COMPILED,
        _ => USAGE,
    }
}

/// Begins a durable run of the program in a file, or goes on with it. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_durable(
    file: &Path,
    arguments: &[String],
    mut host: RealHost,
    options: &MachineOptions,
    state: (&Path, &StateOptions),
    reports: &RunReports<'_>,
    path: &ModulePath,
) -> Result<u8, u8> {
    let (folder, state) = state;
    let refuse = |error: DurableError| refused(&error);
    let is_virtual = match options.clock {
        ClockChoice::Real => false,
        ClockChoice::Virtual => true,
        #[cfg(feature = "robots")]
        ClockChoice::Ros => {
            complain("`--state` needs a clock of its own: leave out `--clock ros`");
            return Err(USAGE);
        }
    };
    let downtime = match state.downtime {
        DowntimeChoice::Counts if !is_virtual => Downtime::Counts,
        _ => Downtime::Stops,
    };
    let durability = match state.durability {
        DurabilityChoice::Process => Durability::Process,
        DurabilityChoice::Power => Durability::Power,
    };
    let run = DurableRun::open(folder, DurableOptions { durability, downtime }).map_err(refuse)?;
    let (signals, control) = (SignalTarget::default(), run.control());
    let pauses = state.on_term == OnTerm::Pause;
    end_on_signal_unless(signals.clone(), move |signal| {
        pauses && signal == ProcessSignal::Terminate && control.pause()
    });
    run.control().on_resume(say_resumed);
    let (program, _) = program(file, path, options, Instrumentation::None, reports.is_quiet, &signals)?;
    if run.arguments().is_some_and(|known| known != arguments) {
        return Err(refused(&DurableError::OtherSettings("other arguments of the program")));
    }
    if is_virtual {
        host = host.with_virtual_time();
    }
    let setup = |error| {
        complain(error);
        USAGE
    };
    let host = run.host(host.with_elapsed(run.elapsed()));
    let mut machine = program::machine(options.config(), Box::new(host)).map_err(setup)?;
    if !is_virtual {
        esl_world::install_operations(&mut machine);
    }
    signals.set(machine.inbox());
    // A run that goes on looks for modules where it did before.
    let given = || path.folders().iter().map(|folder| folder.to_string_lossy().into_owned()).collect();
    let (folders, program_file) = match run.found() {
        Some(found) => (found.folders.clone(), found.program_file.clone()),
        None => (given(), path.program_file()),
    };
    program::set_module_folders(&mut machine, &folders).map_err(setup)?;
    program::set_program_file(&mut machine, &program_file).map_err(setup)?;
    program::set_traces(&mut machine, reports.trace).map_err(setup)?;
    if reports.stats.is_some() {
        machine.gather_figures(false);
    }
    machine.set_tier(reports.tier.map_or(Tier::Auto, Tier::from));
    let traces = reports.trace.to_vec();
    let setup_of_run = RunSetup { config: options.config(), traces, folders, program_file, schedule: None };
    run.begin(&program, &setup_of_run, &machine).map_err(refuse)?;
    if let Some(status) = run.ended() {
        complain(format_args!(
            "the run in {} has ended with status {status}; to run the program again, remove the folder",
            folder.display()
        ));
        return Ok(status);
    }
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let managed = tell_manager(&machine, &name)?;
    let started = std::time::Instant::now();
    let main = program::begin(&mut machine, &program).map_err(setup)?;
    let outcome = machine.run(u64::MAX);
    run.check().map_err(refuse)?;
    if run.control().begin_end() {
        run.pause(&machine).map_err(refuse)?;
        complain("paused; the same command goes on");
        std::mem::forget(machine);
        return Ok(SUCCESS);
    }
    let summary = program::finish(&mut machine, main, outcome);
    drop(managed);
    run.check().map_err(refuse)?;
    let status = summary.ended.exit_status();
    run.end(&machine, status).map_err(refuse)?;
    match summary.ended {
        program::Ended::BudgetSpent => {
            complain(format_args!(
                "the budget of {} ticks is spent",
                options.budget.unwrap_or(summary.ticks)
            ));
        }
        program::Ended::Signalled(signal) => complain_of_signal(signal),
        _ => {}
    }
    if reports.stats.is_some() {
        print_stats(&machine, &summary, started.elapsed().as_secs_f64());
    }
    // The process ends here: giving the memory back piece by piece would only take time.
    std::mem::forget(machine);
    Ok(status)
}

/// Reports that a run goes on, and the number of things that are gone with the earlier process.
fn say_resumed(resumed: &Resumed) {
    let Resumed { life, downtime, interrupted, lost } = *resumed;
    let mut text =
        format!("the run goes on in process {}, {downtime:.1} s after the last record", life.number);
    if interrupted > 0 {
        text += &format!("; calls interrupted: {interrupted}");
    }
    if lost > 0 {
        text += &format!(
            "; closed connections and servers that signalled inputs: {lost}; the program has to open them again"
        );
    }
    complain(text);
}

/// Shows a durable run at the end of its journal. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_state(options: &LookOptions) -> Result<u8, u8> {
    let mut state = look(&options.folder).map_err(|error| refused(&error))?;
    match &options.facts {
        Some(name) => print_facts(&mut state, name),
        None => {
            print_state(&mut state);
            Ok(SUCCESS)
        }
    }
}

/// Prints the facts of a relation. Returns the exit status.
fn print_facts(state: &mut DurableState, name: &str) -> Result<u8, u8> {
    let name = name.to_uppercase();
    let mut count = 0;
    loop {
        let request =
            SurveyRequest { data: true, facts: Some((name.clone(), count)), ..SurveyRequest::default() };
        let survey = state.survey(&request);
        if !survey.relations.iter().any(|relation| relation.name == name) {
            let known: Vec<String> = survey
                .relations
                .iter()
                .map(|relation| format!("`{}`", relation.name.to_lowercase()))
                .collect();
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            complain(format_args!(
                "the run has no facts called `{}`; its relations: {known}",
                name.to_lowercase()
            ));
            return Err(USAGE);
        }
        if survey.facts.is_empty() {
            return Ok(SUCCESS);
        }
        count += survey.facts.len();
        for fact in &survey.facts {
            say!("{fact}");
        }
    }
}

fn print_state(state: &mut DurableState) {
    let survey = state.survey(&SurveyRequest { data: true, ..SurveyRequest::default() });
    let file = state.program_file.first().map_or("standard input", String::as_str);
    let lives = state.lives.iter().filter(|life| !life.is_pause).count();
    let standing = match (state.ended, state.lives.last()) {
        (Some(status), _) => format!("ended with status {status}"),
        (None, Some(last)) if last.is_pause => "paused".into(),
        _ => "cut off".into(),
    };
    let facts: usize = survey.relations.iter().map(|relation| relation.facts).sum();
    say!("program: {file}");
    say!("machine: {}", state.identity);
    say!("run: {standing}, tick {}, process {lives}", state.ticks);
    say!("tasks: {}", survey.figures.tasks.iter().sum::<u64>());
    say!("facts: {facts} in {} relations", survey.relations.len());
    say!(
        "journal: {} records, {} effects, {} bytes{}",
        state.records,
        state.effects,
        state.bytes,
        if state.torn > 0 { format!(", and {} bytes that are cut off", state.torn) } else { String::new() }
    );
    if let Some(written) = state.written {
        let since = SystemTime::now().duration_since(written).unwrap_or(Duration::ZERO);
        let date = written.duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
        say!("written: {} s ago, {date} s since 1970", since.as_secs());
    }
    say!("verified: the run takes the course of its journal");
}
