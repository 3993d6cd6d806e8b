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

use crate::schedule::{Due, Status};
use crate::task::{
    AccountId, Allowance, Control, End, EntryKind, Limit, Running, Target, TaskState, Unwinding, guard,
};
use crate::value::Value;
use crate::vm::Vm;

impl Vm {
    /// The machine's clock, in nanoseconds.
    pub(crate) fn time(&mut self) -> u64 {
        self.scheduler.clock.now = self.outside.host.monotonic();
        self.scheduler.clock.now
    }

    /// Makes the innermost catch of the running task, whose tag is `tag`, a limit of time in nanoseconds from now and of
    /// ticks. Whether there is such a catch.
    pub(crate) fn open_limit(&mut self, tag: Value, time: Option<u64>, ticks: Option<u64>) -> bool {
        let number = self.scheduler.next_serial();
        let now = self.time();
        let index = self.scheduler.turn.index;
        let task = self.scheduler.task_mut();
        let Some(entry) = task.control.entries.last_mut() else { return false };
        if entry.kind != EntryKind::Catch || entry.data != tag {
            return false;
        }
        entry.kind = EntryKind::Limit;
        let entry = task.control.entries.len() as u32 - 1;
        let parent = task.account;
        let mut limit = Limit { entry, number, account: AccountId::NONE, expired: None };
        if let Some(ticks) = ticks {
            limit.account = self.scheduler.accounts.open(parent, ticks, Status::Form(index, number));
            self.scheduler.task_mut().account = limit.account;
            // What the slice has used so far is not charged to it, and the next one is to be no longer than it allows.
            self.end_slice_here();
        }
        self.scheduler.task_mut().extra_mut().limits.push(limit);
        if let Some(time) = time {
            self.scheduler.timers.push(now.saturating_add(time), index, Due::Limit(number));
        }
        if ticks == Some(0) {
            self.expire(index, number, self.world.known.budget_exhausted);
        }
        true
    }

    /// Closes the innermost limit of the running task, because its entry was popped.
    pub(crate) fn close_limit(&mut self) {
        let limit = self.scheduler.task_mut().extra.as_mut().and_then(|extra| extra.limits.pop());
        let Some(limit) = limit else { return };
        if let Some(account) = self.scheduler.accounts.get_mut(limit.account) {
            // Tasks that were made inside and have not had their turn since it was spent are still to end.
            account.status = if account.left > 0 { Status::Closed } else { Status::Tasks };
            // The task never ceased to be a user of the account above.
            let parent = account.parent;
            self.scheduler.task_mut().account = parent;
            self.scheduler.accounts.leave(limit.account);
        }
    }

    /// Charges ticks to an account and those above it.
    pub(crate) fn charge_account(&mut self, id: AccountId, ticks: u64) {
        let mut id = id;
        while let Some(account) = self.scheduler.accounts.get_mut(id) {
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
        let mut id = self.scheduler.task().account;
        while let Some(account) = self.scheduler.accounts.get(id) {
            if account.left <= 0 {
                match account.status {
                    Status::Tasks => return true,
                    Status::Form(index, _) if index != self.scheduler.turn.index => return true,
                    _ => {}
                }
            }
            id = account.parent;
        }
        false
    }

    /// Notes that a limit has expired, if it is still open.
    pub(crate) fn expire(&mut self, index: u32, number: u64, cause: Value) {
        let is_running = index == self.scheduler.turn.index && self.scheduler.running.is_some();
        let task = if is_running {
            self.scheduler.running.as_deref_mut()
        } else {
            self.scheduler.tasks.at_mut(index)
        };
        let Some(task) = task else { return };
        let limits = task.extra.as_mut().map_or(&mut [][..], |extra| &mut extra.limits[..]);
        let Some(limit) = limits.iter_mut().find(|limit| limit.number == number) else { return };
        limit.expired = limit.expired.or(Some(cause));
        self.call_attention(index);
    }

    /// Has a task looked after before it goes on, whatever it does: one that is blocked becomes runnable.
    pub(crate) fn call_attention(&mut self, index: u32) {
        if index == self.scheduler.turn.index
            && let Some(task) = self.scheduler.running.as_deref_mut()
        {
            task.flags.set_attention(true);
            self.end_slice_here();
            return;
        }
        let Some(task) = self.scheduler.tasks.at_mut(index) else { return };
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
        let is_running = index == self.scheduler.turn.index && self.scheduler.running.is_some();
        let task = if is_running {
            self.scheduler.running.as_deref_mut()
        } else {
            self.scheduler.tasks.at_mut(index)
        };
        if let Some(task) = task {
            task.extra_mut().interrupts.push(guard);
            self.call_attention(index);
        }
    }

    /// Sees to what has been noted of the running task. What has to wait for the end of a cleanup, or of a critical
    /// section, stays noted. Gives a function that is to be called where the task stands.
    pub(crate) fn see_to_running_task(&mut self) -> Option<Value> {
        if self.scheduler.task().account != AccountId::NONE && self.is_spent() {
            self.scheduler.task_mut().flags.set_attention(true);
        }
        if !self.scheduler.task().flags.attention() || self.scheduler.task().critical > 0 {
            return None;
        }
        let cleanup = self.scheduler.task().control.get().and_then(Control::innermost_cleanup);
        if cleanup.is_some() && self.cut_off_cleanup() {
            return None;
        }
        let mut waits = false;
        if self.scheduler.task().flags.abort_pending() || self.is_spent() {
            if cleanup.is_none() {
                let end = if self.scheduler.task().flags.abort_pending() { End::Aborted } else { End::Spent };
                self.end_running_task(end);
                return None;
            }
            waits = true;
        }
        let limits = self.scheduler.task().extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
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
        let has_more = self.scheduler.task().extra.as_ref().is_some_and(|extra| !extra.interrupts.is_empty());
        self.scheduler.task_mut().flags.set_attention(waits || has_more);
        interrupt
    }

    /// Begins to end the running task.
    fn end_running_task(&mut self, end: End) {
        self.cancel_wait();
        let task = self.scheduler.task_mut();
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
        let task = self.scheduler.task_mut();
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
        let task = self.scheduler.task();
        let interrupts = task.extra.as_ref().map_or(&[][..], |extra| &extra.interrupts[..]);
        if interrupts.is_empty() || task.control.is_unwinding() {
            return None;
        }
        let may = |&guard: &Value| {
            let height = self.slot(guard, guard::HEIGHT).as_index().unwrap_or(0);
            cleanup.is_none_or(|cleanup| cleanup < height)
        };
        let position = interrupts.iter().position(may)?;
        let guard = self.scheduler.task_mut().extra_mut().interrupts.remove(position);
        if self.slot(guard, guard::IS_OPEN).is_nil() {
            return None;
        }
        self.set_slot(guard, guard::IS_OPEN, Value::NIL);
        Some(self.slot(guard, guard::FUNCTION))
    }

    /// Gives each cleanup that runs in the running task, and has none, an allowance.
    fn allow_cleanups(&mut self) {
        let time = self.time().saturating_add(self.config.cleanup_time);
        let ticks = self.scheduler.task().ticks.saturating_add(self.config.cleanup_ticks);
        let mut gives = false;
        for running in &mut self.scheduler.task_mut().control.running {
            if running.allowance.is_none() {
                running.allowance = Some(Allowance { ticks, time });
                gives = true;
            }
        }
        if gives {
            self.scheduler.timers.push(time, self.scheduler.turn.index, Due::Cleanup);
        }
    }

    /// The allowance of a cleanup that an abort or an expired limit meets.
    pub(crate) fn new_allowance(&mut self) -> Allowance {
        let time = self.time().saturating_add(self.config.cleanup_time);
        self.scheduler.timers.push(time, self.scheduler.turn.index, Due::Cleanup);
        // The ticks of the slice under way are not counted yet, and come on top.
        Allowance { ticks: self.scheduler.task().ticks.saturating_add(self.config.cleanup_ticks), time }
    }

    /// Ticks that the innermost cleanup of the running task may still use.
    pub(crate) fn cleanup_ticks_left(&self) -> u64 {
        let task = self.scheduler.task();
        let Some(control) = task.control.get() else { return u64::MAX };
        let allowances = control.running.iter().filter_map(|running| running.allowance);
        allowances.map(|allowance| allowance.ticks.saturating_sub(task.ticks)).min().unwrap_or(u64::MAX)
    }

    /// Begins to leave the outermost cleanup of the running task that has outrun its allowance. Whether there is one.
    fn cut_off_cleanup(&mut self) -> bool {
        let now = self.time();
        let wait = self.scheduler.task().wait;
        let awaits_child = wait.is_true() && self.is_for_child(wait);
        let task = self.scheduler.task();
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
            let index = self.scheduler.turn.index;
            self.scheduler.timers.push(now.saturating_add(1_000_000_000), index, Due::Cleanup);
        }
        let Some(position) = position else { return false };
        let Some(entry) = self.scheduler.task().control.cleanup_entry(position) else { return false };
        self.cancel_wait();
        let is_under_way =
            self.scheduler.task().control.unwinding.as_ref().is_some_and(
                |unwinding| matches!(unwinding.target, Target::Cleanup(index) if index <= entry),
            );
        if !is_under_way {
            let unwinding = Unwinding { target: Target::Cleanup(entry), values: Vec::new() };
            self.scheduler.task_mut().control.unwinding = Some(unwinding);
            let name = self.task_label(self.scheduler.task().object);
            self.outside.complain(&format!("A cleanup of {name} takes too long and is left.\n"));
        }
        true
    }

    /// What unwinds on when the entry of a cleanup that was cut off has been popped.
    pub(crate) fn after_cut_off(&mut self, interrupted: Option<Unwinding>) -> Option<Unwinding> {
        if interrupted.is_some() {
            return interrupted;
        }
        let control = &mut self.scheduler.task_mut().control;
        // It followed a form that had returned. What made it end is for the whole task or for a form further out; with a
        // cleanup around it that one is what ends.
        if let Some(entry) = control.innermost_cleanup() {
            return Some(Unwinding { target: Target::Cleanup(entry), values: Vec::new() });
        }
        let limits = self.scheduler.task().extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
        if !self.scheduler.task().flags.abort_pending()
            && let Some(limit) = limits.iter().find(|limit| limit.expired.is_some())
        {
            let (entry, cause) = (limit.entry as usize, limit.expired.unwrap_or(Value::NIL));
            return Some(Unwinding { target: Target::Limit(entry), values: vec![cause] });
        }
        let end = if self.scheduler.task().flags.abort_pending() { End::Aborted } else { End::Spent };
        let task = self.scheduler.task_mut();
        task.flags.set_abort_pending(false);
        task.flags.set_urgent(true);
        Some(Unwinding { target: Target::Root(end), values: Vec::new() })
    }
}
