//! The commands `eslc` and `eslvm`, run as processes: exit statuses, outputs, and what they do to files.

#[cfg(unix)]
mod attach;
#[cfg(unix)]
mod attacks;
mod author;
mod background;
mod bad_input;
#[cfg(unix)]
mod browser;
mod checking;
mod coverage;
mod deadlock;
mod documents;
mod editor;
mod editors;
mod examples;
mod exploring;
mod folder;
mod frames;
mod grammar;
mod http;
mod http_client;
mod http_peers;
mod http_server;
#[cfg(unix)]
mod lines;
mod lsp;
#[cfg(target_os = "linux")]
mod memory;
mod missions;
mod modules;
mod monitor;
#[cfg(unix)]
mod mqtt;
mod mqtt_messages;
mod operate;
#[cfg(unix)]
mod patches;
mod paths;
mod peers;
#[cfg(unix)]
mod playground;
mod profile;
mod real_time;
mod recording;
mod renaming;
mod replay;
mod reports;
mod rights;
#[cfg(unix)]
mod secured;
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
mod typing;
#[cfg(unix)]
mod ways_out;
mod world;

use std::process::Command;

const ESLC: &str = env!("CARGO_BIN_EXE_eslc");
const ESLVM: &str = env!("CARGO_BIN_EXE_eslvm");

/// The command `eslc` with these arguments.
fn eslc(arguments: &[&str]) -> Command {
    command(ESLC, arguments)
}

/// The command `eslvm` with these arguments.
fn eslvm(arguments: &[&str]) -> Command {
    command(ESLVM, arguments)
}

fn command(program: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(arguments).env_remove("ESL_LIBRARY");
    command
}

/// Says that a test was left out, and why.
#[allow(clippy::print_stderr, reason = "whoever runs the tests sees what is left out")]
fn say_left_out(reason: &str) {
    eprintln!("left out: {reason}");
}
