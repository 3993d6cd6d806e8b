//! Functions that run where a task was interrupted: a call above its frame that leaves the instruction there,
//! and the wait at which it was parked, as they were.

use super::Signal;
use super::call::{FramePlace, call};
use super::substitute::resume_below;
use crate::saved_pc::SavedPc;
use crate::task::{Binding, Entry, EntryKind};
use crate::value::Value;
use crate::vm::Vm;

/// Calls a function where the running task stands, before the instruction there. It has the rights `lent`, or
/// those of the place without them.
///
/// # Safety
/// The contract of [`super::settle`], at an instruction that has had no effect yet.
pub(super) unsafe fn interrupt(
    vm: &mut Vm,
    function: Value,
    arguments: &[Value],
    lent: Option<Value>,
) -> Signal {
    let base = vm.offset_of(vm.cpu.base()) as u32;
    let task = vm.scheduler.task_mut();
    let wait = std::mem::replace(&mut task.wait, Value::NIL);
    let bindings = task.control.bindings.len() as u32;
    let kind = EntryKind::Interrupt;
    let entry = Entry { data: wait, pc: SavedPc::NONE, base, bindings, window: 0, want: 0, kind };
    task.control.entries.push(entry);
    if let Some(value) = lent {
        task.control.bindings.push(Binding { symbol: vm.names.rights, value, base });
    }
    // SAFETY: F1 holds by the contract, and a frame above the running one needs no window.
    unsafe { call(vm, function, arguments, FramePlace::Interrupt) }
}

/// `interrupt-return`: the function that ran where the task was interrupted has returned. The instruction
/// there, which has had no effect yet, comes next, and a wait at which the task was parked goes on.
///
/// # Safety
/// The contract of [`super::settle`], at the stub.
pub(super) unsafe fn interrupt_return(vm: &mut Vm, base: *mut Value) -> Signal {
    // SAFETY: F3: the stub is the return address of a function that `interrupt` has put above this frame.
    unsafe { resume_below(vm, base) };
    vm.restore_wait();
    Signal::Reload
}

impl Vm {
    /// Ends an interrupt of the running task: it is at the wait at which it was parked again.
    pub(super) fn restore_wait(&mut self) {
        let task = self.scheduler.task_mut();
        if let Some(entry) = task.control.entries.pop() {
            debug_assert_eq!(entry.kind, EntryKind::Interrupt);
            task.wait = entry.data;
            task.control.bindings.truncate(entry.bindings as usize);
        }
    }
}
