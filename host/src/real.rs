//! The real host: the system's clocks, streams and files.
//!
//! A thread reads standard input, one chunk per request of the program, and then puts a note into the inbox.
//! So waiting for either, up to a deadline, is one operation, and input that was not requested stays with the
//! system.
//!
//! Output to a pipe, a terminal or a socket is written as far as there is room; a thread waits for more room,
//! and then puts a note into the inbox. Everything else takes output without delay, or at its own pace.

use std::io::{Read, Write};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::real_files::request_of_files;
#[cfg(unix)]
use super::real_output::{OutputState, PIECE, await_room, with_descriptor};
use super::rights::{permit, resolve};
use super::{
    Awaited, FileAnswer, FileRequest, Host, HostError, Inbox, Incoming, Input, Output, Permit, Right, Rights,
    VIRTUAL_BEGINNING, Wake, WriteMode,
};

/// Receives the bytes written by a program.
pub type Screen = Box<dyn FnMut(&[u8]) -> std::io::Result<()> + Send>;

/// Chunk of standard input that was read and not taken yet.
#[derive(Clone, Default)]
struct PendingInput(Arc<Mutex<Option<Input>>>);

impl PendingInput {
    fn lock(&self) -> MutexGuard<'_, Option<Input>> {
        // The chunk is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The outside as provided by the operating system.
pub struct RealHost {
    start: Instant,
    arguments: Vec<String>,
    rights: Rights,
    inbox: Inbox,
    input: PendingInput,
    /// Requests a chunk from the reading thread, which is started at the first request.
    reader: Option<Sender<()>>,
    is_reading: bool,
    /// The states of standard output and standard error.
    #[cfg(unix)]
    outputs: [OutputState; 2],
    /// Destination of both output streams, in place of the process's own.
    screen: Option<Screen>,
    /// Nanoseconds of the program's clock at the start.
    elapsed: u64,
    /// Nanoseconds of virtual time, if time is virtual.
    virtual_time: Option<u64>,
    /// Whether the outside tells the time.
    is_external: bool,
    /// Seconds of the program's clock in a second.
    speed: f64,
}

impl RealHost {
    /// Creates a host with these arguments for the program, which grants no rights.
    pub fn new(arguments: Vec<String>) -> RealHost {
        RealHost {
            start: Instant::now(),
            arguments,
            rights: Rights::none(),
            inbox: Inbox::new(),
            input: PendingInput::default(),
            reader: None,
            is_reading: false,
            #[cfg(unix)]
            outputs: Default::default(),
            screen: None,
            elapsed: 0,
            virtual_time: None,
            is_external: false,
            speed: 1.0,
        }
    }

    /// Redirects both output streams of the program to `screen`.
    #[must_use]
    pub fn with_screen(mut self, screen: Screen) -> RealHost {
        self.screen = Some(screen);
        self
    }

    /// Grants rights, in place of those before.
    #[must_use]
    pub fn with_rights(mut self, rights: Rights) -> RealHost {
        self.rights = rights;
        self
    }

    /// Makes time virtual: it starts at zero, the beginning of the year 2000, and passes only when the
    /// program waits or the host is told so.
    #[must_use]
    pub fn with_virtual_time(mut self) -> RealHost {
        self.virtual_time = Some(0);
        self
    }

    /// Starts the program's clock at this number of nanoseconds, as for a run that goes on.
    #[must_use]
    pub fn with_elapsed(mut self, nanoseconds: u64) -> RealHost {
        self.elapsed = nanoseconds;
        self.virtual_time = self.virtual_time.map(|_| nanoseconds);
        self
    }

    /// Takes the time from [`Inbox::set_time`], such as that of a simulator, in place of real time. It stands
    /// still until then. From a signal on that ends the run, time passes as real time does, so that cleanups
    /// have an end.
    #[must_use]
    pub fn with_external_time(mut self) -> RealHost {
        self.is_external = true;
        self.inbox.external_clock().begin();
        self
    }

    /// Has so many seconds of the program's clock pass in a second of real time: for a program whose outside
    /// is a simulator that is as fast. The wall clock is not affected.
    #[must_use]
    pub fn with_speed(mut self, speed: f64) -> RealHost {
        self.speed = speed;
        self
    }

    /// Waits until the outside tells a time that reaches `deadline`, or something arrives.
    fn wait_for_outside(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        let clock = self.inbox.external_clock();
        let (left, is_due) = clock.begin_wait(deadline);
        if !is_due {
            self.inbox.wait(left.map(Duration::from_nanos));
        }
        clock.end_wait();
        if awaited.input && self.input.lock().is_some() {
            return Wake::Arrival;
        }
        // The clock itself may have rung.
        if self.inbox.quieten_if_empty() { Wake::Time } else { self.inbox.why_rung() }
    }

    /// Makes sure that a chunk of input is requested.
    fn ask_for_input(&mut self) {
        if self.is_reading || self.input.lock().is_some() {
            return;
        }
        if self.reader.is_none() {
            let (ask, asked) = channel();
            let (arrived, inbox) = (self.input.clone(), self.inbox.clone());
            // Where time is virtual, input takes none of it: the program notices when all its tasks wait.
            let is_virtual = self.virtual_time.is_some();
            let spawned = std::thread::Builder::new().name("standard-input".into()).spawn(move || {
                while asked.recv().is_ok() {
                    *arrived.lock() = Some(read_chunk());
                    if is_virtual { inbox.ring() } else { inbox.put(Incoming::Input) }
                }
            });
            match spawned {
                Ok(_) => self.reader = Some(ask),
                Err(error) => {
                    *self.input.lock() = Some(Input::Failed(error_of(&error)));
                    return;
                }
            }
        }
        self.is_reading = self.reader.as_ref().is_some_and(|reader| reader.send(()).is_ok());
    }
}

/// Waits for a chunk of standard input.
fn read_chunk() -> Input {
    let mut buffer = [0; 4096];
    loop {
        match std::io::stdin().lock().read(&mut buffer) {
            Ok(0) => return Input::End,
            Ok(n) => return Input::Data(buffer[..n].to_vec()),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(error) => return Input::Failed(error_of(&error)),
        }
    }
}

fn error_of(error: &std::io::Error) -> HostError {
    HostError::from(error)
}

fn nanoseconds(duration: Duration) -> u64 {
    let whole = duration.as_secs().saturating_mul(1_000_000_000);
    whole.saturating_add(duration.subsec_nanos().into())
}

/// Returns a duration times a factor, the longest there is if that is out of range.
#[inline]
fn scaled(duration: Duration, factor: f64) -> Duration {
    if factor == 1.0 {
        return duration;
    }
    Duration::try_from_secs_f64(duration.as_secs_f64() * factor).unwrap_or(Duration::MAX)
}

impl Host for RealHost {
    fn monotonic(&mut self) -> u64 {
        match self.virtual_time {
            Some(time) => time,
            None if self.is_external => self.inbox.external_clock().elapsed(),
            None => self.elapsed.saturating_add(nanoseconds(scaled(self.start.elapsed(), self.speed))),
        }
    }

    #[cfg(unix)]
    fn processor_time(&mut self) -> u64 {
        use rustix::time::{ClockId, clock_gettime};
        let spent = clock_gettime(ClockId::ProcessCPUTime);
        (spent.tv_sec as u64).saturating_mul(1_000_000_000).saturating_add(spent.tv_nsec as u64)
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
        if let Some(time) = self.virtual_time {
            return VIRTUAL_BEGINNING.saturating_add_unsigned(time);
        }
        if self.is_external {
            return self.inbox.external_clock().time();
        }
        let since = |time: Result<Duration, std::time::SystemTimeError>| match time {
            Ok(after) => i64::try_from(after.as_nanos()).unwrap_or(i64::MAX),
            Err(before) => i64::try_from(before.duration().as_nanos()).map_or(i64::MIN, |n| -n),
        };
        since(SystemTime::now().duration_since(UNIX_EPOCH))
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        if awaited.input {
            self.ask_for_input();
        }
        if awaited.input && self.input.lock().is_some() {
            return Wake::Arrival;
        }
        if self.inbox.is_rung() {
            return self.inbox.why_rung();
        }
        let deadline = match (self.virtual_time, deadline) {
            // Input takes no virtual time, so that it arrives at the same time in each run; nothing else is
            // waited for.
            (Some(_), _) if awaited.input => None,
            (Some(now), Some(deadline)) => {
                self.virtual_time = Some(now.max(deadline));
                return Wake::Time;
            }
            (_, deadline) => deadline,
        };
        if self.is_external && (deadline.is_some() || awaited != Awaited::default()) {
            return self.wait_for_outside(deadline, awaited);
        }
        let time = match deadline {
            None if awaited == Awaited::default() => return Wake::Never,
            None => None,
            Some(deadline) => {
                let left = Duration::from_nanos(deadline.saturating_sub(self.monotonic()));
                Some(scaled(left, self.speed.recip()))
            }
        };
        if !self.inbox.wait(time) {
            return Wake::Time;
        }
        if awaited.input && self.input.lock().is_some() { Wake::Arrival } else { self.inbox.why_rung() }
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

    #[cfg(unix)]
    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        // Where time is virtual, a reader takes none of it.
        let is_at_once = self.screen.is_some() || self.virtual_time.is_some();
        if is_at_once || !self.outputs[output as usize].is_delayed(output) {
            return self.write(output, bytes).map(|()| bytes.len());
        }
        let mut done = 0;
        while done < bytes.len() {
            let piece = &bytes[done..bytes.len().min(done + PIECE)];
            let written = match await_room(output, false) {
                true => with_descriptor(output, |descriptor| rustix::io::write(descriptor, piece)),
                false => Err(rustix::io::Errno::AGAIN),
            };
            match written {
                Ok(count) => done += count,
                Err(rustix::io::Errno::INTR) => {}
                Err(rustix::io::Errno::AGAIN) if self.outputs[output as usize].watch(output, &self.inbox) => {
                    return Ok(done);
                }
                Err(rustix::io::Errno::AGAIN) => {
                    return self.write(output, &bytes[done..]).map(|()| bytes.len());
                }
                // As in the standard library: the stream is closed, and output to it is dropped.
                Err(rustix::io::Errno::BADF) => return Ok(bytes.len()),
                Err(error) => return Err(error_of(&error.into())),
            }
        }
        Ok(done)
    }

    fn read_input(&mut self) -> Input {
        let arrived = self.input.lock().take();
        match arrived {
            // The end is permanent and is not requested again.
            Some(Input::End) => {
                *self.input.lock() = Some(Input::End);
                Input::End
            }
            Some(input) => {
                self.is_reading = false;
                input
            }
            None => {
                self.ask_for_input();
                Input::WouldBlock
            }
        }
    }

    fn is_interactive(&mut self) -> bool {
        std::io::IsTerminal::is_terminal(&std::io::stdout())
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        permit(&self.rights, narrowed, right, object, &resolve)
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        std::fs::read(path).map_err(|error| error_of(&error))
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
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
        std::path::Path::new(path).is_file()
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        std::fs::remove_file(path).map_err(|error| error_of(&error))
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        request_of_files(request)
    }

    fn inbox(&self) -> Inbox {
        self.inbox.clone()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        _ = round;
        let contents = self.inbox.take();
        let ends = |incoming: &Incoming| match incoming {
            Incoming::Signal(signal) => signal.ends_a_run() && !self.inbox.is_handled(*signal),
            _ => false,
        };
        if self.is_external && contents.iter().any(ends) {
            self.inbox.external_clock().release();
        }
        contents
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_into_the_inbox_ends_a_wait() {
        let mut host = RealHost::new(Vec::new());
        let inbox = host.inbox();
        let thread = std::thread::spawn(move || inbox.put(Incoming::Stop));
        assert_eq!(host.wait(Some(u64::MAX), Awaited::default()), Wake::Arrival);
        assert!(matches!(host.poll(1)[..], [Incoming::Stop]));
        assert_eq!(host.wait(None, Awaited::default()), Wake::Never);
        assert!(thread.join().is_ok());
    }

    #[test]
    fn a_deadline_ends_a_wait() {
        let mut host = RealHost::new(Vec::new());
        let deadline = host.monotonic() + 1;
        assert_eq!(host.wait(Some(deadline), Awaited::default()), Wake::Time);
        assert!(host.monotonic() >= deadline);
    }

    #[test]
    fn an_external_clock_ends_a_wait_when_its_time_is_told() {
        let mut host = RealHost::new(Vec::new()).with_external_time();
        let inbox = host.inbox();
        assert!(inbox.has_external_clock());
        assert_eq!((host.monotonic(), host.wall_clock()), (0, 0));
        inbox.set_time(5_000);
        let thread = std::thread::spawn(move || {
            for time in (0..=100).map(|step| 5_000 + step * 10) {
                inbox.set_time(time);
                std::thread::yield_now();
            }
            inbox
        });
        while host.monotonic() < 1_000 {
            assert_eq!(host.wait(Some(1_000), Awaited::default()), Wake::Time);
        }
        assert_eq!((host.monotonic(), host.wall_clock()), (1_000, 6_000));
        let inbox = thread.join().expect("it does not panic");
        assert!(!inbox.is_rung(), "the machine is left alone");
        assert_eq!(host.wait(None, Awaited::default()), Wake::Never);
        inbox.put(Incoming::Stop);
        assert_eq!(host.wait(Some(2_000), Awaited::default()), Wake::Arrival);
        assert_eq!(host.poll(1).len(), 1);
        // A signal that ends the run has time pass.
        inbox.put(Incoming::Signal(super::super::ProcessSignal::Terminate));
        assert_eq!(host.poll(2).len(), 1);
        assert_eq!(host.wait(Some(1_000_000), Awaited::default()), Wake::Time);
        assert!(host.monotonic() >= 1_000_000);
    }

    #[test]
    fn a_clock_that_is_faster_reaches_its_deadlines_sooner() {
        let mut host = RealHost::new(Vec::new()).with_speed(1e6);
        let deadline = host.monotonic() + 1_000_000_000_000;
        let begun = Instant::now();
        while host.monotonic() < deadline {
            assert_eq!(host.wait(Some(deadline), Awaited::default()), Wake::Time);
        }
        assert!(begun.elapsed() < Duration::from_secs(600), "a thousand seconds take a thousandth");
        assert_eq!(scaled(Duration::MAX, 2.0), Duration::MAX);
    }

    #[test]
    fn files_are_reached_by_what_was_permitted() {
        let directory = std::env::temp_dir().join(format!("esl-host-{}", std::process::id()));
        let inside = directory.join("inside");
        std::fs::create_dir_all(&inside).unwrap();
        let rights = Rights::none().with(Right::Write, inside.to_str().unwrap());
        let mut host = RealHost::new(Vec::new()).with_rights(rights);
        let path = |name: &str| directory.join(name).to_str().unwrap().to_owned();
        let mut permitted = |name: &str| host.permit(Right::Write, &path(name), &[]);
        let Permit::Granted(x) = permitted("inside/x") else { panic!("it is inside") };
        assert_eq!(permitted("inside/../y"), Permit::NotGranted);
        assert_eq!(RealHost::new(Vec::new()).permit(Right::Write, &x, &[]), Permit::NotGranted);
        assert_eq!(host.write_file(&x, b"one", WriteMode::Create), Ok(()));
        assert_eq!(host.write_file(&x, b"two", WriteMode::Append), Ok(()));
        assert_eq!(host.read_file(&x), Ok(b"onetwo".to_vec()));
        assert_eq!(host.write_file(&x, b"", WriteMode::Create), Err(HostError::Exists));
        assert_eq!(host.read_file(&path("inside/none")), Err(HostError::NotFound));
        assert!(host.file_exists(&x) && !host.file_exists(&path("inside/none")));
        assert_eq!(host.delete_file(&x), Ok(()));
        std::fs::remove_dir_all(&directory).unwrap();
    }
}
