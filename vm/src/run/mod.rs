//! Running tasks: everything that happens to them while the machine runs.
//!
//! ```text
//! spawn     making a task             signal    waking the waiters of an event
//! turn      its turns, slice by slice wake      making a task runnable
//! pending   aborts, expired limits    limit     opening limits, and their expiry
//!           and interrupts, delivered timers    time, and sleeping while nothing can run
//! finish    its end                   abort     asking for it
//! call      calling a function from   arrival   taking in what has come
//!           outside, and its result             into the inbox
//! news      news of operations        cleanup   allowances of cleanups, and cutting off
//! question  calls from outside,       ending    the end of a run, wherever it stands
//!           and what is asked of tasks rest     suspended tasks that stand where they wait
//! ```
//!
//! A runnable task has a slice of ticks and goes to the end of its queue; `schedule` says whose turn it is.
//! The machine's own budget is counted to the tick: a run that is given the same budget ends at the same
//! place. When no task is runnable the machine sleeps in the host until the first timer, or until something
//! comes from outside.

mod abort;
mod arrival;
mod call;
mod cleanup;
mod ending;
mod finish;
mod limit;
mod news;
mod pending;
mod question;
mod rest;
mod signal;
mod spawn;
mod timers;
mod turn;
mod wake;

pub(crate) use abort::abort_others;
pub(crate) use arrival::{take_in, take_in_deferred, wait_in_host};
pub use call::{CallError, FailureArguments};
pub(crate) use limit::{admit, expire_limit, go_on, open_limit, stand_still};
pub(crate) use pending::interrupt_by;
pub(crate) use rest::{begin_rest, can_rest, end_rest, resume_from_rest};
pub(crate) use signal::{deliver_some, show_kept, signal};
pub(crate) use spawn::{SpawnOptions, make_task};
pub(crate) use timers::idle;
pub(crate) use turn::{give_turn, go_on_with_turn};

use esl_host::{Awaited, Host, ReplayState, RunCheck};

use abort::abort_more;
use news::expects_news;
use timers::{go_on_in_time, look_at_clock};

use crate::task::{TaskId, TaskIndex, TaskState};
use crate::vm::Vm;

/// Why a run came back to the embedder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunOutcome {
    /// The tasks to be run have ended: all of them, or the one that was named.
    Done,
    /// The tasks that are left all wait for what cannot come.
    Waiting,
    /// The budget of the run is spent.
    BudgetSpent,
    /// The ticks that this call was given are used up.
    TicksUsed,
    /// [`Incoming::Stop`](esl_host::Incoming::Stop) has come into the inbox, or an interrupt that cuts the
    /// end of the run short.
    Stopped,
}

impl Vm {
    /// Runs tasks in turn until all have ended or wait for what cannot come, the budget of the run is spent,
    /// or `ticks` are used up. Into which portions its ticks are divided changes nothing in a run.
    pub fn run(&mut self, ticks: u64) -> RunOutcome {
        run_tasks(self, None, ticks, true)
    }

    /// Runs tasks in turn, as [`Vm::run`] does, but only until the named one has ended.
    pub fn run_until(&mut self, id: Option<TaskId>, ticks: u64) -> RunOutcome {
        run_tasks(self, id, ticks, true)
    }

    /// Runs tasks in turn, as [`Vm::run`] does, but comes back instead of waiting when all of them wait.
    pub fn run_ready(&mut self, ticks: u64) -> RunOutcome {
        run_tasks(self, None, ticks, false)
    }

    /// Runs tasks in turn, as [`Vm::run_ready`] does, those included whose time has come. Virtual time goes
    /// on when all tasks wait.
    pub fn run_due(&mut self, ticks: u64) -> RunOutcome {
        let end = self.scheduler.spent.saturating_add(ticks);
        loop {
            let outcome = run_tasks(self, None, end.saturating_sub(self.scheduler.spent), false);
            if outcome != RunOutcome::Waiting || !go_on_in_time(self) {
                return outcome;
            }
        }
    }

    /// Returns whether something can still come for tasks that all wait: a time, input, or news from outside.
    /// To a replay only that comes which was recorded.
    pub fn expects_something(&mut self) -> bool {
        let scheduler = &mut self.scheduler;
        match self.outside.host.replay_state() {
            ReplayState::Live => {}
            // The recorded end of a pause rings in each round until it comes.
            ReplayState::Replays if !scheduler.is_paused || self.outside.inbox.is_rung() => {}
            ReplayState::Replays | ReplayState::IsOver => return false,
        }
        scheduler.forget_left_streams();
        scheduler.first_timer().is_some()
            || !scheduler.readers.is_empty()
            || !scheduler.writers.is_empty()
            || expects_news(self)
    }

    /// Returns whether the run is the replay of another one, which waits for nothing.
    pub fn replays(&self) -> bool {
        self.outside.host.replay_state() == ReplayState::Replays
    }

    /// Sets a function that is called between two rounds, when no task runs. It may store the state of the
    /// machine, and must not change it. It is not called while the machine waits for the end of a task that
    /// was named, or of all at the end of a run: its next steps then are not part of its state.
    pub fn on_round(&mut self, function: impl FnMut(&mut Vm) + Send + 'static) {
        self.between_rounds = Some(Box::new(function));
    }

    /// Returns how far the run is.
    pub fn check(&self) -> RunCheck {
        let mut canary = self.scheduler.canary;
        canary.mix(self.outside.host.canary().value());
        RunCheck { round: self.scheduler.rounds, ticks: self.scheduler.spent, canary: canary.value() }
    }

    /// Returns the time of the program's clock when it was read last, in nanoseconds.
    pub fn last_time(&self) -> u64 {
        self.scheduler.clock.now
    }

    /// Returns when a task goes on by itself, by the program's clock in nanoseconds: 0 if one can now, `None`
    /// if all wait for something from outside. Asks nothing of the host.
    pub fn next_turn(&mut self) -> Option<u64> {
        let scheduler = &mut self.scheduler;
        let can_go_on = !scheduler.queues.are_empty()
            || !scheduler.deliveries.is_empty()
            || scheduler.open_turn.is_some();
        if can_go_on { Some(0) } else { scheduler.first_timer() }
    }

    /// Returns whether the program has ties to this process that another one cannot take up: things of the
    /// host, senders of signals, streams that it waits for, output under way.
    pub fn is_tied_to_process(&self) -> bool {
        let Vm { names, outside, scheduler, embedder, .. } = self;
        names.opaques.holds_things()
            || outside.senders > 0
            || outside.console.is_behind()
            || !scheduler.readers.is_empty()
            || !scheduler.writers.is_empty()
            || embedder.first.is_some()
    }

    /// Returns the time that is left to the first timer, in nanoseconds.
    pub fn time_to_next_timer(&mut self) -> Option<u64> {
        let first = self.scheduler.first_timer()?;
        let now = self.scheduler.clock.read(&mut self.outside.host);
        Some(first.saturating_sub(now))
    }
}

/// Rounds after which the host is told how far the run is.
const CHECK_ROUNDS: u64 = 4096;

/// Tells the host how far the run is.
#[cold]
fn tell_how_far(vm: &mut Vm) {
    let check = vm.check();
    vm.outside.host.check(check);
}

/// Calls the embedder's function, which finds the state of the machine between two turns.
#[cold]
fn call_between_rounds(vm: &mut Vm) {
    let Some(mut function) = vm.between_rounds.take() else { return };
    function(vm);
    vm.between_rounds.get_or_insert(function);
}

/// Runs tasks in turn, at most for `ticks`, until the named one has ended. `may_wait` says whether to sleep
/// while all of them wait.
fn run_tasks(vm: &mut Vm, id: Option<TaskId>, ticks: u64, may_wait: bool) -> RunOutcome {
    let end = vm.scheduler.spent.saturating_add(ticks);
    let limit = vm.config.budget.map_or(end, |budget| budget.min(end));
    loop {
        if let Some(id) = id
            && vm.scheduler.tasks.get(id).is_none_or(|task| task.state == TaskState::Ended)
        {
            return RunOutcome::Done;
        }
        if vm.scheduler.spent >= limit {
            let is_budget = vm.scheduler.is_budget_spent(&vm.config);
            return if is_budget { RunOutcome::BudgetSpent } else { RunOutcome::TicksUsed };
        }
        if let Some(turn) = vm.scheduler.open_turn.take() {
            go_on_with_turn(vm, turn, end);
            continue;
        }
        if vm.between_rounds.is_some() && id.is_none() {
            call_between_rounds(vm);
        }
        vm.scheduler.rounds += 1;
        if vm.scheduler.rounds.is_multiple_of(CHECK_ROUNDS) {
            tell_how_far(vm);
        }
        if vm.embedder.first.is_some() {
            take_in_deferred(vm);
        }
        if vm.outside.inbox.is_rung() && take_in(vm) {
            return RunOutcome::Stopped;
        }
        if vm.scheduler.is_paused {
            if !may_wait {
                return RunOutcome::Waiting;
            }
            vm.outside.pass_on();
            wait_in_host(vm, None, Awaited { news: true, ..Awaited::default() });
            continue;
        }
        look_at_clock(vm);
        if !vm.scheduler.deliveries.is_empty() {
            deliver_some(vm);
        }
        let scheduler = &mut vm.scheduler;
        let frees = scheduler.tasks.free_some();
        let next = match scheduler.end_of_all {
            None => scheduler.queues.next(&scheduler.tasks, &mut scheduler.choices),
            Some(_) => next_while_all_end(vm),
        };
        let scheduler = &vm.scheduler;
        match next {
            Some(index) => give_turn(vm, index, end),
            None => {
                if frees || !scheduler.deliveries.is_empty() || scheduler.end_of_all.is_some() {
                    continue;
                }
                if scheduler.counts.alive == 0 {
                    return RunOutcome::Done;
                }
                if !may_wait || !idle(vm) {
                    return RunOutcome::Waiting;
                }
            }
        }
    }
}

/// Asks more tasks to end, and returns the one whose turn it is among those that do.
#[cold]
fn next_while_all_end(vm: &mut Vm) -> Option<TaskIndex> {
    abort_more(vm);
    vm.scheduler.queues.next_urgent(&vm.scheduler.tasks)
}
