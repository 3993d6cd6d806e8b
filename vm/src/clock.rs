//! Time: when the clock is read, what is due then, and sleeping while nothing can run.
//!
//! Virtual time stands still while tasks run. It moves when all of them wait, to the first time for which one does, and when
//! so many ticks have run that something else must be meant to happen.

use crate::task::{Task, TaskState};
use crate::timer::Due;
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
        if self.timers.first().is_none() {
            return;
        }
        if self.more_is_due {
            return self.fire_timers();
        }
        if self.host.is_virtual() {
            if self.spent.saturating_sub(self.moved_at) < VIRTUAL_TICKS {
                return;
            }
            let Some(first) = self.first_timer() else { return };
            let now = self.host.monotonic();
            self.host.advance(first.saturating_sub(now));
        } else if self.spent.saturating_sub(self.looked_at) < CLOCK_TICKS {
            return;
        }
        self.looked_at = self.spent;
        self.fire_timers();
    }

    /// Does what is due, or as much of it as may be done at once.
    fn fire_timers(&mut self) {
        let now = self.time();
        let mut left = AT_ONCE;
        while left > 0
            && let Some((index, due)) = self.timers.take_due(now)
        {
            left -= 1;
            match due {
                Due::Wait(serial) => {
                    if self.tasks.at(index).is_some_and(|task| is_waiting(task, serial)) {
                        self.make_runnable(index, false);
                    }
                }
                Due::Limit(number) => self.expire(index, number, self.world.known.timeout),
                Due::Cleanup => {
                    let task = self.tasks.at(index);
                    if task
                        .and_then(|task| task.control.get())
                        .is_some_and(|control| !control.running.is_empty())
                    {
                        self.call_attention(index);
                    }
                }
            }
        }
        self.more_is_due = left == 0;
        self.moved_at = self.spent;
        if self.timers.wants_sweep() {
            self.sweep_timers();
        }
    }

    /// The time of the first timer that is still of use.
    fn first_timer(&mut self) -> Option<u64> {
        while let Some((index, due)) = self.timers.peek()
            && !is_wanted(self.tasks.at(index), due)
        {
            self.timers.take_first();
        }
        self.timers.first()
    }

    fn sweep_timers(&mut self) {
        let tasks = &self.tasks;
        self.timers.sweep(|index, due| is_wanted(tasks.at(index), due));
    }

    /// Sleeps until something is due or comes from outside. False if nothing ever will.
    pub(crate) fn idle(&mut self) -> bool {
        self.flush_output();
        let deadline = self.first_timer();
        let for_input = !self.readers.is_empty();
        if deadline.is_none() && !for_input {
            return false;
        }
        self.host.wait(deadline, for_input);
        if for_input {
            for id in std::mem::take(&mut self.readers) {
                if self.tasks.get(id).is_some_and(|task| task.state == TaskState::Reading) {
                    self.make_runnable(id.index, false);
                }
            }
        }
        self.looked_at = self.spent;
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
            task.extra.as_ref().is_some_and(|extra| extra.limits.iter().any(|limit| limit.number() == number))
        }
        Due::Cleanup => task.control.get().is_some_and(|control| !control.running.is_empty()),
    }
}
