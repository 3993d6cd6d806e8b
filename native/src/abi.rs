//! The interface of machine code: its arguments, and its exits.

use std::ffi::c_void;
use std::mem::MaybeUninit;

use esl_heap::table::LastLookup;

/// The function has returned; the value is in the reply. Its frame is still the topmost one.
pub const RETURNED: u64 = 0;
/// The interpreter is to go on at `pc` in the frame `base`; it repeats the instruction there.
pub const AGAIN: u64 = 1;
/// A function of the machine has left a signal for the interpreter, for the instruction at `pc` in the frame
/// `base`.
pub const SIGNAL: u64 = 2;
/// A tail call: the frame is that of the callee, and the reply has the address of its machine code. Only
/// between functions of machine code, and to the interpreter's entry.
pub const TAIL: u64 = 3;
/// The function in the frame `base` returns the value list.
pub const RETURN_VALUES: u64 = 4;

/// As [`AGAIN`], since a register does not hold what was guessed when the machine code was made.
pub const GUESSED_WRONG: u64 = 5;
/// As [`AGAIN`], at a call of a function that was inlined, and is no longer the one that is called.
pub const REDEFINED: u64 = 6;

/// Reply of a helper for an instruction: go on with the next one.
pub const STEP_NEXT: u64 = 0;
/// Reply of a helper for an instruction: it jumps.
pub const STEP_JUMP: u64 = 1;
/// Reply of a helper for an instruction: leave the machine code with [`SIGNAL`].
pub const STEP_SIGNAL: u64 = 2;
/// Reply of a helper for a builtin called in place of the function: its values are in the value list.
pub const STEP_VALUES: u64 = 3;

/// Reply of a helper for a call: it is given up, without effect.
pub const CALL_AGAIN: u64 = 0;
/// Reply of a helper for a call: a builtin was called, and its values are where the call wants them.
pub const CALL_DONE: u64 = 1;
/// Reply of a helper for a tail call: a builtin was called, and its values are in the value list.
pub const CALL_VALUES: u64 = 2;
/// Reply of a helper for a call: leave the machine code with [`SIGNAL`]. Greater replies are addresses.
pub const CALL_SIGNAL: u64 = 3;

/// The spilled word of a register whose place is up to date: no operation has this result, and no program
/// this double.
pub const IN_PLACE: u64 = 0x7FF8_1E57_1E57_1E57;

/// Function of the machine that does the instruction at `pc` in the frame `base`.
pub type NativeHelper = unsafe extern "C" fn(*mut NativeContext, *const u32, *mut u64) -> u64;

/// Function of the machine that overwrites a slot while objects are marked.
pub type NativeStore = unsafe extern "C" fn(*mut NativeContext, *mut u64, u64);

/// Function of the machine that returns the value of a symbol that was bound, which may be unbound. It looks
/// at no frame.
pub type NativeValueOf = unsafe extern "C" fn(*mut NativeContext, u64) -> u64;

/// Function of the machine that sets a symbol that was bound and is not a constant. It reads no frame.
pub type NativeSetValueOf = unsafe extern "C" fn(*mut NativeContext, u64, u64);

/// Function of the machine that makes a pair, or returns 0 if that takes more than a hole of the heap. It
/// looks at no frame.
pub type NativeCons = unsafe extern "C" fn(*mut NativeContext, u64, u64) -> u64;

/// Function of the machine that does what the builtin of an instruction does in a hash table: with a key, the
/// table and what else the builtin is given; without effect, and with the word of `Value::UNBOUND`, if that
/// takes more. It reads no frame.
pub type NativeLookup = unsafe extern "C" fn(*mut NativeContext, u64, u64, u64, u64) -> u64;

/// Machine code of a function: the frame, and the place of entry: 0 for the first instruction, and the
/// numbers from 1 on for loop instructions.
pub type NativeEntry = unsafe extern "C" fn(*mut NativeContext, *mut u64, u64) -> NativeReply;

/// The state that machine code shares with the interpreter.
#[repr(C)]
#[derive(Debug)]
pub struct NativeContext {
    /// Ticks left until the next safepoint.
    pub ticks: i32,
    /// Whether the collector marks, so that overwritten slots have to be logged.
    pub is_marking: u32,
    /// End of the stack that machine code may use.
    pub limit: u64,
    /// Where it was left: address of the instruction.
    pub pc: u64,
    /// Where it was left: base of the frame.
    pub base: u64,
    /// Where it was left: base of the frame of the function whose machine code it is, which is another one if
    /// it was left in an inlined function.
    pub outer: u64,
    /// Value that a builtin called in place of the function has returned, or that `only_value` delivers.
    pub value: u64,
    /// Registers, from `outer` on, whose doubles a side exit has saved: see N3. None while machine code runs.
    pub unspilled: [u64; 4],
    /// The bits of each of them, or [`IN_PLACE`].
    pub doubles: [MaybeUninit<u64>; 256],
    /// The machine.
    pub machine: *mut c_void,
    /// Does an instruction whose fast path does not apply.
    pub step: NativeHelper,
    /// Calls the builtin of a `call-builtin`.
    pub call_builtin: NativeHelper,
    /// Calls the builtin of a `tail-call-builtin`.
    pub tail_builtin: NativeHelper,
    /// Does what is left of a call whose callee does not take exactly the given arguments: puts them in the
    /// order of its parameters, and returns the address of its machine code; or calls it, tick and all, if it
    /// is a builtin.
    pub call_other: NativeHelper,
    /// As `call_other`, for a tail call: the arguments get into the running frame. A builtin leaves its only
    /// value in `value`.
    pub tail_call_other: NativeHelper,
    /// Delivers the value list as what the function in the frame `base` returns.
    pub all_values: NativeHelper,
    /// Delivers `value` as the only one that the function in the frame `base` returns, where more are wanted.
    pub only_value: NativeHelper,
    /// Overwrites a slot while objects are marked.
    pub store: NativeStore,
    /// Reads a special variable that was bound.
    pub value_of: NativeValueOf,
    /// Sets a special variable that was bound.
    pub set_value_of: NativeSetValueOf,
    /// Does a `bind`.
    pub bind: NativeHelper,
    /// Does an `unbind`.
    pub unbind: NativeHelper,
    /// Makes a pair.
    pub cons: NativeCons,
    /// The entry that the last search in a hash table has found.
    pub last_lookup: *mut LastLookup,
    /// Whether the collector wants the next tick to be a safepoint.
    pub gc_due: *const bool,
    /// Charges beside ticks: not zero if the next builtin is to settle them.
    pub charges: *const u64,
    /// Finds the value of a key: with what it is if the table has none.
    pub value_of_key: NativeLookup,
    /// Sets the value of a key that the table has.
    pub set_value_of_key: NativeLookup,
    /// Adds to the value of a key that the table has, a fixnum: with what it would be, and what is added.
    pub add_to_value_of_key: NativeLookup,
}

/// How a function of machine code was left.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct NativeReply {
    /// One of the constants of this module.
    pub status: u64,
    /// The value that was returned, or the address of the callee's machine code.
    pub value: u64,
}

/// The first words of what the entry word of compiled code points to.
#[repr(C, align(8))]
#[derive(Clone, Copy, Debug)]
pub struct EntryStub {
    /// Operation of the interpreter's loop: the entry to machine code.
    pub word: u32,
    /// Number of the machine code, for the interpreter.
    pub number: u32,
    /// Address of the machine code, a [`NativeEntry`].
    pub address: u64,
}
