//! Events of a run, as an observer is told of them, as messages.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use esl_bytecode::Bytes;
use esl_bytecode::datum::Datum;
use esl_host::{Incoming, News};
use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;
use serde_json::{Value, json};

use super::RunSink;
use super::json::{array_of, fact_of, value_of};
use super::log::{LogLevel, SCHEMA, level_of, message};
use super::tap;
use crate::mcap::OutputChannel;
use crate::message::{MessageType, Types};

/// Cause of the failure of a function that reaches the outside, in a world without one.
const NO_OUTSIDE: &str = ":NOT-IN-THIS-WORLD";

/// Most characters of a line that is recorded.
const LINE: usize = 10_000;

/// A task that has not ended.
struct KnownTask {
    name: String,
    is_hidden: bool,
    state: String,
}

#[derive(Default)]
struct RecorderState {
    channels: HashMap<String, Option<u16>>,
    tasks: HashMap<u64, KnownTask>,
    /// Names of the operations under way, by their numbers.
    operations: HashMap<u64, String>,
    begun: u64,
    /// Incomplete lines of the standard output and the error output.
    lines: [Vec<u8>; 2],
}

struct RecordedRun {
    sink: Arc<dyn RunSink>,
    /// Time at which the run began, in nanoseconds since 1970.
    start: u64,
    /// Time of the last event that the machine has told, since the start.
    latest: AtomicU64,
    /// Time of the first event that the machine tells, since the start.
    delay: AtomicU64,
    /// Time at which a run that is replayed began, by the clock of its records.
    origin: AtomicU64,
    /// The start of a run that is replayed, by the first time of day that the program was told.
    told: OnceLock<u64>,
    state: Mutex<RecorderState>,
}

/// A recorder of a run. Clones are the same.
#[derive(Clone)]
pub struct RunRecorder(Arc<RecordedRun>);

/// Schemas of the channels that are not topics of ROS 2.
fn schema(name: &str, properties: &Value) -> (String, String, Bytes) {
    let text = json!({ "title": name, "type": "object", "properties": properties }).to_string();
    (name.to_owned(), "jsonschema".into(), Bytes::from(text))
}

impl RunRecorder {
    /// Returns a recorder of a run that begins at this time, in nanoseconds since 1970. It hears of the
    /// topics of ROS 2 of the process from now on.
    pub fn begin(sink: Arc<dyn RunSink>, start: u64) -> RunRecorder {
        let recorder = RecordedRun {
            sink,
            start,
            latest: AtomicU64::new(0),
            delay: AtomicU64::new(0),
            origin: AtomicU64::new(0),
            told: OnceLock::new(),
            state: Mutex::default(),
        };
        let recorder = RunRecorder(Arc::new(recorder));
        tap::set(Some(recorder.clone()));
        recorder
    }

    /// Ends the recording of topics, and records incomplete lines.
    pub fn end(&self) {
        tap::set(None);
        let time = self.now();
        for output in [0, 1] {
            let rest = std::mem::take(&mut self.state().lines[output]);
            if !rest.is_empty() {
                self.note_line(time, output, &rest);
            }
        }
    }

    /// Notes that the run, which is replayed, began at this time of the clock of its records, in nanoseconds.
    pub fn set_origin(&self, time: u64) {
        self.0.origin.store(time, Ordering::Relaxed);
    }

    /// Notes the time of day that a program was told, in seconds since 1970.
    pub(super) fn note_time_of_day(&self, seconds: f64) {
        let told = (seconds.max(0.0) * 1e9) as u64;
        self.0.told.get_or_init(|| told.saturating_sub(self.0.latest.load(Ordering::Relaxed)));
    }

    /// Returns the time at which a run that is replayed began, in nanoseconds since 1970, once the program
    /// was told the time of day.
    pub fn told_start(&self) -> Option<u64> {
        self.0.told.get().copied()
    }

    /// Notes that the machine counts its time from so long after the start on.
    pub fn set_delay(&self, delay: std::time::Duration) {
        self.0.delay.store(u64::try_from(delay.as_nanos()).unwrap_or(0), Ordering::Relaxed);
    }

    fn state(&self) -> MutexGuard<'_, RecorderState> {
        // It is whole at every moment, so a panic elsewhere does not corrupt it.
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> u64 {
        self.0.start.saturating_add(self.0.latest.load(Ordering::Relaxed))
    }

    /// Notes that the machine is so far, in nanoseconds since the start.
    pub(super) fn note_time(&self, time: u64) {
        let since = time.saturating_sub(self.0.origin.load(Ordering::Relaxed));
        self.0.latest.fetch_max(since, Ordering::Relaxed);
    }

    fn note(&self, topic: &str, time: u64, make: impl FnOnce() -> OutputChannel, message: &Value) {
        let channel = {
            let mut state = self.state();
            match state.channels.get(topic) {
                Some(known) => *known,
                None => {
                    let number = self.0.sink.channel(make());
                    state.channels.insert(topic.to_owned(), number);
                    number
                }
            }
        };
        if let Some(channel) = channel {
            self.0.sink.message(channel, time, Bytes::from(message.to_string()));
        }
    }

    /// Records a message of a channel of this kind.
    fn note_json(&self, topic: &str, kind: &str, properties: &Value, time: u64, message: &Value) {
        let make = || OutputChannel {
            topic: topic.to_owned(),
            encoding: "json".into(),
            schema: Some(schema(kind, properties)),
            metadata: Vec::new(),
        };
        self.note(topic, time, make, message);
    }

    fn note_log(&self, time: u64, level: LogLevel, text: &str, name: &str) {
        let make = || OutputChannel {
            topic: "/esl/log".into(),
            encoding: "json".into(),
            schema: Some(("foxglove.Log".into(), "jsonschema".into(), Bytes::from_static(SCHEMA.as_bytes()))),
            metadata: Vec::new(),
        };
        self.note("/esl/log", time, make, &message(time, level, text, name));
    }

    /// Records a message under a topic of ROS 2.
    pub(super) fn note_topic(&self, topic: &str, of_type: &MessageType, payload: &[u8]) {
        let name = format!("{topic} {}", of_type.hash());
        let channel = {
            let mut state = self.state();
            *state
                .channels
                .entry(name)
                .or_insert_with(|| topic_channel(topic, of_type).and_then(|made| self.0.sink.channel(made)))
        };
        if let Some(channel) = channel {
            self.0.sink.message(channel, self.now(), Bytes::copy_from_slice(payload));
        }
    }

    /// Records bytes of the standard output, 0, or the error output, 1.
    pub(super) fn note_output(&self, output: usize, bytes: &[u8]) {
        let lines: Vec<Vec<u8>> = {
            let kept = &mut self.state().lines[output];
            kept.extend_from_slice(bytes);
            let Some(end) = kept.iter().rposition(|&byte| byte == b'\n') else {
                kept.truncate(4 * LINE);
                return;
            };
            let rest = kept.split_off(end + 1);
            std::mem::replace(kept, rest).split(|&byte| byte == b'\n').map(<[u8]>::to_vec).collect()
        };
        let time = self.now();
        lines.iter().filter(|line| !line.is_empty()).for_each(|line| self.note_line(time, output, line));
    }

    fn note_line(&self, time: u64, output: usize, line: &[u8]) {
        let text: String = String::from_utf8_lossy(line).chars().take(LINE).collect();
        match output {
            0 => self.note_log(time, LogLevel::Debug, &text, "output"),
            _ => {
                let (level, text) = level_of(&text);
                self.note_log(time, level, &text, "log");
            }
        }
    }

    /// Records what has come from outside.
    pub(super) fn note_arrivals(&self, arrivals: &[Incoming]) {
        for arrival in arrivals {
            match arrival {
                Incoming::Message { input, arguments } => self.note_input(input, arguments),
                Incoming::Operation { number, news } => self.note_news(*number, news),
                _ => {}
            }
        }
    }

    fn note_input(&self, input: &str, arguments: &[Datum]) {
        // The inputs of modules have numbers behind their names.
        let name = match input.rsplit_once(' ') {
            Some((name, number)) if number.bytes().all(|byte| byte.is_ascii_digit()) => name,
            _ => input,
        };
        let name = name.trim_matches('*').to_lowercase().replace(' ', "_");
        let properties = json!({ "value": {}, "arguments": { "type": "array" } });
        let value = arguments.first().map_or(Value::Null, value_of);
        let message = json!({ "value": value, "arguments": array_of(arguments) });
        let topic = format!("/esl/inputs/{}", name.trim_start_matches('/'));
        self.note_json(&topic, "esl.Input", &properties, self.now(), &message);
    }

    /// Records the beginning of an operation of the host.
    pub(super) fn note_operation(&self, name: &str, arguments: &[Datum]) {
        let name = name.to_lowercase();
        let number = {
            let mut state = self.state();
            state.begun += 1;
            let number = state.begun;
            state.operations.insert(number, name.clone());
            number
        };
        self.tell_operation(number, &name, "begun", &array_of(arguments));
    }

    fn note_news(&self, number: u64, news: &News) {
        let (state, data, is_over) = match news {
            News::Completed(values) => ("completed", array_of(values), true),
            News::Failed(failure) => {
                let cause = failure.cause.to_lowercase();
                ("failed", json!({ "cause": cause, "arguments": array_of(&failure.arguments) }), true)
            }
            _ => ("progress", Value::Null, false),
        };
        let name = {
            let operations = &mut self.state().operations;
            let name = operations.get(&number).cloned().unwrap_or_default();
            if is_over {
                operations.remove(&number);
            }
            name
        };
        self.tell_operation(number, &name, state, &data);
    }

    fn tell_operation(&self, number: u64, name: &str, state: &str, data: &Value) {
        let properties = json!({
            "operation": { "type": "string" }, "number": { "type": "integer" }, "state": { "type": "string" },
            "data": {},
        });
        let message = json!({ "operation": name, "number": number, "state": state, "data": data });
        self.note_json("/esl/operations", "esl.Operation", &properties, self.now(), &message);
    }

    fn note_state(&self, time: u64, task: u64, state: &str, reason: &str) {
        let name = {
            let mut known = self.state();
            let Some(known) = known.tasks.get_mut(&task) else { return };
            let whole = format!("{state} {reason}");
            if known.is_hidden || known.state == whole {
                return;
            }
            known.state = whole;
            known.name.clone()
        };
        let properties = json!({
            "task": { "type": "string" }, "number": { "type": "integer" }, "state": { "type": "string" },
            "reason": { "type": "string" },
        });
        let message = json!({ "task": name, "number": task, "state": state, "reason": reason });
        self.note_json("/esl/tasks", "esl.Task", &properties, time, &message);
    }

    fn name_of(&self, task: u64) -> String {
        self.state().tasks.get(&task).map(|task| task.name.clone()).unwrap_or_default()
    }

    fn note_failure(&self, time: u64, task: u64, cause: &str, is_recovery: bool) {
        let name = self.name_of(task);
        let event = if is_recovery { "recovers" } else { "fails" };
        let properties = json!({
            "task": { "type": "string" }, "number": { "type": "integer" }, "cause": { "type": "string" },
            "event": { "type": "string" },
        });
        let message = json!({ "task": name, "number": task, "cause": cause, "event": event });
        self.note_json("/esl/failures", "esl.Failure", &properties, time, &message);
        // The library asks whether there is an outside by such failures, and handles them.
        if cause == NO_OUTSIDE {
            return;
        }
        let (level, word) = match is_recovery {
            true => (LogLevel::Info, "recovers from"),
            // One that nothing handles is in the report that follows.
            false => (LogLevel::Warning, "fails with"),
        };
        self.note_log(time, level, &format!("{name} {word} {cause}"), "failures");
    }

    fn note_signal(&self, time: u64, task: u64, event: &str) {
        let properties = json!({ "event": { "type": "string" }, "task": { "type": "string" } });
        let message = json!({ "event": event, "task": self.name_of(task) });
        self.note_json("/esl/signals", "esl.Signal", &properties, time, &message);
    }

    fn note_fact(&self, time: u64, fact: &str, is_there: bool) {
        let (name, arguments) = fact_of(fact);
        let properties = json!({
            "fact": { "type": "string" }, "present": { "type": "boolean" }, "value": {},
            "arguments": { "type": "array" },
        });
        // The last argument is the value of a property.
        let value = arguments.last().filter(|_| is_there).cloned().unwrap_or(Value::Null);
        let message = json!({ "fact": fact, "present": is_there, "value": value, "arguments": arguments });
        self.note_json(&format!("/esl/facts/{name}"), "esl.Fact", &properties, time, &message);
    }
}

/// Returns the channel of a topic of ROS 2; `None` if its type has no text.
fn topic_channel(topic: &str, of_type: &MessageType) -> Option<OutputChannel> {
    static BUNDLED: OnceLock<Types> = OnceLock::new();
    let bundled = BUNDLED.get_or_init(Types::bundled);
    let is_bundled = bundled.message(of_type.name()).is_ok_and(|known| known.hash() == of_type.hash());
    let text = match is_bundled {
        true => bundled.joined_text(of_type.name()).ok(),
        false => None,
    };
    let text = text.unwrap_or_else(|| of_type.text_of_fields());
    Some(OutputChannel {
        topic: topic.to_owned(),
        encoding: "cdr".into(),
        schema: Some((of_type.name().to_owned(), "ros2msg".into(), Bytes::from(text))),
        metadata: vec![("topic_type_hash".into(), of_type.hash().to_owned())],
    })
}

impl Observer for RunRecorder {
    fn see(&mut self, since: u64, TaskNumber(task): TaskNumber, seen: Seen<'_>) {
        self.note_time(since.saturating_add(self.0.delay.load(Ordering::Relaxed)));
        let time = self.now();
        match seen {
            Seen::Begins { name, is_hidden } => {
                let known = KnownTask { name: name.to_owned(), is_hidden, state: String::new() };
                self.state().tasks.insert(task, known);
            }
            Seen::IsNamed(name) => {
                if let Some(known) = self.state().tasks.get_mut(&task) {
                    name.clone_into(&mut known.name);
                }
            }
            // A task that is ready runs within the slices of others.
            Seen::Runs | Seen::IsReady => self.note_state(time, task, "active", ""),
            Seen::Waits(reason) => self.note_state(time, task, "waits", reason),
            Seen::IsSuspended(reason) => self.note_state(time, task, "suspended", reason),
            Seen::IsToEnd => self.note_state(time, task, "ending", ""),
            Seen::Ends(how) => {
                self.note_state(time, task, how, "");
                self.state().tasks.remove(&task);
            }
            Seen::Signals(event) => self.note_signal(time, task, event),
            Seen::Fails(cause) => self.note_failure(time, task, cause, false),
            Seen::Recovers(cause) => self.note_failure(time, task, cause, true),
            Seen::Changes { fact, is_there } => self.note_fact(time, fact, is_there),
            Seen::IsWokenBy { .. }
            | Seen::CollectionBegins
            | Seen::PauseBegins
            | Seen::PauseEnds
            | Seen::CollectionEnds => {}
        }
    }
}
