//! A host that tells a recorder what comes from outside, which operations begin, and what is printed.

use esl_bytecode::datum::{Datum, DatumKind};
use esl_host::{
    ActionId, Awaited, FileAnswer, FileRequest, Host, HostCall, HostError, HostFailure, HostState, Inbox,
    Incoming, Input, Output, Permit, ReplayState, Right, Rights, RunCheck, Wake, WriteMode,
};

use super::recorder::RunRecorder;
use super::topics::ReplayedTopics;

/// A host whose requests a recorder hears.
pub struct ObservedHost<H> {
    host: H,
    recorder: RunRecorder,
    /// The monotonic clock at the beginning.
    start: u64,
    /// Those of a run that is replayed. Such a host must not be asked more than the program asks.
    topics: Option<ReplayedTopics>,
}

impl<H: Host> ObservedHost<H> {
    /// Tells `recorder` of the requests to `host`.
    pub fn new(mut host: H, recorder: RunRecorder) -> ObservedHost<H> {
        let start = host.monotonic();
        ObservedHost { host, recorder, start, topics: None }
    }

    /// Tells `recorder` of the requests to `host`, which replays a run.
    pub fn of_replay(host: H, recorder: RunRecorder) -> ObservedHost<H> {
        ObservedHost { host, recorder, start: 0, topics: Some(ReplayedTopics::new()) }
    }

    /// Notes the time.
    fn note_time(&mut self) {
        let now = if self.topics.is_some() { self.host.stopwatch() } else { self.host.monotonic() };
        self.recorder.note_time(now.saturating_sub(self.start));
    }
}

impl<H: Host> Host for ObservedHost<H> {
    fn monotonic(&mut self) -> u64 {
        self.host.monotonic()
    }

    fn wall_clock(&mut self) -> i64 {
        self.host.wall_clock()
    }

    fn processor_time(&mut self) -> u64 {
        self.host.processor_time()
    }

    fn due(&mut self, deadline: u64) -> Option<u64> {
        self.host.due(deadline)
    }

    fn wait(&mut self, deadline: Option<u64>, awaited: Awaited) -> Wake {
        self.host.wait(deadline, awaited)
    }

    fn save(&self) -> Option<HostState> {
        self.host.save()
    }

    fn restore(&mut self, state: &HostState) -> bool {
        self.host.restore(state)
    }

    fn stopwatch(&mut self) -> u64 {
        self.host.stopwatch()
    }

    fn is_virtual(&self) -> bool {
        self.host.is_virtual()
    }

    fn advance(&mut self, nanoseconds: u64) {
        self.host.advance(nanoseconds);
    }

    fn seed(&mut self) -> u64 {
        self.host.seed()
    }

    fn arguments(&mut self) -> Vec<String> {
        self.host.arguments()
    }

    fn write(&mut self, output: Output, bytes: &[u8]) -> Result<(), HostError> {
        self.note_time();
        self.recorder.note_output(usize::from(output == Output::Error), bytes);
        self.host.write(output, bytes)
    }

    fn write_ready(&mut self, output: Output, bytes: &[u8]) -> Result<usize, HostError> {
        let written = self.host.write_ready(output, bytes);
        if let Ok(count) = written {
            self.note_time();
            self.recorder.note_output(usize::from(output == Output::Error), &bytes[..count]);
        }
        written
    }

    fn read_input(&mut self) -> Input {
        self.host.read_input()
    }

    fn is_interactive(&mut self) -> bool {
        self.host.is_interactive()
    }

    fn permit(&mut self, right: Right, object: &str, narrowed: &[Rights]) -> Permit {
        self.host.permit(right, object, narrowed)
    }

    fn read_file(&mut self, path: &str) -> Result<Vec<u8>, HostError> {
        self.host.read_file(path)
    }

    fn write_file(&mut self, path: &str, bytes: &[u8], mode: WriteMode) -> Result<(), HostError> {
        self.host.write_file(path, bytes, mode)
    }

    fn file_exists(&mut self, path: &str) -> bool {
        self.host.file_exists(path)
    }

    fn delete_file(&mut self, path: &str) -> Result<(), HostError> {
        self.host.delete_file(path)
    }

    fn request_of_files(&mut self, request: FileRequest<'_>) -> Result<FileAnswer, HostError> {
        self.host.request_of_files(request)
    }

    fn call(
        &mut self,
        call: HostCall<'_>,
        function: &mut dyn FnMut(&[Datum]) -> Result<Datum, HostFailure>,
    ) -> Result<Datum, HostFailure> {
        if let Some(topics) = &self.topics {
            topics.note_call(call.name, call.arguments, |topic, of_type, payload| {
                self.recorder.note_topic(topic, of_type, payload);
            });
        }
        let answer = self.host.call(call, function);
        if self.topics.is_some()
            && call.name == "%TIME-NOW"
            && let Ok(answer) = &answer
            && let DatumKind::Float(seconds) = answer.kind()
        {
            self.note_time();
            self.recorder.note_time_of_day(*seconds);
        }
        answer
    }

    fn begin(&mut self, call: HostCall<'_>, function: &mut dyn FnMut(&[Datum], Option<ActionId>)) {
        self.note_time();
        self.recorder.note_operation(call.name, call.arguments);
        if let Some(topics) = &mut self.topics {
            topics.note_operation(call.name, call.arguments, |topic, of_type, payload| {
                self.recorder.note_topic(topic, of_type, payload);
            });
        }
        self.host.begin(call, function);
    }

    fn inbox(&self) -> Inbox {
        self.host.inbox()
    }

    fn poll(&mut self, round: u64) -> Vec<Incoming> {
        let arrivals = self.host.poll(round);
        if !arrivals.is_empty() {
            self.note_time();
            self.recorder.note_arrivals(&arrivals);
            if let Some(topics) = &mut self.topics {
                for arrival in &arrivals {
                    topics.note_arrival(arrival, |topic, of_type, payload| {
                        self.recorder.note_topic(topic, of_type, payload);
                    });
                }
            }
        }
        arrivals
    }

    fn broken_output_status(&self) -> u8 {
        self.host.broken_output_status()
    }

    fn replay_state(&self) -> ReplayState {
        self.host.replay_state()
    }

    fn hear_of_refusal(&mut self) {
        self.host.hear_of_refusal();
    }

    fn check(&mut self, check: RunCheck) {
        self.host.check(check);
    }
}
