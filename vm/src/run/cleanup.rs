//! Cleanups of the running task that an abort or an expired limit waits for: allowances, and cutting off.

use crate::report;
use crate::schedule::Due;
use crate::task::{Allowance, RunningCleanup, UnwindTarget, Unwinding};
use crate::vm::Vm;
use crate::wait::link;

/// Interval at which a cleanup that waits for the end of a child is looked at again, in nanoseconds.
const CHILD_INTERVAL: u64 = 1_000_000_000;

/// Gives an allowance to the outermost running cleanup of the running task that an abort or a limit waits
/// for, which is the one that bounds all others. `depth` is the number of control entries that are left then.
pub(super) fn allow_cleanups(vm: &mut Vm, depth: usize) {
    let Vm { scheduler, outside, config, cpu, .. } = vm;
    let running = scheduler.task().control.get().map_or(&[][..], |control| &control.running[..]);
    let position = running.partition_point(|running| running.entry < depth);
    let Some(&RunningCleanup { entry, allowance: None, .. }) = running.get(position) else { return };
    let allowance = scheduler.allow_cleanup(Some(depth), entry, cpu.used(), &mut outside.host, config);
    let allowance = allowance.unwrap_or(Allowance { ticks: 0, time: 0 });
    scheduler.task_mut().control.set_allowance(position, allowance);
}

/// Begins to leave the outermost cleanup of the running task that has outrun its allowance. Returns whether
/// there is one.
pub(super) fn cut_off_cleanup(vm: &mut Vm) -> bool {
    let scheduler = &mut vm.scheduler;
    let now = scheduler.clock.read(&mut vm.outside.host);
    let task = scheduler.task();
    let awaits_child = task.wait.is_true() && link::is_for_child(&vm.heap, task.wait);
    let ticks = task.ticks;
    let is_spent = |allowance: Allowance| ticks >= allowance.ticks || now >= allowance.time && !awaits_child;
    let position = task.control.outermost_spent(is_spent);
    if awaits_child && task.control.bound() != Allowance::OVER {
        // Children are bounded in their turn; their end is what this cleanup is for.
        let index = scheduler.turn.index;
        scheduler.timers.push(now.saturating_add(CHILD_INTERVAL), index, Due::Cleanup);
    }
    let Some(position) = position else { return false };
    scheduler.cancel_wait(&mut vm.heap);
    let control = &mut scheduler.task_mut().control;
    let entry = control.running[position].entry;
    // It is left once; cleanups on the exit path have allowances of their own.
    control.set_allowance(position, Allowance::OVER);
    let is_under_way = control
        .unwinding
        .as_ref()
        .is_some_and(|unwinding| matches!(unwinding.target, UnwindTarget::Cleanup(index) if index <= entry));
    if !is_under_way {
        control.unwinding = Some(Unwinding { target: UnwindTarget::Cleanup(entry), values: Vec::new() });
        report_cut_off(vm);
    }
    true
}

/// Reports that a cleanup of the running task is cut off. Once what its cleanups may use together is spent,
/// a single report stands for all that follow.
fn report_cut_off(vm: &mut Vm) {
    let is_last = vm.scheduler.is_fund_spent(vm.cpu.used(), &mut vm.outside.host);
    let task = vm.scheduler.task_mut();
    let object = task.object;
    let fund = task.extra.as_mut().and_then(|extra| extra.fund.as_mut());
    let was_reported = fund.is_some_and(|fund| std::mem::replace(&mut fund.is_reported, is_last));
    if was_reported {
        return;
    }
    let name = report::task_label(vm, object);
    let all = if is_last { ", and so are outer ones that do not end at once" } else { "" };
    vm.outside.complain(&format!("A cleanup of {name} takes too long and is cut off{all}.\n"));
}
