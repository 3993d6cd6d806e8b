//! Runs as files of MCAP and as live sources of Foxglove, `eslvm run --mcap` and `--foxglove`, and what is in
//! such files, `eslvm mcap`.
//!
//! All belong to the feature `robots`; without it they are refused with what to type.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use esl_command::{USAGE, complain};
use esl_operate::parse_address;
use esl_vm::vm::Vm;

/// Options by which a run is written for people and their tools.
#[derive(Args, Clone, Debug, Default)]
pub struct RunFileOptions {
    /// Write the run to a file of MCAP, which Foxglove shows: tasks, failures, facts, inputs, operations,
    /// output, and topics of ROS 2. Needs a build with the cargo feature `robots`
    #[arg(long, value_name = "FILE")]
    pub mcap: Option<PathBuf>,
    /// Let Foxglove show the run while it goes on, the same as with --mcap, at a port of 127.0.0.1, by
    /// default 8765, or at ADDRESS:PORT of this machine. Needs a build with the cargo feature `robots`
    #[arg(long, value_name = "[ADDRESS:]PORT", num_args = 0..=1, require_equals = true, default_missing_value = "8765",
          value_parser = parse_address)]
    pub foxglove: Option<SocketAddr>,
}

/// Actions on files of MCAP.
#[derive(Subcommand)]
pub enum McapAction {
    /// Print the figures of a file: channels, messages, times, compression, and what is damaged
    ///
    /// Exit status: 0 the file is whole; 1 a part of it is damaged; 2 it cannot be read at all.
    Info {
        /// File, or the folder of a bag of ROS 2
        #[arg(value_name = "FILE")]
        file: PathBuf,
    },
}

/// Does what was asked for. Returns the exit status.
///
/// # Errors
/// The exit status, after a message.
pub fn run(action: &McapAction) -> Result<u8, u8> {
    let McapAction::Info { file } = action;
    info(file)
}

#[cfg(feature = "robots")]
use with_robots::info;
#[cfg(feature = "robots")]
pub use with_robots::{McapHost, McapRecording};
#[cfg(not(feature = "robots"))]
use without_robots::info;
#[cfg(not(feature = "robots"))]
pub use without_robots::{McapHost, McapRecording};

#[cfg(feature = "robots")]
mod with_robots {
    use std::fs::File;
    use std::io::Write;
    use std::sync::Arc;
    use std::time::Instant;

    use esl::host::{Host, Record, ReplayHost, VIRTUAL_BEGINNING};
    use esl_command::{FAILED, SUCCESS};
    use esl_replay::{Recorded, Rerun};
    use esl_robots::mcap::{McapBag, McapOutput, McapSelection, OutputOptions};
    use esl_robots::run::{LiveServer, NoSink, ObservedHost, RunRecorder, RunSink, RunSinks};

    use super::{Path, PathBuf, RunFileOptions, USAGE, Vm, complain};

    /// A host that a recorder hears.
    pub type McapHost<H> = ObservedHost<H>;

    /// A run on its way to a file of MCAP, to Foxglove, or both.
    pub struct McapRecording {
        output: Option<(Arc<McapOutput>, PathBuf)>,
        live: Option<Arc<LiveServer>>,
        recorder: RunRecorder,
        /// Nothing for a run in virtual time.
        begun: Option<Instant>,
    }

    /// Ticks of a replay after which it is seen whether the program was told the time of day.
    const PROBED: u64 = 10_000;

    /// Creates a file of MCAP.
    fn create(path: &Path) -> Result<Arc<McapOutput>, u8> {
        let settings = OutputOptions { profile: "ros2".into(), ..OutputOptions::default() };
        let output = File::create(path).and_then(|file| McapOutput::begin(file, &settings));
        output.map(Arc::new).map_err(|error| {
            complain(format_args!("{} cannot be written: {error}", path.display()));
            USAGE
        })
    }

    /// Returns the time at which a recorded run began, in nanoseconds since 1970, by the first time of day
    /// that it was told; 0 if it was told none. `origin` is the same by the clock of the records.
    fn start_of(recorded: &Recorded, origin: u64) -> u64 {
        let mut elapsed = origin;
        for noted in &*recorded.records {
            match noted.record {
                Record::Monotonic(time) => elapsed = time,
                Record::WallClock(time) => {
                    return u64::try_from(time).unwrap_or(0).saturating_sub(elapsed - origin);
                }
                Record::Virtual(true) => return u64::try_from(VIRTUAL_BEGINNING).unwrap_or(0),
                _ => {}
            }
        }
        // A function of the host may have told it, and a record does not name the function.
        let probe = RunRecorder::begin(Arc::new(NoSink), 0);
        probe.set_origin(origin);
        let host = |host| -> Box<dyn Host + Send> { Box::new(ObservedHost::of_replay(host, probe.clone())) };
        if let Ok(mut rerun) = Rerun::begin_within(recorded, |_, _| (), host) {
            while probe.told_start().is_none() && rerun.run(PROBED).is_none() {}
        }
        probe.told_start().unwrap_or(0)
    }

    impl McapRecording {
        /// Creates a file of a run that is replayed.
        ///
        /// # Errors
        /// The exit status, after a message.
        pub fn of_replay(path: &Path, recorded: &Recorded) -> Result<McapRecording, u8> {
            let output = create(path)?;
            let times = recorded.records.iter().filter_map(|noted| match noted.record {
                Record::Monotonic(time) => Some(time),
                _ => None,
            });
            let origin = times.min().unwrap_or(0);
            let recorder = RunRecorder::begin(output.clone(), start_of(recorded, origin));
            recorder.set_origin(origin);
            Ok(McapRecording { output: Some((output, path.to_owned())), live: None, recorder, begun: None })
        }

        /// Returns the host of a replay, whose answers are recorded.
        pub fn host_of_replay(&self, host: ReplayHost) -> Box<dyn Host + Send> {
            Box::new(ObservedHost::of_replay(host, self.recorder.clone()))
        }

        /// Records the machine of a replay from now on.
        pub fn watch_replay(&self, rerun: &mut Rerun) {
            let elapsed = rerun.host().clone().stopwatch();
            self.recorder.set_delay(std::time::Duration::from_nanos(elapsed));
            self.watch(rerun.machine_mut());
        }

        /// Creates what was asked for, for a run of this program on this host; nothing if nothing was.
        ///
        /// # Errors
        /// The exit status, after a message.
        pub fn begin(
            options: &RunFileOptions,
            program: &str,
            host: &mut impl Host,
        ) -> Result<Option<McapRecording>, u8> {
            let mut sinks: Vec<Arc<dyn RunSink>> = Vec::new();
            let output = match &options.mcap {
                None => None,
                Some(path) => {
                    let output = create(path)?;
                    sinks.push(output.clone());
                    Some((output, path.clone()))
                }
            };
            let live = match options.foxglove {
                None => None,
                Some(address) => {
                    let live = LiveServer::begin(address, program).map(Arc::new).map_err(|fault| {
                        complain(fault);
                        USAGE
                    })?;
                    esl_command::say_error!("; Foxglove at ws://{}", live.address());
                    sinks.push(live.clone());
                    Some(live)
                }
            };
            let start = u64::try_from(host.wall_clock()).unwrap_or(0);
            let sink: Arc<dyn RunSink> = match <[Arc<dyn RunSink>; 1]>::try_from(sinks) {
                Ok([sink]) => sink,
                Err(sinks) if sinks.is_empty() => return Ok(None),
                Err(sinks) => Arc::new(RunSinks::new(sinks)),
            };
            let recorder = RunRecorder::begin(sink, start);
            let begun = (!host.is_virtual()).then(Instant::now);
            Ok(Some(McapRecording { output, live, recorder, begun }))
        }

        /// Returns the host, whose requests are recorded.
        pub fn host<H: Host>(&self, host: H) -> McapHost<H> {
            ObservedHost::new(host, self.recorder.clone())
        }

        /// Records the machine from now on.
        pub fn watch(&self, machine: &mut Vm) {
            if let Some(begun) = self.begun {
                self.recorder.set_delay(begun.elapsed());
            }
            machine.add_observer(Box::new(self.recorder.clone()));
        }

        /// Completes the file, and ends the connections.
        ///
        /// # Errors
        /// The exit status, after a message: a part of the file could not be written.
        pub fn end(self, machine: &mut Vm) -> Result<(), u8> {
            drop(machine.take_observers());
            self.recorder.end();
            if let Some(live) = self.live {
                live.end();
            }
            let Some((output, path)) = self.output else { return Ok(()) };
            output.finish();
            output.wait().map_err(|reason| {
                complain(format_args!("{} cannot be written: {reason}", path.display()));
                USAGE
            })
        }
    }

    /// Prints the figures of a file.
    pub(super) fn info(file: &Path) -> Result<u8, u8> {
        let refused = |fault: &dyn std::fmt::Display| {
            let text = fault.to_string();
            let name = file.display().to_string();
            let prefix = if text.starts_with(&name) { String::new() } else { format!("{name}: ") };
            complain(format_args!("{prefix}{text}"));
            USAGE
        };
        let mut bag = McapBag::open(file).map_err(|fault| refused(&fault))?;
        // The chunks of a file with a summary are not read for the figures, so damage shows here.
        for message in bag.messages(McapSelection::default()) {
            if let Err(fault) = message {
                return Err(refused(&fault));
            }
        }
        // Others may take a part of it only.
        _ = write!(std::io::stdout().lock(), "{bag}");
        Ok(if bag.damage().is_empty() { SUCCESS } else { FAILED })
    }
}

#[cfg(not(feature = "robots"))]
mod without_robots {
    use super::{Path, RunFileOptions, USAGE, Vm, complain};

    /// The host itself.
    pub type McapHost<H> = H;

    /// A run on its way to a file, which there is not without the feature.
    pub enum McapRecording {}

    fn refuse(what: &str) -> u8 {
        complain(format_args!(
            "{what} belongs to the feature robots, which this program is built without: type cargo install \
             --path commands/eslvm --features robots"
        ));
        USAGE
    }

    impl McapRecording {
        /// Refuses what was asked for.
        ///
        /// # Errors
        /// The exit status, after a message.
        pub fn of_replay(_path: &Path, _recorded: &esl_replay::Recorded) -> Result<McapRecording, u8> {
            Err(refuse("`--mcap`"))
        }

        /// Returns the host.
        pub fn host_of_replay(&self, host: esl::host::ReplayHost) -> Box<dyn esl::host::Host + Send> {
            Box::new(host)
        }

        /// Does nothing.
        pub fn watch_replay(&self, _rerun: &mut esl_replay::Rerun) {}

        /// Refuses what was asked for.
        ///
        /// # Errors
        /// The exit status, after a message.
        pub fn begin(
            options: &RunFileOptions,
            _program: &str,
            _host: &mut impl esl::host::Host,
        ) -> Result<Option<McapRecording>, u8> {
            match (&options.mcap, options.foxglove) {
                (Some(_), _) => Err(refuse("`--mcap`")),
                (None, Some(_)) => Err(refuse("`--foxglove`")),
                (None, None) => Ok(None),
            }
        }

        /// Returns the host.
        pub fn host<H>(&self, host: H) -> H {
            host
        }

        /// Does nothing.
        pub fn watch(&self, _machine: &mut Vm) {}

        /// Does nothing.
        ///
        /// # Errors
        /// None.
        pub fn end(self, _machine: &mut Vm) -> Result<(), u8> {
            match self {}
        }
    }

    pub(super) fn info(_file: &Path) -> Result<u8, u8> {
        Err(refuse("`eslvm mcap`"))
    }
}
