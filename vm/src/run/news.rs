//! News of operations, from the inbox to their handles.

use super::finish::allocate_without_retry;
use crate::datum;
use crate::outside::ExpectedOperators;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{event, handle};
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_bytecode::symbol::Symbol;
use esl_host::News;

/// Returns whether something may come into the inbox that lets a waiting task go on: a signal of an input, or
/// news of an operation whose handle a task waits for. News of others, such as one that an earlier program
/// has left, would wake no task.
pub(super) fn expects_news(vm: &Vm) -> bool {
    vm.outside.senders > 0 || expects_operation(vm) || awaits_operator(vm)
}

fn expects_operation(vm: &Vm) -> bool {
    let is_awaited = |event| event::is_awaited(&vm.heap, event);
    let any_is_awaited = is_awaited(vm.scheduler.any_event);
    vm.outside.operations.handles().any(|handle| any_is_awaited || is_awaited(handle))
}

/// Returns whether a task waits for an input that an operator may still attach to signal.
fn awaits_operator(vm: &Vm) -> bool {
    vm.outside.attendance != ExpectedOperators::None
        && vm.outside.inputs.values().any(|&input| event::is_awaited(&vm.heap, input))
}

/// Says for which inputs the run waits, the first time that nothing else can let it go on.
#[cold]
pub(super) fn say_what_operators_can_do(vm: &mut Vm) {
    let is_awaited = vm.outside.senders == 0 && !expects_operation(vm) && awaits_operator(vm);
    if !is_awaited || vm.outside.attendance == ExpectedOperators::IsAwaited {
        return;
    }
    vm.outside.attendance = ExpectedOperators::IsAwaited;
    let inputs = vm.outside.inputs.iter().filter(|(_, input)| event::is_awaited(&vm.heap, **input));
    let names: Vec<&str> = inputs.map(|(name, _)| name.as_str()).take(SAID).collect();
    let text = format!("; all tasks wait, and only an operator can signal {}\n", names.join(" or "));
    vm.outside.complain(&text);
}

/// Inputs that are named when a run waits for operators.
const SAID: usize = 5;

/// Takes in news of an operation: notes them in the handle, and signals it. News of an operation that is over
/// have no effect.
pub(super) fn hear(vm: &mut Vm, number: u64, news: News) {
    let Some(open) = vm.outside.operations.open.get(&number) else { return };
    let (handle, is_cancelled) = (open.handle, open.is_cancelled);
    let known = vm.names.known;
    let (state, items) = match news {
        News::Progress(values) => {
            // The next progress comes as a whole again.
            let Some(values) = import_list(vm, &values) else { return };
            vm.heap.slot_set(handle, handle::PROGRESS, values);
            return signal(vm, handle);
        }
        _ if is_cancelled => (known.cancelled, Vec::new()),
        News::Completed(values) => (known.completed, values),
        News::Failed(failure) => {
            let cause = Datum::symbol(Symbol::keyword(&failure.cause), Span::default());
            (known.failed, [vec![cause], failure.arguments].concat())
        }
    };
    let (state, result) = match import_list(vm, &items) {
        Some(list) => (state, list),
        None => {
            let cause = known.heap_exhausted;
            (known.failed, allocate_without_retry(vm, |vm| Ok(vm.heap.list(&[cause])?)))
        }
    };
    vm.heap.slot_set(handle, handle::RESULT, result);
    vm.heap.slot_set(handle, handle::STATE, state);
    signal(vm, handle);
    vm.outside.operations.remove(number);
}

/// Returns data as a list of the heap; `None` if there is no room for it.
pub(super) fn import_list(vm: &mut Vm, items: &[Datum]) -> Option<Value> {
    // A cons around it tells the empty list from a lack of room.
    let cell = allocate_without_retry(vm, |vm| {
        let list = datum::import_all(&mut vm.heap, &mut vm.names, items)?;
        Ok(vm.heap.cons(list, Value::NIL)?)
    });
    vm.heap.as_cons(cell).map(|cell| cell.car)
}

/// Signals the handle of an operation under way.
fn signal(vm: &mut Vm, handle: Value) {
    allocate_without_retry(vm, |vm| vm.signal_event(handle, &[]).map(|()| Value::NIL));
}
