//! The words by which reports call tasks, events and causes of failures.

use esl_bytecode::datum::Datum;

use crate::datum;
use crate::describe::describe;
use crate::heap::{Heap, Kind};
use crate::names::class;
use crate::names::records::{child, claim, request, resource};
use crate::task::{Task, TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{event, handle, input, link};

/// Returns what reports call the task that `object` stands for.
pub(crate) fn task_label(vm: &Vm, object: Value) -> String {
    let task = event::task_index(&vm.heap, object).and_then(|index| vm.scheduler.find(index));
    let number = task.map_or(TaskNumber::NONE, |task| task.number);
    label_of(vm, vm.heap.slot_or_nil(object, event::NAME), number)
}

/// Returns what reports call a task of this name and number. The number is [`TaskNumber::NONE`] if the task
/// has ended.
pub(crate) fn label_of(vm: &Vm, name: Value, number: TaskNumber) -> String {
    if name.is_true() {
        format!("task {}", describe(&vm.heap, name))
    } else if vm.scheduler.main_number == Some(number) {
        "the main task".into()
    } else if number == TaskNumber::NONE {
        "a task that has ended".into()
    } else {
        format!("task {number}")
    }
}

/// Returns what reports call an event.
pub(crate) fn event_label(vm: &Vm, event: Value) -> String {
    if vm.heap.is(event, Kind::Task) {
        return task_label(vm, event);
    }
    if !event::is_event(&vm.heap, event) {
        return "nothing".into();
    }
    match vm.heap.slot_or_nil(event, event::NAME) {
        name if handle::is_handle(&vm.heap, event) => {
            format!("operation {} {}", describe(&vm.heap, name), handle::number(&vm.heap, event))
        }
        name if input::is_input(&vm.heap, event) => format!("input {}", describe(&vm.heap, name)),
        _ if event == vm.scheduler.any_event => "any event".into(),
        name if name.is_true() => format!("event {}", describe(&vm.heap, name)),
        _ => "an event".into(),
    }
}

/// Returns what a parked task waits for.
pub(crate) fn reason_of(vm: &Vm, task: &Task) -> String {
    if task.state == TaskState::Reading {
        return "input".into();
    }
    if task.state == TaskState::Writing {
        return "room for output".into();
    }
    let index = event::task_index(&vm.heap, task.object);
    let by = index.map_or(Value::NIL, |index| vm.scheduler.tasks.standstill(index).by);
    if by.is_true() {
        return format!("RESUME-TASK, suspended by {}", event_label(vm, by));
    }
    if task.wait.is_nil() {
        return "a time".into();
    }
    let (events, what) = link::waited_for(&vm.heap, task.wait);
    let first = events.first().copied().unwrap_or(Value::NIL);
    if let Some(pair) = vm.heap.as_cons(what) {
        let datum = describe(&vm.heap, pair.cdr);
        return match describe(&vm.heap, pair.car).as_str() {
            ":CHECKPOINT" => format!("checkpoint {datum} of {}", event_label(vm, first)),
            ":UNTIL" => format!("{datum} to be true{}", changes_label(vm, &events)),
            ":CHILDREN" => children_label(vm, pair.cdr),
            ":SUSPENDED" => format!("RESUME-TASK, suspended by {}", event_label(vm, pair.cdr)),
            ":RESOURCE" => resources_label(vm, pair.cdr),
            ":RETRY" => retry_label(vm, pair.cdr),
            _ => vm.heap.string_text(pair.cdr).unwrap_or(datum),
        };
    }
    let labels: Vec<String> = events.iter().map(|&event| event_label(vm, event)).collect();
    match &labels[..] {
        [label] if what == vm.names.known.task_end => format!("the end of {label}"),
        [label] if vm.heap.is(first, Kind::Task) => format!("a signal of {label}"),
        [_] if what == vm.names.known.room => {
            format!("room in input {}", describe(&vm.heap, vm.heap.slot_or_nil(first, event::NAME)))
        }
        labels => labels.join(" or "),
    }
}

/// Returns what is added to a condition that is waited for: the fluents whose changes are. Sources of facts
/// have no names; the condition shows them.
fn changes_label(vm: &Vm, events: &[Value]) -> String {
    let named = events.iter().filter(|&&event| event != vm.scheduler.any_event);
    let names: Vec<String> = named
        .map(|&event| vm.heap.slot_or_nil(event, event::NAME))
        .filter(|name| name.is_true())
        .take(SHOWN)
        .map(|name| describe(&vm.heap, name))
        .collect();
    if names.is_empty() { String::new() } else { format!(" by changes of {}", in_words(&names, "or")) }
}

/// Returns what reports call that for which a supervisor waits: the ends of children that run, and the
/// restarts of those that are due. `supervision.esl` says what these are.
fn children_label(vm: &Vm, children: Value) -> String {
    let (mut running, mut due) = (Vec::new(), Vec::new());
    for child in items(vm, children) {
        let name = describe(&vm.heap, field_of(vm, child, child::ID));
        if field_of(vm, child, child::TASK).is_true() {
            running.push(name);
        } else if field_of(vm, child, child::DUE).is_true() {
            due.push(name);
        }
    }
    let mut parts = Vec::new();
    if !running.is_empty() {
        parts.push(format!("the end of {}", in_words(&running, "or")));
    }
    if !due.is_empty() {
        parts.push(format!("the time to restart {}", in_words(&due, "and")));
    }
    if parts.is_empty() { "its children".into() } else { parts.join(" or ") }
}

/// Returns what reports call the time of a retry: its cause, and which of how many it is, if that is limited.
fn retry_label(vm: &Vm, retry: Value) -> String {
    let words: Vec<String> = items(vm, retry).map(|item| describe(&vm.heap, item)).collect();
    match &words[..] {
        [cause, number, of] => format!("the time to retry after {cause}, {number} of {of}"),
        words => format!("the time to retry after {}", words.concat()),
    }
}

/// Returns a list in words.
fn in_words(names: &[String], conjunction: &str) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} {conjunction} {last}", first.join(", ")),
        names => names.concat(),
    }
}

/// Returns what a deadlock report adds to the reason for which a task waits.
pub(crate) fn lack_of(vm: &Vm, task: &Task) -> &'static str {
    let events = if task.wait.is_true() { link::waited_for(&vm.heap, task.wait).0 } else { Vec::new() };
    let is_for_input = events.into_iter().any(|event| input::is_input(&vm.heap, event));
    if is_for_input { ", which has no sender left" } else { "" }
}

/// Longest part of a list of resources, or of their holders, that is shown.
const SHOWN: usize = 8;

/// Returns what reports call the resources of a request, with their holders. `resources.esl` says what they
/// are.
fn resources_label(vm: &Vm, resources: Value) -> String {
    let labels: Vec<String> = items(vm, resources).map(|resource| resource_label(vm, resource)).collect();
    labels.join(" and ")
}

fn resource_label(vm: &Vm, resource: Value) -> String {
    let field = |index| field_of(vm, resource, index);
    let name = describe(&vm.heap, field(resource::NAME));
    let holders: Vec<String> = ring(vm, field(resource::HOLDERS))
        .map(|claim| task_label(vm, field_of(vm, field_of(vm, claim, claim::REQUEST), request::TASK)))
        .collect();
    if holders.is_empty() {
        format!("resource {name}")
    } else {
        format!("resource {name}, held by {}", holders.join(" and "))
    }
}

/// Returns a field of a record of the library; `NIL` if there is none.
pub(super) fn field_of(vm: &Vm, record: Value, index: usize) -> Value {
    vm.heap.vector(record).and_then(|fields| fields.get(index).copied()).unwrap_or(Value::NIL)
}

/// Returns the first claims of a ring.
pub(super) fn ring(vm: &Vm, first: Value) -> impl Iterator<Item = Value> {
    let mut next = first;
    let step = move || {
        let record = next;
        next = field_of(vm, record, claim::NEXT);
        if next == first {
            next = Value::NIL;
        }
        record.is_true().then_some(record)
    };
    std::iter::from_fn(step).take(SHOWN)
}

/// Returns the first items of a list.
pub(super) fn items(vm: &Vm, list: Value) -> impl Iterator<Item = Value> {
    let mut rest = list;
    let next = move || {
        let pair = vm.heap.as_cons(rest)?;
        rest = pair.cdr;
        Some(pair.car)
    };
    std::iter::from_fn(next).take(SHOWN)
}

/// Returns how a task has ended, in a word.
pub(crate) fn end_label(vm: &Vm, task: &Task) -> &'static str {
    let status = vm.heap.slot_or_nil(task.object, event::STATE);
    let known = &vm.names.known;
    match status {
        status if status == known.succeeded => "succeeded",
        status if status == known.failed => "failed",
        _ => "aborted",
    }
}

/// Returns what a condition is called where it is said that it was signalled: its cause, or the name of its
/// type.
pub(crate) fn cause_label(heap: &Heap, condition: Value) -> String {
    let Some(class) = heap.structure_class(condition) else { return describe(heap, condition) };
    let name = describe(heap, class::name_of(heap, class));
    if name == "FAILURE" {
        let cause = heap.structure_slots(condition).and_then(|slots| slots.first());
        cause.map_or(name, |&cause| describe(heap, cause))
    } else {
        format!(":{name}")
    }
}

/// Returns a short text for the arguments of a failure, or for the values of the slots of a condition.
pub(crate) fn arguments_label(vm: &Vm, condition: Value, list: Value) -> String {
    let heap = &vm.heap;
    let slots = heap.structure_slots(condition).unwrap_or_default();
    let Some(class) = heap.structure_class(condition) else {
        return items(vm, list).take(SHOWN).map(|value| describe(heap, value)).collect::<Vec<_>>().join(", ");
    };
    let arguments: Vec<Value> = if describe(heap, class::name_of(heap, class)) == "FAILURE" {
        items(vm, slots.get(1).copied().unwrap_or(Value::NIL)).take(SHOWN).collect()
    } else {
        slots.iter().copied().take(SHOWN).collect()
    };
    arguments.into_iter().map(|value| describe(heap, value)).collect::<Vec<_>>().join(", ")
}

/// Returns the arguments of a failure of a cause of the program's, those that are data.
pub(crate) fn failure_arguments(vm: &Vm, condition: Value) -> Vec<Datum> {
    let heap = &vm.heap;
    let Some(class) = heap.structure_class(condition) else { return Vec::new() };
    if describe(heap, class::name_of(heap, class)) != "FAILURE" {
        return Vec::new();
    }
    let list = heap.structure_slots(condition).and_then(|slots| slots.get(1).copied()).unwrap_or(Value::NIL);
    let export = |value| datum::export(heap, &vm.names, value, describe).ok();
    items(vm, list).filter_map(export).map(|(datum, _)| datum).collect()
}

/// Returns the report of a failure that has ended a task when there was no room for more.
pub(crate) fn report_in_short(heap: &Heap, condition: Value) -> String {
    format!("Failure {}, no recovery available.\nAborted\n", cause_label(heap, condition))
}
