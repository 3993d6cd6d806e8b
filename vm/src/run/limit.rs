//! Limits of time, of ticks and of other measures: opening them, and their expiry.
//!
//! A limit that expires is noted in its task and seen to before the task next runs: see `pending`.

use super::wake::call_attention;
use crate::raise::Exit;
use crate::schedule::{AccountOwner, Amount, Due, Measure};
use crate::task::{AccountId, EntryKind, Limit, LimitNumber, TaskIndex, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// Makes the innermost catch of the running task, whose tag is `tag`, a limit of time, in nanoseconds from
/// now, or of an amount that may be used. Returns whether there is such a catch.
pub(crate) fn open_limit(vm: &mut Vm, tag: Value, time: Option<u64>, amount: Option<Amount>) -> bool {
    let scheduler = &mut vm.scheduler;
    let number = scheduler.next_limit();
    let now = scheduler.clock.read(&mut vm.outside.host);
    let index = scheduler.turn.index;
    let time_of_task = scheduler.standstill().time_at(now);
    let task = scheduler.task_mut();
    let Some(entry) = task.control.entries.last_mut() else { return false };
    if entry.kind != EntryKind::Catch || entry.data != tag {
        return false;
    }
    entry.kind = EntryKind::Limit;
    let entry = task.control.entries.len() as u32 - 1;
    let outer = task.account;
    // In a cleanup of a form that has spent its account, the new one is not to be spent with that.
    let is_free = task.runs_cleanup();
    let ends = time.map(|time| time_of_task.saturating_add(time));
    let mut limit = Limit { entry, number, account: AccountId::NONE, outer, ends, expired: None };
    if let Some(amount) = amount {
        let parent = scheduler.accounts.for_child(outer, is_free);
        limit.account = scheduler.accounts.open(parent, amount, AccountOwner::Form(index, number));
        scheduler.task_mut().account = limit.account;
        // The ticks of the slice so far are not charged to it, and the next slice is no longer than it
        // allows.
        vm.exchange.charges.end_slice();
    }
    scheduler.task_mut().extra_mut().limits.push(limit);
    if let Some(time) = time {
        scheduler.set_timer(now.saturating_add(time), index, Due::Limit(number));
    }
    if amount.is_some_and(|amount| amount.measure == Measure::Ticks && amount.units == 0) {
        expire(vm, index, number, vm.names.known.budget_exhausted);
    }
    true
}

/// Notes that a limit of time has expired, unless the clock of its task was stopped meanwhile.
pub(super) fn expire_in_time(vm: &mut Vm, index: TaskIndex, number: LimitNumber, now: u64) {
    let Some(task) = vm.scheduler.find(index) else { return };
    let limits = task.extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
    let ends = limits.iter().find(|limit| limit.number == number).and_then(|limit| limit.ends);
    let standstill = vm.scheduler.tasks.standstill(index);
    match ends {
        Some(ends) if standstill.time_at(now) < ends => {
            // The timer of one whose clock is stopped is set when it goes on.
            if !standstill.is_stopped() {
                let time = standstill.when(ends);
                vm.scheduler.timers.push(time, index, Due::Limit(number));
            }
        }
        _ => expire(vm, index, number, vm.names.known.timeout),
    }
}

/// Has the running task stand still, with its clock stopped or not.
pub(crate) fn stand_still(vm: &mut Vm, stops_clock: bool) {
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    let index = vm.scheduler.turn.index;
    vm.scheduler.task_mut().flags.set_suspended(true);
    if stops_clock {
        vm.scheduler.tasks.standstill_mut(&mut vm.heap, index).stop_clock(now);
    }
}

/// Has the running task go on after it has stood still. Requests pending since then are delivered.
pub(crate) fn go_on(vm: &mut Vm) {
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    let index = vm.scheduler.turn.index;
    let task = vm.scheduler.task_mut();
    task.flags.set_suspended(false);
    task.flags.set_attention(true);
    vm.exchange.charges.end_slice();
    if !vm.scheduler.standstill().is_stopped() {
        return;
    }
    let standstill = vm.scheduler.tasks.standstill_mut(&mut vm.heap, index);
    standstill.start_clock(now);
    let standstill = *standstill;
    let limits = vm.scheduler.task().extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
    let open = limits.iter().filter_map(|limit| Some((limit.number, limit.ends?)));
    let timers: Vec<(LimitNumber, u64)> = open.collect();
    for (number, ends) in timers {
        vm.scheduler.timers.push(standstill.when(ends), index, Due::Limit(number));
    }
}

/// Charges ticks or bytes to an account and those above it; limits whose accounts are spent by it expire.
pub(super) fn charge_account(vm: &mut Vm, id: AccountId, measure: Measure, units: u64) {
    for (index, number) in vm.scheduler.accounts.charge(id, measure, units) {
        expire_spent(vm, index, number);
    }
}

/// Notes that a limit has expired whose account is spent.
fn expire_spent(vm: &mut Vm, index: TaskIndex, number: LimitNumber) {
    let can_run =
        |vm: &Vm| vm.scheduler.tasks.at(index).is_some_and(|task| task.state == TaskState::Runnable);
    let was_hit = vm.scheduler.points.grain.is_some() && can_run(vm);
    vm.scheduler.points.was_hit |= was_hit;
    expire(vm, index, number, vm.names.known.budget_exhausted);
}

/// Sees to it that the running task may take a unit more of a measure.
///
/// # Errors
/// [`Exit::Again`] if that is more than a quota allows: before the task does it again, the form with the
/// quota ends. Where it cannot, as in a cleanup, the unit may be taken then.
#[inline(always)]
pub(crate) fn admit(vm: &mut Vm, measure: Measure) -> Result<(), Exit> {
    match vm.scheduler.running_account() {
        AccountId::NONE => Ok(()),
        account => admit_to(vm, account, measure),
    }
}

#[cold]
fn admit_to(vm: &mut Vm, account: AccountId, measure: Measure) -> Result<(), Exit> {
    let Err(expired) = vm.scheduler.accounts.admit(account, measure) else { return Ok(()) };
    for (index, number) in expired {
        expire_spent(vm, index, number);
    }
    Err(Exit::Again)
}

/// Notes that the limit of a task that was opened for `tag` has expired, if it is still open.
pub(crate) fn expire_limit(vm: &mut Vm, index: TaskIndex, tag: Value, cause: Value) {
    let Some(task) = vm.scheduler.find(index) else { return };
    let limits = task.extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
    let tag_of = |limit: &Limit| task.control.entries.get(limit.entry as usize).map(|entry| entry.data);
    if let Some(number) = limits.iter().find(|limit| tag_of(limit) == Some(tag)).map(|limit| limit.number) {
        expire(vm, index, number, cause);
    }
}

/// Notes that a limit has expired, if it is still open.
pub(super) fn expire(vm: &mut Vm, index: TaskIndex, number: LimitNumber, cause: Value) {
    let Some(task) = vm.scheduler.find_mut(index) else { return };
    let limits = task.extra.as_mut().map_or(&mut [][..], |extra| &mut extra.limits[..]);
    let Some(limit) = limits.iter_mut().find(|limit| limit.number == number) else { return };
    limit.expired = limit.expired.or(Some(cause));
    call_attention(vm, index);
}
