//! The command line of `eslvm`: its arguments, and what each subcommand does with them.

mod durable;
mod explore;
mod figures;
#[cfg(unix)]
mod host;
mod injecting;
mod options;
mod parse;
mod program;
mod realtime;
mod run;
mod state;

use std::path::Path;

use clap::{CommandFactory, Parser};
use esl::Config;
use esl::module_path::ModulePath;
use esl_command as command;

use crate::repl::AttachSecurity;
use crate::{replay, testing};

use explore::run_explore;
use options::{ClockChoice, CompilingOptions, Eslvm, EslvmAction};
use run::{RunAlone, run_command};
use state::run_state;

/// Lets the process have as many open files and connections as the system allows it.
#[cfg(unix)]
fn raise_limit_of_descriptors() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    // A system that refuses leaves the limit as it is.
    _ = setrlimit(Resource::Nofile, Rlimit { current: limit.maximum, ..limit });
}

/// Words in place of a subcommand, and what to type.
const HABITS: command::Habits = &[
    ("exec", "eslvm run"),
    ("start", "eslvm run"),
    ("debug", "eslvm replay"),
    ("shell", "eslvm repl"),
    ("check", "eslc check"),
    ("lint", "eslc check"),
    ("compile", "eslc compile"),
    ("build", "eslc compile"),
    ("format", "eslc format"),
    ("fmt", "eslc format"),
    ("new", "eslc new"),
    ("init", "eslc new"),
    ("lsp", "eslc lsp"),
    ("expand", "eslc expand"),
    ("disasm", "eslc disasm"),
];

/// Parses the command line. One that is wrong ends the process.
fn parse() -> EslvmAction {
    let mut arguments = command::arguments();
    if arguments.get(1).is_some_and(|first| first == "run") {
        arguments.remove(0);
        if let Ok(alone) = RunAlone::try_parse_from(arguments) {
            return EslvmAction::Run(Box::new(alone.options));
        }
    }
    command::parse::<Eslvm>("eslvm run", HABITS).action
}

/// Runs the command line of the process, and returns its exit status.
pub fn main() -> u8 {
    #[cfg(unix)]
    raise_limit_of_descriptors();
    #[cfg(feature = "eslc")]
    if command::command_name() == "eslc" {
        return eslc::main();
    }
    esl_vm::allocator::return_large_blocks();
    command::add_modules();
    let status = match parse() {
        EslvmAction::Run(options) => run_command(*options),
        EslvmAction::Replay { options } => replay::run(&options),
        EslvmAction::State { options } => run_state(&options),
        #[cfg(unix)]
        EslvmAction::Host { options } => host::run_host(&options),
        #[cfg(unix)]
        EslvmAction::Agents { options } => host::run_agents(&options),
        EslvmAction::Test {
            filter,
            watch,
            jobs,
            seed,
            junit,
            findings,
            coverage,
            full,
            no_explore,
            injecting,
            budget,
            memory,
            compiling,
            rights,
            sources,
        } => {
            let CompilingOptions { modules, quiet: is_quiet } = compiling;
            rights.rights().map(|rights| {
                let config = Config { budget: Some(budget), memory, ..Config::default() };
                let jobs = jobs.map_or_else(processors, usize::from);
                let options = testing::Options {
                    filter,
                    is_watching: watch,
                    jobs,
                    seed,
                    junit,
                    findings,
                    coverage,
                    config,
                    rights,
                    is_quiet,
                    is_full: full,
                    explores: !no_explore,
                };
                match injecting.options() {
                    Some(faults) => testing::inject::run(&sources, &modules.library, &options, &faults),
                    None => testing::run(&sources, &modules.library, &options),
                }
            })
        }
        EslvmAction::Completions { shell } => Ok(command::print_completions(shell, Eslvm::command())),
        EslvmAction::Man { folder } => Ok(command::write_man_pages(Eslvm::command(), folder.as_deref())),
        EslvmAction::Explore { options, compiling, file } => {
            run_explore(&file, &options, &compiling.modules.library, compiling.quiet)
        }
        EslvmAction::Attach { secret_file, tls, ca_file, rights, address } => {
            let security = match (tls, &ca_file) {
                (false, None) => AttachSecurity::Plain,
                (_, ca_file) => AttachSecurity::Tls(ca_file.as_deref()),
            };
            let attach = |rights| crate::repl::attach(&address, security, secret_file.as_deref(), &rights);
            rights.rights().and_then(attach)
        }
        EslvmAction::Mcap { action } => crate::mcap::run(&action),
        EslvmAction::Repl { options, modules } => options.rights.rights().and_then(|rights| {
            let path = ModulePath::new([Path::new("-")], &modules.library);
            match options.clock {
                ClockChoice::Real | ClockChoice::Virtual => {
                    crate::repl::run(options.config(), rights, options.clock == ClockChoice::Virtual, &path)
                }
                #[cfg(feature = "robots")]
                ClockChoice::Ros => {
                    command::complain(
                        "`--clock ros` is for `eslvm run`: the clock of a REPL is real or virtual",
                    );
                    Err(command::USAGE)
                }
            }
        }),
    };
    status.unwrap_or_else(|status| status)
}

/// Returns the number of processors.
fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
