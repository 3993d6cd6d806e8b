//! Calls from machine code whose arguments have to be put in order first.

use esl_native::NativeContext;
use esl_native::abi::EntryStub;

use super::super::{code_of, in_window, stubs, word_at};
use super::step::parts;
use super::{callee_at, make_words};
use crate::shape::Shape;
use crate::value::Value;

/// Puts the arguments of a call in order in its window.
pub(super) unsafe extern "C" fn arrange(context: *mut NativeContext, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`.
    unsafe {
        let base = base.cast::<Value>();
        let window = base.add(word_at(pc).a());
        arranged(context, pc, base, window.add(2)).map_or(0, |(address, _)| address)
    }
}

/// Puts the arguments of a tail call in order in the running frame.
pub(super) unsafe extern "C" fn arrange_in_place(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`; the callee's registers
    // have room there.
    unsafe {
        let base = base.cast::<Value>();
        let Some((address, parameters)) = arranged(context, pc, base, base) else { return 0 };
        std::ptr::copy(base.add(word_at(pc).a() + 2), base, parameters);
        address
    }
}

/// Puts the arguments of a call in order in its window, if the callee has machine code, and there is a tick
/// and room for its frame at `frame`. Returns the address of the machine code, and the number of parameters.
///
/// # Safety
/// That of a helper, at a call whose callee is a Function.
unsafe fn arranged(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut Value,
    frame: *mut Value,
) -> Option<(u64, usize)> {
    // SAFETY: V3, V4: the operands of the instruction are there; the function of a symbol is a Function.
    unsafe {
        make_words(&mut *context);
        let (vm, _) = parts(context);
        let word = word_at(pc);
        let window = base.add(word.a());
        let function = callee_at(pc, base)?;
        let code = code_of(function);
        let end = frame.wrapping_add((*code).nregs as usize).addr() as u64;
        if !Shape::is_bytecode((*code).spare[0])
            || *(*code).entry != u32::from(stubs::NATIVE_ENTRY)
            || (*context).ticks <= 0
            || end > (*context).limit
        {
            return None;
        }
        let parameters = in_window::arrange(vm, code, window.add(2), word.b())?;
        Some(((*(*code).entry.cast::<EntryStub>()).address, parameters))
    }
}
