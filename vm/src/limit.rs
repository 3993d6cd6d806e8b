//! What ends a task, or a part of it, from outside: aborts, limits of time and of ticks, interrupts; and how long cleanups
//! may take then.
//!
//! None of these acts at once. They are noted in the task, which gets the flag `attention`, and are seen to just before it
//! next runs, where [`Vm::see_to_running_task`] turns them into an unwinding or a frame. While a cleanup runs they wait,
//! and the cleanup has an allowance from then on; the unwinding of an abort or of an expired limit gives one to each cleanup
//! that it meets. A cleanup that outruns its allowance is left, and the unwinding goes on outward: no task is unkillable.
//!
//! Ticks are charged to *accounts*. A form with a budget opens one under that of its task, and tasks made inside charge
//! it too, so nobody gains ticks by making tasks. When it is spent its owner's form ends, and so do tasks that outlive
//! their form's owner; the account of a task's own budget has no owner, and ends all that use it.

use crate::control::{Control, End, EntryKind, Running, Target, Unwinding};
use crate::heap::Kind;
use crate::task::{Task, TaskState};
use crate::timer::Due;
use crate::value::Value;
use crate::vm::Vm;

/// Ticks that a cleanup may take once an abort or an expired limit is pending.
pub(crate) const CLEANUP_TICKS: u64 = 1_000_000;
/// Nanoseconds that it may take.
pub(crate) const CLEANUP_TIME: u64 = 60_000_000_000;

/// Names an account.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AccountId(u32);

impl AccountId {
    /// No account: ticks are not limited.
    pub(crate) const NONE: AccountId = AccountId(u32::MAX);
}

/// Ticks that may be used together.
#[derive(Clone, Debug)]
struct Account {
    left: i64,
    parent: AccountId,
    /// Tasks and accounts that charge it, and the open form.
    users: u32,
    status: Status,
}

/// Who ends when an account is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Status {
    /// The form with the limit of this number, of the task at this place.
    Form(u32, u64),
    /// All tasks that charge it.
    Tasks,
    /// Nobody: its form was left before it was spent.
    Closed,
}

/// The accounts of a machine.
#[derive(Default)]
pub(crate) struct Accounts {
    accounts: Vec<Account>,
    free: Vec<u32>,
}

impl Accounts {
    fn get(&self, id: AccountId) -> Option<&Account> {
        self.accounts.get(id.0 as usize)
    }

    fn get_mut(&mut self, id: AccountId) -> Option<&mut Account> {
        self.accounts.get_mut(id.0 as usize)
    }

    fn open(&mut self, parent: AccountId, ticks: u64, status: Status) -> AccountId {
        self.enter(parent);
        let left = i64::try_from(ticks).unwrap_or(i64::MAX);
        let account = Account { left, parent, users: 1, status };
        match self.free.pop() {
            Some(index) => {
                self.accounts[index as usize] = account;
                AccountId(index)
            }
            None => {
                self.accounts.push(account);
                AccountId(self.accounts.len() as u32 - 1)
            }
        }
    }

    /// Opens an account for a task with a budget of its own.
    pub(crate) fn open_for_task(&mut self, parent: AccountId, ticks: u64) -> AccountId {
        self.open(parent, ticks, Status::Tasks)
    }

    /// Adds a user.
    pub(crate) fn enter(&mut self, id: AccountId) {
        if let Some(account) = self.get_mut(id) {
            account.users += 1;
        }
    }

    /// Takes a user away; one that nobody uses is gone.
    pub(crate) fn leave(&mut self, id: AccountId) {
        let mut id = id;
        while let Some(account) = self.get_mut(id) {
            account.users -= 1;
            if account.users > 0 {
                return;
            }
            let parent = account.parent;
            self.free.push(id.0);
            id = parent;
        }
    }

    /// Calls `visit` with the ticks that are left of an account and of those above it, as far as they matter.
    pub(crate) fn visit_left(&self, id: AccountId, visit: &mut dyn FnMut(u64)) {
        let mut id = id;
        while let Some(account) = self.get(id) {
            if account.status != Status::Closed {
                visit(account.left as u64);
            }
            id = account.parent;
        }
    }

    /// The ticks that may be used before one of these accounts is spent.
    pub(crate) fn left(&self, id: AccountId) -> u64 {
        let (mut id, mut least) = (id, i64::MAX);
        while let Some(account) = self.get(id) {
            if account.status != Status::Closed && account.left > 0 {
                least = least.min(account.left);
            }
            id = account.parent;
        }
        least as u64
    }
}

/// An open limit of a task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    /// Index of its entry in the control stack.
    entry: u32,
    /// Its number.
    number: u64,
    /// Its account, if it limits ticks.
    account: AccountId,
    /// Why it has expired: the cause, a keyword.
    expired: Option<Value>,
}

impl Limit {
    /// Index of its entry in the control stack.
    pub(crate) fn entry(&self) -> usize {
        self.entry as usize
    }

    /// Why it has expired, if it has.
    pub(crate) fn expired(&self) -> Option<Value> {
        self.expired
    }

    /// Its number.
    pub(crate) fn number(&self) -> u64 {
        self.number
    }
}

/// What a running cleanup may still use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Allowance {
    /// Up to how many ticks of the task.
    pub ticks: u64,
    /// Until when, in nanoseconds.
    pub time: u64,
}

impl Vm {
    /// The machine's clock, in nanoseconds.
    pub(crate) fn time(&mut self) -> u64 {
        self.now = self.host.monotonic();
        self.now
    }

    /// Makes the innermost catch of the running task, whose tag is `tag`, a limit of time in nanoseconds from now and of
    /// ticks. Whether there is such a catch.
    pub(crate) fn open_limit(&mut self, tag: Value, time: Option<u64>, ticks: Option<u64>) -> bool {
        let number = self.next_serial();
        let now = self.time();
        let index = self.running_index;
        let task = self.task_mut();
        let Some(entry) = task.control.entries.last_mut() else { return false };
        if entry.kind != EntryKind::Catch || entry.data != tag {
            return false;
        }
        entry.kind = EntryKind::Limit;
        let entry = task.control.entries.len() as u32 - 1;
        let parent = task.account;
        let mut limit = Limit { entry, number, account: AccountId::NONE, expired: None };
        if let Some(ticks) = ticks {
            limit.account = self.accounts.open(parent, ticks, Status::Form(index, number));
            self.task_mut().account = limit.account;
            // What the slice has used so far is not charged to it, and the next one is to be no longer than it allows.
            self.end_slice_here();
        }
        self.task_mut().extra_mut().limits.push(limit);
        if let Some(time) = time {
            self.timers.push(now.saturating_add(time), index, Due::Limit(number));
        }
        if ticks == Some(0) {
            self.expire(index, number, self.world.known.budget_exhausted);
        }
        true
    }

    /// Closes the innermost limit of the running task, because its entry was popped.
    pub(crate) fn close_limit(&mut self) {
        let limit = self.task_mut().extra.as_mut().and_then(|extra| extra.limits.pop());
        let Some(limit) = limit else { return };
        if let Some(account) = self.accounts.get_mut(limit.account) {
            // Tasks that were made inside and have not had their turn since it was spent are still to end.
            account.status = if account.left > 0 { Status::Closed } else { Status::Tasks };
            // The task never ceased to be a user of the account above.
            let parent = account.parent;
            self.task_mut().account = parent;
            self.accounts.leave(limit.account);
        }
    }

    /// Charges ticks to an account and those above it.
    pub(crate) fn charge_account(&mut self, id: AccountId, ticks: u64) {
        let mut id = id;
        while let Some(account) = self.accounts.get_mut(id) {
            let was_left = account.left > 0;
            account.left = account.left.saturating_sub_unsigned(ticks);
            let (spent, status, parent) = (was_left && account.left <= 0, account.status, account.parent);
            if spent && let Status::Form(index, number) = status {
                self.expire(index, number, self.world.known.budget_exhausted);
            }
            id = parent;
        }
    }

    /// Whether the running task has to end because an account that it charges is spent.
    fn is_spent(&self) -> bool {
        let mut id = self.task().account;
        while let Some(account) = self.accounts.get(id) {
            if account.left <= 0 {
                match account.status {
                    Status::Tasks => return true,
                    Status::Form(index, _) if index != self.running_index => return true,
                    _ => {}
                }
            }
            id = account.parent;
        }
        false
    }

    /// Notes that a limit has expired, if it is still open.
    pub(crate) fn expire(&mut self, index: u32, number: u64, cause: Value) {
        let is_running = index == self.running_index && self.running.is_some();
        let task = if is_running { self.running.as_deref_mut() } else { self.tasks.at_mut(index) };
        let Some(task) = task else { return };
        let limits = task.extra.as_mut().map_or(&mut [][..], |extra| &mut extra.limits[..]);
        let Some(limit) = limits.iter_mut().find(|limit| limit.number == number) else { return };
        limit.expired = limit.expired.or(Some(cause));
        self.call_attention(index);
    }

    /// Has a task looked after before it goes on, whatever it does: one that is blocked becomes runnable.
    pub(crate) fn call_attention(&mut self, index: u32) {
        if index == self.running_index
            && let Some(task) = self.running.as_deref_mut()
        {
            task.flags.set_attention(true);
            self.end_slice_here();
            return;
        }
        let Some(task) = self.tasks.at_mut(index) else { return };
        if task.state != TaskState::Ended {
            task.flags.set_attention(true);
            self.make_runnable(index, true);
        }
    }

    /// Has `guard` interrupt the task that it guards, if it is open.
    pub(crate) fn interrupt_by(&mut self, guard: Value) {
        let task = self.slot(guard, guard::TASK);
        let Some(index) = self.slot(task, crate::wait::event::STATE).as_index() else { return };
        if self.slot(guard, guard::IS_OPEN).is_nil() {
            return;
        }
        let index = index as u32;
        let is_running = index == self.running_index && self.running.is_some();
        let task = if is_running { self.running.as_deref_mut() } else { self.tasks.at_mut(index) };
        if let Some(task) = task {
            task.extra_mut().interrupts.push(guard);
            self.call_attention(index);
        }
    }

    /// Sees to what has been noted of the running task. What has to wait for the end of a cleanup, or of a critical
    /// section, stays noted. Gives a function that is to be called where the task stands.
    pub(crate) fn see_to_running_task(&mut self) -> Option<Value> {
        if self.task().account != AccountId::NONE && self.is_spent() {
            self.task_mut().flags.set_attention(true);
        }
        if !self.task().flags.attention() || self.task().critical > 0 {
            return None;
        }
        let cleanup = self.task().control.get().and_then(Control::innermost_cleanup);
        if cleanup.is_some() && self.cut_off_cleanup() {
            return None;
        }
        let mut waits = false;
        if self.task().flags.abort_pending() || self.is_spent() {
            if cleanup.is_none() {
                let end = if self.task().flags.abort_pending() { End::Aborted } else { End::Spent };
                self.end_running_task(end);
                return None;
            }
            waits = true;
        }
        let limits = self.task().extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
        let expired = limits.iter().find(|limit| limit.expired.is_some()).copied();
        if let Some(limit) = expired {
            let entry = limit.entry as usize;
            if cleanup.is_none_or(|cleanup| cleanup < entry) {
                self.unwind_to_limit(entry, limit.expired.unwrap_or(Value::NIL));
                // What is noted besides is looked at again when that is over.
                return None;
            }
            waits = true;
        }
        if waits {
            self.allow_cleanups();
        }
        let interrupt = self.take_interrupt_of_guard(cleanup);
        let has_more = self.task().extra.as_ref().is_some_and(|extra| !extra.interrupts.is_empty());
        self.task_mut().flags.set_attention(waits || has_more);
        interrupt
    }

    /// Begins to end the running task.
    fn end_running_task(&mut self, end: End) {
        self.cancel_wait();
        let task = self.task_mut();
        task.flags.set_abort_pending(false);
        task.flags.set_attention(false);
        task.flags.set_urgent(true);
        if let Some(extra) = &mut task.extra {
            extra.interrupts.clear();
        }
        let ends_anyhow = task
            .control
            .get()
            .and_then(|control| control.unwinding.as_ref())
            .is_some_and(|unwinding| matches!(unwinding.target, Target::Root(_)));
        if !ends_anyhow {
            self.begin_end(end);
        }
    }

    /// Begins to unwind the running task to the entry of a limit, unless it is on its way further out.
    fn unwind_to_limit(&mut self, entry: usize, cause: Value) {
        self.cancel_wait();
        let task = self.task_mut();
        let passes_by = task.control.unwinding.as_ref().is_some_and(|unwinding| match unwinding.target {
            Target::Root(_) => true,
            Target::Entry(index) | Target::Limit(index) | Target::Cleanup(index) => index <= entry,
            Target::Return { entries, .. } => entries <= entry,
        });
        if !passes_by {
            task.control.unwinding = Some(Unwinding { target: Target::Limit(entry), values: vec![cause] });
        }
    }

    /// The function of the first guard whose interrupt may be delivered now.
    fn take_interrupt_of_guard(&mut self, cleanup: Option<usize>) -> Option<Value> {
        let task = self.task();
        let interrupts = task.extra.as_ref().map_or(&[][..], |extra| &extra.interrupts[..]);
        if interrupts.is_empty() || task.control.is_unwinding() {
            return None;
        }
        let may = |&guard: &Value| {
            let height = self.slot(guard, guard::HEIGHT).as_index().unwrap_or(0);
            cleanup.is_none_or(|cleanup| cleanup < height)
        };
        let position = interrupts.iter().position(may)?;
        let guard = self.task_mut().extra_mut().interrupts.remove(position);
        if self.slot(guard, guard::IS_OPEN).is_nil() {
            return None;
        }
        self.set_slot(guard, guard::IS_OPEN, Value::NIL);
        Some(self.slot(guard, guard::FUNCTION))
    }

    /// Gives each cleanup that runs in the running task, and has none, an allowance.
    fn allow_cleanups(&mut self) {
        let time = self.time().saturating_add(self.config.cleanup_time);
        let ticks = self.task().ticks.saturating_add(self.config.cleanup_ticks);
        let mut gives = false;
        for running in &mut self.task_mut().control.running {
            if running.allowance.is_none() {
                running.allowance = Some(Allowance { ticks, time });
                gives = true;
            }
        }
        if gives {
            self.timers.push(time, self.running_index, Due::Cleanup);
        }
    }

    /// The allowance of a cleanup that an abort or an expired limit meets.
    pub(crate) fn new_allowance(&mut self) -> Allowance {
        let time = self.time().saturating_add(self.config.cleanup_time);
        self.timers.push(time, self.running_index, Due::Cleanup);
        // The ticks of the slice under way are not counted yet, and come on top.
        Allowance { ticks: self.task().ticks.saturating_add(self.config.cleanup_ticks), time }
    }

    /// Ticks that the innermost cleanup of the running task may still use.
    pub(crate) fn cleanup_ticks_left(&self) -> u64 {
        let task = self.task();
        let Some(control) = task.control.get() else { return u64::MAX };
        let allowances = control.running.iter().filter_map(|running| running.allowance);
        allowances.map(|allowance| allowance.ticks.saturating_sub(task.ticks)).min().unwrap_or(u64::MAX)
    }

    /// Begins to leave the outermost cleanup of the running task that has outrun its allowance. Whether there is one.
    fn cut_off_cleanup(&mut self) -> bool {
        let now = self.time();
        let wait = self.task().wait;
        let awaits_child = wait.is_true() && self.is_for_child(wait);
        let task = self.task();
        let ticks = task.ticks;
        let is_spent = |running: &Running| {
            running
                .allowance
                .is_some_and(|allowance| ticks >= allowance.ticks || now >= allowance.time && !awaits_child)
        };
        let has_allowance = task.control.running.iter().any(|running| running.allowance.is_some());
        let position = task.control.running.iter().position(is_spent);
        if awaits_child && has_allowance {
            // Children are bounded in their turn; their end is what this cleanup is for.
            let index = self.running_index;
            self.timers.push(now.saturating_add(1_000_000_000), index, Due::Cleanup);
        }
        let Some(position) = position else { return false };
        let Some(entry) = self.task().control.cleanup_entry(position) else { return false };
        self.cancel_wait();
        let is_under_way =
            self.task().control.unwinding.as_ref().is_some_and(
                |unwinding| matches!(unwinding.target, Target::Cleanup(index) if index <= entry),
            );
        if !is_under_way {
            let unwinding = Unwinding { target: Target::Cleanup(entry), values: Vec::new() };
            self.task_mut().control.unwinding = Some(unwinding);
            let name = self.task_label(self.task().object);
            self.complain(&format!("A cleanup of {name} takes too long and is left.\n"));
        }
        true
    }

    /// What unwinds on when the entry of a cleanup that was cut off has been popped.
    pub(crate) fn after_cut_off(&mut self, interrupted: Option<Unwinding>) -> Option<Unwinding> {
        if interrupted.is_some() {
            return interrupted;
        }
        let control = &mut self.task_mut().control;
        // It followed a form that had returned. What made it end is for the whole task or for a form further out; with a
        // cleanup around it that one is what ends.
        if let Some(entry) = control.innermost_cleanup() {
            return Some(Unwinding { target: Target::Cleanup(entry), values: Vec::new() });
        }
        let limits = self.task().extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
        if !self.task().flags.abort_pending()
            && let Some(limit) = limits.iter().find(|limit| limit.expired.is_some())
        {
            let (entry, cause) = (limit.entry as usize, limit.expired.unwrap_or(Value::NIL));
            return Some(Unwinding { target: Target::Limit(entry), values: vec![cause] });
        }
        let end = if self.task().flags.abort_pending() { End::Aborted } else { End::Spent };
        let task = self.task_mut();
        task.flags.set_abort_pending(false);
        task.flags.set_urgent(true);
        Some(Unwinding { target: Target::Root(end), values: Vec::new() })
    }
}

/// Slots of a guard: what a child interrupts its parent with.
pub(crate) mod guard {
    /// The task that it guards.
    pub(crate) const TASK: usize = 0;
    /// The function that is to run there.
    pub(crate) const FUNCTION: usize = 1;
    /// Whether it still may.
    pub(crate) const IS_OPEN: usize = 2;
    /// The height of the control stack where it was made: it acts inside a cleanup only if it was made there.
    pub(crate) const HEIGHT: usize = 3;
    /// What `aux` is of such a record.
    pub(crate) const AUX: u16 = 1;
}

impl Vm {
    /// Whether `object` is a guard.
    pub(crate) fn is_guard(&self, object: Value) -> bool {
        self.heap.is(object, Kind::Record)
            && self.heap.header(object).is_some_and(|header| header.aux == guard::AUX)
    }
}

/// Calls `visit` with the values that limits and interrupts of a task hold.
pub(crate) fn visit(task: &Task, visit: &mut dyn FnMut(Value)) {
    if let Some(extra) = &task.extra {
        extra.limits.iter().filter_map(|limit| limit.expired).for_each(&mut *visit);
        extra.interrupts.iter().copied().for_each(visit);
    }
}
