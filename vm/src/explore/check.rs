//! The task of a program that checks its conditions in each state of an exploration (`always`, `eventually`,
//! `leads-to`), and what it has found.

use super::tasks::runnable_tasks;
use crate::describe::describe;
use crate::heap::Kind;
use crate::run;
use crate::task::TaskIndex;
use crate::value::Value;
use crate::vm::Vm;

/// Most turns of that task in one state.
const CHECK_TURNS: u32 = 1_000;

/// Ticks of such a turn.
const CHECK_SLICE: u32 = 100_000;

/// Lets the task run that checks what always has to hold, if the program has one (`stdlib/exploration.esl`):
/// until it waits for the event in the variable `checks`, where it stands at first, and then from each signal
/// of that event until it waits again. It stops at no points, so that it adds no states. Returns whether its
/// turns were enough.
pub(super) fn check_state(vm: &mut Vm, checks: Value) -> bool {
    let awaited = vm.heap.symbol(checks).map_or(Value::NIL, |symbol| symbol.value);
    if awaited == Value::NIL || awaited == Value::UNBOUND || vm.outside.exit_status.is_some() {
        return true;
    }
    let object = |vm: &Vm, index| vm.scheduler.tasks.at(index).map_or(Value::NIL, |task| task.object);
    let before: Vec<TaskIndex> =
        runnable_tasks(vm).map(|(_, index)| index).filter(|&index| object(vm, index) != awaited).collect();
    // It has not begun yet, or there is an event; without room for a signal, the next state is checked.
    if !vm.heap.is(awaited, Kind::Task) && run::signal(vm, awaited, Value::NIL).is_err() {
        return true;
    }
    while !vm.scheduler.deliveries.is_empty() {
        run::deliver_some(vm);
    }
    // The reads of the conditions are not part of a schedule.
    let uses = vm.scheduler.points.uses.take();
    let grain = vm.scheduler.points.grain.take();
    let slice = std::mem::replace(&mut vm.config.slice, CHECK_SLICE);
    let mut turns = 0;
    while turns < CHECK_TURNS {
        let woken = runnable_tasks(vm).map(|(_, index)| index).find(|index| !before.contains(index));
        let Some(index) = woken else { break };
        run::give_turn(vm, index, u64::MAX);
        turns += 1;
    }
    (vm.scheduler.points.grain, vm.scheduler.points.uses, vm.config.slice) = (grain, uses, slice);
    turns < CHECK_TURNS
}

impl Vm {
    /// Returns the name of the condition of `eventually` or `leads-to` with this number.
    pub fn name_of_condition(&mut self, number: u32) -> Option<String> {
        let variable = self.names.intern_esl(&mut self.heap, "*%CONDITIONS*").ok()?;
        let mut rest = self.heap.symbol(variable)?.value;
        while let Some(pair) = self.heap.as_cons(rest) {
            let condition = self.heap.as_cons(pair.car)?;
            let bit = self.heap.as_cons(condition.cdr)?.car;
            if bit.as_fixnum() == 1_i64.checked_shl(number) {
                return Some(describe(&self.heap, condition.car));
            }
            rest = pair.cdr;
        }
        None
    }
}
