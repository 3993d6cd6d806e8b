//! What the library needs to signal a failure: the handlers on the control stack, the end of a task,
//! backtraces.

use smallvec::SmallVec;

use crate::interp::frames::Frame;
use crate::raise::{Exit, Outcome, Raised};
use crate::report;
use crate::run;
use crate::task::FailureReport;
use crate::task::{EntryKind, TaskEnd, UnwindTarget, Unwinding};
use crate::value::Value;
use crate::vm::Vm;

use super::expect::exactly;

pub(super) fn next_handler(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [height, failure] = exactly(arguments);
    let (is_failure, is_first) = (failure.is_true(), height.is_nil());
    let height = match height.as_index() {
        Some(height) => height,
        None if is_first => usize::MAX,
        None => return vm.exchange.type_error(height, "UNSIGNED-BYTE"),
    };
    if vm.watch.is_watched && is_failure && is_first {
        report::tell_of_failure(vm, failure, false);
    }
    let mut steps = 0;
    let found = vm.scheduler.task().control.find_handlers(height, is_failure, &mut steps);
    vm.exchange.charge(steps);
    let Some(found) = found else { return Ok(Value::NIL) };
    vm.exchange.values.clear();
    let known = &vm.world.known;
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
        report::tell_of_failure(vm, failure, true);
    }
    Ok(state)
}

pub(super) fn stand_in(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [index, values] = exactly(arguments);
    let control = &vm.scheduler.task().control;
    let handler = match index.as_index() {
        // Nothing handles it, and somebody outside gives the values.
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
    // What happens in its cleanups while it ends is told to nobody else.
    let is_ending = vm.scheduler.task().control.final_unwinding().is_some();
    Ok(Value::boolean(is_ending || !belongs_to_form(vm)))
}

/// Returns whether a form is told of the failure of the running task, and nobody else.
fn belongs_to_form(vm: &Vm) -> bool {
    let task = vm.scheduler.task();
    task.notify.is_true() && !task.flags.kept()
}

pub(super) fn end_task(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let text = |vm: &Vm, index: usize| vm.heap.string_text(arguments[index]).unwrap_or_default();
    match vm.scheduler.task().control.final_unwinding() {
        Some(UnwindTarget::Root(TaskEnd::Failed(_))) => {
            let story = text(vm, 2);
            if let Some(report) = &mut vm.scheduler.task_mut().extra_mut().report {
                report.add_cleanup(&story);
            }
        }
        Some(_) => {
            let label = report::task_label(vm, vm.scheduler.task().object);
            vm.outside.complain(&format!("In a cleanup of {label}:\n{}{}", text(vm, 2), text(vm, 3)));
        }
        None if belongs_to_form(vm) => {}
        None => {
            let (story, ending) = (text(vm, 2), text(vm, 3));
            vm.embedder.last_words = vm.heap.string_text(arguments[1]);
            vm.embedder.last_place = report::place_in_program(vm, vm.scheduler.task(), vm.frames());
            let is_wanted = vm.watch.tells_variables;
            let detailed =
                is_wanted.then(|| (report::with_variables(vm, &story, vm.frames()).into(), story.len()));
            vm.scheduler.task_mut().extra_mut().report = Some(FailureReport { story, ending, detailed });
        }
    }
    vm.scheduler.task_mut().begin_end(TaskEnd::Failed(arguments[0]));
    Err(Exit::Unwind)
}

pub(super) fn exit(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let status = arguments[0].as_index().and_then(|status| u8::try_from(status).ok());
    let Some(status) = status else { return vm.exchange.type_error(arguments[0], "UNSIGNED-BYTE") };
    vm.outside.exit_status = Some(status);
    run::abort_others(vm);
    vm.scheduler.task_mut().begin_end(TaskEnd::Aborted);
    Err(Exit::Unwind)
}

pub(super) fn backtrace(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let limit = arguments[0].as_index().unwrap_or(usize::MAX).min(super::LIMIT);
    let with_variables = arguments.get(1).is_some_and(|variables| variables.is_true());
    let mut rows = Vec::new();
    let row = |frame: Frame<'_>| {
        let variables = if with_variables { report::variables_of(vm, &frame) } else { Vec::new() };
        (frame.function, frame.place(), variables)
    };
    let frames: Vec<_> = vm.frames().take(limit).map(row).collect();
    let shown: usize = frames.iter().map(|(_, _, variables)| variables.len()).sum();
    for (function, word, variables) in frames {
        let Some(code) = vm.heap.function_code(function) else { continue };
        let name = vm.heap.code(code).map_or(Value::NIL, |code| code.name);
        let is_top_level =
            vm.heap.header(function).is_some_and(|header| header.aux == crate::world::load::TOP_LEVEL);
        let name =
            if name.is_nil() && !is_top_level { vm.heap.list(&[vm.world.known.lambda])? } else { name };
        let mut row = match vm.world.source_place(&vm.heap, code, word) {
            Some(place) => {
                let source = vm.heap.alloc_str(&place.source)?;
                let (line, column) = (Value::index(place.line as usize), Value::index(place.column as usize));
                vec![name, source, line, column]
            }
            None => vec![name],
        };
        if with_variables {
            row.resize(4, Value::NIL);
            let mut pairs = Vec::with_capacity(variables.len());
            for (name, value) in variables {
                let name = vm.heap.alloc_str(&name)?;
                pairs.push(vm.heap.cons(name, value)?);
            }
            row.push(vm.heap.list(&pairs)?);
        }
        rows.push(vm.heap.list(&row)?);
    }
    vm.exchange.charge((rows.len() + shown) * 64);
    Ok(vm.heap.list(&rows)?)
}
