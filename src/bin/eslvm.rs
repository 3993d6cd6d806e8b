//! `eslvm`: runs ESL programs, and the REPL.
#![forbid(unsafe_code)]
#![allow(clippy::print_stderr, reason = "commands print")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, CommandFactory, Parser, Subcommand};
use esl::Config;
use esl::command::{self, NOT_COMPILED, ProgramFile, RightsOptions, SignalTarget, USAGE, complain};
use esl::coverage::{self, Coverage};
use esl::explore::{self, Schedule};
use esl::host::{Host, ProcessSignal, RealHost, RecordingHost};
use esl::module_path::ModulePath;
use esl::operate::OperateOptions;
use esl::profile::{INTERVAL, Profile};
use esl::program::{self, Compiled, Ended, Modules, Program, Summary};
use esl::repl::AttachSecurity;
use esl::replay::{self, FileRecorder, ReplayOptions, RunSetup};
use esl::testing;
use esl::timeline::Timeline;
use esl_compiler::diagnostic::{Format, Renderer};
use esl_vm::value::Value;
use esl_vm::vm::{Tier, Vm};

/// Functions whose figures are printed, at most.
const SHOWN_FUNCTIONS: usize = 40;

/// The virtual machine of ESL, the Execution Support Language.
#[derive(Parser)]
#[command(name = "eslvm", version, propagate_version = true, max_term_width = 100)]
struct Eslvm {
    #[command(subcommand)]
    action: EslvmAction,
    /// Folder to search for required modules, after the folder of the program and before those of
    /// ESL_LIBRARY
    #[arg(long, value_name = "FOLDER", global = true)]
    library: Vec<PathBuf>,
    /// Do not say at a terminal how far a long compilation, test or exploration is
    #[arg(long, short, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
#[allow(clippy::large_enum_variant, reason = "there is one, which is made once")]
enum EslvmAction {
    /// Run a program
    ///
    /// Exit status: 0 success, or the status that the program asks for; 1 a failure left the main task; 2
    /// wrong usage, or a file that cannot be read or written; 3 the program does not compile or is refused;
    /// 4 no task can ever run again; 5 the budget or the memory is spent; 129, 130, 143 ended by SIGHUP,
    /// SIGINT or SIGTERM. However the run ends, the cleanups of its tasks are run.
    Run {
        #[command(flatten)]
        options: MachineOptions,
        /// Seconds of the program's clock in a second of real time:
        /// for a program whose outside is a simulator
        #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = parse_speed)]
        speed: f64,
        /// Print figures of the run to standard error at its end; with `=tasks` or `=functions`, also of
        /// those with most ticks; with `=coverage`, also what was not run
        #[arg(long, value_name = "WHAT", num_args = 0..=1, require_equals = true, default_missing_value = "run")]
        stats: Option<Stats>,
        /// How functions run, which no program can tell: by the interpreter, all as machine code, or as
        /// machine code those that are hot. A build without the code generator interprets all, and --stats
        /// says so
        #[arg(long, value_enum, default_value_t = TierChoice::Interpreter, value_name = "TIER")]
        #[arg(conflicts_with = "schedule")]
        tier: TierChoice,
        /// Write a timeline of the tasks to a file: a drawing if its name ends in `.svg`, else a trace for
        /// Perfetto
        #[arg(long, value_name = "FILE")]
        timeline: Option<PathBuf>,
        /// Run the program by a schedule that `eslvm explore` has written; its clock is virtual then
        #[arg(long, value_name = "FILE")]
        schedule: Option<PathBuf>,
        /// Record the run in a file, for `eslvm replay`: the program, and everything that reaches it
        #[arg(long, value_name = "FILE", conflicts_with = "schedule")]
        record: Option<PathBuf>,
        /// Write to a file which calls and lines have used the ticks: a flame graph if its name ends in
        /// `.svg`, for speedscope if it ends in `.json`, else a line for each stack
        #[arg(long, value_name = "FILE", conflicts_with = "schedule")]
        profile: Option<PathBuf>,
        /// Write to a file, in the form of lcov, how often each line, function and arm was run
        #[arg(long, value_name = "FILE", conflicts_with_all = ["schedule", "record"])]
        coverage: Option<PathBuf>,
        /// Trace failures, goals or tasks on standard error: a list such as failures,tasks
        #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = ["failures", "goals", "tasks"])]
        trace: Vec<String>,
        #[command(flatten)]
        operate: OperateOptions,
        /// Source or bytecode file; `-` is a source from standard input
        file: PathBuf,
        /// Arguments of the program
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARG")]
        arguments: Vec<String>,
    },
    /// Run a recorded run again, forwards and backwards
    ///
    /// Needs neither the sources nor the world of the program, and waits for nothing. With --until or
    /// --break the replay stops there and takes commands from standard input: `help` lists them. Exit
    /// status: that of the recorded run; 0 if the recording ends before the run, or after commands; 2 wrong
    /// usage, or a file that cannot be read; 3 the recording is damaged or of another version; 6 the replay
    /// has diverged.
    Replay {
        #[command(flatten)]
        options: ReplayOptions,
    },
    /// Run the tests of programs
    ///
    /// Each test (`deftest`) runs in a machine of its own, whose clock is virtual. Exit status: 0 all
    /// passed; 1 a test failed; 2 wrong usage, or a file that cannot be read or written; 3 a file does not
    /// compile or is refused.
    Test {
        /// Only tests whose names contain this word, in any case
        #[arg(long, value_name = "WORD")]
        filter: Option<String>,
        /// Number of tests that run at the same time; as many as there are processors if it is missing
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
        jobs: Option<u16>,
        /// Run each test with this seed only
        #[arg(long, value_name = "N")]
        seed: Option<u64>,
        /// Write a report in the form of JUnit to a file
        #[arg(long, value_name = "FILE")]
        junit: Option<PathBuf>,
        /// Write to a file, in the form of lcov, how often each line, function and arm was run, and print
        /// what was not
        #[arg(long, value_name = "FILE")]
        coverage: Option<PathBuf>,
        /// Most ticks of a run of a test
        #[arg(long, value_name = "TICKS", default_value_t = 1_000_000_000)]
        budget: u64,
        /// Most memory for objects of a test, such as 64M or 2G
        #[arg(long, value_name = "SIZE", default_value = "1G", value_parser = command::parse_size)]
        memory: usize,
        #[command(flatten)]
        rights: RightsOptions,
        /// Source or bytecode files
        #[arg(required = true, value_name = "FILE")]
        sources: Vec<PathBuf>,
    },
    /// Run a program under all schedules
    ///
    /// Lets the tasks of the program take turns in every possible order, and tells of those orders that end
    /// badly: by a deadlock, a failure of the main task, a status other than 0. Writes each as a schedule,
    /// which `eslvm run --schedule` repeats. Exit status: 0 no schedule ends badly; 1 one does; 2 wrong
    /// usage, or a file that cannot be read or written; 3 the program does not compile or is refused; 7
    /// none was found, and not all were tried.
    Explore {
        #[command(flatten)]
        options: ExploreArguments,
        /// Source or bytecode file
        file: PathBuf,
    },
    /// Attach to a run that was begun with --listen
    ///
    /// Lines are typed here as in the REPL, and evaluated in the run, which goes on meanwhile and
    /// afterwards; `:help` lists commands. Exit status: 0 the session has ended; 1 the run has; 2 no run
    /// can be reached, or it refuses the secret; 3 the last form is incomplete.
    Attach {
        /// File with the secret that a port asks for; otherwise it is that of the environment variable
        /// ESL_SECRET
        #[arg(long, value_name = "FILE")]
        secret_file: Option<PathBuf>,
        /// Speak TLS, as a run does that was begun with --certificate
        #[arg(long)]
        tls: bool,
        /// The same, with a run whose certificate is in this file, in PEM, or signed by one of it
        #[arg(long, value_name = "FILE")]
        ca_file: Option<PathBuf>,
        /// Path or port that was given to --listen
        #[arg(value_name = "PATH|[ADDRESS:]PORT")]
        address: String,
    },
    /// Read forms, evaluate them and print their values
    Repl {
        #[command(flatten)]
        options: MachineOptions,
    },
    /// Print the completions for a shell
    ///
    /// For bash: eslvm completions bash > ~/.local/share/bash-completion/completions/eslvm
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages, in the form of `man`
    Man {
        /// Folder to write them to, one page for each subcommand; without it, the first page is printed
        folder: Option<PathBuf>,
    },
}

/// Subject of the figures that are printed.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Stats {
    /// The run
    Run,
    /// The run and its tasks
    Tasks,
    /// The run and its functions
    Functions,
    /// The run, and which lines and arms of the program it has not reached
    Coverage,
}

/// How functions run.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TierChoice {
    /// By the interpreter
    Interpreter,
    /// All as machine code, from their second call on
    Native,
    /// As machine code those that are hot
    Auto,
}

impl From<TierChoice> for Tier {
    fn from(choice: TierChoice) -> Tier {
        match choice {
            TierChoice::Interpreter => Tier::Interpreter,
            TierChoice::Native => Tier::Native,
            TierChoice::Auto => Tier::Auto,
        }
    }
}

/// Clock of a program.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ClockChoice {
    /// Real time
    Real,
    /// Time that stands still until all tasks wait, and then jumps to the first time that one waits for
    Virtual,
}

#[derive(Args)]
struct MachineOptions {
    /// Clock of the program
    #[arg(long, value_enum, default_value = "real")]
    clock: ClockChoice,
    /// Seed of the choices that the language leaves open, such as which task runs next
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Ticks that a task runs before the next task has its turn
    #[arg(long, value_name = "TICKS", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000_000))]
    slice: u32,
    /// End the run with status 5 after this many ticks
    #[arg(long, value_name = "TICKS")]
    budget: Option<u64>,
    /// Most memory for objects, such as 64M or 2G
    #[arg(long, value_name = "SIZE", default_value = "1G", value_parser = command::parse_size)]
    memory: usize,
    /// Most seconds that the cleanups of an aborted task may take, also at the end of the run
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    cleanup_time: u32,
    /// Most memory for the stack of a task, such as 16M; half of --memory without it
    #[arg(long, value_name = "SIZE", value_parser = command::parse_stack)]
    stack: Option<usize>,
    #[command(flatten)]
    rights: RightsOptions,
}

impl MachineOptions {
    fn config(&self) -> Config {
        Config {
            memory: self.memory,
            stack: self.stack.map(|bytes| bytes / size_of::<Value>()),
            slice: self.slice,
            budget: self.budget,
            seed: self.seed,
            cleanup_time: u64::from(self.cleanup_time) * 1_000_000_000,
            ..Config::default()
        }
    }
}

#[derive(Args)]
struct ExploreArguments {
    /// Where a task may have to let others go first: before what others can see (changes), or also before
    /// it looks at what others do (reads)
    #[arg(long, value_enum, default_value = "changes")]
    grain: GrainChoice,
    /// Most states
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    states: u64,
    /// Most memory of the exploration, for states and for snapshots, such as 64M or 2G; less makes it slower
    #[arg(long, value_name = "SIZE", default_value = "512M", value_parser = command::parse_size)]
    memory: usize,
    /// Most seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    time: u32,
    /// When timers end: when all tasks wait (idle), or at any point, as if what tasks do took so long (any)
    #[arg(long, value_enum, default_value = "idle")]
    timers: TimersChoice,
    /// Most switches of a schedule: points at which a task that could go on lets another one go first
    #[arg(long, value_name = "N")]
    switches: Option<usize>,
    /// Most times that CHOOSE takes another form than its first
    #[arg(long, value_name = "N")]
    faults: Option<usize>,
    /// Write a timeline of the first finding to a file: a drawing if its name ends in `.svg`, else a trace
    /// for Perfetto
    #[arg(long, value_name = "FILE")]
    timeline: Option<PathBuf>,
    /// Print findings and figures as JSON, an object a line
    #[arg(long)]
    json: bool,
}

/// Where a task may have to let others go first.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum GrainChoice {
    /// Before it changes what others can see, or begins to wait
    Changes,
    /// Also before it looks at what others have changed
    Reads,
}

/// When timers end.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TimersChoice {
    /// When all tasks wait
    Idle,
    /// At any point
    Any,
}

/// Lets the process have as many open files and connections as the system allows it.
#[cfg(unix)]
fn raise_limit_of_descriptors() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    // A system that refuses leaves the limit as it is.
    _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

fn main() -> ExitCode {
    #[cfg(unix)]
    raise_limit_of_descriptors();
    esl_vm::allocator::return_large_blocks();
    let Eslvm { action, library, quiet: is_quiet } = Eslvm::parse();
    let status = match action {
        EslvmAction::Run {
            mut options,
            speed,
            stats,
            tier,
            timeline,
            profile,
            coverage,
            schedule,
            record,
            trace,
            operate,
            file,
            arguments,
        } => {
            if schedule.is_some() {
                options.clock = ClockChoice::Virtual;
            }
            let path = ModulePath::new([file.as_path()], &library);
            let rights = options.rights.rights();
            rights.and_then(|rights| {
                let host = RealHost::new(arguments).with_rights(path.with_rights(rights)).with_speed(speed);
                let schedule = schedule.as_deref().map(explore::read_schedule).transpose()?;
                let reports = RunReports {
                    stats,
                    tier,
                    timeline: timeline.as_deref(),
                    profile: profile.as_deref(),
                    coverage: coverage.as_deref(),
                    record: record.as_deref(),
                    trace: &trace,
                    operate: &operate,
                    is_quiet,
                };
                run(&file, host, &options, &reports, schedule.as_ref(), &path)
            })
        }
        EslvmAction::Replay { options } => replay::run_command(&options),
        EslvmAction::Test { filter, jobs, seed, junit, coverage, budget, memory, rights, sources } => {
            rights.rights().map(|rights| {
                let processors = || std::thread::available_parallelism().map_or(1, usize::from);
                let config = Config { budget: Some(budget), memory, ..Config::default() };
                let jobs = jobs.map_or_else(processors, usize::from);
                testing::run(
                    &sources,
                    &library,
                    &testing::Options { filter, jobs, seed, junit, coverage, config, rights, is_quiet },
                )
            })
        }
        EslvmAction::Completions { shell } => Ok(command::print_completions(shell, Eslvm::command())),
        EslvmAction::Man { folder } => Ok(command::write_man_pages(Eslvm::command(), folder.as_deref())),
        EslvmAction::Explore { options, file } => run_explore(&file, &options, &library, is_quiet),
        EslvmAction::Attach { secret_file, tls, ca_file, address } => {
            let security = match (tls, &ca_file) {
                (false, None) => AttachSecurity::Plain,
                (_, ca_file) => AttachSecurity::Tls(ca_file.as_deref()),
            };
            esl::repl::attach(&address, security, secret_file.as_deref())
        }
        EslvmAction::Repl { options } => options.rights.rights().and_then(|rights| {
            let path = ModulePath::new([Path::new("-")], &library);
            esl::repl::run(options.config(), rights, options.clock == ClockChoice::Virtual, &path)
        }),
    };
    ExitCode::from(status.unwrap_or_else(|status| status))
}

/// Parses the speed of the program's clock.
fn parse_speed(text: &str) -> Result<f64, &'static str> {
    match text.parse() {
        Ok(speed) if (1e-6..=1e6).contains(&speed) => Ok(speed),
        _ => Err("expected a number from 0.000001 to 1000000"),
    }
}

/// Reads the program in a file, and compiles it if it is a source, within the limits of its run. Returns
/// its coverage too, if that `is_covered`.
///
/// # Errors
/// The exit status, after a message.
fn program(
    file: &Path,
    path: &ModulePath,
    options: &MachineOptions,
    is_covered: bool,
    is_quiet: bool,
    signals: &SignalTarget,
) -> Result<(Program, Option<Coverage>), u8> {
    let source = match command::read_program(file)? {
        ProgramFile::Compiled(_) if is_covered => return Err(coverage::refuse_compiled(file)),
        ProgramFile::Compiled(program) => return Ok((program, None)),
        ProgramFile::Source(source) => source,
    };
    let mut watch = |inbox| signals.set(inbox);
    let config = options.config();
    let compile = || program::compile_for_run(&[source], path, is_covered, &config, &mut watch);
    let compiled = compiling(file, is_quiet, compile);
    if let Some(ended) = compiled.stopped {
        match ended {
            Ended::BudgetSpent => complain("compiling the program takes more than the budget"),
            Ended::Signalled(signal) => complain_of_signal(signal),
            _ => complain(format_args!(
                "compiling the program takes more than {} MiB of memory",
                config.memory >> 20
            )),
        }
        return Err(command::exit_status(ended));
    }
    let color = command::wants_color();
    command::print_diagnostics(&compiled, &Renderer { color, format: Format::Human });
    let coverage = is_covered.then(|| Coverage::new(&compiled));
    Ok((compiled.program.ok_or(NOT_COMPILED)?, coverage))
}

/// Compiles a program, and says at a terminal that it takes long, if it does.
fn compiling(file: &Path, is_quiet: bool, compile: impl FnOnce() -> Compiled) -> Compiled {
    command::StatusLine::new(is_quiet).during(|| format!("compiling {}", file.display()), compile)
}

/// Explores the schedules of a program. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
fn run_explore(
    file: &Path,
    options: &ExploreArguments,
    library: &[PathBuf],
    is_quiet: bool,
) -> Result<u8, u8> {
    if let Some(timeline) = &options.timeline {
        command::refuse_overwriting(timeline, [file])?;
    }
    let path = ModulePath::new([file], library);
    let program = match command::read_program(file)? {
        ProgramFile::Compiled(program) => program,
        ProgramFile::Source(source) => {
            let compile = || program::compile_with(&[source], &path, Modules::Inside);
            let compiled = compiling(file, is_quiet, compile);
            let color = command::wants_color();
            command::print_diagnostics(&compiled, &Renderer { color, format: Format::Human });
            compiled.program.ok_or(NOT_COMPILED)?
        }
    };
    let grain = match options.grain {
        GrainChoice::Changes => explore::Grain::Changes,
        GrainChoice::Reads => explore::Grain::Reads,
    };
    let settings = explore::Settings {
        grain,
        timers: match options.timers {
            TimersChoice::Idle => explore::TimerGrain::Idle,
            TimersChoice::Any => explore::TimerGrain::Any,
        },
        memory: options.memory,
        states: usize::try_from(options.states).unwrap_or(usize::MAX),
        switches: options.switches,
        faults: options.faults,
        output: false,
        ..explore::Settings::default()
    };
    let time = std::time::Duration::from_secs(u64::from(options.time));
    let (timeline, json) = (options.timeline.clone(), options.json);
    Ok(explore::run(
        &program,
        file,
        &path,
        &explore::ExplorationOptions { settings, time, timeline, json, is_quiet },
    ))
}

/// What is to be seen of a run.
struct RunReports<'a> {
    stats: Option<Stats>,
    tier: TierChoice,
    timeline: Option<&'a Path>,
    record: Option<&'a Path>,
    profile: Option<&'a Path>,
    coverage: Option<&'a Path>,
    trace: &'a [String],
    operate: &'a OperateOptions,
    is_quiet: bool,
}

fn run(
    file: &Path,
    mut host: RealHost,
    options: &MachineOptions,
    reports: &RunReports<'_>,
    schedule: Option<&Schedule>,
    path: &ModulePath,
) -> Result<u8, u8> {
    let RunReports { stats, tier, timeline, profile, coverage, record, trace, operate, is_quiet } = *reports;
    for output in [timeline, profile, coverage, record].into_iter().flatten() {
        command::refuse_overwriting(output, [file])?;
    }
    let signals = SignalTarget::default();
    command::end_on_signal(signals.clone());
    let is_covered = coverage.is_some() || stats == Some(Stats::Coverage);
    let (program, mut covered) = program(file, path, options, is_covered, is_quiet, &signals)?;
    let setup = |error| {
        complain(error);
        USAGE
    };
    if options.clock == ClockChoice::Virtual {
        host = host.with_virtual_time();
    }
    let recording = match record {
        Some(path) => Some((FileRecorder::create(path).map_err(|error| not_written(path, &error))?, path)),
        None => None,
    };
    let host: Box<dyn Host + Send> = match &recording {
        Some((recorder, _)) => Box::new(RecordingHost::with_recorder(host, recorder.clone())),
        None => Box::new(host),
    };
    let mut machine = program::machine(options.config(), host).map_err(setup)?;
    if options.clock == ClockChoice::Real {
        esl_world::install_operations(&mut machine);
    }
    if let Some((recorder, path_of_record)) = &recording {
        let folders = path.folders().iter().map(|folder| folder.to_string_lossy().into_owned()).collect();
        let setup = RunSetup { config: options.config(), traces: trace.to_vec(), folders };
        let beginning = replay::beginning(&program, &setup, &machine).map_err(|error| {
            complain(format_args!("{} cannot be recorded: {error}", path_of_record.display()));
            USAGE
        })?;
        recorder.begin(&beginning);
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
    if is_covered {
        machine.count_passages();
    }
    machine.set_tier(tier.into());
    let served = operate.begin(&mut machine)?;
    let started = std::time::Instant::now();
    let is_profiled = profile.is_some() || stats == Some(Stats::Functions);
    let mut found = Profile::new();
    let summary = match schedule {
        Some(schedule) if !schedule.is_of(&program) => {
            complain(
                "the schedule was found in another program, or in another version of this one: explore again",
            );
            return Err(USAGE);
        }
        Some(schedule) if !schedule.is_of_this_machine() => {
            complain("the schedule was found by another version of eslvm: explore again");
            return Err(USAGE);
        }
        Some(schedule) => program::run_by(&mut machine, &program, &schedule.settings(), schedule.choices()),
        None if is_profiled => {
            program::run_in_portions(&mut machine, &program, INTERVAL, &mut |machine| found.look(machine))
        }
        None => program::run_in(&mut machine, &program),
    };
    let summary = summary.map_err(setup)?;
    let seconds = started.elapsed().as_secs_f64();
    drop(served);
    let mut status = command::exit_status(summary.ended);
    if let Some((recorder, path)) = recording
        && let Err(error) = recorder.end(&machine, status)
    {
        status = not_written(path, &error);
    }
    if let Some((timeline, path)) = timeline
        && let Err(error) = timeline.end(&mut machine)
    {
        status = not_written(path, &error);
    }
    if let Some(path) = profile
        && let Err(error) = found.write(path)
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
        if stats == Stats::Functions {
            print_functions(&found);
        }
        if let (Stats::Coverage, Some(report)) = (stats, &covered) {
            eprint!("\n{}", report.table());
        }
    }
    // The process ends here: giving the memory back piece by piece would only take time.
    std::mem::forget(machine);
    Ok(status)
}

/// Prints that a signal has ended the run.
fn complain_of_signal(signal: ProcessSignal) {
    complain(match signal {
        ProcessSignal::HangUp => "hung up",
        ProcessSignal::Interrupt => "interrupted",
        ProcessSignal::Terminate => "terminated",
    });
}

/// Prints that a file could not be written, and returns the exit status.
fn not_written(path: &Path, error: &std::io::Error) -> u8 {
    complain(format_args!("{} cannot be written: {error}", path.display()));
    USAGE
}

fn print_stats(machine: &Vm, summary: &Summary, seconds: f64) {
    let (heap, pauses) = (summary.heap, machine.pauses());
    let milliseconds = |nanoseconds: u64| nanoseconds as f64 / 1e6;
    eprintln!("ticks         {:>14}", summary.ticks);
    eprintln!("tasks         {:>14}", summary.tasks);
    eprintln!("turns         {:>14}", summary.turns);
    eprintln!("switches      {:>14}", summary.switches);
    eprintln!("seconds       {seconds:>14.3}");
    eprintln!("allocated     {:>14} bytes", heap.allocated);
    eprintln!("peak heap     {:>14} bytes", heap.peak);
    eprintln!("collections   {:>14}", heap.cycles);
    eprintln!("pauses        {:>14}", pauses.count);
    eprintln!("  all         {:>14.3} ms", milliseconds(pauses.total));
    eprintln!("  longest     {:>14.3} ms", milliseconds(pauses.longest));
    eprintln!("longest slice {:>14} objects", heap.longest_slice);
    let (tier, report) = machine.tier();
    if tier != Tier::Interpreter {
        match &report.refused {
            Some(reason) => eprintln!("machine code            none: {reason}"),
            None => {
                eprintln!("machine code  {:>14} functions", report.functions);
                eprintln!("  size        {:>14} bytes", report.bytes);
                eprintln!("  making it   {:>14.3} ms", milliseconds(report.nanoseconds));
            }
        }
    }
}

/// Prints the functions that have used most ticks.
fn print_functions(profile: &Profile) {
    eprintln!("\n{:>14} {:>14}  function", "own ticks", "with calls");
    for function in profile.functions().iter().take(SHOWN_FUNCTIONS) {
        eprintln!("{:>14} {:>14}  {}", function.own, function.total, function.name);
    }
}

fn print_tasks(machine: &Vm) {
    eprintln!("\n{:>14} {:>10} {:>8}  {:<9}  task", "ticks", "turns", "stack", "status");
    for task in machine.task_figures() {
        eprintln!(
            "{:>14} {:>10} {:>8}  {:<9}  {}",
            task.ticks, task.turns, task.stack, task.status, task.name
        );
    }
}
