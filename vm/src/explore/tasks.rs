//! The tasks of a machine that stands at a point, and the uses of their variables.

use smallvec::SmallVec;

use super::step::is_of_library;
use crate::heap::Kind;
use crate::heap::layout::SymbolObject;
use crate::schedule::Due;
use crate::task::{Control, EntryKind, Task, TaskIndex, TaskNumber, TaskState, UnwindTarget};
use crate::vm::Vm;

/// Returns whether a task is on its way to its end.
pub(super) fn ends(task: &Task) -> bool {
    let unwinding = task.control.get().and_then(|control| control.unwinding.as_ref());
    unwinding.is_some_and(|unwinding| matches!(unwinding.target, UnwindTarget::Root(_)))
}

/// Returns the time if a task stands at a tick: there it may hold a time that the library has read, such as
/// the deadline of a sleep, of which relative times do not tell whether it has passed.
pub(super) fn time_at_ticks(vm: &Vm) -> u64 {
    let stands_at_tick = |(_, index)| vm.scheduler.tasks.at(index).is_some_and(|task| task.flags.at_tick());
    if runnable_tasks(vm).any(stands_at_tick) { vm.scheduler.clock.now } else { 0 }
}

/// Makes all uses of the program's special variables known. Those of the library are its own business: it
/// protects them.
pub(super) fn watch_variables(vm: &mut Vm) {
    let mut watched = Vec::new();
    vm.names.each_symbol(&mut |symbol, object| {
        if !is_of_library(symbol)
            && vm.heap.symbol(object).is_some_and(|cell| cell.header.flags & NOT_WATCHED == 0)
        {
            watched.push(object);
        }
    });
    for object in watched {
        let flags = vm.heap.symbol(object).map_or(0, |cell| cell.header.flags);
        vm.heap.set_flags(object, Kind::Symbol, flags | SymbolObject::EVER_BOUND);
    }
}

/// Flags of symbols that have no variable, or one whose uses are known already.
const NOT_WATCHED: u8 = SymbolObject::CONSTANT | SymbolObject::EVER_BOUND;

/// Returns whether it makes a difference at which place a task is asked to end, or to leave a form: a cleanup
/// runs then, or the form is followed by others, which may use variables of the task.
pub(super) fn depends_on_place(control: &Control) -> bool {
    let depends = |kind| {
        matches!(kind, EntryKind::Cleanup | EntryKind::Running | EntryKind::Limit | EntryKind::Interrupt)
    };
    control.entries.iter().any(|entry| depends(entry.kind))
}

/// Returns whether time may pass while tasks can run. A cleanup takes no longer than it may: otherwise each
/// that waits would be found to be cut off somewhere.
pub(super) fn time_may_pass(vm: &mut Vm) -> bool {
    vm.scheduler.first_timer().is_some()
        && vm.scheduler.timers.first().is_some_and(|timer| timer.due != Due::Cleanup)
}

/// Returns the numbers and places of the tasks that can run.
pub(super) fn runnable_tasks(vm: &Vm) -> impl Iterator<Item = (TaskNumber, TaskIndex)> + '_ {
    let ids = vm.scheduler.tasks.ids().into_iter();
    ids.filter_map(|id| {
        let task = vm.scheduler.tasks.get(id).filter(|task| task.state == TaskState::Runnable)?;
        Some((task.number, id.index))
    })
}

/// Returns the numbers of the tasks that have not ended, oldest first, and which of the first 63 can run.
pub(super) fn living_tasks(vm: &Vm) -> (SmallVec<[TaskNumber; 16]>, u64) {
    let living = vm.scheduler.tasks.iter().filter(|task| task.state != TaskState::Ended);
    let mut tasks: SmallVec<[(TaskNumber, bool); 16]> =
        living.map(|task| (task.number, task.state == TaskState::Runnable)).collect();
    tasks.sort_unstable();
    let able = tasks.iter().take(63).enumerate().filter(|(_, (_, is_able))| *is_able);
    let able = able.fold(0, |able, (rank, _)| able | 1 << rank);
    (tasks.into_iter().map(|(number, _)| number).collect(), able)
}
