//! `eslvm`: runs ESL programs, and talks with people.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "commands print")]

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use esl::Config;
use esl::command::{self, Input, NOT_COMPILED, USAGE, complain};
use esl::host::{FileAccess, RealHost};
use esl::library::Library;
use esl::program::{self, Ended, Modules, Program};
use esl_compiler::diagnostic::{Format, Renderer};

/// The virtual machine of ESL, the Execution Support Language.
#[derive(Parser)]
#[command(name = "eslvm", version, propagate_version = true, max_term_width = 100)]
struct Command {
    #[command(subcommand)]
    action: Action,
    /// A folder in which required modules are found, after that of the program and before those of ESL_LIBRARY
    #[arg(long, value_name = "FOLDER", global = true)]
    library: Vec<PathBuf>,
}

#[derive(Subcommand)]
enum Action {
    /// Run a program
    ///
    /// Exit status: 0 success, or what the program asks for; 1 a failure left the main task; 2 wrong usage or an
    /// unreadable file; 3 the program does not compile or is refused; 4 no task can ever run again; 5 the budget or the memory is spent.
    Run {
        #[command(flatten)]
        limits: Limits,
        /// Print figures of the run to standard error when it is over
        #[arg(long)]
        stats: bool,
        /// Write to standard error what happens to failures, goals or tasks: a list such as failures,tasks
        #[arg(long, value_name = "WHAT", value_delimiter = ',', value_parser = ["failures", "goals", "tasks"])]
        trace: Vec<String>,
        /// A source or bytecode file; `-` is a source from standard input
        file: PathBuf,
        /// Arguments of the program
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARG")]
        arguments: Vec<String>,
    },
    /// Evaluate what is typed
    Repl {
        #[command(flatten)]
        limits: Limits,
    },
}

/// How time passes.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Clock {
    /// As it does.
    Real,
    /// By jumps to the next time for which a task waits.
    Virtual,
}

#[derive(Args)]
struct Limits {
    /// Let time pass as it does, or only when all tasks wait
    #[arg(long, value_enum, default_value = "real")]
    clock: Clock,
    /// Choose another legal order of what the language leaves open
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Ticks that a task runs before the next one has its turn
    #[arg(long, value_name = "TICKS", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000_000))]
    slice: u32,
    /// End the run with status 5 after so many ticks
    #[arg(long, value_name = "TICKS")]
    budget: Option<u64>,
    /// Limit of the memory for objects, such as 64M or 2G
    #[arg(long, value_name = "SIZE", default_value = "1G", value_parser = command::parse_size)]
    memory: usize,
}

impl Limits {
    fn config(&self) -> Config {
        Config {
            memory: self.memory,
            slice: self.slice,
            budget: self.budget,
            seed: self.seed,
            ..Config::default()
        }
    }
}

fn main() -> ExitCode {
    let Command { action, library } = command::parse::<Command>();
    let status = match action {
        Action::Run { limits, stats, trace, file, arguments } => {
            let library = Library::new([file.as_path()], &library);
            run(&file, arguments, &limits, stats, &trace, &library)
        }
        Action::Repl { limits } => esl::repl::run(limits.config(), &Library::new([Path::new("-")], &library)),
    };
    ExitCode::from(status.unwrap_or_else(|status| status))
}

/// The program in a file, compiled if it is a source.
fn program(file: &Path, library: &Library) -> Result<Program, u8> {
    let source = match command::read_program(file)? {
        Input::Program(program) => return Ok(program),
        Input::Source(source) => source,
    };
    let compiled = program::compile_with(&[source], library, Modules::Inside);
    let color = std::io::stderr().is_terminal();
    command::print_diagnostics(&compiled, &Renderer { color, format: Format::Human });
    compiled.program.ok_or(NOT_COMPILED)
}

fn run(
    file: &Path,
    arguments: Vec<String>,
    limits: &Limits,
    stats: bool,
    trace: &[String],
    library: &Library,
) -> Result<u8, u8> {
    let program = program(file, library)?;
    let setup = |text| {
        complain(text);
        USAGE
    };
    let mut host = RealHost::new(arguments).with_files(FileAccess::All);
    if limits.clock == Clock::Virtual {
        host = host.with_virtual_time();
    }
    let waker = host.waker();
    let mut machine = program::machine(limits.config(), Box::new(host)).map_err(setup)?;
    command::end_on_signal(machine.interrupt_flag(), waker);
    program::set_library(&mut machine, library).map_err(setup)?;
    program::set_traces(&mut machine, trace).map_err(setup)?;
    let started = std::time::Instant::now();
    let report = program::run_in(&mut machine, &program).map_err(setup)?;
    match report.ended {
        Ended::BudgetSpent => complain(format_args!("the budget of {} ticks is spent", report.ticks)),
        Ended::Interrupted => complain("interrupted"),
        _ => {}
    }
    if stats {
        let heap = report.heap;
        eprintln!("ticks         {:>14}", report.ticks);
        eprintln!("tasks         {:>14}", report.tasks);
        eprintln!("turns         {:>14}", report.turns);
        eprintln!("seconds       {:>14.3}", started.elapsed().as_secs_f64());
        eprintln!("allocated     {:>14} bytes", heap.allocated);
        eprintln!("peak heap     {:>14} bytes", heap.peak);
        eprintln!("collections   {:>14}", heap.cycles);
        eprintln!("longest slice {:>14} objects", heap.longest_slice);
    }
    // The process ends here; to give the memory back piece by piece would only take time.
    std::mem::forget(machine);
    Ok(report.ended.status())
}
