//! Taking in what has come into the machine's inbox, between two turns.

use esl_bytecode::datum::Datum;
use esl_host::{Awaited, Host, Incoming, Inspection, ProcessSignal, Question, Wake};

use super::finish::allocate_without_retry;
use super::news::{hear, import_list};
use super::question::{abort_call, abort_task, release, take_question};
use super::signal::signal;
use super::spawn::{SpawnOptions, make_task};
use super::wake::make_runnable;
use crate::outside::ExpectedOperators;
use crate::task::{TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::input;

/// Takes in the contents of the inbox, in the order in which they came. Returns whether the run is to come
/// back to the embedder.
#[cold]
pub(crate) fn take_in(vm: &mut Vm) -> bool {
    let mut stops = false;
    for incoming in vm.outside.host.poll(vm.scheduler.rounds) {
        if vm.embedder.first.is_some() && is_deferrable(&incoming) {
            vm.embedder.deferred.push_back(incoming);
        } else {
            stops |= take_in_one(vm, incoming);
        }
    }
    vm.outside.repeat_calls();
    serve_inspections(vm);
    stops
}

/// Returns whether an arrival is deferred until a call that goes first has ended: those whose order a task of
/// the program could observe, and releases of values that such calls need. Requests to end, pause or list
/// tasks are not deferred.
fn is_deferrable(incoming: &Incoming) -> bool {
    matches!(
        incoming,
        Incoming::Message { .. }
            | Incoming::Question { question: Question::Call { .. }, .. }
            | Incoming::Release(_)
    )
}

/// Takes in what was deferred for a call that goes first, if that has ended or waits now.
#[cold]
pub(crate) fn take_in_deferred(vm: &mut Vm) {
    if let Some(id) = vm.embedder.first
        && vm.scheduler.tasks.get(id).is_some_and(|task| task.state == TaskState::Runnable)
    {
        return;
    }
    vm.embedder.first = None;
    while vm.embedder.first.is_none()
        && let Some(incoming) = vm.embedder.deferred.pop_front()
    {
        take_in_one(vm, incoming);
    }
}

/// Takes in one thing. Returns whether the run is to come back to the embedder.
fn take_in_one(vm: &mut Vm, incoming: Incoming) -> bool {
    match incoming {
        Incoming::Signal(signal) => return end_by_signal(vm, signal),
        Incoming::Stop => return true,
        Incoming::Interlude => {
            vm.scheduler.rounds -= 1;
            return true;
        }
        Incoming::Input => wake_readers(vm),
        Incoming::Output => wake_writers(vm),
        Incoming::Operation { number, news } => hear(vm, number, news),
        Incoming::Message { input, arguments } => receive(vm, &input, &arguments),
        Incoming::Question { number, question } => take_question(vm, number, question),
        Incoming::Abort(number) => abort_task(vm, TaskNumber(number)),
        Incoming::AbortCall(number) => abort_call(vm, number),
        Incoming::Pause(pauses) => vm.scheduler.is_paused = pauses && !vm.embedder.is_ending,
        Incoming::Release(number) => release(vm, number),
        Incoming::Watch => admit_observers(vm),
        Incoming::SenderCame => vm.outside.senders += 1,
        Incoming::SenderLeft => {
            vm.outside.senders = vm.outside.senders.saturating_sub(1);
            // Without a sender nothing could end a pause.
            vm.scheduler.is_paused &= vm.outside.senders > 0;
        }
        Incoming::Attended => vm.outside.attendance = ExpectedOperators::MayCome,
        Incoming::Unattended => vm.outside.attendance = ExpectedOperators::None,
        // That it waits for messages is not worth a report.
        Incoming::Hosted => vm.outside.attendance = ExpectedOperators::IsAwaited,
    }
    false
}

/// Waits in the host, and answers surveys meanwhile.
pub(crate) fn wait_in_host(vm: &mut Vm, deadline: Option<u64>, awaited: Awaited) -> Wake {
    loop {
        let wake = vm.outside.host.wait(deadline, awaited);
        if wake != Wake::Inspection {
            return wake;
        }
        vm.outside.inbox.quieten();
        serve_inspections(vm);
    }
}

/// Answers surveys of the run, which change nothing in it.
pub(super) fn serve_inspections(vm: &mut Vm) {
    for inspection in vm.outside.inbox.take_inspections() {
        match inspection {
            Inspection::Survey(request, tell) => tell(vm.survey(&request)),
            Inspection::Watch => admit_observers(vm),
        }
    }
}

/// Registers newly arrived observers.
fn admit_observers(vm: &mut Vm) {
    for observer in vm.watch.coming.take() {
        vm.add_observer(observer);
    }
}

/// Ends the run because of a signal, or the task that was named, unless the program handles the signal, or
/// nothing ends for it; a signal that no task is named for waits for the next one. Returns whether the signal
/// cuts the end of the run short.
fn end_by_signal(vm: &mut Vm, signal: ProcessSignal) -> bool {
    let embedder = &mut vm.embedder;
    if !embedder.is_ending
        && let Some(&function) = embedder.handlers.get(&signal.number())
    {
        handle_signal(vm, function);
        return false;
    }
    if !signal.ends_a_run() {
        return false;
    }
    if embedder.is_ending {
        let cuts = signal == ProcessSignal::Interrupt;
        embedder.is_cut_short |= cuts;
        return cuts;
    }
    match embedder.interruptible {
        None => embedder.signal_waits = Some(signal),
        Some(id) => {
            embedder.ended_by = Some(signal);
            embedder.is_ending = vm.scheduler.main.is_some();
            if vm.embedder.is_ending { vm.abort_all() } else { vm.abort(id) }
        }
    }
    false
}

/// Starts a task of the program for a signal of the process that it handles.
fn handle_signal(vm: &mut Vm, function: Value) {
    let options = SpawnOptions { name: vm.names.known.on_signal, ..SpawnOptions::default() };
    let start = |vm: &mut Vm| make_task(vm, function, Value::NIL, options).map(|_| Value::T);
    if allocate_without_retry(vm, start).is_nil() {
        vm.outside.complain("Not enough memory for the task that handles a signal.\n");
    }
}

/// Signals an input of the program, which knows it by this name.
fn receive(vm: &mut Vm, name: &str, arguments: &[Datum]) {
    vm.outside.inbox.note_arrival(name);
    let Some(&input) = vm.outside.inputs.get(name) else { return };
    // A signal without its arguments would be another one.
    let Some(arguments) = import_list(vm, arguments) else {
        return input::count_dropped(&mut vm.heap, input, 1);
    };
    allocate_without_retry(vm, |vm| signal(vm, input, arguments).map(|()| Value::NIL));
}

/// Writes what has room now, and has the tasks that wait for that try again.
fn wake_writers(vm: &mut Vm) {
    vm.outside.pass_on();
    for id in std::mem::take(&mut vm.scheduler.writers) {
        if vm.scheduler.tasks.get(id).is_some_and(|task| task.state == TaskState::Writing) {
            make_runnable(vm, id.index, false);
        }
    }
}

/// Has the tasks that wait for standard input try again.
pub(super) fn wake_readers(vm: &mut Vm) {
    for id in std::mem::take(&mut vm.scheduler.readers) {
        if vm.scheduler.tasks.get(id).is_some_and(|task| task.state == TaskState::Reading) {
            make_runnable(vm, id.index, false);
        }
    }
}
