//! Liveness: the registers of a frame that may still be read from a given instruction on. Only these belong
//! to a state; the others hold remains of earlier work, and would make two states of one.
//!
//! The analysis is conservative: a register that may be read is always live. Some others are live, too: what
//! a landing of a control entry reads is live everywhere in its function.

use esl_bytecode::module::CaptureSource;
use esl_bytecode::opcode::{CallOperands, Instr, RegisterAccess};
use esl_bytecode::operand::{Role, Window};

use crate::heap::Heap;
use crate::shape::capture_source;
use crate::value::Value;

/// A set of registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LiveRegisters([u64; 4]);

impl LiveRegisters {
    pub(super) fn contains(self, register: usize) -> bool {
        self.0[register >> 6 & 3] >> (register & 63) & 1 != 0
    }

    fn insert(&mut self, register: usize) {
        self.0[register >> 6 & 3] |= 1 << (register & 63);
    }

    fn insert_range(&mut self, first: u8, count: u8) {
        (usize::from(first)..(usize::from(first) + usize::from(count)).min(256))
            .for_each(|register| self.insert(register));
    }

    pub(super) fn with(self, other: LiveRegisters) -> LiveRegisters {
        LiveRegisters(std::array::from_fn(|word| self.0[word] | other.0[word]))
    }

    fn without(self, other: LiveRegisters) -> LiveRegisters {
        LiveRegisters(std::array::from_fn(|word| self.0[word] & !other.0[word]))
    }
}

/// An instruction's effect on liveness.
struct LiveStep {
    at: usize,
    reads: LiveRegisters,
    writes: LiveRegisters,
    /// Words at which control may continue.
    next: [Option<usize>; 2],
    /// Landing of the control entry that it pushes.
    landing: Option<usize>,
}

/// The live registers for each word at which an instruction begins.
#[derive(Debug, Default)]
pub(super) struct Live(Vec<LiveRegisters>);

impl Live {
    /// Analyses a function with these words and constants.
    pub(super) fn of(heap: &Heap, words: &[u32], constants: &[Value]) -> Live {
        let mut steps = Vec::new();
        let mut at = 0;
        while let Some(instruction) = Instr::decode(words, at) {
            steps.push(step(heap, constants, at, instruction));
            at += instruction.opcode().words();
        }
        let mut live = vec![LiveRegisters::default(); words.len() + 1];
        let mut landed = LiveRegisters::default();
        let mut has_changed = true;
        while has_changed {
            has_changed = false;
            for step in steps.iter().rev() {
                let after = step.next.iter().flatten();
                let after =
                    after.fold(landed, |all, &at| all.with(live.get(at).copied().unwrap_or_default()));
                let before = after.without(step.writes).with(step.reads).with(landed);
                has_changed |= before != live[step.at];
                live[step.at] = before;
                if let Some(landing) = step.landing.and_then(|at| live.get(at)) {
                    landed = landed.with(*landing);
                }
            }
        }
        Live(live)
    }

    /// Returns the registers that may be read from word `at` on.
    pub(super) fn at(&self, at: usize) -> LiveRegisters {
        self.0.get(at).copied().unwrap_or_default()
    }
}

fn step(heap: &Heap, constants: &[Value], at: usize, instruction: Instr) -> LiveStep {
    let after = at + instruction.opcode().words();
    let (mut reads, mut writes) = (LiveRegisters::default(), LiveRegisters::default());
    instruction.visit_registers(|access| match access {
        RegisterAccess::Read { first, count } => reads.insert_range(first, count),
        RegisterAccess::Write { first, count } => writes.insert_range(first, count),
    });
    if let Some(CallOperands { callee, window: Window(window), count, .. }) = instruction.call() {
        if callee.is_in_window() {
            reads.insert(usize::from(window));
        }
        reads.insert_range(window.saturating_add(2), count.0);
        writes.insert_range(window, u8::MAX);
    }
    let (mut jump, mut landing) = (None, None);
    instruction.visit_operands(|role| match role {
        Role::Forward(by) | Role::Backward(by) => jump = after.checked_add_signed(by as isize),
        Role::Landing(by) => landing = after.checked_add_signed(by as isize),
        Role::FunctionConstant(index) => {
            for register in captured_registers(heap, constants.get(index as usize).copied()) {
                reads.insert(register);
            }
        }
        _ => {}
    });
    let falls_through = instruction.opcode().falls_through();
    LiveStep { at, reads, writes, next: [falls_through.then_some(after), jump], landing }
}

/// Returns the registers from which the captures of a closure are taken.
fn captured_registers(heap: &Heap, code: Option<Value>) -> Vec<usize> {
    let Some((code, layout)) = code.and_then(|code| Some((code, heap.code(code)?))) else {
        return Vec::new();
    };
    let words = heap.code_words(code).unwrap_or_default();
    let captures = words.len().saturating_sub(layout.spare[1] as usize);
    let register = |&word: &u32| match capture_source(word) {
        CaptureSource::Register(register) => Some(usize::from(register)),
        CaptureSource::Capture(_) | CaptureSource::Later => None,
    };
    words[captures..].iter().filter_map(register).collect()
}
