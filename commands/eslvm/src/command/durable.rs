//! `eslvm run --state`: durable runs.

use std::path::Path;

use clap::Args;
use esl::host::{ProcessSignal, RealHost};
use esl::module_path::ModulePath;
use esl::program::{self, Instrumentation};
use esl_command::{DIVERGED, NOT_COMPILED, SUCCESS, USAGE, complain};
use esl_durable::{
    Downtime, Durability, DurableError, DurableOptions, DurableRun, KeptFacts, Resumed, SnapshotEvery,
    UpgradeReport,
};
use esl_replay::{RecordedError, RunSetup};
use esl_vm::vm::Tier;

use super::figures::{print_snapshots, print_stats};
use super::options::ClockChoice;
use super::program::{complain_of_signal, program_with_sources};
use super::run::RunOptions;
use crate::operate::tell_manager;
use crate::signal::{SignalTarget, end_on_signal_unless};

/// Things missing in the facts of an earlier run that are named.
const LEFT_OUT: usize = 5;

/// Options of a durable run.
#[derive(Args)]
pub(crate) struct StateOptions {
    /// Make the run durable: keep its journal in this folder, or go on with the run of this folder. Needs the
    /// same program each time
    #[arg(long, value_name = "FOLDER", conflicts_with_all = [
        "schedule", "record", "coverage", "profile", "timeline", "mcap", "foxglove",
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
    /// Store the machine after so much time or journal, such as 60s or 64M, so that the next process need not
    /// repeat all before; `never` for not at all. Without this, once a minute in which much has happened
    #[arg(long, value_name = "WHEN", requires = "state")]
    pub(crate) snapshot_every: Option<SnapshotEvery>,
    /// Make the changed definitions of the program in the durable run, before it goes on, if its program is
    /// another one
    #[arg(long, requires = "state")]
    pub(crate) upgrade: bool,
    /// If the durable run is of another version of eslvm, begin its program anew, with its facts and the
    /// variables of DEFDURABLE as they were at the last pause or snapshot
    #[arg(long, requires = "state")]
    pub(crate) from_facts: bool,
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

/// Prints why a durable run cannot begin, or go on. Returns the exit status.
pub(super) fn refused(error: &DurableError) -> u8 {
    complain(error);
    match error {
        DurableError::Diverged(_) => DIVERGED,
        DurableError::Journal(RecordedError::OtherMachine | RecordedError::Format(_))
        | DurableError::NoFacts => DIVERGED,
        DurableError::Journal(_) | DurableError::Program(_) => NOT_COMPILED,
        _ => USAGE,
    }
}

/// Begins a durable run of the program in a file, or goes on with it. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_durable(
    folder: &Path,
    command: &RunOptions,
    mut host: RealHost,
    path: &ModulePath,
) -> Result<u8, u8> {
    let RunOptions { machine: options, durable: state, file, arguments, .. } = command;
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
    let snapshots = state.snapshot_every.unwrap_or_default();
    let options_of_run =
        DurableOptions { durability, downtime, snapshots, hosted: None, from_facts: state.from_facts };
    let mut run = DurableRun::open(folder, options_of_run).map_err(refuse)?;
    if let Some(kept) = run.kept_facts() {
        say_kept(kept);
    }
    run.warnings().iter().for_each(complain);
    run.control().on_warning(|text| complain(text));
    let (signals, control) = (SignalTarget::default(), run.control());
    let pauses = state.on_term == OnTerm::Pause;
    end_on_signal_unless(signals.clone(), move |signal| {
        pauses && signal == ProcessSignal::Terminate && control.pause()
    });
    run.control().on_resume(say_resumed);
    run.control().on_upgrade(say_upgraded);
    let (program, sources, _) =
        program_with_sources(file, path, options, Instrumentation::None, command.compiling.quiet, &signals)?;
    let program = run.choose_program(&program, &sources, state.upgrade).map_err(refuse)?;
    if run.arguments().is_some_and(|known| known != arguments.as_slice()) {
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
    let mut machine = program::machine(run.config(options.config()), Box::new(host)).map_err(setup)?;
    // That part of the library makes upgrades.
    program::load_operators(&mut machine).map_err(setup)?;
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
    program::set_traces(&mut machine, &command.trace).map_err(setup)?;
    run.prepare(&mut machine).map_err(refuse)?;
    if command.stats.is_some() {
        machine.gather_figures(false);
    }
    machine.set_tier(command.tier.map_or(Tier::Auto, Tier::from));
    let traces = command.trace.clone();
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
    let served = command.operate.begin(&mut machine, &name)?;
    let managed = tell_manager(&machine, &name)?;
    let started = std::time::Instant::now();
    let main = match run.restore(&mut machine).map_err(refuse)? {
        Some(main) => main,
        None => program::begin(&mut machine, &program).map_err(setup)?,
    };
    run.take_snapshots(&mut machine);
    let outcome = machine.run(u64::MAX);
    run.check().map_err(refuse)?;
    if run.control().begin_end() {
        run.pause(&machine).map_err(refuse)?;
        complain("paused; the same command goes on");
        std::mem::forget(machine);
        return Ok(SUCCESS);
    }
    let summary = program::finish(&mut machine, main, outcome);
    run.check().map_err(refuse)?;
    let status = summary.ended.exit_status();
    served.end(&machine, summary.ended, status, summary.report.as_deref());
    drop((served, managed));
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
    if command.stats.is_some() {
        print_stats(&machine, &summary, started.elapsed().as_secs_f64());
        print_snapshots(run.snapshot_figures());
    }
    // The process ends here: giving the memory back piece by piece would only take time.
    std::mem::forget(machine);
    Ok(status)
}

/// Reports that a run goes on, and the number of things that are gone with the earlier process.
fn say_resumed(resumed: &Resumed) {
    let Resumed { life, downtime, interrupted, lost, again } = *resumed;
    let mut text =
        format!("the run goes on in process {}, {downtime:.1} s after the last record", life.number);
    if interrupted > 0 {
        text += &format!("; calls interrupted: {interrupted}");
    }
    if again > 0 {
        text += "; servers, clients and subscriptions are opened again";
    } else if lost > 0 {
        text += &format!(
            "; gone: {lost} connections or operators that signalled inputs; the program has to open its own again"
        );
    }
    complain(text);
}

/// Reports the facts from which a run begins anew.
fn say_kept(kept: &KeptFacts) {
    let (facts, variables) = (counted(kept.facts, "fact"), counted(kept.variables, "variable"));
    let when = if kept.is_pause { "its pause" } else { "a snapshot, behind which it went on" };
    complain(format_args!(
        "the run was begun by another version of eslvm, and begins anew with {facts} and {variables}, as at {when}, \
         {:.1} s ago; its files are in {}",
        kept.seconds,
        kept.earlier.display()
    ));
    for what in kept.left_out.iter().take(LEFT_OUT) {
        complain(format_args!("missing: {what}"));
    }
    if kept.left_out.len() > LEFT_OUT {
        complain(format_args!("missing: {} more", kept.left_out.len() - LEFT_OUT));
    }
}

/// Reports the effects of an upgrade.
fn say_upgraded(report: &UpgradeReport) {
    complain(upgrade_text("upgraded", report));
}

/// Returns a number of things.
pub(super) fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Returns a text about an upgrade that is or would be made.
pub(super) fn upgrade_text(made: &str, report: &UpgradeReport) -> String {
    let mut text = format!("{made}: {}", counted(report.definitions, "definition"));
    if report.structures > 0 {
        text += &format!(", new slots in {}", counted(report.structures, "structure"));
    }
    if !report.left_out.is_empty() {
        let first_line = |form: &String| {
            let line = form.lines().next().unwrap_or_default();
            if form.lines().count() > 1 { format!("`{line} …`") } else { format!("`{line}`") }
        };
        let forms: Vec<String> = report.left_out.iter().take(4).map(first_line).collect();
        let more = if report.left_out.len() > forms.len() { " and others" } else { "" };
        text += &format!("; not definitions, and not run: {}{more}", forms.join(", "));
    }
    text
}
