//! Operating a run from outside: metrics, the monitor, sessions of operators, the system's service manager.
//!
//! Servers live on the event loop of `world/`. They read the run through surveys, which have no side effects;
//! commands go through the machine's inbox. Without an option nothing here runs.
//!
//! Guarantees: other machines reach a server only at an address that an option names, and over TLS; a server
//! that accepts commands asks for a secret, which is compared in constant time; the size of a request is
//! bounded before it is parsed. Nothing here prints: lines for the user go to a function of the caller.
//!
//! ```
//! use esl::Config;
//! use esl::host::VirtualHost;
//! use esl::program::{Source, begin, compile, machine};
//! use esl_operate::ServedPlaces;
//!
//! let mut machine = machine(Config::default(), Box::new(VirtualHost::new()))?;
//! let places = ServedPlaces { metrics: Some("127.0.0.1:0".parse()?), ..ServedPlaces::default() };
//! let mut said = Vec::new();
//! // The figures are served until this is dropped.
//! let served = places.begin(&mut machine, "rover.esl", &mut |line| said.push(line.to_string()))?;
//! assert!(said[0].starts_with("; metrics at http://127.0.0.1:"));
//! let program = compile(&[Source::new("rover.esl", "(sleep 60)")]).program.expect("there are no errors");
//! begin(&mut machine, &program)?;
//! machine.run(u64::MAX);
//! drop(served);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod attach;
mod http;
mod lobby;
mod metrics;
mod monitor;
#[cfg(any(test, fuzzing))]
#[doc(hidden)]
pub mod noise;
mod refusal;
mod scope;
mod secrets;
#[cfg(unix)]
pub mod service;
mod slime;

use std::fmt;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use esl_host::{Incoming, SurveyRequest};
use esl_vm::vm::Vm;
use esl_world::{NoEventLoop, TlsError, TlsIdentity};

use esl::program::Ended;

use attach::{Entrance, SessionsHandle};
use monitor::MonitorHandle;
use scope::RunScope;
use secrets::{OperatorRole, Secrets};

pub use secrets::SecretsError;

/// Places at which a run is served; nothing is without one.
#[derive(Clone, Debug, Default)]
pub struct ServedPlaces {
    /// Address at which figures of the run are served to Prometheus.
    pub metrics: Option<SocketAddr>,
    /// The address at which operators attach: the path of a socket that only its owner can open, or an
    /// address as [`parse_address`] takes it, which asks for a secret.
    pub listen: Option<String>,
    /// Address at which the run is shown in a browser.
    pub monitor: Option<SocketAddr>,
    /// File with the secrets of the roles: lines such as `observe SECRET`, `command SECRET` and `patch
    /// SECRET`. Without it they are made anew, and said.
    pub secrets: Option<PathBuf>,
    /// File with certificates, in PEM, and file with the key of the first. With them, all that listens at an
    /// address speaks TLS; an address that other machines reach asks for it.
    pub identity: Option<(PathBuf, PathBuf)>,
    /// The picture of the program that the monitor shows live.
    pub mission: Option<MissionPicture>,
}

/// Returns a picture of a program in SVG, or `None` if there is none.
type DrawMission = dyn Fn() -> Option<String> + Send + Sync;

/// A picture of a program in SVG, drawn when a viewer wants to see it. The monitor finds in it tasks,
/// functions and failures by the attributes `data-name`, `data-range`, `data-begins`, `data-from` and
/// `data-to`.
#[derive(Clone)]
pub struct MissionPicture(Arc<DrawMission>);

impl MissionPicture {
    /// Creates one from the function that draws it, which is called on a thread of its own.
    pub fn new(draw: impl Fn() -> Option<String> + Send + Sync + 'static) -> MissionPicture {
        MissionPicture(Arc::new(draw))
    }
}

impl fmt::Debug for MissionPicture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("MissionPicture")
    }
}

/// Reason why a run is not served.
#[derive(Debug)]
#[non_exhaustive]
pub enum OperateError {
    /// There are no secrets, or none in this file.
    Secrets(Option<PathBuf>, SecretsError),
    /// Certificate or key is not valid.
    Tls(TlsError),
    /// Other machines reach the address, and would hear what is said there.
    Exposed(SocketAddr),
    /// No socket can be made at this path; without an error, since this system has none.
    Path(PathBuf, Option<io::Error>),
    /// Nothing can listen at this address.
    Address(SocketAddr, io::Error),
    /// The event loop cannot be started.
    EventLoop(NoEventLoop),
    /// The part of the library for operators cannot be loaded.
    Library(esl::Error),
}

impl fmt::Display for OperateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OperateError::Secrets(None, error) => error.fmt(f),
            OperateError::Secrets(Some(path), error) => write!(f, "{}: {error}", path.display()),
            OperateError::Tls(error) => error.fmt(f),
            OperateError::Exposed(address) => write!(
                f,
                "others could read the traffic at {address}: use --certificate FILE --key FILE, or a port of \
                 127.0.0.1, which others reach by ssh -L"
            ),
            OperateError::Path(path, Some(error)) => {
                write!(f, "cannot listen for operators at {}: {error}", path.display())
            }
            OperateError::Path(path, None) => {
                write!(f, "cannot listen for operators at {}: expected a port such as 4005", path.display())
            }
            OperateError::Address(address, error) => write!(f, "cannot listen at {address}: {error}"),
            OperateError::EventLoop(error) => write!(f, "the event loop cannot be started: {error}"),
            OperateError::Library(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for OperateError {}

impl From<NoEventLoop> for OperateError {
    fn from(error: NoEventLoop) -> OperateError {
        OperateError::EventLoop(error)
    }
}

/// The services of a run. At the end of the run they notify viewers and operators, and are dropped.
#[derive(Default)]
pub struct ServedRun {
    socket: Option<PathBuf>,
    monitor: Option<MonitorHandle>,
    sessions: Option<SessionsHandle>,
}

impl std::fmt::Debug for ServedRun {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServedRun").field("socket", &self.socket).finish_non_exhaustive()
    }
}

/// Time that viewers and operators have to hear how a run has ended.
const FAREWELL: Duration = Duration::from_secs(1);
/// Time that answers have that the run has given before its end, to be on their way before that is told.
const ANSWERS: Duration = Duration::from_millis(200);

impl ServedRun {
    /// Tells viewers of the monitor and attached operators how the run of a machine has ended, with this exit
    /// status and report, without waiting for peers that do not read.
    pub fn end(&self, machine: &Vm, ended: Ended, status: u8, report: Option<&str>) {
        let how = match ended {
            Ended::Normally(_) => "",
            Ended::Failed => ": a failure or an abort has ended the main task",
            Ended::Deadlocked => ": no task could ever run again",
            Ended::BudgetSpent => ": its budget of ticks is spent",
            Ended::HeapExhausted => ": its memory is exhausted",
            Ended::Signalled(_) => ": a signal of the process has ended it",
        };
        let said = format!("the run has ended with status {status}{how}");
        let told_monitor = self.monitor.as_ref().map(|monitor| {
            let request = SurveyRequest { failures_after: Some(0), data: true, ..SurveyRequest::default() };
            monitor.end(
                RunEnd { status, said: said.clone(), report: report.map(String::from) },
                machine.survey(&request),
            );
        });
        let told_sessions = self.sessions.as_ref().map(|sessions| {
            machine.inbox().end_questions();
            wait_until(ANSWERS, || sessions.is_answered());
            sessions.end(&said);
        });
        if told_monitor.is_none() && told_sessions.is_none() {
            return;
        }
        wait_until(FAREWELL, || {
            self.monitor.as_ref().is_none_or(MonitorHandle::is_told)
                && self.sessions.as_ref().is_none_or(SessionsHandle::is_told)
        });
    }
}

/// Waits until a condition is true, or the time is over.
fn wait_until(time: Duration, holds: impl Fn() -> bool) {
    let deadline = Instant::now() + time;
    while !holds() && Instant::now() < deadline {
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// How a run has ended.
#[derive(Clone, Debug)]
struct RunEnd {
    /// Its exit status.
    status: u8,
    /// Its description.
    said: String,
    /// The last report.
    report: Option<String>,
}

impl Drop for ServedRun {
    fn drop(&mut self) {
        if let Some(path) = &self.socket {
            // It may be gone.
            drop(std::fs::remove_file(path));
        }
    }
}

/// Parses a port, of the loopback unless an address comes before it.
///
/// # Errors
/// The form that was expected, if the text has another one.
pub fn parse_address(text: &str) -> Result<SocketAddr, &'static str> {
    match text.parse() {
        Ok(port) => Ok(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port)),
        Err(_) => {
            text.parse().map_err(|_| "expected a port such as 9464, or an address such as 10.0.0.7:9464")
        }
    }
}

impl ServedPlaces {
    /// Loads the functions of the library that the services call into a machine that is about to run a
    /// program. [`begin`](Self::begin) does that too; to record the run, call this before anything else
    /// changes the machine, as a replay does.
    ///
    /// # Errors
    /// [`OperateError::Library`].
    pub fn prepare(&self, machine: &mut Vm) -> Result<(), OperateError> {
        if self.listen.is_none() && self.monitor.is_none() {
            return Ok(());
        }
        esl::program::load_operators(machine).map_err(OperateError::Library)
    }

    /// Begins to serve the run of a program of this name, before the machine runs it. `say` is told, line by
    /// line, where what is served. Returns what is to be told of the end, and dropped after the run.
    ///
    /// # Errors
    /// [`OperateError`].
    pub fn begin(
        &self,
        machine: &mut Vm,
        program: &str,
        say: &mut dyn FnMut(&str),
    ) -> Result<ServedRun, OperateError> {
        self.prepare(machine)?;
        let scope = RunScope::new(machine);
        let mut served = ServedRun::default();
        // Whether an operator may attach that can signal an input.
        let mut may_signal = false;
        if self.metrics.is_some() || self.listen.is_some() || self.monitor.is_some() {
            watch_closely(machine);
        }
        let identity = self.identity()?;
        let scheme = if identity.is_some() { "https" } else { "http" };
        if let Some(address) = self.metrics {
            self.keeps_secret(address)?;
            let (listener, address) = listen(address)?;
            say(&format!("; metrics at {scheme}://{address}/metrics"));
            metrics::serve(listener, identity.clone(), scope.clone())?;
        }
        if let Some(address) = self.monitor {
            self.keeps_secret(address)?;
            let secrets = self.secrets()?;
            may_signal |= secrets.may_signal();
            let (listener, address) = listen(address)?;
            for role in [OperatorRole::Observe, OperatorRole::Command] {
                if let (Some(secret), None) = (secrets.of(role), &self.secrets) {
                    say(&format!("; monitor, to {role}: {scheme}://{address}/#token={secret}"));
                }
            }
            if self.secrets.is_some() {
                say(&format!("; monitor at {scheme}://{address}/#token=SECRET"));
            }
            let program = program.to_string();
            let handle = monitor::serve(
                listener,
                identity.clone(),
                scope.clone(),
                secrets,
                program,
                self.mission.clone(),
            );
            served.monitor = Some(handle?);
        }
        if let Some(place) = &self.listen {
            let entrance = match parse_address(place) {
                Ok(address) => {
                    self.keeps_secret(address)?;
                    let secrets = self.secrets()?;
                    may_signal |= secrets.may_signal();
                    let (listener, address) = listen(address)?;
                    let flag = if identity.is_some() { "--tls " } else { "" };
                    say(&format!("; operators attach with eslvm attach {flag}{address}"));
                    self.say_secrets(&secrets, say);
                    Entrance::Tcp(listener, secrets, identity)
                }
                Err(_) => {
                    let path = PathBuf::from(place);
                    let entrance = listen_at_path(&path)?;
                    say(&format!("; operators attach with eslvm attach {place}"));
                    served.socket = Some(path);
                    may_signal = true;
                    entrance
                }
            };
            served.sessions = Some(attach::serve(machine, entrance, scope)?);
        }
        if may_signal {
            machine.inbox().put(Incoming::Attended);
        }
        Ok(served)
    }

    fn secrets(&self) -> Result<Secrets, OperateError> {
        let made = self.secrets.as_deref().map_or_else(Secrets::random, Secrets::read);
        made.map_err(|error| OperateError::Secrets(self.secrets.clone(), error))
    }

    /// Reads what connections are secured with, if that is asked for.
    fn identity(&self) -> Result<Option<TlsIdentity>, OperateError> {
        let Some((certificate, key)) = &self.identity else { return Ok(None) };
        TlsIdentity::read(certificate, key).map(Some).map_err(OperateError::Tls)
    }

    /// Refuses an address that other machines reach, unless what is said there is secret.
    fn keeps_secret(&self, address: SocketAddr) -> Result<(), OperateError> {
        if address.ip().is_loopback() || self.identity.is_some() {
            return Ok(());
        }
        Err(OperateError::Exposed(address))
    }

    /// Says the secrets that were made for this run.
    fn say_secrets(&self, secrets: &Secrets, say: &mut dyn FnMut(&str)) {
        if self.secrets.is_none() {
            for role in OperatorRole::ALL {
                say(&format!(";   to {role}: ESL_SECRET={}", secrets.of(role).unwrap_or_default()));
            }
        }
    }
}

/// Listens at the path of a socket that only the owner of the process can open.
#[cfg(unix)]
fn listen_at_path(path: &Path) -> Result<Entrance, OperateError> {
    use rustix::fs::Mode;
    use std::os::unix::net::{UnixListener, UnixStream};
    let bind = || {
        let mask = rustix::process::umask(Mode::from_raw_mode(0o177));
        let listener = UnixListener::bind(path);
        rustix::process::umask(mask);
        let listener = listener?;
        listener.set_nonblocking(true)?;
        Ok::<_, std::io::Error>(listener)
    };
    let mut listener = bind();
    let is_left = |error: &std::io::Error| {
        let refused = |error: std::io::Error| error.kind() == std::io::ErrorKind::ConnectionRefused;
        error.kind() == std::io::ErrorKind::AddrInUse && UnixStream::connect(path).is_err_and(refused)
    };
    if listener.as_ref().is_err_and(is_left) {
        // A run that was killed has left it.
        listener = std::fs::remove_file(path).and_then(|()| bind());
    }
    listener.map(Entrance::Unix).map_err(|error| OperateError::Path(path.into(), Some(error)))
}

#[cfg(not(unix))]
fn listen_at_path(path: &Path) -> Result<Entrance, OperateError> {
    Err(OperateError::Path(path.into(), None))
}

/// Has figures gathered and a journal kept.
fn watch_closely(machine: &mut Vm) {
    machine.gather_figures(false);
    machine.keep_journal();
}

/// Listens at an address, and returns the one that the system has given.
fn listen(address: SocketAddr) -> Result<(TcpListener, SocketAddr), OperateError> {
    let listener = TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        Ok((listener, address))
    });
    listener.map_err(|error| OperateError::Address(address, error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_one_of_the_loopback() {
        assert_eq!(parse_address("9464").map(|address| address.to_string()), Ok("127.0.0.1:9464".into()));
        assert_eq!(parse_address("[::]:80").map(|address| address.to_string()), Ok("[::]:80".into()));
        assert!(parse_address("host:80").is_err() && parse_address("70000").is_err());
    }
}
