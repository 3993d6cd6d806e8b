//! Asking tasks to end.

use super::wake::call_attention;
use crate::report::{self, Happening};
use crate::schedule::EndOfAll;
use crate::task::{TaskId, TaskIndex, TaskNumber, TaskState};
use crate::vm::Vm;

/// Tasks that are asked to end in one step.
const AT_ONCE: usize = 1000;

impl Vm {
    /// Asks a task to end, wherever it is. It unwinds, and runs its cleanups, within two slices; inside a
    /// cleanup or a critical section the request waits for its end.
    pub fn abort(&mut self, id: TaskId) {
        if !self.scheduler.tasks.contains(id) {
            return;
        }
        if let Some(task) = self.scheduler.find_mut(id.index)
            && task.state != TaskState::Ended
        {
            task.flags.set_abort_pending(true);
            report::note(self, id.index, Happening::IsToEnd);
            call_attention(self, id.index);
        }
    }

    /// Asks every task to end, as if the program had asked to end.
    pub fn abort_all(&mut self) {
        abort_others(self);
    }
}

/// Asks every task but the running one to end. Where there are many, the rest are asked between turns, and
/// only those that are being ended have turns until then.
pub(crate) fn abort_others(vm: &mut Vm) {
    let except = vm.scheduler.running_number();
    let newest = TaskNumber(vm.scheduler.counts.made);
    vm.scheduler.end_of_all = Some(EndOfAll { next: 0, newest, except });
    abort_more(vm);
    if vm.scheduler.end_of_all.is_some()
        && let Some(task) = &mut vm.scheduler.running
    {
        task.flags.set_urgent(true);
    }
}

/// Asks the next tasks to end, if all are to.
pub(super) fn abort_more(vm: &mut Vm) {
    let Some(all) = vm.scheduler.end_of_all else { return };
    let end = vm.scheduler.tasks.places().min(all.next + AT_ONCE);
    for index in all.next..end {
        let index = TaskIndex(index as u32);
        if let Some(task) = vm.scheduler.tasks.at(index)
            && task.number <= all.newest
            && task.number != all.except
            && let Some(id) = vm.scheduler.tasks.id_at(index)
        {
            vm.abort(id);
        }
    }
    let is_over = end == vm.scheduler.tasks.places();
    vm.scheduler.end_of_all = if is_over { None } else { Some(EndOfAll { next: end, ..all }) };
}
