//! Suspension of trees of tasks: finding their members, and those that stand still where they wait.

use smallvec::SmallVec;

use crate::builtins::LIMIT;
use crate::builtins::expect::exactly;
use crate::builtins::task::expect_task;
use crate::raise::{Exit, Outcome};
use crate::run;
use crate::task::{TaskIndex, TaskState};
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

/// Returns the depth of the task `object`, at `place`, in the tree of the task `root`, which has depth 1; 0
/// if it is not of that tree. `depths` is a vector of those that are known, by the places of the tasks. Adds
/// the number of steps to `work`.
fn depth_of(
    vm: &mut Vm,
    root: usize,
    (place, object): (usize, Value),
    depths: Value,
    work: &mut usize,
) -> usize {
    let mut path: SmallVec<[usize; 16]> = SmallVec::new();
    let (mut at, mut known_object) = (place, Some(object));
    let mut depth = loop {
        if at == root {
            break 1;
        }
        let known = vm.heap.vector(depths).and_then(|depths| depths.get(at)?.as_index());
        if let Some(depth) = known {
            break depth;
        }
        path.push(at);
        let find = || vm.scheduler.find(TaskIndex(at as u32)).map(|task| task.object);
        match known_object.take().or_else(find).and_then(|task| lineage::owner_of(&vm.heap, task)) {
            Some(owner) => at = owner.as_usize(),
            None => break 0,
        }
    };
    *work += path.len();
    // By reference, since a path has much room that would be moved.
    for &place in path.iter().rev() {
        depth += usize::from(depth > 0);
        vm.heap.vector_set(depths, place, Value::index(depth));
    }
    depth
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
    let mut members = Vec::new();
    let mut work = end - begin;
    for place in (begin..end).rev() {
        let Some(task) = vm.scheduler.find(TaskIndex(place as u32)) else { continue };
        let (number, object) = (task.number.0, task.object);
        // Of those that are newer nothing is known: their places may have been those of others.
        if task.state == TaskState::Ended || number <= above || number > below {
            continue;
        }
        let depth = depth_of(vm, root.as_usize(), (place, object), depths, &mut work);
        if depth > 0 {
            members.push((depth - 1, object));
        }
    }
    let objects: Vec<Value> = members.iter().map(|&(_, object)| object).collect();
    let mut cells = vm.heap.list(&objects)?;
    vm.exchange.charge(16 * (work + members.len()));
    let deepest = members.iter().map(|&(depth, _)| depth + 1).max().unwrap_or(0);
    for (depth, _) in members {
        let Some(pair) = vm.heap.as_cons(cells) else { break };
        let others = vm.heap.vector(generations).and_then(|lists| lists.get(depth).copied());
        vm.heap.set_cdr(cells, others.unwrap_or(Value::NIL));
        vm.heap.vector_set(generations, depth, cells);
        cells = pair.cdr;
    }
    vm.give_values(&[Value::index(begin), Value::index(deepest)])
}

pub(super) fn begin_rest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [tasks, stops_clock] = exactly(arguments);
    let (mut resting, mut others) = (Vec::new(), Vec::new());
    let mut rest = tasks;
    for _ in 0..LIMIT {
        let Some(pair) = vm.heap.as_cons(rest) else { break };
        rest = pair.cdr;
        let task = expect_task(vm, pair.car)?;
        let Some(index) = event::task_index(&vm.heap, task) else { continue };
        match vm.scheduler.tasks.at(index) {
            Some(task) if run::can_rest(vm, task) => resting.push(index),
            _ => others.push(task),
        }
    }
    let others = vm.heap.list(&others)?;
    vm.exchange.charge(64 * resting.len());
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    for index in resting {
        run::begin_rest(vm, index, stops_clock.is_true(), now);
    }
    vm.give_values(&[others, rest])
}

pub(super) fn resume_from_rest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let [tasks, end] = exactly(arguments);
    let (mut resting, mut others) = (Vec::new(), Vec::new());
    let mut rest = tasks;
    for _ in 0..LIMIT {
        let Some(pair) = vm.heap.as_cons(rest).filter(|_| rest != end) else { break };
        rest = pair.cdr;
        let task = expect_task(vm, pair.car)?;
        let Some(index) = event::task_index(&vm.heap, task) else { continue };
        match vm.scheduler.find(index) {
            Some(task) if task.flags.rests() => resting.push(index),
            _ => others.push(task),
        }
    }
    let others = vm.heap.list(&others)?;
    vm.exchange.charge(64 * resting.len());
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    for index in resting {
        run::resume_from_rest(vm, index, now);
    }
    vm.give_values(&[rest, others])
}

pub(super) fn end_rest(vm: &mut Vm, arguments: &[Value]) -> Outcome {
    vm.scheduler.point()?;
    let task = expect_task(vm, arguments[0])?;
    let Some(index) = event::task_index(&vm.heap, task) else { return Ok(Value::small(0)) };
    let now = vm.scheduler.clock.read(&mut vm.outside.host);
    Ok(Value::index(run::end_rest(vm, index, now) as usize))
}
