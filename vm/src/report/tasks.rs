//! Reports on tasks: the deadlock report, when no task can ever run again, and the tree of all tasks.

use esl_bytecode::compile::{MODULE_SOURCES, SourcePlace};
use esl_bytecode::word::Word;
use esl_host::SurveyedTask;
use esl_host::machine::task_order;

use super::survey::{lock_owners, maker_of, row_of};
use super::{event_label, lack_of, task_label};
use crate::fused::original;
use crate::interp::frames::{Frame, Frames};
use crate::interp::start::first_code_of;
use crate::task::{Task, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::lineage;

/// Maximal number of tasks that a deadlock report names.
const SHOWN: usize = 20;
/// Maximal number of tasks that the tree shows.
const SHOWN_IN_TREE: usize = 1000;
/// Maximal number of frames searched for a line of the program.
const FRAMES: usize = 50;

/// Returns whether a source belongs to the library, or to a module that comes with the machine, by its name.
pub(super) fn is_of_library(source: &str) -> bool {
    source.ends_with(".esl") && (source.starts_with("stdlib/") || source.starts_with(MODULE_SOURCES))
}

/// Returns the word of the one tail call in some code; `None` if there are several.
fn tail_call_in(words: &[u32]) -> Option<usize> {
    let mut found = None;
    let mut at = 0;
    while let Some(opcode) = words.get(at).and_then(|&word| original(Word(word)).opcode()) {
        if opcode.is_tail() && found.replace(at).is_some() {
            return None;
        }
        at += opcode.words();
    }
    found
}

/// Returns the number of the task that a living task belongs to; 0 if that is none.
pub(crate) fn number_of_owner(vm: &Vm, task: Value) -> u64 {
    let owner = lineage::owner_of(&vm.heap, task).and_then(|index| vm.scheduler.find(index));
    owner.map_or(0, |owner| owner.number.0)
}

impl Vm {
    /// Returns a text that names the waiting tasks of the program, what they wait for, and the lines where
    /// they do.
    pub fn deadlock_report(&self) -> String {
        let mut tasks: Vec<&Task> = self
            .scheduler
            .tasks
            .iter()
            .filter(|task| {
                matches!(task.state, TaskState::Waiting | TaskState::Reading | TaskState::Writing)
                    && !task.flags.hidden()
            })
            .collect();
        tasks.sort_unstable_by_key(|task| task.number);
        let owners = lock_owners(self);
        let mut text = String::from("Deadlock: no task can ever run again.\n");
        for task in tasks.iter().take(SHOWN) {
            let SurveyedTask { name, waits_for, place, .. } = row_of(self, task, &owners);
            let reason = waits_for.unwrap_or_default();
            let place = place.map_or(String::new(), |place| format!(", {place}"));
            let lack = lack_of(self, task);
            text.push_str(&format!("  {name} waits for {reason}{lack}{place}\n"));
        }
        if tasks.len() > SHOWN {
            text.push_str(&format!("  and {} more\n", tasks.len() - SHOWN));
        }
        text
    }

    /// Returns a text that shows the tasks of the program: each below its maker, with what it does and where,
    /// and the ticks that it has used.
    pub fn task_report(&self) -> String {
        let mut tasks: Vec<&Task> = self
            .scheduler
            .tasks
            .iter()
            .filter(|task| task.state != TaskState::Ended && !task.flags.hidden() && !task.flags.kept())
            .collect();
        tasks.sort_unstable_by_key(|task| task.number);
        let owners = lock_owners(self);
        let order = task_order(tasks.iter().map(|task| (task.number.0, maker_of(self, task))));
        let mut text = String::new();
        for (position, depth) in order.iter().take(SHOWN_IN_TREE) {
            text.push_str(&row_of(self, tasks[*position], &owners).line(*depth));
        }
        if tasks.is_empty() {
            text.push_str("No tasks.\n");
        } else if tasks.len() > SHOWN_IN_TREE {
            text.push_str(&format!("and {} more\n", tasks.len() - SHOWN_IN_TREE));
        }
        text
    }
}

/// Returns what is said of the tasks of the program that have not ended: what they are called, and where they
/// are.
pub(crate) fn tasks_left(vm: &Vm) -> Vec<String> {
    let alive = vm.scheduler.tasks.iter();
    let mut tasks: Vec<&Task> =
        alive.filter(|task| task.state != TaskState::Ended && !task.flags.hidden()).collect();
    tasks.sort_unstable_by_key(|task| task.number);
    let say = |task: &Task| {
        let what = if task.runs_cleanup() { ", in a cleanup" } else { "" };
        let place = program_place(vm, task).map_or(String::new(), |place| format!(", {place}"));
        format!("{}{what}{place}", task_label(vm, task.object))
    };
    tasks.iter().take(SHOWN).map(|task| say(task)).collect()
}

/// Returns the names of the operations under way that are not detached.
pub(crate) fn operations_left(vm: &Vm) -> Vec<String> {
    let awaited = vm.outside.operations.open.values().filter(|open| !open.is_detached);
    awaited.take(SHOWN).map(|open| event_label(vm, open.handle)).collect()
}

/// Returns the text of the innermost place of the program at which a parked task stands.
pub(crate) fn program_place(vm: &Vm, task: &Task) -> Option<String> {
    let place = place_in_program(vm, task, Frames::of_task(task))?;
    Some(format!("{}:{}:{}", place.source, place.line, place.column))
}

/// Returns the place at which a frame stands.
pub(super) fn place_of(vm: &Vm, frame: &Frame<'_>) -> Option<SourcePlace> {
    vm.names.source_place(&vm.heap, vm.heap.function_code(frame.function)?, frame.place())
}

/// Returns the text of the place at which a frame stands.
pub(super) fn place_text(vm: &Vm, frame: &Frame<'_>) -> Option<String> {
    let place = place_of(vm, frame)?;
    Some(format!("{}:{}:{}", place.source, place.line, place.column))
}

/// Returns the innermost place of the program, not of the library, at which a task with these frames stands.
/// If tail calls have left no frame of the program, it is that of the tail call in the function with which
/// the task began, or of its beginning if there are several.
pub(crate) fn place_in_program<'a>(
    vm: &Vm,
    task: &Task,
    frames: impl Iterator<Item = Frame<'a>>,
) -> Option<SourcePlace> {
    let place = |code: Value, word: usize| {
        let place = vm.names.source_place(&vm.heap, code, word as u32);
        place.filter(|place| !is_of_library(&place.source))
    };
    let in_frame = |frame: Frame<'_>| place(vm.heap.function_code(frame.function)?, frame.place() as usize);
    frames.take(FRAMES).find_map(in_frame).or_else(|| {
        let code = first_code_of(task);
        place(code, tail_call_in(vm.heap.code_words(code)?).unwrap_or(0))
    })
}
