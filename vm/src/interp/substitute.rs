//! Results: where the values go that a call returns, and those that stand for the result of a failed
//! instruction.
//!
//! Values arrive in the value list. A call's go to its window. A substitute goes where the row of the failed
//! instruction in the opcode table says, and control goes on behind the instruction. The function that
//! computes the substitute runs in a frame above the failed instruction, whose pc is saved between the two:
//!
//! ```text
//! registers of the frame with the failed instruction | its pc | %raise | return pc, a stub | arguments ...
//! ```
//!
//! The stub's `error-return` finds the instruction by the saved pc. The same way serves an instruction whose
//! work a function of the library takes over, and one that asks for a call.

use esl_bytecode::opcode::Substitute;

use super::{Signal, aux_at, code_of, pc_from_value, stubs, word_at};
use crate::value::Value;
use crate::vm::Vm;

/// Delivers the value list to a call window.
///
/// # Safety
/// The window is in the running frame, with as many registers as `want` says (V3).
pub(super) unsafe fn deliver(vm: &mut Vm, window: *mut Value, want: usize) {
    let count = if want == 0 || want == 255 { 1 } else { want };
    for i in 0..count {
        // SAFETY: by the contract the window has so many registers.
        unsafe { *window.add(i) = vm.exchange.values.get(i).copied().unwrap_or(Value::NIL) };
    }
}

/// Returns the value list from the running frame.
///
/// # Safety
/// The contract of [`super::settle`].
pub(super) unsafe fn return_all(vm: &mut Vm) -> Signal {
    // SAFETY: F2: the link leads behind a call word whose window begins with the link; V3: the window has the
    // registers that the call wants.
    unsafe {
        let base = vm.cpu.base();
        let return_to = pc_from_value(*base.sub(1));
        let call = word_at(return_to.sub(2));
        let window = base.sub(2);
        vm.cpu.set_base(window.sub(call.a()));
        vm.cpu.set_pc(return_to);
        // A return to a wanted number of values may be to fewer registers than there are values.
        deliver(vm, window, call.c());
    }
    Signal::Reload
}

/// Puts the value list in the place of the result of the instruction at `vm.cpu.pc()`, and goes on behind it.
///
/// # Safety
/// The contract of [`super::settle`], at an instruction.
pub(super) unsafe fn substitute(vm: &mut Vm) -> Signal {
    // SAFETY: V1, V2: the instruction has an aux word and a target if its row says so; V3: its operand and
    // its window are registers of the frame.
    unsafe {
        let (pc, base) = (vm.cpu.pc(), vm.cpu.base());
        let word = word_at(pc);
        let value = vm.exchange.values.first().copied().unwrap_or(Value::NIL);
        let Some(opcode) = word.opcode() else { return Signal::Next };
        match opcode.substitute() {
            Substitute::Value => *base.add(word.a()) = value,
            Substitute::Effect | Substitute::Silent => {}
            // Nothing can stand for what the instruction was to do: it is tried again.
            Substitute::Never => return Signal::Reload,
            Substitute::Test | Substitute::TestNot => {
                if value.is_true() == opcode.jumps_when() {
                    vm.cpu.set_pc(pc.add(2).offset(aux_at(pc) as i32 as isize));
                    return Signal::Reload;
                }
            }
            Substitute::Call => deliver(vm, base.add(word.a()), word.c()),
            Substitute::Tail => return Signal::ReturnAll,
        }
        vm.cpu.set_pc(pc.add(stubs::length(word)));
        Signal::Reload
    }
}

/// `error-return`: the value list holds what the function above the frame has returned.
///
/// # Safety
/// The contract of [`super::settle`], at the stub.
pub(super) unsafe fn error_return(vm: &mut Vm, base: *mut Value) -> Signal {
    // SAFETY: F3: the stub is the return address of a function that `call` has put above this frame; its pc
    // is saved, and is that of an instruction.
    unsafe {
        resume_below(vm, base);
        substitute(vm)
    }
}

/// Makes the frame at `base`, above which a function has run, the running one, at its saved pc.
///
/// # Safety
/// `base` is that of a frame above which `call` has put a function: its pc is saved behind its registers.
pub(super) unsafe fn resume_below(vm: &mut Vm, base: *mut Value) {
    // SAFETY: F3: by the contract the pc is in the word behind the registers.
    unsafe {
        let registers = (*code_of(*base.sub(2))).nregs as usize;
        vm.cpu.set_base(base);
        vm.cpu.set_pc(pc_from_value(*base.add(registers)));
    }
}
