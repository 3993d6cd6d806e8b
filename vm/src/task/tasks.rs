//! The table of a machine's tasks.

use esl_heap::list_state;
use esl_heap::stored;

use super::{Extra, Rest, Standstill, Task, TaskIndex};
use crate::heap::{Heap, Holder};
use crate::stack::Stack;
use crate::value::Value;

/// Name of a task, good for as long as the machine lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TaskId {
    /// Index in the table.
    pub(crate) index: TaskIndex,
    /// Number of tasks that have had this index, up to this one.
    generation: u32,
}

/// Maximal number of records kept to be used again.
const SPARE: usize = 64;
/// Maximal number of rarely used parts kept to be used again: calls from outside come one after another.
const SPARE_EXTRA: usize = 4;
/// Maximal number of words of stack that a record is kept with.
const SPARE_WORDS: usize = 64;
/// Place of a task in the table.
#[derive(Clone, Default)]
struct TaskPlace {
    /// Task; `None` while it runs, and when the place is free.
    task: Option<Box<Task>>,
    /// Number of tasks that have had the place.
    generation: u32,
    /// Whether a task has the place.
    taken: bool,
    /// Whether it is at rest.
    rest: Rest,
}

/// Table of a machine's tasks. The record of the running task is out of its place.
#[derive(Clone, Default)]
pub(crate) struct Tasks {
    places: Vec<TaskPlace>,
    /// Standstills of the tasks at the first places; those behind were never suspended.
    standstills: Vec<Standstill>,
    free: Vec<u32>,
    /// Records of tasks that have ended, to be used again.
    #[allow(clippy::vec_box, reason = "the boxes are kept, since they go into places as they are")]
    spare: Vec<Box<Task>>,
    /// Rarely used parts of such records, to be used again.
    #[allow(clippy::vec_box, reason = "the boxes are kept, since they go into records as they are")]
    spare_extra: Vec<Box<Extra>>,
    /// Number of places, from the first on, that the collector has yet to look at.
    unmet: usize,
    /// Large stacks of tasks that have ended, to be freed.
    discarded: Vec<Stack>,
}

list_state! { TaskId { index: Run, generation: Run } }
list_state! { TaskPlace { task: Visited, generation: Run, taken: Run, rest: Run } }
list_state! { Tasks {
    places: Run,
    standstills: Run,
    free: Run,
    spare: Derived,
    spare_extra: Derived,
    unmet: Derived,
    discarded: Derived,
} }

impl Tasks {
    /// Creates a task that has yet to be given a frame, with at least so many words of stack.
    pub(crate) fn make(&mut self, heap: &mut Heap, object: Value, words: usize) -> Box<Task> {
        if let Some(mut task) = self.spare.pop() {
            if task.stack.capacity() >= words {
                task.renew(object);
                return task;
            }
            task.uncount(heap);
        }
        Box::new(Task::new(object, words))
    }

    /// Frees the place of a task that has ended, and keeps its record if few are kept. The heap goes on
    /// counting one that is kept.
    pub(crate) fn retire(&mut self, heap: &mut Heap, id: TaskId, task: Box<Task>) {
        self.remove(id);
        self.keep_spare(heap, task);
    }

    /// Keeps the record of a task that has ended, which has no place any more, if few are kept.
    pub(crate) fn keep_spare(&mut self, heap: &mut Heap, mut task: Box<Task>) {
        if let Some(mut extra) = task.extra.take()
            && self.spare_extra.len() < SPARE_EXTRA
            && extra.clear()
        {
            self.spare_extra.push(extra);
        }
        if self.spare.len() < SPARE && task.stack.capacity() <= SPARE_WORDS {
            self.spare.push(task);
        } else {
            task.uncount(heap);
        }
    }

    /// Returns the rarely used parts for a record, without contents.
    pub(crate) fn make_extra(&mut self) -> Box<Extra> {
        self.spare_extra.pop().unwrap_or_default()
    }

    /// Takes the large stack of a task that has ended, to free it piece by piece.
    pub(crate) fn discard(&mut self, stack: Stack) {
        self.discarded.push(stack);
    }

    /// Returns the bytes that all tasks take.
    pub(crate) fn bytes(&self) -> usize {
        self.iter().map(Task::bytes).sum()
    }

    /// Returns whether nothing is left to be freed.
    pub(crate) fn has_freed_all(&self) -> bool {
        self.discarded.is_empty()
    }

    /// Frees a piece of a stack that was discarded. Returns whether there was one.
    #[inline]
    pub(crate) fn free_some(&mut self) -> bool {
        let Some(stack) = self.discarded.last_mut() else { return false };
        let before = stack.capacity();
        stack.shrink(0);
        if stack.capacity() == before {
            self.discarded.pop();
        }
        true
    }

    /// Adds a task, and returns its name.
    pub(crate) fn insert(&mut self, task: Box<Task>) -> TaskId {
        let index = self.free.pop().unwrap_or_else(|| {
            self.places.push(TaskPlace::default());
            (self.places.len() - 1) as u32
        });
        let index = TaskIndex(index);
        let place = &mut self.places[index.as_usize()];
        place.generation = place.generation.wrapping_add(1);
        place.taken = true;
        place.task = Some(task);
        TaskId { index, generation: place.generation }
    }

    fn place(&self, id: TaskId) -> Option<&TaskPlace> {
        self.places.get(id.index.as_usize()).filter(|place| place.taken && place.generation == id.generation)
    }

    /// Returns the name of the task with this index.
    pub(crate) fn id_at(&self, index: TaskIndex) -> Option<TaskId> {
        let place = self.places.get(index.as_usize()).filter(|place| place.taken)?;
        Some(TaskId { index, generation: place.generation })
    }

    /// Returns whether the task is still there.
    pub(crate) fn contains(&self, id: TaskId) -> bool {
        self.place(id).is_some()
    }

    /// Returns a task, unless it runs.
    pub(crate) fn get(&self, id: TaskId) -> Option<&Task> {
        self.place(id)?.task.as_deref()
    }

    /// Returns a task, unless it runs.
    pub(crate) fn get_mut(&mut self, id: TaskId) -> Option<&mut Task> {
        self.places
            .get_mut(id.index.as_usize())
            .filter(|place| place.taken && place.generation == id.generation)?
            .task
            .as_deref_mut()
    }

    /// Returns the task with this index, unless it runs.
    #[inline]
    pub(crate) fn at(&self, index: TaskIndex) -> Option<&Task> {
        self.places.get(index.as_usize())?.task.as_deref()
    }

    /// Returns the task with this index, unless it runs.
    #[inline]
    pub(crate) fn at_mut(&mut self, index: TaskIndex) -> Option<&mut Task> {
        self.places.get_mut(index.as_usize())?.task.as_deref_mut()
    }

    /// Returns the task with this index, which is to go on, unless it runs or is at rest. Of one at rest that
    /// is noted.
    #[inline(always)]
    pub(crate) fn wake_up(&mut self, index: TaskIndex) -> Option<&mut Task> {
        let place = self.places.get_mut(index.as_usize())?;
        if place.rest != Rest::None {
            place.rest = Rest::Woken;
            return None;
        }
        place.task.as_deref_mut()
    }

    /// Takes a task out of its place, to be run.
    #[inline]
    pub(crate) fn take(&mut self, index: TaskIndex) -> Option<Box<Task>> {
        self.places.get_mut(index.as_usize())?.task.take()
    }

    /// Puts a task back into its place.
    #[inline]
    pub(crate) fn put_back(&mut self, index: TaskIndex, task: Box<Task>) {
        self.places[index.as_usize()].task = Some(task);
    }

    /// Frees the place of a task.
    pub(crate) fn remove(&mut self, id: TaskId) -> Option<Box<Task>> {
        let place = self.places.get_mut(id.index.as_usize())?;
        if !place.taken || place.generation != id.generation {
            return None;
        }
        place.taken = false;
        place.rest = Rest::None;
        self.free.push(id.index.0);
        if let Some(standstill) = self.standstills.get_mut(id.index.as_usize()) {
            *standstill = Standstill::NONE;
        }
        place.task.take()
    }

    /// Returns the standstill of the task with this index.
    #[inline]
    pub(crate) fn standstill(&self, index: TaskIndex) -> &Standstill {
        self.standstills.get(index.as_usize()).unwrap_or(&Standstill::NONE)
    }

    /// Returns the standstill of the task with this index, to be changed.
    pub(crate) fn standstill_mut(&mut self, heap: &mut Heap, index: TaskIndex) -> &mut Standstill {
        self.make_standstills(heap);
        &mut self.standstills[index.as_usize()]
    }

    /// Returns whether the task with this index is at rest.
    #[inline(always)]
    pub(crate) fn rest(&self, index: TaskIndex) -> Rest {
        self.places.get(index.as_usize()).map_or(Rest::None, |place| place.rest)
    }

    /// Returns whether the task with this index is at rest, to be changed, and its standstill, if there is
    /// one for its place, unless it runs.
    #[inline(always)]
    pub(crate) fn rest_mut(&mut self, index: TaskIndex) -> Option<(&mut Rest, &mut Standstill)> {
        let place = self.places.get_mut(index.as_usize()).filter(|place| place.task.is_some())?;
        Some((&mut place.rest, self.standstills.get_mut(index.as_usize())?))
    }

    /// Makes a standstill for each place, and has the heap count them.
    pub(crate) fn make_standstills(&mut self, heap: &mut Heap) {
        if self.standstills.len() == self.places.len() {
            return;
        }
        let bytes = |list: &Vec<Standstill>| list.capacity() * size_of::<Standstill>();
        let before = bytes(&self.standstills);
        self.standstills.resize(self.places.len(), Standstill::NONE);
        heap.recount_external(Holder::Tasks, before, bytes(&self.standstills));
    }

    /// Calls `visit` with every value of the standstills.
    pub(crate) fn visit_standstills(&self, visit: &mut dyn FnMut(Value)) {
        self.standstills.iter().map(|standstill| standstill.by).for_each(visit);
    }

    /// Returns the number of places; each task that has not ended has one.
    pub(crate) fn places(&self) -> usize {
        self.places.len()
    }

    /// Returns the names of all tasks, by index.
    pub(crate) fn ids(&self) -> Vec<TaskId> {
        (0..self.places.len() as u32).filter_map(|index| self.id_at(TaskIndex(index))).collect()
    }

    /// Returns all tasks but the running one.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Task> {
        self.places.iter().filter_map(|place| place.task.as_deref())
    }

    /// Returns all tasks but the running one.
    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut Task> {
        self.places.iter_mut().filter_map(|place| place.task.as_deref_mut())
    }

    /// Begins a cycle of the collector: all tasks are to be met. Those that begin later are born scanned.
    pub(crate) fn begin_cycle(&mut self) {
        self.unmet = self.places.len();
    }

    /// Returns the task at the next place for the collector to look at, unless it runs, and what its
    /// standstill holds. `None` at the end.
    pub(crate) fn next_unmet(&mut self) -> Option<(Option<&mut Task>, Value)> {
        self.unmet = self.unmet.checked_sub(1)?;
        let held = self.standstill(TaskIndex(self.unmet as u32)).by;
        Some((self.places[self.unmet].task.as_deref_mut(), held))
    }

    /// Has the collector look again at the place that it has looked at last.
    pub(crate) fn meet_again(&mut self) {
        self.unmet += 1;
    }
}

stored! { TaskId { index, generation } }
stored! { TaskPlace { task, generation, taken, rest } }
stored! { Tasks { places, standstills, free, spare, spare_extra, unmet, discarded } }

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trust::heap_for_tests;

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
    fn that_a_task_at_rest_was_to_go_on_is_noted_until_it_ends() {
        let (mut tasks, mut heap) = (Tasks::default(), heap_for_tests());
        let id = tasks.insert(task());
        assert!(tasks.wake_up(id.index).is_some() && tasks.rest_mut(id.index).is_none());
        tasks.make_standstills(&mut heap);
        *tasks.rest_mut(id.index).unwrap().0 = Rest::Rests;
        assert!(tasks.wake_up(id.index).is_none());
        assert_eq!(tasks.rest(id.index), Rest::Woken);
        tasks.remove(id);
        let next = tasks.insert(task());
        assert_eq!((next.index, tasks.rest(next.index)), (id.index, Rest::None));
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
        while let Some((task, _)) = tasks.next_unmet() {
            met += usize::from(task.is_some_and(|task| std::mem::replace(&mut task.scanned, 1) == 0));
            tasks.remove(ids[3]);
        }
        assert!(met == 9 || met == 10);
        assert!(tasks.iter().all(|task| task.scanned == 1));
    }
}
