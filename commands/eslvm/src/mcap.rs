//! Runs as files of MCAP, `eslvm run --mcap`, and what is in such files, `eslvm mcap`.
//!
//! Both belong to the feature `robots`; without it they are refused with what to type.
#![allow(clippy::print_stdout, reason = "commands print")]

use std::io;
use std::path::Path;

use clap::Subcommand;
use esl_command::{USAGE, complain};
use esl_vm::vm::Vm;

/// What is done with files of MCAP.
#[derive(Subcommand)]
pub enum McapAction {
    /// Print the figures of a file: channels, messages, times, compression, and what is damaged
    ///
    /// Exit status: 0 the file is whole; 1 a part of it is damaged; 2 it cannot be read at all.
    Info {
        /// File, or the folder of a bag of ROS 2
        #[arg(value_name = "FILE")]
        file: std::path::PathBuf,
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
    use std::sync::Arc;
    use std::time::Instant;

    use esl::host::Host;
    use esl_command::{FAILED, SUCCESS};
    use esl_robots::mcap::{McapBag, McapOutput, McapSelection, OutputOptions};
    use esl_robots::run::{ObservedHost, RunRecorder};

    use super::{Path, USAGE, Vm, complain, io};

    /// A host that a recorder hears.
    pub type McapHost<H> = ObservedHost<H>;

    /// The recording of a run.
    pub struct McapRecording {
        output: Arc<McapOutput>,
        recorder: RunRecorder,
        /// Nothing for a run in virtual time.
        begun: Option<Instant>,
    }

    impl McapRecording {
        /// Creates the file, for a run on this host.
        ///
        /// # Errors
        /// The exit status, after a message.
        pub fn begin(path: &Path, host: &mut impl Host) -> Result<McapRecording, u8> {
            let options = OutputOptions { profile: "ros2".into(), ..OutputOptions::default() };
            let output = File::create(path).and_then(|file| McapOutput::begin(file, &options));
            let output = output.map(Arc::new).map_err(|error| {
                complain(format_args!("{} cannot be written: {error}", path.display()));
                USAGE
            })?;
            let start = u64::try_from(host.wall_clock()).unwrap_or(0);
            let recorder = RunRecorder::begin(output.clone(), start);
            let begun = (!host.is_virtual()).then(Instant::now);
            Ok(McapRecording { output, recorder, begun })
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

        /// Completes the file.
        ///
        /// # Errors
        /// A part of it could not be written.
        pub fn end(self, machine: &mut Vm) -> io::Result<()> {
            drop(machine.take_observers());
            self.recorder.end();
            self.output.finish();
            self.output.wait().map_err(io::Error::other)
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
        print!("{bag}");
        Ok(if bag.damage().is_empty() { SUCCESS } else { FAILED })
    }
}

#[cfg(not(feature = "robots"))]
mod without_robots {
    use super::{Path, USAGE, Vm, complain, io};

    /// The host itself.
    pub type McapHost<H> = H;

    /// The recording of a run, which there is not without the feature.
    pub enum McapRecording {}

    fn refuse(what: &str) -> u8 {
        complain(format_args!(
            "{what} belongs to the feature robots, which this program is built without: type cargo install \
             --path commands/eslvm --features robots"
        ));
        USAGE
    }

    impl McapRecording {
        /// Refuses.
        ///
        /// # Errors
        /// The exit status, after a message.
        pub fn begin(_path: &Path, _host: &mut impl esl::host::Host) -> Result<McapRecording, u8> {
            Err(refuse("`--mcap`"))
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
        pub fn end(self, _machine: &mut Vm) -> io::Result<()> {
            match self {}
        }
    }

    pub(super) fn info(_file: &Path) -> Result<u8, u8> {
        Err(refuse("`eslvm mcap`"))
    }
}
