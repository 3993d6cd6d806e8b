//! Requests of a program to the outside: its arguments, the time, and the embedder's functions.

use crate::builtins::operation::host_call;
use crate::datum;
use crate::raise::{Exit, Outcome, Raised};
use crate::value::Value;
use crate::vm::Vm;
use esl_bytecode::datum::Datum;
use esl_bytecode::span::Span;
use esl_host::{Host, HostFailure};

/// Seconds from the beginning of 1900 to that of 1970.
pub(super) const UNIX_EPOCH: i64 = 2_208_988_800;

pub(super) fn command_line_arguments(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let mut strings = Vec::new();
    for argument in vm.outside.host.arguments() {
        strings.push(vm.heap.alloc_str(&argument)?);
    }
    Ok(vm.heap.list(&strings)?)
}

pub(super) fn now(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let seconds = vm.outside.host.monotonic() as f64 / 1e9;
    Ok(vm.heap.float(seconds)?)
}

pub(super) fn internal_real_time(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    // Nanoseconds are far below 2^61 for the next 70 years.
    Ok(Value::fixnum((vm.outside.host.monotonic() / 1000) as i64).unwrap_or(Value::NIL))
}

pub(super) fn internal_run_time(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    // Under a virtual clock the processor's time is that in which the clock moved while tasks computed.
    let run = if vm.scheduler.clock.is_virtual {
        vm.outside.host.monotonic().saturating_sub(vm.scheduler.clock.idled)
    } else {
        vm.outside.host.processor_time()
    };
    Ok(Value::fixnum((run / 1000) as i64).unwrap_or(Value::NIL))
}

pub(super) fn universal_time(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let seconds = vm.outside.host.wall_clock().div_euclid(1_000_000_000);
    Ok(Value::fixnum(seconds.saturating_add(UNIX_EPOCH)).unwrap_or(Value::NIL))
}

pub(super) fn call_host(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let function = host_call(vm, arguments)?;
    // The function has effects that cannot be done twice, so what it gives is kept until there is room for
    // it.
    let task = vm.scheduler.task().number;
    let base = vm.offset_of(vm.cpu.base()) as u32;
    let kept = vm.outside.answers.take(task, base);
    let answer = kept.or_else(|| vm.outside.call(function?));
    vm.outside.let_go_of_arguments();
    let Some(answer) = answer else {
        return vm.exchange.raise(Raised::Cause("NOT-IN-THIS-WORLD", arguments[0]));
    };
    match give_answer(vm, &answer) {
        Err(Exit::Collect) => {
            vm.outside.answers.keep(task, base, answer);
            Err(Exit::Collect)
        }
        outcome => outcome,
    }
}

/// Returns the value of an embedder's function, or requests a call that fails as the function has failed.
fn give_answer(vm: &mut Vm, answer: &Result<Datum, HostFailure>) -> Outcome {
    match answer {
        Ok(datum) => import(vm, datum),
        Err(failure) => {
            let cause = vm.names.keyword(&mut vm.heap, &failure.cause)?;
            let list = Datum::list(failure.arguments.iter().cloned(), Span::default());
            let list = import(vm, &list)?;
            vm.exchange.request_call(vm.names.known.fail_as_host, &[cause, list]);
            Err(Exit::Call)
        }
    }
}

/// Returns data as a value, and charges for it.
fn import(vm: &mut Vm, datum: &Datum) -> Outcome {
    let (value, work) = datum::import(&mut vm.heap, &mut vm.names, datum)?;
    vm.exchange.charge(work);
    Ok(value)
}
