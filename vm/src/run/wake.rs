//! Making tasks runnable.

use crate::report::{self, Happening};
use crate::task::{TaskIndex, TaskState};
use crate::vm::Vm;

/// Makes a parked task runnable, or moves a runnable one to the urgent ones.
#[inline]
pub(crate) fn make_runnable(vm: &mut Vm, index: TaskIndex, urgent: bool) {
    if vm.scheduler.make_runnable(index, urgent) {
        report::note(vm, index, Happening::GoesOn);
    }
}

/// Has what was noted of a task seen to before the task goes on, whatever it does: a parked task becomes
/// runnable, the running one ends its slice.
pub(super) fn call_attention(vm: &mut Vm, index: TaskIndex) {
    if vm.scheduler.is_running(index) {
        vm.scheduler.task_mut().flags.set_attention(true);
        vm.exchange.charges.end_slice();
        return;
    }
    let Some(task) = vm.scheduler.tasks.at_mut(index) else { return };
    if task.state != TaskState::Ended {
        task.flags.set_attention(true);
        vm.scheduler.points.note_request(index, task.state == TaskState::Runnable);
        make_runnable(vm, index, true);
    }
}
