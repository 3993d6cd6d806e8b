//! Time: when the clock is read, what is due then, and sleeping while nothing can run.
//!
//! Virtual time stands still while tasks run. It moves when all of them wait, to the first time for which one does, and when
//! so many ticks have run that something else must be meant to happen.

use crate::schedule::Due;
use crate::task::{Task, TaskState};
use crate::vm::Vm;

/// Ticks between two looks at the clock while tasks are running.
const CLOCK_TICKS: u64 = 2000;
/// Ticks after which virtual time moves although tasks are running.
const VIRTUAL_TICKS: u64 = 10_000_000;
/// Timers that are seen to in one step; between two steps tasks have their turns.
const AT_ONCE: usize = 1000;

impl Vm {
    /// Reads the clock if it is time to, and does what is due.
    pub(crate) fn look_at_clock(&mut self) {
        if self.scheduler.timers.first().is_none() {
            return;
        }
        if self.scheduler.clock.more_is_due {
            return self.fire_timers();
        }
        if self.outside.host.is_virtual() {
            if self.scheduler.spent.saturating_sub(self.scheduler.clock.moved_at) < VIRTUAL_TICKS {
                return;
            }
            let Some(first) = self.first_timer() else { return };
            let now = self.outside.host.monotonic();
            self.outside.host.advance(first.saturating_sub(now));
        } else if self.scheduler.spent.saturating_sub(self.scheduler.clock.looked_at) < CLOCK_TICKS {
            return;
        }
        self.scheduler.clock.looked_at = self.scheduler.spent;
        self.fire_timers();
    }

    /// Does what is due, or as much of it as may be done at once.
    fn fire_timers(&mut self) {
        let now = self.time();
        let mut left = AT_ONCE;
        while left > 0
            && let Some((index, due)) = self.scheduler.timers.take_due(now)
        {
            left -= 1;
            match due {
                Due::Wait(serial) => {
                    if self.scheduler.tasks.at(index).is_some_and(|task| is_waiting(task, serial)) {
                        self.make_runnable(index, false);
                    }
                }
                Due::Limit(number) => self.expire(index, number, self.world.known.timeout),
                Due::Cleanup => {
                    let task = self.scheduler.tasks.at(index);
                    if task
                        .and_then(|task| task.control.get())
                        .is_some_and(|control| !control.running.is_empty())
                    {
                        self.call_attention(index);
                    }
                }
            }
        }
        self.scheduler.clock.more_is_due = left == 0;
        self.scheduler.clock.moved_at = self.scheduler.spent;
        if self.scheduler.timers.wants_sweep() {
            self.sweep_timers();
        }
    }

    /// The time of the first timer that is still of use.
    fn first_timer(&mut self) -> Option<u64> {
        while let Some((index, due)) = self.scheduler.timers.peek()
            && !is_wanted(self.scheduler.tasks.at(index), due)
        {
            self.scheduler.timers.take_first();
        }
        self.scheduler.timers.first()
    }

    fn sweep_timers(&mut self) {
        let tasks = &self.scheduler.tasks;
        self.scheduler.timers.sweep(|index, due| is_wanted(tasks.at(index), due));
    }

    /// Sleeps until something is due or comes from outside. False if nothing ever will.
    pub(crate) fn idle(&mut self) -> bool {
        self.outside.flush();
        let deadline = self.first_timer();
        let for_input = !self.scheduler.readers.is_empty();
        if deadline.is_none() && !for_input {
            return false;
        }
        self.outside.host.wait(deadline, for_input);
        if for_input {
            for id in std::mem::take(&mut self.scheduler.readers) {
                if self.scheduler.tasks.get(id).is_some_and(|task| task.state == TaskState::Reading) {
                    self.make_runnable(id.index, false);
                }
            }
        }
        self.scheduler.clock.looked_at = self.scheduler.spent;
        self.fire_timers();
        true
    }
}

fn is_waiting(task: &Task, serial: u64) -> bool {
    task.serial == serial && task.state == TaskState::Waiting
}

/// Whether a timer of a task is still of use.
pub(crate) fn is_wanted(task: Option<&Task>, due: Due) -> bool {
    let Some(task) = task else { return false };
    match due {
        Due::Wait(serial) => is_waiting(task, serial),
        Due::Limit(number) => {
            task.extra.as_ref().is_some_and(|extra| extra.limits.iter().any(|limit| limit.number == number))
        }
        Due::Cleanup => task.control.get().is_some_and(|control| !control.running.is_empty()),
    }
}
