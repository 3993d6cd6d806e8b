//! Time: when the clock is read, firing timers, and sleeping while nothing can run.
//!
//! Virtual time stands still while tasks run. It moves when all of them wait, to the first time for which one
//! does, and when so many ticks have run that something else must be meant to happen.

use esl_host::{Awaited, Host, Wake};

use super::arrival::{serve_inspections, wait_in_host, wake_readers};
use super::limit::expire_in_time;
use super::news::{expects_news, say_what_operators_can_do};
use super::tell_how_far;
use super::wake::{call_attention, make_runnable};
use crate::schedule::{Due, Scheduler};
use crate::task::Task;
use crate::vm::Vm;

/// Ticks between two readings of the clock while tasks are running.
const CLOCK_TICKS: u64 = 2000;
/// Ticks after which virtual time moves although tasks are running.
const VIRTUAL_TICKS: u64 = 10_000_000;
/// Timers that fire in one step; between two steps tasks have their turns.
const AT_ONCE: usize = 1000;

/// Asks the clock if it is time to, and fires the timers that are due. Where many timers are no longer
/// wanted, drops them: while tasks run, none may fire for long.
#[inline(always)]
pub(super) fn look_at_clock(vm: &mut Vm) {
    if vm.scheduler.timers.is_empty() {
        return;
    }
    if vm.scheduler.timers.wants_sweep() {
        vm.scheduler.sweep_timers();
    }
    let Scheduler { clock, spent, .. } = &vm.scheduler;
    let wait = if clock.is_virtual { VIRTUAL_TICKS } else { CLOCK_TICKS };
    let since = if clock.is_virtual { clock.moved_at } else { clock.looked_at };
    if clock.more_is_due || spent.saturating_sub(since) >= wait {
        ask_clock(vm);
    }
}

/// Asks the clock, and fires the timers that are due. There are timers.
fn ask_clock(vm: &mut Vm) {
    let scheduler = &mut vm.scheduler;
    if scheduler.clock.more_is_due {
        return fire_timers(vm);
    }
    if scheduler.clock.is_virtual {
        let Some(first) = scheduler.first_timer() else { return };
        let now = scheduler.clock.read(&mut vm.outside.host);
        vm.outside.host.advance(first.saturating_sub(now));
    }
    scheduler.clock.looked_at = scheduler.spent;
    fire_timers(vm);
}

/// Fires the timers that are due, or as many as one step has room for.
fn fire_timers(vm: &mut Vm) {
    let scheduler = &mut vm.scheduler;
    let is_due = match scheduler.first_timer() {
        Some(first) => scheduler.clock.is_due(&mut vm.outside.host, first),
        None => false,
    };
    let now = scheduler.clock.now;
    let mut left = AT_ONCE;
    while is_due
        && left > 0
        && let Some(timer) = vm.scheduler.timers.take_due(now)
    {
        left -= 1;
        let task = vm.scheduler.tasks.at(timer.index);
        match timer.due {
            Due::Wait(serial) => {
                if task.is_some_and(|task| task.is_waiting_since(serial)) {
                    vm.watch.journal.note_timer(now.saturating_sub(timer.time));
                    make_runnable(vm, timer.index, false);
                }
            }
            Due::Limit(number) => expire_in_time(vm, timer.index, number, now),
            Due::Cleanup => {
                if task.is_some_and(Task::runs_cleanup) {
                    call_attention(vm, timer.index);
                }
            }
        }
    }
    let scheduler = &mut vm.scheduler;
    scheduler.clock.more_is_due = left == 0;
    scheduler.clock.moved_at = scheduler.spent;
}

/// Fires timers that are due while all tasks wait, and looks whether input has come, without waiting. Where
/// time is virtual, it goes on to the first timer. Returns whether any task can go on.
pub(super) fn go_on_in_time(vm: &mut Vm) -> bool {
    if vm.scheduler.is_paused {
        return false;
    }
    vm.scheduler.forget_left_streams();
    let input = !vm.scheduler.readers.is_empty();
    let first = vm.scheduler.first_timer();
    let is_virtual = vm.scheduler.clock.is_virtual;
    if vm.outside.inbox.is_rung() {
        if vm.outside.inbox.why_rung() != Wake::Inspection {
            return true;
        }
        vm.outside.inbox.quieten();
        serve_inspections(vm);
    }
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    if input || is_virtual && first.is_some() {
        let deadline = first.filter(|_| is_virtual).unwrap_or(now);
        wait_in_host(vm, Some(deadline), Awaited { input, ..Awaited::default() });
        if input && is_virtual {
            wake_readers(vm);
        }
    }
    vm.scheduler.clock.looked_at = vm.scheduler.spent;
    fire_timers(vm);
    let has_fired = vm.scheduler.first_timer() != first || vm.scheduler.clock.more_is_due;
    has_fired || vm.outside.inbox.is_rung() || input && is_virtual
}

/// Sleeps until a timer is due or something comes from outside. Returns false if nothing ever will.
pub(crate) fn idle(vm: &mut Vm) -> bool {
    vm.outside.pass_on();
    vm.scheduler.forget_left_streams();
    let deadline = vm.scheduler.first_timer();
    let awaited = Awaited {
        input: !vm.scheduler.readers.is_empty(),
        // Room may have come since a task has parked; the note that says so has not.
        output: vm.outside.console.is_behind() || !vm.scheduler.writers.is_empty(),
        news: expects_news(vm),
    };
    if deadline.is_none() && awaited == Awaited::default() {
        return false;
    }
    if awaited.news && deadline.is_none() && !awaited.input && !awaited.output {
        say_what_operators_can_do(vm);
    }
    tell_how_far(vm);
    let host = &mut vm.outside.host;
    let begun = vm.scheduler.clock.read(host);
    wait_in_host(vm, deadline, awaited);
    vm.scheduler.clock.idled += vm.scheduler.clock.read(&mut vm.outside.host) - begun;
    if awaited.input && vm.scheduler.clock.is_virtual {
        wake_readers(vm);
    }
    vm.scheduler.clock.looked_at = vm.scheduler.spent;
    fire_timers(vm);
    true
}
