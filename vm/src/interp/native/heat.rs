//! Which functions are hot: what runs at the ends of slices, and calls at which machine code was left.

use esl_bytecode::opcode::Opcode;
use smallvec::SmallVec;

use super::super::{aux_at, code_of, constant, word_at};
use super::make::{install_made, instructions, make};
use crate::heap::layout::{CodeObject, Kind, SymbolObject};
use crate::shape::Shape;
use crate::tier::Tier;
use crate::value::Value;
use crate::vm::Vm;

/// Ticks that a function has taken before machine code is made of it, for each word of its code. To make it
/// takes some 60 microseconds for each word, mostly on another processor; it saves some ten nanoseconds of
/// each tick.
const HOT_TICKS: u32 = 2500;

/// Fewest ticks of a hot function.
const LEAST_HOT_TICKS: u32 = 64_000;

/// Most ticks that a function is told to have taken because it was met once.
const MOST_TICKS_AT_ONCE: u32 = LEAST_HOT_TICKS / 2;

/// Ticks that leaving machine code at a call is counted as.
const TICKS_OF_EXIT: u32 = 250;

/// Frames that are looked at, from the running one on; each counts for half of the one that it has
/// called.
const FRAMES: usize = 4;

/// Returns what the instruction at `pc` calls, if it is a call of a global function or of a value.
///
/// # Safety
/// `pc` is the address of an instruction of the frame `base`.
pub(super) unsafe fn callee_at(pc: *const u32, base: *mut Value) -> Option<Value> {
    // SAFETY: V1, V3, V4: the operands of the instruction are there, and a constant is the symbol.
    unsafe {
        let word = word_at(pc);
        match word.opcode()? {
            Opcode::CallGlobal | Opcode::TailCallGlobal => {
                let symbol = constant(base, aux_at(pc) as usize).object_ptr().cast::<SymbolObject>();
                Some((*symbol).function)
            }
            Opcode::Call | Opcode::TailCall => Some(*base.add(word.a())),
            _ => None,
        }
    }
}

/// Returns how many ticks a function has taken when it is hot.
///
/// # Safety
/// `code` points to a Code of bytecode.
unsafe fn hot_ticks(code: *mut CodeObject) -> u32 {
    // SAFETY: the contract says that this is a live Code.
    let words = unsafe { instructions(code) }.len() as u32;
    words.saturating_mul(HOT_TICKS).max(LEAST_HOT_TICKS)
}

/// Counts a call at which machine code was left, and makes machine code of the callee if there were many.
/// The kinds of the present arguments are the guess for those of later calls.
///
/// # Safety
/// `pc` is the address of an instruction of the frame `base`.
#[cold]
#[inline(never)]
pub(super) unsafe fn note_call(vm: &mut Vm, pc: u64, base: u64) {
    let pc: *const u32 = std::ptr::with_exposed_provenance(pc as usize);
    let base: *mut Value = std::ptr::with_exposed_provenance_mut(base as usize);
    // SAFETY: V1, V3, V4: the operands of the instruction are there; the function of a symbol is a Function.
    unsafe {
        let word = word_at(pc);
        let Some(function) = callee_at(pc, base) else { return };
        if !function.is_object() || (*function.object_ptr()).kind != Kind::Function {
            return;
        }
        let code = code_of(function);
        if !Shape::is_bytecode((*code).spare[0]) {
            return;
        }
        // Where others than these are taken too, the registers get them in another order.
        let count = if (*code).arity == word.b() as u32 { word.b() } else { 0 };
        let warm = vm.compiled.heat.of(Value::from_object(code.cast()).bits());
        warm.see(std::slice::from_raw_parts(base.add(word.a() + 2), count));
        if warm.add(TICKS_OF_EXIT, hot_ticks(code)) {
            let guesses = warm.guesses();
            make(vm, code, guesses);
        }
    }
}

impl Vm {
    /// Notes which functions run at the end of a slice, and makes machine code of those that are hot;
    /// installs what was made. `is_overdrawn` says that a builtin took the last ticks, which machine code
    /// makes no faster.
    pub(in crate::interp) fn note_heat(&mut self, is_overdrawn: bool) {
        if self.compiled.tier == Tier::Interpreter {
            return;
        }
        install_made(&mut self.compiled);
        if is_overdrawn {
            return;
        }
        let ticks = (self.cpu.granted as u32).min(MOST_TICKS_AT_ONCE);
        let mut hot = SmallVec::<[*mut CodeObject; FRAMES]>::new();
        let mut heat = std::mem::take(&mut self.compiled.heat);
        for (depth, frame) in self.frames().take(FRAMES).enumerate() {
            // SAFETY: F2: the function of a frame is a Function.
            let code = unsafe { code_of(frame.function) };
            // SAFETY: F2: it keeps its code alive.
            unsafe {
                if (*code).nwords < 2 {
                    // A stub.
                    continue;
                }
                let warm = heat.of(Value::from_object(code.cast()).bits());
                warm.see(frame.registers());
                if warm.add(ticks >> depth, hot_ticks(code)) {
                    hot.push(code);
                }
            }
        }
        self.compiled.heat = heat;
        for code in hot {
            // SAFETY: F2: the function of the frame in which it was met keeps the code alive.
            unsafe {
                let guesses = self.compiled.heat.of(Value::from_object(code.cast()).bits()).guesses();
                make(self, code, guesses);
            }
        }
    }
}
