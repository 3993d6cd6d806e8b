//! The command `eslvm`, run as a process, also with programs that `eslc` compiles: exit statuses, outputs,
//! files.

#[macro_use]
mod listed;

#[cfg(unix)]
mod agents;
#[cfg(unix)]
mod attach;
#[cfg(unix)]
mod attacks;
mod background;
mod bad_input;
#[cfg(unix)]
mod browser;
mod copter;
mod coverage;
mod deadlock;
mod documents;
#[cfg(unix)]
mod durable;
mod durable_facts;
mod durable_operators;
mod durable_services;
mod durable_upgrades;
mod endings;
mod examples;
mod exploring;
mod exploring_endless;
mod exploring_randomly;
#[cfg(unix)]
mod fleet;
#[cfg(unix)]
mod fleet_command;
mod http;
mod http_client;
mod http_peers;
mod http_server;
mod injecting;
#[cfg(unix)]
mod lines;
#[cfg(target_os = "linux")]
mod manipulator;
mod manual;
mod mavlink;
#[cfg(unix)]
mod mcap;
#[cfg(unix)]
mod mcap_runs;
mod memory;
mod missions;
mod modules;
mod monitor;
#[cfg(unix)]
mod mqtt;
mod mqtt_messages;
#[cfg(unix)]
mod mutual_tls;
mod operate;
#[cfg(target_os = "linux")]
mod packages;
#[cfg(unix)]
mod patches;
mod paths;
mod peers;
mod plans;
#[cfg(unix)]
mod playground;
mod profile;
mod real_time;
mod recording;
mod replay;
mod reports;
mod rights;
mod robots;
mod robots_rude;
mod robots_tools;
#[cfg(unix)]
mod secured;
#[cfg(unix)]
mod service;
#[cfg(unix)]
mod slime;
mod sockets;
#[cfg(unix)]
mod standing;
mod streams;
#[cfg(unix)]
mod terminal;
mod testing;
mod timeline;
mod traces;
mod transcripts;
mod trees;
mod tutorial;
mod venv;
#[cfg(unix)]
mod world;
#[cfg(unix)]
mod ws;
#[cfg(unix)]
mod ws_peers;

use std::process::{Child, Command};

use esl_conformance::process;

const ESLVM: &str = env!("CARGO_BIN_EXE_eslvm");

/// Returns the path of the command `eslc`, which is built beside `eslvm`.
fn eslc_path() -> String {
    process::beside(ESLVM, "eslc")
}

/// The command `eslc` with these arguments.
fn eslc(arguments: &[&str]) -> Command {
    process::command(&eslc_path(), arguments)
}

/// The command `eslvm` with these arguments.
fn eslvm(arguments: &[&str]) -> Command {
    process::command(ESLVM, arguments)
}

/// Returns the most resident memory that a process of `eslvm` has had so far, in mebibytes; `None` before its
/// program is there, and after its end.
///
/// A process that was just spawned shares the memory of this one for a moment: its name is the first sign of
/// memory of its own.
fn most_memory(child: &Child) -> Option<usize> {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let value = |key: &str| status.lines().find_map(|line| line.strip_prefix(key)).map(str::trim);
    (value("Name:")? == "eslvm").then_some(())?;
    let kibibytes: usize = value("VmHWM:")?.trim_end_matches(" kB").parse().ok()?;
    Some(kibibytes / 1024)
}

/// Says that a test was left out, and why.
#[allow(clippy::print_stderr, reason = "whoever runs the tests sees what is left out")]
fn say_left_out(reason: &str) {
    eprintln!("left out: {reason}");
}
