//! `eslvm run`.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::{Args, Parser};
use esl::host::{Host, RealHost, RecordingHost};
use esl::module_path::ModulePath;
use esl::program::{self, Ended, Instrumentation, Program, Schedule};
use esl_command::{USAGE, complain, refuse_overwriting, say_error, say_error_part};
use esl_replay::{FileRecorder, RunSetup};
use esl_timeline::Timeline;
use esl_vm::vm::Tier;

use super::durable::{StateOptions, run_durable};
use super::figures::{print_functions, print_stats, print_tasks};
use super::options::{ClockChoice, CompilingOptions, MachineOptions, Stats, TierChoice};
use super::parse::parse_speed;
use super::program::{complain_of_signal, program};
use super::realtime::react_in_time;
use crate::explore::read_schedule;
use crate::fleet::AgentOptions;
use crate::mcap::{McapRecording, RunFileOptions};
use crate::operate::{OperateOptions, mission_of, tell_manager};
use crate::profile::{INTERVAL, Profile, ProfileUnit};
use crate::signal::{SignalTarget, end_on_signal};

/// Arguments of `run`.
#[derive(Args)]
pub(crate) struct RunOptions {
    #[command(flatten)]
    pub(crate) machine: MachineOptions,
    #[command(flatten)]
    pub(crate) compiling: CompilingOptions,
    /// Seconds of the program's clock in a second of real time,
    /// for a program connected to a simulator
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = parse_speed)]
    pub(crate) speed: f64,
    /// Print figures of the run to standard error at its end; with `=tasks` or `=functions`, also of
    /// those with most ticks; with `=coverage`, also what was not run
    #[arg(long, value_name = "WHAT", num_args = 0..=1, require_equals = true, default_missing_value = "run")]
    pub(crate) stats: Option<Stats>,
    /// Execution of functions, which changes nothing in the run: by the interpreter, all as machine code,
    /// or hot ones as machine code, the default. A build without the cargo feature `native` interprets
    /// all, and reports that the option has no effect
    #[arg(long, value_enum, value_name = "TIER", conflicts_with = "schedule")]
    pub(crate) tier: Option<TierChoice>,
    /// Let the run react in time, as far as the system permits it: lock its memory, and run it before
    /// other programs, with a priority from 1 to 99, by default 50
    #[arg(long, value_name = "PRIORITY", num_args = 0..=1, require_equals = true, default_missing_value = "50")]
    #[arg(value_parser = clap::value_parser!(u8).range(1..=99), conflicts_with_all = ["schedule", "state"])]
    pub(crate) realtime: Option<u8>,
    /// Write a timeline of the tasks to a file: a drawing if its name ends in `.svg`, else a trace for
    /// Perfetto
    #[arg(long, value_name = "FILE")]
    pub(crate) timeline: Option<PathBuf>,
    /// Run the program by a schedule that `eslvm explore` has written; its clock is virtual then
    #[arg(long, value_name = "FILE")]
    pub(crate) schedule: Option<PathBuf>,
    /// Record the run in a file, for `eslvm replay`: the program, and everything that reaches it
    #[arg(long, value_name = "FILE")]
    pub(crate) record: Option<PathBuf>,
    /// Write a profile of ticks and time by task, call and line to a file: a flame graph if its name ends
    /// in `.svg`, for speedscope if it ends in `.json`, else a line for each stack
    #[arg(long, value_name = "FILE", conflicts_with = "schedule")]
    pub(crate) profile: Option<PathBuf>,
    /// Unit of a flame graph and of lines of stacks; data for speedscope have both units
    #[arg(long, value_enum, default_value_t = ProfileUnit::Ticks, value_name = "UNIT")]
    #[arg(requires = "profile")]
    pub(crate) profile_unit: ProfileUnit,
    /// Write the coverage of lines, functions and arms to a file, in the format of lcov
    #[arg(long, value_name = "FILE", conflicts_with_all = ["schedule", "record"])]
    pub(crate) coverage: Option<PathBuf>,
    /// Trace failures, goals or tasks on standard error: a list such as failures,tasks
    #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = ["failures", "goals", "tasks"])]
    pub(crate) trace: Vec<String>,
    /// Show all calls of the library in reports of failures, which are folded otherwise
    #[arg(long)]
    pub(crate) full: bool,
    #[command(flatten)]
    pub(crate) agent: AgentOptions,
    #[command(flatten)]
    pub(crate) files: RunFileOptions,
    #[command(flatten)]
    pub(crate) operate: OperateOptions,
    #[command(flatten)]
    pub(crate) durable: StateOptions,
    /// Source or bytecode file; `-` is a source from standard input
    pub(crate) file: PathBuf,
    /// Arguments of the program
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARG")]
    pub(crate) arguments: Vec<String>,
}

/// The command line of `run` alone, which is made in a fraction of the time that all of them take.
#[derive(Parser)]
pub(crate) struct RunAlone {
    #[command(flatten)]
    pub(crate) options: RunOptions,
}

/// Runs a program as these options say. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_command(mut run: RunOptions) -> Result<u8, u8> {
    if run.schedule.is_some() {
        run.machine.clock = ClockChoice::Virtual;
    }
    if run.full {
        run.trace.push("full".into());
    }
    #[cfg(feature = "robots")]
    if run.speed != 1.0 && run.machine.clock == ClockChoice::Ros {
        complain("`--speed` has no effect on the clock of ROS: leave it out");
        return Err(USAGE);
    }
    if run.realtime.is_some() && run.machine.clock == ClockChoice::Virtual {
        complain("`--realtime` has no effect on a virtual clock: leave it out");
        return Err(USAGE);
    }
    run.agent.install()?;
    let path = ModulePath::new([run.file.as_path()], &run.compiling.modules.library);
    let rights = path.with_rights(run.machine.rights.rights()?);
    let host = RealHost::new(run.arguments.clone()).with_rights(rights).with_speed(run.speed);
    match &run.durable.state {
        Some(folder) => run_durable(folder, &run, host, &path),
        None => run_once(&run, host, &path),
    }
}

/// Runs the program in a file, or the source in it. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
fn run_once(run: &RunOptions, mut host: RealHost, path: &ModulePath) -> Result<u8, u8> {
    let RunOptions { machine: options, file, stats, tier, operate, files, trace, .. } = run;
    let (stats, is_quiet) = (*stats, run.compiling.quiet);
    let [timeline, profile, coverage, record] =
        [&run.timeline, &run.profile, &run.coverage, &run.record].map(|path| path.as_deref());
    let schedule = run.schedule.as_deref().map(read_schedule).transpose()?;
    let schedule = schedule.as_ref();
    for output in [timeline, profile, coverage, record, files.mcap.as_deref()].into_iter().flatten() {
        refuse_overwriting(output, [file.as_path()])?;
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
    if let Some(priority) = run.realtime {
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
        && let Err(error) = found.write(path, run.profile_unit)
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
