//! Suspension of trees of tasks: finding their members, and those that stand still where they wait.
//!
//! The time goes into fetching the records and the objects of tasks from memory. So each of these has a pass
//! of its own, in which the processor requests the next one while it still waits for others.

use smallvec::{SmallVec, smallvec};

use crate::builtins::LIMIT;
use crate::builtins::expect::exactly;
use crate::builtins::task::expect_task;
use crate::heap::Heap;
use crate::raise::{Exit, Outcome};
use crate::run;
use crate::task::{Rest, TaskIndex, TaskState};
use crate::value::Value;
use crate::vm::Vm;
use crate::wait::{event, lineage};

/// Returns a number that is not negative.
fn index_argument(vm: &mut Vm, v: Value) -> Result<usize, Exit> {
    match v.as_index() {
        Some(index) => Ok(index),
        None => vm.exchange.type_error(v, "UNSIGNED-BYTE"),
    }
}

/// The depths of the tasks of a tree, in which `root` has depth 1; a task that is not of the tree has 0.
/// `known` is a vector of those that are known, plus one, by the places of the tasks, and of 0 for the
/// others. Most trees are so flat that it is not looked at, and memory that is not looked at costs nothing.
#[derive(Clone, Copy)]
struct Depths {
    root: TaskIndex,
    known: Value,
}

impl Depths {
    /// Returns the depth of the task at `place`, if it is known.
    fn known(self, vm: &Vm, place: TaskIndex) -> Option<usize> {
        if place == self.root {
            return Some(1);
        }
        vm.heap.vector(self.known)?.get(place.as_usize())?.as_index()?.checked_sub(1)
    }

    /// Returns the depth of the task `object`, at `place`. Adds the number of steps to `work`.
    fn find(self, vm: &mut Vm, place: TaskIndex, object: Value, work: &mut usize) -> usize {
        if place == self.root {
            return 1;
        }
        match lineage::owner_of(&vm.heap, object) {
            // Most have been made by the root, and it takes no longer to find that again than to note it.
            Some(owner) if owner == self.root => 2,
            owner => match (self.known(vm, place), owner) {
                (Some(depth), _) => depth,
                (None, Some(owner)) => self.find_by_owner(vm, place, owner, work),
                (None, None) => 0,
            },
        }
    }

    /// Returns the depth of the task at `place`, which is known once it is that of its owner.
    fn find_by_owner(self, vm: &mut Vm, place: TaskIndex, owner: TaskIndex, work: &mut usize) -> usize {
        let mut path: SmallVec<[TaskIndex; 16]> = smallvec![place];
        let mut at = owner;
        let mut depth = loop {
            if let Some(depth) = self.known(vm, at) {
                break depth;
            }
            path.push(at);
            let task = vm.scheduler.find(at).map(|task| task.object);
            match task.and_then(|task| lineage::owner_of(&vm.heap, task)) {
                Some(owner) => at = owner,
                None => break 0,
            }
        };
        *work += path.len();
        // By reference, since a path has much room that would be moved.
        for &place in path.iter().rev() {
            depth += usize::from(depth > 0);
            vm.heap.vector_set(self.known, place.as_usize(), Value::index(depth + 1));
        }
        depth
    }
}

pub(super) fn tasks_made(vm: &mut Vm, _arguments: &[Value]) -> Outcome {
    let (made, places) = (vm.scheduler.counts.made, vm.scheduler.tasks.places());
    vm.give_values(&[Value::index(made as usize), Value::index(places)])
}

pub(super) fn tree_part(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    let [root, above, below, end, depths, generations] = exactly(arguments);
    let root = expect_task(vm, root)?;
    let Some(root) = event::task_index(&vm.heap, root) else { return Ok(Value::NIL) };
    let [above, below, end] = [above, below, end].map(|number| index_argument(vm, number));
    let (above, below, end) = (above? as u64, below? as u64, end?);
    let begin = end.saturating_sub(LIMIT);
    let depths = Depths { root, known: depths };
    let mut candidates = Vec::with_capacity(end - begin);
    // None is looked at if none was made since the last look.
    let places = if above < below { begin..end } else { end..end };
    for place in places.map(|place| TaskIndex(place as u32)) {
        let Some(task) = vm.scheduler.find(place) else { continue };
        let (number, object) = (task.number.0, task.object);
        // Of those that are newer nothing is known: their places may have been those of others.
        if task.state != TaskState::Ended && number > above && number <= below {
            candidates.push((place, object));
        }
    }
    let mut members = Vec::with_capacity(candidates.len());
    let mut work = end - begin;
    for (place, object) in candidates {
        let depth = depths.find(vm, place, object, &mut work);
        if depth > 0 {
            members.push((depth - 1, object));
        }
    }
    members.sort_by_key(|&(depth, _)| depth);
    let objects: Vec<Value> = members.iter().map(|&(_, object)| object).collect();
    // All lists are made before one is noted.
    let (mut lists, mut start) = (SmallVec::<[(usize, Value); 16]>::new(), 0);
    for run in members.chunk_by(|left, right| left.0 == right.0) {
        let depth = run[0].0;
        let others = vm.heap.vector(generations).and_then(|lists| lists.get(depth).copied());
        let end = start + run.len();
        let tail = others.filter(|others| others.is_cons()).unwrap_or(Value::NIL);
        let list = vm.heap.list_with_tail(&objects[start..end], tail)?;
        lists.push((depth, list));
        start = end;
    }
    for &(depth, list) in &lists {
        vm.heap.vector_set(generations, depth, list);
    }
    vm.exchange.charge(16 * (work + members.len()));
    let deepest = members.last().map_or(0, |&(depth, _)| depth + 1);
    vm.give_values(&[Value::index(begin), Value::index(deepest)])
}

/// The first tasks of a list, as many as a builtin sees to at once.
struct ListedTasks {
    objects: Vec<Value>,
    /// Their places; [`TaskIndex::NONE`] for those that have ended.
    places: Vec<TaskIndex>,
    /// The rest of the list.
    rest: Value,
}

impl ListedTasks {
    /// Returns the first tasks of `list`, up to the cell `end`.
    fn new(heap: &Heap, list: Value, end: Value) -> ListedTasks {
        let mut objects = Vec::with_capacity(LIMIT);
        let mut rest = list;
        while objects.len() < LIMIT
            && rest != end
            && let Some(pair) = heap.as_cons(rest)
        {
            objects.push(pair.car);
            rest = pair.cdr;
        }
        let place = |&object: &Value| event::task_index(heap, object).unwrap_or(TaskIndex::NONE);
        let places = objects.iter().map(place).collect();
        ListedTasks { objects, places, rest }
    }

    /// Returns the places of those that are or can be at rest, and the others.
    fn divide(&self, rests: impl Fn(TaskIndex) -> bool) -> (Vec<TaskIndex>, Vec<Value>) {
        let (mut resting, mut others) = (Vec::with_capacity(self.places.len()), Vec::new());
        for (&place, &task) in self.places.iter().zip(&self.objects) {
            if rests(place) {
                resting.push(place);
            } else if place != TaskIndex::NONE {
                others.push(task);
            }
        }
        (resting, others)
    }
}

pub(super) fn begin_rest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [tasks, stops_clock] = exactly(arguments);
    let tasks = ListedTasks::new(&vm.heap, tasks, Value::NIL);
    let (resting, others) = tasks.divide(|place| run::can_rest(vm, place));
    let others = vm.heap.list(&others)?;
    vm.exchange.charge(64 * resting.len());
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    run::begin_rest(vm, &resting, stops_clock.is_true(), now);
    vm.give_values(&[others, tasks.rest])
}

pub(super) fn resume_from_rest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [tasks, end] = exactly(arguments);
    let tasks = ListedTasks::new(&vm.heap, tasks, end);
    let (resting, others) = tasks.divide(|place| vm.scheduler.tasks.rest(place) != Rest::None);
    let others = vm.heap.list(&others)?;
    vm.exchange.charge(64 * resting.len());
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    run::resume_from_rest(vm, &resting, now);
    vm.give_values(&[tasks.rest, others])
}

pub(super) fn end_rest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let task = expect_task(vm, arguments[0])?;
    let Some(index) = event::task_index(&vm.heap, task) else { return Ok(Value::small(0)) };
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    Ok(Value::index(run::end_rest(vm, index, now) as usize))
}
