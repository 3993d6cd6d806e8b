//! Asking tasks to end.

use super::rest::end_rest;
use super::wake::call_attention;
use crate::report::{self, Happening};
use crate::schedule::EndOfAll;
use crate::task::{Rest, TaskId, TaskNumber, TaskState};
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
        // Nothing but its end reaches one at rest, and that does.
        if self.scheduler.tasks.rest(id.index) != Rest::None {
            let now = self.scheduler.clock.read(&mut self.outside.host);
            end_rest(self, id.index, now);
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

/// Asks every task but the running one to end, the newest first. Where there are many, the rest are asked
/// between turns, and only those that are being ended have turns until then.
pub(crate) fn abort_others(vm: &mut Vm) {
    let tasks = &vm.scheduler.tasks;
    let alive = tasks.ids().into_iter().filter_map(|id| {
        let task = tasks.get(id).filter(|task| task.state != TaskState::Ended)?;
        Some((task.number, id))
    });
    let mut alive: Vec<(TaskNumber, TaskId)> = alive.collect();
    alive.sort_unstable_by_key(|&(number, _)| number);
    vm.scheduler.end_of_all = Some(EndOfAll { left: alive.into_iter().map(|(_, id)| id).collect() });
    vm.scheduler.counts.made_at_end = vm.scheduler.counts.made;
    abort_more(vm);
    if vm.scheduler.end_of_all.is_some()
        && let Some(task) = &mut vm.scheduler.running
    {
        task.flags.set_urgent(true);
    }
}

/// Asks the next tasks to end, if all are to.
pub(super) fn abort_more(vm: &mut Vm) {
    let Some(mut all) = vm.scheduler.end_of_all.take() else { return };
    let next = all.left.split_off(all.left.len().saturating_sub(AT_ONCE));
    next.into_iter().rev().for_each(|id| vm.abort(id));
    vm.scheduler.end_of_all = (!all.left.is_empty()).then_some(all);
}
