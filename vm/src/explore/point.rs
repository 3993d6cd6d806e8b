//! Running from point to point.

use std::sync::Arc;

use smallvec::SmallVec;

use super::check::check_state;
use super::left_out::{LeftOut, TickPlace, first_alone};
use super::step::Runnable;
use super::tasks::{depends_on_place, ends, runnable_tasks, time_may_pass, watch_variables};
use super::{Settings, TimerGrain};
use crate::run::{self, RunOutcome};
use crate::schedule::Grain;
use crate::task::{Task, TaskId, TaskIndex, TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;

/// A run from point to point: what has to be known of it beside the state of the machine.
#[derive(Clone, Debug)]
pub(super) struct PointRun {
    /// The task that ran last.
    last: TaskNumber,
    /// Variable with the event for which the task waits that checks each state.
    checks: Value,
    /// Variable with the bits of the conditions that are still to become true.
    pending: Value,
    /// Whether the machine stands at a point, where the next choice is made.
    is_at_point: bool,
    /// Whether timers may fire while tasks can run.
    has_timers: bool,
    /// With [`Grain::Variables`], what is to be known of the way since the last point.
    unseen: Option<UnseenWay>,
    /// The points that were left out since the last one.
    passed: PassedPoints,
    /// Whether the task that ran last stands at a tick at which only requests to it matter.
    awaits_requests: bool,
    /// Number of tasks that may still be asked to end.
    aborts: u32,
    /// Whether the machine stands at the point of the last choice, which has let no task go on.
    stays: bool,
    /// The place at which it was when it was chosen.
    chosen_at: Option<TickPlace>,
}

/// Points with a choice that were left out.
#[derive(Clone, Debug, Default)]
pub(super) struct PassedPoints {
    /// The choice at each.
    pub(super) choices: Vec<u32>,
    /// The tasks that went on there first, when they had begun or were woken.
    pub(super) tasks: SmallVec<[TaskNumber; 4]>,
}

impl PassedPoints {
    fn clear(&mut self) {
        self.choices.clear();
        self.tasks.clear();
    }
}

/// The way in which a run goes on at a tick.
enum AtTick {
    /// Others may go.
    Stop,
    /// Those may go that make requests.
    StopForRequests,
    /// This task goes on, the one that ran last.
    GoOn(TaskIndex),
}

/// Most ticks that are left out one after the other: a task that goes round for ever has to come to a point.
const MOST_LEFT_OUT: u32 = 200;

/// The way of a task since it last stood at a point.
#[derive(Clone, Copy, Debug)]
struct UnseenWay {
    /// Number of symbols whose variables are watched.
    watched: usize,
    /// Ticks since then, or since a point that was left out.
    ticks: u32,
    /// Ticks after which there is a point in any case.
    most: u32,
    /// Number of ticks that were left out since the last point.
    left_out: u32,
    /// The tick after the last action that others can see, if that was left out.
    last_action: Option<TickPlace>,
    /// The output and the calls of the outside when that was left out, see [`outside`].
    outside: (u64, u64),
}

impl UnseenWay {
    /// Returns whether the last turn has done something before which others had no choice to go.
    fn is_sudden(&self, vm: &Vm) -> bool {
        vm.scheduler.points.is_sudden || self.outside != outside(vm)
    }
}

/// Returns what tells whether something was written, if states differ by it, or called outside.
fn outside(vm: &Vm) -> (u64, u64) {
    (vm.outside.console.noted(), vm.outside.calls)
}

/// Says which of the tasks continues at a point, or `None` to give up the run.
pub(super) type Choose<'a> = dyn FnMut(&mut Vm, PointRun, Runnable<'_>) -> Option<u32> + 'a;

impl PointRun {
    /// Begins to run a program from its beginning.
    pub(super) fn begin(vm: &mut Vm, settings: &Settings) -> PointRun {
        let mut variable = |name| vm.names.intern_esl(&mut vm.heap, name).unwrap_or(Value::NIL);
        let (checks, pending) = (variable("*%EXPLORED-STATE*"), variable("*%PENDING*"));
        PointRun {
            last: TaskNumber(u64::MAX),
            checks,
            pending,
            is_at_point: false,
            has_timers: settings.timers == TimerGrain::Any,
            unseen: (settings.grain == Grain::Variables).then_some(UnseenWay {
                watched: 0,
                ticks: 0,
                most: settings.turn,
                left_out: 0,
                last_action: None,
                outside: (0, 0),
            }),
            passed: PassedPoints::default(),
            awaits_requests: false,
            aborts: settings.aborts,
            stays: false,
            chosen_at: None,
        }
    }

    /// Returns the points with a choice that were left out since the last one.
    pub(super) fn passed(&self) -> &PassedPoints {
        &self.passed
    }

    /// Returns the bits of the conditions that are still to become true in the state of a machine.
    pub(super) fn pending(&self, vm: &Vm) -> u64 {
        let bits = vm.heap.symbol(self.pending).and_then(|symbol| symbol.value.as_fixnum());
        bits.and_then(|bits| u64::try_from(bits).ok()).unwrap_or(0)
    }

    /// Returns the number of tasks that may still be asked to end.
    pub(super) fn aborts(&self) -> u32 {
        self.aborts
    }

    /// Returns the task that ran last.
    pub(super) fn last(&self) -> TaskNumber {
        self.last
    }

    /// Runs from point to point, up to so many ticks of the whole run; at each, `choose` says which task
    /// continues. It is given the run as it stands, from which [`PointRun::go_on`] comes to the same choice
    /// again. Points are left out as `left_out` says, which takes note of what shows that they are needed.
    /// Returns how the run has ended, unless it was given up.
    pub(super) fn go_on(
        &mut self,
        vm: &mut Vm,
        end: u64,
        mut left_out: Option<&mut LeftOut<'_>>,
        choose: &mut Choose<'_>,
    ) -> Option<RunOutcome> {
        let outcome = self.go_from_point_to_point(vm, end, left_out.as_deref_mut(), choose);
        if let Some(left_out) = left_out {
            // No tick comes after the last actions of a run.
            if outcome.is_some()
                && let Some(way) = &self.unseen
            {
                left_out.shown.places.extend(way.last_action.filter(|_| way.is_sudden(vm)));
            }
            left_out.take_requests(vm, self.chosen_at);
            left_out.take_variables(vm);
        }
        outcome
    }

    fn go_from_point_to_point(
        &mut self,
        vm: &mut Vm,
        end: u64,
        mut left_out: Option<&mut LeftOut<'_>>,
        choose: &mut Choose<'_>,
    ) -> Option<RunOutcome> {
        loop {
            if vm.scheduler.spent >= end {
                return Some(RunOutcome::TicksUsed);
            }
            if let Some(turn) = vm.scheduler.open_turn.take() {
                let index = turn.task.index;
                run::go_on_with_turn(vm, turn, end);
                note_tick(vm, index);
                continue;
            }
            if !std::mem::take(&mut self.is_at_point) {
                if let Some(outcome) = self.come_to_point(vm) {
                    return Some(outcome);
                }
                match &mut left_out {
                    Some(left_out) => left_out.take_requests(vm, self.chosen_at),
                    None => vm.scheduler.points.requested.clear(),
                }
                self.awaits_requests = false;
                let stays = std::mem::take(&mut self.stays);
                let next = if stays { AtTick::Stop } else { self.look_at_tick(vm, left_out.as_deref_mut()) };
                match next {
                    AtTick::Stop => {}
                    AtTick::StopForRequests => self.awaits_requests = true,
                    AtTick::GoOn(index) => {
                        give_turn(vm, index, end);
                        continue;
                    }
                }
            }
            let mut runnable: Vec<(bool, TaskNumber, TaskIndex)> =
                runnable_tasks(vm).map(|(number, index)| (number != self.last, number, index)).collect();
            runnable.sort_unstable();
            let Some(&(is_other, ..)) = runnable.first() else {
                if vm.scheduler.counts.alive == 0 {
                    return Some(RunOutcome::Done);
                }
                let aborts = self.tasks_to_abort(vm);
                if !aborts.is_empty() {
                    let here = PointRun { is_at_point: true, ..self.clone() };
                    let waiting = Runnable {
                        tasks: &[],
                        ways: None,
                        has_last: false,
                        has_timer: true,
                        aborts: &aborts,
                        tried: None,
                    };
                    let choice = choose(vm, here, waiting)?;
                    self.passed.clear();
                    if let Some(id) = waiting.abort(choice) {
                        self.abort(vm, id);
                        continue;
                    }
                }
                if !run::idle(vm) {
                    return Some(RunOutcome::Waiting);
                }
                // All tasks wait, so a request finds each at its wait.
                vm.scheduler.points.requested.clear();
                continue;
            };
            let has_timer = self.has_timers && time_may_pass(vm);
            if vm.scheduler.points.asked.is_none()
                && !self.awaits_requests
                && self.aborts == 0
                && let Some(left_out) = &mut left_out
                && let Some(position) = first_alone(vm, &runnable, left_out)
            {
                let (_, number, index) = runnable[position];
                let has_choice = runnable.len() > 1 || has_timer;
                self.go_first((number, index), has_choice.then_some(position as u32), vm, left_out);
                give_turn(vm, index, end);
                continue;
            }
            let tasks: SmallVec<[TaskIndex; 16]> = runnable.iter().map(|&(.., index)| index).collect();
            let here = PointRun { is_at_point: true, ..self.clone() };
            if let Some(ways) = vm.scheduler.points.asked {
                let ways = Some(ways as u32);
                let asking = Runnable {
                    tasks: &tasks,
                    ways,
                    has_last: false,
                    has_timer: false,
                    aborts: &[],
                    tried: None,
                };
                let way = choose(vm, here, asking)?;
                self.passed.clear();
                vm.scheduler.points.asked = None;
                vm.scheduler.points.chosen = Some(way as usize);
                if let Some(&(_, _, index)) = runnable.first().filter(|_| !is_other) {
                    if let Some(task) = vm.scheduler.tasks.at_mut(index) {
                        task.flags.set_at_point(false);
                    }
                    give_turn(vm, index, end);
                }
                continue;
            }
            let aborts = self.tasks_to_abort(vm);
            let tried: Option<SmallVec<[u32; 8]>> =
                left_out.as_deref_mut().filter(|_| self.awaits_requests).map(|left_out| {
                    let others = (1_u32..).zip(&tasks[1..]);
                    let may_request = |&(_, &index): &(u32, &TaskIndex)| left_out.may_request(vm, index);
                    let mut tried: SmallVec<[u32; 8]> =
                        others.filter(may_request).map(|(choice, _)| choice).collect();
                    tried.extend((has_timer && left_out.has_timer_requests()).then_some(tasks.len() as u32));
                    // Of those that may be asked to end, only this one stands elsewhere at the next point.
                    let own = aborts.iter().position(|id| id.index == tasks[0]);
                    let before = tasks.len() + usize::from(has_timer);
                    tried.extend(own.map(|position| (before + position) as u32));
                    tried
                });
            let tried = tried.as_deref();
            let has_last = !is_other;
            let choices = Runnable { tasks: &tasks, ways: None, has_last, has_timer, aborts: &aborts, tried };
            let choice = choose(vm, here, choices)?;
            self.passed.clear();
            if let Some(id) = choices.abort(choice) {
                self.abort(vm, id);
                continue;
            }
            if has_timer && choice as usize == tasks.len() {
                self.stays = true;
                run::idle(vm);
                if let Some(left_out) = &mut left_out {
                    left_out.take_requests(vm, None);
                }
                continue;
            }
            let (_, number, index) = runnable[choice as usize % runnable.len()];
            if number != self.last
                && let Some(way) = &mut self.unseen
            {
                way.last_action = None;
            }
            self.last = number;
            self.chosen_at = left_out.as_deref_mut().map(|left_out| left_out.place(vm, index));
            if let Some(task) = vm.scheduler.tasks.at_mut(index) {
                vm.scheduler.points.is_open = task.flags.at_point();
                task.flags.set_at_point(false);
            }
            give_turn(vm, index, end);
        }
    }

    /// Returns the tasks of the program that may be asked to end, oldest first.
    fn tasks_to_abort(&self, vm: &Vm) -> Vec<TaskId> {
        if self.aborts == 0 {
            return Vec::new();
        }
        let tasks = &vm.scheduler.tasks;
        let asked = tasks.ids().into_iter().filter_map(|id| {
            let task = tasks.get(id).filter(|task| task.state != TaskState::Ended)?;
            let is_open =
                !task.flags.hidden() && !task.flags.kept() && !task.flags.abort_pending() && !ends(task);
            is_open.then_some((task.number, id))
        });
        let mut asked: Vec<(TaskNumber, TaskId)> = asked.collect();
        asked.sort_unstable_by_key(|&(number, _)| number);
        asked.into_iter().map(|(_, id)| id).collect()
    }

    /// Asks a task to end, as an operator does.
    fn abort(&mut self, vm: &mut Vm, id: TaskId) {
        self.aborts -= 1;
        self.stays = true;
        vm.abort(id);
        vm.scheduler.points.requested.clear();
    }

    /// Notes that a task goes first, which has begun or was woken: by this choice, if there is one. Then the
    /// place where it stands is a point that was left out.
    fn go_first(
        &mut self,
        (number, index): (TaskNumber, TaskIndex),
        choice: Option<u32>,
        vm: &Vm,
        left_out: &mut LeftOut<'_>,
    ) {
        let place = left_out.place(vm, index);
        (self.last, self.chosen_at) = (number, Some(place));
        self.passed.tasks.push(number);
        self.passed.choices.extend(choice);
        if let Some(way) = &mut self.unseen {
            (way.last_action, way.outside) = (choice.map(|_| place), outside(vm));
        }
    }

    /// Returns whether the task that ran last has done something that others can see since its last point.
    /// That matters where it chooses a way: there, no other task may go.
    pub(super) fn has_open_action(&self, vm: &Vm) -> bool {
        let points = &vm.scheduler.points;
        let is_open = |way: &UnseenWay| way.last_action.is_some() || points.has_shown;
        points.asked.is_some() && self.unseen.as_ref().is_some_and(is_open)
    }

    /// Returns what to do if the task that ran last stands at a tick: if others have seen nothing of it since
    /// its last point, giving way here would be as giving way there, but for requests to the task.
    fn look_at_tick(&mut self, vm: &mut Vm, mut left_out: Option<&mut LeftOut<'_>>) -> AtTick {
        let aborts = self.tasks_to_abort(vm);
        let Some(way) = self.unseen.as_mut() else { return AtTick::Stop };
        let symbols = vm.names.symbol_count();
        if way.watched != symbols {
            watch_variables(vm);
            way.watched = symbols;
            vm.scheduler.points.raced = left_out.as_ref().map(|left_out| Arc::new(left_out.raced(vm)));
        }
        if vm.scheduler.points.asked.is_some() {
            // No other task may go here, so the way of this one goes on.
            return AtTick::Stop;
        }
        let (last_action, is_sudden) = (way.last_action.take(), way.is_sudden(vm));
        let points = &mut vm.scheduler.points;
        let has_shown = std::mem::take(&mut points.has_shown);
        let is_seen = std::mem::take(&mut points.is_seen);
        let was_hit = std::mem::take(&mut points.was_hit);
        points.is_sudden = false;
        let ticks = std::mem::take(&mut way.ticks) + 1;
        if let Some(left_out) = &mut left_out {
            left_out.shown.needs_all |= was_hit;
            left_out.shown.places.extend(last_action.filter(|_| is_sudden));
        }
        let was_left_out = std::mem::take(&mut way.left_out);
        let last = runnable_tasks(vm).find(|&(number, _)| number == self.last);
        let task = last.and_then(|(_, index)| Some((index, vm.scheduler.tasks.at(index)?)));
        // One that was woken meanwhile goes on as others do.
        let stands = |task: &Task| task.flags.at_tick() && !task.flags.at_point();
        let Some((index, task)) = task.filter(|(_, task)| stands(task) && ticks < way.most) else {
            return AtTick::Stop;
        };
        // An abort cuts off the rest of the task, of which others may see each part.
        let depends_on_place =
            vm.scheduler.points.has_guards || task.control.get().is_some_and(depends_on_place);
        let may_matter = has_shown || depends_on_place;
        if may_matter && (left_out.is_none() || was_left_out >= MOST_LEFT_OUT) {
            return AtTick::Stop;
        }
        let mut last_action = last_action;
        if let Some(left_out) = left_out.as_deref_mut().filter(|_| is_seen) {
            let place = left_out.place(vm, index);
            if left_out.needed.places.contains(&place) {
                return AtTick::Stop;
            }
            (last_action, way.outside) = (Some(place), outside(vm));
        }
        let is_abortable = aborts.iter().any(|id| id.index == index);
        let has_timer = self.has_timers && time_may_pass(vm);
        let others: SmallVec<[TaskIndex; 16]> =
            runnable_tasks(vm).map(|(_, other)| other).filter(|&other| other != index).collect();
        if let Some(left_out) = left_out
            && depends_on_place
            && (is_abortable || left_out.is_target(vm, index))
        {
            if last_action.is_some() {
                // Others may go between that and a request to this task.
                return AtTick::Stop;
            }
            let may_request = others.iter().any(|&other| left_out.may_request(vm, other));
            if is_abortable || may_request || has_timer && left_out.has_timer_requests() {
                way.left_out = was_left_out + 1;
                return AtTick::StopForRequests;
            }
        }
        way.last_action = last_action;
        way.left_out = was_left_out + u32::from(may_matter);
        if !may_matter {
            way.ticks = ticks;
        } else if !others.is_empty() || has_timer || !aborts.is_empty() {
            self.passed.choices.push(0);
        }
        AtTick::GoOn(index)
    }

    /// Does what is to be done between two turns. Returns how the run has ended, if it has.
    fn come_to_point(&self, vm: &mut Vm) -> Option<RunOutcome> {
        vm.scheduler.rounds += 1;
        vm.scheduler.queues.sweep(&vm.scheduler.tasks);
        if vm.outside.inbox.is_rung() && run::take_in(vm) {
            return Some(RunOutcome::Stopped);
        }
        if vm.scheduler.is_budget_spent(&vm.config) {
            return Some(RunOutcome::BudgetSpent);
        }
        while !vm.scheduler.deliveries.is_empty() {
            run::deliver_some(vm);
        }
        (!check_state(vm, self.checks)).then_some(RunOutcome::BudgetSpent)
    }
}

/// Gives a task a turn, and notes of it whether it then stands at a tick.
fn give_turn(vm: &mut Vm, index: TaskIndex, end: u64) {
    run::give_turn(vm, index, end);
    note_tick(vm, index);
}

/// Notes of a task that has had a turn whether it stands at a tick: not if it waits, and will be woken.
fn note_tick(vm: &mut Vm, index: TaskIndex) {
    if let Some(task) = vm.scheduler.tasks.at_mut(index) {
        let stands = task.state == TaskState::Runnable && !task.flags.at_point();
        task.flags.set_at_tick(stands);
    }
}
