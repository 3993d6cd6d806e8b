//! What is known of registers before each instruction: which hold fixnums, and which hold doubles without a
//! box.
//!
//! It is found by following all ways until nothing changes, from the assumption that a way not followed yet
//! says nothing against it. So a variable of a loop that begins as a double and stays one is known to be one
//! all the time. The translation keeps what is said here: a result that is of another kind leads out of the
//! machine code, at the instruction or behind it. Where machine code is entered at a loop instruction, it
//! tests what is said of the registers that are used from there on.
//!
//! Nothing tells what comes from an object or a call, or what a parameter is. If the register held a double
//! when the machine code was asked for, the guess is that it is one again; this is tested at the instruction.

use esl_bytecode::opcode::{Instr, RegisterAccess};
use esl_bytecode::operand::Want;
use esl_heap::Value;

use crate::flow::{FlowStep, NativeFlow};
use crate::maker::NativeSource;

/// What is known of the content of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// Nothing.
    Nothing,
    /// It is a fixnum.
    Fixnum,
    /// It is a double without a box.
    Double,
}

impl Known {
    /// Returns what is known of a value.
    pub fn of(value: Value) -> Known {
        match (value.as_fixnum(), value.as_double()) {
            (Some(_), _) => Known::Fixnum,
            (_, Some(_)) => Known::Double,
            _ => Known::Nothing,
        }
    }
}

/// A set of registers.
type ReadRegisters = [u64; 4];

/// What is known before each word of a function at which an instruction begins.
#[derive(Debug)]
pub(crate) struct NativeKinds {
    before: Vec<Option<Box<[Known]>>>,
    /// Registers that are read before they are written, from there on.
    live: Vec<ReadRegisters>,
    /// Registers that are guessed to hold doubles.
    guesses: Vec<bool>,
}

impl NativeKinds {
    /// Follows all ways through a function.
    pub(crate) fn of(flow: &NativeFlow, source: &NativeSource) -> NativeKinds {
        let mut guesses: Vec<bool> = source.guesses.iter().map(|&guess| guess == Known::Double).collect();
        guesses.resize(source.registers, false);
        let mut kinds = NativeKinds {
            before: vec![None; flow.steps.len()],
            live: vec![[0; 4]; flow.steps.len()],
            guesses,
        };
        kinds.find_live(flow);
        kinds.follow(flow, source.registers, &source.constants);
        kinds
    }

    /// Returns the register that an instruction writes, if that is guessed to hold a double then.
    pub(crate) fn guess(&self, instr: &Instr, before: &[Known]) -> Option<u8> {
        let is_unknown = |left: u8, right: u8| {
            let of = |register: u8| before[usize::from(register)];
            (of(left), of(right)) != (Known::Fixnum, Known::Fixnum)
        };
        let dst = match *instr {
            Instr::Add { dst, left, right }
            | Instr::Sub { dst, left, right }
            | Instr::Mul { dst, left, right }
            | Instr::Div { dst, left, right }
                if is_unknown(left.0, right.0) =>
            {
                dst.0
            }
            Instr::VectorRef { dst, .. }
            | Instr::ArrayRef { dst, .. }
            | Instr::Slot { dst, .. }
            | Instr::Car { dst, .. }
            | Instr::BoxRef { dst, .. }
            | Instr::CaptureRef { dst, .. }
            | Instr::CaptureBoxRef { dst, .. }
            | Instr::SymbolValue { dst, .. } => dst.0,
            Instr::Call { window, want, .. }
            | Instr::CallGlobal { window, want, .. }
            | Instr::CallSelf { window, want, .. }
            | Instr::CallBuiltin { window, want, .. }
                if want == Want::ONE =>
            {
                window.0
            }
            _ => return None,
        };
        self.guesses[usize::from(dst)].then_some(dst)
    }

    /// Returns what is known before the instruction at a word that can be reached.
    pub(crate) fn before(&self, at: usize) -> &[Known] {
        self.before[at].as_deref().unwrap_or_default()
    }

    /// Returns whether a register may be read from the instruction at a word on.
    pub(crate) fn is_live(&self, at: usize, register: usize) -> bool {
        self.live[at][register / 64] >> (register % 64) & 1 != 0
    }

    fn follow(&mut self, flow: &NativeFlow, registers: usize, constants: &[Value]) {
        // What is read before it is written is a parameter.
        let entry = (0..registers).map(|register| {
            let is_guessed = self.guesses[register] && self.is_live(0, register);
            if is_guessed { Known::Double } else { Known::Nothing }
        });
        let entry: Box<[Known]> = entry.collect();
        self.before[0] = Some(entry);
        let mut open = vec![0];
        // A loop instruction that no way leads to is an entry all the same.
        let mut entries = flow.loops.clone();
        loop {
            let Some(at) = open.pop() else {
                let Some(at) = entries.pop() else { break };
                if self.before[at].is_none() {
                    self.before[at] = Some(vec![Known::Nothing; registers].into());
                    open.push(at);
                }
                continue;
            };
            let (Some(step), Some(mut kinds)) = (&flow.steps[at], self.before[at].clone()) else { continue };
            let guess = self.guess(&step.instr, &kinds);
            apply(&step.instr, &mut kinds, constants);
            if let Some(register) = guess {
                kinds[usize::from(register)] = Known::Double;
            }
            let next = step.instr.opcode().falls_through().then_some(step.next);
            for to in next.into_iter().chain(step.target) {
                if self.meet(to, &kinds) {
                    open.push(to);
                }
            }
        }
    }

    /// Takes away what is not known on another way to a word; returns whether that changed anything.
    fn meet(&mut self, to: usize, kinds: &[Known]) -> bool {
        let Some(known) = &mut self.before[to] else {
            self.before[to] = Some(kinds.into());
            return true;
        };
        let mut has_changed = false;
        for (known, &kind) in known.iter_mut().zip(kinds) {
            if *known != Known::Nothing && *known != kind {
                *known = Known::Nothing;
                has_changed = true;
            }
        }
        has_changed
    }

    fn find_live(&mut self, flow: &NativeFlow) {
        let mut has_changed = true;
        while has_changed {
            has_changed = false;
            for (at, step) in flow.steps.iter().enumerate().rev() {
                let Some(step) = step else { continue };
                let live = self.live_before(step);
                has_changed |= live != self.live[at];
                self.live[at] = live;
            }
        }
    }

    fn live_before(&self, step: &FlowStep) -> ReadRegisters {
        let mut live = [0; 4];
        let next = step.instr.opcode().falls_through().then_some(step.next);
        for to in next.into_iter().chain(step.target) {
            for (word, more) in live.iter_mut().zip(self.live[to]) {
                *word |= more;
            }
        }
        let registers = |live: &mut ReadRegisters, first: u8, count: u8, are_in: bool| {
            for register in usize::from(first)..usize::from(first) + usize::from(count) {
                if let Some(word) = live.get_mut(register / 64) {
                    let bit = 1 << (register % 64);
                    *word = if are_in { *word | bit } else { *word & !bit };
                }
            }
        };
        step.instr.visit_registers(|access| {
            if let RegisterAccess::Write { first, count } = access {
                registers(&mut live, first, count, false);
            }
        });
        step.instr.visit_registers(|access| {
            if let RegisterAccess::Read { first, count } = access {
                registers(&mut live, first, count, true);
            }
        });
        if let Some((window, count)) = window_of(&step.instr) {
            registers(&mut live, window, count.saturating_add(2), true);
        }
        live
    }
}

/// Returns the window of a call, and the number of arguments.
fn window_of(instr: &Instr) -> Option<(u8, u8)> {
    match *instr {
        Instr::Call { window, count, .. }
        | Instr::CallGlobal { window, count, .. }
        | Instr::CallSelf { window, count, .. }
        | Instr::CallBuiltin { window, count, .. }
        | Instr::Apply { window, count, .. }
        | Instr::TailApply { window, count, .. }
        | Instr::TailCall { window, count, .. }
        | Instr::TailCallGlobal { window, count, .. }
        | Instr::TailCallBuiltin { window, count, .. } => Some((window.0, count.0)),
        _ => None,
    }
}

/// Makes what is known before an instruction what is known behind it.
fn apply(instr: &Instr, kinds: &mut [Known], constants: &[Value]) {
    use Known::{Fixnum, Nothing};
    let of = |register: u8| kinds[usize::from(register)];
    let result = match *instr {
        Instr::Move { dst, src } => Some((dst.0, of(src.0))),
        Instr::LoadInt { dst, .. } => Some((dst.0, Fixnum)),
        Instr::LoadConst { dst, constant } => {
            Some((dst.0, constants.get(usize::from(constant.0)).map_or(Nothing, |&value| Known::of(value))))
        }
        Instr::Add { dst, left, right }
        | Instr::Sub { dst, left, right }
        | Instr::Mul { dst, left, right } => Some((dst.0, of_number(of(left.0), of(right.0), Fixnum))),
        Instr::Div { dst, left, right } => Some((dst.0, of_number(of(left.0), of(right.0), Nothing))),
        Instr::AddInt { dst, left, .. } => Some((dst.0, of(left.0))),
        Instr::Floor { dst, left, right }
        | Instr::Truncate { dst, left, right }
        | Instr::Mod { dst, left, right }
        | Instr::Rem { dst, left, right }
        | Instr::LogAnd { dst, left, right }
        | Instr::LogIor { dst, left, right }
        | Instr::LogXor { dst, left, right }
        | Instr::Ash { dst, left, right } => {
            let are_fixnums = (of(left.0), of(right.0)) == (Fixnum, Fixnum);
            Some((dst.0, if are_fixnums { Fixnum } else { Nothing }))
        }
        // What is no fixnum leads out of the machine code.
        Instr::LoopCount { counter, .. } if of(counter.0) == Fixnum => Some((counter.0, Fixnum)),
        _ => None,
    };
    match result {
        Some((dst, known)) => kinds[usize::from(dst)] = known,
        None => {
            instr.visit_registers(|access| {
                if let RegisterAccess::Write { first, count } = access {
                    forget(kinds, first, usize::from(count));
                }
            });
        }
    }
    if let Instr::LoopCount { counter, .. } = *instr
        && kinds[usize::from(counter.0)] != Fixnum
    {
        forget(kinds, counter.0, 1);
    }
    // The frame of a callee is there.
    if let Some((window, _)) = window_of(instr) {
        forget(kinds, window, usize::MAX);
    }
}

fn forget(kinds: &mut [Known], first: u8, count: usize) {
    for known in kinds.iter_mut().skip(usize::from(first)).take(count) {
        *known = Known::Nothing;
    }
}

/// Returns what is known of the result of an operation.
fn of_number(left: Known, right: Known, of_fixnums: Known) -> Known {
    match (left, right) {
        (Known::Fixnum, Known::Fixnum) => of_fixnums,
        (Known::Double, _) | (_, Known::Double) => Known::Double,
        _ => Known::Nothing,
    }
}
