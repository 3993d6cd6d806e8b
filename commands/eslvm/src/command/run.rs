//! `eslvm run`.

use std::io::ErrorKind;
use std::path::Path;

use esl::host::{Host, RealHost, RecordingHost};
use esl::module_path::ModulePath;
use esl::program::{self, Ended, Instrumentation, Program, Schedule};
use esl_command::{USAGE, complain, refuse_overwriting, say_error, say_error_part};
use esl_replay::{FileRecorder, RunSetup};
use esl_timeline::Timeline;
use esl_vm::vm::Tier;

use super::figures::{print_functions, print_stats, print_tasks};
use super::options::{ClockChoice, MachineOptions, Stats, TierChoice};
use super::program::{complain_of_signal, program};
use super::realtime::react_in_time;
use crate::mcap::{McapRecording, RunFileOptions};
use crate::operate::{OperateOptions, mission_of, tell_manager};
use crate::profile::{INTERVAL, Profile, ProfileUnit};
use crate::signal::{SignalTarget, end_on_signal};

/// The requested reports of a run.
pub(crate) struct RunReports<'a> {
    pub(crate) stats: Option<Stats>,
    pub(crate) tier: Option<TierChoice>,
    pub(crate) realtime: Option<u8>,
    pub(crate) timeline: Option<&'a Path>,
    pub(crate) record: Option<&'a Path>,
    pub(crate) files: &'a RunFileOptions,
    pub(crate) profile: Option<&'a Path>,
    pub(crate) profile_unit: ProfileUnit,
    pub(crate) coverage: Option<&'a Path>,
    pub(crate) trace: &'a [String],
    pub(crate) operate: &'a OperateOptions,
    pub(crate) is_quiet: bool,
}

/// Runs the program in a file, or the source in it. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run(
    file: &Path,
    mut host: RealHost,
    options: &MachineOptions,
    reports: &RunReports<'_>,
    schedule: Option<&Schedule>,
    path: &ModulePath,
) -> Result<u8, u8> {
    let RunReports {
        stats,
        tier,
        realtime,
        timeline,
        profile,
        profile_unit,
        coverage,
        record,
        files,
        trace,
        operate,
        is_quiet,
    } = *reports;
    for output in [timeline, profile, coverage, record, files.mcap.as_deref()].into_iter().flatten() {
        refuse_overwriting(output, [file])?;
    }
    let signals = SignalTarget::default();
    end_on_signal(signals.clone());
    let is_covered = coverage.is_some() || stats == Some(Stats::Coverage);
    let instrumentation = match schedule {
        Some(schedule) if schedule.is_strict() => Instrumentation::Points,
        _ if is_covered => Instrumentation::Passages,
        _ => Instrumentation::None,
    };
    let (program, mut covered) = program(file, path, options, instrumentation, is_quiet, &signals)?;
    let setup = |error| {
        complain(error);
        USAGE
    };
    if let Some(schedule) = schedule {
        refuse_other(schedule, &program)?;
    }
    match options.clock {
        ClockChoice::Real => {}
        ClockChoice::Virtual => host = host.with_virtual_time(),
        #[cfg(feature = "robots")]
        ClockChoice::Ros => host = host.with_external_time(),
    }
    let recording = match record {
        Some(path) => Some((FileRecorder::create(path).map_err(|error| not_written(path, &error))?, path)),
        None => None,
    };
    let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
    let mcap = McapRecording::begin(files, &name, &mut host)?;
    let recorder = recording.as_ref().map(|(recorder, _)| recorder);
    let host: Box<dyn Host + Send> = match &mcap {
        Some(mcap) => recorded(mcap.host(host), recorder),
        None => recorded(host, recorder),
    };
    let mut machine = program::machine(options.config(), host).map_err(setup)?;
    operate.prepare(&mut machine)?;
    if options.clock != ClockChoice::Virtual {
        esl_world::install_operations(&mut machine);
    }
    signals.set(machine.inbox());
    program::set_module_path(&mut machine, path).map_err(setup)?;
    program::set_traces(&mut machine, trace).map_err(setup)?;
    if let Some(stats) = stats {
        machine.gather_figures(stats == Stats::Tasks);
    }
    let timeline = match timeline {
        Some(path) => {
            Some((Timeline::begin(path, &mut machine).map_err(|error| not_written(path, &error))?, path))
        }
        None => None,
    };
    if let Some(mcap) = &mcap {
        mcap.watch(&mut machine);
    }
    if is_covered {
        machine.count_passages();
    }
    // Runs by a schedule end within few turns.
    let default = if schedule.is_some() { Tier::Interpreter } else { Tier::Auto };
    machine.set_tier(tier.map_or(default, Tier::from));
    if let (Some(_), Some(reason)) = (tier, &machine.tier().1.refused) {
        say_error!("eslvm: --tier has no effect: {reason}");
    }
    let served = operate.begin_with(&mut machine, &name, Some(mission_of(file, path)))?;
    if let Some((recorder, path_of_record)) = &recording {
        let folders = path.folders().iter().map(|folder| folder.to_string_lossy().into_owned()).collect();
        let schedule = schedule.cloned();
        let (traces, program_file) = (trace.to_vec(), path.program_file());
        let setup = RunSetup { config: options.config(), traces, folders, program_file, schedule };
        let beginning = esl_replay::beginning(&program, &setup, &machine).map_err(|error| {
            complain(format_args!("{} cannot be recorded: {error}", path_of_record.display()));
            USAGE
        })?;
        recorder.begin(&beginning);
    }
    let managed = tell_manager(&machine, &name)?;
    if let Some(priority) = realtime {
        react_in_time(priority, options.config().memory);
    }
    let started = std::time::Instant::now();
    let is_profiled = profile.is_some() || stats == Some(Stats::Functions);
    let mut found = is_profiled.then(|| Profile::begin(&mut machine));
    let summary = match schedule {
        Some(schedule) => program::run_by(&mut machine, &program, &schedule.settings(), schedule.choices()),
        None => match &mut found {
            Some(found) => program::run_in_portions(&mut machine, &program, INTERVAL, &mut |machine| {
                found.sample(machine)
            }),
            None => program::run_in(&mut machine, &program),
        },
    };
    let summary = summary.map_err(setup)?;
    let seconds = started.elapsed().as_secs_f64();
    let mut status = summary.ended.exit_status();
    served.end(&machine, summary.ended, status, summary.report.as_deref());
    drop((served, managed));
    if let Some(found) = &mut found {
        found.end(&mut machine);
    }
    if let Some((recorder, path)) = recording
        && let Err(error) = recorder.end(&machine, status)
    {
        match error.kind() {
            // Nothing that the program has done is wrong.
            ErrorKind::OutOfMemory => complain(format_args!("{} is not whole: {error}", path.display())),
            _ => status = not_written(path, &error),
        }
    }
    if let Some((timeline, path)) = timeline
        && let Err(error) = timeline.end(&mut machine)
    {
        status = not_written(path, &error);
    }
    if let Some(mcap) = mcap
        && let Err(refused) = mcap.end(&mut machine)
    {
        status = refused;
    }
    if let (Some(path), Some(found)) = (profile, &found)
        && let Err(error) = found.write(path, profile_unit)
    {
        status = not_written(path, &error);
    }
    if let Some(covered) = &mut covered {
        covered.add(&machine.take_passages());
    }
    let covered = covered.map(|covered| covered.report());
    if let (Some(path), Some(report)) = (coverage, &covered)
        && let Err(error) = std::fs::write(path, report.lcov())
    {
        status = not_written(path, &error);
    }
    match summary.ended {
        Ended::BudgetSpent => {
            let budget = options.budget.unwrap_or(summary.ticks);
            complain(format_args!("the budget of {budget} ticks is spent"));
        }
        Ended::Signalled(signal) => complain_of_signal(signal),
        _ => {}
    }
    if let Some(stats) = stats {
        print_stats(&machine, &summary, seconds);
        if stats == Stats::Tasks {
            print_tasks(&machine);
        }
        if let (Stats::Functions, Some(found)) = (stats, &found) {
            print_functions(found);
        }
        if let (Stats::Coverage, Some(report)) = (stats, &covered) {
            say_error_part!("\n{}", report.table());
        }
    }
    // The process ends here: giving the memory back piece by piece would only take time.
    std::mem::forget(machine);
    Ok(status)
}

/// Returns a host whose answers are recorded, if there is a recorder.
fn recorded(host: impl Host + Send + 'static, recorder: Option<&FileRecorder>) -> Box<dyn Host + Send> {
    match recorder {
        Some(recorder) => Box::new(RecordingHost::with_recorder(host, recorder.clone())),
        None => Box::new(host),
    }
}

/// Refuses a schedule that was not found in this program, or not by this machine.
fn refuse_other(schedule: &Schedule, program: &Program) -> Result<(), u8> {
    let found_by = match (schedule.is_of(program), schedule.is_of_this_machine()) {
        (true, true) => return Ok(()),
        (false, _) => "in another program, or in another version of this one",
        (true, false) => "by another version of eslvm",
    };
    complain(format_args!("the schedule was found {found_by}: explore again"));
    Err(USAGE)
}

/// Prints that a file could not be written, and returns the exit status.
fn not_written(path: &Path, error: &std::io::Error) -> u8 {
    complain(format_args!("{} cannot be written: {error}", path.display()));
    USAGE
}
