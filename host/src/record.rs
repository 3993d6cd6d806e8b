//! Recording the answers of a host.
//!
//! There are three sorts of records: answers, in the order of the questions; what comes when it comes, which
//! is the contents of the inbox, by rounds of the machine, and timers that are due, by the number of
//! questions; and checks, which say how far the run was, by which a replay is compared.
//!
//! Guarantees: a program that is deterministic but for its host does the same under a
//! [`ReplayHost`](super::ReplayHost) as it did under the [`RecordingHost`]. Before the machine waits, all
//! records are handed on.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::{Datum, DatumKind};

use super::{
    ActionId, Awaited, FileAnswer, FileRequest, Host, HostCall, HostError, HostFailure, Inbox, Incoming,
    Input, Output, Permit, Right, Rights, RunCheck, Wake, WriteMode,
};
use crate::canary::Canary;

/// Rounds of the machine after which there is a check.
const CHECK_ROUNDS: u64 = 4096;
/// Nanoseconds after which there is one.
const CHECK_TIME: u64 = 1_000_000_000;

/// Hash of the arguments of a question to a host; 0 if it has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct QuestionHash(pub u32);

impl QuestionHash {
    /// Returns the hash of these arguments.
    pub(super) fn of(arguments: &[&[u8]]) -> QuestionHash {
        let mut canary = Canary::default();
        arguments.iter().for_each(|argument| canary.mix_bytes(argument));
        QuestionHash((canary.value() ^ canary.value() >> 32) as u32)
    }

    pub(super) fn of_wait(deadline: Option<u64>, awaited: Awaited) -> QuestionHash {
        let flags = [awaited.input, awaited.output, awaited.news].map(u8::from);
        QuestionHash::of(&[&deadline.unwrap_or(u64::MAX).to_le_bytes(), &flags])
    }

    pub(super) fn of_write(output: Output, bytes: &[u8]) -> QuestionHash {
        QuestionHash::of(&[&[output as u8], bytes])
    }

    pub(super) fn of_permit(right: Right, object: &str) -> QuestionHash {
        QuestionHash::of(&[&[right as u8], object.as_bytes()])
    }

    /// Returns the hash of a write to a file.
    pub fn of_write_file(path: &str, bytes: &[u8], mode: WriteMode) -> QuestionHash {
        QuestionHash::of(&[path.as_bytes(), bytes, &[mode as u8]])
    }

    /// Returns the hash of a request of files that has one name for its argument.
    pub fn of_path(path: &str) -> QuestionHash {
        QuestionHash::of(&[path.as_bytes()])
    }

    /// Returns the hash of a request of files.
    pub fn of_request(request: &FileRequest<'_>) -> QuestionHash {
        QuestionHash::of(&[format!("{request:?}").as_bytes()])
    }

    /// Returns the hash of a call of a function of the embedder's.
    pub fn of_call(name: &str, arguments: &[Datum]) -> QuestionHash {
        let contents = |argument: &Datum| match argument.kind() {
            DatumKind::Packed(vector) => vector.to_le_bytes().into_owned(),
            _ => argument.to_string().into_bytes(),
        };
        let contents: Vec<Vec<u8>> = arguments.iter().map(contents).collect();
        let mut parts = vec![name.as_bytes()];
        parts.extend(contents.iter().map(Vec::as_slice));
        QuestionHash::of(&parts)
    }
}

/// An effect that is about to leave the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Intent {
    /// Identity of the effect.
    pub action: ActionId,
    /// Number of the operation that begins, if one does.
    pub operation: Option<u64>,
    /// State of the file that is to be changed: one more than its length, or 0 if there is none.
    pub before: u64,
}

/// A record, and the question that it answers.
#[derive(Clone, Debug)]
pub struct NotedRecord {
    /// Hash of the arguments of the question.
    pub question: QuestionHash,
    /// The record.
    pub record: Record,
}

/// Defines [`Record`] and, for each kind of answer, how it is recorded and replayed.
macro_rules! define_records {
    ($( $(#[doc = $doc:literal])* $variant:ident ($ty:ty) ; )*) => {
        /// One answer of a host.
        #[derive(Clone, Debug)]
        pub enum Record {
            $( $(#[doc = $doc])* $variant($ty), )*
        }

        /// A kind of answer.
        pub(super) trait RecordedAnswer: Sized + Clone {
            fn into_record(self) -> Record;
            fn from_record(record: &Record) -> Option<Self>;
        }

        $(
            /// Wraps the answers of this kind, since some kinds have the same type.
            #[derive(Clone)]
            pub(super) struct $variant(pub(super) $ty);

            impl RecordedAnswer for $variant {
                fn into_record(self) -> Record {
                    Record::$variant(self.0)
                }

                fn from_record(record: &Record) -> Option<$variant> {
                    match record {
                        Record::$variant(answer) => Some($variant(answer.clone())),
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
    /// Time of the processor.
    ProcessorTime(u64);
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
    /// The answer to a request about files.
    Filed(Result<FileAnswer, HostError>);
    /// Whether a right is granted.
    Permitted(Permit);
    /// Contents of a file.
    FileRead(Result<Vec<u8>, HostError>);
    /// Whether a file exists.
    Exists(bool);
    /// Result of a function of the embedder's.
    Called(Result<Datum, HostFailure>);
    /// Exit status of a program whose output is closed.
    BrokenOutput(u8);
    /// How many questions before it were answered no, and the time, for a timer that is due.
    Due((u64, u64));
    /// Round of the machine, and the contents of the inbox then.
    Received((u64, Vec<Incoming>));
    /// How far the run was.
    Checked(RunCheck);
    /// An effect that was about to leave. Its outcome follows: the answer to the question, or news of the
    /// operation. Only the journals of durable runs have it.
    Intended(Intent);
}

impl Record {
    /// Returns what was asked when this was recorded.
    pub fn subject(&self) -> &'static str {
        match self {
            Record::Monotonic(_) => "the time",
            Record::WallClock(_) => "the time of day",
            Record::ProcessorTime(_) => "the time of the processor",
            Record::Waited(_) => "a wait",
            Record::Virtual(_) => "whether time is virtual",
            Record::Seed(_) => "the seed",
            Record::Arguments(_) => "the arguments",
            Record::Written(_) => "a write to a stream or a file, or a removal",
            Record::PassedOn(_) => "a write to a stream",
            Record::Read(_) => "standard input",
            Record::Interactive(_) => "whether a person watches",
            Record::Filed(_) => "a request of files",
            Record::Permitted(_) => "a right",
            Record::FileRead(_) => "the contents of a file",
            Record::Exists(_) => "whether there is a file",
            Record::Called(_) => "a call of the host",
            Record::BrokenOutput(_) => "the status of a closed output",
            Record::Due(_) => "a time that has come",
            Record::Received(_) => "something that came into the inbox",
            Record::Checked(_) => "a check",
            Record::Intended(_) => "an effect",
        }
    }
}

/// A keeper of records.
pub trait Recorder: Send {
    /// Is given the next record.
    fn note(&self, noted: NotedRecord);

    /// Is told that nothing may come for a while: what was given so far should be safe.
    fn flush(&self) {}

    /// Is told that a replay cannot repeat what follows: no more is to be kept.
    fn break_off(&self) {}
}

/// The records of a run, kept in memory while they are made.
#[derive(Clone, Default)]
pub struct Recording(Arc<Mutex<Vec<NotedRecord>>>);

impl Recording {
    fn records(&self) -> MutexGuard<'_, Vec<NotedRecord>> {
        // Each record is pushed whole, so a panic elsewhere does not corrupt the list.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns everything recorded so far.
    pub fn to_records(&self) -> Vec<NotedRecord> {
        self.records().clone()
    }
}

impl Recorder for Recording {
    fn note(&self, noted: NotedRecord) {
        self.records().push(noted);
    }
}

/// A host that records the answers of another one.
pub struct RecordingHost<H, R = Recording> {
    host: H,
    recorder: R,
    /// Number of questions whether a timer is due that were answered no.
    not_due: u64,
    /// Round of the last check, and its time by the stopwatch.
    checked: Option<(u64, u64)>,
}

impl<H: Host> RecordingHost<H> {
    /// Records the answers of `host` in memory.
    pub fn new(host: H) -> RecordingHost<H> {
        RecordingHost::with_recorder(host, Recording::default())
    }

    /// Returns the recording, which grows with each request.
    pub fn recording(&self) -> Recording {
        self.recorder.clone()
    }
}

impl<H: Host, R: Recorder> RecordingHost<H, R> {
    /// Records the answers of `host` with `recorder`.
    pub fn with_recorder(host: H, recorder: R) -> RecordingHost<H, R> {
        RecordingHost { host, recorder, not_due: 0, checked: None }
    }

    /// Continues the records of an earlier process of the run, in which `not_due` questions whether a timer
    /// is due were answered no.
    pub fn go_on(&mut self, not_due: u64) {
        self.not_due = not_due;
    }

    /// Returns how many questions whether a timer is due were answered no.
    pub fn not_due(&self) -> u64 {
        self.not_due
    }

    /// Returns the host, for questions that are not recorded.
    pub fn host_mut(&mut self) -> &mut H {
        &mut self.host
    }

    /// Records that an effect is about to leave.
    pub fn note_intent(&self, question: QuestionHash, intent: Intent) {
        self.note(question, Intended(intent));
    }

    /// Records this as the answer to a call, in place of making it.
    ///
    /// # Errors
    /// The failure that is recorded.
    pub fn answer_call(
        &self,
        call: HostCall<'_>,
        answer: Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        self.note(QuestionHash::of_call(call.name, call.arguments), Called(answer)).0
    }

    /// Records this as the answer to a write to a file or its removal, in place of doing it.
    ///
    /// # Errors
    /// The error that is recorded.
    pub fn answer_write(
        &self,
        question: QuestionHash,
        answer: Result<(), HostError>,
    ) -> Result<(), HostError> {
        self.note(question, Written(answer)).0
    }

    /// Records this as the answer to a request of files, in place of carrying it out.
    ///
    /// # Errors
    /// The error that is recorded.
    pub fn answer_request(
        &self,
        question: QuestionHash,
        answer: Result<FileAnswer, HostError>,
    ) -> Result<FileAnswer, HostError> {
        self.note(question, Filed(answer)).0
    }

    /// Counts a question whether a timer is due that is answered no without the host.
    pub fn answer_not_due(&mut self) {
        self.not_due += 1;
    }

    fn note<A: RecordedAnswer>(&self, question: QuestionHash, answer: A) -> A {
        self.recorder.note(NotedRecord { question, record: answer.clone().into_record() });
        answer
    }

    /// Records the answer to a question without arguments.
    fn note_plain<A: RecordedAnswer>(&self, answer: A) -> A {
        self.note(QuestionHash::default(), answer)
    }
}

impl<H: Host, R: Recorder> Host for RecordingHost<H, R> {
    fn monotonic(&mut self) -> u64 {
        let answer = Monotonic(self.host.monotonic());
        self.note_plain(answer).0
    }

    fn wall_clock(&mut self) -> i64 {
        let answer = WallClock(self.host.wall_clock());
        self.note_plain(answer).0
    }

    fn processor_time(&mut self) -> u64 {
        let answer = ProcessorTime(self.host.processor_time());
        self.note_plain(answer).0
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        self.recorder.flush();
        let wake = self.host.wait(deadline, awaited);
        if wake == Wake::Inspection {
            return wake;
        }
        self.note(QuestionHash::of_wait(deadline, awaited), Waited(wake)).0
    }

    fn stopwatch(&mut self) -> u64 {
        // Nothing depends on it, so it is not recorded.
        self.host.stopwatch()
    }

    fn is_virtual(&self) -> bool {
        self.note_plain(Virtual(self.host.is_virtual())).0
    }

    fn advance(&mut self, nanoseconds: u64) {
        self.host.advance(nanoseconds);
    }

    fn seed(&mut self) -> u64 {
        let answer = Seed(self.host.seed());
        self.note_plain(answer).0
    }

    fn arguments(&mut self) -> Vec<String> {
        let answer = Arguments(self.host.arguments());
        self.note_plain(answer).0
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        let answer = Written(self.host.write(output, bytes));
        self.note(QuestionHash::of_write(output, bytes), answer).0
    }

    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        let answer = PassedOn(self.host.write_ready(output, bytes));
        self.note(QuestionHash::of_write(output, bytes), answer).0
    }

    fn read_input(&mut self) -> Input {
        let answer = Read(self.host.read_input());
        self.note_plain(answer).0
    }

    fn is_interactive(&mut self) -> bool {
        let answer = Interactive(self.host.is_interactive());
        self.note_plain(answer).0
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        let answer = Filed(self.host.request_of_files(request));
        self.note(QuestionHash::of_request(&request), answer).0
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        let answer = Permitted(self.host.permit(right, object, narrowed));
        self.note(QuestionHash::of_permit(right, object), answer).0
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        let answer = FileRead(self.host.read_file(path));
        self.note(QuestionHash::of_path(path), answer).0
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        let answer = Written(self.host.write_file(path, bytes, mode));
        self.note(QuestionHash::of_write_file(path, bytes, mode), answer).0
    }

    fn file_exists(&mut self, path: &str) -> bool {
        let answer = Exists(self.host.file_exists(path));
        self.note(QuestionHash::of_path(path), answer).0
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        let answer = Written(self.host.delete_file(path));
        self.note(QuestionHash::of_path(path), answer).0
    }

    fn due(&mut self, deadline: u64) -> Option<u64> {
        let Some(now) = self.host.due(deadline) else {
            self.not_due += 1;
            return None;
        };
        Some(self.note(QuestionHash::of(&[&deadline.to_le_bytes()]), Due((self.not_due, now))).0.1)
    }

    fn call(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        let answer = Called(self.host.call(call, function));
        self.note(QuestionHash::of_call(call.name, call.arguments), answer).0
    }

    fn begin(&mut self, call: HostCall<'_>, function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        self.host.begin(call, function);
    }

    fn inbox(&self) -> Inbox {
        self.host.inbox()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        let contents = self.host.poll(round);
        if contents.is_empty() { contents } else { self.note_plain(Received((round, contents))).0.1 }
    }

    fn check(&mut self, check: RunCheck) {
        let now = self.host.stopwatch();
        let is_time = self.checked.is_none_or(|(round, time)| {
            check.round.saturating_sub(round) >= CHECK_ROUNDS || now.saturating_sub(time) >= CHECK_TIME
        });
        if is_time {
            self.checked = Some((check.round, now));
            self.note_plain(Checked(check));
            self.recorder.flush();
        }
    }

    fn hear_of_refusal(&mut self) {
        self.recorder.break_off();
    }

    fn broken_output_status(&self) -> u8 {
        self.note_plain(BrokenOutput(self.host.broken_output_status())).0
    }
}
