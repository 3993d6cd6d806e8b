//! Machine code for hot functions of the virtual machine, made by Cranelift from verified bytecode.
//!
//! The contract between this crate and the interpreter (`esl_vm`, module `interp::native`):
//!
//! * **N1, source.** The translated code is that of one function that has passed the verifier
//!   (`esl_bytecode::verify`, V1 to V14), at the address at which it stays. Its constants are read when the
//!   machine code runs, since some of them change; one that is a number stays the same.
//! * **N2, frames.** Machine code is entered with the base of a frame of that function (F2 of the
//!   interpreter), at its first instruction or at one of its loop instructions. It reads and writes registers
//!   of that frame, and links and registers of frames that it makes above it, below [`NativeContext::limit`].
//! * **N3, truth.** Where machine code is left, and before it calls anything, all results are in the task's
//!   stack. So whatever the machine code leaves can be taken up by the interpreter, at the instruction that
//!   [`NativeContext::pc`] names in the frame [`NativeContext::base`]. Between, doubles may be *unspilled*: only
//!   in a register of the processor. A side exit saves them in [`NativeContext::doubles`];
//!   [`NativeContext::unspilled`] names them by their distance from [`NativeContext::outer`], and the machine
//!   writes their words to the stack before anything else reads it.
//!   Where the function returns, they are dropped; other words without an address are in their places.
//!   Functions of the machine that read no frame may be called while some are unspilled.
//! * **N4, exits.** Machine code is left at the beginning of an instruction, before it has had any effect
//!   ([`AGAIN`]), or behind a function of the machine that has done the instruction and says what is to be
//!   done next ([`SIGNAL`], [`RETURN_VALUES`]), or with the value of the function ([`RETURNED`]).
//! * **N5, ticks.** A call, and an instruction that jumps back, takes one tick where the interpreter takes
//!   it, after everything that could make the machine code give the instruction up. Without one left it gives
//!   the instruction up, so that the interpreter meets the safepoint.
//! * **N6, objects.** Nothing collects while machine code runs, and no object moves. An address is followed
//!   only after the tests that the interpreter makes. A slot is overwritten without the machine's help only
//!   while nothing is marked ([`NativeContext::is_marking`]), or where it holds no address.
//! * **N7, native stack.** A frame of machine code holds nothing that another one needs. There are as many as
//!   fit between the base at the entry and [`NativeContext::limit`], which the interpreter keeps near.
//! * **N8, inlined functions.** A call of a global function, or of the running one, may be replaced by the
//!   instructions of the function. Its frame is made all the same, so that N3 to N5 hold within it. Or only
//!   the paths are inlined on which the running function returns soon: what they do before another path
//!   branches off can be repeated, and calls no function of the machine; there the function is called in the
//!   frame that has been made. The call of a global function is given up, with [`REDEFINED`], if the symbol
//!   has another function by then. So the machine code is good only as long as the functions inlined in it
//!   are there.
//!
//! The code is in memory that is either writable or executable, never both. It is given back when the
//! [`MachineCode`] is dropped: its owner must not drop it while it runs.

#![allow(unsafe_code)]

pub mod abi;
mod arithmetic;
mod branches;
mod calls;
mod characters;
mod doubles;
mod emit;
mod flow;
pub mod helper;
mod inlined;
mod instruction;
mod integers;
mod kinds;
mod lookups;
pub mod maker;
mod matrices;
mod objects;
mod places;
mod special;
mod translate;

pub use abi::{
    AGAIN, GUESSED_WRONG, IN_PLACE, NativeContext, NativeReply, REDEFINED, RETURN_VALUES, RETURNED, SIGNAL,
};
pub use flow::{MAX_DEPTH, MAX_INLINED, may_be_inlined};
pub use helper::{MachineCodeHelper, MadeCode};
pub use kinds::Known;
pub use maker::{FunctionSource, InlinedSource, MachineCode, MachineCodeMaker, NativeSource, NotMade};
