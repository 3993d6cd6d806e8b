//! THE loop: runs the bytecode of one task until its slice is over, it ends, or it waits.
//!
//! Registers of the machine are locals of [`dispatch`]: `pc`, `base` (the running frame's first register),
//! `k` (the running code's constants) and `ticks`. An arm decodes, takes the fast path, and leaves everything
//! else to a cold function or to a [`Signal`], which breaks out of the inner loop with `pc` still at the
//! instruction; the outer loop deals with it and comes back with fresh registers. So the hot loop holds
//! nothing that has to be dropped, and the size of its frame stays small.
//!
//! Safepoints are ticks: a call or a turn of a loop takes one, and when none is left the instruction is given
//! up before it has had any effect. Preemption, collection and aborts happen there and nowhere else, save
//! that an instruction for which there is no room is given up too, and done again after a collection.
//!
//! The interpreter relies on the facts V1 to V14 about code in `esl_bytecode::verify`; its `SAFETY:` notes
//! name the items. Its obligations in return are M1 to M6 there. The notes also name facts that it
//! establishes itself:
//!
//! * **F1, registers of the machine.** When the loop is left, `Cpu::pc` is at an instruction of the running
//!   function's code, or in a stub, and `Cpu::base` is the base of the running frame.
//! * **F2, frames.** A frame is the words of its task's stack from its base on, as many as its function's
//!   code has registers. Below the base is its link: its function, a Function, which keeps the code alive,
//!   and the address at which it returns. That is behind an instruction of two words in the code of the frame
//!   below, in whose window the link lies; or it is in a stub, which begins with a call word of the same
//!   form.
//! * **F3, parked frames.** `base` and `pc` of a task that does not run are those that it had at the switch.
//!   The pc of a frame above which the machine has put a function is in the word behind its registers.
//! * **F4, words.** Every word of a stack is a value, or an address of code that looks like a fixnum.
//! * **F5, entries.** The frame of an entry of the control stack is live, since the entries of a frame are
//!   popped before it is left; the entry's pc is the landing that the entry's instruction names (V2).
//!
//! Only this module and its children write the fields behind F1, F3 and F5.
//!
//! The loop reads words as they were loaded, with fused instructions (`crate::fused`). All other code asks
//! [`word_at`], which gives the instructions that the verifier has seen. The arm of a fused instruction
//! leaves `pc` at the part that could not be done.
#![allow(unsafe_code)]

pub(crate) mod arguments;
mod call;
mod cold;
mod collect;
mod double;
mod end;
mod exit;
pub(crate) mod frames;
mod in_window;
mod interrupt;
#[cfg(feature = "native")]
mod native;
mod point;
mod reserve;
pub(crate) mod start;
pub(crate) mod stubs;
mod substitute;
#[cfg(test)]
mod tests;
mod unwind;
mod variable;

pub(crate) use collect::top_of_task;
use esl_bytecode::for_each_opcode;
use esl_bytecode::opcode::Opcode;
use esl_bytecode::word::Word;

use crate::cpu::Cpu;
use crate::fused::{QUICK_LOOP, for_each_fused, original};
use crate::heap::layout::{Boxed, CodeObject, FunctionObject, Kind, StructureObject, SymbolObject, Vector};
use crate::raise::{Exit, Raised};
use crate::shape::Shape;
use crate::value::Value;
use crate::vm::Vm;

macro_rules! define_operations {
    ({ $( $(#[doc = $doc:literal])* $name:ident = $number:literal, $mnemonic:literal, $($kind:ident)+
        { $( $field:ident : $ty:ident ),* } $( , $slow:ident $half:path )? ; )* }
     $( $(#[doc = $fused_doc:literal])* $fused:ident = $fused_number:literal, [$($part:ident)+], $fits:ident; )*
    ) => {
        /// The operations of the loop: every opcode, those that only the machine's own stubs contain, and
        /// fused instructions.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        #[allow(dead_code, reason = "operations are made by reading code")]
        pub(crate) enum LoopOperation {
            $( $name = $number, )*
            /// The function that took the place of an instruction has returned: see `substitute`.
            ErrorReturn = stubs::ERROR_RETURN,
            /// The task's function has returned: its values are in the value list.
            TaskExit = stubs::TASK_EXIT,
            /// The function that ran where the task was interrupted has returned: see `interrupt`.
            InterruptReturn = stubs::INTERRUPT_RETURN,
            /// The function has machine code: see `native`.
            #[cfg(feature = "native")]
            NativeEntry = stubs::NATIVE_ENTRY,
            /// Machine code is to be made of the function.
            #[cfg(feature = "native")]
            MakeAtEntry = stubs::MAKE_AT_ENTRY,
            /// Loop instructions of functions that have machine code.
            QuickLoop = QUICK_LOOP,
            QuickLoopIfNil = QUICK_LOOP + 1,
            QuickLoopIfNotNil = QUICK_LOOP + 2,
            QuickLoopIfCons = QUICK_LOOP + 3,
            QuickLoopLess = QUICK_LOOP + 4,
            QuickLoopNotLess = QUICK_LOOP + 5,
            QuickLoopCount = QUICK_LOOP + 6,
            $( $fused = $fused_number, )*
        }
    };
}
macro_rules! define_operations_with_fused {
    ($($opcodes:tt)*) => {
        for_each_fused! { define_operations { $($opcodes)* } }
    };
}
for_each_opcode!(define_operations_with_fused);

/// Why the inner loop was left, or what a cold function wants of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    /// Go on after this instruction.
    Next,
    /// Go on at `Cpu::pc` with `Cpu::base`.
    Reload,
    /// No tick is left.
    Tick,
    /// A builtin gave no value, or an instruction failed as a builtin does.
    Exit(Exit),
    /// The call of this instruction takes the slow path.
    Call,
    /// The values in the value list are to be delivered to the caller of this frame.
    ReturnAll,
    /// The unwinding noted in the task goes on.
    Unwind,
    /// The task has come to its end.
    TaskExit,
    /// The task waits; the instruction is done again when it goes on.
    Park,
    /// The turn is over; the instruction is done again in the next one.
    Again,
}

/// Why a task stopped running.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leave {
    /// It has used up the ticks that it was given.
    Slice,
    /// It has come to its end.
    Ended,
    /// It waits.
    Parked,
}

/// Returns the code of a function.
///
/// # Safety
/// `function` is a Function.
#[inline(always)]
pub(crate) unsafe fn code_of(function: Value) -> *mut CodeObject {
    // SAFETY: by the contract this is a live Function; the heap guarantees that its code is a Code.
    unsafe { (*function.object_ptr().cast::<FunctionObject>()).code.object_ptr().cast() }
}

/// Returns the constants of a code.
///
/// # Safety
/// `code` points to a Code.
#[inline(always)]
pub(crate) unsafe fn constants_of(code: *mut CodeObject) -> *const Value {
    // SAFETY: the constants are at a fixed offset inside the Code.
    unsafe { code.byte_add(CodeObject::CONSTANTS_OFFSET).cast() }
}

/// Returns the address of the first instruction of a code.
///
/// # Safety
/// `code` points to a Code.
#[inline(always)]
unsafe fn first_instruction(code: *mut CodeObject) -> *const u32 {
    // SAFETY: the words are at this offset inside the Code.
    unsafe { code.byte_add((*code).words_offset()).cast() }
}

/// Constant `index` of the function whose frame has its registers at `base`.
///
/// # Safety
/// `base` is that of a frame, and the code of its function has such a constant.
#[inline(always)]
unsafe fn constant(base: *mut Value, index: usize) -> Value {
    // SAFETY: F2: the function is below the registers; by the contract its code has such a constant.
    unsafe { *constants_of(code_of(*base.sub(2))).add(index) }
}

/// Returns the word of the instruction at `pc`, which may be the first part of a fused one.
///
/// # Safety
/// `pc` points into code.
#[inline(always)]
unsafe fn word_at(pc: *const u32) -> Word {
    // SAFETY: by the contract there is a word of live code.
    original(Word(unsafe { *pc }))
}

/// Returns the word at `pc` as the loop runs it.
///
/// # Safety
/// `pc` points into code.
#[inline(always)]
unsafe fn loaded_word_at(pc: *const u32) -> Word {
    // SAFETY: by the contract there is a word of live code.
    Word(unsafe { *pc })
}

/// Returns the aux word of the instruction at `pc`.
///
/// # Safety
/// `pc` is at an instruction of two words.
#[inline(always)]
unsafe fn aux_at(pc: *const u32) -> u32 {
    // SAFETY: by the contract a second word of live code follows.
    unsafe { *pc.add(1) }
}

/// Returns the operation of a word.
///
/// # Safety
/// The word is one of code that has passed the verifier and may have been fused, or of a stub.
#[inline(always)]
unsafe fn operation(word: Word) -> LoopOperation {
    // SAFETY: V1: the low byte of an instruction is the number of an operation; those of stubs are operations
    // too, and so are the numbers that `fused::fuse` puts in the place of others.
    unsafe { std::mem::transmute(word.number()) }
}

/// Returns a pc as a word of a stack: its low bits are clear, so it looks like a fixnum.
#[inline(always)]
fn pc_as_value(pc: *const u32) -> Value {
    // SAFETY: the bits of a fixnum, since a word of code is aligned to four bytes.
    unsafe { Value::from_bits(pc.expose_provenance() as u64) }
}

/// Returns the pc that is in a word of a stack.
#[inline(always)]
fn pc_from_value(word: Value) -> *const u32 {
    std::ptr::with_exposed_provenance(word.bits() as usize)
}

/// Notes a failure of the instruction that is worked on.
fn failure(vm: &mut Vm, raised: Raised) -> Signal {
    vm.exchange.raised = Some(raised);
    Signal::Exit(Exit::Raise)
}

/// Element `i` of a simple vector, box or other record.
///
/// # Safety
/// `object` is a record with more than `i` elements.
#[inline(always)]
unsafe fn element(object: Value, i: usize) -> *mut Value {
    // SAFETY: by the contract the record has such an element; elements follow the header.
    unsafe { object.object_ptr().byte_add(size_of::<Vector>()).cast::<Value>().add(i) }
}

#[inline(always)]
fn is_simple_vector(v: Value) -> bool {
    // SAFETY: H1, H2: an object's value is the address of a live header.
    v.is_object() && unsafe { (*v.object_ptr()).kind == Kind::SimpleVector }
}

/// Makes the task in `vm.scheduler.running` the one whose registers are in `vm.cpu`, with so many ticks.
pub(crate) fn load(vm: &mut Vm, ticks: i32) {
    let task = vm.scheduler.task();
    let pc = task.pc.get();
    // SAFETY: F3: the base of the task lies in its stack.
    let base = unsafe { task.stack.start().add(task.base as usize) };
    let stack_end = reserve::stack_end(&vm.config, task);
    // SAFETY: the task stands at `pc` in the frame at `base`, and may use its stack up to `stack_end`.
    vm.cpu = unsafe { Cpu::at(pc, base, stack_end, ticks) };
    vm.arm();
}

/// Calls `function` where the task in `vm.scheduler.running`, which is loaded, stands.
pub(crate) fn interrupt(
    vm: &mut Vm,
    function: Value,
    arguments: &[Value],
    lent: Option<Value>,
) -> Result<(), Leave> {
    // SAFETY: F1: the task is loaded; a task that was switched out stands at an instruction that has had no
    // effect yet.
    unsafe {
        let signal = interrupt::interrupt(vm, function, arguments, lent);
        settle(vm, signal)
    }
}

/// Runs the task in `vm.scheduler.running` from `vm.cpu` until it leaves the processor.
#[inline]
pub(crate) fn run(vm: &mut Vm) -> Leave {
    if vm.scheduler.task().control.is_unwinding() {
        // SAFETY: F1: the task is loaded, and what unwinds it works on its control stack and on `vm.cpu`
        // only.
        if let Err(leave) = unsafe { settle(vm, Signal::Unwind) } {
            return leave;
        }
    }
    loop {
        // SAFETY: F1, F2: `vm.cpu` describes the running task: its pc lies in code that its innermost frame
        // keeps alive and that has passed the verifier, its base in its stack, with room for the registers of
        // that code.
        let signal = unsafe { dispatch(vm) };
        if signal == Signal::Exit(Exit::Park) && vm.scheduler.task().critical == 0 {
            return Leave::Parked;
        }
        // SAFETY: F1: `dispatch` has put its registers back, at the instruction that gave the signal.
        let signal = unsafe { settle(vm, signal) };
        if let Err(leave) = signal {
            return leave;
        }
    }
}

/// Deals with a signal, and with those that follow from it, until the loop can go on.
///
/// # Safety
/// `vm.cpu` describes the running task, at the instruction that gave the signal.
unsafe fn settle(vm: &mut Vm, mut signal: Signal) -> Result<(), Leave> {
    // SAFETY: F1 holds by the contract, and each of these functions needs just that and restores it.
    unsafe {
        loop {
            signal = match signal {
                Signal::Reload => return Ok(()),
                Signal::Next => {
                    let words = stubs::length(word_at(vm.cpu.pc()));
                    vm.cpu.set_pc(vm.cpu.pc().add(words));
                    return Ok(());
                }
                Signal::Tick => match vm.safepoint() {
                    Some(leave) => return Err(leave),
                    None if vm.scheduler.task().control.is_unwinding() => Signal::Unwind,
                    None => return Ok(()),
                },
                Signal::Park if vm.scheduler.task().critical > 0 => {
                    vm.scheduler.cancel_wait(&mut vm.heap);
                    failure(vm, Raised::Failure("WOULD-BLOCK"))
                }
                Signal::Park => return Err(Leave::Parked),
                Signal::Again => return Err(Leave::Slice),
                Signal::Exit(exit) => exit::exit(vm, exit),
                Signal::Call => call::slow_call(vm),
                Signal::ReturnAll => substitute::return_all(vm),
                Signal::Unwind => {
                    let signal = unwind::unwind(vm);
                    // A cleanup that begins may have less to use than the slice.
                    if vm.wants_safepoint() {
                        vm.cpu.ticks = vm.prepare_safepoint(vm.cpu.ticks);
                    }
                    signal
                }
                Signal::TaskExit => return end::end_task(vm),
            };
        }
    }
}

/// The inner loop.
///
/// # Safety
/// The contract of [`settle`]; the code at `pc` has passed the verifier, or is a stub.
#[allow(clippy::too_many_lines, reason = "one arm for each row of the opcode table")]
unsafe fn dispatch(vm: &mut Vm) -> Signal {
    let mut pc = vm.cpu.pc();
    let mut base = vm.cpu.base();
    let mut ticks = vm.cpu.ticks;
    // SAFETY: F2: below the base is the function of the frame, which keeps its code alive.
    let mut k = unsafe { constants_of(code_of(*base.sub(2))) };

    // SAFETY: for the whole loop, V1 makes every word reached an instruction with its aux word; V3 keeps
    // registers inside the frame, for which the call made room (F2); V4 keeps constants inside the code; V6
    // makes every register read hold an object of the program, whose value is the address of a live object.
    // Facts that depend on data are tested before they are used (M6).
    let signal = unsafe {
        let mut word = loaded_word_at(pc);
        loop {
            // Goes on with the instruction at `pc`.
            macro_rules! go_on {
                () => {{
                    word = loaded_word_at(pc);
                    continue;
                }};
            }
            macro_rules! aux {
                () => {
                    aux_at(pc)
                };
            }
            macro_rules! get {
                ($register:expr) => {
                    *base.add($register)
                };
            }
            macro_rules! set {
                ($register:expr, $value:expr) => {{
                    let value = $value;
                    *base.add($register) = value;
                }};
            }
            // Keeps the ends of arms apart. The code generator would make one end of those that are alike,
            // which costs a jump per instruction; it cannot with a line of assembly that differs, though
            // nothing is in it. WebAssembly has no lines of assembly, and no jumps that could be saved.
            macro_rules! apart {
                () => {
                    apart!(0)
                };
                ($which:literal) => {
                    #[cfg(not(any(miri, target_family = "wasm")))]
                    std::arch::asm!(
                        "/* {} {} */", const line!(), const $which, options(nomem, nostack, preserves_flags)
                    );
                };
            }
            // Goes on after an instruction of this many words.
            macro_rules! next {
                ($words:expr) => {
                    next!($words, 0)
                };
                // One of several ends of an arm.
                ($words:expr, $which:literal) => {{
                    pc = pc.add($words);
                    apart!($which);
                    go_on!();
                }};
            }
            // Jumps from behind an instruction of this many words.
            macro_rules! jump {
                ($words:expr, $offset:expr) => {{
                    pc = pc.add($words).offset($offset);
                    apart!();
                    go_on!();
                }};
            }
            macro_rules! jump_if {
                ($words:expr, $test:expr, $offset:expr) => {{
                    if $test {
                        jump!($words, $offset);
                    }
                    next!($words);
                }};
            }
            macro_rules! tick {
                () => {
                    if !cfg!(feature = "no-ticks") {
                        ticks -= 1;
                        if ticks < 0 {
                            break Signal::Tick;
                        }
                    }
                };
            }
            // Handles the charges of a builtin and the requests of an allocation.
            macro_rules! attend {
                () => {
                    if vm.wants_safepoint() {
                        ticks = vm.prepare_safepoint(ticks);
                    }
                };
            }
            // Leaves the instruction to the function of its slow half.
            macro_rules! leave_to {
                ($name:ident, $half:path) => {{
                    match $half(vm, pc, base) {
                        Signal::Next => {
                            attend!();
                            next!(const { Opcode::$name.words() });
                        }
                        signal => break signal,
                    }
                }};
            }
            // Leaves a test to a function that returns whether it holds.
            macro_rules! leave_test_to {
                ($name:ident, $half:path) => {{
                    match $half(vm, pc, base) {
                        Ok(holds) => {
                            let jumps = holds == const { Opcode::$name.jumps_when() };
                            jump_if!(2, jumps, aux!() as i32 as isize)
                        }
                        Err(signal) => break signal,
                    }
                }};
            }
            // The slow half of an instruction, by the words of its row.
            macro_rules! slow_half {
                ($name:ident [test $builtin:ident]) => {
                    leave_test_to!($name, cold::test::<{ Opcode::$name as u8 }>)
                };
                ($name:ident [test_not $builtin:ident]) => {
                    leave_test_to!($name, cold::test::<{ Opcode::$name as u8 }>)
                };
                ($name:ident [$kind:ident $builtin:ident]) => {
                    leave_to!($name, cold::compute::<{ Opcode::$name as u8 }>)
                };
                // The arm has tried the function.
                ($name:ident [$kind:ident $builtin:ident] first $half:path) => {
                    slow_half!($name [$kind $builtin])
                };
                ($name:ident [$($kind:ident)+] does $half:path) => {
                    leave_to!($name, $half)
                };
                ($name:ident [$($kind:ident)+] rest $half:path) => {
                    leave_to!($name, $half)
                };
                ($name:ident [$($kind:ident)+] quiet $half:path) => {{
                    $half(vm, pc, base);
                    next!(const { Opcode::$name.words() })
                }};
                ($name:ident [$($kind:ident)+] gives $half:path) => {{
                    set!(word.a(), $half(vm, word, base, k));
                    next!(const { Opcode::$name.words() })
                }};
                ($name:ident [$($kind:ident)+] jumps $half:path) => {
                    jump_if!(2, $half(vm, word, base, k), aux!() as i32 as isize)
                };
                ($name:ident [$($kind:ident)+] stays $half:path) => {
                    jump_if!(2, !$half(vm, word, base, k), aux!() as i32 as isize)
                };
                ($name:ident [$($kind:ident)+] test $half:path) => {
                    leave_test_to!($name, $half)
                };
            }
            // `slow!` is the slow half of an instruction; `first!` is the function that is tried before the
            // builtin.
            macro_rules! define_slow_halves {
                ($( $(#[doc = $doc:literal])* $name:ident = $number:literal, $mnemonic:literal,
                    $($kind:ident)+ { $( $field:ident : $ty:ident ),* } $( , $slow:ident $half:path )? ; )*
                ) => {
                    macro_rules! slow {
                        $( ($name) => { slow_half!($name [$($kind)+] $($slow $half)?) }; )*
                    }
                    macro_rules! first {
                        $( ($name) => { $( $half )? }; )*
                    }
                };
            }
            for_each_opcode!(define_slow_halves);
            // A double and a fixnum, or a zero.
            macro_rules! mixed {
                ($operation:ident, $x:expr, $y:expr) => {{
                    let v = first!($operation)($x, $y);
                    if v != Value::UNBOUND {
                        set!(word.a(), v);
                        next!(1, 2);
                    }
                    slow!($operation)
                }};
            }
            macro_rules! arithmetic {
                ($operation:ident, $fixnum:ident, $float:tt) => {{
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) {
                        let (sum, overflow) = (x.bits() as i64).$fixnum(y.bits() as i64);
                        if !overflow {
                            set!(word.a(), Value::from_bits(sum as u64));
                            next!(1);
                        }
                    } else if Value::both_windowed_doubles(x, y) {
                        let result = double::load(base.add(word.b())) $float double::load(base.add(word.c()));
                        if double::store(base.add(word.a()), result) {
                            next!(1, 1);
                        }
                    }
                    mixed!($operation, x, y)
                }};
            }
            macro_rules! compare {
                ($operator:tt, $x:expr, $y:expr, $then:expr, $else:expr) => {{
                    let (x, y) = ($x, $y);
                    if Value::both_fixnums(x, y) {
                        if (x.bits() as i64) $operator (y.bits() as i64) { $then } else { $else }
                    } else if Value::both_windowed_doubles(x, y) {
                        if x.windowed_double() $operator y.windowed_double() { $then } else { $else }
                    }
                }};
            }
            macro_rules! jump_compare {
                ($operation:ident, $operator:tt) => {{
                    let offset = aux!() as i32 as isize;
                    compare!(
                        $operator,
                        get!(word.a()),
                        get!(word.b()),
                        jump_if!(2, const { Opcode::$operation.jumps_when() }, offset),
                        jump_if!(2, const { !Opcode::$operation.jumps_when() }, offset)
                    );
                    slow!($operation)
                }};
            }
            macro_rules! jump_compare_int {
                ($operation:ident, $operator:tt) => {{
                    let offset = aux!() as i32 as isize;
                    let x = get!(word.a());
                    if x.is_fixnum() {
                        let holds = (x.bits() as i64) $operator (i64::from(word.signed_d()) << 2);
                        jump_if!(2, holds == const { Opcode::$operation.jumps_when() }, offset);
                    }
                    slow!($operation)
                }};
            }
            macro_rules! bitwise {
                ($operation:ident, $operator:tt) => {{
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) {
                        set!(word.a(), Value::from_bits(x.bits() $operator y.bits()));
                        next!(1);
                    }
                    slow!($operation)
                }};
            }
            // Makes the frame of a function with bytecode that takes exactly the given arguments.
            macro_rules! enter {
                ($window:expr, $function:expr, $code:expr, $return_to:expr) => {{
                    let (window, code): (*mut Value, *mut CodeObject) = ($window, $code);
                    let registers = window.add(2);
                    // The registers may end behind the stack, where `add` has no meaning.
                    if registers.wrapping_add((*code).nregs as usize) > vm.cpu.stack_end() {
                        break Signal::Call;
                    }
                    *window = $function;
                    *window.add(1) = pc_as_value($return_to);
                    base = registers;
                    k = constants_of(code);
                    pc = (*code).entry;
                    go_on!();
                }};
            }
            // As `enter!`, after the arguments have been put in the order of the function's parameters.
            macro_rules! enter_arranged {
                ($window:expr, $function:expr, $code:expr, $return_to:expr) => {{
                    if Shape::is_bytecode((*$code).spare[0])
                        && in_window::arrange(vm, $code, $window.add(2), word.b()).is_some()
                    {
                        enter!($window, $function, $code, $return_to);
                    }
                }};
            }
            // As `enter!`, in place of the running frame, if the function takes so many arguments.
            macro_rules! enter_in_place {
                ($window:expr, $function:expr) => {{
                    let (window, function): (*mut Value, Value) = ($window, $function);
                    let code = code_of(function);
                    if (*code).arity == word.b() as u32
                        && base.wrapping_add((*code).nregs as usize) <= vm.cpu.stack_end()
                    {
                        replace_frame!(window, function, code, word.b());
                    }
                    if Shape::is_bytecode((*code).spare[0])
                        && let Some(parameters) = in_window::arrange(vm, code, window.add(2), word.b())
                    {
                        replace_frame!(window, function, code, parameters);
                    }
                }};
            }
            // Puts the frame of a function, whose first registers lie in the window, in place of the running
            // one.
            macro_rules! replace_frame {
                ($window:expr, $function:expr, $code:expr, $count:expr) => {{
                    for i in 0..$count {
                        *base.add(i) = *$window.add(2 + i);
                    }
                    *base.sub(2) = $function;
                    k = constants_of($code);
                    pc = (*$code).entry;
                    go_on!();
                }};
            }
            // Calls the builtin of the instruction with the arguments in its window.
            macro_rules! call_native {
                ($wants_one:expr) => {{
                    let arguments = std::slice::from_raw_parts(base.add(word.a() + 2), word.b());
                    // SAFETY: V5: the number is in the table, the number of arguments right. The slice of
                    // arguments stays good, since no builtin writes to the stack or moves it.
                    let native = *vm.natives.get_unchecked(aux!() as usize);
                    vm.cpu.set_pc(pc);
                    vm.cpu.set_base(base);
                    vm.cpu.wants_one = $wants_one;
                    native(vm, arguments)
                }};
            }
            // Returns the value list.
            macro_rules! return_all {
                () => {{
                    vm.cpu.set_base(base);
                    substitute::return_all(vm);
                    pc = vm.cpu.pc();
                    base = vm.cpu.base();
                    k = constants_of(code_of(*base.sub(2)));
                    go_on!();
                }};
            }
            macro_rules! return_value {
                ($value:expr) => {{
                    let value = $value;
                    let return_to = pc_from_value(*base.sub(1));
                    // No fused instruction begins with a call.
                    let call = loaded_word_at(return_to.sub(2));
                    if call.c() != 0 {
                        vm.exchange.values.clear();
                        vm.exchange.values.push(value);
                        return_all!();
                    }
                    *base.sub(2) = value;
                    base = base.sub(2 + call.a());
                    pc = return_to;
                    k = constants_of(code_of(*base.sub(2)));
                    go_on!();
                }};
            }
            // Goes on as machine code has left off.
            #[cfg(feature = "native")]
            macro_rules! go_on_from {
                ($leaving:expr) => {{
                    let leaving = $leaving;
                    ticks = leaving.ticks;
                    match leaving.left {
                        native::Left::Returned(value) => return_value!(value),
                        native::Left::Values => {
                            base = leaving.base;
                            return_all!();
                        }
                        native::Left::Again => {
                            (pc, base) = (leaving.pc, leaving.base);
                            k = constants_of(code_of(*base.sub(2)));
                            // By the loop, even if machine code could be entered there.
                            word = word_at(pc);
                            continue;
                        }
                        native::Left::Signal(signal) => {
                            (pc, base) = (leaving.pc, leaving.base);
                            break signal;
                        }
                    }
                }};
            }
            macro_rules! multiply {
                () => {{
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) {
                        let (product, overflow) = (x.bits() as i64 >> 2).overflowing_mul(y.bits() as i64);
                        if !overflow {
                            set!(word.a(), Value::from_bits(product as u64));
                            next!(1);
                        }
                    } else if Value::both_windowed_doubles(x, y)
                        && double::store(
                            base.add(word.a()),
                            double::load(base.add(word.b())) * double::load(base.add(word.c())),
                        )
                    {
                        next!(1, 1);
                    }
                    mixed!(Mul, x, y)
                }};
            }
            macro_rules! modulo {
                () => {{
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) && (y.bits() as i64) > 0 {
                        // Both are shifted by two, and so is the remainder.
                        let remainder = (x.bits() as i64).rem_euclid(y.bits() as i64);
                        set!(word.a(), Value::from_bits(remainder as u64));
                        next!(1);
                    }
                    slow!(Mod)
                }};
            }
            // Goes on with the next part of a fused instruction.
            macro_rules! next_part {
                () => {{
                    pc = pc.add(1);
                    word = loaded_word_at(pc);
                }};
            }
            macro_rules! on_fixnums {
                (Add, $x:expr, $y:expr) => {
                    ($x.bits() as i64).overflowing_add($y.bits() as i64)
                };
                (Sub, $x:expr, $y:expr) => {
                    ($x.bits() as i64).overflowing_sub($y.bits() as i64)
                };
                (Mul, $x:expr, $y:expr) => {
                    ($x.bits() as i64 >> 2).overflowing_mul($y.bits() as i64)
                };
            }
            macro_rules! on_doubles {
                (Add, $x:expr, $y:expr) => {
                    $x + $y
                };
                (Sub, $x:expr, $y:expr) => {
                    $x - $y
                };
                (Mul, $x:expr, $y:expr) => {
                    $x * $y
                };
            }
            // Applies an operation to the result of the part before and to another operand.
            macro_rules! on_result {
                ($apply:ident, $operation:ident, right, $result:expr, $other:expr) => {
                    $apply!($operation, $other, $result)
                };
                ($apply:ident, $operation:ident, $side:ident, $result:expr, $other:expr) => {
                    $apply!($operation, $result, $other)
                };
            }
            // Register of the operand of a second part that is not the result of the first.
            macro_rules! other_operand {
                ($second:expr, left) => {
                    $second.c()
                };
                ($second:expr, right) => {
                    $second.b()
                };
                // One of the two is the result of the first part.
                ($second:expr, either) => {
                    $second.b() ^ $second.c() ^ word.a()
                };
            }
            // The second part of a fused instruction, as the instruction that it is.
            macro_rules! part {
                (Add) => {
                    arithmetic!(Add, overflowing_add, +)
                };
                (Sub) => {
                    arithmetic!(Sub, overflowing_sub, -)
                };
                (Mul) => {
                    multiply!()
                };
                (Mod) => {
                    modulo!()
                };
            }
            // Does the first part of a fused instruction as the instruction that it is.
            macro_rules! first_part {
                () => {{
                    word = original(word);
                    continue;
                }};
            }
            // Two operations, of which the second uses the result of the first. Registers are written in the
            // order of the parts, since the second may write to that of the first.
            macro_rules! arithmetic_twice {
                ($first:ident, $second:ident, $side:ident) => {{
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    let second = loaded_word_at(pc.add(1));
                    let other = base.add(other_operand!(second, $side));
                    if Value::both_fixnums(x, y) {
                        let (result, overflow) = on_fixnums!($first, x, y);
                        if !overflow {
                            let result = Value::from_bits(result as u64);
                            set!(word.a(), result);
                            let other = *other;
                            if other.is_fixnum() {
                                let (result, overflow) =
                                    on_result!(on_fixnums, $second, $side, result, other);
                                if !overflow {
                                    set!(second.a(), Value::from_bits(result as u64));
                                    next!(2);
                                }
                            }
                            next!(1, 1);
                        }
                    } else if Value::both_windowed_doubles(x, y) {
                        let (x, y) = (base.add(word.b()), base.add(word.c()));
                        let result = on_doubles!($first, double::load(x), double::load(y));
                        if double::store(base.add(word.a()), result) {
                            if (*other).is_windowed_double() {
                                let result =
                                    on_result!(on_doubles, $second, $side, result, double::load(other));
                                if double::store(base.add(second.a()), result) {
                                    next!(2, 2);
                                }
                            }
                            next!(1, 3);
                        }
                    }
                    first_part!()
                }};
            }
            // The sum or difference of two products.
            macro_rules! products {
                ($operation:ident) => {{
                    let (second, third) = (loaded_word_at(pc.add(1)), loaded_word_at(pc.add(2)));
                    let (x, y) = (base.add(word.b()), base.add(word.c()));
                    let (v, w) = (base.add(second.b()), base.add(second.c()));
                    if Value::both_windowed_doubles(*x, *y) && Value::both_windowed_doubles(*v, *w) {
                        let left = double::load(x) * double::load(y);
                        let right = double::load(v) * double::load(w);
                        if double::store(base.add(word.a()), left) {
                            if double::store(base.add(second.a()), right) {
                                let result = on_doubles!($operation, left, right);
                                if double::store(base.add(third.a()), result) {
                                    next!(3);
                                }
                                next!(2, 1);
                            }
                            next!(1, 2);
                        }
                    }
                    first_part!()
                }};
            }
            // An operation on an element of a simple vector.
            macro_rules! element_and {
                ($second:ident, $side:ident) => {{
                    let (vector, index) = (get!(word.b()), get!(word.c()));
                    if is_simple_vector(vector)
                        && index.is_fixnum()
                        && index.bits() >> 2 < u64::from((*vector.object_ptr()).len)
                    {
                        let place = element(vector, (index.bits() >> 2) as usize);
                        let value = *place;
                        set!(word.a(), value);
                        let second = loaded_word_at(pc.add(1));
                        let other = base.add(other_operand!(second, $side));
                        if Value::both_windowed_doubles(value, *other) {
                            let (value, other) = (double::load(place), double::load(other));
                            let result = on_result!(on_doubles, $second, $side, value, other);
                            if double::store(base.add(second.a()), result) {
                                next!(2);
                            }
                        }
                        next!(1, 1);
                    }
                    first_part!()
                }};
            }
            // An element of a simple vector times something, added to something else.
            macro_rules! element_product_and_sum {
                () => {{
                    let (vector, index) = (get!(word.b()), get!(word.c()));
                    if is_simple_vector(vector)
                        && index.is_fixnum()
                        && index.bits() >> 2 < u64::from((*vector.object_ptr()).len)
                    {
                        let place = element(vector, (index.bits() >> 2) as usize);
                        let value = *place;
                        set!(word.a(), value);
                        let (second, third) = (loaded_word_at(pc.add(1)), loaded_word_at(pc.add(2)));
                        let factor = base.add(second.b() ^ second.c() ^ word.a());
                        if Value::both_windowed_doubles(value, *factor) {
                            let product = double::load(place) * double::load(factor);
                            if double::store(base.add(second.a()), product) {
                                let other = base.add(third.b() ^ third.c() ^ second.a());
                                if (*other).is_windowed_double()
                                    && double::store(base.add(third.a()), product + double::load(other))
                                {
                                    next!(3);
                                }
                                next!(2, 1);
                            }
                        }
                        next!(1, 2);
                    }
                    first_part!()
                }};
            }
            // Loads a value, then goes on with an operation.
            macro_rules! load_and {
                ($value:expr, $second:ident) => {{
                    set!(word.a(), $value);
                    next_part!();
                    part!($second)
                }};
            }
            macro_rules! call_global {
                () => {{
                    tick!();
                    // SAFETY: V4: the constant is a symbol, and the function of a symbol is a Function.
                    let symbol = (*k.add(aux!() as usize)).object_ptr().cast::<SymbolObject>();
                    let function = (*symbol).function;
                    let code = code_of(function);
                    if (*code).arity == word.b() as u32 {
                        enter!(base.add(word.a()), function, code, pc.add(2));
                    }
                    enter_arranged!(base.add(word.a()), function, code, pc.add(2));
                    break Signal::Call;
                }};
            }
            macro_rules! call_self {
                () => {{
                    tick!();
                    // SAFETY: V5: the running function takes exactly these arguments.
                    let code = k.byte_sub(CodeObject::CONSTANTS_OFFSET).cast::<CodeObject>().cast_mut();
                    enter!(base.add(word.a()), *base.sub(2), code, pc.add(2));
                }};
            }
            macro_rules! car {
                () => {{
                    let list = get!(word.b());
                    if !list.is_cons() {
                        slow!(Car)
                    }
                    set!(word.a(), (*list.cons_ptr()).car);
                }};
            }
            macro_rules! cdr {
                () => {{
                    let list = get!(word.b());
                    if !list.is_cons() {
                        slow!(Cdr)
                    }
                    set!(word.a(), (*list.cons_ptr()).cdr);
                }};
            }
            macro_rules! add_int {
                ($next:expr) => {{
                    let x = get!(word.b());
                    if x.is_fixnum() {
                        let addend = i64::from(word.signed_c()) << 2;
                        let (sum, overflow) = (x.bits() as i64).overflowing_add(addend);
                        if !overflow {
                            set!(word.a(), Value::from_bits(sum as u64));
                            $next
                        }
                    } else if x.is_windowed_double()
                        && double::store(
                            base.add(word.a()),
                            double::load(base.add(word.b())) + f64::from(word.signed_c()),
                        )
                    {
                        next!(1, 1);
                    }
                    slow!(AddInt)
                }};
            }

            match operation(word) {
                // ---- moves and constants
                LoopOperation::Move => {
                    set!(word.a(), get!(word.b()));
                    next!(1)
                }
                LoopOperation::LoadInt => {
                    set!(word.a(), Value::small(word.signed_d()));
                    next!(1)
                }
                LoopOperation::LoadConst => {
                    set!(word.a(), *k.add(word.d()));
                    next!(1)
                }
                LoopOperation::LoadNil => {
                    for i in 0..word.b() {
                        set!(word.a() + i, Value::NIL);
                    }
                    next!(1)
                }
                LoopOperation::LoadTrue => {
                    set!(word.a(), Value::T);
                    next!(1)
                }

                // ---- arithmetic
                LoopOperation::Add => arithmetic!(Add, overflowing_add, +),
                LoopOperation::Sub => arithmetic!(Sub, overflowing_sub, -),
                LoopOperation::Mul => multiply!(),
                LoopOperation::Div => {
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_windowed_doubles(x, y)
                        && double::store(
                            base.add(word.a()),
                            double::load(base.add(word.b())) / double::load(base.add(word.c())),
                        )
                    {
                        next!(1);
                    }
                    mixed!(Div, x, y)
                }
                LoopOperation::AddInt => add_int!(next!(1)),
                LoopOperation::Floor => {
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) && (y.bits() as i64) > 0 {
                        let quotient = (x.bits() as i64).div_euclid(y.bits() as i64);
                        set!(word.a(), Value::from_bits((quotient << 2) as u64));
                        next!(1);
                    }
                    slow!(Floor)
                }
                LoopOperation::Truncate => {
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) && (y.bits() as i64) > 0 {
                        let quotient = (x.bits() as i64) / (y.bits() as i64);
                        set!(word.a(), Value::from_bits((quotient << 2) as u64));
                        next!(1);
                    }
                    slow!(Truncate)
                }
                LoopOperation::Mod => modulo!(),
                LoopOperation::Rem => {
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) && (y.bits() as i64) > 0 {
                        let remainder = (x.bits() as i64) % (y.bits() as i64);
                        set!(word.a(), Value::from_bits(remainder as u64));
                        next!(1);
                    }
                    slow!(Rem)
                }
                LoopOperation::LogAnd => bitwise!(LogAnd, &),
                LoopOperation::LogIor => bitwise!(LogIor, |),
                LoopOperation::LogXor => bitwise!(LogXor, ^),
                LoopOperation::Ash => {
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) {
                        let (n, shift) = (x.bits() as i64, y.bits() as i64 >> 2);
                        if shift <= 0 {
                            let shifted = n >> (-shift).min(63);
                            set!(word.a(), Value::from_bits((shifted & !3) as u64));
                            next!(1);
                        }
                        if shift < 62 && (n << shift) >> shift == n {
                            set!(word.a(), Value::from_bits((n << shift) as u64));
                            next!(1);
                        }
                    }
                    slow!(Ash)
                }

                // ---- comparisons that give T or NIL
                LoopOperation::Not => {
                    set!(word.a(), Value::boolean(get!(word.b()).is_nil()));
                    next!(1)
                }
                LoopOperation::Eq => {
                    set!(word.a(), Value::boolean(get!(word.b()) == get!(word.c())));
                    next!(1)
                }
                LoopOperation::Eql => slow!(Eql),
                LoopOperation::NumEq => {
                    compare!(==, get!(word.b()), get!(word.c()),
                        { set!(word.a(), Value::T); next!(1) }, { set!(word.a(), Value::NIL); next!(1) });
                    slow!(NumEq)
                }
                LoopOperation::Less => {
                    compare!(<, get!(word.b()), get!(word.c()),
                        { set!(word.a(), Value::T); next!(1) }, { set!(word.a(), Value::NIL); next!(1) });
                    slow!(Less)
                }
                LoopOperation::LessEq => {
                    compare!(<=, get!(word.b()), get!(word.c()),
                        { set!(word.a(), Value::T); next!(1) }, { set!(word.a(), Value::NIL); next!(1) });
                    slow!(LessEq)
                }
                LoopOperation::CharEq => {
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if x.is_character() && y.is_character() {
                        set!(word.a(), Value::boolean(x == y));
                        next!(1);
                    }
                    slow!(CharEq)
                }
                LoopOperation::IsType => slow!(IsType),

                // ---- jumps forward
                LoopOperation::JumpAlways => jump!(1, word.signed_e() as isize),
                LoopOperation::JumpIfNil => {
                    jump_if!(1, get!(word.a()).is_nil(), word.signed_d() as isize)
                }
                LoopOperation::JumpIfNotNil => {
                    jump_if!(1, get!(word.a()).is_true(), word.signed_d() as isize)
                }
                LoopOperation::JumpIfCons => {
                    jump_if!(1, get!(word.a()).is_cons(), word.signed_d() as isize)
                }
                LoopOperation::JumpIfNotCons => {
                    jump_if!(1, !get!(word.a()).is_cons(), word.signed_d() as isize)
                }
                LoopOperation::JumpIfSupplied => {
                    jump_if!(1, get!(word.a()) != Value::UNSUPPLIED, word.signed_d() as isize)
                }
                LoopOperation::JumpEq => {
                    jump_if!(2, get!(word.a()) == get!(word.b()), aux!() as i32 as isize)
                }
                LoopOperation::JumpNotEq => {
                    jump_if!(2, get!(word.a()) != get!(word.b()), aux!() as i32 as isize)
                }
                LoopOperation::JumpEql => slow!(JumpEql),
                LoopOperation::JumpNotEql => slow!(JumpNotEql),
                LoopOperation::JumpEqlConst => slow!(JumpEqlConst),
                LoopOperation::JumpNotEqlConst => slow!(JumpNotEqlConst),
                LoopOperation::JumpIfType => slow!(JumpIfType),
                LoopOperation::JumpIfNotType => slow!(JumpIfNotType),
                LoopOperation::JumpNumEq => jump_compare!(JumpNumEq, ==),
                LoopOperation::JumpNotNumEq => jump_compare!(JumpNotNumEq, ==),
                LoopOperation::JumpLess => jump_compare!(JumpLess, <),
                LoopOperation::JumpNotLess => jump_compare!(JumpNotLess, <),
                LoopOperation::JumpLessEq => jump_compare!(JumpLessEq, <=),
                LoopOperation::JumpNotLessEq => jump_compare!(JumpNotLessEq, <=),
                LoopOperation::JumpNumEqInt => jump_compare_int!(JumpNumEqInt, ==),
                LoopOperation::JumpNotNumEqInt => jump_compare_int!(JumpNotNumEqInt, ==),
                LoopOperation::JumpLessInt => jump_compare_int!(JumpLessInt, <),
                LoopOperation::JumpNotLessInt => jump_compare_int!(JumpNotLessInt, <),
                LoopOperation::JumpGreaterInt => jump_compare_int!(JumpGreaterInt, >),
                LoopOperation::JumpNotGreaterInt => jump_compare_int!(JumpNotGreaterInt, >),

                // ---- loops
                LoopOperation::Loop => {
                    tick!();
                    jump!(1, word.signed_e() as isize)
                }
                LoopOperation::LoopIfNil => {
                    if get!(word.a()).is_nil() {
                        tick!();
                        jump!(1, word.signed_d() as isize);
                    }
                    next!(1)
                }
                LoopOperation::LoopIfNotNil => {
                    if get!(word.a()).is_true() {
                        tick!();
                        jump!(1, word.signed_d() as isize);
                    }
                    next!(1)
                }
                LoopOperation::LoopIfCons => {
                    if get!(word.a()).is_cons() {
                        tick!();
                        jump!(1, word.signed_d() as isize);
                    }
                    next!(1)
                }
                LoopOperation::LoopLess => {
                    tick!();
                    jump_compare!(LoopLess, <)
                }
                LoopOperation::LoopNotLess => {
                    tick!();
                    jump_compare!(LoopNotLess, <)
                }
                LoopOperation::LoopCount => {
                    tick!();
                    let (x, limit) = (get!(word.a()), get!(word.b()));
                    let step = i64::from(word.signed_c()) << 2;
                    if Value::both_fixnums(x, limit) {
                        let (sum, overflow) = (x.bits() as i64).overflowing_add(step);
                        if !overflow {
                            set!(word.a(), Value::from_bits(sum as u64));
                            jump_if!(2, sum < limit.bits() as i64, aux!() as i32 as isize);
                        }
                    }
                    slow!(LoopCount)
                }

                // ---- lists
                LoopOperation::Cons => {
                    if let Some(v) = vm.heap.cons_in_hole(get!(word.b()), get!(word.c())) {
                        set!(word.a(), v);
                        next!(1);
                    }
                    slow!(Cons)
                }
                LoopOperation::Car => {
                    car!();
                    next!(1)
                }
                LoopOperation::Cdr => {
                    cdr!();
                    next!(1)
                }
                LoopOperation::Cadr => {
                    let list = get!(word.b());
                    if list.is_cons() {
                        let rest = (*list.cons_ptr()).cdr;
                        if rest.is_cons() {
                            set!(word.a(), (*rest.cons_ptr()).car);
                            next!(1);
                        }
                    }
                    slow!(Cadr)
                }
                LoopOperation::Cddr => {
                    let list = get!(word.b());
                    if list.is_cons() {
                        let rest = (*list.cons_ptr()).cdr;
                        if rest.is_cons() {
                            set!(word.a(), (*rest.cons_ptr()).cdr);
                            next!(1);
                        }
                    }
                    slow!(Cddr)
                }
                LoopOperation::SetCar => {
                    let pair = get!(word.a());
                    if pair.is_cons() {
                        vm.heap.store(&raw mut (*pair.cons_ptr()).car, get!(word.b()));
                        next!(1);
                    }
                    slow!(SetCar)
                }
                LoopOperation::SetCdr => {
                    let pair = get!(word.a());
                    if pair.is_cons() {
                        vm.heap.store(&raw mut (*pair.cons_ptr()).cdr, get!(word.b()));
                        next!(1);
                    }
                    slow!(SetCdr)
                }
                LoopOperation::List => slow!(List),

                // ---- vectors and structures
                LoopOperation::VectorRef | LoopOperation::ArrayRef => {
                    let (vector, index) = (get!(word.b()), get!(word.c()));
                    if is_simple_vector(vector)
                        && index.is_fixnum()
                        && index.bits() >> 2 < u64::from((*vector.object_ptr()).len)
                    {
                        set!(word.a(), *element(vector, (index.bits() >> 2) as usize));
                        next!(1);
                    }
                    if word.number() == Opcode::VectorRef as u8 {
                        slow!(VectorRef)
                    }
                    slow!(ArrayRef)
                }
                LoopOperation::VectorSet | LoopOperation::ArraySet => {
                    let (vector, index) = (get!(word.a()), get!(word.b()));
                    if is_simple_vector(vector)
                        && index.is_fixnum()
                        && index.bits() >> 2 < u64::from((*vector.object_ptr()).len)
                    {
                        vm.heap.store(element(vector, (index.bits() >> 2) as usize), get!(word.c()));
                        next!(1);
                    }
                    if word.number() == Opcode::VectorSet as u8 {
                        slow!(VectorSet)
                    }
                    slow!(ArraySet)
                }
                LoopOperation::VectorRefInt => {
                    let (vector, index) = (get!(word.b()), word.c());
                    if is_simple_vector(vector) && index < (*vector.object_ptr()).len as usize {
                        set!(word.a(), *element(vector, index));
                        next!(1);
                    }
                    slow!(VectorRefInt)
                }
                LoopOperation::VectorSetInt => {
                    let (vector, index) = (get!(word.a()), word.b());
                    if is_simple_vector(vector) && index < (*vector.object_ptr()).len as usize {
                        vm.heap.store(element(vector, index), get!(word.c()));
                        next!(1);
                    }
                    slow!(VectorSetInt)
                }
                LoopOperation::CharRef => {
                    let (string, index) = (get!(word.b()), get!(word.c()));
                    if string.is_object() && index.is_fixnum() {
                        let header = string.object_ptr();
                        let at = index.bits() >> 2;
                        if (*header).kind == Kind::String && at < u64::from((*header).len) {
                            let code = *header.add(1).cast::<u32>().add(at as usize);
                            if let Some(v) = Value::character(code) {
                                set!(word.a(), v);
                                next!(1);
                            }
                        }
                    }
                    slow!(CharRef)
                }
                LoopOperation::Slot => {
                    let instance = get!(word.b());
                    if is_instance_of_exactly(instance, *k.add(aux!() as usize)) {
                        // The class has the slot: the compiler took its number from it, and `cold::slot`
                        // checked it when this place met the class first. Instances of a class never change
                        // in length.
                        let slot = word.c() + 1;
                        if slot < (*instance.object_ptr()).len as usize {
                            set!(word.a(), *element(instance, slot));
                            next!(2);
                        }
                    }
                    slow!(Slot)
                }
                LoopOperation::SetSlot => {
                    let instance = get!(word.a());
                    if is_instance_of_exactly(instance, *k.add(aux!() as usize)) {
                        let slot = word.b() + 1;
                        if slot < (*instance.object_ptr()).len as usize {
                            vm.heap.store(element(instance, slot), get!(word.c()));
                            next!(2);
                        }
                    }
                    slow!(SetSlot)
                }
                LoopOperation::JumpIfNotInstance => slow!(JumpIfNotInstance),

                // ---- variables
                LoopOperation::MakeBox => slow!(MakeBox),
                LoopOperation::BoxRef => {
                    // SAFETY: V7: the register holds a box. In the three arms below that deal with boxes, V7
                    // says the same of the register or capture.
                    set!(word.a(), (*get!(word.b()).object_ptr().cast::<Boxed>()).value);
                    next!(1)
                }
                LoopOperation::BoxSet => {
                    let cell = get!(word.a()).object_ptr().cast::<Boxed>();
                    vm.heap.store(&raw mut (*cell).value, get!(word.b()));
                    next!(1)
                }
                LoopOperation::MakeClosure => {
                    let function = *k.add(word.d());
                    // Functions without captures are made when their code is loaded.
                    if (*function.object_ptr()).kind == Kind::Function {
                        set!(word.a(), function);
                        next!(1);
                    }
                    slow!(MakeClosure)
                }
                LoopOperation::PatchCapture => {
                    // SAFETY: V8: the register holds a closure with such a capture.
                    vm.heap.store(element(get!(word.a()), 1 + word.b()), get!(word.c()));
                    next!(1)
                }
                LoopOperation::CaptureRef => {
                    // SAFETY: V8: the running function has such a capture.
                    set!(word.a(), *element(*base.sub(2), 1 + word.b()));
                    next!(1)
                }
                LoopOperation::CaptureBoxRef => {
                    let cell = *element(*base.sub(2), 1 + word.b());
                    set!(word.a(), (*cell.object_ptr().cast::<Boxed>()).value);
                    next!(1)
                }
                LoopOperation::CaptureBoxSet => {
                    let cell = *element(*base.sub(2), 1 + word.b());
                    vm.heap.store(&raw mut (*cell.object_ptr().cast::<Boxed>()).value, get!(word.a()));
                    next!(1)
                }
                LoopOperation::SymbolValue => {
                    // SAFETY: V4: the constant is a symbol.
                    let symbol = *k.add(word.d());
                    let cell = symbol.object_ptr().cast::<SymbolObject>();
                    let value = if (*cell).header.flags & SymbolObject::EVER_BOUND == 0 {
                        (*cell).value
                    } else {
                        variable::bound_value(vm, symbol)
                    };
                    if value != Value::UNBOUND {
                        set!(word.a(), value);
                        next!(1);
                    }
                    slow!(SymbolValue)
                }
                LoopOperation::SetSymbolValue => {
                    // SAFETY: V4: the constant is a symbol.
                    let symbol = (*k.add(word.d())).object_ptr().cast::<SymbolObject>();
                    if (*symbol).header.flags & (SymbolObject::EVER_BOUND | SymbolObject::CONSTANT) == 0 {
                        vm.heap.store(&raw mut (*symbol).value, get!(word.a()));
                        next!(1);
                    }
                    slow!(SetSymbolValue)
                }
                LoopOperation::Bind => slow!(Bind),
                LoopOperation::Unbind => slow!(Unbind),
                LoopOperation::BindList => slow!(BindList),
                LoopOperation::FunctionRef => slow!(FunctionRef),

                // ---- calls
                LoopOperation::Call => {
                    tick!();
                    let window = base.add(word.a());
                    let function = *window;
                    if function.is_object() && (*function.object_ptr()).kind == Kind::Function {
                        let code = code_of(function);
                        if (*code).arity == word.b() as u32 {
                            enter!(window, function, code, pc.add(2));
                        }
                        enter_arranged!(window, function, code, pc.add(2));
                    }
                    break Signal::Call;
                }
                LoopOperation::CallGlobal => call_global!(),
                LoopOperation::CallSelf => call_self!(),
                LoopOperation::CallBuiltin => {
                    tick!();
                    let window = base.add(word.a());
                    match call_native!(word.c() == 0) {
                        Ok(value) if word.c() == 0 => {
                            *window = value;
                            attend!();
                            next!(2)
                        }
                        Ok(value) => {
                            vm.exchange.values.clear();
                            vm.exchange.values.push(value);
                            substitute::deliver(vm, window, word.c());
                            next!(2)
                        }
                        Err(Exit::Values) => {
                            substitute::deliver(vm, window, word.c());
                            attend!();
                            next!(2)
                        }
                        Err(exit) => {
                            break Signal::Exit(exit);
                        }
                    }
                }
                LoopOperation::Apply | LoopOperation::TailApply => {
                    tick!();
                    break Signal::Call;
                }
                LoopOperation::TailCall => {
                    tick!();
                    let window = base.add(word.a());
                    let function = *window;
                    if function.is_object() && (*function.object_ptr()).kind == Kind::Function {
                        enter_in_place!(window, function);
                    }
                    break Signal::Call;
                }
                LoopOperation::TailCallGlobal => {
                    tick!();
                    // SAFETY: V4: the constant is a symbol, and the function of a symbol is a Function.
                    let symbol = (*k.add(aux!() as usize)).object_ptr().cast::<SymbolObject>();
                    enter_in_place!(base.add(word.a()), (*symbol).function);
                    break Signal::Call;
                }
                LoopOperation::TailCallBuiltin => {
                    tick!();
                    match call_native!(false) {
                        Ok(value) => {
                            attend!();
                            return_value!(value)
                        }
                        Err(Exit::Values) => {
                            attend!();
                            return_all!();
                        }
                        Err(exit) => {
                            break Signal::Exit(exit);
                        }
                    }
                }
                LoopOperation::Return => return_value!(get!(word.a())),
                LoopOperation::ReturnValues => {
                    if word.b() == 1 {
                        return_value!(get!(word.a()))
                    }
                    cold::set_values(vm, pc, base);
                    return_all!();
                }
                LoopOperation::ReturnAll => return_all!(),

                // ---- the value list
                LoopOperation::SetValues => slow!(SetValues),
                LoopOperation::GetValues => slow!(GetValues),
                LoopOperation::ValuesToList => slow!(ValuesToList),
                LoopOperation::ListToValues => slow!(ListToValues),

                // ---- the control stack
                LoopOperation::NewTag => slow!(NewTag),
                LoopOperation::PushCatch => slow!(PushCatch),
                LoopOperation::PushCleanup => slow!(PushCleanup),
                LoopOperation::PushHandlerCase => slow!(PushHandlerCase),
                LoopOperation::PushRecovery => slow!(PushRecovery),
                LoopOperation::PushFailureCleanup => slow!(PushFailureCleanup),
                LoopOperation::PushHandlers => slow!(PushHandlers),
                LoopOperation::PushMask => slow!(PushMask),
                LoopOperation::PushScope => slow!(PushScope),
                LoopOperation::PopControl => slow!(PopControl),
                LoopOperation::EnterCleanup => slow!(EnterCleanup),
                LoopOperation::EndCleanup => slow!(EndCleanup),
                LoopOperation::Throw => match unwind::throw(vm, pc, base) {
                    Signal::Next => next!(1),
                    signal => break signal,
                },

                // ---- counting
                LoopOperation::Pass => slow!(Pass),
                LoopOperation::Point => slow!(Point),

                // ---- stubs
                LoopOperation::ErrorReturn | LoopOperation::InterruptReturn => {
                    let signal = if word.number() == stubs::ERROR_RETURN {
                        substitute::error_return(vm, base)
                    } else {
                        interrupt::interrupt_return(vm, base)
                    };
                    // It has found the place to go on at.
                    pc = vm.cpu.pc();
                    base = vm.cpu.base();
                    break signal;
                }
                LoopOperation::TaskExit => break Signal::TaskExit,

                // ---- machine code
                #[cfg(feature = "native")]
                LoopOperation::NativeEntry => go_on_from!(native::enter(vm, pc, base, ticks)),
                #[cfg(feature = "native")]
                LoopOperation::MakeAtEntry => {
                    let code = code_of(*base.sub(2));
                    native::make_at_entry(vm, base);
                    pc = (*code).entry;
                    go_on!();
                }
                LoopOperation::QuickLoop
                | LoopOperation::QuickLoopIfNil
                | LoopOperation::QuickLoopIfNotNil
                | LoopOperation::QuickLoopIfCons
                | LoopOperation::QuickLoopLess
                | LoopOperation::QuickLoopNotLess
                | LoopOperation::QuickLoopCount => {
                    #[cfg(feature = "native")]
                    if let Some(leaving) = native::enter_at_loop(vm, pc, base, ticks) {
                        go_on_from!(leaving)
                    }
                    first_part!()
                }

                // ---- fused instructions
                LoopOperation::MulMulAdd => products!(Add),
                LoopOperation::MulMulSub => products!(Sub),
                LoopOperation::VectorRefMulAdd | LoopOperation::ArrayRefMulAdd => {
                    element_product_and_sum!()
                }
                LoopOperation::AddAdd => arithmetic_twice!(Add, Add, either),
                LoopOperation::AddMul => arithmetic_twice!(Add, Mul, either),
                LoopOperation::AddSubLeft => arithmetic_twice!(Add, Sub, left),
                LoopOperation::AddSubRight => arithmetic_twice!(Add, Sub, right),
                LoopOperation::SubAdd => arithmetic_twice!(Sub, Add, either),
                LoopOperation::SubMul => arithmetic_twice!(Sub, Mul, either),
                LoopOperation::SubSubLeft => arithmetic_twice!(Sub, Sub, left),
                LoopOperation::SubSubRight => arithmetic_twice!(Sub, Sub, right),
                LoopOperation::MulAdd => arithmetic_twice!(Mul, Add, either),
                LoopOperation::MulMul => arithmetic_twice!(Mul, Mul, either),
                LoopOperation::MulSubLeft => arithmetic_twice!(Mul, Sub, left),
                LoopOperation::MulSubRight => arithmetic_twice!(Mul, Sub, right),
                LoopOperation::AddIntDiv => {
                    let second = loaded_word_at(pc.add(1));
                    let (addend, dividend) = (base.add(word.b()), base.add(second.b()));
                    if Value::both_windowed_doubles(*addend, *dividend) {
                        let sum = double::load(addend) + f64::from(word.signed_c());
                        if double::store(base.add(word.a()), sum) {
                            if double::store(base.add(second.a()), double::load(dividend) / sum) {
                                next!(2);
                            }
                            next!(1, 1);
                        }
                    }
                    first_part!()
                }
                LoopOperation::AddIntMul => add_int!({
                    next_part!();
                    multiply!()
                }),
                LoopOperation::VectorRefAdd | LoopOperation::ArrayRefAdd => element_and!(Add, either),
                LoopOperation::VectorRefMul | LoopOperation::ArrayRefMul => element_and!(Mul, either),
                LoopOperation::VectorRefSubLeft | LoopOperation::ArrayRefSubLeft => {
                    element_and!(Sub, left)
                }
                LoopOperation::VectorRefSubRight | LoopOperation::ArrayRefSubRight => {
                    element_and!(Sub, right)
                }
                LoopOperation::LoadConstAdd => load_and!(*k.add(word.d()), Add),
                LoopOperation::LoadConstSub => load_and!(*k.add(word.d()), Sub),
                LoopOperation::LoadConstMul => load_and!(*k.add(word.d()), Mul),
                LoopOperation::LoadConstMod => load_and!(*k.add(word.d()), Mod),
                LoopOperation::LoadIntMul => load_and!(Value::small(word.signed_d()), Mul),
                LoopOperation::LoadIntMod => load_and!(Value::small(word.signed_d()), Mod),
                LoopOperation::MoveMove => {
                    set!(word.a(), get!(word.b()));
                    next_part!();
                    set!(word.a(), get!(word.b()));
                    next!(1)
                }
                LoopOperation::MoveLoop => {
                    set!(word.a(), get!(word.b()));
                    next_part!();
                    tick!();
                    jump!(1, word.signed_e() as isize)
                }
                LoopOperation::AddIntMove => add_int!({
                    next_part!();
                    set!(word.a(), get!(word.b()));
                    next!(1)
                }),
                LoopOperation::CarCdr => {
                    car!();
                    next_part!();
                    cdr!();
                    next!(1)
                }
                LoopOperation::CarJumpNumEq => {
                    car!();
                    next_part!();
                    jump_compare!(JumpNumEq, ==)
                }
                LoopOperation::CarAdd => {
                    car!();
                    next_part!();
                    part!(Add)
                }
                LoopOperation::CarSub => {
                    car!();
                    next_part!();
                    part!(Sub)
                }
                LoopOperation::CdrAddInt => {
                    cdr!();
                    next_part!();
                    add_int!(next!(1))
                }
                LoopOperation::MoveCallGlobal => {
                    set!(word.a(), get!(word.b()));
                    next_part!();
                    call_global!()
                }
                LoopOperation::MoveCallSelf => {
                    set!(word.a(), get!(word.b()));
                    next_part!();
                    call_self!()
                }
                LoopOperation::AddIntCallSelf => add_int!({
                    next_part!();
                    call_self!()
                }),
                LoopOperation::AddReturn => {
                    let (x, y) = (get!(word.b()), get!(word.c()));
                    if Value::both_fixnums(x, y) {
                        let (sum, overflow) = on_fixnums!(Add, x, y);
                        if !overflow {
                            set!(word.a(), Value::from_bits(sum as u64));
                            next_part!();
                            return_value!(get!(word.a()))
                        }
                    }
                    first_part!()
                }
            }
        }
    };
    // SAFETY: the loop stands at `pc` in the frame at `base`.
    unsafe {
        vm.cpu.set_pc(pc);
        vm.cpu.set_base(base);
    }
    vm.cpu.ticks = ticks;
    signal
}

/// Returns whether `value` is an instance of just this class, not of a subclass.
#[inline(always)]
unsafe fn is_instance_of_exactly(value: Value, class: Value) -> bool {
    // SAFETY: an object's value is the address of a live header; in a structure its class follows.
    value.is_object()
        && unsafe {
            (*value.object_ptr()).kind == Kind::Structure
                && (*value.object_ptr().cast::<StructureObject>()).class == class
        }
}
