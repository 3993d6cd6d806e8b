//! Replaying recorded answers.
//!
//! Guarantees: nothing outside is touched, and nothing is waited for. When the program asks something else
//! than it did, or a check differs, the replay has diverged: it says where, and has the machine come back. So
//! it does when the program asks something after the last record: a replay never goes on by itself.

mod divergence;
mod question;
mod start;
mod text;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;

use crate::record::{
    Arguments, BrokenOutput, Called, Due, Exists, FileRead, Filed, Intended, Intent, Interactive, Monotonic,
    NotedRecord, PassedOn, Permitted, ProcessorTime, QuestionHash, Read, Received, Record, RecordedAnswer,
    Seed, Virtual, Waited, WallClock, Written,
};
use crate::{
    ActionId, Awaited, Captured, FileAnswer, FileRequest, Host, HostCall, HostError, HostFailure, Inbox,
    Incoming, Input, Output, Permit, ProcessSignal, ReplayState, Right, Rights, RunCheck, Wake, WriteMode,
};

use question::RecordedQuestions;
use text::{asked_call, quoted, stream};

pub use divergence::Divergence;

/// The source of answers. Without records it is an empty world, whose time passes during waits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum AnswerSource {
    /// The records.
    #[default]
    Records,
    /// Nothing yet, as the machine is not at the place where the records begin.
    Preparing,
    /// Nothing, as the replay has diverged.
    Diverged(Divergence),
    /// Nothing, as this was asked after the last record.
    Over(String),
    /// Nothing, as the replay was given up.
    Nothing,
}

/// The records, and how far they were replayed.
struct ReplayProgress {
    records: Arc<[NotedRecord]>,
    /// Number of the records that were replayed.
    replayed: usize,
    source: AnswerSource,
    /// Number of questions whether a timer is due that were answered no.
    not_due: u64,
    /// The latest time that was answered.
    time: u64,
    /// The last equal check.
    equal: Option<RunCheck>,
    /// Number of checks so far.
    checks: u64,
    /// Whether the machine is to come back.
    comes_back: bool,
    questions: RecordedQuestions,
}

/// Receives the output of a replay, piece by piece.
type OutputScreen = Box<dyn FnMut(Output, &[u8]) + Send>;

/// A host that replays recorded answers. It captures what the program writes.
#[derive(Clone)]
pub struct ReplayHost {
    progress: Arc<Mutex<ReplayProgress>>,
    captured: Captured,
    screen: Arc<Mutex<Option<OutputScreen>>>,
    inbox: Inbox,
    /// Whether the inbox is that of another host too, which takes out its contents.
    is_shared: bool,
}

impl ReplayHost {
    /// Creates a host that replays these records.
    pub fn new(records: impl Into<Arc<[NotedRecord]>>) -> ReplayHost {
        let progress = ReplayProgress {
            records: records.into(),
            replayed: 0,
            source: AnswerSource::Records,
            not_due: 0,
            time: 0,
            equal: None,
            checks: 0,
            comes_back: false,
            questions: RecordedQuestions::default(),
        };
        let replay = ReplayHost {
            progress: Arc::new(Mutex::new(progress)),
            captured: Captured::default(),
            screen: Arc::default(),
            inbox: Inbox::new(),
            is_shared: false,
        };
        replay.ring_if_needed(&replay.progress());
        replay
    }

    /// Makes it share the inbox of another host, which goes on with the run after the last record. The
    /// contents of the inbox are left to that host.
    #[must_use]
    pub fn with_inbox(mut self, inbox: Inbox) -> ReplayHost {
        self.inbox = inbox;
        self.is_shared = true;
        self.ring_if_needed(&self.progress());
        self
    }

    /// Has output passed to `screen` instead of being captured.
    #[must_use]
    pub fn with_screen(self, screen: impl FnMut(Output, &[u8]) + Send + 'static) -> ReplayHost {
        *self.screen.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(screen));
        self
    }

    fn progress(&self) -> MutexGuard<'_, ReplayProgress> {
        // Each record is taken whole, so a panic elsewhere does not corrupt the progress.
        self.progress.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns whether the program has made a different request than it did during recording, or one more.
    pub fn has_diverged(&self) -> bool {
        matches!(self.progress().source, AnswerSource::Diverged(_) | AnswerSource::Over(_))
    }

    /// Returns where the replay has diverged.
    pub fn divergence(&self) -> Option<Divergence> {
        match &self.progress().source {
            AnswerSource::Diverged(divergence) => Some(divergence.clone()),
            _ => None,
        }
    }

    /// Returns what the program has asked after the last record.
    pub fn asked_at_end(&self) -> Option<String> {
        match &self.progress().source {
            AnswerSource::Over(asked) => Some(asked.clone()),
            _ => None,
        }
    }

    /// Returns whether all records were replayed.
    pub fn is_at_end(&self) -> bool {
        let progress = self.progress();
        progress.replayed == progress.records.len()
    }

    /// Returns how many records were replayed.
    pub fn replayed(&self) -> usize {
        self.progress().replayed
    }

    /// Returns how many questions whether a timer is due were answered no.
    pub fn not_due(&self) -> u64 {
        self.progress().not_due
    }

    /// Takes the intent of the question with this hash, if that is the next record.
    pub fn take_intent(&self, question: QuestionHash) -> Option<Intent> {
        let is_next = {
            let progress = self.progress();
            let next = progress.records.get(progress.replayed);
            next.is_some_and(|noted| {
                noted.question == question && matches!(noted.record, Record::Intended(_))
            })
        };
        if is_next {
            self.next::<Intended>(question, &|| "for an effect".into()).map(|intent| intent.0)
        } else {
            None
        }
    }

    /// Takes the intent of a call that begins an operation. Without it the replay has diverged.
    pub fn expect_intent(&self, call: HostCall<'_>) -> Option<Intent> {
        let question = QuestionHash::of_call(call.name, call.arguments);
        self.next::<Intended>(question, &|| asked_call(call)).map(|intent| intent.0)
    }

    /// Returns how many checks were equal, and the last of them.
    pub fn checks(&self) -> (u64, Option<RunCheck>) {
        let progress = self.progress();
        (progress.checks, progress.equal)
    }

    /// Returns what the program writes to the standard streams.
    pub fn captured(&self) -> Captured {
        self.captured.clone()
    }

    /// Gives up the replay: from here on the program has an empty world, whose time passes during waits. So a
    /// form can be evaluated in the middle of it. Its output is captured.
    pub fn detach(&self) {
        self.progress().source = AnswerSource::Nothing;
        *self.screen.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Returns the next record if it answers this question.
    fn next<A: RecordedAnswer>(&self, question: QuestionHash, asked: &dyn Fn() -> String) -> Option<A> {
        let mut progress = self.progress();
        if progress.source != AnswerSource::Records {
            return None;
        }
        let Some(noted) = progress.records.get(progress.replayed) else {
            progress.source = AnswerSource::Over(asked());
            self.come_back(&mut progress);
            return None;
        };
        let Some(answer) = A::from_record(&noted.record).filter(|_| noted.question == question) else {
            let recorded = match A::from_record(&noted.record) {
                Some(_) => format!("{}, with other arguments", noted.record.subject()),
                None => noted.record.subject().into(),
            };
            self.diverge(&mut progress, asked(), recorded);
            return None;
        };
        match noted.record {
            Record::Monotonic(time) | Record::Due((_, time)) => progress.time = time,
            _ => {}
        }
        progress.replayed += 1;
        self.ring_if_needed(&progress);
        Some(answer)
    }

    /// Returns the next record if it answers this question without arguments.
    fn next_plain<A: RecordedAnswer>(&self, asked: &str) -> Option<A> {
        self.next(QuestionHash::default(), &|| asked.into())
    }

    fn diverge(&self, progress: &mut ReplayProgress, asked: String, recorded: String) {
        let (record, equal) = (progress.replayed + 1, progress.equal);
        progress.source = AnswerSource::Diverged(Divergence { record, asked, recorded, equal });
        self.come_back(progress);
    }

    /// Has the machine come back to the embedder.
    fn come_back(&self, progress: &mut ReplayProgress) {
        progress.comes_back = true;
        self.inbox.ring();
    }

    /// Has the machine look into the inbox in each round until the next record, if that is of the inbox.
    fn ring_if_needed(&self, progress: &ReplayProgress) {
        let next = progress.records.get(progress.replayed);
        if matches!(next, Some(NotedRecord { record: Record::Received(_), .. })) {
            self.inbox.ring();
        }
    }

    fn show(&self, output: Output, bytes: &[u8]) {
        if matches!(self.progress().source, AnswerSource::Diverged(_) | AnswerSource::Over(_)) {
            return;
        }
        match &mut *self.screen.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(screen) => screen(output, bytes),
            None => self.captured.append(output, bytes),
        }
    }

    /// Returns what is answered in place of a record: `there` in a world without anything.
    fn without<T>(&self, there: T, after: T) -> T {
        if self.progress().source == AnswerSource::Nothing { there } else { after }
    }
}

impl Host for ReplayHost {
    fn monotonic(&mut self) -> u64 {
        self.next_plain::<Monotonic>("the time").map_or_else(|| self.progress().time, |answer| answer.0)
    }

    fn wall_clock(&mut self) -> i64 {
        self.next_plain::<WallClock>("the time of day").map_or(0, |answer| answer.0)
    }

    fn processor_time(&mut self) -> u64 {
        self.next_plain::<ProcessorTime>("the time of the processor").map_or(0, |answer| answer.0)
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        let asked = || "to wait".to_string();
        if let Some(answer) = self.next::<Waited>(QuestionHash::of_wait(deadline, awaited), &asked) {
            return answer.0;
        }
        let mut progress = self.progress();
        match deadline {
            Some(deadline) => {
                progress.time = progress.time.max(deadline);
                Wake::Time
            }
            None => {
                // Nothing will ever come: the machine comes back instead of asking again.
                self.come_back(&mut progress);
                Wake::Never
            }
        }
    }

    /// The time that the program knows.
    fn stopwatch(&mut self) -> u64 {
        self.progress().time
    }

    fn is_virtual(&self) -> bool {
        self.next_plain::<Virtual>("whether time is virtual").is_some_and(|answer| answer.0)
    }

    fn seed(&mut self) -> u64 {
        self.next_plain::<Seed>("the seed").map_or(0, |answer| answer.0)
    }

    fn arguments(&mut self) -> Vec<String> {
        self.next_plain::<Arguments>("the arguments").map_or(Vec::new(), |answer| answer.0)
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        let asked = || format!("to write {} to {}", quoted(bytes), stream(output));
        let answer = self.next::<Written>(QuestionHash::of_write(output, bytes), &asked);
        // Output is shown even if the recorded write failed, as it is what the program wanted to write.
        self.show(output, bytes);
        answer.map_or_else(|| self.without(Ok(()), Err(HostError::BrokenPipe)), |answer| answer.0)
    }

    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        let asked = || format!("to write {} to {}", quoted(bytes), stream(output));
        let answer = self.next::<PassedOn>(QuestionHash::of_write(output, bytes), &asked);
        let missing = || self.without(Ok(bytes.len()), Err(HostError::BrokenPipe));
        let passed_on = answer.map_or_else(missing, |answer| answer.0);
        let count = passed_on.as_ref().map_or(bytes.len(), |&count| count.min(bytes.len()));
        self.show(output, &bytes[..count]);
        passed_on
    }

    fn read_input(&mut self) -> Input {
        self.next_plain::<Read>("for standard input").map_or(Input::End, |answer| answer.0)
    }

    fn is_interactive(&mut self) -> bool {
        self.next_plain::<Interactive>("whether a person watches").is_some_and(|answer| answer.0)
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        let question = QuestionHash::of_request(&request);
        self.take_intent(question);
        let asked = || format!("of files: {request:?}");
        let answer = self.next::<Filed>(question, &asked);
        answer.map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn permit(&mut self, right: Right, object: &str, _narrowed: &[Rights]) -> Permit {
        let asked = || format!("for the right {}", right.flag(object));
        let answer = self.next::<Permitted>(QuestionHash::of_permit(right, object), &asked);
        answer.map_or(Permit::NotGranted, |answer| answer.0)
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        let asked = || format!("for the contents of `{path}`");
        let answer = self.next::<FileRead>(QuestionHash::of_path(path), &asked);
        answer.map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        let asked = || format!("to write {} to `{path}`", quoted(bytes));
        let question = QuestionHash::of_write_file(path, bytes, mode);
        self.take_intent(question);
        let answer = self.next::<Written>(question, &asked);
        answer.map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn file_exists(&mut self, path: &str) -> bool {
        let asked = || format!("whether there is `{path}`");
        self.next::<Exists>(QuestionHash::of_path(path), &asked).is_some_and(|answer| answer.0)
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        let asked = || format!("to delete `{path}`");
        self.take_intent(QuestionHash::of_path(path));
        let answer = self.next::<Written>(QuestionHash::of_path(path), &asked);
        answer.map_or(Err(HostError::Refused), |answer| answer.0)
    }

    fn due(&mut self, deadline: u64) -> Option<u64> {
        {
            let mut progress = self.progress();
            if progress.source != AnswerSource::Records {
                return Some(progress.time).filter(|&now| now >= deadline);
            }
            let next = progress.records.get(progress.replayed).map(|noted| &noted.record);
            let is_due = matches!(next, Some(&Record::Due((n, _))) if n == progress.not_due);
            if !is_due {
                progress.not_due += 1;
                return None;
            }
        }
        let asked = || "whether a time has come".to_string();
        let answer = self.next::<Due>(QuestionHash::of(&[&deadline.to_le_bytes()]), &asked);
        answer.map(|answer| answer.0.1)
    }

    fn call(
        &mut self,
        call: HostCall<'_>,
        _function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        let is_missing = || HostFailure {
            cause: "NOT-IN-THIS-WORLD".into(),
            arguments: vec![Datum::string(call.name, Span::default())],
        };
        let question = QuestionHash::of_call(call.name, call.arguments);
        self.take_intent(question);
        let answer = self.next::<Called>(question, &|| asked_call(call));
        answer.map_or_else(|| Err(is_missing()), |answer| answer.0)
    }

    /// Nothing is begun; what was heard then is heard again.
    fn begin(&mut self, call: HostCall<'_>, _function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        self.take_intent(QuestionHash::of_call(call.name, call.arguments));
    }

    fn inbox(&self) -> Inbox {
        self.inbox.clone()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        if !self.is_shared {
            self.drop_arrivals();
        }
        {
            let mut progress = self.progress();
            if progress.source != AnswerSource::Records {
                let comes_back = std::mem::take(&mut progress.comes_back);
                return match progress.source {
                    _ if !comes_back => Vec::new(),
                    AnswerSource::Nothing | AnswerSource::Preparing => vec![Incoming::Stop],
                    // The signal cuts the end of the run short, if that is where it is.
                    _ => vec![Incoming::Signal(ProcessSignal::Interrupt), Incoming::Stop],
                };
            }
            let next = progress.records.get(progress.replayed).map(|noted| &noted.record);
            match next {
                Some(&Record::Received((n, _))) if n == round => {}
                Some(&Record::Received((n, _))) if n < round => {
                    let recorded = format!("the arrivals of round {n}");
                    self.diverge(&mut progress, format!("for the arrivals of round {round}"), recorded);
                    return Vec::new();
                }
                _ => {
                    self.ring_if_needed(&progress);
                    return Vec::new();
                }
            }
        }
        self.next_plain::<Received>("the arrivals").map_or(Vec::new(), |answer| answer.0.1)
    }

    fn replay_state(&self) -> ReplayState {
        match self.progress().source {
            AnswerSource::Records if !self.is_shared => ReplayState::Replays,
            AnswerSource::Diverged(_) | AnswerSource::Over(_) if !self.is_shared => ReplayState::IsOver,
            _ => ReplayState::Live,
        }
    }

    fn check(&mut self, check: RunCheck) {
        let mut progress = self.progress();
        if progress.source != AnswerSource::Records {
            return;
        }
        let next = progress.records.get(progress.replayed).map(|noted| &noted.record);
        let Some(&Record::Checked(recorded)) = next else { return };
        if recorded.round > check.round {
            return;
        }
        if recorded != check {
            let say = |check: RunCheck| {
                format!("round {}, tick {}, canary {:016x}", check.round, check.ticks, check.canary)
            };
            return self.diverge(&mut progress, format!("nothing, but is at {}", say(check)), say(recorded));
        }
        progress.equal = Some(check);
        progress.checks += 1;
        progress.replayed += 1;
        self.ring_if_needed(&progress);
    }

    fn broken_output_status(&self) -> u8 {
        let answer = self.next_plain::<BrokenOutput>("for the status of a closed output");
        answer.map_or(0, |answer| answer.0)
    }
}

#[cfg(test)]
mod tests;
