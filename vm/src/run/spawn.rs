//! Making tasks, and dropping them.
//!
//! A task is made of a function and its arguments. It begins with copies of the bindings of special variables that its maker
//! has, and charges the same account.

use crate::heap::Kind;
use crate::interp;
use crate::raise::Exit;
use crate::report::Happening;
use crate::task::{DEFAULT_PRIORITY, TaskId, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::event;

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
    /// Who is told of its end, see [`crate::task::Task::notify`].
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
    /// Makes a task that will call `function`, a function or a symbol that names one, and puts it at the end of its
    /// queue. What became of it is kept until [`Vm::forget`].
    ///
    /// # Errors
    /// [`Exit::Collect`] if there is no room for it.
    pub fn spawn(&mut self, function: Value, arguments: &[Value]) -> Result<TaskId, Exit> {
        let id = match self.try_spawn(function, arguments) {
            Err(Exit::Collect) => {
                self.embedder.pinned.extend_from_slice(arguments);
                self.embedder.pinned.push(function);
                self.collect_fully();
                self.embedder.pinned.truncate(self.embedder.pinned.len() - arguments.len() - 1);
                self.try_spawn(function, arguments)?
            }
            result => result?,
        };
        if let Some(task) = self.scheduler.tasks.get_mut(id) {
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
        let parent =
            self.scheduler.running.as_ref().map_or(Value::NIL, |task| Value::index(task.number as usize));
        let mut slots = [Value::NIL; event::TASK_LENGTH];
        slots[event::NAME] = options.name;
        slots[event::COUNT] = Value::small(0);
        slots[event::RESULT] = parent;
        let object = self.heap.alloc_record(Kind::Task, 0, 0, &slots)?;
        let words = interp::start::first_words(&self.heap, function, arguments);
        let mut task = self.scheduler.tasks.make(object, words);
        interp::start::first_frame(&self.heap, &mut task, self.scheduler.starter, function, arguments);
        // A new task holds nothing that was not found in a cycle under way: what it is made of is in hands of a task
        // that has been scanned, or of the host.
        self.heap.log_if_marking(function);
        self.heap.log_if_marking(arguments);
        self.heap.log_if_marking(options.notify);
        task.scanned = self.heap.cycle_id();
        self.scheduler.counts.made += 1;
        task.number = self.scheduler.counts.made;
        task.serial = self.scheduler.next_serial();
        task.priority = options.priority;
        task.notify = options.notify;
        task.flags.set_daemon(options.daemon);
        task.flags.set_hidden(options.hidden);
        let bindings = self.scheduler.running.as_ref().and_then(|parent| parent.control.get());
        // They are copied.
        self.exchange.charge(bindings.map_or(0, |control| 2 * control.bindings.len()));
        if let Some(parent) = &self.scheduler.running {
            self.scheduler.accounts.enter(parent.account);
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
            task.account = self.scheduler.accounts.open_for_task(parent, ticks);
            // The account has taken the place of the task with the one above.
            self.scheduler.accounts.leave(parent);
        }
        self.scheduler.counts.alive += 1;
        self.scheduler.counts.foreground += usize::from(!options.daemon);
        let (serial, priority) = (task.serial, task.priority);
        let id = self.scheduler.tasks.insert(task);
        self.set_slot(object, event::STATE, Value::index(id.index as usize));
        self.scheduler.queues.push(id.index, serial, priority, false);
        self.note(id.index, Happening::Begins);
        Ok(id)
    }

    /// Forgets a task that has ended; one that has not is dropped as it stands, without its cleanups.
    pub fn forget(&mut self, id: TaskId) {
        let Some(task) = self.scheduler.tasks.get(id) else { return };
        if task.state != TaskState::Ended {
            self.scheduler.counts.alive -= 1;
            self.scheduler.counts.foreground -= usize::from(!task.flags.daemon());
            let (object, wait, account) = (task.object, task.wait, task.account);
            self.close_wait(wait);
            self.scheduler.accounts.leave(account);
            self.set_slot(object, event::STATE, self.world.known.aborted);
        }
        self.scheduler.tasks.remove(id);
    }
}
