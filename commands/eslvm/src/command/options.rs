//! Arguments of the command line.

use std::path::PathBuf;
use std::sync::LazyLock;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use esl::Config;
use esl::size::{parse_size, parse_stack};
use esl_vm::value::Value;
use esl_vm::vm::Tier;

#[cfg(unix)]
use super::host::{AgentsOptions, HostOptions};
use super::injecting::InjectArguments;
use super::parse::{parse_findings, parse_time};
use super::run::RunOptions;
use super::state::LookOptions;
use crate::mcap::McapAction;
use crate::replay::ReplayOptions;
use crate::rights::RightsOptions;

/// The answer to `--version`.
static BUILD: LazyLock<String> = LazyLock::new(|| {
    let features = [("native", cfg!(feature = "native")), ("robots", cfg!(feature = "robots"))];
    esl_command::version_of_build(env!("CARGO_PKG_VERSION"), &features)
});

/// The virtual machine of ESL, the Execution Support Language.
#[derive(Parser)]
#[command(name = "eslvm", version, long_version = BUILD.as_str(), propagate_version = true, max_term_width = 100)]
pub(crate) struct Eslvm {
    #[command(subcommand)]
    pub(crate) action: EslvmAction,
}

/// Where required modules are.
#[derive(Args)]
pub(crate) struct LibraryOption {
    /// Folder to search for required modules, after the folder of the program and before those of
    /// ESL_LIBRARY
    #[arg(long, value_name = "FOLDER")]
    pub(crate) library: Vec<PathBuf>,
}

/// Options of the commands that compile files.
#[derive(Args)]
pub(crate) struct CompilingOptions {
    #[command(flatten)]
    pub(crate) modules: LibraryOption,
    /// Show no progress line at a terminal
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

#[derive(Subcommand)]
#[allow(clippy::large_enum_variant, reason = "there is one, which is made once")]
pub(crate) enum EslvmAction {
    /// Run a program
    ///
    /// Exit status: 0 success, or the status that the program asks for; 1 a failure left the main task; 2
    /// wrong usage, or a file that cannot be read or written; 3 the program does not compile or is refused;
    /// 4 no task can ever run again; 5 the budget or the memory is spent; 129, 130, 143 ended by SIGHUP,
    /// SIGINT or SIGTERM. However the run ends, the cleanups of its tasks are run.
    Run(Box<RunOptions>),
    /// Replay a recorded run, forwards and backwards
    ///
    /// Needs neither the sources nor the world of the program, and waits for nothing. With --until or
    /// --break the replay stops there and takes commands from standard input: `help` lists them. Exit
    /// status: that of the recorded run; 0 if the recording ends before the run, or after commands; 2 wrong
    /// usage, or a file that cannot be read; 3 the recording is damaged; 6 the replay
    /// has diverged, or would, since the recording is of another version.
    Replay {
        #[command(flatten)]
        options: ReplayOptions,
    },
    /// Show a durable run as it stands
    ///
    /// Runs the program again by the journal in the folder, without the outside, and so verifies the journal.
    /// Exit status: 0 the journal leads to where the run was; 2 wrong usage, or a folder that cannot be read,
    /// or that another process has; 3 the journal is damaged; 6 it leads elsewhere, or is of another version.
    State {
        #[command(flatten)]
        options: LookOptions,
    },
    /// Host the agents in a folder: durable runs, which sleep on disk while they wait
    ///
    /// Runs until SIGTERM or SIGINT, at which all agents are paused; the same command goes on. Exit status: 0
    /// it was ended so; 2 wrong usage, or a folder that cannot be used, or that another process has.
    #[cfg(unix)]
    Host {
        #[command(flatten)]
        options: HostOptions,
    },
    /// Begin, list, stop and end the agents of a host, and send messages to them
    ///
    /// Exit status: 0 it is done; 2 wrong usage, no host serves the folder, or the request is refused; 3 the
    /// program does not compile.
    #[cfg(unix)]
    Agents {
        #[command(flatten)]
        options: AgentsOptions,
    },
    /// Run the tests of programs
    ///
    /// Each test (`deftest`) runs in a machine of its own, whose clock is virtual. Exit status: 0 all
    /// passed; 1 a test failed, or with --inject a run was bad; 2 wrong usage, or a file that cannot be read
    /// or written; 3 a file does not compile or is refused, or has two tests of one name; 5 there was no test
    /// to run.
    Test {
        /// Only tests whose names contain this word, in any case
        #[arg(long, value_name = "WORD")]
        filter: Option<String>,
        /// Run the tests again whenever a source beside them changes, until the command is interrupted
        #[arg(long, conflicts_with_all = ["junit", "coverage"])]
        watch: bool,
        /// Number of tests that run at the same time, by default that of the processors
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
        jobs: Option<u16>,
        /// Run each test with this seed only
        #[arg(long, value_name = "N")]
        seed: Option<u64>,
        /// Write a report in the form of JUnit to a file
        #[arg(long, value_name = "FILE")]
        junit: Option<PathBuf>,
        /// Write the schedules under which tests fail to a file, as JSON, for editors; its name ends in
        /// `.findings.json`
        #[arg(long, value_name = "FILE", value_parser = parse_findings, conflicts_with = "no_explore")]
        findings: Option<PathBuf>,
        /// Write the coverage of lines, functions and arms to a file, in the format of lcov, and print
        /// those that were not run
        #[arg(long, value_name = "FILE")]
        coverage: Option<PathBuf>,
        /// Show all calls of the library in reports of failures, which are folded otherwise
        #[arg(long)]
        full: bool,
        /// Run no test under all schedules that does not ask for it; without this, a test of several tasks
        /// whose schedules are few is
        #[arg(long)]
        no_explore: bool,
        #[command(flatten)]
        injecting: InjectArguments,
        /// Most ticks of a run of a test
        #[arg(long, value_name = "TICKS", default_value_t = 1_000_000_000)]
        budget: u64,
        /// Most memory for objects of a test, such as 64M or 2G
        #[arg(long, value_name = "SIZE", default_value = "1G", value_parser = parse_size)]
        memory: usize,
        #[command(flatten)]
        compiling: CompilingOptions,
        #[command(flatten)]
        rights: RightsOptions,
        /// Source or bytecode files, or folders, of which those sources are meant that are named `test.esl`,
        /// `tests.esl`, `*_test.esl` or `*-test.esl`, or are in a folder `tests`; by default this folder
        #[arg(value_name = "FILE")]
        sources: Vec<PathBuf>,
    },
    /// Run a program under all schedules
    ///
    /// Lets the tasks of the program take turns in every possible order, and reports the orders that end
    /// badly: by a deadlock, a failure of the main task, a status other than 0. Writes each as a schedule,
    /// which `eslvm run --schedule` repeats. Exit status: 0 no schedule ends badly; 1 one does; 2 wrong
    /// usage, or a file that cannot be read or written; 3 the program does not compile or is refused; 7
    /// none was found, which proves nothing: some were not tried, or the grain leaves out shared places.
    Explore {
        #[command(flatten)]
        options: ExploreArguments,
        #[command(flatten)]
        compiling: CompilingOptions,
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
        /// Speak TLS with a run whose certificate is in this file, in PEM, or signed by one in it
        #[arg(long, value_name = "FILE")]
        ca_file: Option<PathBuf>,
        #[command(flatten)]
        rights: RightsOptions,
        /// Path or port that was given to --listen
        #[arg(value_name = "PATH|[ADDRESS:]PORT")]
        address: String,
    },
    /// Read files of MCAP, in which robots record their messages
    ///
    /// Needs a build with the cargo feature `robots`.
    Mcap {
        #[command(subcommand)]
        action: McapAction,
    },
    /// Read forms, evaluate them and print their values
    Repl {
        #[command(flatten)]
        options: MachineOptions,
        #[command(flatten)]
        modules: LibraryOption,
    },
    /// Print the completions for a shell
    ///
    /// For bash: eslvm completions bash > ~/.local/share/bash-completion/completions/eslvm
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages
    Man {
        /// Folder to write them to, one page for each subcommand; without it, the first page is printed
        folder: Option<PathBuf>,
    },
}

/// Subject of the figures that are printed.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Stats {
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
pub(crate) enum TierChoice {
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
pub(crate) enum ClockChoice {
    /// Real time
    Real,
    /// Time that stands still until all tasks wait, and then jumps to the first time that one waits for
    Virtual,
    /// Time of the topic `/clock` of ROS, which the first node of the program subscribes to: that of a
    /// simulator, or of a recording that is played
    #[cfg(feature = "robots")]
    Ros,
}

#[derive(Args)]
pub(crate) struct MachineOptions {
    /// Clock of the program
    #[arg(long, value_enum, default_value = "real")]
    pub(crate) clock: ClockChoice,
    /// Seed of the choices that the language leaves open, such as which task runs next
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Ticks that a task runs before the next task has its turn
    #[arg(long, value_name = "TICKS", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000_000))]
    pub(crate) slice: u32,
    /// End the run with status 5 after this many ticks
    #[arg(long, value_name = "TICKS")]
    pub(crate) budget: Option<u64>,
    /// Most memory for objects, such as 64M or 2G
    #[arg(long, value_name = "SIZE", default_value = "1G", value_parser = parse_size)]
    pub(crate) memory: usize,
    /// Most seconds that the cleanups of an aborted task may take, also at the end of the run
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    pub(crate) cleanup_time: u32,
    /// Most memory for the stack of a task, such as 16M; half of --memory without it
    #[arg(long, value_name = "SIZE", value_parser = parse_stack)]
    pub(crate) stack: Option<usize>,
    #[command(flatten)]
    pub(crate) rights: RightsOptions,
}

impl MachineOptions {
    /// Returns the configuration of a machine.
    pub(crate) fn config(&self) -> Config {
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
pub(crate) struct ExploreArguments {
    /// Where a task may have to let others go first; a finer grain sees more, and has more states. By default
    /// it is variables, and then ticks if the program changes what variables does not see
    #[arg(long, value_enum)]
    pub(crate) grain: Option<GrainChoice>,
    /// Number of threads, by default that of the processors; the findings do not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) jobs: Option<u16>,
    /// Most states
    #[arg(long, value_name = "N", default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) states: u64,
    /// Most memory of the exploration, for states and for snapshots, such as 64M or 2G; less makes it slower
    #[arg(long, value_name = "SIZE", default_value = "512M", value_parser = parse_size)]
    pub(crate) memory: usize,
    /// Most time, in seconds or with a unit, such as 90, 10m or 8h
    #[arg(long, value_name = "TIME", default_value = "60", value_parser = parse_time)]
    pub(crate) time: Duration,
    /// When timers end: when all tasks wait (idle), or at any point, as if what tasks do took so long (any)
    #[arg(long, value_enum, default_value = "idle")]
    pub(crate) timers: TimersChoice,
    /// Take states for one that differ only by which of several like tasks is which
    #[arg(long, conflicts_with = "random")]
    pub(crate) symmetry: bool,
    /// Most switches of a schedule: points at which a task that could go on lets another one go first
    #[arg(long, value_name = "N")]
    pub(crate) switches: Option<usize>,
    /// Most aborts of a schedule by an operator, who may ask any task but the main one to end, at any point
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) aborts: u32,
    /// Most restarts of a schedule, as of a durable run: each interrupts a call of a mock or of a script,
    /// before its effect or behind it, and signals *RESUMED*
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) crashes: u32,
    /// Schedules without an end that are findings: those that are fair to each task, or all
    #[arg(long, value_enum, default_value = "weak")]
    pub(crate) fairness: FairnessChoice,
    /// The program is meant to go on for ever: of schedules without an end, only those are findings on which
    /// a condition of EVENTUALLY or LEADS-TO never comes true
    #[arg(long, conflicts_with = "random")]
    pub(crate) endless: bool,
    /// Also look for updates that are safe only because no call stands between a read and a write: fragile
    /// ones
    #[arg(long, conflicts_with = "random")]
    pub(crate) strict: bool,
    /// End with status 1 if an update is fragile; implies --strict
    #[arg(long, value_name = "WHAT", value_parser = ["fragile"], conflicts_with = "random")]
    pub(crate) deny: Vec<String>,
    /// Try N schedules with random priorities, in place of all schedules; without N, until the time is over
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    #[arg(num_args = 0..=1, default_missing_value = "18446744073709551615")]
    pub(crate) random: Option<u64>,
    /// Keep the progress of random schedules in a file, from which the same command goes on, and print which
    /// places of the program came in both orders
    #[arg(long, value_name = "FILE", requires = "random")]
    pub(crate) progress: Option<PathBuf>,
    /// Seed of the first random schedule, by default 1; the next schedules have the next seeds
    #[arg(long, value_name = "SEED", requires = "random")]
    pub(crate) seed: Option<u64>,
    /// Number of steps whose order matters in the faults that random schedules look for
    #[arg(long, value_name = "D", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    #[arg(requires = "random")]
    pub(crate) depth: u32,
    /// Most times that CHOOSE takes another form than its first
    #[arg(long, value_name = "N")]
    pub(crate) faults: Option<usize>,
    /// Write a timeline of the first finding to a file: a drawing if its name ends in `.svg`, else a trace
    /// for Perfetto
    #[arg(long, value_name = "FILE")]
    pub(crate) timeline: Option<PathBuf>,
    /// Write a picture of the first finding to a file: the table of the tasks, in SVG
    #[arg(long, value_name = "FILE")]
    pub(crate) svg: Option<PathBuf>,
    /// Write the findings to a file, as JSON, for editors; its name ends in `.findings.json`
    #[arg(long, value_name = "FILE", value_parser = parse_findings)]
    pub(crate) findings: Option<PathBuf>,
    /// Print findings and figures as JSON, an object a line
    #[arg(long)]
    pub(crate) json: bool,
}

/// Where a task may have to let others go first.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum GrainChoice {
    /// Before it changes what others can see, or begins to wait
    Changes,
    /// Also before it looks at what others have changed
    Reads,
    /// Also after it has read or set a variable of the program
    Variables,
    /// At every tick, which is wherever the machine can preempt it
    Ticks,
}

/// The schedules without an end that are findings.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum FairnessChoice {
    /// Those on which each task that could go on all along goes on, and time passes if it could all along
    Weak,
    /// All, those too on which a task that could go on never does
    None,
}

/// When timers end.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum TimersChoice {
    /// When all tasks wait
    Idle,
    /// At any point
    Any,
}
