//! The verifier: refuses every module that the interpreter could not run without looking at each step.
//!
//! **Theorem.** Of a module for which [`verify`] returned `Ok`, the interpreter may assume the following; V1
//! to V5 for all of a function's code, V6 to V11 and V14 for what control can get to.
//!
//! * **V1, instructions.** Wherever control gets to in a function begins an instruction of the opcode table,
//!   with its aux word. Bits that no operand uses are zero, and so is an aux word that only fills up. A
//!   function has at least one word of code and at most [`MAX_CODE`]; control does not run past the end.
//! * **V2, jumps.** Every jump lands on the beginning of an instruction of the same function: a loop's at or
//!   before the loop instruction, all others after the jump.
//! * **V3, registers.** `registers` is at most [`MAX_REGISTERS`]. Every register operand is below it. A range
//!   fits: `first + count <= registers`. A call window fits with its arguments, `window + 2 + count <=
//!   registers`, and its results, `window + want.registers() <= registers`; so do the results of
//!   `push-catch`, and the two registers of `push-handler-case` and `push-recovery`. The window of another
//!   control entry is at most `registers`.
//! * **V4, constants.** A constant operand is below `constants.len()`, and `constants` names entries of the
//!   pool. A symbol operand is a [`Constant::Symbol`] (not `Nil`, not `True`), a function operand a
//!   [`Constant::Function`] that the module has, a class operand a [`Constant::Class`]; the items of the
//!   vector of `push-handler-case` are symbols (`NIL` and `T` too) and pairs. `load-const` and the two jumps
//!   that compare with a constant get data: neither they nor anything inside them is a `Class` or a function
//!   with captures.
//! * **V5, small operands.** A type code is one of [`TypeCode`], a builtin's number is in the table and takes
//!   so many arguments, `call-self` passes what the function takes and that function takes an exact number,
//!   `apply` passes at least the list, `throw` says 0, 1 or 2, and a [`Want`] is [`Want::ONE`], [`Want::ALL`]
//!   or 2 to [`Want::MAX`].
//! * **V6, assigned.** A register that is read, as an operand, an argument or a capture, was written in this
//!   call of the function on every path, and no callee's frame has lain over it since. It holds an object of
//!   the program: not a link word, not a leftover, not a box (but see V7), and not the *unsupplied* marker,
//!   which only `jump-if-supplied` ever sees, only in registers of optional and key parameters.
//! * **V7, boxes.** The `cell` of `box-ref` and `box-set` is a box that `make-box` made. Else a register with
//!   a box is only read by `move` and by `make-closure`, for a capture declared as boxed, which always gets
//!   one. `capture-box-ref` and `capture-box-set` name captures declared as boxed. No program ever gets hold
//!   of a box.
//! * **V8, captures.** Capture operands are below `captures.len()`. A function with captures comes to life by
//!   `make-closure` only, from registers and captures that its maker has. The `closure` of `patch-capture`
//!   was made in this frame by `make-closure`, from a function whose capture `index` is declared
//!   [`CaptureSource::Later`].
//! * **V9, control stack.** For each instruction it is known which control entries of this frame stand, at
//!   most [`MAX_CONTROL`], and how many bindings were made since the innermost: `pop-control` pops catches,
//!   handlers, recovery procedures, cleanups for failures, masks and scopes of this frame only;
//!   `enter-cleanup` finds a cleanup of this frame on top, `end-cleanup` a running one, and no bindings made
//!   since; `bind-list` finds a scope of this frame; `unbind` undoes bindings of `bind` that this frame made
//!   since the innermost entry and its last `bind-list`. Returns and tail calls find no entry and no binding
//!   of this frame. A cleanup that was pushed is thus run, unless the task is killed.
//! * **V10, landings.** While an entry stands, no call and no further entry has a window below the entry's.
//!   The code at `to` asks for no more than: registers below the entry's window as they are, the results
//!   (`push-catch`) or the two registers (`push-handler-case`, `push-recovery`), the entry popped or, for a
//!   cleanup, replaced by a running one, and the bindings undone that were made since the push. As long as
//!   the entry stands, the machine may make the closure that the first instruction at `to` of `push-recovery`
//!   makes.
//! * **V11, the value list.** It is read only where the same frame set it on every path: by a call or a catch
//!   that wants all, `set-values` or `list-to-values`, with nothing in between but silent instructions that
//!   do not loop, or a cleanup from `enter-cleanup` to `end-cleanup`; and after the `end-cleanup` of a
//!   cleanup for failures. So no one else has to preserve it.
//! * **V12, functions.** There are at most [`MAX_CAPTURES`] captures. Parameters have registers,
//!   `parameters.registers() <= registers`. Names of keys are symbols (`NIL` and `T` too). Top-level
//!   functions take no arguments and have no captures.
//! * **V13, the pool.** Entries refer to earlier entries only. A `Symbol` is not `COMMON-LISP:NIL` or `T`; a
//!   ratio is in lowest terms with a denominator above 1; an array has as many elements as its dimensions say
//!   and a rank other than 1. No `Class` and no function with captures is inside a pair, vector or array.
//! * **V14, variables.** The range of each variable lies in the code, its register or capture is there, and
//!   at each place of the range that control gets to, the register holds an object of the program or a box.
//!
//! Obligations of the interpreter in return:
//!
//! * **M1.** An instruction of the kind `never` does all its work, is tried again, or is left by an
//!   unwinding. Control does not pass to the next instruction in another way.
//! * **M2.** Values that arrive from outside (arguments, results, thrown values, conditions, substitutes) are
//!   objects of the program: no boxes, no markers, no link words. On entry the registers of parameters hold:
//!   required, an object; rest, a list; optional and key, an object or the marker.
//! * **M3.** Frames for recoveries and interrupts lie at or above `registers` of the frame that they
//!   interrupt.
//! * **M4.** An unwinding lands as V10 says. A running cleanup that another unwinding passes is dropped.
//!   A cleanup for failures that a failure has reached goes on behind its `end-cleanup`, with a value list.
//! * **M5.** The value list always consists of objects. `enter-cleanup` keeps it for `end-cleanup`. A `throw`
//!   that is tried again throws the values that it had; one that is recovered from leaves what the recovery
//!   gave, a `list-to-values` an empty one.
//! * **M6.** Everything that depends on data is checked when it happens: types of operands (`push-mask` and
//!   `push-handlers` too), index and slot bounds, arity, the length of spread lists, the sizes of the stacks.
//!
//! Not here: whether the file is intact (`file`), whether symbols and classes exist (the virtual machine's
//! loader). Source: the verifiers of the JVM (definite assignment by data flow) and of WebAssembly (a static
//! stack of labels).

mod error;
mod expect;
mod flow;
mod pool;
mod registers;
mod shape;
mod state;

pub use error::{Fault, FaultPlace, VerifyError};
pub use pool::MAX_RATIO_BITS;
pub use state::VerifiedEntry;

#[allow(unused_imports, reason = "named by the text above")]
use crate::module::{CaptureSource, Constant, MAX_CAPTURES, MAX_CODE, MAX_CONTROL, MAX_REGISTERS};
use crate::module::{FunctionNumber, Module};
#[allow(unused_imports, reason = "named by the text above")]
use crate::{opcode::TypeCode, operand::Want};

/// Checks all of `module`.
///
/// # Errors
/// The first fault that is found.
pub fn verify(module: &Module) -> Result<(), VerifyError> {
    verify_outline(module)?;
    (0..module.functions.len() as u32).try_for_each(|number| verify_function(module, FunctionNumber(number)))
}

/// Checks what belongs to no function: the constants, and which functions run top-level forms.
///
/// # Errors
/// The first fault that is found.
pub fn verify_outline(module: &Module) -> Result<(), VerifyError> {
    pool::verify(module)?;
    for (index, &number) in module.toplevel.iter().enumerate() {
        verify_toplevel(module, number)
            .map_err(|fault| VerifyError { place: FaultPlace::Toplevel(index), fault })?;
    }
    Ok(())
}

/// Checks one function of a module whose outline is in order.
///
/// # Errors
/// The first fault that is found.
pub fn verify_function(module: &Module, number: FunctionNumber) -> Result<(), VerifyError> {
    let shape = shape::verify(module, number)?;
    flow::verify(module, number, &shape)
}

fn verify_toplevel(module: &Module, number: FunctionNumber) -> Result<(), Fault> {
    let function = pool::function(module, number)?;
    if function.parameters.registers() != 0 || function.parameters.keys.is_some() {
        return Err(Fault::ToplevelParameters);
    }
    if !function.captures.is_empty() {
        return Err(Fault::ToplevelCaptures);
    }
    Ok(())
}

#[cfg(test)]
mod tests;
