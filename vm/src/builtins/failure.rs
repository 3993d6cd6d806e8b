//! Builtins by which the library signals a failure: the handlers on the control stack, the end of a task,
//! backtraces.

use esl_bytecode::compile::SourcePlace;
use smallvec::SmallVec;

use crate::heap::AllocError;
use crate::interp::frames::Frame;
use crate::names::records::frame;
use crate::raise::{Exit, Expected, Outcome, Raised};
use crate::report::{self, NotedFrame};
use crate::run;
use crate::task::FailureReport;
use crate::task::{EntryKind, TaskEnd, UnwindTarget, Unwinding};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::{exactly, optional};

pub(super) fn next_handler(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [height, failure] = exactly(&arguments[..2]);
    let (is_failure, is_first) = (failure.is_true(), height.is_nil());
    let height = match height.as_index() {
        Some(height) => height,
        None if is_first => usize::MAX,
        None => return vm.exchange.type_error(height, "UNSIGNED-BYTE"),
    };
    if vm.watch.is_watched && is_failure && is_first {
        report::tell_of_failure(vm, failure, optional(arguments, 2));
    }
    let mut steps = 0;
    let found = vm.scheduler.task().control.find_handlers(height, is_failure, &mut steps);
    vm.exchange.charge(steps);
    let Some(found) = found else { return Ok(Value::NIL) };
    vm.exchange.values.clear();
    let known = &vm.names.known;
    let kind = match found.kind {
        EntryKind::HandlerCase => known.cases,
        EntryKind::Recovery => known.recovery,
        EntryKind::FailureCleanup => known.cleanup,
        _ => known.functions,
    };
    vm.exchange.values.extend([Value::index(found.index), kind, found.data]);
    Err(Exit::Values)
}

pub(super) fn begin_recovery(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [index, table, failure] = exactly(arguments);
    let entry = index.as_index().and_then(|index| vm.scheduler.task().control.entries.get(index));
    if entry.is_none_or(|entry| entry.kind != EntryKind::Recovery || entry.data != table) {
        return vm
            .exchange
            .raise(Raised::Control("the recovery procedures of a failure are no longer there".into()));
    }
    let items = vm.heap.vector(table).unwrap_or_default();
    let state = if items.first().is_some_and(|first| first.is_true()) {
        table
    } else {
        let mut items: SmallVec<[Value; 16]> = items.into();
        let index = index.as_index().unwrap_or(usize::MAX);
        let Some(function) = vm.recovery_function(index)? else {
            return vm
                .exchange
                .raise(Raised::Control("the recovery procedures of a failure are no longer there".into()));
        };
        if let Some(first) = items.first_mut() {
            *first = function;
        }
        let state = vm.heap.alloc_vector(&items)?;
        vm.exchange.charge(items.len());
        if let Some(entry) = vm.scheduler.task_mut().control.entries.get_mut(index) {
            entry.data = state;
        }
        state
    };
    if vm.watch.is_watched {
        report::tell_of_recovery(vm, failure);
    }
    Ok(state)
}

pub(super) fn stand_in(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [index, values] = exactly(arguments);
    let control = &vm.scheduler.task().control;
    let handler = match index.as_index() {
        // Nothing handles it, and a debugger supplies the values.
        None => 0,
        Some(index) => match control.entries.get(index) {
            Some(handler) => handler.base,
            None => return Ok(Value::NIL),
        },
    };
    // A cleanup of the library goes on to its end, and so does what it has interrupted.
    let cleanup = control.innermost_cleanup().and_then(|index| control.entries.get(index));
    let around = cleanup.map_or(handler, |cleanup| cleanup.base.max(handler));
    let mut items = Vec::new();
    let mut rest = values;
    while let Some(pair) = vm.heap.as_cons(rest) {
        items.push(pair.car);
        rest = pair.cdr;
    }
    vm.exchange.charge(items.len());
    let Some(base) = vm.frame_of_operation(around) else { return vm.give_values(&items) };
    let control = &mut vm.scheduler.task_mut().control;
    let entries = control.entries.partition_point(|entry| entry.base < base);
    control.unwinding = Some(Unwinding { target: UnwindTarget::Return { entries, base }, values: items });
    Err(Exit::Unwind)
}

pub(super) fn is_called_by_library(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let caller = vm.frames().nth(1);
    Ok(Value::boolean(caller.is_some_and(|frame| frame.is_of_library())))
}

pub(super) fn unwind_to_cleanup(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [index, failure] = exactly(arguments);
    let Some(index) = index.as_index() else { return vm.exchange.type_error(index, "UNSIGNED-BYTE") };
    let control = &mut vm.scheduler.task_mut().control;
    match control.entries.get(index) {
        Some(entry) if entry.kind == EntryKind::FailureCleanup => {
            let values = vec![failure];
            control.unwinding = Some(Unwinding { target: UnwindTarget::Entry(index), values });
            Err(Exit::Unwind)
        }
        _ => vm.exchange.raise(Raised::Control("the cleanup for a failure is no longer there".into())),
    }
}

pub(super) fn cleaning_up(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let running = vm.scheduler.task().control.running.last().filter(|running| running.pending.is_none());
    Ok(running.and_then(|running| running.values.first().copied()).unwrap_or(Value::NIL))
}

pub(super) fn take_case(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let Some(index) = arguments[0].as_index() else {
        return vm.exchange.type_error(arguments[0], "UNSIGNED-BYTE");
    };
    let control = &mut vm.scheduler.task_mut().control;
    match control.entries.get(index) {
        Some(entry) if entry.kind == EntryKind::HandlerCase => {
            let values = arguments[1..].to_vec();
            control.unwinding = Some(Unwinding { target: UnwindTarget::Entry(index), values });
            Err(Exit::Unwind)
        }
        _ => {
            vm.exchange.raise(Raised::Control("the handlers to take a condition are no longer there".into()))
        }
    }
}

pub(super) fn is_reported(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    // No form learns of failures in its cleanups while it ends, so they are reported.
    let is_ending = vm.scheduler.task().control.final_unwinding().is_some();
    Ok(Value::boolean(is_ending || !belongs_to_form(vm)))
}

pub(super) fn lend_report_memory(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    vm.lend_cleanup_memory();
    Ok(Value::NIL)
}

/// Returns whether the failure of the running task goes to a form, and to nothing else.
fn belongs_to_form(vm: &Vm) -> bool {
    let task = vm.scheduler.task();
    task.notify.is_true() && !task.flags.kept()
}

pub(super) fn end_task(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [condition, words, story, ending, history, full] = exactly(arguments);
    let text = |vm: &Vm, text: Value| vm.heap.string_text(text).unwrap_or_default();
    match vm.scheduler.task().control.final_unwinding() {
        Some(UnwindTarget::Root(TaskEnd::Failed(_))) => {
            let story = text(vm, story);
            if let Some(report) = &mut vm.scheduler.task_mut().extra_mut().report {
                report.add_cleanup(&story);
            }
        }
        Some(_) => {
            let label = report::task_label(vm, vm.scheduler.task().object);
            vm.outside.complain(&format!(
                "In a cleanup of {label}:\n{}{}",
                text(vm, story),
                text(vm, ending)
            ));
        }
        // The form is given the history at the end of the task.
        None if belongs_to_form(vm) => vm.scheduler.task_mut().extra_mut().values = vec![history],
        None => {
            let (story, ending) = (text(vm, story), text(vm, ending));
            vm.embedder.last_words = vm.heap.string_text(words);
            vm.embedder.last_place = report::place_in_program(vm, vm.scheduler.task(), vm.frames());
            let is_wanted = vm.watch.tells_variables;
            let detailed =
                is_wanted.then(|| (report::with_variables(vm, &story, vm.frames()).into(), story.len()));
            let full = vm.heap.string_text(full).map(Into::into);
            let frames = vm.frames_of_history(history, vm.scheduler.task().object).into();
            let report = FailureReport { story, full, ending, detailed, frames };
            vm.scheduler.task_mut().extra_mut().report = Some(report);
        }
    }
    vm.scheduler.task_mut().begin_end(TaskEnd::Failed(condition));
    Err(Exit::Unwind)
}

pub(super) fn exit(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let status = arguments[0].as_index().and_then(|status| u8::try_from(status).ok());
    let Some(status) = status else {
        return vm.exchange.raise(Raised::Type(arguments[0], Expected::Index(256)));
    };
    vm.scheduler.points.note_shown();
    vm.outside.exit_status = Some(status);
    run::abort_others(vm);
    vm.scheduler.task_mut().begin_end(TaskEnd::Aborted);
    Err(Exit::Unwind)
}

pub(super) fn backtrace(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let limit = arguments[0].as_index().unwrap_or(usize::MAX).min(super::LIMIT);
    let with_variables = arguments.get(1).is_some_and(|variables| variables.is_true());
    let mut rows = Vec::new();
    let variables = |frame: Frame<'_>| {
        if with_variables { report::variables_of(vm, &frame) } else { Vec::new() }
    };
    let variables: Vec<_> = vm.frames().take(limit).map(variables).collect();
    let shown: usize = variables.iter().map(Vec::len).sum();
    let note = vm.note_frames(limit)?;
    let mut variables = variables.into_iter();
    for frame in vm.noted_frames(note) {
        let variables = if frame.has_left { None } else { variables.next() };
        let mut pairs = Vec::new();
        for (name, value) in variables.unwrap_or_default() {
            let name = vm.heap.alloc_str(&name)?;
            pairs.push(vm.heap.cons(name, value)?);
        }
        let variables = vm.heap.list(&pairs)?;
        rows.push(row_of(vm, &frame, variables)?);
    }
    vm.exchange.charge((rows.len() + shown) * 64);
    Ok(vm.heap.list(&rows)?)
}

/// Returns a frame as a record of the library: see `reports.esl`.
fn row_of(vm: &mut Vm, frame: &NotedFrame, variables: Value) -> Result<Value, AllocError> {
    let has_no_name = frame.name.is_nil() && !frame.is_top_level;
    let name = if has_no_name { vm.heap.list(&[vm.names.known.lambda])? } else { frame.name };
    let [source, line, column] = place_parts(vm, frame.place.as_ref())?;
    let mut fields = [Value::NIL; frame::LENGTH];
    fields[frame::FUNCTION] = name;
    fields[frame::SOURCE] = source;
    fields[frame::LINE] = line;
    fields[frame::COLUMN] = column;
    fields[frame::VARIABLES] = variables;
    fields[frame::LIBRARY_P] = Value::boolean(frame.is_of_library);
    fields[frame::LEFT_P] = Value::boolean(frame.has_left);
    vm.heap.list(&fields)
}

/// Returns source, line and column of a place, `NIL` if it is unknown.
fn place_parts(vm: &mut Vm, place: Option<&SourcePlace>) -> Result<[Value; 3], AllocError> {
    let Some(place) = place else { return Ok([Value::NIL; 3]) };
    let source = vm.heap.alloc_str(&place.source)?;
    Ok([source, Value::index(place.line as usize), Value::index(place.column as usize)])
}

pub(super) fn note_frames(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let limit = arguments[0].as_index().unwrap_or(usize::MAX).min(super::LIMIT);
    Ok(vm.note_frames(limit)?)
}

pub(super) fn noted_frames(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [note] = exactly(arguments);
    let frames = vm.noted_frames(note);
    let mut rows = Vec::with_capacity(frames.len());
    for frame in &frames {
        rows.push(row_of(vm, frame, Value::NIL)?);
    }
    let rows = vm.heap.list(&rows)?;
    let beginning = match vm.beginning(note) {
        Some(place) => {
            let parts = place_parts(vm, Some(&place))?;
            vm.heap.list(&parts)?
        }
        None => Value::NIL,
    };
    vm.exchange.charge(frames.len() * 64);
    vm.give_values(&[rows, beginning])
}
