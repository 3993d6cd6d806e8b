//! `eslvm host` and `eslvm agents`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use clap::{Args, Subcommand};
use esl::host::{ProcessSignal, Rights};
use esl::program::{self, Modules};
use esl::size::parse_size;
use esl_agents::{
    AgentError, AgentOrigin, AgentsHost, HostClient, HostRequest, HostSettings, HostSurroundings, NewAgent,
    begin_agent,
};
use esl_command::{
    NOT_COMPILED, ProgramFile, SUCCESS, USAGE, complain, print_diagnostics, read_program, say, say_error,
    wants_color,
};
use esl_compiler::diagnostic::{Format, Renderer};
use esl_durable::{Downtime, Durability, DurableOptions, SnapshotEvery};
use serde_json::Value;

use super::durable::{DowntimeChoice, DurabilityChoice};
use super::options::LibraryOption;
use crate::rights::RightsOptions;
use crate::signal::{SignalTarget, end_on_signal_unless};

/// Options of `eslvm host`.
#[derive(Args)]
pub(crate) struct HostOptions {
    /// Put an agent to sleep that has waited for this time, and will not go on by itself for as long again
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = humantime::parse_duration)]
    sleep_after: Duration,
    /// Most agents that are awake, beside those that cannot sleep, since they have connections or other ties
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..))]
    awake: u32,
    /// Let the agents survive the end of the process, or loss of power as well, for which they wait for the
    /// disk before each effect
    #[arg(long, value_enum, default_value = "process", value_name = "EVENT")]
    durability: DurabilityChoice,
    /// Count the time without a process for the clocks of the agents, or leave it out
    #[arg(long, value_enum, default_value = "counts", value_name = "HOW")]
    downtime: DowntimeChoice,
    /// Store the machine of an agent after so much time or journal, as for `eslvm run --state`
    #[arg(long, value_name = "WHEN")]
    snapshot_every: Option<SnapshotEvery>,
    /// Begin the agents of another version of eslvm anew, with their programs as they are now, their facts,
    /// and the variables of DEFDURABLE
    #[arg(long)]
    from_facts: bool,
    #[command(flatten)]
    rights: RightsOptions,
    /// Folder of the agents
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Options of `eslvm agents`.
#[derive(Args)]
pub(crate) struct AgentsOptions {
    /// Folder of the agents
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    #[command(subcommand)]
    action: AgentsAction,
}

/// Actions on the agents of a folder.
#[derive(Subcommand)]
enum AgentsAction {
    /// Begin a program as a new agent; if no host serves the folder, it takes its first turn when one does
    Begin {
        /// Most memory for objects of the agent, such as 64M or 2G
        #[arg(long, value_name = "SIZE", default_value = "64M", value_parser = parse_size)]
        memory: usize,
        /// Seed of the choices that the language leaves open
        #[arg(long, value_name = "N", default_value_t = 0)]
        seed: u64,
        #[command(flatten)]
        modules: LibraryOption,
        /// Name of the agent
        name: String,
        /// Source or bytecode file
        program: PathBuf,
        /// Arguments of the program
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARG")]
        arguments: Vec<String>,
    },
    /// List the agents, or one
    List {
        /// Name of the agent
        name: Option<String>,
    },
    /// Signal an input of an agent; returns when the signal is in its journal
    Send {
        /// Name of the agent
        name: String,
        /// Name of the input
        input: String,
        /// Arguments of the signal, as programs write data
        #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "DATA")]
        data: Vec<String>,
    },
    /// Start an agent that was stopped, has failed, or was copied into the folder
    Start {
        /// Name of the agent
        name: String,
    },
    /// Pause an agent until it is started
    Stop {
        /// Name of the agent
        name: String,
    },
    /// End the run of an agent, with its cleanups
    End {
        /// Name of the agent
        name: String,
    },
}

/// The output of all agents, whose lines stay apart.
#[derive(Default)]
struct AgentsOutput {
    /// The agent whose line has no end yet.
    open: Option<String>,
}

impl AgentsOutput {
    /// Returns the output of an agent with its name before each line.
    fn lines(&mut self, name: &str, bytes: &[u8]) -> Vec<u8> {
        let mut out = Vec::with_capacity(bytes.len() + name.len() + 3);
        let mut is_open = match &self.open {
            Some(open) if open == name => true,
            Some(_) => {
                out.push(b'\n');
                false
            }
            None => false,
        };
        for piece in bytes.split_inclusive(|&byte| byte == b'\n') {
            if !is_open {
                out.extend_from_slice(name.as_bytes());
                out.extend_from_slice(b": ");
            }
            out.extend_from_slice(piece);
            is_open = piece.last() != Some(&b'\n');
        }
        self.open = is_open.then(|| name.into());
        out
    }
}

fn refused(error: &AgentError) -> u8 {
    complain(error);
    USAGE
}

/// Hosts the agents in a folder. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_host(options: &HostOptions) -> Result<u8, u8> {
    let rights: Rights = options.rights.rights()?;
    let durability = match options.durability {
        DurabilityChoice::Process => Durability::Process,
        DurabilityChoice::Power => Durability::Power,
    };
    let downtime = match options.downtime {
        DowntimeChoice::Counts => Downtime::Counts,
        DowntimeChoice::Stops => Downtime::Stops,
    };
    let snapshots = options.snapshot_every.unwrap_or_default();
    let settings = HostSettings {
        durable: DurableOptions {
            durability,
            downtime,
            snapshots,
            hosted: None,
            from_facts: options.from_facts,
        },
        rights,
        sleep_after: options.sleep_after,
        awake: options.awake as usize,
    };
    let output = Mutex::<AgentsOutput>::default();
    let print = move |name: &str, bytes: &[u8]| {
        let mut output = output.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let lines = output.lines(name, bytes);
        // Agents go on when nobody reads their output any more.
        let mut out = std::io::stdout().lock();
        drop(out.write_all(&lines).and_then(|()| out.flush()));
    };
    let surroundings = HostSurroundings {
        prepare: Box::new(esl_world::install_operations),
        print: Box::new(print),
        report: Box::new(|name, text| complain(format_args!("{name}: {text}"))),
    };
    let host = AgentsHost::open(&options.folder, settings, surroundings).map_err(|error| refused(&error))?;
    let control = host.control();
    end_on_signal_unless(SignalTarget::default(), move |signal: ProcessSignal| {
        let ends = signal.ends_a_run();
        if ends {
            control.end();
        }
        ends
    });
    let count = host.control().agents().len();
    say_error!("; hosts {count} agents; eslvm agents {} list", options.folder.display());
    host.serve();
    complain("all agents are paused; the same command goes on");
    Ok(SUCCESS)
}

/// Begins, lists, stops and ends agents, and sends messages. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub(crate) fn run_agents(options: &AgentsOptions) -> Result<u8, u8> {
    let folder = options.folder.as_path();
    let request = match &options.action {
        AgentsAction::Begin { memory, seed, modules, name, program, arguments } => {
            // The host may have another working folder.
            let absolute = |path: &PathBuf| std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
            let library = modules.library.iter().map(absolute).collect();
            let origin = AgentOrigin { file: absolute(program), library, memory: *memory, seed: *seed };
            begin(folder, name, arguments, &origin)?;
            // Without a host the agent waits for one.
            if let Ok(mut client) = HostClient::connect(folder) {
                let start = HostRequest::Start(name.clone());
                client.ask(&start).map_err(|error| refused(&error))?;
            }
            return Ok(SUCCESS);
        }
        AgentsAction::List { name } => HostRequest::List(name.clone()),
        AgentsAction::Send { name, input, data } => {
            HostRequest::Send { agent: name.clone(), input: input.clone(), data: data.join(" ") }
        }
        AgentsAction::Start { name } => HostRequest::Start(name.clone()),
        AgentsAction::Stop { name } => HostRequest::Stop(name.clone()),
        AgentsAction::End { name } => HostRequest::End(name.clone()),
    };
    let mut client = HostClient::connect(folder).map_err(|error| refused(&error))?;
    let answer = client.ask(&request).map_err(|error| refused(&error))?;
    for agent in answer["agents"].as_array().map_or(&[][..], Vec::as_slice) {
        say!("{}", line_of(agent));
    }
    Ok(SUCCESS)
}

/// Begins an agent.
fn begin(folder: &Path, name: &str, arguments: &[String], origin: &AgentOrigin) -> Result<(), u8> {
    let path = origin.path();
    let program = match read_program(&origin.file)? {
        ProgramFile::Compiled(program) => program,
        ProgramFile::Source(source) => {
            let compiled = program::compile_with(&[source], &path, Modules::Inside);
            print_diagnostics(&compiled, &Renderer { color: wants_color(), format: Format::Human });
            compiled.program.ok_or(NOT_COMPILED)?
        }
    };
    let setup = origin.setup();
    let agent = NewAgent { program: &program, arguments, setup: &setup, origin: Some(origin) };
    begin_agent(folder, name, agent, esl_world::install_operations).map_err(|error| refused(&error))
}

/// Returns a line about an agent.
fn line_of(agent: &Value) -> String {
    let text = |key: &str| agent[key].as_str().unwrap_or_default();
    let until = agent["until"].as_u64().map(|time| {
        let left = (UNIX_EPOCH + Duration::from_nanos(time)).duration_since(SystemTime::now());
        let left = humantime::format_duration(Duration::from_secs(left.unwrap_or_default().as_secs()));
        left.to_string()
    });
    let more = match (text("standing"), until) {
        ("asleep", Some(left)) => format!(", goes on in {left}"),
        ("ended", _) => format!(" with status {}", agent["status"]),
        ("failed", again) => {
            let again = again.map(|left| format!("; tried again in {left}")).unwrap_or_default();
            format!(": {}{again}", text("reason"))
        }
        _ => String::new(),
    };
    format!("{}: {}{more}", text("name"), text("standing"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_agents_stay_apart() {
        let mut output = AgentsOutput::default();
        let text: Vec<u8> = [("a", "x\ny"), ("a", "z\n"), ("b", "half"), ("a", "\n"), ("b", "q\n")]
            .into_iter()
            .flat_map(|(name, text)| output.lines(name, text.as_bytes()))
            .collect();
        assert_eq!(String::from_utf8_lossy(&text), "a: x\na: yz\nb: half\na: \nb: q\n");
    }
}
