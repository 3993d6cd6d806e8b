//! Running tasks: making them, giving them their turns, and what becomes of them.
//!
//! A runnable task has a slice of ticks and goes to the end of its queue; `schedule` says whose turn it is. The machine's own
//! budget is counted to the tick: a run that is given the same budget ends at the same place. When no task is
//! runnable the machine sleeps in the host until the first timer, or until something comes from outside.

use crate::control::End;
use crate::heap::Kind;
use crate::interp::{self, Leave};
use crate::limit::AccountId;
use crate::raise::Exit;
use crate::task::{DEFAULT_PRIORITY, Task, TaskId, TaskResult, TaskState};
use crate::timer::Due;
use crate::trace::Happening;
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{Parking, event};

/// Why a run came back to the embedder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunOutcome {
    /// What was to be run has ended: every task, or the one that was named.
    Done,
    /// The tasks that are left all wait for what cannot come.
    Waiting,
    /// The budget of the run is spent.
    BudgetSpent,
    /// The ticks that this call was given are used up.
    TicksUsed,
}

/// Ticks between two looks at the clock while tasks are running.
const CLOCK_TICKS: u64 = 2000;
/// Ticks after which virtual time moves although tasks are running.
const VIRTUAL_TICKS: u64 = 10_000_000;

/// What a new task is like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpawnOptions {
    /// What it is called, or `NIL`.
    pub name: Value,
    /// From 0 to 7.
    pub priority: u8,
    /// Ticks that it may use.
    pub budget: Option<u64>,
    /// Whether the run ends without it.
    pub daemon: bool,
    /// Whether it belongs to the library.
    pub hidden: bool,
    /// Who is told of its end, see [`Task::notify`].
    pub notify: Value,
}

impl Default for SpawnOptions {
    fn default() -> SpawnOptions {
        SpawnOptions {
            name: Value::NIL,
            priority: DEFAULT_PRIORITY,
            budget: None,
            daemon: false,
            hidden: false,
            notify: Value::NIL,
        }
    }
}

impl Vm {
    /// The running task.
    ///
    /// # Panics
    /// If none runs: builtins and instructions are only reached from a task.
    #[inline(always)]
    pub(crate) fn task(&self) -> &Task {
        self.running.as_ref().expect("a builtin is called by a task")
    }

    /// The running task.
    ///
    /// # Panics
    /// If none runs: builtins and instructions are only reached from a task.
    #[inline(always)]
    pub(crate) fn task_mut(&mut self) -> &mut Task {
        self.running.as_mut().expect("a builtin is called by a task")
    }

    /// A number that no state of a task had before.
    #[inline]
    pub(crate) fn next_serial(&mut self) -> u64 {
        self.serial += 1;
        self.serial
    }

    /// Makes a task that will call `function`, a function or a symbol that names one, and puts it at the end of its
    /// queue. What became of it is kept until [`Vm::forget`].
    ///
    /// # Errors
    /// [`Exit::Collect`] if there is no room for it.
    pub fn spawn(&mut self, function: Value, arguments: &[Value]) -> Result<TaskId, Exit> {
        let id = match self.try_spawn(function, arguments) {
            Err(Exit::Collect) => {
                self.pinned.extend_from_slice(arguments);
                self.pinned.push(function);
                self.collect_fully();
                self.pinned.truncate(self.pinned.len() - arguments.len() - 1);
                self.try_spawn(function, arguments)?
            }
            result => result?,
        };
        if let Some(task) = self.tasks.get_mut(id) {
            task.flags.set_kept(true);
        }
        Ok(id)
    }

    fn try_spawn(&mut self, function: Value, arguments: &[Value]) -> Result<TaskId, Exit> {
        let list = self.heap.list(arguments)?;
        self.make_task(function, list, SpawnOptions::default())
    }

    /// Makes a task that will call `function` with a list of arguments. It has copies of the bindings of the running task.
    ///
    /// # Errors
    /// [`Exit::Collect`] if there is no room for it; then nothing has happened.
    pub(crate) fn make_task(
        &mut self,
        function: Value,
        arguments: Value,
        options: SpawnOptions,
    ) -> Result<TaskId, Exit> {
        let parent = self.running.as_ref().map_or(Value::NIL, |task| Value::index(task.number as usize));
        let mut slots = [Value::NIL; event::TASK_LENGTH];
        slots[event::NAME] = options.name;
        slots[event::COUNT] = Value::small(0);
        slots[event::RESULT] = parent;
        let object = self.heap.alloc_record(Kind::Task, 0, 0, &slots)?;
        let words = interp::call::first_words(&self.heap, function, arguments);
        let mut task = Box::new(Task::new(object, words));
        interp::call::first_frame(&self.heap, &mut task, self.starter, function, arguments);
        // A new task holds nothing that was not found in a cycle under way: what it is made of is in hands of a task
        // that has been scanned, or of the host.
        self.heap.log_if_marking(function);
        self.heap.log_if_marking(arguments);
        self.heap.log_if_marking(options.notify);
        task.scanned = self.heap.cycle_id();
        self.made += 1;
        task.number = self.made;
        task.serial = self.next_serial();
        task.priority = options.priority;
        task.notify = options.notify;
        task.flags.set_daemon(options.daemon);
        task.flags.set_hidden(options.hidden);
        if let Some(parent) = &self.running {
            self.accounts.enter(parent.account);
            task.account = parent.account;
            if let Some(control) = parent.control.get()
                && control.bindings.len() > 0
            {
                // What is in force around the parent cannot be reached from another task.
                let known = &self.world.known;
                task.control.bindings = control.bindings.copy(&[known.restarts, known.recoveries]);
            }
        }
        if let Some(ticks) = options.budget {
            let parent = task.account;
            task.account = self.accounts.open_for_task(parent, ticks);
            // The account has taken the place of the task with the one above.
            self.accounts.leave(parent);
        }
        self.alive += 1;
        self.foreground += usize::from(!options.daemon);
        let (serial, priority) = (task.serial, task.priority);
        let id = self.tasks.insert(task);
        self.set_slot(object, event::STATE, Value::index(id.index as usize));
        self.queues.push(id.index, serial, priority, false);
        self.trace(id.index, Happening::Begins);
        Ok(id)
    }

    /// What became of a task. One that was forgotten counts as running.
    pub fn result(&self, id: TaskId) -> TaskResult {
        self.tasks.get(id).map_or(TaskResult::Running, Task::result)
    }

    /// What is to be said of the failure that ended a task.
    pub fn report(&self, id: TaskId) -> Option<&str> {
        self.tasks.get(id)?.extra.as_ref()?.report.as_deref()
    }

    /// Ticks that a task has used.
    pub fn ticks_of(&self, id: TaskId) -> u64 {
        self.tasks.get(id).map_or(0, |task| task.ticks)
    }

    /// Ticks that all tasks together have used.
    pub fn ticks(&self) -> u64 {
        self.spent
    }

    /// Tasks that were made, and turns that they had, since the program began.
    pub fn tasks_and_turns(&self) -> (u64, u64) {
        (self.made, self.turns)
    }

    /// Forgets a task that has ended; one that has not is dropped as it stands, without its cleanups.
    pub fn forget(&mut self, id: TaskId) {
        let Some(task) = self.tasks.get(id) else { return };
        if task.state != TaskState::Ended {
            self.alive -= 1;
            self.foreground -= usize::from(!task.flags.daemon());
            let (object, wait, account) = (task.object, task.wait, task.account);
            self.close_wait(wait);
            self.accounts.leave(account);
            self.set_slot(object, event::STATE, self.world.known.aborted);
        }
        self.tasks.remove(id);
    }

    /// Asks for the end of a task, wherever it is. It unwinds, and runs its cleanups, within two slices; inside a cleanup
    /// or a critical section the request waits for its end.
    pub fn abort(&mut self, id: TaskId) {
        if !self.tasks.contains(id) {
            return;
        }
        let is_running = id.index == self.running_index && self.running.is_some();
        let task = if is_running { self.running.as_deref_mut() } else { self.tasks.get_mut(id) };
        if let Some(task) = task
            && task.state != TaskState::Ended
        {
            task.flags.set_abort_pending(true);
            self.trace(id.index, Happening::IsToEnd);
            self.call_attention(id.index);
        }
    }

    /// Asks for the end of every task but the running one.
    pub(crate) fn abort_others(&mut self) {
        for id in self.tasks.ids() {
            if self.running.is_none() || id.index != self.running_index {
                self.abort(id);
            }
        }
    }

    /// Makes a task runnable that is parked, or moves one that is runnable to the urgent ones.
    pub(crate) fn make_runnable(&mut self, index: u32, urgent: bool) {
        let serial = self.next_serial();
        let Some(task) = self.tasks.at_mut(index) else { return };
        let was_parked = std::mem::replace(&mut task.state, TaskState::Runnable) != TaskState::Runnable;
        task.serial = serial;
        let (priority, urgent) = (task.priority, urgent || task.flags.urgent());
        self.queues.push(index, serial, priority, urgent);
        if was_parked {
            self.trace(index, Happening::GoesOn);
        }
    }

    /// Runs tasks in turn until all have ended or wait for what cannot come, the budget of the run is spent, or `ticks`
    /// are used up.
    pub fn run(&mut self, ticks: u64) -> RunOutcome {
        self.run_until(None, ticks)
    }

    /// Runs tasks in turn, as [`Vm::run`] does, but only until the named one has ended.
    pub fn run_until(&mut self, id: Option<TaskId>, ticks: u64) -> RunOutcome {
        let end = self.spent.saturating_add(ticks);
        loop {
            if let Some(id) = id
                && self.tasks.get(id).is_none_or(|task| task.state == TaskState::Ended)
            {
                return RunOutcome::Done;
            }
            if self.is_budget_spent() {
                return RunOutcome::BudgetSpent;
            }
            if self.spent >= end {
                return RunOutcome::TicksUsed;
            }
            if let Some(interrupted) = self.take_interrupt() {
                self.was_interrupted = true;
                self.abort(interrupted);
            }
            self.look_at_clock();
            match self.queues.next(&self.tasks, &mut self.choices) {
                Some(index) => self.give_turn(index, end),
                None => {
                    if self.alive == 0 {
                        return RunOutcome::Done;
                    }
                    if !self.idle() {
                        return RunOutcome::Waiting;
                    }
                }
            }
        }
    }

    /// Gives a runnable task its turn: one slice, or as many as it takes to leave a critical section.
    fn give_turn(&mut self, index: u32, end: u64) {
        loop {
            let limit = end.saturating_sub(self.spent);
            let leave = self.run_slice(index, limit);
            let Some(task) = self.tasks.at_mut(index) else { return };
            match leave {
                Leave::Ended => return,
                Leave::Slice => {
                    let passes = std::mem::take(&mut self.passes_turn);
                    let goes_on = task.critical > 0 || self.slice_is_cut && !passes;
                    if goes_on && self.spent < end && !self.is_budget_spent() {
                        continue;
                    }
                    return self.make_runnable(index, false);
                }
                Leave::Parked => return self.park_task(index),
            }
        }
    }

    /// Gives a runnable task one slice.
    fn run_slice(&mut self, index: u32, limit: u64) -> Leave {
        let Some(task) = self.tasks.take(index) else { return Leave::Ended };
        let account = task.account;
        self.running = Some(task);
        self.running_index = index;
        self.turns += 1;
        self.slice_is_cut = false;
        self.had_attention = self.task().flags.attention();
        self.scan_before_running();
        let slice = self.slice_of_running_task(limit);
        interp::load(self, slice as i32);
        let mut left = Ok(());
        if self.task().flags.attention() || account != AccountId::NONE {
            left = interp::see_to_attention(self);
        }
        let is_over = self.task().critical > 0 && self.critical_left <= 0;
        if left.is_ok() && is_over && !self.task().control.is_unwinding() {
            left = self.end_critical_by_failure();
        }
        let leave = match left {
            Ok(()) => interp::run(self),
            Err(leave) => leave,
        };
        let cpu = &self.cpu;
        let used = (i64::from(cpu.granted) - i64::from(cpu.reserve) - i64::from(cpu.ticks)).max(0) as u64;
        self.cpu.reserve = 0;
        let used = used + self.take_charged();
        self.spent += used;
        if leave != Leave::Ended {
            self.save_cpu();
        }
        let task = self.task_mut();
        task.ticks += used;
        if task.critical > 0 && !std::mem::take(&mut self.critical_is_new) {
            self.critical_left -= used as i64;
        }
        if account != AccountId::NONE {
            self.charge_account(account, used);
        }
        let Some(task) = self.running.take() else { return Leave::Ended };
        if leave == Leave::Ended && !task.flags.kept() {
            self.running_index = u32::MAX;
            if let Some(id) = self.tasks.id_at(index) {
                self.tasks.remove(id);
            }
        } else {
            self.tasks.put_back(index, task);
        }
        leave
    }

    /// The length of the next slice of the running task.
    fn slice_of_running_task(&mut self, limit: u64) -> u64 {
        let mut slice = u64::from(self.choices.slice(self.config.slice)).min(limit);
        if let Some(budget) = self.config.budget {
            slice = slice.min(budget.saturating_sub(self.spent));
        }
        let account = self.task().account;
        if account != AccountId::NONE {
            slice = slice.min(self.accounts.left(account));
        }
        if self.task().control.get().is_some_and(|control| !control.running.is_empty()) {
            let left = self.cleanup_ticks_left();
            slice = slice.min(left);
            if left == 0 {
                self.task_mut().flags.set_attention(true);
            }
        }
        if self.task().critical > 0 {
            slice = slice.min(self.critical_left.max(1) as u64);
        }
        slice.max(1)
    }

    /// Ends the critical section of the running task, which has used up its ticks, with a failure where the task stands.
    fn end_critical_by_failure(&mut self) -> Result<(), Leave> {
        self.task_mut().critical = 0;
        let function = self.world.known.raise;
        let cause = self.world.known.budget_exhausted;
        interp::interrupt(self, function, &[cause])
    }

    /// Notes that the task at a place has come to wait.
    fn park_task(&mut self, index: u32) {
        let parking = std::mem::take(&mut self.parking);
        let serial = self.next_serial();
        let Some(id) = self.tasks.id_at(index) else { return };
        let Some(task) = self.tasks.at_mut(index) else { return };
        task.serial = serial;
        trim(task);
        match parking {
            Parking::Input => {
                task.state = TaskState::Reading;
                self.readers.push(id);
            }
            Parking::Wait(deadline) => {
                task.state = TaskState::Waiting;
                if let Some(deadline) = deadline {
                    self.timers.push(deadline, index, Due::Wait(serial));
                }
            }
        }
        self.trace(index, Happening::Waits);
        if !self.had_attention && self.tasks.at(index).is_some_and(|task| task.flags.attention()) {
            // Something was noted while it was about to wait.
            self.make_runnable(index, true);
        }
    }

    /// Reads the clock if it is time to, and does what is due.
    fn look_at_clock(&mut self) {
        if self.timers.first().is_none() {
            return;
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

    /// Does what is due.
    fn fire_timers(&mut self) {
        let now = self.time();
        while let Some((index, due)) = self.timers.take_due(now) {
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
    fn idle(&mut self) -> bool {
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

    /// Whether the budget of the run is spent.
    pub(crate) fn is_budget_spent(&self) -> bool {
        self.config.budget.is_some_and(|budget| self.spent >= budget)
    }

    /// Notes how the running task has ended, and tells those who want to know.
    pub(crate) fn finish_task(&mut self) {
        let end = match self.ending.take().unwrap_or(End::Succeeded) {
            End::Spent => End::Failed(self.world.known.budget_exhausted),
            end => end,
        };
        let mut values = std::mem::take(&mut self.values);
        let object = self.task().object;
        // What others are told of has to be made before; here there is nothing to go back to.
        let result = match (end, &values[..]) {
            (End::Succeeded, &[value]) => value,
            (End::Succeeded, values) => self.make_for_end(|vm| Ok(vm.heap.list(values)?)),
            (End::Failed(condition), _) => condition,
            _ => Value::NIL,
        };
        let aux = u16::from(end == End::Succeeded && values.len() == 1);
        self.heap.set_aux(object, Kind::Task, aux);
        self.set_slot(object, event::RESULT, result);
        let status = match end {
            End::Succeeded => self.world.known.succeeded,
            End::Failed(_) | End::Spent => self.world.known.failed,
            End::Aborted => self.world.known.aborted,
        };
        self.set_slot(object, event::STATE, status);
        let is_awaited = self.slot(object, event::FIRST).is_true();
        let notify = std::mem::replace(&mut self.task_mut().notify, Value::NIL);
        interp::call::drop_frames(self.task_mut());
        let account = std::mem::replace(&mut self.task_mut().account, AccountId::NONE);
        self.accounts.leave(account);
        self.trace_end(self.slot(object, event::NAME), status);
        self.report_end(end, is_awaited || notify.is_true());
        let task = self.task_mut();
        task.state = TaskState::Ended;
        if task.flags.kept() {
            let extra = task.extra_mut();
            extra.end = Some(end);
            extra.values = std::mem::take(&mut values);
        }
        values.clear();
        self.values = values;
        // The list of arguments is made only if somebody will see it.
        let has_waiters = self.slot(object, event::FIRST).is_true();
        let arguments: &[Value] = if has_waiters { &[self.world.known.task_end] } else { &[] };
        self.make_for_end(|vm| vm.signal_event(object, arguments).map(|()| Value::NIL));
        if let Some(pair) = self.heap.as_cons(notify) {
            self.make_for_end(|vm| vm.signal(pair.car, pair.cdr).map(|()| Value::NIL));
        } else if notify.is_true() {
            self.interrupt_by(notify);
        }
        self.end_run_if_over(end);
    }

    /// Does what needs room at the end of a task, where an instruction cannot be done again: with a collection if need be,
    /// and with the reserve of the heap.
    fn make_for_end(&mut self, mut make: impl FnMut(&mut Vm) -> Result<Value, Exit>) -> Value {
        for attempt in 0..3 {
            if let Ok(value) = make(self) {
                return value;
            }
            match attempt {
                0 => self.collect_fully(),
                _ => _ = self.heap.open_reserve(),
            }
        }
        Value::NIL
    }

    /// Reports the failure that has ended the running task, unless somebody waits for it or the embedder wants to.
    fn report_end(&mut self, end: End, is_awaited: bool) {
        let task = self.task_mut();
        if task.flags.kept() || is_awaited {
            return;
        }
        let report = task.extra.as_mut().and_then(|extra| extra.report.take());
        let name = self.slot(self.task().object, event::NAME);
        let label = self.label_of(name, self.task().number);
        match (end, report) {
            (End::Failed(_), Some(report)) => self.complain(&format!("In {label}:\n{report}")),
            (End::Failed(condition), None) => {
                let cause = self.describe(condition);
                self.complain(&format!("In {label}:\nFailure {cause}, no recovery available.\nAborted\n"));
            }
            _ => {}
        }
    }

    /// Ends the run with the running task, if it is the last that matters.
    fn end_run_if_over(&mut self, end: End) {
        self.alive -= 1;
        if !self.task().flags.daemon() {
            self.foreground -= 1;
        }
        let Some(main) = self.main else { return };
        let main_has_failed = main.index == self.running_index && (end != End::Succeeded);
        if main_has_failed || self.foreground == 0 {
            self.abort_others();
        }
    }

    /// How reports call a task.
    pub(crate) fn task_label(&self, object: Value) -> String {
        let index = self.slot(object, event::STATE).as_index();
        let is_running = index == Some(self.running_index as usize);
        let task = if is_running { self.running.as_deref() } else { None };
        let number = task.or_else(|| self.tasks.at(index? as u32)).map_or(0, |task| task.number);
        self.label_of(self.slot(object, event::NAME), number)
    }

    pub(crate) fn label_of(&self, name: Value, number: u64) -> String {
        if name.is_true() {
            format!("task {}", self.describe(name))
        } else if self.main_number == Some(number) {
            "the main task".into()
        } else {
            format!("task {number}")
        }
    }

    /// Makes a program's main task the one with whose failure the run ends.
    pub fn set_main(&mut self, id: TaskId) {
        self.main = Some(id);
        self.main_number = self.tasks.get(id).map(|task| task.number);
    }

    /// Calls a function in a task of its own and runs tasks until it has ended, at most for `ticks`.
    ///
    /// # Errors
    /// The text of the failure that ended it, or that it took too long.
    pub fn call(&mut self, function: Value, arguments: &[Value], ticks: u64) -> Result<Vec<Value>, String> {
        let id = self.spawn(function, arguments).map_err(|_| "no room for a task".to_string())?;
        let outcome = self.run_until(Some(id), ticks);
        let result = self.result(id);
        self.forget(id);
        match (result, outcome) {
            (TaskResult::Succeeded(values), _) => Ok(values),
            (TaskResult::Failed(condition), _) => {
                Err(self.last_words.take().unwrap_or_else(|| self.describe(condition)))
            }
            (TaskResult::Aborted, _) => Err("it was aborted".into()),
            (_, RunOutcome::Waiting) => Err("it waits for what cannot come".into()),
            (_, RunOutcome::BudgetSpent) => Err("the budget of the run is spent".into()),
            _ => Err(format!("it did not end within {ticks} ticks")),
        }
    }
}

fn is_waiting(task: &Task, serial: u64) -> bool {
    task.serial == serial && task.state == TaskState::Waiting
}

/// Whether a timer of a task is still of use.
fn is_wanted(task: Option<&Task>, due: Due) -> bool {
    let Some(task) = task else { return false };
    match due {
        Due::Wait(serial) => is_waiting(task, serial),
        Due::Limit(number) => {
            task.extra.as_ref().is_some_and(|extra| extra.limits.iter().any(|limit| limit.number() == number))
        }
        Due::Cleanup => task.control.get().is_some_and(|control| !control.running.is_empty()),
    }
}

/// Gives back most of a stack that is much too large for what is on it, if it was the last time too.
fn trim(task: &mut Task) {
    let (top, capacity) = (interp::top_of_task(task), task.stack.capacity());
    let is_oversized = capacity > 64 && top < capacity / 4;
    if is_oversized && task.flags.oversized() {
        task.stack.shrink(top + 16);
    }
    task.flags.set_oversized(is_oversized && !task.flags.oversized());
}
