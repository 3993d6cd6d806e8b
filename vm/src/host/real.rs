//! The real host: the system's clocks, streams and files.
//!
//! A single channel carries everything from other threads: messages, and chunks of standard input. A thread
//! reads standard input, one chunk per request of the program. So waiting for either, up to a deadline, is
//! one operation, and input that was not requested stays with the system.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::{Host, HostError, Input, Message, Output, Wake, WriteMode};

/// An arrival from another thread.
enum Incoming {
    Message(Message),
    Input(Input),
    /// A sender of messages is gone, perhaps the last.
    SenderGone,
    /// The current wait is to end.
    Wake,
}

/// Ends a wait of the host from any thread, to interrupt the machine while nothing runs.
#[derive(Clone)]
pub struct Waker(Sender<Incoming>);

impl Waker {
    /// Ends the current wait, or the next one.
    pub fn wake(&self) {
        // Without a host there is nothing to wake.
        let _ = self.0.send(Incoming::Wake);
    }
}

/// Sends messages to a virtual machine, from any thread.
pub struct MessageSender {
    channel: Sender<Incoming>,
    /// Token counted by the host, which thereby knows whether messages can still arrive.
    alive: Option<Arc<()>>,
}

impl MessageSender {
    /// Sends a message. Returns whether there is a receiver.
    pub fn send(&self, message: Message) -> bool {
        self.channel.send(Incoming::Message(message)).is_ok()
    }
}

impl Clone for MessageSender {
    fn clone(&self) -> MessageSender {
        MessageSender { channel: self.channel.clone(), alive: self.alive.clone() }
    }
}

impl Drop for MessageSender {
    fn drop(&mut self) {
        // The token is dropped first, because the host counts when it has received the notice.
        self.alive = None;
        let _ = self.channel.send(Incoming::SenderGone);
    }
}

/// Which files a program may read and write.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum FileAccess {
    /// No files.
    #[default]
    None,
    /// Files in these directories and below.
    Under(Vec<PathBuf>),
    /// All files that the system lets the process read and write.
    All,
}

/// Receives the bytes written by a program.
pub type Screen = Box<dyn FnMut(&[u8]) -> std::io::Result<()> + Send>;

/// The outside as provided by the operating system.
pub struct RealHost {
    start: Instant,
    arguments: Vec<String>,
    files: FileAccess,
    incoming: Receiver<Incoming>,
    sender: Sender<Incoming>,
    alive: Arc<()>,
    messages: Vec<Message>,
    input: Option<Input>,
    /// Requests a chunk from the reading thread, which is started at the first request.
    reader: Option<Sender<()>>,
    is_reading: bool,
    is_woken: bool,
    /// Destination of both output streams, in place of the process's own.
    screen: Option<Screen>,
    /// Nanoseconds of virtual time, if time is virtual.
    virtual_time: Option<u64>,
}

impl RealHost {
    /// Creates a host with these arguments for the program, and without access to files.
    pub fn new(arguments: Vec<String>) -> RealHost {
        let (sender, incoming) = channel();
        RealHost {
            start: Instant::now(),
            arguments,
            files: FileAccess::None,
            incoming,
            sender,
            alive: Arc::new(()),
            messages: Vec::new(),
            input: None,
            reader: None,
            is_reading: false,
            is_woken: false,
            screen: None,
            virtual_time: None,
        }
    }

    /// Redirects both output streams of the program to `screen`.
    #[must_use]
    pub fn with_screen(mut self, screen: Screen) -> RealHost {
        self.screen = Some(screen);
        self
    }

    /// Grants access to files.
    #[must_use]
    pub fn with_files(mut self, files: FileAccess) -> RealHost {
        self.files = files;
        self
    }

    /// Makes time virtual: it starts at zero, and passes only when the program waits or the host is told so.
    #[must_use]
    pub fn with_virtual_time(mut self) -> RealHost {
        self.virtual_time = Some(0);
        self
    }

    /// Returns a sender of messages to this host's program.
    pub fn sender(&self) -> MessageSender {
        MessageSender { channel: self.sender.clone(), alive: Some(self.alive.clone()) }
    }

    /// Returns a handle that ends this host's waits.
    pub fn waker(&self) -> Waker {
        Waker(self.sender.clone())
    }

    fn take_in(&mut self, incoming: Incoming) {
        match incoming {
            Incoming::Message(message) => self.messages.push(message),
            Incoming::Input(input) => {
                self.is_reading = false;
                self.input = Some(input);
            }
            Incoming::SenderGone => {}
            Incoming::Wake => self.is_woken = true,
        }
    }

    fn drain(&mut self) {
        while let Ok(incoming) = self.incoming.try_recv() {
            self.take_in(incoming);
        }
    }

    /// Makes sure that a chunk of input is requested.
    fn ask_for_input(&mut self) {
        if self.is_reading || self.input.is_some() {
            return;
        }
        if self.reader.is_none() {
            let (ask, asked) = channel();
            let answer = self.sender.clone();
            let spawned = std::thread::Builder::new()
                .name("standard-input".into())
                .spawn(move || read_on_demand(&asked, &answer));
            match spawned {
                Ok(_) => self.reader = Some(ask),
                Err(error) => {
                    self.input = Some(Input::Failed(error_of(&error)));
                    return;
                }
            }
        }
        self.is_reading = self.reader.as_ref().is_some_and(|reader| reader.send(()).is_ok());
    }

    fn check(&self, path: &str, must_exist: bool) -> Result<PathBuf, HostError> {
        let directories = match &self.files {
            FileAccess::None => return Err(HostError::Refused),
            FileAccess::All => return Ok(path.into()),
            FileAccess::Under(directories) => directories,
        };
        let full = resolve(Path::new(path), must_exist)?;
        let is_granted = directories.iter().any(|directory| {
            std::fs::canonicalize(directory).is_ok_and(|directory| full.starts_with(directory))
        });
        if is_granted { Ok(full) } else { Err(HostError::Refused) }
    }
}

/// Returns the path without links and dots, so that no link leads out of the granted directories.
fn resolve(path: &Path, must_exist: bool) -> Result<PathBuf, HostError> {
    match std::fs::canonicalize(path) {
        Ok(full) => Ok(full),
        Err(error) if must_exist || error.kind() != std::io::ErrorKind::NotFound => Err(error_of(&error)),
        // A write would follow a dangling link to a place that was not checked.
        Err(_) if path.symlink_metadata().is_ok() => Err(HostError::Refused),
        Err(_) => {
            let name = path.file_name().ok_or(HostError::NotFound)?;
            let parent = match path.parent() {
                Some(parent) if !parent.as_os_str().is_empty() => parent,
                _ => Path::new("."),
            };
            Ok(std::fs::canonicalize(parent).map_err(|error| error_of(&error))?.join(name))
        }
    }
}

/// Body of the thread that reads standard input.
fn read_on_demand(asked: &Receiver<()>, answer: &Sender<Incoming>) {
    let mut buffer = [0; 4096];
    while asked.recv().is_ok() {
        let input = loop {
            match std::io::stdin().lock().read(&mut buffer) {
                Ok(0) => break Input::End,
                Ok(n) => break Input::Data(buffer[..n].to_vec()),
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(error) => break Input::Failed(error_of(&error)),
            }
        };
        if answer.send(Incoming::Input(input)).is_err() {
            return;
        }
    }
}

fn error_of(error: &std::io::Error) -> HostError {
    use std::io::ErrorKind;
    match error.kind() {
        ErrorKind::BrokenPipe => HostError::BrokenPipe,
        ErrorKind::NotFound => HostError::NotFound,
        ErrorKind::PermissionDenied => HostError::Refused,
        ErrorKind::AlreadyExists => HostError::Exists,
        _ => HostError::Other(error.to_string()),
    }
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

impl Host for RealHost {
    fn monotonic(&mut self) -> u64 {
        self.virtual_time.unwrap_or_else(|| nanoseconds(self.start.elapsed()))
    }

    fn stopwatch(&mut self) -> u64 {
        nanoseconds(self.start.elapsed())
    }

    fn is_virtual(&self) -> bool {
        self.virtual_time.is_some()
    }

    fn advance(&mut self, nanoseconds: u64) {
        self.virtual_time = self.virtual_time.map(|time| time.saturating_add(nanoseconds));
    }

    fn wall_clock(&mut self) -> i64 {
        let since = |time: Result<Duration, std::time::SystemTimeError>| match time {
            Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
            Err(before) => i64::try_from(before.duration().as_nanos()).map_or(i64::MIN, |n| -n),
        };
        since(SystemTime::now().duration_since(UNIX_EPOCH))
    }

    fn wait(&mut self, deadline: Option<u64>, for_input: bool) -> Wake {
        self.drain();
        if for_input {
            self.ask_for_input();
        }
        loop {
            let is_woken = std::mem::take(&mut self.is_woken);
            if is_woken || !self.messages.is_empty() || for_input && self.input.is_some() {
                return Wake::Arrival;
            }
            if let (Some(now), Some(deadline), false) = (self.virtual_time, deadline, for_input) {
                // Input takes no virtual time, so that it arrives at the same time in each run; nothing else
                // is waited for.
                self.virtual_time = Some(now.max(deadline));
                return Wake::Time;
            }
            let deadline = if self.virtual_time.is_some() { None } else { deadline };
            let received = match deadline {
                None if !for_input && !self.has_senders() => return Wake::Never,
                None => self.incoming.recv().map_err(|_| RecvTimeoutError::Disconnected),
                Some(deadline) => {
                    let now = self.monotonic();
                    if now >= deadline {
                        return Wake::Time;
                    }
                    self.incoming.recv_timeout(Duration::from_nanos(deadline - now))
                }
            };
            match received {
                Ok(incoming) => self.take_in(incoming),
                Err(RecvTimeoutError::Timeout) => return Wake::Time,
                // The host itself holds a sender.
                Err(RecvTimeoutError::Disconnected) => return Wake::Never,
            }
        }
    }

    fn seed(&mut self) -> u64 {
        self.wall_clock() as u64 ^ u64::from(std::process::id()) << 40
    }

    fn arguments(&mut self) -> Vec<String> {
        self.arguments.clone()
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        if let Some(screen) = &mut self.screen {
            return screen(bytes).map_err(|error| error_of(&error));
        }
        let written = match output {
            Output::Standard => {
                let mut out = std::io::stdout().lock();
                out.write_all(bytes).and_then(|()| out.flush())
            }
            Output::Error => std::io::stderr().lock().write_all(bytes),
        };
        written.map_err(|error| error_of(&error))
    }

    fn read_input(&mut self) -> Input {
        self.drain();
        match self.input.take() {
            // The end is permanent and is not requested again.
            Some(Input::End) => {
                self.input = Some(Input::End);
                Input::End
            }
            Some(input) => input,
            None => {
                self.ask_for_input();
                Input::WouldBlock
            }
        }
    }

    fn is_interactive(&mut self) -> bool {
        std::io::IsTerminal::is_terminal(&std::io::stdout())
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        let path = self.check(path, true)?;
        std::fs::read(path).map_err(|error| error_of(&error))
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        let path = self.check(path, false)?;
        let mut options = std::fs::OpenOptions::new();
        match mode {
            WriteMode::Replace => options.write(true).create(true).truncate(true),
            WriteMode::Append => options.append(true).create(true),
            WriteMode::Create => options.write(true).create_new(true),
        };
        let written = options.open(path).and_then(|mut file| file.write_all(bytes));
        written.map_err(|error| error_of(&error))
    }

    fn file_exists(&mut self, path: &str) -> bool {
        self.check(path, true).is_ok_and(|path| path.is_file())
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        let path = self.check(path, true)?;
        std::fs::remove_file(path).map_err(|error| error_of(&error))
    }

    fn receive(&mut self) -> Vec<Message> {
        self.drain();
        std::mem::take(&mut self.messages)
    }

    fn has_senders(&self) -> bool {
        Arc::strong_count(&self.alive) > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(channel: &str) -> Message {
        Message { channel: channel.into(), arguments: Vec::new() }
    }

    #[test]
    fn messages_of_another_thread_arrive_in_order_and_end_a_wait() {
        let mut host = RealHost::new(Vec::new());
        let sender = host.sender();
        let thread = std::thread::spawn(move || {
            assert!(sender.send(message("a")));
            assert!(sender.clone().send(message("b")));
        });
        let mut channels = Vec::new();
        while host.wait(None, false) == Wake::Arrival {
            channels.extend(host.receive().into_iter().map(|message| message.channel));
        }
        assert_eq!(channels, ["a", "b"]);
        assert!(!host.has_senders());
        assert!(thread.join().is_ok());
    }

    #[test]
    fn a_waker_ends_a_wait_without_a_deadline() {
        let mut host = RealHost::new(Vec::new());
        let _sender = host.sender();
        let waker = host.waker();
        let thread = std::thread::spawn(move || waker.wake());
        assert_eq!(host.wait(None, false), Wake::Arrival);
        thread.join().unwrap();
    }

    #[test]
    fn a_deadline_ends_a_wait() {
        let mut host = RealHost::new(Vec::new());
        let deadline = host.monotonic() + 1;
        assert_eq!(host.wait(Some(deadline), false), Wake::Time);
        assert!(host.monotonic() >= deadline);
    }

    #[test]
    fn files_outside_of_the_grant_are_refused() {
        let directory = std::env::temp_dir().join(format!("esl-host-{}", std::process::id()));
        let inside = directory.join("inside");
        std::fs::create_dir_all(&inside).unwrap();
        let path = |name: &str| directory.join(name).to_str().unwrap().to_owned();
        let mut none = RealHost::new(Vec::new());
        assert_eq!(none.write_file(&path("inside/x"), b"x", WriteMode::Replace), Err(HostError::Refused));

        let mut host = RealHost::new(Vec::new()).with_files(FileAccess::Under(vec![inside]));
        assert_eq!(host.write_file(&path("inside/x"), b"one", WriteMode::Create), Ok(()));
        assert_eq!(host.write_file(&path("inside/x"), b"two", WriteMode::Append), Ok(()));
        assert_eq!(host.read_file(&path("inside/x")), Ok(b"onetwo".to_vec()));
        assert_eq!(host.write_file(&path("inside/x"), b"", WriteMode::Create), Err(HostError::Exists));
        assert_eq!(host.write_file(&path("inside/../y"), b"", WriteMode::Create), Err(HostError::Refused));
        assert_eq!(host.read_file(&path("inside/none")), Err(HostError::NotFound));
        assert!(host.file_exists(&path("inside/x")) && !host.file_exists(&path("inside/none")));
        assert_eq!(host.delete_file(&path("inside/x")), Ok(()));
        std::fs::remove_dir_all(&directory).unwrap();
    }
}
