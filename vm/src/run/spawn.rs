//! Making tasks, and dropping them.
//!
//! A task is made of a function and its arguments. It begins with copies of its maker's bindings of special
//! variables, and charges the same account.

use super::limit::admit;
use crate::heap::Kind;
use crate::interp::start::FirstCall;
use crate::raise::{Exit, Raised};
use crate::report::{self, Happening};
use crate::schedule::{AccountOwner, Amount, Measure};
use crate::task::{AccountId, Bindings, DEFAULT_PRIORITY, Flags, Fund, Task, TaskId, TaskNumber, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{event, lineage};

/// Properties of a new task.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpawnOptions {
    /// Name, any value, or `NIL`.
    pub name: Value,
    /// Priority, from 0 to 7.
    pub priority: u8,
    /// Ticks that it may use.
    pub budget: Option<u64>,
    /// Whether the run may end without it.
    pub daemon: bool,
    /// Whether it belongs to the library.
    pub hidden: bool,
    /// Whether it works for all: it has no bindings of its maker, and charges no account.
    pub is_service: bool,
    /// The object notified of its end: a wait, a guard, or `NIL`.
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
            is_service: false,
            notify: Value::NIL,
        }
    }
}

impl Vm {
    /// Makes a task that will call `function`, a function or a symbol that names one, and puts it at the end
    /// of its queue. Its outcome is kept until [`Vm::forget`].
    ///
    /// # Errors
    /// [`Exit::Collect`] if there is no room for it.
    pub fn spawn(&mut self, function: Value, arguments: &[Value]) -> Result<TaskId, Exit> {
        spawn_kept(self, function, arguments, SpawnOptions::default())
    }

    /// Forgets a task that has ended; one that has not is dropped as it stands, without its cleanups.
    pub fn forget(&mut self, id: TaskId) {
        let scheduler = &mut self.scheduler;
        let Some(task) = scheduler.tasks.get(id) else { return };
        let has_ended = task.state == TaskState::Ended;
        if !has_ended {
            scheduler.counts.alive -= 1;
            scheduler.counts.foreground -= usize::from(!task.flags.daemon());
            let (object, wait, account) = (task.object, task.wait, task.account);
            let hidden = task.flags.hidden();
            scheduler.close_wait(&mut self.heap, wait);
            if !hidden {
                scheduler.accounts.give_back(account, Measure::Tasks);
            }
            scheduler.accounts.leave(account);
            lineage::end(&mut self.heap, object);
            self.heap.slot_set(object, event::RESULT, Value::NIL);
            self.heap.slot_set(object, event::STATE, self.names.known.aborted);
        }
        match self.scheduler.tasks.remove(id) {
            Some(task) if has_ended => self.scheduler.tasks.keep_spare(&mut self.heap, task),
            Some(mut task) => task.uncount(&mut self.heap),
            None => {}
        }
    }
}

/// Makes a task that is kept, with a collection before if there is no room for it.
pub(super) fn spawn_kept(
    vm: &mut Vm,
    function: Value,
    arguments: &[Value],
    options: SpawnOptions,
) -> Result<TaskId, Exit> {
    let id = match try_spawn(vm, function, arguments, options) {
        Err(Exit::Collect) => {
            vm.embedder.pinned.extend_from_slice(arguments);
            vm.embedder.pinned.push(function);
            vm.collect_fully();
            vm.embedder.pinned.truncate(vm.embedder.pinned.len() - arguments.len() - 1);
            try_spawn(vm, function, arguments, options)?
        }
        result => result?,
    };
    if let Some(task) = vm.scheduler.tasks.get_mut(id) {
        task.flags.set_kept(true);
    }
    Ok(id)
}

fn try_spawn(
    vm: &mut Vm,
    function: Value,
    arguments: &[Value],
    options: SpawnOptions,
) -> Result<TaskId, Exit> {
    let list = vm.heap.list(arguments)?;
    make_task(vm, function, list, options)
}

/// Makes a task that will call `function` with a list of arguments. It has copies of the bindings of the
/// running task.
///
/// # Errors
/// [`Exit::Collect`] if there is no room for it, [`Exit::Again`] if it would be more than a quota allows, and
/// a failure if it would belong to a form of a cleanup that is being cut off; then nothing has happened.
pub(crate) fn make_task(
    vm: &mut Vm,
    function: Value,
    arguments: Value,
    options: SpawnOptions,
) -> Result<TaskId, Exit> {
    let belongs = options.notify.is_true();
    let fund =
        if belongs || vm.scheduler.counts.made_at_end > 0 { fund_of_child(vm, belongs)? } else { None };
    if !options.hidden {
        admit(vm, Measure::Tasks)?;
    }
    let Vm { heap, names, scheduler, exchange, .. } = vm;
    let call = FirstCall::new(heap, function, arguments);
    let words = call.words();
    let maker = scheduler.running.as_ref();
    let bindings = maker.and_then(|maker| maker.control.get()).map_or(0, |control| control.bindings.len());
    heap.check_room(Task::bytes_with(words) + bindings * Bindings::BYTES)?;
    let mut slots = [Value::NIL; event::TASK_LENGTH];
    slots[event::NAME] = options.name;
    slots[event::COUNT] = Value::small(0);
    // A service belongs to no task, so it is not suspended with its maker.
    if let Some(maker) = maker.filter(|_| !options.is_service) {
        slots[event::RESULT] = lineage::node_of(heap, maker.object)?;
    }
    // The cell that enters the task into the queue of the wait at its end is made now.
    let is_wait = heap.is(options.notify, Kind::Wait);
    let notify = if is_wait { heap.cons(options.notify, Value::NIL)? } else { options.notify };
    let object = heap.alloc_record(Kind::Task, 0, 0, &slots)?;
    let mut task = scheduler.tasks.make(heap, object, words);
    call.make_frame(&mut task, scheduler.starter);
    // A new task holds nothing that was not found in a cycle under way: what it is made of is in hands of a
    // task that has been scanned, or of the host.
    heap.log_all_if_marking(&[function, arguments, notify, options.notify]);
    task.scanned = heap.cycle_id();
    scheduler.counts.made += 1;
    // The new task may run before what its maker does next.
    scheduler.points.note_shown();
    task.number = TaskNumber(scheduler.counts.made);
    task.serial = scheduler.serial.advance();
    task.priority = options.priority;
    task.notify = notify;
    // Stored at once: to load what was stored in parts just before takes as long as a miss of the cache.
    let mut flags = Flags::default();
    flags.set_daemon(options.daemon);
    flags.set_hidden(options.hidden);
    if let Some(fund) = fund {
        task.extra_mut().fund = Some(fund);
    }
    if let Some(maker) = scheduler.running.as_ref().filter(|_| !options.is_service) {
        flags.set_serves_cleanup(maker.runs_cleanup() || maker.flags.serves_cleanup());
        if maker.account != AccountId::NONE {
            // A task that a cleanup makes in a form that has used up its account must not end at once.
            let is_free = maker.runs_cleanup();
            let account = scheduler.accounts.for_child(maker.account, is_free);
            scheduler.accounts.enter(account);
            task.account = account;
            if !options.hidden {
                scheduler.accounts.take(account, Measure::Tasks);
            }
        }
        if let Some(control) = maker.control.get()
            && control.bindings.len() > 0
        {
            exchange.charge(2 * control.bindings.len());
            // Restarts and recoveries around the maker cannot be reached from another task.
            let without = [names.known.restarts, names.known.recoveries];
            task.control.bindings = control.bindings.copy(&without);
        }
    }
    task.flags = flags;
    task.recount(heap);
    if let Some(ticks) = options.budget {
        let above = task.account;
        task.account = scheduler.accounts.open(above, Amount::budget(ticks), AccountOwner::Tasks);
        // The account has taken the place of the task with the one above.
        scheduler.accounts.leave(above);
    }
    scheduler.counts.alive += 1;
    scheduler.counts.foreground += usize::from(!options.daemon);
    let (serial, priority) = (task.serial, task.priority);
    let id = scheduler.tasks.insert(task);
    heap.slot_set(object, event::STATE, Value::index(id.index.as_usize()));
    scheduler.queues.push(id.index, serial, priority, false);
    report::note(vm, id.index, Happening::Begins);
    Ok(id)
}

/// Returns what the cleanups of a new task may use that the running task makes: what is left to the cleanups
/// of that one, if it belongs to a form there, or a part of that. `None` without bounds.
///
/// # Errors
/// `:budget-exhausted` if nothing is left: nothing would end the new task.
fn fund_of_child(vm: &mut Vm, belongs: bool) -> Result<Option<Fund>, Exit> {
    let Vm { scheduler, outside, cpu, exchange, .. } = vm;
    if scheduler
        .running
        .as_ref()
        .is_none_or(|task| task.extra.as_ref().is_none_or(|extra| extra.fund.is_none()))
    {
        return Ok(None);
    }
    if scheduler.is_fund_spent(cpu.used(), &mut outside.host) {
        return exchange.raise(Raised::Failure("BUDGET-EXHAUSTED"));
    }
    let task = scheduler.task_mut();
    let ticks = task.ticks;
    let fund = task.extra_mut().fund.as_mut();
    Ok(fund.map(|fund| if belongs { fund.for_child(ticks) } else { fund.split(ticks) }))
}
