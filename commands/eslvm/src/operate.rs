//! The options of `eslvm run` by which a run is operated from outside.
//!
//! ```
//! use clap::Parser;
//! use esl::Config;
//! use esl::host::VirtualHost;
//! use esl::program::{Source, begin, compile, machine};
//! use eslvm::operate::OperateOptions;
//!
//! #[derive(Parser)]
//! struct Options {
//!     #[command(flatten)]
//!     operate: OperateOptions,
//! }
//!
//! let options = Options::parse_from(["rover", "--metrics", "0"]);
//! let mut machine = machine(Config::default(), Box::new(VirtualHost::new()))?;
//! // Prints the address at which the figures are. They are served until this is dropped.
//! let served = options.operate.begin(&mut machine, "rover.esl").expect("any port will do");
//! let program = compile(&[Source::new("rover.esl", "(sleep 60)")]).program.expect("there are no errors");
//! begin(&mut machine, &program)?;
//! machine.run(u64::MAX);
//! drop(served);
//! # Ok::<(), esl::Error>(())
//! ```

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use clap::Args;
use esl::module_path::ModulePath;
use esl::program::{Source, compile_with_core};
use esl_analysis::render::render_graph;
use esl_analysis::{AnalysisOptions, analyze};
use esl_command::{USAGE, complain, say_error};
#[cfg(unix)]
use esl_operate::service::{ServiceManager, WatchedRun};
use esl_operate::{MissionPicture, ServedPlaces, ServedRun, parse_address};
use esl_vm::vm::Vm;

/// Options by which a run can be operated from outside.
#[derive(Args, Clone, Debug, Default)]
pub struct OperateOptions {
    /// Serve metrics of the run to Prometheus at a port of 127.0.0.1, or at ADDRESS:PORT
    #[arg(long, value_name = "[ADDRESS:]PORT", value_parser = parse_address)]
    metrics: Option<SocketAddr>,
    /// Let operators attach to the run with `eslvm attach`: at the path of a socket that only its owner can
    /// open; or at a port of 127.0.0.1 or ADDRESS:PORT, which requires a secret
    #[arg(long, value_name = "PATH|[ADDRESS:]PORT")]
    listen: Option<String>,
    /// Show the run in a browser, at a port of 127.0.0.1 or at ADDRESS:PORT; at any free port without a
    /// number
    #[arg(long, value_name = "[ADDRESS:]PORT", num_args = 0..=1, require_equals = true, default_missing_value = "0",
          value_parser = parse_address)]
    monitor: Option<SocketAddr>,
    /// File with the secrets of the roles: lines such as `observe SECRET`, `command SECRET` and `patch
    /// SECRET`; without it each run generates new secrets and prints them
    #[arg(long, value_name = "FILE")]
    secrets: Option<PathBuf>,
    /// Secure all ports with TLS, by the certificates of this file, in PEM; required for an address that
    /// other machines reach
    #[arg(long, value_name = "FILE", requires = "key")]
    certificate: Option<PathBuf>,
    /// File with the key of the certificate, in PEM
    #[arg(long, value_name = "FILE", requires = "certificate")]
    key: Option<PathBuf>,
}

impl OperateOptions {
    fn places(&self, mission: Option<MissionPicture>) -> ServedPlaces {
        ServedPlaces {
            metrics: self.metrics,
            listen: self.listen.clone(),
            monitor: self.monitor,
            secrets: self.secrets.clone(),
            identity: self.certificate.clone().zip(self.key.clone()),
            mission,
        }
    }

    /// Loads the functions of the library that the services call, before anything else changes the machine.
    ///
    /// # Errors
    /// The exit status, after a message.
    pub fn prepare(&self, machine: &mut Vm) -> Result<(), u8> {
        self.places(None).prepare(machine).map_err(|error| {
            complain(error);
            USAGE
        })
    }

    /// Begins to serve what was asked for, before the machine runs a program of this name. Returns what is
    /// to be told of the end, and dropped after the run.
    ///
    /// # Errors
    /// The exit status, after a message.
    pub fn begin(&self, machine: &mut Vm, program: &str) -> Result<ServedRun, u8> {
        self.begin_with(machine, program, None)
    }

    /// Begins to serve as [`begin`](Self::begin) does, with a picture of the program for the monitor.
    ///
    /// # Errors
    /// The exit status, after a message.
    pub fn begin_with(
        &self,
        machine: &mut Vm,
        program: &str,
        mission: Option<MissionPicture>,
    ) -> Result<ServedRun, u8> {
        self.places(mission).begin(machine, program, &mut |line| say_error!("{line}")).map_err(|error| {
            complain(error);
            USAGE
        })
    }
}

/// Returns the picture of a program in a source file: its failures, clauses, tasks and goals.
pub fn mission_of(file: &Path, path: &ModulePath) -> MissionPicture {
    let (file, path) = (file.to_path_buf(), path.clone());
    MissionPicture::new(move || {
        let text = std::fs::read_to_string(&file).ok()?;
        let name = file.display().to_string();
        let mut compiled = compile_with_core(&[Source::new(name.clone(), text)], &path);
        let cores = std::mem::take(&mut compiled.core);
        if compiled.has_errors() {
            return None;
        }
        let (table, _) = analyze(cores, &compiled.sources, &AnalysisOptions::default());
        (!table.is_incomplete).then(|| render_graph(&table, &name))
    })
}

/// Tells the service manager of the system, if the command was started by one that waits for it, that the
/// program of this name runs. Returns what tells it of the end when it is dropped.
///
/// # Errors
/// The exit status, after a message.
#[cfg(unix)]
pub fn tell_manager(machine: &Vm, program: &str) -> Result<Option<WatchedRun>, u8> {
    let watched = ServiceManager::of_environment()
        .and_then(|manager| manager.map(|manager| manager.ready(machine, program)).transpose());
    watched.map_err(|error| {
        complain(format_args!("the service manager that NOTIFY_SOCKET names cannot be told: {error}"));
        USAGE
    })
}

/// Does nothing: this system has no such manager.
///
/// # Errors
/// Never.
#[cfg(not(unix))]
pub fn tell_manager(_machine: &Vm, _program: &str) -> Result<Option<()>, u8> {
    Ok(None)
}
