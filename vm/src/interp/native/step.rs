//! The helpers of machine code: the slow half of an instruction, as its row of the opcode table names it, and
//! calls of builtins.
//!
//! All of it has the contract of a helper: machine code calls it at an instruction of the running frame, with
//! the context of [`super::run`]. It does what the arm of the loop does behind the fast paths that machine
//! code has, and asks for a safepoint where the arm does.

use esl_bytecode::for_each_opcode;
use esl_bytecode::opcode::Opcode;
use esl_native::NativeContext;
use esl_native::abi::{STEP_JUMP, STEP_NEXT, STEP_SIGNAL, STEP_VALUES};

use super::super::{
    Signal, aux_at, code_of, cold, constants_of, double, point, substitute, unwind, variable, word_at,
};
use super::{Caller, make_words};
use crate::heap::Phase;
use crate::raise::Exit;
use crate::value::Value;
use crate::vm::Vm;

/// The outcome of an instruction that the machine has executed for machine code.
enum Done {
    /// The next one follows. A fast path of the loop requests no safepoint.
    Fast,
    /// The next one follows.
    Slow,
    /// It is a test: whether it jumps.
    Jump(bool),
    /// It is left.
    Signal(Signal),
}

impl From<Signal> for Done {
    fn from(signal: Signal) -> Done {
        if signal == Signal::Next { Done::Slow } else { Done::Signal(signal) }
    }
}

impl Done {
    /// Returns what a test has come to.
    fn of_test(opcode: Opcode, holds: Result<bool, Signal>) -> Done {
        match holds {
            Ok(holds) => Done::Jump(holds == opcode.jumps_when()),
            Err(signal) => Done::Signal(signal),
        }
    }
}

/// Takes the parts of a helper's arguments.
///
/// # Safety
/// Machine code has called the helper: the context is that of [`run`].
pub(super) unsafe fn parts<'a>(context: *mut NativeContext) -> (&'a mut Vm, *mut Caller) {
    // SAFETY: by the contract; machine code does not use the machine while a helper does.
    unsafe {
        let caller = (*context).machine.cast::<Caller>();
        (&mut *(*caller).vm, caller)
    }
}

/// Leaves machine code with a signal.
///
/// # Safety
/// That of a helper.
pub(super) unsafe fn leave(
    context: *mut NativeContext,
    signal: Signal,
    pc: *const u32,
    base: *mut Value,
) -> u64 {
    // SAFETY: by the contract the context is that of `run`.
    unsafe {
        (*(*context).machine.cast::<Caller>()).signal = signal;
        (*context).pc = pc.expose_provenance() as u64;
        (*context).base = base.expose_provenance() as u64;
    }
    STEP_SIGNAL
}

/// Handles the charges of a builtin, the requests of an allocation, and a new end of the stack, as the loop
/// does.
///
/// # Safety
/// That of a helper.
pub(super) unsafe fn attend(context: *mut NativeContext, vm: &mut Vm) {
    // SAFETY: by the contract the context is that of `run`.
    unsafe {
        if vm.wants_safepoint() {
            (*context).ticks = vm.prepare_safepoint((*context).ticks);
        }
        (*context).is_marking = u32::from(vm.heap.phase() == Phase::Marking);
        // A control stack that has grown takes room from the stack.
        (*context).limit = (*context).limit.min(vm.cpu.stack_end().expose_provenance() as u64);
    }
}

/// Does the instruction at `pc`: what its arm does behind the fast paths that machine code has.
pub(super) unsafe extern "C" fn step(context: *mut NativeContext, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: machine code calls this at an instruction of the frame at `base`.
    unsafe {
        let base = base.cast::<Value>();
        make_words(&mut *context);
        let (vm, _) = parts(context);
        match instruction(vm, pc, base) {
            Done::Fast => STEP_NEXT,
            Done::Slow => {
                attend(context, vm);
                STEP_NEXT
            }
            Done::Jump(jumps) => u64::from(jumps) * STEP_JUMP,
            Done::Signal(signal) => leave(context, signal, pc, base),
        }
    }
}

/// Calls the builtin of a `call-builtin`, whose tick has been taken.
pub(super) unsafe extern "C" fn call_builtin(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`; V3, V5 as in the loop.
    unsafe {
        let (vm, _) = parts(context);
        let base = base.cast::<Value>();
        let word = word_at(pc);
        let window = base.add(word.a());
        match call_native(vm, pc, base, word.c() == 0) {
            Ok(value) if word.c() == 0 => {
                *window = value;
                attend(context, vm);
            }
            Ok(value) => {
                vm.exchange.values.clear();
                vm.exchange.values.push(value);
                substitute::deliver(vm, window, word.c());
            }
            Err(Exit::Values) => {
                substitute::deliver(vm, window, word.c());
                attend(context, vm);
            }
            Err(exit) => return leave(context, Signal::Exit(exit), pc, base),
        }
        STEP_NEXT
    }
}

/// Calls the builtin of a `tail-call-builtin`, whose tick has been taken.
pub(super) unsafe extern "C" fn tail_builtin(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`; V3, V5 hold for it.
    unsafe {
        let (vm, _) = parts(context);
        let base = base.cast::<Value>();
        match call_native(vm, pc, base, false) {
            Ok(value) => {
                attend(context, vm);
                (*context).value = value.bits();
                STEP_NEXT
            }
            Err(Exit::Values) => {
                attend(context, vm);
                STEP_VALUES
            }
            Err(exit) => leave(context, Signal::Exit(exit), pc, base),
        }
    }
}

/// Delivers the value list as what the function in the frame that was left returns.
pub(super) unsafe extern "C" fn all_values(
    context: *mut NativeContext,
    _pc: *const u32,
    _base: *mut u64,
) -> u64 {
    // SAFETY: N3: the frame is that of a function that was called from machine code, so its link is in order.
    unsafe {
        let (vm, _) = parts(context);
        vm.cpu.set_base(std::ptr::with_exposed_provenance_mut((*context).base as usize));
        substitute::return_all(vm);
    }
    STEP_NEXT
}

/// Delivers a value as the only one that the function in the frame that was left returns.
pub(super) unsafe extern "C" fn only_value(
    context: *mut NativeContext,
    pc: *const u32,
    base: *mut u64,
) -> u64 {
    // SAFETY: N3: the value is one of the program; the frame is as for `all_values`.
    unsafe {
        let (vm, _) = parts(context);
        vm.exchange.values.clear();
        vm.exchange.values.push(Value::from_bits((*context).value));
        all_values(context, pc, base)
    }
}

/// Overwrites a slot.
pub(super) unsafe extern "C" fn store(context: *mut NativeContext, slot: *mut u64, value: u64) {
    // SAFETY: N6: machine code has found the slot by the tests of the loop; the value is one of the program.
    unsafe {
        let (vm, _) = parts(context);
        vm.heap.store(slot.cast(), Value::from_bits(value));
    }
}

/// Returns the value of a symbol that was bound.
pub(super) unsafe extern "C" fn value_of(context: *mut NativeContext, symbol: u64) -> u64 {
    // SAFETY: V4: machine code has found the flag in a symbol that is a constant of its function.
    unsafe {
        let (vm, _) = parts(context);
        variable::bound_value(vm, Value::from_bits(symbol)).bits()
    }
}

/// Sets a symbol that was bound and is not a constant.
pub(super) unsafe extern "C" fn set_value_of(context: *mut NativeContext, symbol: u64, value: u64) {
    // SAFETY: V4: machine code has found the flags in a symbol that is a constant of its function; the value
    // is one of the program.
    unsafe {
        let (vm, _) = parts(context);
        let is_set = vm.set_symbol_value(Value::from_bits(symbol), Value::from_bits(value));
        debug_assert!(is_set.is_ok(), "the symbol is not a constant");
        attend(context, vm);
    }
}

/// Makes a pair in the hole of the heap that is filled; 0 if it has no room.
pub(super) unsafe extern "C" fn cons(context: *mut NativeContext, car: u64, cdr: u64) -> u64 {
    // SAFETY: both are values of the program.
    unsafe {
        let (vm, _) = parts(context);
        vm.heap.cons_in_hole(Value::from_bits(car), Value::from_bits(cdr)).map_or(0, Value::bits)
    }
}

/// Does a `bind`.
pub(super) unsafe extern "C" fn bind(context: *mut NativeContext, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`, all of it in its place.
    unsafe {
        let (vm, _) = parts(context);
        let signal = variable::bind(vm, pc, base.cast());
        end_binding(context, signal, pc, base)
    }
}

/// Does an `unbind`.
pub(super) unsafe extern "C" fn unbind(context: *mut NativeContext, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: machine code calls this at such an instruction of the frame at `base`.
    unsafe {
        let (vm, _) = parts(context);
        let signal = variable::unbind(vm, pc, base.cast());
        end_binding(context, signal, pc, base)
    }
}

/// Goes on behind an instruction that binds, or leaves there.
///
/// # Safety
/// That of a helper.
unsafe fn end_binding(context: *mut NativeContext, signal: Signal, pc: *const u32, base: *mut u64) -> u64 {
    // SAFETY: N4: the contract says that the context is that of `run`, and the frame the running one.
    unsafe {
        if signal != Signal::Next {
            return leave(context, signal, pc, base.cast());
        }
        let (vm, _) = parts(context);
        attend(context, vm);
        STEP_NEXT
    }
}

/// Calls the builtin of the instruction with the arguments in its window.
///
/// # Safety
/// `pc` is at a call of a builtin in the frame at `base`.
unsafe fn call_native(vm: &mut Vm, pc: *const u32, base: *mut Value, wants_one: bool) -> Result<Value, Exit> {
    // SAFETY: V3, V5: the window holds the arguments, and the number is in the table. No builtin writes to
    // the stack or moves it.
    unsafe {
        let word = word_at(pc);
        let arguments = std::slice::from_raw_parts(base.add(word.a() + 2), word.b());
        let native = vm.natives[aux_at(pc) as usize];
        vm.cpu.set_pc(pc);
        vm.cpu.set_base(base);
        vm.cpu.wants_one = wants_one;
        native(vm, arguments)
    }
}

macro_rules! slow_half {
    // It is nothing that machine code asks for: the loop does it.
    ($name:ident [$kind:ident] $vm:ident $pc:ident $base:ident) => {
        Done::Signal(Signal::Reload)
    };
    ($name:ident [call $callee:ident] $vm:ident $pc:ident $base:ident) => {
        Done::Signal(Signal::Reload)
    };
    ($name:ident [tail $callee:ident] $vm:ident $pc:ident $base:ident) => {
        Done::Signal(Signal::Reload)
    };
    ($name:ident [test $builtin:ident] $vm:ident $pc:ident $base:ident) => {
        Done::of_test(Opcode::$name, cold::test::<{ Opcode::$name as u8 }>($vm, $pc, $base))
    };
    ($name:ident [test_not $builtin:ident] $vm:ident $pc:ident $base:ident) => {
        Done::of_test(Opcode::$name, cold::test::<{ Opcode::$name as u8 }>($vm, $pc, $base))
    };
    ($name:ident [$kind:ident $builtin:ident] $vm:ident $pc:ident $base:ident) => {
        cold::compute::<{ Opcode::$name as u8 }>($vm, $pc, $base).into()
    };
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident first $half:path) => {{
        let word = word_at($pc);
        let value = $half(*$base.add(word.b()), *$base.add(word.c()));
        if value != Value::UNBOUND {
            *$base.add(word.a()) = value;
            return Done::Fast;
        }
        slow_half!($name [$($kind)+] $vm $pc $base)
    }};
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident does $half:path) => {
        $half($vm, $pc, $base).into()
    };
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident rest $half:path) => {
        $half($vm, $pc, $base).into()
    };
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident quiet $half:path) => {{
        $half($vm, $pc, $base);
        Done::Fast
    }};
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident gives $half:path) => {{
        let word = word_at($pc);
        *$base.add(word.a()) = $half($vm, word, $base, constants_of(code_of(*$base.sub(2))));
        Done::Fast
    }};
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident jumps $half:path) => {
        Done::Jump($half($vm, word_at($pc), $base, constants_of(code_of(*$base.sub(2)))))
    };
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident stays $half:path) => {
        Done::Jump(!$half($vm, word_at($pc), $base, constants_of(code_of(*$base.sub(2)))))
    };
    ($name:ident [$($kind:ident)+] $vm:ident $pc:ident $base:ident test $half:path) => {
        Done::of_test(Opcode::$name, $half($vm, $pc, $base))
    };
}

macro_rules! define_instruction {
    ($( $(#[doc = $doc:literal])* $name:ident = $number:literal, $mnemonic:literal, $($kind:ident)+
        { $( $field:ident : $ty:ident ),* } $( , $slow:ident $half:path )? ; )*) => {
        /// Does the slow half of the instruction at `pc` in the frame at `base`.
        ///
        /// # Safety
        /// It is one of verified code, and that frame is one of the code's function.
        unsafe fn instruction(vm: &mut Vm, pc: *const u32, base: *mut Value) -> Done {
            // SAFETY: by the contract, which is that of the functions that the rows name; F2: below the base
            // is the function of the frame.
            unsafe {
                match word_at(pc).opcode() {
                    $( Some(Opcode::$name) => slow_half!($name [$($kind)+] vm pc base $($slow $half)?), )*
                    None => Done::Signal(Signal::Reload),
                }
            }
        }
    };
}

for_each_opcode!(define_instruction);
