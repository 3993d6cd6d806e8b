//! `esl-crash`: kills durable runs at any place, and counts the effects that a device has seen.
//!
//! It makes small durable programs, runs each without a kill, and then again while it kills the process
//! again and again: at random moments, and, in a debug build of `eslvm`, before and behind each call by which
//! the journal is written. A device in a third process counts the actions that it performs. At the end of
//! each run it compares: no action was performed twice, no action that the program knows to be done is
//! missing, each action with an unknown outcome was reported, and the last facts and lines are those of the
//! run that was not killed.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "it is a command")]

mod check;
mod device;
mod generate;
mod subject;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Parser, Subcommand};

use check::Counts;
use generate::{Chance, generate};
use subject::{DeviceProcess, KillMode, Subject};

/// Kills durable runs at any place, and counts the effects that a device has seen.
#[derive(Parser)]
struct CrashOptions {
    #[command(subcommand)]
    role: Option<Role>,
    /// Number of kills
    #[arg(long, default_value_t = 200)]
    kills: u64,
    /// Seed of the programs and of the moments
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kill at every place between two calls of the journal, one after the other, in place of random ones
    #[arg(long)]
    places: bool,
    /// Let runs survive loss of power, which makes more places
    #[arg(long)]
    power: bool,
    /// When snapshots are taken: after so much time or journal, or `never`
    #[arg(long, default_value = "3ms")]
    snapshot_every: String,
    /// Most seconds, after which the counts so far are reported
    #[arg(long, default_value_t = 3600)]
    seconds: u64,
    /// The command, built for debugging
    #[arg(long, default_value = "target/debug/eslvm")]
    eslvm: PathBuf,
}

#[derive(Subcommand)]
enum Role {
    /// The device, which this command begins itself
    Device,
}

/// Runs of a program with kills, before the next program.
const RUNS: u64 = 4;
/// Kills of a run, after which it is let go on to its end.
const MOST_KILLS: u64 = 40;

fn main() -> ExitCode {
    let options = CrashOptions::parse();
    let done = match options.role {
        Some(Role::Device) => device::serve().map(|()| true),
        None => run(&options),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("esl-crash: {error}");
            ExitCode::from(2)
        }
    }
}

/// Runs programs until there were enough kills. Returns whether there were, without a violation.
fn run(options: &CrashOptions) -> std::io::Result<bool> {
    let started = Instant::now();
    let limit = Duration::from_secs(options.seconds);
    let device = DeviceProcess::begin()?;
    let mut counts = Counts::default();
    let mut chance = Chance(options.seed);
    while counts.kills < options.kills && started.elapsed() < limit {
        let seed = chance.next();
        let text = generate(seed, device.port);
        let subject = Subject::new(&options.eslvm, &text, options.power, &options.snapshot_every)?;
        let (alone, duration) = subject.run_alone(&device)?;
        counts.programs += 1;
        let mut place = 1;
        let mut runs = 0;
        loop {
            let is_enough = counts.kills >= options.kills || started.elapsed() >= limit;
            if is_enough || (!options.places && runs == RUNS) {
                break;
            }
            runs += 1;
            let mut kills = 0;
            let mut mode = |chance: &mut Chance| {
                kills += 1;
                let is_last = if options.places { kills > 1 } else { kills > MOST_KILLS };
                if is_last || started.elapsed() >= limit {
                    return KillMode::None;
                }
                if options.places {
                    return KillMode::AtPlace(place);
                }
                match chance.below(2) {
                    0 => KillMode::AtPlace(1 + chance.below(40)),
                    _ => {
                        let most = u64::try_from(duration.as_micros()).unwrap_or(u64::MAX);
                        KillMode::After(Duration::from_micros(chance.below(most + most / 4 + 1)))
                    }
                }
            };
            let ended = subject.run_killed(&device, || mode(&mut chance), &mut counts)?;
            let problems = check::compare(&alone, &ended, &mut counts);
            for problem in &problems {
                println!("seed {seed}: {problem}");
            }
            if !problems.is_empty() {
                println!("the program is {}", subject.keep()?.display());
            }
            place += 1;
            // The place is behind the last one of the run.
            if options.places && ended.kills == 0 {
                break;
            }
        }
    }
    println!("{}", counts.report(started.elapsed()));
    Ok(counts.bad() == 0 && counts.kills >= options.kills)
}
