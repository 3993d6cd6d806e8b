//! Machine code beside the loop: entering it, what it asks of the machine, and making it.
//!
//! The contract is that of `esl_native` (N1 to N8). Machine code is entered where the loop meets the stub
//! that the entry word of compiled code leads to, or a loop instruction that was quickened. When it is left,
//! the loop goes on with the instruction at which it was left, as if it had run all before.
//!
//! The entry word of a Code leads to its first instruction, to the stub of its machine code, or to
//! [`MAKE_AT_ENTRY`]. Only the arms of the loop that make frames go by it; a task that stands at
//! the beginning of a function stands at the first instruction.

mod call;
mod heat;
mod make;
mod step;
mod table;

use std::ffi::c_void;
use std::mem::MaybeUninit;

use esl_native::abi::{EntryStub, NativeEntry, TAIL};
use esl_native::{
    AGAIN, GUESSED_WRONG, IN_PLACE, NativeContext, NativeReply, REDEFINED, RETURN_VALUES, RETURNED,
};

use super::{Signal, aux_at, code_of, constant, first_instruction, stubs, word_at};
use crate::fused::quicken_loop;
use crate::heap::layout::CodeObject;
use crate::heap::{Heap, Phase};
use crate::tier::{CompiledFunctions, LoopUse, Tier};
use crate::value::Value;
use crate::vm::Vm;

use heat::note_call;
pub(super) use make::make_at_entry;
use make::{instructions, make, uninstall};

/// Words of the stack that one entry may use, which bounds the native stack too: about 500 KB.
const WORDS_AT_ONCE: usize = 4096;

/// Entries at loop instructions after which their use is looked at.
const ENTRIES: u32 = 8192;

/// Ticks that each of them has to take on average, lest the interpreter run the loops alone: machine code
/// that is left at once costs more than it saves.
const LEAST_TICKS: u32 = 8;

/// Wrong guesses after which machine code is made without any.
const WRONG_GUESSES: u32 = 64;

/// The entry of code of which machine code is made at its first call.
pub(crate) static MAKE_AT_ENTRY: u32 = stubs::MAKE_AT_ENTRY as u32;

/// Why machine code was left.
pub(super) enum Left {
    /// The function has returned this.
    Returned(Value),
    /// The function returns the value list.
    Values,
    /// The loop goes on.
    Again,
    /// As in the loop.
    Signal(Signal),
}

/// Machine code that was left, and the registers of the loop.
pub(super) struct Leaving {
    pub(super) left: Left,
    pub(super) pc: *const u32,
    pub(super) base: *mut Value,
    pub(super) ticks: i32,
}

/// The data of helpers behind `NativeContext::machine`.
struct Caller {
    vm: *mut Vm,
    signal: Signal,
}

/// Runs the machine code behind the stub at `pc` in the frame at `base`.
///
/// # Safety
/// The frame at `base` is the running one, and the entry of its function's code leads to the stub.
pub(super) unsafe fn enter(vm: &mut Vm, pc: *const u32, base: *mut Value, ticks: i32) -> Leaving {
    // SAFETY: by the contract the stub is that of installed code, which stands as long as the code's entry
    // leads to it.
    unsafe {
        let stub = pc.cast::<EntryStub>();
        let entry = std::mem::transmute::<u64, NativeEntry>((*stub).address);
        run(vm, entry, 0, base, ticks)
    }
}

/// Runs the machine code of the running function from the loop instruction at `pc` on; `None` if there is
/// none.
///
/// # Safety
/// The frame at `base` is the running one, and `pc` is at a loop instruction of its function.
pub(super) unsafe fn enter_at_loop(
    vm: &mut Vm,
    pc: *const u32,
    base: *mut Value,
    ticks: i32,
) -> Option<Leaving> {
    // SAFETY: F2: the function of the frame keeps its code alive. Its entry leads to a stub if it is
    // compiled.
    unsafe {
        let code = code_of(*base.sub(2));
        if *(*code).entry != u32::from(stubs::NATIVE_ENTRY) {
            return None;
        }
        let number = (*(*code).entry.cast::<EntryStub>()).number as usize;
        let installed = vm.compiled.installed.get(number)?.as_ref()?;
        let word = pc.offset_from_unsigned(first_instruction(code));
        let place = installed.made.loops().binary_search(&word).ok()?;
        let entry = installed.made.entry();
        let leaving = run(vm, entry, place as u64 + 1, base, ticks);
        let is_auto = vm.compiled.tier == Tier::Auto;
        let installed = vm.compiled.installed.get_mut(number).and_then(Option::as_mut);
        let usage = installed.filter(|_| is_auto).and_then(|installed| installed.loops.get_mut(place));
        if let Some(usage) = usage {
            usage.entries += 1;
            let taken = ticks.saturating_sub(leaving.ticks).max(0) as u32;
            usage.ticks = usage.ticks.saturating_add(taken);
            if usage.entries == ENTRIES {
                let is_calm = usage.ticks < ENTRIES * LEAST_TICKS;
                *usage = LoopUse { is_calm, ..LoopUse::default() };
                if is_calm {
                    calm_loop(pc);
                }
            }
        }
        Some(leaving)
    }
}

/// Lets a loop instruction lead to machine code no more.
///
/// # Safety
/// `pc` is at a loop instruction of a Code.
#[cold]
unsafe fn calm_loop(pc: *const u32) {
    // SAFETY: by the contract this is a word of a code, and no reference to it exists.
    unsafe { *pc.cast_mut() = word_at(pc).0 };
}

/// Lets the loop instructions that lead no longer to machine code lead there again: what made it leave them
/// at once may have been a call of what has machine code now.
fn rouse_loops(compiled: &mut CompiledFunctions) {
    for installed in compiled.installed.iter_mut().flatten() {
        for (usage, &at) in installed.loops.iter_mut().zip(installed.made.loops()) {
            if !std::mem::take(&mut usage.is_calm) {
                continue;
            }
            // SAFETY: the word was made of the address of a code, which is there: else this had been given
            // back when all that is reached had been marked. No reference to its words exists.
            unsafe {
                let code = Value::from_bits(installed.order.code).object_ptr().cast::<CodeObject>();
                let words = instructions(code).len();
                let words = std::slice::from_raw_parts_mut(first_instruction(code).cast_mut(), words);
                quicken_loop(words, at);
            }
        }
    }
}

/// Runs machine code until it is left.
///
/// # Safety
/// N2: `entry` is that of the code of the function of the frame at `base`, which is the running one.
unsafe fn run(vm: &mut Vm, entry: NativeEntry, place: u64, base: *mut Value, ticks: i32) -> Leaving {
    let end = vm.cpu.stack_end();
    let limit = base.wrapping_add(WORDS_AT_ONCE).min(end);
    let is_marking = u32::from(vm.heap.phase() == Phase::Marking);
    let mut caller = Caller { vm: &raw mut *vm, signal: Signal::Next };
    let mut context = NativeContext {
        ticks,
        is_marking,
        limit: limit.expose_provenance() as u64,
        pc: 0,
        base: 0,
        outer: 0,
        value: 0,
        unspilled: [0; 4],
        doubles: [MaybeUninit::uninit(); 256],
        machine: (&raw mut caller).cast::<c_void>(),
        step: step::step,
        call_builtin: step::call_builtin,
        tail_builtin: step::tail_builtin,
        call_other: call::call_other,
        tail_call_other: call::tail_call_other,
        all_values: step::all_values,
        only_value: step::only_value,
        store: step::store,
        value_of: step::value_of,
        set_value_of: step::set_value_of,
        bind: step::bind,
        unbind: step::unbind,
        cons: step::cons,
        last_lookup: &raw mut vm.exchange.lookups.last,
        gc_due: vm.heap.gc_due_at(),
        charges: (&raw const vm.exchange.charges).cast(),
        value_of_key: table::value_of_key,
        set_value_of_key: table::set_value_of_key,
        add_to_value_of_key: table::add_to_value_of_key,
    };
    // SAFETY: N2, N7: by the contract; the machine is borrowed for as long, and only helpers use it. A tail
    // call has made the frame of the function whose machine code the reply names.
    let reply: NativeReply = unsafe {
        let context = &raw mut context;
        let mut reply = entry(context, base.cast(), place);
        while reply.status == TAIL {
            let callee = std::mem::transmute::<u64, NativeEntry>(reply.value);
            reply = callee(context, base.cast(), 0);
        }
        reply
    };
    if matches!(reply.status, AGAIN | GUESSED_WRONG | REDEFINED) {
        // SAFETY: N3, N4: it was left in that frame.
        unsafe {
            make_words(&mut context);
            debug_assert!(
                reply.status == GUESSED_WRONG || is_as_said(vm, &context),
                "left at an instruction without a side exit"
            );
        }
    }
    if reply.status == AGAIN && context.ticks > 0 && vm.compiled.tier == Tier::Auto {
        // SAFETY: N4: it was left at an instruction of that frame.
        unsafe { note_call(vm, context.pc, context.base) };
    }
    if reply.status == GUESSED_WRONG {
        // SAFETY: N4: it was left in that frame, whose function has machine code.
        unsafe { note_wrong_guess(vm, context.outer) };
    }
    if reply.status == REDEFINED {
        // SAFETY: N8: it was left at a call in that frame, and no machine code runs any more.
        unsafe { note_redefined(vm, &context) };
    }
    let left = match reply.status {
        // SAFETY: N3: a value of the program.
        RETURNED => Left::Returned(unsafe { Value::from_bits(reply.value) }),
        RETURN_VALUES => Left::Values,
        AGAIN | GUESSED_WRONG | REDEFINED => Left::Again,
        _ => Left::Signal(caller.signal),
    };
    Leaving {
        left,
        pc: std::ptr::with_exposed_provenance(context.pc as usize),
        base: std::ptr::with_exposed_provenance_mut(context.base as usize),
        ticks: context.ticks,
    }
}

/// Returns whether the registers of the frame in which machine code was left, and of those around it that it
/// made, are what its maker says of them there.
///
/// # Safety
/// Machine code was left as the context says.
unsafe fn is_as_said(vm: &Vm, context: &NativeContext) -> bool {
    let base: *mut Value = std::ptr::with_exposed_provenance_mut(context.base as usize);
    let outer: *mut Value = std::ptr::with_exposed_provenance_mut(context.outer as usize);
    // SAFETY: F2: the function of the frame keeps its code alive; an entry leads to an operation of the loop.
    // The frames have room up to the end of the topmost one.
    unsafe {
        let code = code_of(*outer.sub(2));
        if *(*code).entry != u32::from(stubs::NATIVE_ENTRY) {
            return false;
        }
        let number = (*(*code).entry.cast::<EntryStub>()).number as usize;
        let below = base.offset_from_unsigned(outer);
        let registers = std::slice::from_raw_parts(outer, below + (*code_of(*base.sub(2))).nregs as usize);
        let installed = vm.compiled.installed.get(number).and_then(Option::as_ref);
        installed.is_some_and(|installed| installed.made.may_be_left(context.pc, below, registers))
    }
}

/// Spills the doubles that machine code has saved: writes their words to the stack.
///
/// # Safety
/// Machine code was left, or has called the machine.
#[inline]
unsafe fn make_words(context: &mut NativeContext) {
    let base: *mut Value = std::ptr::with_exposed_provenance_mut(context.outer as usize);
    for (index, names) in context.unspilled.iter_mut().enumerate() {
        while *names != 0 {
            let register = index * 64 + names.trailing_zeros() as usize;
            *names &= *names - 1;
            // SAFETY: N3: machine code has written the bits of what it names, and the place is one of the
            // frame, or of those that it has made above it.
            unsafe {
                let bits = context.doubles[register].assume_init();
                if bits == IN_PLACE {
                    continue;
                }
                let double = Value::double(f64::from_bits(bits));
                debug_assert!(
                    double.is_some_and(|v| v.as_double().is_some_and(f64::is_finite)),
                    "{register}"
                );
                base.add(register).write(double.unwrap_or(Value::NAN));
            }
        }
    }
}

/// Counts a wrong guess, and has machine code without guesses made of the function if there were many.
///
/// # Safety
/// `base` is a frame of a function that has machine code.
#[cold]
#[inline(never)]
unsafe fn note_wrong_guess(vm: &mut Vm, base: u64) {
    let base: *mut Value = std::ptr::with_exposed_provenance_mut(base as usize);
    // SAFETY: F2: the function of the frame keeps its code alive, whose entry leads to a stub.
    unsafe {
        let code = code_of(*base.sub(2));
        if *(*code).entry != u32::from(stubs::NATIVE_ENTRY) {
            return;
        }
        let number = (*(*code).entry.cast::<EntryStub>()).number as usize;
        let Some(installed) = vm.compiled.installed.get_mut(number).and_then(Option::as_mut) else { return };
        installed.wrong += 1;
        if installed.wrong == WRONG_GUESSES && installed.order.has_guesses {
            make(vm, code, Vec::new());
        }
    }
}

/// Releases machine code in which a function was inlined that its symbol no longer has. New machine code
/// calls it.
///
/// # Safety
/// Machine code was left with [`REDEFINED`], as the context says.
#[cold]
#[inline(never)]
unsafe fn note_redefined(vm: &mut Vm, context: &NativeContext) {
    let pc: *const u32 = std::ptr::with_exposed_provenance(context.pc as usize);
    let base: *mut Value = std::ptr::with_exposed_provenance_mut(context.base as usize);
    let outer: *mut Value = std::ptr::with_exposed_provenance_mut(context.outer as usize);
    // SAFETY: N8: the instruction is the call of a global function in that frame. F2: the function of the
    // frame of the machine code keeps its code alive.
    unsafe {
        vm.compiled.redefined.insert(constant(base, aux_at(pc) as usize).bits());
        uninstall(&mut vm.compiled, code_of(*outer.sub(2)));
    }
}

impl Vm {
    /// Sets how functions run from now on. Existing machine code stays. It takes up to 512 KiB of the
    /// thread's stack.
    pub fn set_tier(&mut self, tier: Tier) {
        if cfg!(feature = "no-ticks") {
            return;
        }
        if self.config.snapshots && tier != Tier::Interpreter {
            // A snapshot would bring back code that leads to machine code given back since.
            self.compiled.report.refused = Some("the machine is made for snapshots".into());
            return;
        }
        self.compiled.tier = tier;
        // SAFETY: the operation there makes machine code of the code that is called, or lets it begin at its
        // first instruction.
        unsafe { self.heap.set_code_entry((tier == Tier::Native).then_some(&MAKE_AT_ENTRY)) };
    }

    /// Gives back the machine code of functions that nothing reaches. To be called when all that is reached
    /// is marked, and no machine code runs.
    pub(super) fn give_back_code(compiled: &mut CompiledFunctions, heap: &Heap) {
        // SAFETY: a word was made of the address of an object; whether that is marked is told by its address.
        let is_there = |word: u64| heap.is_marked(unsafe { Value::from_bits(word) });
        compiled.heat.forget_all(|word| !is_there(word));
        let are_there = |words: &[u64]| words.iter().all(|&word| is_there(word));
        compiled.asked.retain(|_, order| is_there(order.code) && are_there(&order.inlined));
        compiled.redefined.retain(|&symbol| is_there(symbol));
        for number in 0..compiled.installed.len() {
            let Some(installed) = &compiled.installed[number] else { continue };
            let (code, stands) = (installed.order.code, are_there(&installed.order.inlined));
            if !is_there(code) {
                compiled.report.bytes -= installed.made.bytes().next_multiple_of(4096);
                compiled.free.push(number as u32);
                compiled.installed[number] = None;
            } else if !stands {
                // SAFETY: the code is marked, so it is there.
                unsafe { uninstall(compiled, Value::from_bits(code).object_ptr().cast()) };
            }
        }
    }
}
