//! A task: a thread of control of the program, with its own stack.
//!
//! A task has two parts. What programs hold is an object of the heap, an event too, that knows its name, how it ended and
//! the checkpoints that it passed. What runs is a [`Task`], a small record in [`Tasks`], which goes away at its end.
//!
//! While a task runs, its record is taken out of the table into [`crate::vm::Vm::running`] and `pc` and `base` are kept by
//! the interpreter; at a safepoint they are put back, and the record is all there is: no Rust frame holds any state.

use crate::control::{End, LazyControl};
use crate::limit::{AccountId, Limit};
use crate::stack::Stack;
use crate::value::Value;

/// Names a task for as long as the machine lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TaskId {
    pub(crate) index: u32,
    generation: u32,
}

/// Whether a task can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TaskState {
    /// It can, and is in a run queue or running.
    Runnable,
    /// It waits for a signal or for a time.
    Waiting,
    /// It waits for input from outside.
    Reading,
    /// It has ended, and its record is kept for the embedder.
    Ended,
}

/// The running part of a task. There may be a million of them, so what few tasks need is in [`Extra`] and in
/// [`LazyControl`], behind pointers.
pub(crate) struct Task {
    /// Its registers.
    pub stack: Stack,
    /// The next instruction, while it does not run.
    pub pc: *const u32,
    /// Its control stack and bindings.
    pub control: LazyControl,
    /// What few tasks need.
    pub extra: Option<Box<Extra>>,
    /// The object that programs know it by.
    pub object: Value,
    /// The wait at which it is parked, from then until it goes on; otherwise `NIL`.
    pub wait: Value,
    /// Who is told of its end beside those who wait for it: the wait of a net, a guard, or `NIL`.
    pub notify: Value,
    /// Ticks that it has used.
    pub ticks: u64,
    /// Changes whenever it is queued or parked, so that older places in queues and timers are told from the present one.
    pub serial: u64,
    /// The how manieth task of this machine it is.
    pub number: u64,
    /// The collector's cycle in which the stack was last scanned.
    pub scanned: u64,
    /// Offset of the running frame's base, while it does not run.
    pub base: u32,
    /// How many turns it has had.
    pub turns: u32,
    /// The account that its ticks are charged to.
    pub account: AccountId,
    /// Whether it can run.
    pub state: TaskState,
    /// From 0 to 7, most urgent last.
    pub priority: u8,
    /// How many critical sections it is in.
    pub critical: u8,
    /// See [`Flags`].
    pub flags: Flags,
}

/// Properties of a task that are true or false.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Flags(u16);

macro_rules! define_flags {
    ($( $(#[doc = $doc:literal])* $name:ident $set:ident = $bit:literal ; )*) => {
        impl Flags {
            /// All of them, as a word.
            pub(crate) const fn bits(self) -> u16 {
                self.0
            }

            $(
                $(#[doc = $doc])*
                #[inline(always)]
                pub(crate) const fn $name(self) -> bool {
                    self.0 & 1 << $bit != 0
                }

                /// Sets the flag of this name.
                #[inline(always)]
                pub(crate) fn $set(&mut self, on: bool) {
                    self.0 = self.0 & !(1 << $bit) | u16::from(on) << $bit;
                }
            )*
        }
    };
}

define_flags! {
    /// It is to be aborted as soon as it may be.
    abort_pending set_abort_pending = 0;
    /// The stack's reserve is open, because a failure for lack of stack is being handled.
    uses_reserve set_uses_reserve = 1;
    /// It does not keep the run from ending.
    daemon set_daemon = 2;
    /// It is no part of the program, but of the library.
    hidden set_hidden = 3;
    /// Its record stays after its end, for the embedder.
    kept set_kept = 4;
    /// Its turns come before those of others: it is being ended, or waited for that.
    urgent set_urgent = 5;
    /// A limit of it has expired, its cleanups have run out, or an interrupt waits: to be looked at before it goes on.
    attention set_attention = 6;
    /// It has waited twice with a stack that is much too large.
    oversized set_oversized = 7;
    /// It stands at a point, before it does what others can see: see `explore`.
    at_point set_at_point = 8;
}

/// What is to be said of a failure.
#[derive(Clone, Debug)]
pub(crate) struct FailureReport {
    /// What has happened, and where.
    pub story: String,
    /// The line that says that there is no recovery.
    pub ending: String,
}

impl FailureReport {
    /// Adds the story of a failure of a cleanup that this one has had run.
    pub(crate) fn add_cleanup(&mut self, story: &str) {
        self.story.push_str("In a cleanup after that:\n");
        self.story.push_str(story);
    }

    /// All of it.
    pub(crate) fn text(&self) -> String {
        format!("{}{}Aborted\n", self.story, self.ending)
    }
}

/// What few tasks need.
#[derive(Default)]
pub(crate) struct Extra {
    /// What is to be said of the failure that ends it.
    pub report: Option<FailureReport>,
    /// How it ended, for the embedder.
    pub end: Option<End>,
    /// What it returned, for the embedder.
    pub values: Vec<Value>,
    /// The open limits, outermost first: one for each entry of the control stack of that kind.
    pub limits: Vec<Limit>,
    /// Functions that are to run in it as soon as may be, with the guards that they come from.
    pub interrupts: Vec<Value>,
}

// SAFETY: `pc` points into a Code in the heap of the machine that owns the task, or into a static table.
#[allow(unsafe_code, reason = "the one raw pointer of a task moves with its machine")]
unsafe impl Send for Task {}

/// What became of a task, for the embedder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TaskResult {
    /// It has not ended.
    Running,
    /// It returned these values.
    Succeeded(Vec<Value>),
    /// It ended by a failure: the condition.
    Failed(Value),
    /// It was aborted.
    Aborted,
}

impl Task {
    /// A task that has yet to be given a frame.
    pub(crate) fn new(object: Value, words: usize) -> Task {
        Task::with_stack(object, Stack::new(words))
    }

    fn with_stack(object: Value, stack: Stack) -> Task {
        Task {
            stack,
            pc: std::ptr::null(),
            control: LazyControl::default(),
            extra: None,
            object,
            wait: Value::NIL,
            notify: Value::NIL,
            ticks: 0,
            serial: 0,
            number: 0,
            scanned: 0,
            base: 0,
            turns: 0,
            account: AccountId::NONE,
            state: TaskState::Runnable,
            priority: DEFAULT_PRIORITY,
            critical: 0,
            flags: Flags::default(),
        }
    }

    /// Makes a task that has ended, and holds nothing any more, a new one.
    fn renew(&mut self, object: Value) {
        let stack = std::mem::replace(&mut self.stack, Stack::none());
        *self = Task::with_stack(object, stack);
    }

    /// What few tasks need, made if it is not there.
    pub(crate) fn extra_mut(&mut self) -> &mut Extra {
        self.extra.get_or_insert_default()
    }

    /// What became of it.
    pub(crate) fn result(&self) -> TaskResult {
        let Some(extra) = &self.extra else { return TaskResult::Running };
        match extra.end {
            Some(End::Succeeded) => TaskResult::Succeeded(extra.values.clone()),
            Some(End::Failed(condition)) => TaskResult::Failed(condition),
            Some(End::Aborted) => TaskResult::Aborted,
            // A budget that was spent is noted as a failure.
            Some(End::Spent) | None => TaskResult::Running,
        }
    }
}

/// Records that are kept to be used again.
const SPARE: usize = 64;
/// The most words of stack that a record is kept with.
const SPARE_WORDS: usize = 64;
/// The priority of a task that is given none.
pub(crate) const DEFAULT_PRIORITY: u8 = 4;
/// How many priorities there are.
pub(crate) const PRIORITIES: usize = 8;

const _: () = assert!(size_of::<Task>() <= 120, "there may be a million tasks");

/// A place for a task.
#[derive(Default)]
struct Place {
    /// The task; not there while it runs, nor when the place is free.
    task: Option<Box<Task>>,
    /// How often the place was taken.
    generation: u32,
    /// Whether a task has the place.
    taken: bool,
}

/// The tasks of a machine. The running one's record is out of its place while it runs.
#[derive(Default)]
pub(crate) struct Tasks {
    places: Vec<Place>,
    free: Vec<u32>,
    /// Records of tasks that have ended, to be used again.
    #[allow(clippy::vec_box, reason = "the boxes are what is kept: they go into places as they are")]
    spare: Vec<Box<Task>>,
    /// The collector has yet to meet the tasks before this place.
    unmet: usize,
}

impl Tasks {
    /// A task that has yet to be given a frame, with at least so many words of stack.
    pub(crate) fn make(&mut self, object: Value, words: usize) -> Box<Task> {
        match self.spare.pop() {
            Some(mut task) if task.stack.capacity() >= words => {
                task.renew(object);
                task
            }
            _ => Box::new(Task::new(object, words)),
        }
    }

    /// Frees the place of a task that has ended, and keeps its record if few are kept.
    pub(crate) fn retire(&mut self, id: TaskId, task: Box<Task>) {
        self.remove(id);
        if self.spare.len() < SPARE && task.stack.capacity() <= SPARE_WORDS {
            self.spare.push(task);
        }
    }

    /// Takes in a task.
    pub(crate) fn insert(&mut self, task: Box<Task>) -> TaskId {
        let index = self.free.pop().unwrap_or_else(|| {
            self.places.push(Place::default());
            (self.places.len() - 1) as u32
        });
        let place = &mut self.places[index as usize];
        place.generation = place.generation.wrapping_add(1);
        place.taken = true;
        place.task = Some(task);
        TaskId { index, generation: place.generation }
    }

    fn place(&self, id: TaskId) -> Option<&Place> {
        self.places.get(id.index as usize).filter(|place| place.taken && place.generation == id.generation)
    }

    /// The name of the task at a place that is taken.
    pub(crate) fn id_at(&self, index: u32) -> Option<TaskId> {
        let place = self.places.get(index as usize).filter(|place| place.taken)?;
        Some(TaskId { index, generation: place.generation })
    }

    /// Whether the task is still there.
    pub(crate) fn contains(&self, id: TaskId) -> bool {
        self.place(id).is_some()
    }

    /// A task that does not run.
    pub(crate) fn get(&self, id: TaskId) -> Option<&Task> {
        self.place(id)?.task.as_deref()
    }

    /// A task that does not run.
    pub(crate) fn get_mut(&mut self, id: TaskId) -> Option<&mut Task> {
        self.places
            .get_mut(id.index as usize)
            .filter(|place| place.taken && place.generation == id.generation)?
            .task
            .as_deref_mut()
    }

    /// The task at a place, if it does not run.
    #[inline]
    pub(crate) fn at(&self, index: u32) -> Option<&Task> {
        self.places.get(index as usize)?.task.as_deref()
    }

    /// The task at a place, if it does not run.
    #[inline]
    pub(crate) fn at_mut(&mut self, index: u32) -> Option<&mut Task> {
        self.places.get_mut(index as usize)?.task.as_deref_mut()
    }

    /// Takes a task out of its place, to be run.
    #[inline]
    pub(crate) fn take(&mut self, index: u32) -> Option<Box<Task>> {
        self.places.get_mut(index as usize)?.task.take()
    }

    /// Puts a task back into its place.
    #[inline]
    pub(crate) fn put_back(&mut self, index: u32, task: Box<Task>) {
        self.places[index as usize].task = Some(task);
    }

    /// Frees the place of a task.
    pub(crate) fn remove(&mut self, id: TaskId) -> Option<Box<Task>> {
        let place = self.places.get_mut(id.index as usize)?;
        if !place.taken || place.generation != id.generation {
            return None;
        }
        place.taken = false;
        self.free.push(id.index);
        place.task.take()
    }

    /// How many places there are; each task that has not ended has one.
    pub(crate) fn places(&self) -> usize {
        self.places.len()
    }

    /// The names of all tasks, in the order of their places.
    pub(crate) fn ids(&self) -> Vec<TaskId> {
        (0..self.places.len() as u32).filter_map(|index| self.id_at(index)).collect()
    }

    /// All tasks but the running one.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Task> {
        self.places.iter().filter_map(|place| place.task.as_deref())
    }

    /// All tasks but the running one.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Task> {
        self.places.iter_mut().filter_map(|place| place.task.as_deref_mut())
    }

    /// Begins a cycle of the collector: all tasks are to be met. Those that begin later are born scanned.
    pub(crate) fn begin_cycle(&mut self) {
        self.unmet = self.places.len();
    }

    /// The next place for the collector to look at: its task, if there is one that does not run. `None` at the end.
    pub(crate) fn next_unmet(&mut self) -> Option<Option<&mut Task>> {
        self.unmet = self.unmet.checked_sub(1)?;
        Some(self.places[self.unmet].task.as_deref_mut())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn task() -> Box<Task> {
        Box::new(Task::new(Value::NIL, 1))
    }

    #[test]
    fn a_place_that_is_taken_again_has_another_name() {
        let mut tasks = Tasks::default();
        let first = tasks.insert(task());
        assert!(tasks.contains(first) && tasks.remove(first).is_some());
        let second = tasks.insert(task());
        assert_eq!(first.index, second.index);
        assert!(!tasks.contains(first) && tasks.get(first).is_none() && tasks.remove(first).is_none());
        assert_eq!(tasks.id_at(first.index), Some(second));
    }

    #[test]
    fn a_running_task_keeps_its_place() {
        let mut tasks = Tasks::default();
        let id = tasks.insert(task());
        let running = tasks.take(id.index).unwrap();
        assert!(tasks.contains(id) && tasks.get(id).is_none());
        tasks.put_back(id.index, running);
        assert!(tasks.get(id).is_some());
    }

    #[test]
    fn the_collector_meets_each_task_once() {
        let mut tasks = Tasks::default();
        let ids: Vec<TaskId> = (0..10).map(|_| tasks.insert(task())).collect();
        tasks.begin_cycle();
        let mut met = 0;
        while let Some(task) = tasks.next_unmet() {
            met += usize::from(task.is_some_and(|task| std::mem::replace(&mut task.scanned, 1) == 0));
            tasks.remove(ids[3]);
        }
        assert!(met == 9 || met == 10);
        assert!(tasks.iter().all(|task| task.scanned == 1));
    }

    #[test]
    fn flags_are_independent() {
        let mut flags = Flags::default();
        flags.set_daemon(true);
        flags.set_kept(true);
        flags.set_daemon(false);
        assert!(flags.kept() && !flags.daemon());
    }
}
