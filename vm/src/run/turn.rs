//! The turn of a task: its slices, from taking its record out of the table to putting it back.
//!
//! The ticks of a run come in portions, whose ends say nothing about its turns: a turn that one falls into
//! stays open (`schedule::portion`), and goes on with the next portion as if nothing had happened.

use super::finish::finish_task;
use super::limit::charge_account;
use super::pending::deliver_pending;
use super::signal::deliver_some;
use super::wake::make_runnable;
use crate::exchange::Charges;
use crate::heap::Heap;
use crate::interp::{self, Leave};
use crate::observe::Seen;
use crate::report::{self, Happening};
use crate::schedule::{Due, Measure, OpenSlice, OpenTurn, Parking, TurnEnd};
use crate::task::{AccountId, Task, TaskIndex, TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// Gives a runnable task its turn: one slice, or its parts where it is cut, and as many more as it takes to
/// leave a critical section. `end` is the number of ticks of the run at which the portion is over; the turn
/// stays open then.
#[inline(always)]
pub(crate) fn give_turn(vm: &mut Vm, index: TaskIndex, end: u64) {
    vm.scheduler.turn.left = None;
    run_slices(vm, index, end);
}

/// Gives a task the slices of its turn that are to come.
#[inline(always)]
fn run_slices(vm: &mut Vm, index: TaskIndex, end: u64) {
    while let Some(leave) = run_slice(vm, index, end)
        && goes_on(vm, index, leave, end)
    {}
}

/// Goes on with a turn that the end of the last portion has left open.
#[cold]
pub(crate) fn go_on_with_turn(vm: &mut Vm, turn: OpenTurn, end: u64) {
    let index = turn.task.index;
    if !vm.scheduler.tasks.contains(turn.task) {
        if let Some(slice) = turn.slice {
            vm.scheduler.accounts.leave(slice.account);
        }
        return;
    }
    if let Some(slice) = turn.slice {
        let Some(leave) = run_rest_of_slice(vm, index, slice, end) else { return };
        if !goes_on(vm, index, leave, end) {
            return;
        }
    }
    run_slices(vm, index, end);
}

/// Does what follows on a slice, and returns whether that is another one in the same turn.
#[inline(always)]
fn goes_on(vm: &mut Vm, index: TaskIndex, leave: Leave, end: u64) -> bool {
    let scheduler = &mut vm.scheduler;
    match leave {
        Leave::Ended => {}
        Leave::Parked => park_task(vm, index),
        Leave::Slice => {
            let Some(task) = scheduler.tasks.at_mut(index) else { return false };
            let turn = &scheduler.turn;
            let goes_on = task.critical > 0 || turn.end == TurnEnd::Cut && !turn.is_spent();
            if goes_on && !scheduler.is_budget_spent(&vm.config) {
                if scheduler.spent < end {
                    return true;
                }
                scheduler.leave_open(None);
                return false;
            }
            match scheduler.turn.end {
                TurnEnd::Held => scheduler.hold(index),
                TurnEnd::Spent | TurnEnd::Cut | TurnEnd::Passed => make_runnable(vm, index, false),
            }
        }
    }
    false
}

/// Gives a task a slice. `None` if the portion has ended before the slice, which then stays open.
#[inline(always)]
fn run_slice(vm: &mut Vm, index: TaskIndex, end: u64) -> Option<Leave> {
    if !vm.scheduler.deliveries.is_empty() {
        deliver_some(vm);
    }
    let Some(mut task) = vm.scheduler.tasks.take(index) else { return Some(Leave::Ended) };
    if !vm.scan_in_turn(&mut task) {
        vm.scheduler.tasks.put_back(index, task);
        vm.scheduler.turn.end = TurnEnd::Spent;
        return Some(Leave::Slice);
    }
    let portion = end.saturating_sub(vm.scheduler.spent);
    let allocated = vm.bytes_for_accounts();
    let (slice, leave) = begin_slice(vm, index, task, portion);
    settle_slice(vm, slice, leave, portion, allocated)
}

/// Gives a task the rest of a slice. `None` as by [`run_slice`].
#[cold]
fn run_rest_of_slice(vm: &mut Vm, index: TaskIndex, slice: OpenSlice, end: u64) -> Option<Leave> {
    let Some(task) = vm.scheduler.tasks.take(index) else {
        vm.scheduler.accounts.leave(slice.account);
        return Some(Leave::Ended);
    };
    let portion = end.saturating_sub(vm.scheduler.spent);
    let allocated = vm.bytes_for_accounts();
    let leave = go_on_with_slice(vm, task, slice, portion);
    settle_slice(vm, slice, leave, portion, allocated)
}

/// Ends a slice that the running task has left, or leaves it open if that was because of the portion's end.
/// `allocated` is the number of bytes allocated when the task came to run.
#[inline(always)]
fn settle_slice(
    vm: &mut Vm,
    mut slice: OpenSlice,
    leave: Leave,
    portion: u64,
    allocated: u64,
) -> Option<Leave> {
    let leave = match leave {
        Leave::Ended if vm.scheduler.stops_before_end(&mut vm.exchange.values) => Leave::Slice,
        Leave::Ended => {
            finish_task(vm);
            Leave::Ended
        }
        leave => leave,
    };
    let used = vm.cpu.take_used();
    slice.used += used;
    if vm.scheduler.accounts.count_bytes() {
        slice.bytes += vm.heap.stats().allocated.saturating_sub(allocated);
    }
    if leave == Leave::Slice && used >= portion && used < slice.left && vm.slice_may_go_on() {
        vm.scheduler.spent += used;
        slice.left -= used;
        slice.collections = vm.cpu.collections;
        leave_slice_open(vm, slice);
        return None;
    }
    let charges = vm.exchange.charges.take().ticks();
    vm.scheduler.spent += used + charges;
    slice.used += charges;
    end_slice(vm, slice, leave);
    Some(leave)
}

impl Vm {
    /// Returns the number of bytes allocated so far, if an account counts them.
    fn bytes_for_accounts(&self) -> u64 {
        if self.scheduler.accounts.count_bytes() { self.heap.stats().allocated } else { 0 }
    }
}

/// Makes a task the running one, and runs it for a slice, or for a portion of it. The cycle of the collector
/// under way has scanned its stack.
#[inline(always)]
fn begin_slice(vm: &mut Vm, index: TaskIndex, mut task: Box<Task>, portion: u64) -> (OpenSlice, Leave) {
    task.turns = task.turns.wrapping_add(1);
    let account = task.account;
    // Until the slice is charged to it, its number is not that of another one.
    vm.scheduler.accounts.enter(account);
    // Notes from behind the slice before, such as that of the end of its account, do not concern this one.
    vm.exchange.charges = Charges::default();
    let scheduler = &mut vm.scheduler;
    let turn = &mut scheduler.turn;
    scheduler.counts.switches += u64::from(index != turn.index);
    scheduler.counts.turns += 1;
    turn.index = index;
    turn.end = TurnEnd::Spent;
    turn.had_attention = task.flags.attention();
    turn.shortage = task.flags.take_shortage();
    turn.used_before = 0;
    let left = scheduler.slice_length(&mut task, &vm.config);
    let has_pending = task.flags.attention() || account != AccountId::NONE;
    let is_critical = task.critical > 0;
    make_running(vm, task);
    interp::load(vm, left.min(portion) as i32);
    let begun = if has_pending || is_critical { begin_running(vm, has_pending) } else { Ok(()) };
    let leave = match begun {
        Ok(()) => interp::run(vm),
        Err(leave) => leave,
    };
    (OpenSlice { left, used: 0, bytes: 0, account, collections: 0 }, leave)
}

/// Makes a task the running one, and runs it for a further portion of its slice.
fn go_on_with_slice(vm: &mut Vm, task: Box<Task>, slice: OpenSlice, portion: u64) -> Leave {
    make_running(vm, task);
    vm.scan_before_running();
    vm.scheduler.turn.used_before = slice.used;
    interp::load(vm, slice.left.min(portion) as i32);
    vm.cpu.collections = slice.collections;
    interp::run(vm)
}

/// Makes a task the running one.
#[inline(always)]
fn make_running(vm: &mut Vm, task: Box<Task>) {
    let number = task.number;
    vm.heap.lend_to_cleanup(task.flags.uses_cleanup_memory());
    vm.scheduler.running = Some(task);
    if vm.watch.are_turns_noted {
        note_turn(vm, number);
    }
}

/// Takes the running task, in whose slice the portion has ended, off the processor.
#[cold]
fn leave_slice_open(vm: &mut Vm, slice: OpenSlice) {
    vm.save_cpu();
    if vm.watch.are_turns_noted {
        note_end_of_turn(vm, Leave::Slice);
    }
    put_back(vm, Leave::Slice);
    vm.scheduler.leave_open(Some(slice));
}

/// Charges the running task what it has used in its slice, and takes it off the processor.
#[inline(always)]
fn end_slice(vm: &mut Vm, slice: OpenSlice, leave: Leave) {
    let OpenSlice { used, bytes, account, .. } = slice;
    let word = if leave == Leave::Ended {
        0
    } else {
        vm.save_cpu();
        vm.word_of_pc()
    };
    vm.scheduler.turn.charge(used);
    let task = vm.scheduler.task_mut();
    task.ticks += used;
    let course = task.number.0.rotate_left(40) ^ used.rotate_left(20) ^ word as u64;
    if task.critical > 0 && !std::mem::take(&mut vm.scheduler.turn.critical_is_new) {
        vm.scheduler.turn.critical_left -= used as i64;
    }
    vm.scheduler.canary.mix(course);
    if account != AccountId::NONE {
        charge_account(vm, account, Measure::Ticks, used);
        charge_account(vm, account, Measure::Bytes, bytes);
        vm.scheduler.accounts.leave(account);
    }
    if vm.watch.are_turns_noted {
        note_end_of_turn(vm, leave);
    }
    put_back(vm, leave);
}

/// Does what has to be done before the first instruction of the slice: delivers what is pending, if anything
/// is, and ends a critical section that has taken too long.
///
/// # Errors
/// The reason for which the task gives up the processor before it runs.
fn begin_running(vm: &mut Vm, has_pending: bool) -> Result<(), Leave> {
    if has_pending {
        deliver_pending(vm)?;
    }
    let task = vm.scheduler.task();
    if task.critical > 0 && vm.scheduler.turn.critical_left <= 0 && !task.control.is_unwinding() {
        vm.scheduler.task_mut().critical = 0;
        let known = &vm.names.known;
        let (function, class, cause) = (known.raise, known.failure, known.budget_exhausted);
        interp::interrupt(vm, function, &[class, cause, Value::NIL], None)?;
    }
    Ok(())
}

/// Puts the record of the running task back into the table, or retires it after the task's end.
#[inline(always)]
fn put_back(vm: &mut Vm, leave: Leave) {
    let scheduler = &mut vm.scheduler;
    let Some(task) = scheduler.running.take() else { return };
    let index = scheduler.turn.index;
    if leave == Leave::Ended && !task.flags.kept() {
        scheduler.turn.index = TaskIndex::NONE;
        if let Some(id) = scheduler.tasks.id_at(index) {
            scheduler.tasks.retire(&mut vm.heap, id, task);
        }
    } else {
        scheduler.tasks.put_back(index, task);
    }
}

/// Notes that the turn of the running task begins, or goes on.
#[cold]
fn note_turn(vm: &mut Vm, number: TaskNumber) {
    if vm.watch.is_followed {
        report::show(vm, number, Seen::Runs);
    }
    if vm.watch.meter.is_on {
        let now = vm.used_so_far();
        vm.watch.meter.begin_turn(now);
    }
}

/// Notes that the turn of the running task is over, or stays open. Waits are told of when the task is parked.
#[cold]
fn note_end_of_turn(vm: &mut Vm, leave: Leave) {
    let number = vm.scheduler.task().number;
    if vm.watch.meter.is_on {
        let task = (vm.scheduler.turn.index, number);
        let now = vm.used_so_far();
        vm.watch.meter.end_turn(now, task);
        if leave == Leave::Ended {
            report::note_end_in_meter(vm);
        }
    }
    if !vm.watch.is_followed {
        return;
    }
    match leave {
        Leave::Slice => vm.watch.end_turn(&mut vm.outside.host, &vm.scheduler, number),
        Leave::Parked => {}
        Leave::Ended => {
            report::note_end_in_figures(vm);
            let how = report::end_label(vm, vm.scheduler.task());
            report::show(vm, number, Seen::Ends(how));
        }
    }
}

/// Notes that the task with this index has come to wait.
#[inline(always)]
fn park_task(vm: &mut Vm, index: TaskIndex) {
    let scheduler = &mut vm.scheduler;
    let parking = std::mem::take(&mut scheduler.turn.parking);
    let serial = scheduler.serial.advance();
    let Some(task) = scheduler.tasks.at_mut(index) else { return };
    task.serial = serial;
    trim(&mut vm.heap, task);
    // Something was noted while it was about to wait.
    let goes_on = task.flags.attention() && !scheduler.turn.had_attention;
    match parking {
        Parking::Wait(deadline) => {
            task.state = TaskState::Waiting;
            if let Some(deadline) = deadline {
                scheduler.set_timer(deadline, index, Due::Wait(serial));
            }
        }
        Parking::Input => {
            task.state = TaskState::Reading;
            scheduler.readers.extend(scheduler.tasks.id_at(index));
        }
        Parking::Output => {
            task.state = TaskState::Writing;
            scheduler.writers.extend(scheduler.tasks.id_at(index));
        }
    }
    report::note(vm, index, Happening::Waits);
    if goes_on {
        make_runnable(vm, index, true);
    }
}

/// Gives back most of a stack that is much too large for what is on it, if it was the last time too.
#[inline]
fn trim(heap: &mut Heap, task: &mut Task) {
    let capacity = task.stack.capacity();
    let is_oversized = capacity > 64 && interp::top_of_task(task) < capacity / 4;
    if is_oversized && task.flags.oversized() {
        task.stack.shrink(interp::top_of_task(task) + 16);
        task.recount(heap);
    }
    task.flags.set_oversized(is_oversized && !task.flags.oversized());
}
