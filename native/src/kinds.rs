//! The kinds of registers before each instruction: which hold fixnums, and which hold doubles without a box.
//!
//! A data flow over all paths finds them. It begins with the assumption that a path not followed yet agrees
//! with everything, so a variable of a loop that begins as a double and stays one is known as a double
//! throughout. The translation relies on the result: where an operation gives another kind, the machine code
//! is left, at the instruction or behind it. An entry at a loop instruction tests the kinds of the registers
//! that are used from there on.
//!
//! The kind of a parameter, of a call's result and of a part of an object is unknown. If the register held a
//! double when the machine code was asked for, the guess is that it will again; the instruction tests it.
//!
//! A computed double stays in a register of the processor, and its place in the stack is not written: it is
//! spilled only where the slot may be read (N3). Where paths meet, all registers that can stay unspilled do.

use esl_bytecode::builtin::Builtin;
use esl_bytecode::opcode::{Instr, RegisterAccess};
use esl_bytecode::operand::Want;
use esl_heap::Value;

use crate::flow::{FlowStep, FrameChange, NativeFlow};
use crate::maker::NativeSource;
use crate::places::RegisterBits;

/// The known kind of the contents of a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// Nothing.
    Nothing,
    /// It is a fixnum.
    Fixnum,
    /// It is a finite double without a box.
    Double,
    /// It is not read from there on, and on some path there it is an unspilled double. On the others, the
    /// register of the processor has a mark.
    Spent,
}

impl Known {
    /// Returns what is known of a value.
    pub fn of(value: Value) -> Known {
        match (value.as_fixnum(), value.as_double()) {
            (Some(_), _) => Known::Fixnum,
            (_, Some(double)) if double.is_finite() => Known::Double,
            _ => Known::Nothing,
        }
    }
}

/// The known kinds before each word of a function at which an instruction begins.
#[derive(Debug)]
pub(crate) struct NativeKinds {
    before: Vec<Option<Box<[Known]>>>,
    /// RegisterBits that are read before they are written, from there on.
    live: Vec<RegisterBits>,
    /// Registers that may be unspilled there.
    unspilled: Vec<RegisterBits>,
    /// The guessed kinds of registers.
    guesses: Vec<Known>,
    /// Whether doubles are told from other values at all.
    tells_doubles: bool,
}

impl NativeKinds {
    /// Follows all paths through a function.
    pub(crate) fn of(flow: &NativeFlow<'_>, source: &NativeSource) -> NativeKinds {
        let mut guesses = source.guesses.clone();
        guesses.resize(flow.registers, Known::Nothing);
        let mut kinds = NativeKinds {
            before: vec![None; flow.steps.len()],
            live: vec![RegisterBits::NONE; flow.steps.len()],
            unspilled: vec![RegisterBits::NONE; flow.steps.len()],
            guesses,
            tells_doubles: !source.guesses.is_empty(),
        };
        kinds.find_live(flow);
        kinds.follow(flow);
        kinds.find_unspilled(flow);
        kinds
    }

    /// Returns whether doubles are told from other values, which takes guesses.
    pub(crate) fn tells_doubles(&self) -> bool {
        self.tells_doubles
    }

    /// Returns what is known of a constant.
    pub(crate) fn of_constant(&self, constant: Option<&Value>) -> Known {
        match constant.map_or(Known::Nothing, |&value| Known::of(value)) {
            Known::Double if !self.tells_doubles => Known::Nothing,
            known => known,
        }
    }

    /// Returns the register that an instruction writes, if that is guessed to hold a double then.
    pub(crate) fn guess(&self, step: &FlowStep, before: &[Known]) -> Option<u8> {
        let of = |register: u8| before[usize::from(register)];
        let is_unknown = |left: u8, right: u8| (of(left), of(right)) != (Known::Fixnum, Known::Fixnum);
        let is_guessed = |register: u8| self.guesses[usize::from(register)] == Known::Double;
        match step.change {
            FrameChange::None => {}
            FrameChange::Enter { .. } => return None,
            FrameChange::Return { to } => {
                let value = returned(&step.instr).map_or(Known::Nothing, of);
                return (value == Known::Nothing && is_guessed(to)).then_some(to);
            }
            FrameChange::Call { to, .. } => return is_guessed(to).then_some(to),
        }
        let dst = match step.instr {
            Instr::Add { dst, left, right }
            | Instr::Sub { dst, left, right }
            | Instr::Mul { dst, left, right }
            | Instr::Div { dst, left, right }
                if is_unknown(left.0, right.0) =>
            {
                dst.0
            }
            Instr::VectorRef { dst, .. }
            | Instr::VectorRefInt { dst, .. }
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
        is_guessed(dst).then_some(dst)
    }

    /// Returns what is known before the instruction at a word that can be reached.
    pub(crate) fn before(&self, at: usize) -> &[Known] {
        self.before[at].as_deref().unwrap_or_default()
    }

    /// Returns what is known before each word that can be reached, of the registers that may be read from
    /// there on.
    pub(crate) fn into_said(mut self) -> Vec<Option<Box<[Known]>>> {
        for (known, &live) in self.before.iter_mut().zip(&self.live) {
            for (register, known) in known.iter_mut().flatten().enumerate() {
                if !live.contains(register) {
                    *known = Known::Nothing;
                }
            }
        }
        self.before
    }

    /// Returns whether a register may be read from the instruction at a word on.
    pub(crate) fn is_live(&self, at: usize, register: usize) -> bool {
        self.live[at].contains(register)
    }

    /// Returns the registers that may be unspilled before the instruction at a word.
    pub(crate) fn unspilled(&self, at: usize) -> RegisterBits {
        self.unspilled[at]
    }

    /// Returns whether doubles are unspilled anywhere.
    pub(crate) fn keeps_back(&self) -> bool {
        self.unspilled.iter().any(|&registers| registers != RegisterBits::NONE)
    }

    fn follow(&mut self, flow: &NativeFlow<'_>) {
        // A register that is read before it is written is a parameter.
        let entry = (0..flow.registers)
            .map(|register| if self.is_live(0, register) { self.guesses[register] } else { Known::Nothing });
        let entry: Box<[Known]> = entry.collect();
        self.before[0] = Some(entry);
        let mut open = vec![0];
        // A loop instruction that no path leads to is an entry all the same.
        let mut entries = flow.loops.clone();
        loop {
            let Some(at) = open.pop() else {
                let Some(at) = entries.pop() else { break };
                if self.before[at].is_none() {
                    self.before[at] = Some(vec![Known::Nothing; flow.registers].into());
                    open.push(at);
                }
                continue;
            };
            let (Some(step), Some(mut kinds)) = (&flow.steps[at], self.before[at].clone()) else { continue };
            self.apply(flow, step, &mut kinds);
            for to in step.successors() {
                if self.meet(flow, to, &kinds) {
                    open.push(to);
                }
            }
        }
    }

    /// Takes away what is not known on another path to a word; returns whether that changed anything.
    fn meet(&mut self, flow: &NativeFlow<'_>, to: usize, kinds: &[Known]) -> bool {
        let live = self.live[to];
        // With one predecessor, earlier guesses are invalid: a guess depends on kinds that are unknown.
        let has_one_predecessor = flow.steps[to].as_ref().is_some_and(|step| !step.is_target);
        if has_one_predecessor && self.before[to].as_deref() != Some(kinds) {
            self.before[to] = None;
        }
        let Some(known) = &mut self.before[to] else {
            self.before[to] = Some(kinds.into());
            return true;
        };
        let mut has_changed = false;
        for (register, (known, &kind)) in known.iter_mut().zip(kinds).enumerate() {
            if *known == kind {
                continue;
            }
            let is_kept = |known| matches!(known, Known::Double | Known::Spent);
            let met = if (is_kept(*known) || is_kept(kind)) && !live.contains(register) {
                Known::Spent
            } else {
                Known::Nothing
            };
            has_changed |= met != *known;
            *known = met;
        }
        has_changed
    }

    /// Follows all paths once more: a register is unspilled if it may be on one of them.
    fn find_unspilled(&mut self, flow: &NativeFlow<'_>) {
        let mut has_changed = true;
        while has_changed {
            has_changed = false;
            for (at, step) in flow.steps.iter().enumerate() {
                let (Some(step), Some(mut kinds)) = (step, self.before[at].clone()) else { continue };
                let mut unspilled = self.unspilled[at];
                if let FrameChange::Enter { window, count } = step.change {
                    unspilled = unspilled.without(dropped(window, count));
                } else if let FrameChange::Call { .. } = step.change {
                    unspilled = RegisterBits::NONE;
                } else if window_of(&step.instr).is_some() && !is_root(&step.instr, &kinds) {
                    unspilled = RegisterBits::NONE;
                }
                step.instr.visit_registers(|access| {
                    if let RegisterAccess::Write { first, count } = access {
                        unspilled.remove_range(usize::from(first), usize::from(count));
                    }
                });
                self.apply(flow, step, &mut kinds);
                if let FrameChange::Return { to } = step.change {
                    unspilled = unspilled.without(RegisterBits::all_from(to));
                }
                if let Some(dst) = computed(step)
                    && kinds[usize::from(dst)] == Known::Double
                {
                    unspilled.insert(usize::from(dst));
                }
                for to in step.successors() {
                    let mut there = unspilled;
                    for (register, known) in self.before(to).iter().enumerate() {
                        if !matches!(known, Known::Double | Known::Spent) {
                            there.remove(register);
                        }
                    }
                    has_changed |= self.unspilled[to].unite(there);
                }
            }
        }
    }

    fn find_live(&mut self, flow: &NativeFlow<'_>) {
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

    fn live_before(&self, step: &FlowStep) -> RegisterBits {
        let mut live = RegisterBits::NONE;
        for to in step.successors() {
            live.unite(self.live[to]);
        }
        match step.change {
            FrameChange::None => {}
            FrameChange::Enter { window, count } => return live.without(dropped(window, count)),
            FrameChange::Return { to } => live = live.without(RegisterBits::all_from(to)),
            FrameChange::Call { to, count } => {
                live = live.without(RegisterBits::all_from(to));
                live.insert_range(usize::from(to) + 2, usize::from(count));
                return live;
            }
        }
        step.instr.visit_registers(|access| {
            if let RegisterAccess::Write { first, count } = access {
                live.remove_range(usize::from(first), usize::from(count));
            }
        });
        step.instr.visit_registers(|access| {
            if let RegisterAccess::Read { first, count } = access {
                live.insert_range(usize::from(first), usize::from(count));
            }
        });
        if let Some((window, count)) = window_of(&step.instr) {
            live.insert_range(usize::from(window), usize::from(count) + 2);
        }
        live
    }

    /// Makes what is known before an instruction what is known behind it.
    fn apply(&self, flow: &NativeFlow<'_>, step: &FlowStep, kinds: &mut [Known]) {
        let (instr, guess) = (&step.instr, self.guess(step, kinds));
        match step.change {
            FrameChange::None => {}
            FrameChange::Enter { window, count } => {
                forget_all(kinds, dropped(window, count));
                return;
            }
            FrameChange::Return { to } => {
                let value = returned(instr).map_or(Known::Nothing, |register| kinds[usize::from(register)]);
                forget_all(kinds, RegisterBits::all_from(to));
                kinds[usize::from(to)] = if guess == Some(to) { Known::Double } else { value };
                return;
            }
            FrameChange::Call { to, .. } => {
                forget_all(kinds, RegisterBits::all_from(to));
                if guess == Some(to) {
                    kinds[usize::from(to)] = Known::Double;
                }
                return;
            }
        }
        if let Some((window, _)) = window_of(instr)
            && is_root(instr, kinds)
        {
            kinds[usize::from(window)] = Known::Double;
            return;
        }
        let constants = &flow.frames[step.frame].source.constants;
        apply(instr, kinds, |index| self.of_constant(constants.get(index)));
        if let Some(register) = guess {
            kinds[usize::from(register)] = Known::Double;
        }
    }
}

/// Returns the register that an instruction computes, if it is one that keeps a double back.
fn computed(step: &FlowStep) -> Option<u8> {
    match step.instr {
        Instr::Return { .. } | Instr::ReturnValues { .. } => match step.change {
            FrameChange::Return { to } => returned(&step.instr).map(|_| to),
            _ => None,
        },
        Instr::Move { dst, .. }
        | Instr::LoadConst { dst, .. }
        | Instr::Add { dst, .. }
        | Instr::Sub { dst, .. }
        | Instr::Mul { dst, .. }
        | Instr::Div { dst, .. }
        | Instr::AddInt { dst, .. }
        | Instr::VectorRef { dst, .. }
        | Instr::VectorRefInt { dst, .. } => Some(dst.0),
        Instr::CallBuiltin { window, builtin, .. } if builtin.0 == Builtin::Sqrt.number() => Some(window.0),
        _ => None,
    }
}

/// Returns whether an instruction takes the square root of what is known to be a double.
pub(crate) fn is_root(instr: &Instr, before: &[Known]) -> bool {
    match *instr {
        Instr::CallBuiltin { window, count, want, builtin } => {
            builtin.0 == Builtin::Sqrt.number()
                && (count.0, want) == (1, Want::ONE)
                && before[usize::from(window.0) + 2] == Known::Double
        }
        _ => false,
    }
}

/// Returns the register that holds the only value that an instruction returns.
pub(crate) fn returned(instr: &Instr) -> Option<u8> {
    match *instr {
        Instr::Return { src } => Some(src.0),
        Instr::ReturnValues { first, count } if count.0 == 1 => Some(first.0),
        _ => None,
    }
}

/// Returns the registers that a call of an inlined function gives up: all from its window on but the
/// arguments.
pub(crate) fn dropped(window: u8, count: u8) -> RegisterBits {
    let mut dropped = RegisterBits::all_from(window);
    dropped.remove_range(usize::from(window) + 2, usize::from(count));
    dropped
}

fn forget_all(kinds: &mut [Known], registers: RegisterBits) {
    for (register, known) in kinds.iter_mut().enumerate() {
        if registers.contains(register) {
            *known = Known::Nothing;
        }
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

/// Makes what is known before an instruction what is known behind it, guesses left out.
fn apply(instr: &Instr, kinds: &mut [Known], of_constant: impl Fn(usize) -> Known) {
    use Known::{Fixnum, Nothing, Spent};
    let of = |register: u8| match kinds[usize::from(register)] {
        Spent => Nothing,
        known => known,
    };
    let result = match *instr {
        Instr::Move { dst, src } => Some((dst.0, of(src.0))),
        Instr::LoadInt { dst, .. } => Some((dst.0, Fixnum)),
        Instr::LoadConst { dst, constant } => Some((dst.0, of_constant(usize::from(constant.0)))),
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
        // A value that is not a fixnum leaves the machine code.
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
