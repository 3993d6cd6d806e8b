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
use esl::program::{self, Ended, Modules, Program, Report};
use esl::timeline::Timeline;
use esl_compiler::diagnostic::{Format, Renderer};
use esl_vm::vm::Vm;

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
        /// Print figures of the run to standard error when it is over; with `=tasks`, those of the tasks that have used most, too
        #[arg(long, value_name = "WHAT", num_args = 0..=1, require_equals = true, default_missing_value = "run")]
        stats: Option<Stats>,
        /// Write what the tasks do in time to a file: a trace for the Perfetto UI, or one drawing if it ends in `.svg`
        #[arg(long, value_name = "FILE")]
        timeline: Option<PathBuf>,
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

/// What figures are printed of.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Stats {
    /// The run.
    Run,
    /// Also of tasks.
    Tasks,
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
    let Command { action, library } = Command::parse();
    let status = match action {
        Action::Run { limits, stats, timeline, trace, file, arguments } => {
            let library = Library::new([file.as_path()], &library);
            run(&file, arguments, &limits, stats, timeline.as_deref(), &trace, &library)
        }
        Action::Repl { limits } => esl::repl::run(
            limits.config(),
            limits.clock == Clock::Virtual,
            &Library::new([Path::new("-")], &library),
        ),
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
    stats: Option<Stats>,
    timeline: Option<&Path>,
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
    if let Some(stats) = stats {
        machine.gather_figures(stats == Stats::Tasks);
    }
    let timeline = match timeline {
        Some(path) => {
            Some((Timeline::begin(path, &mut machine).map_err(|error| not_written(path, &error))?, path))
        }
        None => None,
    };
    let started = std::time::Instant::now();
    let report = program::run_in(&mut machine, &program).map_err(setup)?;
    let seconds = started.elapsed().as_secs_f64();
    let mut status = report.ended.status();
    if let Some((timeline, path)) = timeline
        && let Err(error) = timeline.end(&mut machine)
    {
        status = not_written(path, &error);
    }
    match report.ended {
        Ended::BudgetSpent => complain(format_args!("the budget of {} ticks is spent", report.ticks)),
        Ended::Interrupted => complain("interrupted"),
        _ => {}
    }
    if let Some(stats) = stats {
        print_stats(&machine, &report, seconds);
        if stats == Stats::Tasks {
            print_tasks(&machine);
        }
    }
    // The process ends here; to give the memory back piece by piece would only take time.
    std::mem::forget(machine);
    Ok(status)
}

/// Says that a file could not be written; gives the exit status.
fn not_written(path: &Path, error: &std::io::Error) -> u8 {
    complain(format_args!("{} cannot be written: {error}", path.display()));
    USAGE
}

fn print_stats(machine: &Vm, report: &Report, seconds: f64) {
    let (heap, pauses) = (report.heap, machine.pauses());
    let milliseconds = |nanoseconds: u64| nanoseconds as f64 / 1e6;
    eprintln!("ticks         {:>14}", report.ticks);
    eprintln!("tasks         {:>14}", report.tasks);
    eprintln!("turns         {:>14}", report.turns);
    eprintln!("switches      {:>14}", report.switches);
    eprintln!("seconds       {seconds:>14.3}");
    eprintln!("allocated     {:>14} bytes", heap.allocated);
    eprintln!("peak heap     {:>14} bytes", heap.peak);
    eprintln!("collections   {:>14}", heap.cycles);
    eprintln!("pauses        {:>14}", pauses.count);
    eprintln!("  all         {:>14.3} ms", milliseconds(pauses.total));
    eprintln!("  longest     {:>14.3} ms", milliseconds(pauses.longest));
    eprintln!("longest slice {:>14} objects", heap.longest_slice);
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
