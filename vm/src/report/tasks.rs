//! What is said of tasks: when no task can ever run again, who waits, for what, and where; and the tree of all of them.

use std::collections::BTreeMap;

use esl_bytecode::opcode::Opcode;

use crate::heap::Kind;
use crate::interp::frames::{Frame, Frames};
use crate::interp::start::first_code_of;
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

/// Tasks that a report names.
const SHOWN: usize = 20;
/// Tasks that the tree of them shows.
const SHOWN_IN_TREE: usize = 1000;
/// Frames in which the line of the program is looked for.
const FRAMES: usize = 50;

/// Whether a source is one of the library, by the name that its build gives it.
fn is_of_library(source: &str) -> bool {
    source.starts_with("stdlib/") && source.ends_with(".esl")
}

/// The word of the one tail call in some code; none if there are several.
fn tail_call_in(words: &[u32]) -> Option<usize> {
    let mut found = None;
    let mut at = 0;
    while let Some(opcode) = words.get(at).and_then(|&word| Opcode::from_number(word as u8)) {
        let is_tail_call = matches!(
            opcode,
            Opcode::TailCall | Opcode::TailCallGlobal | Opcode::TailCallBuiltin | Opcode::TailApply
        );
        if is_tail_call && found.replace(at).is_some() {
            return None;
        }
        at += opcode.words();
    }
    found
}

/// The order in which tasks are shown, each after its maker, and how deep below the first of them. `tasks` are the numbers of each task
/// and of its maker, in the order of the former.
fn depths(tasks: impl Iterator<Item = (u64, u64)>) -> Vec<(usize, usize)> {
    let mut made: BTreeMap<u64, Vec<usize>> = BTreeMap::new();
    let mut numbers = Vec::new();
    let mut makers = Vec::new();
    for (position, (number, maker)) in tasks.enumerate() {
        made.entry(maker).or_default().push(position);
        numbers.push(number);
        makers.push(maker);
    }
    let is_there = |number: &u64| numbers.binary_search(number).is_ok();
    let mut open: Vec<(usize, usize)> = (0..numbers.len())
        .rev()
        .filter(|&position| !is_there(&makers[position]))
        .map(|root| (root, 0))
        .collect();
    let mut order = Vec::new();
    while let Some((position, depth)) = open.pop() {
        order.push((position, depth));
        let children = made.get(&numbers[position]).map_or(&[][..], Vec::as_slice);
        open.extend(children.iter().rev().map(|&child| (child, depth + 1)));
    }
    order
}

impl Vm {
    /// A text that names the tasks that wait, what they wait for, and the lines where they do. Those of the library are
    /// left out.
    pub fn deadlock_report(&self) -> String {
        let mut tasks: Vec<&Task> = self
            .scheduler
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

    /// A text that shows the tasks of the program: each below the one that made it, what it does and where, and the ticks that
    /// it has used.
    pub fn task_report(&self) -> String {
        let mut tasks: Vec<&Task> = self
            .scheduler
            .tasks
            .iter()
            .filter(|task| task.state != TaskState::Ended && !task.flags.hidden() && !task.flags.kept())
            .collect();
        tasks.sort_unstable_by_key(|task| task.number);
        let maker = |task: &Task| self.slot(task.object, event::RESULT).as_index().unwrap_or(0) as u64;
        let depths = depths(tasks.iter().map(|task| (task.number, maker(task))));
        let mut text = String::new();
        for (position, depth) in depths.iter().take(SHOWN_IN_TREE) {
            let task = tasks[*position];
            let label = self.task_label(task.object);
            let state = match task.state {
                TaskState::Runnable => "can run".to_string(),
                _ => format!("waits for {}", self.reason_of(task)),
            };
            let place = self.program_place(task).map_or(String::new(), |place| format!(", {place}"));
            let indent = "  ".repeat((*depth).min(20));
            text.push_str(&format!("{indent}{label} {state}{place}, {} ticks\n", task.ticks));
        }
        if tasks.is_empty() {
            text.push_str("There are no tasks.\n");
        } else if tasks.len() > SHOWN_IN_TREE {
            text.push_str(&format!("and {} more\n", tasks.len() - SHOWN_IN_TREE));
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
            _ if event == self.scheduler.any_event => "any event".into(),
            name if name.is_true() => format!("event {}", self.describe(name)),
            _ => "an event".into(),
        }
    }

    /// The innermost place of the program, not of the library, at which a task stands; if tail calls have left no frame of the
    /// program, that of the tail call in the function with which the task began, or of its beginning if there are several.
    fn program_place(&self, task: &Task) -> Option<String> {
        let place = |code: Value, word: usize| {
            let place = self.source_place(code, word as u32).filter(|place| !is_of_library(&place.source))?;
            Some(format!("{}:{}:{}", place.source, place.line, place.column))
        };
        let in_frame = |frame: Frame<'_>| {
            let word = if frame.is_exact { frame.word } else { frame.word.saturating_sub(1) };
            place(self.heap.function_code(frame.function)?, word)
        };
        Frames::of_task(task).take(FRAMES).find_map(in_frame).or_else(|| {
            let code = first_code_of(task);
            place(code, tail_call_in(self.heap.code_words(code)?).unwrap_or(0))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::depths;

    #[test]
    fn tasks_come_after_their_makers() {
        let tasks = [(2, 1), (4, 2), (5, 3), (7, 4), (8, 2), (9, 5)];
        let tree: Vec<(u64, usize)> = depths(tasks.into_iter())
            .into_iter()
            .map(|(position, depth)| (tasks[position].0, depth))
            .collect();
        assert_eq!(tree, [(2, 0), (4, 1), (7, 2), (8, 1), (5, 0), (9, 1)]);
    }
}
