//! Questions from outside: calls in tasks of their own, and what there is to know of tasks.

use esl_bytecode::datum::Datum;
use esl_bytecode::symbol::{Symbol, USER_PACKAGE};
use esl_host::{Answer, FunctionRef, Incoming, Kept, Question, TaskInfo};

use super::finish::allocate_without_retry;
use super::spawn::{SpawnOptions, spawn_kept};
use crate::datum::{self, DatumError};
use crate::describe::describe;
use crate::report;
use crate::task::{DEFAULT_PRIORITY, HIGHEST_PRIORITY, Task, TaskEnd, TaskId, TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// Beginning of the names of the library's own functions. A call of one is not a task of the program.
const LIBRARY: &str = "ESL::%";
/// Most tasks that an answer names.
const SHOWN: usize = 10_000;

/// Takes in a question, and answers it at once if it is not for a call.
pub(super) fn take_question(vm: &mut Vm, number: u64, question: Question) {
    match question {
        Question::Tasks => {
            let tasks = tasks(vm);
            vm.outside.inbox.answer(number, Answer::Tasks(tasks));
        }
        // A run that is ending begins no call.
        Question::Call { .. } if begins_no_call(vm) => {
            vm.outside.inbox.answer(number, Answer::Ended);
        }
        Question::Call { function, arguments, goes_first } => {
            let Some(id) = begin_call(vm, &function, &arguments, goes_first) else {
                return vm.outside.inbox.answer(number, no_call(&function));
            };
            vm.embedder.calls.insert(id.index, number);
            if goes_first {
                vm.scheduler.make_runnable(id.index, true);
                vm.embedder.first = Some(id);
            }
        }
    }
}

/// Returns whether the run is ending, and begins no call any more.
pub(super) fn begins_no_call(vm: &Vm) -> bool {
    vm.embedder.is_ending || all_are_to_end(vm)
}

/// Returns whether all tasks of a program have been asked to end. Each task that ends passes the request to
/// the tasks made since; no task does so after the last one.
fn all_are_to_end(vm: &Vm) -> bool {
    vm.scheduler.main.is_some() && vm.scheduler.counts.made_at_end > 0
}

fn no_call(function: &FunctionRef) -> Answer {
    let (cause, message) = match function {
        FunctionRef::Kept(u64::MAX) => (":PROGRAM-ERROR", "The function belongs to another engine."),
        _ => (":HEAP-EXHAUSTED", "Not enough memory for a task."),
    };
    Answer::Failed {
        cause: cause.into(),
        message: message.into(),
        report: String::new(),
        full_report: None,
        arguments: Vec::new(),
        frames: Vec::new(),
    }
}

impl Vm {
    /// Keeps a value for the outside, until that lets go of it.
    pub fn keep(&mut self, value: Value) -> Kept {
        let number = self.embedder.keep(&mut self.heap, value);
        Kept::new(number, self.outside.inbox.clone())
    }

    /// Returns the function that the outside calls so: a symbol, or a value that is kept. `None` if there is
    /// no room for the symbol, or no such value.
    pub fn callee(&mut self, callee: &FunctionRef) -> Option<Value> {
        let name = match callee {
            FunctionRef::Named(name) => name,
            FunctionRef::Kept(number) => return self.embedder.kept.get(number).copied(),
        };
        self.symbol_named(name)
    }

    /// Returns the function that the outside calls by this name, in any case. `None` if there is no room for
    /// the symbol.
    pub fn callee_named(&mut self, name: &str) -> Option<Value> {
        if let Some(symbol) = self.names.called.find(name) {
            return Some(symbol);
        }
        let symbol = self.symbol_named(&name.to_uppercase())?;
        self.names.called.keep(name, symbol);
        Some(symbol)
    }

    /// Returns the symbol with this name, which may have a package before it; `None` if there is no room.
    fn symbol_named(&mut self, name: &str) -> Option<Value> {
        let (package, name) = match name.rsplit_once(':') {
            Some((package, name)) => (package.trim_end_matches(':'), name),
            None => (USER_PACKAGE, name),
        };
        let packages = self.names.packages();
        let found = packages.named(package).and_then(|package| packages.find(package, name));
        let symbol = found.map_or_else(|| Symbol::new(&package.into(), name), |(symbol, _)| symbol);
        // A symbol that is there needs no memory; a new one may need a collection.
        if let Ok(object) = self.names.intern(&mut self.heap, &symbol) {
            return Some(object);
        }
        let symbol = Datum::symbol(symbol, Default::default());
        import_datum(self, &symbol)
    }
}

impl Vm {
    /// Returns data as a value, after a collection if need be; `None` if there is no room. Values that the
    /// embedder holds meanwhile are pinned.
    pub fn import_or_collect(&mut self, datum: &Datum) -> Option<Value> {
        import_datum(self, datum)
    }
}

/// Lets go of a value that was kept for the outside.
pub(super) fn release(vm: &mut Vm, number: u64) {
    vm.embedder.kept.remove(&number);
}

/// Returns data as a value; `None` if there is no room.
fn import_datum(vm: &mut Vm, datum: &Datum) -> Option<Value> {
    // A cons around it tells `NIL` from a lack of room.
    let cell = allocate_without_retry(vm, |vm| {
        let (value, _) = datum::import(&mut vm.heap, &mut vm.names, datum)?;
        Ok(vm.heap.cons(value, Value::NIL)?)
    });
    vm.heap.as_cons(cell).map(|cell| cell.car)
}

/// Makes the task that calls a function for a request from outside; `None` if there is no room for it.
fn begin_call(vm: &mut Vm, callee: &FunctionRef, arguments: &[Datum], goes_first: bool) -> Option<TaskId> {
    let function = vm.callee(callee)?;
    vm.embedder.pin(&mut vm.heap, function);
    let mut values = vec![function];
    for argument in arguments {
        // A later argument may have what was made before collected.
        let Some(value) = import_datum(vm, argument) else { break };
        vm.embedder.pin(&mut vm.heap, value);
        values.push(value);
    }
    let is_library = matches!(callee, FunctionRef::Named(name) if name.starts_with(LIBRARY));
    let options = SpawnOptions {
        priority: if goes_first { HIGHEST_PRIORITY } else { DEFAULT_PRIORITY },
        daemon: is_library,
        hidden: is_library,
        ..SpawnOptions::default()
    };
    let has_all = values.len() > arguments.len();
    let id = has_all.then(|| spawn_kept(vm, values[0], &values[1..], options).ok()).flatten();
    values.into_iter().for_each(|value| vm.embedder.unpin(value));
    id
}

/// Aborts the task of the call that was asked for with this number, or does not begin it.
pub(super) fn abort_call(vm: &mut Vm, number: u64) {
    let is_it = |other: &Incoming| matches!(other, Incoming::Question { number: n, .. } if *n == number);
    if let Some(place) = vm.embedder.deferred.iter().position(is_it) {
        vm.embedder.deferred.remove(place);
        return vm.outside.inbox.answer(number, Answer::Aborted);
    }
    let call = vm.embedder.calls.iter().find(|&(_, &other)| other == number);
    if let Some(id) = call.and_then(|(&index, _)| vm.scheduler.tasks.id_at(index)) {
        vm.abort(id);
    }
}

/// Aborts the task with this number.
pub(super) fn abort_task(vm: &mut Vm, number: TaskNumber) {
    let tasks = &vm.scheduler.tasks;
    let is_it = |id: &TaskId| tasks.get(*id).is_some_and(|task| task.number == number);
    if let Some(id) = tasks.ids().into_iter().find(is_it) {
        vm.abort(id);
    }
}

/// Answers the call that the running task was made for, which has ended with these values. Returns whether it
/// was made for a call.
pub(super) fn answer_call(vm: &mut Vm, end: TaskEnd, values: &[Value]) -> bool {
    let Some(number) = vm.embedder.calls.remove(&vm.scheduler.turn.index) else { return false };
    let answer = match end {
        TaskEnd::Succeeded => answer_with(vm, values),
        TaskEnd::Failed(condition) => {
            let extra = vm.scheduler.task_mut().extra.as_mut();
            let report = extra.and_then(|extra| extra.report.take());
            let message = vm.embedder.last_words.take().unwrap_or_else(|| vm.describe(condition));
            let frames = report.as_ref().map_or(Vec::new(), |report| report.frames.to_vec());
            let full_report = report.as_ref().and_then(|report| report.full_text());
            let report = report.map_or_else(
                || report::report_in_short(&vm.heap, condition),
                |report| report.detailed_text(),
            );
            let (cause, arguments) =
                (report::cause_label(&vm.heap, condition), report::failure_arguments(vm, condition));
            Answer::Failed { cause, message, report, full_report, arguments, frames }
        }
        TaskEnd::Aborted if all_are_to_end(vm) => Answer::Ended,
        TaskEnd::Aborted | TaskEnd::Spent => match vm.outside.exit_status {
            Some(status) => Answer::Exited(status),
            None => Answer::Aborted,
        },
    };
    vm.outside.inbox.answer(number, answer);
    true
}

/// Returns values as an answer.
fn answer_with(vm: &Vm, values: &[Value]) -> Answer {
    let mut data = Vec::new();
    for &value in values {
        match datum::export(&vm.heap, &vm.names, value, describe) {
            Ok((datum, _)) => data.push(datum),
            Err(DatumError::Circular) => return Answer::Circular,
            Err(DatumError::TooLarge | DatumError::NoRoom(_)) => return Answer::TooLarge,
        }
    }
    Answer::Values(data)
}

/// Returns what there is to know of the tasks of the program.
fn tasks(vm: &Vm) -> Vec<TaskInfo> {
    let mut tasks: Vec<&Task> = vm
        .scheduler
        .tasks
        .iter()
        .filter(|task| task.state != TaskState::Ended && !task.flags.hidden())
        .collect();
    tasks.sort_unstable_by_key(|task| task.number);
    let maker = |task: &Task| report::number_of_owner(vm, task.object);
    let info = |task: &Task| TaskInfo {
        number: task.number.0,
        maker: maker(task),
        name: report::task_label(vm, task.object),
        waits_for: (task.state != TaskState::Runnable).then(|| report::reason_of(vm, task)),
        ticks: task.ticks,
    };
    tasks.into_iter().take(SHOWN).map(info).collect()
}
