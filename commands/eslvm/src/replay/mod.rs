//! `eslvm replay`.

mod session;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use esl_command::{DIVERGED, NOT_COMPILED, SUCCESS, USAGE, complain, refuse_overwriting, say};
use esl_host::{Host, Output, ReplayHost};
use esl_replay::{
    Breakpoint, RecordedError, ReplayError, Replayed, Rerun, RerunError, Target, read_recorded,
};
use esl_timeline::Timeline;

use crate::mcap::McapRecording;

/// Options of a replay.
#[derive(Args, Clone, Debug)]
pub struct ReplayOptions {
    /// Stop at a place of the run: tick:N, turn:N, time:SECONDS or failure
    #[arg(long, value_name = "PLACE", value_parser = Target::from_str)]
    until: Option<Target>,
    /// Stop at an event: failure, failure:CAUSE, task:NAME, fact:PATTERN or function:NAME
    #[arg(long = "break", value_name = "WHAT", value_parser = Breakpoint::from_str)]
    breakpoints: Vec<Breakpoint>,
    /// Print no output of the program; report whether the replay equals the recorded run
    #[arg(long, conflicts_with_all = ["until", "breakpoints"])]
    check: bool,
    /// Write a timeline of the replay to a file: a drawing if its name ends in `.svg`, else a trace for
    /// Perfetto
    #[arg(long, value_name = "FILE", conflicts_with_all = ["until", "breakpoints"])]
    timeline: Option<PathBuf>,
    /// Write the replay to a file of MCAP, as `eslvm run --mcap` writes a run. Needs a build with the cargo
    /// feature `robots`
    #[arg(long, value_name = "FILE", conflicts_with_all = ["until", "breakpoints"])]
    mcap: Option<PathBuf>,
    /// File of a recorded run
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

/// Replays a recorded run. Returns the exit status.
///
/// # Errors
/// The exit status, after a message, if there is nothing to replay.
pub fn run(options: &ReplayOptions) -> Result<u8, u8> {
    let file = &options.file;
    let recorded = read_recorded(file).map_err(|error| match error {
        ReplayError::Recording(error) => refused(file, &RerunError::Recording(error)),
        error => {
            complain(format_args!("{} cannot be read: {error}", file.display()));
            USAGE
        }
    })?;
    if options.until.is_some() || !options.breakpoints.is_empty() {
        if recorded.start.is_some() {
            complain(
                "a journal that begins at a snapshot is replayed as a whole: leave out `--until` and `--break`",
            );
            return Err(USAGE);
        }
        return session::run(recorded, options.until.clone(), options.breakpoints.clone())
            .map_err(|error| refused(file, &error));
    }
    let is_quiet = options.check;
    let screen = move |output, bytes: &[u8]| {
        if !is_quiet {
            show(output, bytes);
        }
    };
    for output in [&options.timeline, &options.mcap].into_iter().flatten() {
        refuse_overwriting(output, [file.as_path()])?;
    }
    let mcap = match &options.mcap {
        Some(path) => Some(McapRecording::of_replay(path, &recorded)?),
        None => None,
    };
    let host = |host: ReplayHost| -> Box<dyn Host + Send> {
        match &mcap {
            Some(mcap) => mcap.host_of_replay(host),
            None => Box::new(host),
        }
    };
    let mut rerun = Rerun::begin_within(&recorded, screen, host).map_err(|error| refused(file, &error))?;
    if let Some(mcap) = &mcap {
        mcap.watch_replay(&mut rerun);
    }
    let mut timeline = None;
    if let Some(path) = &options.timeline {
        let begun = Timeline::begin(path, rerun.machine_mut()).map_err(|error| not_written(path, &error))?;
        timeline = Some((begun, path));
    }
    let replayed = rerun.run(u64::MAX).cloned().unwrap_or(Replayed::Cut);
    if let Some((timeline, path)) = timeline {
        timeline.end(rerun.machine_mut()).map_err(|error| not_written(path, &error))?;
    }
    if let Some(mcap) = mcap {
        mcap.end(rerun.machine_mut())?;
    }
    let status = match &replayed {
        Replayed::Equal(status) => *status,
        Replayed::Cut => SUCCESS,
        Replayed::Diverged(text) => {
            complain(text);
            DIVERGED
        }
    };
    if replayed == Replayed::Cut && !options.check {
        complain(format_args!(
            "the recording ends here, at tick {}: the run was killed, or the system has refused it memory",
            rerun.check().ticks
        ));
    }
    if options.check && status != DIVERGED {
        let ((checks, _), ticks) = (rerun.host().checks(), rerun.check().ticks);
        let ending = match replayed {
            Replayed::Equal(status) => format!("status {status}"),
            _ => "the end of the recording, before that of the run".into(),
        };
        say!("equal: {} records, {checks} checks, {ticks} ticks, {ending}", rerun.host().replayed());
        return Ok(SUCCESS);
    }
    Ok(status)
}

/// Writes a piece of the program's output.
pub(super) fn show(output: Output, bytes: &[u8]) {
    // A closed output does not stop a replay.
    _ = match output {
        Output::Standard => std::io::stdout().lock().write_all(bytes),
        Output::Error => std::io::stderr().lock().write_all(bytes),
    };
}

fn refused(file: &Path, error: &RerunError) -> u8 {
    complain(format_args!("{} cannot be replayed: {error}", file.display()));
    match error {
        // The run that this machine would make of it is another one.
        RerunError::Recording(RecordedError::OtherMachine | RecordedError::Format(_)) => DIVERGED,
        _ => NOT_COMPILED,
    }
}

fn not_written(path: &Path, error: &std::io::Error) -> u8 {
    complain(format_args!("{} cannot be written: {error}", path.display()));
    USAGE
}
