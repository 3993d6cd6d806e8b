//! The scheduler: all tasks, whose turn it is, and what is to happen at which time.
//!
//! ```text
//! queues    runnable tasks, by priority       choices   which of them, where the order is open
//! timer     what is due at which time         clock     when the host's clock was read
//! account   ticks that may be used together   turn      the turn of the running task
//! ```
//!
//! Guarantees: a task that has not ended is running, in a run queue, held, or parked, and only one of these. Everything here is data
//! with its own operations; what happens to tasks while the machine runs is in `run`.

mod account;
mod choices;
mod clock;
mod queues;
mod timer;
mod turn;

pub(crate) use account::{Accounts, Status};
pub use choices::Choices;
pub(crate) use clock::Clock;
pub(crate) use queues::RunQueues;
pub(crate) use timer::{Due, Timers};
pub(crate) use turn::{Parking, Turn};

use std::collections::VecDeque;

use crate::task::{Task, TaskId, Tasks};
use crate::value::Value;
use crate::wait::Delivery;

/// Progress of ending all tasks, which takes several steps where there are many.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EndOfAll {
    /// Place of the next task to be asked.
    pub(crate) place: usize,
    /// Number of the newest task that is to end: those made afterwards are not asked.
    pub(crate) made: u64,
    /// Number of the task that wants it, which is not asked, or 0.
    pub(crate) except: u64,
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
    /// Turns so far.
    pub(crate) turns: u64,
    /// Turns that came after one of another task.
    pub(crate) switches: u64,
}

/// The scheduler of a machine.
pub(crate) struct Scheduler {
    /// The tasks; the record of the running one is in `running`.
    pub(crate) tasks: Tasks,
    /// The runnable tasks.
    pub(crate) queues: RunQueues,
    /// The choices among them.
    pub(crate) choices: Choices,
    /// Waits, limits and cleanups with a time.
    pub(crate) timers: Timers,
    /// Budgets of forms and tasks.
    pub(crate) accounts: Accounts,
    /// Signals under delivery, in the order in which they were given.
    pub(crate) deliveries: VecDeque<Delivery>,
    /// Tasks held back until all signals are delivered, each with its serial number.
    pub(crate) held: Vec<(u32, u64)>,
    /// Tasks that wait for input.
    pub(crate) readers: Vec<TaskId>,
    /// Progress of ending all tasks, while that is under way.
    pub(crate) end_of_all: Option<EndOfAll>,
    /// The event that every signal signals too.
    pub(crate) any_event: Value,
    /// The function with which every task begins.
    pub(crate) starter: Value,
    /// The task with whose failure the run ends; without one, tasks come and go as they like.
    pub(crate) main: Option<TaskId>,
    /// Number of the task that reports call the main task.
    pub(crate) main_number: Option<u64>,
    /// Numbers of tasks and of turns.
    pub(crate) counts: Counts,
    /// Newest serial number of a task's state.
    pub(crate) serial: u64,
    /// Readings of the clock.
    pub(crate) clock: Clock,
    /// Ticks used by all tasks together.
    pub(crate) spent: u64,
    /// The running task.
    pub(crate) running: Option<Box<Task>>,
    /// The turn of the running task.
    pub(crate) turn: Turn,
}

impl Scheduler {
    /// Creates a scheduler without tasks.
    pub(crate) fn new(seed: u64, starter: Value, any_event: Value) -> Scheduler {
        Scheduler {
            tasks: Tasks::default(),
            queues: RunQueues::default(),
            choices: Choices::seeded(seed),
            timers: Timers::default(),
            accounts: Accounts::default(),
            deliveries: VecDeque::new(),
            held: Vec::new(),
            readers: Vec::new(),
            end_of_all: None,
            any_event,
            starter,
            main: None,
            main_number: None,
            counts: Counts::default(),
            serial: 0,
            clock: Clock::default(),
            spent: 0,
            running: None,
            turn: Turn::default(),
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

    /// Returns a number that no state of a task had before.
    #[inline]
    pub(crate) fn next_serial(&mut self) -> u64 {
        self.serial += 1;
        self.serial
    }
}
