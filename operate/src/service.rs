//! A run as a service of systemd: the protocol of `sd_notify(3)`.
//!
//! The manager names a socket in `NOTIFY_SOCKET`. It is told when the program runs and when it has ended,
//! and, if `WATCHDOG_USEC` asks for it, that the machine still takes turns: the thread that tells it requests
//! an inspection, which the machine answers between two turns and while its tasks wait, and passes on that it
//! was answered. A machine that does not answer is not reported, so the manager ends and restarts it.
//!
//! Not here: the log. The output of a program goes to the journal as it is.

use std::io;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use esl_host::{Inbox, Inspection, SurveyRequest};
use esl_vm::vm::Vm;

/// Longest time that news wait until there is room for them.
const PATIENCE: Duration = Duration::from_secs(5);

/// A service manager that waits for news of a run.
#[derive(Debug)]
pub struct ServiceManager {
    socket: UnixDatagram,
    address: SocketAddr,
    /// Time within which a sign of life is expected.
    patience: Option<Duration>,
}

/// A run that a service manager watches, until this is dropped.
#[derive(Debug)]
pub struct WatchedRun {
    manager: ServiceManager,
    /// Ends the thread that watches the machine.
    _watch: Option<Sender<()>>,
}

impl ServiceManager {
    /// Returns the manager that the environment of the process names, if it names one.
    ///
    /// # Errors
    /// The reason why it cannot be told anything.
    pub fn of_environment() -> io::Result<Option<ServiceManager>> {
        let Some(address) = std::env::var_os("NOTIFY_SOCKET").filter(|address| !address.is_empty()) else {
            return Ok(None);
        };
        let socket = UnixDatagram::unbound()?;
        // A manager that does not read must not hold up the run, nor its end.
        socket.set_write_timeout(Some(PATIENCE))?;
        let address = address_of(address.as_encoded_bytes())?;
        let number = |name| std::env::var(name).ok().and_then(|text| text.parse::<u64>().ok());
        let is_watched =
            number("WATCHDOG_PID").is_none_or(|process| process == u64::from(std::process::id()));
        let patience = number("WATCHDOG_USEC").filter(|&patience| patience > 0 && is_watched);
        Ok(Some(ServiceManager { socket, address, patience: patience.map(Duration::from_micros) }))
    }

    /// Tells the manager that the program of a machine runs, and has the machine watched.
    ///
    /// # Errors
    /// The reason why the manager cannot be told.
    pub fn ready(self, machine: &Vm, program: &str) -> io::Result<WatchedRun> {
        self.tell(&format!("READY=1\nSTATUS={program} runs\nMAINPID={}", std::process::id()))?;
        let watch = match self.patience {
            Some(patience) => Some(self.watch(machine.inbox(), patience / 3)?),
            None => None,
        };
        Ok(WatchedRun { manager: self, _watch: watch })
    }

    /// Begins to tell the manager at intervals that the machine with this inbox takes turns.
    fn watch(&self, inbox: Inbox, interval: Duration) -> io::Result<Sender<()>> {
        let (end, ended) = channel();
        let socket = self.socket.try_clone()?;
        let address = self.address.clone();
        let tell = move || {
            // A manager that is being restarted is told by the next sign.
            drop(socket.send_to_addr(b"WATCHDOG=1", &address));
        };
        let thread = std::thread::Builder::new().name("esl-watchdog".into());
        thread.spawn(move || watch(&inbox, interval, &ended, tell))?;
        Ok(end)
    }

    fn tell(&self, news: &str) -> io::Result<()> {
        self.socket.send_to_addr(news.as_bytes(), &self.address).map(drop)
    }
}

impl Drop for WatchedRun {
    fn drop(&mut self) {
        // A manager that is gone needs no news.
        drop(self.manager.tell("STOPPING=1"));
    }
}

/// Calls `tell` at intervals, each time after the machine has answered, until the run has ended.
fn watch(inbox: &Inbox, interval: Duration, ended: &Receiver<()>, tell: impl Fn()) {
    while ended.recv_timeout(interval) == Err(RecvTimeoutError::Timeout) {
        let (answer, answered) = channel();
        let request = SurveyRequest::default();
        inbox.inspect(Inspection::Survey(request, Box::new(move |_| _ = answer.send(()))));
        if answered.recv().is_ok() {
            tell();
        }
    }
}

/// Returns the address that a manager has given: a path, or after an `@` a name of Linux.
fn address_of(text: &[u8]) -> io::Result<SocketAddr> {
    use std::os::unix::ffi::OsStrExt;
    match text.strip_prefix(b"@") {
        #[cfg(target_os = "linux")]
        Some(name) => <SocketAddr as std::os::linux::net::SocketAddrExt>::from_abstract_name(name),
        #[cfg(not(target_os = "linux"))]
        Some(_) => Err(io::ErrorKind::Unsupported.into()),
        None => SocketAddr::from_pathname(std::ffi::OsStr::from_bytes(text)),
    }
}
