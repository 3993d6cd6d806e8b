//! A run as a trace in the Trace Event Format: a track for each task with its states as slices, signals as
//! flows, failures and recoveries as marks, and a track for the collector.
//!
//! Guarantees: events are in the order of time; each slice that begins ends; each flow has both ends, inside
//! slices. A trace in progress takes memory for the tasks that have not ended, and for nothing else.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, Write};

use esl_vm::observe::{Observer, Seen};
use esl_vm::task::TaskNumber;

/// Process of the tracks of tasks.
const TASKS: u32 = 1;
/// Process of the machine's own tracks.
const MACHINE: u32 = 2;

/// A trace in progress.
pub struct Trace<W> {
    out: W,
    /// Slice that is open on the track of each task that has not ended.
    tasks: BTreeMap<u64, Option<String>>,
    /// Number of open slices on the collector's track.
    collector: u32,
    flows: u64,
    latest: u64,
    has_events: bool,
    error: Option<io::Error>,
}

impl<W: Write> Trace<W> {
    /// Begins a trace.
    pub fn new(out: W) -> Trace<W> {
        let mut trace = Trace {
            out,
            tasks: BTreeMap::new(),
            collector: 0,
            flows: 0,
            latest: 0,
            has_events: false,
            error: None,
        };
        trace.write("{\"displayTimeUnit\":\"ns\",\"traceEvents\":[");
        trace.name_track(MACHINE, 0, "process_name", "machine");
        trace.name_track(MACHINE, 0, "thread_name", "collector");
        trace.name_track(TASKS, 0, "process_name", "tasks");
        trace
    }

    fn write(&mut self, text: &str) {
        if self.error.is_none()
            && let Err(error) = self.out.write_all(text.as_bytes())
        {
            self.error = Some(error);
        }
    }

    /// Writes an event; `more` are further members.
    fn event(&mut self, phase: char, (process, track): (u32, u64), name: &str, more: &str) {
        let mut text = String::with_capacity(100);
        text.push_str(if self.has_events { ",\n" } else { "\n" });
        self.has_events = true;
        _ = write!(text, "{{\"ph\":\"{phase}\",\"pid\":{process},\"tid\":{track},\"name\":");
        quote(name, &mut text);
        let (micro, nano) = (self.latest / 1000, self.latest % 1000);
        _ = write!(text, ",\"ts\":{micro}.{nano:03}{more}}}");
        self.write(&text);
    }

    fn name_track(&mut self, process: u32, track: u64, what: &str, name: &str) {
        let mut more = String::from(",\"args\":{\"name\":");
        quote(name, &mut more);
        more.push('}');
        self.event('M', (process, track), what, &more);
    }

    /// Ends the open slice of a task, and begins one for `state`.
    fn change(&mut self, task: u64, state: Option<String>) {
        let Some(open) = self.tasks.get_mut(&task) else { return };
        if *open == state {
            return;
        }
        if let Some(old) = std::mem::replace(open, state.clone()) {
            self.event('E', (TASKS, task), &old, "");
        }
        if let Some(name) = state {
            self.event('B', (TASKS, task), &name, ",\"cat\":\"task\"");
        }
    }

    fn mark(&mut self, task: u64, name: &str, category: &str) {
        if self.tasks.contains_key(&task) {
            self.event('i', (TASKS, task), name, &format!(",\"s\":\"t\",\"cat\":\"{category}\""));
        }
    }

    fn flow(&mut self, from: u64, to: u64, name: &str) {
        let has_slice = |task: &u64| self.tasks.get(task).is_some_and(Option::is_some);
        if from == to || !has_slice(&from) || !has_slice(&to) {
            return;
        }
        self.flows += 1;
        let id = self.flows;
        self.event('s', (TASKS, from), name, &format!(",\"cat\":\"signal\",\"id\":{id}"));
        self.event('f', (TASKS, to), name, &format!(",\"cat\":\"signal\",\"id\":{id},\"bp\":\"e\""));
    }

    fn begin_on_collector(&mut self, name: &str) {
        self.collector += 1;
        self.event('B', (MACHINE, 0), name, ",\"cat\":\"collector\"");
    }

    fn end_on_collector(&mut self, name: &str) {
        if self.collector > 0 {
            self.collector -= 1;
            self.event('E', (MACHINE, 0), name, "");
        }
    }

    /// Ends the open slices and the trace.
    ///
    /// # Errors
    /// The first error of writing.
    pub fn end(&mut self) -> io::Result<()> {
        for task in self.tasks.keys().copied().collect::<Vec<_>>() {
            self.change(task, None);
        }
        while self.collector > 0 {
            self.end_on_collector(if self.collector > 1 { "pause" } else { "collection" });
        }
        self.write("\n]}\n");
        match self.error.take() {
            Some(error) => Err(error),
            None => self.out.flush(),
        }
    }
}

impl<W: Write + Send> Observer for Trace<W> {
    fn see(&mut self, time: u64, TaskNumber(task): TaskNumber, seen: Seen<'_>) {
        self.latest = time;
        match seen {
            Seen::Begins { name, is_hidden } => {
                let name = if is_hidden { format!("library: {name}") } else { name.to_string() };
                self.name_track(TASKS, task, "thread_name", &name);
                let order = format!(",\"args\":{{\"sort_index\":{task}}}");
                self.event('M', (TASKS, task), "thread_sort_index", &order);
                self.tasks.insert(task, None);
            }
            Seen::IsNamed(name) => self.name_track(TASKS, task, "thread_name", name),
            Seen::Runs => self.change(task, Some("runs".into())),
            Seen::IsReady => self.change(task, Some("ready".into())),
            Seen::Waits(reason) | Seen::IsSuspended(reason) => {
                self.change(task, Some(format!("waits for {reason}")));
            }
            Seen::IsToEnd => self.mark(task, "abort requested", "task"),
            Seen::Ends(how) => {
                self.change(task, None);
                self.mark(task, how, "task");
                self.tasks.remove(&task);
            }
            Seen::Signals(event) => self.mark(task, &format!("signals {event}"), "signal"),
            Seen::IsWokenBy { task: by, event } => self.flow(by.0, task, event),
            Seen::Fails(cause) => self.mark(task, &format!("fails with {cause}"), "failure"),
            Seen::Recovers(cause) => self.mark(task, &format!("recovers from {cause}"), "failure"),
            Seen::CollectionBegins => self.begin_on_collector("collection"),
            Seen::PauseBegins => self.begin_on_collector("pause"),
            Seen::PauseEnds => self.end_on_collector("pause"),
            Seen::Changes { .. } => {}
            Seen::CollectionEnds => self.end_on_collector("collection"),
        }
    }
}

/// Appends a text as a JSON string.
fn quote(text: &str, out: &mut String) {
    out.push('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            '\n' => out.push_str("\\n"),
            c if c < ' ' => _ = write!(out, "\\u{:04x}", u32::from(c)),
            c => out.push(c),
        }
    }
    out.push('"');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_open_is_ended_and_flows_have_two_ends() {
        let mut bytes = Vec::new();
        let mut trace = Trace::new(&mut bytes);
        let seen = [
            (0, 1, Seen::Begins { name: "a \"b\"\n", is_hidden: false }),
            (5, 1, Seen::Runs),
            (6, 2, Seen::Begins { name: "c", is_hidden: true }),
            (6, 2, Seen::Waits("event E")),
            (7, 1, Seen::Signals("event E")),
            (7, 2, Seen::IsReady),
            (7, 2, Seen::IsWokenBy { task: TaskNumber(1), event: "event E" }),
            (8, 2, Seen::IsWokenBy { task: TaskNumber(9), event: "of nobody" }),
            (1500, 0, Seen::CollectionBegins),
            (1501, 1, Seen::Ends("failed")),
        ];
        for (time, task, seen) in seen {
            trace.see(time, TaskNumber(task), seen);
        }
        trace.end().expect("a vector takes it all");
        let text = String::from_utf8(bytes).expect("text");
        let count = |what: &str| text.matches(what).count();
        assert_eq!(count("\"ph\":\"B\""), count("\"ph\":\"E\""));
        assert_eq!((count("\"ph\":\"s\""), count("\"ph\":\"f\"")), (1, 1));
        assert!(
            text.contains(r#""name":"a \"b\"\n""#) && text.contains("\"ts\":1.501") && text.ends_with("]}\n")
        );
    }
}
