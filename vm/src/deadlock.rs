//! What is said when no task can ever run again: who waits, for what, and where.

use crate::heap::Kind;
use crate::interp;
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// Tasks that a report names.
const SHOWN: usize = 20;
/// Frames in which the line of the program is looked for.
const FRAMES: usize = 50;

/// Whether a source is one of the library, by the name that its build gives it.
fn is_of_library(source: &str) -> bool {
    source.starts_with("stdlib/") && source.ends_with(".esl")
}

impl Vm {
    /// A text that names the tasks that wait, what they wait for, and the lines where they do. Those of the library are
    /// left out.
    pub fn deadlock_report(&self) -> String {
        let mut tasks: Vec<&Task> = self
            .tasks
            .iter()
            .filter(|task| {
                matches!(task.state, TaskState::Waiting | TaskState::Reading) && !task.flags.hidden()
            })
            .collect();
        tasks.sort_unstable_by_key(|task| task.number);
        let mut text = String::from("Deadlock: no task can ever run again.\n");
        for task in tasks.iter().take(SHOWN) {
            let label = self.task_label(task.object);
            let place = self.program_place(task).map_or(String::new(), |place| format!(", {place}"));
            text.push_str(&format!("  {label} waits for {}{place}\n", self.reason_of(task)));
        }
        if tasks.len() > SHOWN {
            text.push_str(&format!("  and {} more\n", tasks.len() - SHOWN));
        }
        text
    }

    /// What a task waits for.
    pub(crate) fn reason_of(&self, task: &Task) -> String {
        if task.state == TaskState::Reading {
            return "input".into();
        }
        if task.wait.is_nil() {
            return "a time".into();
        }
        let (events, what) = self.waited_for(task.wait);
        let first = events.first().copied().unwrap_or(Value::NIL);
        if let Some(pair) = self.heap.as_cons(what) {
            let datum = self.describe(pair.cdr);
            return match self.describe(pair.car).as_str() {
                ":CHECKPOINT" => format!("checkpoint {datum} of {}", self.event_label(first)),
                ":UNTIL" => format!("{datum} to be true"),
                _ => self.heap.string_text(pair.cdr).unwrap_or(datum),
            };
        }
        let labels: Vec<String> = events.iter().map(|&event| self.event_label(event)).collect();
        match &labels[..] {
            [label] if what == self.world.known.task_end => format!("the end of {label}"),
            [label] if self.heap.is(first, Kind::Task) => format!("a signal of {label}"),
            labels => labels.join(" or "),
        }
    }

    pub(crate) fn event_label(&self, event: Value) -> String {
        if self.heap.is(event, Kind::Task) {
            return self.task_label(event);
        }
        if !self.is_event(event) {
            return "nothing".into();
        }
        match self.slot(event, crate::wait::event::NAME) {
            _ if event == self.any_event => "any event".into(),
            name if name.is_true() => format!("event {}", self.describe(name)),
            _ => "an event".into(),
        }
    }

    /// The innermost place of the program, not of the library, at which a task stands.
    fn program_place(&self, task: &Task) -> Option<String> {
        interp::frames_of_task(task, FRAMES).into_iter().find_map(|frame| {
            let code = self.heap.function_code(frame.function)?;
            let word = if frame.is_exact { frame.word } else { frame.word.saturating_sub(1) };
            let place = self.source_place(code, word as u32).filter(|place| !is_of_library(&place.source))?;
            Some(format!("{}:{}:{}", place.source, place.line, place.column))
        })
    }
}
