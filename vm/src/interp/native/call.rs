//! Calls from machine code of others than functions that take exactly the given arguments: the arguments are
//! put in order first, or a builtin is called.

use esl_native::NativeContext;
use esl_native::abi::{CALL_AGAIN, CALL_DONE, CALL_SIGNAL, CALL_VALUES, EntryStub};

use super::super::call::{FramePlace, apply_native, call_instead};
use super::super::{code_of, in_window, stubs, substitute, word_at};
use super::heat::callee_at;
use super::make_words;
use super::step::{attend, leave, parts};
use crate::heap::layout::CodeObject;
use crate::raise::Exit;
use crate::shape::{CodeKind, Shape};
use crate::value::Value;

/// Does what is left of a call: see [`NativeContext::call_other`].
pub(super) unsafe extern "C" fn call_other(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`, whose callee is a
    // Function; V3: the window has the registers that the call wants.
    unsafe {
        let base = base.cast::<Value>();
        make_words(&mut *context);
        let Some(function) = callee_at(pc, base) else { return CALL_AGAIN };
        let (code, word) = (code_of(function), word_at(pc));
        let window = base.add(word.a());
        let shape = Shape::unpack((*code).spare[0]);
        if shape.kind != CodeKind::Native {
            let arranged = arrange(context, pc, base, code, window.add(2));
            return arranged.map_or(CALL_AGAIN, |(address, _)| address);
        }
        match call_builtin(context, pc, base, shape.number, FramePlace::Window) {
            Ok(_) | Err(CALL_VALUES) => {
                let (vm, _) = parts(context);
                substitute::deliver(vm, window, word.c());
                CALL_DONE
            }
            Err(outcome) => outcome,
        }
    }
}

/// Does what is left of a tail call: see [`NativeContext::tail_call_other`].
pub(super) unsafe extern "C" fn tail_call_other(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`, whose callee is a
    // Function, and has its registers in place of that frame's if it has a frame.
    unsafe {
        let base = base.cast::<Value>();
        make_words(&mut *context);
        let Some(function) = callee_at(pc, base) else { return CALL_AGAIN };
        let code = code_of(function);
        let shape = Shape::unpack((*code).spare[0]);
        if shape.kind != CodeKind::Native {
            let Some((address, parameters)) = arrange(context, pc, base, code, base) else {
                return CALL_AGAIN;
            };
            std::ptr::copy(base.add(word_at(pc).a() + 2), base, parameters);
            return address;
        }
        match call_builtin(context, pc, base, shape.number, FramePlace::Tail) {
            Ok(value) => (*context).value = value.bits(),
            Err(outcome) => return outcome,
        }
        CALL_DONE
    }
}

/// Puts the arguments of a call in order in its window, if the callee has machine code, and there is a tick
/// and room for its frame at `frame`. Returns the address of the machine code, and the number of parameters.
///
/// # Safety
/// That of a helper, at a call of a function with this code.
unsafe fn arrange(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut Value,
    code: *mut CodeObject,
    frame: *mut Value,
) -> Option<(u64, usize)> {
    // SAFETY: V3: the operands of the instruction are there.
    unsafe {
        let (vm, _) = parts(context);
        let word = word_at(pc);
        let end = frame.wrapping_add((*code).nregs as usize).addr() as u64;
        if !Shape::is_bytecode((*code).spare[0])
            || *(*code).entry != u32::from(stubs::NATIVE_ENTRY)
            || (*context).ticks <= 0
            || end > (*context).limit
        {
            return None;
        }
        let parameters = in_window::arrange(vm, code, base.add(word.a() + 2), word.b())?;
        Some(((*(*code).entry.cast::<EntryStub>()).address, parameters))
    }
}

/// Takes the tick of a call of a builtin, and calls it. Returns its value, which is the value list too, as
/// where the loop calls it: what the list holds is kept by the collector.
///
/// # Errors
/// The reply for the call if it has another outcome.
///
/// # Safety
/// That of a helper, at a call of the builtin with this number.
unsafe fn call_builtin(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut Value,
    number: u16,
    place: FramePlace,
) -> Result<Value, u64> {
    // SAFETY: V3: the window holds the arguments. A call that a builtin requests is made as from the loop,
    // which goes on in the frame that this makes.
    unsafe {
        if (*context).ticks <= 0 {
            return Err(CALL_AGAIN);
        }
        (*context).ticks -= 1;
        let (vm, _) = parts(context);
        let word = word_at(pc);
        let arguments = std::ptr::slice_from_raw_parts(base.add(word.a() + 2), word.b());
        vm.cpu.set_pc(pc);
        vm.cpu.set_base(base);
        let result = apply_native(vm, number, arguments);
        match result {
            Ok(value) => {
                vm.exchange.values.clear();
                vm.exchange.values.push(value);
                attend(context, vm);
            }
            Err(Exit::Values) => attend(context, vm),
            Err(exit) => {
                let signal = call_instead(vm, exit, number, arguments, place);
                let (pc, base) = (vm.cpu.pc(), vm.cpu.base());
                leave(context, signal, pc, base);
                return Err(CALL_SIGNAL);
            }
        }
        result.map_err(|_| CALL_VALUES)
    }
}
