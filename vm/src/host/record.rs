//! Recording the answers of a host, and replaying them.
//!
//! Guarantees: a program that is deterministic but for its host does the same under a [`ReplayHost`] as it
//! did under the [`RecordingHost`], without touching anything outside. When it makes a different request than
//! it did then, the replay has diverged: this is recorded, and further answers are those of a host without
//! anything.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Captured, Host, HostError, Input, Message, Output, Wake, WriteMode};

/// Defines [`Record`] and, for each kind of answer, how it is recorded and replayed.
macro_rules! define_records {
    ($( $(#[doc = $doc:literal])* $variant:ident ($ty:ty) ; )*) => {
        /// One answer of a host.
        #[derive(Clone, Debug)]
        pub enum Record {
            $( $(#[doc = $doc])* $variant($ty), )*
        }

        /// A kind of answer.
        trait Answer: Sized + Clone {
            fn into_record(self) -> Record;
            fn from_record(record: Record) -> Option<Self>;
        }

        $(
            /// Wraps the answers of this kind, since some kinds have the same type.
            #[derive(Clone)]
            struct $variant($ty);

            impl Answer for $variant {
                fn into_record(self) -> Record {
                    Record::$variant(self.0)
                }

                fn from_record(record: Record) -> Option<$variant> {
                    match record {
                        Record::$variant(answer) => Some($variant(answer)),
                        _ => None,
                    }
                }
            }
        )*
    };
}

define_records! {
    /// Time of the monotonic clock.
    Monotonic(u64);
    /// Time of the wall clock.
    WallClock(i64);
    /// Outcome of a wait.
    Waited(Wake);
    /// Whether time is virtual.
    Virtual(bool);
    /// The seed.
    Seed(u64);
    /// The arguments.
    Arguments(Vec<String>);
    /// Outcome of a write to a standard stream or a file, or of a removal.
    Written(Result<(), HostError>);
    /// Standard input.
    Read(Input);
    /// Whether a person watches standard output.
    Interactive(bool);
    /// Contents of a file.
    FileRead(Result<Vec<u8>, HostError>);
    /// Whether a file exists, or a sender of messages.
    Exists(bool);
    /// Messages.
    Received(Vec<Message>);
}

/// The answers of a host in order, while they are being recorded.
#[derive(Clone, Default)]
pub struct Recording(Arc<Mutex<Vec<Record>>>);

impl Recording {
    fn records(&self) -> MutexGuard<'_, Vec<Record>> {
        // Each record is pushed whole, so a panic elsewhere does not corrupt the list.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns everything recorded so far.
    pub fn to_records(&self) -> Vec<Record> {
        self.records().clone()
    }
}

/// A host that records the answers of another one.
pub struct RecordingHost<H> {
    host: H,
    recording: Recording,
}

impl<H: Host> RecordingHost<H> {
    /// Records the answers of `host`.
    pub fn new(host: H) -> RecordingHost<H> {
        RecordingHost { host, recording: Recording::default() }
    }

    /// Returns the recording, which grows with each request.
    pub fn recording(&self) -> Recording {
        self.recording.clone()
    }

    fn note<A: Answer>(&mut self, answer: A) -> A {
        self.recording.records().push(answer.clone().into_record());
        answer
    }
}

impl<H: Host> Host for RecordingHost<H> {
    fn monotonic(&mut self) -> u64 {
        let answer = Monotonic(self.host.monotonic());
        self.note(answer).0
    }

    fn wall_clock(&mut self) -> i64 {
        let answer = WallClock(self.host.wall_clock());
        self.note(answer).0
    }

    fn wait(&mut self, deadline: Option<u64>, for_input: bool) -> Wake {
        let answer = Waited(self.host.wait(deadline, for_input));
        self.note(answer).0
    }

    fn stopwatch(&mut self) -> u64 {
        // Nothing depends on it, so it is not recorded.
        self.host.stopwatch()
    }

    fn is_virtual(&self) -> bool {
        let answer = self.host.is_virtual();
        self.recording.records().push(Record::Virtual(answer));
        answer
    }

    fn advance(&mut self, nanoseconds: u64) {
        self.host.advance(nanoseconds);
    }

    fn seed(&mut self) -> u64 {
        let answer = Seed(self.host.seed());
        self.note(answer).0
    }

    fn arguments(&mut self) -> Vec<String> {
        let answer = Arguments(self.host.arguments());
        self.note(answer).0
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        let answer = Written(self.host.write(output, bytes));
        self.note(answer).0
    }

    fn read_input(&mut self) -> Input {
        let answer = Read(self.host.read_input());
        self.note(answer).0
    }

    fn is_interactive(&mut self) -> bool {
        let answer = Interactive(self.host.is_interactive());
        self.note(answer).0
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        let answer = FileRead(self.host.read_file(path));
        self.note(answer).0
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        let answer = Written(self.host.write_file(path, bytes, mode));
        self.note(answer).0
    }

    fn file_exists(&mut self, path: &str) -> bool {
        let answer = Exists(self.host.file_exists(path));
        self.note(answer).0
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        let answer = Written(self.host.delete_file(path));
        self.note(answer).0
    }

    fn receive(&mut self) -> Vec<Message> {
        let answer = Received(self.host.receive());
        self.note(answer).0
    }

    fn has_senders(&self) -> bool {
        let answer = self.host.has_senders();
        self.recording.records().push(Record::Exists(answer));
        answer
    }
}

/// The answers yet to be replayed.
#[derive(Default)]
struct Remaining {
    records: VecDeque<Record>,
    diverged: bool,
}

/// A host that replays recorded answers. It captures what the program writes.
#[derive(Clone)]
pub struct ReplayHost {
    remaining: Arc<Mutex<Remaining>>,
    captured: Captured,
}

impl ReplayHost {
    /// Creates a host that replays these answers.
    pub fn new(records: Vec<Record>) -> ReplayHost {
        let remaining = Remaining { records: records.into(), diverged: false };
        ReplayHost { remaining: Arc::new(Mutex::new(remaining)), captured: Captured::default() }
    }

    fn remaining(&self) -> MutexGuard<'_, Remaining> {
        // Each record is popped whole, so a panic elsewhere does not corrupt the list.
        self.remaining.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether the program has made a different request than it did during recording.
    pub fn has_diverged(&self) -> bool {
        self.remaining().diverged
    }

    /// Returns whether all answers were replayed.
    pub fn is_at_end(&self) -> bool {
        self.remaining().records.is_empty()
    }

    /// Returns what the program writes to the standard streams.
    pub fn captured(&self) -> Captured {
        self.captured.clone()
    }

    fn next<A: Answer>(&self) -> Option<A> {
        let mut remaining = self.remaining();
        if remaining.diverged {
            return None;
        }
        let answer = remaining.records.pop_front().and_then(A::from_record);
        remaining.diverged = answer.is_none();
        answer
    }
}

impl Host for ReplayHost {
    fn monotonic(&mut self) -> u64 {
        self.next::<Monotonic>().map_or(0, |answer| answer.0)
    }

    fn wall_clock(&mut self) -> i64 {
        self.next::<WallClock>().map_or(0, |answer| answer.0)
    }

    fn wait(&mut self, _deadline: Option<u64>, _for_input: bool) -> Wake {
        self.next::<Waited>().map_or(Wake::Never, |answer| answer.0)
    }

    fn is_virtual(&self) -> bool {
        self.next::<Virtual>().is_some_and(|answer| answer.0)
    }

    fn seed(&mut self) -> u64 {
        self.next::<Seed>().map_or(0, |answer| answer.0)
    }

    fn arguments(&mut self) -> Vec<String> {
        self.next::<Arguments>().map_or(Vec::new(), |answer| answer.0)
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        // Output is captured even if the recorded write failed, as it is what the program wanted to write.
        self.captured.append(output, bytes);
        self.next::<Written>().map_or(Err(HostError::BrokenPipe), |answer| answer.0)
    }

    fn read_input(&mut self) -> Input {
        self.next::<Read>().map_or(Input::End, |answer| answer.0)
    }

    fn is_interactive(&mut self) -> bool {
        self.next::<Interactive>().is_some_and(|answer| answer.0)
    }

    fn read_file(&mut self, _path: &str) -> Result<Vec<u8>, HostError> {
        self.next::<FileRead>().map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn write_file(&mut self, _path: &str, _bytes: &[u8], _mode: WriteMode) -> Result<(), HostError> {
        self.next::<Written>().map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn file_exists(&mut self, _path: &str) -> bool {
        self.next::<Exists>().is_some_and(|answer| answer.0)
    }

    fn delete_file(&mut self, _path: &str) -> Result<(), HostError> {
        self.next::<Written>().map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn receive(&mut self) -> Vec<Message> {
        self.next::<Received>().map_or(Vec::new(), |answer| answer.0)
    }

    fn has_senders(&self) -> bool {
        self.next::<Exists>().is_some_and(|answer| answer.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::VirtualHost;

    /// A stand-in for a program: describes what it learns from `host`.
    fn run(host: &mut dyn Host) -> String {
        let mut log = format!("{} {:?} ", host.seed(), host.arguments());
        log += &format!("{:?} {} ", host.wait(Some(30), false), host.monotonic());
        log += &format!("{:?} {:?} ", host.read_input(), host.read_file("f"));
        log += &format!("{:?} {}", host.write(Output::Standard, b"hello"), host.file_exists("g"));
        log
    }

    #[test]
    fn a_replay_gives_the_recorded_answers() {
        let host = VirtualHost::new().with_seed(7).with_input("in").with_file("f", "1").with_output_limit(2);
        let mut recording_host = RecordingHost::new(host.with_arguments(vec!["x".into()]));
        let recording = recording_host.recording();
        let first = run(&mut recording_host);
        let mut replay = ReplayHost::new(recording.to_records());
        assert_eq!(run(&mut replay), first);
        assert!(replay.is_at_end() && !replay.has_diverged());
        assert_eq!(replay.captured().output(), "hello");
    }

    #[test]
    fn another_question_is_a_divergence() {
        let mut replay = ReplayHost::new(vec![Record::Seed(3), Record::Monotonic(9)]);
        assert_eq!(replay.seed(), 3);
        assert_eq!(replay.wall_clock(), 0);
        assert!(replay.has_diverged());
        assert_eq!(replay.monotonic(), 0);
    }
}
