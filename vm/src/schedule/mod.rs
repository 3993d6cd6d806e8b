//! The scheduler: all tasks, whose turn it is, and what is to happen at which time.
//!
//! ```text
//! queues    runnable tasks, by priority       choices   which of them, where the order is open
//! timer     what happens at which time        clock     readings of the host's clock
//! account   ticks that may be used together   turn      the turn of the running task
//! allowance what cleanups may use while an abort or an expired limit waits
//! point     places at which a task lets others go first, while schedules are explored
//! portion   the turn that the end of a portion of the run's ticks has fallen into
//! ```
//!
//! Guarantees: a task that has not ended is running, in a run queue, held or parked, and only one of these.
//! Everything here is data with its own operations; what happens to tasks while the machine runs is in `run`.

mod account;
mod allowance;
mod choices;
mod clock;
mod point;
mod portion;
mod queues;
mod stored;
mod timer;
mod turn;

pub(crate) use account::{AccountOwner, Accounts, Amount, Measure};
pub use choices::Choices;
pub(crate) use clock::Clock;
pub use point::Grain;
pub(crate) use point::{AskedFor, Points, SharedUse, UsedPlace};
pub(crate) use portion::{OpenSlice, OpenTurn};
pub(crate) use queues::RunQueues;
pub(crate) use timer::{Due, Timer, Timers};
pub(crate) use turn::{Parking, Turn, TurnEnd};

use esl_heap::stored;
use esl_host::machine::Canary;

use crate::config::Config;
use crate::heap::Heap;
use crate::raise::{Exit, Outcome};
use crate::task::{
    AccountId, LimitNumber, Rest, Serial, Standstill, Task, TaskId, TaskIndex, TaskNumber, TaskState, Tasks,
};
use crate::value::Value;
use crate::wait::{Deliveries, event, input, link};

/// Progress of ending all tasks, which takes several steps where there are many.
#[derive(Clone, Debug)]
pub(crate) struct EndOfAll {
    /// Tasks that were not asked yet, the newest last.
    pub(crate) left: Vec<TaskId>,
}

/// Numbers of tasks and of their turns.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counts {
    /// Tasks that have not ended.
    pub(crate) alive: usize,
    /// Tasks among them that are not daemons.
    pub(crate) foreground: usize,
    /// Tasks made so far.
    pub(crate) made: u64,
    /// Tasks made when all were last asked to end.
    pub(crate) made_at_end: u64,
    /// Turns so far.
    pub(crate) turns: u64,
    /// Turns that came after one of another task.
    pub(crate) switches: u64,
}

/// The scheduler of a machine.
#[derive(Clone)]
pub(crate) struct Scheduler {
    /// The tasks; the record of the running one is in `running`.
    pub(crate) tasks: Tasks,
    /// The runnable tasks.
    pub(crate) queues: RunQueues,
    /// The choices among them.
    pub(crate) choices: Choices,
    /// Times at which waits end, limits expire and cleanups are looked at.
    pub(crate) timers: Timers,
    /// Budgets and quotas of forms and tasks.
    pub(crate) accounts: Accounts,
    /// Signals under delivery, and the tasks held back by them.
    pub(crate) deliveries: Deliveries,
    /// Tasks that wait for input.
    pub(crate) readers: Vec<TaskId>,
    /// Tasks that wait until output has room.
    pub(crate) writers: Vec<TaskId>,
    /// Progress of ending all tasks, while that is under way.
    pub(crate) end_of_all: Option<EndOfAll>,
    /// The event that every signal signals too.
    pub(crate) any_event: Value,
    /// The function with which every task begins.
    pub(crate) starter: Value,
    /// The task with whose failure the run ends; without one, tasks come and go as they like.
    pub(crate) main: Option<TaskId>,
    /// Number of the task that reports call the main task.
    pub(crate) main_number: Option<TaskNumber>,
    /// Numbers of tasks and of turns.
    pub(crate) counts: Counts,
    /// Newest serial number of a task's state.
    pub(crate) serial: Serial,
    /// Readings of the clock.
    pub(crate) clock: Clock,
    /// Ticks used by all tasks together.
    pub(crate) spent: u64,
    /// Number of rounds of the machine: times that it has looked whose turn it is. Never set back.
    pub(crate) rounds: u64,
    /// Whether no task is to run until the outside says so.
    pub(crate) is_paused: bool,
    /// Canary of the turns.
    pub(crate) canary: Canary,
    /// Turn that the end of the last portion has left open.
    pub(crate) open_turn: Option<OpenTurn>,
    /// The running task.
    pub(crate) running: Option<Box<Task>>,
    /// The turn of the running task.
    pub(crate) turn: Turn,
    /// Where tasks stop while schedules are explored.
    pub(crate) points: Points,
}

impl Scheduler {
    /// Creates a scheduler without tasks.
    pub(crate) fn new(seed: u64, clock: Clock, starter: Value, any_event: Value) -> Scheduler {
        Scheduler {
            tasks: Tasks::default(),
            queues: RunQueues::default(),
            choices: Choices::seeded(seed),
            timers: Timers::default(),
            accounts: Accounts::default(),
            deliveries: Deliveries::default(),
            readers: Vec::new(),
            writers: Vec::new(),
            end_of_all: None,
            any_event,
            starter,
            main: None,
            main_number: None,
            counts: Counts::default(),
            serial: Serial::default(),
            clock,
            spent: 0,
            rounds: 0,
            is_paused: false,
            canary: Canary::default(),
            open_turn: None,
            running: None,
            turn: Turn::default(),
            points: Points::default(),
        }
    }

    /// Returns the running task.
    ///
    /// # Panics
    /// If none runs: builtins and instructions are only reached from a task.
    #[inline(always)]
    pub(crate) fn task(&self) -> &Task {
        self.running.as_ref().expect("a builtin is called by a task")
    }

    /// Returns the running task.
    ///
    /// # Panics
    /// If none runs: builtins and instructions are only reached from a task.
    #[inline(always)]
    pub(crate) fn task_mut(&mut self) -> &mut Task {
        self.running.as_mut().expect("a builtin is called by a task")
    }

    /// Returns the standstill of the running task.
    pub(crate) fn standstill(&self) -> &Standstill {
        self.tasks.standstill(self.turn.index)
    }

    /// Returns whether a task is suspended, by an interrupt or at rest.
    pub(crate) fn is_suspended(&self, heap: &Heap, task: &Task) -> bool {
        let index = event::task_index(heap, task.object);
        task.flags.suspended() || index.is_some_and(|index| self.tasks.rest(index) != Rest::None)
    }

    /// Returns the number of the running task, or [`TaskNumber::NONE`].
    pub(crate) fn running_number(&self) -> TaskNumber {
        self.running.as_ref().map_or(TaskNumber::NONE, |task| task.number)
    }

    /// Returns whether the running task has this index.
    #[inline]
    pub(crate) fn is_running(&self, index: TaskIndex) -> bool {
        index == self.turn.index && self.running.is_some()
    }

    /// Returns the task with this index, whether it runs or not.
    pub(crate) fn find(&self, index: TaskIndex) -> Option<&Task> {
        if self.is_running(index) { self.running.as_deref() } else { self.tasks.at(index) }
    }

    /// Returns the task with this index, whether it runs or not.
    pub(crate) fn find_mut(&mut self, index: TaskIndex) -> Option<&mut Task> {
        if self.is_running(index) { self.running.as_deref_mut() } else { self.tasks.at_mut(index) }
    }

    /// Puts a task at the end of its queue, or of the urgent one. Returns whether it was parked. One at rest
    /// stays there; that it was to go on is noted.
    pub(crate) fn make_runnable(&mut self, index: TaskIndex, urgent: bool) -> bool {
        let Some(task) = self.tasks.wake_up(index) else { return false };
        let serial = self.serial.advance();
        let was_parked = std::mem::replace(&mut task.state, TaskState::Runnable) != TaskState::Runnable;
        task.serial = serial;
        let (priority, urgent) = (task.priority, urgent || task.flags.urgent());
        self.queues.push(index, serial, priority, urgent);
        was_parked
    }

    /// Keeps a runnable task from running until all signals are delivered.
    pub(crate) fn hold(&mut self, index: TaskIndex) {
        let serial = self.serial.advance();
        if let Some(task) = self.tasks.at_mut(index) {
            task.serial = serial;
            self.deliveries.held.push((index, serial));
        }
    }

    /// Has an operation on waits of the running task try again once all signals are delivered.
    ///
    /// # Errors
    /// [`Exit::Again`] if signals are under delivery.
    pub(crate) fn wait_for_deliveries(&mut self) -> Result<(), Exit> {
        if self.deliveries.is_empty() || self.running.is_none() {
            return Ok(());
        }
        self.turn.end_with(TurnEnd::Held);
        Err(Exit::Again)
    }

    /// Parks the running task at `wait`; the instruction is done again when it goes on.
    ///
    /// # Errors
    /// Always [`Exit::Park`].
    pub(crate) fn park_at(&mut self, wait: Value, deadline: Option<u64>) -> Outcome {
        let task = self.task_mut();
        task.wait = wait;
        task.has_deadline = deadline.is_some();
        self.turn.parking = Parking::Wait(deadline);
        Err(Exit::Park)
    }

    /// Closes a wait. A signal of an input that it has got, and not handed on, goes back to the input.
    pub(crate) fn close_wait(&mut self, heap: &mut Heap, wait: Value) {
        link::close(heap, &mut self.deliveries, wait);
        if let Some(input) = input::give_back(heap, wait) {
            self.wake_takers(heap, input);
        }
    }

    /// Has the tasks that wait for an input look what it has kept.
    #[cold]
    fn wake_takers(&mut self, heap: &Heap, input: Value) {
        let mut link = link::first(heap, input);
        while link.is_true() {
            let (wait, next) = link::wait_and_next(heap, link);
            if let Some(index) = self.index_of_parked(heap, wait)
                && link::takes(heap, wait)
            {
                self.make_runnable(index, false);
            }
            link = next;
        }
    }

    /// Returns the place of the task that is parked at this wait.
    pub(crate) fn index_of_parked(&self, heap: &Heap, wait: Value) -> Option<TaskIndex> {
        let index = event::task_index(heap, link::owner(heap, wait))?;
        let task = self.tasks.at(index)?;
        (task.state == TaskState::Waiting && task.wait == wait).then_some(index)
    }

    /// Closes the wait at which the running task was parked, because it will not go on there.
    pub(crate) fn cancel_wait(&mut self, heap: &mut Heap) {
        let wait = std::mem::replace(&mut self.task_mut().wait, Value::NIL);
        if wait.is_true() {
            heap.log_if_marking(wait);
            self.close_wait(heap, wait);
        }
    }

    /// Leaves the wait at which the running task was parked. Its signal has come, so it is in no list any
    /// more.
    pub(crate) fn leave_signalled(&mut self, heap: &mut Heap) {
        let wait = std::mem::replace(&mut self.task_mut().wait, Value::NIL);
        heap.log_if_marking(wait);
    }

    /// Returns a number for a new limit.
    pub(crate) fn next_limit(&mut self) -> LimitNumber {
        LimitNumber(self.serial.advance())
    }

    /// Closes the innermost limit of the running task, because its entry was popped.
    pub(crate) fn close_limit(&mut self) {
        let limit = self.task_mut().extra.as_mut().and_then(|extra| extra.limits.pop());
        let Some(limit) = limit else { return };
        if let Some(extra) = &mut self.task_mut().extra {
            // The form of the limit has been left, so its fund is closed.
            extra.fund = extra.fund.filter(|fund| fund.depth != limit.entry as usize + 1);
        }
        if self.accounts.close_form(limit.account) {
            self.task_mut().account = limit.outer;
        }
    }

    /// Returns the account that the running task charges, if there is a task and an account.
    pub(crate) fn running_account(&self) -> AccountId {
        self.running.as_ref().map_or(AccountId::NONE, |task| task.account)
    }

    /// Returns whether the running task has to end because an account that it charges is spent.
    pub(crate) fn is_task_spent(&self) -> bool {
        self.accounts.is_spent_for(self.task().account, self.turn.index)
    }

    /// Returns whether the running task has to end because it charges a quota that is spent.
    pub(crate) fn is_task_over_quota(&self) -> bool {
        self.accounts.is_quota_spent_for(self.task().account, self.turn.index)
    }

    /// Returns whether the budget of the run is spent.
    pub(crate) fn is_budget_spent(&self, config: &Config) -> bool {
        config.budget.is_some_and(|budget| self.spent >= budget)
    }

    /// Notes that the turn of the task that ran last goes on with the next portion: with the rest of this
    /// slice, or with another one.
    pub(crate) fn leave_open(&mut self, slice: Option<OpenSlice>) {
        self.open_turn = self.tasks.id_at(self.turn.index).map(|task| OpenTurn { task, slice });
    }

    /// Returns the length of the next slice of the task that is to run: the whole turn, or what is left of
    /// it. A critical section goes beyond.
    #[inline(always)]
    pub(crate) fn slice_length(&mut self, task: &mut Task, config: &Config) -> u64 {
        let mut slice = match self.turn.left {
            None => *self.turn.left.insert(u64::from(self.choices.slice(config.slice))),
            Some(0) => u64::from(config.slice),
            Some(left) => left,
        };
        if let Some(budget) = config.budget {
            slice = slice.min(budget.saturating_sub(self.spent));
        }
        if task.account != AccountId::NONE {
            slice = slice.min(self.accounts.left(task.account));
        }
        if let Some(left) = task.cleanup_ticks_left() {
            slice = slice.min(left);
            if left == 0 {
                task.flags.set_attention(true);
            }
        }
        if task.critical > 0 {
            slice = slice.min(self.turn.critical_left.max(1) as u64);
        }
        slice.max(1)
    }

    /// Forgets the tasks that no longer wait for a standard stream: a read or a write that was aborted, or
    /// whose time was up, would keep the run waiting for the stream.
    pub(crate) fn forget_left_streams(&mut self) {
        let tasks = &self.tasks;
        let is_in = |id: TaskId, state| tasks.get(id).is_some_and(|task| task.state == state);
        self.readers.retain(|&id| is_in(id, TaskState::Reading));
        self.writers.retain(|&id| is_in(id, TaskState::Writing));
        self.readers.dedup();
        self.writers.dedup();
    }

    /// Sets a timer. One whose time has come fires when the turn ends, also where time stands still while
    /// tasks run.
    pub(crate) fn set_timer(&mut self, time: u64, index: TaskIndex, due: Due) {
        self.clock.more_is_due |= time <= self.clock.now;
        self.timers.push(time, index, due);
    }

    /// Returns the time of the first timer that is still wanted, and drops those before it.
    pub(crate) fn first_timer(&mut self) -> Option<u64> {
        while let Some(timer) = self.timers.first()
            && !self.is_wanted(timer)
        {
            self.timers.take_first();
        }
        self.timers.first().map(|timer| timer.time)
    }

    /// Drops the timers that are no longer wanted.
    pub(crate) fn sweep_timers(&mut self) {
        let tasks = &self.tasks;
        self.timers.sweep(|timer| is_wanted(tasks, timer));
    }

    /// Returns whether a timer is still wanted, while no task runs.
    pub(crate) fn is_wanted(&self, timer: Timer) -> bool {
        is_wanted(&self.tasks, timer)
    }
}

fn is_wanted(tasks: &Tasks, timer: Timer) -> bool {
    let Some(task) = tasks.at(timer.index) else { return false };
    match timer.due {
        Due::Wait(serial) => task.is_waiting_since(serial),
        Due::Limit(number) => {
            let limits = task.extra.as_ref().map_or(&[][..], |extra| &extra.limits[..]);
            limits.iter().any(|limit| limit.number == number)
        }
        Due::Cleanup => task.runs_cleanup(),
    }
}

stored! { EndOfAll { left } }
stored! { Counts { alive, foreground, made, made_at_end, turns, switches } }
