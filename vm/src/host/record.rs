//! Recording the answers of a host, and replaying them.
//!
//! There are two sorts of records: answers, in the order of the questions, and what comes when it comes: the
//! contents of the inbox, by rounds of the machine, and timers that are due, by the number of questions.
//!
//! Guarantees: a program that is deterministic but for its host does the same under a [`ReplayHost`] as it
//! did under the [`RecordingHost`], without touching anything outside. When it makes a different request than
//! it did then, the replay has diverged: this is recorded, and further answers are those of a host without
//! anything.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;

use super::{
    Awaited, Captured, FileAnswer, FileRequest, Host, HostError, HostFailure, Inbox, Incoming, Input, Output,
    Permit, Right, Rights, Wake, WriteMode,
};

/// Defines [`Record`] and, for each kind of answer, how it is recorded and replayed.
macro_rules! define_records {
    ($( $(#[doc = $doc:literal])* $variant:ident ($ty:ty) ; )*) => {
        /// One answer of a host.
        #[derive(Clone, Debug)]
        pub enum Record {
            $( $(#[doc = $doc])* $variant($ty), )*
        }

        /// A kind of answer.
        trait RecordedAnswer: Sized + Clone {
            fn into_record(self) -> Record;
            fn from_record(record: Record) -> Option<Self>;
        }

        $(
            /// Wraps the answers of this kind, since some kinds have the same type.
            #[derive(Clone)]
            struct $variant($ty);

            impl RecordedAnswer for $variant {
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
    /// Outcome of a write of what there was room for.
    PassedOn(Result<usize, HostError>);
    /// Standard input.
    Read(Input);
    /// Whether a person watches standard output.
    Interactive(bool);
    /// What came of a request of files.
    Filed(Result<FileAnswer, HostError>);
    /// Whether a right is granted.
    Permitted(Permit);
    /// Contents of a file.
    FileRead(Result<Vec<u8>, HostError>);
    /// Whether a file exists.
    Exists(bool);
    /// Result of a function of the embedder's.
    Called(Result<Datum, HostFailure>);
    /// How many questions before it were answered no, and the time, for a timer that is due.
    Due((u64, u64));
    /// Round of the machine, and the contents of the inbox then.
    Received((u64, Vec<Incoming>));
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
    /// Number of questions whether a timer is due that were answered no.
    not_due: u64,
}

impl<H: Host> RecordingHost<H> {
    /// Records the answers of `host`.
    pub fn new(host: H) -> RecordingHost<H> {
        RecordingHost { host, recording: Recording::default(), not_due: 0 }
    }

    /// Returns the recording, which grows with each request.
    pub fn recording(&self) -> Recording {
        self.recording.clone()
    }

    fn note<A: RecordedAnswer>(&mut self, answer: A) -> A {
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

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        let answer = Waited(self.host.wait(deadline, awaited));
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

    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        let answer = PassedOn(self.host.write_ready(output, bytes));
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

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        let answer = Filed(self.host.request_of_files(request));
        self.note(answer).0
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        let answer = Permitted(self.host.permit(right, object, narrowed));
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

    fn due(&mut self, deadline: u64) -> Option<u64> {
        let Some(now) = self.host.due(deadline) else {
            self.not_due += 1;
            return None;
        };
        Some(self.note(Due((self.not_due, now))).0.1)
    }

    fn call(
        &mut self,
        name: &str,
        arguments: &[Datum],
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        let answer = Called(self.host.call(name, arguments, function));
        self.note(answer).0
    }

    fn begin(&mut self, name: &str, arguments: &[Datum], function: &mut dyn FnMut(&[Datum])) {
        self.host.begin(name, arguments, function);
    }

    fn inbox(&self) -> Inbox {
        self.host.inbox()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        let contents = self.host.poll(round);
        if contents.is_empty() { contents } else { self.note(Received((round, contents))).0.1 }
    }
}

/// The answers yet to be replayed.
#[derive(Default)]
struct Remaining {
    records: VecDeque<Record>,
    diverged: bool,
    /// Number of questions whether a timer is due that were answered no.
    not_due: u64,
}

/// A host that replays recorded answers. It captures what the program writes.
#[derive(Clone)]
pub struct ReplayHost {
    remaining: Arc<Mutex<Remaining>>,
    captured: Captured,
    inbox: Inbox,
}

impl ReplayHost {
    /// Creates a host that replays these answers.
    pub fn new(records: Vec<Record>) -> ReplayHost {
        let remaining = Remaining { records: records.into(), ..Remaining::default() };
        let replay = ReplayHost {
            remaining: Arc::new(Mutex::new(remaining)),
            captured: Captured::default(),
            inbox: Inbox::new(),
        };
        replay.ring_if_needed();
        replay
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

    fn next<A: RecordedAnswer>(&self) -> Option<A> {
        let mut remaining = self.remaining();
        if remaining.diverged {
            return None;
        }
        let answer = remaining.records.pop_front().and_then(A::from_record);
        remaining.diverged = answer.is_none();
        drop(remaining);
        self.ring_if_needed();
        answer
    }

    /// Has the machine look into the inbox in each round until the next record, if that is of the inbox.
    fn ring_if_needed(&self) {
        if matches!(self.remaining().records.front(), Some(Record::Received(_))) {
            self.inbox.ring();
        }
    }
}

impl Host for ReplayHost {
    fn monotonic(&mut self) -> u64 {
        self.next::<Monotonic>().map_or(0, |answer| answer.0)
    }

    fn wall_clock(&mut self) -> i64 {
        self.next::<WallClock>().map_or(0, |answer| answer.0)
    }

    fn wait(&mut self, _deadline: Option<u64>, _awaited: Awaited) -> Wake {
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

    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        let passed_on = self.next::<PassedOn>().map_or(Err(HostError::BrokenPipe), |answer| answer.0);
        let count = passed_on.as_ref().map_or(bytes.len(), |&count| count.min(bytes.len()));
        self.captured.append(output, &bytes[..count]);
        passed_on
    }

    fn read_input(&mut self) -> Input {
        self.next::<Read>().map_or(Input::End, |answer| answer.0)
    }

    fn is_interactive(&mut self) -> bool {
        self.next::<Interactive>().is_some_and(|answer| answer.0)
    }

    fn request_of_files(&mut self, _request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        self.next::<Filed>().map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn permit(&mut self, _right: Right, _object: &str, _narrowed: &[Rights]) -> Permit {
        self.next::<Permitted>().map_or(Permit::NotGranted, |answer| answer.0)
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

    fn due(&mut self, _deadline: u64) -> Option<u64> {
        let mut remaining = self.remaining();
        let is_due =
            matches!(remaining.records.front(), Some(&Record::Due((n, _))) if n == remaining.not_due);
        if !is_due {
            remaining.not_due += 1;
            return None;
        }
        drop(remaining);
        self.next::<Due>().map(|answer| answer.0.1)
    }

    fn call(
        &mut self,
        name: &str,
        _arguments: &[Datum],
        _function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        let is_missing = || HostFailure {
            cause: "NOT-IN-THIS-WORLD".into(),
            arguments: vec![Datum::string(name, Span::default())],
        };
        self.next::<Called>().map_or_else(|| Err(is_missing()), |answer| answer.0)
    }

    /// Nothing is begun; what was heard then is heard again.
    fn begin(&mut self, _name: &str, _arguments: &[Datum], _function: &mut dyn FnMut(&[Datum])) {}

    fn inbox(&self) -> Inbox {
        self.inbox.clone()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        self.inbox.take();
        let is_now =
            matches!(self.remaining().records.front(), Some(&Record::Received((n, _))) if n == round);
        let contents = if is_now { self.next::<Received>() } else { None };
        self.ring_if_needed();
        contents.map_or(Vec::new(), |answer| answer.0.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::VirtualHost;

    /// A stand-in for a program: describes what it learns from `host`.
    fn run(host: &mut dyn Host) -> String {
        let mut log = format!("{} {:?} ", host.seed(), host.arguments());
        log += &format!("{:?} {} ", host.wait(Some(30), Awaited::default()), host.monotonic());
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
    fn what_came_comes_again_in_the_same_round_and_at_the_same_question() {
        let host = VirtualHost::new().with_arrival(0, Incoming::Stop).with_arrival(20, Incoming::Input);
        let mut recording_host = RecordingHost::new(host);
        let recording = recording_host.recording();
        let rounds = |host: &mut dyn Host| {
            let look = |host: &mut dyn Host, round| {
                if host.inbox().is_rung() { host.poll(round) } else { Vec::new() }
            };
            let mut log = String::new();
            for round in 1..5 {
                log += &format!("{:?} {:?}; ", look(host, round), host.due(15));
                host.advance(10);
            }
            log
        };
        let first = rounds(&mut recording_host);
        assert_eq!(first, "[Stop] None; [] None; [Input] Some(20); [] Some(30); ");
        assert_eq!(recording.to_records().len(), 4);
        let mut replay = ReplayHost::new(recording.to_records());
        assert_eq!(rounds(&mut replay), first);
        assert!(replay.is_at_end() && !replay.has_diverged());
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
