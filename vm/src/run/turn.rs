//! The turn of a task: its slices, from taking its record out of the table to putting it back.

use super::finish::finish_task;
use super::limit::charge_account;
use super::pending::deliver_pending;
use super::signal::deliver_some;
use super::wake::make_runnable;
use crate::interp::{self, Leave};
use crate::observe::Seen;
use crate::report::{self, Happening};
use crate::schedule::{Due, Parking, TurnEnd};
use crate::task::{AccountId, Task, TaskIndex, TaskState};
use crate::vm::Vm;

/// Gives a runnable task its turn: one slice, or as many as it takes to leave a critical section. `end` is
/// the number of ticks of the run at which it is over in any case.
pub(crate) fn give_turn(vm: &mut Vm, index: TaskIndex, end: u64) {
    loop {
        let limit = end.saturating_sub(vm.scheduler.spent);
        let leave = run_slice(vm, index, limit);
        let scheduler = &mut vm.scheduler;
        let Some(task) = scheduler.tasks.at_mut(index) else { return };
        match leave {
            Leave::Ended => return,
            Leave::Slice => {
                let goes_on = task.critical > 0 || scheduler.turn.end == TurnEnd::Cut;
                if goes_on && scheduler.spent < end && !scheduler.is_budget_spent(&vm.config) {
                    continue;
                }
                return match scheduler.turn.end {
                    TurnEnd::Held => scheduler.hold(index),
                    TurnEnd::Spent | TurnEnd::Cut | TurnEnd::Passed => make_runnable(vm, index, false),
                };
            }
            Leave::Parked => return park_task(vm, index),
        }
    }
}

/// Gives a runnable task one slice.
fn run_slice(vm: &mut Vm, index: TaskIndex, limit: u64) -> Leave {
    if !vm.scheduler.deliveries.is_empty() {
        deliver_some(vm);
    }
    let Some(task) = vm.scheduler.tasks.take(index) else { return Leave::Ended };
    let account = task.account;
    begin_slice(vm, index, task);
    let slice = vm.scheduler.slice_length(&vm.config, limit);
    interp::load(vm, slice as i32);
    let leave = match begin_running(vm, account) {
        Ok(()) => interp::run(vm),
        Err(leave) => leave,
    };
    let leave = match leave {
        Leave::Ended if vm.scheduler.stops_before_end(&mut vm.exchange.values) => Leave::Slice,
        Leave::Ended => {
            finish_task(vm);
            Leave::Ended
        }
        leave => leave,
    };
    let used = vm.cpu.take_used() + vm.exchange.charges.take().ticks();
    vm.scheduler.spent += used;
    if leave != Leave::Ended {
        vm.save_cpu();
    }
    let task = vm.scheduler.task_mut();
    task.ticks += used;
    if task.critical > 0 && !std::mem::take(&mut vm.scheduler.turn.critical_is_new) {
        vm.scheduler.turn.critical_left -= used as i64;
    }
    if account != AccountId::NONE {
        charge_account(vm, account, used);
    }
    if vm.watch.is_watched {
        tell_how_turn_ended(vm, leave);
    }
    put_back(vm, leave);
    leave
}

/// Makes a task the running one, at the beginning of a slice.
fn begin_slice(vm: &mut Vm, index: TaskIndex, mut task: Box<Task>) {
    task.turns = task.turns.wrapping_add(1);
    let number = task.number;
    let scheduler = &mut vm.scheduler;
    let turn = &mut scheduler.turn;
    scheduler.counts.switches += u64::from(index != turn.index);
    scheduler.counts.turns += 1;
    turn.index = index;
    turn.end = TurnEnd::Spent;
    turn.had_attention = task.flags.attention();
    scheduler.running = Some(task);
    if vm.watch.is_watched {
        report::show(vm, number, Seen::Runs);
    }
    vm.scan_before_running();
}

/// Does what has to be done before the first instruction of the slice: delivers what is pending, and ends a
/// critical section that has taken too long.
///
/// # Errors
/// What takes the task off the processor before it runs.
fn begin_running(vm: &mut Vm, account: AccountId) -> Result<(), Leave> {
    if vm.scheduler.task().flags.attention() || account != AccountId::NONE {
        deliver_pending(vm)?;
    }
    let task = vm.scheduler.task();
    if task.critical > 0 && vm.scheduler.turn.critical_left <= 0 && !task.control.is_unwinding() {
        vm.scheduler.task_mut().critical = 0;
        let (function, cause) = (vm.world.known.raise, vm.world.known.budget_exhausted);
        interp::interrupt(vm, function, &[cause])?;
    }
    Ok(())
}

/// Puts the record of the running task back into the table, or retires it after the task's end.
fn put_back(vm: &mut Vm, leave: Leave) {
    let scheduler = &mut vm.scheduler;
    let Some(task) = scheduler.running.take() else { return };
    let index = scheduler.turn.index;
    if leave == Leave::Ended && !task.flags.kept() {
        scheduler.turn.index = TaskIndex::NONE;
        if let Some(id) = scheduler.tasks.id_at(index) {
            scheduler.tasks.retire(id, task);
        }
    } else {
        scheduler.tasks.put_back(index, task);
    }
}

/// Tells observers that the turn of the running task is over. Waits are told of when the task is parked.
#[cold]
fn tell_how_turn_ended(vm: &mut Vm, leave: Leave) {
    let number = vm.scheduler.task().number;
    match leave {
        Leave::Slice => vm.watch.end_turn(&mut *vm.outside.host, &vm.scheduler, number),
        Leave::Parked => {}
        Leave::Ended => {
            report::note_end_in_figures(vm);
            let how = report::end_label(vm, vm.scheduler.task());
            report::show(vm, number, Seen::Ends(how));
        }
    }
}

/// Notes that the task with this index has come to wait.
fn park_task(vm: &mut Vm, index: TaskIndex) {
    let scheduler = &mut vm.scheduler;
    let parking = std::mem::take(&mut scheduler.turn.parking);
    let serial = scheduler.serial.advance();
    let Some(id) = scheduler.tasks.id_at(index) else { return };
    let Some(task) = scheduler.tasks.at_mut(index) else { return };
    task.serial = serial;
    trim(task);
    match parking {
        Parking::Input => {
            task.state = TaskState::Reading;
            scheduler.readers.push(id);
        }
        Parking::Wait(deadline) => {
            task.state = TaskState::Waiting;
            if let Some(deadline) = deadline {
                scheduler.timers.push(deadline, index, Due::Wait(serial));
            }
        }
    }
    report::note(vm, index, Happening::Waits);
    let scheduler = &vm.scheduler;
    if !scheduler.turn.had_attention && scheduler.tasks.at(index).is_some_and(|task| task.flags.attention()) {
        // Something was noted while it was about to wait.
        make_runnable(vm, index, true);
    }
}

/// Gives back most of a stack that is much too large for what is on it, if it was the last time too.
fn trim(task: &mut Task) {
    let (top, capacity) = (interp::top_of_task(task), task.stack.capacity());
    let is_oversized = capacity > 64 && top < capacity / 4;
    if is_oversized && task.flags.oversized() {
        task.stack.shrink(top + 16);
    }
    task.flags.set_oversized(is_oversized && !task.flags.oversized());
}
